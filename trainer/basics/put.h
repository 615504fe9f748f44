/* SPDX-License-Identifier: MIT
 *
 * Writes numbers little-endian. Each function moves *at past what it wrote.
 */
#ifndef SAGA_PUT_H
#define SAGA_PUT_H

#include <stdint.h>
#include <string.h>

static inline void saga_put_le(uint8_t **at, uint32_t v, int nbytes)
{
    for (int i = 0; i < nbytes; i++)
        *(*at)++ = (uint8_t)(v >> 8 * i);
}

static inline void saga_put_f32(uint8_t **at, float x)
{
    uint32_t bits;

    memcpy(&bits, &x, sizeof bits);
    saga_put_le(at, bits, 4);
}

#endif
