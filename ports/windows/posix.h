/* SPDX-License-Identifier: MIT
 *
 * The Makefile includes this file first in all code with an operating system
 * that is compiled for Windows. It adds what MinGW-w64 lacks of POSIX and C11.
 */
#ifndef POSIX_H
#define POSIX_H

/* Opening a pipe does not wait for its writer. */
#define O_NONBLOCK 0

/* malloc of 64-bit Windows aligns to 16 bytes, which saga.h asks for; larger
 * alignments are for speed only. free() must take the block. */
#define aligned_alloc(align, nbytes) malloc(nbytes)

#endif
