/* SPDX-License-Identifier: MIT */
#include "isa.h"

#include <stdlib.h>
#include <string.h>

static const char variable[] = "SAGA_CPU";

static const char *const names[] = { [SAGA_ISA_BASELINE] = "baseline",
                                     [SAGA_ISA_V3] = "x86-64-v3",
                                     [SAGA_ISA_V4] = "x86-64-v4" };

/* Processors with these features have all the others of their level. */
static saga_isa best(void)
{
#ifdef __x86_64__
    __builtin_cpu_init();
    if (!__builtin_cpu_supports("avx2") || !__builtin_cpu_supports("fma") ||
        !__builtin_cpu_supports("bmi2"))
        return SAGA_ISA_BASELINE;
    return __builtin_cpu_supports("avx512f") &&
                   __builtin_cpu_supports("avx512bw") &&
                   __builtin_cpu_supports("avx512cd") &&
                   __builtin_cpu_supports("avx512dq") &&
                   __builtin_cpu_supports("avx512vl")
               ? SAGA_ISA_V4
               : SAGA_ISA_V3;
#else
    return SAGA_ISA_BASELINE;
#endif
}

static saga_isa choose(void)
{
    const char *const asked = getenv(variable);
    const saga_isa most = best();

    for (saga_isa isa = SAGA_ISA_BASELINE; asked && isa < most; isa++)
        if (!strcmp(asked, names[isa]))
            return isa;
    return most;
}

/* The first call is before main, so that no thread runs yet. */
saga_isa saga_isa_used(void)
{
    static saga_isa used;
    static bool known;

    if (!known)
        used = choose();
    known = true;
    return used;
}

saga_isa saga_isa_same(saga_isa isa)
{
    return isa == SAGA_ISA_V4 ? SAGA_ISA_V3 : isa;
}

const char *saga_isa_text(saga_isa isa)
{
    return names[isa];
}

bool saga_isa_check(saga_error *error)
{
    const char *const asked = getenv(variable);

    return !asked || !*asked || !strcmp(asked, names[saga_isa_used()]) ||
           saga_fail(error, variable,
                     "set baseline, x86-64-v3 or x86-64-v4, as far as the "
                     "machine has it, or nothing",
                     "is '%s', which this machine does not have", asked);
}
