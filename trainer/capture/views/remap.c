/* SPDX-License-Identifier: MIT */
#include "remap.h"

#include "alloc.h"
#include "error.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* Returns the radius at which a fisheye lens shows a given angle from its
 * axis. */
static double fisheye_radius(const saga_lens *l, double angle)
{
    const double a2 = angle * angle;
    return angle *
           (1.0 + a2 * (l->k1 + a2 * (l->k2 + a2 * (l->k3 + a2 * l->k4))));
}

void saga_lens_project(const saga_lens *lens, double x, double y, double uv[2])
{
    /* An equirectangular picture shows longitude and latitude of the direction,
     * in the axes of the whole picture. */
    if (lens->equirect) {
        const double *const m = lens->turn;
        const double d[3] = { m[0] * x + m[1] * y + m[2],
                              m[3] * x + m[4] * y + m[5],
                              m[6] * x + m[7] * y + m[8] };
        uv[0] = lens->fx * atan2(d[0], d[2]) + lens->cx;
        uv[1] = lens->fy * atan2(d[1], sqrt(d[0] * d[0] + d[2] * d[2])) +
                lens->cy;
        return;
    }
    /* A fisheye keeps the direction in the picture; the angle from the axis
     * gives the radius. */
    if (lens->fisheye) {
        const double r = sqrt(x * x + y * y);
        const double part = r > 1e-12 ? fisheye_radius(lens, atan(r)) / r : 1.0;
        uv[0] = lens->fx * x * part + lens->cx;
        uv[1] = lens->fy * y * part + lens->cy;
        return;
    }
    /* Other lenses multiply the radius by g; then p1 and p2 are added for a
     * decentred lens. */
    const double r2 = x * x + y * y;
    const double g = 1.0 + r2 * (lens->k1 + r2 * (lens->k2 + r2 * lens->k3));
    const double xd = x * g + 2.0 * lens->p1 * x * y +
                      lens->p2 * (r2 + 2.0 * x * x);
    const double yd = y * g + lens->p1 * (r2 + 2.0 * y * y) +
                      2.0 * lens->p2 * x * y;
    uv[0] = lens->fx * xd + lens->cx;
    uv[1] = lens->fy * yd + lens->cy;
}

bool saga_lens_is_pinhole(const saga_lens *lens)
{
    return !lens->fisheye && !lens->equirect && lens->k1 == 0.0 &&
           lens->k2 == 0.0 && lens->k3 == 0.0 && lens->p1 == 0.0 &&
           lens->p2 == 0.0;
}

/* Returns the side in pixels of a full-size face of an equirectangular
 * picture. */
static int face_side(const saga_lens *lens)
{
    return (int)fmin(2.0 * lens->fx, SAGA_MAX_SIDE);
}

/* Sets uv to the source position for a position (u, v) in the pinhole picture,
 * whose focal lengths are the lens's times s. */
static void source_of(const saga_lens *lens, double s, double u, double v,
                      double uv[2])
{
    const double half = face_side(lens) / 2.0;
    /* A face spans 90 degrees, so half a side is tan(45 degrees) = 1. */
    if (lens->equirect) {
        saga_lens_project(lens, (u - half) / half, (v - half) / half, uv);
        return;
    }
    saga_lens_project(lens, (u - lens->cx) / (lens->fx * s),
                      (v - lens->cy) / (lens->fy * s), uv);
}

/* Tells whether the distorted radius, r g(r^2) or the fisheye's, grows up to
 * r_max. Beyond a fold the model would show pixels a second time, mirrored. */
static bool grows_until(const saga_lens *lens, double r_max)
{
    const double step = atan(r_max) / 256.0;
    for (int i = 0; lens->fisheye && i < 256; i++)
        if (!(fisheye_radius(lens, step * (i + 1)) -
                  fisheye_radius(lens, step * i) >
              0.05 * step))
            return false;
    for (int i = 0; !lens->fisheye && i <= 256; i++) {
        const double r2 = r_max * r_max * (i / 256.0) * (i / 256.0);
        /* d/dr (r g) = 1 + 3 k1 r^2 + 5 k2 r^4 + 7 k3 r^6. If it is below 0.05,
         * more than twenty pixels of the pinhole show one pixel of the
         * source. */
        const double slope = 1.0 +
                             r2 * (3.0 * lens->k1 +
                                   r2 * (5.0 * lens->k2 + r2 * 7.0 * lens->k3));
        if (!(slope > 0.05))
            return false;
    }
    return true;
}

/* Tangent of half of 110 degrees, which is the widest angle for a fisheye's
 * pinhole picture, because a wider one spends most pixels on its border. */
static const double WIDEST = 1.428;

static bool covers(const saga_lens *lens, double s, int i, int j, int width,
                   int height)
{
    double uv[2];
    source_of(lens, s, i + 0.5, j + 0.5, uv);
    return uv[0] >= 0.5 && uv[0] <= width - 0.5 && uv[1] >= 0.5 &&
           uv[1] <= height - 0.5;
}

/* Tells whether all pixels have a source. It is enough to test the border,
 * because the map is continuous and, as far as grows_until tests, one to
 * one. */
static bool all_valid(const saga_lens *lens, double s, int width, int height)
{
    /* x and y are the corner that is farthest from the axis, at z = 1. */
    const double x = fmax(lens->cx, width - lens->cx) / (lens->fx * s);
    const double y = fmax(lens->cy, height - lens->cy) / (lens->fy * s);
    if (fmax(x, y) > WIDEST && lens->fisheye)
        return false;
    if (!grows_until(lens, sqrt(x * x + y * y)))
        return false;
    for (int i = 0; i < width; i++)
        if (!covers(lens, s, i, 0, width, height) ||
            !covers(lens, s, i, height - 1, width, height))
            return false;
    for (int j = 0; j < height; j++)
        if (!covers(lens, s, 0, j, width, height) ||
            !covers(lens, s, width - 1, j, width, height))
            return false;
    return true;
}

/* Returns the focal scale s: the smallest valid one that is connected by valid
 * values to the first valid one at or above 1. Returns 0 if none up to 4 is
 * valid. */
static double choose_scale(const saga_lens *lens, int width, int height)
{
    /* s grows by 2 % at a time until it is valid. */
    double good = 1.0;
    while (!all_valid(lens, good, width, height)) {
        good *= 1.02;
        if (good > 4.0)
            return 0.0;
    }
    /* Then s shrinks, which widens the view, as long as it stays valid. */
    double bad = good / 1.02;
    while (bad > 0.25 && all_valid(lens, bad, width, height)) {
        good = bad;
        bad /= 1.02;
    }
    /* Bisection between the last valid s and the invalid one below it; 40
     * halvings reduce the 2 % to 2e-14. */
    for (int i = 0; i < 40; i++) {
        const double middle = 0.5 * (good + bad);
        if (all_valid(lens, middle, width, height))
            good = middle;
        else
            bad = middle;
    }
    return good;
}

static bool lens_is_sane(const saga_lens *l)
{
    const double all[] = { l->fx, l->fy, l->cx, l->cy, l->k1,
                           l->k2, l->k3, l->p1, l->p2, l->k4 };
    for (size_t i = 0; i < sizeof all / sizeof all[0]; i++)
        if (!isfinite(all[i]))
            return false;
    return l->fx > 0.0 && l->fy > 0.0;
}

bool saga_remap_plan(saga_remap *remap, const saga_lens *lens, int width,
                     int height, int scale, const char *file, saga_error *error)
{
    const int side = lens->equirect ? face_side(lens) : 0;
    *remap = (saga_remap){ .original_width = width,
                           .original_height = height,
                           .full_width = side ? side : width,
                           .full_height = side ? side : height,
                           .scale = scale,
                           .focal_scale = 1.0 };
    remap->width = remap->full_width / scale;
    remap->height = remap->full_height / scale;
    if (remap->width < 1 || remap->height < 1)
        return saga_fail(error, file, "use a larger --scale fraction",
                         "%d x %d pixels leave nothing at --scale 1/%d", width,
                         height, scale);
    if (!lens_is_sane(lens))
        return saga_fail(error, file, "correct the intrinsics",
                         "intrinsics are not usable (fx %g, fy %g, cx %g, "
                         "cy %g)",
                         lens->fx, lens->fy, lens->cx, lens->cy);
    if (lens->equirect) {
        remap->fx = remap->fy = remap->cx = remap->cy = side / 2.0 / scale;
        return true;
    }
    if (!saga_lens_is_pinhole(lens))
        remap->focal_scale = choose_scale(lens, width, height);
    if (remap->focal_scale == 0.0)
        return saga_fail(error, file,
                         "check their order and sign, or "
                         "undistort the pictures first",
                         "distortion k1 %g, "
                         "k2 %g, k3 %g, p1 %g, p2 %g folds the picture",
                         lens->k1, lens->k2, lens->k3, lens->p1, lens->p2);
    /* Positions are measured from the picture's corner, so dividing them by N
     * keeps the place at 1/N of the size. */
    const double s = remap->focal_scale / scale;
    remap->fx = lens->fx * s;
    remap->fy = lens->fy * s;
    remap->cx = lens->cx / scale;
    remap->cy = lens->cy / scale;
    return true;
}

uint64_t saga_remap_nbytes(const saga_remap *remap, const saga_lens *lens)
{
    /* A tap takes 4 bytes, and its two fractions take 2. */
    return saga_lens_is_pinhole(lens)
               ? 0
               : (uint64_t)remap->full_width * (uint64_t)remap->full_height * 6;
}

/* Returns the first of two neighbouring taps for a position along one axis. The
 * fraction is the position between them in 1/256. tap + 1 is always inside the
 * picture; at the last pixel the fraction is 255/256. */
static int split_position(double position, int size, uint8_t *fraction)
{
    if (size < 2) {
        *fraction = 0;
        return 0;
    }
    /* The centre of pixel i is at i + 1/2. */
    const double p = fmin(fmax(position - 0.5, 0.0), size - 1.0);
    const int q = (int)floor(p * 256.0 + 0.5);
    const int tap = q >> 8 < size - 2 ? q >> 8 : size - 2;
    const int rest = q - tap * 256;
    *fraction = (uint8_t)(rest < 255 ? rest : 255);
    return tap;
}

bool saga_remap_build(saga_remap *remap, const saga_lens *lens,
                      const char *file, saga_error *error)
{
    if (saga_lens_is_pinhole(lens))
        return true;
    const int w = remap->original_width, h = remap->original_height;
    const size_t full = (size_t)remap->full_width;
    const size_t n = full * (size_t)remap->full_height;
    remap->taps = saga_alloc(n, sizeof *remap->taps, file, error);
    remap->fractions = saga_alloc(n, 2, file, error);
    if (!remap->taps || !remap->fractions) {
        saga_remap_free(remap);
        return false;
    }
    /* For each pixel of the full-size pinhole picture, its first tap in the
     * source and the fractions to the next taps. */
    for (size_t i = 0; i < n; i++) {
        double uv[2];
        source_of(lens, remap->focal_scale, (double)(i % full) + 0.5,
                  (double)(i / full) + 0.5, uv);
        const int x = split_position(uv[0], w, &remap->fractions[2 * i]);
        const int y = split_position(uv[1], h, &remap->fractions[2 * i + 1]);
        remap->taps[i] = (uint32_t)y * (uint32_t)w + (uint32_t)x;
    }
    return true;
}

void saga_remap_free(saga_remap *remap)
{
    free(remap->taps);
    free(remap->fractions);
    remap->taps = NULL;
    remap->fractions = NULL;
}

/* Adds a full-size pixel of the pinhole picture, times 65536, to sum[3]. */
static inline void add_bilinear(const saga_remap *remap, const uint8_t *source,
                                size_t i, uint64_t sum[3])
{
    const uint32_t fx = remap->fractions[2 * i];
    const uint32_t fy = remap->fractions[2 * i + 1];
    const size_t right = remap->original_width > 1 ? 3 : 0;
    const size_t down = remap->original_height > 1
                            ? (size_t)remap->original_width * 3
                            : 0;
    const uint8_t *const p = source + (size_t)remap->taps[i] * 3;
    for (size_t c = 0; c < 3; c++) {
        const uint32_t top = p[c] * (256 - fx) + p[right + c] * fx;
        const uint32_t bottom = p[down + c] * (256 - fx) +
                                p[down + right + c] * fx;
        sum[c] += top * (256 - fy) + bottom * fy;
    }
}

static void box_pixel(const saga_remap *remap, const uint8_t *source, int x,
                      int y, uint8_t *rgb)
{
    const size_t n = (size_t)remap->scale, w = (size_t)remap->full_width;
    /* The sum of 64 x 64 pixels of 255 x 65536 exceeds 32 bits. */
    uint64_t sum[3] = { 0 };
    for (size_t b = 0; b < n; b++)
        for (size_t a = 0; a < n; a++) {
            const size_t i = ((size_t)y * n + b) * w + (size_t)x * n + a;
            if (remap->taps)
                add_bilinear(remap, source, i, sum);
            else
                for (size_t c = 0; c < 3; c++)
                    sum[c] += source[3 * i + c];
        }
    /* Bilinear values are scaled by 2^8 for each axis. The division below is
     * the only rounding. */
    const uint64_t unit = remap->taps ? n * n << 16 : n * n;
    for (size_t c = 0; c < 3; c++)
        rgb[c] = (uint8_t)((sum[c] + unit / 2) / unit);
}

void saga_remap_rgb(const saga_remap *remap, const uint8_t *source,
                    uint8_t *rgb)
{
    if (!remap->taps && remap->scale == 1) {
        memcpy(rgb, source, (size_t)remap->width * (size_t)remap->height * 3);
        return;
    }
    for (int y = 0; y < remap->height; y++)
        for (int x = 0; x < remap->width; x++, rgb += 3)
            box_pixel(remap, source, x, y, rgb);
}

/* Samples depth at the middle of each box; if N is even, at the pixel to the
 * lower right of the middle. */
void saga_remap_depth(const saga_remap *remap, const float *source,
                      float *depth)
{
    const size_t n = (size_t)remap->scale, w = (size_t)remap->original_width;
    for (size_t y = 0; y < (size_t)remap->height; y++)
        for (size_t x = 0; x < (size_t)remap->width; x++) {
            size_t i = (y * n + n / 2) * (size_t)remap->full_width + x * n +
                       n / 2;
            /* The nearest of the four taps is taken, since an average of two
             * depths may lie where there is nothing. */
            if (remap->taps) {
                const uint8_t *const f = &remap->fractions[2 * i];
                i = remap->taps[i] + (f[0] >= 128 ? 1u : 0u) +
                    (f[1] >= 128 ? w : 0u);
            }
            *depth++ = source[i];
        }
}
