/* SPDX-License-Identifier: MIT
 *
 * check_vectors --init FILE...: checks that the decoder's output depends only
 * on a file's bytes and not on uninitialised memory. Each file is played twice,
 * on every path of this machine (plain C, 128 bits, AVX2). Before every call,
 * the stack below it, and everything in work block, scratch, pictures and
 * results that the decoder has not written, is filled: with zeros in one run,
 * with PAINT in the other. Statuses, results, pixels and the number of calls
 * that a job takes must be the same. Prints `N passed, N failed`, where each
 * file counts once on each path.
 *
 * With MemorySanitizer nothing is filled. Instead, everything that the decoder
 * has not written is poisoned, and all output is checked. Like check_vectors
 * this is plain C, because MemorySanitizer would need a test library built with
 * it.
 */
#include "check_init.h"

#include "freed.h"
#include "head.h"
#include "plan.h"
#include "reconstruct.h"
#include "saga.h"

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#if defined __has_feature
#if __has_feature(memory_sanitizer)
#define POISONED
#include <sanitizer/msan_interface.h>
#endif
#endif

/* DECODER_NBYTES is the size of the decoder at the start of the work block
 * (work_block.h). STACK_NBYTES is more than twice the stack of any public
 * function. The other numbers limit how much of a file is played. */
enum {
    PAINT = 0xb5,
    STACK_NBYTES = 8192,
    DECODER_NBYTES = 768,
    MAX_WORK = 32 << 20,
    MAX_SEGMENTS = 3,
    MAX_CAMERAS = 2,
    MAX_TAPS = 100,
    WIDTH = 50,
    HEIGHT = 38
};
#define MAX_MACS 100000000u

static saga_cpu path;

static void *must(void *p)
{
    if (!p) {
        fprintf(stderr, "check_vectors: out of memory\n");
        exit(2);
    }
    return p;
}

/* --- What came out ------------------------------------------------------- */

typedef struct {
    const char *what;
    uint32_t value;
} entry;

/* A run over a file, and its output. */
typedef struct {
    const uint8_t *bytes;
    size_t n;
    uint8_t colour;
    entry *log;
    size_t n_log, cap_log;
    saga_header header;
    saga_plan plan;
    saga_info info;
    uint8_t *work;
    saga_decoder *dec;
} player;

static void note(player *p, const char *what, uint32_t value)
{
    if (p->n_log == p->cap_log) {
        p->cap_log = 2 * p->cap_log + 256;
        p->log = must(realloc(p->log, p->cap_log * sizeof *p->log));
    }
    p->log[p->n_log].what = what;
    p->log[p->n_log++].value = value;
}

/* Notes n bytes of output, which have no padding. */
static void note_bytes(player *p, const char *what, const void *bytes, size_t n)
{
#ifdef POISONED
    __msan_check_mem_is_initialized(bytes, n);
#endif
    note(p, what, saga_crc32c(0, bytes, n));
}

static saga_status note_status(player *p, const char *what, saga_status s)
{
#ifdef POISONED
    __msan_check_mem_is_initialized(&s, sizeof s);
#endif
    note(p, what, (uint32_t)s);
    return s;
}

/* --- Paint --------------------------------------------------------------- */

static void paint(const player *p, void *at, size_t n)
{
#ifdef POISONED
    (void)p;
    __msan_poison(at, n);
#else
    memset(at, p->colour, n);
#endif
}

/* Fills the part of the stack that the next called function uses. */
static __attribute__((noinline)) void paint_stack(const player *p)
{
#ifdef POISONED
    (void)p;
#else
    uint64_t deep[STACK_NBYTES / 8];
    const uint64_t eight = p->colour * UINT64_C(0x0101010101010101);

    for (size_t i = 0; i < STACK_NBYTES / 8; i++)
        deep[i] = eight;
    __asm__ volatile("" : : "r"(deep) : "memory");
#endif
}

/* Paints stack and *out before a call that fills *out. */
static void prepare(const player *p, void *out, size_t n)
{
    paint(p, out, n);
    paint_stack(p);
}

static void paint_work(const player *p, size_t begin, size_t end)
{
    paint(p, p->work + begin, end - begin);
}

/* Paints everything in the work block that a new segment may not rely on: all
 * except the decoder, the networks and the primitives of the base. */
static void forget_segment(const player *p)
{
    const size_t base = p->header.base.prim;
    const saga_plan *const plan = &p->plan;
    saga_prim_format format;

    saga_prim_format_of(&format, &p->header.model);
    paint_work(p, plan->models_at, plan->vectors_at);
    paint_work(p, plan->class_models_at, plan->prims_at);
    paint_work(p, plan->prims_at + base * format.nbytes, plan->colours_at);
    paint_work(p, plan->colours_at + 2 * base * plan->colour_stride,
               plan->work_nbytes);
}

/* Paints the anchors, which are no longer needed before a view. */
static void forget_anchors(const player *p)
{
    paint_work(p, p->plan.splats_at, p->plan.work_nbytes);
}

/* --- Pictures ------------------------------------------------------------ */

typedef struct {
    int32_t tile;
    uint32_t list, n_scratch, budget;
    int bits;
} division;

static size_t sample_nbytes(int bits)
{
    return bits == SAGA_DEPTH ? sizeof(saga_depth) : bits == 16 ? 6 : 3;
}

/* Draws a part of the picture, from its middle on. */
static void draw(player *p, const saga_camera *c, const division *d)
{
    static _Alignas(8) uint8_t pixels[WIDTH * HEIGHT * sizeof(saga_depth)];
    const size_t n = SAGA_JOB_NBYTES(d->tile, d->list) * d->n_scratch;
    uint8_t *const scratch = must(malloc(n));
    saga_job job = { .x0 = c->width / 3,
                     .y0 = c->height / 3,
                     .tile = d->tile,
                     .list_capacity = d->list,
                     .scratch = scratch,
                     .scratch_nbytes = n };
    saga_picture picture = { .rgb = pixels, .bits = d->bits };
    uint32_t n_calls = 0;
    saga_status s;

    job.x1 = c->width - job.x0 > WIDTH ? job.x0 + WIDTH : c->width;
    job.y1 = c->height - job.y0 > HEIGHT ? job.y0 + HEIGHT : c->height;
    picture.stride_nbytes = (size_t)(job.x1 - job.x0) * sample_nbytes(d->bits);
    picture.nbytes = picture.stride_nbytes * (size_t)(job.y1 - job.y0);
    paint(p, scratch, n);
    paint(p, pixels, picture.nbytes);
    do {
        paint_stack(p);
        s = saga_draw(p->dec, &job, &picture, d->budget);
        n_calls++;
    } while (s == SAGA_AGAIN);
    note_status(p, "status of drawing", s);
    note(p, "number of calls", n_calls);
    if (s == SAGA_OK)
        note_bytes(p, "pixels", pixels, picture.nbytes);
    free(scratch);
}

/* Returns a stride with which at most MAX_TAPS of n things are visited. */
static uint32_t stride_of(uint32_t n)
{
    return n / MAX_TAPS + 1;
}

static void note_splats(player *p)
{
    saga_report report;
    saga_splat s;

    prepare(p, &report, sizeof report);
    note_status(p, "status of telling", saga_tell(&report, p->dec));
    note_bytes(p, "report", &report, sizeof report);
    for (uint32_t i = 0; i < report.n_splats; i += stride_of(report.n_splats)) {
        prepare(p, &s, sizeof s);
        note_status(p, "status of a splat", saga_splat_at(&s, p->dec, i));
        note_bytes(p, "splat", &s, offsetof(saga_splat, y1) + sizeof s.y1);
    }
}

static void look(player *p, const saga_camera *c, int32_t t)
{
    static const division divisions[] = { { 8, 7, 1, 97, 8 },
                                          { 16, 300, 4, 1000, 16 },
                                          { 32, 60, 2, 333, SAGA_DEPTH },
                                          { 64, 5000, 1, 1u << 30, 8 } };

    forget_anchors(p);
    paint_stack(p);
    if (note_status(p, "status of a view", saga_view(p->dec, c, t)))
        return;
    note_splats(p);
    for (uint32_t i = 0; i < sizeof divisions / sizeof *divisions; i++)
        draw(p, c, &divisions[i]);
}

/* The camera for a file without one, or with one that no view accepts. */
static const saga_camera plain_camera = {
    .rotation_q30 = { 1 << 30, 0, 0, 0, 1 << 30, 0, 0, 0, 1 << 30 },
    .centre = { 0, 0, -(1 << 24) },
    .focal_q16 = { 100 << 16, 100 << 16 },
    .principal_q16 = { 48 << 16, 32 << 16 },
    .near_plane = 1,
    .width = 96,
    .height = 64,
    .background_q15 = { 1, 2, 32768 }
};

static void look_around(player *p)
{
    static const int32_t times[] = { 0, 40000, 65535 };
    saga_camera c;
    uint32_t number;

    for (uint32_t i = 0; i < MAX_CAMERAS && i < p->info.n_cameras; i++) {
        prepare(p, &c, sizeof c);
        paint(p, &number, sizeof number);
        note_status(p, "status of the rig",
                    saga_rig(&c, &number, p->bytes, p->n, i));
        note_bytes(p, "camera", &c,
                   offsetof(saga_camera, background_q15) +
                       sizeof c.background_q15);
        note_bytes(p, "number of a camera", &number, sizeof number);
        look(p, &c, times[i]);
    }
    look(p, &plain_camera, times[2]);
}

/* --- Files --------------------------------------------------------------- */

static void note_primitives(player *p)
{
    const uint32_t all = p->info.base_primitives + p->info.max_primitives;
    uint16_t colour[3];
    saga_animated a;

    for (uint32_t i = 0; i <= all; i += stride_of(all)) {
        prepare(p, &a, sizeof a);
        if (!note_status(p, "status of a primitive",
                         saga_primitive_at(&a, p->dec, i, 50000)))
            note_bytes(p, "primitive", &a, sizeof a);
        prepare(p, colour, sizeof colour);
        if (!note_status(
                p, "status of a colour",
                saga_colour_at(colour, p->dec, i, plain_camera.centre)))
            note_bytes(p, "colour", colour, sizeof colour);
    }
}

static void note_layers(player *p, const saga_segment *seg,
                        const uint8_t *bytes, size_t n)
{
    saga_layer_report layer;

    for (uint32_t i = 0; i <= p->info.n_layers; i++) {
        prepare(p, &layer, sizeof layer);
        if (!note_status(p, "status of a layer",
                         saga_find_layer(&layer, p->dec, seg, bytes, n, i)))
            note_bytes(p, "layer", &layer, sizeof layer);
    }
}

static saga_status decode(player *p, const saga_segment *seg,
                          const uint8_t *bytes, size_t n)
{
    forget_segment(p);
    paint_stack(p);
    return note_status(p, "status of a segment",
                       saga_decode(p->dec, seg, bytes, n, NULL));
}

/* Plays the available bytes of a segment, and one byte less. */
static void play_segment(player *p, const saga_segment *seg)
{
    const size_t left = p->n - (size_t)seg->offset;
    const size_t n = seg->nbytes < left ? seg->nbytes : left;
    const uint8_t *const bytes = p->bytes + seg->offset;

    note_layers(p, seg, bytes, n);
    if (n > 0)
        decode(p, seg, bytes, n - 1);
    note_primitives(p);
    if (decode(p, seg, bytes, n))
        return;
    note_primitives(p);
    look_around(p);
}

static void play_segments(player *p)
{
    uint32_t frame = 0;

    for (uint32_t i = 0; i < MAX_SEGMENTS && i < p->info.n_segments; i++) {
        saga_segment seg;

        prepare(p, &seg, sizeof seg);
        if (note_status(p, "status of finding",
                        saga_find(&seg, p->bytes, p->n, frame, 1)))
            return;
        note_bytes(p, "segment", &seg,
                   offsetof(saga_segment, n_frames) + sizeof seg.n_frames);
        note_bytes(p, "place of a segment", &seg.offset,
                   offsetof(saga_segment, t) + sizeof seg.t -
                       offsetof(saga_segment, offset));
        if (seg.offset > p->n)
            return;
        play_segment(p, &seg);
        frame = seg.first_frame + seg.n_frames;
    }
}

static void note_names(player *p)
{
    saga_naming naming;

    for (uint32_t i = 0; i <= p->info.n_cameras;
         i += stride_of(p->info.n_cameras)) {
        prepare(p, &naming, sizeof naming);
        if (!note_status(p, "status of a name",
                         saga_name_camera(&naming, p->bytes, p->n, i)))
            note_bytes(p, "name", &naming, sizeof naming);
    }
}

static void note_info(player *p)
{
    const saga_info *const i = &p->info;

    note_bytes(p, "version and level", &i->version, 8);
    note_bytes(p, "sizes", &i->work_nbytes, 2 * sizeof(size_t));
    note_bytes(p, "counts", &i->n_segments,
               offsetof(saga_info, features) + sizeof i->features -
                   offsetof(saga_info, n_segments));
    note_bytes(p, "work", &i->decode_macs,
               offsetof(saga_info, view_macs) + sizeof i->view_macs -
                   offsetof(saga_info, decode_macs));
    note_bytes(p, "unit", &i->unit_mantissa,
               offsetof(saga_info, centre_exponent) + sizeof(int32_t) -
                   offsetof(saga_info, unit_mantissa));
}

static void play(player *p)
{
    prepare(p, &p->info, sizeof p->info);
    if (note_status(p, "status of the head",
                    saga_probe(&p->info, p->bytes, p->n)))
        return;
    note_info(p);
    note_names(p);
    if (p->info.work_nbytes > MAX_WORK ||
        p->info.decode_macs + p->info.base_macs > MAX_MACS ||
        saga_head_read(&p->header, p->bytes, p->n) ||
        saga_plan_make(&p->plan, &p->header, DECODER_NBYTES))
        return;
    p->work = must(aligned_alloc(SAGA_WORK_ALIGN, p->info.work_nbytes));
    prepare(p, p->work, p->info.work_nbytes);
    if (!note_status(p, "status of opening",
                     saga_open(&p->dec, p->work, p->info.work_nbytes, p->bytes,
                               p->n, NULL)))
        play_segments(p);
    free(p->work);
}

/* --- Runs ---------------------------------------------------------------- */

static const char *const path_text[] = { "plain", "128 bits", "AVX2" };

/* Compares two runs and prints the first difference. */
static int is_same(const char *name, const player *a, const player *b)
{
    size_t i = 0;

    while (i < a->n_log && i < b->n_log && a->log[i].value == b->log[i].value)
        i++;
    if (i == a->n_log && i == b->n_log)
        return 1;
    if (i < a->n_log && i < b->n_log)
        printf("FAIL %s, %s: result %zu, %s: %08" PRIx32 " and %08" PRIx32 "\n",
               name, path_text[path], i, a->log[i].what, a->log[i].value,
               b->log[i].value);
    else
        printf("FAIL %s, %s: %zu and %zu results\n", name, path_text[path],
               a->n_log, b->n_log);
    return 0;
}

static int check(const char *name, const uint8_t *bytes, size_t n)
{
    player zero = { .bytes = bytes, .n = n, .colour = 0 };
    player paint = { .bytes = bytes, .n = n, .colour = PAINT };
    int ok = 1;

#ifdef POISONED
    printf("%s, %s\n", name, path_text[path]);
    fflush(stdout); /* the sanitizer ends the program */
#else
    play(&paint);
#endif
    play(&zero);
    if (paint.n_log > 0)
        ok = is_same(name, &zero, &paint);
    free(zero.log);
    free(paint.log);
    return ok;
}

/* Returns the file's bytes in memory of exact size, or NULL. */
static uint8_t *read_file(const char *name, size_t *n)
{
    FILE *const f = fopen(name, "rb");
    uint8_t *p;
    long size;

    if (!f)
        return NULL;
    fseek(f, 0, SEEK_END);
    size = ftell(f);
    fseek(f, 0, SEEK_SET);
    p = must(malloc(size > 0 ? (size_t)size : 1));
    *n = fread(p, 1, (size_t)size, f);
    fclose(f);
    return p;
}

int check_init(saga_cpu *chosen, saga_cpu best, char *const *files, int n_files)
{
    int n_passed = 0, n_failed = 0;

    for (int i = 0; i < n_files; i++) {
        size_t n = 0;
        FREED uint8_t *const bytes = read_file(files[i], &n);

        if (!bytes) {
            printf("FAIL %s: cannot be read\n", files[i]);
            n_failed++;
            continue;
        }
        for (path = SAGA_CPU_PLAIN; path <= best; path++) {
            *chosen = path;
            if (check(files[i], bytes, n))
                n_passed++;
            else
                n_failed++;
        }
    }
    printf("%d passed, %d failed\n", n_passed, n_failed);
    return n_failed != 0 || n_passed == 0;
}
