/* SPDX-License-Identifier: MIT */
#include "miv_depth.h"

#include "alloc.h"
#include "error.h"
#include "file.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* Reads n samples of a frame, starting with sample `at`; each has one or two
 * bytes. */
static bool read_samples(FILE *file, const saga_miv_depth *d, int bits,
                         uint64_t at, uint16_t *to, size_t n)
{
    const uint64_t size = bits > 8 ? 2 : 1;
    const uint64_t frame = (uint64_t)d->width * (uint64_t)d->height * 3 / 2;
    const uint64_t offset = size * (frame * (uint64_t)d->frame + at);
    uint8_t *const bytes = (uint8_t *)to;
    if (fseek(file, (long)offset, SEEK_SET) != 0 ||
        fread(bytes, (size_t)size, n, file) != n)
        return false;
    /* The bytes lie at the front of the same memory. They are widened from the
     * back, so that none is overwritten before it is read. */
    for (size_t i = n; i-- > 0;)
        to[i] = size == 1 ? bytes[i]
                          : (uint16_t)(bytes[2 * i] | bytes[2 * i + 1] << 8);
    return true;
}

static uint8_t level(double x)
{
    return (uint8_t)(255.0 * fmin(fmax(x, 0.0), 1.0) + 0.5);
}

/* Converts a colour from BT.709 with limited range. */
static void set_colour(saga_point *p, int bits, int y, int u, int v)
{
    /* Limited range in 8 bits has luma 16 to 235 and chroma 16 to 240 around
     * 128; in 10 bits all of these are multiplied by 4. */
    const double unit = 1 << (bits - 8);
    const double l = (y / unit - 16.0) / 219.0;
    const double b = (u / unit - 128.0) / 224.0;
    const double r = (v / unit - 128.0) / 224.0;
    p->rgb[0] = level(l + 1.5748 * r);
    p->rgb[1] = level(l - 0.1873 * b - 0.4681 * r);
    p->rgb[2] = level(l + 1.8556 * b);
}

static void set_position(saga_point *p, const saga_miv_depth *d, double u,
                         double v, double z)
{
    const double s = d->a[0] + d->a[1] * u, t = d->a[2] + d->a[3] * v;
    /* For a pinhole, z is the depth along the axis, and s and t are slopes. */
    double x[3] = { z, z * s, z * t };
    /* For an equirectangular view, z is the distance from the centre, and s and
     * t are angles. */
    if (d->kind == SAGA_MIV_EQUIRECT) {
        x[0] = z * cos(t) * cos(s);
        x[1] = z * cos(t) * sin(s);
        x[2] = z * sin(t);
    } else if (d->kind == SAGA_MIV_ORTHO) {
        x[1] = s;
        x[2] = t;
    }
    for (int i = 0; i < 3; i++)
        p->position[i] = d->centre[i] + d->matrix[3 * i] * x[0] +
                         d->matrix[3 * i + 1] * x[1] +
                         d->matrix[3 * i + 2] * x[2];
}

/* Returns the depth for a code, or 0 if the code has none. */
static double depth_of(const saga_miv_depth *d, int code)
{
    const double part = code / (double)((1 << d->depth_bits) - 1);
    /* 1/z is linear in the code. If `far` is infinite, code 0 has no depth. */
    const double inverse = (1.0 - part) / d->far + part / d->near;
    return (code == 0 && d->has_invalid) || !(inverse > 0.0) ? 0.0
                                                             : 1.0 / inverse;
}

typedef struct rows {
    FILE *texture, *depth;
    uint16_t *z, *y, *u, *v; /* samples of one row */
} rows;

static bool read_row(rows *r, const saga_miv_depth *d, int y)
{
    const uint64_t w = (uint64_t)d->width, plane = w * (uint64_t)d->height;
    const uint64_t row = (uint64_t)y, half = w / 2;
    /* The planes Y, U and V follow each other. U and V have half the width and
     * half the height, so that one of their rows serves two rows of Y. */
    return read_samples(r->depth, d, d->depth_bits, w * row, r->z, w) &&
           read_samples(r->texture, d, d->texture_bits, w * row, r->y, w) &&
           read_samples(r->texture, d, d->texture_bits,
                        plane + half * (row / 2), r->u, half) &&
           read_samples(r->texture, d, d->texture_bits,
                        plane + plane / 4 + half * (row / 2), r->v, half);
}

/* Adds a point for every step-th pixel of every step-th row. */
static bool add_points(saga_listing *l, rows *r, const saga_miv_depth *d,
                       int step, saga_error *error)
{
    for (int y = step / 2; y < d->height; y += step) {
        /* There is room for a point per pixel of the row; fewer are added. */
        saga_point *const more = saga_realloc(l->points,
                                              l->n_points + (size_t)d->width,
                                              sizeof *more, d->depth, error);
        if (!more)
            return false;
        l->points = more;
        if (!read_row(r, d, y))
            return saga_fail(error, d->depth,
                             "copy it again, with as many "
                             "frames as its texture has",
                             "ends before row %d "
                             "of frame %d, or its texture does",
                             y, d->frame);
        for (int x = step / 2; x < d->width; x += step) {
            const double z = depth_of(d, r->z[x]);
            saga_point *const p = &l->points[l->n_points];
            if (!(z > 0.0))
                continue;
            set_position(p, d, x + 0.5, y + 0.5, z);
            set_colour(p, d->texture_bits, r->y[x], r->u[x / 2], r->v[x / 2]);
            l->n_points++;
        }
    }
    return true;
}

bool saga_miv_take_points(saga_listing *listing, const saga_miv_depth *d, int n,
                          saga_error *error)
{
    const size_t w = (size_t)d->width;
    const double pixels = (double)d->width * d->height;
    /* One point for each square of step x step pixels gives about n points. */
    const int step = (int)ceil(sqrt(pixels / n));
    uint16_t *const room = saga_alloc(4 * w, sizeof *room, d->depth, error);
    rows r = { saga_open_file(d->texture),
               saga_open_file(d->depth),
               room,
               room + w,
               room + 2 * w,
               room + 3 * w };
    bool ok = room != NULL;
    if (ok && (!r.texture || !r.depth))
        ok = saga_fail_errno(error, r.texture ? d->depth : d->texture,
                             "check its permissions", "cannot be opened");
    ok = ok && add_points(listing, &r, d, step, error);
    if (r.texture)
        fclose(r.texture);
    if (r.depth)
        fclose(r.depth);
    free(room);
    return ok;
}
