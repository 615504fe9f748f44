/* SPDX-License-Identifier: MIT
 *
 * Functions for drawing the built-in scenes: numbers, noise, colours, and the
 * intersection of rays with shapes.
 *
 * They use only IEEE additions, products, quotients, square roots and floor,
 * and a sine of their own. Built without contraction (-ffp-contract=off), they
 * give the same bits on every machine.
 */
#ifndef SAGA_SYNTH_MATH_H
#define SAGA_SYNTH_MATH_H

#include "vec3.h"

#include <math.h>
#include <stdbool.h>
#include <stdint.h>

/* Computes sine and cosine of an angle in turns, within 1e-15. */
void saga_synth_sin_cos(double turns, double *s, double *c);

/* ----------------------------------------------------------------- numbers */

static inline void normalise(double a[3])
{
    const double s = 1.0 / sqrt(dot3(a, a));
    for (int i = 0; i < 3; i++)
        a[i] *= s;
}

static inline double clamp01(double x)
{
    return x < 0.0 ? 0.0 : x > 1.0 ? 1.0 : x;
}

static inline double mix(double a, double b, double t)
{
    return a + (b - a) * t;
}

/* Returns 0 below a, 1 above b, and a smooth transition between them. */
static inline double ramp(double a, double b, double x)
{
    const double t = clamp01((x - a) / (b - a));
    return t * t * (3.0 - 2.0 * t);
}

/* ----------------------------------------------------------------- texture */

static inline double lattice(int32_t x, int32_t y, uint32_t salt)
{
    uint32_t h = (uint32_t)x * 0x9e3779b1u ^ (uint32_t)y * 0x85ebca77u ^
                 salt * 0xc2b2ae3du;
    h ^= h >> 15;
    h *= 0x2c1b3c6du;
    h ^= h >> 12;
    h *= 0x297a2d39u;
    h ^= h >> 15;
    return (double)(h >> 8) * (1.0 / 16777216.0);
}

/* Returns smooth noise in 0..1 with features of about one unit. */
static inline double noise(double x, double y, uint32_t salt)
{
    const double fx = floor(x), fy = floor(y);
    const int32_t ix = (int32_t)fx, iy = (int32_t)fy;
    const double u = x - fx, v = y - fy;
    const double su = u * u * (3.0 - 2.0 * u), sv = v * v * (3.0 - 2.0 * v);
    const double top = mix(lattice(ix, iy, salt), lattice(ix + 1, iy, salt),
                           su);
    const double bottom = mix(lattice(ix, iy + 1, salt),
                              lattice(ix + 1, iy + 1, salt), su);
    return mix(top, bottom, sv);
}

/* Returns the sum of two octaves of noise about 0, a broad one and a finer
 * one. */
static inline double grain(double x, double y, uint32_t salt)
{
    return (noise(x, y, salt) - 0.5) +
           0.45 * (noise(3.7 * x, 3.7 * y, salt + 1) - 0.5);
}

static inline void paint(double rgb[3], double r, double g, double b,
                         double amount)
{
    rgb[0] = mix(rgb[0], r, amount);
    rgb[1] = mix(rgb[1], g, amount);
    rgb[2] = mix(rgb[2], b, amount);
}

static inline void brighten(double rgb[3], double factor)
{
    for (int i = 0; i < 3; i++)
        rgb[i] *= factor;
}

/* Returns the brightness of lines of the given half-width at every period,
 * whose edges are soft over one half-width. */
static inline double lines(double x, double period, double half)
{
    const double d = fabs(x / period - floor(x / period + 0.5)) * period;
    return 1.0 - ramp(half, 2.0 * half, d);
}

static inline double inside_rect(double x, double y, double cx, double cy,
                                 double hx, double hy)
{
    const double dx = hx - fabs(x - cx), dy = hy - fabs(y - cy);
    return ramp(-0.006, 0.006, dx < dy ? dx : dy);
}

/* ------------------------------------------------------------------- rays */

/* Finds where a ray enters a box from outside. Sets t and the axis of the side
 * that it enters. */
static inline bool enter_box(const double low[3], const double high[3],
                             const double o[3], const double inverse[3],
                             double *t, int *axis)
{
    double near = 0.0, far = 1e30;
    int which = -1;
    for (int i = 0; i < 3; i++) {
        double a = (low[i] - o[i]) * inverse[i];
        double b = (high[i] - o[i]) * inverse[i];
        if (a > b) {
            const double swap = a;
            a = b;
            b = swap;
        }
        if (a > near) {
            near = a;
            which = i;
        }
        far = b < far ? b : far;
    }
    *t = near;
    *axis = which;
    return which >= 0 && near < far;
}

static inline bool enter_ball(const double centre[3], double radius,
                              const double o[3], const double d[3], double d2,
                              double *t)
{
    const double v[3] = { centre[0] - o[0], centre[1] - o[1],
                          centre[2] - o[2] };
    const double b = dot3(v, d);
    const double disc = b * b - d2 * (dot3(v, v) - radius * radius);
    if (b <= 0.0 || disc <= 0.0)
        return false;
    *t = (b - sqrt(disc)) / d2;
    return *t > 1e-9;
}

typedef struct ray {
    const double *origin, *direction;
    double inverse[3], length2;
} ray;

/* Components of 0 are replaced by tiny ones, so that quotients are huge but
 * never NaN. */
static inline ray make_ray(const double origin[3], const double direction[3])
{
    ray r = { .origin = origin,
              .direction = direction,
              .length2 = dot3(direction, direction) };
    for (int i = 0; i < 3; i++)
        r.inverse[i] = 1.0 / (direction[i] == 0.0 ? 1e-300 : direction[i]);
    return r;
}

#endif
