/* SPDX-License-Identifier: MIT
 *
 * Novel views, pictures between the cameras that teachers draw. The tests check
 * where their cameras are, in which order the pictures come, what they show,
 * and that a warm-up learns from them.
 */
#include "camera.h"
#include "flat.h"
#include "lone.h"
#include "novel.h"
#include "testing.h"

enum { W = 32, H = 24, VIEWS = 5, FRAMES = 3, HELD_OUT = 4 };

#define DISTANCE 4.0 /* distance of all cameras from the origin */

/* Makes a camera at an angle and a height of 0 that looks at the origin. */
static void look(saga_source_view *s, double angle)
{
    const double c = cos(angle), d = sin(angle);
    const double r[9] = { c, 0, -d, 0, 1, 0, d, 0, c };

    /* It stands at -DISTANCE times its forward axis, so t = (0, 0,
     * DISTANCE). */
    memcpy(s->rotation, r, sizeof r);
    s->translation[0] = s->translation[1] = 0;
    s->translation[2] = DISTANCE;
}

typedef struct {
    saga_capture capture;
    saga_source_view views[VIEWS];
    uint8_t rgb[FRAMES * W * H * 3];
    saga_pictures pictures;
} fixture;

/* Makes cameras `step` apart on an arc, one of them held out; all see grey. */
static fixture *make(double step)
{
    fixture *const f = zeroed(1, sizeof *f);

    f->capture = (saga_capture){
        .n_views = VIEWS, .n_frames = FRAMES, .fps = 25, .views = f->views
    };
    /* No two neighbouring pixels are equal, so that no colour is taken for the
     * background. */
    for (size_t i = 0; i < sizeof f->rgb; i++)
        f->rgb[i] = (uint8_t)(100 + i * 37 % 56);
    for (int v = 0; v < VIEWS; v++) {
        saga_source_view *const s = &f->views[v];

        *s = (saga_source_view){ .width = W,
                                 .height = H,
                                 .fx = 30,
                                 .fy = 30,
                                 .cx = W / 2.0,
                                 .cy = H / 2.0,
                                 .near_depth = 2,
                                 .far_depth = 8,
                                 .held_out = v == HELD_OUT,
                                 .rgb = f->rgb };
        look(s, step * v);
    }
    assert_done(saga_pictures_init(&f->pictures, &f->capture, &error));
    return f;
}

static void drop(fixture *f)
{
    saga_pictures_free(&f->pictures);
    free(f);
}

static saga_novel placed(const fixture *f)
{
    saga_novel o;

    assert_done(saga_novel_init(&o, &f->pictures, &error));
    return o;
}

/* --- Cameras ------------------------------------------------------------- */

/* Returns the distance of a place from the segment between two cameras. */
static double off(const double x[3], const saga_source_view *a,
                  const saga_source_view *b)
{
    double p[3], q[3], along = 0, length = 0, sum = 0;

    saga_source_view_centre(p, a);
    saga_source_view_centre(q, b);
    for (int i = 0; i < 3; i++) {
        along += (x[i] - p[i]) * (q[i] - p[i]);
        length += (q[i] - p[i]) * (q[i] - p[i]);
    }
    along = fmin(fmax(along / length, 0), 1);
    for (int i = 0; i < 3; i++) {
        const double d = p[i] + along * (q[i] - p[i]) - x[i];

        sum += d * d;
    }
    return sqrt(sum);
}

/* Cameras 0 to 3 are training views. Each is paired with its two nearest ones:
 * 0 with 1 and 2, 1 with 0 and 2, 2 with 1 and 3, 3 with 2 and 1. There must be
 * three novel cameras between each of these five pairs. */
TEST(cameras_should_stand_between_training_views)
{
    static const int pair[5][2] = {
        { 0, 1 }, { 0, 2 }, { 1, 2 }, { 2, 3 }, { 1, 3 }
    };
    fixture *const f = make(0.35);
    FREED_BY(saga_novel_free) saga_novel o = placed(f);
    int n[5] = { 0 };

    assert_int_equal(o.n_views, 15);
    for (int i = 0; i < o.n_views; i++) {
        const double *const r = o.view[i].rotation;
        double x[3], ahead = 0, length = 0;
        int at = -1;

        saga_source_view_centre(x, &o.view[i]);
        for (int k = 0; k < 5; k++)
            if (off(x, &f->views[pair[k][0]], &f->views[pair[k][1]]) < 1e-9)
                at = k;
        assert_true(at >= 0);
        n[at]++;
        /* It must look at the origin like the two cameras of the pair: forward
         * is -x / |x|, except for the distance of a chord from its arc. */
        for (int k = 0; k < 3; k++) {
            ahead -= r[6 + k] * x[k];
            length += x[k] * x[k];
        }
        assert_true(ahead / sqrt(length) > 0.99);
        /* Rows are orthonormal. */
        for (int k = 0; k < 9; k++) {
            const double *const a = r + k / 3 * 3, *const b = r + k % 3 * 3;

            assert_true(fabs(a[0] * b[0] + a[1] * b[1] + a[2] * b[2] -
                             (k % 4 == 0)) < 1e-12);
        }
    }
    for (int k = 0; k < 5; k++)
        assert_int_equal(n[k], 3);
    drop(f);
}

/* The three cameras of a pair must be in the middle of each third of the way
 * between them. */
TEST(rotation_should_be_shared_evenly)
{
    static const double part[3] = { 1 / 6.0, 1 / 2.0, 5 / 6.0 };
    fixture *const f = make(0.35);
    FREED_BY(saga_novel_free) saga_novel o = placed(f);

    /* The first pair is that of cameras 0 and 1, 0.35 apart. */
    for (int i = 0; i < 3; i++)
        assert_true(fabs(atan2(o.view[i].rotation[6], o.view[i].rotation[8]) -
                         0.35 * part[i]) < 1e-12);
    drop(f);
}

TEST(cameras_should_not_know_held_out_views)
{
    fixture *const f = make(0.35);
    saga_novel a = placed(f), b;

    /* The place and the pictures of the held-out camera must not matter. */
    look(&f->views[HELD_OUT], -1.1);
    b = placed(f);
    assert_int_equal(a.n_views, b.n_views);
    assert_memory_equal(a.view, b.view, (size_t)a.n_views * sizeof *a.view);
    saga_novel_free(&a);
    saga_novel_free(&b);
    drop(f);
}

/* Novel cameras must exist only if neighbours are 20 to 40 degrees apart, seen
 * from the middle depth, which is near the origin here. A step of 0.35 radians
 * puts them 20.3 degrees apart, and the second ones 39; one of 0.34 puts them
 * 19.7 apart, which is too near. With 0.9 they are 48 degrees apart, which is
 * too far. */
TEST(cameras_should_stand_where_views_are_far_apart)
{
    fixture *f = make(0.35);
    saga_novel o = placed(f);

    assert_int_equal(o.n_views, 15);
    saga_novel_free(&o);
    drop(f);
    f = make(0.34);
    o = placed(f);
    assert_int_equal(o.n_views, 0);
    saga_novel_free(&o);
    drop(f);
    /* Of four views, one is 0.4 from the nearest. */
    f = make(0.34);
    look(&f->views[3], 2 * 0.34 + 0.4);
    o = placed(f);
    assert_int_equal(o.n_views, 0);
    saga_novel_free(&o);
    drop(f);
    f = make(0.9);
    o = placed(f);
    assert_int_equal(o.n_views, 0);
    saga_novel_free(&o);
    drop(f);
}

/* --- Pictures ------------------------------------------------------------ */

/* Makes a ball before the cameras that fills their pictures with one colour. */
static void ball(saga_splat_params *p, real red)
{
    assert_done(
        saga_params_alloc(p, SAGA_ATTR_BIT(SAGA_ATTR_SUPPORT) - 1, 1, &error));
    p->quat[0] = 1;
    p->opacity[0] = 12;
    for (int k = 0; k < 3; k++)
        p->log2_scale[k] = 1;
    p->colour[0] = red;
    p->colour[1] = p->colour[2] = R(0.5);
}

static void teach(saga_novel *o, real red)
{
    FREED_BY(saga_params_free) saga_splat_params p;

    ball(&p, red);
    assert_done(saga_novel_teach(o, &p, 1, &error));
}

/* In a capture that moves, 15 of a hundred pictures must be the teachers'. The
 * others must come in the order that they have without teachers. */
TEST(others_should_keep_their_order)
{
    const saga_rng r = saga_rng_stream(1, 2);
    fixture *const f = make(0.35);
    FREED_BY(saga_novel_free) saga_novel o = placed(f);
    uint64_t own = 0;
    int moments = 0;

    for (uint64_t i = 0; i < 20; i++)
        assert_false(
            saga_novel_is(&f->pictures, saga_novel_pick(&f->pictures, r, i)));
    f->pictures.novel = &o;
    for (uint64_t i = 0; i < 1000; i++) {
        const saga_sample s = saga_novel_pick(&f->pictures, r, i);

        if (saga_novel_is(&f->pictures, s)) {
            assert_in_range(s.view, VIEWS, VIEWS + o.n_views - 1);
            assert_in_range(s.frame, 0, FRAMES - 1);
            moments |= 1 << s.frame;
        } else {
            const saga_sample t = saga_pictures_pick(&f->pictures, r, own++);

            assert_int_equal(s.view, t.view);
            assert_int_equal(s.frame, t.frame);
        }
    }
    assert_int_equal(own, 850);
    assert_int_equal(moments, (1 << FRAMES) - 1);
    drop(f);
}

/* In a still, three of ten pictures must be the teachers'. */
TEST(still_should_have_more_of_them)
{
    const saga_rng r = saga_rng_stream(1, 2);
    fixture *const f = make(0.35);
    saga_novel o;
    int n = 0;

    f->capture.n_frames = 1;
    o = placed(f);
    f->pictures.novel = &o;
    for (uint64_t i = 0; i < 1000; i++)
        n += saga_novel_is(&f->pictures, saga_novel_pick(&f->pictures, r, i));
    assert_int_equal(n, 300);
    saga_novel_free(&o);
    drop(f);
}

TEST(truth_should_be_the_mean_of_the_teachers)
{
    fixture *const f = make(0.35);
    const size_t middle = W * (H / 2) + W / 2, plane = W * H;
    FREED_BY(saga_novel_free) saga_novel o = placed(f);
    FREED_BY(saga_canvas_free) saga_canvas canvas;
    real red[3];

    assert_done(saga_pictures_canvas(&canvas, &f->pictures, &error));
    f->pictures.novel = &o;
    for (int k = 0; k < 3; k++) {
        /* First one teacher, then the other one, then both. */
        if (k > 0)
            for (int i = 0; i < o.n_teachers; i++)
                saga_params_free(&o.teacher[i]);
        o.n_teachers = 0;
        if (k != 1)
            teach(&o, R(0.25));
        if (k != 0)
            teach(&o, R(0.75));
        assert_done(saga_novel_show(&canvas, &f->pictures,
                                    (saga_sample){ .view = VIEWS, .frame = 1 },
                                    &error));
        assert_int_equal(canvas.n_unseen, 0);
        red[k] = canvas.truth[middle];
        assert_true(canvas.truth[middle + plane] > R(0.4));
    }
    /* Alpha is 0.99 in front of a black background. */
    assert_true(fabs((double)red[0] - 0.2475) < 0.01);
    assert_true(fabs((double)red[1] - 0.7425) < 0.01);
    assert_true(fabs((double)(red[0] + red[1]) / 2 - (double)red[2]) < 1e-6);
    drop(f);
}

/* --- Learning ------------------------------------------------------------ */

/* Returns the mean squared error of a warm-up's picture against the teacher's
 * at the first camera between two views. */
static double distance_of(const fixture *f, saga_flat *flat,
                          const saga_novel *o)
{
    const saga_splat_params p = saga_flat_params(flat);
    saga_pictures pictures = f->pictures;
    FREED_BY(saga_canvas_free) saga_canvas canvas;
    double mse;

    pictures.novel = (saga_novel *)(uintptr_t)o;
    assert_done(saga_pictures_canvas(&canvas, &pictures, &error));
    assert_done(saga_novel_show(&canvas, &pictures,
                                (saga_sample){ .view = VIEWS }, &error));
    assert_done(saga_splat_forward(&canvas, &p, saga_flat_count(flat), &error));
    mse = saga_canvas_mse(&canvas);
    return mse;
}

/* The cameras see grey and the teacher's pictures between them are red. A
 * warm-up with this teacher must be redder there. For the teacher's pictures an
 * error of 0 must be reported. */
TEST(warm_up_should_learn_from_teachers)
{
    saga_flat_options options = saga_flat_defaults();
    fixture *const f = make(0.35);
    saga_novel o;
    double away[2], mse;
    int n_novel = 0;

    f->capture.n_frames = 1;
    o = placed(f);
    teach(&o, R(1));
    options.n_primitives = 60;
    options.n_iterations = 100;
    options.temporal = 0;
    for (int k = 0; k < 2; k++) {
        saga_flat *flat;

        f->pictures.novel = k ? &o : NULL;
        assert_done(flat = saga_flat_new(&f->pictures, &options, &error));
        for (int i = 0; i < options.n_iterations; i++) {
            assert_done(saga_flat_iterate(flat, &mse, &error));
            n_novel += !(mse > 0);
        }
        away[k] = distance_of(f, flat, &o);
        saga_flat_free(flat);
    }
    assert_int_equal(n_novel, 30);
    if (!(away[1] < 0.7 * away[0]))
        fail_msg("%g with a teacher, %g without", away[1], away[0]);
    saga_novel_free(&o);
    drop(f);
}

/* --- Lone views ----------------------------------------------------------- */

/* Returns the distance of the origin from the nearest lone view, and their
 * number. */
static real from_origin(const fixture *f, int *n)
{
    const real origin[3] = {
        R(-f->pictures.cube.centre[0] / f->pictures.cube.unit),
        R(-f->pictures.cube.centre[1] / f->pictures.cube.unit),
        R(-f->pictures.cube.centre[2] / f->pictures.cube.unit)
    };
    saga_lone lone;
    real d;

    assert_done(saga_lone_find(&lone, &f->pictures, &error));
    *n = lone.n;
    d = saga_lone_distance(&lone, origin);
    saga_lone_free(&lone);
    return d;
}

/* Cameras 0 and 1, and 3 and 4, are neighbours. */
TEST(views_should_be_alone_if_none_is_within_ten_degrees)
{
    fixture *const near = make(0.17), *const far = make(0.18);
    int n;

    assert_true(isinf(from_origin(near, &n)));
    assert_int_equal(n, 0);
    assert_float_equal(from_origin(far, &n),
                       R(DISTANCE / far->pictures.cube.unit), 1e-5);
    assert_int_equal(n, 4);
    drop(near);
    drop(far);
}

TEST(no_view_should_be_alone_if_one_camera_moves_or_around_a_subject)
{
    fixture *const f = make(0.22);
    int n;

    f->capture.moves = true;
    from_origin(f, &n);
    assert_int_equal(n, 0);
    f->capture.moves = false;
    f->capture.subject = true;
    from_origin(f, &n);
    assert_int_equal(n, 0);
    drop(f);
}
