/* SPDX-License-Identifier: MIT
 *
 * The slowest valid files of each level: small, since what costs time costs no
 * bytes. Every symbol is the one that its distribution is nearly sure of.
 */
#ifndef GEN_SLOW_H
#define GEN_SLOW_H

#include "gen_stream.h"

/* Streams that keep the decoder busy: products of wide networks; runs of
 * networks that have hardly any; anchors alone, in trees of single children,
 * with the largest windows. The first two have a bank whose rounds are of one
 * block. */
enum { GEN_SLOW_WIDE, GEN_SLOW_NARROW, GEN_SLOW_ANCHORS, GEN_N_SLOW };

/* A stream of eight layers whose header.max has as many anchors as the level's
 * bounds of work allow: one more of each tier is too many. The layers have a
 * `share`th of them. */
void gen_slow_make(gen_stream *g, int level, int kind, uint32_t share);

/* n splats that cover all of the picture of the rig's camera, 256 by 256, and
 * are so faint that no pixel ever ends. */
void gen_slow_wall(gen_stream *g, int level, uint32_t n);

/* Changes two fields of a file's header, and its CRC. */
void gen_slow_set_max(uint8_t *bytes, uint32_t max_coarse, uint32_t max_fine);

#endif
