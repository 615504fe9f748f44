/* SPDX-License-Identifier: MIT */
#include "refine.h"

#include "alloc.h"
#include "bundle.h"
#include "order.h"

#include <math.h>
#include <stdlib.h>

enum {
    APART = 5,               /* one place in five is kept for the test */
    FEW_PLACES = 60,         /* with fewer places nothing is refined */
    MOST_VIEWS = 100         /* above this number of views nothing is refined;
                              * their equations take 6.5 MB */
};

/* Refinement must reduce the error to this part to count as a help, since right
 * cameras also gain a few hundredths of a pixel from fitting noise. */
static const double clearly = 0.8;

/* Features of all views are numbered, view after view. The parents form trees,
 * whose root is the first feature of the place that all features of the tree
 * show. */
typedef struct tracks {
    const saga_pairs *pairs;
    size_t *first;           /* (n_views + 1) number of a view's first
                              * feature */
    size_t *parent;          /* (n) */
    size_t n;
    saga_sight *sights;      /* (n) sorted by place */
    size_t n_sights, n_places;
    double *off;             /* (n_off) scratch for distances */
} tracks;

/* ------------------------------------------------------------------- tracks */

static size_t root_of(const tracks *t, size_t i)
{
    while (t->parent[i] != i)
        i = t->parent[i] = t->parent[t->parent[i]];
    return i;
}

static void link_matches(tracks *t)
{
    for (size_t i = 0; i < t->pairs->n; i++) {
        const saga_pair *const p = &t->pairs->list[i];
        for (size_t k = 0; k < p->n; k++) {
            const size_t a = root_of(t, t->first[p->a] +
                                        (size_t)p->matches[k].of_a);
            const size_t b = root_of(t, t->first[p->b] +
                                        (size_t)p->matches[k].of_b);
            /* The lowest number becomes the root, whatever the order of the
             * pairs. */
            t->parent[a > b ? a : b] = a > b ? b : a;
        }
    }
}

static int by_place(const void *a, const void *b)
{
    const saga_sight *const x = a, *const y = b;
    if (x->place != y->place)
        return x->place < y->place ? -1 : 1;
    return x->camera - y->camera;
}

/* Tells whether the sights of a place, sorted by camera, come from at least two
 * cameras and only once from each. Two sights of one camera show that a match
 * is wrong. */
static bool is_sound(const saga_sight *s, size_t n)
{
    for (size_t k = 1; k < n; k++)
        if (s[k].camera == s[k - 1].camera)
            return false;
    return n > 1;
}

/* Keeps the sights of sound tracks and numbers their places. */
static void collect(tracks *t)
{
    const int n_views = t->pairs->capture->n_views;
    size_t kept = 0;
    for (int v = 0; v < n_views; v++)
        for (size_t i = t->first[v]; i < t->first[v + 1]; i++) {
            const saga_feature *const f =
                &t->pairs->features[v].list[i - t->first[v]];
            t->sights[i] = (saga_sight){.camera = v, .place = root_of(t, i),
                                        .at = {f->x, f->y}};
        }
    qsort(t->sights, t->n, sizeof *t->sights, by_place);
    for (size_t i = 0, n; i < t->n; i += n) {
        for (n = 1; i + n < t->n &&
                    t->sights[i + n].place == t->sights[i].place; n++)
            ;
        if (!is_sound(t->sights + i, n))
            continue;
        /* Since kept <= i, no sight is overwritten before it has moved. */
        for (size_t k = 0; k < n; k++) {
            t->sights[kept] = t->sights[i + k];
            t->sights[kept++].place = t->n_places;
        }
        t->n_places++;
    }
    t->n_sights = kept;
}

static bool make_tracks(tracks *t, saga_error *error)
{
    static const char what[] = "the matches";
    const int n_views = t->pairs->capture->n_views;
    t->first = saga_alloc((size_t)n_views + 1, sizeof *t->first, what, error);
    if (!t->first)
        return false;
    for (int v = 0; v < n_views; v++) {
        t->first[v] = t->n;
        t->n += t->pairs->features[v].n;
    }
    t->first[n_views] = t->n;
    t->parent = saga_alloc(t->n, sizeof *t->parent, what, error);
    t->sights = saga_alloc(t->n, sizeof *t->sights, what, error);
    if (!t->parent || !t->sights)
        return false;
    for (size_t i = 0; i < t->n; i++)
        t->parent[i] = i;
    link_matches(t);
    collect(t);
    return true;
}

/* ------------------------------------------------------------------ judging */

/* Returns the epipolar distance in pixels of two sights of a place, for the
 * given cameras. */
static double off_of(const saga_pinhole *cameras, const saga_sight *a,
                     const saga_sight *b)
{
    const saga_pinhole *const ca = &cameras[a->camera];
    const saga_pinhole *const cb = &cameras[b->camera];
    const saga_epipolar between = saga_epipolar_between(ca, cb);
    const saga_match m = {.a = {a->at[0], a->at[1]},
                          .b = {b->at[0], b->at[1]}};
    bool front;
    return saga_epipolar_off(ca, cb, &between, &m, 1.0, &front);
}

/* Returns the median error over the test places, comparing every sight with the
 * next one; NaN if they are too few. */
static double judge(const tracks *t, const saga_pinhole *cameras)
{
    size_t n = 0;
    for (size_t i = 0; i + 1 < t->n_sights; i++)
        if (t->sights[i].place == t->sights[i + 1].place &&
            t->sights[i].place % APART == 0)
            t->off[n++] = off_of(cameras, &t->sights[i], &t->sights[i + 1]);
    return n < FEW_PLACES / APART ? (double)NAN : saga_median(t->off, n);
}

/* -------------------------------------------------------------- adjustment */

/* Fills the bundle with the places that are not kept for the test and whose
 * rays meet. */
static void fill(saga_bundle *b, const tracks *t)
{
    for (size_t i = 0, n; i < t->n_sights; i += n) {
        const saga_sight *const s = &t->sights[i];
        for (n = 1; i + n < t->n_sights && s[n].place == s->place; n++)
            ;
        if (s->place % APART == 0 ||
            !saga_bundle_meet(b->places[b->n_places], b->cameras, s, n))
            continue;
        for (size_t k = 0; k < n; k++) {
            b->sights[b->n_sights] = s[k];
            b->sights[b->n_sights++].place = b->n_places;
        }
        b->n_places++;
    }
}

static bool adjust(saga_refinement *r, const tracks *t, saga_error *error)
{
    static const char what[] = "the matches";
    saga_bundle b = {.cameras = r->cameras,
                     .n_cameras = t->pairs->capture->n_views,
                     .within = t->pairs->within / 2.0};
    b.places = saga_alloc(t->n_places, sizeof *b.places, what, error);
    b.sights = saga_alloc(t->n_sights, sizeof *b.sights, what, error);
    bool ok = b.places && b.sights;
    if (ok) {
        fill(&b, t);
        ok = b.n_places < FEW_PLACES || saga_bundle_adjust(&b, error);
    }
    free(b.places);
    free(b.sights);
    return ok;
}

bool saga_refine(saga_refinement *refinement, const saga_pairs *pairs,
                 saga_error *error)
{
    const saga_capture *const c = pairs->capture;
    tracks t = {.pairs = pairs};
    *refinement = (saga_refinement){.before = (double)NAN,
                                    .after = (double)NAN};
    if (c->moves || c->n_views < 3 || c->n_views > MOST_VIEWS)
        return true;
    refinement->cameras = saga_alloc((size_t)c->n_views,
                                     sizeof *refinement->cameras,
                                     "the cameras", error);
    /* Matches between pairs of views are joined to tracks, whose places are
     * adjusted together with the cameras. */
    bool ok = refinement->cameras && make_tracks(&t, error);
    t.off = ok ? saga_alloc(t.n_sights + 1, sizeof *t.off, "the matches",
                            error) : NULL;
    ok = ok && t.off;
    for (int v = 0; ok && v < c->n_views; v++)
        refinement->cameras[v] = saga_pinhole_of(&c->views[v]);
    if (ok && t.n_places >= FEW_PLACES) {
        /* The same matches judge both states of the cameras. */
        refinement->before = judge(&t, refinement->cameras);
        ok = adjust(refinement, &t, error);
        refinement->after = judge(&t, refinement->cameras);
        refinement->helps = refinement->after < clearly * refinement->before;
    }
    free(t.first);
    free(t.parent);
    free(t.sights);
    free(t.off);
    return ok;
}
