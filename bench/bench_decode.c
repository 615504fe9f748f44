/* SPDX-License-Identifier: MIT
 *
 * A whole stream, stage by stage, on one thread: CPU time to open (networks),
 * to decode a segment, to prepare a view and to draw it; symbols and
 * multiply-accumulates per second. The stream is random (gen_stream.h), not a
 * trained scene.
 *
 *     bench_decode [REPETITIONS] [COARSE]
 */
#include "encode.h"
#include "gen_stream.h"
#include "ref_recorder.h"
#include "saga.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

enum { MAX_REPETITIONS = 1000, WIDTH = 640, HEIGHT = 360, LIST = 1 << 16 };

enum { OPEN, DECODE, VIEW, DRAW, N_STAGES };
static const char *const stage_name[N_STAGES] = {
    "open (networks)", "decode a segment", "view", "draw 640x360"
};

static int repetitions = 15;
static double times[N_STAGES][MAX_REPETITIONS];

static double now_ms(void)
{
    struct timespec t;

    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
    return 1e3 * (double)t.tv_sec + 1e-6 * (double)t.tv_nsec;
}

static int compare(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;

    return (x > y) - (x < y);
}

static double median(double *t)
{
    qsort(t, (size_t)repetitions, sizeof *t, compare);
    return t[repetitions / 2];
}

static void *need(size_t nbytes)
{
    void *const p = aligned_alloc(64, (nbytes + 63) & ~(size_t)63);

    if (!p) {
        fprintf(stderr, "out of memory\n");
        exit(1);
    }
    return p;
}

static void check(saga_status s, const char *what)
{
    if (s) {
        fprintf(stderr, "bench_decode: %s: %s\n", what, saga_status_text(s));
        exit(1);
    }
}

/* Symbols of the whole file, counted by the recorder. */
static double count_symbols(const uint8_t *bytes, size_t n,
                            const saga_info *info, uint32_t *in_nets)
{
    saga_net_symbols nets;
    saga_symbols s;
    uint32_t final_range[3];
    double count;

    if (!recorder_read(&nets, &s, 0, final_range, bytes, n))
        check(SAGA_ERR_DATA, "recorder");
    *in_nets = info->n_weights;
    count = (4.0 + info->features) * s.n.coarse + 5.0 * s.n.fine +
            4.0 * s.n.prim;
    saga_net_symbols_free(&nets);
    recorder_free_symbols(&s);
    return count;
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
                     void *work, int i)
{
    const size_t scratch_nbytes = SAGA_JOB_NBYTES(64, LIST) +
                                  64u * WIDTH * 16u;
    void *const scratch = need(scratch_nbytes);
    uint8_t *const pixels = need(3 * WIDTH * HEIGHT);
    saga_decoder *dec;
    saga_segment seg;
    saga_camera camera;
    uint32_t number;
    double t[N_STAGES + 1];
    int k;

    check(saga_find(&seg, bytes, n, 0, 1), "find");
    check(saga_rig(&camera, &number, bytes, n, 0), "rig");
    camera.focal_q16[0] = camera.focal_q16[1] = 440 << 16;
    camera.principal_q16[0] = WIDTH / 2 << 16;
    camera.principal_q16[1] = HEIGHT / 2 << 16;
    camera.width = WIDTH;
    camera.height = HEIGHT;
    t[OPEN] = now_ms();
    check(saga_open(&dec, work, info->work_nbytes, bytes, n), "open");
    t[DECODE] = now_ms();
    check(saga_decode(dec, &seg, bytes + seg.offset, seg.nbytes), "decode");
    t[VIEW] = now_ms();
    check(saga_view(dec, &camera, 20000), "view");
    t[DRAW] = now_ms();
    draw(dec, pixels, scratch, scratch_nbytes);
    t[N_STAGES] = now_ms();
    for (k = 0; k < N_STAGES; k++)
        times[k][i] = t[k + 1] - t[k];
    free(pixels);
    free(scratch);
}

int main(int argc, char **argv)
{
    gen_options o = { .seed = 12, .level = 3, .picture = 1, .tools_fixed = 1,
                      .tools = SAGA_TOOLS_PICTURE };
    gen_stream g;
    saga_info info;
    uint8_t *bytes;
    size_t n;
    void *work;
    double symbols;
    uint32_t in_nets;
    int i;

    if (argc > 1)
        repetitions = atoi(argv[1]);
    if (repetitions < 1 || repetitions > MAX_REPETITIONS)
        repetitions = 15;
    o.n_coarse = argc > 2 ? (uint32_t)atoi(argv[2]) : 600;
    gen_stream_make(&g, &o);
    gen_stream_encode(&g, &bytes, &n);
    check(saga_probe(&info, bytes, n), "probe");
    work = need(info.work_nbytes);
    for (i = 0; i < repetitions; i++)
        run_once(bytes, n, &info, work, i);
    symbols = count_symbols(bytes, n, &info, &in_nets);
    printf("stream             %zu bytes; %u coarse, %u fine, %u primitives; "
           "%u weights; work block %zu bytes\n", n, info.max_coarse,
           info.max_fine, info.max_primitives, info.n_weights,
           info.work_nbytes);
    for (i = 0; i < N_STAGES; i++) {
        const double m = median(times[i]);

        printf("%-18s %8.2f ms median, %.2f best", stage_name[i], m,
               times[i][0]);
        if (i == OPEN)
            printf("; %.1f Msym/s", in_nets / (1e3 * m));
        if (i == DECODE)
            printf("; %.2f Msym/s, %.2f GMAC/s, %.1f us a primitive",
                   symbols / (1e3 * m), (double)info.decode_macs / (1e6 * m),
                   1e3 * m / info.max_primitives);
        printf("\n");
    }
    free(work);
    free(bytes);
    gen_stream_free(&g);
    return 0;
}
