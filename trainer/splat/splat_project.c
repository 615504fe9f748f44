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

#include "model.h"

#include <tgmath.h>

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
    real view[3];    /* in camera axes */
    real ratio[2];   /* x/z, y/z */
    real slope[2];   /* x/z and y/z, clamped for the Jacobian */
    real row[2][3];  /* J W */
    real quat[4];    /* of unit length */
    real quat_recip; /* 1 / length of the given quaternion; 0: it was
                      * zero */
    real r[9];       /* rotation matrix */
    real scale[3];
    real u[2][3], t[2][3]; /* J W R, and J W R times the scales */
    real shrink;           /* 1, or the factor that reduced T to ROW_MAX */
    real low_pass;         /* from the canvas's rules */
} shape;

static real dot3(const real *a, const real *b)
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static void cross3(real *c, const real *a, const real *b)
{
    c[0] = a[1] * b[2] - a[2] * b[1];
    c[1] = a[2] * b[0] - a[0] * b[2];
    c[2] = a[0] * b[1] - a[1] * b[0];
}

static real max_real(real a, real b)
{
    return a > b ? a : b;
}

/* --- Forward ------------------------------------------------------------- */

/* Projects the mean and applies the drop rules of docs/arithmetic.md; returns 0
 * if the primitive is dropped. Comparisons are written so that NaN drops. */
static int project_mean(real *mean, shape *s, const real *x,
                        const saga_splat_camera *cam)
{
    const real side[2] = { R(cam->width), R(cam->height) };
    const real d[3] = { x[0] - cam->centre[0], x[1] - cam->centre[1],
                        x[2] - cam->centre[2] };
    int i;

    for (i = 0; i < 3; i++)
        s->view[i] = dot3(cam->rotation + 3 * i, d);
    if (!(s->view[2] >= cam->near_plane) || !(s->view[2] < REAL_MAX))
        return 0;
    for (i = 0; i < 2; i++) {
        const real f = cam->focal[i];
        const real p = cam->principal[i];

        /* The mean in the picture is p + f x/z. */
        s->ratio[i] = s->view[i] / s->view[2];
        if (!(s->ratio[i] < RATIO_MAX && s->ratio[i] > -RATIO_MAX))
            return 0;
        mean[i] = p + f * s->ratio[i];
        if (!(fabs(mean[i] - side[i] / 2) <= MEAN_MAX))
            return 0;
        /* Outside a border around the picture, the linear approximation is that
         * of the border. */
        s->slope[i] = saga_clamp(s->ratio[i], (-BORDER * side[i] - p) / f,
                                 ((1 + BORDER) * side[i] - p) / f);
    }
    return 1;
}

static void rotation(shape *s, const real *quat)
{
    const real norm2 = quat[0] * quat[0] + quat[1] * quat[1] +
                       quat[2] * quat[2] + quat[3] * quat[3];
    const real *const q = s->quat;
    int i;

    /* A length whose square underflows or overflows counts as zero. */
    s->quat_recip = 0;
    if (norm2 > FLT_MIN && norm2 < REAL_MAX)
        s->quat_recip = R(1) / sqrt(norm2);
    for (i = 0; i < 4; i++)
        s->quat[i] = s->quat_recip == 0 ? R(i == 0) : quat[i] * s->quat_recip;
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

static void project_shape(shape *s, const real *quat, const real *log2_scale,
                          const saga_splat_camera *cam)
{
    const real *const w = cam->rotation;
    real top = 0;
    int i, j;

    rotation(s, quat);
    for (j = 0; j < 3; j++)
        s->scale[j] = exp2(saga_clamp(log2_scale[j], -SCALE_MAX, SCALE_MAX));
    for (i = 0; i < 2; i++) {
        const real f = cam->focal[i] / s->view[2];

        for (j = 0; j < 3; j++)
            /* The rows of J W follow from d(f x/z) = f/z (dx - x/z dz). */
            s->row[i][j] = f * (w[3 * i + j] - s->slope[i] * w[6 + j]);
        /* T = J W R S has a column for each axis of the primitive. */
        for (j = 0; j < 3; j++) {
            s->u[i][j] = s->row[i][0] * s->r[j] + s->row[i][1] * s->r[3 + j] +
                         s->row[i][2] * s->r[6 + j];
            s->t[i][j] = s->u[i][j] * s->scale[j];
            top = max_real(top, fabs(s->t[i][j]));
        }
    }
    /* The squares of larger values would overflow a float in covariance_of. */
    s->shrink = top > ROW_MAX ? ROW_MAX / top : 1;
    if (s->shrink < 1)
        for (i = 0; i < 2; i++)
            for (j = 0; j < 3; j++)
                s->t[i][j] *= s->shrink;
}

typedef struct {
    real a, b, c, det, cross[3];
} covariance;

static void covariance_of(covariance *v, const shape *s)
{
    const real a0 = dot3(s->t[0], s->t[0]);
    const real c0 = dot3(s->t[1], s->t[1]);

    cross3(v->cross, s->t[0], s->t[1]);
    v->a = a0 + s->low_pass;
    v->b = dot3(s->t[0], s->t[1]);
    v->c = c0 + s->low_pass;
    /* The determinant is (A0 + d)(C0 + d) - B^2, in which A0 C0 - B^2 = |t0 x
     * t1|^2. */
    v->det = dot3(v->cross, v->cross) + s->low_pass * (a0 + c0) +
             s->low_pass * s->low_pass;
}

/* Sets [*lo, *hi) to the pixels of one axis whose centres may be within `half`
 * of mean. `half` is widened to cover its rounding error. */
static void span(int16_t *lo, int16_t *hi, real mean, real half, int side)
{
    const real h = half * R(1.0001) + R(0.01);
    const real a = ceil(mean - h - R(0.5));
    const real b = floor(mean + h - R(0.5)) + 1;

    *lo = (int16_t)saga_clamp(a, 0, R(side));
    *hi = (int16_t)saga_clamp(b, 0, R(side));
}

/* Returns the s for which s + square s^2 = rest. */
static real reach(real rest, real square)
{
    return square > 0 ? (sqrt(1 + 4 * square * rest) - 1) / (2 * square) : rest;
}

/* Sets the pixels that the splat touches. The ellipse s < most extends sqrt(A
 * most / k) pixels to each side. Returns its major half-axis, the same with the
 * larger eigenvalue, or 0 if it covers no pixel. */
static real bound(saga_splat_2d *o, const covariance *v, real most,
                  const saga_splat_camera *cam)
{
    const real m = (v->a - v->c) / 2;
    const real mid = (v->a + v->c) / 2;
    const real big = mid + sqrt(m * m + v->b * v->b);

    span(&o->x0, &o->x1, o->mean[0], sqrt(v->a * most / K), cam->width);
    span(&o->y0, &o->y1, o->mean[1], sqrt(v->c * most / K), cam->height);
    /* No pixel's centre is inside the ellipse. */
    if (o->x0 >= o->x1 || o->y0 >= o->y1) {
        o->x1 = o->x0;
        o->y1 = o->y0;
        return 0;
    }
    return sqrt(big * most / K);
}

/* Returns the number of primitives given to the pass, which precede the
 * canvas's own. */
static size_t n_given(const saga_canvas *canvas)
{
    return canvas->splat.n - canvas->n_still;
}

static real project_one(saga_splat_2d *o, const saga_canvas *canvas,
                        const saga_splat_params *p, size_t i)
{
    const saga_splat_posed *const posed = &canvas->splat.posed;
    const saga_splat_camera *const cam = &canvas->camera;
    const real cut = canvas->rules.cut;
    const bool is_given = i < n_given(canvas);
    const saga_splat_params *const from = is_given ? p : canvas->still;
    const size_t k = is_given ? i : i - n_given(canvas);
    shape s;
    covariance v;
    size_t a;

    *o = (saga_splat_2d){ 0 };
    /* Primitives that are too faint at this time, outside the view or
     * degenerate get an extent of 0. */
    if (!(posed->q0[i] < cut))
        return 0;
    if (!project_mean(o->mean, &s, posed->mean + 3 * i, cam))
        return 0;
    s.low_pass = canvas->rules.low_pass;
    project_shape(&s, posed->quat + 4 * i, from->log2_scale + 3 * k, cam);
    covariance_of(&v, &s);
    if (!(v.det > 0 && v.det < REAL_MAX))
        return 0;
    /* s = (g dx - n dy)^2 + (h dy)^2, with the Cholesky factor g, n, h of the
     * conic. */
    o->h = sqrt(K / v.c);
    o->g = sqrt(K * (v.c / v.det));
    o->n = o->g * (v.b / v.c);
    o->q0 = posed->q0[i];
    o->depth = s.view[2];
    for (a = 0; a < 3; a++)
        o->colour[a] = from->colour[3 * k + a];
    return bound(o, &v, reach(cut - o->q0, canvas->rules.square), cam);
}

void saga_splat_project_forward(saga_canvas *canvas, const saga_splat_params *p,
                                saga_range of)
{
    saga_splat_work *const w = &canvas->splat;
    size_t i;

    for (i = of.begin; i < of.end; i++)
        w->extent[i] = project_one(w->splat + i, canvas, p, i);
}

/* --- Backward ------------------------------------------------------------ */

/* The gradients of one splat. */
typedef struct {
    real mean[2], g, n, h, q0, colour[3], weight;
} splat_gradient;

static void gather(splat_gradient *d, const saga_splat_work *work, size_t i)
{
    const saga_splat_2d *const o = work->splat + i;
    const size_t end = work->slot_begin[i + 1];
    real sum[SAGA_N_SUMS] = { 0 };
    size_t r, k;

    /* Each tile has left a record. Their order is fixed, so the sum is too. */
    for (r = work->slot_begin[i]; r < end; r++)
        for (k = 0; k < SAGA_N_SUMS; k++)
            sum[k] += work->record[r * SAGA_N_SUMS + k];
    /* dL/dq = -ln 2 alpha dL/dalpha; the records leave out ln 2. */
    for (k = SAGA_SUM_Q; k <= SAGA_SUM_YY; k++)
        sum[k] *= LN_2;
    d->q0 = sum[SAGA_SUM_Q];
    /* s = v^2 + w^2 with v = g dx - n dy, w = h dy, and (dx, dy) from the
     * mean. */
    d->g = 2 * sum[SAGA_SUM_VX];
    d->n = -2 * sum[SAGA_SUM_VY];
    d->h = 2 * o->h * sum[SAGA_SUM_YY];
    d->mean[0] = -2 * o->g * sum[SAGA_SUM_V];
    d->mean[1] = 2 * o->n * sum[SAGA_SUM_V] - 2 * o->h * o->h * sum[SAGA_SUM_Y];
    for (k = 0; k < 3; k++)
        d->colour[k] = sum[SAGA_SUM_R + k];
    d->weight = sum[SAGA_SUM_WEIGHT];
}

/* Computes the gradients of the rows of T from those of the conic. */
static void conic_backward(real dt[2][3], const splat_gradient *d,
                           const saga_splat_2d *o, const shape *s)
{
    covariance v;
    real x[2][3];
    real d_g, d_b, d_c, d_det;
    int j;

    covariance_of(&v, s);
    /* g = sqrt(k C / det), n = g B / C, h = sqrt(k / C), with C and det as
     * independent variables. */
    d_g = d->g + d->n * (v.b / v.c);
    d_b = d->n * o->g / v.c;
    d_c = (d_g * o->g / 2 - d->n * o->n - d->h * o->h / 2) / v.c;
    d_det = -d_g * o->g / (2 * v.det);
    /* d |t0 x t1|^2 / dt0 = 2 t1 x (t0 x t1), and likewise for t1. */
    cross3(x[0], s->t[1], v.cross);
    cross3(x[1], v.cross, s->t[0]);
    for (j = 0; j < 3; j++) {
        dt[0][j] = 2 * d_det * (x[0][j] + s->low_pass * s->t[0][j]) +
                   d_b * s->t[1][j];
        dt[1][j] = 2 * d_det * (x[1][j] + s->low_pass * s->t[1][j]) +
                   d_b * s->t[0][j] + 2 * d_c * s->t[1][j];
    }
}

/* Computes the gradient of the quaternion from dR[i][j], through its
 * normalisation. */
static void rotation_backward(real *d_quat, const real *dr, const shape *s)
{
    const real *const q = s->quat;
    real d[4], along;
    int i;

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
    for (i = 0; i < 4; i++)
        d_quat[i] = (d[i] - along * q[i]) * s->quat_recip;
}

/* Computes the gradients of quaternion, scales and the rows of J W from those
 * of T. */
static void shape_backward(real *d_quat, real *d_scale, real d_row[2][3],
                           real dt[2][3], const shape *s,
                           const real *log2_scale)
{
    real dr[9], du[2][3];
    int i, j;

    for (j = 0; j < 3; j++) {
        if (log2_scale[j] >= -SCALE_MAX && log2_scale[j] <= SCALE_MAX)
            /* A column of T is proportional to 2^log2_scale, so d = ln 2 <dT,
             * T>. */
            d_scale[j] += LN_2 *
                          (dt[0][j] * s->t[0][j] + dt[1][j] * s->t[1][j]);
        du[0][j] = dt[0][j] * s->scale[j];
        du[1][j] = dt[1][j] * s->scale[j];
    }
    /* U = (J W) R gives dR = (J W)^T dU and d(J W) = dU R^T. */
    for (i = 0; i < 3; i++) {
        for (j = 0; j < 3; j++)
            dr[3 * i + j] = s->row[0][i] * du[0][j] + s->row[1][i] * du[1][j];
        d_row[0][i] = dot3(s->r + 3 * i, du[0]);
        d_row[1][i] = dot3(s->r + 3 * i, du[1]);
    }
    rotation_backward(d_quat, dr, s);
}

/* Computes the gradient of the position from those of the rows f/z (w_i - slope
 * w_2) and of mean = p + f x/z. A slope that was clamped is a constant. */
static void mean_backward(real *d_mean, const real *d_mean2d, real d_row[2][3],
                          const shape *s, const saga_splat_camera *cam)
{
    const real *const w = cam->rotation;
    const real z = s->view[2];
    real dv[3] = { 0 };
    int i;

    for (i = 0; i < 2; i++) {
        const real f = cam->focal[i] / z;
        /* x/z changes the mean, and the slope unless that is clamped. */
        real d_ratio = cam->focal[i] * d_mean2d[i];

        if (s->slope[i] == s->ratio[i])
            d_ratio -= f * dot3(w + 6, d_row[i]);
        /* The derivative of x/z by x is 1/z, by z -(x/z)/z; rows of J W are
         * proportional to 1/z too. */
        dv[i] = d_ratio / z;
        dv[2] -= (dot3(s->row[i], d_row[i]) + d_ratio * s->ratio[i]) / z;
    }
    for (i = 0; i < 3; i++)
        d_mean[i] = w[i] * dv[0] + w[3 + i] * dv[1] + w[6 + i] * dv[2];
}

/* Takes the gradients of a splat back to its primitive. A splat that was shrunk
 * to ROW_MAX gives none to its shape. */
static void project_one_backward(saga_splat_params *d, const splat_gradient *ds,
                                 saga_canvas *canvas, size_t i,
                                 const saga_splat_params *p)
{
    const saga_splat_work *const work = &canvas->splat;
    const saga_splat_posed *const d_posed = &work->d_posed;
    const real *const log2_scale = p->log2_scale + 3 * i;
    real dt[2][3] = { { 0 } }, d_row[2][3] = { { 0 } };
    real mean[2];
    shape s;
    size_t a;

    /* The forward pass keeps only splats, so its intermediate values are
     * computed again. */
    if (!project_mean(mean, &s, work->posed.mean + 3 * i, &canvas->camera))
        return;
    s.low_pass = canvas->rules.low_pass;
    project_shape(&s, work->posed.quat + 4 * i, log2_scale, &canvas->camera);
    for (a = 0; a < 4; a++)
        d_posed->quat[4 * i + a] = 0;
    if (s.shrink == 1) {
        conic_backward(dt, ds, work->splat + i, &s);
        shape_backward(d_posed->quat + 4 * i, d->log2_scale + 3 * i, d_row, dt,
                       &s, log2_scale);
    }
    mean_backward(d_posed->mean + 3 * i, ds->mean, d_row, &s, &canvas->camera);
    d_posed->q0[i] = ds->q0;
    for (a = 0; a < 3; a++)
        d->colour[3 * i + a] += ds->colour[a];
}

static void note(saga_splat_stats *st, const splat_gradient *d, size_t i)
{
    if (st->grad2d)
        st->grad2d[i] += sqrt(d->mean[0] * d->mean[0] +
                              d->mean[1] * d->mean[1]);
    if (st->weight)
        st->weight[i] += d->weight;
    if (st->seen)
        st->seen[i]++;
}

void saga_splat_project_backward(saga_splat_params *d, saga_splat_stats *stats,
                                 saga_canvas *canvas,
                                 const saga_splat_params *p, saga_range of)
{
    const saga_splat_work *const work = &canvas->splat;
    size_t i;

    for (i = of.begin; i < of.end; i++) {
        splat_gradient ds;

        if (work->extent[i] == 0)
            continue;
        gather(&ds, work, i);
        project_one_backward(d, &ds, canvas, i, p);
        if (stats)
            note(stats, &ds, i);
    }
}
