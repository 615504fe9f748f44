/* SPDX-License-Identifier: MIT
 *
 * The trainer's failures. There is one convention, for every room:
 *
 * - A function that can fail returns bool (true: done) or a pointer (NULL:
 *   failed) and takes a saga_error, never NULL, as its last parameter. Where it
 *   fails it has left a sentence there: the file, what is wrong with which
 *   value, and what to do about it. Callers pass it on and add nothing.
 * - The first error is kept: a caller may go on tidying up, and what fails then
 *   does not hide the cause.
 * - Whoever fails has freed what it had allocated itself, and has removed the
 *   file it was writing. What it was given stays the caller's, in a state that
 *   may be freed.
 * - A function that the user may stop as well returns a saga_outcome.
 * - Memory whose size depends on input comes from alloc.h, which writes the
 *   sentence itself. Nothing aborts the program: neither a file nor a machine
 *   that is too small is a mistake of ours. assert() is for those.
 * - What is done in every iteration works in memory that was reserved before,
 *   where its size is known by then; a function that cannot fail returns void.
 * - A saga_error belongs to one thread. Each job of a parallel loop has its
 *   own, and the one of the lowest job is passed on, so that the sentence does
 *   not depend on the number of threads.
 *
 * saga_error holds no reals: operators that compile twice (real.h) share it.
 */
#ifndef SAGA_ERROR_H
#define SAGA_ERROR_H

#include <stdbool.h>
#include <stddef.h>

enum { SAGA_MESSAGE_NBYTES = 1024 };

/* An error holds one sentence for the user; empty as long as nothing failed, so
 * it begins as `saga_error error = { "" };`. */
typedef struct saga_error {
    char message[SAGA_MESSAGE_NBYTES];
} saga_error;

/* This says why a function came back that the user may stop. */
typedef enum saga_outcome {
    SAGA_FAILED = -1,        /* the saga_error says why */
    SAGA_DONE = 0,
    SAGA_STOPPED = 1         /* as the progress function asked; call again to
                              * go on */
} saga_outcome;

#ifdef __GNUC__
#define SAGA_PRINTF(f, a) __attribute__((format(printf, f, a)))
#else
#define SAGA_PRINTF(f, a)
#endif

/* Writes "FILE: what; remedy" and returns false, so that it can end a function.
 * file or remedy may be NULL; the first error is kept. */
bool saga_fail(saga_error *error, const char *file, const char *remedy,
               const char *format, ...) SAGA_PRINTF(4, 5);

/* Says the same of a call to the system or to a library that has just set
 * errno: "FILE: what (why); remedy". Where errno is ENOMEM it was memory; where
 * it is 0 nobody knows why. */
bool saga_fail_errno(saga_error *error, const char *file, const char *remedy,
                     const char *what);

/* Returns true once something has failed. */
static inline bool saga_failed(const saga_error *error)
{
    return error->message[0] != '\0';
}

/* Says that there was no memory for `what`, a file or a noun; nbytes is 0 where
 * a library does not tell how much it wanted. Returns false. */
bool saga_no_memory(size_t nbytes, const char *what, saga_error *error);

#endif
