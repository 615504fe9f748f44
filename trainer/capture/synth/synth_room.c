/* SPDX-License-Identifier: MIT */
#include "synth_room.h"

#include "synth_math.h"

#include <math.h>
#include <stdint.h>
#include <string.h>

static void poster_rings(double x, double z, double rgb[3])
{
    const double dx = x + 1.05, dz = z - 1.62;
    const double r = sqrt(dx * dx + dz * dz);
    const double in = inside_rect(x, z, -1.05, 1.62, 0.42, 0.5);
    const double ring = ramp(-0.3, 0.3,
                             4.0 * fabs(r / 0.3 - floor(r / 0.3 + 0.5)) - 1.0);
    double c[3] = { 0.75, 0.68, 0.45 };
    paint(c, 0.55, 0.10, 0.08, ring * (1.0 - ramp(0.38, 0.42, r)));
    paint(c, 0.10, 0.14, 0.30, ramp(0.38, 0.42, r));
    paint(rgb, c[0], c[1], c[2], in);
}

static void poster_hills(double x, double z, double rgb[3])
{
    const double in = inside_rect(x, z, 0.85, 1.6, 0.55, 0.4);
    const double h1 = 1.50 + 0.22 * noise(2.2 * x, 0.5, 71);
    const double h2 = 1.30 + 0.22 * noise(3.1 * x, 9.5, 72);
    double c[3] = { 0.30, 0.48, 0.70 };
    paint(c, 0.80, 0.60, 0.42, 1.0 - ramp(1.5, 1.95, z));
    paint(c, 0.20, 0.30, 0.34, 1.0 - ramp(h1 - 0.01, h1 + 0.01, z));
    paint(c, 0.12, 0.28, 0.10, 1.0 - ramp(h2 - 0.01, h2 + 0.01, z));
    paint(rgb, c[0], c[1], c[2], in);
}

static void back_wall(double x, double z, double rgb[3])
{
    paint(rgb, 0.52, 0.44, 0.33, 1.0);
    brighten(rgb, 1.0 + 0.45 * grain(1.6 * x, 1.6 * z, 11));
    const double low = 1.0 - ramp(0.96, 0.98, z);
    paint(rgb, 0.20, 0.30, 0.27, low);
    brighten(rgb, 1.0 - 0.35 * low * lines(x - 0.1, 0.46, 0.018));
    brighten(rgb, 1.0 + 0.5 * low * grain(2.5 * x, 1.2 * z, 13));
    paint(rgb, 0.62, 0.58, 0.50, ramp(0.94, 0.96, z) - ramp(1.0, 1.02, z));
    poster_rings(x, z, rgb);
    poster_hills(x, z, rgb);
}

static void left_wall(double y, double z, double rgb[3])
{
    double s, c;
    saga_synth_sin_cos(z / 0.55 + 0.12 * grain(y, z, 21), &s, &c);
    paint(rgb, 0.26, 0.36, 0.48, 1.0);
    brighten(rgb, 1.0 + 0.22 * s);
    brighten(rgb, 1.0 + 0.4 * grain(1.8 * y, 1.8 * z, 22));
}

static void right_wall(double y, double z, double rgb[3])
{
    const double row = floor(z / 0.24);
    /* Every second row of bricks is shifted by half a brick. */
    const double shift = y / 0.52 + 0.5 * (row - 2.0 * floor(0.5 * row));
    const double tone = lattice((int32_t)floor(shift), (int32_t)row, 31);
    paint(rgb, 0.46, 0.26, 0.18, 1.0);
    brighten(rgb, 0.8 + 0.4 * tone);
    brighten(rgb, 1.0 + 0.3 * grain(3.0 * y, 3.0 * z, 32));
    const double joint = fmax(lines(z, 0.24, 0.014),
                              lines(shift + 0.5, 1.0, 0.014 / 0.52));
    paint(rgb, 0.42, 0.36, 0.32, 0.6 * joint);
}

static void floor_boards(double x, double y, double rgb[3])
{
    const double board = floor(x / 0.34);
    const double along = y + 0.9 * lattice((int32_t)board, 7, 41);
    const double tone = lattice((int32_t)board, (int32_t)floor(along / 1.3),
                                42);
    paint(rgb, 0.36, 0.23, 0.13, 1.0);
    brighten(rgb, 0.75 + 0.5 * tone);
    brighten(rgb, 1.0 + 0.5 * grain(5.0 * x, 1.1 * y, 43));
    brighten(rgb, 1.0 - 0.4 * lines(x, 0.34, 0.01));
    /* The rug is an ellipse that covers the boards. */
    const double r = sqrt(x * x + 1.7 * (y + 0.55) * (y + 0.55));
    const double rug = 1.0 - ramp(1.28, 1.30, r);
    double c[3] = { 0.42, 0.10, 0.12 };
    paint(c, 0.62, 0.50, 0.30, lines(r - 0.15, 0.4, 0.05));
    paint(c, 0.10, 0.14, 0.30, 1.0 - ramp(0.38, 0.40, r));
    brighten(c, 1.0 + 0.4 * grain(5.0 * x, 5.0 * y, 45));
    paint(rgb, c[0], c[1], c[2], rug);
}

static const double room_low[3] = { -2.3, -3.6, 0.0 };
static const double room_high[3] = { 2.3, 2.2, 2.6 };
static const double bench_low[3] = { -0.95, 0.1, 0.0 };
static const double bench_high[3] = { 0.95, 0.95, 0.6 };
enum { CUBE_HALF_MM = 210 };
static const double cube_centre[3] = { 0.08, 0.5, 0.6 + CUBE_HALF_MM / 1000.0 };

static void room_colour(const saga_room_hit *hit, double rgb[3])
{
    const double *const p = hit->position, *const n = hit->normal;
    if (n[2] > 0.5)
        floor_boards(p[0], p[1], rgb);
    else if (n[1] < -0.5)
        back_wall(p[0], p[2], rgb);
    else if (n[0] > 0.5)
        left_wall(p[1], p[2], rgb);
    else if (n[0] < -0.5)
        right_wall(p[1], p[2], rgb);
    else if (n[2] < -0.5) {
        paint(rgb, 0.62, 0.60, 0.56, 1.0);
        brighten(rgb, 1.0 + 0.2 * grain(p[0], p[1], 51));
    } else {
        paint(rgb, 0.30, 0.28, 0.26, 1.0);
    }
}

static void bench_colour(const saga_room_hit *hit, double rgb[3])
{
    const double *const p = hit->position;
    if (hit->normal[2] > 0.5) {
        double s, c;
        saga_synth_sin_cos(4.0 * p[1] + 1.5 * noise(1.4 * p[0], 2.0 * p[1], 61),
                           &s, &c);
        paint(rgb, 0.50, 0.36, 0.20, 1.0);
        brighten(rgb, 1.0 + 0.14 * s);
        brighten(rgb, 1.0 + 0.35 * grain(3.0 * p[0], 6.0 * p[1], 62));
        return;
    }
    const double a = hit->normal[1] < -0.5 ? p[0] : p[1];
    const double cell = a / 0.38 - floor(a / 0.38 + 0.5);
    const double dz = (p[2] - 0.3) / 0.38;
    const double r = sqrt(cell * cell + dz * dz);
    paint(rgb, 0.26, 0.17, 0.10, 1.0);
    brighten(rgb, 1.0 + 0.5 * grain(3.0 * a, 3.0 * p[2], 63));
    paint(rgb, 0.55, 0.42, 0.16, 0.8 * (1.0 - ramp(0.26, 0.30, r)));
}

/* Paints the cube in its own axes: each face has its own colour and a disc. */
static void cube_colour(const saga_room_state *s, const saga_room_hit *hit,
                        double rgb[3])
{
    static const double face[4][3] = { { 0.60, 0.16, 0.10 },
                                       { 0.10, 0.36, 0.50 },
                                       { 0.62, 0.50, 0.10 },
                                       { 0.16, 0.42, 0.16 } };
    const double dx = hit->position[0] - cube_centre[0];
    const double dy = hit->position[1] - cube_centre[1];
    const double dz = hit->position[2] - cube_centre[2];
    /* Coordinates in the cube's own axes, so that its paint turns with it. */
    const double x = s->cube_cos * dx + s->cube_sin * dy;
    const double y = s->cube_cos * dy - s->cube_sin * dx;
    const double nx = s->cube_cos * hit->normal[0] +
                      s->cube_sin * hit->normal[1];
    const double ny = s->cube_cos * hit->normal[1] -
                      s->cube_sin * hit->normal[0];
    if (hit->normal[2] > 0.5) {
        paint(rgb, 0.66, 0.62, 0.56, 1.0);
        paint(rgb, 0.30, 0.12, 0.34, ramp(-0.02, 0.02, x * y * 20.0));
        return;
    }
    const int k = fabs(nx) > fabs(ny) ? (nx > 0.0 ? 0 : 1) : (ny > 0.0 ? 2 : 3);
    const double a = k < 2 ? y : x;
    const double r = sqrt(a * a + dz * dz);
    paint(rgb, face[k][0], face[k][1], face[k][2], 1.0);
    brighten(rgb, 1.0 + 0.4 * grain(6.0 * a, 6.0 * dz, 65));
    paint(rgb, 0.72, 0.70, 0.64, ramp(0.06, 0.075, r) - ramp(0.12, 0.135, r));
}

/* Paints stripes and noise that turn with the ball. */
static void ball_colour(const saga_room_state *s, const saga_room_hit *hit,
                        double rgb[3])
{
    const double dx = hit->normal[0], dz = hit->normal[2];
    const double x = s->roll_cos * dx - s->roll_sin * dz;
    const double z = s->roll_cos * dz + s->roll_sin * dx;
    const double y = hit->normal[1];
    paint(rgb, 0.70, 0.62, 0.50, 1.0);
    paint(rgb, 0.05, 0.20, 0.52, ramp(-0.06, 0.06, x * z * 3.0));
    paint(rgb, 0.60, 0.08, 0.06, 1.0 - ramp(0.20, 0.26, fabs(y)));
    brighten(rgb, 1.0 + 0.3 * grain(3.0 * x + 5.0, 3.0 * (y + z), 66));
}

static void albedo(const saga_room_state *s, const saga_room_hit *hit,
                   double rgb[3])
{
    const double *const n = hit->normal;
    switch (hit->object) {
    case SAGA_ROOM_WALLS:
        room_colour(hit, rgb);
        break;
    case SAGA_ROOM_BENCH:
        bench_colour(hit, rgb);
        break;
    case SAGA_ROOM_CUBE:
        cube_colour(s, hit, rgb);
        break;
    case SAGA_ROOM_BALL:
        ball_colour(s, hit, rgb);
        break;
    case SAGA_ROOM_GUEST:
        paint(rgb, 0.70, 0.30, 0.05, 1.0);
        paint(rgb, 0.75, 0.66, 0.20, ramp(-0.1, 0.1, n[2] - 0.2));
        brighten(rgb, 1.0 + 0.4 * grain(3.0 * n[0], 3.0 * n[2], 67));
        break;
    case SAGA_ROOM_MIRROR:
        paint(rgb, 0.05, 0.07, 0.10, 1.0);
        break;
    case SAGA_ROOM_BOB:
        paint(rgb, 0.10, 0.42, 0.30, 1.0);
        break;
    case SAGA_ROOM_LAMP:
        paint(rgb, 0.80, 0.74, 0.58, 1.0);
        break;
    case SAGA_ROOM_POLE:
        paint(rgb, 0.08, 0.08, 0.09, 1.0);
        break;
    default:
        paint(rgb, 0.55, 0.50, 0.42, 1.0);
        break;
    }
}

/* ------------------------------------------------------------------ motion */

/* Returns the guest's relative size. In each period of 2.5 s it is 0 until 0.4
 * s, grows to 1 until 0.5 s, shrinks from 1.6 s, and is 0 from 1.7 s. */
static double guest_size(double seconds)
{
    const double t = seconds - 2.5 * floor(seconds / 2.5);
    return ramp(0.4, 0.5, t) - ramp(1.6, 1.7, t);
}

void saga_room_at(saga_room_state *state, double seconds)
{
    static const double still[SAGA_ROOM_N_BALLS][4] = {
        { 0.0, -0.5, 0.20, 0.20 },   /* the ball; x is set below */
        { 0.64, 0.36, 0.78, 0.18 },  /* the guest; its radius is set below */
        { -0.56, 0.42, 0.80, 0.20 }, /* mirror */
        { 0.0, 0.0, 0.0, 0.10 },     /* the bob; set below */
        { 1.45, 1.25, 1.70, 0.17 },  /* lamp */
    };
    double s, c;
    state->seconds = seconds;
    for (int i = 0; i < SAGA_ROOM_N_BALLS; i++) {
        memcpy(state->ball[i], still[i], sizeof state->ball[i]);
        state->radius[i] = still[i][3];
    }
    saga_synth_sin_cos(seconds / 3.0, &s, &c);
    state->ball[0][0] = -0.95 * c;
    /* The ball rolls: one turn per circumference, which is 2 pi 0.2 m. */
    saga_synth_sin_cos(state->ball[0][0] / (6.283185307179586477 * 0.2),
                       &state->roll_sin, &state->roll_cos);
    state->radius[1] = 0.18 * guest_size(seconds);
    state->ball[1][2] = 0.6 + state->radius[1];
    /* The cube turns 0.17 times per second. The bob, below, swings by 0.055
     * turns to either side with a period of 2.1 seconds. */
    saga_synth_sin_cos(0.17 * seconds + 0.03, &state->cube_sin,
                       &state->cube_cos);
    double swing_sin, swing_cos;
    saga_synth_sin_cos(seconds / 2.1 + 0.1, &s, &c);
    saga_synth_sin_cos(0.055 * s, &swing_sin, &swing_cos);
    state->hook[0] = -1.15;
    state->hook[1] = 0.75;
    state->hook[2] = room_high[2];
    state->ball[3][0] = state->hook[0] + 1.15 * swing_sin;
    state->ball[3][1] = state->hook[1];
    state->ball[3][2] = state->hook[2] - 1.15 * swing_cos;
}

/* ----------------------------------------------------------------- tracing */

/* Finds where a ray enters a round rod without caps, which begins at p and has
 * the given axis and length. */
static bool enter_rod(const double p[3], const double axis[3], double length,
                      double radius, const double o[3], const double d[3],
                      double *t, double normal[3])
{
    const double v[3] = { o[0] - p[0], o[1] - p[1], o[2] - p[2] };
    const double da = dot3(d, axis), va = dot3(v, axis);
    const double a = dot3(d, d) - da * da;
    const double b = dot3(v, d) - va * da;
    const double c = dot3(v, v) - va * va - radius * radius;
    const double disc = b * b - a * c;
    /* The ray misses, moves away, or is parallel to the axis. */
    if (disc <= 0.0 || b >= 0.0 || a <= 0.0)
        return false;
    *t = (-b - sqrt(disc)) / a;
    const double along = va + *t * da;
    if (*t <= 1e-9 || along < 0.0 || along > length)
        return false;
    for (int i = 0; i < 3; i++)
        normal[i] = (v[i] + *t * d[i] - along * axis[i]) / radius;
    return true;
}

static void set_hit(saga_room_hit *hit, double t, enum saga_room_object object)
{
    hit->distance = t;
    hit->object = object;
}

static void hit_room(const ray *r, saga_room_hit *hit)
{
    double best = 1e30;
    int axis = 0;
    for (int i = 0; i < 3; i++) {
        const double wall = r->direction[i] > 0.0 ? room_high[i] : room_low[i];
        const double t = (wall - r->origin[i]) * r->inverse[i];
        if (t < best) {
            best = t;
            axis = i;
        }
    }
    set_hit(hit, best, SAGA_ROOM_WALLS);
    memset(hit->normal, 0, sizeof hit->normal);
    hit->normal[axis] = r->direction[axis] > 0.0 ? -1.0 : 1.0;
}

static void hit_bench(const ray *r, saga_room_hit *hit)
{
    double t;
    int axis;
    if (!enter_box(bench_low, bench_high, r->origin, r->inverse, &t, &axis) ||
        t >= hit->distance)
        return;
    set_hit(hit, t, SAGA_ROOM_BENCH);
    memset(hit->normal, 0, sizeof hit->normal);
    hit->normal[axis] = r->direction[axis] > 0.0 ? -1.0 : 1.0;
}

static void hit_cube(const saga_room_state *s, const ray *r, saga_room_hit *hit)
{
    const double half = CUBE_HALF_MM / 1000.0;
    const double low[3] = { -half, -half, -half },
                 high[3] = { half, half, half };
    double t;
    int axis;
    /* The ball around the cube is tested first, since it does not depend on the
     * turn. */
    if (!enter_ball(cube_centre, 1.7321 * half, r->origin, r->direction,
                    r->length2, &t) ||
        t >= hit->distance)
        return;
    const double v[3] = { r->origin[0] - cube_centre[0],
                          r->origin[1] - cube_centre[1],
                          r->origin[2] - cube_centre[2] };
    const double *const d = r->direction;
    const double o2[3] = { s->cube_cos * v[0] + s->cube_sin * v[1],
                           s->cube_cos * v[1] - s->cube_sin * v[0], v[2] };
    const double d2[3] = { s->cube_cos * d[0] + s->cube_sin * d[1],
                           s->cube_cos * d[1] - s->cube_sin * d[0], d[2] };
    const ray local = make_ray(o2, d2);
    if (!enter_box(low, high, o2, local.inverse, &t, &axis) ||
        t >= hit->distance)
        return;
    set_hit(hit, t, SAGA_ROOM_CUBE);
    double n[3] = { 0 };
    n[axis] = d2[axis] > 0.0 ? -1.0 : 1.0;
    /* The normal is turned back into the room's axes. */
    hit->normal[0] = s->cube_cos * n[0] - s->cube_sin * n[1];
    hit->normal[1] = s->cube_cos * n[1] + s->cube_sin * n[0];
    hit->normal[2] = n[2];
}

static void hit_balls(const saga_room_state *s, const ray *r,
                      saga_room_hit *hit)
{
    for (int i = 0; i < SAGA_ROOM_N_BALLS; i++) {
        double t;
        if (!enter_ball(s->ball[i], s->radius[i], r->origin, r->direction,
                        r->length2, &t) ||
            t >= hit->distance)
            continue;
        set_hit(hit, t, (enum saga_room_object)(SAGA_ROOM_BALL + i));
        for (int k = 0; k < 3; k++)
            hit->normal[k] = (r->origin[k] + t * r->direction[k] -
                              s->ball[i][k]) /
                             s->radius[i];
    }
}

static void hit_rods(const saga_room_state *s, const ray *r, saga_room_hit *hit)
{
    static const double up[3] = { 0.0, 0.0, 1.0 };
    const double foot[3] = { s->ball[4][0], s->ball[4][1], 0.0 };
    double axis[3], normal[3], t;
    if (enter_rod(foot, up, s->ball[4][2], 0.016, r->origin, r->direction, &t,
                  normal) &&
        t < hit->distance) {
        set_hit(hit, t, SAGA_ROOM_POLE);
        memcpy(hit->normal, normal, sizeof normal);
    }
    for (int i = 0; i < 3; i++)
        axis[i] = (s->ball[3][i] - s->hook[i]) * (1.0 / 1.15);
    if (enter_rod(s->hook, axis, 1.15, 0.011, r->origin, r->direction, &t,
                  normal) &&
        t < hit->distance) {
        set_hit(hit, t, SAGA_ROOM_ROD);
        memcpy(hit->normal, normal, sizeof normal);
    }
}

saga_room_hit saga_room_trace(const saga_room_state *state,
                              const double origin[3], const double direction[3])
{
    const ray r = make_ray(origin, direction);
    saga_room_hit hit;
    hit_room(&r, &hit);
    hit_bench(&r, &hit);
    hit_cube(state, &r, &hit);
    hit_balls(state, &r, &hit);
    hit_rods(state, &r, &hit);
    for (int i = 0; i < 3; i++)
        hit.position[i] = origin[i] + hit.distance * direction[i];
    return hit;
}

/* ----------------------------------------------------------------- shading */

static const double light[3] = { -1.3, -2.0, 2.45 };

/* Returns the light that a ball's soft shadow leaves; the cube's shadow is that
 * of a ball. The penumbra widens with the distance. */
static double shadow_of(const double centre[3], double radius,
                        const double p[3], const double to_light[3])
{
    const double v[3] = { centre[0] - p[0], centre[1] - p[1],
                          centre[2] - p[2] };
    const double along = dot3(v, to_light);
    const double width = 0.02 + 0.10 * along;
    const double d2 = dot3(v, v) - along * along;
    const double reach = radius + width;
    if (along <= 0.0 || radius <= 0.0 || d2 >= reach * reach)
        return 1.0;
    return ramp(radius - width, radius + width, sqrt(d2 > 0.0 ? d2 : 0.0));
}

static double lit(const saga_room_state *s, const saga_room_hit *hit,
                  const double to_light[3])
{
    double open = 1.0;
    /* The lamp, which is the last ball, casts no shadow. */
    for (int i = 0; i < SAGA_ROOM_N_BALLS - 1; i++)
        if ((int)hit->object != SAGA_ROOM_BALL + i)
            open *= shadow_of(s->ball[i], s->radius[i], hit->position,
                              to_light);
    if (hit->object != SAGA_ROOM_CUBE)
        open *= shadow_of(cube_centre, 0.25, hit->position, to_light);
    return open;
}

/* Darkens floor and walls near the bench. */
static double near_bench(const double p[3])
{
    double d2 = 0.0;
    for (int i = 0; i < 3; i++) {
        const double d = p[i] < bench_low[i]    ? bench_low[i] - p[i]
                         : p[i] > bench_high[i] ? p[i] - bench_high[i]
                                                : 0.0;
        d2 += d * d;
    }
    return 0.55 + 0.45 * ramp(-0.1, 0.45, sqrt(d2));
}

static void diffuse(const saga_room_state *s, const saga_room_hit *hit,
                    double rgb[3])
{
    double to_light[3] = { light[0] - hit->position[0],
                           light[1] - hit->position[1],
                           light[2] - hit->position[2] };
    const double distance2 = dot3(to_light, to_light);
    normalise(to_light);
    const double facing = dot3(hit->normal, to_light);
    /* Ambient light is slightly stronger from above. */
    double bright = 0.34 + 0.10 * hit->normal[2];
    if (hit->object == SAGA_ROOM_WALLS)
        bright *= near_bench(hit->position);
    if (facing > 0.0)
        bright += 1.9 / (1.0 + 0.11 * distance2) * facing *
                  lit(s, hit, to_light);
    if (hit->object == SAGA_ROOM_LAMP)
        bright = 0.9 + 0.2 * hit->normal[2];
    rgb[0] = rgb[1] = rgb[2] = 0.0;
    albedo(s, hit, rgb);
    brighten(rgb, bright);
}

/* Adds the reflections of the glossy ball: the room once, more at grazing
 * angles, and a soft highlight of the light. */
static void add_gloss(const saga_room_state *s, const saga_room_hit *hit,
                      const double direction[3], double rgb[3])
{
    double view[3] = { direction[0], direction[1], direction[2] };
    double origin[3], mirrored[3], seen[3];
    normalise(view);
    const double cosine = -dot3(view, hit->normal);
    for (int i = 0; i < 3; i++) {
        mirrored[i] = view[i] + 2.0 * cosine * hit->normal[i];
        /* The origin is moved off the surface, so that the mirrored ray does
         * not hit it. */
        origin[i] = hit->position[i] + 1e-6 * hit->normal[i];
    }
    const saga_room_hit other = saga_room_trace(s, origin, mirrored);
    diffuse(s, &other, seen);
    /* The reflection grows at grazing angles by a power, as in Schlick's
     * approximation. */
    const double g = 1.0 - clamp01(cosine);
    const double strength = 0.35 + 0.5 * g * g * g;
    double to_light[3] = { light[0] - hit->position[0],
                           light[1] - hit->position[1],
                           light[2] - hit->position[2] };
    normalise(to_light);
    double spot = clamp01(dot3(mirrored, to_light));
    /* spot becomes the 32nd power of the cosine of the angle to the mirrored
     * ray. */
    for (int i = 0; i < 5; i++)
        spot *= spot;
    for (int i = 0; i < 3; i++)
        rgb[i] += strength * seen[i] + 0.8 * spot;
}

void saga_room_radiance(const saga_room_state *state, const double origin[3],
                        const double direction[3], double rgb[3])
{
    const saga_room_hit hit = saga_room_trace(state, origin, direction);
    diffuse(state, &hit, rgb);
    if (hit.object == SAGA_ROOM_MIRROR)
        add_gloss(state, &hit, direction, rgb);
}
