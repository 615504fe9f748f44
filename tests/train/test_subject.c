/* SPDX-License-Identifier: MIT
 *
 * What surrounds a subject becomes transparent: its training pictures are over
 * random backgrounds, and in a trained file the opacity is that of the masks.
 */
#include "evaluate.h"
#include "tiny_training.h"

#include <unistd.h>

enum { N_VIEWS = 5 };

/* The room's things without the room. */
static saga_capture things;

static int open_things(void **state)
{
    saga_synth_options s = synth_options(64, 36, N_VIEWS, 3, 300);
    saga_capture_options o = saga_capture_defaults();
    char folder[] = "/tmp/test_subject.XXXXXX", path[40], command[60];

    (void)state;
    s.masks = true;
    o.subject = true;
    assert_non_null(mkdtemp(folder));
    snprintf(path, sizeof path, "%s/room", folder);
    assert_done(saga_synth_write(path, &s, &error));
    assert_done(saga_capture_load(&things, path, &o, &error));
    snprintf(command, sizeof command, "rm -r %s", folder);
    return system(command);
}

static int close_things(void **state)
{
    (void)state;
    saga_capture_free(&things);
    return 0;
}

TEST_GROUP(open_things, close_things);

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
    const int n = 64 * 36;
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
