/* SPDX-License-Identifier: MIT
 *
 * Detects the SIMD instructions of the machine. All versions of a function give
 * the same bits, so that the choice affects nothing but time.
 */
#ifndef SAGA_CPU_H
#define SAGA_CPU_H

/* Kinds of SIMD in ascending order: a machine that has one also has those
 * before it. Code selects its highest version for the machine by >=. */
typedef enum saga_cpu {
    SAGA_CPU_PLAIN, /* plain C, for the compiler's target */
    SAGA_CPU_X4,    /* 128 bits: SSE4.1, NEON, WebAssembly SIMD */
    SAGA_CPU_AVX2   /* 256 bits: AVX2 */
} saga_cpu;

/* On x86-64 the SIMD kind is detected at run time, unless the compiler may not
 * use SSE registers (-mgeneral-regs-only undefines __SSE2__). On other machines
 * the target of the compiler decides. */
#if defined __x86_64__ && defined __SSE2__
#define SAGA_MAY_AVX2
#define SAGA_MAY_X4
#elif defined __ARM_NEON || defined __wasm_simd128__
#define SAGA_MAY_X4
#endif
#if defined __ARM_NEON && __BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__
#define SAGA_MAY_NEON
#endif

/* Returns the highest kind that this machine has. The detection on x86-64 may
 * take microseconds under a hypervisor. */
saga_cpu saga_cpu_best(void);

#endif
