/* SPDX-License-Identifier: MIT
 *
 * PLY has logarithms of scales and logits of opacities by custom, and glTF has
 * lengths and opacities. Some writers store the other kind, which nothing in
 * the file says; the numbers show it.
 */
#include "cloud_files.h"

#include <math.h>
#include <stdlib.h>

/* At most this number of splats, at equal distances, is looked at for the size
 * of the scene. */
enum { MOST_SAMPLES = 4096 };

/* Opacities may be this far outside 0..1 by rounding. */
#define SLACK 1e-3f

/* This part of the numbers of a glTF file may be outside their range without
 * being of the other kind. */
#define STRAY 0.01

/* How many splats have a number that only the one kind can have. */
typedef struct {
    size_t negative;   /* scales */
    size_t outside;    /* opacities that are not in 0..1 */
    float least, most; /* the range of the opacities */
} tally;

static tally count(const saga_cloud *c)
{
    tally t = { .least = INFINITY, .most = -INFINITY };

    for (size_t i = 0; i < c->n; i++) {
        const float *const s = c->log_scale + 3 * i;

        t.negative += s[0] < 0.0f || s[1] < 0.0f || s[2] < 0.0f;
        t.outside += c->logit[i] < -SLACK || c->logit[i] > 1.0f + SLACK;
        t.least = fminf(t.least, c->logit[i]);
        t.most = fmaxf(t.most, c->logit[i]);
    }
    return t;
}

static int smaller(const void *a, const void *b)
{
    const float x = *(const float *)a, y = *(const float *)b;

    return (x > y) - (x < y);
}

/* Takes number k of 3 of some of the splats, in ascending order, and returns
 * their number. */
static size_t sample(float to[MOST_SAMPLES], const float *v, size_t n, size_t k)
{
    const size_t every = n / MOST_SAMPLES + 1;
    size_t m = 0;

    for (size_t i = 0; i < n; i += every)
        to[m++] = v[3 * i + k];
    qsort(to, m, sizeof *to, smaller);
    return m;
}

/* Tells whether scales without a negative number are lengths. n splats that
 * cover a surface of the scene's extent have scales near extent / sqrt(n); the
 * kind whose median is nearer to it, by its ratio, is meant. */
static bool are_lengths(const saga_cloud *c)
{
    float v[MOST_SAMPLES];
    double extent = 0.0, scale = 0.0, spacing;

    for (size_t k = 0; k < 3; k++) {
        size_t m = sample(v, c->mean, c->n, k);

        /* A few distant splats have no influence on the extent. */
        extent = fmax(extent, (double)(v[m - 1 - m / 10] - v[m / 10]));
        m = sample(v, c->log_scale, c->n, k);
        scale += (double)v[m / 2] / 3.0;
    }
    if (!(extent > 0.0) || !(scale > 0.0))
        return false;
    spacing = log(extent / sqrt((double)c->n));
    return fabs(log(scale) - spacing) < fabs(scale - spacing);
}

/* The tests that follow need some splats; a file of fewer is believed. */
enum { LEAST_SPLATS = 16 };

static void settle_log(bool *lengths, bool *opacities, saga_cloud *c)
{
    const tally t = count(c);
    const bool inside = !t.outside && c->n >= LEAST_SPLATS;
    /* Logits of trained splats go far beyond 0..1. If all are within, they are
     * opacities, unless they hardly differ. */
    const bool differ = inside && t.most - t.least > 0.5f;

    *lengths = !t.negative && c->n >= LEAST_SPLATS &&
               (differ || are_lengths(c));
    *opacities = differ || (inside && *lengths);
    c->facts.count[SAGA_FACT_LINEAR_SCALE] += *lengths;
    c->facts.count[SAGA_FACT_OPACITY] += *opacities;
    c->facts.count[SAGA_FACT_UNSURE] += inside && !*opacities;
}

static void settle_linear(bool *lengths, bool *opacities, saga_cloud *c)
{
    const tally t = count(c);

    *lengths = (double)t.negative <= STRAY * (double)c->n;
    *opacities = (double)t.outside <= STRAY * (double)c->n;
    c->facts.count[SAGA_FACT_LOG_SCALE] += !*lengths;
    c->facts.count[SAGA_FACT_LOGIT] += !*opacities;
}

/* A scale of 0 has no logarithm; 1e-30 replaces it. */
static float log_of(float length)
{
    return length >= 0.0f ? (float)log(fmax((double)length, 1e-30)) : NAN;
}

static float logit_of(float opacity)
{
    return opacity >= -SLACK && opacity <= 1.0f + SLACK
               ? saga_cloud_logit((double)opacity)
               : NAN;
}

void saga_cloud_settle(saga_cloud *c)
{
    bool lengths = false, opacities = false;

    if (c->form == SAGA_FORM_LOG)
        settle_log(&lengths, &opacities, c);
    else if (c->form == SAGA_FORM_LINEAR)
        settle_linear(&lengths, &opacities, c);
    for (size_t i = 0; i < 3 * c->n && lengths; i++)
        c->log_scale[i] = log_of(c->log_scale[i]);
    for (size_t i = 0; i < c->n && opacities; i++)
        c->logit[i] = logit_of(c->logit[i]);
    c->form = SAGA_FORM_SURE;
}
