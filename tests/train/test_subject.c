/* SPDX-License-Identifier: MIT
 *
 * What surrounds a subject becomes transparent: its training pictures are over
 * random backgrounds, and in a trained file the opacity is that of the masks.
 */
#include "capture_files.h"
#include "cube.h"
#include "evaluate.h"
#include "tiny_training.h"

enum { N_VIEWS = 5, W = 64, H = 36 };

/* The room's things without the room. */
static saga_capture things;

static int open_things(void **state)
{
    saga_synth_options s = synth_options(W, H, N_VIEWS, 3, 300);
    saga_capture_options o = saga_capture_defaults();
    void *f;

    (void)state;
    s.masks = true;
    s.depth_every = 1;
    o.subject = true;
    o.want_depth = true;
    if (folder_make(&f))
        return 1;
    assert_done(saga_synth_write(folder_file(f, "room"), &s, &error));
    things = load_with(folder_file(f, "room"), &o);
    return folder_remove(&f);
}

static int close_things(void **state)
{
    (void)state;
    saga_capture_free(&things);
    return 0;
}

TEST_GROUP(open_things, close_things);

/* The box must hold the places that training views show of the subject, by the
 * scene's true depths. */
TEST(box_should_hold_what_the_masks_show)
{
    double box[6];
    int n_shown = 0;

    assert_done(saga_cube_subject(box, &things, &error));
    for (int i = 0; i < N_VIEWS * things.n_frames * W * H; i++) {
        const int v = i % N_VIEWS, frame = i / N_VIEWS % things.n_frames;
        const int at = i / N_VIEWS / things.n_frames;
        double x[3];

        if (things.views[v].held_out ||
            saga_capture_mask(&things, v, frame)[at] < 255)
            continue;
        n_shown++;
        saga_view_lift(&things.views[v],
                       (double[]){ at % W + 0.5, at / W + 0.5 },
                       (double)saga_capture_depth(&things, v, frame)[at], x);
        for (int k = 0; k < 3; k++)
            assert_true(x[k] > box[k] && x[k] < box[3 + k]);
    }
    assert_true(n_shown > 1000);
}

enum { N_ROUND = 8, SIDE = 96 };

/* Makes view v of eight that look from all sides, 5 away, at the middle. */
static void stand_round(saga_source_view *view, int v)
{
    const double c = cos(v * 3.14159265 / 4), s = sin(v * 3.14159265 / 4);
    const double r[9] = { -s, c, 0, 0, 0, -1, -c, -s, 0 };

    *view = (saga_source_view){ .width = SIDE,
                                .height = SIDE,
                                .fx = SIDE,
                                .fy = SIDE,
                                .cx = SIDE / 2.0,
                                .cy = SIDE / 2.0,
                                .translation = { 0, 0, 5 } };
    memcpy(view->rotation, r, sizeof r);
}

/* Marks the pixels whose rays pass a ball. */
static void mark_ball(uint8_t *mask, const saga_source_view *v,
                      const double ball[3], double radius)
{
    double c[3];

    saga_view_transform(v, ball, c);
    for (int i = 0; i < SIDE * SIDE; i++) {
        const double d[3] = { (i % SIDE + 0.5 - v->cx) / v->fx,
                              (i / SIDE + 0.5 - v->cy) / v->fy, 1 };
        const double t = (c[0] * d[0] + c[1] * d[1] + c[2]) /
                         (d[0] * d[0] + d[1] * d[1] + 1);

        mask[i] = hypot(hypot(c[0] - t * d[0], c[1] - t * d[1]), c[2] - t) <
                          radius
                      ? 255
                      : 0;
    }
}

/* Eight views see a ball inside an octagon around it, which is 1 / cos 22.5
 * degrees = 1.08 as wide; a margin of 6 % of the width and two pixels, a tenth
 * of a unit each way, are added. A mask that is empty by mistake changes
 * little; masks of two different balls are refused, unless a box is given. */
TEST(box_should_be_as_small_as_the_subject)
{
    static const double ball[3] = { 0.4, -0.3, 0.2 },
                        other[3] = { -0.6, 1, -1 };
    static const double radius = 0.5;
    saga_source_view view[N_ROUND];
    uint8_t mask[N_ROUND][SIDE * SIDE];
    saga_capture c = { .n_views = N_ROUND,
                       .n_frames = 1,
                       .n_learned = N_ROUND,
                       .subject = true,
                       .views = view };
    saga_error failed = { "" };
    double box[6];

    for (int v = 0; v < N_ROUND; v++) {
        stand_round(&view[v], v);
        view[v].mask = mask[v];
        mark_ball(mask[v], &view[v], ball, radius);
    }
    for (int empty = 0; empty < 2; empty++) {
        assert_done(saga_cube_subject(box, &c, &error));
        for (int k = 0; k < 3; k++) {
            assert_true(box[k] < ball[k] - radius + 0.05);
            assert_true(box[3 + k] > ball[k] + radius - 0.05);
            assert_near(box[k], ball[k] - radius, 0.25);
            assert_near(box[3 + k], ball[k] + radius, 0.25);
        }
        memset(mask[3], 0, sizeof mask[3]);
    }
    for (int v = 0; v < N_ROUND; v += 2)
        mark_ball(mask[v], &view[v], other, radius / 4);
    assert_false(saga_cube_subject(box, &c, &failed));
    assert_says(&failed, "no place is inside the masks");
    c.box[3] = c.box[4] = c.box[5] = 1;
    assert_done(saga_cube_subject(box, &c, &error));
    assert_memory_equal(box, c.box, sizeof box);
}

/* Backgrounds are uniform, and the truth is the picture over its background,
 * at full size and halved. */
TEST(truth_should_be_over_the_random_background)
{
    const saga_rng r = saga_rng_stream(1, 2);
    saga_pictures p;
    FREED_BY(saga_canvas_free) saga_canvas c;
    double sum = 0;

    assert_done(saga_pictures_init(&p, &things, &error));
    assert_done(saga_pictures_canvas(&c, &p, &error));
    for (uint64_t draw = 0; draw < 400; draw++) {
        saga_sample s = saga_pictures_pick(&p, r, draw);
        const saga_source_view *const v = &things.views[s.view];

        for (int k = 0; k < 3; k++)
            sum += s.behind[k];
        if (draw > 10)
            continue;
        s.mip = (int)draw % 2;
        saga_pictures_aim(&c, &p, s);
        saga_pictures_truth(&c, &p, s);
        assert_int_equal(c.n_unseen, 0);
        for (int i = 0; i < 3 * c.camera.width * c.camera.height; i++) {
            const int side = 1 << s.mip,
                      plane = c.camera.width * c.camera.height;
            const int x = i % c.camera.width, y = i % plane / c.camera.width;
            double truth = 0;

            for (int j = 0; j < side * side; j++) {
                const int at = (y * side + j / side) * v->width + x * side +
                               j % side;
                const double m =
                    saga_capture_mask(&things, s.view, s.frame)[at] / 255.0;

                truth += (saga_capture_frame(&things, s.view,
                                             s.frame)[3 * at + i / plane] +
                          (1 - m) * s.behind[i / plane]) /
                         255 / (side * side);
            }
            assert_near(c.truth[i], truth, 1e-5);
        }
    }
    /* The mean of 1200 uniform numbers has a deviation of 2.1. */
    assert_near(sum / 1200, 127.5, 10);
    saga_pictures_free(&p);
}

/* Returns the intersection over union of a file. */
static double iou_of(const trained *t, saga_eval *eval)
{
    FREED_BY(saga_film_close) saga_film film;
    const saga_eval_options o = { .score = { .no_ssim = true } };
    const saga_eval_maker maker = { .name = "x",
                                    .n_threads = 1,
                                    .draw = saga_eval_draw_film,
                                    .opacity = saga_eval_film_opacity,
                                    .state = &film };

    assert_done(saga_film_open(&film, "x", t->bytes, t->n, 1, &error));
    assert_done(saga_eval_match(eval, &film, &things, -1, &error));
    assert_done(saga_eval_run(eval, &maker, &things, &o, &error));
    return eval->training.value[saga_metric_called("iou")];
}

/* Returns the same of view 0, by opacities that follow from the difference of
 * what a white and a black background show. */
static double plain_iou(const trained *t, const saga_eval *eval)
{
    FREED_BY(saga_film_close) saga_film film;
    const int n = W * H;
    uint8_t rgb[2][TINY_PICTURE];
    double both = 0, any = 0;

    assert_done(saga_film_open(&film, "x", t->bytes, t->n, 1, &error));
    for (int frame = 0; frame < things.n_frames; frame++) {
        for (int white = 0; white < 2; white++) {
            saga_camera c = eval->view[0].camera;

            for (int k = 0; k < 3; k++)
                c.background_q15[k] = (uint16_t)(white ? 32768 : 0);
            assert_done(saga_film_draw(&film, &c, (uint32_t)frame, 1,
                                       rgb[white], &error));
        }
        for (int i = 0; i < n; i++) {
            const double a = 1 - (rgb[1][3 * i] - rgb[0][3 * i]) / 255.0;
            const double m = saga_capture_mask(&things, 0, frame)[i] / 255.0;

            both += fmin(a, m);
            any += fmax(a, m);
        }
    }
    return both / any;
}

/* Over black, a black and opaque surrounding is as good as a transparent one;
 * over random backgrounds it is not. */
TEST(opacity_should_be_that_of_the_masks)
{
    saga_train_options o = tiny_options(300, 300, 300);
    saga_eval eval;
    trained subject, over_black;
    uint8_t *mask[N_VIEWS];
    double own, other;

    subject = tiny_train(&things, &o);
    own = iou_of(&subject, &eval);
    assert_near(eval.view[0].score.value[saga_metric_called("iou")],
                plain_iou(&subject, &eval), 0.01);
    saga_eval_free(&eval);
    things.subject = false;
    for (int v = 0; v < things.n_views; v++) {
        mask[v] = things.views[v].mask;
        things.views[v].mask = NULL;
    }
    over_black = tiny_train(&things, &o);
    things.subject = true;
    for (int v = 0; v < things.n_views; v++)
        things.views[v].mask = mask[v];
    other = iou_of(&over_black, &eval);
    saga_eval_free(&eval);
    assert_true(own > 0.6);
    assert_true(other < 0.4);
    free(subject.bytes);
    free(over_black.bytes);
}
