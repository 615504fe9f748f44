/* SPDX-License-Identifier: MIT
 *
 * A pass on the device: primitives become splats, which are sorted by depth and
 * listed for each tile; tiles are drawn, compared and differentiated; records
 * are added and taken back to the primitives. The kernels in kernels/ do the
 * work, and this file their order.
 */
#include "gpu_state.h"

#include "alloc.h"
#include "splat_tiles.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* Pairs of splats and tiles for which a canvas has room at first: for each
 * primitive, and as many more; and for each tile in a plan. 10,000 primitives
 * had 3 each; fewer are larger, and 2,000 had 123 on a tile. */
enum { FIRST_PAIRS = 8, MORE_PAIRS = 1 << 16, PLAN_PAIRS = 160 };

static const char what[] = "primitives";

/* --- A canvas ------------------------------------------------------------ */

saga_gpu_canvas *saga_gpu_canvas_new(saga_gpu *gpu,
                                     const saga_pictures *pictures,
                                     saga_error *error)
{
    saga_gpu_canvas *const g = saga_calloc(1, sizeof *g, "the GPU", error);

    if (!g)
        return NULL;
    g->gpu = gpu;
    g->pictures = pictures;
    if (saga_gpu_alloc(&g->up_frame, gpu, sizeof g->frame, SAGA_GPU_UP, what,
                       error) &&
        saga_gpu_room(g, GPU_FRAME, sizeof g->frame, what, error) &&
        saga_gpu_room(g, GPU_TOTAL, SAGA_GPU_N_TOTALS * sizeof(uint32_t), what,
                      error) &&
        saga_gpu_begin_pictures(g, error))
        return g;
    saga_gpu_canvas_free(g);
    return NULL;
}

void saga_gpu_canvas_free(saga_gpu_canvas *g)
{
    if (!g)
        return;
    saga_gpu_canvas_free(g->teachers);
    for (int k = 0; k < SAGA_NOVEL_MOST_TEACHERS; k++)
        saga_gpu_free(&g->teacher[k], g->gpu);
    saga_gpu_end_pictures(g);
    for (int b = 0; b < GPU_N_BUFFERS; b++)
        saga_gpu_free(&g->on[b], g->gpu);
    saga_gpu_free(&g->up_frame, g->gpu);
    saga_gpu_free(&g->up, g->gpu);
    saga_gpu_free(&g->up_back, g->gpu);
    saga_gpu_free(&g->up_picture, g->gpu);
    saga_gpu_free(&g->down, g->gpu);
    free(g);
}

/* Returns the bytes of the backdrop's attributes. */
static size_t back_nbytes(const saga_gpu_frame *f)
{
    return sizeof(real) * saga_attrs_width(f->back_attrs) * (f->n - f->n_own);
}

/* Makes room for a pass with the frame that is set. */
static bool make_room(saga_gpu_canvas *g, saga_error *error)
{
    const saga_gpu_frame *const f = &g->frame;
    const size_t back = back_nbytes(f);
    const size_t n = f->n, own = f->n_own, p = g->most_pairs;
    const size_t tiles = (size_t)f->n_tiles_x * f->n_tiles_y;
    const size_t blocks = saga_n_parts(n > p ? n : p, SAGA_GPU_BLOCK);
    const size_t counts = SAGA_GPU_DIGITS * blocks;
    const saga_gpu_need need[] = {
        { GPU_GRAD, GPU_GRAD, saga_attrs_width(f->attrs) * own },
        { GPU_BACK, GPU_BACK, back / sizeof(real) + 1 },
        { GPU_STAT, GPU_STAT, 3 * own },
        { GPU_D_Q0, GPU_D_Q0, own },
        { GPU_CARRY, GPU_CARRY, 5 * own },
        { GPU_SIZES, GPU_SIZES, saga_gpu_groups(own) },
        { GPU_SPLAT, GPU_SPLAT, 12 * n },
        { GPU_COUNT, GPU_ORDER_2, n },
        { GPU_TILE, GPU_OWNER, p },
        { GPU_RECORD, GPU_RECORD, SAGA_N_SUMS * p },
        { GPU_DIGITS, GPU_DIGITS, counts },
        /* The sums of a scan over counts or primitives, and their sum. */
        { GPU_SUMS, GPU_SUMS,
          saga_n_parts(counts > n ? counts : n, SAGA_GPU_BLOCK) + 1 },
        { GPU_RANGE, GPU_RANGE, 2 * tiles },
        { GPU_SQUARES, GPU_SQUARES, tiles }
    };

    return SAGA_GPU_ROOMS(g, need, what, error) &&
           (back == 0 || saga_gpu_grow(&g->up_back, g->gpu, back, SAGA_GPU_UP,
                                       "still primitives", error));
}

static uint32_t first_pairs(const saga_gpu_frame *f)
{
    return MORE_PAIRS + FIRST_PAIRS * f->n;
}

/* --- The host's arrays --------------------------------------------------- */

void saga_gpu_pack(real *block, const saga_splat_params *p, size_t n)
{
    saga_splat_params to;

    saga_params_lay(&to, block, saga_attrs_of(p), n);
    saga_params_copy(&to, p, n);
}

/* Sets at[a] to the begin of each attribute in a block of n primitives. */
static void find_attributes(uint32_t at[SAGA_N_ATTRS], uint32_t attrs,
                            uint32_t n)
{
    uint32_t sum = 0;

    for (int a = 0; a < SAGA_N_ATTRS; a++) {
        at[a] = sum;
        if (attrs & SAGA_ATTR_BIT(a))
            sum += n * (uint32_t)saga_attributes[a].width;
    }
}

/* --- The frame ----------------------------------------------------------- */

static void copy_reals(float *to, const real *from, int n)
{
    for (int i = 0; i < n; i++)
        to[i] = (float)from[i];
}

static void set_camera(saga_gpu_frame *f, const saga_canvas *c)
{
    const saga_splat_camera *const cam = &c->camera;
    const saga_splat_rules *const r = &c->rules;

    copy_reals(f->rotation, cam->rotation, 9);
    copy_reals(f->centre, cam->centre, 3);
    copy_reals(f->focal, cam->focal, 2);
    copy_reals(f->principal, cam->principal, 2);
    copy_reals(f->background, cam->background, 3);
    f->near_plane = (float)cam->near_plane;
    f->t = (float)c->t;
    f->cut = (float)r->cut;
    f->alpha_cap = (float)r->alpha_cap;
    /* Pixels outside the picture stay below the floor even if that is 0. */
    f->t_floor = r->t_floor > 0 ? (float)r->t_floor : 1e-37f;
    f->low_pass = (float)r->low_pass;
    f->square = (float)r->square;
    f->detach_time = (uint32_t)r->detach_time;
    f->order = (uint32_t)r->order;
    f->width = (uint32_t)cam->width;
    f->height = (uint32_t)cam->height;
    f->n_tiles_x = (uint32_t)saga_n_parts(f->width, SAGA_SPLAT_TILE);
    f->n_tiles_y = (uint32_t)saga_n_parts(f->height, SAGA_SPLAT_TILE);
    f->n_by_ln_2 = (float)(3.0 * f->width * f->height / 0.69314718055994531);
    f->n_seen = (float)saga_canvas_n_seen(c);
}

void saga_gpu_set_frame(saga_gpu_canvas *g, const saga_canvas *c,
                        uint32_t attrs, uint32_t n)
{
    saga_gpu_frame *const f = &g->frame;

    set_camera(f, c);
    f->n_own = n;
    f->n = n + c->n_still;
    f->attrs = attrs;
    f->back_attrs = c->n_still ? saga_attrs_of(c->still) : 0;
    f->draws = 0;
    find_attributes(f->attr_at, f->attrs, n);
    find_attributes(f->back_at, f->back_attrs, c->n_still);
    for (int a = 0; a < SAGA_N_ATTRS; a++)
        f->attr_width[a] = (uint32_t)saga_attributes[a].width;
}

/* --- Recording ----------------------------------------------------------- */

/* Sums n numbers of buffer `from` into buffer `to`: exclusive sums. With
 * is_listed, number k is from[order[k]]. Returns the number of blocks, after
 * which GPU_SUMS has the sum of all. */
static uint32_t scan(saga_gpu_canvas *g, int from, int to, uint32_t n,
                     uint32_t is_listed)
{
    const uint32_t blocks = (uint32_t)saga_n_parts(n, SAGA_GPU_BLOCK);

    saga_gpu_do_with(g, SAGA_KERNEL_SCAN, blocks,
                     (int[]){ GPU_FRAME, from, GPU_ORDER, to, GPU_SUMS, -1 },
                     (uint32_t[]){ n, is_listed }, 2);
    saga_gpu_do_with(g, SAGA_KERNEL_SCAN_TOP, 1,
                     (int[]){ GPU_FRAME, GPU_SUMS, -1 }, &blocks, 1);
    saga_gpu_do_with(g, SAGA_KERNEL_SCAN_ADD, blocks,
                     (int[]){ GPU_FRAME, to, GPU_SUMS, -1 }, &n, 1);
    return blocks;
}

/* Sorts keys with their values by the lowest `bits` bits; the number of digits
 * is even, so that the result is in the first of each pair of buffers. `n` is
 * the number of keys, or 0 if the device knows it; `room` is the most. */
static void sort(saga_gpu_canvas *g, int key, int value, uint32_t n,
                 uint32_t room, uint32_t bits)
{
    const uint32_t blocks = (uint32_t)saga_n_parts(room, SAGA_GPU_BLOCK);
    const uint32_t n_digits = (bits + 2 * SAGA_GPU_DIGIT_BITS - 1) /
                              (2 * SAGA_GPU_DIGIT_BITS) * 2;

    for (uint32_t d = 0; d < n_digits; d++) {
        const int k = key + (int)(d & 1), v = value + (int)(d & 1);
        const int to_k = key + (int)(~d & 1), to_v = value + (int)(~d & 1);
        const uint32_t push[] = { n, blocks, SAGA_GPU_DIGIT_BITS * d };

        saga_gpu_do_with(g, SAGA_KERNEL_SORT_COUNT, blocks,
                         (int[]){ GPU_FRAME, GPU_TOTAL, k, GPU_DIGITS, -1 },
                         push, 3);
        scan(g, GPU_DIGITS, GPU_DIGITS, SAGA_GPU_DIGITS * blocks, 0);
        saga_gpu_do_with(
            g, SAGA_KERNEL_SORT_MOVE, blocks,
            (int[]){ GPU_FRAME, GPU_TOTAL, k, v, GPU_DIGITS, to_k, to_v, -1 },
            push, 3);
    }
}

static uint32_t bits_of(uint32_t most)
{
    uint32_t bits = 1;

    while (most >> bits)
        bits++;
    return bits;
}

/* Makes the lists of the tiles. */
void saga_gpu_record_lists(saga_gpu_canvas *g)
{
    const saga_gpu_frame *const f = &g->frame;
    const uint32_t n_tiles = f->n_tiles_x * f->n_tiles_y;
    uint32_t blocks;

    saga_gpu_do(g, SAGA_KERNEL_PROJECT, saga_gpu_groups(f->n),
                (int[]){ GPU_FRAME, GPU_VALUE, GPU_BACK, GPU_SPLAT, GPU_DEPTH,
                         GPU_ORDER, GPU_COUNT, -1 });
    sort(g, GPU_DEPTH, GPU_ORDER, f->n, f->n, 31);
    /* Pairs are numbered by depth, and then sorted by tile, which keeps their
     * order in each tile. */
    blocks = scan(g, GPU_COUNT, GPU_OFFSET, f->n, 1);
    saga_gpu_do_with(g, SAGA_KERNEL_PLAN, 1,
                     (int[]){ GPU_FRAME, GPU_SUMS, GPU_TOTAL, -1 }, &blocks, 1);
    saga_gpu_do(g, SAGA_KERNEL_EXPAND, saga_gpu_groups(f->n),
                (int[]){ GPU_FRAME, GPU_TOTAL, GPU_ORDER, GPU_OFFSET, GPU_COUNT,
                         GPU_SPLAT, GPU_TILE, GPU_SLOT, GPU_OWNER, GPU_RECORD,
                         -1 });
    sort(g, GPU_TILE, GPU_SLOT, 0, f->most_pairs, bits_of(n_tiles));
    saga_gpu_clear(g, GPU_RANGE, 2 * (size_t)n_tiles);
    saga_gpu_do(g, SAGA_KERNEL_RANGES,
                saga_n_parts(f->most_pairs, SAGA_GPU_BLOCK),
                (int[]){ GPU_FRAME, GPU_TOTAL, GPU_TILE, GPU_RANGE, -1 });
}

void saga_gpu_record_tiles(saga_gpu_canvas *g)
{
    saga_gpu_do(g, SAGA_KERNEL_TILES,
                (size_t)g->frame.n_tiles_x * g->frame.n_tiles_y,
                (int[]){ GPU_FRAME, GPU_RANGE, GPU_SLOT, GPU_OWNER, GPU_SPLAT,
                         GPU_TRUTH, GPU_RECORD, GPU_SQUARES, GPU_IMAGE, -1 });
}

void saga_gpu_record_back(saga_gpu_canvas *g)
{
    saga_gpu_do(g, SAGA_KERNEL_BACK, saga_gpu_groups(g->frame.n_own),
                (int[]){ GPU_FRAME, GPU_TOTAL, GPU_VALUE, GPU_SPLAT, GPU_COUNT,
                         GPU_RECORD, GPU_GRAD, GPU_STAT, GPU_D_Q0, -1 });
}

void saga_gpu_record_sums(saga_gpu_canvas *g, uint32_t n_sizes)
{
    saga_gpu_do_with(
        g, SAGA_KERNEL_SUMS, 1,
        (int[]){ GPU_FRAME, GPU_TOTAL, GPU_SQUARES, GPU_SIZES, -1 }, &n_sizes,
        1);
}

bool saga_gpu_begin_pass(saga_gpu_pass *p, saga_gpu_canvas *g,
                         saga_error *error)
{
    saga_gpu_frame *const f = &g->frame;
    const size_t back = back_nbytes(f);

    if (p->is_over)
        return false;
    if (g->most_pairs == 0)
        g->most_pairs = first_pairs(f);
    f->most_pairs = g->most_pairs;
    if (!make_room(g, error))
        return false;
    /* What the host sends. */
    if (back)
        saga_gpu_pack(g->up_back.map, p->canvas->still, p->canvas->n_still);
    memcpy(g->up_frame.map, f, sizeof *f);
    saga_gpu_begin(g->gpu);
    saga_gpu_copy(g->gpu, &g->on[GPU_FRAME], 0, &g->up_frame, 0, sizeof *f);
    saga_gpu_copy(g->gpu, &g->on[GPU_VALUE], 0, g->from, 0, g->n_from);
    saga_gpu_copy(g->gpu, &g->on[GPU_BACK], 0, &g->up_back, 0, back);
    p->n_runs++;
    return true;
}

void saga_gpu_end_pass(saga_gpu_pass *p, saga_gpu_canvas *g, saga_error *error)
{
    const uint32_t *const total = g->down.map;

    saga_gpu_copy(g->gpu, &g->down, 0, &g->on[GPU_TOTAL], 0,
                  SAGA_GPU_N_TOTALS * sizeof(uint32_t));
    p->is_over = true;
    if (!saga_gpu_finish(g->gpu, error))
        return;
    p->is_over = p->is_done = !total[SAGA_GPU_IS_FULL];
    if (!p->is_done)
        g->most_pairs = total[SAGA_GPU_WANTED] + total[SAGA_GPU_WANTED] / 4;
}

double saga_gpu_mse(const saga_gpu_canvas *g, const saga_canvas *c)
{
    const uint32_t *const total = g->down.map;

    return (double)saga_gpu_float(total[SAGA_GPU_SQUARES]) /
           saga_canvas_n_seen(c);
}

/* --- Passes over the host's primitives ----------------------------------- */

/* Makes room for the ways of n primitives up and of `down` bytes, after the
 * totals, down. */
static bool ways_room(saga_gpu_canvas *g, uint32_t attrs, uint32_t n,
                      size_t down, saga_error *error)
{
    const size_t nbytes = saga_attrs_width(attrs) * n * sizeof(real);

    return saga_gpu_room(g, GPU_VALUE, nbytes, what, error) &&
           saga_gpu_grow(&g->up, g->gpu, nbytes, SAGA_GPU_UP, what, error) &&
           saga_gpu_grow(&g->down, g->gpu,
                         SAGA_GPU_N_TOTALS * sizeof(uint32_t) + down,
                         SAGA_GPU_DOWN, what, error);
}

/* Sets the frame for the host's primitives, which a pass sends first. */
static bool send_primitives(saga_gpu_canvas *g, const saga_canvas *c,
                            const saga_splat_params *p, uint32_t n, size_t down,
                            saga_error *error)
{
    const uint32_t attrs = saga_attrs_of(p);

    saga_gpu_set_frame(g, c, attrs, n);
    g->n_set = 0;
    g->from = &g->up;
    g->n_from = saga_attrs_width(attrs) * n * sizeof(real);
    if (!ways_room(g, attrs, n, down, error))
        return false;
    saga_gpu_pack(g->up.map, p, n);
    return true;
}

const real *saga_gpu_after_totals(const saga_gpu_canvas *g)
{
    return (const real *)g->down.map + SAGA_GPU_N_TOTALS;
}

bool saga_gpu_draw(saga_gpu_canvas *g, saga_canvas *c,
                   const saga_splat_params *p, uint32_t n, saga_error *error)
{
    const size_t nbytes = 3 * (size_t)c->camera.width *
                          (size_t)c->camera.height * sizeof(real);
    saga_gpu_pass pass = { .canvas = c };

    if (!send_primitives(g, c, p, n, nbytes, error))
        return false;
    g->frame.draws = 1;
    while (saga_gpu_begin_pass(&pass, g, error)) {
        saga_gpu_record_lists(g);
        saga_gpu_record_tiles(g);
        saga_gpu_copy(g->gpu, &g->down, SAGA_GPU_N_TOTALS * sizeof(uint32_t),
                      &g->on[GPU_IMAGE], 0, nbytes);
        saga_gpu_end_pass(&pass, g, error);
    }
    if (pass.is_done)
        memcpy(c->image, saga_gpu_after_totals(g), nbytes);
    return pass.is_done;
}

static void record_learning(saga_gpu_canvas *g)
{
    const size_t n = g->frame.n_own, word = sizeof(uint32_t);
    const size_t grads = saga_attrs_width(g->frame.attrs) * n * word;
    const size_t at = SAGA_GPU_N_TOTALS * word;

    saga_gpu_record_lists(g);
    saga_gpu_record_truth(g);
    saga_gpu_record_tiles(g);
    saga_gpu_clear(g, GPU_STAT, 3 * n);
    saga_gpu_record_back(g);
    saga_gpu_record_sums(g, 0);
    saga_gpu_copy(g->gpu, &g->down, at, &g->on[GPU_GRAD], 0, grads);
    saga_gpu_copy(g->gpu, &g->down, at + grads, &g->on[GPU_STAT], 0,
                  3 * n * word);
}

/* Returns the bytes of gradients and statistics. */
static size_t learned_nbytes(uint32_t attrs, size_t n)
{
    return (saga_attrs_width(attrs) + 3) * n * sizeof(real);
}

/* Adds the gradients of a pass on the host. */
typedef struct {
    const saga_gpu_canvas *g;
    saga_splat_learning *l;
    const real *grad, *stat;
    size_t n;
} adding;

/* Primitives in one task, and nanoseconds for one. */
enum { PART = 1024, ADD_NS = 20 };

static void add_part(void *user, size_t part)
{
    const adding *const j = user;
    const saga_range of = saga_part(j->n, PART, part);
    const saga_splat_stats *const s = j->l->stats;

    /* Gradients, and then statistics, of which any may be missing. */
    for (int a = 0; a < SAGA_N_ATTRS; a++) {
        const size_t w = (size_t)saga_attributes[a].width;
        const real *const from = j->grad + j->g->frame.attr_at[a];
        real *const to = j->l->d.of[a];

        for (size_t i = w * of.begin;
             to && j->g->frame.attrs >> a & 1 && i < w * of.end; i++)
            to[i] += from[i];
    }
    for (size_t i = of.begin; s && i < of.end; i++) {
        if (s->grad2d)
            s->grad2d[i] += j->stat[3 * i];
        if (s->weight)
            s->weight[i] += j->stat[3 * i + 1];
        if (s->seen)
            s->seen[i] += (uint32_t)j->stat[3 * i + 2];
    }
}

bool saga_gpu_learn(saga_gpu_canvas *g, saga_splat_learning *l,
                    const saga_canvas *c, const saga_splat_params *p,
                    uint32_t n, saga_error *error)
{
    const size_t reals = saga_attrs_width(saga_attrs_of(p)) * n;
    const size_t down = learned_nbytes(saga_attrs_of(p), n);
    saga_gpu_pass pass = { .canvas = c };
    adding j = { .g = g, .l = l, .n = n };

    if (!send_primitives(g, c, p, n, down, error))
        return false;
    while (saga_gpu_begin_pass(&pass, g, error)) {
        record_learning(g);
        saga_gpu_end_pass(&pass, g, error);
    }
    if (!pass.is_done)
        return false;
    j.grad = saga_gpu_after_totals(g);
    j.stat = j.grad + reals;
    l->mse = saga_gpu_mse(g, c);
    saga_parallel(&(saga_tasks){ .run = add_part,
                                 .user = &j,
                                 .n = saga_n_parts(n, PART),
                                 .ns = (double)ADD_NS * n });
    return true;
}

/* --- Room ---------------------------------------------------------------- */

bool saga_gpu_pass_room(saga_gpu_canvas *g, const saga_canvas *c,
                        uint32_t attrs, uint32_t n, saga_error *error)
{
    const saga_gpu_frame *const f = &g->frame;
    uint32_t by_tiles, most;

    saga_gpu_set_frame(g, c, attrs, n);
    by_tiles = PLAN_PAIRS * f->n_tiles_x * f->n_tiles_y;
    most = first_pairs(f) > by_tiles ? first_pairs(f) : by_tiles;
    g->most_pairs = g->most_pairs > most ? g->most_pairs : most;
    return make_room(g, error);
}

bool saga_gpu_learn_room(saga_gpu_canvas *g, const saga_canvas *c,
                         uint32_t attrs, uint32_t n, saga_error *error)
{
    return ways_room(g, attrs, n, learned_nbytes(attrs, n), error) &&
           saga_gpu_pass_room(g, c, attrs, n, error);
}
