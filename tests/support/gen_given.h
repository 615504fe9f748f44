/* SPDX-License-Identifier: MIT
 *
 * Streams whose primitives are given: what a file decodes to is known before
 * there is a decoder. Networks pass features on as they are, so each attribute
 * of a primitive is one feature of its coarse anchor.
 */
#ifndef GEN_GIVEN_H
#define GEN_GIVEN_H

#include "gen_stream.h"
#include "primitive.h"

/* Formats of the outputs below. Features are multiples of 16, so values of
 * opacity, t_centre / 2, log2_scale_q10 / 2, log2_width_q10 / 2 and motion are
 * too; quaternions and slopes are any whole numbers that the format holds:
 * quat[0] in -1023..3071, the others and slopes within +-2047. */
enum {
    GIVEN_Q_OPACITY = 10,
    GIVEN_FULL = 192,        /* opacity 8 / (1 + 2^(3 - 192/1024)) = 0.9969 */
    GIVEN_Q_QUAT = 10,
    GIVEN_Q_MOTION = 11
};

typedef struct gen_given {
    saga_primitive p;        /* x: any, rounded to support / 1024 at the
                              * coarsest; support: a power of two, at least
                              * 1024; what the format cannot say is refused */
    uint16_t colour_q15[3];  /* multiples of 32 */
    uint32_t copies;         /* 1..256 of it at the same place; 0 is 1 */
} gen_given;

/* At (0, 0, depth), a ball of 2^log2_scale box units, white, still, visible all
 * the time, of opacity GIVEN_FULL, more than the cap. */
gen_given gen_given_ball(int32_t depth, int log2_scale);

/* How to read them: orders of motion, slope and width are on if tools say so
 * (bits of SAGA_TOOLS_PICTURE). With VIEW, the direction (Q14, 1 for the whole
 * range of a colour) is added to the colour. */
saga_prim_format gen_given_format(uint32_t tools);

/* A stream of one segment of n_frames, with n of them, each in a leaf of its
 * own; they are put into the order of the file, and p[i].p.x becomes what it
 * will be. Exits with a message where one cannot be said. */
void gen_given_make(gen_stream *g, gen_given *p, uint32_t n, uint32_t tools,
                    uint32_t n_frames);

#endif
