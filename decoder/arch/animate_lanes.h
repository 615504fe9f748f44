/* SPDX-License-Identifier: MIT
 *
 * decoder/animate.c in vectors. The formulas are the same; animate.c proves
 * that all values fit.
 */
#ifndef SAGA_ANIMATE_LANES_H
#define SAGA_ANIMATE_LANES_H

#include "fx_lanes.h"
#include "model.h"
#include "animate.h"

#ifdef INLINE

_Static_assert(offsetof(saga_primitive, x) == 0 &&
                   offsetof(saga_primitive, t_centre) == 12 &&
                   offsetof(saga_primitive, support) == 16 &&
                   offsetof(saga_primitive, quat) == 28 &&
                   offsetof(saga_primitive, slope) == 36 &&
                   offsetof(saga_primitive, motion) == 44 &&
                   offsetof(saga_primitive, log2_scale_q10) == 62 &&
                   offsetof(saga_primitive, opacity) == 68 &&
                   offsetof(saga_primitive, log2_width_q10) == 70,
               "WORDS");

enum { WORDS = SAGA_PRIM_NBYTES / 8 }; /* words of 64 bits */

/* LANES primitives. Each vector holds one word of all of them. */
typedef struct {
    i64s word[WORDS];
} prims;

/* Loads primitives with nbytes for each. */
INLINE void load_prims(prims *to, const saga_primitive *p, size_t nbytes)
{
    const uint8_t *const bytes = (const uint8_t *)p;
    int k;

    for (k = 0; k < WORDS; k++)
        to->word[k] = load_each(bytes + 8 * k, nbytes);
}

/* Returns the 32-bit field at byte `at` of each primitive; low (lanes.h). */
INLINE i64s field32(const prims *p, int at)
{
    return at & 4 ? shift_down(p->word[at >> 3], 32) : p->word[at >> 3];
}

/* Returns the 16-bit field at byte `at` of each primitive; low. */
INLINE i64s field16(const prims *p, int at)
{
    const i64s half = field32(p, at);

    return (i64s)(at & 2 ? (i32s)half >> 16 : (i32s)((u32s)half << 16) >> 16);
}

/* The place of each primitive in its own time, as in animate.c. */
typedef struct {
    i64s dt;
    i64s u; /* |dt| / width, Q16, at most 16 */
    i64s age;
} moment;

INLINE i64s width_ratio_q16(i64s abs_dt, i64s log2_width_q10)
{
    const i64s e = 0 - log2_width_q10;
    const i64s whole = widen((i64s)((i32s)e >> 10));
    const i64s product = mul(abs_dt, exp2_frac_q10_q30(e));
    const rounding r = round_by(max_small(14 - whole, all(10)));

    return clamp_each(round_each(product, &r), 0, LIMIT_U);
}

/* Computes the moment of each primitive. For the age, a width longer than half
 * a segment counts as half a segment, which has the ratio 2 |dt|. */
INLINE void find_moment(moment *m, const prims *p, const saga_prim_format *f,
                        int32_t t)
{
    const i64s dt = t - widen(field32(p, 12));
    const i64s abs_dt = abs_small(dt);
    const i64s whole = min_small(abs_dt << 1, all(LIMIT_AGE));

    m->dt = dt;
    m->u = all(0);
    m->age = whole;
    if (f->has_width) {
        const i64s width = widen(field16(p, 70));

        m->u = width_ratio_q16(abs_dt, width);
        m->age = select(negative(width - HALF_SEGMENT),
                        min_small(m->u, all(LIMIT_AGE)), whole);
    }
    m->age = select(negative(dt), 0 - m->age, m->age);
}

INLINE i64s q0_of(const prims *p, const saga_prim_format *f, const moment *m)
{
    const i64s o = 0 - widen(field16(p, 68));
    const int q = f->q_opacity;
    const i64s q0 = softplus2_q12_q20(
        (q <= 12 ? shift_up(o, 12 - q) : round_off(o, q - 12)) +
        (SAGA_PEAK_LOG2 << 12));

    if (!f->has_width)
        return q0;
    return q0 + round_low(mul_wide(mul(m->u, m->u), all(LOG2_E_Q20)), 32);
}

INLINE i64s motion_q20(const prims *p, const saga_prim_format *f, int axis,
                       i64s age)
{
    i64s sum = all(0);
    int order;

    for (order = f->motion_order; order >= 1; order--) {
        const int k = order - 1;
        const i64s b = k == 0   ? field16(p, 44 + 2 * axis)
                       : k == 1 ? field16(p, 50 + 2 * axis)
                                : field16(p, 56 + 2 * axis);

        sum += mul(b, all(1 << (20 - f->q_motion[k])));
        sum = round_off(mul_wide(sum, age), 16);
    }
    return clamp_each(sum, -LIMIT_MOTION, LIMIT_MOTION);
}

INLINE void mean_of(i64s x[3], const prims *p, const saga_prim_format *f,
                    i64s age)
{
    int i;

    for (i = 0; i < 3; i++) {
        const i64s support = field32(p, 16 + 4 * i);
        const i64s m = mul_wide(motion_q20(p, f, i, age), support);

        x[i] = clamp_each(widen(field32(p, 4 * i)) + round_off(m, 20), -LIMIT_X,
                          LIMIT_X);
    }
}

/* Sets q to the quaternion at the age, with 30 bits; low. animate.c shifts the
 * bits above 30 away, and project.c shifts the result to 30 bits. Here both
 * shifts are one. They differ only if animate.c rounds up to 2^30, which
 * project.c halves. */
INLINE void quat_of(i64s q[4], const prims *p, const saga_prim_format *f,
                    i64s age)
{
    i64s bits = all(0), rounded = all(0), n, is_zero;
    int i;

    for (i = 0; i < 4; i++) {
        q[i] = mul(field16(p, 28 + 2 * i), all(1 << (20 - f->q_quat)));
        if (f->has_slope)
            q[i] += round_off(
                shift_up(mul(field16(p, 36 + 2 * i), age), 20 - f->q_slope),
                16);
        bits |= abs_each(q[i]);
    }
    /* Shift the values up to 62 bits, then down by 32 with one rounding, so
     * that 30 bits remain. */
    n = 62 - n_bits(bits);
    is_zero = negative(bits - 1);
    for (i = 0; i < 4; i++) {
        q[i] = round_off((i64s)shl((u64s)q[i], (u64s)n), 32);
        rounded |= abs_small(q[i]);
    }
    /* n is 1 in lanes where rounding gave 2^30. These are halved. */
    n = shift_down(rounded, 30);
    for (i = 0; i < 4; i++)
        q[i] = (i64s)shr((u64s)(q[i] + n), (u64s)n);
    q[0] = select(is_zero, all(1 << 29), q[0]);
}

#endif
#endif
