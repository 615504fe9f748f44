/* SPDX-License-Identifier: MIT */
#include "splat_raster.h"

#include "raster_tile.h"

#include <string.h>

/* Copies the tile's part of a plane to the picture. */
static void put_plane(real *plane, const tile *t, const real *from, int width)
{
    int half, y;

    for (half = 0; half < 2; half++)
        for (y = 0; y < t->height; y++)
            memcpy(plane + plane_at(t, half, y, width),
                   from + eight_at(half, y),
                   (size_t)n_inside(t, half) * sizeof *from);
}

static void draw_tile(void *user, size_t index)
{
    const pass *const p = user;
    saga_canvas *const canvas = p->canvas;
    const saga_splat_work *const work = &canvas->splat;
    const size_t begin = work->tile_begin[index];
    const size_t end = work->tile_begin[index + 1];
    _Alignas(64) kept passing[BLOCKS];
    tile t;
    size_t e;
    int c;

    begin_tile(&t, p, index);
    for (e = begin; e < end && !is_done(&t, p, e - begin); e++)
        blend(passing, &t, splat_at(work, e), p);
    end_tile(&t, canvas->camera.background);
    for (c = 0; c < 3; c++)
        put_plane(canvas->image + (size_t)c * plane_size(&canvas->camera), &t,
                  t.colour[c], canvas->camera.width);
}

void saga_splat_raster_forward(saga_canvas *canvas)
{
    pass p = pass_of(canvas);

    do_tiles(draw_tile, &p, 1);
}

SAGA_ISA_CHOOSE(saga_splat_raster_forward);
