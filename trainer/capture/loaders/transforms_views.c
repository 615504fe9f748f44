/* SPDX-License-Identifier: MIT
 *
 * Groups entries into cameras: entries with the same pose and the same
 * intrinsics are one camera. If the camera moves, each entry is a view of its
 * own.
 */
#include "transforms.h"

#include "alloc.h"
#include "error.h"
#include "order.h"

#include <stdlib.h>
#include <string.h>

static bool too_many(const saga_transforms *r, const char *remedy,
                     const char *what)
{
    return saga_fail(r->error, r->path, remedy, "has more than %d %s",
                     SAGA_MAX_VIEWS, what);
}

/* Makes room for one more item in `first` (n_views). */
static bool add_view(const saga_transforms *r, int **first)
{
    if (r->n_views == SAGA_MAX_VIEWS)
        return too_many(r, "every camera must stand still and have one pose",
                        "different camera poses");
    int *const more = saga_realloc(*first, (size_t)r->n_views + 1, sizeof *more,
                                   r->path, r->error);
    *first = more ? more : *first;
    return more != NULL;
}

static bool assign_views(saga_transforms *r)
{
    int *first = NULL; /* (n_views) the first entry of each view */
    bool ok = true;
    for (int i = 0; ok && i < r->n_entries; i++) {
        saga_entry *const e = &r->entries[i];
        e->view = -1;
        /* Newest views are tried first, since files mostly list one camera
         * after another. Each video is a view of its own, whatever its pose. */
        for (int v = r->n_views; !r->videos && v-- > 0 && e->view < 0;)
            if (memcmp(&r->entries[first[v]].key, &e->key, sizeof e->key) == 0)
                e->view = v;
        if (e->view >= 0)
            continue;
        ok = add_view(r, &first);
        if (ok) {
            first[r->n_views] = i;
            e->view = r->n_views++;
        }
    }
    free(first);
    if (!ok)
        return false;
    r->view_size = saga_calloc((size_t)r->n_views, sizeof *r->view_size,
                               r->path, r->error);
    if (!r->view_size)
        return false;
    for (int i = 0; i < r->n_entries; i++)
        r->view_size[r->entries[i].view]++;
    return true;
}

/* Returns the number of different times of training pictures; `times` is
 * scratch memory for all entries. */
static int count_moments(const saga_transforms *r, double *times)
{
    size_t n = 0;
    int n_moments = 1;
    for (int i = 0; i < r->n_entries; i++)
        if (!r->entries[i].held_out)
            times[n++] = r->entries[i].time;
    if (n == 0)
        return 0;
    qsort(times, n, sizeof *times, saga_by_value);
    /* Times closer than a millionth of the span are equal except for
     * rounding. */
    const double least = 1e-6 * (times[n - 1] - times[0]);
    for (size_t i = 1; i < n; i++)
        n_moments += times[i] - times[i - 1] > least;
    return n_moments;
}

/* The camera is taken to move if fewer than two pictures share a pose on
 * average and no pose has more than half of the moments. Then every picture
 * becomes a view. */
static bool find_moves(saga_transforms *r)
{
    int most = 0;
    for (int v = 0; v < r->n_views; v++)
        most = r->view_size[v] > most ? r->view_size[v] : most;
    if (r->videos || saga_transforms_n_timed(r) < r->n_entries ||
        2 * r->n_views <= r->n_entries)
        return true;
    double *const times = saga_alloc((size_t)r->n_entries, sizeof *times,
                                     r->path, r->error);
    if (!times)
        return false;
    const int n = count_moments(r, times);
    free(times);
    if (2 * most > n)
        return true;
    /* There may be more pictures than poses, and each picture becomes a
     * view. */
    if (r->n_entries > SAGA_MAX_VIEWS)
        return too_many(r, "list fewer pictures",
                        "pictures of a camera that moves");
    int *const size = saga_realloc(r->view_size, (size_t)r->n_entries,
                                   sizeof *size, r->path, r->error);
    if (!size)
        return false;
    r->view_size = size;
    /* From here on every picture is a view of its own. */
    r->n_moments = n;
    r->n_views = r->n_entries;
    for (int i = 0; i < r->n_entries; i++) {
        r->entries[i].view = i;
        size[i] = 1;
    }
    return true;
}

static bool index_views(saga_transforms *r)
{
    r->view_first = saga_calloc((size_t)r->n_views, sizeof *r->view_first,
                                r->path, r->error);
    for (int v = 0, i = 0; r->view_first && v < r->n_views; v++) {
        r->view_first[v] = i;
        i += r->view_size[v];
        if (r->view_size[v] > r->view_size[r->fullest])
            r->fullest = v;
    }
    return r->view_first != NULL;
}

static bool check_counts(const saga_transforms *r)
{
    const int n_times = saga_transforms_n_timed(r);
    if (n_times != 0 && n_times != r->n_entries)
        return saga_fail(r->error, r->path,
                         "give every picture its time, or "
                         "none",
                         "only %d of %d frames have \"time\"", n_times,
                         r->n_entries);
    for (int v = 0; v < r->n_views; v++) {
        const int n = r->view_size[v], most = r->view_size[r->fullest];
        /* A camera may lack up to half of its pictures. */
        if (2 * n < most)
            return saga_fail(r->error, r->path,
                             "give every camera a picture "
                             "of every moment, with one pose",
                             "unequal frame counts: camera of %s has %d, "
                             "camera of %s has %d",
                             r->entries[r->view_first[r->fullest]].file, most,
                             r->entries[r->view_first[v]].file, n);
    }
    return true;
}

bool saga_transforms_find_views(saga_transforms *r)
{
    if (!assign_views(r) || !find_moves(r))
        return false;
    saga_transforms_sort(r);
    return index_views(r) && check_counts(r);
}
