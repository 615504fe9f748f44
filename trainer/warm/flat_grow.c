/* SPDX-License-Identifier: MIT
 *
 * Decides how many primitives there are, and where. In the first quarter of the
 * training, rounds of growing raise their number to twice n_primitives. Some
 * are made by splitting primitives whose projected position has the largest
 * gradient, most from the pixels with the largest error, at their time.
 * Afterwards the primitives that are worth least are removed in three steps,
 * down to exactly n_primitives.
 */
#include "flat_state.h"

#include "alloc.h"
#include "plane_sweep.h"
#include "threads.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { N_PRUNES = 3, N_ROUNDS = 40, N_PICTURES = 8 };

#define FIRST_PRUNE 0.35
#define PRUNE_STEP 0.1
#define FROM_PIXELS 0.9 /* part of the new primitives */
/* On the squared error of pixels that move, where places of new primitives are
 * drawn. */
#define MOVING_FACTOR 4.0
#define MOVING_LEVEL 8 /* of 255: a pixel moves if it changes by more */
#define DEAD R(-6)     /* opacity, in log2 units */

/* --- Ranking ------------------------------------------------------------- */

typedef struct ranked {
    real score;
    uint32_t i;
} ranked;

static const char ranking[] = "the ranking of primitives";

/* Sorts by descending score, and by index where scores are equal. */
static int compare(const void *a, const void *b)
{
    const ranked *const p = a, *const q = b;

    if (p->score != q->score)
        return p->score > q->score ? -1 : 1;
    return (p->i > q->i) - (p->i < q->i);
}

static ranked *rank(const saga_flat *f,
                    real (*score)(const saga_flat *, uint32_t),
                    saga_error *error)
{
    ranked *const r = saga_alloc(f->n, sizeof *r, ranking, error);

    for (uint32_t i = 0; r && i < f->n; i++)
        r[i] = (ranked){ score(f, i), i };
    if (r)
        qsort(r, f->n, sizeof *r, compare);
    return r;
}

static real worth(const saga_flat *f, uint32_t i)
{
    return f->worth[i];
}

/* Returns the mean gradient of the projected position over the pictures that
 * show the primitive, times the root of their number. Otherwise a short-lived
 * primitive would be split as readily as one that is always visible. */
static real doubt(const saga_flat *f, uint32_t i)
{
    const real seen = R(f->stats.seen[i]);

    if (seen < 1 || f->value.opacity[i] < -4)
        return 0;
    return f->stats.grad2d[i] / (real)sqrt(seen);
}

/* --- Removing ------------------------------------------------------------ */

static bool is_dead(const saga_flat *f, uint32_t i)
{
    const real seen = R(f->stats.seen[i]);

    /* A primitive is dead if it is too transparent, or if at least four
     * pictures may show it and its mean weight in them is below a fiftieth of a
     * pixel. */
    return f->value.opacity[i] < DEAD ||
           (seen >= 4 && f->stats.weight[i] < R(0.02) * seen);
}

static bool remove_dead(saga_flat *f, saga_error *error)
{
    uint8_t *const keep = saga_alloc(f->n, 1, ranking, error);
    uint32_t left = 0;

    if (!keep)
        return false;
    for (uint32_t i = 0; i < f->n; i++)
        left += keep[i] = !is_dead(f, i);
    /* An empty set could not grow again by splitting. */
    if (left > 0)
        saga_flat_keep(f, keep);
    free(keep);
    return true;
}

static bool reduce(saga_flat *f, uint32_t n, saga_error *error)
{
    uint8_t *const keep = saga_calloc(f->n, 1, ranking, error);
    ranked *const r = rank(f, worth, error);
    const bool ok = keep && r;

    if (ok) {
        for (uint32_t k = 0; k < n; k++)
            keep[r[k].i] = 1;
        saga_flat_keep(f, keep);
    }
    free(r);
    free(keep);
    return ok;
}

/* --- Splitting ----------------------------------------------------------- */

/* Splits a primitive along its longest axis into halves at +-0.6 sigma, each of
 * 0.75 sigma. */
static void split(saga_flat *f, uint32_t i)
{
    const size_t one = 3 * (size_t)i;
    const size_t two = 3 * (size_t)saga_flat_append_copy(f, i);
    real *const mean = f->value.mean, *const size = f->value.log2_scale;
    real axes[3][3];
    size_t k = 0;

    for (size_t a = 1; a < 3; a++)
        if (size[one + a] > size[one + k])
            k = a;
    saga_flat_axes(axes, f->value.quat + 4 * (size_t)i);
    for (size_t a = 0; a < 3; a++) {
        const real d = R(0.6) * (real)exp2((double)size[one + k]) * axes[k][a];

        mean[one + a] -= d;
        mean[two + a] += d;
    }
    /* This is log2 0.75. The variance of both halves together is 0.6^2 + 0.75^2
     * = 0.92 of the old one. */
    size[one + k] -= R(0.415);
    size[two + k] = size[one + k];
    saga_flat_forget(f, i);
}

/* Splits up to n primitives, for which there must be room. */
static bool split_most(saga_flat *f, uint32_t n, bool any, saga_error *error)
{
    const uint32_t before = f->n;
    ranked *const r = rank(f, any ? worth : doubt, error);

    if (!r)
        return false;
    /* Each primitive is split at most once; its halves can be split in the next
     * round. */
    for (uint32_t k = 0; k < n && k < before; k++)
        if (any || r[k].score > 0)
            split(f, r[k].i);
    free(r);
    return true;
}

/* --- From pixels --------------------------------------------------------- */

/* Candidates for new primitives. sum: squared error over the channels, counted
 * MOVING_FACTOR times where the pixel moves, accumulated along the picture. */
typedef struct {
    saga_flat_sight *sight;
    uint8_t *good;
    double *sum;
} places;

static size_t n_pixels(const saga_flat *f)
{
    return (size_t)f->canvas.camera.width * (size_t)f->canvas.camera.height;
}

/* Sets rgb to the picture and to what its view saw a third and two thirds of
 * the capture later, cyclically. A missing picture is replaced by this one. */
static void three_frames(const uint8_t *rgb[3], const saga_flat *f,
                         saga_sample picture)
{
    const saga_capture *const c = f->pictures->capture;

    for (int k = 0; k < 3; k++) {
        const int at = (picture.frame + k * c->n_frames / 3) % c->n_frames;

        rgb[k] = saga_capture_frame(
            c, picture.view,
            saga_capture_has(c, picture.view, at) ? at : picture.frame);
    }
}

/* Tells whether a pixel moves: in some channel it is brighter than in both
 * other frames by more than MOVING_LEVEL, or darker than in both. `at` is the
 * pixel's offset in bytes. */
static bool moves(const uint8_t *const rgb[3], size_t at)
{
    for (size_t i = at; i < at + 3; i++) {
        const int b = rgb[0][i] - rgb[1][i], c = rgb[0][i] - rgb[2][i];

        if ((b > MOVING_LEVEL && c > MOVING_LEVEL) ||
            (b < -MOVING_LEVEL && c < -MOVING_LEVEL))
            return true;
    }
    return false;
}

static double error_sums(double *sum, const saga_flat *f, saga_sample picture)
{
    const real *const x = f->canvas.image, *const y = f->canvas.truth;
    const size_t n = n_pixels(f), w = (size_t)f->canvas.camera.width;
    const saga_source_view *const view = f->pictures->capture->views +
                                         picture.view;
    const size_t side = (size_t)1 << picture.mip;
    const uint8_t *rgb[3];
    double total = 0;

    three_frames(rgb, f, picture);
    for (size_t i = 0; i < n; i++) {
        /* A pixel of a reduced picture moves if the middle of its box does. */
        const size_t at = (i / w * side + side / 2) *
                              saga_view_row_nbytes(view) +
                          (i % w * side + side / 2) * 3;
        const double factor = f->o.temporal && moves(rgb, at) ? MOVING_FACTOR
                                                              : 1;

        for (size_t k = 0; k < 3; k++) {
            /* A pixel with truth < 0 does not count. */
            const double e = y[i] < 0 ? 0
                                      : (double)(x[i + k * n] - y[i + k * n]);

            total += factor * e * e;
        }
        sum[i] = total;
    }
    return total;
}

static size_t find(const double *sum, size_t n, double at)
{
    size_t lo = 0, hi = n - 1;

    while (lo < hi) {
        /* Finds the first pixel whose accumulated sum is above `at`. A pixel
         * without error is never found. */
        const size_t mid = (lo + hi) / 2;

        if (sum[mid] > at)
            hi = mid;
        else
            lo = mid + 1;
    }
    return lo;
}

/* Looks at n pixels of the drawn picture, chosen with probability proportional
 * to their error: one in each n-th of the sum. */
typedef struct {
    const saga_flat *f;
    const places *p;
    saga_sample picture;
    uint32_t n;
    uint64_t counter;
} job;

static void look_part(void *user, size_t part)
{
    const job *const j = user;
    const saga_flat *const f = j->f;
    const places *const p = j->p;
    const saga_rng r = saga_rng_stream(f->o.seed, FLAT_RNG_GROW);
    const size_t w = (size_t)f->canvas.camera.width, pixels = n_pixels(f);
    const int side = 1 << j->picture.mip;
    const saga_range of = saga_part(j->n, SAGA_PLANE_PART, part);

    for (size_t i = of.begin; i < of.end; i++) {
        /* The draws are stratified, one in each n-th of the sum, so that new
         * primitives are proportional to the error and do not form random
         * clusters. */
        const double along = ((double)i + saga_rng_double(r, j->counter + i)) /
                             j->n;
        const size_t at = find(p->sum, pixels, along * p->sum[pixels - 1]);
        const double u = (double)(at % w) + 0.5;
        const double v = (double)(at / w) + 0.5;

        /* Pixels of a reduced picture are converted to those of the whole
         * one. */
        p->good[i] = saga_flat_look(f, j->picture.view, j->picture.frame,
                                    u * side, v * side, p->sight + i);
    }
}

static void look_where_wrong(job *j)
{
    saga_parallel(&(saga_tasks){ .run = look_part,
                                 .user = j,
                                 .n = saga_n_parts(j->n, SAGA_PLANE_PART),
                                 .ns = (double)SAGA_PLANE_NS * j->n });
}

static bool grow_from_picture(saga_flat *f, const places *p, uint32_t n,
                              uint64_t counter, saga_error *error)
{
    const saga_pictures *const all = f->pictures;
    const saga_rng r = saga_rng_stream(f->o.seed, FLAT_RNG_GROW + 100);
    const saga_sample picture = {
        .view =
            all->train[saga_rng_below(r, 2 * counter, (uint32_t)all->n_train)],
        .frame = (int)saga_rng_below(r, 2 * counter + 1,
                                     (uint32_t)all->capture->n_frames),
        .mip = saga_flat_mip_at(f, f->iteration)
    };

    if (!saga_capture_has(all->capture, picture.view, picture.frame))
        return true;
    if (!saga_flat_draw(f, picture, error))
        return false;
    if (!(error_sums(p->sum, f, picture) > 0))
        return true;
    /* Places are found in parallel and appended in order, so the set does not
     * depend on threads. Each counter has 2^32 numbers of its own. */
    look_where_wrong(&(job){ f, p, picture, n, counter << 32 });
    for (uint32_t i = 0; i < n; i++)
        /* Sigma is 1.5 pixels of the picture at its training size. */
        if (p->good[i])
            saga_flat_add(f, p->sight + i,
                          1.5 * p->sight[i].footprint * (1 << picture.mip));
    return true;
}

static bool grow_from_pixels(saga_flat *f, uint32_t n, saga_error *error)
{
    static const char what[] = "new primitives";
    const uint32_t each = n / N_PICTURES + 1;
    const size_t largest = saga_pictures_largest(f->pictures);
    const places p = { saga_alloc(each, sizeof *p.sight, what, error),
                       saga_alloc(each, 1, what, error),
                       saga_alloc(largest, sizeof *p.sum, what, error) };
    bool ok = p.sight && p.good && p.sum;

    for (uint32_t k = 0; k < N_PICTURES && ok; k++) {
        const uint32_t part = n / N_PICTURES + (k < n % N_PICTURES);

        if (part > 0)
            ok = grow_from_picture(
                f, &p, part, (uint64_t)f->iteration * N_PICTURES + k, error);
    }
    free(p.sight);
    free(p.good);
    free(p.sum);
    return ok;
}

/* --- The schedule -------------------------------------------------------- */

static uint32_t target_at(const saga_flat *f, int iteration)
{
    const double n = f->o.n_primitives;
    const double end = FLAT_GROW_END * f->o.n_iterations;
    const double k = iteration / end;
    const double start = (double)f->o.start, peak = (double)f->o.growth;

    return (uint32_t)(n * (start + (peak - start) * (k < 1 ? k : 1)) + 0.5);
}

static bool grow(saga_flat *f, saga_error *error)
{
    const uint32_t target = target_at(f, f->iteration);
    uint32_t want;

    /* Dead primitives are removed first, so that new ones replace them. */
    if (!remove_dead(f, error))
        return false;
    if (target <= f->n)
        return true;
    if (!saga_flat_reserve(f, target, error))
        return false;
    /* A tenth is made by splitting primitives, as far as any should be split,
     * and the rest from pixels, which needs the pictures. */
    want = target - f->n;
    if (!split_most(f, want - (uint32_t)(FROM_PIXELS * want), false, error))
        return false;
    return target <= f->n ||
           grow_from_pixels(f, (uint32_t)(FROM_PIXELS * want), error);
}

static int round_length(const saga_flat *f)
{
    const int n = (int)(FLAT_GROW_END * f->o.n_iterations / N_ROUNDS);

    /* There are N_ROUNDS rounds of growing, but each has at least 25 pictures,
     * for sufficient statistics, and at most 250. */
    return n < 25 ? 25 : n > 250 ? 250 : n;
}

static void halve(saga_flat *f)
{
    saga_splat_stats *const s = &f->stats;
    const double epoch = (double)f->pictures->n_train *
                         f->pictures->capture->n_frames;
    /* The worth is a sum over all pictures, so it is halved every epoch, not
     * every round. */
    const real kept = (real)exp2(-round_length(f) / epoch);

    for (uint32_t i = 0; i < f->n; i++) {
        s->grad2d[i] /= 2;
        s->weight[i] /= 2;
        f->worth[i] *= kept;
        s->seen[i] /= 2;
    }
}

/* Reduces the number of primitives at prune k; the last one leaves exactly
 * n_primitives. */
static bool prune(saga_flat *f, int k, saga_error *error)
{
    const uint32_t n = f->o.n_primitives;
    const double ratio = (double)f->n / n;
    uint32_t left = n;

    if (k + 1 < N_PRUNES && f->n > n)
        /* Every prune divides by the same factor, here the (N_PRUNES - k)-th
         * root of f->n / n. */
        left = (uint32_t)(n *
                          pow(ratio, (N_PRUNES - 1.0 - k) / (N_PRUNES - k)));
    if (f->n > left)
        return reduce(f, left, error);
    if (k + 1 < N_PRUNES)
        return true;
    /* If too many primitives have died, those worth most are split, repeatedly
     * if needed. */
    if (!saga_flat_reserve(f, n, error))
        return false;
    while (f->n < n)
        if (!split_most(f, n - f->n, true, error))
            return false;
    return true;
}

static int iteration_of_prune(const saga_flat *f, int k)
{
    return (int)(f->o.n_iterations * (FIRST_PRUNE + PRUNE_STEP * k));
}

int saga_flat_first_prune(const saga_flat *f)
{
    return iteration_of_prune(f, 0);
}

void saga_flat_aim(saga_flat *f, uint32_t n_primitives)
{
    f->o.n_primitives = n_primitives;
}

bool saga_flat_leave(saga_flat *f, double left, saga_error *error)
{
    f->iteration = f->o.n_iterations - (int)(left * f->o.n_iterations);
    if (!saga_flat_bring(f, error))
        return false;
    return f->n <= f->o.n_primitives || reduce(f, f->o.n_primitives, error);
}

static bool is_round(const saga_flat *f)
{
    return f->iteration > 0 && f->iteration % round_length(f) == 0;
}

bool saga_flat_change_count(saga_flat *f, saga_error *error)
{
    const int n = f->o.n_iterations, at = f->iteration;
    bool is_due = is_round(f), ok;

    for (int k = 0; k < N_PRUNES; k++)
        is_due = is_due || at == iteration_of_prune(f, k);
    if (!is_due)
        return true;
    ok = saga_flat_bring(f, error);
    for (int k = 0; k < N_PRUNES && ok; k++)
        if (at == iteration_of_prune(f, k))
            ok = prune(f, k, error);
    /* Rounds continue after growth has ended, because prunes need recent
     * statistics. */
    if (!ok || !is_round(f))
        return ok;
    if (at <= FLAT_GROW_END * n)
        ok = grow(f, error);
    halve(f);
    return ok;
}
