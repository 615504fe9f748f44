/* SPDX-License-Identifier: MIT
 *
 * With W the camera's rotation, R S the primitive's axes and J the Jacobian of
 * the projection, the 2-D covariance is T T^t + d I, where T = J W R S (2 x 3)
 * and d is the low-pass. The rows t0, t1 of T give A0 = t0.t0, B = t0.t1,
 * C0 = t1.t1, and
 *   A = A0 + d,  C = C0 + d,  det = |t0 x t1|^2 + d (A0 + C0) + d^2
 *   h = sqrt(k / C),  g = sqrt(k C / det),  n = g B / C,  k = log2(e) / 2.
 * In this form, det and its derivative suffer no cancellation for thin
 * ellipses.
 */
#include "splat_project.h"

#include "splat_lanes.h"
#include "model.h"

#define K R(0.72134752044448170) /* log2(e) / 2 */
#define LN_2 R(0.69314718055994531)
#define RATIO_MAX R(8) /* limit of |x/z| and |y/z| */
/* Limit in pixels from the picture's centre. */
#define MEAN_MAX R(32768)
/* Part of a side by which the Jacobian's clamp exceeds the picture. */
#define BORDER R(0.15)
#define SCALE_MAX R(60) /* limit of |log2_scale| */
/* In pixels: larger splats are shrunk to it. */
#define ROW_MAX R(1048576)

/* The intermediate values of a projection, for both directions. */
typedef struct {
    vec view[3];    /* in camera axes */
    vec ratio[2];   /* x/z, y/z */
    vec slope[2];   /* x/z and y/z, clamped for the Jacobian */
    vec row[2][3];  /* J W */
    vec quat[4];    /* of unit length */
    vec quat_recip; /* 1 / length of the given quaternion; 0: it was zero */
    vec r[9];       /* rotation matrix */
    vec scale[3];
    vec u[2][3], t[2][3]; /* J W R, and J W R times the scales */
    vec shrink;           /* 1, or the factor that reduced T to ROW_MAX */
    real low_pass;        /* from the canvas's rules */
} shape;

static vec dot3(const vec *a, const vec *b)
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static void cross3(vec *c, const vec *a, const vec *b)
{
    c[0] = a[1] * b[2] - a[2] * b[1];
    c[1] = a[2] * b[0] - a[0] * b[2];
    c[2] = a[0] * b[1] - a[1] * b[0];
}

/* --- Forward ------------------------------------------------------------- */

/* Projects means x and applies the drop rules of docs/arithmetic.md; returns
 * which are kept. Comparisons are written so that NaN drops. */
static veci project_mean(vec *mean, shape *s, const vec *x,
                         const saga_splat_camera *cam)
{
    const real *const w = cam->rotation;
    const real side[2] = { R(cam->width), R(cam->height) };
    const vec d[3] = { x[0] - cam->centre[0], x[1] - cam->centre[1],
                       x[2] - cam->centre[2] };
    veci kept;

    for (int i = 0; i < 3; i++)
        s->view[i] = w[3 * i] * d[0] + w[3 * i + 1] * d[1] +
                     w[3 * i + 2] * d[2];
    kept = (veci)(s->view[2] >= cam->near_plane) &
           (veci)(s->view[2] < REAL_MAX);
    for (int i = 0; i < 2; i++) {
        const real f = cam->focal[i];
        const real p = cam->principal[i];

        /* The mean in the picture is p + f x/z. */
        s->ratio[i] = s->view[i] / s->view[2];
        mean[i] = p + f * s->ratio[i];
        kept &= (veci)(vec_abs(s->ratio[i]) < RATIO_MAX) &
                (veci)(vec_abs(mean[i] - side[i] / 2) <= MEAN_MAX);
        /* Outside a border around the picture, the linear approximation is that
         * of the border. */
        s->slope[i] = vec_clamp(s->ratio[i],
                                vec_set1((-BORDER * side[i] - p) / f),
                                vec_set1(((1 + BORDER) * side[i] - p) / f));
    }
    return kept;
}

static void rotation(shape *s, const vec *quat)
{
    const vec norm2 = quat[0] * quat[0] + quat[1] * quat[1] +
                      quat[2] * quat[2] + quat[3] * quat[3];
    /* A length whose square underflows or overflows counts as zero, which
     * stands for no rotation. */
    const veci has_length = (veci)(norm2 > FLT_MIN) & (veci)(norm2 < REAL_MAX);
    const vec *const q = s->quat;

    s->quat_recip = vec_and(has_length, 1 / vec_sqrt(norm2));
    for (int i = 0; i < 4; i++)
        s->quat[i] = vec_select(has_length, quat[i] * s->quat_recip,
                                vec_set1(R(i == 0)));
    s->r[0] = 1 - 2 * (q[2] * q[2] + q[3] * q[3]);
    s->r[1] = 2 * (q[1] * q[2] - q[0] * q[3]);
    s->r[2] = 2 * (q[1] * q[3] + q[0] * q[2]);
    s->r[3] = 2 * (q[1] * q[2] + q[0] * q[3]);
    s->r[4] = 1 - 2 * (q[1] * q[1] + q[3] * q[3]);
    s->r[5] = 2 * (q[2] * q[3] - q[0] * q[1]);
    s->r[6] = 2 * (q[1] * q[3] - q[0] * q[2]);
    s->r[7] = 2 * (q[2] * q[3] + q[0] * q[1]);
    s->r[8] = 1 - 2 * (q[1] * q[1] + q[2] * q[2]);
}

static void project_shape(shape *s, const vec *quat, const vec *log2_scale,
                          const saga_splat_camera *cam)
{
    const real *const w = cam->rotation;
    vec top = vec_zero();

    rotation(s, quat);
    for (int j = 0; j < 3; j++)
        s->scale[j] = vec_exp2(vec_clamp(log2_scale[j], vec_set1(-SCALE_MAX),
                                         vec_set1(SCALE_MAX)));
    for (int i = 0; i < 2; i++) {
        const vec f = cam->focal[i] / s->view[2];

        for (int j = 0; j < 3; j++)
            /* The rows of J W follow from d(f x/z) = f/z (dx - x/z dz). */
            s->row[i][j] = f * (w[3 * i + j] - s->slope[i] * w[6 + j]);
        /* T = J W R S has a column for each axis of the primitive. */
        for (int j = 0; j < 3; j++) {
            s->u[i][j] = s->row[i][0] * s->r[j] + s->row[i][1] * s->r[3 + j] +
                         s->row[i][2] * s->r[6 + j];
            s->t[i][j] = s->u[i][j] * s->scale[j];
            top = vec_max(top, vec_abs(s->t[i][j]));
        }
    }
    /* The squares of larger values would overflow a float in covariance_of. */
    s->shrink = vec_select((veci)(top > ROW_MAX), ROW_MAX / top, vec_set1(1));
    for (int i = 0; i < 2; i++)
        for (int j = 0; j < 3; j++)
            s->t[i][j] *= s->shrink;
}

typedef struct {
    vec a, b, c, det, cross[3];
} covariance;

static void covariance_of(covariance *v, const shape *s)
{
    const vec a0 = dot3(s->t[0], s->t[0]);
    const vec c0 = dot3(s->t[1], s->t[1]);

    cross3(v->cross, s->t[0], s->t[1]);
    v->a = a0 + s->low_pass;
    v->b = dot3(s->t[0], s->t[1]);
    v->c = c0 + s->low_pass;
    /* The determinant is (A0 + d)(C0 + d) - B^2, in which A0 C0 - B^2 = |t0 x
     * t1|^2. */
    v->det = dot3(v->cross, v->cross) + s->low_pass * (a0 + c0) +
             s->low_pass * s->low_pass;
}

/* Splats, and the pixels that they touch. */
typedef struct {
    vec mean[2], g, n, h, q0, extent;
    veci begin[2], end[2];
} splats;

/* Sets [begin, end) to the pixels of one axis whose centres may be within
 * `half` of mean. `half` is widened to cover its rounding error. */
static void span(veci *begin, veci *end, vec mean, vec half, int side)
{
    const vec h = half * R(1.0001) + R(0.01);
    /* NaN ends at the side, so that
     * nothing is touched. */
    const vec a = vec_max(vec_min(mean - h - R(0.5), vec_set1(R(side))),
                          vec_zero());
    const vec b = vec_max(vec_min(mean + h - R(0.5), vec_set1(R(side - 1))),
                          vec_set1(-1));
    const veci whole = __builtin_convertvector(a, veci);

    /* ceil(a), and floor(b) + 1, which is 0 for any b below 0. */
    *begin = whole - (veci)(__builtin_convertvector(whole, vec) < a);
    *end = (__builtin_convertvector(b, veci) + 1) & (veci)(b >= 0);
}

/* Returns the s for which s + square s^2 = rest. */
static vec reach(vec rest, real square)
{
    return square > 0 ? (vec_sqrt(1 + 4 * square * rest) - 1) / (2 * square)
                      : rest;
}

/* Sets the pixels that splats touch. The ellipse s < most extends sqrt(A most /
 * k) pixels to each side. The extent is its major half-axis, the same with the
 * larger eigenvalue. Returns which cover a pixel's centre. */
static veci bound(splats *o, const covariance *v, vec most,
                  const saga_splat_camera *cam)
{
    const vec m = (v->a - v->c) / 2;
    const vec mid = (v->a + v->c) / 2;
    const vec big = mid + vec_sqrt(m * m + v->b * v->b);

    span(&o->begin[0], &o->end[0], o->mean[0], vec_sqrt(v->a * most / K),
         cam->width);
    span(&o->begin[1], &o->end[1], o->mean[1], vec_sqrt(v->c * most / K),
         cam->height);
    o->extent = vec_sqrt(big * most / K);
    return (veci)(o->begin[0] < o->end[0]) & (veci)(o->begin[1] < o->end[1]);
}

/* Writes the splats that are seen, and empty ones for the others. */
static void put(saga_splat_work *w, const splats *o, const shape *s, lanes at,
                veci seen, const real *colour)
{
    for (size_t l = 0; l < at.n; l++) {
        saga_splat_2d *const to = w->splat + at.first + l;

        *to = (saga_splat_2d){ 0 };
        w->extent[at.first + l] = 0;
        if (!seen[l])
            continue;
        *to = (saga_splat_2d){ .mean = { o->mean[0][l], o->mean[1][l] },
                               .g = o->g[l],
                               .n = o->n[l],
                               .h = o->h[l],
                               .q0 = o->q0[l],
                               .depth = s->view[2][l],
                               .x0 = (int16_t)o->begin[0][l],
                               .y0 = (int16_t)o->begin[1][l],
                               .x1 = (int16_t)o->end[0][l],
                               .y1 = (int16_t)o->end[1][l] };
        memcpy(to->colour, colour + 3 * l, sizeof to->colour);
        w->extent[at.first + l] = o->extent[l];
    }
}

/* Reads posed primitives, and projects their means. Returns which are kept. */
static veci begin_shape(vec *mean, shape *s, const saga_canvas *canvas,
                        lanes at)
{
    vec x[3];

    s->low_pass = canvas->rules.low_pass;
    lanes_get_rows(x, canvas->splat.posed.mean, 3, at);
    return project_mean(mean, s, x, &canvas->camera);
}

static void end_shape(shape *s, const saga_canvas *canvas, lanes at,
                      const vec *log2_scale)
{
    vec quat[4];

    lanes_get_rows(quat, canvas->splat.posed.quat, 4, at);
    project_shape(s, quat, log2_scale, &canvas->camera);
}

/* Projects the primitives in these lanes of the canvas, which `of` has as
 * primitives from `first` on. Those that are too faint at this time, outside
 * the view or degenerate become empty splats. */
static void project(saga_canvas *canvas, lanes at, const saga_splat_params *of,
                    size_t first)
{
    saga_splat_work *const w = &canvas->splat;
    const real cut = canvas->rules.cut;
    splats o = { .q0 = lanes_get(w->posed.q0, at) };
    veci seen = (veci)(o.q0 < cut);
    vec log2_scale[3];
    shape s;
    covariance v;

    seen &= begin_shape(o.mean, &s, canvas, at);
    if (vec_any(seen)) {
        lanes_get_rows(log2_scale, of->log2_scale, 3, (lanes){ first, at.n });
        end_shape(&s, canvas, at, log2_scale);
        covariance_of(&v, &s);
        seen &= (veci)(v.det > 0) & (veci)(v.det < REAL_MAX);
        /* s = (g dx - n dy)^2 + (h dy)^2, with the Cholesky factor g, n, h of
         * the conic. */
        o.h = vec_sqrt(K / v.c);
        o.g = vec_sqrt(K * (v.c / v.det));
        o.n = o.g * (v.b / v.c);
        seen &= bound(&o, &v, reach(cut - o.q0, canvas->rules.square),
                      &canvas->camera);
    }
    put(w, &o, &s, at, seen, of->colour + 3 * first);
}

/* The canvas's own primitives come after those given to the pass. */
void saga_splat_project_forward(saga_canvas *canvas, const saga_splat_params *p,
                                saga_range of)
{
    const size_t n = canvas->splat.n - canvas->n_still;
    const saga_range given = { of.begin, of.end < n ? of.end : n };
    const saga_range still = { of.begin < n ? n : of.begin, of.end };

    for (size_t i = given.begin; i < given.end; i += VEC_LANES)
        project(canvas, lanes_from(given, i), p, i);
    for (size_t i = still.begin; i < still.end; i += VEC_LANES)
        project(canvas, lanes_from(still, i), canvas->still, i - n);
}

SAGA_ISA_CHOOSE(saga_splat_project_forward);

/* --- Backward ------------------------------------------------------------ */

/* The gradients of splats, and what the forward pass left of them. */
typedef struct {
    vec mean[2], g, n, h, q0, colour[3], weight;
    vec splat_g, splat_n, splat_h;
} splat_gradient;

/* Adds up the records of the splats that are seen. Each tile has left one.
 * Their order is fixed, so the sum is too. */
static void add_records(vec *sums, const saga_splat_work *w, lanes at,
                        veci seen)
{
    real column[SAGA_N_SUMS][VEC_LANES] = { { 0 } };

    for (size_t l = 0; l < at.n; l++) {
        const real *row = w->record +
                          (size_t)w->slot_begin[at.first + l] * SAGA_N_SUMS;
        const real *const end =
            w->record + (size_t)w->slot_begin[at.first + l + 1] * SAGA_N_SUMS;
        real sum[SAGA_N_SUMS] = { 0 };

        if (!seen[l])
            continue;
        for (; row < end; row += SAGA_N_SUMS)
            for (size_t k = 0; k < SAGA_N_SUMS; k++)
                sum[k] += row[k];
        for (size_t k = 0; k < SAGA_N_SUMS; k++)
            column[k][l] = sum[k];
    }
    for (size_t k = 0; k < SAGA_N_SUMS; k++)
        sums[k] = vec_load(column[k]);
}

static void gather(splat_gradient *d, const saga_splat_work *w, lanes at,
                   veci seen)
{
    real factor[3][VEC_LANES] = { { 0 } };
    vec sum[SAGA_N_SUMS];

    add_records(sum, w, at, seen);
    for (size_t l = 0; l < at.n; l++) {
        const saga_splat_2d *const o = w->splat + at.first + l;

        factor[0][l] = o->g;
        factor[1][l] = o->n;
        factor[2][l] = o->h;
    }
    d->splat_g = vec_load(factor[0]);
    d->splat_n = vec_load(factor[1]);
    d->splat_h = vec_load(factor[2]);
    /* dL/dq = -ln 2 alpha dL/dalpha; the records leave out ln 2. */
    for (size_t k = SAGA_SUM_Q; k <= SAGA_SUM_YY; k++)
        sum[k] *= LN_2;
    d->q0 = sum[SAGA_SUM_Q];
    /* s = v^2 + w^2 with v = g dx - n dy, w = h dy, and (dx, dy) from the
     * mean. */
    d->g = 2 * sum[SAGA_SUM_VX];
    d->n = -2 * sum[SAGA_SUM_VY];
    d->h = 2 * d->splat_h * sum[SAGA_SUM_YY];
    d->mean[0] = -2 * d->splat_g * sum[SAGA_SUM_V];
    d->mean[1] = 2 * d->splat_n * sum[SAGA_SUM_V] -
                 2 * d->splat_h * d->splat_h * sum[SAGA_SUM_Y];
    for (size_t k = 0; k < 3; k++)
        d->colour[k] = sum[SAGA_SUM_R + k];
    d->weight = sum[SAGA_SUM_WEIGHT];
}

/* Computes the gradients of the rows of T from those of the conic. A splat that
 * was shrunk to ROW_MAX gives none to its shape. */
static void conic_backward(vec dt[2][3], const splat_gradient *d,
                           const shape *s)
{
    const veci whole = (veci)(s->shrink == 1);
    covariance v;
    vec x[2][3];
    vec d_g, d_b, d_c, d_det;

    covariance_of(&v, s);
    /* g = sqrt(k C / det), n = g B / C, h = sqrt(k / C), with C and det as
     * independent variables. */
    d_g = d->g + d->n * (v.b / v.c);
    d_b = d->n * d->splat_g / v.c;
    d_c = (d_g * d->splat_g / 2 - d->n * d->splat_n - d->h * d->splat_h / 2) /
          v.c;
    d_det = -d_g * d->splat_g / (2 * v.det);
    /* d |t0 x t1|^2 / dt0 = 2 t1 x (t0 x t1), and likewise for t1. */
    cross3(x[0], s->t[1], v.cross);
    cross3(x[1], v.cross, s->t[0]);
    for (int j = 0; j < 3; j++) {
        dt[0][j] = vec_and(whole,
                           2 * d_det * (x[0][j] + s->low_pass * s->t[0][j]) +
                               d_b * s->t[1][j]);
        dt[1][j] = vec_and(whole,
                           2 * d_det * (x[1][j] + s->low_pass * s->t[1][j]) +
                               d_b * s->t[0][j] + 2 * d_c * s->t[1][j]);
    }
}

/* Computes the gradient of the quaternion from dR[i][j], through its
 * normalisation. */
static void rotation_backward(vec *d_quat, const vec *dr, const shape *s)
{
    const vec *const q = s->quat;
    vec d[4], along;

    d[0] = 2 * (q[1] * (dr[7] - dr[5]) + q[2] * (dr[2] - dr[6]) +
                q[3] * (dr[3] - dr[1]));
    d[1] = 2 * (q[0] * (dr[7] - dr[5]) + q[2] * (dr[1] + dr[3]) +
                q[3] * (dr[2] + dr[6]) - 2 * q[1] * (dr[4] + dr[8]));
    d[2] = 2 * (q[0] * (dr[2] - dr[6]) + q[1] * (dr[1] + dr[3]) +
                q[3] * (dr[5] + dr[7]) - 2 * q[2] * (dr[0] + dr[8]));
    d[3] = 2 * (q[0] * (dr[3] - dr[1]) + q[1] * (dr[2] + dr[6]) +
                q[2] * (dr[5] + dr[7]) - 2 * q[3] * (dr[0] + dr[4]));
    /* q = p / |p| gives dp = (d - (d.q) q) / |p|: a change along q has no
     * effect. */
    along = q[0] * d[0] + q[1] * d[1] + q[2] * d[2] + q[3] * d[3];
    for (int i = 0; i < 4; i++)
        d_quat[i] = (d[i] - along * q[i]) * s->quat_recip;
}

/* Computes the gradients of quaternion, scales and the rows of J W from those
 * of T. */
static void shape_backward(vec *d_quat, vec *d_scale, vec d_row[2][3],
                           vec dt[2][3], const shape *s, const vec *log2_scale)
{
    vec dr[9], du[2][3];

    for (int j = 0; j < 3; j++) {
        const veci moves = (veci)(vec_abs(log2_scale[j]) <= SCALE_MAX);

        /* A column of T is proportional to 2^log2_scale, so d = ln 2 <dT,
         * T>. */
        d_scale[j] = vec_and(
            moves, LN_2 * (dt[0][j] * s->t[0][j] + dt[1][j] * s->t[1][j]));
        du[0][j] = dt[0][j] * s->scale[j];
        du[1][j] = dt[1][j] * s->scale[j];
    }
    /* U = (J W) R gives dR = (J W)^T dU and d(J W) = dU R^T. */
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++)
            dr[3 * i + j] = s->row[0][i] * du[0][j] + s->row[1][i] * du[1][j];
        d_row[0][i] = dot3(s->r + 3 * i, du[0]);
        d_row[1][i] = dot3(s->r + 3 * i, du[1]);
    }
    rotation_backward(d_quat, dr, s);
}

/* Computes the gradient of the position from those of the rows f/z (w_i - slope
 * w_2) and of mean = p + f x/z. A slope that was clamped is a constant. */
static void mean_backward(vec *d_mean, const vec *d_mean2d, vec d_row[2][3],
                          const shape *s, const saga_splat_camera *cam)
{
    const real *const w = cam->rotation;
    const vec z = s->view[2];
    vec dv[3];

    dv[2] = vec_zero();
    for (int i = 0; i < 2; i++) {
        const vec f = cam->focal[i] / z;
        const veci moves = (veci)(s->slope[i] == s->ratio[i]);
        /* x/z changes the mean, and the slope unless that is clamped. */
        const vec d_ratio = cam->focal[i] * d_mean2d[i] -
                            vec_and(moves, f * (w[6] * d_row[i][0] +
                                                w[7] * d_row[i][1] +
                                                w[8] * d_row[i][2]));

        /* The derivative of x/z by x is 1/z, by z -(x/z)/z; rows of J W are
         * proportional to 1/z too. */
        dv[i] = d_ratio / z;
        dv[2] -= (dot3(s->row[i], d_row[i]) + d_ratio * s->ratio[i]) / z;
    }
    for (int i = 0; i < 3; i++)
        d_mean[i] = w[i] * dv[0] + w[3 + i] * dv[1] + w[6 + i] * dv[2];
}

/* Takes the gradients of splats back to their primitives. */
static void project_backward(saga_splat_params *d, const splat_gradient *ds,
                             const saga_canvas *canvas, lanes at, veci seen,
                             const saga_splat_params *p)
{
    const saga_splat_posed *const d_posed = &canvas->splat.d_posed;
    vec mean[2], log2_scale[3];
    vec dt[2][3], d_row[2][3], d_quat[4], d_scale[3], d_mean[3];
    shape s;

    /* The forward pass keeps only splats, so its intermediate values are
     * computed again. */
    begin_shape(mean, &s, canvas, at);
    lanes_get_rows(log2_scale, p->log2_scale, 3, at);
    end_shape(&s, canvas, at, log2_scale);
    conic_backward(dt, ds, &s);
    shape_backward(d_quat, d_scale, d_row, dt, &s, log2_scale);
    mean_backward(d_mean, ds->mean, d_row, &s, &canvas->camera);
    for (int a = 0; a < 3; a++)
        d_mean[a] = vec_and(seen, d_mean[a]);
    for (int a = 0; a < 4; a++)
        d_quat[a] = vec_and(seen, d_quat[a]);
    lanes_set_rows(d_posed->mean, 3, at, d_mean);
    lanes_set_rows(d_posed->quat, 4, at, d_quat);
    lanes_set(d_posed->q0, at, ds->q0);
    lanes_add_rows(d->log2_scale, 3, at, seen, d_scale);
    lanes_add_rows(d->colour, 3, at, seen, ds->colour);
}

static void note(const saga_splat_stats *st, const splat_gradient *d, lanes at,
                 veci seen)
{
    if (st->grad2d)
        lanes_add(st->grad2d, at, seen,
                  vec_sqrt(d->mean[0] * d->mean[0] + d->mean[1] * d->mean[1]));
    if (st->weight)
        lanes_add(st->weight, at, seen, d->weight);
    for (size_t l = 0; st->seen && l < at.n; l++)
        st->seen[at.first + l] += seen[l] != 0;
}

void saga_splat_project_backward(saga_splat_params *d, saga_splat_stats *stats,
                                 saga_canvas *canvas,
                                 const saga_splat_params *p, saga_range of)
{
    const saga_splat_work *const w = &canvas->splat;

    for (size_t i = of.begin; i < of.end; i += VEC_LANES) {
        const lanes at = lanes_from(of, i);
        const veci seen = (veci)(lanes_get(w->extent, at) > 0);
        splat_gradient ds;

        if (!vec_any(seen))
            continue;
        gather(&ds, w, at, seen);
        project_backward(d, &ds, canvas, at, seen, p);
        if (stats)
            note(stats, &ds, at, seen);
    }
}

SAGA_ISA_CHOOSE(saga_splat_project_backward);
