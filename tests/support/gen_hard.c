/* SPDX-License-Identifier: MIT
 *
 * See gen_hard.h.
 */
#include "gen_hard.h"

#include <math.h>

static const double limit_x = 536870912; /* 2^29 */

static double clamp(double x, double lo, double hi)
{
    return x < lo ? lo : x > hi ? hi : x;
}

static int32_t to_int(double x, double limit)
{
    return (int32_t)lrint(clamp(x, -limit, limit));
}

int32_t gen_shifted(gen_rng *r, int32_t lo, int32_t hi, int max_shift)
{
    const int32_t x = gen_int(r, lo, hi);

    return x >> gen_int(r, 0, max_shift);
}

int16_t gen_any16(gen_rng *r, int max_shift)
{
    static const int16_t edges[] = { -32768, -32767, -1, 0, 1, 32767 };

    if (gen_one_in(r, 4))
        return edges[gen_int(r, 0, 5)];
    return (int16_t)gen_shifted(r, -32768, 32767, max_shift);
}

void gen_hard_camera(saga_camera *c, gen_rng *r, int width, int height)
{
    static const int32_t reach[] = { 0, 1 << 12, 1 << 23, 1 << 27, 1 << 29 };
    const double focal = width * exp2(gen_uniform(r, -4, 5));

    gen_any_camera(c, r, width, height, reach[gen_int(r, 0, 4)]);
    for (int i = 0; i < 3 && gen_one_in(r, 8); i++)
        c->centre[i] = gen_one_in(r, 2) ? 1 << 29 : -(1 << 29);
    for (int i = 0; i < 2; i++) {
        const double f = focal * exp2(gen_uniform(r, -1, 1));

        c->focal_q16[i] = to_int(clamp(f * 65536, 1, INT32_MAX), INT32_MAX);
        if (gen_one_in(r, 8))
            c->principal_q16[i] = gen_int(r, -(1 << 26), 1 << 26);
    }
    c->near_plane = gen_one_in(r, 2) ? 1 : 1 << gen_int(r, 0, 16);
}

/* Sets x to the box coordinates of the point that a pixel shows at depth z. */
static void place(int32_t *x, const saga_camera *c, const double *pixel,
                  double z)
{
    double v[3] = { 0, 0, z };

    for (int i = 0; i < 2; i++)
        v[i] = (pixel[i] - c->principal_q16[i] / 65536.0) * z /
               (c->focal_q16[i] / 65536.0);
    for (int i = 0; i < 3; i++) {
        double sum = c->centre[i];

        for (int k = 0; k < 3; k++)
            sum += c->rotation_q30[3 * k + i] / 1073741824.0 * v[k];
        x[i] = to_int(sum, limit_x);
    }
}

static void hard_position(saga_animated *a, gen_rng *r, const saga_camera *c,
                          double z)
{
    const double border = gen_one_in(r, 8) ? 40 : gen_one_in(r, 4) ? 2 : 0.2;
    double pixel[2];

    pixel[0] = c->width * gen_uniform(r, -border, 1 + border);
    pixel[1] = c->height * gen_uniform(r, -border, 1 + border);
    place(a->x, c, pixel, gen_one_in(r, 32) ? -z : z);
    for (int i = 0; i < 3 && gen_one_in(r, 64); i++)
        a->x[i] = gen_int(r, -(1 << 29), 1 << 29);
}

/* Sets a random quaternion: with all bits, with few bits, with components of at
 * most 3, or with components of -1, 0 and 1. */
static void hard_quat(saga_animated *a, gen_rng *r)
{
    const int32_t reach[] = { 1 << 30, 1 << 30, 1 << 14, 3, 1 };
    const int32_t n = reach[gen_int(r, 0, 4)];

    for (int i = 0; i < 4; i++)
        a->quat[i] = gen_int(r, -n, n);
    for (int i = 0; i < 4 && gen_one_in(r, 4); i++)
        a->quat[i] = 0;
    if (gen_one_in(r, 16))
        a->quat[gen_int(r, 0, 3)] = gen_one_in(r, 2) ? 1 << 30 : -(1 << 30);
}

/* Sets scales with a standard deviation of 0.01 to 10^6 pixels in the picture,
 * and with ratios between axes of up to 10^4. */
static void hard_scale(saga_animated *a, gen_rng *r, const saga_camera *c,
                       double z)
{
    const double sigma = log2(0.01) + gen_uniform(r, 0, log2(1e8));
    const double ratio = gen_one_in(r, 2) ? 1.5 : log2(1e4);

    for (int i = 0; i < 3; i++) {
        const double log2_box = fmax(sigma - gen_uniform(r, 0, ratio),
                                     log2(0.01)) +
                                log2(z * 65536.0 / c->focal_q16[0]);

        a->log2_scale_q10[i] = to_int(1024 * log2_box, 32767);
    }
}

void gen_hard_animated(saga_animated *a, gen_rng *r, const saga_camera *c)
{
    const double z = exp2(gen_uniform(r, 0, 29));
    const int32_t cut = 11 << 20;

    hard_position(a, r, c, z);
    hard_quat(a, r);
    hard_scale(a, r, c, z);
    a->q0_q20 = gen_int(r, 0, gen_one_in(r, 4) ? 1 << 20 : cut - 1);
    if (gen_one_in(r, 16))
        a->q0_q20 = gen_one_in(r, 2) ? 0 : cut - gen_int(r, 1, 1 << 14);
    if (gen_one_in(r, 64))
        a->q0_q20 = cut + gen_int(r, 0, 1 << 20);
}

void gen_hard_format(saga_prim_format *f, gen_rng *r)
{
    *f = (saga_prim_format){ 0 };
    f->q_quat = (uint8_t)gen_int(r, 0, 20);
    f->q_slope = (uint8_t)gen_int(r, 0, 20);
    f->q_opacity = (uint8_t)gen_int(r, 0, 20);
    for (int i = 0; i < 3; i++)
        f->q_motion[i] = (uint8_t)gen_int(r, 0, 20);
    f->nbytes = sizeof(saga_primitive);
    f->motion_order = (uint8_t)gen_int(r, 0, 3);
    f->has_slope = (uint8_t)gen_int(r, 0, 1);
    f->has_width = (uint8_t)gen_int(r, 0, 1);
}

void gen_hard_primitive(saga_primitive *p, gen_rng *r, int max_shift)
{
    static const int32_t times[] = { -32768, 0, 32768, 65535, 98303 };

    for (int i = 0; i < 3; i++) {
        p->x[i] = gen_one_in(r, 4) ? -(1 << 23)
                                   : gen_int(r, -(1 << 23), (1 << 23) - 1);
        p->support[i] = 1 << gen_int(r, 0, 23);
        if (gen_one_in(r, 2))
            p->support[i] = gen_int(r, 1, 1 << 23);
        p->log2_scale_q10[i] = gen_any16(r, max_shift);
    }
    p->t_centre = gen_one_in(r, 4) ? times[gen_int(r, 0, 4)]
                                   : gen_int(r, -32768, 98303);
    for (int i = 0; i < 4; i++) {
        p->quat[i] = gen_any16(r, max_shift);
        p->slope[i] = gen_any16(r, max_shift);
    }
    for (int i = 0; i < 9; i++)
        p->motion[i] = gen_any16(r, max_shift);
    p->opacity = gen_any16(r, max_shift);
    p->log2_width_q10 = gen_any16(r, max_shift);
}
