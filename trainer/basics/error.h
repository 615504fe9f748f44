/* SPDX-License-Identifier: MIT
 *
 * The error convention of the trainer, for every room:
 *
 * - A function that can fail returns bool (true: success) or a pointer (NULL:
 *   failure), and takes a saga_error, never NULL, as its last parameter. On
 *   failure the saga_error holds a sentence with the file, what is wrong with
 *   which value, and a remedy. Callers pass it on unchanged.
 * - The first error is kept, so that a failure during the clean-up does not
 *   hide the cause.
 * - A function that fails frees what it has allocated and removes the file it
 *   was writing. Its arguments stay owned by the caller, in a state that can be
 *   freed.
 * - A function that the user can also stop returns a saga_outcome.
 * - Memory whose size depends on input is allocated by alloc.h, which writes
 *   the sentence itself. Neither a bad file nor a small machine aborts the
 *   program; assert() is for our own mistakes only.
 * - Code that runs in every iteration uses memory that was allocated before, if
 *   the size is known by then; a function that cannot fail returns void.
 * - A saga_error is used by one thread. Every job of a parallel loop has its
 *   own, and that of the lowest failed job is passed on, so that the sentence
 *   does not depend on the number of threads.
 *
 * saga_error holds no reals, so operators that compile twice (real.h) share it.
 */
#ifndef SAGA_ERROR_H
#define SAGA_ERROR_H

#include <stdbool.h>
#include <stddef.h>

enum { SAGA_MESSAGE_NBYTES = 1024 };

/* One sentence for the user, empty until something fails. It is initialised by
 * `saga_error error = { "" };`. */
typedef struct saga_error {
    char message[SAGA_MESSAGE_NBYTES];
} saga_error;

/* The result of a function that the user can stop. */
typedef enum saga_outcome {
    SAGA_FAILED = -1, /* the saga_error has the reason */
    SAGA_DONE = 0,
    SAGA_STOPPED = 1 /* stopped by the progress function; another call
                      * continues */
} saga_outcome;

#ifdef __GNUC__
#define SAGA_PRINTF(f, a) __attribute__((format(printf, f, a)))
#else
#define SAGA_PRINTF(f, a)
#endif

/* Writes "FILE: what; remedy" and returns false, so that a function can end
 * with it. file and remedy may be NULL. An earlier error is kept. */
bool saga_fail(saga_error *error, const char *file, const char *remedy,
               const char *format, ...) SAGA_PRINTF(4, 5);

/* Writes an error like saga_fail after a call to the system or a library that
 * has set errno: "FILE: what (strerror); remedy". ENOMEM becomes an
 * out-of-memory error. If errno is 0, the parentheses are left out. */
bool saga_fail_errno(saga_error *error, const char *file, const char *remedy,
                     const char *what);

/* Tells whether something has failed. */
static inline bool saga_failed(const saga_error *error)
{
    return error->message[0] != '\0';
}

/* Reports that there was no memory for `what`, a file or a noun. nbytes is 0 if
 * the amount is unknown. Returns false. */
bool saga_no_memory(size_t nbytes, const char *what, saga_error *error);

#endif
