/* SPDX-License-Identifier: MIT */
#include "hull.h"

#include "alloc.h"
#include "vec3.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum {
    CELLS = 480, /* most cells along a side of a picture, boxes of pixels that
                  * become one bit */
    GRID = 48,   /* voxels along each side of the box */
    N_VOXELS = GRID * GRID * GRID,
    PASSES = 3 /* of which each begins with the box that the last one found, so
                * that a subject may be small in its room */
};

/* One mask in five may miss a place: it is cut off by something in front, or
 * wrong. */
#define MISSES_PART 0.2
/* A place counts that half as many views see as see the best one. The cones of
 * fewer views meet again far behind the subject. */
#define SEEING_PART 0.5
/* Opacity of a half. Less may be noise of a coded mask. */
#define SOLID 128
/* The hull has its voxels' corners, and its subject is inside, but masks may
 * be a little small: 3 % of the longest side are added. */
#define MARGIN 0.03

/* Where a view sees the subject at any time: n at (x, y) is the number of such
 * cells above and to the left. */
typedef struct {
    int side;          /* of a cell, in pixels */
    int width, height; /* in cells */
    uint32_t *n;       /* (height + 1, width + 1) */
} outline;

static void mark_cells(uint8_t *cell, const outline *o, const saga_capture *c,
                       int view)
{
    const saga_source_view *const v = &c->views[view];

    for (int k = 0; k < saga_view_n_held(v, c->n_frames); k++) {
        const uint8_t *mask = saga_capture_mask(c, view, k);

        for (int y = 0; y < v->height; y++)
            for (int x = 0; x < v->width; x++, mask++)
                if (*mask >= SOLID)
                    cell[y / o->side * o->width + x / o->side] = 1;
    }
}

static bool make_outline(outline *o, const saga_capture *c, int view,
                         saga_error *error)
{
    const saga_source_view *const v = &c->views[view];
    const int longest = v->width > v->height ? v->width : v->height;
    const int side = (longest + CELLS - 1) / CELLS;
    const int w = (v->width + side - 1) / side;
    const int h = (v->height + side - 1) / side;
    uint8_t *const cell = saga_calloc((size_t)w * (size_t)h, 1, v->name, error);

    *o = (outline){ side, w, h,
                    saga_calloc((size_t)(w + 1) * (size_t)(h + 1), sizeof *o->n,
                                v->name, error) };
    if (cell && o->n) {
        mark_cells(cell, o, c, view);
        for (int y = 0; y < h; y++)
            for (int x = 0; x < w; x++) {
                uint32_t *const n = o->n + (y + 1) * (w + 1) + x + 1;

                *n = n[-1] + n[-w - 1] - n[-w - 2] + cell[y * w + x];
            }
    }
    free(cell);
    return cell && o->n;
}

static int clamp_cell(double cell, int most)
{
    return cell < 0 ? 0 : cell > most ? most : (int)cell;
}

/* Tells whether the subject is anywhere in a square of pixels. */
static bool is_in(const outline *o, const double uv[2], double radius)
{
    const int x0 = clamp_cell((uv[0] - radius) / o->side, o->width);
    const int y0 = clamp_cell((uv[1] - radius) / o->side, o->height);
    const int x1 = clamp_cell((uv[0] + radius) / o->side + 1, o->width);
    const int y1 = clamp_cell((uv[1] + radius) / o->side + 1, o->height);
    const uint32_t *const top = o->n + y0 * (o->width + 1);
    const uint32_t *const bottom = o->n + y1 * (o->width + 1);

    return bottom[x1] - bottom[x0] - top[x1] + top[x0] > 0;
}

/* Returns the number of views that see the subject within a ball; 0 if too many
 * that have it in their picture do not. */
static int n_seeing(const outline *all, const saga_capture *c,
                    const double centre[3], double radius)
{
    int n = 0, n_missed = 0;

    for (int v = 0; v < c->n_views; v++) {
        const saga_source_view *const w = &c->views[v];
        double uv[2], z;

        if (!all[v].n || !saga_view_project(w, centre, uv, &z) || uv[0] < 0 ||
            uv[1] < 0 || uv[0] >= w->width || uv[1] >= w->height)
            continue;
        if (is_in(&all[v], uv, radius * fmax(w->fx, w->fy) / z))
            n++;
        else
            n_missed++;
    }
    return n_missed > MISSES_PART * (n + n_missed) ? 0 : n;
}

/* Sets the centre of a voxel. */
static void voxel_at(double x[3], int i, const double lo[3],
                     const double side[3])
{
    const int at[3] = { i % GRID, i / GRID % GRID, i / GRID / GRID };

    for (int k = 0; k < 3; k++)
        x[k] = lo[k] + (at[k] + 0.5) * side[k];
}

/* Shrinks the box to the voxels that are in the hull. Returns false if none
 * is. seeing has room for all voxels. */
static bool shrink(double lo[3], double hi[3], uint16_t *seeing,
                   const outline *all, const saga_capture *c)
{
    double a[3] = { INFINITY, INFINITY, INFINITY }, x[3], side[3];
    double b[3] = { -INFINITY, -INFINITY, -INFINITY };
    int most = 0;

    /* The ball around a voxel reaches its corners. */
    for (int k = 0; k < 3; k++)
        side[k] = (hi[k] - lo[k]) / GRID;
    for (int i = 0; i < N_VOXELS; i++) {
        voxel_at(x, i, lo, side);
        seeing[i] = (uint16_t)n_seeing(all, c, x, length3(side) / 2);
        most = seeing[i] > most ? seeing[i] : most;
    }
    if (most < (c->n_learned > 1 ? 2 : 1))
        return false;
    for (int i = 0; i < N_VOXELS; i++) {
        if (seeing[i] < SEEING_PART * most)
            continue;
        voxel_at(x, i, lo, side);
        for (int k = 0; k < 3; k++) {
            a[k] = fmin(a[k], x[k] - side[k] / 2);
            b[k] = fmax(b[k], x[k] + side[k] / 2);
        }
    }
    memcpy(lo, a, sizeof a);
    memcpy(hi, b, sizeof b);
    return true;
}

bool saga_hull_box(double lo[3], double hi[3], const saga_capture *c,
                   saga_error *error)
{
    outline *const all = saga_calloc((size_t)c->n_views, sizeof *all,
                                     "the masks", error);
    uint16_t *const seeing = saga_alloc(N_VOXELS, sizeof *seeing, "the masks",
                                        error);
    bool ok = all && seeing, found = true;
    double margin = 0;

    /* Outlines of the training views; passes over ever smaller boxes; margin.
     */
    for (int v = 0; ok && v < c->n_views; v++)
        if (!c->views[v].held_out && c->views[v].n_missing < c->n_frames)
            ok = make_outline(&all[v], c, v, error);
    for (int pass = 0; ok && found && pass < PASSES; pass++)
        found = shrink(lo, hi, seeing, all, c);
    for (int v = 0; all && v < c->n_views; v++)
        free(all[v].n);
    free(all);
    free(seeing);
    for (int k = 0; k < 3; k++)
        margin = fmax(margin, MARGIN * (hi[k] - lo[k]));
    for (int k = 0; k < 3; k++) {
        lo[k] -= margin;
        hi[k] += margin;
    }
    return ok &&
           (found || saga_fail(error, "--subject",
                               "look at the masks and the poses with `saga "
                               "check`, or give --box",
                               "no place is inside the masks of four in five "
                               "of the cameras that should see it"));
}
