/* SPDX-License-Identifier: MIT
 *
 * Cameras and animated primitives at the edges of what is valid: needles,
 * standard deviations from 0.01 to 10^6 px, quaternions of any length, points
 * around and behind the camera.
 */
#ifndef SAGA_GEN_HARD_H
#define SAGA_GEN_HARD_H

#include "gen_scene.h"

/* Makes a camera anywhere within +-2^29, turned at random, with focal lengths
 * of 2^-4..2^5 sides, and principal points around the picture and far from it.
 */
void gen_hard_camera(saga_camera *c, gen_rng *r, int width, int height);

/* Makes any format of primitives, without tools. */
void gen_hard_format(saga_prim_format *f, gen_rng *r);

/* Makes a primitive, mostly one in or near the picture, sometimes one close to
 * the camera, behind it or far outside. */
void gen_hard_animated(saga_animated *a, gen_rng *r, const saga_camera *c);

/* Makes a primitive whose values are independent of each other: 16-bit values
 * shifted right by 0..max_shift, places in the cube, and valid supports and
 * times. */
void gen_hard_primitive(saga_primitive *p, gen_rng *r, int max_shift);

/* Returns a number lo..hi shifted right by 0..max_shift, so that small values
 * occur, too. It draws from r in a fixed order, unlike gen_int(..) >>
 * gen_int(..). */
int32_t gen_shifted(gen_rng *r, int32_t lo, int32_t hi, int max_shift);

/* Returns any 16-bit value, shifted right by 0..max_shift; extremes and zero
 * are more frequent. */
int16_t gen_any16(gen_rng *r, int max_shift);

#endif
