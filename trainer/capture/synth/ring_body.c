/* SPDX-License-Identifier: MIT */
#include "ring_motion.h"

#include "synth_math.h"

#include <string.h>

/* ------------------------------------------------------------------ shapes */

/* Completes a frame of axes. The first axis is given, and the second is the
 * part of `side` at right angles to it. */
static void complete(double frame[3][3], const double side[3])
{
    const double along = dot3(frame[0], side);
    for (int i = 0; i < 3; i++)
        frame[1][i] = side[i] - along * frame[0][i];
    normalise(frame[1]);
    cross3(frame[2], frame[0], frame[1]);
}

saga_ring_shape saga_ring_capsule(const double a[3], const double b[3],
                                  double radius, const double side[3],
                                  enum saga_ring_object object)
{
    saga_ring_shape s = { .object = object, .radius = radius };
    for (int i = 0; i < 3; i++) {
        s.a[i] = a[i];
        s.frame[0][i] = b[i] - a[i];
        s.centre[i] = 0.5 * (a[i] + b[i]);
    }
    s.length = sqrt(dot3(s.frame[0], s.frame[0]));
    normalise(s.frame[0]);
    complete(s.frame, side);
    /* All of the shape lies in a ball of this radius, so a ray that misses the
     * ball misses the shape. */
    s.bound = 0.5 * s.length + radius;
    return s;
}

saga_ring_shape saga_ring_ball(const double centre[3], double radius,
                               double frame[3][3], enum saga_ring_object object)
{
    saga_ring_shape s = { .object = object, .radius = radius, .bound = radius };
    memcpy(s.a, centre, sizeof s.a);
    memcpy(s.centre, centre, sizeof s.centre);
    memcpy(s.frame, frame, sizeof s.frame);
    return s;
}

/* -------------------------------------------------------------------- pose */

/* The runner's axes are forward, left and up; they lean into the curve. */
typedef struct pose {
    const saga_ring_plan *plan;
    double t; /* seconds */
    double axes[3][3];
    double chest[3][3]; /* the axes, twisted against the hips */
    double pelvis[3];
    saga_ring_shape *to;
    int n;
} pose;

/* Sets out = from + f forward + l left + u up, where flu has f, l and u. */
static void reach(double out[3], const double from[3], double axes[3][3],
                  const double flu[3])
{
    for (int i = 0; i < 3; i++)
        out[i] = from[i] + flu[0] * axes[0][i] + flu[1] * axes[1][i] +
                 flu[2] * axes[2][i];
}

/* Finds the end of a limb, which hangs down at 0 turns, points forward at 1/4
 * and up at 1/2. `length_out` has its length and how far it points to the
 * left. */
static void limb(double end[3], const double from[3], double axes[3][3],
                 double turns, const double length_out[2])
{
    double s, c;
    saga_synth_sin_cos(turns, &s, &c);
    const double l = length_out[0], o = length_out[1];
    /* The length that remains in the plane of forward and up. */
    const double in = l * sqrt(1.0 - o * o);
    const double flu[3] = { in * s, l * o, -in * c };
    reach(end, from, axes, flu);
}

/* Adds a capsule of the body. Limbs swing across the left axis; trunk and hips
 * lie along it. */
static void add(pose *p, const double a[3], const double b[3], double radius,
                enum saga_ring_object object)
{
    const double v[3] = { b[0] - a[0], b[1] - a[1], b[2] - a[2] };
    const double left = dot3(v, p->axes[1]);
    /* The second axis of the capsule must not be parallel to the first. */
    const int side = left * left > 0.8 * dot3(v, v) ? 0 : 1;
    p->to[p->n++] = saga_ring_capsule(a, b, radius * p->plan->girth,
                                      p->axes[side], object);
}

static void add_ball(pose *p, const double centre[3], double radius,
                     enum saga_ring_object object)
{
    p->to[p->n++] = saga_ring_ball(centre, radius * p->plan->size, p->chest,
                                   object);
}

/* ------------------------------------------------------------------- steps */

/* The joints of a leg, from the hip. */
typedef struct leg {
    double hip[3], knee[3], ankle[3], toe[3];
} leg;

static void bend_leg(leg *l, pose *p, const double pelvis[3], int side)
{
    const double k = p->plan->size;
    const double phase = p->plan->stride * p->t + 0.5 * side;
    const double sign = side ? -1.0 : 1.0;
    double swing, unused, lift;
    /* The legs are half a stride apart. A foot is lifted while its thigh moves
     * forward. */
    saga_synth_sin_cos(phase, &swing, &unused);
    saga_synth_sin_cos(phase + 0.06, &unused, &lift);
    lift = lift > 0.0 ? lift * lift : 0.0;
    const double thigh = 0.03 + 0.11 * swing;
    /* Angles are in turns: a lifted foot bends the knee by up to a quarter
     * turn. */
    const double shin = thigh - 0.03 - 0.25 * lift;
    const double at[3] = { 0.0, 0.10 * k * sign, 0.0 };
    reach(l->hip, pelvis, p->axes, at);
    limb(l->knee, l->hip, p->axes, thigh,
         (const double[2]){ 0.44 * k, 0.03 * sign });
    limb(l->ankle, l->knee, p->axes, shin, (const double[2]){ 0.43 * k, 0.0 });
    limb(l->toe, l->ankle, p->axes, shin + 0.21 - 0.08 * lift,
         (const double[2]){ 0.16 * k, 0.06 * sign });
}

static void add_leg(pose *p, const leg *l)
{
    add(p, l->hip, l->knee, 0.080, SAGA_RING_TROUSERS);
    add(p, l->knee, l->ankle, 0.056, SAGA_RING_TROUSERS);
    add(p, l->ankle, l->toe, 0.046, SAGA_RING_SHOE);
}

/* Sets the pelvis's height so that the lower foot stands on the floor. */
static void stand(pose *p, leg legs[2])
{
    double low = 0.0;
    /* The first pass has the pelvis on the floor, to find how low the feet
     * reach. */
    p->pelvis[2] = 0.0;
    for (int side = 0; side < 2; side++) {
        bend_leg(&legs[side], p, p->pelvis, side);
        low = legs[side].ankle[2] < low ? legs[side].ankle[2] : low;
        low = legs[side].toe[2] < low ? legs[side].toe[2] : low;
    }
    /* The pelvis is raised by this, and by the radius of a foot. */
    p->pelvis[2] = 0.046 * p->plan->girth - low;
    for (int side = 0; side < 2; side++)
        bend_leg(&legs[side], p, p->pelvis, side);
}

static void place(pose *p)
{
    const saga_ring_plan *const plan = p->plan;
    const double way = plan->path_turn > 0.0 ? 1.0 : -1.0;
    double s, c;
    saga_synth_sin_cos(plan->path_start + plan->path_turn * p->t, &s, &c);
    const double side[3] = { -way * c, -way * s, 0.0 }; /* left: inwards */
    /* The runner leans forward and inwards into the curve. */
    const double lean[3] = { -0.10 * c - 0.16 * way * s,
                             -0.10 * s + 0.16 * way * c, 1.0 };
    p->pelvis[0] = plan->path_radius * c;
    p->pelvis[1] = plan->path_radius * s;
    memcpy(p->axes[2], lean, sizeof lean);
    normalise(p->axes[2]);
    const double along = dot3(p->axes[2], side);
    for (int i = 0; i < 3; i++)
        p->axes[1][i] = side[i] - along * p->axes[2][i];
    normalise(p->axes[1]);
    cross3(p->axes[0], p->axes[1], p->axes[2]);
}

/* --------------------------------------------------------------- upper body */

static void twist(pose *p, double turns)
{
    double s, c;
    saga_synth_sin_cos(turns, &s, &c);
    for (int i = 0; i < 3; i++) {
        p->chest[0][i] = c * p->axes[0][i] + s * p->axes[1][i];
        p->chest[1][i] = c * p->axes[1][i] - s * p->axes[0][i];
        p->chest[2][i] = p->axes[2][i];
    }
}

/* Angles of upper arm and forearm in turns, and how far the arm points
 * sideways. */
typedef struct arm {
    double upper, fore, out;
} arm;

/* Returns the pose of the throwing arm. It moves up and back until 0.10 s
 * before the release, then to the front within 0.2 s. */
static arm throwing(const saga_ring_plan *plan, double t, arm swinging)
{
    const double s = t - SAGA_RING_ROUND * floor(t / SAGA_RING_ROUND) -
                     plan->release;
    /* The seconds since the release in this round drive three phases: up,
     * through, and back to swinging. */
    const double up = ramp(-0.32, -0.12, s), through = ramp(-0.10, 0.12, s);
    const double over = ramp(0.25, 0.55, s);
    arm a = swinging;
    a.upper = mix(mix(a.upper, 0.57, up), 0.10, through);
    a.fore = mix(mix(a.fore, 0.80, up), 0.16, ramp(-0.08, 0.08, s));
    a.out = mix(mix(a.out, -0.35, up), -0.10, through);
    a.upper = mix(a.upper, swinging.upper, over);
    a.fore = mix(a.fore, swinging.fore, over);
    a.out = mix(a.out, swinging.out, over);
    return a;
}

static void add_arm(pose *p, const double shoulder[3], const arm *a,
                    double hand[3])
{
    const double k = p->plan->size;
    double elbow[3], wrist[3];
    limb(elbow, shoulder, p->chest, a->upper,
         (const double[2]){ 0.29 * k, a->out });
    limb(wrist, elbow, p->chest, a->fore,
         (const double[2]){ 0.26 * k, 0.5 * a->out });
    limb(hand, elbow, p->chest, a->fore,
         (const double[2]){ 0.32 * k, 0.5 * a->out });
    add(p, shoulder, elbow, 0.050, SAGA_RING_SHIRT);
    add(p, elbow, wrist, 0.040, SAGA_RING_SKIN);
    add_ball(p, hand, 0.055, SAGA_RING_SKIN);
}

static void add_baton(pose *p, const double hand[3], double turns)
{
    double ends[2][3];
    for (int i = 0; i < 2; i++)
        limb(ends[i], hand, p->chest, turns + 0.5 * i,
             (const double[2]){ i ? 0.10 : 0.50, 0.25 });
    p->to[p->n++] = saga_ring_capsule(ends[1], ends[0], 0.012, p->axes[1],
                                      SAGA_RING_BATON);
}

static void add_arms(pose *p, const double neck[3], double hand[3])
{
    const double k = p->plan->size;
    double swing, unused, left_hand[3], shoulder[2][3];
    /* Arms swing opposite to the legs and to each other. */
    saga_synth_sin_cos(p->plan->stride * p->t, &swing, &unused);
    for (int side = 0; side < 2; side++)
        reach(shoulder[side], neck, p->chest,
              (const double[3]){ 0.0, (side ? -0.20 : 0.20) * k, -0.07 * k });
    const arm left = { -0.02 - 0.10 * swing, 0.16 - 0.13 * swing, 0.16 };
    const arm loose = { -0.02 + 0.10 * swing, 0.16 + 0.13 * swing, -0.16 };
    const arm right = throwing(p->plan, p->t, loose);
    add_arm(p, shoulder[0], &left, left_hand);
    add_arm(p, shoulder[1], &right, hand);
    add_baton(p, left_hand, left.fore + 0.20);
}

static void add_trunk(pose *p, double neck[3])
{
    const double k = p->plan->size;
    double at[4][3], head[3];
    reach(neck, p->pelvis, p->axes, (const double[3]){ 0.02, 0.0, 0.52 * k });
    for (int i = 0; i < 2; i++) {
        const double l = i ? -1.0 : 1.0;
        reach(at[i], p->pelvis, p->axes,
              (const double[3]){ 0.0, 0.075 * l * k, 0.03 });
        reach(at[2 + i], neck, p->chest,
              (const double[3]){ 0.0, 0.085 * l * k, -0.16 * k });
    }
    /* Hips, chest, waist, neck and head; each joint is relative to pelvis or
     * neck. */
    add(p, at[0], at[1], 0.100, SAGA_RING_TROUSERS);
    add(p, at[2], at[3], 0.120, SAGA_RING_SHIRT);
    reach(at[0], p->pelvis, p->axes, (const double[3]){ 0.0, 0.0, 0.08 });
    reach(at[1], neck, p->chest, (const double[3]){ 0.0, 0.0, -0.20 * k });
    add(p, at[0], at[1], 0.125, SAGA_RING_SHIRT);
    reach(head, neck, p->chest, (const double[3]){ 0.04, 0.0, 0.19 * k });
    add(p, neck, head, 0.050, SAGA_RING_SKIN);
    add_ball(p, head, 0.120, SAGA_RING_HEAD);
}

int saga_ring_body(saga_ring_shape *to, double hand[3],
                   const saga_ring_plan *plan, double seconds)
{
    pose p = { .plan = plan, .t = seconds, .to = to };
    double swing, unused, neck[3];
    leg legs[2];
    /* The body is built from the path upwards: each part begins where the
     * previous one ends. */
    place(&p);
    stand(&p, legs);
    saga_synth_sin_cos(plan->stride * seconds, &swing, &unused);
    twist(&p, 0.035 * swing);
    add_leg(&p, &legs[0]);
    add_leg(&p, &legs[1]);
    add_trunk(&p, neck);
    add_arms(&p, neck, hand);
    return p.n;
}
