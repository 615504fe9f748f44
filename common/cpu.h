/* SPDX-License-Identifier: MIT
 *
 * Which vectors the machine has. Every function that is written more than once
 * gives the same bits in all its versions, so the choice shows in nothing but
 * time.
 */
#ifndef SAGA_CPU_H
#define SAGA_CPU_H

/* In ascending order: a machine that has one has those before it. */
typedef enum saga_cpu {
    SAGA_CPU_PLAIN,          /* C, compiled for what the compiler was told */
    SAGA_CPU_SSE4,           /* x86-64 with SSE4.1 */
    SAGA_CPU_AVX2            /* x86-64 with AVX2 */
} saga_cpu;

/* The last one that this machine has. Asks the processor, which under a
 * hypervisor may take microseconds. */
saga_cpu saga_cpu_best(void);

#endif
