/* SPDX-License-Identifier: MIT */
#include "synth_ring.h"

#include "ring_paint.h"
#include "synth_math.h"

#include <string.h>

/* ----------------------------------------------------------------- tracing */

/* Tells whether a ray certainly misses a ball. It may return false for a ray
 * that misses. */
static bool passes(const double centre[3], double bound, const ray *r)
{
    const double v[3] = { centre[0] - r->origin[0], centre[1] - r->origin[1],
                          centre[2] - r->origin[2] };
    /* The origin is outside the ball, and either the ball is behind, or the
     * squared distance of the ray from its centre, v v - b^2 / length2, exceeds
     * bound^2. */
    const double b = dot3(v, r->direction);
    const double away = dot3(v, v) - bound * bound;
    return away > 0.0 && (b <= 0.0 || b * b < away * r->length2);
}

static bool enter_end(const saga_ring_shape *s, const ray *r, bool far_end,
                      double *t, double normal[3])
{
    double c[3];
    for (int i = 0; i < 3; i++)
        c[i] = s->a[i] + (far_end ? s->length * s->frame[0][i] : 0.0);
    if (!enter_ball(c, s->radius, r->origin, r->direction, r->length2, t))
        return false;
    for (int i = 0; i < 3; i++)
        normal[i] = (r->origin[i] + *t * r->direction[i] - c[i]) / s->radius;
    return true;
}

/* Finds where a ray from outside enters a capsule. The infinite cylinder is
 * tested first; if the ray enters it beyond an end, the ball at that end
 * decides. */
static bool enter_capsule(const saga_ring_shape *s, const ray *r, double *t,
                          double normal[3])
{
    const double *const axis = s->frame[0], *const d = r->direction;
    const double v[3] = { r->origin[0] - s->a[0], r->origin[1] - s->a[1],
                          r->origin[2] - s->a[2] };
    /* The ray is at the radius's distance from the axis where a t^2 + 2 b t + c
     * = 0. */
    const double da = dot3(d, axis), va = dot3(v, axis);
    const double a = r->length2 - da * da;
    const double b = dot3(v, d) - va * da;
    const double c = dot3(v, v) - va * va - s->radius * s->radius;
    const double disc = b * b - a * c;
    if (s->length == 0.0)
        return enter_end(s, r, false, t, normal);
    /* A ray along the axis can only enter through the end that it comes
     * from. */
    if (a <= 1e-12 * r->length2)
        return enter_end(s, r, da < 0.0, t, normal);
    if (disc <= 0.0)
        return false;
    *t = (-b - sqrt(disc)) / a;
    const double along = va + *t * da;
    if (along < 0.0 || along > s->length)
        return enter_end(s, r, along > 0.0, t, normal);
    for (int i = 0; i < 3; i++)
        normal[i] = (v[i] + *t * d[i] - along * axis[i]) / s->radius;
    return *t > 1e-9;
}

static bool enter_turned(const saga_ring_shape *s, const ray *r, double *t,
                         double normal[3])
{
    const double low[3] = { -s->half[0], -s->half[1], -s->half[2] };
    double o[3], d[3];
    int axis;
    /* In the box's own axes its sides are parallel to the axes. */
    for (int i = 0; i < 3; i++) {
        const double v[3] = { r->origin[0] - s->a[0], r->origin[1] - s->a[1],
                              r->origin[2] - s->a[2] };
        o[i] = dot3(s->frame[i], v);
        d[i] = dot3(s->frame[i], r->direction);
    }
    const ray local = make_ray(o, d);
    if (!enter_box(low, s->half, o, local.inverse, t, &axis))
        return false;
    for (int i = 0; i < 3; i++)
        normal[i] = (d[axis] > 0.0 ? -1.0 : 1.0) * s->frame[axis][i];
    return true;
}

static void hit_hall(const ray *r, saga_ring_hit *hit)
{
    static const double half = SAGA_RING_HALL;
    const double low[3] = { -half, -half, 0.0 };
    const double high[3] = { half, half, SAGA_RING_CEILING };
    int axis = 0;
    *hit = (saga_ring_hit){ .distance = 1e30, .shape = -1 };
    for (int i = 0; i < 3; i++) {
        /* From inside, each axis has one wall ahead, and the nearest of these
         * three is hit. */
        const double wall = r->inverse[i] > 0.0 ? high[i] : low[i];
        const double t = (wall - r->origin[i]) * r->inverse[i];
        if (t < hit->distance) {
            hit->distance = t;
            axis = i;
        }
    }
    hit->normal[axis] = r->direction[axis] > 0.0 ? -1.0 : 1.0;
    hit->object = hit->normal[2] > 0.5 ? SAGA_RING_GROUND : SAGA_RING_WALL;
}

static void hit_shape(const saga_ring_state *s, int shape, const ray *r,
                      saga_ring_hit *hit)
{
    const saga_ring_shape *const it = &s->shape[shape];
    double t, normal[3];
    if (passes(it->centre, it->bound, r) ||
        !(it->is_box ? enter_turned(it, r, &t, normal)
                     : enter_capsule(it, r, &t, normal)) ||
        t >= hit->distance)
        return;
    hit->distance = t;
    hit->shape = shape;
    hit->object = it->object;
    memcpy(hit->normal, normal, sizeof normal);
}

saga_ring_hit saga_ring_trace(const saga_ring_state *s, const double origin[3],
                              const double direction[3])
{
    const ray r = make_ray(origin, direction);
    saga_ring_hit hit;
    hit_hall(&r, &hit);
    const int first = passes(s->body_centre, s->body_bound, &r) ? s->n_body : 0;
    for (int i = first; i < s->n_shapes; i++)
        hit_shape(s, i, &r, &hit);
    for (int i = 0; i < 3; i++)
        hit.position[i] = origin[i] + hit.distance * direction[i];
    return hit;
}

/* ----------------------------------------------------------------- shading */

/* Returns the fraction of the light that passes a capsule. The shadow's edge
 * widens with the distance. `r` must run towards the light and have unit
 * length. */
static double open_of(const saga_ring_shape *s, const ray *r)
{
    const double *const axis = s->frame[0], *const d = r->direction;
    const double w[3] = { r->origin[0] - s->a[0], r->origin[1] - s->a[1],
                          r->origin[2] - s->a[2] };
    /* The points where the lines of ray and axis are nearest to each other,
     * limited to the axis's ends. */
    const double k = dot3(d, axis), wd = dot3(w, d);
    const double across = 1.0 - k * k;
    double along = across > 1e-9 ? (dot3(w, axis) - k * wd) / across : 0.0;
    along = along < 0.0 ? 0.0 : along > s->length ? s->length : along;
    const double t = k * along - wd, width = 0.012 + 0.025 * t;
    double v[3];
    if (t <= 0.0)
        return 1.0;
    for (int i = 0; i < 3; i++)
        v[i] = w[i] + t * d[i] - along * axis[i];
    return ramp(s->radius - width, s->radius + width, sqrt(dot3(v, v)));
}

/* Returns the fraction of the light that reaches a place. The shape with the
 * place on it casts no shadow there; shadows of boxes have sharp edges. */
static double lit(const saga_ring_state *s, const saga_ring_hit *hit,
                  const double to_light[3])
{
    const ray r = make_ray(hit->position, to_light);
    const double wide = 0.15; /* open_of widens a shadow by this at most, up to
                               * 5 m away */
    const int first = passes(s->body_centre, s->body_bound + wide, &r)
                          ? s->n_body
                          : 0;
    double open = 1.0, t, normal[3];
    for (int i = first; i < s->n_shapes && open > 0.0; i++) {
        const saga_ring_shape *const it = &s->shape[i];
        if (i == hit->shape || it->object == SAGA_RING_DISPLAY ||
            passes(it->centre, it->bound + wide, &r))
            continue;
        if (it->is_box)
            open *= enter_turned(it, &r, &t, normal) ? 0.0 : 1.0;
        else
            open *= open_of(it, &r);
    }
    return open;
}

/* Returns the highlight of the light on a glossy surface. */
static double spot(const saga_ring_hit *hit, const double direction[3],
                   const double to_light[3])
{
    double view[3] = { direction[0], direction[1], direction[2] }, m[3];
    normalise(view);
    const double cosine = dot3(view, hit->normal);
    for (int i = 0; i < 3; i++)
        m[i] = view[i] - 2.0 * cosine * hit->normal[i];
    double s = clamp01(dot3(m, to_light));
    /* s^16, where s is the cosine of the angle to the mirrored ray. */
    for (int i = 0; i < 4; i++)
        s *= s;
    return 0.6 * s;
}

void saga_ring_radiance(const saga_ring_state *s, const double origin[3],
                        const double direction[3], double rgb[3])
{
    const saga_ring_hit hit = saga_ring_trace(s, origin, direction);
    double to_light[3];
    for (int i = 0; i < 3; i++) {
        to_light[i] = s->plan.light[i] - hit.position[i];
        rgb[i] = 0.0;
    }
    const double distance2 = dot3(to_light, to_light);
    normalise(to_light);
    if (saga_ring_albedo(s, &hit, rgb))
        return;
    const double facing = dot3(hit.normal, to_light);
    const double open = facing > 0.0 ? lit(s, &hit, to_light) : 0.0;
    /* A second, weak light from the opposite side casts no shadow. */
    const double fill = -(hit.normal[0] * s->plan.light[0] +
                          hit.normal[1] * s->plan.light[1]) /
                        2.8;
    brighten(rgb,
             0.38 + 0.12 * hit.normal[2] + (fill > 0.0 ? 0.25 * fill : 0.0) +
                 2.2 / (1.0 + 0.06 * distance2) * fmax(facing, 0.0) * open);
    if (hit.object != SAGA_RING_BALL && hit.object != SAGA_RING_GOER)
        return;
    for (int i = 0; i < 3; i++)
        rgb[i] += open * spot(&hit, direction, to_light);
}
