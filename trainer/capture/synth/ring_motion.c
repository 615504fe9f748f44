/* SPDX-License-Identifier: MIT */
#include "ring_motion.h"

#include "synth_math.h"

#include <string.h>

/* -------------------------------------------------------------------- plan */

double saga_ring_draw(uint32_t seed, int index, double lo, double hi)
{
    return mix(lo, hi, lattice(index, 0, seed * 0x9e3779b1u + 77u));
}

/* Computes a colour from its hue (0..6 from red through green and blue),
 * saturation and brightness. */
static void tint(double rgb[3], double hue, double saturation, double bright)
{
    for (int i = 0; i < 3; i++) {
        double x = hue + (i == 0 ? 0.0 : i == 1 ? 4.0 : 2.0);
        /* A channel is full within 1/6 turn of its hue, and falls to 0 over the
         * next 1/6: the hexagon of HSV. */
        x -= 6.0 * floor(x / 6.0);
        rgb[i] = bright * mix(1.0, clamp01(fabs(x - 3.0) - 1.0), saturation);
    }
}

static void draw_colours(saga_ring_plan *p, uint32_t seed)
{
    for (int i = 0; i < SAGA_RING_N_COLOURS; i++)
        tint(p->colour[i], saga_ring_draw(seed, 200 + i, 0.0, 6.0),
             saga_ring_draw(seed, 300 + i, 0.35, 0.85),
             saga_ring_draw(seed, 400 + i, 0.25, 0.62));
}

static void on_circle(double at[2], double turns, double radius)
{
    double s, c;
    saga_synth_sin_cos(turns, &s, &c);
    at[0] = radius * c;
    at[1] = radius * s;
}

static void draw_poles(saga_ring_plan *p, uint32_t seed)
{
    const double start = saga_ring_draw(seed, 20, 0.0, 1.0);
    for (int i = 0; i < SAGA_RING_N_POLES; i++) {
        double *const pole = p->pole[i];
        on_circle(pole,
                  start + (i + saga_ring_draw(seed, 30 + i, 0.0, 0.5)) /
                              SAGA_RING_N_POLES,
                  saga_ring_draw(seed, 40 + i, 1.25, 2.15));
        pole[2] = 0.0;
        pole[3] = pole[0] + saga_ring_draw(seed, 50 + i, -0.15, 0.15);
        pole[4] = pole[1] + saga_ring_draw(seed, 60 + i, -0.15, 0.15);
        pole[5] = saga_ring_draw(seed, 70 + i, 1.2, 2.2);
    }
}

void saga_ring_draw_plan(saga_ring_plan *p, uint32_t seed)
{
    const double way = saga_ring_draw(seed, 0, -1.0, 1.0) < 0.0 ? -1.0 : 1.0;
    const double corner = saga_ring_draw(seed, 13, 0.0, 1.0);
    *p = (saga_ring_plan){ .salt = seed * 0x85ebca77u + 5u,
                           .size = saga_ring_draw(seed, 1, 0.93, 1.05),
                           .girth = saga_ring_draw(seed, 2, 0.90, 1.15),
                           .path_radius = saga_ring_draw(seed, 3, 0.55, 0.80),
                           .path_start = saga_ring_draw(seed, 4, 0.0, 1.0),
                           .path_turn = way *
                                        saga_ring_draw(seed, 5, 0.30, 0.48),
                           .stride = saga_ring_draw(seed, 6, 1.3, 1.8),
                           .release = saga_ring_draw(seed, 7, 0.34, 0.46),
                           .aim = saga_ring_draw(seed, 8, -0.08, 0.08),
                           .reach = saga_ring_draw(seed, 9, 1.3, 2.0),
                           .flight = saga_ring_draw(seed, 10, 0.42, 0.60),
                           .comes = saga_ring_draw(seed, 11, 0.30, 0.50),
                           .goes = saga_ring_draw(seed, 12, 0.55, 0.75) };
    /* Things stand in four sectors of a quarter turn each. */
    for (int i = 0; i < 4; i++)
        p->place[i] = corner + 0.25 * i +
                      saga_ring_draw(seed, 14 + i, 0.0, 0.15);
    /* The light is 2.8 m from the middle and 3.1 m high. */
    on_circle(p->light, saga_ring_draw(seed, 18, 0.0, 1.0), 2.8);
    p->light[2] = 3.1;
    draw_colours(p, seed);
    draw_poles(p, seed);
}

/* -------------------------------------------------------------------- ball */

static void fold(double *x, double *way, double limit)
{
    /* Reflections between -limit and limit turn a straight path into a triangle
     * wave with period 4 limit. */
    const double turns = (*x + limit) / (4.0 * limit);
    const double y = 4.0 * limit * (turns - floor(turns));
    *way = y < 2.0 * limit ? 1.0 : -1.0;
    *x = y < 2.0 * limit ? y - limit : 3.0 * limit - y;
}

void saga_ring_fly(double at[3], const double from[3], const double speed[3],
                   double seconds)
{
    static const double g = 9.81, again = 0.72, along = 0.85;
    const double floor_z = SAGA_RING_BALL_RADIUS;
    double z = from[2], up = speed[2], left = seconds, keep = 1.0, way;
    at[0] = from[0];
    at[1] = from[1];
    for (int bounce = 0; bounce < 12; bounce++) {
        /* The time at which z + up t - g t^2 / 2 reaches the floor, which is
         * the later root. */
        const double lands = (up + sqrt(up * up + 2.0 * g * (z - floor_z))) / g;
        const double t = left < lands ? left : lands;
        at[0] += keep * speed[0] * t;
        at[1] += keep * speed[1] * t;
        at[2] = z + up * t - 0.5 * g * t * t;
        left -= t;
        if (!(left > 0.0))
            break;
        /* The ball lands at the speed g lands - up, and keeps a part of it
         * upwards. */
        up = again * (g * lands - up);
        z = at[2] = floor_z;
        keep *= along;
    }
    fold(&at[0], &way, SAGA_RING_HALL - SAGA_RING_BALL_RADIUS);
    fold(&at[1], &way, SAGA_RING_HALL - SAGA_RING_BALL_RADIUS);
}

/* Computes the speed with which the ball must leave the hand to land where it
 * is aimed. */
static void throw_speed(double speed[3], const double hand[3],
                        const saga_ring_plan *p, double seconds)
{
    const double way = p->path_turn > 0.0 ? 0.25 : -0.25;
    double aim[2];
    on_circle(aim, p->path_start + p->path_turn * seconds + way + p->aim,
              p->reach);
    speed[0] = aim[0] / p->flight;
    speed[1] = aim[1] / p->flight;
    speed[2] = (SAGA_RING_BALL_RADIUS - hand[2]) / p->flight +
               0.5 * 9.81 * p->flight;
}

/* Sets axes that turn about a slanted axis. */
static void spin(double frame[3][3], double turns)
{
    static const double axis[3][3] = { { 0.6, 0.0, 0.8 },
                                       { 0.0, 1.0, 0.0 },
                                       { -0.8, 0.0, 0.6 } };
    double s, c;
    saga_synth_sin_cos(turns, &s, &c);
    for (int i = 0; i < 3; i++) {
        frame[0][i] = axis[0][i];
        frame[1][i] = c * axis[1][i] + s * axis[2][i];
        frame[2][i] = c * axis[2][i] - s * axis[1][i];
    }
}

static void add_thrown(saga_ring_state *s, const double hand[3])
{
    const saga_ring_plan *const p = &s->plan;
    const double round = SAGA_RING_ROUND * floor(s->seconds / SAGA_RING_ROUND);
    const double since = s->seconds - round - p->release;
    saga_ring_shape unused[SAGA_RING_BODY_SHAPES];
    double from[3], speed[3], at[3], frame[3][3];
    memcpy(at, hand, sizeof at);
    /* The position of the hand at the release follows from the body's pose at
     * that time, which is computed once more. */
    if (since > 0.0) {
        saga_ring_body(unused, from, p, round + p->release);
        throw_speed(speed, from, p, round + p->release);
        saga_ring_fly(at, from, speed, since);
    }
    spin(frame, since > 0.0 ? 2.2 * since : 0.0);
    s->shape[s->n_shapes++] = saga_ring_ball(at, SAGA_RING_BALL_RADIUS, frame,
                                             SAGA_RING_BALL);
}

/* ------------------------------------------------------------------- things */

/* Makes a box that is turned about z. */
static saga_ring_shape box(const double centre[3], const double half[3],
                           double turns, enum saga_ring_object object)
{
    saga_ring_shape b = { .object = object, .is_box = true };
    double s, c;
    saga_synth_sin_cos(turns, &s, &c);
    memcpy(b.a, centre, sizeof b.a);
    memcpy(b.centre, centre, sizeof b.centre);
    memcpy(b.half, half, sizeof b.half);
    b.frame[0][0] = b.frame[1][1] = c;
    b.frame[0][1] = s;
    b.frame[1][0] = -s;
    b.frame[2][2] = 1.0;
    b.bound = sqrt(dot3(half, half));
    return b;
}

static void add_box(saga_ring_state *s, const double at_turns_z[3],
                    const double half[3], double turns,
                    enum saga_ring_object object)
{
    double centre[3] = { 0.0, 0.0, at_turns_z[2] };
    on_circle(centre, at_turns_z[1], at_turns_z[0]);
    s->shape[s->n_shapes++] = box(centre, half, turns, object);
}

static void add_guests(saga_ring_state *s)
{
    const saga_ring_plan *const p = &s->plan;
    static const double stand[3] = { 0.16, 0.16, 0.30 };
    static const double cube[3] = { 0.17, 0.17, 0.17 };
    const double t = s->seconds -
                     SAGA_RING_ROUND * floor(s->seconds / SAGA_RING_ROUND);
    double at[3] = { 0.0, 0.0, 0.60 + 0.19 }, frame[3][3];
    for (int i = 0; i < 2; i++)
        add_box(s, (const double[3]){ 1.5, p->place[i], 0.30 }, stand,
                p->place[i], SAGA_RING_CRATE);
    if (t >= p->comes)
        add_box(s, (const double[3]){ 1.5, p->place[0], 0.60 + 0.17 }, cube,
                p->place[0] + 0.5 * s->seconds, SAGA_RING_COMER);
    if (t >= p->goes)
        return;
    on_circle(at, p->place[1], 1.5);
    spin(frame, 0.3);
    s->shape[s->n_shapes++] = saga_ring_ball(at, 0.19, frame, SAGA_RING_GOER);
}

static void add_still(saga_ring_state *s)
{
    const saga_ring_plan *const p = &s->plan;
    static const double crate[3] = { 0.28, 0.20, 0.24 };
    static const double display[3] = { 0.03, 0.95, 0.56 };
    static const double across[3] = { 0.6, 0.8, 0.0 };
    add_box(s, (const double[3]){ 1.65, p->place[2], 0.24 }, crate,
            p->place[2] + 0.1, SAGA_RING_CRATE);
    for (int i = 0; i < 2; i++)
        add_box(s, (const double[3]){ 3.85, p->place[3] + 0.5 * i, 1.45 },
                display, p->place[3] + 0.5 * i, SAGA_RING_DISPLAY);
    for (int i = 0; i < SAGA_RING_N_POLES; i++)
        s->shape[s->n_shapes++] = saga_ring_capsule(p->pole[i], p->pole[i] + 3,
                                                    0.008 + 0.0015 * i, across,
                                                    SAGA_RING_POLE);
    s->shape[s->n_shapes++] = saga_ring_capsule(
        p->pole[0] + 3, p->pole[1] + 3, 0.006,
        (const double[3]){ 0.0, 0.0, 1.0 }, SAGA_RING_POLE);
}

static void bound_body(saga_ring_state *s)
{
    memset(s->body_centre, 0, sizeof s->body_centre);
    s->body_bound = 0.0;
    for (int i = 0; i < s->n_body; i++)
        for (int k = 0; k < 3; k++)
            s->body_centre[k] += s->shape[i].centre[k] / s->n_body;
    for (int i = 0; i < s->n_body; i++) {
        double v[3];
        for (int k = 0; k < 3; k++)
            v[k] = s->shape[i].centre[k] - s->body_centre[k];
        /* The ball around the whole body; a ray that misses it skips the
         * body. */
        const double r = sqrt(dot3(v, v)) + s->shape[i].bound;
        s->body_bound = r > s->body_bound ? r : s->body_bound;
    }
}

void saga_ring_at(saga_ring_state *s, uint32_t seed, double seconds)
{
    double hand[3];
    memset(s, 0, sizeof *s);
    s->seconds = seconds;
    saga_ring_draw_plan(&s->plan, seed);
    s->n_body = s->n_shapes = saga_ring_body(s->shape, hand, &s->plan, seconds);
    bound_body(s);
    add_thrown(s, hand);
    add_guests(s);
    add_still(s);
}
