/* SPDX-License-Identifier: MIT
 *
 * saga-play: the pictures of a file, drawn by several threads; the worked
 * example of docs/threads.md. It prints each picture's CRC-32C, which does not
 * depend on the threads, and at the end how long a picture took, and how much
 * processor time of all threads.
 *
 *     saga-play [--seconds S] FILE [THREADS [CAMERA [PICTURES]]]
 *
 * It gives up when decoding a segment takes longer than S, which is as long as
 * files of the level may take where nobody says otherwise.
 *
 * While the threads draw a picture, this one prepares the next in a second
 * decoder, and then draws too. A third decodes the next segment meanwhile.
 */
#include "saga.h"

#include <pthread.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

enum { MAX_THREADS = 64, ROWS = 32, LIST = 1 << 15, BUDGET = 1 << 22 };
#define NO_SEGMENT 0xffffffffu

/* A decoder's block and what is decoded in it. */
typedef struct {
    void *work;
    saga_decoder *dec;
    uint32_t segment;
} block;

/* One thread's scratch; they share the rest. */
typedef struct {
    struct player *player;
    void *scratch;
    pthread_t thread;
} painter;

typedef struct player {
    unsigned char *bytes;
    size_t n;
    saga_info info;
    saga_camera camera;
    double seconds;          /* of decoding a segment, or the base; 0: any */
    block shown[2];          /* pictures take turns */
    block ahead;             /* the next segment */
    pthread_t decoding;
    int is_decoding;
    painter painters[MAX_THREADS];
    uint32_t n_threads;
    /* The picture being drawn. */
    const saga_decoder *dec;
    unsigned char *rgb;
    atomic_int next_row;
} player;

static void stop(const char *what)
{
    fprintf(stderr, "saga-play: %s\n", what);
    exit(1);
}

static void check(saga_status s)
{
    if (s)
        stop(saga_status_text(s));
}

static void *need(size_t n)
{
    void *const p = aligned_alloc(64, (n + 63) & ~(size_t)63);

    if (!p)
        stop("out of memory");
    return p;
}

static void read_file(player *p, const char *path)
{
    FILE *const f = fopen(path, "rb");

    if (!f || fseek(f, 0, SEEK_END))
        stop("cannot read the file");
    p->n = (size_t)ftell(f);
    p->bytes = need(p->n + 1);
    rewind(f);
    if (fread(p->bytes, 1, p->n, f) != p->n)
        stop("cannot read the file");
    fclose(f);
}

/* --- Segments ------------------------------------------------------------ */

static double ms_of(clockid_t clock)
{
    struct timespec t;

    clock_gettime(clock, &t);
    return 1e3 * (double)t.tv_sec + 1e-6 * (double)t.tv_nsec;
}

/* A decoder is asked in its own thread; user is when its time is over. */
static int is_late(void *user)
{
    const double *const deadline = user;

    return *deadline > 0 && ms_of(CLOCK_MONOTONIC) > *deadline;
}

static double deadline_of(const player *p)
{
    return p->seconds > 0 ? ms_of(CLOCK_MONOTONIC) + 1e3 * p->seconds : 0;
}

static void check_decoding(const player *p, saga_status s)
{
    if (s == SAGA_ERR_STOPPED) {
        fprintf(stderr, "saga-play: decoding took more than %g s; allow more "
                "with --seconds %g\n", p->seconds, 6 * p->seconds);
        exit(1);
    }
    check(s);
}

static void open_block(player *p, block *b)
{
    double deadline = deadline_of(p);
    const saga_watch watch = { is_late, &deadline };

    b->work = need(p->info.work_nbytes);
    b->segment = NO_SEGMENT;
    check_decoding(p, saga_open(&b->dec, b->work, p->info.work_nbytes,
                                p->bytes, p->n, &watch));
}

static void decode(player *p, block *b, const saga_segment *seg)
{
    double deadline = deadline_of(p);
    const saga_watch watch = { is_late, &deadline };

    if (seg->offset > p->n || seg->nbytes > p->n - seg->offset)
        stop("the file ends too early");
    check_decoding(p, saga_decode(b->dec, seg, p->bytes + seg->offset,
                                  seg->nbytes, &watch));
    b->segment = seg->number;
}

/* The segment behind the first shown one, on a thread of its own. */
static void *decode_ahead(void *arg)
{
    player *const p = arg;
    saga_segment seg;

    check(saga_find(&seg, p->bytes, p->n, p->ahead.segment, 1));
    decode(p, &p->ahead, &seg);
    return NULL;
}

static void finish_ahead(player *p)
{
    if (p->is_decoding)
        pthread_join(p->decoding, NULL);
    p->is_decoding = 0;
}

/* `ahead.segment` holds the segment's first frame until it is decoded. */
static void begin_ahead(player *p, const saga_segment *seg)
{
    const uint32_t frame = seg->first_frame + seg->n_frames;

    if (frame >= p->info.n_frames)
        return;
    p->ahead.segment = frame;
    p->is_decoding = !pthread_create(&p->decoding, NULL, decode_ahead, p);
    if (!p->is_decoding)
        stop("no thread");
}

/* A decoded block is copied as it is: it has offsets, no pointers. */
static void copy(const player *p, block *to, const block *from)
{
    memcpy(to->work, from->work, p->info.work_nbytes);
    to->segment = from->segment;
}

/* Makes the splats of a frame in its block. */
static void prepare(player *p, uint32_t frame)
{
    block *const b = &p->shown[frame & 1];
    const block *const other = &p->shown[~frame & 1];
    saga_segment seg;

    check(saga_find(&seg, p->bytes, p->n, frame, 1));
    if (b->segment != seg.number && other->segment == seg.number) {
        copy(p, b, other);
    } else if (b->segment != seg.number) {
        finish_ahead(p);
        if (p->ahead.segment == seg.number)
            copy(p, b, &p->ahead);
        else
            decode(p, b, &seg);
        begin_ahead(p, &seg);
    }
    check(saga_view(b->dec, &p->camera, seg.t));
}

/* --- Pictures ------------------------------------------------------------ */

/* Takes bands of rows until none is left. */
static void *paint(void *arg)
{
    const painter *const me = arg;
    player *const p = me->player;
    const size_t line = 3u * p->camera.width;

    for (;;) {
        const int32_t y = atomic_fetch_add(&p->next_row, ROWS);
        const int32_t end = y + ROWS < p->camera.height ? y + ROWS
                                                        : p->camera.height;
        saga_picture picture = { p->rgb + line * (size_t)y, line, 0, 8 };
        saga_job job = { .y0 = y, .x1 = p->camera.width, .y1 = end,
                         .tile = 16, .list_capacity = LIST,
                         .scratch = me->scratch };
        saga_status s;

        if (y >= end)
            return NULL;
        picture.nbytes = line * (size_t)(end - y);
        job.scratch_nbytes = SAGA_JOB_NBYTES(16, LIST) +
                             16u * ROWS * (p->camera.width + 16u);
        do
            s = saga_draw(p->dec, &job, &picture, BUDGET);
        while (s == SAGA_AGAIN);
        check(s);
    }
}

/* All threads draw `frame`; this one prepares the next before it helps. */
static void draw(player *p, uint32_t frame, int has_next)
{
    uint32_t i;

    p->dec = p->shown[frame & 1].dec;
    atomic_store(&p->next_row, 0);
    for (i = 1; i < p->n_threads; i++)
        if (pthread_create(&p->painters[i].thread, NULL, paint,
                           &p->painters[i]))
            stop("no thread");
    if (has_next)
        prepare(p, frame + 1);
    paint(&p->painters[0]);
    for (i = 1; i < p->n_threads; i++)
        pthread_join(p->painters[i].thread, NULL);
}

static void open_player(player *p, const char *path, uint32_t camera)
{
    uint32_t number, i;

    read_file(p, path);
    check(saga_probe(&p->info, p->bytes, p->n));
    check(saga_rig(&p->camera, &number, p->bytes, p->n, camera));
    open_block(p, &p->shown[0]);
    open_block(p, &p->shown[1]);
    open_block(p, &p->ahead);
    p->rgb = need(3u * p->camera.width * (size_t)p->camera.height);
    for (i = 0; i < p->n_threads; i++) {
        p->painters[i].player = p;
        p->painters[i].scratch = need(SAGA_JOB_NBYTES(16, LIST) + 16u * ROWS *
                                      (p->camera.width + 16u));
    }
}

/* Takes --seconds S from the front; returns how many arguments that is. */
static int take_seconds(player *p, int argc, char **argv)
{
    char *end;

    if (argc < 3 || strcmp(argv[1], "--seconds"))
        return 0;
    p->seconds = strtod(argv[2], &end);
    if (*end || !(p->seconds > 0 && p->seconds <= 1e9))
        stop("give --seconds a number above 0");
    return 2;
}

int main(int argc, char **argv)
{
    static player p;
    uint32_t n, i;
    double wall, cpu;
    const int n_taken = take_seconds(&p, argc, argv);

    argc -= n_taken;
    argv += n_taken;
    p.n_threads = argc > 2 ? (uint32_t)strtoul(argv[2], NULL, 10) : 1;
    if (argc < 2 || p.n_threads < 1 || p.n_threads > MAX_THREADS)
        stop("usage: saga-play [--seconds S] FILE "
             "[THREADS [CAMERA [PICTURES]]]");
    open_player(&p, argv[1],
                argc > 3 ? (uint32_t)strtoul(argv[3], NULL, 10) : 0);
    n = argc > 4 ? (uint32_t)strtoul(argv[4], NULL, 10) : p.info.n_frames;
    if (n > p.info.n_frames)
        n = p.info.n_frames;
    prepare(&p, 0);
    wall = ms_of(CLOCK_MONOTONIC);
    cpu = ms_of(CLOCK_PROCESS_CPUTIME_ID);
    for (i = 0; i < n; i++) {
        draw(&p, i, i + 1 < n);
        printf("%u %08x\n", i,
               saga_crc32c(0, p.rgb, 3u * p.camera.width *
                           (size_t)p.camera.height));
    }
    finish_ahead(&p);
    wall = ms_of(CLOCK_MONOTONIC) - wall;
    cpu = ms_of(CLOCK_PROCESS_CPUTIME_ID) - cpu;
    fprintf(stderr, "%u pictures of %ux%u, %u threads: %.2f ms each, "
            "%.2f of CPU\n", n, p.camera.width, p.camera.height, p.n_threads,
            n ? wall / n : 0, n ? cpu / n : 0);
    return 0;
}
