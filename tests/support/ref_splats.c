/* SPDX-License-Identifier: MIT */
#include "ref_splats.h"

#include "freed.h"
#include "model.h"

#include <math.h>
#include <stdlib.h>

typedef struct {
    double mean[2], inverse[3], q0, depth, colour[3];
    size_t index;
} splat;

/* Sets r to the rotation of a quaternion of length 1. */
static void rotation(double r[3][3], const double *quat)
{
    const double w = quat[0], x = quat[1], y = quat[2], z = quat[3];
    const double m[3][3] = { { w * w + x * x - y * y - z * z,
                               2 * (x * y - w * z), 2 * (x * z + w * y) },
                             { 2 * (x * y + w * z),
                               w * w - x * x + y * y - z * z,
                               2 * (y * z - w * x) },
                             { 2 * (x * z - w * y), 2 * (y * z + w * x),
                               w * w - x * x - y * y + z * z } };

    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            r[i][j] = m[i][j];
}

/* c = a b a^t */
static void conjugate(double c[3][3], double a[3][3], double b[3][3])
{
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) {
            c[i][j] = 0;
            for (int k = 0; k < 3; k++)
                for (int l = 0; l < 3; l++)
                    c[i][j] += a[i][k] * b[k][l] * a[j][l];
        }
}

static void covariance(double cov[3], const ref_animated *a, const double *view,
                       const ref_camera *cam)
{
    double r[3][3], w[3][3], j[3][3] = { { 0 } }, s[3][3] = { { 0 } };
    double t[3][3], b[3][3];

    rotation(r, a->quat);
    for (int i = 0; i < 3; i++) {
        s[i][i] = a->scale[i] * a->scale[i];
        for (int k = 0; k < 3; k++)
            w[i][k] = cam->rotation[3 * i + k];
    }
    for (int i = 0; i < 2; i++) {
        const double side = i ? cam->height : cam->width;
        const double lo = (-0.15 * side - cam->principal[i]) / cam->focal[i];
        const double hi = (1.15 * side - cam->principal[i]) / cam->focal[i];
        double ratio = view[i] / view[2];

        ratio = fmin(fmax(ratio, lo), hi);
        j[i][i] = cam->focal[i] / view[2];
        j[i][2] = -cam->focal[i] * ratio / view[2];
    }
    conjugate(t, r, s);
    conjugate(b, w, t);
    conjugate(t, j, b);
    cov[0] = t[0][0] + 0.1;
    cov[1] = t[0][1];
    cov[2] = t[1][1] + 0.1;
}

static int project(splat *o, const ref_coloured *p, double t,
                   const ref_camera *cam)
{
    ref_animated a;
    double view[3], cov[3], det;
    int k;

    ref_animate(&a, &p->p, t);
    for (int i = 0; i < 3; i++)
        for (view[i] = 0, k = 0; k < 3; k++)
            view[i] += cam->rotation[3 * i + k] * (a.x[k] - cam->centre[k]);
    o->q0 = a.q0 - SAGA_PEAK_LOG2;
    o->depth = view[2];
    if (view[2] < cam->near_plane || o->q0 >= cam->cut ||
        fabs(view[0] / view[2]) >= 8 || fabs(view[1] / view[2]) >= 8)
        return 0;
    for (int i = 0; i < 2; i++) {
        const double side = i ? cam->height : cam->width;

        o->mean[i] = cam->principal[i] + cam->focal[i] * view[i] / view[2];
        if (fabs(o->mean[i] - side / 2) > 32768)
            return 0;
    }
    covariance(cov, &a, view, cam);
    det = cov[0] * cov[2] - cov[1] * cov[1];
    o->inverse[0] = cov[2] / det;
    o->inverse[1] = -cov[1] / det;
    o->inverse[2] = cov[0] / det;
    for (int i = 0; i < 3; i++)
        o->colour[i] = p->colour[i];
    return 1;
}

static int by_depth(const void *a, const void *b)
{
    const splat *const x = a, *const y = b;

    if (x->depth != y->depth)
        return x->depth < y->depth ? -1 : 1;
    return x->index < y->index ? -1 : x->index > y->index;
}

static void draw_pixel(double rgb[3], uint8_t *unsure, const splat *s, size_t n,
                       double x, double y, const ref_camera *cam, double margin)
{
    double t = 1;

    rgb[0] = rgb[1] = rgb[2] = 0;
    *unsure = 0;
    for (size_t i = 0; i < n && t >= cam->t_floor; i++) {
        const double dx = x - s[i].mean[0], dy = y - s[i].mean[1];
        const double form = s[i].inverse[0] * dx * dx +
                            2 * s[i].inverse[1] * dx * dy +
                            s[i].inverse[2] * dy * dy;
        const double q = s[i].q0 + form / 2 / log(2);
        const double alpha = fmin(exp2(-q), cam->alpha_cap);

        if (fabs(q - cam->cut) < margin)
            *unsure = 1;
        if (q >= cam->cut)
            continue;
        for (int c = 0; c < 3; c++)
            rgb[c] += alpha * t * s[i].colour[c];
        t -= alpha * t;
        if (fabs(t - cam->t_floor) < margin * cam->t_floor)
            *unsure = 1;
    }
    for (int c = 0; c < 3; c++)
        rgb[c] += t * cam->background[c];
}

void ref_splats_draw(double *image, uint8_t *unsure, const ref_coloured *p,
                     size_t n, double t, const ref_camera *cam, double margin)
{
    const size_t plane = (size_t)cam->width * (size_t)cam->height;
    FREED splat *const s = malloc((n + 1) * sizeof *s);
    size_t i, m = 0;
    int y;

    for (i = 0; i < n; i++) {
        s[m].index = i;
        if (project(&s[m], p + i, t, cam))
            m++;
    }
    qsort(s, m, sizeof *s, by_depth);
    for (y = 0, i = 0; y < cam->height; y++)
        for (int x = 0; x < cam->width; x++, i++) {
            double rgb[3];

            draw_pixel(rgb, unsure + i, s, m, x + 0.5, y + 0.5, cam, margin);
            for (int c = 0; c < 3; c++)
                image[(size_t)c * plane + i] = rgb[c];
        }
}
