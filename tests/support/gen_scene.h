/* SPDX-License-Identifier: MIT
 *
 * Random scenes and cameras for tests and benchmarks of the renderer. The same
 * seed gives the same numbers on every machine with IEEE doubles and an
 * accurate libm. Where exact numbers matter, use gen_u32 and integers.
 */
#ifndef SAGA_GEN_SCENE_H
#define SAGA_GEN_SCENE_H

#include "primitive.h"
#include "saga.h"

typedef struct gen_rng {
    uint64_t state;
} gen_rng;

/* Returns a generator with the seed from SAGA_TEST_SEED, or else the given one,
 * and prints the seed. */
gen_rng gen_seeded(uint64_t seed);
uint32_t gen_u32(gen_rng *r);
/* Returns a number in lo..hi; both are included. */
int32_t gen_int(gen_rng *r, int32_t lo, int32_t hi);
/* Returns 1 in one of n cases, else 0. */
int gen_one_in(gen_rng *r, int n);
double gen_uniform(gen_rng *r, double lo, double hi);
double gen_normal(gen_rng *r);

/* Makes a camera at the origin that looks along z; its focal length is width.
 */
void gen_front_camera(saga_camera *c, int width, int height);

/* Makes a camera like gen_front_camera's, at a random place within +-reach and
 * with a random rotation. */
void gen_any_camera(saga_camera *c, gen_rng *r, int width, int height,
                    int32_t reach);

/* The formats of the primitives that gen_uniform_scene makes: quaternions in
 * Q14, opacity in Q12. */
extern const saga_prim_format gen_still_format;

/* Makes n still primitives, uniform over the picture of a front camera and over
 * depths of 2^21..2^23. Their three deviations are log-normal; the median of
 * the largest 3-sigma radius is about 4 px. */
void gen_uniform_scene(saga_primitive *p, uint32_t n, gen_rng *r,
                       const saga_camera *c);

/* Animates and projects n primitives at time t. Returns the number of visible
 * splats, which are stored without gaps, with random colours that depend on the
 * index alone. splats has room for n; source, unless NULL, gets the index of
 * each splat's primitive. */
uint32_t gen_splats(saga_splat *splats, uint32_t *source,
                    const saga_primitive *p, const saga_prim_format *f,
                    uint32_t n, const saga_camera *c, int32_t t);
void gen_colour(uint16_t colour_q15[3], uint32_t index);

#endif
