/* SPDX-License-Identifier: MIT */
#include "conv.h"

#include "alloc.h"
#include "threads.h"
#include "vec.h"

#include <stdlib.h>
#include <string.h>

/* A thread computes BLOCK pixels at a time. The samples in their windows are
 * first copied to a matrix with one row per tap, so that the sums run along
 * vectors. */
enum {
    GROUP = SAGA_CONV_GROUP,
    PANEL = 2 * VEC_LANES, /* pixels whose sums are in registers */
    BLOCK = 64
};

static const char purpose[] = "comparing two pictures";

bool saga_conv_pack(saga_conv *c, const double *weight, const double *bias,
                    saga_error *error)
{
    const size_t k = (size_t)c->n_in * (size_t)c->size * (size_t)c->size;
    const size_t n = (size_t)c->n_out;
    const size_t n_groups = (n + GROUP - 1) / GROUP;

    c->weight = saga_calloc(n_groups * GROUP * k, sizeof *c->weight, purpose,
                            error);
    c->bias = saga_calloc(n_groups * GROUP, sizeof *c->bias, purpose, error);
    if (!c->weight || !c->bias)
        return false;
    /* The weights of a tap for GROUP planes lie side by side, as sum_panel
     * reads them; planes beyond the last keep zeros. */
    for (size_t o = 0; o < n; o++) {
        float *const to = c->weight + o / GROUP * GROUP * k + o % GROUP;

        for (size_t i = 0; i < k; i++)
            to[GROUP * i] = (float)weight[o * k + i];
        c->bias[o] = (float)bias[o];
    }
    return true;
}

void saga_conv_free(saga_conv *c)
{
    free(c->weight);
    free(c->bias);
    c->weight = c->bias = NULL;
}

/* --- Windows side by side ------------------------------------------------ */

/* Some pixels of one output row. */
typedef struct {
    int y, x, n;
} run;

/* Copies the samples that tap (plane, ky, kx) reads for the pixels of a run;
 * zeros outside the picture. */
static void copy_run(float *to, const saga_conv *c, const saga_planes *in,
                     const int tap[3], const run *r)
{
    const int y = r->y * c->stride + tap[1] - c->pad;
    const float *const row = in->v +
                             ((ptrdiff_t)tap[0] * in->height + y) * in->width;

    for (int i = 0; i < r->n; i++) {
        const int x = (r->x + i) * c->stride + tap[2] - c->pad;

        to[i] = y >= 0 && y < in->height && x >= 0 && x < in->width ? row[x]
                                                                    : 0.0f;
    }
}

/* Fills column (taps, BLOCK) for the pixels from `first` on; pixels past the
 * end of the picture get zeros. */
static void fill(float *column, const saga_conv *c, const saga_planes *in,
                 const saga_planes *out, int first)
{
    const int end = out->width * out->height;
    const int n = end - first < BLOCK ? end - first : BLOCK;

    for (int plane = 0; plane < c->n_in; plane++)
        for (int ky = 0; ky < c->size; ky++)
            for (int kx = 0; kx < c->size; kx++, column += BLOCK) {
                const int tap[3] = { plane, ky, kx };

                /* A block may span several output rows; it is copied in runs,
                 * each within one row. */
                for (int done = 0; done < n;) {
                    const int x = (first + done) % out->width;
                    const int left = out->width - x;
                    const run r = { (first + done) / out->width, x,
                                    left < n - done ? left : n - done };

                    copy_run(column + done, c, in, tap, &r);
                    done += r.n;
                }
                memset(column + n, 0, (size_t)(BLOCK - n) * sizeof *column);
            }
}

/* --- Sums ---------------------------------------------------------------- */

/* Computes GROUP planes of PANEL pixels: sum is (GROUP, PANEL). */
static void sum_panel(float *sum, const float *weight, const float *column,
                      size_t n_taps)
{
    vec a[GROUP][2];

    for (int o = 0; o < GROUP; o++)
        a[o][0] = a[o][1] = vec_zero();
    /* GROUP x 2 sums stay in registers while all taps are added in order. */
    for (size_t k = 0; k < n_taps; k++) {
        const vec x0 = vec_load(column + k * BLOCK);
        const vec x1 = vec_load(column + k * BLOCK + VEC_LANES);

        for (int o = 0; o < GROUP; o++) {
            const vec w = vec_set1(weight[GROUP * k + (size_t)o]);

            a[o][0] = vec_fma(w, x0, a[o][0]);
            a[o][1] = vec_fma(w, x1, a[o][1]);
        }
    }
    for (int o = 0; o < GROUP; o++) {
        vec_store(sum + o * PANEL, a[o][0]);
        vec_store(sum + o * PANEL + VEC_LANES, a[o][1]);
    }
}

/* Stores a panel's sums of plane o, with bias and ReLU. */
static void store(const saga_planes *out, const saga_conv *c, int o, int first,
                  const float *sum)
{
    const int n = out->width * out->height;
    float *const to = out->v + (ptrdiff_t)o * n;

    for (int i = 0; i < PANEL && first + i < n; i++) {
        const float v = sum[i] + c->bias[o];

        to[first + i] = v > 0.0f ? v : 0.0f;
    }
}

static void run_block(const saga_planes *out, const saga_conv *c,
                      const saga_planes *in, int first, float *column)
{
    const size_t n_taps = (size_t)c->n_in * (size_t)c->size * (size_t)c->size;

    fill(column, c, in, out, first);
    for (int o = 0; o < c->n_out; o += GROUP)
        for (int p = 0; p < BLOCK; p += PANEL) {
            /* Planes of the last group that do not exist are computed, but not
             * stored. */
            float sum[GROUP * PANEL];

            sum_panel(sum, c->weight + (size_t)o * n_taps, column + p, n_taps);
            for (int i = 0; i < GROUP && o + i < c->n_out; i++)
                store(out, c, o + i, first + p, sum + i * PANEL);
        }
}

/* Returns the number of windows of `size` along a side; 0 if it is too
 * small. */
static int count(int side, int size, int stride)
{
    return side < size ? 0 : (side - size) / stride + 1;
}

/* Allocates the planes; leaves v NULL if they have no pixels. */
static bool make_planes(saga_planes *p, saga_error *error)
{
    const size_t n = (size_t)p->n * (size_t)p->height * (size_t)p->width;

    p->v = n ? saga_alloc(n, sizeof *p->v, purpose, error) : NULL;
    return p->v || !n;
}

bool saga_conv_run(saga_planes *out, const saga_conv *c, const saga_planes *in,
                   int n_threads, saga_error *error)
{
    const size_t n_taps = (size_t)c->n_in * (size_t)c->size * (size_t)c->size;
    int n;
    float *columns;

    *out = (saga_planes){
        .n = c->n_out,
        .height = count(in->height + 2 * c->pad, c->size, c->stride),
        .width = count(in->width + 2 * c->pad, c->size, c->stride)
    };
    if (!make_planes(out, error) || !out->v)
        return !saga_failed(error);
    columns = saga_alloc((size_t)n_threads * n_taps, BLOCK * sizeof *columns,
                         purpose, error);
    n = out->width * out->height;
    if (!columns) {
        free(out->v);
        out->v = NULL;
        return false;
    }
/* Each thread has its own column; blocks write different pixels. */
#pragma omp parallel for num_threads(n_threads) schedule(dynamic)
    for (int first = 0; first < n; first += BLOCK)
        run_block(out, c, in, first,
                  columns + saga_thread_number() * n_taps * BLOCK);
    free(columns);
    return true;
}

/* --- Pooling ------------------------------------------------------------- */

static float largest(const saga_planes *in, int plane, int y0, int x0, int size)
{
    const float *const p = in->v + (ptrdiff_t)plane * in->height * in->width;
    float most = p[y0 * in->width + x0];

    for (int y = y0; y < y0 + size && y < in->height; y++)
        for (int x = x0; x < x0 + size && x < in->width; x++) {
            const float v = p[y * in->width + x];

            most = v > most ? v : most;
        }
    return most;
}

/* Returns the number of pooling windows along a side. With `ceil` a last window
 * that is not full counts; it begins inside the picture, because the stride is
 * at most the size. */
static int count_pool(int side, int size, int stride, bool ceil)
{
    return side < 1 ? 0
                    : count(side + (ceil && side >= size ? stride - 1 : 0),
                            size, stride);
}

bool saga_pool_max(saga_planes *out, const saga_planes *in, int size,
                   int stride, bool ceil, saga_error *error)
{
    float *to;

    *out = (saga_planes){ .n = in->n,
                          .height = count_pool(in->height, size, stride, ceil),
                          .width = count_pool(in->width, size, stride, ceil) };
    if (!make_planes(out, error) || !out->v)
        return !saga_failed(error);
    to = out->v;
    for (int p = 0; p < in->n; p++)
        for (int y = 0; y < out->height; y++)
            for (int x = 0; x < out->width; x++)
                *to++ = largest(in, p, y * stride, x * stride, size);
    return true;
}

SAGA_ISA_CHOOSE(saga_conv_pack);
SAGA_ISA_CHOOSE(saga_conv_free);
SAGA_ISA_CHOOSE(saga_conv_run);
SAGA_ISA_CHOOSE(saga_pool_max);
