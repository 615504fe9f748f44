/* SPDX-License-Identifier: MIT */
#include "crc32c.h"

/* Remainders of the 16 nibbles: entry i = i shifted through four steps of
 * c = (c >> 1) ^ (c & 1 ? 0x82f63b78 : 0). */
static const uint32_t nibble[16] = {
    0x00000000u, 0x105ec76fu, 0x20bd8edeu, 0x30e349b1u,
    0x417b1dbcu, 0x5125dad3u, 0x61c69362u, 0x7198540du,
    0x82f63b78u, 0x92a8fc17u, 0xa24bb5a6u, 0xb21572c9u,
    0xc38d26c4u, 0xd3d3e1abu, 0xe330a81au, 0xf36e6f75u
};

uint32_t saga_crc32c(uint32_t crc, const uint8_t *p, size_t n)
{
    uint32_t c = ~crc;
    size_t i;

    for (i = 0; i < n; i++) {
        c ^= p[i];
        c = c >> 4 ^ nibble[c & 15u];
        c = c >> 4 ^ nibble[c & 15u];
    }
    return ~c;
}
