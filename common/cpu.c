/* SPDX-License-Identifier: MIT */
#include "cpu.h"

#include <stdint.h>

#ifdef SAGA_MAY_AVX2

enum { EAX, EBX, ECX, EDX };

static void cpuid(uint32_t r[4], uint32_t leaf)
{
    __asm__ volatile("cpuid"
                     : "=a"(r[EAX]), "=b"(r[EBX]), "=c"(r[ECX]), "=d"(r[EDX])
                     : "a"(leaf), "c"(0));
}

/* Returns whether the operating system saves the registers of SSE and AVX (bits
 * 1 and 2 of XCR0). */
static int keeps_ymm(void)
{
    uint32_t low, high;

    __asm__ volatile("xgetbv" : "=a"(low), "=d"(high) : "c"(0));
    return (low & 6) == 6;
}

/* Leaf 1, ecx: SSSE3 (9), SSE4.1 (19), OSXSAVE (27), AVX (28). Leaf 7, ebx:
 * AVX2 (5). */
saga_cpu saga_cpu_best(void)
{
    const uint32_t sse4 = 1u << 9 | 1u << 19, avx = 1u << 27 | 1u << 28;
    uint32_t r[4], most;

    cpuid(r, 0);
    most = r[EAX];
    cpuid(r, 1);
    if ((r[ECX] & sse4) != sse4)
        return SAGA_CPU_PLAIN;
    if ((r[ECX] & avx) != avx || most < 7 || !keeps_ymm())
        return SAGA_CPU_X4;
    cpuid(r, 7);
    return r[EBX] & 1u << 5 ? SAGA_CPU_AVX2 : SAGA_CPU_X4;
}

#else

saga_cpu saga_cpu_best(void)
{
#ifdef SAGA_MAY_X4
    return SAGA_CPU_X4;
#else
    return SAGA_CPU_PLAIN;
#endif
}

#endif
