/* SPDX-License-Identifier: MIT
 *
 * How the trainer fails: a function that can fail returns false (or NULL) and
 * leaves one sentence in a saga_error, which its caller passes on.
 */
#ifndef SAGA_ERROR_H
#define SAGA_ERROR_H

#include <stdbool.h>

enum { SAGA_MESSAGE_NBYTES = 1024 };

/* One sentence for the user: the file, what is wrong with which value, and
 * what to do about it. Empty as long as nothing failed. */
typedef struct saga_error {
    char message[SAGA_MESSAGE_NBYTES];
} saga_error;

#ifdef __GNUC__
#define SAGA_PRINTF(f, a) __attribute__((format(printf, f, a)))
#else
#define SAGA_PRINTF(f, a)
#endif

/* Writes "FILE: what. Remedy." and returns false, so that it can end a
 * function. file or remedy may be NULL; the first error is kept. */
bool saga_fail(saga_error *error, const char *file, const char *remedy,
               const char *format, ...) SAGA_PRINTF(4, 5);

#endif
