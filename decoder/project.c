/* SPDX-License-Identifier: MIT
 *
 * Projection of an animated primitive; docs/arithmetic.md is normative.
 *
 * Let W be the camera's rotation, R S the primitive's axes and J the Jacobian
 * of the projection. Then the 2-D covariance is T T^t + d I, where T = J W R S
 * (2 x 3) and d is the low-pass. The two rows t0, t1 of T are integers below
 * 2^30 with a common power of two. Values computed from them are pairs of
 * mantissa and exponent, because standard deviations range from 0.01 to 10^6
 * pixels. The result, the Cholesky factor of the conic, is bounded by
 * sqrt(k / d) = 2.686 for every splat.
 */
#include "project.h"

#include "fx.h"
#include "fx_math.h"
#include "sqrt_up.h"

#define ROW_SUM_MAX 1859828213 /* 1.7321 * 2^30: |row| of a rotation */
#define LIMIT_CENTRE (1 << 29)
#define LIMIT_PRINCIPAL (1 << 30)
#define LIMIT_SIDE 16384

/* A point in front of the camera: z in [2^26, 2^27]; x and y have the same
 * scale. */
typedef struct {
    int32_t x, y, z;
    int32_t shift; /* z = depth in box units * 2^(30 - shift) */
    uint32_t depth;
} view_point;

/* Results of projecting the centre that the shape needs. */
typedef struct {
    int32_t mean_q8[2];
    int64_t slope_q16[2]; /* focal * x/z and y/z, clamped */
    uint32_t depth;
    uint32_t recip; /* 1/depth = recip * 2^-recip_shift */
    int32_t recip_shift;
} centre;

/* Rows of T: value = t * 2^exp pixels, |t| <= 2^30. */
typedef struct {
    int32_t t[2][3];
    int32_t exp;
} shape;

static const saga_float low_pass = { LOW_PASS };
static const saga_float low_pass_2 = { LOW_PASS_2 };
static const saga_float root_k = { ROOT_K };

static int64_t abs64(int64_t x)
{
    return x < 0 ? -x : x;
}

/* Returns the number of bits of x, 0 for 0. */
static int n_bits(uint64_t x)
{
    return x ? 64 - fx_clz64(x) : 0;
}

static int row_is_bounded(const int32_t *r)
{
    return abs64(r[0]) + abs64(r[1]) + abs64(r[2]) <= ROW_SUM_MAX;
}

static int in_range(int32_t x, int32_t lo, int32_t hi)
{
    return x >= lo && x <= hi;
}

saga_status saga_camera_check(const saga_camera *c)
{
    int ok = c->near_plane >= 1;
    int i;

    for (i = 0; i < 3; i++) {
        ok &= row_is_bounded(c->rotation_q30 + 3 * i);
        ok &= in_range(c->centre[i], -LIMIT_CENTRE, LIMIT_CENTRE);
        ok &= c->background_q15[i] <= 32768;
    }
    for (i = 0; i < 2; i++) {
        ok &= c->focal_q16[i] > 0;
        ok &= in_range(c->principal_q16[i], -LIMIT_PRINCIPAL, LIMIT_PRINCIPAL);
    }
    ok &= in_range(c->width, 1, LIMIT_SIDE);
    ok &= in_range(c->height, 1, LIMIT_SIDE);
    return ok ? SAGA_OK : SAGA_ERR_ARG;
}

/* --- Pairs --------------------------------------------------------------- */

/* Returns x * 2^exp for x < 2^63, rounded to 31 bits. Zero has the mantissa 0,
 * which pair_add and pair_mul accept. */
static saga_float pair(uint64_t x, int32_t exp)
{
    saga_float f = { 0, ZERO_EXP };
    int n;

    if (x == 0)
        return f;
    /* Shift the highest bit of x to bit 62 and keep the upper 31 bits. */
    n = fx_clz64(x) - 1;
    f.mant_q30 = (uint32_t)(((x << n) + (1u << 31)) >> 32);
    f.exp = exp + 62 - n;
    /* Rounding gave 2^31, which is 2^30 with the next exponent. */
    if (f.mant_q30 >> 31) {
        f.mant_q30 = 1u << 30;
        f.exp++;
    }
    return f;
}

/* Returns a b. Mantissas are below 2^31, so that the product is below 2^62. */
static saga_float pair_mul(saga_float a, saga_float b)
{
    return pair((uint64_t)a.mant_q30 * b.mant_q30, a.exp + b.exp - 60);
}

/* Returns a + b for terms >= 0. Mantissas are scaled to at most 2^62, so that
 * the sum is below 2^63. */
static saga_float pair_add(saga_float a, saga_float b)
{
    const saga_float hi = a.exp >= b.exp ? a : b;
    const saga_float lo = a.exp >= b.exp ? b : a;
    const int32_t n = hi.exp - lo.exp;

    /* lo is below half a unit of hi's mantissa and is ignored. */
    if (n > 31)
        return hi;
    return pair(((uint64_t)hi.mant_q30 << 31) +
                    ((uint64_t)lo.mant_q30 << 31 >> n),
                hi.exp - 61);
}

/* Converts a pair below 4 to Q28, rounded. */
static int32_t pair_q28(saga_float a)
{
    const int32_t n = 2 - a.exp;

    return n > 32 ? 0 : (int32_t)fx_rshift64(a.mant_q30, n);
}

/* --- The centre ---------------------------------------------------------- */

/* Returns a coordinate of x - centre along a row of the rotation. |x - centre|
 * <= 2^30 and a row's sum is at most 1.7321 * 2^30, so that the result is below
 * 2^61. */
static int64_t view_coordinate(const int32_t *row, const int32_t *x,
                               const int32_t *c)
{
    return (int64_t)row[0] * (x[0] - c[0]) + (int64_t)row[1] * (x[1] - c[1]) +
           (int64_t)row[2] * (x[2] - c[2]);
}

/* Applies the rules of near plane and |x/z|, |y/z| < 8, then shifts the point
 * so that z has 27 bits. x and y are then within 8 * 2^27 = 2^30. Returns 0 if
 * the primitive is dropped. */
static int view(view_point *p, const int32_t *x, const saga_camera *c)
{
    const int64_t vx = view_coordinate(c->rotation_q30, x, c->centre);
    const int64_t vy = view_coordinate(c->rotation_q30 + 3, x, c->centre);
    const int64_t vz = view_coordinate(c->rotation_q30 + 6, x, c->centre);
    const int32_t depth = (int32_t)fx_rshift64(vz, 30);

    /* The Jacobian of a pinhole is useless beyond 83 degrees off the axis. */
    if (depth < c->near_plane || abs64(vx) >> 3 >= vz || abs64(vy) >> 3 >= vz)
        return 0;
    p->depth = (uint32_t)depth;
    p->shift = n_bits((uint64_t)vz) - 27;
    p->x = (int32_t)fx_rshift64(vx, p->shift);
    p->y = (int32_t)fx_rshift64(vy, p->shift);
    p->z = (int32_t)fx_rshift64(vz, p->shift);
    return 1;
}

/* Projects one axis: x/z in Q28 (saturating just below 8), mean = principal +
 * focal x/z rounded once, and the clamped slope of the Jacobian.
 *   x recip: 2^30 * 2^31;  recip_shift - 28 in 28..30, since z has 27 bits
 *   focal x/z: 2^31 * 2^31; principal in Q44: 2^58
 * Returns 0 if the mean is more than 2^15 px from the picture's centre. */
static int project_axis(centre *o, const saga_camera *c, int axis, int32_t x,
                        int n)
{
    const int32_t side = axis == 0 ? c->width : c->height;
    const int64_t principal = c->principal_q16[axis];
    /* The Jacobian is evaluated at most BORDER outside the picture, because the
     * linearised shape of something far outside would cover all of it. */
    const int64_t lo = -(int64_t)side * BORDER_Q16 - principal;
    const int64_t hi = (int64_t)side * (65536 + BORDER_Q16) - principal;
    const int32_t ratio_q28 = fx_clamp64(fx_rshift64((int64_t)x * o->recip, n),
                                         -INT32_MAX, INT32_MAX);
    const int64_t focal_q44 = (int64_t)c->focal_q16[axis] * ratio_q28;
    const int64_t mean = fx_rshift64(focal_q44 + principal * ((int64_t)1 << 28),
                                     36);
    const int64_t slope = fx_rshift64(focal_q44, 28);

    if (abs64(mean - side * 128) > LIMIT_MEAN)
        return 0;
    o->mean_q8[axis] = (int32_t)mean;
    o->slope_q16[axis] = slope < lo ? lo : slope > hi ? hi : slope;
    return 1;
}

static int project_centre(centre *o, const int32_t *x, const saga_camera *c)
{
    view_point p;
    int n;

    if (!view(&p, x, c))
        return 0;
    o->depth = p.depth;
    o->recip = saga_recip32((uint32_t)p.z, &n);
    o->recip_shift = n + p.shift - 30;
    return project_axis(o, c, 0, p.x, n - 28) &&
           project_axis(o, c, 1, p.y, n - 28);
}

/* --- The shape ----------------------------------------------------------- */

/* Shifts a quaternion to 30 bits; all zeros become (1, 0, 0, 0). Rounding may
 * give 2^30. */
static void normalise_quat(int64_t *q, const int32_t *quat)
{
    uint64_t bits = 0;
    int i, n;

    /* The OR has the highest bit of all components. */
    for (i = 0; i < 4; i++)
        bits |= (uint64_t)abs64(quat[i]);
    n = 30 - n_bits(bits);
    for (i = 0; i < 4; i++)
        q[i] = n >= 0 ? quat[i] * ((int64_t)1 << n) : fx_rshift64(quat[i], -n);
    if (bits == 0)
        q[0] = 1 << 29;
}

/* Computes the rotation matrix times |q|^2, shifted so that |q|^2 has 30 bits,
 * and returns the shifted |q|^2. Before the shift, |q|^2 is in [2^58, 2^62] and
 * bounds every entry; products are below 2^60, their doubled sums below 2^62.
 */
static uint32_t rotation(int32_t *r, const int32_t *quat)
{
    int64_t q[4], m[9];
    int64_t norm;
    int i, n;

    normalise_quat(q, quat);
    /* R |q|^2 needs no division; the scales are divided by |q|^2 instead. */
    norm = q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3];
    m[0] = q[0] * q[0] + q[1] * q[1] - q[2] * q[2] - q[3] * q[3];
    m[1] = 2 * (q[1] * q[2] - q[0] * q[3]);
    m[2] = 2 * (q[1] * q[3] + q[0] * q[2]);
    m[3] = 2 * (q[1] * q[2] + q[0] * q[3]);
    m[4] = q[0] * q[0] - q[1] * q[1] + q[2] * q[2] - q[3] * q[3];
    m[5] = 2 * (q[2] * q[3] - q[0] * q[1]);
    m[6] = 2 * (q[1] * q[3] - q[0] * q[2]);
    m[7] = 2 * (q[2] * q[3] + q[0] * q[1]);
    m[8] = q[0] * q[0] - q[1] * q[1] - q[2] * q[2] + q[3] * q[3];
    /* |q|^2 and the matrix are shifted alike, so that R does not change. */
    n = n_bits((uint64_t)norm) - 30;
    for (i = 0; i < 9; i++)
        r[i] = (int32_t)fx_rshift64(m[i], n);
    return (uint32_t)fx_rshift64(norm, n);
}

/* Computes the rows of depth * J W: focal * (a row of W) - slope * (the third
 * row), Q46, shifted to 30 bits. Returns the common shift: row = u * 2^shift.
 * |slope| <= 2.15 * 2^30 and |focal| < 2 * 2^30 times entries of at most
 * 1.7321 * 2^30 sum to less than 2^62.9. */
static int jacobian(int32_t *u, const centre *o, const saga_camera *c)
{
    const int32_t *const w = c->rotation_q30;
    int64_t row[6];
    uint64_t bits = 1;
    int i, n;

    for (i = 0; i < 6; i++) {
        const int axis = i >= 3;

        /* d(focal x/z) = (focal dx - (focal x/z) dz) / z. */
        row[i] = (int64_t)c->focal_q16[axis] * w[i] -
                 o->slope_q16[axis] * w[6 + i - 3 * axis];
        bits |= (uint64_t)abs64(row[i]);
    }
    n = n_bits(bits) - 30;
    for (i = 0; i < 6; i++)
        u[i] = (int32_t)(n >= 0 ? fx_rshift64(row[i], n)
                                : row[i] * ((int64_t)1 << -n));
    return n;
}

/* Computes u R. By Cauchy's inequality its entries are at most 3^(1/2) 2^60
 * before the shift, so that p < 2^31. */
static void turn_rows(int32_t p[2][3], const int32_t *u, const int32_t *r)
{
    int i, k;

    for (i = 0; i < 2; i++)
        for (k = 0; k < 3; k++)
            p[i][k] = (int32_t)fx_rshift64(
                (int64_t)u[3 * i] * r[k] + (int64_t)u[3 * i + 1] * r[3 + k] +
                    (int64_t)u[3 * i + 2] * r[6 + k],
                30);
}

/* Returns the mantissa of scale / (depth |q|^2), at least 2^28. Two products
 * below 2^31 * 2^31 are each shifted to at most 2^31. */
static int64_t scale_mant(int32_t log2_scale_q10, int64_t factor)
{
    const uint32_t f = (uint32_t)log2_scale_q10 & 1023;

    return fx_rshift64(saga_exp2_frac_q16_q30(f << 6) * factor, 31);
}

/* Computes t = p * scale / (depth |q|^2). Column k has the exponent of its
 * scale, and top is the highest bit that any column reaches. The shift by 1 +
 * top - exponent, which is at least 1 + the column's bits, makes |t| <= 2^30.
 * Products are below 2^62 and round to 0 for shifts of 62 and more. */
static void scale_columns(shape *s, int32_t p[2][3], const int32_t *log2_scale,
                          int64_t factor)
{
    int32_t top = log2_scale[0] >> 10;
    int k;

    for (k = 0; k < 3; k++) {
        /* A column is below 2^bits times its scale 2^(log2_scale >> 10). */
        const int bits = n_bits((uint64_t)(abs64(p[0][k]) | abs64(p[1][k])));

        top = fx_max(top, (log2_scale[k] >> 10) + bits);
    }
    for (k = 0; k < 3; k++) {
        /* A column that is far smaller than the largest becomes 0. */
        const int64_t m = scale_mant(log2_scale[k], factor);
        const int32_t n = 1 + top - (log2_scale[k] >> 10);

        s->t[0][k] = n > 61 ? 0 : (int32_t)fx_rshift64(p[0][k] * m, n);
        s->t[1][k] = n > 61 ? 0 : (int32_t)fx_rshift64(p[1][k] * m, n);
    }
    s->exp = top + 1;
}

/* Computes the rows of T. Their exponent is the sum of all shifts: of u (Q46
 * and its shift), p (30), scale (Q30, and 62 for its two products), 1/depth and
 * 1/|q|^2. */
static void project_shape(shape *s, const saga_animated *a, const centre *o,
                          const saga_camera *c)
{
    int32_t u[6], r[9], p[2][3];
    int shift, n;
    uint32_t recip;
    int64_t factor;

    shift = jacobian(u, o, c);
    recip = saga_recip32(rotation(r, a->quat), &n);
    /* One factor for both divisions: 1 / (depth |q|^2). */
    factor = (int64_t)(((uint64_t)recip * o->recip + (1u << 30)) >> 31);
    turn_rows(p, u, r);
    scale_columns(s, p, a->log2_scale_q10, factor);
    s->exp += shift - 46 + 30 - 30 + 62 - n - o->recip_shift;
}

/* --- The conic ----------------------------------------------------------- */

/* Returns an inner product, at most 3 * 2^60. */
static int64_t dot3(const int32_t *a, const int32_t *b)
{
    return (int64_t)a[0] * b[0] + (int64_t)a[1] * b[1] + (int64_t)a[2] * b[2];
}

/* Returns |t0 x t1|^2. Components are below 2^61; they are shifted to 30 bits
 * and squared. */
static saga_float cross_squared(const shape *s)
{
    const int32_t *const a = s->t[0];
    const int32_t *const b = s->t[1];
    int64_t c[3];
    uint64_t bits, sum = 0;
    int i, n;

    c[0] = (int64_t)a[1] * b[2] - (int64_t)a[2] * b[1];
    c[1] = (int64_t)a[2] * b[0] - (int64_t)a[0] * b[2];
    c[2] = (int64_t)a[0] * b[1] - (int64_t)a[1] * b[0];
    bits = (uint64_t)(abs64(c[0]) | abs64(c[1]) | abs64(c[2]));
    /* If the rows are nearly parallel, this keeps 30 bits of their small area,
     * all of which would cancel in a c - b^2. */
    n = fx_max(n_bits(bits) - 30, 0);
    for (i = 0; i < 3; i++) {
        const int64_t m = fx_rshift64(c[i], n);

        sum += (uint64_t)(m * m);
    }
    return pair(sum, 4 * s->exp + 2 * n);
}

/* Computes the conic of the covariance (A B; B C), which includes the low-pass
 * d. det = |t0 x t1|^2 + d (A0 + C0) + d^2 > 0 has no cancellation, and
 *   h = sqrt(k / C),  m = sqrt(k / (C det)),  g = C m,  n = B m. */
static void conic(int32_t *chol_q28, const shape *s)
{
    const int64_t a0 = dot3(s->t[0], s->t[0]);
    const int64_t b = dot3(s->t[0], s->t[1]);
    const int64_t c0 = dot3(s->t[1], s->t[1]);
    const int32_t exp = 2 * s->exp;
    const saga_float c = pair_add(pair((uint64_t)c0, exp), low_pass);
    const saga_float trace = pair((uint64_t)a0 + (uint64_t)c0, exp);
    const saga_float det = pair_add(
        pair_add(cross_squared(s), pair_mul(trace, low_pass)), low_pass_2);
    const saga_float h = pair_mul(saga_rsqrt(c), root_k);
    const saga_float m = pair_mul(saga_rsqrt(det), h);
    const int32_t n = pair_q28(pair_mul(pair((uint64_t)abs64(b), exp), m));

    chol_q28[0] = pair_q28(pair_mul(c, m));
    chol_q28[1] = b < 0 ? -n : n;
    chol_q28[2] = pair_q28(h);
}

/* --- The box ------------------------------------------------------------- */

/* Returns L / h in pixels, Q8, rounded up; h is in Q28, L in Q12 and < 2^14.
 * recip16 is within 2^-15 of 1/h; adding two units to its mantissa (17 bits)
 * makes it an upper bound. */
static int32_t extent_y(int32_t l_q12, int32_t h)
{
    int64_t e;
    int n;

    /* h is below the resolution of Q28: the splat covers whole columns. */
    if (h == 0)
        return LIMIT_EXTENT;
    e = l_q12 * (int64_t)(saga_recip16((uint32_t)h, &n) + 2);
    return fx_clamp64(n > 24 ? (e >> (n - 24)) + 1 : LIMIT_EXTENT, 0,
                      LIMIT_EXTENT);
}

/* Returns L |(h, n)| / (g h), rounded up. |(h, n)|^2 in Q56 has b <= 60 bits.
 * An even shift 2 j leaves 22 or 23 of them for sqrt_up, and the root is
 * 2^(j-2) times the result of sqrt_up. The product of L (14 bits), the root
 * (14) and two reciprocals (17) is below 2^62, and the final shift below 62,
 * since j >= (bits of h) - 12. */
static int32_t extent_x(int32_t l_q12, int32_t g, int32_t n, int32_t h)
{
    const uint64_t square = (uint64_t)((int64_t)h * h + (int64_t)n * n);
    const int j = (n_bits(square) - 22) >> 1;
    int64_t e, root;
    int sg, sh;

    if (g == 0 || h == 0)
        return LIMIT_EXTENT;
    /* Adding 1 for the bits that are shifted out makes this an upper bound. */
    root = j > 0 ? (int64_t)(square >> 2 * j) + 1 : (int64_t)(square << -2 * j);
    e = l_q12 * (int64_t)sqrt_up_q20_q12((int32_t)root);
    e *= saga_recip16((uint32_t)g, &sg) + 2;
    e *= saga_recip16((uint32_t)h, &sh) + 2;
    sg += sh - 22 - j;
    return fx_clamp64(sg > 0 ? (e >> sg) + 1 : LIMIT_EXTENT, 0, LIMIT_EXTENT);
}

/* Finds the pixels of the picture whose centre is within extent of the mean.
 * All values are below 2^27. Returns 0 if there are none. */
static int pixel_range(int16_t *from, int16_t *to, int32_t mean_q8,
                       int32_t extent_q8, int32_t side)
{
    const int32_t lo = (mean_q8 - extent_q8 + 127) >> 8;
    const int32_t hi = ((mean_q8 + extent_q8 - 128) >> 8) + 1;

    *from = (int16_t)fx_clamp(lo, 0, side);
    *to = (int16_t)fx_clamp(hi, 0, side);
    return *from < *to;
}

/* Computes the box of a splat. q < 11 implies |(v, w)| < L, where L is the root
 * of saga_reach_q20, rounded up by sqrt_up. With v = g dx - n dy and w = h dy,
 *   |dy| < L / h,  |dx| < L |(h, n)| / (g h) = (L / g) |(1, n/h)|.
 * The bounds use the same integer factors as the blending, so that the rounding
 * of these factors cannot exclude a pixel. */
static int box(saga_splat *s, const saga_camera *c, uint32_t tools)
{
    const int32_t *const f = s->chol_q28;
    const int32_t reach = saga_reach_q20(SAGA_CUT_Q20 - s->q0_q20, tools);
    const int32_t l_q12 = sqrt_up_q20_q12(reach);
    const int32_t ex = extent_x(l_q12, f[0], f[1], f[2]);
    const int32_t ey = extent_y(l_q12, f[2]);

    return pixel_range(&s->x0, &s->x1, s->mean_q8[0], ex, c->width) &
           pixel_range(&s->y0, &s->y1, s->mean_q8[1], ey, c->height);
}

int saga_project(saga_splat *s, const saga_animated *a, const saga_camera *c,
                 uint32_t tools)
{
    centre o;
    shape t;

    /* Transparent primitives and those outside the view need no shape. */
    if (a->q0_q20 >= SAGA_CUT_Q20 || !project_centre(&o, a->x, c))
        return 0;
    project_shape(&t, a, &o, c);
    conic(s->chol_q28, &t);
    s->mean_q8[0] = o.mean_q8[0];
    s->mean_q8[1] = o.mean_q8[1];
    s->q0_q20 = a->q0_q20;
    s->depth = o.depth;
    return box(s, c, tools);
}
