/* SPDX-License-Identifier: MIT
 *
 * The time of a training's iterations: the second half of 200 iterations of the
 * warm-up and of 100 of the rendering stage. The training has 15,000 primitives
 * and pictures of the built-in scene at 480x270.
 */
#include "bench_table.h"
#include "freed.h"
#include "synth.h"
#include "synth_room.h"
#include "train.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

typedef struct {
    double at, psnr[SAGA_TRAIN_PACK];
    bench_times times[SAGA_TRAIN_PACK];
} watch;

static bool tick(void *user, const saga_train_progress *p)
{
    watch *const w = user;
    const double now = bench_now_ms();
    const int n = p->n_iterations, step = n / 2 / BENCH_MAX + 1;

    if (p->stage == SAGA_TRAIN_PACK)
        return false;
    if (p->iteration > n / 2 && p->iteration % step == 0)
        bench_add(&w->times[p->stage], now - w->at);
    w->psnr[p->stage] = p->psnr;
    w->at = bench_now_ms();
    return true;
}

static void draw(saga_shot *v, const saga_room_state *state, int frame)
{
    uint8_t *to = v->rgb + (size_t)frame * saga_view_frame_nbytes(v);
    double origin[3], at[3], rgb[3];

    saga_view_lift(v, (const double[2]){ 0, 0 }, 0, origin);
    for (int y = 0; y < v->height; y++)
        for (int x = 0; x < v->width; x++) {
            saga_view_lift(v, (const double[2]){ x + 0.5, y + 0.5 }, 1, at);
            for (int k = 0; k < 3; k++)
                at[k] -= origin[k];
            saga_room_radiance(state, origin, at, rgb);
            for (int k = 0; k < 3; k++)
                *to++ = (uint8_t)(255.5 * sqrt(fmin(rgb[k], 1)));
        }
}

static void built_in(saga_capture *c)
{
    saga_synth_options o = saga_synth_defaults(SAGA_SYNTH_ROOM);
    saga_room_state state;

    o.width = 480;
    o.height = 270;
    o.n_cameras = 6;
    memset(c, 0, sizeof *c);
    c->format = "built-in scene";
    c->n_views = o.n_cameras;
    c->n_frames = 8;
    c->fps = o.fps;
    c->scale = 1;
    c->views = calloc((size_t)c->n_views, sizeof *c->views);
    for (int i = 0; i < c->n_views; i++) {
        saga_shot *const v = c->views + i;

        saga_synth_view(&o, i, v);
        v->rgb = malloc((size_t)c->n_frames * saga_view_frame_nbytes(v));
        for (int k = 0; k < c->n_frames; k++) {
            saga_room_at(&state, k / c->fps);
            draw(v, &state, k);
        }
    }
}

void bench_train(void)
{
    saga_train_options o = saga_train_defaults();
    saga_error error = { "" };
    FREED_BY(saga_capture_free) saga_capture capture;
    saga_train *train;
    watch w;

    memset(&w, 0, sizeof w);
    o.n_warm = 200;
    o.n_render = 100;
    o.n_primitives = 15000;
    o.motion = SAGA_TRAIN_MOVING;
    o.progress = tick;
    o.progress_user = &w;
    built_in(&capture);
    train = saga_train_new(&capture, &o, &error);
    if (!train || saga_train_run(train, &error) != SAGA_STOPPED) {
        fprintf(stderr, "bench: %s\n", error.message);
        exit(1);
    }
    for (int s = 0; s < SAGA_TRAIN_PACK; s++) {
        char name[56];
        bench_row *r;

        snprintf(name, sizeof name, "training: %s, an iteration",
                 saga_train_stage_name((saga_train_stage)s));
        r = bench_row_add(name, &w.times[s]);
        snprintf(r->note, sizeof r->note, "%.2f dB", w.psnr[s]);
    }
    saga_train_free(train);
}
