/* SPDX-License-Identifier: MIT
 *
 * See ref_primitive.h. These functions share with the decoder only constants of
 * model.h: integer widths, Q formats and the order of operations differ.
 */
#include "ref_primitive.h"

#include "ref_nets.h"
#include "scaffold.h"

#include <math.h>
#include <string.h>

static const double log2_e = 1.4426950408889634;

enum { FROM_HEADER = -1 };

#define AT(member) offsetof(ref_primitive, member)

const ref_field ref_fields[REF_N_FIELDS] = {
    { "position", "box unit", AT(mean), 0, 0, 3, 0, false },
    { "opacity", "log2", AT(opacity), SAGA_OUT_OPACITY, 1, 0, FROM_HEADER,
      false },
    { "log2 scale", "1", AT(log2_scale), SAGA_OUT_SCALE, 1, 0, 10, false },
    { "quaternion", "1", AT(quat), SAGA_OUT_QUAT, 1, 0, FROM_HEADER, false },
    { "motion", "support", AT(motion), SAGA_OUT_MOTION1, 3, 0, FROM_HEADER,
      true },
    { "slope", "1", AT(slope), SAGA_OUT_SLOPE, 1, 0, FROM_HEADER, true },
    { "temporal centre", "segment", AT(t_centre), 0, 0, 1, 16, true },
    { "log2 temporal width", "1", AT(log2_width), SAGA_OUT_WIDTH, 1, 0, 10,
      true }
};

int ref_field_width(const ref_field *f, const saga_model *m)
{
    saga_rows rows[SAGA_N_OUTS];
    int n = 0;

    saga_model_rows(rows, m);
    for (int i = 0; i < f->n_outs; i++)
        n += rows[f->out + i].n;
    return f->n_outs ? n : f->n;
}

double ref_field_step(const ref_field *f, const saga_model *m)
{
    return ldexp(1, -(f->q == FROM_HEADER ? m->out_q[f->out] : f->q));
}

/* --- From the outputs of F_geo -------------------------------------------- */

/* Returns value i of an output, or 0 if the output has no such row. */
static double value(const double *out, const saga_rows *rows, int i)
{
    return i < rows->n ? out[rows->first + i] : 0;
}

void ref_primitive_make(ref_primitive *p, const saga_model *m,
                        const double *out, const double x[4],
                        const double support[4], const double log2_half[4])
{
    saga_rows rows[SAGA_N_OUTS];

    saga_model_rows(rows, m);
    for (int i = 0; i < 3; i++) {
        p->mean[i] = x[i];
        p->support[i] = support[i];
        p->log2_scale[i] = ref_saturate(
            value(out, &rows[SAGA_OUT_SCALE], i) + log2_half[i], 1 / 1024.0);
        for (int k = 0; k < 3; k++)
            p->motion[3 * k + i] = value(out, &rows[SAGA_OUT_MOTION1 + k], i);
    }
    for (int i = 0; i < 4; i++) {
        p->quat[i] = value(out, &rows[SAGA_OUT_QUAT], i);
        p->slope[i] = value(out, &rows[SAGA_OUT_SLOPE], i);
    }
    p->quat[0] = ref_saturate(p->quat[0] + 1,
                              ldexp(1, -m->out_q[SAGA_OUT_QUAT]));
    p->opacity = value(out, &rows[SAGA_OUT_OPACITY], 0);
    p->t_centre = ref_clamp(x[3] + support[3] *
                                       value(out, &rows[SAGA_OUT_TIME], 0),
                            SAGA_CENTRE_T_MIN, SAGA_CENTRE_T_END - 1) /
                  65536;
    p->log2_width = rows[SAGA_OUT_WIDTH].n
                        ? ref_saturate(value(out, &rows[SAGA_OUT_WIDTH], 0) +
                                           log2_half[3],
                                       1 / 1024.0) -
                              16
                        : INFINITY;
}

void ref_primitive_stand_still(ref_primitive *p)
{
    memset(p->motion, 0, sizeof p->motion);
    memset(p->slope, 0, sizeof p->slope);
    p->t_centre = 0.5;
    /* 2^(32767/1024) time units are the longest width of the format. */
    p->log2_width = 32767 / 1024.0 - 16;
}

/* --- From integers -------------------------------------------------------- */

static void normalise(double q[4])
{
    const double len = sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] +
                            q[3] * q[3]);
    int i;

    for (i = 0; i < 4; i++)
        q[i] = len > 0 ? q[i] / len : i == 0;
}

void ref_primitive_of(ref_primitive *out, const saga_primitive *p,
                      const saga_prim_format *f)
{
    int i;

    /* A parameter that the file's tools leave out has no format, and is 0. */
    for (i = 0; i < 3; i++) {
        out->mean[i] = p->x[i];
        out->support[i] = p->support[i];
        out->log2_scale[i] = p->log2_scale_q10[i] / 1024.0;
    }
    for (i = 0; i < 9; i++)
        out->motion[i] = i / 3 < f->motion_order
                             ? ldexp(p->motion[i], -f->q_motion[i / 3])
                             : 0;
    for (i = 0; i < 4; i++) {
        out->quat[i] = ldexp(p->quat[i], -f->q_quat);
        out->slope[i] = f->has_slope ? ldexp(p->slope[i], -f->q_slope) : 0;
    }
    out->opacity = ldexp(p->opacity, -f->q_opacity);
    out->t_centre = p->t_centre / 65536.0;
    out->log2_width = f->has_width ? p->log2_width_q10 / 1024.0 - 16 : INFINITY;
}

void ref_animated_of(ref_animated *out, const saga_animated *a)
{
    int i;

    for (i = 0; i < 3; i++) {
        out->x[i] = a->x[i];
        out->scale[i] = exp2(a->log2_scale_q10[i] / 1024.0);
    }
    for (i = 0; i < 4; i++)
        out->quat[i] = a->quat[i];
    normalise(out->quat);
    out->q0 = a->q0_q20 / 1048576.0;
}

/* --- At a time ------------------------------------------------------------ */

void ref_animate(ref_animated *out, const ref_primitive *p, double t)
{
    const double width = fmin(0.5, exp2(p->log2_width));
    const double dt = t - p->t_centre;
    const double age = ref_clamp(dt / width, -4, 4);
    const double u = fmin(16, fabs(dt) / exp2(p->log2_width));
    int i, k;

    for (i = 0; i < 3; i++) {
        double m = 0;

        for (k = 0; k < 3; k++)
            m += p->motion[3 * k + i] * pow(age, k + 1);
        m = ref_clamp(m, -524288, 524288);
        out->x[i] = ref_clamp(p->mean[i] + p->support[i] * m, -536870912.0,
                              536870912.0);
        out->scale[i] = exp2(p->log2_scale[i]);
    }
    for (i = 0; i < 4; i++)
        out->quat[i] = p->quat[i] + p->slope[i] * age;
    normalise(out->quat);
    /* The peak is 8 / (1 + 2^(3 - opacity)); the life, a Gaussian in time,
     * multiplies it by exp(-u^2). */
    out->q0 = log2(1 + exp2(SAGA_PEAK_LOG2 - p->opacity));
    if (isinf(out->q0))
        out->q0 = SAGA_PEAK_LOG2 - p->opacity;
    out->q0 += log2_e * u * u;
}
