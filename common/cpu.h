/* SPDX-License-Identifier: MIT
 *
 * Which vectors the machine has. Every function that is written more than once
 * gives the same bits in all its versions, so the choice shows in nothing but
 * time.
 */
#ifndef SAGA_CPU_H
#define SAGA_CPU_H

/* In ascending order: a machine that has one has those before it, and whoever
 * chooses a version takes the last one that it knows, by >=. */
typedef enum saga_cpu {
    SAGA_CPU_PLAIN,          /* C, compiled for what the compiler was told */
    SAGA_CPU_X4,             /* 128 bits: SSE4.1, NEON, WebAssembly's */
    SAGA_CPU_AVX2            /* 256 bits: AVX2 */
} saga_cpu;

/* A file is compiled for vectors or not; -mgeneral-regs-only undoes __SSE2__.
 * x86-64 is asked what it has. Others are compiled for vectors or without. */
#if defined __x86_64__ && defined __SSE2__
#define SAGA_MAY_AVX2
#define SAGA_MAY_X4
#elif defined __ARM_NEON || defined __wasm_simd128__
#define SAGA_MAY_X4
#endif
#if defined __ARM_NEON && __BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__
#define SAGA_MAY_NEON
#endif

/* The last one that this machine has. Asking x86-64 may take microseconds
 * under a hypervisor. */
saga_cpu saga_cpu_best(void);

#endif
