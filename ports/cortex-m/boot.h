/* SPDX-License-Identifier: MIT
 *
 * The code that runs before main, the timer, and the use of the stack.
 */
#ifndef SAGA_BOOT_H
#define SAGA_BOOT_H

#include <stdint.h>

/* Returns the ticks of the timer since the start. A tick is a clock cycle of
 * the processor, or in an emulator that counts instructions a fixed number of
 * them. */
uint64_t boot_ticks(void);

/* Returns the largest number of bytes of stack used at any time since the
 * start, found from the remains of the pattern with which it was filled. */
uint32_t boot_stack_nbytes(void);

#endif
