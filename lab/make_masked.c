/* SPDX-License-Identifier: MIT
 *
 * make_masked FILE.saga: measures how much the anchors of a file have in common
 * (paper: Hierarchical 4D Anchor, shareability), and prints a line for each
 * tier and percentage. The features of that part of the tier's anchors are
 * masked and recovered from the other anchors: by the file's own interpolation
 * between neighbours in space and time, with the same weights but anchors taken
 * at random, and by the mean. `error` is the RMS error over the RMS of the
 * masked features, `cosine` the mean similarity. Masked anchors without a known
 * neighbour are counted as `alone` and get the mean. Positions stay known.
 */
#include "alloc.h"
#include "error.h"
#include "file.h"
#include "interp.h"
#include "ref_scene.h"
#include "rng.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { NEIGHBOURS, RANDOM, MEAN, N_METHODS };

/* The least window and number of neighbours. A file in which each primitive has
 * its own anchor may have been coded with one neighbour and a window of 0, and
 * its own interpolation would find nothing that is shared. */
enum { LEAST_WINDOW = 16, LEAST_NEIGHBOURS = 8 };

typedef struct {
    saga_scaffold sc; /* group 1 marks masked anchors */
    int tier;
    uint32_t n, f;                  /* anchors of the tier, features of each */
    const double *was;              /* (n, f) */
    double *now;                    /* (n, f) */
    double mean[SAGA_MAX_FEATURES]; /* of the known anchors */
    saga_rng random;
    uint64_t n_random; /* numbers drawn so far */
} session;

static uint8_t *group_of(const session *s, uint32_t rank)
{
    return s->tier == SAGA_TIER_COARSE ? &s->sc.coarse[rank].group
                                       : &s->sc.fine[rank].group;
}

/* Sets the position from which an anchor searches for neighbours. */
static void place(saga_position *p, const session *s, uint32_t rank)
{
    if (s->tier == SAGA_TIER_FINE) {
        saga_position_fine(p, &s->sc.fine[rank]);
        return;
    }
    saga_position_cell(p, &s->sc.coarse[rank]);
    for (int i = 0; i < 3; i++)
        p->x[i] = s->sc.coarse[rank].x[i];
    p->t = s->sc.coarse[rank].t;
}

static void set_mean(session *s, uint32_t n_known)
{
    memset(s->mean, 0, sizeof s->mean);
    for (uint32_t k = 0; k < s->n; k++)
        for (uint32_t i = 0; !*group_of(s, k) && i < s->f; i++)
            s->mean[i] += s->was[(size_t)k * s->f + i] / n_known;
}

/* Draws a known anchor; all are equally likely. */
static uint32_t known(session *s)
{
    uint32_t rank;

    do
        rank = saga_rng_below(s->random, s->n_random++, s->n);
    while (*group_of(s, rank));
    return rank;
}

/* Recovers a masked anchor. Returns whether it has no known neighbour. */
static bool recover(session *s, int method, uint32_t rank)
{
    double *const out = s->now + (size_t)rank * s->f;
    saga_neighbours nb;
    saga_position p;
    uint32_t sum = 0;

    /* Anchors of group 0 are searched, since masked ones must not be a
     * source. */
    place(&p, s, rank);
    saga_interp_find(&nb, &s->sc, s->tier, &p, rank, 1);
    if (method == MEAN || nb.n == 0) {
        memcpy(out, s->mean, s->f * sizeof *out);
        return nb.n == 0;
    }
    memset(out, 0, s->f * sizeof *out);
    for (uint32_t k = 0; k < nb.n; k++) {
        const uint32_t from = method == RANDOM ? known(s) : nb.rank[k];

        for (uint32_t i = 0; i < s->f; i++)
            out[i] += nb.weight_q14[k] * s->was[(size_t)from * s->f + i];
        sum += nb.weight_q14[k];
    }
    /* The decoder's weights sum to 1 within 2^-12 only. */
    for (uint32_t i = 0; i < s->f; i++)
        out[i] /= sum;
    return false;
}

/* Prints error and cosine over the masked anchors. */
static void print_score(const session *s)
{
    double wrong = 0, all = 0, cosine = 0;
    uint32_t n = 0;

    for (uint32_t k = 0; k < s->n; k++) {
        double aa = 0, bb = 0, ab = 0;

        if (!*group_of(s, k))
            continue;
        for (size_t i = (size_t)k * s->f; i < (size_t)(k + 1) * s->f; i++) {
            wrong += (s->now[i] - s->was[i]) * (s->now[i] - s->was[i]);
            aa += s->was[i] * s->was[i];
            bb += s->now[i] * s->now[i];
            ab += s->now[i] * s->was[i];
        }
        all += aa;
        if (aa > 0 && bb > 0) {
            cosine += ab / sqrt(aa * bb);
            n++;
        }
    }
    printf("%8.3f%7.2f", wrong > 0 ? sqrt(wrong / all) : 0,
           n ? cosine / n : (double)NAN);
}

static void print_row(session *s, int percent)
{
    const double share = floor(s->n * (percent / 100.0) + 0.5);
    const uint32_t n = (uint32_t)fmin(fmax(share, 1), s->n - 1.0);
    const saga_rng choice = saga_rng_stream((uint64_t)percent,
                                            (uint64_t)s->tier);
    uint32_t n_alone = 0;

    for (uint32_t i = 0; i < s->n; i++)
        *group_of(s, i) = 0;
    for (uint32_t i = 0; i < n; i++)
        *group_of(s, saga_rng_shuffled(choice, i, s->n)) = 1;
    set_mean(s, s->n - n);
    printf("%-6s%4d %%%8u", s->tier == SAGA_TIER_COARSE ? "coarse" : "fine",
           percent, n);
    for (int method = 0; method < N_METHODS; method++) {
        /* Each method starts from the same mask. */
        s->random = saga_rng_stream((uint64_t)percent, 2 + (uint64_t)s->tier);
        s->n_random = 0;
        n_alone = 0;
        for (uint32_t k = 0; k < s->n; k++)
            n_alone += *group_of(s, k) && recover(s, method, k);
        print_score(s);
    }
    printf("%8u\n", n_alone);
}

static void print_tier(const ref_scene *scene, int tier, double *now)
{
    const bool coarse = tier == SAGA_TIER_COARSE;
    saga_model model = *scene->before.model;
    saga_tier *const t = &model.tier[tier];
    session s = { .sc = scene->before,
                  .tier = tier,
                  .f = model.features,
                  .now = now,
                  .n = coarse ? scene->before.n.coarse : scene->before.n.fine,
                  .was = coarse ? scene->coarse_feature : scene->fine_feature };

    t->window = t->window < LEAST_WINDOW ? LEAST_WINDOW : t->window;
    t->neighbours = t->neighbours < LEAST_NEIGHBOURS ? LEAST_NEIGHBOURS
                                                     : t->neighbours;
    s.sc.model = &model;
    for (int percent = 10; s.n > 1 && percent < 100; percent += 20)
        print_row(&s, percent);
}

/* Measures both tiers. Fine anchors are as the decoder searches among them:
 * their supports are half of their parents' cells. */
static bool measure(const ref_file *f, saga_error *error)
{
    const saga_counts n = f->sc.n;
    ref_scene scene = { .file = NULL };
    saga_primitive *prims = NULL;
    int16_t *colours = NULL;
    double *const now = saga_alloc(n.coarse > n.fine ? n.coarse : n.fine,
                                   f->h.model.features * sizeof *now,
                                   "the anchors", error);
    const bool ok = now && ref_file_primitives(&prims, &colours, f, error) &&
                    ref_scene_make(&scene, f, prims, colours, error);

    if (ok) {
        ref_scene_fine(&scene);
        printf("                      neighbours         random"
               "           mean\n"
               "tier  masked anchors   error cosine   error cosine   error "
               "cosine   alone\n");
        print_tier(&scene, SAGA_TIER_COARSE, now);
        print_tier(&scene, SAGA_TIER_FINE, now);
    }
    ref_scene_free(&scene);
    free(now);
    free(prims);
    free(colours);
    return ok;
}

int main(int argc, char **argv)
{
    saga_error error = { "" };
    saga_bytes in;
    ref_file f;
    const char *why;

    if (argc != 2) {
        fprintf(stderr, "usage: make_masked FILE.saga\n");
        return 2;
    }
    if (!saga_read_file(&in, argv[1], &error))
        why = error.message;
    else if (!(why = ref_file_read(&f, in.data, in.nbytes))) {
        if (!measure(&f, &error))
            why = error.message;
        ref_file_free(&f);
        saga_bytes_free(&in);
    }
    if (why)
        fprintf(stderr, "make_masked: %s\n", why);
    return why != NULL;
}
