/* SPDX-License-Identifier: MIT
 *
 * Runs a child process whose standard output we read, or whose standard input
 * we write: no shell, the other one is empty, standard error goes to an
 * unnamed file from which the last line can be quoted.
 */
#ifndef SAGA_CHILD_H
#define SAGA_CHILD_H

#include "capture.h"

#include <sys/types.h>

/* A child is given up after this many seconds without output: counting the
 * packets of a long video takes minutes. */
enum { SAGA_CHILD_PATIENCE = 300 };

typedef struct saga_child {
    pid_t pid;      /* 0: not running */
    int patience;   /* seconds; saga_child_start sets SAGA_CHILD_PATIENCE */
    bool hung;      /* it was given up */
    int in, out;    /* file descriptors: what we write, read; -1: none */
    int log;        /* of its messages; -1: none */
    char tail[256]; /* last line of standard error, after saga_child_end */
} saga_child;

/* argv[0] is looked up in PATH; argv ends with NULL. */
bool saga_child_start(saga_child *child, const char *const *argv,
                      saga_error *error);
/* Does the same, but we write what it reads. */
bool saga_child_start_fed(saga_child *child, const char *const *argv,
                          saga_error *error);
/* Writes n bytes; false where the child takes no more. */
bool saga_child_write(saga_child *child, const void *buffer, size_t n);
/* Reads until n bytes are there or the output ends; returns how many. A child
 * that says nothing for too long is killed. */
size_t saga_child_read(saga_child *child, void *buffer, size_t n);
/* Ends what it reads, reaps it, killing it first if asked, and returns its exit
 * status, or -1 if it ended by a signal. Ending twice is fine. */
int saga_child_end(saga_child *child, bool kill_it);

#endif
