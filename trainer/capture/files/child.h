/* SPDX-License-Identifier: MIT
 *
 * Runs a child process whose standard output this program reads, or whose
 * standard input it writes. No shell is involved. The other of the two streams
 * is empty. Standard error goes to an unnamed file, from which the last line
 * can be quoted.
 */
#ifndef SAGA_CHILD_H
#define SAGA_CHILD_H

#include "capture.h"

#include <sys/types.h>

/* A child is killed after this many seconds without output: counting the
 * packets of a long video takes minutes. */
enum { SAGA_CHILD_PATIENCE = 300 };

typedef struct saga_child {
    pid_t pid;    /* 0: not running */
    int patience; /* seconds; saga_child_start sets SAGA_CHILD_PATIENCE */
    bool hung;    /* it was killed because it produced no output */
    int in, out;  /* file descriptors: its standard input, which we write, and
                   * its output, which we read; -1: none */
    int log;      /* file descriptor of its standard error; -1: none */
    char said[2048]; /* the end of its standard error, after saga_child_end */
    char tail[256];  /* the last line of that, fit to be printed */
} saga_child;

/* Starts a program, which is looked up in PATH; argv ends with NULL. */
bool saga_child_start(saga_child *child, const char *const *argv,
                      saga_error *error);
/* Starts a program like saga_child_start, with a pipe to its standard input. */
bool saga_child_start_fed(saga_child *child, const char *const *argv,
                          saga_error *error);
/* Writes n bytes; returns false if the child accepts no more. */
bool saga_child_write(saga_child *child, const void *buffer, size_t n);
/* Reads until n bytes have arrived or the output ends; returns their number. A
 * child without output for `patience` seconds is killed. */
size_t saga_child_read(saga_child *child, void *buffer, size_t n);
/* Closes the pipes and waits for the child, which is killed first if kill_it.
 * Returns its exit status, or -1 if a signal ended it. May be called twice. */
int saga_child_end(saga_child *child, bool kill_it);

#endif
