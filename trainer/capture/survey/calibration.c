/* SPDX-License-Identifier: MIT */
#include "calibration.h"

#include "alloc.h"
#include "epipolar.h"
#include "order.h"
#include "pairs.h"
#include "pose.h"
#include "tracks.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum {
    FEW_PAIRS = 3,    /* with fewer pairs there is no verdict on all
                       * cameras, because many a mistake makes one pair
                       * fit */
    FEW_CARRIED = 30, /* with fewer places that three cameras see, only
                       * pairs are judged */
    FOCAL_STEPS = 8,  /* focal lengths tried per octave */
    FOCAL_OCTAVES = 2
};

/* All cameras count as right if this fraction of the pairs fits; in the others,
 * repeated objects such as windows and chairs may match wrongly. */
#define MOST_FIT 0.8
/* A mistake must explain this fraction of the pairs that did not fit, or reduce
 * the typical error to it; the noise of corners does not shrink that far. */
#define EXPLAINED 0.6
/* Limit for a view's error, relative to the best third of the pairs, which is
 * 0.3 to 0.5 pixels in captures without mistakes. */
#define ODD 3.0
/* A view whose error is at most this many times the tolerance of a fit is not
 * called odd if bundle adjustment was tried and did not help (see pardon). */
#define FAR_OFF 2.0
/* Axes that are rarely reversed must reduce the errors to this part: if all
 * cameras stand upright at one height, their y reversed fits exactly as well as
 * a mirrored world. */
#define GAIN 0.99
/* A pair fits only if this fraction of its matches lies in front of both
 * cameras. */
#define IN_FRONT 0.5

typedef struct search {
    const saga_capture *c;
    bool left_handed; /* the poses are mirror images */
    saga_pairs pairs;
    saga_tracks tracks;
    double *scratch; /* (SAGA_FEATURES_MOST + 2 x number of pairs) */
    double *carried; /* (n_places of the tracks) */
} search;

/* ----------------------------------------------------------------- mistakes */

/* Negates axes of the camera, which are the columns of camera to world. */
static void reverse_axes(double a[9], int axes)
{
    for (int i = 0; i < 9; i++)
        a[i] = axes >> i % 3 & 1 ? -a[i] : a[i];
}

static void transpose(double a[9])
{
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < i; j++) {
            const double t = a[3 * i + j];
            a[3 * i + j] = a[3 * j + i];
            a[3 * j + i] = t;
        }
}

void saga_mistake_undo(const saga_mistake *mistake, double rotation[9],
                       double translation[3], double lens[4])
{
    const saga_pose_form form = mistake->form;
    const bool to_camera = mistake->poses == SAGA_POSES_TO_CAMERA;
    /* A and b are the rotation and the translation as in the file. */
    double a[9], b[3], x[3];
    memcpy(a, rotation, sizeof a);
    memcpy(b, translation, sizeof b);
    if (!to_camera) {
        transpose(a);
        saga_pose_centre(rotation, translation, b);
    }
    if (form != SAGA_POSE_RIGHT && mistake->poses == SAGA_POSES_OPENGL)
        reverse_axes(a, SAGA_AXIS_Y + SAGA_AXIS_Z);
    if (form == SAGA_POSE_INVERSE || form == SAGA_POSE_TRANSPOSED)
        transpose(a);
    /* If b is the t of the other direction, that of this one is -A t. */
    if (form == SAGA_POSE_INVERSE || form == SAGA_POSE_TRANSLATION) {
        saga_pose_translation(a, b, x);
        memcpy(b, x, sizeof b);
    }
    /* From here on, A and b are those of camera to world. */
    if (to_camera) {
        saga_pose_centre(a, b, x);
        memcpy(b, x, sizeof b);
        transpose(a);
    }
    reverse_axes(a, mistake->reversed);
    transpose(a);
    /* The third coordinate of a mirrored world changes its sign. */
    if (mistake->mirrored) {
        reverse_axes(a, SAGA_AXIS_Z);
        b[2] = -b[2];
    }
    memcpy(rotation, a, sizeof a);
    saga_pose_translation(a, b, translation);
    for (int k = 0; k < 2; k++) {
        lens[k] *= mistake->focal;
        lens[2 + k] *= mistake->centre ? mistake->focal : 1.0;
    }
}

/* -------------------------------------------------------------------- score */

/* Returns the median error of a pair's matches, or infinity if too many lie
 * behind the cameras. */
static double off_pair(const saga_pair *p, const saga_pinhole *a,
                       const saga_pinhole *b, double within, double *scratch)
{
    const saga_epipolar s = saga_epipolar_between(a, b);
    size_t n_front = 0;
    for (size_t i = 0; i < p->n; i++) {
        bool front;
        scratch[i] = saga_epipolar_off(a, b, &s, &p->matches[i], within,
                                       &front);
        n_front += front;
    }
    return (double)n_front < IN_FRONT * (double)p->n
               ? (double)INFINITY
               : saga_median(scratch, p->n);
}

static void off_pairs(double *off, const search *s, const saga_pinhole *cameras)
{
    for (size_t i = 0; i < s->pairs.n; i++) {
        const saga_pair *const p = &s->pairs.list[i];
        off[i] = off_pair(p, &cameras[p->a], &cameras[p->b], s->pairs.within,
                          s->scratch);
    }
}

/* Returns the median error over places that three cameras see: the distance of
 * one sight from where two others see the place. Infinite if there are too few,
 * or if most rays do not meet. */
static double carry(const search *s, const saga_pinhole *cameras)
{
    const saga_tracks *const t = &s->tracks;
    size_t n = 0;
    for (size_t i = 0, of_place; i < t->n_sights; i += of_place) {
        of_place = saga_tracks_length(t, i);
        if (of_place < 3)
            continue;
        /* The views in the middle of the list and at its ends are likely to
         * stand apart. */
        const saga_sight three[3] = { t->sights[i], t->sights[i + of_place / 2],
                                      t->sights[i + of_place - 1] };
        s->carried[n++] = saga_transfer_off(cameras, three, 3, 1);
    }
    return n < FEW_CARRIED ? (double)INFINITY : saga_median(s->carried, n);
}

/* The number of pairs that fit, the median error of all pairs, and that of
 * places that three cameras see. */
typedef struct score {
    int n_fit;
    double typical, carried;
} score;

/* Scores cameras. off (n_pairs) is scratch memory and ends sorted. */
static score score_of(const search *s, const saga_pinhole *cameras, double *off)
{
    score found = { 0, (double)NAN, carry(s, cameras) };
    off_pairs(off, s, cameras);
    for (size_t i = 0; i < s->pairs.n; i++)
        found.n_fit += off[i] <= s->pairs.within;
    found.typical = saga_median(off, s->pairs.n);
    return found;
}

/* Tells whether the errors of a are below `part` of those of b. */
static bool is_nearer(const score *a, const score *b, double part)
{
    return isinf(a->carried) && isinf(b->carried)
               ? a->typical < part * b->typical
               : a->carried < part * b->carried;
}

static bool is_better(const score *a, const score *b)
{
    return a->n_fit > b->n_fit ||
           (a->n_fit == b->n_fit && is_nearer(a, b, 1.0));
}

typedef struct best {
    saga_mistake mistake;
    score score;
} best;

/* Scores the cameras with a mistake undone, and keeps the mistake if it is the
 * best so far. */
static void try_mistake(best *to, const search *s, const saga_mistake *m,
                        saga_pinhole *cameras)
{
    const saga_source_view *const views = s->c->views;
    const int *const other = m->swapped;
    for (int v = 0; v < s->c->n_views; v++) {
        const int from = v == other[0]   ? other[1]
                         : v == other[1] ? other[0]
                                         : v;
        cameras[v] = saga_pinhole_of(&views[from]);
        saga_mistake_undo(m, cameras[v].rotation, cameras[v].translation,
                          cameras[v].lens);
    }
    const score now = score_of(s, cameras, s->scratch + SAGA_FEATURES_MOST);
    if (is_better(&now, &to->score))
        *to = (best){ *m, now };
}

/* Tells whether undoing a mistake explains the pictures. Most pairs must fit
 * with the mistake undone. In addition, a mistake that all cameras share must
 * have moved most of the places that three cameras see; if there are none, or
 * if pictures are exchanged, either most of the pairs that did not fit before
 * must fit then, or the error of pairs must be clearly smaller. */
static bool explains(const best *to, const score *now, int n_pairs)
{
    const score *const then = &to->score;
    const int gain = then->n_fit - now->n_fit, bad = n_pairs - now->n_fit;
    if (gain < 0 || then->n_fit < MOST_FIT * n_pairs)
        return false;
    if (to->mistake.swapped[0] < 0 && !isinf(then->carried))
        return then->carried < EXPLAINED * now->carried;
    return (gain >= FEW_PAIRS && gain >= EXPLAINED * bad) ||
           (n_pairs >= 2 * FEW_PAIRS &&
            then->typical < EXPLAINED * now->typical);
}

/* Tries all focal lengths for one form of poses. A focal length other than the
 * file's must explain much to be chosen, because noise too has a best one. */
static void try_lenses(best *to, const search *s, saga_mistake m,
                       saga_pinhole *cameras)
{
    const int most = FOCAL_STEPS * FOCAL_OCTAVES;
    best as_is = { .score = { .n_fit = -1 } }, other = as_is;
    try_mistake(&as_is, s, &m, cameras);
    for (int k = -most; k <= most; k++)
        for (int centre = 0; centre < 2 && k != 0; centre++) {
            m.focal = exp2((double)k / FOCAL_STEPS);
            m.centre = centre;
            try_mistake(&other, s, &m, cameras);
        }
    if (explains(&other, &as_is.score, (int)s->pairs.n))
        as_is = other;
    if (is_better(&as_is.score, &to->score))
        *to = as_is;
}

/* Tries exchanged pictures of two views whose poses are right. */
static void try_swaps(best *to, const search *s, saga_pinhole *cameras)
{
    const saga_source_view *const views = s->c->views;
    saga_mistake m = { .focal = 1.0 };
    for (int v = 0; v < s->c->n_views; v++)
        for (int w = v + 1; w < s->c->n_views; w++) {
            m.swapped[0] = v;
            m.swapped[1] = w;
            if (views[v].width == views[w].width &&
                views[v].height == views[w].height)
                try_mistake(to, s, &m, cameras);
        }
}

/* Tells whether cameras often have these axes reversed: none, or y and z, by
 * which OpenCV's and OpenGL's differ. */
static bool is_usual(int axes)
{
    return axes == 0 || axes == SAGA_AXIS_Y + SAGA_AXIS_Z;
}

/* Tries one form of poses with axes of the cameras reversed. Whether the loader
 * reversed axes before it read the matrix as camera to world is known. It is
 * not searched for, because a world turned as a whole would fit as well. */
static void try_form(best *to, const search *s, saga_pose_form form, int axes,
                     saga_pinhole *cameras)
{
    const bool odd = (axes ^ axes >> 1 ^ axes >> 2) & 1;
    const saga_mistake m = { .poses = s->c->poses,
                             .form = form,
                             .reversed = axes,
                             /* Whatever is undone leads to a rotation. */
                             .mirrored = odd != s->left_handed,
                             .focal = 1.0,
                             .swapped = { -1, -1 } };
    if (is_usual(axes)) {
        try_lenses(to, s, m, cameras);
        return;
    }
    best other = { .score = { .n_fit = -1 } };
    try_mistake(&other, s, &m, cameras);
    if (is_better(&other.score, &to->score) &&
        is_nearer(&other.score, &to->score, GAIN))
        *to = other;
}

static void try_forms(best *to, const search *s, saga_pinhole *cameras)
{
    for (int usual = 1; usual >= 0; usual--)
        for (int form = 0; form < SAGA_POSE_FORMS; form++)
            for (int axes = 0; axes < SAGA_AXES; axes++)
                if (is_usual(axes) == usual)
                    try_form(to, s, (saga_pose_form)form, axes, cameras);
}

/* ------------------------------------------------------------------ verdict */

/* Gathers, in s->scratch, the errors of a view's pairs with views that are not
 * odd. Returns their number. */
static size_t gather(const saga_calibration *cal, const search *s, int v,
                     const double *off)
{
    size_t n = 0;
    for (size_t i = 0; i < s->pairs.n && n < SAGA_FEATURES_MOST; i++) {
        const saga_pair *const p = &s->pairs.list[i];
        if ((p->a == v && !cal->odd[p->b]) || (p->b == v && !cal->odd[p->a]))
            s->scratch[n++] = off[i];
    }
    return n;
}

/* Returns an error that more than half of a view's pairs with views that are
 * not odd exceed or have. It is 0 for a single pair, because that pair may be
 * the wrong one. */
static double off_most(const saga_calibration *cal, const search *s, int v,
                       const double *off)
{
    const size_t n = gather(cal, s, v, off);
    qsort(s->scratch, n, sizeof *s->scratch, saga_by_value);
    return n > 1 ? s->scratch[(n - 1) / 2] : 0.0;
}

/* Marks odd views, one after the other: each is the view with the largest error
 * above that of fitting pairs. If more than a third of the views are marked,
 * none is, because the error then lies elsewhere. */
static void find_odd(saga_calibration *cal, const search *s, const double *off)
{
    const int n_views = s->c->n_views;
    double *const sorted = s->scratch + SAGA_FEATURES_MOST;
    memcpy(sorted, off, s->pairs.n * sizeof *off);
    qsort(sorted, s->pairs.n, sizeof *sorted, saga_by_value);
    /* A third of the pairs is taken as fitting, because one odd view of four is
     * in half of the pairs. */
    const double fits = sorted[s->pairs.n / 3];
    const double limit = fmax(s->pairs.within / 2.0, ODD * fits);
    int n_odd = 0, n_left = 0;
    for (bool more = fits <= s->pairs.within; more; n_odd += more) {
        int worst = 0;
        double most = limit;
        for (int v = 0; v < n_views; v++) {
            const double one = cal->odd[v] ? 0.0 : off_most(cal, s, v, off);
            worst = one > most ? v : worst;
            most = one > most ? one : most;
        }
        more = most > limit;
        cal->odd[worst] = cal->odd[worst] || more;
    }
    /* Too few pairs without odd views are no evidence. */
    for (size_t i = 0; i < s->pairs.n; i++) {
        const saga_pair *const p = &s->pairs.list[i];
        n_left += !cal->odd[p->a] && !cal->odd[p->b];
    }
    if (3 * n_odd > n_views || n_left < FEW_PAIRS)
        memset(cal->odd, 0, (size_t)n_views * sizeof *cal->odd);
}

static void judge(saga_calibration *cal, const search *s, saga_pinhole *cameras)
{
    const int n_views = s->c->n_views, n_pairs = (int)s->pairs.n;
    double *const off = s->scratch + SAGA_FEATURES_MOST + s->pairs.n;
    for (int v = 0; v < n_views; v++)
        cameras[v] = saga_pinhole_of(&s->c->views[v]);
    off_pairs(off, s, cameras);
    for (int v = 0; v < n_views; v++)
        cal->off[v] = saga_median(s->scratch, gather(cal, s, v, off));
    /* A mirrored world fits as it is. */
    best found = { .mistake = { .poses = s->c->poses,
                                .mirrored = s->left_handed,
                                .focal = 1.0,
                                .swapped = { -1, -1 } },
                   .score = score_of(s, cameras,
                                     s->scratch + SAGA_FEATURES_MOST) };
    cal->n_pairs = n_pairs;
    cal->n_fit = found.score.n_fit;
    cal->typical = found.score.typical;
    if (n_pairs < FEW_PAIRS)
        return;
    const score now = found.score;
    /* Simpler changes are tried first, since a later one must score better to
     * replace them. */
    if (n_views <= SAGA_ALL_PAIRS && !s->left_handed)
        try_swaps(&found, s, cameras);
    try_forms(&found, s, cameras);
    /* Mirror images are certainly wrong, even if they fit. */
    cal->found = s->left_handed ? found.score.n_fit >= MOST_FIT * n_pairs
                                : explains(&found, &now, n_pairs);
    cal->mistake = found.mistake;
    cal->n_fit_then = found.score.n_fit;
    cal->bad = now.n_fit < MOST_FIT * n_pairs;
    if (!cal->found)
        find_odd(cal, s, off);
}

/* Clears odd views that are off by little, if their cameras were refined in
 * vain: of a few pairs with repeated objects the median may be wrong. */
static void pardon(saga_calibration *cal, int n_views)
{
    const saga_refinement *const r = &cal->refinement;
    for (int v = 0; v < n_views && !isnan(r->before) && !r->helps; v++)
        cal->odd[v] = cal->odd[v] && cal->off[v] > FAR_OFF * cal->within;
}

/* ----------------------------------------------------------------- together */

static bool reserve(saga_calibration *cal, size_t n, saga_error *error)
{
    *cal = (saga_calibration){ .typical = (double)NAN };
    cal->off = saga_alloc(n, sizeof *cal->off, "the views", error);
    cal->odd = saga_calloc(n, sizeof *cal->odd, "the views", error);
    cal->colours = saga_alloc(n, sizeof *cal->colours, "the views", error);
    cal->shared = saga_alloc(n * n, sizeof *cal->shared, "the views", error);
    cal->turned = saga_alloc(n * n, sizeof *cal->turned, "the views", error);
    cal->n_features = saga_calloc(n, sizeof *cal->n_features, "the views",
                                  error);
    if (!cal->off || !cal->odd || !cal->colours || !cal->shared ||
        !cal->turned || !cal->n_features)
        return false;
    for (size_t i = 0; i < n * n; i++) {
        cal->shared[i] = -1;
        cal->turned[i] = (double)NAN;
    }
    for (size_t v = 0; v < n; v++)
        cal->off[v] = (double)NAN;
    return true;
}

/* Sets the number of matches for each pair of views, 0 if they were compared
 * without any match. */
static void count_shared(int *shared, const saga_pairs *pairs)
{
    const int n = pairs->capture->n_views;
    for (size_t i = 0; i < pairs->n; i++) {
        const saga_pair *const p = &pairs->list[i];
        shared[p->a * n + p->b] = shared[p->b * n + p->a] = (int)p->n;
    }
}

/* Sets, for each pair of views, how far its matches are from where they would
 * be if the cameras stood at one place. */
static void find_turned(double *turned, const search *s)
{
    const int n = s->c->n_views;
    for (size_t i = 0; i < s->pairs.n; i++) {
        const saga_pair *const p = &s->pairs.list[i];
        const saga_pinhole a = saga_pinhole_of(&s->c->views[p->a]);
        const saga_pinhole b = saga_pinhole_of(&s->c->views[p->b]);
        for (size_t k = 0; k < p->n; k++)
            s->scratch[k] = saga_epipolar_turned(&a, &b, &p->matches[k]);
        turned[p->a * n + p->b] = turned[p->b * n + p->a] = saga_median(
            s->scratch, p->n);
    }
}

static bool compare(saga_calibration *cal, search *s, saga_error *error)
{
    if (!saga_pairs_look(&s->pairs, s->c, 0, error) ||
        !saga_pairs_list(&s->pairs, error))
        return false;
    count_shared(cal->shared, &s->pairs);
    if (!saga_pairs_match(&s->pairs, saga_pair_agree, error))
        return false;
    count_shared(cal->shared, &s->pairs);
    cal->within = s->pairs.within;
    for (int v = 0; v < s->c->n_views; v++)
        cal->n_features[v] = (int)s->pairs.features[v].n;
    if (!saga_tracks_make(&s->tracks, &s->pairs, error))
        return false;
    s->scratch = saga_alloc(SAGA_FEATURES_MOST + 2 * s->pairs.n,
                            sizeof *s->scratch, "the matches", error);
    s->carried = saga_alloc(s->tracks.n_places + 1, sizeof *s->carried,
                            "the matches", error);
    if (!s->scratch || !s->carried)
        return false;
    find_turned(cal->turned, s);
    return true;
}

bool saga_calibration_find(saga_calibration *calibration,
                           const saga_capture *capture, saga_error *error)
{
    const size_t n_views = (size_t)capture->n_views;
    search s = { .c = capture };
    saga_pinhole *const cameras = saga_alloc(n_views, sizeof *cameras,
                                             "the views", error);
    bool ok = reserve(calibration, n_views, error) && cameras &&
              compare(calibration, &s, error);
    s.left_handed = n_views > 0 &&
                    saga_pose_is_mirrored(capture->views[0].rotation);
    if (ok)
        judge(calibration, &s, cameras);
    if (ok && !calibration->found && !s.left_handed)
        ok = saga_refine(&calibration->refinement, &s.pairs, &s.tracks, error);
    if (ok && !calibration->found)
        pardon(calibration, capture->n_views);
    ok = ok && saga_match_colours_find(calibration->colours, &s.pairs, error);
    saga_tracks_free(&s.tracks);
    saga_pairs_free(&s.pairs);
    free(s.scratch);
    free(s.carried);
    free(cameras);
    return ok;
}

void saga_calibration_free(saga_calibration *calibration)
{
    free(calibration->off);
    free(calibration->odd);
    free(calibration->colours);
    free(calibration->shared);
    free(calibration->turned);
    free(calibration->n_features);
    saga_refinement_free(&calibration->refinement);
    *calibration = (saga_calibration){ .off = NULL };
}
