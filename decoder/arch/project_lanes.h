/* SPDX-License-Identifier: MIT
 *
 * decoder/project.c in vectors. The formulas are the same; project.c proves
 * that all values fit. Lanes of primitives that are dropped on the way hold
 * undefined values until the end.
 */
#ifndef SAGA_PROJECT_LANES_H
#define SAGA_PROJECT_LANES_H

#include "animate_lanes.h"
#include "project.h"

#ifdef INLINE

/* Results of projecting the centre that the shape and the box need. */
typedef struct {
    i64s mean_q8[2];
    i64s slope_q16[2]; /* less middle_slope() */
    i64s depth;
    i64s minus_recip; /* negated reciprocal of z, see fx_lanes.h */
    i64s recip_shift;
} centres;

/* Rows of T, low. */
typedef struct {
    i64s t[2][3];
    i64s exp;
} shapes;

typedef struct {
    i64s x0, x1, y0, y1;
} boxes;

/* --- Pairs --------------------------------------------------------------- */

/* Returns the pair for y 2^exp. y has 62 or 63 bits, or is 0. */
INLINE pairs pair_of(i64s y, i64s exp)
{
    const i64s mant = round_low(y, 32);
    const i64s carry = shift_down(mant, 31);
    pairs p;

    p.mant = mant - (carry << 30);
    p.exp = exp + carry;
    return p;
}

/* x < 2^63. */
INLINE pairs pair(i64s x, i64s exp)
{
    const i64s n = n_bits(x);
    const i64s shift = min_small(63 - n, all(62));
    pairs p = pair_of((i64s)shl((u64s)x, (u64s)shift), exp + n - 1);

    p.exp = select(negative(n - 1), all(ZERO_EXP), p.exp);
    return p;
}

/* Returns a b. The product of the mantissas has 61 or 62 bits. */
INLINE pairs pair_mul(pairs a, pairs b)
{
    const i64s product = mul(a.mant, b.mant);
    const i64s top = shift_down(product, 61);

    return pair_of((i64s)shl((u64s)product, (u64s)(2 - top)),
                   a.exp + b.exp + top);
}

/* Returns a + b. The sum of the shifted mantissas has 62 or 63 bits. */
INLINE pairs pair_add(pairs a, pairs b)
{
    const i64s is_b = negative(a.exp - b.exp);
    const i64s hi = select(is_b, b.mant, a.mant) << 31;
    const i64s lo = select(is_b, a.mant, b.mant) << 31;
    const i64s exp = max_small(a.exp, b.exp);
    const i64s n = abs_small(a.exp - b.exp);
    const i64s sum = hi + ((i64s)shr((u64s)lo, (u64s)min_small(n, all(63))) &
                           negative(n - 32));
    const i64s top = shift_down(sum, 62);

    return pair_of((i64s)shl((u64s)sum, (u64s)(1 - top)), exp + top);
}

INLINE i64s pair_q28(pairs a)
{
    const rounding r = round_by(min_small(2 - a.exp, all(63)));

    return round_low_each(a.mant, &r);
}

/* A positive number and its number of bits. */
typedef struct {
    i64s value, bits;
} sized;

/* Converts a pair to Q28, with the number of bits of the result: 31 minus the
 * shift, or one more if rounding carries. */
INLINE sized pair_q28_sized(pairs a)
{
    const i64s n = max_small(29 + a.exp, all(0));
    sized s;

    s.value = pair_q28(a);
    s.bits = n + (i64s)shr((u64s)s.value, (u64s)n);
    return s;
}

/* --- The centre ---------------------------------------------------------- */

INLINE i64s view_coordinate(const int32_t *row, const i64s *d)
{
    return mul(d[0], all(row[0])) + mul(d[1], all(row[1])) +
           mul(d[2], all(row[2]));
}

/* Returns the middle of the range of slopes. Slopes are stored relative to it,
 * so that they fit 32 bits. */
INLINE int64_t middle_slope(const saga_camera *c, int axis)
{
    const int32_t side = axis == 0 ? c->width : c->height;

    return side * (int64_t)32768 - c->principal_q16[axis];
}

/* Returns a negative number in lanes whose mean is too far away. */
INLINE i64s project_axis(centres *o, const saga_camera *c, int axis, i64s x,
                         const rounding *r)
{
    const int32_t side = axis == 0 ? c->width : c->height;
    const int64_t principal = c->principal_q16[axis];
    const int64_t reach = side * (int64_t)(32768 + BORDER_Q16);
    const i64s ratio_q28 = clamp_each(round_each(0 - mul(x, o->minus_recip), r),
                                      -INT32_MAX, INT32_MAX);
    const i64s focal_q44 = mul(ratio_q28, all(c->focal_q16[axis]));
    const i64s mean = round_off(focal_q44 + principal * ((int64_t)1 << 28), 36);

    o->mean_q8[axis] = mean;
    o->slope_q16[axis] = clamp_each(
        round_off(focal_q44, 28) - middle_slope(c, axis), -reach, reach);
    return LIMIT_MEAN - abs_small(mean - side * 128);
}

/* Returns a negative number in lanes whose primitive is dropped. */
INLINE i64s project_centres(centres *o, const i64s *x, const saga_camera *c)
{
    const i64s d[3] = { x[0] - c->centre[0], x[1] - c->centre[1],
                        x[2] - c->centre[2] };
    const i64s vx = view_coordinate(c->rotation_q30, d);
    const i64s vy = view_coordinate(c->rotation_q30 + 3, d);
    const i64s vz = view_coordinate(c->rotation_q30 + 6, d);
    const i64s depth = round_off(vz, 30);
    const i64s shift = max_small(n_bits(vz) - 27, all(1));
    const rounding r = round_by(shift);
    const i64s z = round_each(vz, &r);
    const i64s over = shift_down(z, 27); /* 1 if rounded up to 28 bits */
    const rounding by = round_by((over & 1) + 29);
    i64s out = (depth - c->near_plane) |
               (vz - 1 - shift_down(abs_each(vx), 3)) |
               (vz - 1 - shift_down(abs_each(vy), 3));

    o->depth = depth;
    o->minus_recip = minus_recip32_of(
        (i64s)shr((u64s)(z << 5), (u64s)(over & 1)));
    o->recip_shift = over + shift + (57 - 30);
    out |= project_axis(o, c, 0, round_each(vx, &r), &by);
    out |= project_axis(o, c, 1, round_each(vy, &r), &by);
    return out;
}

/* --- The shape ----------------------------------------------------------- */

/* Computes the rotation matrix times |q|^2 and returns |q|^2. All are shifted
 * right by *k bits, so that |q|^2 has 30 bits. */
INLINE i64s rotation(i64s r[9], i64s *k, const i64s q[4])
{
    const i64s ww = mul(q[0], q[0]), xx = mul(q[1], q[1]);
    const i64s yy = mul(q[2], q[2]), zz = mul(q[3], q[3]);
    const i64s xy = mul(q[1], q[2]) << 1, wz = mul(q[0], q[3]) << 1;
    const i64s xz = mul(q[1], q[3]) << 1, wy = mul(q[0], q[2]) << 1;
    const i64s yz = mul(q[2], q[3]) << 1, wx = mul(q[0], q[1]) << 1;
    const i64s norm = ww + xx + yy + zz;
    rounding by;
    int i;

    r[0] = ww + xx - yy - zz;
    r[1] = xy - wz;
    r[2] = xz + wy;
    r[3] = xy + wz;
    r[4] = ww - xx + yy - zz;
    r[5] = yz - wx;
    r[6] = xz - wy;
    r[7] = yz + wx;
    r[8] = ww - xx - yy + zz;
    /* Every entry is at most |q|^2, so that one shift suits all. */
    *k = 28 + n_bits_nibble(shift_down(norm, 58));
    by = round_by(*k);
    for (i = 0; i < 9; i++)
        r[i] = round_low_each(r[i], &by);
    return round_low_each(norm, &by);
}

/* Computes the two rows of depth * J W, which are low. Returns their common
 * shift. */
INLINE i64s jacobian(i64s u[6], const centres *o, const saga_camera *c)
{
    const int32_t *const w = c->rotation_q30;
    const i64s zero = all(0);
    i64s bits = all(1), n;
    rounding down;
    int i;

    for (i = 0; i < 6; i++) {
        const int axis = i >= 3;

        u[i] = all((int64_t)c->focal_q16[axis] * w[i] -
                   middle_slope(c, axis) * w[6 + i - 3 * axis]) -
               mul(o->slope_q16[axis], all(w[6 + i - 3 * axis]));
        bits |= abs_each(u[i]);
    }
    n = n_bits(bits) - 30;
    down = round_by(max_small(n, zero));
    for (i = 0; i < 6; i++)
        u[i] = (i64s)shl((u64s)round_each(u[i], &down),
                         (u64s)max_small(0 - n, zero));
    return n;
}

/* Low. */
INLINE void turn_rows(i64s p[2][3], const i64s *u, const i64s *r)
{
    int i, k;

    for (i = 0; i < 2; i++)
        for (k = 0; k < 3; k++)
            p[i][k] = round_low(mul(u[3 * i], r[k]) +
                                    mul(u[3 * i + 1], r[3 + k]) +
                                    mul(u[3 * i + 2], r[6 + k]),
                                30);
}

INLINE void scale_columns(shapes *s, i64s p[2][3], const i64s log2_scale[3],
                          i64s factor)
{
    i64s bits[3], e[3], top;
    int k;

    for (k = 0; k < 3; k++) {
        bits[k] = lower(abs_small(p[0][k]) | abs_small(p[1][k]));
        e[k] = widen((i64s)((i32s)log2_scale[k] >> 10));
    }
    bits[0] = n_bits_halves(bits[0] | shift_up(bits[1], 32));
    top = max_small(e[0] + lower(bits[0]), e[1] + shift_down(bits[0], 32));
    top = max_small(top, e[2] + n_bits(bits[2]));
    for (k = 0; k < 3; k++) {
        const i64s n = top - e[k] + 1;
        const rounding r = round_by(min_small(n, all(62)));
        const i64s m = round_low(
                           (i64s)mul_u((u64s)exp2_frac_q10_q30(log2_scale[k]),
                                       (u64s)factor),
                           31) &
                       negative(n - 62);

        s->t[0][k] = round_each(mul(p[0][k], m), &r);
        s->t[1][k] = round_each(mul(p[1][k], m), &r);
    }
    s->exp = top + 1;
}

INLINE void project_shapes(shapes *s, const prims *a, const i64s quat[4],
                           const centres *o, const saga_camera *c)
{
    const i64s log2_scale[3] = { field16(a, 62), field16(a, 64),
                                 field16(a, 66) };
    i64s u[6], r[9], p[2][3], k;
    const i64s shift = jacobian(u, o, c);
    const i64s norm = rotation(r, &k, quat);
    const i64s over = shift_down(norm, 30); /* 1 if rounded up to 31 bits */
    const i64s minus_recip = minus_recip32_of(
        (i64s)shr((u64s)(norm << 2), (u64s)over));

    turn_rows(p, u, r);
    scale_columns(s, p, log2_scale,
                  round_low(mul(minus_recip, o->minus_recip), 31));
    s->exp += shift + (62 - 46 - 60) - over - o->recip_shift;
}

/* --- The conic ----------------------------------------------------------- */

INLINE i64s dot3(const i64s *a, const i64s *b)
{
    return mul(a[0], b[0]) + mul(a[1], b[1]) + mul(a[2], b[2]);
}

INLINE pairs cross_squared(const shapes *s)
{
    const i64s *const a = s->t[0];
    const i64s *const b = s->t[1];
    const i64s c0 = mul(a[1], b[2]) - mul(a[2], b[1]);
    const i64s c1 = mul(a[2], b[0]) - mul(a[0], b[2]);
    const i64s c2 = mul(a[0], b[1]) - mul(a[1], b[0]);
    const i64s bits = n_bits(abs_each(c0) | abs_each(c1) | abs_each(c2));
    const i64s n = max_small(bits - 30, all(0));
    const rounding r = round_by(n);
    const i64s m0 = round_low_each(c0, &r);
    const i64s m1 = round_low_each(c1, &r);
    const i64s m2 = round_low_each(c2, &r);

    return pair(mul(m0, m0) + mul(m1, m1) + mul(m2, m2),
                (s->exp << 2) + (n << 1));
}

INLINE pairs constant(uint32_t mant, int32_t exp)
{
    pairs p;

    p.mant = all(mant);
    p.exp = all(exp);
    return p;
}

/* The factors g, n, h of the conic. */
typedef struct {
    sized g, h;
    i64s n;
} factors;

INLINE void conics(factors *f, const shapes *s)
{
    const pairs low_pass = constant(LOW_PASS);
    const pairs low_pass_2 = constant(LOW_PASS_2);
    const i64s a0 = dot3(s->t[0], s->t[0]);
    const i64s b = dot3(s->t[0], s->t[1]);
    const i64s c0 = dot3(s->t[1], s->t[1]);
    const i64s exp = s->exp << 1;
    const pairs c = pair_add(pair(c0, exp), low_pass);
    const pairs trace = pair(a0 + c0, exp);
    const pairs det = pair_add(
        pair_add(cross_squared(s), pair_mul(trace, low_pass)), low_pass_2);
    const pairs h = pair_mul(rsqrt_each(c), constant(ROOT_K));
    const pairs m = pair_mul(rsqrt_each(det), h);
    const i64s n = pair_q28(pair_mul(pair(abs_each(b), exp), m));

    f->g = pair_q28_sized(pair_mul(c, m));
    f->n = select(negative(b), 0 - n, n);
    f->h = pair_q28_sized(h);
}

/* --- The box ------------------------------------------------------------- */

/* Returns (e >> shift) + 1, or 2^25 if the shift is 0 or less or if `none` is
 * negative. */
INLINE i64s extent_of(i64s e, i64s shift, i64s none)
{
    const i64s n = max_small(shift, all(0)), limit = all(LIMIT_EXTENT);
    const i64s extent = clamp_each((i64s)shr((u64s)e, (u64s)n) + 1, 0,
                                   LIMIT_EXTENT);

    return select(negative((shift - 1) | none), limit, extent);
}

/* Returns the mantissa of saga_recip16 plus two units, which is an upper bound.
 * Its shift is 15 plus the number of bits of x. */
INLINE i64s recip_up(sized x)
{
    return recip16_of((i64s)shl((u64s)x.value, (u64s)(32 - x.bits))) + 2;
}

INLINE void extents(i64s *ex, i64s *ey, i64s l_q12, const factors *f)
{
    const i64s recip_g = recip_up(f->g), recip_h = recip_up(f->h);
    const i64s no_g = f->g.value - 1, no_h = f->h.value - 1;
    const i64s square = mul(f->h.value, f->h.value) + mul(f->n, f->n);
    const i64s j = shift_down(n_bits(square) + (64 - 22), 1) - 32;
    const i64s down = max_small(j, all(0)), up = max_small(0 - j, all(0));
    const i64s root = (i64s)shl(shr((u64s)square, (u64s)(down + down)),
                                (u64s)(up + up)) +
                      min_small(down, all(1));
    const i64s e = mul(mul(l_q12, sqrt_up_each(root)), recip_g);

    *ey = extent_of(mul(l_q12, recip_h), f->h.bits + (15 - 24), no_h);
    *ex = extent_of(mul_wide(e, recip_h), f->g.bits + f->h.bits - j + (30 - 22),
                    no_g | no_h);
}

/* Returns a negative number in lanes without any pixel. */
INLINE i64s pixel_range(i64s *from, i64s *to, i64s mean_q8, i64s extent_q8,
                        int32_t side)
{
    const i64s lo = (i64s)((i32s)(mean_q8 - extent_q8 + 127) >> 8);
    const i64s hi = (i64s)((i32s)(mean_q8 + extent_q8 - 128) >> 8);

    *from = clamp_small(lo, 0, side);
    *to = clamp_small(hi + 1, 0, side);
    return lower(*to) - lower(*from) - 1;
}

/* saga_reach_q20 of each. */
INLINE i64s reach_of(i64s q0, uint32_t tools)
{
    const i64s rest = SAGA_CUT_Q20 - q0;

    if (!(tools & SAGA_TOOL_STEEP))
        return rest;
    return (2 * sqrt_up_each((1 << 18) + shift_down(rest, 1)) - 4096) * 256;
}

INLINE i64s boxes_of(boxes *b, const centres *o, i64s reach, const factors *f,
                     const saga_camera *c)
{
    const i64s l_q12 = sqrt_up_each(reach);
    i64s ex, ey;

    extents(&ex, &ey, l_q12, f);
    return pixel_range(&b->x0, &b->x1, o->mean_q8[0], ex, c->width) |
           pixel_range(&b->y0, &b->y1, o->mean_q8[1], ey, c->height);
}

#endif
#endif
