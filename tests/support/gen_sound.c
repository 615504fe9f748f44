/* SPDX-License-Identifier: MIT */
#include "gen_sound.h"

#include <string.h>

static void store(uint8_t *to, int n, uint64_t v)
{
    for (int i = 0; i < n; i++)
        to[i] = (uint8_t)(v >> 8 * i);
}

void gen_sound_sign(uint8_t *p)
{
    size_t n = 27u + p[26];
    uint32_t crc = 0;

    for (int i = 0; i < p[26]; i++)
        n += p[27 + i];
    store(p + 22, 4, 0);
    /* The CRC is computed by long division: first the bits of the page enter,
     * one at a time, then 32 zeros. */
    for (size_t i = 0; i < 8 * (n + 4); i++) {
        const uint32_t byte = i < 8 * n ? p[i / 8] : 0;
        const uint32_t bit = byte >> (7 - i % 8) & 1u;
        const uint32_t out = crc >> 31;

        crc = (crc << 1 | bit) ^ (out ? 0x04c11db7u : 0);
    }
    store(p + 22, 4, crc);
}

/* Writes an Ogg page with n packets of `each` bytes; returns the address after
 * it. */
static uint8_t *page(uint8_t *p, int flags, uint32_t number, uint64_t granule,
                     const uint8_t *packet, int each, int n)
{
    memcpy(p, "OggS", 4);
    p[4] = 0;
    p[5] = (uint8_t)flags;
    store(p + 6, 8, granule);
    store(p + 14, 4, 0x5a6a);
    store(p + 18, 4, number);
    p[26] = (uint8_t)n;
    memset(p + 27, each, (size_t)n);
    for (int i = 0; i < n; i++)
        memcpy(p + 27 + n + i * each, packet, (size_t)each);
    gen_sound_sign(p);
    return p + 27 + n + n * each;
}

void gen_sound(uint8_t to[GEN_SOUND_NBYTES])
{
    /* The Opus header: version 1, one channel, 192 samples of pre-skip, 48000
     * Hz. */
    static const uint8_t head[19] = "OpusHead\1\1\xc0\0\x80\xbb\0\0\0\0";
    static const uint8_t tags[20] = "OpusTags\4\0\0\0saga\0\0\0";
    /* An Opus packet: full band, 20 ms, one frame of silence. */
    static const uint8_t silence[3] = { 0xf8, 0xff, 0xfe };

    to = page(to, 2, 0, 0, head, sizeof head, 1);
    to = page(to, 0, 1, 0, tags, sizeof tags, 1);
    page(to, 4, 2, 960 * GEN_SOUND_PACKETS, silence, sizeof silence,
         GEN_SOUND_PACKETS);
}
