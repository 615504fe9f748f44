/* SPDX-License-Identifier: MIT
 *
 * A short Ogg stream of Opus for tests: silence, in packets of 20 ms.
 */
#ifndef GEN_SOUND_H
#define GEN_SOUND_H

#include <stddef.h>
#include <stdint.h>

enum {
    GEN_SOUND_PACKETS = 5,
    GEN_SOUND_NBYTES = 47 + 48 + 27 + 4 * GEN_SOUND_PACKETS
};

/* Writes the stream. It plays 96 ms, after 192 samples of pre-skip. */
void gen_sound(uint8_t to[GEN_SOUND_NBYTES]);

/* Computes the checksum of the complete page at p and writes it. */
void gen_sound_sign(uint8_t *p);

#endif
