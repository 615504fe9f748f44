/* SPDX-License-Identifier: MIT */
#include "moments.h"

#include "alloc.h"
#include "error.h"
#include "file.h"
#include "order.h"

#include <stdlib.h>
#include <string.h>

/* Only the last 18 digits of a number count, because they always fit in 64
 * bits. */
bool saga_last_number(const char *s, size_t n, uint64_t *number)
{
    while (n > 0 && (s[n - 1] < '0' || s[n - 1] > '9'))
        n--;
    size_t first = n;
    while (first > 0 && n - first < 18 && s[first - 1] >= '0' &&
           s[first - 1] <= '9')
        first--;
    *number = 0;
    for (size_t i = first; i < n; i++)
        *number = *number * 10 + (uint64_t)(s[i] - '0');
    return n > first;
}

static bool ends_with(const char *name, const char *const *endings, size_t n)
{
    for (size_t i = 0; i < n; i++)
        if (saga_has_suffix(name, endings[i]))
            return true;
    return false;
}

/* Tells by a file name's extension whether it is a still picture that can be
 * read. */
static bool is_picture_name(const char *name)
{
    static const char *const endings[] = { ".png", ".jpg",  ".jpeg", ".webp",
                                           ".tif", ".tiff", ".exr" };
    return ends_with(name, endings, sizeof endings / sizeof *endings);
}

bool saga_is_video_name(const char *name)
{
    static const char *const endings[] = { ".mp4", ".mov",  ".m4v",
                                           ".mkv", ".webm", ".avi",
                                           ".ts",  ".mts",  ".m2ts" };
    return ends_with(name, endings, sizeof endings / sizeof *endings);
}

bool saga_finds_add(saga_finds *finds, int source, uint64_t moment, char *path,
                    saga_error *error)
{
    if (!path)
        return false;
    saga_found *more = finds->items;
    if ((finds->n & (finds->n - 1)) == 0) /* the capacity is the next power of
                                           * two */
        more = saga_realloc(finds->items, finds->n ? 2 * finds->n : 1,
                            sizeof *more, path, error);
    if (!more) {
        free(path);
        return false;
    }
    finds->items = more;
    more[finds->n++] = (saga_found){ source, moment, path };
    return true;
}

bool saga_finds_add_folder(saga_finds *finds, int source, const char *folder,
                           saga_error *error)
{
    saga_names names;
    bool ok = saga_folder_list(&names, folder, is_picture_name, error);
    for (size_t i = 0; ok && i < names.n; i++) {
        const char *const name = names.at[i];
        uint64_t moment;
        /* strrchr finds a dot, because is_picture_name requires an
         * extension. */
        (void)saga_last_number(name, (size_t)(strrchr(name, '.') - name),
                               &moment);
        ok = saga_finds_add(finds, source, moment,
                            saga_path_join(folder, name, error), error);
    }
    saga_names_free(&names);
    return ok;
}

void saga_finds_free(saga_finds *finds)
{
    for (size_t i = 0; i < finds->n; i++)
        free(finds->items[i].path);
    free(finds->items);
    *finds = (saga_finds){ 0 };
}

static int by_moment(const void *a, const void *b)
{
    const saga_found *const x = a, *const y = b;
    if (x->moment != y->moment)
        return x->moment < y->moment ? -1 : 1;
    if (x->source != y->source)
        return x->source < y->source ? -1 : 1;
    return saga_compare_names(x->path, y->path);
}

/* Returns the number of different moments in sorted finds. */
static int count_moments(const saga_finds *finds)
{
    int n = 0;
    for (size_t i = 0; i < finds->n && n <= SAGA_MAX_FRAMES; i++)
        n += i == 0 || finds->items[i].moment != finds->items[i - 1].moment;
    return n;
}

/* If each camera has only one picture, all pictures belong to one moment,
 * whatever their numbers are. */
static void join_stills(saga_finds *finds, const int *n_of)
{
    for (size_t i = 0; i < finds->n; i++)
        if (n_of[finds->items[i].source] > 1)
            return;
    for (size_t i = 0; i < finds->n; i++)
        finds->items[i].moment = 0;
}

static bool place(saga_listing *listing, saga_finds *finds, saga_error *error)
{
    int k = -1;
    for (size_t i = 0; i < finds->n; i++) {
        saga_found *const f = &finds->items[i];
        /* The finds are sorted, so k is the number of the moment. A source that
         * lacks a moment keeps NULL there. */
        k += i == 0 || f->moment != finds->items[i - 1].moment;
        char **const to = &listing->sources[f->source].pictures[k];
        if (*to)
            return saga_fail(error, f->path,
                             "keep one picture for each "
                             "camera and moment",
                             "is a second picture of "
                             "camera %s with the number %llu, besides %.200s",
                             listing->sources[f->source].name,
                             (unsigned long long)f->moment, *to);
        /* The listing owns the path from here on. */
        *to = f->path;
        f->path = NULL;
    }
    return true;
}

bool saga_listing_take_finds(saga_listing *listing, saga_finds *finds,
                             saga_error *error)
{
    int *const n_of = saga_calloc((size_t)listing->n_sources, sizeof *n_of,
                                  listing->path, error);
    for (size_t i = 0; n_of && i < finds->n; i++)
        n_of[finds->items[i].source]++;
    /* Stills are joined before the sort, since that changes their moments. */
    if (n_of)
        join_stills(finds, n_of);
    if (finds->n > 0)
        qsort(finds->items, finds->n, sizeof *finds->items, by_moment);
    bool ok = n_of != NULL;
    free(n_of);
    const int n = count_moments(finds);
    if (ok && n > SAGA_MAX_FRAMES)
        ok = saga_fail(error, listing->path, "split the capture",
                       "has more than %d frames", SAGA_MAX_FRAMES);
    if (ok)
        listing->n_frames = n;
    for (int i = 0; ok && i < listing->n_sources; i++) {
        saga_source *const s = &listing->sources[i];
        s->pictures = saga_calloc((size_t)n, sizeof *s->pictures, listing->path,
                                  error);
        ok = s->pictures != NULL;
    }
    ok = ok && place(listing, finds, error);
    saga_finds_free(finds);
    return ok;
}
