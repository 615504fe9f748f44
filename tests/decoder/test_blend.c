/* SPDX-License-Identifier: MIT
 *
 * Blending of a splat into a tile. The plain loops are compared pixel by pixel
 * with the integer formulas of docs/arithmetic.md, and the SIMD loops with the
 * plain loops. Canaries around the tile show writes outside of it.
 */
#include "blend.h"
#include "every_cpu.h"
#include "gen_scene.h"
#include "ref_render.h"
#include "sqrt_up.h"

enum { GUARD = 64, MOST = 4 * 64 * 64, COUNT = 4000, CUT = 11 << 20 };

/* The largest factor of a conic (docs/arithmetic.md), 2.686, in Q28. */
#define MOST_FACTOR 721000000

/* A tile: guards, the four planes, guards. */
typedef struct {
    uint32_t block[GUARD + MOST + GUARD];
} tile;

static tile want, got;

static int32_t any_of(gen_rng *r, const int32_t *values, int n)
{
    return values[gen_int(r, 0, n - 1)];
}

/* Returns a number with a random number of bits, so that all magnitudes occur.
 */
static int32_t any_size(gen_rng *r, int32_t most)
{
    return gen_int(r, 0, most) >> gen_int(r, 0, 28);
}

/* Fills a tile with T in 0..65536, mostly at the limits, and with C for which
 * one more splat fits. */
static void fill_tile(tile *to, gen_rng *r, uint32_t n)
{
    uint32_t *const t = to->block + GUARD;
    static const int32_t limits[] = { 65536, 65535, 0, 1, 7, 8, 9 };
    uint32_t i;

    for (i = 0; i < n; i++)
        t[i] = gen_int(r, 0, 3) ? (uint32_t)gen_int(r, 0, 65536)
                                : (uint32_t)any_of(r, limits, 7);
    for (; i < 4 * n; i++)
        t[i] = gen_u32(r) >> 2;
    for (i = 0; i < GUARD; i++)
        t[(int32_t)i - GUARD] = t[4 * n + i] = 0xa5a5a5a5;
}

/* Makes a patch in a tile of `side`, whose first row is `first`. Mostly its v
 * and w are small somewhere in the tile. */
static void any_patch(saga_patch *p, gen_rng *r, int32_t side, int32_t first)
{
    static const int32_t colours[] = { 0, 1, 32767, 32768 };
    static const int32_t q[] = { 0, 1, CUT - 1, CUT - (1 << 20),
                                 (4 << 20) - 1 };
    int64_t x, y;

    memset(p, 0, sizeof *p);
    p->x0 = gen_int(r, 0, side - 1);
    p->x1 = gen_int(r, p->x0 + 1, side);
    p->n_rows = (uint32_t)gen_int(r, 1, side - first);
    p->g = any_size(r, MOST_FACTOR);
    p->h = any_size(r, MOST_FACTOR);
    p->n = any_size(r, MOST_FACTOR) * (gen_int(r, 0, 1) ? 1 : -1);
    p->q0 = gen_int(r, 0, 2) ? any_size(r, CUT - 1) : any_of(r, q, 5);
    p->tools = gen_int(r, 0, 1) ? SAGA_TOOL_STEEP : 0;
    p->reach = saga_reach_q20(CUT - p->q0, p->tools);
    x = gen_int(r, -4 * 256, (side + 4) * 256);
    y = gen_int(r, -4 * 256, (side + 4) * 256);
    p->v = (-p->g * x + p->n * y) >> 8;
    p->w = -p->h * y >> 8;
    if (gen_int(r, 0, 7) == 0)
        p->v += gen_int(r, -100, 100) * ((int64_t)1 << gen_int(r, 20, 45));
    if (gen_int(r, 0, 7) == 0)
        p->w = gen_int(r, -100, 100) * ((int64_t)1 << gen_int(r, 20, 45));
    for (int i = 0; i < 3; i++)
        p->colour_q15[i] = (uint16_t)any_of(r, colours, 4);
    if (gen_int(r, 0, 3) == 0) { /* values half-way between two roundings */
        p->g &= ~0x7fff;
        p->h &= ~0x7fff;
        p->n &= ~0x7fff;
        p->v = (p->v & ~(int64_t)0x7fff) | 0x4000;
        p->w = (p->w & ~(int64_t)0x7fff) | 0x4000;
    }
}

/* Blends a pixel by the formula of docs/arithmetic.md, from the pixel's own v
 * and w. */
static void blend_pixel(uint32_t *t, uint32_t plane, const saga_patch *p,
                        int64_t x, int64_t y)
{
    const int64_t v = ((p->v + p->g * x - p->n * y) + (1 << 14)) >> 15;
    const int64_t w = ((p->w + p->h * y) + (1 << 14)) >> 15;
    uint32_t weight;
    int64_t s, q, half;

    if (*t < 8 || v < -65536 || v > 65536 || w < -65536 || w > 65536)
        return;
    s = ((w * w + 32) >> 6) + ((v * v + 32) >> 6);
    q = p->q0 + s;
    if (p->tools & SAGA_TOOL_STEEP) {
        half = (s < 8388607 ? s + 128 : 8388735) >> 8;
        q += (half * half + 16) >> 5;
    }
    if (q >= CUT)
        return;
    weight = (ref_alpha_q16((int32_t)q) * *t + 0x8000) >> 16;
    *t -= weight;
    for (uint32_t k = 0; k < 3; k++)
        t[(k + 1) * plane] += weight * p->colour_q15[k];
}

/* Returns whether every pixel outside of the box is beyond the cut, as callers
 * promise. If not, the test widens the box to the tile. */
static int box_holds(const saga_patch *p, int32_t side)
{
    for (int32_t y = 0; y < (int32_t)p->n_rows; y++)
        for (int32_t x = 0; x < side; x++) {
            uint32_t t[4] = { 65536, 0, 0, 0 };

            blend_pixel(t, 1, p, x, y);
            if (t[0] != 65536 && (x < p->x0 || x >= p->x1))
                return 0;
        }
    return 1;
}

static void compare(gen_rng *r, int32_t side)
{
    const int32_t first = gen_int(r, 0, side - 1);
    const uint32_t plane = (uint32_t)(side * side);
    saga_patch p;

    any_patch(&p, r, side, first);
    if (!box_holds(&p, side)) {
        p.x0 = 0;
        p.x1 = side;
    }
    fill_tile(&want, r, plane);
    memcpy(&got, &want, (2 * GUARD + 4 * plane) * sizeof *got.block);
    for (int32_t y = 0; y < (int32_t)p.n_rows; y++)
        for (int32_t x = 0; x < side; x++)
            blend_pixel(want.block + GUARD + (first + y) * side + x, plane, &p,
                        x, y);
    saga_blend(got.block + GUARD + first * side, (uint32_t)side, &p, cpu);
    assert_memory_equal(&got, &want,
                        (2 * GUARD + 4 * plane) * sizeof *got.block);
}

TEST(patches_should_be_those_of_the_norm)
{
    static const int32_t sides[] = { 8, 8, 16, 16, 16, 16, 32, 64 };
    gen_rng r = gen_seeded(51);

    for (int i = 0; i < COUNT; i++)
        compare(&r, any_of(&r, sides, 8));
}

/* q of steep splats must equal q0 + s + s^2 / 2 in double, except for the
 * rounding of v and w to 2^-13 and of s, before it is squared, to 2^-12. */
TEST(steep_should_be_that_of_the_formula)
{
    gen_rng r = gen_seeded(52);

    for (int i = 0; i < COUNT; i++) {
        const saga_splat splat = {
            .chol_q28 = { gen_int(&r, 1, MOST_FACTOR),
                          gen_int(&r, -MOST_FACTOR, MOST_FACTOR),
                          gen_int(&r, 1, MOST_FACTOR) },
            .mean_q8 = { gen_int(&r, -512, 512), gen_int(&r, -512, 512) }
        };
        const double dx = (128 - splat.mean_q8[0]) / 256.0;
        const double dy = (128 - splat.mean_q8[1]) / 256.0;
        const double v = (splat.chol_q28[0] * dx - splat.chol_q28[1] * dy) *
                         0x1p-28;
        const double w = splat.chol_q28[2] * dy * 0x1p-28, s = v * v + w * w;
        const double off = (fabs(v) + fabs(w)) * 0x1p-13 + 0x1p-19;

        if (s < 7.9)
            assert_true(
                fabs(ref_q_q20(&splat, 0, 0, SAGA_TOOL_STEEP) * 0x1p-20 -
                     (s + s * s / 2)) <=
                (1 + s) * off + s * 0x1p-13 + 0x1p-20 + off * off);
    }
}

/* alpha must equal the norm's formula for every entry of the table, at every
 * power of two, with eight values of T each. */
TEST(alpha_should_be_that_of_the_norm)
{
    enum { PLANE = 64 };

    for (int32_t q = 0; q < CUT; q += 511) {
        saga_patch p = { .q0 = q,
                         .reach = CUT - q,
                         .x1 = 8,
                         .n_rows = 1,
                         .colour_q15 = { 32768, 1, 0 } };
        uint32_t a[4 * PLANE] = { 0 }, b[4 * PLANE] = { 0 };

        for (uint32_t i = 0; i < 8; i++) {
            a[i] = b[i] = 65536 >> (2 * i);
            blend_pixel(a + i, PLANE, &p, i, 0);
        }
        saga_blend(b, 8, &p, cpu);
        assert_memory_equal(b, a, sizeof b);
    }
}
