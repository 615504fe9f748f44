/* SPDX-License-Identifier: MIT
 *
 * A short Ogg stream of Opus for tests: silence, in packets of 20 ms.
 */
#ifndef GEN_SOUND_H
#define GEN_SOUND_H

#include <stddef.h>
#include <stdint.h>

enum { GEN_SOUND_PACKETS = 5, GEN_SOUND_NBYTES = 47 + 48 + 27 +
                                                 4 * GEN_SOUND_PACKETS };

/* Writes it; 96 ms of it are heard, after 192 samples of pre-skip. */
void gen_sound(uint8_t to[GEN_SOUND_NBYTES]);

/* Writes the checksum of the page at p, which is whole. */
void gen_sound_sign(uint8_t *p);

#endif
