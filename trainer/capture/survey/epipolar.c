/* SPDX-License-Identifier: MIT */
#include "epipolar.h"

#include "vec3.h"

#include <math.h>
#include <string.h>

saga_pinhole saga_pinhole_of(const saga_source_view *view)
{
    saga_pinhole c = { .lens = { view->fx, view->fy, view->cx, view->cy } };
    memcpy(c.rotation, view->rotation, sizeof c.rotation);
    memcpy(c.translation, view->translation, sizeof c.translation);
    return c;
}

/* Sets c = a b^T for 3 x 3 matrices. */
static void times_transposed(double c[9], const double a[9], const double b[9])
{
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            c[3 * i + j] = a[3 * i] * b[3 * j] + a[3 * i + 1] * b[3 * j + 1] +
                           a[3 * i + 2] * b[3 * j + 2];
}

static void apply(double y[3], const double m[9], const double x[3])
{
    for (int i = 0; i < 3; i++)
        y[i] = m[3 * i] * x[0] + m[3 * i + 1] * x[1] + m[3 * i + 2] * x[2];
}

static void ray_of(double ray[3], const saga_pinhole *c, const double p[2])
{
    ray[0] = (p[0] - c->lens[2]) / c->lens[0];
    ray[1] = (p[1] - c->lens[3]) / c->lens[1];
    ray[2] = 1.0;
}

saga_epipolar saga_epipolar_between(const saga_pinhole *a,
                                    const saga_pinhole *b)
{
    saga_epipolar s;
    times_transposed(s.r, b->rotation, a->rotation);
    apply(s.t, s.r, a->translation);
    for (int k = 0; k < 3; k++)
        s.t[k] = b->translation[k] - s.t[k];
    return s;
}

/* Returns the distance in pixels of a point in camera c from the line (normal)
 * . (ray) = 0. */
static double off_line(const double normal[3], const saga_pinhole *c,
                       const double ray[3])
{
    return fabs(dot3(normal, ray)) /
           (hypot(normal[0] / c->lens[0], normal[1] / c->lens[1]) + 1e-300);
}

double saga_epipolar_off(const saga_pinhole *a, const saga_pinhole *b,
                         const saga_epipolar *between, const saga_match *match,
                         double within, bool *front)
{
    double ra[3], rb[3], turned[3], normal[3], back[3] = { 0.0 }, n[3];
    ray_of(ra, a, match->a);
    ray_of(rb, b, match->b);
    apply(turned, between->r, ra);
    /* With the essential matrix E = [t] R, the line in b has the normal E ra =
     * t x (R ra), and that in a has E^T rb = R^T (rb x t). */
    cross3(normal, between->t, turned);
    cross3(n, rb, between->t);
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++)
            back[k] += between->r[3 * i + k] * n[i];
    /* The depths follow from za R ra + t = zb rb by cross products with rb and
     * with R ra. */
    double across[3], x[3], y[3];
    cross3(across, turned, rb);
    cross3(x, rb, between->t);
    cross3(y, turned, between->t);
    const double least = within / b->lens[0] *
                         sqrt(dot3(turned, turned) * dot3(rb, rb));
    *front = dot3(across, across) <= least * least ||
             (dot3(across, x) > 0.0 && dot3(across, y) > 0.0);
    if (dot3(turned, rb) <= 0.0 && dot3(across, across) <= least * least)
        *front = false; /* parallel rays in opposite directions */
    return fmax(off_line(normal, b, rb), off_line(back, a, ra));
}

double saga_epipolar_turned(const saga_pinhole *a, const saga_pinhole *b,
                            const saga_match *m)
{
    const saga_epipolar s = saga_epipolar_between(a, b);
    double ray[3], x[3];
    ray_of(ray, a, m->a);
    apply(x, s.r, ray);
    return x[2] > 0.0 ? hypot(b->lens[0] * x[0] / x[2] + b->lens[2] - m->b[0],
                              b->lens[1] * x[1] / x[2] + b->lens[3] - m->b[1])
                      : (double)INFINITY;
}
