/* SPDX-License-Identifier: MIT */
#include "refine.h"

#include "alloc.h"
#include "bundle.h"
#include "order.h"

#include <math.h>
#include <stdlib.h>

enum {
    APART = 5,       /* one place in five is kept for the test */
    FEW_PLACES = 60, /* with fewer places nothing is refined, */
    FEW_SHARED = 30, /* nor with fewer that three cameras see: cameras
                      * that hang together by pairs alone can be moved
                      * to fit wrong matches */
    MOST_VIEWS = 100 /* above this number of views nothing is refined;
                      * their equations take 6.5 MB */
};

/* Refinement must reduce the error to this part to count as a help, since right
 * cameras also gain a few hundredths of a pixel from fitting noise. */
static const double clearly = 0.8;
static const double by_half = 0.5;
#define HALF_PIXEL 0.5

/* ------------------------------------------------------------------ judging */

/* Returns the epipolar distance in pixels of two sights of a place, for the
 * given cameras. */
static double off_of(const saga_pinhole *cameras, const saga_sight *a,
                     const saga_sight *b)
{
    const saga_pinhole *const ca = &cameras[a->camera];
    const saga_pinhole *const cb = &cameras[b->camera];
    const saga_epipolar between = saga_epipolar_between(ca, cb);
    const saga_match m = { .a = { a->at[0], a->at[1] },
                           .b = { b->at[0], b->at[1] } };
    bool front;
    return saga_epipolar_off(ca, cb, &between, &m, 1.0, &front);
}

/* Appends the errors of the sights of one place: how far each is from where the
 * others see the place, or from the epipolar line of the next one if there are
 * only two or if their rays are nearly parallel. Returns their number. */
static size_t judge_place(double *off, const saga_pinhole *cameras,
                          const saga_sight *s, size_t n)
{
    if (n > SAGA_TRANSFER_MOST)
        n = SAGA_TRANSFER_MOST;
    for (size_t k = 0; k < n; k++) {
        off[k] = n > 2 ? saga_transfer_off(cameras, s, n, k) : (double)INFINITY;
        if (isinf(off[k]))
            off[k] = off_of(cameras, &s[k], &s[(k + 1) % n]);
    }
    return n;
}

/* Returns the median error over the sights of the test places, of one view or,
 * if view < 0, of all; NaN if they are too few. off (n_sights) is scratch
 * memory. */
static double judge(double *off, const saga_tracks *t,
                    const saga_pinhole *cameras, int view)
{
    size_t n = 0, n_places = 0;
    for (size_t i = 0, of_place; i < t->n_sights; i += of_place) {
        of_place = saga_tracks_length(t, i);
        if (t->sights[i].place % APART != 0)
            continue;
        const size_t end = n + judge_place(off + n, cameras, t->sights + i,
                                           of_place);
        size_t kept = n;
        for (size_t k = n; k < end; k++)
            if (view < 0 || t->sights[i + k - n].camera == view)
                off[kept++] = off[k];
        n_places += kept > n;
        n = kept;
    }
    return n_places < FEW_PLACES / APART ? (double)NAN : saga_median(off, n);
}

/* Tells whether the error of some view's test matches has fallen to half, and
 * by half a pixel. A single wrong camera of many hardly changes the median over
 * all views. */
static bool helps_one(double *off, const saga_refinement *r,
                      const saga_capture *c, const saga_tracks *t,
                      const saga_pinhole *before)
{
    bool helps = false;
    for (int v = 0; v < c->n_views; v++) {
        const double was = judge(off, t, before, v);
        const double is = judge(off, t, r->cameras, v);
        helps = helps || (is < by_half * was && is < was - HALF_PIXEL);
    }
    return helps && r->after <= r->before;
}

/* -------------------------------------------------------------- adjustment */

/* Fills the bundle with the places that are not kept for the test and whose
 * rays meet. */
static void fill(saga_bundle *b, const saga_tracks *t)
{
    for (size_t i = 0, n; i < t->n_sights; i += n) {
        const saga_sight *const s = &t->sights[i];
        n = saga_tracks_length(t, i);
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

static bool adjust(saga_refinement *r, const saga_pairs *pairs,
                   const saga_tracks *t, saga_error *error)
{
    static const char what[] = "the matches";
    saga_bundle b = { .cameras = r->cameras,
                      .n_cameras = pairs->capture->n_views,
                      .within = pairs->within / 2.0 };
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

/* Tells whether there are enough places, of which enough are seen by three
 * cameras or more. */
static bool is_enough(const saga_tracks *t)
{
    size_t n_shared = 0;
    for (size_t i = 0, of_place; i < t->n_sights; i += of_place) {
        of_place = saga_tracks_length(t, i);
        n_shared += of_place > 2;
    }
    return t->n_places >= FEW_PLACES && n_shared >= FEW_SHARED;
}

/* Projects a place to a pixel. Returns false if it is behind the camera. */
static bool see(double at[2], const saga_pinhole *camera, const double place[3])
{
    const double origin[2] = { 0.0, 0.0 };
    double by_camera[2][SAGA_BUNDLE_N], by_place[2][3];
    return saga_bundle_differ(at, by_camera, by_place, camera, place, origin);
}

/* Returns by how far view v sees the places of its tracks elsewhere than
 * before. off (n_sights) is scratch memory. */
static double find_moved(double *off, const saga_refinement *r,
                         const saga_pinhole *before, int v,
                         const saga_tracks *t)
{
    size_t n = 0;
    for (size_t i = 0, of_place; i < t->n_sights; i += of_place) {
        double place[3], a[2], b[2];
        bool own = false;
        of_place = saga_tracks_length(t, i);
        for (size_t k = 0; k < of_place; k++)
            own = own || t->sights[i + k].camera == v;
        if (own &&
            saga_bundle_meet(place, r->cameras, t->sights + i, of_place) &&
            see(a, before, place) && see(b, &r->cameras[v], place))
            off[n++] = hypot(a[0] - b[0], a[1] - b[1]);
    }
    return n < FEW_PLACES / APART ? (double)NAN : saga_median(off, n);
}

bool saga_refine(saga_refinement *refinement, const saga_pairs *pairs,
                 const saga_tracks *tracks, saga_error *error)
{
    const saga_capture *const c = pairs->capture;
    saga_refinement *const r = refinement;
    const size_t n_views = (size_t)c->n_views;
    *r = (saga_refinement){ .before = (double)NAN, .after = (double)NAN };
    if (c->moves || n_views < 3 || n_views > MOST_VIEWS)
        return true;
    r->cameras = saga_alloc(n_views, sizeof *r->cameras, "the cameras", error);
    r->moved = saga_calloc(n_views, sizeof *r->moved, "the cameras", error);
    saga_pinhole *const before = saga_alloc(n_views, sizeof *before,
                                            "the cameras", error);
    double *const off = saga_alloc(tracks->n_sights + 1, sizeof *off,
                                   "the matches", error);
    bool ok = r->cameras && r->moved && before && off;
    for (int v = 0; ok && v < c->n_views; v++)
        before[v] = r->cameras[v] = saga_pinhole_of(&c->views[v]);
    if (ok && is_enough(tracks)) {
        /* The same matches judge both states of the cameras. */
        ok = adjust(r, pairs, tracks, error);
        r->before = judge(off, tracks, before, -1);
        r->after = judge(off, tracks, r->cameras, -1);
        r->helps = r->after < clearly * r->before ||
                   helps_one(off, r, c, tracks, before);
    }
    for (int v = 0; ok && r->helps && v < c->n_views; v++)
        r->moved[v] = find_moved(off, r, &before[v], v, tracks);
    free(before);
    free(off);
    return ok;
}

void saga_refinement_free(saga_refinement *refinement)
{
    free(refinement->cameras);
    free(refinement->moved);
    *refinement = (saga_refinement){ .helps = false };
}
