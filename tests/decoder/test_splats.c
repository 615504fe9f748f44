/* SPDX-License-Identifier: MIT
 *
 * Runs of primitives become splats. The vector code is compared bit by bit with
 * animate.c and project.c, over primitives and cameras of every kind, with
 * canaries after the splats.
 */
#include "animate.h"
#include "every_cpu.h"
#include "gen_hard.h"
#include "project.h"
#include "splats.h"

enum { COUNT = 30000, N = 8, MOST_NBYTES = sizeof(saga_primitive) + 16 };

static void any_format(saga_prim_format *f, gen_rng *r)
{
    gen_hard_format(f, r);
    f->nbytes += (uint8_t)(8 * gen_int(r, 0, 2));
    f->tools = gen_int(r, 0, 1) ? SAGA_TOOL_STEEP : 0;
}

/* Makes a primitive that the camera sees, unless motion moves it away. */
static void any_primitive(saga_primitive *p, gen_rng *r, const saga_camera *c)
{
    saga_animated a;

    gen_hard_primitive(p, r, 14);
    gen_hard_animated(&a, r, c);
    for (int i = 0; i < 3; i++) {
        p->x[i] = a.x[i];
        p->support[i] = gen_shifted(r, 1 << 22, 1 << 23, 22);
        p->log2_scale_q10[i] = (int16_t)a.log2_scale_q10[i];
    }
    p->t_centre = gen_one_in(r, 2) ? gen_int(r, -32768, 98303) : 32768;
    for (int i = 0; i < 9; i++)
        p->motion[i] = gen_one_in(r, 3) ? 0 : (int16_t)(p->motion[i] / 4096);
    if (!gen_one_in(r, 3))
        p->opacity = (int16_t)gen_int(r, 0, 32767);
    if (gen_one_in(r, 2))
        p->log2_width_q10 = (int16_t)gen_int(r, 10000, 32767);
}

/* Makes a primitive with all values at their limits. */
static void edge_primitive(saga_primitive *p, gen_rng *r)
{
    gen_hard_primitive(p, r, 14);
    for (int i = 0; i < 3; i++) {
        p->x[i] = gen_one_in(r, 2) ? -(1 << 23) : gen_int(r, -4, 4);
        p->support[i] = gen_one_in(r, 2) ? 1 : 1 << 23;
    }
    p->t_centre = gen_one_in(r, 2) ? -32768 : 98303;
    for (int i = 0; i < 4; i++)
        p->quat[i] = gen_one_in(r, 2) ? 32767 : -32767;
    for (int i = 0; i < 9; i++)
        p->motion[i] = gen_one_in(r, 2) ? 32767 : -32767;
}

static int same_splat(const saga_splat *a, const saga_splat *b)
{
    return !memcmp(a, b, offsetof(saga_splat, colour_q15)) && a->x0 == b->x0 &&
           a->x1 == b->x1 && a->y0 == b->y0 && a->y1 == b->y1;
}

/* Compares the two paths; returns the number of splats. The array of a run has
 * the format's distance from one primitive to the next. */
static uint32_t compare(const saga_primitive *p, uint32_t n,
                        const saga_look *look)
{
    _Alignas(saga_primitive) uint8_t run[N * MOST_NBYTES] = { 0 };
    saga_splat got[N + 1], want[N + 1], canary;
    uint32_t n_want = 0, seen;

    memset(&canary, 0x5a, sizeof canary);
    for (uint32_t i = 0; i <= N; i++)
        got[i] = canary;
    for (uint32_t i = 0; i < n; i++)
        memcpy(run + i * look->format->nbytes, p + i, sizeof *p);
    seen = saga_splats(got, (const saga_primitive *)(void *)run, n, look, cpu);
    for (uint32_t i = 0; i < n; i++) {
        saga_animated a;
        int is_splat;

        saga_animate(&a, p + i, look->format, look->t);
        is_splat = saga_project(want + n_want, &a, look->camera,
                                look->format->tools);
        assert_int_equal(seen >> i & 1, is_splat);
        n_want += (uint32_t)is_splat;
    }
    assert_int_equal(seen >> (n - 1) >> 1, 0);
    for (uint32_t i = 0; i < n_want; i++)
        assert_true(same_splat(got + i, want + i));
    assert_memory_equal(got + n, &canary, sizeof canary);
    return n_want;
}

TEST(runs_should_be_animate_and_project)
{
    gen_rng r = gen_seeded(61);
    uint32_t n_splats = 0;

    for (int i = 0; i < COUNT; i++) {
        const int n = gen_one_in(&r, 8) ? gen_int(&r, 1, N) : N;
        saga_primitive p[N];
        saga_prim_format f;
        saga_camera c;
        saga_look look = { &f, &c, gen_int(&r, 0, 65535) };
        const int width = gen_int(&r, 1, 2000);

        if (gen_one_in(&r, 2))
            gen_hard_camera(&c, &r, width, gen_int(&r, 1, 16384));
        else
            gen_any_camera(&c, &r, width, gen_int(&r, 1, 2000), 1 << 23);
        any_format(&f, &r);
        for (int k = 0; k < n; k++)
            if (gen_one_in(&r, 16))
                edge_primitive(p + k, &r);
            else
                any_primitive(p + k, &r, &c);
        n_splats += compare(p, (uint32_t)n, &look);
    }
    assert_true(n_splats > COUNT);
}

/* Returns a power of two, one more, or one less. */
static int32_t near_power(gen_rng *r, int most)
{
    return (1 << gen_int(r, 0, most)) + gen_int(r, -1, 1);
}

static int32_t any_sign(gen_rng *r, int32_t x)
{
    return gen_int(r, 0, 1) ? x : -x;
}

/* Makes a camera whose sides, near plane, focal lengths and principal point
 * are powers of two or one more or less, where roundings carry, or limits. Its
 * axes are parallel to those of the cube. */
static void power_camera(saga_camera *c, gen_rng *r)
{
    static const int32_t sides[] = { 1, 16, 640, 16384 };

    gen_front_camera(c, sides[gen_int(r, 0, 3)], sides[gen_int(r, 0, 3)]);
    c->near_plane = near_power(r, 10) + 1;
    c->focal_q16[0] = near_power(r, 30);
    c->focal_q16[1] = gen_one_in(r, 2) ? 1 : near_power(r, 30);
    c->focal_q16[0] += c->focal_q16[0] == 0;
    c->focal_q16[1] += c->focal_q16[1] == 0;
    c->principal_q16[0] = any_sign(r, near_power(r, 29));
    c->principal_q16[1] = c->height * 32768;
    if (gen_one_in(r, 4)) { /* the Jacobian's entries have few bits */
        c->rotation_q30[0] = c->rotation_q30[4] = gen_int(r, 1, 1 << 10);
        c->rotation_q30[8] = 1 << gen_int(r, 4, 30);
        c->focal_q16[0] = c->focal_q16[1] = gen_int(r, 1, 256);
        c->near_plane = 1;
    }
}

static void power_primitive(saga_primitive *p, gen_rng *r)
{
    static const int16_t quats[] = { 0, 1, 16384, 32767, -32767, 23170 };

    memset(p, 0, sizeof *p);
    p->x[2] = near_power(r, 29);
    for (int i = 0; i < 2; i++)
        p->x[i] = any_sign(r, gen_one_in(r, 3) && p->x[2] < 1 << 26
                                  ? 8 * p->x[2] + gen_int(r, -1, 1)
                                  : near_power(r, 29) >> gen_int(r, 0, 29));
    p->opacity = gen_one_in(r, 2) ? 4096 : gen_any16(r, 14);
    p->t_centre = 65535 - near_power(r, 16);
    p->log2_width_q10 = gen_one_in(r, 2) ? 15 << 10 : gen_any16(r, 14);
    for (int i = 0; i < 3; i++) {
        p->support[i] = 1;
        p->log2_scale_q10[i] = (int16_t)(1024 * gen_int(r, -32, 31));
    }
    for (int i = 0; i < 4; i++) {
        p->quat[i] = quats[gen_int(r, 0, 5)];
        p->slope[i] = quats[gen_int(r, 0, 5)];
    }
}

TEST(powers_of_two_should_be_the_same)
{
    gen_rng r = gen_seeded(62);
    uint32_t n_splats = 0;

    for (int i = 0; i < COUNT; i++) {
        saga_primitive p[N];
        saga_prim_format f;
        saga_camera c;
        const saga_look look = { &f, &c, 65535 };

        power_camera(&c, &r);
        any_format(&f, &r);
        for (int k = 0; k < N; k++)
            power_primitive(p + k, &r);
        n_splats += compare(p, N, &look);
    }
    assert_true(n_splats > COUNT / 4);
}
