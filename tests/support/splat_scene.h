/* SPDX-License-Identifier: MIT
 *
 * Random primitives and cameras for tests and benchmarks, in the real type of
 * the file that includes it.
 */
#ifndef SPLAT_SCENE_H
#define SPLAT_SCENE_H

#include "attributes.h"
#include "rng.h"
#include "splat.h"
#include "testing.h"

/* Returns zeroed primitives with all attributes, in one block that begins at
 * p->mean; saga_params_free frees them. */
static inline saga_splat_params scene_alloc(size_t n)
{
    saga_splat_params p;

    assert_done(saga_params_alloc(&p, SAGA_ATTRS_ALL, n, &error));
    return p;
}

/* Returns the number of reals in the block of scene_alloc. */
static inline size_t scene_reals(size_t n)
{
    return n * saga_attrs_width(SAGA_ATTRS_ALL);
}

static inline real scene_uniform(saga_rng r, uint64_t i, double lo, double hi)
{
    return (real)(lo + (hi - lo) * (double)saga_rng_float(r, i));
}

static inline real scene_normal(saga_rng r, uint64_t i, double mean,
                                double sigma)
{
    return (real)(float)(mean + sigma * saga_rng_normal(r, i));
}

/* Makes primitives before scene_camera, visible at times 0..1. px is the
 * typical standard deviation in pixels of a picture that is 100 pixels wide. */
static inline void scene_random(saga_splat_params *p, size_t n, uint64_t seed,
                                double px)
{
    for (size_t i = 0; i < n; i++) {
        const saga_rng r = saga_rng_stream(seed, i);
        const double z = 2 + 2 * (double)saga_rng_float(r, 0);

        p->mean[3 * i] = scene_uniform(r, 1, -0.55 * z, 0.55 * z);
        p->mean[3 * i + 1] = scene_uniform(r, 2, -0.35 * z, 0.35 * z);
        p->mean[3 * i + 2] = (real)(float)(z - 3);
        for (size_t a = 0; a < 4; a++)
            p->quat[4 * i + a] = scene_normal(r, 3 + a, 0, 1);
        for (size_t a = 0; a < 3; a++) {
            p->log2_scale[3 * i + a] = scene_normal(r, 7 + a, log2(px * 0.03),
                                                    0.8);
            p->colour[3 * i + a] = scene_uniform(r, 10 + a, 0, 1);
            p->support[3 * i + a] = scene_uniform(r, 13 + a, 0.1, 0.3);
        }
        p->opacity[i] = scene_normal(r, 16, 0, 2);
        for (size_t a = 0; a < 9; a++)
            p->motion[9 * i + a] = scene_normal(r, 17 + a, 0, 0.5);
        for (size_t a = 0; a < 4; a++)
            p->slope[4 * i + a] = scene_normal(r, 26 + a, 0, 0.5);
        p->t_centre[i] = scene_uniform(r, 30, 0, 1);
        p->log2_width[i] = scene_normal(r, 31, -0.5, 0.5);
    }
}

/* Returns a camera 3 units before the origin, turned by a small angle. */
static inline saga_splat_camera scene_camera(int width, int height, double turn)
{
    const real c = (real)(float)cos(turn), s = (real)(float)sin(turn);
    const saga_splat_camera cam = {
        .rotation = { c, 0, -s, 0, 1, 0, s, 0, c },
        .centre = { -3 * s, 0, -3 * c },
        .focal = { (real)width, (real)(width * 1.0625) },
        .principal = { (real)(width * 0.5), (real)(height * 0.5 + 0.75) },
        .near_plane = (real)0.0625,
        .width = width,
        .height = height,
        .background = { (real)0.25, (real)0.5, (real)0.125 }
    };

    return cam;
}

/* --- A picture's gradient ------------------------------------------------ */

/* Primitives, their gradients, and a canvas with random gradients of its
 * picture. */
typedef struct {
    saga_splat_params p, d;
    saga_canvas c;
    size_t n, plane;
} fixture;

static inline fixture *new_fixture(size_t n, int width, int height,
                                   uint64_t seed, double px)
{
    fixture *const f = zeroed(1, sizeof *f);
    const saga_rng r = saga_rng_stream(seed, 1u << 30);

    f->n = n;
    f->plane = (size_t)width * (size_t)height;
    f->p = scene_alloc(n);
    f->d = scene_alloc(n);
    scene_random(&f->p, n, seed, px);
    assert_done(saga_canvas_init(&f->c, f->plane, &error));
    f->c.camera = scene_camera(width, height, 0.1);
    f->c.t = R(0.5);
    for (size_t i = 0; i < 3 * f->plane; i++)
        f->c.d_image[i] = scene_uniform(r, i, -1, 1);
    return f;
}

static inline void free_fixture(fixture *f)
{
    saga_params_free(&f->p);
    saga_params_free(&f->d);
    saga_canvas_free(&f->c);
    free(f);
}

#endif
