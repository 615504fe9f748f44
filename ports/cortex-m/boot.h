/* SPDX-License-Identifier: MIT
 *
 * The code that runs before main, and the processor's counters.
 */
#ifndef SAGA_BOOT_H
#define SAGA_BOOT_H

#include <stdint.h>

/* Ticks of the processor's timer since the start. A tick is a clock of the
 * processor; where the emulator counts instructions, a fixed number of these.
 */
uint64_t boot_ticks(void);

/* Bytes of stack that have been used at any time since the start, from what is
 * left of the pattern it was filled with. */
uint32_t boot_stack_nbytes(void);

#endif
