/* SPDX-License-Identifier: MIT
 *
 * Finds the moment of each entry: by its time, by the number in its name, or by
 * the order of the names.
 */
#include "transforms.h"

#include "alloc.h"
#include "error.h"
#include "moments.h"
#include "notes.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* Takes the numbers in the files' names as times, for captures that lack
 * entries and have no times. */
static void take_numbers_for_times(saga_transforms *r)
{
    for (int i = 0; i < r->n_entries; i++) {
        saga_entry *const e = &r->entries[i];
        const char *const dot = strrchr(e->file, '.');
        uint64_t number;
        (void)saga_last_number(
            e->file, dot ? (size_t)(dot - e->file) : strlen(e->file), &number);
        e->time = (double)number;
    }
    /* The first sort was done while all times were equal, so it is repeated. */
    saga_transforms_sort(r);
}

/* Sets *k to the entry's moment. In a view with all n pictures that is the
 * entry's rank, which *k holds already; otherwise it is the nearest of n evenly
 * spaced times from `start`. */
static bool find_moment(const saga_transforms *r, const saga_entry *e,
                        double start, double step, int n, int *k)
{
    if (!isfinite(e->time))
        return saga_fail(r->error, r->path, "correct it",
                         "time of %s is not finite", e->file);
    const double moment = step > 0.0 ? fmin(fmax((e->time - start) / step, 0.0),
                                            n - 1.0)
                                     : 0.0;
    if (r->view_size[e->view] < n)
        *k = (int)floor(moment + 0.5);
    /* A time within a quarter of a step counts as synchronous. */
    const double near = start + step * *k;
    return fabs(e->time - near) <= 0.25 * step ||
           saga_fail(r->error, r->path,
                     "give pictures that are synchronous and "
                     "evenly spaced in time",
                     "time %g of %s is not near %g, "
                     "that of frame %d",
                     e->time, e->file, near, *k);
}

/* Sets the table of entries by view and moment. Entries are sorted by view and
 * time, and those of the fullest view define the moments. If there are no times
 * and no gaps, the order of entries gives their moments. */
static bool place_entries(saga_transforms *r, int n, bool timed)
{
    const saga_entry *const ref = &r->entries[r->view_first[r->fullest]];
    const double step = n > 1 ? (ref[n - 1].time - ref[0].time) / (n - 1) : 0.0;
    r->at = saga_calloc((size_t)r->n_views * (size_t)n, sizeof *r->at, r->path,
                        r->error);
    for (int i = 0; r->at && i < r->n_entries; i++) {
        saga_entry *const e = &r->entries[i];
        int k = i - r->view_first[e->view];
        /* If k > 0, the previous entry belongs to the same view. */
        const bool twice = k > 0 && timed && e->time == e[-1].time;
        if (timed && !twice && !find_moment(r, e, ref[0].time, step, n, &k))
            return false;
        saga_entry **const to = &r->at[e->view * n + k];
        if (twice || *to)
            return saga_fail(r->error, r->path,
                             "keep one picture for each "
                             "camera and moment",
                             "%s and %s have one pose and one time "
                             "%g",
                             e[-1].file, e->file, e->time);
        *to = e;
    }
    return r->at != NULL;
}

/* Sets the moment of every picture, and how late after it the picture was
 * taken. */
static bool place_moving(saga_transforms *r, int n)
{
    double first = r->entries[0].time, last = first;
    for (int i = 0; i < r->n_entries; i++) {
        first = fmin(first, r->entries[i].time);
        last = fmax(last, r->entries[i].time);
    }
    r->first_time = first;
    /* n >= 2, because find_moves does not treat a capture with one moment as
     * moving. */
    r->step = (last - first) / (n - 1);
    if (!isfinite(r->step))
        return saga_fail(r->error, r->path, "correct them",
                         "times run from "
                         "%g to %g",
                         first, last);
    r->at = saga_calloc((size_t)r->n_views * (size_t)n, sizeof *r->at, r->path,
                        r->error);
    for (int i = 0; r->at && i < r->n_entries; i++) {
        saga_entry *const e = &r->entries[i];
        const double moment = (e->time - first) / r->step;
        /* A picture within 1e-4 of a step counts as taken at the moment
         * itself. */
        const bool between = fabs(moment - rint(moment)) > 1e-4;
        const double k = between ? floor(moment) : rint(moment);
        e->late = between ? moment - k : 0.0;
        r->at[e->view * n + (int)k] = e;
    }
    r->listing->moves = true;
    if (r->at)
        saga_note(r->listing->notes,
                  "cameras: the camera moves; its %d "
                  "pictures are views of %d moments",
                  r->n_entries, n);
    return r->at != NULL;
}

static bool place(saga_transforms *r, int n)
{
    const bool timed = saga_transforms_n_timed(r) > 0;
    const bool holes = r->n_entries < n * r->n_views;
    if (r->n_moments > 0)
        return place_moving(r, n);
    /* If there are no times, the order of entries gives their moments, unless
     * some pictures are not listed. */
    if (holes && !timed)
        take_numbers_for_times(r);
    return place_entries(r, n, (timed || holes) && !r->videos);
}

/* Derives the frame rate from times, which are in seconds unless they run from
 * exactly 0 to exactly 1. */
static void guess_fps(saga_transforms *r, int n)
{
    const saga_entry *const e = &r->entries[r->view_first[r->fullest]];
    const bool moving = r->n_moments > 0;
    if (r->listing->fps > 0.0 || n < 2 || saga_transforms_n_timed(r) == 0)
        return;
    /* For a moving camera the times of all views count, otherwise those of the
     * fullest view. */
    const double first = moving ? r->first_time : e[0].time;
    const double last = moving ? first + r->step * (n - 1) : e[n - 1].time;
    if (fabs(first) < 1e-9 && fabs(last - 1.0) < 1e-9) {
        saga_note(r->listing->notes, "time: values from 0 to 1 are taken as "
                                     "fractions of the whole time");
        return;
    }
    r->listing->fps = (n - 1) / (last - first);
}

bool saga_transforms_find_moments(saga_transforms *r, int n)
{
    if (!place(r, n))
        return false;
    if (!r->videos)
        guess_fps(r, n);
    return true;
}
