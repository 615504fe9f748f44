/* SPDX-License-Identifier: MIT
 *
 * Reads the TOML files that calibration with a board writes; each camera has a
 * video beside them. The files are caliscope's camera_array.toml, and the
 * calibration.toml of Anipose, Pose2Sim and FreeMoCap. A camera is a table;
 * caliscope's cameras are in a table "cameras", whose keys are numbers. The
 * keys of a camera are:
 *
 *     name         name of the camera; without it, the table's name
 *     size         width and height of the pictures used in the calibration
 *     matrix       3 x 3 intrinsics
 *     distortions  k1 k2 p1 p2 k3, or k1 k2 k3 k4 of a fisheye lens
 *     fisheye      whether the lens is a fisheye; default false
 *     rotation     world to camera in OpenCV axes, a rotation vector or 3 x 3
 *     translation  world to camera
 *     ignore       whether the camera must not be used
 *
 * OpenCV's pixel coordinates begin at the centre of the first pixel, ours at
 * its corner.
 */
#include "alloc.h"
#include "error.h"
#include "file.h"
#include "load.h"
#include "moments.h"
#include "notes.h"
#include "pose.h"
#include "toml.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

/* If cameras are further apart, the unit is not the metre, because no board is
 * found from so far away. */
static const double largest_rig_metres = 50.0;

typedef struct calibration {
    saga_listing *listing;
    const char *path;         /* path of the TOML file */
    double (*sizes)[2];       /* (n_sources) size of the calibrated pictures */
    char *videos_folder;
    saga_names videos;        /* in that folder */
    saga_error *error;
} calibration;

/* ---------------------------------------------------------------- the file */

/* Tells whether a file name is that of a calibration, such as
 * "calibration.toml", "Calib_scene.toml", "x_camera_calibration.toml" and
 * "camera_array_aniposelib.toml". */
static bool is_calibration(const char *name)
{
    const char *const begin = strrchr(name, '_');
    return saga_has_suffix(name, ".toml") &&
           (strncasecmp(name, "calib", 5) == 0 ||
            (begin && strncasecmp(begin, "_calib", 6) == 0) ||
            strcmp(name, "camera_array_aniposelib.toml") == 0);
}

/* Sets *file to a calibration in a folder, NULL if there is none, and *n to
 * their number. Caliscope exports one calibration in two forms, of which the
 * first counts. Returns false only on an error. */
static bool find_file(char **file, int *n, const char *folder,
                      saga_error *error)
{
    static const char first[] = "camera_array.toml";
    saga_names names = {0};
    *file = NULL;
    /* A file of this name takes precedence over all others. */
    *n = saga_folder_has(folder, first);
    if (*n == 1)
        return (*file = saga_path_join(folder, first, error)) != NULL;
    bool ok = saga_folder_list(&names, folder, is_calibration, error);
    if (ok && names.n > 0) {
        *file = saga_path_join(folder, names.at[0], error);
        ok = *file != NULL;
    }
    *n = (int)names.n;
    saga_names_free(&names);
    return ok;
}

/* ------------------------------------------------------------------ numbers */

/* Reads a list of at most `most` numbers, or a list of such lists as one list,
 * and sets *n to their number. Returns false for anything else. */
static bool get_numbers(const json_t *list, double *to, size_t most, size_t *n)
{
    *n = 0;
    for (size_t i = 0; i < json_array_size(list); i++) {
        const json_t *const item = json_array_get(list, i);
        const size_t m = json_is_array(item) ? json_array_size(item) : 1;
        for (size_t k = 0; k < m; k++) {
            const json_t *const x =
                json_is_array(item) ? json_array_get(item, k) : item;
            if (!json_is_number(x) || *n == most)
                return false;
            to[(*n)++] = json_number_value(x);
        }
    }
    return *n > 0;
}

static bool bad_value(const calibration *c, const saga_source *s,
                      const char *key, const char *wanted)
{
    return saga_fail(c->error, c->path, "export the calibration again",
                     "\"%s\" of %s is missing or not %s", key, s->name, wanted);
}

/* Reads exactly n numbers. */
static bool get_all(const calibration *c, const saga_source *s,
                    const json_t *table, const char *key, size_t n, double *to)
{
    size_t n_there;
    char wanted[40];
    (void)snprintf(wanted, sizeof wanted, "%zu numbers", n);
    return (get_numbers(json_object_get(table, key), to, n, &n_there) &&
            n_there == n) || bad_value(c, s, key, wanted);
}

/* ------------------------------------------------------------------ cameras */

static bool read_distortion(const calibration *c, saga_source *s,
                            const json_t *table)
{
    enum { MOST = 14 };
    double k[MOST] = {0.0};
    const json_t *const list = json_object_get(table, "distortions");
    const size_t n_known = s->lens.fisheye ? 4 : 5;
    size_t n;
    if (!get_numbers(list, k, MOST, &n))
        return bad_value(c, s, "distortions", "a list of numbers");
    /* The additional coefficients of longer lens models (rational, tilted
     * sensor) must be 0, where these models equal the short one. */
    for (size_t i = n_known; i < n; i++)
        if (k[i] != 0.0)
            return saga_fail(c->error, c->path, s->lens.fisheye
                             ? "calibrate with OpenCV's fisheye model"
                             : "calibrate with only k1 k2 p1 p2 k3",
                             "the lens of %s has %zu coefficients, but only "
                             "%zu are supported", s->name, n, n_known);
    s->lens.k1 = k[0];
    s->lens.k2 = k[1];
    if (s->lens.fisheye) {
        s->lens.k3 = k[2];
        s->lens.k4 = k[3];
    } else {
        s->lens.p1 = k[2];
        s->lens.p2 = k[3];
        s->lens.k3 = k[4];
    }
    return true;
}

static bool read_lens(const calibration *c, saga_source *s, const json_t *table,
                      double size[2])
{
    double m[9];
    if (!get_all(c, s, table, "size", 2, size) ||
        !get_all(c, s, table, "matrix", 9, m))
        return false;
    if (!(size[0] >= 1.0 && size[1] >= 1.0 && size[0] <= SAGA_MAX_SIDE &&
          size[1] <= SAGA_MAX_SIDE))
        return bad_value(c, s, "size", "a width and a height in pixels");
    if (m[1] != 0.0)
        return saga_fail(c->error, c->path, "calibrate without skew",
                         "matrix of %s has a skew of %g", s->name, m[1]);
    s->lens = (saga_lens){.fx = m[0], .fy = m[4], .cx = m[2] + 0.5,
                          .cy = m[5] + 0.5};
    s->lens.fisheye = json_is_true(json_object_get(table, "fisheye"));
    return read_distortion(c, s, table);
}

static bool read_pose(const calibration *c, saga_source *s, const json_t *table)
{
    double r[9], t[3];
    size_t n;
    if (!get_all(c, s, table, "translation", 3, t))
        return false;
    if (!get_numbers(json_object_get(table, "rotation"), r, 9, &n) ||
        (n != 3 && n != 9))
        return bad_value(c, s, "rotation", "3 numbers or 3 x 3");
    if (n == 3)
        saga_pose_from_turn((double[3]){r[0], r[1], r[2]}, r);
    return saga_pose_from_world(r, t, s->rotation, s->translation) ||
           saga_fail(c->error, c->path, "export the calibration again",
                     "rotation of %s is not finite or not a rotation (%g %g "
                     "%g)",
                     s->name, r[0], r[1], r[2]);
}

static void name_camera(saga_source *s, const char *key, const json_t *table)
{
    const char *const name = json_string_value(json_object_get(table, "name"));
    char text[SAGA_NAME_NBYTES + 8];
    /* Caliscope names cameras by numbers; their videos are cam_0.mp4 and so
     * on. */
    (void)snprintf(text, sizeof text, "%s%.*s",
                   !name && strspn(key, "0123456789") == strlen(key) ? "cam_"
                                                                     : "",
                   SAGA_NAME_NBYTES - 1, name ? name : key);
    saga_copy_name(s->name, text, strlen(text));
}

static bool add_camera(calibration *c, const char *key, const json_t *table)
{
    static const saga_note_kind left_out = {
        "cameras: left out, because the calibration has no pose of them or "
        "ignores them: ", ""};
    saga_listing *const l = c->listing;
    if (l->n_sources == SAGA_MAX_VIEWS)
        return saga_fail(c->error, c->path, "split the capture",
                         "has more than %d cameras", SAGA_MAX_VIEWS);
    const size_t n = (size_t)l->n_sources + 1;
    saga_source *const more =
        saga_realloc(l->sources, n, sizeof *more, c->path, c->error);
    l->sources = more ? more : l->sources;
    double (*const sizes)[2] =
        saga_realloc(c->sizes, n, sizeof *sizes, c->path, c->error);
    c->sizes = sizes ? sizes : c->sizes;
    if (!more || !sizes)
        return false;
    saga_source *const s = &more[n - 1];
    *s = (saga_source){.video = NULL};
    name_camera(s, key, table);
    /* The calibration may have failed for a camera, or the user may have
     * excluded it. */
    if (json_is_true(json_object_get(table, "ignore")) ||
        !json_object_get(table, "rotation") ||
        !json_object_get(table, "translation")) {
        saga_note_each(l->notes, &left_out, "%s", s->name);
        return true;
    }
    l->n_sources++;
    return read_lens(c, s, table, sizes[n - 1]) && read_pose(c, s, table);
}

static bool read_cameras(calibration *c)
{
    json_t *const root = saga_toml_read(c->path, c->error);
    json_t *const array = json_object_get(root, "cameras");
    bool ok = root != NULL;
    const char *key;
    json_t *table;
    /* Tables without intrinsics, such as "metadata", are not cameras. */
    json_object_foreach (array ? array : root, key, table)
        if (ok && json_object_get(table, "matrix"))
            ok = add_camera(c, key, table);
    /* Caliscope's unit is the metre. */
    if (array)
        c->listing->metres = 1.0;
    json_decref(root);
    return ok && (c->listing->n_sources > 0 ||
                  saga_fail(c->error, c->path, "calibrate poses as well",
                            "has no camera with matrix, rotation and "
                            "translation"));
}

/* ------------------------------------------------------------------- videos */

/* Finds the videos beside the calibration, or in a folder there. */
static bool find_videos(calibration *c, const char *folder)
{
    static const char *const parts[] = {"", "/videos", "/synchronized_videos"};
    const size_t n = strlen(folder) + sizeof "/synchronized_videos";
    bool ok = (c->videos_folder = saga_alloc(n, 1, folder, c->error)) != NULL;
    for (size_t i = 0; ok && c->videos.n == 0 && i < 3; i++) {
        (void)snprintf(c->videos_folder, n, "%s%s", folder, parts[i]);
        ok = saga_folder_list(&c->videos, c->videos_folder, saga_is_video_name,
                              c->error);
    }
    if (!ok || c->videos.n > 0)
        return ok;
    return saga_fail(c->error, folder, "put them there", "has a calibration "
                     "but no videos beside it, nor in videos/ or "
                     "synchronized_videos/");
}

/* ----------------------------------------------------- which is whose video */

/* The rules by which a video's name without extension belongs to a camera, the
 * most certain first: "trial" to camera "trial", "walk-camA" to "A", "port_3"
 * to "cam_03". */
static bool is_same(const char *camera, const char *video, size_t n)
{
    return strlen(camera) == n && strncasecmp(camera, video, n) == 0;
}

static bool ends_so(const char *camera, const char *video, size_t n)
{
    const size_t m = strlen(camera);
    return m > 0 && m <= n && strncasecmp(camera, video + n - m, m) == 0;
}

static bool has_number(const char *camera, const char *video, size_t n)
{
    uint64_t a, b;
    return saga_last_number(camera, strlen(camera), &a) &&
           saga_last_number(video, n, &b) && a == b;
}

static bool (*const rules[])(const char *camera, const char *video,
                             size_t n) = {is_same, ends_so, has_number};

enum { N_RULES = sizeof rules / sizeof *rules };

static bool belongs(const calibration *c, int rule, int camera, int video)
{
    const char *const name = c->videos.at[video];
    return rules[rule](c->listing->sources[camera].name, name,
                       (size_t)(strrchr(name, '.') - name));
}

/* Returns the only video that belongs to a camera and to no other camera, or
 * -1. */
static int video_of(const calibration *c, int rule, int camera)
{
    int found = -1;
    for (int v = 0; v < (int)c->videos.n; v++)
        if (belongs(c, rule, camera, v)) {
            if (found >= 0)
                return -1;
            found = v;
        }
    for (int i = 0; found >= 0 && i < c->listing->n_sources; i++)
        if (i != camera && belongs(c, rule, i, found))
            return -1;
    return found;
}

/* Returns the rule by which most cameras have a video, or -1 if none has. */
static int best_rule(const calibration *c)
{
    int best = -1, most = 0;
    for (int rule = 0; rule < N_RULES; rule++) {
        int n = 0;
        for (int i = 0; i < c->listing->n_sources; i++)
            n += video_of(c, rule, i) >= 0;
        if (n > most) {
            best = rule;
            most = n;
        }
    }
    return best;
}

static bool give_videos(calibration *c, const char *folder)
{
    saga_listing *const l = c->listing;
    const int rule = best_rule(c);
    if (rule < 0)
        return saga_fail(c->error, folder, "name each video as its camera, for "
                         "example cam_0.mp4", "no name of its %zu videos "
                         "contains that of one of the %d cameras; the first "
                         "camera is %s",
                         c->videos.n, l->n_sources, l->sources[0].name);
    /* Each camera takes the video that the rule gives it; the other videos are
     * only counted. */
    size_t n_used = 0;
    for (int i = 0; i < l->n_sources; i++) {
        const int v = video_of(c, rule, i);
        if (v < 0)
            continue;
        l->sources[i].video = saga_path_join(c->videos_folder,
                                              c->videos.at[v], c->error);
        if (!l->sources[i].video)
            return false;
        n_used++;
    }
    if (n_used < c->videos.n)
        saga_note(l->notes, "videos: %zu of %zu belong to no camera of the "
                  "calibration", c->videos.n - n_used, c->videos.n);
    return true;
}

/* ----------------------------------------------------------- filling in */

/* Scales a lens to the size of the video's pictures. */
static bool fit_size(const calibration *c, saga_source *s, const double size[2])
{
    if (!saga_source_fit(s, size[0], size[1]))
        return saga_fail(c->error, c->path, "calibrate with pictures that are "
                         "neither rotated nor cropped", "%s was "
                         "calibrated with %g x %g pixels, the video has "
                         "%d x %d", s->name, size[0], size[1], s->width,
                         s->height);
    if (s->width != size[0] && !strstr(c->listing->notes, "size:"))
        saga_note(c->listing->notes, "size: lenses were calibrated with %g x "
                  "%g pixels and are scaled to the videos' (%s)", size[0],
                  size[1], s->name);
    return true;
}

/* Notes the unit of length. A file without one uses the unit of its board,
 * often millimetres. */
static void tell_unit(saga_listing *l)
{
    double farthest = 0.0;
    for (int i = 0; i < l->n_sources; i++)
        for (int k = 0; k < i; k++) {
            double a[3], b[3];
            saga_pose_centre(l->sources[i].rotation, l->sources[i].translation,
                             a);
            saga_pose_centre(l->sources[k].rotation, l->sources[k].translation,
                             b);
            farthest = fmax(farthest, hypot(hypot(a[0] - b[0], a[1] - b[1]),
                                            a[2] - b[2]));
        }
    if (farthest <= largest_rig_metres)
        return;
    saga_note(l->notes, "unit: cameras are up to %.4g units apart, which "
              "cannot be metres; if they are millimetres, --metres 0.001 "
              "records that in the file", farthest);
    l->metres = 0.0;
}

static bool fill_in(calibration *c, const saga_capture_options *options)
{
    saga_listing *const l = c->listing;
    int *const kept_as = saga_alloc((size_t)l->n_sources, sizeof *kept_as,
                                    c->path, c->error);
    const int n = l->n_sources;
    /* Cameras without a video are left out first; c->sizes still has the old
     * order. */
    bool ok = kept_as && saga_listing_drop_empty(l, 0, 0, kept_as, c->error);
    for (int i = 0; ok && i < n; i++) {
        saga_source *const s = &l->sources[kept_as[i] < 0 ? 0 : kept_as[i]];
        ok = kept_as[i] < 0 || (saga_probe_video(s, c->error) &&
                                fit_size(c, s, c->sizes[i]));
    }
    free(kept_as);
    if (!ok)
        return false;
    /* Names and the unit of length are settled first, then the frames that all
     * videos have. */
    saga_listing_tell_apart(l);
    tell_unit(l);
    saga_note(l->notes, "points: none (a calibration has none)");
    return saga_listing_match_videos(l, options, c->error) &&
           saga_listing_hold_out(l, options->hold_out, c->error);
}

static bool is_there(const char *folder, saga_error *error)
{
    char *file;
    int n;
    const bool ok = find_file(&file, &n, folder, error);
    free(file);
    return ok && n > 0;
}

static bool list(saga_listing *listing, const char *folder,
                 const saga_capture_options *options, saga_error *error)
{
    calibration c = {.listing = listing, .error = error};
    char *file;
    int n;
    bool ok = find_file(&file, &n, folder, error);
    c.path = file;
    if (ok && n > 1)
        ok = saga_fail(error, folder, "keep one of them beside the videos",
                       "has %d calibrations, among them %.100s", n,
                       strrchr(file, '/') + 1);
    ok = ok && read_cameras(&c) && find_videos(&c, folder) &&
         give_videos(&c, folder) && fill_in(&c, options);
    saga_names_free(&c.videos);
    free(c.videos_folder);
    free(c.sizes);
    free(file);
    return ok;
}

const saga_loader saga_calibrated_videos_loader = {
    "calibrated videos", "calibration.toml",
    "a video for each camera and the calibration in camera_array.toml of "
    "caliscope, or in calibration.toml of Anipose, Pose2Sim or FreeMoCap",
    is_there, list
};
