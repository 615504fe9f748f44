/* SPDX-License-Identifier: MIT
 *
 * See tiny_training.h.
 */
#include "tiny_training.h"

#include "fit_state.h"
#include "start.h"
#include "train_state.h"
#include "view.h"

#include <unistd.h>

static void remove_folder(const char *folder)
{
    char command[100];

    snprintf(command, sizeof command, "rm -rf '%s'", folder);
    assert_int_equal(system(command), 0);
}

void tiny_open(tiny *t, int n_frames)
{
    const saga_synth_options o = synth_options(64, 36, 4, n_frames, 300);
    char path[80];

    strcpy(t->folder, "/tmp/test_tiny.XXXXXX");
    assert_non_null(mkdtemp(t->folder));
    snprintf(t->checkpoint, sizeof t->checkpoint, "%s/x.saga.ckpt", t->folder);
    snprintf(path, sizeof path, "%s/room", t->folder);
    t->capture = synth_capture(path, &o);
}

void tiny_close(tiny *t)
{
    saga_capture_free(&t->capture);
    remove_folder(t->folder);
}

saga_capture tiny_capture(const saga_synth_options *s)
{
    char folder[] = "/tmp/test_tiny.XXXXXX", path[40];
    saga_capture c;

    assert_non_null(mkdtemp(folder));
    snprintf(path, sizeof path, "%s/room", folder);
    c = synth_capture(path, s);
    remove_folder(folder);
    return c;
}

saga_train_options tiny_options(uint32_t n_primitives, int n_warm, int n_render)
{
    saga_train_options o = saga_train_defaults();

    o.n_primitives = n_primitives;
    o.n_warm = n_warm;
    o.n_render = n_render;
    o.motion = SAGA_TRAIN_MOVING;
    return o;
}

saga_train_options tiny_defaults(void)
{
    saga_train_options o = tiny_options(150, TINY_WARM, TINY_RENDER);

    o.lambda = 0;
    o.ablate = "slots=32";
    return o;
}

saga_train_options tiny_layered(void)
{
    saga_train_options o = tiny_defaults();

    o.n_layers = 3;
    o.ablate = NULL;
    return o;
}

saga_train *tiny_begin(const saga_capture *c, const saga_train_options *o)
{
    saga_error error = { "" };
    saga_train *const t = saga_train_new(c, o, &error);

    if (!t)
        fail_msg("%s", error.message);
    return t;
}

saga_train *tiny_resume(const saga_capture *c, const saga_train_options *o)
{
    saga_error error = { "" };
    saga_train *const t = saga_train_resume(c, o, &error);

    if (!t)
        fail_msg("%s", error.message);
    return t;
}

trained tiny_finish(saga_train *t)
{
    const uint8_t *bytes;
    trained r;

    assert_done(saga_train_run(t, &error) == SAGA_DONE);
    bytes = saga_train_bytes(t, &r.n);
    assert_non_null(bytes);
    r.bytes = copy_of(bytes, r.n);
    r.report = *saga_train_report_of(t);
    saga_train_free(t);
    return r;
}

trained tiny_train(const saga_capture *c, const saga_train_options *o)
{
    return tiny_finish(tiny_begin(c, o));
}

void tiny_begin_fit(saga_train *t)
{
    saga_fit_free(t->render.fit);
    saga_params_free(&t->render.target);
    saga_scene_free(&t->render.scene);
    assert_done(saga_train_begin_fit(t, &error));
    assert_done(saga_fit_start(t->render.fit, &t->render.target, &error));
}

double tiny_start_psnr(saga_train *t)
{
    FREED_BY(saga_canvas_free) saga_canvas c;
    saga_twin *const w = &t->render.fit->twin;
    const uint32_t prims = t->render.scene.n.prim;
    double sum = 0;
    int n = 0;

    assert_done(saga_pictures_canvas(&c, &t->pictures, &error));
    for (int view = 0; view < t->capture->n_views; view++)
        for (int frame = 0; frame < t->capture->n_frames; frame++, n++) {
            const saga_sample p = { .view = view, .frame = frame };

            saga_pictures_aim(&c, &t->pictures, p);
            assert_done(
                saga_splat_forward(&c, &t->render.target, prims, &error));
            memcpy(c.truth, c.image, TINY_PICTURE * sizeof *c.truth);
            saga_twin_colour(w, &t->render.fit->used, c.camera.centre);
            assert_done(saga_splat_forward(&c, &w->attr, prims, &error));
            sum += saga_canvas_mse(&c);
        }
    return -10 * log10(sum / n);
}

void tiny_draw(uint8_t rgb[TINY_PICTURE], const uint8_t *bytes, size_t n,
               uint32_t frame)
{
    FREED_BY(saga_film_close) saga_film film;
    saga_camera camera;
    uint32_t number;

    assert_done(saga_film_open(&film, "x", bytes, n, 1, &error));
    assert_done(saga_film_rig(&film, 0, &camera, &number, &error));
    assert_done(saga_film_draw(&film, &camera, frame, 1, rgb, &error));
}

bool tiny_same(const trained *a, const trained *b)
{
    const saga_train_entropy *const x = &a->report.entropy;
    const saga_train_entropy *const y = &b->report.entropy;
    double apart = fabs(x->hyper_weights - y->hyper_weights) +
                   fabs(x->bank_weights - y->bank_weights);

    for (int i = 0; i < SAGA_N_KINDS; i++)
        apart += fabs(x->kind[i].networks - y->kind[i].networks) +
                 fabs(x->kind[i].weights - y->kind[i].weights);
    return a->n == b->n && memcmp(a->bytes, b->bytes, a->n) == 0 &&
           !(apart > 0);
}

static bool goes_on(void *user, const saga_train_progress *p)
{
    tiny_stop *const s = user;

    assert_true(p->iteration <= p->n_iterations);
    assert_true(p->done >= 0 && p->done <= 1);
    s->calls++;
    if (s->every)
        return s->calls % s->every != 0;
    if (p->stage != s->stage ||
        (s->iteration >= 0 && p->iteration != s->iteration))
        return true;
    s->stage = SAGA_TRAIN_N_STAGES;
    return false;
}

void tiny_stop_at(saga_train_options *o, tiny_stop *stop)
{
    o->progress = goes_on;
    o->progress_user = stop;
}

saga_train *tiny_train_until(const saga_capture *c, saga_train_options *o,
                             tiny_stop *stop)
{
    saga_train *t;

    tiny_stop_at(o, stop);
    t = tiny_begin(c, o);
    assert_done(saga_train_run(t, &error) == SAGA_STOPPED);
    return t;
}
