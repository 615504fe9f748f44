/* SPDX-License-Identifier: MIT */
#include "residual_hash.h"

#include "fx.h"

uint32_t saga_hash_entry(const saga_model *m, uint32_t level, uint32_t rank,
                         const int16_t offset_q14[4])
{
    static const uint32_t prime[4] = { 2654435761u, 805459861u, 3674653429u,
                                       2097192037u };
    uint32_t hash = rank;
    int i;

    for (i = 0; i < 4; i++)
        hash ^= prime[i] * (uint32_t)fx_rshift(offset_q14[i], 15 - (int)level);
    return (level << m->hash_log2_entries) +
           (hash & ((1u << m->hash_log2_entries) - 1));
}
