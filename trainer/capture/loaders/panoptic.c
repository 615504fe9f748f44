/* SPDX-License-Identifier: MIT
 *
 * Reads Panoptic Sports in the form that Dynamic 3D Gaussians uses:
 * train_meta.json and test_meta.json, whose cameras are held out. Each file has
 * w, h, and for every moment t a list of cameras c:
 *
 *     k[t][c]        3 x 3 intrinsics
 *     w2c[t][c]      4 x 4 world to camera, OpenCV axes
 *     fn[t][c]       the picture, in ims/
 *     cam_id[t][c]   the number of the camera
 *
 * A camera must have the same k and w2c at all moments. init_pt_cld.npz is
 * optional and has points: rows of "data" are x, y, z, red, green, blue (0 to
 * 1) and more. seg/ is not read.
 */
#include "alloc.h"
#include "error.h"
#include "file.h"
#include "json_memory.h"
#include "load.h"
#include "moments.h"
#include "notes.h"
#include "npz.h"
#include "picture.h"
#include "pose.h"

#include <jansson.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

typedef struct sports_reader {
    saga_listing *listing;
    const char *folder;
    const char *path; /* path of the JSON that is being read */
    json_t *root;
    bool test;
    int *ids; /* (n_sources) cam_id of each source */
    saga_finds finds;
    int n_missing;
    saga_error *error;
} sports_reader;

/* ---------------------------------------------------------------- the JSON */

static bool bad_value(const sports_reader *r, const char *key, size_t t,
                      size_t c, const char *wanted)
{
    return saga_fail(r->error, r->path, "export it again",
                     "\"%s\"[%zu][%zu] "
                     "is missing or not %s",
                     key, t, c, wanted);
}

static const json_t *entry_of(const sports_reader *r, const char *key, size_t t,
                              size_t c)
{
    return json_array_get(json_array_get(json_object_get(r->root, key), t), c);
}

/* Reads the first rows x cols numbers of a matrix. */
static bool get_matrix(const sports_reader *r, const char *key, size_t t,
                       size_t c, size_t rows, size_t cols, double *to)
{
    const json_t *const m = entry_of(r, key, t, c);
    for (size_t i = 0; i < rows * cols; i++) {
        const json_t *const x = json_array_get(json_array_get(m, i / cols),
                                               i % cols);
        if (!json_is_number(x))
            return bad_value(r, key, t, c, "a matrix of numbers");
        to[i] = json_number_value(x);
    }
    return true;
}

static bool get_size(const sports_reader *r, const char *key, int *to)
{
    const json_t *const x = json_object_get(r->root, key);
    const double v = json_number_value(x);
    if (!json_is_number(x) || !(v >= 1.0 && v <= SAGA_MAX_SIDE))
        return saga_fail(r->error, r->path, "give pixels",
                         "\"%s\" is missing "
                         "or not 1 to %d",
                         key, SAGA_MAX_SIDE);
    *to = (int)v;
    return true;
}

/* ------------------------------------------------------------------ cameras */

static bool fill_camera(const sports_reader *r, saga_source *s, size_t t,
                        size_t c)
{
    double k[9], m[12], turn[9], t_of[3];
    if (!get_matrix(r, "k", t, c, 3, 3, k) ||
        !get_matrix(r, "w2c", t, c, 3, 4, m) || !get_size(r, "w", &s->width) ||
        !get_size(r, "h", &s->height))
        return false;
    if (k[1] != 0.0)
        return saga_fail(r->error, r->path, "rectify the pictures first",
                         "k[%zu][%zu] has a skew of %g", t, c, k[1]);
    s->lens = (saga_lens){ .fx = k[0], .fy = k[4], .cx = k[2], .cy = k[5] };
    for (int i = 0; i < 12; i++)
        *(i % 4 < 3 ? &turn[3 * (i / 4) + i % 4] : &t_of[i / 4]) = m[i];
    return saga_pose_from_world(turn, t_of, s->rotation, s->translation) ||
           saga_fail(r->error, r->path, "export the poses again",
                     "w2c[%zu][%zu] is not finite or not a rotation (first "
                     "row %g %g %g)",
                     t, c, m[0], m[1], m[2]);
}

static bool add_camera(sports_reader *r, int id, size_t t, size_t c)
{
    saga_listing *const l = r->listing;
    if (l->n_sources == SAGA_MAX_VIEWS)
        return saga_fail(r->error, r->path, "split the capture",
                         "has more than %d cameras", SAGA_MAX_VIEWS);
    saga_source *const more = saga_realloc(l->sources, (size_t)l->n_sources + 1,
                                           sizeof *more, r->path, r->error);
    if (!more)
        return false;
    l->sources = more;
    int *const ids = saga_realloc(r->ids, (size_t)l->n_sources + 1, sizeof *ids,
                                  r->path, r->error);
    if (!ids)
        return false;
    r->ids = ids;
    ids[l->n_sources] = id;
    /* The cameras of test_meta.json are held out. */
    more[l->n_sources] = (saga_source){ .held_out = r->test };
    (void)snprintf(more[l->n_sources].name, SAGA_NAME_NBYTES, "cam%02d", id);
    return fill_camera(r, &more[l->n_sources++], t, c);
}

static bool same_camera(const saga_source *a, const saga_source *b)
{
    const double x[] = { a->lens.fx,       a->lens.fy,        a->lens.cx,
                         a->lens.cy,       a->translation[0], a->translation[1],
                         a->translation[2] };
    const double y[] = { b->lens.fx,       b->lens.fy,        b->lens.cx,
                         b->lens.cy,       b->translation[0], b->translation[1],
                         b->translation[2] };
    for (int i = 0; i < 7; i++)
        if (fabs(x[i] - y[i]) > 1e-6 * (1.0 + fabs(x[i])))
            return false;
    for (int i = 0; i < 9; i++)
        if (fabs(a->rotation[i] - b->rotation[i]) > 1e-6)
            return false;
    return true;
}

/* Sets *source to the camera of an entry, which is added if it is new. */
static bool find_camera(sports_reader *r, size_t t, size_t c, int *source)
{
    saga_listing *const l = r->listing;
    const json_t *const x = entry_of(r, "cam_id", t, c);
    const json_int_t id = json_integer_value(x);
    saga_source now = { .name = "" };
    if (!json_is_integer(x) || id < 0 || id > 999999)
        return bad_value(r, "cam_id", t, c, "an integer of 0 to 999999");
    for (*source = 0; *source < l->n_sources; ++*source)
        if (r->ids[*source] == (int)id)
            break;
    if (*source == l->n_sources)
        return add_camera(r, (int)id, t, c);
    const saga_source *const s = &l->sources[*source];
    if (s->held_out != r->test)
        return saga_fail(r->error, r->path, "list a camera in one of both",
                         "camera %d is in train_meta.json and in "
                         "test_meta.json",
                         (int)id);
    /* A known camera is read again, to check that it has not moved. */
    return fill_camera(r, &now, t, c) &&
           (same_camera(s, &now) ||
            saga_fail(r->error, r->path, "use cameras that stand still",
                      "camera %d moves: it has another k or w2c at moment %zu",
                      (int)id, t));
}

/* ----------------------------------------------------------------- pictures */

static bool add_picture(sports_reader *r, size_t t, size_t c)
{
    const char *const fn = json_string_value(entry_of(r, "fn", t, c));
    int source = 0;
    if (!fn)
        return bad_value(r, "fn", t, c, "a string");
    if (!find_camera(r, t, c, &source))
        return false;
    char *const folder = saga_path_join(r->folder, "ims", r->error);
    /* jansson's copy of the string is no constant, and keeps its length. */
    if (folder)
        saga_path_slashes((char *)(uintptr_t)fn, folder);
    char *const path = folder ? saga_listing_join(r->listing, folder, fn,
                                                  r->path, r->error)
                              : NULL;
    free(folder);
    if (path && saga_path_is_file(path))
        return saga_finds_add(&r->finds, source, t, path, r->error);
    r->n_missing += path != NULL;
    saga_listing_miss(r->listing, path);
    return path != NULL;
}

static bool read_moments(sports_reader *r)
{
    const json_t *const fn = json_object_get(r->root, "fn");
    const size_t n = json_array_size(fn);
    if (n < 1 || n > SAGA_MAX_FRAMES)
        return saga_fail(r->error, r->path, "list the pictures",
                         "\"fn\" has "
                         "%zu moments",
                         n);
    for (size_t t = 0; t < n; t++)
        for (size_t c = 0; c < json_array_size(json_array_get(fn, t)); c++)
            if (!add_picture(r, t, c))
                return false;
    return true;
}

static bool read_meta(sports_reader *r, const char *name, bool test)
{
    char *const path = saga_path_join(r->folder, name, r->error);
    r->path = path;
    r->test = test;
    r->root = path ? saga_json_read(path, r->error) : NULL;
    const bool ok = r->root && read_moments(r);
    json_decref(r->root);
    r->root = NULL;
    free(path);
    return ok;
}

/* Checks that the pictures have the size that the file gives. */
static bool check_sizes(saga_listing *l, saga_error *error)
{
    int *const sizes = saga_alloc((size_t)l->n_sources, 2 * sizeof *sizes,
                                  l->path, error);
    for (int i = 0; sizes && i < l->n_sources; i++) {
        sizes[2 * i] = l->sources[i].width;
        sizes[2 * i + 1] = l->sources[i].height;
    }
    bool ok = sizes && saga_listing_probe_pictures(l, error);
    for (int i = 0; ok && i < l->n_sources; i++) {
        saga_source *const s = &l->sources[i];
        saga_source_turn(s, sizes[2 * i], sizes[2 * i + 1]);
        ok = saga_check_same_size(saga_source_picture(s), s->width, s->height,
                                  sizes[2 * i], sizes[2 * i + 1], error);
    }
    free(sizes);
    return ok;
}

static bool take_points(saga_listing *l, const saga_npy *rows, const char *path,
                        saga_error *error)
{
    if (rows->cols < 6)
        return saga_fail(error, path, "save rows of x, y, z, red, green, blue",
                         "\"data\" has %zu columns", rows->cols);
    l->points = saga_alloc(rows->rows, sizeof *l->points, path, error);
    for (size_t i = 0; l->points && i < rows->rows; i++) {
        const double *const x = rows->data + rows->cols * i;
        /* A point that is not finite is overwritten by the next one. */
        saga_point *const p = &l->points[l->n_points];
        if (!isfinite(x[0]) || !isfinite(x[1]) || !isfinite(x[2]))
            continue;
        for (int k = 0; k < 3; k++) {
            p->position[k] = x[k];
            p->rgb[k] = (uint8_t)(255.0 * fmin(fmax(x[3 + k], 0.0), 1.0) + 0.5);
        }
        l->n_points++;
    }
    if (l->points)
        saga_note(l->notes,
                  "points: %zu of init_pt_cld.npz, of unknown "
                  "visibility",
                  l->n_points);
    return l->points != NULL;
}

static bool read_points(saga_listing *l, const char *folder, saga_error *error)
{
    char *const path = saga_path_join(folder, "init_pt_cld.npz", error);
    saga_npz npz;
    saga_npy rows;
    if (!path)
        return false;
    bool ok = true;
    /* init_pt_cld.npz is optional. */
    if (!saga_path_is_file(path)) {
        saga_note(l->notes, "points: none (no init_pt_cld.npz)");
    } else {
        ok = saga_npz_open(&npz, path, error) &&
             saga_npz_read(&rows, &npz, "data", error);
        if (ok) {
            ok = take_points(l, &rows, path, error);
            saga_npy_free(&rows);
        }
        saga_npz_close(&npz);
    }
    free(path);
    return ok;
}

static bool is_there(const char *folder, saga_error *error)
{
    (void)error;
    return saga_folder_has(folder, "train_meta.json");
}

static bool list(saga_listing *listing, const char *folder,
                 const saga_capture_options *options, saga_error *error)
{
    sports_reader r = { .listing = listing, .folder = folder, .error = error };
    listing->poses = SAGA_POSES_TO_CAMERA;
    bool ok = read_meta(&r, "train_meta.json", false) &&
              (!saga_folder_has(folder, "test_meta.json") ||
               read_meta(&r, "test_meta.json", true)) &&
              saga_listing_take_finds(listing, &r.finds, error) &&
              saga_listing_drop_empty(listing, 0, listing->n_frames, NULL,
                                      error) &&
              check_sizes(listing, error) &&
              saga_listing_hold_out(listing, options->hold_out, error) &&
              read_points(listing, folder, error);
    if (ok && r.n_missing > 0)
        saga_note(listing->notes, "pictures: %d of ims/ are missing",
                  r.n_missing);
    saga_finds_free(&r.finds);
    free(r.ids);
    return ok;
}

const saga_loader saga_panoptic_loader = {
    "Panoptic Sports", "train_meta.json",
    "train_meta.json, test_meta.json, ims/; tested on files of our own only",
    is_there, list
};
