/* SPDX-License-Identifier: MIT
 *
 * One tile at a time, splat by splat, in groups of VEC_LANES pixels of a row;
 * the tile's state stays in L1. A group whose pixels are all outside the cut
 * or finished is skipped. Both directions evaluate q, alpha and T by the same
 * code in the same order, so the backward pass sees the forward's bits.
 *
 * Backward: with s = g.c (g = dL/dC), T before the splat and
 *   D = g.(C_final - what splats up to and including this one gave),
 *   dL/dalpha = T s - D / (1 - alpha),   dL/dq = -ln 2 alpha dL/dalpha
 * (0 where the cap holds), so nothing is stored per splat and pixel.
 */
#include "splat_raster.h"

#include "splat_tiles.h"
#include "vec.h"

#include <string.h>

enum {
    TILE = SAGA_SPLAT_TILE,
    AREA = TILE * TILE,
    GROUPS = TILE / VEC_LANES,
    CHECK_EVERY = 32      /* splats between two looks for an unfinished pixel */
};

/* State of a tile's pixels, row by row. */
typedef struct {
    real trans[AREA];
    real colour[3][AREA];  /* forward: so far; backward: dL/dC */
    real rest[AREA];       /* backward: D */
    int x0, y0;            /* of the tile in the picture */
    int width, height;     /* of its part in the picture */
} tile;

/* Rows and groups of a splat in a tile. */
typedef struct { int y0, y1, g0, g1; } window;

typedef struct { vec floor, cut, cap; } limits;

static void place(tile *t, const saga_splat_work *work, size_t index,
                  const saga_splat_camera *cam)
{
    t->x0 = TILE * (int)(index % work->n_tiles_x);
    t->y0 = TILE * (int)(index / work->n_tiles_x);
    t->width = cam->width - t->x0 < TILE ? cam->width - t->x0 : TILE;
    t->height = cam->height - t->y0 < TILE ? cam->height - t->y0 : TILE;
}

/* Pixels of the tile outside the picture start finished, so that nothing
 * they hold counts. */
static void clear_trans(tile *t)
{
    int x, y;

    for (y = 0; y < TILE; y++)
        for (x = 0; x < TILE; x++)
            t->trans[y * TILE + x] = x < t->width && y < t->height;
}

static int all_finished(const tile *t, vec floor)
{
    vec top = vec_load(t->trans);
    int i;

    for (i = VEC_LANES; i < AREA; i += VEC_LANES)
        top = vec_max(vec_load(t->trans + i), top);
    return !vec_any((veci)(top >= floor));
}

static window clip(const saga_splat_2d *o, const tile *t)
{
    window w;
    int x0 = o->x0 - t->x0, x1 = o->x1 - t->x0;

    w.y0 = o->y0 > t->y0 ? o->y0 - t->y0 : 0;
    w.y1 = o->y1 < t->y0 + TILE ? o->y1 - t->y0 : TILE;
    x0 = x0 > 0 ? x0 : 0;
    x1 = x1 < TILE ? x1 : TILE;
    w.g0 = x0 / VEC_LANES;
    w.g1 = (x1 + VEC_LANES - 1) / VEC_LANES;
    return w;
}

static limits limits_of(const saga_splat_rules *rules)
{
    /* A floor of 0 means none; padding pixels must stay below it. */
    const real floor = rules->t_floor > 0 ? rules->t_floor : REAL_MIN;

    return (limits){ vec_set1(floor), vec_set1(rules->cut),
                     vec_set1(rules->alpha_cap) };
}

/* --- Forward ------------------------------------------------------------- */

static void blend(tile *t, const saga_splat_2d *o, const limits *l, real cut)
{
    const window win = clip(o, t);
    const vec g = vec_set1(o->g);
    const vec red = vec_set1(o->colour[0]);
    const vec green = vec_set1(o->colour[1]);
    const vec blue = vec_set1(o->colour[2]);
    const vec dx0 = vec_iota() + (R(t->x0) + R(0.5) - o->mean[0]);
    int y, k;

    for (y = win.y0; y < win.y1; y++) {
        const real dy = R(t->y0 + y) + R(0.5) - o->mean[1];
        const real w = o->h * dy;
        const real q_row = o->q0 + w * w;
        const vec n_dy = vec_set1(-(o->n * dy));

        if (!(q_row < cut))
            continue;
        for (k = win.g0; k < win.g1; k++) {
            const int at = y * TILE + k * VEC_LANES;
            const vec v = vec_fma(g, dx0 + R(k * VEC_LANES), n_dy);
            const vec q = vec_fma(v, v, vec_set1(q_row));
            const vec trans = vec_load(t->trans + at);
            const veci on = (veci)(q < l->cut) & (veci)(trans >= l->floor);
            vec a;

            a = vec_and(on, vec_min(vec_exp2_neg(q), l->cap)) * trans;
            vec_store(t->trans + at, trans - a);
            vec_store(t->colour[0] + at,
                      vec_fma(a, red, vec_load(t->colour[0] + at)));
            vec_store(t->colour[1] + at,
                      vec_fma(a, green, vec_load(t->colour[1] + at)));
            vec_store(t->colour[2] + at,
                      vec_fma(a, blue, vec_load(t->colour[2] + at)));
        }
    }
}

static void put_tile(real *image, const tile *t, const saga_splat_camera *cam)
{
    const size_t plane = (size_t)cam->width * (size_t)cam->height;
    int c, x, y;

    for (y = 0; y < t->height; y++) {
        const size_t to = (size_t)(t->y0 + y) * (size_t)cam->width +
                          (size_t)t->x0;

        for (c = 0; c < 3; c++)
            for (x = 0; x < t->width; x++)
                image[(size_t)c * plane + to + (size_t)x] =
                    t->colour[c][y * TILE + x] +
                    t->trans[y * TILE + x] * cam->background[c];
    }
}

static void draw_tile(saga_canvas *canvas, size_t index)
{
    const saga_splat_work *const work = &canvas->splat;
    const limits l = limits_of(&canvas->rules);
    const size_t begin = work->tile_begin[index];
    const size_t end = work->tile_begin[index + 1];
    tile t;
    size_t e;

    place(&t, work, index, &canvas->camera);
    clear_trans(&t);
    memset(t.colour, 0, sizeof t.colour);
    for (e = begin; e < end; e++) {
        if ((e - begin) % CHECK_EVERY == CHECK_EVERY - 1 &&
            all_finished(&t, l.floor))
            break;
        blend(&t, work->splat + work->pair[e].splat, &l, canvas->rules.cut);
    }
    put_tile(canvas->image, &t, &canvas->camera);
}

static int64_t n_tiles(const saga_splat_work *work)
{
    return (int64_t)work->n_tiles_x * work->n_tiles_y;
}

void saga_splat_raster_forward(saga_canvas *canvas)
{
    const int64_t n = n_tiles(&canvas->splat);
    int64_t i;

#pragma omp parallel for schedule(dynamic, 4)
    for (i = 0; i < n; i++)
        draw_tile(canvas, (size_t)i);
}

/* --- Backward ------------------------------------------------------------ */

static void blend_backward(real *record, tile *t, const saga_splat_2d *o,
                           const limits *l, real cut)
{
    const window win = clip(o, t);
    const vec g = vec_set1(o->g);
    const vec red = vec_set1(o->colour[0]);
    const vec green = vec_set1(o->colour[1]);
    const vec blue = vec_set1(o->colour[2]);
    const vec dx0 = vec_iota() + (R(t->x0) + R(0.5) - o->mean[0]);
    vec s1 = vec_zero(), sv = vec_zero(), svx = vec_zero(), svy = vec_zero();
    vec sy = vec_zero(), syy = vec_zero(), sw = vec_zero();
    vec s_red = vec_zero(), s_green = vec_zero(), s_blue = vec_zero();
    int y, k;

    for (y = win.y0; y < win.y1; y++) {
        const real dy = R(t->y0 + y) + R(0.5) - o->mean[1];
        const real w = o->h * dy;
        const real q_row = o->q0 + w * w;
        const vec n_dy = vec_set1(-(o->n * dy));
        vec row1 = vec_zero(), row_v = vec_zero();

        if (!(q_row < cut))
            continue;
        for (k = win.g0; k < win.g1; k++) {
            const int at = y * TILE + k * VEC_LANES;
            const vec dx = dx0 + R(k * VEC_LANES);
            const vec v = vec_fma(g, dx, n_dy);
            const vec q = vec_fma(v, v, vec_set1(q_row));
            const vec trans = vec_load(t->trans + at);
            const veci on = (veci)(q < l->cut) & (veci)(trans >= l->floor);
            vec uncapped, alpha, a, d_red, d_green, d_blue, s, rest, d_q;

            if (!vec_any(on))
                continue;
            uncapped = vec_exp2_neg(q);
            alpha = vec_and(on, vec_min(uncapped, l->cap));
            a = alpha * trans;
            d_red = vec_load(t->colour[0] + at);
            d_green = vec_load(t->colour[1] + at);
            d_blue = vec_load(t->colour[2] + at);
            s = vec_fma(d_blue, blue, vec_fma(d_green, green, d_red * red));
            rest = vec_fnma(a, s, vec_load(t->rest + at));
            vec_store(t->rest + at, rest);
            vec_store(t->trans + at, trans - a);
            d_q = (rest / (R(1) - alpha) - trans * s) * alpha;
            d_q = vec_and((veci)(uncapped < l->cap), d_q);
            row1 += d_q;
            d_q *= v;
            row_v += d_q;
            svx = vec_fma(d_q, dx, svx);
            s_red = vec_fma(a, d_red, s_red);
            s_green = vec_fma(a, d_green, s_green);
            s_blue = vec_fma(a, d_blue, s_blue);
            sw += a;
        }
        s1 += row1;
        sv += row_v;
        svy += row_v * dy;
        row1 *= dy;
        sy += row1;
        syy += row1 * dy;
    }
    {
        const vec sums[8] = { s1, sv, svx, svy, sy, syy, s_red, s_green };

        vec_sum8(record, sums);
    }
    record[SAGA_SUM_B] = vec_sum(s_blue);
    record[SAGA_SUM_WEIGHT] = vec_sum(sw);
}

/* dL/dC, and D before the first splat. Pixels outside the picture are zero. */
static void get_tile(tile *t, const saga_canvas *canvas)
{
    const saga_splat_camera *const cam = &canvas->camera;
    const size_t plane = (size_t)cam->width * (size_t)cam->height;
    int c, x, y;

    memset(t->colour, 0, sizeof t->colour);
    memset(t->rest, 0, sizeof t->rest);
    for (y = 0; y < t->height; y++) {
        const size_t from = (size_t)(t->y0 + y) * (size_t)cam->width +
                            (size_t)t->x0;
        real *const rest = t->rest + y * TILE;

        for (c = 0; c < 3; c++)
            for (x = 0; x < t->width; x++) {
                const size_t i = (size_t)c * plane + from + (size_t)x;

                t->colour[c][y * TILE + x] = canvas->d_image[i];
                rest[x] += canvas->d_image[i] * canvas->image[i];
            }
    }
}

static void tile_backward(saga_canvas *canvas, size_t index)
{
    saga_splat_work *const work = &canvas->splat;
    const limits l = limits_of(&canvas->rules);
    const size_t begin = work->tile_begin[index];
    const size_t end = work->tile_begin[index + 1];
    int finished = 0;
    tile t;
    size_t e;

    if (begin == end)
        return;
    place(&t, work, index, &canvas->camera);
    clear_trans(&t);
    get_tile(&t, canvas);
    for (e = begin; e < end; e++) {
        real *const r = work->record +
                        (size_t)work->pair[e].slot * SAGA_N_SUMS;

        if ((e - begin) % CHECK_EVERY == CHECK_EVERY - 1 && !finished)
            finished = all_finished(&t, l.floor);
        if (finished)
            memset(r, 0, SAGA_N_SUMS * sizeof *r);
        else
            blend_backward(r, &t, work->splat + work->pair[e].splat, &l,
                           canvas->rules.cut);
    }
}

void saga_splat_raster_backward(saga_canvas *canvas)
{
    const int64_t n = n_tiles(&canvas->splat);
    int64_t i;

#pragma omp parallel for schedule(dynamic, 4)
    for (i = 0; i < n; i++)
        tile_backward(canvas, (size_t)i);
}
