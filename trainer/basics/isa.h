/* SPDX-License-Identifier: MIT
 *
 * Files that compute with vectors (vec.h) are compiled for several levels of
 * the instruction set, and a program uses the highest one that its machine has.
 * In these files SAGA_ISA is the level, which ends the names of their
 * functions. Elsewhere the names stand for pointers, which are set before main
 * runs. A header declares such a function by
 *
 *     #define saga_thing SAGA_ISA_NAME(saga_thing)
 *     extern void saga_thing(void);
 *
 * and its file ends with SAGA_ISA_CHOOSE(saga_thing). In double it is compiled
 * once (real.h).
 */
#ifndef SAGA_ISA_H
#define SAGA_ISA_H

#include "error.h"

#include <stdbool.h>

/* 256 bits with fused multiply-add, and 512 bits, which give the same results.
 * The baseline is what the compiler assumes: on x86-64 it has 128 bits. */
typedef enum saga_isa { SAGA_ISA_BASELINE, SAGA_ISA_V3, SAGA_ISA_V4 } saga_isa;

#if defined SAGA_REAL_DOUBLE
#define SAGA_ISA_NAME(name) name##_f64
#elif !defined SAGA_ISA
#define SAGA_ISA_NAME(name) (*name##_isa)
#elif SAGA_ISA == 4
#define SAGA_ISA_NAME(name) name##_v4
#elif SAGA_ISA == 3
#define SAGA_ISA_NAME(name) name##_v3
#else
#define SAGA_ISA_NAME(name) name##_v1
#endif

#if defined SAGA_REAL_DOUBLE || !defined SAGA_ISA || SAGA_ISA != 1
#define SAGA_ISA_CHOOSE(name) extern saga_isa saga_isa_used(void)
#elif defined __x86_64__
#define SAGA_ISA_CHOOSE(name)                                 \
    extern __typeof__(name##_v1) name##_v3, name##_v4;        \
    __typeof__(name##_v1) *name##_isa;                        \
    __attribute__((constructor)) static void name##_set(void) \
    {                                                         \
        const saga_isa isa = saga_isa_used();                 \
                                                              \
        name##_isa = isa >= SAGA_ISA_V4   ? name##_v4         \
                     : isa >= SAGA_ISA_V3 ? name##_v3         \
                                          : name##_v1;        \
    }                                                         \
    extern saga_isa saga_isa_used(void)
#else
#define SAGA_ISA_CHOOSE(name) __typeof__(name##_v1) *name##_isa = name##_v1
#endif

/* Returns the level in use: that which the environment variable SAGA_CPU names,
 * if this machine has it, otherwise the highest one. It never changes. */
saga_isa saga_isa_used(void);

/* Returns the lowest level that gives the same results as this one. */
saga_isa saga_isa_same(saga_isa isa);

const char *saga_isa_text(saga_isa isa);

/* Fails if SAGA_CPU names no level of this machine. */
bool saga_isa_check(saga_error *error);

#endif
