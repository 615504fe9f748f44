/* SPDX-License-Identifier: MIT
 *
 * The operations on a listing, which holds what a loader found, that all
 * loaders share.
 */
#include "load.h"

#include "alloc.h"
#include "error.h"
#include "file.h"
#include "notes.h"
#include "output.h"
#include "picture.h"
#include "picture_turn.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static void source_free(saga_source *s, int n_frames)
{
    for (int k = 0; k < n_frames; k++) {
        if (s->pictures)
            free(s->pictures[k]);
        if (s->depths)
            free(s->depths[k]);
        if (s->masks)
            free(s->masks[k]);
    }
    free(s->pictures);
    free(s->depths);
    free(s->masks);
    free(s->video);
    free(s->frames);
    saga_video_info_free(&s->info);
}

void saga_source_turn(saga_source *source, double width, double height)
{
    const int w = source->width;
    if (!saga_turn_wanted(source->orientation, w, source->height, width,
                          height))
        return;
    source->upright = !source->upright;
    source->width = source->height;
    source->height = w;
}

void saga_listing_note_turns(saga_listing *listing)
{
    static const char *const done[2] = {
        "but are used as they are stored, as the calibration's pictures are",
        "and are turned"
    };
    for (int upright = 0; upright < 2; upright++) {
        const saga_source *first = NULL;
        int n = 0;
        for (int i = 0; i < listing->n_sources; i++) {
            const saga_source *const s = &listing->sources[i];
            if (s->orientation < 2 || s->upright != (upright == 1))
                continue;
            first = first ? first : s;
            n++;
        }
        if (n > 0)
            saga_note(listing->notes,
                      "orientation: cameras whose files ask to be shown "
                      "turned: %d (%s: %s, EXIF orientation %d) %s",
                      n, first->name, saga_turn_name(first->orientation),
                      first->orientation, done[upright]);
    }
}

bool saga_source_fit(saga_source *source, double width, double height)
{
    saga_source_turn(source, width, height);
    const double sx = source->width / width, sy = source->height / height;
    if (!(fabs(sx / sy - 1.0) <= 0.01))
        return false;
    source->lens.fx *= sx;
    source->lens.cx *= sx;
    source->lens.fy *= sy;
    source->lens.cy *= sy;
    return true;
}

const char *saga_source_fit_remedy(const saga_source *source, double width,
                                   double height, const char *usual)
{
    return source->width == height && source->height == width
               ? "width and height are exchanged: turn the pictures by 90 "
                 "degrees, since nothing in them asks for it"
               : usual;
}

void saga_listing_free(saga_listing *listing)
{
    for (int i = 0; i < listing->n_sources; i++)
        source_free(&listing->sources[i], listing->n_frames);
    free(listing->sources);
    free(listing->points);
    free(listing->missing);
    *listing = (saga_listing){ 0 };
}

void saga_listing_miss(saga_listing *listing, char *path)
{
    if (listing->missing)
        free(path);
    else
        listing->missing = path;
}

/* ------------------------------------------------------------------- paths */

/* Returns the part of a name after its last "..", which only descends; an
 * absolute name is returned whole. */
static const char *descent(const char *name)
{
    const char *behind = name;
    for (const char *p = name; *p;) {
        const size_t n = strcspn(p, "/");
        if (n == 2 && p[0] == '.' && p[1] == '.')
            behind = p + n;
        p += n + strspn(p + n, "/");
    }
    return behind;
}

/* Tells whether a folder is `root` or below it; `root` must be a real path. */
static bool is_in(const char *folder, const char *root)
{
    char *const real = realpath(folder, NULL);
    const size_t n = strcmp(root, "/") ? strlen(root) : 0;
    const bool in = real && strncmp(real, root, n) == 0 &&
                    (real[n] == '/' || real[n] == '\0');
    free(real);
    return in;
}

/* Tells whether a path leads into `root`. The last n characters only descend,
 * so it is enough that one of the folders that they pass is in `root`. */
static bool leads_into(char *path, size_t n, const char *root)
{
    char *const real = realpath(root, NULL);
    bool in = false;
    for (char *p = path + strlen(path) - n; real && !in;
         p += 1 + strcspn(p + 1, "/")) {
        /* The path is cut here for the test, then restored. */
        const char end = *p;
        *p = '\0';
        in = is_in(p > path ? path : "/", real);
        *p = end;
        if (!end)
            break;
    }
    free(real);
    return in;
}

/* Returns the capture's folder, which the caller frees. */
static char *root_of(const saga_listing *listing, saga_error *error)
{
    const bool folder = saga_path_is_folder(listing->path);
    const char *const slash = folder ? NULL : strrchr(listing->path, '/');
    char *const root = saga_string_copy(folder || slash ? listing->path : ".",
                                        error);
    if (root && slash)
        root[slash > listing->path ? slash - listing->path : 1] = '\0';
    return root;
}

char *saga_listing_join(const saga_listing *listing, const char *folder,
                        const char *name, const char *file, saga_error *error)
{
    char *const path = saga_path_join(folder, name, error);
    const char *const down = descent(name);
    /* A relative name without ".." only descends, so it needs no test. */
    if (!path || listing->follow_paths || (name[0] != '/' && down == name))
        return path;
    char *const root = root_of(listing, error);
    const bool in = root && leads_into(path, strlen(down), root);
    free(root);
    if (in)
        return path;
    free(path);
    if (!saga_failed(error))
        saga_fail(error, file,
                  "copy it there, or give --follow-paths if this "
                  "capture may read any file",
                  "names \"%.200s\", which "
                  "is not in the capture's folder",
                  name);
    return NULL;
}

/* ----------------------------------------------------------------- loaders */

/* A run's own output is not what the user put there. */
static bool is_of_user(const char *name)
{
    return !strstr(name, SAGA_OUTPUT_MARK);
}

/* Writes the first names in a folder in one line, for messages. */
static bool list_found(char *text, size_t n, const char *folder,
                       saga_error *error)
{
    enum { MOST = 5 };
    saga_names names;
    const bool ok = saga_folder_list(&names, folder, is_of_user, error);
    size_t at = (size_t)snprintf(text, n, names.n ? "" : "nothing");
    for (size_t i = 0; i < names.n && i < MOST && at < n; i++)
        at += (size_t)snprintf(text + at, n - at, "%s%.40s", i ? ", " : "",
                               names.at[i]);
    if (names.n > MOST && at < n)
        (void)snprintf(text + at, n - at, " and %zu more", names.n - MOST);
    saga_names_free(&names);
    return ok;
}

static bool unknown_format(const saga_listing *listing, const char *path,
                           saga_error *error)
{
    char looked[400], found[300];
    size_t n = (size_t)snprintf(looked, sizeof looked, "looked for ");
    if (!saga_path_is_folder(path))
        return saga_fail(error, path,
                         "give the folder of a capture, or its "
                         "transforms.json",
                         "does not exist or is neither a "
                         "folder nor a .json file");
    for (const saga_loader *const *l = listing->loaders;
         *l && n < sizeof looked; l++)
        n += (size_t)snprintf(looked + n, sizeof looked - n, "%s%s", (*l)->sign,
                              l[1] ? ", "
                                   : "; `saga help check` lists the layouts");
    return list_found(found, sizeof found, path, error) &&
           saga_fail(
               error, path, looked,
               "holds no capture of a known format "
               "(docs/from-cameras.md explains how to make one); it has %s",
               found);
}

bool saga_listing_make_part(saga_listing *listing, const char *path,
                            const saga_loader *without,
                            const saga_capture_options *options,
                            saga_error *error)
{
    const saga_loader *found = NULL;
    /* is_there may also return false because it is out of memory. */
    for (const saga_loader *const *l = listing->loaders;
         *l && !found && !saga_failed(error); l++)
        if (*l != without && (*l)->is_there(path, error))
            found = *l;
    if (saga_failed(error))
        return false;
    if (!found)
        return unknown_format(listing, path, error);
    listing->format = found->name;
    return found->list(listing, path, options, error);
}

/* ------------------------------------------------------------------- names */

/* Writes the names of all sources in one line, for messages. */
static void list_names(const saga_listing *listing, char *text, size_t n)
{
    size_t used = 0;
    text[0] = '\0';
    for (int i = 0; i < listing->n_sources && used + 8 < n; i++)
        used += (size_t)snprintf(text + used, n - used, "%s%.40s", i ? "," : "",
                                 listing->sources[i].name);
}

/* Returns the source with a name, which is shortened as sources' names are, or
 * NULL if there is none. */
static saga_source *find_source(const saga_listing *listing, const char *name,
                                size_t n)
{
    char same[SAGA_NAME_NBYTES];
    saga_copy_name(same, name, n);
    for (int i = 0; i < listing->n_sources; i++)
        if (strcmp(listing->sources[i].name, same) == 0)
            return &listing->sources[i];
    return NULL;
}

static bool hold_out_one(saga_listing *listing, const char *name, size_t n,
                         saga_error *error)
{
    saga_source *const s = find_source(listing, name, n);
    if (s) {
        s->held_out = true;
        return true;
    }
    char names[160];
    list_names(listing, names, sizeof names);
    return saga_fail(error, listing->path,
                     "use names of this capture's cameras",
                     "--hold-out names \"%.*s\", but the cameras are %s",
                     (int)(n < 60 ? n : 60), name, names);
}

bool saga_listing_hold_out(saga_listing *listing, const char *names,
                           saga_error *error)
{
    /* The option replaces what the format marks as held out. */
    for (int i = 0; names && i < listing->n_sources; i++)
        listing->sources[i].held_out = false;
    for (const char *p = names; p && *p;) {
        const size_t n = strcspn(p, ",");
        if (n > 0 && !hold_out_one(listing, p, n, error))
            return false;
        p += n + (p[n] == ',');
    }
    for (int i = 0; i < listing->n_sources; i++)
        if (!listing->sources[i].held_out)
            return true;
    return saga_fail(error, listing->path,
                     "use --hold-out to keep some for "
                     "training",
                     "all %d cameras are held out", listing->n_sources);
}

/* Finds the first source, *b, that has no name, *a = *b, or the name of an
 * earlier one, *a. Returns false if there is none. */
static bool find_clash(const saga_listing *listing, int *a, int *b)
{
    for (*b = 0; *b < listing->n_sources; ++*b) {
        const char *const name = listing->sources[*b].name;
        for (*a = 0; *a < *b; ++*a)
            if (strcmp(listing->sources[*a].name, name) == 0)
                return true;
        if (name[0] == '\0')
            return true;
    }
    return false;
}

bool saga_listing_names_differ(const saga_listing *listing)
{
    int a, b;
    return !find_clash(listing, &a, &b);
}

bool saga_listing_check_names(const saga_listing *listing, const char *file,
                              saga_error *error)
{
    int a, b;
    if (!find_clash(listing, &a, &b))
        return true;
    return a == b ? saga_fail(error, file, "give each camera a name",
                              "camera %d has no name", b + 1)
                  : saga_fail(error, file, "give each camera a name of its own",
                              "cameras %d and %d have the same name, %s", a + 1,
                              b + 1, listing->sources[b].name);
}

/* Notes lenses whose focal lengths along x and y differ as no usual lens's do:
 * a number in a wrong place, or pixels that are not square. */
static void judge_lenses(saga_listing *listing)
{
    const saga_source *first = NULL;
    int n = 0;
    for (int i = 0; i < listing->n_sources; i++) {
        const saga_source *const s = &listing->sources[i];
        if (!(fabs(s->lens.fx - s->lens.fy) > 0.05 * fabs(s->lens.fx)))
            continue;
        first = first ? first : s;
        n++;
    }
    if (n > 0)
        saga_note(listing->notes,
                  "warning: the focal lengths along x and y "
                  "of %d camera%s are more than 5 %% apart (%s: %.5g and %.5g "
                  "pixels); is one of them in a wrong place?",
                  n, n == 1 ? "" : "s", first->name, first->lens.fx,
                  first->lens.fy);
}

bool saga_listing_judge(saga_listing *listing, saga_error *error)
{
    judge_lenses(listing);
    return saga_listing_check_names(listing, listing->path, error);
}

static bool has_picture(const saga_source *s, int first, int end)
{
    for (int k = first; s->pictures && k < end; k++)
        if (s->pictures[k])
            return true;
    return s->video != NULL;
}

bool saga_listing_drop_empty(saga_listing *listing, int first, int end,
                             int *kept_as, saga_error *error)
{
    static const saga_note_kind absent = {
        "pictures: without any, and left out: ", ""
    };
    int n = 0;
    for (int i = 0; i < listing->n_sources; i++) {
        saga_source *const s = &listing->sources[i];
        const bool keep = has_picture(s, first, end);
        if (kept_as)
            kept_as[i] = keep ? n : -1;
        /* Since n <= i, no source is overwritten before it has moved. */
        if (keep) {
            listing->sources[n++] = *s;
            continue;
        }
        saga_note_each(listing->notes, &absent, "%s", s->name);
        source_free(s, listing->n_frames);
    }
    const int n_before = listing->n_sources;
    listing->n_sources = n;
    return n > 0 ||
           saga_fail(error, listing->path,
                     "copy the pictures beside "
                     "the cameras",
                     "none of its %d cameras has a "
                     "picture%s%.300s",
                     n_before, listing->missing ? "; the first would be " : "",
                     listing->missing ? listing->missing : "");
}

const char *saga_source_picture(const saga_source *source)
{
    int k = 0;
    while (!source->pictures[k])
        k++;
    return source->pictures[k];
}

bool saga_listing_probe_pictures(saga_listing *listing, saga_error *error)
{
    char first[sizeof((saga_picture_look *)NULL)->ignored] = "";
    const char *path = NULL;
    int n = 0;
    for (int i = 0; i < listing->n_sources; i++) {
        saga_source *const s = &listing->sources[i];
        saga_picture_look look;
        const char *const picture = saga_source_picture(s);
        if (!saga_picture_probe(picture, &look, error))
            return false;
        s->width = look.width;
        s->height = look.height;
        s->orientation = look.orientation;
        /* The first camera with something ignored stands for all. */
        if (look.ignored[0] && n++ == 0) {
            memcpy(first, look.ignored, sizeof first);
            path = picture;
        }
    }
    if (n > 0)
        saga_note(listing->notes,
                  "warning: the pictures of %d cameras have "
                  "%s, which is ignored (%.200s)",
                  n, first, path);
    return true;
}

/* ---------------------------------------------------------------- late ones */

/* Reads one "NAME=FRAMES" at *text and moves *text past it. */
static bool take_late(const saga_listing *l, const char **text, double *late,
                      saga_error *error)
{
    const size_t n = strcspn(*text, "="), all = strcspn(*text, ",");
    char *end;
    const double frames = n < all ? strtod(*text + n + 1, &end) : 0.0;
    const saga_source *const s = find_source(l, *text, n);
    /* The number must reach exactly to the comma or the end. */
    if (n >= all || end != *text + all || !(fabs(frames) <= SAGA_MAX_FRAMES))
        return saga_fail(error, l->path,
                         "give NAME=FRAMES, with commas "
                         "between",
                         "--late \"%.60s\" is not a camera with a "
                         "number of frames",
                         *text);
    if (!s) {
        char names[160];
        list_names(l, names, sizeof names);
        return saga_fail(error, l->path, "use names of this capture's cameras",
                         "--late names \"%.*s\", but the cameras are %s",
                         (int)(n < 60 ? n : 60), *text, names);
    }
    late[s - l->sources] = frames;
    *text += all + ((*text)[all] == ',');
    return true;
}

/* Keeps n files from number `skip` and frees the others. */
static void cut_list(char **files, int skip, int n, int n_before)
{
    for (int k = 0; files && k < n_before; k++)
        if (k < skip || k >= skip + n)
            free(files[k]);
    if (files)
        memmove(files, files + skip, (size_t)n * sizeof *files);
}

bool saga_listing_late(saga_listing *listing, const char *text,
                       saga_error *error)
{
    saga_listing *const l = listing;
    bool any = text && *text;
    for (int i = 0; i < l->n_sources; i++)
        any = any || l->sources[i].behind > 0.0;
    if (!any)
        return true;
    double *const late = saga_calloc((size_t)l->n_sources, sizeof *late,
                                     l->path, error);
    double least = INFINITY;
    int most = 0;
    bool ok = late != NULL;
    while (ok && text && *text)
        ok = take_late(l, &text, late, error);
    /* What the pictures show late adds to what time stamps say. */
    for (int i = 0; ok && i < l->n_sources; i++) {
        late[i] += l->sources[i].behind;
        least = fmin(least, late[i]);
    }
    /* No camera may begin before the first picture of the latest one. The 1e-6
     * of a frame absorbs rounding. */
    for (int i = 0; ok && i < l->n_sources; i++) {
        saga_source *const s = &l->sources[i];
        const double behind = late[i] - least - s->late;
        s->skip = (int)ceil(behind - 1e-6);
        s->late = fmax(s->skip - behind, 0.0);
        most = s->skip > most ? s->skip : most;
    }
    int n = l->n_frames - most;
    for (int i = 0; ok && i < l->n_sources; i++) {
        const saga_source *const s = &l->sources[i];
        if (s->video && s->n_moments - s->skip < n)
            n = s->n_moments - s->skip;
    }
    if (ok && n < 1)
        ok = saga_fail(error, l->path, "give smaller numbers",
                       "--late leaves "
                       "none of %d frames",
                       l->n_frames);
    /* Videos are not cut here; their reader skips these frames. */
    for (int i = 0; ok && i < l->n_sources; i++) {
        saga_source *const s = &l->sources[i];
        cut_list(s->pictures, s->skip, n, l->n_frames);
        cut_list(s->depths, s->skip, n, l->n_frames);
        cut_list(s->masks, s->skip, n, l->n_frames);
    }
    if (ok)
        l->n_frames = n;
    free(late);
    return ok;
}
