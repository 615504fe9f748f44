/* SPDX-License-Identifier: MIT
 *
 * What the proofs of tests/run_prove.py share: values of which Frama-C's Eva
 * considers all at once. Elsewhere proofs compile, but do not link.
 */
#ifndef PROVE_H
#define PROVE_H

#include <stddef.h>
#include <stdint.h>

#ifdef __FRAMAC__
#include <__fc_builtin.h>
#else
void Frama_C_make_unknown(char *p, size_t n);
int Frama_C_interval(int least, int most);
long Frama_C_long_interval(long least, long most);
unsigned Frama_C_unsigned_int_interval(unsigned least, unsigned most);
unsigned long Frama_C_unsigned_long_interval(unsigned long least,
                                             unsigned long most);
#endif

/* Returns any number from `least` to `most`. */
static inline uint32_t any_of(uint32_t least, uint32_t most)
{
    return Frama_C_unsigned_int_interval(least, most);
}

static inline void any_bytes(void *p, size_t n)
{
    Frama_C_make_unknown((char *)p, n);
}

#endif
