/* SPDX-License-Identifier: MIT
 *
 * Finds corners in a grey picture and in smaller copies of it. A corner is a
 * pixel around which gradients have two directions, so that the smaller
 * eigenvalue of
 *
 *     sum w (gx, gy) (gx, gy)^T
 *
 * is a maximum (Shi and Tomasi). The best corners of each cell of a grid are
 * kept, so that a detailed part of the picture is not all that is compared.
 */
#include "corners.h"

#include "alloc.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum {
    LARGEST = 960, /* pixels of the longer side; larger pictures are
                    * reduced first, since corners to half a pixel are
                    * exact enough */
    SMALLEST = 40, /* least length of the shorter side of a copy */
    N_SIZES = 6,
    MARGIN = 9,      /* least pixels from the border to a corner */
    GRID = 8,        /* cells per side */
    RADIUS = 9,      /* radius of the patch that gives a corner's
                      * direction */
    DIRECTIONS = 36, /* bins of the direction histogram */
    PLACES = 4,      /* cells per side of a descriptor */
    TURNS = 8        /* direction bins in each cell */
};

/* Size of each copy relative to the previous one: 1 / sqrt(2). */
#define SHRINK 0.70710678118654752
#define PLACE_WIDTH 4.0 /* pixels per cell of a descriptor */
/* Least strength, in squared grey levels from 0 to 1; weaker corners are camera
 * noise. */
#define LEAST_CORNER 2e-5
/* Limit for each number of a descriptor, since highlights change single
 * gradients. */
#define MOST_PART 0.2f
#define PI 3.14159265358979324

/* A grey image, 0 to 1, (height, width). Its pixels are `scale` pixels of the
 * picture wide. */
typedef struct image {
    float *at;
    int width, height;
    double scale;
} image;

typedef struct corner {
    double x, y; /* in pixels of the image; its first pixel has its
                  * centre at (1/2, 1/2) */
    float strength;
    int size; /* index of the image */
} corner;

static size_t n_pixels(const image *a)
{
    return (size_t)a->width * (size_t)a->height;
}

static float pixel(const image *a, int x, int y)
{
    x = x < 0 ? 0 : x >= a->width ? a->width - 1 : x;
    y = y < 0 ? 0 : y >= a->height ? a->height - 1 : y;
    return a->at[(size_t)y * (size_t)a->width + (size_t)x];
}

/* -------------------------------------------------------------------- sizes */

/* Makes a grey image from averages of boxes of n x n pixels; its longer side is
 * at most LARGEST. */
static bool take_grey(image *to, const uint8_t *rgb, int width, int height,
                      saga_error *error)
{
    const int longer = width > height ? width : height;
    const int n = (longer + LARGEST - 1) / LARGEST;
    *to = (image){ .width = width / n, .height = height / n, .scale = n };
    if (to->width == 0 || to->height == 0)
        return true;
    to->at = saga_calloc(n_pixels(to), sizeof *to->at, "the features", error);
    for (int y = 0; to->at && y < to->height * n; y++) {
        const uint8_t *const row = rgb + (size_t)y * (size_t)width * 3;
        float *const sum = to->at + (size_t)(y / n) * (size_t)to->width;
        /* Luma weights of 0.3, 0.6, 0.1 are near enough to any standard's. */
        for (int x = 0; x < to->width * n; x++)
            sum[x / n] += (float)(3 * row[3 * x] + 6 * row[3 * x + 1] +
                                  row[3 * x + 2]) /
                          (2550.0f * (float)(n * n));
    }
    return to->at != NULL;
}

/* A filter has five taps; these are the weights at distances 0, 1 and 2. */
static const float bell[3] = { 6.0f / 16, 4.0f / 16, 1.0f / 16 };
static const float box[3] = { 0.2f, 0.2f, 0.2f };

/* Filters an image along x and then along y; scratch has the image's size. */
static void filter(image *a, const float w[3], float *scratch)
{
    image b = { scratch, a->width, a->height, a->scale };
    for (int way = 0; way < 2; way++) {
        const image *const from = way ? &b : a;
        float *to = way ? a->at : scratch;
        const int dx = !way, dy = way;
        for (int y = 0; y < a->height; y++)
            for (int x = 0; x < a->width; x++) {
                float sum = w[0] * pixel(from, x, y);
                for (int k = 1; k < 3; k++)
                    sum += w[k] * (pixel(from, x - k * dx, y - k * dy) +
                                   pixel(from, x + k * dx, y + k * dy));
                *to++ = sum;
            }
    }
}

/* Makes the next smaller image from a blurred one. */
static bool shrink(image *to, const image *from, saga_error *error)
{
    *to = (image){ .width = (int)(from->width * SHRINK),
                   .height = (int)(from->height * SHRINK) };
    to->scale = from->scale * from->width / to->width;
    to->at = saga_alloc(n_pixels(to), sizeof *to->at, "the features", error);
    const double step_x = (double)from->width / to->width;
    const double step_y = (double)from->height / to->height;
    for (int y = 0; to->at && y < to->height; y++)
        for (int x = 0; x < to->width; x++) {
            /* The value is interpolated between the centres of the four nearest
             * pixels. */
            const double u = (x + 0.5) * step_x - 0.5;
            const double v = (y + 0.5) * step_y - 0.5;
            const int i = (int)floor(u), j = (int)floor(v);
            const float a = (float)(u - i), b = (float)(v - j);
            to->at[(size_t)y * (size_t)to->width + (size_t)x] =
                (1 - b) *
                    ((1 - a) * pixel(from, i, j) + a * pixel(from, i + 1, j)) +
                b * ((1 - a) * pixel(from, i, j + 1) +
                     a * pixel(from, i + 1, j + 1));
        }
    return to->at != NULL;
}

/* ------------------------------------------------------------------ corners */

/* Sets the corner strength of each pixel. scratch has the size of three
 * images. */
static void find_strengths(float *strength, const image *a, float *scratch)
{
    const size_t n = n_pixels(a);
    float *const xx = scratch, *const xy = scratch + n, *const yy = strength;
    for (int y = 0; y < a->height; y++)
        for (int x = 0; x < a->width; x++) {
            const size_t i = (size_t)y * (size_t)a->width + (size_t)x;
            const float gx = (pixel(a, x + 1, y) - pixel(a, x - 1, y)) / 2;
            const float gy = (pixel(a, x, y + 1) - pixel(a, x, y - 1)) / 2;
            xx[i] = gx * gx;
            xy[i] = gx * gy;
            yy[i] = gy * gy;
        }
    float *const sums[3] = { xx, xy, yy };
    for (int k = 0; k < 3; k++) {
        image one = { sums[k], a->width, a->height, a->scale };
        filter(&one, box, scratch + 2 * n);
    }
    /* The strength is the smaller eigenvalue of ((xx, xy), (xy, yy)). */
    for (size_t i = 0; i < n; i++) {
        const float half = (xx[i] - yy[i]) / 2;
        strength[i] = (xx[i] + yy[i]) / 2 - sqrtf(half * half + xy[i] * xy[i]);
    }
}

/* Returns the offset of the maximum of the parabola through l, c, r at -1, 0,
 * 1. */
static double peak(float l, float c, float r)
{
    const double bend = (double)l - 2.0 * (double)c + (double)r;
    return bend < 0.0 ? 0.5 * ((double)l - (double)r) / bend : 0.0;
}

static bool is_largest(const image *s, int x, int y)
{
    const float c = pixel(s, x, y);
    for (int dy = -2; dy <= 2; dy++)
        for (int dx = -2; dx <= 2; dx++)
            if ((dx || dy) && pixel(s, x + dx, y + dy) >= c)
                return false;
    return true;
}

/* Adds the corners of one image to the list until it is full. Returns its new
 * length. */
static size_t add_corners(corner *list, size_t n, size_t most, const image *a,
                          const float *strength, int size)
{
    const image s = { (float *)(uintptr_t)strength, a->width, a->height, 1.0 };
    for (int y = MARGIN; y < a->height - MARGIN; y++)
        for (int x = MARGIN; x < a->width - MARGIN; x++) {
            const float c = pixel(&s, x, y);
            if (n == most || !((double)c > LEAST_CORNER) ||
                !is_largest(&s, x, y))
                continue;
            list[n++] = (corner){
                .x = x + 0.5 +
                     peak(pixel(&s, x - 1, y), c, pixel(&s, x + 1, y)),
                .y = y + 0.5 +
                     peak(pixel(&s, x, y - 1), c, pixel(&s, x, y + 1)),
                .strength = c,
                .size = size
            };
        }
    return n;
}

static int by_strength(const void *a, const void *b)
{
    const corner *const x = a, *const y = b;
    return (x->strength < y->strength) - (x->strength > y->strength);
}

/* Keeps the strongest corners of each cell and image. The limit for an image is
 * proportional to its area, so that all have the same density of corners. */
static size_t spread(corner *list, size_t n, const image *images, int n_images)
{
    size_t taken[N_SIZES][GRID * GRID] = { { 0 } }, most[N_SIZES];
    double area = 0.0;
    size_t kept = 0;
    /* Limit the number of each cell by the image's fraction of the total
     * area. */
    for (int i = 0; i < n_images; i++)
        area += (double)n_pixels(&images[i]);
    for (int i = 0; i < n_images; i++)
        most[i] = (size_t)ceil(SAGA_FEATURES_MOST / area *
                               (double)n_pixels(&images[i]) / (GRID * GRID));
    /* The strongest corners are taken first, until their cell is full. */
    qsort(list, n, sizeof *list, by_strength);
    for (size_t i = 0; i < n && kept < SAGA_FEATURES_MOST; i++) {
        const corner c = list[i];
        const image *const a = &images[c.size];
        const int cell = (int)(c.y * GRID / a->height) * GRID +
                         (int)(c.x * GRID / a->width);
        if (taken[c.size][cell] == most[c.size])
            continue;
        taken[c.size][cell]++;
        list[kept++] = c;
    }
    return kept;
}

/* ------------------------------------------------------------- descriptions */

static void gradient_at(const image *a, int x, int y, double *length,
                        double *angle)
{
    const double gx = (double)(pixel(a, x + 1, y) - pixel(a, x - 1, y));
    const double gy = (double)(pixel(a, x, y + 1) - pixel(a, x, y - 1));
    *length = hypot(gx, gy);
    *angle = atan2(gy, gx);
}

/* Returns the dominant direction of the gradients around a corner. */
static double strongest_direction(const image *a, const corner *c)
{
    double sum[DIRECTIONS] = { 0.0 }, length, angle;
    const int cx = (int)c->x, cy = (int)c->y;
    int best = 0;
    for (int y = cy - RADIUS; y <= cy + RADIUS; y++)
        for (int x = cx - RADIUS; x <= cx + RADIUS; x++) {
            const double dx = x + 0.5 - c->x, dy = y + 0.5 - c->y;
            gradient_at(a, x, y, &length, &angle);
            /* The weight is a Gaussian with a deviation of half the radius. */
            length *= exp(-2.0 * (dx * dx + dy * dy) / (RADIUS * RADIUS));
            const int k = (int)floor((angle / (2.0 * PI) + 1.0) * DIRECTIONS);
            sum[k % DIRECTIONS] += length;
        }
    /* Neighbouring bins count too, so that a direction between two bins gets
     * both. */
    double smooth[DIRECTIONS];
    for (int k = 0; k < DIRECTIONS; k++)
        smooth[k] = sum[(k + DIRECTIONS - 1) % DIRECTIONS] + 2.0 * sum[k] +
                    sum[(k + 1) % DIRECTIONS];
    for (int k = 1; k < DIRECTIONS; k++)
        best = smooth[k] > smooth[best] ? k : best;
    const double offset = peak(
        (float)smooth[(best + DIRECTIONS - 1) % DIRECTIONS],
        (float)smooth[best], (float)smooth[(best + 1) % DIRECTIONS]);
    return (best + 0.5 + offset) / DIRECTIONS * 2.0 * PI;
}

/* Adds a gradient to the two nearest cells along each axis and to the two
 * nearest direction bins, with bilinear weights. */
static void add_gradient(float *at, double u, double v, double turn,
                         double length)
{
    const int i = (int)floor(u), j = (int)floor(v), k = (int)floor(turn);
    for (int n = 0; n < 8; n++) {
        const int x = i + (n & 1), y = j + (n >> 1 & 1), t = k + (n >> 2);
        if (x < 0 || y < 0 || x >= PLACES || y >= PLACES)
            continue;
        at[(y * PLACES + x) * TURNS + (t + 2 * TURNS) % TURNS] +=
            (float)(length * (1.0 - fabs(u - x)) * (1.0 - fabs(v - y)) *
                    (1.0 - fabs(turn - t)));
    }
}

static void normalise(float *at)
{
    float sum = 1e-12f;
    for (int i = 0; i < SAGA_FEATURE_NUMBERS; i++)
        sum += at[i] * at[i];
    for (int i = 0; i < SAGA_FEATURE_NUMBERS; i++)
        at[i] /= sqrtf(sum);
}

static void describe(saga_feature *f, const image *a, const corner *c)
{
    const double direction = strongest_direction(a, c);
    const double cosine = cos(direction), sine = sin(direction);
    /* The patch reaches half the diagonal of PLACES + 1 cells, since the grid
     * may be rotated by 45 degrees. */
    const int reach = (int)(PLACE_WIDTH * (PLACES + 1) * SHRINK + 1.0);
    *f = (saga_feature){ .x = c->x * a->scale, .y = c->y * a->scale };
    for (int y = (int)c->y - reach; y <= (int)c->y + reach; y++)
        for (int x = (int)c->x - reach; x <= (int)c->x + reach; x++) {
            const double dx = x + 0.5 - c->x, dy = y + 0.5 - c->y;
            /* Coordinates in cells along the corner's direction and across it;
             * the centre of the grid is at 0. */
            const double u = (cosine * dx + sine * dy) / PLACE_WIDTH;
            const double v = (cosine * dy - sine * dx) / PLACE_WIDTH;
            const double middle = (PLACES - 1) / 2.0;
            double length, angle;
            if (fabs(u) >= middle + 1.0 || fabs(v) >= middle + 1.0)
                continue;
            gradient_at(a, x, y, &length, &angle);
            length *= exp(-(u * u + v * v) / (2.0 * PLACES));
            add_gradient(f->at, u + middle, v + middle,
                         (angle - direction) / (2.0 * PI) * TURNS, length);
        }
    normalise(f->at);
    for (int i = 0; i < SAGA_FEATURE_NUMBERS; i++)
        f->at[i] = f->at[i] > MOST_PART ? MOST_PART : f->at[i];
    normalise(f->at);
}

/* ----------------------------------------------------------------- together */

/* Tells whether a corner lies on a pixel that counts. */
static bool counts(const corner *c, const image *a, const uint8_t *mask,
                   int width, int height)
{
    const int x = (int)(c->x * a->scale), y = (int)(c->y * a->scale);
    return !mask || (x < width && y < height &&
                     mask[(size_t)y * (size_t)width + (size_t)x]);
}

bool saga_features_find(saga_features *features, const uint8_t *rgb,
                        const uint8_t *mask, int width, int height,
                        saga_error *error)
{
    image images[N_SIZES] = { { .at = NULL } };
    int n_images = 0;
    size_t n = 0;
    *features = (saga_features){ .n = 0 };
    bool ok = take_grey(&images[0], rgb, width, height, error);
    const size_t area = ok ? n_pixels(&images[0]) : 0;
    /* A corner is the maximum of 5 x 5 pixels, so at most one pixel in nine is
     * one, and all images together have twice the area of the first. */
    const size_t most = area / 4 + 1;
    float *const scratch = saga_alloc(4 * area, sizeof *scratch, "the features",
                                      error);
    corner *const corners = saga_alloc(most, sizeof *corners, "the features",
                                       error);
    features->list = saga_calloc(SAGA_FEATURES_MOST, sizeof *features->list,
                                 "the features", error);
    ok = ok && scratch && corners && features->list;
    for (; ok && n_images < N_SIZES; n_images++) {
        image *const a = &images[n_images];
        if (n_images > 0 && !shrink(a, a - 1, error))
            ok = false;
        if (!ok || a->width < SMALLEST || a->height < SMALLEST)
            break;
        filter(a, bell, scratch);
        find_strengths(scratch + 3 * area, a, scratch);
        n = add_corners(corners, n, most, a, scratch + 3 * area, n_images);
    }
    n = spread(corners, n, images, n_images);
    for (size_t i = 0; i < n; i++) {
        const image *const a = &images[corners[i].size];
        if (counts(&corners[i], a, mask, width, height))
            describe(&features->list[features->n++], a, &corners[i]);
    }
    for (int i = 0; i < N_SIZES; i++)
        free(images[i].at);
    free(scratch);
    free(corners);
    return ok;
}
