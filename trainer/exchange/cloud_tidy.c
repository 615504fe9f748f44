/* SPDX-License-Identifier: MIT */
#include "cloud_files.h"

#include "alloc.h"

#include <inttypes.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

/* Fully opaque splats may have an infinite logit; it is cut here. */
#define MOST_LOGIT 16.0f

/* The decoder draws nothing below an opacity of 1/256, which has this logit. */
#define LEAST_LOGIT (-5.54f)

/* Larger numbers make no sense for any attribute. */
#define MOST_NUMBER 1e6f

enum { KEEP = -1 };

/* Tells why a splat is left out, or returns KEEP. */
typedef int judge_fn(const saga_cloud *c, size_t i);

static bool are_sound(const float *v, size_t n)
{
    /* The comparison is written so that NaN fails it. */
    for (size_t i = 0; i < n; i++)
        if (!(fabsf(v[i]) <= MOST_NUMBER))
            return false;
    return true;
}

static bool are_zero(const float *v, size_t n)
{
    for (size_t i = 0; i < n; i++)
        if (fabsf(v[i]) > 0.0f)
            return false;
    return true;
}

/* Judges the numbers as the file has them. */
static int judge_numbers(const saga_cloud *c, size_t i)
{
    const size_t each = 3 * (size_t)saga_n_harmonics(c->degree);

    if (!are_sound(c->mean + 3 * i, 3) || !are_sound(c->quat + 4 * i, 4) ||
        !are_sound(c->log_scale + 3 * i, 3) ||
        !are_sound(c->colour + each * i, each) || isnan(c->logit[i]))
        return SAGA_FACT_BROKEN;
    return are_zero(c->mean + 3 * i, 3) && are_zero(c->quat + 4 * i, 4) &&
                   are_zero(c->log_scale + 3 * i, 3) &&
                   are_zero(c->logit + i, 1)
               ? SAGA_FACT_ZERO
               : KEEP;
}

/* Judges logarithms of scales and logits of opacities. */
static int judge_meaning(const saga_cloud *c, size_t i)
{
    if (!are_sound(c->log_scale + 3 * i, 3) || isnan(c->logit[i]))
        return SAGA_FACT_BROKEN;
    return c->logit[i] >= LEAST_LOGIT ? KEEP : SAGA_FACT_FAINT;
}

static void move(saga_cloud *c, size_t to, size_t from)
{
    const size_t each = 3 * (size_t)saga_n_harmonics(c->degree);

    memmove(c->mean + 3 * to, c->mean + 3 * from, 3 * sizeof(float));
    memmove(c->quat + 4 * to, c->quat + 4 * from, 4 * sizeof(float));
    memmove(c->log_scale + 3 * to, c->log_scale + 3 * from, 3 * sizeof(float));
    memmove(c->colour + each * to, c->colour + each * from,
            each * sizeof(float));
    c->logit[to] = c->logit[from];
}

static void keep(saga_cloud *c, judge_fn *judge)
{
    const size_t n = c->n;

    c->n = 0;
    for (size_t i = 0; i < n; i++) {
        const int why = judge(c, i);

        if (why == KEEP)
            move(c, c->n++, i);
        else
            c->facts.count[why]++;
    }
}

/* Gives a quaternion the length 1; length 0 means no rotation. Returns whether
 * it had a length. */
static bool make_unit(float q[4])
{
    double square = 0.0;

    for (int k = 0; k < 4; k++)
        square += (double)q[k] * (double)q[k];
    for (int k = 0; k < 4; k++)
        q[k] = square > 0.0 ? (float)((double)q[k] / sqrt(square)) : k == 0;
    return square > 0.0;
}

bool saga_cloud_tidy(saga_cloud *cloud, const char *path, saga_error *error)
{
    char why[SAGA_FACTS_NBYTES];
    int from = 0;

    /* What the numbers mean is found out when they are all numbers. */
    cloud->facts.n = cloud->n;
    keep(cloud, judge_numbers);
    saga_cloud_settle(cloud);
    keep(cloud, judge_meaning);
    for (size_t i = 0; i < cloud->n; i++) {
        cloud->logit[i] = fminf(cloud->logit[i], MOST_LOGIT);
        if (!make_unit(cloud->quat + 4 * i))
            cloud->facts.count[SAGA_FACT_UNTURNED]++;
    }
    if (cloud->n)
        return true;
    if (saga_cloud_facts_line(why, &from, &cloud->facts))
        saga_fail(error, path, "export it again", "has no splat to show: %s",
                  why);
    else if (cloud->n_frames)
        saga_fail(error, path, "take out the frames that show nothing",
                  "has no visible splat at frame %" PRIu32 " of %" PRIu32,
                  cloud->frame, cloud->n_frames);
    else
        saga_fail(error, path, "leave it out", "has no splats");
    saga_cloud_free(cloud);
    return false;
}

/* --- Fewer splats -------------------------------------------------------- */

typedef struct {
    double weight;
    size_t index;
} weighted;

static int heavier(const void *a, const void *b)
{
    const weighted *const x = a, *const y = b;

    return x->weight < y->weight || x->weight > y->weight
               ? (x->weight < y->weight) - (x->weight > y->weight)
               : (x->index > y->index) - (x->index < y->index);
}

static int earlier(const void *a, const void *b)
{
    const weighted *const x = a, *const y = b;

    return (x->index > y->index) - (x->index < y->index);
}

/* Returns the logarithm of opacity times area; the area is that of the two
 * longest axes. */
static double weight_of(const saga_cloud *c, size_t i)
{
    const float *const s = c->log_scale + 3 * i;

    return -log1p(exp(-(double)c->logit[i])) +
           (double)(s[0] + s[1] + s[2] - fminf(fminf(s[0], s[1]), s[2]));
}

bool saga_cloud_thin(saga_cloud *cloud, size_t n, saga_error *error)
{
    weighted *w;

    if (n >= cloud->n)
        return true;
    w = saga_alloc(cloud->n, sizeof *w, "splats", error);
    if (!w)
        return false;
    for (size_t i = 0; i < cloud->n; i++)
        w[i] = (weighted){ weight_of(cloud, i), i };
    qsort(w, cloud->n, sizeof *w, heavier);
    /* Those that stay keep their order. */
    qsort(w, n, sizeof *w, earlier);
    for (size_t i = 0; i < n; i++)
        move(cloud, i, w[i].index);
    cloud->facts.count[SAGA_FACT_SMALL] += cloud->n - n;
    cloud->n = n;
    free(w);
    return true;
}
