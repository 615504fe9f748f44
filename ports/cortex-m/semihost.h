/* SPDX-License-Identifier: MIT
 *
 * Semihosting: a debugger or an emulator prints text and writes files for the
 * device. Without either, every call here faults, so that a product must not
 * contain them.
 */
#ifndef SAGA_SEMIHOST_H
#define SAGA_SEMIHOST_H

#include <stddef.h>
#include <stdint.h>

void semihost_text(const char *text);
void semihost_decimal(uint32_t x);
void semihost_hex(uint32_t x); /* 8 digits */

/* Copies the words after the program's name on the host's command line to
 * text[0..n), n >= 1; copies "" if there are none or they do not fit. */
void semihost_arguments(char *text, size_t n);

/* Creates a file on the host. Returns its handle, or -1. */
int semihost_create(const char *path);
/* Returns 1 if all of p[0..n) is written. */
int semihost_write(int file, const void *p, size_t n);
void semihost_close(int file);

/* Ends the program with a status that the host sees. */
_Noreturn void semihost_exit(int status);

#endif
