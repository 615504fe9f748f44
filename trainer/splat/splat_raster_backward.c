/* SPDX-License-Identifier: MIT
 *
 * The backward pass of a tile starts with its forward pass, and keeps alpha and
 * alpha T of the blocks that each splat touches. They stay in L2, as far as
 * there is room; for the remaining splats they are computed again. With b = g.c
 * (g = dL/dC) and T before the splat,
 *   D = g.(C_final - what splats up to and including this one gave),
 *   dL/dalpha = T b - D / (1 - alpha),   dL/dq = -ln 2 alpha dL/dalpha
 * (0 where alpha is capped), dL/ds = (1 + 2 square s) dL/dq.
 *
 * Sums over pixels are of dL/ds times powers of x and y from the tile's middle,
 * and are converted to those of the record at the end. If a tile is far from
 * the splat's mean, this avoids cancellation.
 */
#include "splat_raster.h"

#include "alloc.h"
#include "raster_tile.h"

#include <stdlib.h>
#include <string.h>

enum {
    KEPT = 2048,          /* blocks of a tile that are kept */
    LAST = KEPT + BLOCKS, /* room for the rest of the splat that fills them */
    KEPT_ALL = LAST + BLOCKS /* room for the blocks of the present splat too */
};

/* --- A splat ------------------------------------------------------------- */

/* Sums over the pixels of a tile: q of dL/dq / ln 2, and moments m of
 * dL/ds / ln 2. */
typedef struct {
    wide q, m00, m10, m01, m20, m11, m02;
    wide red, green, blue, weight;
} sums;

/* Writes a record. Its sums are of v = g dx - n dy and of dy from the splat's
 * mean; those of s are of (x, y) from the tile's middle, which is at d from the
 * mean. */
static void write_record(real *record, const sums *s, const saga_splat_2d *o,
                         const tile *t)
{
    const vec all[8] = { wide_fold(s->m00), wide_fold(s->m10),
                         wide_fold(s->m01), wide_fold(s->m20),
                         wide_fold(s->m11), wide_fold(s->m02),
                         wide_fold(s->red), wide_fold(s->green) };
    real m[8], d[2], v0, vx, vy;

    vec_sum8(m, all);
    vec_sum2(record + SAGA_SUM_B, wide_fold(s->blue), wide_fold(s->weight));
    /* With v = v0 + g x - n y and dy = d1 + y, the sums of v, v dx, v dy, dy
     * and dy^2 follow from the moments m00, m10, m01, m20, m11, m02 in m[0] to
     * m[5]. */
    to_middle(d, o, t);
    v0 = o->g * d[0] - o->n * d[1];
    vx = v0 * m[1] + o->g * m[3] - o->n * m[4];
    vy = v0 * m[2] + o->g * m[4] - o->n * m[5];
    record[SAGA_SUM_Q] = vec_sum(wide_fold(s->q));
    record[SAGA_SUM_V] = v0 * m[0] + o->g * m[1] - o->n * m[2];
    record[SAGA_SUM_VX] = vx + d[0] * record[SAGA_SUM_V];
    record[SAGA_SUM_VY] = vy + d[1] * record[SAGA_SUM_V];
    record[SAGA_SUM_Y] = m[2] + d[1] * m[0];
    record[SAGA_SUM_YY] = m[5] + d[1] * (2 * m[2] + d[1] * m[0]);
    record[SAGA_SUM_R] = m[6];
    record[SAGA_SUM_G] = m[7];
}

/* Adds the blocks in one half of the tile that the splat touched. `from` has
 * its alpha and weight in these blocks. */
static void add_half(sums *s, tile *t, const saga_splat_2d *o, const pass *p,
                     const kept *from, int half, unsigned touched)
{
    const wide red = wide_set1(o->colour[0]);
    const wide green = wide_set1(o->colour[1]);
    const wide blue = wide_set1(o->colour[2]), one = wide_set1(1);
    const wide x = wide_load(p->grid.x[half]);
    const wide n = wide_set1(o->n), h = wide_set1(o->h);
    const wide twice = wide_add(p->limit.square, p->limit.square);
    wide m0 = wide_zero(), m1 = m0, m2 = m0, m0_x, g_dx, up;
    wide s_red = s->red, s_green = s->green, s_blue = s->blue;
    wide s_weight = s->weight, s_q = s->q;
    real d[2];

    to_middle(d, o, t);
    g_dx = wide_mul(wide_set1(o->g), wide_add(x, wide_set1(d[0])));
    up = wide_set1(d[1]);
    for (; touched; touched &= touched - 1, from++) {
        const int j = __builtin_ctz(touched);
        const int at = (half * PAIRS + j) * WIDE_LANES;
        const wide alpha = wide_load(from->alpha);
        const wide weight = wide_load(from->weight);
        const wide d_red = wide_load(t->slope[0] + at);
        const wide d_green = wide_load(t->slope[1] + at);
        const wide d_blue = wide_load(t->slope[2] + at);
        const wide shown = wide_mul(
            weight, wide_fma(d_blue, blue,
                             wide_fma(d_green, green, wide_mul(d_red, red))));
        /* D after this splat is what the splats behind it and the background
         * add. */
        const wide rest = wide_sub(wide_load(t->rest + at), shown);
        const wide y = wide_load(p->grid.y[j]);
        /* dL/dq / ln 2 = -(alpha T b - D alpha / (1 - alpha)), where alpha T b
         * is `shown`; 0 where alpha is capped. */
        const wide odds = wide_div(alpha, wide_sub(one, alpha));
        const wide d_q = wide_keep(wide_less(alpha, p->limit.cap),
                                   wide_sub(wide_mul(odds, rest), shown));
        const wide dy = wide_add(y, up);
        const wide v = wide_fnma(n, dy, g_dx), w = wide_mul(h, dy);
        const wide at_s = wide_fma(v, v, wide_mul(w, w));
        const wide d_s = wide_mul(d_q, wide_fma(at_s, twice, one));
        const wide d_s_y = wide_mul(d_s, y);

        wide_store(t->rest + at, rest);
        s_q = wide_add(s_q, d_q);
        m0 = wide_add(m0, d_s);
        m1 = wide_add(m1, d_s_y);
        m2 = wide_fma(d_s_y, y, m2);
        s_red = wide_fma(weight, d_red, s_red);
        s_green = wide_fma(weight, d_green, s_green);
        s_blue = wide_fma(weight, d_blue, s_blue);
        s_weight = wide_add(s_weight, weight);
    }
    /* x is the same for all blocks of a half, so it is applied once at the
     * end. */
    m0_x = wide_mul(m0, x);
    s->q = s_q;
    s->m00 = wide_add(s->m00, m0);
    s->m10 = wide_add(s->m10, m0_x);
    s->m20 = wide_fma(m0_x, x, s->m20);
    s->m01 = wide_add(s->m01, m1);
    s->m11 = wide_fma(m1, x, s->m11);
    s->m02 = wide_add(s->m02, m2);
    s->red = s_red;
    s->green = s_green;
    s->blue = s_blue;
    s->weight = s_weight;
}

static void blend_backward(real *record, tile *t, const saga_splat_2d *o,
                           const pass *p, const kept *from, unsigned touched)
{
    const unsigned left = touched & ((1u << PAIRS) - 1);
    const unsigned right = touched >> PAIRS;
    const wide zero = wide_zero();
    sums s = {
        zero, zero, zero, zero, zero, zero, zero, zero, zero, zero, zero
    };

    if (left)
        add_half(&s, t, o, p, from, 0, left);
    if (right)
        add_half(&s, t, o, p, from + __builtin_popcount(left), 1, right);
    write_record(record, &s, o, t);
}

/* --- A tile's list ------------------------------------------------------- */

/* The data that the forward pass of a tile keeps. */
typedef struct {
    kept *block;
    uint16_t *touched; /* bit mask of blocks, for each splat that is kept */
    size_t begin, end; /* range of the tile's list that was drawn */
    size_t unkept;     /* first splat that is not kept, or end */
    real trans[AREA];  /* transmittance before that splat */
} trail;

static void draw_and_keep(trail *r, tile *t, const pass *p)
{
    const saga_splat_work *const work = &p->canvas->splat;
    kept *to = r->block;
    size_t e;

    r->unkept = r->end;
    for (e = r->begin; e < r->end && !is_done(t, p, e - r->begin); e++) {
        /* There is no room for another splat. T is saved, so that the backward
         * pass can draw again from here. */
        if (r->unkept == r->end && to > r->block + KEPT) {
            r->unkept = e;
            memcpy(r->trans, t->trans, sizeof r->trans);
        }
        if (e >= r->unkept) {
            blend(r->block + LAST, t, splat_at(work, e), p);
            continue;
        }
        r->touched[e] = (uint16_t)blend(to, t, splat_at(work, e), p);
        to += __builtin_popcount(r->touched[e]);
    }
    r->end = e;
    if (r->unkept > e)
        r->unkept = e;
}

static real *record_of(const saga_splat_work *work, size_t e)
{
    const size_t next = work->pair[e + SAGA_SPLAT_AHEAD].slot;

    __builtin_prefetch(work->record + next * SAGA_N_SUMS, 1);
    return work->record + (size_t)work->pair[e].slot * SAGA_N_SUMS;
}

/* Goes through the list and writes all records. t holds the gradient of its
 * pixels. */
static void go_back(const trail *r, tile *t, const pass *p)
{
    const saga_splat_work *const work = &p->canvas->splat;
    const kept *from = r->block;
    size_t e;

    for (e = r->begin; e < r->unkept; e++) {
        blend_backward(record_of(work, e), t, splat_at(work, e), p, from,
                       r->touched[e]);
        from += __builtin_popcount(r->touched[e]);
    }
    /* Splats that were not kept are drawn again, starting with the saved T. */
    if (e < r->end)
        memcpy(t->trans, r->trans, sizeof t->trans);
    for (; e < r->end; e++) {
        kept *const now = r->block + LAST;
        const unsigned touched = blend(now, t, splat_at(work, e), p);

        blend_backward(record_of(work, e), t, splat_at(work, e), p, now,
                       touched);
    }
}

bool saga_splat_raster_reserve(saga_canvas *canvas, saga_error *error)
{
    saga_splat_work *const work = &canvas->splat;
    const size_t n_threads = saga_n_threads();

    if (!saga_canvas_grow((void **)&work->record, &work->cap[9],
                          work->n_pairs * SAGA_N_SUMS * sizeof(real), error) ||
        !saga_canvas_grow((void **)&work->touched, &work->cap[16],
                          work->n_pairs * sizeof *work->touched, error))
        return false;
    if (!saga_canvas_grow((void **)&work->squares, &work->cap[17],
                          n_tiles(work) * sizeof *work->squares, error))
        return false;
    if (n_threads <= work->n_kept)
        return true;
    free(work->kept);
    work->n_kept = 0;
    work->kept = saga_aligned_alloc(64, n_threads * KEPT_ALL * sizeof(kept),
                                    "drawing a picture", error);
    if (!work->kept)
        return false;
    work->n_kept = n_threads;
    return true;
}

/* --- A tile's pixels ----------------------------------------------------- */

/* Copies the tile's part of a plane of the picture. */
static void take_plane(real *to, const tile *t, const real *plane, int width)
{
    int half, y;

    for (half = 0; half < 2; half++)
        for (y = 0; y < t->height; y++)
            memcpy(to + eight_at(half, y), plane + plane_at(t, half, y, width),
                   (size_t)n_inside(t, half) * sizeof *to);
}

/* Sets the slope to the values of a picture, with 0 outside of it. */
static void take_picture(tile *t, const saga_splat_camera *cam,
                         const real *picture)
{
    int c;

    memset(t->slope, 0, sizeof t->slope);
    for (c = 0; c < 3; c++)
        take_plane(t->slope[c], t, picture + (size_t)c * plane_size(cam),
                   cam->width);
}

/* Sets the truth of pixels that do not count to what is drawn. */
static void forgive(tile *t)
{
    for (int c = 0; c < 3; c++)
        for (int i = 0; i < AREA; i++)
            if (t->slope[c][i] < 0)
                t->slope[c][i] = t->colour[c][i];
}

/* Replaces the truth, which is in t->slope, by the gradient of the mean squared
 * error. Returns the sum of squares. */
static double compare(tile *t, const saga_splat_camera *cam)
{
    /* The mean is over all values of the picture, including those that do not
     * count. */
    const wide unit = wide_set1(R(2) / R(3 * plane_size(cam)));
    wide sum = wide_zero();
    int c, i;

    for (c = 0; c < 3; c++)
        for (i = 0; i < AREA; i += WIDE_LANES) {
            const wide e = wide_sub(wide_load(t->colour[c] + i),
                                    wide_load(t->slope[c] + i));

            sum = wide_fma(e, e, sum);
            wide_store(t->slope[c] + i, wide_mul(unit, e));
        }
    return (double)vec_sum(wide_fold(sum));
}

/* Sets D before the first splat. */
static void begin_rest(tile *t)
{
    int c, i;

    for (i = 0; i < AREA; i += WIDE_LANES) {
        /* D = g . C, where C includes the background. */
        wide rest = wide_zero();

        for (c = 0; c < 3; c++)
            rest = wide_fma(wide_load(t->slope[c] + i),
                            wide_load(t->colour[c] + i), rest);
        wide_store(t->rest + i, rest);
    }
}

/* Computes the gradient records of the splats of a tile, either from a given
 * gradient of the picture or from the true picture. In the latter case it also
 * sets the tile's sum of squared errors. */
static void tile_backward(void *user, size_t index)
{
    const pass *const p = user;
    const saga_splat_work *const work = &p->canvas->splat;
    const saga_splat_camera *const cam = &p->canvas->camera;
    const size_t end = work->tile_begin[index + 1];
    trail r = { .block = (kept *)work->kept + saga_thread_number() * KEPT_ALL,
                .touched = work->touched,
                .begin = work->tile_begin[index],
                .end = end };
    tile t;
    size_t e;

    begin_tile(&t, p, index);
    /* Forward pass, gradient of the pixels and backward pass follow each other
     * while the data is in this core's cache. */
    draw_and_keep(&r, &t, p);
    end_tile(&t, cam->background);
    take_picture(&t, cam, p->learn ? p->canvas->truth : p->canvas->d_image);
    if (p->learn && p->canvas->n_unseen)
        forgive(&t);
    if (p->learn)
        work->squares[index] = compare(&t, cam);
    begin_rest(&t);
    go_back(&r, &t, p);
    /* Splats after the last one that was drawn get records of zeros. */
    for (e = r.end; e < end; e++)
        memset(record_of(work, e), 0, SAGA_N_SUMS * sizeof(real));
}

void saga_splat_raster_backward(saga_canvas *canvas)
{
    pass p = pass_of(canvas);

    do_tiles(tile_backward, &p, 3);
}

double saga_splat_raster_learn(saga_canvas *canvas)
{
    const size_t n = n_tiles(&canvas->splat);
    pass p = pass_of(canvas);
    double sum = 0;
    size_t i;

    p.learn = 1;
    do_tiles(tile_backward, &p, 3);
    /* The sum is in the order of tiles, so it does not depend on threads. */
    for (i = 0; i < n; i++)
        sum += canvas->splat.squares[i];
    return sum / saga_canvas_n_seen(canvas);
}

SAGA_ISA_CHOOSE(saga_splat_raster_reserve);
SAGA_ISA_CHOOSE(saga_splat_raster_backward);
SAGA_ISA_CHOOSE(saga_splat_raster_learn);
