/* SPDX-License-Identifier: MIT */
#include "tracks.h"

#include "alloc.h"

#include <math.h>
#include <stdlib.h>

/* Features of all views are numbered, view after view. The parents form trees,
 * whose root is the first feature of the place that all features of the tree
 * show. */
typedef struct forest {
    const saga_pairs *pairs;
    size_t *first;  /* (n_views + 1) number of a view's first
                     * feature */
    size_t *parent; /* (n) */
    size_t n;
} forest;

static size_t root_of(const forest *f, size_t i)
{
    while (f->parent[i] != i)
        i = f->parent[i] = f->parent[f->parent[i]];
    return i;
}

static void link_matches(forest *f)
{
    for (size_t i = 0; i < f->pairs->n; i++) {
        const saga_pair *const p = &f->pairs->list[i];
        for (size_t k = 0; k < p->n; k++) {
            const size_t a = root_of(f, f->first[p->a] +
                                            (size_t)p->matches[k].of_a);
            const size_t b = root_of(f, f->first[p->b] +
                                            (size_t)p->matches[k].of_b);
            /* The lowest number becomes the root, whatever the order of the
             * pairs. */
            f->parent[a > b ? a : b] = a > b ? b : a;
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
static void collect(saga_tracks *t, const forest *f)
{
    const int n_views = f->pairs->capture->n_views;
    size_t kept = 0;
    for (int v = 0; v < n_views; v++)
        for (size_t i = f->first[v]; i < f->first[v + 1]; i++) {
            const saga_feature *const one =
                &f->pairs->features[v].list[i - f->first[v]];
            t->sights[i] = (saga_sight){ .camera = v,
                                         .place = root_of(f, i),
                                         .at = { one->x, one->y } };
        }
    t->n_sights = f->n;
    qsort(t->sights, f->n, sizeof *t->sights, by_place);
    for (size_t i = 0, n; i < f->n; i += n) {
        n = saga_tracks_length(t, i);
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

bool saga_tracks_make(saga_tracks *tracks, const saga_pairs *pairs,
                      saga_error *error)
{
    static const char what[] = "the matches";
    const int n_views = pairs->capture->n_views;
    forest f = { .pairs = pairs };
    *tracks = (saga_tracks){ .n_places = 0 };
    f.first = saga_alloc((size_t)n_views + 1, sizeof *f.first, what, error);
    for (int v = 0; f.first && v < n_views; v++) {
        f.first[v] = f.n;
        f.n += pairs->features[v].n;
        f.first[v + 1] = f.n;
    }
    f.parent = saga_alloc(f.n + 1, sizeof *f.parent, what, error);
    tracks->sights = saga_alloc(f.n + 1, sizeof *tracks->sights, what, error);
    const bool ok = f.first && f.parent && tracks->sights;
    for (size_t i = 0; ok && i < f.n; i++)
        f.parent[i] = i;
    if (ok) {
        link_matches(&f);
        collect(tracks, &f);
    }
    free(f.first);
    free(f.parent);
    return ok;
}

void saga_tracks_free(saga_tracks *tracks)
{
    free(tracks->sights);
    *tracks = (saga_tracks){ .n_places = 0 };
}

size_t saga_tracks_length(const saga_tracks *t, size_t first)
{
    size_t n = 1;
    while (first + n < t->n_sights &&
           t->sights[first + n].place == t->sights[first].place)
        n++;
    return n;
}

double saga_transfer_off(const saga_pinhole *cameras, const saga_sight *sights,
                         size_t n, size_t k)
{
    saga_sight others[SAGA_TRANSFER_MOST];
    double place[3], off[2], by_camera[2][SAGA_BUNDLE_N], by_place[2][3];
    size_t n_others = 0;
    for (size_t i = 0; i < n; i++)
        if (i != k)
            others[n_others++] = sights[i];
    return saga_bundle_meet(place, cameras, others, n_others) &&
                   saga_bundle_differ(off, by_camera, by_place,
                                      &cameras[sights[k].camera], place,
                                      sights[k].at)
               ? hypot(off[0], off[1])
               : (double)INFINITY;
}
