/* SPDX-License-Identifier: MIT */
#include "pairs.h"

#include "alloc.h"
#include "pose.h"
#include "threads.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define SAME_MOMENT 0.01 /* frames */

enum {
    NEIGHBOURS = 4 /* numbers of pairs for each of many views: with
                    * the nearest views, and with the next ones in the
                    * list */
};

/* ----------------------------------------------------------------- features */

static bool find_features(saga_pairs *p, saga_error *error)
{
    const saga_capture *const c = p->capture;
    p->features = saga_calloc((size_t)c->n_views, sizeof *p->features,
                              "the features", error);
    /* Each view has an error of its own, because threads must not share one. */
    saga_error *const errors = saga_calloc((size_t)c->n_views, sizeof *errors,
                                           "the features", error);
    bool ok = p->features && errors;
#pragma omp parallel for schedule(dynamic) if (ok)
    for (int v = 0; v < (ok ? c->n_views : 0); v++) {
        const saga_source_view *const view = &c->views[v];
        const int k = saga_capture_near(c, v, p->frame);
        (void)saga_features_find(&p->features[v], saga_capture_frame(c, v, k),
                                 saga_capture_mask(c, v, k), view->width,
                                 view->height, &errors[v]);
    }
    for (int v = 0; ok && v < c->n_views; v++)
        if (saga_failed(&errors[v]))
            ok = saga_fail(error, NULL, NULL, "%s", errors[v].message);
    free(errors);
    return ok;
}

/* -------------------------------------------------------------------- pairs */

static double between(const saga_source_view *a, const saga_source_view *b)
{
    double x[3], y[3];
    saga_pose_centre(a->rotation, a->translation, x);
    saga_pose_centre(b->rotation, b->translation, y);
    return hypot(hypot(x[0] - y[0], x[1] - y[1]), x[2] - y[2]);
}

/* Marks the pairs to compare for one of many views: the next views in the list,
 * and the nearest ones by poses, which may be wrong. */
static void mark_neighbours(bool *compared, const saga_capture *c, int v)
{
    const int n = c->n_views;
    int near[NEIGHBOURS], n_near = 0;
    for (int w = 0; w < n; w++) {
        const double own = between(&c->views[v], &c->views[w]);
        int i = n_near;
        /* `near` is sorted by distance; of equal distances the first view comes
         * first. */
        while (i > 0 && own < between(&c->views[v], &c->views[near[i - 1]]))
            i--;
        if (w == v || i == NEIGHBOURS)
            continue;
        n_near += n_near < NEIGHBOURS;
        for (int k = n_near - 1; k > i; k--)
            near[k] = near[k - 1];
        near[i] = w;
    }
    for (int i = 0; i < n_near; i++)
        compared[v * n + near[i]] = compared[near[i] * n + v] = true;
    for (int w = v + 1; w < n && w <= v + NEIGHBOURS; w++)
        compared[v * n + w] = compared[w * n + v] = true;
}

/* Tells whether the pictures of two views are of one moment. A camera that
 * moves has pictures of different moments, between which the scene may have
 * moved, too. */
static bool is_one_moment(const saga_pairs *p, int v, int w)
{
    const saga_capture *const c = p->capture;
    const double a = saga_capture_near(c, v, p->frame) + c->views[v].late;
    const double b = saga_capture_near(c, w, p->frame) + c->views[w].late;
    return !c->moves || fabs(a - b) < SAME_MOMENT;
}

bool saga_pairs_list(saga_pairs *p, saga_error *error)
{
    const int n = p->capture->n_views;
    const size_t square = (size_t)n * (size_t)n;
    bool *const compared = saga_calloc(square, sizeof *compared, "the matches",
                                       error);
    size_t most = 0;
    if (!compared)
        return false;
    /* Few views are all compared, many only with their neighbours. */
    if (n <= SAGA_ALL_PAIRS)
        memset(compared, true, square * sizeof *compared);
    for (int v = 0; v < n && n > SAGA_ALL_PAIRS; v++)
        mark_neighbours(compared, p->capture, v);
    /* The number of pairs is counted first, to allocate the list. */
    for (int v = 0; v < n; v++)
        for (int w = v + 1; w < n; w++) {
            compared[v * n + w] &= is_one_moment(p, v, w);
            most += compared[v * n + w];
        }
    p->list = saga_calloc(most + 1, sizeof *p->list, "the matches", error);
    for (int v = 0; p->list && v < n; v++)
        for (int w = v + 1; w < n; w++)
            if (compared[v * n + w])
                p->list[p->n++] = (saga_pair){ .a = v, .b = w };
    free(compared);
    return p->list != NULL;
}

bool saga_pairs_look(saga_pairs *pairs, const saga_capture *capture, int frame,
                     saga_error *error)
{
    *pairs = (saga_pairs){ .capture = capture,
                           .frame = frame,
                           .within = SAGA_MATCH_WITHIN };
    for (int v = 0; v < capture->n_views; v++)
        pairs->within = fmax(pairs->within, SAGA_MATCH_WITHIN / 960.0 *
                                                capture->views[v].width);
    return find_features(pairs, error);
}

/* ------------------------------------------------------------------ matches */

size_t saga_pair_agree(saga_match *matches, const saga_pairs *pairs,
                       const saga_pair *p)
{
    const size_t n = saga_matches_find(matches, &pairs->features[p->a],
                                       &pairs->features[p->b], NULL);
    /* The random numbers depend on the pair only, so a pair's result does not
     * depend on other pairs. */
    return saga_matches_agree(matches, n, pairs->within,
                              (uint64_t)p->a * SAGA_MAX_VIEWS + (uint64_t)p->b);
}

static bool match_pair(saga_pair *p, const saga_pairs *pairs,
                       saga_pair_fn *match, saga_error *error)
{
    saga_match *const m = saga_alloc(SAGA_FEATURES_MOST, sizeof *m,
                                     "the matches", error);
    if (!m)
        return false;
    p->n = match(m, pairs, p);
    p->matches = p->n ? saga_realloc(m, p->n, sizeof *m, "the matches", error)
                      : NULL;
    if (!p->matches)
        free(m);
    return p->n == 0 || p->matches;
}

bool saga_pairs_match(saga_pairs *pairs, saga_pair_fn *match, saga_error *error)
{
    bool ok = true;
    size_t kept = 0;
#pragma omp parallel for schedule(dynamic)
    for (size_t i = 0; i < pairs->n; i++) {
        saga_error own = { "" };
        if (!match_pair(&pairs->list[i], pairs, match, &own))
#pragma omp critical
            ok = saga_fail(error, NULL, NULL, "%s", own.message);
    }
    for (size_t i = 0; i < pairs->n; i++)
        if (pairs->list[i].n)
            pairs->list[kept++] = pairs->list[i];
    pairs->n = kept;
    return ok;
}

void saga_pairs_free(saga_pairs *pairs)
{
    for (int v = 0; pairs->features && v < pairs->capture->n_views; v++)
        free(pairs->features[v].list);
    for (size_t i = 0; pairs->list && i < pairs->n; i++)
        free(pairs->list[i].matches);
    free(pairs->features);
    free(pairs->list);
    *pairs = (saga_pairs){ .n = 0 };
}
