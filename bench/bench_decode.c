/* SPDX-License-Identifier: MIT
 *
 * The time to open a stream (its networks), to decode a segment, to prepare a
 * view and to draw it. The stream is random (gen_stream.h), not a trained
 * scene; `bench_share FILE` measures the components on a trained file.
 */
#include "bench_table.h"
#include "freed.h"
#include "gen_stream.h"
#include "saga.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { REPETITIONS = 9, WIDTH = 640, HEIGHT = 360, LIST = 1 << 16 };

enum { OPEN, DECODE, VIEW, DRAW, N_STAGES };
static const char *const stage_name[N_STAGES] = {
    "open (networks)", "decode a segment", "view", "draw 640x360"
};

static bench_times times[N_STAGES];

static void check(saga_status s, const char *what)
{
    if (s) {
        fprintf(stderr, "bench: decode: %s: %s\n", what, saga_status_text(s));
        exit(1);
    }
}

static void draw(const saga_decoder *dec, uint8_t *pixels, void *scratch,
                 size_t scratch_nbytes)
{
    const saga_picture picture = { pixels, 3 * WIDTH, 3 * WIDTH * HEIGHT, 8 };
    saga_job job;

    memset(&job, 0, sizeof job);
    job.x1 = WIDTH;
    job.y1 = HEIGHT;
    job.tile = 16;
    job.list_capacity = LIST;
    job.scratch = scratch;
    job.scratch_nbytes = scratch_nbytes;
    check(saga_draw(dec, &job, &picture, UINT32_MAX), "draw");
}

static void run_once(const uint8_t *bytes, size_t n, const saga_info *info,
                     void *work)
{
    const size_t scratch_nbytes = SAGA_JOB_NBYTES(64, LIST) +
                                  64u * WIDTH * 16u;
    FREED void *const scratch = bench_need(scratch_nbytes);
    FREED uint8_t *const pixels = bench_need(3 * WIDTH * HEIGHT);
    saga_decoder *dec;
    saga_segment seg;
    saga_camera camera;
    uint32_t number;
    double t[N_STAGES + 1];

    /* The camera is the stream's, with a larger picture. */
    check(saga_find(&seg, bytes, n, 0, 1), "find");
    check(saga_rig(&camera, &number, bytes, n, 0), "rig");
    camera.focal_q16[0] = camera.focal_q16[1] = 440 << 16;
    camera.principal_q16[0] = WIDTH / 2 << 16;
    camera.principal_q16[1] = HEIGHT / 2 << 16;
    camera.width = WIDTH;
    camera.height = HEIGHT;
    t[OPEN] = bench_now_ms();
    check(saga_open(&dec, work, info->work_nbytes, bytes, n, NULL), "open");
    t[DECODE] = bench_now_ms();
    check(saga_decode(dec, &seg, bytes + seg.offset, seg.nbytes, NULL),
          "decode");
    t[VIEW] = bench_now_ms();
    check(saga_view(dec, &camera, 20000), "view");
    t[DRAW] = bench_now_ms();
    draw(dec, pixels, scratch, scratch_nbytes);
    t[N_STAGES] = bench_now_ms();
    for (int k = 0; k < N_STAGES; k++)
        bench_add(&times[k], t[k + 1] - t[k]);
}

/* Adds a row for each stage; its count is a number from the file's header. */
static void report(const saga_info *info)
{
    bench_row *r;

    for (int i = 0; i < N_STAGES; i++) {
        r = bench_row_add(stage_name[i], &times[i]);
        r->count = i == OPEN ? info->n_weights : info->max_primitives;
        r->each = i == OPEN ? "a weight" : "a primitive";
        if (i == DECODE) {
            r->kind = BENCH_MACS;
            r->work = (double)info->decode_macs;
        }
    }
}

void bench_decode(void)
{
    const gen_options o = { .seed = 12, .level = 3, .picture = 1,
                            .tools_fixed = 1, .tools = SAGA_TOOLS_PICTURE,
                            .n_coarse = 600 };
    saga_info info;
    FREED uint8_t *bytes;
    size_t n;
    FREED void *work;
    FREED_BY(gen_stream_free) gen_stream g = gen_stream_make(&o);

    gen_stream_encode(&g, &bytes, &n);
    check(saga_probe(&info, bytes, n), "probe");
    work = bench_need(info.work_nbytes);
    for (int i = 0; i < REPETITIONS; i++)
        run_once(bytes, n, &info, work);
    report(&info);
}
