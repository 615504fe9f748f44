/* SPDX-License-Identifier: MIT
 *
 * The built-in scenes. The room must keep its bytes; the objects of the ring
 * must be where a computation by hand puts them.
 */
#include "capture_files.h"
#include "pose.h"
#include "ring_motion.h"
#include "synth_capture.h"
#include "synth_math.h"
#include "synth_world.h"
#include "testing.h"

#include <zlib.h>

static const double gravity = 9.81;

static void near(double value, double wanted)
{
    assert_near(value, wanted, 1e-9);
}

static double distance(const double a[3], const double b[3])
{
    const double v[3] = { a[0] - b[0], a[1] - b[1], a[2] - b[2] };

    return sqrt(dot3(v, v));
}

/* Returns the first shape of a kind, or NULL. */
static const saga_ring_shape *find(const saga_ring_state *s,
                                   enum saga_ring_object object)
{
    for (int i = 0; i < s->n_shapes; i++)
        if (s->shape[i].object == object)
            return &s->shape[i];
    return NULL;
}

/* --- Captures ------------------------------------------------------------ */

/* Makes a capture with one view held out. */
static saga_capture make_capture(folder *f, saga_synth_scene scene,
                                 int n_cameras)
{
    saga_synth_options o = synth_options(48, 32, n_cameras, 2, 200);

    o.scene = scene;
    return synth_capture(folder_file(f, "scene"), &o);
}

/* Captures of the room are compared across versions, so that its pictures must
 * not change. The number is the checksum of the first version's pictures. */
TEST_IN_FOLDER(room_should_keep_its_bytes)
{
    saga_capture c = make_capture(f, SAGA_SYNTH_ROOM, 3);
    uLong crc = crc32(0, NULL, 0);

    for (int i = 0; i < c.n_views; i++)
        for (int k = 0; k < c.n_frames; k++)
            crc = crc32(crc, saga_capture_frame(&c, i, k), 3 * 48 * 32);
    for (size_t i = 0; i < c.n_points; i++)
        crc = crc32(crc, c.points[i].rgb, 3);
    saga_capture_free(&c);
    if (crc != 0xb7ca2338u)
        fail_msg("CRC %08lx", (unsigned long)crc);
}

/* Of four cameras, number 1 * 4 / 2 must be held out, which is between others.
 * Neighbours must be a quarter of a turn apart, within 2 * 0.1 / 4 of a
 * turn. */
TEST_IN_FOLDER(ring_should_be_all_round_with_a_view_held_out)
{
    const double target[3] = { 0.0, 0.0, 0.92 };
    saga_capture c = make_capture(f, SAGA_SYNTH_RING, 4);
    double at[4][3], uv[2] = { 0 }, z;

    assert_int_equal(c.n_views, 4);
    assert_in_range(c.n_points, 20, 200);
    for (int i = 0; i < 4; i++) {
        const saga_source_view *const v = &c.views[i];

        assert_int_equal(v->held_out, i == 2);
        assert_true(saga_view_project(v, target, uv, &z));
        assert_true(fabs(uv[0] - 24) < 1e-6 && fabs(uv[1] - 16) < 1e-6);
        saga_pose_centre(v->rotation, v->translation, at[i]);
        assert_true(fabs(at[i][2] - (i % 2 ? 1.95 : 1.05)) <= 0.08);
    }
    saga_capture_free(&c);
    for (int i = 0; i < 4; i++) {
        const double *const a = at[i], *const b = at[(i + 1) % 4];
        const double cosine = (a[0] * b[0] + a[1] * b[1]) /
                              (hypot(a[0], a[1]) * hypot(b[0], b[1]));

        assert_true(fabs(acos(cosine) / 6.283185307 - 0.25) <= 0.05 + 1e-6);
        assert_true(a[0] * b[1] - a[1] * b[0] > 0.0); /* the angles increase */
    }
}

TEST(ring_should_hold_out_two_of_fourteen)
{
    const saga_synth_options o = saga_synth_defaults(SAGA_SYNTH_RING);

    assert_int_equal(o.n_cameras, 14);
    for (int i = 0; i < 14; i++) {
        saga_source_view v;

        saga_synth_view(&o, i, &v);
        assert_int_equal(v.held_out, i == 4 || i == 9); /* a low and a high
                                                         * camera */
    }
}

/* --- Ball and body ------------------------------------------------------- */

/* A ball that is thrown upwards at 1 m/s from a height of 2 m must be at 2 +
 * 0.3 - g 0.09 / 2 after 0.3 s. */
TEST(ball_should_fly_freely)
{
    const double from[3] = { 0.1, 0.2, 2.0 }, speed[3] = { 3.0, -1.0, 1.0 };
    double at[3];

    saga_ring_fly(at, from, speed, 0.3);
    near(at[0], 1.0);
    near(at[1], -0.1);
    near(at[2], 2.3 - gravity * 0.045);
}

/* A ball that leaves the floor upwards at v must land after 2 v / g, leave
 * again at 0.72 v and with 0.85 of its horizontal speed, and be highest 0.72 v
 * / g later. */
TEST(ball_should_bounce)
{
    const double r = SAGA_RING_BALL_RADIUS, v = 2.0;
    const double from[3] = { 0.0, 0.0, r }, speed[3] = { 1.0, 0.0, v };
    double at[3];

    saga_ring_fly(at, from, speed, 2.0 * v / gravity);
    near(at[2], r);
    saga_ring_fly(at, from, speed, 2.72 * v / gravity);
    near(at[2], r + 0.72 * v * 0.72 * v / (2.0 * gravity));
    near(at[0], 2.0 * v / gravity + 0.85 * 0.72 * v / gravity);
}

/* The ball flies at 5 m/s and touches the wall after 0.1 s. After 0.2 s it
 * would be half a metre behind this place, and must be thrown back instead. */
TEST(ball_should_come_back_from_a_wall)
{
    const double touch = SAGA_RING_HALL - SAGA_RING_BALL_RADIUS;
    const double from[3] = { touch - 0.5, 0.0, 2.0 };
    const double speed[3] = { 5.0, 0.0, 0.0 };
    double at[3];

    saga_ring_fly(at, from, speed, 0.2);
    near(at[0], touch - 0.5);
}

TEST(ball_should_leave_the_hand_and_land_where_aimed)
{
    for (uint32_t seed = 1; seed <= 20; seed++) {
        saga_ring_shape body[SAGA_RING_BODY_SHAPES];
        saga_ring_plan plan;
        saga_ring_state s;
        double hand[3];

        saga_ring_draw_plan(&plan, seed);
        saga_ring_at(&s, seed, plan.release - 0.1);
        saga_ring_body(body, hand, &plan, plan.release - 0.1);
        assert_true(distance(find(&s, SAGA_RING_BALL)->a, hand) < 1e-12);
        saga_ring_body(body, hand, &plan, plan.release);
        saga_ring_at(&s, seed, plan.release + 1e-7);
        assert_true(distance(find(&s, SAGA_RING_BALL)->a, hand) < 1e-5);
        saga_ring_at(&s, seed, plan.release + plan.flight);
        {
            const double *const at = find(&s, SAGA_RING_BALL)->a;

            assert_true(fabs(at[2] - SAGA_RING_BALL_RADIUS) < 1e-9);
            assert_true(fabs(hypot(at[0] - hand[0], at[1] - hand[1]) -
                             plan.reach) < 1e-9);
        }
    }
}

/* A foot is a capsule, whose lowest point is its lower end minus its radius. */
TEST(body_should_stand_on_the_floor_and_keep_its_bones)
{
    for (int i = 0; i < 200; i++) {
        const uint32_t seed = (uint32_t)i % 10;
        saga_ring_state s;
        double low = 1e9, longest = 0.0;

        saga_ring_at(&s, seed, 0.037 * i - 2.0);
        assert_true(s.n_body <= SAGA_RING_BODY_SHAPES);
        for (int k = 0; k < s.n_body; k++) {
            const saga_ring_shape *const it = &s.shape[k];
            const double rise = it->length * it->frame[0][2];

            assert_true(distance(it->centre, s.body_centre) + it->bound <=
                        s.body_bound + 1e-12);
            if (it->object == SAGA_RING_SHOE)
                low = fmin(low, it->a[2] + fmin(rise, 0.0) - it->radius);
            if (it->object == SAGA_RING_TROUSERS)
                longest = fmax(longest, it->length);
        }
        near(low, 0.0);
        near(longest, 0.44 * s.plan.size);
    }
}

/* --- Rays ---------------------------------------------------------------- */

/* Makes a hall with one capsule from (1, 0, 1) to (1, 2, 1), whose radius is
 * 0.25. */
static void one_capsule(saga_ring_state *s)
{
    const double a[3] = { 1, 0, 1 }, b[3] = { 1, 2, 1 }, up[3] = { 0, 0, 1 };

    memset(s, 0, sizeof *s);
    s->shape[0] = saga_ring_capsule(a, b, 0.25, up, SAGA_RING_POLE);
    s->n_shapes = 1;
}

TEST(capsule_should_be_met_where_it_is)
{
    static const double from[5][3] = { { 0, 1, 1 },
                                       { 0, -0.15, 1 },
                                       { 1, -2, 1 },
                                       { 0, -0.26, 1 },
                                       { 0, 1, 1.26 } };
    static const double to[5][3] = {
        { 2, 0, 0 }, { 1, 0, 0 }, { 0, 1, 0 }, { 1, 0, 0 }, { 1, 0, 0 }
    };
    /* The five rays hit the side (distances are in lengths of the direction,
     * which is 2), the ball at an end 0.15 beside its centre, where its half
     * chord is sqrt(.0625 - .0225) = 0.2, the same ball from ahead, and twice
     * the wall: past the end and past the side. */
    static const double far[5] = { 0.375, 0.8, 1.75, SAGA_RING_HALL,
                                   SAGA_RING_HALL };
    static const double normal[3][3] = { { -1, 0, 0 },
                                         { -0.8, -0.6, 0 },
                                         { 0, -1, 0 } };
    saga_ring_state s;

    one_capsule(&s);
    for (int i = 0; i < 5; i++) {
        const saga_ring_hit hit = saga_ring_trace(&s, from[i], to[i]);

        near(hit.distance, far[i]);
        assert_int_equal(hit.object, i < 3 ? SAGA_RING_POLE : SAGA_RING_WALL);
        for (int k = 0; k < 3 && i < 3; k++)
            near(hit.normal[k], normal[i][k]);
    }
}

/* Seen from 0.5 m off its surface, the ball that disappears must be visible
 * until its time, and the cube that appears from its time on. */
TEST(things_should_come_and_go_at_once)
{
    for (uint32_t seed = 1; seed <= 20; seed++) {
        saga_ring_plan p;
        saga_ring_state s;

        saga_ring_draw_plan(&p, seed);
        saga_ring_at(&s, seed, p.comes - 1e-6);
        assert_null(find(&s, SAGA_RING_COMER));
        saga_ring_at(&s, seed, p.comes + 1e-6);
        assert_non_null(find(&s, SAGA_RING_COMER));
        saga_ring_at(&s, seed, p.goes + 1e-6);
        assert_null(find(&s, SAGA_RING_GOER));
        saga_ring_at(&s, seed, p.goes - 1e-6);
        {
            const saga_ring_shape *const it = find(&s, SAGA_RING_GOER);
            const double from[3] = { it->a[0], it->a[1], it->a[2] + 0.69 };
            const double down[3] = { 0, 0, -1 };
            const saga_ring_hit hit = saga_ring_trace(&s, from, down);

            assert_int_equal(hit.object, SAGA_RING_GOER);
            near(hit.distance, 0.5);
        }
    }
}

/* Looks at 25 places of a display from 1 m before it. Sets sum to the sum of
 * their light in each channel, and returns the sum over channels. */
static double shown(double seconds, double sum[3])
{
    saga_ring_state s;
    const saga_ring_shape *b;
    double all = 0.0;

    saga_ring_at(&s, 1, seconds);
    b = find(&s, SAGA_RING_DISPLAY);
    memset(sum, 0, 3 * sizeof *sum);
    for (int i = 0; i < 25; i++) {
        double from[3], d[3], rgb[3];

        for (int k = 0; k < 3; k++) {
            d[k] = b->frame[0][k];
            from[k] = b->a[k] - d[k] + 0.15 * (i % 5 - 2) * b->frame[1][k] +
                      0.15 * (i / 5 - 2) * b->frame[2][k];
        }
        assert_int_equal(saga_ring_trace(&s, from, d).object,
                         SAGA_RING_DISPLAY);
        saga_ring_radiance(&s, from, d, rgb);
        for (int k = 0; k < 3; k++) {
            sum[k] += rgb[k];
            all += rgb[k];
        }
    }
    return all;
}

TEST(display_should_show_a_new_picture_in_every_frame)
{
    double last[3], now[3], again[3];

    assert_true(shown(0.0, last) > 1.0); /* it emits light */
    for (int frame = 1; frame < 32; frame++) {
        shown(frame / 30.0, now);
        shown(frame / 30.0, again);
        for (int k = 0; k < 3; k++)
            near(now[k], again[k]);
        assert_true(fabs(now[0] - last[0]) + fabs(now[1] - last[1]) +
                        fabs(now[2] - last[2]) >
                    0.1);
        memcpy(last, now, sizeof last);
    }
}

TEST(seeds_should_be_scenes_of_their_own)
{
    saga_ring_plan a, b;

    saga_ring_draw_plan(&a, 1);
    saga_ring_draw_plan(&b, 1);
    assert_memory_equal(&a, &b, sizeof a);
    saga_ring_draw_plan(&b, 2);
    assert_true(a.salt != b.salt);
    assert_true(fabs(a.path_turn - b.path_turn) > 1e-3);
    assert_true(fabs(a.release - b.release) > 1e-4);
    assert_true(fabs(a.size - b.size) > 1e-4);
    assert_true(distance(a.pole[0], b.pole[0]) > 1e-2);
    assert_true(distance(a.colour[0], b.colour[0]) > 1e-2);
}
