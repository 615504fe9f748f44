/* SPDX-License-Identifier: MIT
 *
 * Reads nerfstudio's transforms.json.
 *
 * Every entry of "frames" is one picture with its camera, or one video with
 * all its frames. Intrinsics stand in the entry or, for all, at the top.
 * transform_matrix is camera to world in OpenGL axes (x right, y up, z
 * backwards). Pictures with one pose and the same intrinsics are one camera;
 * "time" orders them and must be the same in all cameras. Without any "time"
 * the order of the file names counts, and a camera with one picture is a
 * still one. A picture whose file is not there is missing, and so is one that
 * is not listed where the others have a "time", or a number in their names,
 * that tells which it is.
 *
 * A camera that moves (D-NeRF) has a "time" and a pose of its own in each
 * picture. Each picture becomes a camera that lacks all other moments, of which
 * there are as many as different times to train on, evenly spaced; a picture
 * that was taken between two of them is late after the earlier.
 *
 * Blender's synthetic scenes have transforms_train.json and
 * transforms_test.json, the pictures of which are held out, camera_angle_x
 * alone, and file names without an ending.
 *
 * "time" is in seconds, or runs from 0 to 1 over the whole capture; a top
 * level "fps" settles it. Whole cameras are held out: those whose files stand
 * in test_filenames or val_filenames, or not in train_filenames if that is
 * there.
 */
#include "error.h"

#include "alloc.h"
#include "file.h"
#include "json_memory.h"
#include "load.h"
#include "moments.h"
#include "notes.h"
#include "order.h"
#include "picture.h"
#include "ply.h"
#include "pose.h"

#include <jansson.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* This has to be the same in all pictures of a camera; no padding, so that
 * bytes can be compared. Unknown values are NaN, kept as one bit pattern. */
typedef struct camera_key {
    double pose[12];          /* camera to world, rows of 3 x 4 */
    double fx, fy, cx, cy;
    double k1, k2, k3, p1, p2, k4;
    double fisheye;           /* 1 or 0 */
    double width, height, angle_x;
} camera_key;

typedef struct entry {
    const char *file;         /* in the JSON */
    const char *depth, *mask; /* or NULL */
    int index;                /* in "frames" */
    int view;
    bool has_time, held_out;
    double time;
    double late;              /* frames, after its moment: 0 to 1 */
    camera_key key;
} entry;

typedef struct reader {
    json_t *root;             /* of the file that is being read */
    json_t *roots[2];         /* of all files */
    const char *path;         /* of the JSON */
    char *folder;
    saga_listing *listing;
    saga_error *error;
    entry *entries;
    int n_entries;
    int n_views;
    int *view_size;           /* (n_views) */
    int *view_first;          /* (n_views) entry, once they are sorted */
    int fullest;              /* the view with most pictures */
    int n_moments;            /* of a camera that moves; or 0 */
    double first_time, step;  /* of those moments */
    entry **at;               /* (n_views, n frames) NULL: not listed */
    bool odd_depths, videos;
    int n_missing;
    const char *first_missing; /* as the JSON has it; or NULL */
} reader;

/* ------------------------------------------------------------ typed access */

static const char *type_name(const json_t *value)
{
    static const char *const names[] = {"an object", "an array", "a string",
                                        "a number", "a number", "true",
                                        "false", "null"};
    const int t = (int)json_typeof(value);
    return t >= 0 && t < 8 ? names[t] : "something else";
}

/* index < 0 stands for the top of the file. */
static bool wrong_type(const reader *r, int index, const char *key,
                       const json_t *value, const char *wanted)
{
    char where[32] = "at the top";
    if (index >= 0)
        (void)snprintf(where, sizeof where, "in frames[%d]", index);
    return saga_fail(r->error, r->path, "correct the file", "\"%s\" %s is %s, "
                     "expected %s", key, where,
                     value ? type_name(value) : "missing", wanted);
}

/* A number is taken from the entry, else from the top, else left alone. */
static bool get_number(const reader *r, const json_t *frame, int index,
                       const char *key, double *x)
{
    const json_t *value = json_object_get(frame, key);
    /* index -1: an error is then told of the top of the file. */
    if (!value) {
        value = json_object_get(r->root, key);
        index = -1;
    }
    if (!value)
        return true;
    if (!json_is_number(value))
        return wrong_type(r, index, key, value, "a number");
    *x = json_number_value(value);
    return true;
}

static bool get_string(const reader *r, const json_t *object, int index,
                       const char *key, const char **s)
{
    const json_t *const value = json_object_get(object, key);
    if (!value)
        return true;
    if (!json_is_string(value))
        return wrong_type(r, index, key, value, "a string");
    *s = json_string_value(value);
    return true;
}

/* ------------------------------------------------------------- one entry */

static bool read_matrix(const reader *r, const json_t *frame, entry *e)
{
    static const char wanted[] = "4 rows of 4 numbers";
    const json_t *const m = json_object_get(frame, "transform_matrix");
    const size_t n_rows = json_array_size(m);
    if (n_rows != 3 && n_rows != 4)
        return wrong_type(r, e->index, "transform_matrix", m, wanted);
    for (size_t i = 0; i < n_rows; i++) {
        const json_t *const row = json_array_get(m, i);
        if (json_array_size(row) != 4)
            return wrong_type(r, e->index, "transform_matrix", row, wanted);
        for (size_t j = 0; j < 4; j++) {
            const json_t *const x = json_array_get(row, j);
            if (!json_is_number(x))
                return wrong_type(r, e->index, "transform_matrix", x, wanted);
            const double v = json_number_value(x);
            if (i < 3)
                e->key.pose[4 * i + j] = v == 0.0 ? 0.0 : v; /* no -0 */
            else if (v != (j == 3 ? 1.0 : 0.0))
                return saga_fail(r->error, r->path, "give a rigid camera-to-"
                                 "world matrix", "last row of transform_"
                                 "matrix of frames[%d] is not 0 0 0 1",
                                 e->index);
        }
    }
    return true;
}

static bool read_model(const reader *r, const json_t *frame, int index,
                       double *fisheye)
{
    static const char *const known[] = {"OPENCV", "PINHOLE", "SIMPLE_PINHOLE",
                                        "SIMPLE_RADIAL", "RADIAL",
                                        "OPENCV_FISHEYE"};
    const char *model = "OPENCV";
    if (!get_string(r, r->root, -1, "camera_model", &model) ||
        !get_string(r, frame, index, "camera_model", &model))
        return false;
    for (size_t i = 0; i < sizeof known / sizeof known[0]; i++)
        if (strcmp(model, known[i]) == 0) {
            *fisheye = strcmp(model, "OPENCV_FISHEYE") == 0 ? 1.0 : 0.0;
            return true;
        }
    return saga_fail(r->error, r->path, "undistort the pictures to PINHOLE "
                     "first", "camera_model \"%s\" of frames[%d] is not "
                     "supported", model, index);
}

static bool read_intrinsics(const reader *r, const json_t *frame, entry *e)
{
    camera_key *const k = &e->key;
    const struct {
        const char *name;
        double *to;
    } numbers[] = {
        {"fl_x", &k->fx}, {"fl_y", &k->fy}, {"cx", &k->cx}, {"cy", &k->cy},
        {"k1", &k->k1},   {"k2", &k->k2},   {"k3", &k->k3}, {"p1", &k->p1},
        {"p2", &k->p2},   {"w", &k->width}, {"h", &k->height},
        {"camera_angle_x", &k->angle_x},    {"k4", &k->k4},
    };
    /* NaN stands for what the file leaves out; distortions and sizes that it
     * leaves out are 0 (read_entries). */
    k->fx = k->fy = k->cx = k->cy = k->angle_x = NAN;
    for (size_t i = 0; i < sizeof numbers / sizeof numbers[0]; i++)
        if (!get_number(r, frame, e->index, numbers[i].name, numbers[i].to))
            return false;
    if (!read_model(r, frame, e->index, &k->fisheye))
        return false;
    return k->k4 == 0.0 || k->fisheye != 0.0 ||
           saga_fail(r->error, r->path, "undistort the pictures first",
                     "k4 = %g of frames[%d] is not supported", k->k4,
                     e->index);
}

static bool read_entry(reader *r, int index)
{
    const json_t *const frames = json_object_get(r->root, "frames");
    const json_t *const frame = json_array_get(frames, (size_t)index);
    entry *const e = &r->entries[r->n_entries++];
    const json_t *const time = json_object_get(frame, "time");
    e->index = index;
    /* The second file has what Blender's scenes hold out. */
    e->held_out = r->root == r->roots[1];
    if (!json_is_object(frame))
        return wrong_type(r, -1, "frames[]", frame, "an object");
    if (!get_string(r, frame, index, "file_path", &e->file))
        return false;
    if (!e->file)
        return wrong_type(r, index, "file_path", NULL, "a string");
    if (!get_string(r, frame, index, "depth_file_path", &e->depth) ||
        !get_string(r, frame, index, "mask_path", &e->mask))
        return false;
    if (time && !json_is_number(time))
        return wrong_type(r, index, "time", time, "a number");
    e->has_time = time != NULL;
    e->time = time ? json_number_value(time) : 0.0;
    if (e->depth && !saga_has_suffix(e->depth, ".exr")) {
        r->odd_depths = true;
        e->depth = NULL;
    }
    return read_matrix(r, frame, e) && read_intrinsics(r, frame, e);
}

static bool is_video(const char *file)
{
    static const char *const endings[] = {".mp4", ".mov", ".mkv", ".webm",
                                          ".avi", ".m4v", ".MP4", ".MOV"};
    for (size_t i = 0; i < sizeof endings / sizeof endings[0]; i++)
        if (saga_has_suffix(file, endings[i]))
            return true;
    return false;
}

static bool read_entries(reader *r)
{
    const json_t *const frames = json_object_get(r->root, "frames");
    const size_t n = json_array_size(frames);
    if (!json_is_array(frames))
        return wrong_type(r, -1, "frames", frames, "an array");
    if (n == 0 || n > (size_t)(SAGA_MAX_FRAMES - r->n_entries))
        return saga_fail(r->error, r->path, "list the pictures or videos",
                         "\"frames\" has %zu entries", n);
    entry *const more = saga_realloc(r->entries, (size_t)r->n_entries + n,
                                     sizeof *more, r->path, r->error);
    if (!more)
        return false;
    memset(more + r->n_entries, 0, n * sizeof *more);
    r->entries = more;
    for (int i = 0; i < (int)n; i++)
        if (!read_entry(r, i))
            return false;
    return true;
}

static bool check_kinds(reader *r)
{
    int n_videos = 0;
    for (int i = 0; i < r->n_entries; i++)
        n_videos += is_video(r->entries[i].file) ? 1 : 0;
    r->videos = n_videos > 0;
    return n_videos == 0 || n_videos == r->n_entries ||
           saga_fail(r->error, r->path, "list either pictures or videos",
                     "mixes %d videos and %d pictures", n_videos,
                     r->n_entries - n_videos);
}

/* ----------------------------------------------------------------- cameras */

/* Makes room for one more view in first (n_views). */
static bool add_view(const reader *r, int **first)
{
    if (r->n_views == SAGA_MAX_VIEWS)
        return saga_fail(r->error, r->path, "every camera must stand still "
                         "and have one pose", "has more than %d different "
                         "camera poses", SAGA_MAX_VIEWS);
    int *const more = saga_realloc(*first, (size_t)r->n_views + 1,
                                   sizeof *more, r->path, r->error);
    *first = more ? more : *first;
    return more != NULL;
}

static bool assign_views(reader *r)
{
    int *first = NULL; /* (n_views) entry */
    bool ok = true;
    for (int i = 0; ok && i < r->n_entries; i++) {
        entry *const e = &r->entries[i];
        e->view = -1;
        /* Newest first: files mostly list camera after camera. Videos are views
         * of their own, whatever their poses. */
        for (int v = r->n_views; !r->videos && v-- > 0 && e->view < 0;)
            if (memcmp(&r->entries[first[v]].key, &e->key,
                       sizeof e->key) == 0)
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

/* Sorts by camera, then by time, then by name. */
static int entry_order(const void *a, const void *b)
{
    const entry *const x = a, *const y = b;
    if (x->view != y->view)
        return x->view < y->view ? -1 : 1;
    if (x->time != y->time)
        return x->time < y->time ? -1 : 1;
    return strcmp(x->file, y->file);
}

static int count_times(const reader *r)
{
    int n = 0;
    for (int i = 0; i < r->n_entries; i++)
        n += r->entries[i].has_time ? 1 : 0;
    return n;
}

static bool check_counts(const reader *r)
{
    const int n_times = count_times(r);
    if (n_times != 0 && n_times != r->n_entries)
        return saga_fail(r->error, r->path, "give every picture its time, or "
                         "none", "only %d of %d frames have \"time\"",
                         n_times, r->n_entries);
    for (int v = 0; v < r->n_views; v++) {
        const int n = r->view_size[v], most = r->view_size[r->fullest];
        /* A camera may lack up to half of its pictures. */
        if (2 * n < most)
            return saga_fail(r->error, r->path, "every camera needs a picture "
                             "of every moment, with one pose",
                             "unequal frame counts: camera of %s has %d, "
                             "camera of %s has %d",
                             r->entries[r->view_first[r->fullest]].file, most,
                             r->entries[r->view_first[v]].file, n);
    }
    return true;
}

/* Where some are not listed and nothing has a time, the numbers in the files'
 * names do. */
static void take_numbers_for_times(reader *r)
{
    for (int i = 0; i < r->n_entries; i++) {
        entry *const e = &r->entries[i];
        const char *const dot = strrchr(e->file, '.');
        uint64_t number;
        (void)saga_last_number(e->file, dot ? (size_t)(dot - e->file)
                                            : strlen(e->file), &number);
        e->time = (double)number;
    }
    /* Times were equal when the entries were sorted first. */
    qsort(r->entries, (size_t)r->n_entries, sizeof *r->entries, entry_order);
}

/* The moment of an entry is its rank in a view that has all n, else the nearest
 * of n even ones from `start` on. */
static bool find_moment(const reader *r, const entry *e, double start,
                        double step, int n, int *k)
{
    if (!isfinite(e->time))
        return saga_fail(r->error, r->path, "correct it",
                         "time of %s is not finite", e->file);
    const double moment =
        step > 0.0 ? fmin(fmax((e->time - start) / step, 0.0), n - 1.0) : 0.0;
    if (r->view_size[e->view] < n)
        *k = (int)floor(moment + 0.5);
    /* Times within a quarter of a step count as synchronous. */
    const double near = start + step * *k;
    return fabs(e->time - near) <= 0.25 * step ||
           saga_fail(r->error, r->path, "pictures must be synchronous and "
                     "evenly spaced in time", "time %g of %s is not near %g, "
                     "that of frame %d", e->time, e->file, near, *k);
}

/* Entries are sorted by view and time. Those of the fullest view tell the
 * moments; with neither times nor holes the order does. */
static bool place_entries(reader *r, int n, bool timed)
{
    const entry *const ref = &r->entries[r->view_first[r->fullest]];
    const double step = n > 1 ? (ref[n - 1].time - ref[0].time) / (n - 1) : 0.0;
    r->at = saga_calloc((size_t)r->n_views * (size_t)n, sizeof *r->at, r->path,
                        r->error);
    for (int i = 0; r->at && i < r->n_entries; i++) {
        entry *const e = &r->entries[i];
        int k = i - r->view_first[e->view];
        /* k > 0 says that the entry before this one is of the same view. */
        const bool twice = k > 0 && timed && e->time == e[-1].time;
        if (timed && !twice && !find_moment(r, e, ref[0].time, step, n, &k))
            return false;
        entry **const to = &r->at[e->view * n + k];
        if (twice || *to)
            return saga_fail(r->error, r->path, "one picture per camera and "
                             "moment", "%s and %s have one pose and one time "
                             "%g", e[-1].file, e->file, e->time);
        *to = e;
    }
    return r->at != NULL;
}

/* ----------------------------------------------------- a camera that moves */

/* Counts the different times of pictures to train on; times is scratch of the
 * number of entries. */
static int count_moments(const reader *r, double *times)
{
    size_t n = 0;
    int n_moments = 1;
    for (int i = 0; i < r->n_entries; i++)
        if (!r->entries[i].held_out)
            times[n++] = r->entries[i].time;
    if (n == 0)
        return 0;
    qsort(times, n, sizeof *times, saga_by_value);
    /* Times closer than a millionth of the span are one, printed
     * differently. */
    const double least = 1e-6 * (times[n - 1] - times[0]);
    for (size_t i = 1; i < n; i++)
        n_moments += times[i] - times[i - 1] > least;
    return n_moments;
}

/* A camera moves where fewer than two pictures share a pose on average, and no
 * pose has half of the moments: then every picture is a view. */
static bool find_moves(reader *r)
{
    int most = 0;
    for (int v = 0; v < r->n_views; v++)
        most = r->view_size[v] > most ? r->view_size[v] : most;
    if (r->videos || count_times(r) < r->n_entries ||
        2 * r->n_views <= r->n_entries)
        return true;
    double *const times =
        saga_alloc((size_t)r->n_entries, sizeof *times, r->path, r->error);
    if (!times)
        return false;
    const int n = count_moments(r, times);
    free(times);
    if (2 * most > n)
        return true;
    int *const size = saga_realloc(r->view_size, (size_t)r->n_entries,
                                   sizeof *size, r->path, r->error);
    if (!size)
        return false;
    r->view_size = size;
    /* It moves. Now there are as many views as pictures, with one picture
     * each. */
    r->n_moments = n;
    r->n_views = r->n_entries;
    for (int i = 0; i < r->n_entries; i++) {
        r->entries[i].view = i;
        size[i] = 1;
    }
    return true;
}

/* Gives every picture its moment, and how much later it was taken. */
static bool place_moving(reader *r, int n)
{
    double first = r->entries[0].time, last = first;
    for (int i = 0; i < r->n_entries; i++) {
        first = fmin(first, r->entries[i].time);
        last = fmax(last, r->entries[i].time);
    }
    r->first_time = first;
    /* n >= 2: with one moment every camera stands, says find_moves. */
    r->step = (last - first) / (n - 1);
    if (!isfinite(r->step))
        return saga_fail(r->error, r->path, "correct them", "times run from "
                         "%g to %g", first, last);
    r->at = saga_calloc((size_t)r->n_views * (size_t)n, sizeof *r->at, r->path,
                        r->error);
    for (int i = 0; r->at && i < r->n_entries; i++) {
        entry *const e = &r->entries[i];
        const double moment = (e->time - first) / r->step;
        /* Within 1e-4 of a step a picture was taken at the moment itself. */
        const bool between = fabs(moment - rint(moment)) > 1e-4;
        const double k = between ? floor(moment) : rint(moment);
        e->late = between ? moment - k : 0.0;
        r->at[e->view * n + (int)k] = e;
    }
    r->listing->moves = true;
    if (r->at)
        saga_note(r->listing->notes, "cameras: the camera moves; its %d "
                  "pictures are views of %d moments", r->n_entries, n);
    return r->at != NULL;
}

/* ------------------------------------------------------------------ moments */

static bool index_views(reader *r)
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

static bool find_moments(reader *r, int n)
{
    const bool timed = count_times(r) > 0;
    const bool holes = r->n_entries < n * r->n_views;
    if (r->n_moments > 0)
        return place_moving(r, n);
    /* Without times the order is enough, unless a picture is not listed. */
    if (holes && !timed)
        take_numbers_for_times(r);
    return place_entries(r, n, (timed || holes) && !r->videos);
}

/* Times are seconds, unless they run from exactly 0 to exactly 1. */
static void guess_fps(reader *r, int n)
{
    const entry *const e = &r->entries[r->view_first[r->fullest]];
    const bool moving = r->n_moments > 0;
    if (r->listing->fps > 0.0 || n < 2 || count_times(r) == 0)
        return;
    /* The times of all views tell for a moving camera, else those of the
     * fullest view. */
    const double first = moving ? r->first_time : e[0].time;
    const double last = moving ? first + r->step * (n - 1) : e[n - 1].time;
    if (fabs(first) < 1e-9 && fabs(last - 1.0) < 1e-9) {
        saga_note(r->listing->notes, "time: 0..1 is taken as normalised");
        return;
    }
    r->listing->fps = (n - 1) / (last - first);
}

static bool read_fps(reader *r)
{
    double fps = 0.0;
    if (!get_number(r, r->root, -1, "fps", &fps))
        return false;
    if (json_object_get(r->root, "fps") && !(fps > 0.0))
        return saga_fail(r->error, r->path, "give frames per second",
                         "\"fps\" is %g", fps);
    r->listing->fps = fps;
    return true;
}

/* ------------------------------------------------------------------- names */

static size_t stem_length(const char *base)
{
    const char *const dot = strrchr(base, '.');
    return dot && dot != base ? (size_t)(dot - base) : strlen(base);
}

static const char *base_of(const char *file)
{
    const char *const slash = strrchr(file, '/');
    return slash ? slash + 1 : file;
}

/* Returns the last folder of a path; empty if it has none. */
static void folder_name(const char *file, char name[SAGA_NAME_NBYTES])
{
    const char *const base = base_of(file);
    const char *start = base > file ? base - 1 : base;
    const char *const end = start;
    while (start > file && start[-1] != '/')
        start--;
    saga_copy_name(name, start, (size_t)(end - start));
}

/* Gives "train/r_003.png" the name "train_r_003". */
static void folder_and_stem(const char *file, char name[SAGA_NAME_NBYTES])
{
    const char *const base = base_of(file);
    char folder[SAGA_NAME_NBYTES], both[2 * SAGA_NAME_NBYTES];
    folder_name(file, folder);
    (void)snprintf(both, sizeof both, "%s_%.*s", folder,
                   (int)stem_length(base), base);
    saga_copy_name(name, both, strlen(both));
}

/* Finds what the names of all pictures of a camera begin with, without the
 * frame number: "cam03_f000" and "cam03_f001" give "cam03". */
static void common_prefix(const entry *e, int n, char name[SAGA_NAME_NBYTES])
{
    const char *const base = base_of(e[0].file);
    size_t len = stem_length(base);
    /* Shorten the stem to what all names begin with. */
    for (int k = 1; k < n; k++) {
        const char *const other = base_of(e[k].file);
        size_t i = 0;
        while (i < len && other[i] == base[i])
            i++;
        len = i;
    }
    while (len > 0 && ((unsigned char)base[len] & 0xc0) == 0x80)
        len--; /* not inside a character */
    /* The frame number's first digits go, then letters in front of it that a
     * separator sets off, then separators: "cam03_f00" becomes "cam03". */
    while (len > 0 && base[len - 1] >= '0' && base[len - 1] <= '9')
        len--;
    size_t letters = len;
    while (letters > 0 && (base[letters - 1] | 32) >= 'a' &&
           (base[letters - 1] | 32) <= 'z')
        letters--;
    if (letters > 0 && strchr("_-. ", base[letters - 1]))
        len = letters;
    while (len > 0 && strchr("_-. ", base[len - 1]))
        len--;
    saga_copy_name(name, base, len);
}

/* Takes the first scheme that tells all cameras apart. */
static void name_views(const reader *r, int n)
{
    saga_listing *const listing = r->listing;
    for (int scheme = n > 1 ? 0 : 2; scheme < 5; scheme++) {
        /* Schemes are the folder, the beginning of the names, the first name,
         * it with its folder, and numbers. The first two need several
         * pictures. */
        for (int v = 0; v < r->n_views; v++) {
            const entry *const e = &r->entries[r->view_first[v]];
            char *const name = listing->sources[v].name;
            const char *const base = base_of(e->file);
            if (scheme == 0)
                folder_name(e->file, name);
            else if (scheme == 1)
                common_prefix(e, r->view_size[v], name);
            else if (scheme == 2)
                saga_copy_name(name, base, stem_length(base));
            else if (scheme == 3)
                folder_and_stem(e->file, name);
            else
                (void)snprintf(name, SAGA_NAME_NBYTES, "view%03d", v);
        }
        if (saga_listing_names_differ(listing))
            return;
    }
}

/* ------------------------------------------------------------------- split */

static int by_string(const void *a, const void *b)
{
    return strcmp(*(const char *const *)a, *(const char *const *)b);
}

/* Every name of the list is the file of an entry. */
static bool all_known(const reader *r, const char *key,
                      const char *const *names, size_t n)
{
    const size_t n_files = (size_t)r->n_entries;
    const char **const files =
        saga_alloc(n_files, sizeof *files, r->path, r->error);
    if (!files)
        return false;
    for (size_t i = 0; i < n_files; i++)
        files[i] = r->entries[i].file;
    qsort(files, n_files, sizeof *files, by_string);
    size_t i = 0;
    while (i < n && bsearch(&names[i], files, n_files, sizeof *files,
                            by_string))
        i++;
    free(files);
    return i == n || saga_fail(r->error, r->path, "names stand there as they "
                               "do in a frame's file_path", "\"%s\" lists "
                               "\"%.200s\", which is no frame's picture", key,
                               names[i]);
}

/* Marks entries whose file stands in the list (or does not, if inverted). */
static bool mark_list(reader *r, const char *key, bool inverted)
{
    const json_t *const list = json_object_get(r->root, key);
    if (!list)
        return true;
    if (!json_is_array(list))
        return wrong_type(r, -1, key, list, "an array of strings");
    const size_t n = json_array_size(list);
    const char **const names =
        saga_alloc(n, sizeof *names, r->path, r->error);
    if (!names)
        return false;
    bool ok = true;
    for (size_t i = 0; ok && i < n; i++) {
        names[i] = json_string_value(json_array_get(list, i));
        if (!names[i])
            ok = wrong_type(r, -1, key, json_array_get(list, i),
                            "an array of strings");
    }
    if (ok && n > 0)
        qsort(names, n, sizeof *names, by_string);
    ok = ok && all_known(r, key, names, n);
    for (int i = 0; ok && i < r->n_entries; i++) {
        const bool listed = n > 0 && bsearch(&r->entries[i].file, names, n,
                                             sizeof *names, by_string);
        r->entries[i].held_out |= listed != inverted;
    }
    free(names);
    return ok;
}

static bool split_views(reader *r)
{
    /* Inverted: what train_filenames leaves out is held out. */
    if (!mark_list(r, "train_filenames", true) ||
        !mark_list(r, "val_filenames", false) ||
        !mark_list(r, "test_filenames", false))
        return false;
    for (int i = 0; i < r->n_entries; i++) {
        const entry *const e = &r->entries[i];
        saga_source *const s = &r->listing->sources[e->view];
        if (i == r->view_first[e->view])
            s->held_out = e->held_out;
        else if (s->held_out != e->held_out)
            return saga_fail(r->error, r->path, "list all pictures of a "
                             "camera alike, or remove the lists and use "
                             "--hold-out", "the train/test lists hold out "
                             "only some pictures of camera %s (%s differs)",
                             s->name, e->file);
    }
    return true;
}

/* ------------------------------------------------------------ filling in */

/* Returns the path of a name in the file. */
static char *join(const reader *r, const char *name)
{
    return saga_listing_join(r->listing, r->folder, name, r->path, r->error);
}

/* Blender leaves out the ending of the files. Where there is none with a known
 * ending either, the path stays. */
static char *picture_path(const reader *r, const char *file)
{
    static const char *const endings[] = {".png", ".jpg", ".jpeg", ".webp",
                                          ".exr"};
    char *const path = join(r, file);
    if (!path || saga_path_is_file(path))
        return path;
    const size_t n = strlen(path) + sizeof ".jpeg";
    char *const longer = saga_alloc(n, 1, path, r->error);
    for (size_t i = 0; longer && i < sizeof endings / sizeof endings[0]; i++) {
        (void)snprintf(longer, n, "%s%s", path, endings[i]);
        if (saga_path_is_file(longer)) {
            free(path);
            return longer;
        }
    }
    const bool ok = longer != NULL;
    free(longer);
    if (ok)
        return path;
    free(path);
    return NULL;
}

static bool fill_lens(const reader *r, saga_source *s, const entry *e)
{
    const camera_key *const k = &e->key;
    if ((k->width != 0.0 && k->width != s->width) ||
        (k->height != 0.0 && k->height != s->height))
        return saga_fail(r->error, r->path, "correct w and h together with "
                         "fl_x fl_y cx cy, or scale the pictures back",
                         "w x h of %s is %g x %g, the file has %d x %d "
                         "pixels", e->file, k->width, k->height, s->width,
                         s->height);
    s->lens = (saga_lens){.fx = k->fx, .fy = k->fy, .cx = k->cx, .cy = k->cy,
                          .k1 = k->k1, .k2 = k->k2, .k3 = k->k3,
                          .p1 = k->p1, .p2 = k->p2, .k4 = k->k4,
                          .fisheye = k->fisheye != 0.0};
    /* w = 2 fx tan(angle / 2). Without fl_x and an angle fx stays NaN, and is
     * refused below. */
    if (isnan(s->lens.fx))
        s->lens.fx = s->width / (2.0 * tan(k->angle_x / 2.0));
    if (isnan(s->lens.fy))
        s->lens.fy = s->lens.fx;
    if (isnan(s->lens.cx))
        s->lens.cx = s->width / 2.0;
    if (isnan(s->lens.cy))
        s->lens.cy = s->height / 2.0;
    if (isfinite(s->lens.fx))
        return true;
    return saga_fail(r->error, r->path, "give fl_x (pixels) or "
                     "camera_angle_x (radians)",
                     "focal length of %s is missing or not finite", e->file);
}

static bool fill_pose(const reader *r, saga_source *s, const entry *e)
{
    double axis[4][3]; /* columns of camera to world, in OpenCV axes */
    for (int i = 0; i < 3; i++) {
        const double *const row = e->key.pose + 4 * i;
        /* OpenGL has y up and z backwards, OpenCV y down and z forward. */
        axis[0][i] = row[0];
        axis[1][i] = -row[1];
        axis[2][i] = -row[2];
        axis[3][i] = row[3];
    }
    if (saga_pose_from_axes(axis[0], axis[1], axis[2], axis[3], s->rotation,
                            s->translation))
        return true;
    return saga_fail(r->error, r->path, "export the poses again, without "
                     "scale", "transform_matrix of %s (frames[%d]) is not "
                     "finite or no rotation (first row %g %g %g %g)", e->file,
                     e->index, e->key.pose[0], e->key.pose[1], e->key.pose[2],
                     e->key.pose[3]);
}

/* Sets the paths of a source's pictures that are there. */
static bool fill_pictures(reader *r, saga_source *s, entry *const *at, int n)
{
    s->pictures =
        saga_calloc((size_t)n, sizeof *s->pictures, r->path, r->error);
    s->depths = saga_calloc((size_t)n, sizeof *s->depths, r->path, r->error);
    s->masks = saga_calloc((size_t)n, sizeof *s->masks, r->path, r->error);
    bool ok = s->pictures && s->depths && s->masks;
    for (int k = 0; ok && k < n; k++) {
        char *const path = at[k] ? picture_path(r, at[k]->file) : NULL;
        if (path && saga_path_is_file(path)) {
            s->pictures[k] = path;
        } else {
            ok = path || !at[k];
            free(path);
            r->first_missing = r->first_missing || !at[k] ? r->first_missing
                                                          : at[k]->file;
            r->n_missing++;
        }
        if (ok && at[k] && at[k]->depth) {
            s->depths[k] = join(r, at[k]->depth);
            ok = s->depths[k] != NULL;
        }
        if (ok && at[k] && at[k]->mask) {
            s->masks[k] = join(r, at[k]->mask);
            ok = s->masks[k] != NULL;
        }
    }
    return ok;
}

static bool fill_views(reader *r, int n)
{
    saga_listing *const l = r->listing;
    l->sources = saga_calloc((size_t)r->n_views, sizeof *l->sources, r->path,
                             r->error);
    if (!l->sources)
        return false;
    l->n_sources = r->n_views;
    /* Videos tell how many frames they have after they are probed. */
    l->n_frames = r->videos ? 0 : n;
    name_views(r, n);
    for (int v = 0; v < r->n_views; v++) {
        saga_source *const s = &l->sources[v];
        const entry *const e = &r->entries[r->view_first[v]];
        s->late = e->late;
        if (!r->videos && !fill_pictures(r, s, r->at + v * n, n))
            return false;
        if (r->videos)
            s->video = join(r, e->file);
        if (r->videos && !(s->video && saga_probe_video(s, l, r->error)))
            return false;
    }
    /* A view of a moving camera lacks all moments but one; these are not
     * missing. */
    const int n_others = l->moves ? r->n_entries * (n - 1) : 0;
    if (r->n_missing > n_others)
        saga_note(l->notes, "pictures: %d are missing (%.100s)",
                  r->n_missing - n_others,
                  r->first_missing ? r->first_missing : "not listed");
    return split_views(r);
}

/* Cameras without any picture are left out; the others get lens and pose. */
static bool place_cameras(reader *r, int n)
{
    saga_listing *const l = r->listing;
    int *const kept_as =
        saga_alloc((size_t)r->n_views, sizeof *kept_as, r->path, r->error);
    /* Empty cameras go first: a size is found by probing a picture. */
    bool ok = kept_as && saga_listing_drop_empty(l, 0, n, kept_as, r->error) &&
              (r->videos || saga_listing_probe_pictures(l, r->error));
    for (int v = 0; ok && v < r->n_views; v++) {
        const entry *const e = &r->entries[r->view_first[v]];
        ok = kept_as[v] < 0 ||
             (fill_lens(r, &l->sources[kept_as[v]], e) &&
              fill_pose(r, &l->sources[kept_as[v]], e));
    }
    free(kept_as);
    return ok;
}

static bool read_ply(reader *r)
{
    const char *file = NULL;
    size_t n_dropped = 0;
    if (!get_string(r, r->root, -1, "ply_file_path", &file))
        return false;
    if (!file) {
        saga_note(r->listing->notes, "points: none (no ply_file_path)");
        return true;
    }
    char *const path = join(r, file);
    const bool ok = path && saga_ply_read(path, &r->listing->points,
                                          &r->listing->n_points, &n_dropped,
                                          r->error);
    free(path);
    if (ok)
        saga_note(r->listing->notes, "points: %zu of unknown visibility, %zu "
                  "dropped as not finite", r->listing->n_points, n_dropped);
    return ok;
}

static bool read_all(reader *r, const saga_capture_options *options)
{
    /* Views first, and whether the camera moves, which makes views anew; then
     * entries are sorted, and what follows takes a view's for one run. */
    if (!read_fps(r) || !assign_views(r) || !find_moves(r))
        return false;
    qsort(r->entries, (size_t)r->n_entries, sizeof *r->entries, entry_order);
    if (!index_views(r) || !check_counts(r))
        return false;
    /* There are as many moments as the fullest view has pictures; of a camera
     * that moves, as the pictures have different times. */
    const int n = r->n_moments > 0 ? r->n_moments : r->view_size[r->fullest];
    if (!find_moments(r, n))
        return false;
    if (!r->videos)
        guess_fps(r, n);
    if (!fill_views(r, n) || !place_cameras(r, n))
        return false;
    if (r->videos && !saga_listing_match_videos(r->listing, options, r->error))
        return false;
    if (r->odd_depths)
        saga_note(r->listing->notes, "depth: only .exr files are read");
    return saga_listing_hold_out(r->listing, options->hold_out, r->error) &&
           read_ply(r);
}

/* Returns the folder of a path, "." if it has none. */
static char *folder_of(const char *path, saga_error *error)
{
    const char *const slash = strrchr(path, '/');
    char *const folder = saga_string_copy(slash ? path : ".", error);
    if (folder && slash)
        folder[slash > path ? slash - path : 1] = '\0';
    return folder;
}

/* Reads one JSON file and its entries. */
static bool read_json(reader *r, int which, const char *path)
{
    r->path = path;
    r->root = r->roots[which] = saga_json_read(path, r->error);
    return r->root && read_entries(r);
}

bool saga_nerfstudio_list(saga_listing *listing, const char *json_path,
                          const char *test_path,
                          const saga_capture_options *options,
                          saga_error *error)
{
    reader r = {.listing = listing, .error = error,
                .folder = folder_of(json_path, error)};
    /* The main file is read last, so that r.root is its top when fps, lists and
     * points are looked up there. */
    const bool ok = r.folder &&
                    (!test_path || read_json(&r, 1, test_path)) &&
                    read_json(&r, 0, json_path) && check_kinds(&r) &&
                    read_all(&r, options);
    /* Not earlier: the entries' names are strings inside the JSON. */
    json_decref(r.roots[0]);
    json_decref(r.roots[1]);
    free(r.folder);
    free(r.entries);
    free(r.view_size);
    free(r.view_first);
    free(r.at);
    return ok;
}

/* Tells whether a path is itself such a file. */
static bool is_json(const char *path)
{
    return saga_has_suffix(path, ".json") && saga_path_is_file(path);
}

static bool is_there(const char *path, saga_error *error)
{
    (void)error;
    return is_json(path) || saga_folder_has(path, "transforms.json");
}

static bool list(saga_listing *listing, const char *path,
                 const saga_capture_options *options, saga_error *error)
{
    char *const json = is_json(path)
        ? saga_string_copy(path, error)
        : saga_path_join(path, "transforms.json", error);
    const bool ok = json && saga_nerfstudio_list(listing, json, NULL, options,
                                                 error);
    free(json);
    return ok;
}

const saga_loader saga_nerfstudio_loader = {
    "nerfstudio", "transforms.json",
    "transforms.json with pictures, or a video for each camera",
    is_there, list
};
