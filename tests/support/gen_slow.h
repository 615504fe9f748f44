/* SPDX-License-Identifier: MIT
 *
 * The slowest valid files of each level. They are small, because every symbol
 * is the one that its distribution predicts almost with certainty.
 */
#ifndef GEN_SLOW_H
#define GEN_SLOW_H

#include "gen_stream.h"

/* What keeps the decoder busy: the products of wide networks; the runs of many
 * narrow networks; or anchors alone, with trees of single children and the
 * largest windows of interpolation. The first two have a memory bank with
 * rounds of one block. */
enum { GEN_SLOW_WIDE, GEN_SLOW_NARROW, GEN_SLOW_ANCHORS, GEN_N_SLOW };

/* Makes a stream with eight layers. Its header.max has the largest numbers of
 * anchors that the level's limit of work allows, so that one more in each tier
 * is refused. The layers together have 1/share of these. */
void gen_slow_make(gen_stream *g, int level, int kind, uint32_t share);

/* Changes all residuals of such a stream to the last one that the widest table
 * has before the escape, which takes the longest search. */
void gen_slow_search(gen_stream *g);

/* Makes as many primitives as the level allows, all of which the rig's camera
 * sees as small splats, with colours that depend on the view. */
void gen_slow_crowd(gen_stream *g, int level);

/* Makes n splats that cover the whole picture of the rig's camera, 256 by 256
 * pixels, and are so faint that no pixel ever stops. */
void gen_slow_wall(gen_stream *g, int level, uint32_t n);

/* Changes two fields of a file's header, and its CRC. */
void gen_slow_set_max(uint8_t *bytes, uint32_t max_coarse, uint32_t max_fine);

#endif
