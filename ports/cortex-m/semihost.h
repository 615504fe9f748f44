/* SPDX-License-Identifier: MIT
 *
 * Semihosting: a debugger, or the emulator, prints and keeps files for the
 * device. Without one, every call here faults: a product leaves it out.
 */
#ifndef SAGA_SEMIHOST_H
#define SAGA_SEMIHOST_H

#include <stddef.h>
#include <stdint.h>

void semihost_text(const char *text);
void semihost_decimal(uint32_t x);
void semihost_hex(uint32_t x);   /* 8 digits */

/* The words behind the program's name on the host's command line, which go to
 * text[0..n), n >= 1; "" if there is none or no room. */
void semihost_arguments(char *text, size_t n);

/* A file of the host's to be written: a handle, or -1. */
int semihost_create(const char *path);
/* Returns 1 if all of p[0..n) is written. */
int semihost_write(int file, const void *p, size_t n);
void semihost_close(int file);

/* Ends the program with a status that the host sees. */
_Noreturn void semihost_exit(int status);

#endif
