/* SPDX-License-Identifier: MIT
 *
 * Streams made from given primitives, so that the decoded primitives are known
 * without a decoder. The networks pass features through unchanged: each
 * attribute of a primitive is one feature of its coarse anchor.
 */
#ifndef GEN_GIVEN_H
#define GEN_GIVEN_H

#include "gen_stream.h"
#include "primitive.h"

/* The Q formats of the outputs. Features are multiples of 16, and therefore so
 * are opacity, t_centre / 2, log2_scale_q10 / 2, log2_width_q10 / 2 and motion.
 * Quaternions and slopes may be any whole numbers that the format holds:
 * quat[0] in -1023..3071, the others and the slopes within +-2047. */
enum {
    GIVEN_Q_OPACITY = 10,
    GIVEN_FULL = 192, /* opacity 8 / (1 + 2^(3 - 192/1024)) = 0.9969 */
    GIVEN_Q_QUAT = 10,
    GIVEN_Q_MOTION = 11
};

typedef struct gen_given {
    saga_primitive p;       /* x: rounded to support / 1024 or finer; support:
                             * a power of two, at least 1024. Other values that
                             * the format cannot express are refused */
    uint16_t colour_q15[3]; /* multiples of 32 */
    uint32_t copies;        /* number at the same place, 1..256; 0 means 1 */
} gen_given;

/* Returns a ball at (0, 0, depth) with deviations of 2^log2_scale box units. It
 * is white, still and always visible, and its opacity, GIVEN_FULL, is above the
 * cap. */
gen_given gen_given_ball(int32_t depth, int log2_scale);

/* Returns the format of the primitives: `tools`, bits of SAGA_TOOLS_PICTURE,
 * turn on orders of motion, slope and width. With VIEW, the direction (Q14,
 * where 1 is the whole range of a colour) is added to the colour. */
saga_prim_format gen_given_format(uint32_t tools);

/* Makes a stream with one segment of n_frames and n primitives, each in a leaf
 * of its own. Sorts p into the order of the file, and sets p[i].p.x to the
 * rounded positions. Exits with a message if the format cannot express a
 * primitive. */
void gen_given_make(gen_stream *g, gen_given *p, uint32_t n, uint32_t tools,
                    uint32_t n_frames);

#endif
