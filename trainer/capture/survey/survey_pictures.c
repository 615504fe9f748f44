/* SPDX-License-Identifier: MIT */
#include "survey_pictures.h"

#include "alloc.h"
#include "notes.h"
#include "order.h"

#include <math.h>
#include <stdlib.h>

/* Limits. Where cameras differ from scene to scene, a camera is compared with
 * the median camera, because most cameras are right. */

/* Correlation of pixels side by side. Of noise it is 0, and 0.5 if that was
 * enlarged or coded; of the captures that we have it is 0.9 or more. */
#define NOISE 0.6
/* Detail as a part of the median camera's. Blurring by 2 pixels leaves half. */
#define BLURRED 0.6
/* Part of the steps in which a camera stands still. A video of half the others'
 * rate repeats every second picture. */
#define FROZEN 0.6
/* Levels, and factor against the median camera, by which colours differ at the
 * places that two cameras see. */
#define OTHER_COLOUR 12.0
#define OTHER_FACTOR 3.0
/* An exchange of red and blue must leave this part of the difference. */
#define EXCHANGED 0.6
#define SOME_COLOUR 4.0 /* levels; a grey scene tells nothing */
/* Matches as a part of the median camera's. A picture of something else has a
 * few by chance. */
#define ALONE 0.1
#define AS_FAR 0.8 /* angle of a neighbour against this camera's */
#define NEARLY_ALL 0.8
/* With a median below this, cameras are too far apart to match: a pair has 16
 * matches or none. The ring of ten cameras, 33 degrees apart, has 23; that of
 * twenty with 1352x1014 pixels, 18 degrees apart, 64, and four that are right
 * have none. */
#define FEW_MATCHES 96.0

#define REMEDY ". Correct the files, or leave them out by --hold-out."

/* The median camera. */
typedef struct typical {
    double detail, colour, matches; /* NaN: too few cameras know theirs */
    const double *n_matches;        /* (n_views) */
    int n_views;
} typical;

static void blank(char *notes, const saga_source_view *view,
                  const saga_look *look)
{
    static const saga_note_kind kind = { "Nothing is seen: ", REMEDY };
    saga_note_each(notes, &kind, "%s is %s (in %d of %d pictures looked at)",
                   view->name,
                   look->level < 48.0    ? "black"
                   : look->level > 208.0 ? "white"
                                         : "of one colour",
                   look->n_blank, look->n_seen);
}

/* Sets n_matches (n_views) to the number of a view's matches with others. */
static void count_matches(double *n_matches, const saga_survey *s, int n)
{
    for (int v = 0; v < n; v++) {
        n_matches[v] = 0.0;
        for (int w = 0; w < n; w++)
            n_matches[v] += fmax(s->calibration.shared[v * n + w], 0);
    }
}

/* Tells whether a view matches next to nothing, while nearly all others do
 * whose neighbours are not much nearer. */
static bool is_alone(const saga_survey *s, int v, const typical *t)
{
    const double least = ALONE * t->matches;
    int n_like = 0, n_match = 0;
    for (int w = 0; w < t->n_views; w++) {
        if (w == v || s->views[w].angle < AS_FAR * s->views[v].angle)
            continue;
        n_like++;
        n_match += t->n_matches[w] >= least;
    }
    return t->matches >= FEW_MATCHES && t->n_matches[v] < least &&
           n_match >= 2 && n_match >= NEARLY_ALL * n_like;
}

/* Notes the first thing that is wrong with a camera's pictures. */
static void judge_one(saga_survey *s, const saga_capture *c, int v,
                      const typical *t)
{
    static const saga_note_kind noise = { "Noise instead of pictures: ",
                                          REMEDY };
    static const saga_note_kind swapped = { "Red and blue are exchanged: ",
                                            REMEDY };
    static const saga_note_kind blurred = { "Out of focus: ", REMEDY };
    static const saga_note_kind frozen = {
        "Frozen, or nothing that moves is in view: ", REMEDY
    };
    static const saga_note_kind alone = {
        "Another scene, or pictures that show too little: ", REMEDY
    };
    static const saga_note_kind coloured = {
        "Colours are not those that other cameras see at the same places: ",
        "; `saga encode` evens out one factor for each of red, green and blue, "
        "but nothing else."
    };
    const saga_survey_view *const one = &s->views[v];
    const saga_look *const look = &one->look;
    const char *const name = c->views[v].name;
    /* The pictures alone come first, since all other comparisons of a camera
     * without a usable picture are wrong as well. */
    if (look->alike < NOISE)
        saga_note_each(s->notes, &noise, "%s", name);
    else if (one->colour > SOME_COLOUR && one->swapped < EXCHANGED)
        saga_note_each(s->notes, &swapped,
                       "%s (colours differ by %.0f of 255 "
                       "levels; exchanged by %.0f)",
                       name, one->colour, one->colour * one->swapped);
    else if (look->detail < BLURRED * t->detail)
        saga_note_each(s->notes, &blurred,
                       "%s has %.0f %% of the others' fine "
                       "detail",
                       name, 100.0 * look->detail / t->detail);
    else if (look->still > FROZEN)
        saga_note_each(s->notes, &frozen,
                       "%s stands still in %.0f %% of the "
                       "steps in which others change",
                       name, 100.0 * look->still);
    else if (is_alone(s, v, t))
        saga_note_each(s->notes, &alone,
                       "%s has %.0f matches with all other "
                       "cameras (the median has %.0f)",
                       name, t->n_matches[v], t->matches);
    else if (one->colour > fmax(OTHER_COLOUR, OTHER_FACTOR * t->colour))
        saga_note_each(s->notes, &coloured, "%s differs by %.0f of 255 levels",
                       name, one->colour);
}

/* Returns the median of the n numbers in x that are known; NaN if they are
 * fewer than three: of two cameras nobody knows which one is right. */
static double median_known(const double *x, size_t n, double *scratch)
{
    size_t known = 0;
    for (size_t i = 0; i < n; i++)
        if (!isnan(x[i]))
            scratch[known++] = x[i];
    return known < 3 ? (double)NAN : saga_median(scratch, known);
}

bool saga_survey_judge_pictures(saga_survey *survey,
                                const saga_capture *capture, saga_error *error)
{
    const size_t n = (size_t)capture->n_views;
    /* Detail, colours, blank pictures and matches of each view, and scratch
     * memory. */
    double *const x = saga_alloc(5 * n, sizeof *x, "the pictures", error);
    if (!x)
        return false;
    for (size_t v = 0; v < n; v++) {
        const saga_survey_view *const one = &survey->views[v];
        x[v] = one->look.detail;
        x[n + v] = one->colour;
        x[2 * n + v] = one->look.n_blank;
    }
    count_matches(x + 3 * n, survey, capture->n_views);
    double *const scratch = x + 4 * n;
    const typical t = { median_known(x, n, scratch),
                        median_known(x + n, n, scratch),
                        median_known(x + 3 * n, n, scratch), x + 3 * n,
                        capture->n_views };
    const double n_dark = saga_median(x + 2 * n, n);
    for (int v = 0; v < capture->n_views; v++) {
        const saga_look *const look = &survey->views[v].look;
        /* All cameras may be dark at once, but not in all pictures. */
        if (look->n_blank > n_dark ||
            (look->n_blank > 0 && look->n_blank == look->n_seen))
            blank(survey->notes, &capture->views[v], look);
        else if (!capture->moves)
            judge_one(survey, capture, v, &t);
    }
    free(x);
    return true;
}
