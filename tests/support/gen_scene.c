/* SPDX-License-Identifier: MIT
 *
 * See gen_scene.h.
 */
#include "gen_scene.h"

#include "animate.h"
#include "project.h"

#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

const saga_prim_format gen_still_format = { .q_quat = 14,
                                            .q_slope = 14,
                                            .q_opacity = 12,
                                            .q_motion = { 14, 14, 14 },
                                            .nbytes = sizeof(saga_primitive) };

gen_rng gen_seeded(uint64_t seed)
{
    const char *const given = getenv("SAGA_TEST_SEED");
    gen_rng r = { given ? strtoull(given, NULL, 0) : seed };

    printf("seed %" PRIu64 "\n", r.state);
    return r;
}

/* Returns the next number of a Weyl sequence, mixed by multiplications and
 * shifts. */
uint32_t gen_u32(gen_rng *r)
{
    uint64_t x = r->state += 0x9e3779b97f4a7c15u;

    x = (x ^ x >> 32) * 0xd6e8feb86659fd93u;
    x = (x ^ x >> 32) * 0xd6e8feb86659fd93u;
    return (uint32_t)(x >> 32);
}

int32_t gen_int(gen_rng *r, int32_t lo, int32_t hi)
{
    const uint64_t n = (uint64_t)((int64_t)hi - lo + 1);

    return (int32_t)(lo + (int64_t)(gen_u32(r) * n >> 32));
}

int gen_one_in(gen_rng *r, int n)
{
    return gen_int(r, 1, n) == 1;
}

double gen_uniform(gen_rng *r, double lo, double hi)
{
    return lo + (hi - lo) * gen_u32(r) / 4294967296.0;
}

double gen_normal(gen_rng *r)
{
    const double u = gen_uniform(r, 1e-9, 1), v = gen_uniform(r, 0, 1);

    return sqrt(-2 * log(u)) * cos(6.283185307179586 * v);
}

void gen_front_camera(saga_camera *c, int width, int height)
{
    memset(c, 0, sizeof *c);
    for (int i = 0; i < 3; i++) {
        c->rotation_q30[4 * i] = 1 << 30;
        c->background_q15[i] = (uint16_t)(8192 * (i + 1));
    }
    c->focal_q16[0] = c->focal_q16[1] = width << 16;
    c->principal_q16[0] = width << 15;
    c->principal_q16[1] = height << 15;
    c->near_plane = 1024;
    c->width = (uint16_t)width;
    c->height = (uint16_t)height;
}

void gen_any_camera(saga_camera *c, gen_rng *r, int width, int height,
                    int32_t reach)
{
    double q[4], len = 0, m[9];

    gen_front_camera(c, width, height);
    for (int i = 0; i < 4; i++) {
        q[i] = gen_normal(r);
        len += q[i] * q[i];
    }
    for (int i = 0; i < 4; i++)
        q[i] /= sqrt(len);
    m[0] = 1 - 2 * (q[2] * q[2] + q[3] * q[3]);
    m[1] = 2 * (q[1] * q[2] - q[0] * q[3]);
    m[2] = 2 * (q[1] * q[3] + q[0] * q[2]);
    m[3] = 2 * (q[1] * q[2] + q[0] * q[3]);
    m[4] = 1 - 2 * (q[1] * q[1] + q[3] * q[3]);
    m[5] = 2 * (q[2] * q[3] - q[0] * q[1]);
    m[6] = 2 * (q[1] * q[3] - q[0] * q[2]);
    m[7] = 2 * (q[2] * q[3] + q[0] * q[1]);
    m[8] = 1 - 2 * (q[1] * q[1] + q[2] * q[2]);
    for (int i = 0; i < 9; i++)
        c->rotation_q30[i] = (int32_t)lrint(m[i] * 1073741824);
    for (int i = 0; i < 3; i++)
        c->centre[i] = gen_int(r, -reach, reach);
    for (int i = 0; i < 2; i++)
        c->principal_q16[i] += 65536 * gen_int(r, -40, 40);
    c->near_plane = 1;
}

static void random_primitive(saga_primitive *p, gen_rng *r,
                             const saga_camera *c)
{
    const double z = gen_uniform(r, 2097152, 8388000);
    const double f = c->focal_q16[0] / 65536.0;
    const double px = gen_uniform(r, 0, c->width) - c->width / 2.0;
    const double py = gen_uniform(r, 0, c->height) - c->height / 2.0;

    memset(p, 0, sizeof *p);
    p->x[0] = (int32_t)(px * z / f);
    p->x[1] = (int32_t)(py * z / f);
    p->x[2] = (int32_t)z;
    p->t_centre = 32768;
    for (int i = 0; i < 3; i++) {
        const double log2_px = log2(1.02) + 0.95 * gen_normal(r);

        p->support[i] = 1 << 16;
        p->log2_scale_q10[i] = (int16_t)lrint(1024 * (log2_px + log2(z / f)));
    }
    for (int i = 0; i < 4; i++)
        p->quat[i] = (int16_t)gen_int(r, -16384, 16384);
    /* The opacity is below 1: 1 / (1 + 2^-normal) = 8 / (1 + 2^(3 - o)). */
    p->opacity = (int16_t)lrint(
        4096 * (3 - log2(8 * (1 + exp2(-2.0 * gen_normal(r))) - 1)));
}

void gen_uniform_scene(saga_primitive *p, uint32_t n, gen_rng *r,
                       const saga_camera *c)
{
    for (uint32_t i = 0; i < n; i++)
        random_primitive(p + i, r, c);
}

void gen_colour(uint16_t colour_q15[3], uint32_t index)
{
    gen_rng r = { index };

    for (int i = 0; i < 3; i++)
        colour_q15[i] = (uint16_t)gen_int(&r, 0, 32768);
}

uint32_t gen_splats(saga_splat *splats, uint32_t *source,
                    const saga_primitive *p, const saga_prim_format *f,
                    uint32_t n, const saga_camera *c, int32_t t)
{
    uint32_t n_splats = 0;
    saga_animated a;

    for (uint32_t i = 0; i < n; i++) {
        saga_animate(&a, p + i, f, t);
        if (!saga_project(splats + n_splats, &a, c, 0))
            continue;
        gen_colour(splats[n_splats].colour_q15, i);
        if (source)
            source[n_splats] = i;
        n_splats++;
    }
    return n_splats;
}
