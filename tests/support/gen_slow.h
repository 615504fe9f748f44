/* SPDX-License-Identifier: MIT
 *
 * The slowest valid files of each level. They are small, because every symbol
 * is the one that its distribution predicts almost with certainty.
 */
#ifndef GEN_SLOW_H
#define GEN_SLOW_H

#include "gen_stream.h"

/* The kinds of streams that keep the decoder busy: with the products of wide
 * networks; with many runs of narrow networks; and with anchors alone, in trees
 * of single children and with the largest windows. The first two have a bank
 * whose rounds have one block. */
enum { GEN_SLOW_WIDE, GEN_SLOW_NARROW, GEN_SLOW_ANCHORS, GEN_N_SLOW };

/* Makes a stream with eight layers. Its header.max has as many anchors as the
 * level's limit of work allows, so that one more in each tier is refused. The
 * layers have 1/share of them. */
void gen_slow_make(gen_stream *g, int level, int kind, uint32_t share);

/* Makes n splats that cover the whole picture of the rig's camera, 256 by 256
 * pixels, and are so faint that no pixel ever stops. */
void gen_slow_wall(gen_stream *g, int level, uint32_t n);

/* Changes two fields of a file's header, and its CRC. */
void gen_slow_set_max(uint8_t *bytes, uint32_t max_coarse, uint32_t max_fine);

#endif
