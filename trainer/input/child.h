/* SPDX-License-Identifier: MIT
 *
 * A child process whose standard output we read: no shell, standard input is
 * empty, standard error goes to an unnamed file from which the last line can
 * be quoted.
 */
#ifndef SAGA_CHILD_H
#define SAGA_CHILD_H

#include "capture.h"

#include <sys/types.h>

/* Seconds without output after which a child is given up: counting the packets
 * of a long video takes minutes. */
enum { SAGA_CHILD_PATIENCE = 300 };

typedef struct saga_child {
    pid_t pid;      /* 0: not running */
    int patience;   /* seconds; saga_child_start sets SAGA_CHILD_PATIENCE */
    bool hung;      /* it was given up */
    int out, log;   /* file descriptors; -1: none */
    char tail[256]; /* last line of standard error, after saga_child_end */
} saga_child;

/* argv[0] is looked up in PATH; argv ends with NULL. */
bool saga_child_start(saga_child *child, const char *const *argv,
                      saga_error *error);
/* Reads until n bytes are there or the output ends; returns how many. A child
 * that says nothing for too long is killed. */
size_t saga_child_read(saga_child *child, void *buffer, size_t n);
/* Reaps the child, killing it first if asked, and returns its exit status,
 * or -1 if it ended by a signal. Ending twice is fine. */
int saga_child_end(saga_child *child, bool kill_it);

#endif
