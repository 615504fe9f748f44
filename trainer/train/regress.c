/* SPDX-License-Identifier: MIT */
#include "regress.h"

#include <math.h>

#ifdef SAGA_REAL_DOUBLE
#define EXP2 exp2
#else
#define EXP2 exp2f
#endif

/* Weights of the terms: what a difference of 1 costs. Colour is in [0, 1],
 * log2 sizes and logits in octaves, displacements in sizes of the primitive,
 * a temporal centre in segments. */
static const real weight_shape = R(0.25), weight_opacity = R(0.05),
                  weight_colour = R(10), weight_time = R(10),
                  weight_width = R(0.25), weight_move = R(4);

/* Added to a primitive's size, half-cubes: less is hardly seen. */
static const real least_size = R(1) / 256;

/* Moments of its life a primitive is compared at. */
enum { N_MOMENTS = 3 };

/* Opacities beyond +-8 octaves of logit look alike. */
static const real logit_limit = R(8);

/* --- Log-covariance ------------------------------------------------------ */

/* Unit quaternion to rotation; returns 1 / |q|, or 0 for the zero one. */
static real rotation(real r[9], real u[4], const real q[4])
{
    const real n2 = q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3];
    const real inverse = n2 > 0 ? (real)(1 / sqrt((double)n2)) : 0;
    int i;

    for (i = 0; i < 4; i++)
        u[i] = n2 > 0 ? q[i] * inverse : (real)(i == 0);
    r[0] = 1 - 2 * (u[2] * u[2] + u[3] * u[3]);
    r[1] = 2 * (u[1] * u[2] - u[0] * u[3]);
    r[2] = 2 * (u[1] * u[3] + u[0] * u[2]);
    r[3] = 2 * (u[1] * u[2] + u[0] * u[3]);
    r[4] = 1 - 2 * (u[1] * u[1] + u[3] * u[3]);
    r[5] = 2 * (u[2] * u[3] - u[0] * u[1]);
    r[6] = 2 * (u[1] * u[3] - u[0] * u[2]);
    r[7] = 2 * (u[2] * u[3] + u[0] * u[1]);
    r[8] = 1 - 2 * (u[1] * u[1] + u[2] * u[2]);
    return inverse;
}

static const int row_of[6] = { 0, 0, 0, 1, 1, 2 };
static const int col_of[6] = { 0, 1, 2, 1, 2, 2 };

void saga_log_covar(real l[6], const real quat[4], const real log2_scale[3])
{
    real r[9], u[4];
    int i, k;

    rotation(r, u, quat);
    for (i = 0; i < 6; i++) {
        l[i] = 0;
        for (k = 0; k < 3; k++)
            l[i] += 2 * log2_scale[k] * r[3 * row_of[i] + k] *
                    r[3 * col_of[i] + k];
    }
}

/* dL/dR to the unit quaternion. */
static void rotation_backward(real d_u[4], const real g[9], const real u[4])
{
    d_u[0] = 2 * (-u[3] * g[1] + u[2] * g[2] + u[3] * g[3] - u[1] * g[5] -
                  u[2] * g[6] + u[1] * g[7]);
    d_u[1] = 2 * (u[2] * g[1] + u[3] * g[2] + u[2] * g[3] - 2 * u[1] * g[4] -
                  u[0] * g[5] + u[3] * g[6] + u[0] * g[7] - 2 * u[1] * g[8]);
    d_u[2] = 2 * (-2 * u[2] * g[0] + u[1] * g[1] + u[0] * g[2] + u[1] * g[3] +
                  u[3] * g[5] - u[0] * g[6] + u[3] * g[7] - 2 * u[2] * g[8]);
    d_u[3] = 2 * (-2 * u[3] * g[0] - u[0] * g[1] + u[1] * g[2] + u[0] * g[3] -
                  2 * u[3] * g[4] + u[2] * g[5] + u[1] * g[6] + u[2] * g[7]);
}

void saga_log_covar_backward(real d_quat[4], real d_log2_scale[3],
                             const real d_l[6], const real quat[4],
                             const real log2_scale[3])
{
    real r[9], u[4], g[9] = { 0 }, d_u[4], along = 0;
    const real inverse = rotation(r, u, quat);
    int i, k;

    for (i = 0; i < 6; i++)
        for (k = 0; k < 3; k++) {
            const real a = r[3 * row_of[i] + k], b = r[3 * col_of[i] + k];

            d_log2_scale[k] += 2 * d_l[i] * a * b;
            g[3 * row_of[i] + k] += 2 * log2_scale[k] * d_l[i] * b;
            g[3 * col_of[i] + k] += 2 * log2_scale[k] * d_l[i] * a;
        }
    rotation_backward(d_u, g, u);
    for (i = 0; i < 4; i++)
        along += d_u[i] * u[i];
    for (i = 0; i < 4; i++)
        d_quat[i] += (d_u[i] - along * u[i]) * inverse;
}

/* --- The loss ------------------------------------------------------------ */

/* Adds w (x - y)^2, returns its derivative. */
static real square(double *loss, real x, real y, real w)
{
    const real e = x - y;

    *loss += (double)(w * e * e);
    return 2 * w * e;
}

static real limited(real logit)
{
    return logit > logit_limit ? logit_limit
         : logit < -logit_limit ? -logit_limit : logit;
}

/* Rotation and motion of a primitive at one moment. */
typedef struct {
    real dt, quat[4], move[3];
} moment;

static void moment_of(moment *m, const saga_splat_params *p, size_t i, real t)
{
    size_t k;

    m->dt = p->t_centre ? t - p->t_centre[i] : 0;
    for (k = 0; k < 4; k++)
        m->quat[k] = p->quat[4 * i + k] +
                     (p->slope ? m->dt * p->slope[4 * i + k] : 0);
    for (k = 0; k < 3; k++) {
        const real *const b = p->motion ? p->motion + 9 * i + k : NULL;
        const real unit = p->support ? p->support[3 * i + k] : 1;

        m->move[k] = !b ? 0 : unit * ((b[6] * m->dt + b[3]) * m->dt + b[0]) *
                              m->dt;
    }
}

/* Given the gradients to a moment's rotation and displacement. */
static void moment_backward(saga_splat_params *d, const saga_splat_params *p,
                            size_t i, const moment *m, const real d_quat[4],
                            const real d_move[3])
{
    const real dt = m->dt;
    real d_dt = 0;
    size_t k;

    for (k = 0; k < 4; k++) {
        d->quat[4 * i + k] += d_quat[k];
        if (p->slope) {
            d->slope[4 * i + k] += dt * d_quat[k];
            d_dt += d_quat[k] * p->slope[4 * i + k];
        }
    }
    for (k = 0; p->motion && k < 3; k++) {
        const real *const b = p->motion + 9 * i + k;
        real *const db = d->motion + 9 * i + k;
        const real unit = p->support ? p->support[3 * i + k] : 1;
        const real e = unit * d_move[k];

        db[0] += e * dt;
        db[3] += e * dt * dt;
        db[6] += e * dt * dt * dt;
        d_dt += e * ((3 * b[6] * dt + 2 * b[3]) * dt + b[0]);
        if (p->support)
            d->support[3 * i + k] += d_move[k] *
                                     (((b[6] * dt + b[3]) * dt + b[0]) * dt);
    }
    if (p->t_centre)
        d->t_centre[i] -= d_dt;
}

/* Shape and place at time t; w: of the whole. */
static void moment_loss(double *loss, saga_splat_params *d,
                        const saga_splat_params *a, const saga_splat_params *t,
                        size_t i, real time, real w)
{
    real l[6], want[6], d_l[6], d_quat[4] = { 0 }, d_move[3];
    real size = 0;
    moment ours, theirs;
    int k;

    moment_of(&ours, a, i, time);
    moment_of(&theirs, t, i, time);
    saga_log_covar(l, ours.quat, a->log2_scale + 3 * i);
    saga_log_covar(want, theirs.quat, t->log2_scale + 3 * i);
    /* Off-diagonal elements stand for two. */
    for (k = 0; k < 6; k++)
        d_l[k] = square(loss, l[k], want[k],
                        w * weight_shape * (row_of[k] == col_of[k] ? 1 : 2));
    saga_log_covar_backward(d_quat, d->log2_scale + 3 * i, d_l, ours.quat,
                            a->log2_scale + 3 * i);
    for (k = 0; k < 3; k++)
        size += t->log2_scale[3 * i + (size_t)k] / 3;
    size = EXP2(size) + least_size;
    for (k = 0; k < 3; k++)
        d_move[k] = square(loss, ours.move[k], theirs.move[k],
                           w * weight_move / (size * size));
    moment_backward(d, a, i, &ours, d_quat, d_move);
}

/* The part of the segment in which a primitive is seen: where temporal opacity
 * is above 1/e. */
static void life_of(real life[2], const saga_splat_params *t, size_t i)
{
    const real centre = t->t_centre ? t->t_centre[i] : R(0.5);
    const real reach = t->log2_width ? EXP2(t->log2_width[i]) : 1;

    life[0] = centre - reach > 0 ? centre - reach : 0;
    life[1] = centre + reach < 1 ? centre + reach : 1;
    if (!(life[0] < life[1]))
        life[0] = life[1] = centre;
}

double saga_regress_loss(saga_splat_params *d, const saga_splat_params *a,
                         const saga_splat_params *target, const real *weight,
                         size_t n)
{
    double loss = 0;
    size_t i, k;

    for (i = 0; i < n; i++) {
        const real w = weight[i] / (real)n;
        real life[2];

        life_of(life, target, i);
        for (k = 0; k < N_MOMENTS; k++)
            moment_loss(&loss, d, a, target, i, life[0] +
                        (life[1] - life[0]) * (real)k / (N_MOMENTS - 1),
                        w / N_MOMENTS);
        if (limited(a->opacity[i]) != limited(target->opacity[i]))
            d->opacity[i] += square(&loss, a->opacity[i],
                                    limited(target->opacity[i]),
                                    w * weight_opacity);
        for (k = 3 * i; k < 3 * i + 3; k++)
            d->colour[k] += square(&loss, a->colour[k], target->colour[k],
                                   w * weight_colour);
        if (a->t_centre && target->t_centre)
            d->t_centre[i] += square(&loss, a->t_centre[i],
                                     target->t_centre[i], w * weight_time);
        if (a->log2_width && target->log2_width)
            d->log2_width[i] += square(&loss, a->log2_width[i],
                                       target->log2_width[i],
                                       w * weight_width);
    }
    return loss;
}
