/* SPDX-License-Identifier: MIT
 *
 * Reads the entries of transforms.json, and from the rest of the file its frame
 * rate and the lists of held-out pictures.
 */
#include "transforms.h"

#include "alloc.h"
#include "error.h"
#include "file.h"
#include "moments.h"
#include "order.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* ------------------------------------------------------------ typed access */

static const char *type_name(const json_t *value)
{
    static const char *const names[] = { "an object", "an array", "a string",
                                         "a number",  "a number", "true",
                                         "false",     "null" };
    const int t = (int)json_typeof(value);
    return t >= 0 && t < 8 ? names[t] : "something else";
}

/* Reports a value of a wrong type; index < 0 means the top of the file. */
static bool wrong_type(const saga_transforms *r, int index, const char *key,
                       const json_t *value, const char *wanted)
{
    char where[32] = "at the top", is[48] = "missing";
    if (index >= 0)
        (void)snprintf(where, sizeof where, "in frames[%d]", index);
    if (json_is_string(value))
        (void)snprintf(is, sizeof is, "\"%.40s\"", json_string_value(value));
    else if (value)
        (void)snprintf(is, sizeof is, "%s", type_name(value));
    return saga_fail(r->error, r->path, "correct the file",
                     "\"%s\" %s is %s, "
                     "expected %s",
                     key, where, is, wanted);
}

/* Reads a number from the entry, or from the top of the file if the entry lacks
 * it. *x is unchanged if both lack it. */
static bool get_number(const saga_transforms *r, const json_t *frame, int index,
                       const char *key, double *x)
{
    const json_t *value = json_object_get(frame, key);
    /* index -1 makes an error message name the top of the file. */
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

/* Sets *s to the string that an object has under `key`; leaves it unchanged if
 * there is none. */
static bool read_string(const saga_transforms *r, const json_t *object,
                        int index, const char *key, const char **s)
{
    const json_t *const value = json_object_get(object, key);
    if (!value)
        return true;
    if (!json_is_string(value))
        return wrong_type(r, index, key, value, "a string");
    *s = json_string_value(value);
    return true;
}

/* Reads a string that names a file; the tree then has the name with "/". */
static const char *path_of(const saga_transforms *r, const json_t *value)
{
    const char *const name = json_string_value(value);
    /* jansson's copy of the string is no constant, and keeps its length. */
    if (name)
        saga_path_slashes((char *)(uintptr_t)name, r->folder);
    return name;
}

bool saga_transforms_path(const saga_transforms *r, const json_t *object,
                          int index, const char *key, const char **s)
{
    (void)path_of(r, json_object_get(object, key));
    return read_string(r, object, index, key, s);
}

/* --------------------------------------------------------------- one entry */

static bool read_matrix(const saga_transforms *r, const json_t *frame,
                        saga_entry *e)
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
                return saga_fail(r->error, r->path,
                                 "give a rigid camera-to-"
                                 "world matrix",
                                 "last row of transform_"
                                 "matrix of frames[%d] is not 0 0 0 1",
                                 e->index);
        }
    }
    return true;
}

static bool read_model(const saga_transforms *r, const json_t *frame, int index,
                       double *fisheye)
{
    static const char *const known[] = { "OPENCV",         "PINHOLE",
                                         "SIMPLE_PINHOLE", "SIMPLE_RADIAL",
                                         "RADIAL",         "OPENCV_FISHEYE" };
    const char *model = "OPENCV";
    if (!read_string(r, r->root, -1, "camera_model", &model) ||
        !read_string(r, frame, index, "camera_model", &model))
        return false;
    for (size_t i = 0; i < sizeof known / sizeof known[0]; i++)
        if (strcmp(model, known[i]) == 0) {
            *fisheye = strcmp(model, "OPENCV_FISHEYE") == 0 ? 1.0 : 0.0;
            return true;
        }
    return saga_fail(r->error, r->path,
                     "undistort the pictures to PINHOLE "
                     "first",
                     "camera_model \"%s\" of frames[%d] is not "
                     "supported",
                     model, index);
}

static bool read_intrinsics(const saga_transforms *r, const json_t *frame,
                            saga_entry *e)
{
    saga_entry_camera *const k = &e->key;
    const struct {
        const char *name;
        double *to;
    } numbers[] = {
        { "fl_x", &k->fx },  { "fl_y", &k->fy },
        { "cx", &k->cx },    { "cy", &k->cy },
        { "k1", &k->k1 },    { "k2", &k->k2 },
        { "k3", &k->k3 },    { "p1", &k->p1 },
        { "p2", &k->p2 },    { "w", &k->width },
        { "h", &k->height }, { "camera_angle_x", &k->angle_x },
        { "k4", &k->k4 },
    };
    /* NaN means that the file has no value. Distortions and sizes without a
     * value are 0 (saga_transforms_read_entries). */
    k->fx = k->fy = k->cx = k->cy = k->angle_x = NAN;
    for (size_t i = 0; i < sizeof numbers / sizeof numbers[0]; i++)
        if (!get_number(r, frame, e->index, numbers[i].name, numbers[i].to))
            return false;
    if (!read_model(r, frame, e->index, &k->fisheye))
        return false;
    return k->k4 == 0.0 || k->fisheye != 0.0 ||
           saga_fail(r->error, r->path, "undistort the pictures first",
                     "k4 = %g of frames[%d] is not supported", k->k4, e->index);
}

static bool read_entry(saga_transforms *r, int index)
{
    const json_t *const frames = json_object_get(r->root, "frames");
    const json_t *const frame = json_array_get(frames, (size_t)index);
    saga_entry *const e = &r->entries[r->n_entries++];
    const json_t *const time = json_object_get(frame, "time");
    e->index = index;
    /* All pictures of the second file, which only Blender's scenes have, are
     * held out. */
    e->held_out = r->root == r->roots[1];
    if (!json_is_object(frame))
        return wrong_type(r, -1, "frames[]", frame, "an object");
    if (!saga_transforms_path(r, frame, index, "file_path", &e->file))
        return false;
    if (!e->file)
        return wrong_type(r, index, "file_path", NULL, "a string");
    if (!saga_transforms_path(r, frame, index, "depth_file_path", &e->depth) ||
        !saga_transforms_path(r, frame, index, "mask_path", &e->mask))
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

/* ------------------------------------------------------------- all entries */

bool saga_transforms_read_entries(saga_transforms *r)
{
    const json_t *const frames = json_object_get(r->root, "frames");
    const size_t n = json_array_size(frames);
    if (!json_is_array(frames))
        return wrong_type(r, -1, "frames", frames, "an array");
    if (n == 0 || n > (size_t)(SAGA_MAX_FRAMES - r->n_entries))
        return saga_fail(r->error, r->path, "list the pictures or videos",
                         "\"frames\" has %zu entries", n);
    saga_entry *const more = saga_realloc(r->entries, (size_t)r->n_entries + n,
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

bool saga_transforms_check_kinds(saga_transforms *r)
{
    int n_videos = 0;
    for (int i = 0; i < r->n_entries; i++)
        n_videos += saga_is_video_name(r->entries[i].file) ? 1 : 0;
    r->videos = n_videos > 0;
    return n_videos == 0 || n_videos == r->n_entries ||
           saga_fail(r->error, r->path, "list either pictures or videos",
                     "mixes %d videos and %d pictures", n_videos,
                     r->n_entries - n_videos);
}

int saga_transforms_n_timed(const saga_transforms *r)
{
    int n = 0;
    for (int i = 0; i < r->n_entries; i++)
        n += r->entries[i].has_time ? 1 : 0;
    return n;
}

/* Orders entries by camera, then by time, then by name. */
static int entry_order(const void *a, const void *b)
{
    const saga_entry *const x = a, *const y = b;
    if (x->view != y->view)
        return x->view < y->view ? -1 : 1;
    if (x->time != y->time)
        return x->time < y->time ? -1 : 1;
    return saga_compare_names(x->file, y->file);
}

void saga_transforms_sort(saga_transforms *r)
{
    qsort(r->entries, (size_t)r->n_entries, sizeof *r->entries, entry_order);
}

bool saga_transforms_read_fps(saga_transforms *r)
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

/* ---------------------------------------------------------------- held out */

static int by_string(const void *a, const void *b)
{
    return strcmp(*(const char *const *)a, *(const char *const *)b);
}

/* Checks that every name in the list is the file of an entry. */
static bool all_known(const saga_transforms *r, const char *key,
                      const char *const *names, size_t n)
{
    const size_t n_files = (size_t)r->n_entries;
    const char **const files = saga_alloc(n_files, sizeof *files, r->path,
                                          r->error);
    if (!files)
        return false;
    for (size_t i = 0; i < n_files; i++)
        files[i] = r->entries[i].file;
    qsort(files, n_files, sizeof *files, by_string);
    size_t i = 0;
    while (i < n &&
           bsearch(&names[i], files, n_files, sizeof *files, by_string))
        i++;
    free(files);
    return i == n || saga_fail(r->error, r->path,
                               "write names as they stand "
                               "in a frame's file_path",
                               "\"%s\" lists "
                               "\"%.200s\", which is no frame's picture",
                               key, names[i]);
}

/* Marks as held out the entries whose file is in the list or, if `inverted`, is
 * not in the list. */
static bool mark_list(saga_transforms *r, const char *key, bool inverted)
{
    const json_t *const list = json_object_get(r->root, key);
    if (!list)
        return true;
    if (!json_is_array(list))
        return wrong_type(r, -1, key, list, "an array of strings");
    const size_t n = json_array_size(list);
    const char **const names = saga_alloc(n, sizeof *names, r->path, r->error);
    if (!names)
        return false;
    bool ok = true;
    /* The names are sorted, so that each entry can be searched by bisection. */
    for (size_t i = 0; ok && i < n; i++) {
        names[i] = path_of(r, json_array_get(list, i));
        if (!names[i])
            ok = wrong_type(r, -1, key, json_array_get(list, i),
                            "an array of strings");
    }
    if (ok && n > 0)
        qsort(names, n, sizeof *names, by_string);
    ok = ok && all_known(r, key, names, n);
    /* An entry that an earlier list holds out stays held out. */
    for (int i = 0; ok && i < r->n_entries; i++) {
        const bool listed = n > 0 && bsearch(&r->entries[i].file, names, n,
                                             sizeof *names, by_string);
        r->entries[i].held_out |= listed != inverted;
    }
    free(names);
    return ok;
}

bool saga_transforms_mark_held_out(saga_transforms *r)
{
    /* Pictures that train_filenames does not list are held out. */
    return mark_list(r, "train_filenames", true) &&
           mark_list(r, "val_filenames", false) &&
           mark_list(r, "test_filenames", false);
}
