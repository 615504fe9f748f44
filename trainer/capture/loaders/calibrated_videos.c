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
#include "colmap_views.h"
#include "error.h"
#include "file.h"
#include "moments.h"
#include "notes.h"
#include "pose.h"
#include "toml.h"
#include "video_owner.h"

#include <limits.h>
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
    char *path;         /* path of the TOML file, or NULL */
    double (*sizes)[2]; /* (n_sources) size of the calibrated pictures */
    int n_files;        /* number of TOML files beside it, and it */
    char *videos_folder;
    saga_names videos; /* in that folder */
    int n_recordings;  /* number of folders in recordings/ that have
                        * videos */
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

/* Finds a calibration in a folder. Caliscope exports one in two forms, of which
 * the first counts. Returns false only on an error. */
static bool find_file(calibration *c, const char *folder)
{
    static const char first[] = "camera_array.toml";
    saga_names names = { 0 };
    bool ok = true;
    c->n_files = saga_folder_has(folder, first);
    if (!c->n_files) {
        ok = saga_folder_list(&names, folder, is_calibration, c->error);
        c->n_files = (int)names.n;
    }
    if (ok && c->n_files)
        c->path = saga_path_join(folder, names.n ? names.at[0] : first,
                                 c->error);
    saga_names_free(&names);
    return !saga_failed(c->error);
}

/* Finds the calibration in a folder, or where caliscope and Pose2Sim put it in
 * the folder of a project, of which caliscope's recordings/NAME may be given.
 * *beside tells which. */
static bool find_calibration(calibration *c, const char *folder, bool *beside)
{
    static const char *const parts[] = {
        "",
        "capture_volume",
        "calibration/extrinsic/capture_volume",
        "calibration/extrinsic",
        "calibration",
        "../../recordings/../calibration/extrinsic/capture_volume"
    };
    for (size_t i = 0; !c->path && i < sizeof parts / sizeof *parts; i++) {
        char *const place = saga_path_join(folder, parts[i], c->error);
        const bool ok = place && find_file(c, place);
        free(place);
        if (!ok)
            return false;
        *beside = i == 0;
    }
    return true;
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
            const json_t *const x = json_is_array(item)
                                        ? json_array_get(item, k)
                                        : item;
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
            n_there == n) ||
           bad_value(c, s, key, wanted);
}

/* ------------------------------------------------------------------ cameras */

static bool read_distortion(const calibration *c, saga_source *s,
                            const json_t *table)
{
    enum { MOST = 14 };
    double k[MOST] = { 0.0 };
    const json_t *const list = json_object_get(table, "distortions");
    const size_t n_known = s->lens.fisheye ? 4 : 5;
    size_t n;
    if (!get_numbers(list, k, MOST, &n))
        return bad_value(c, s, "distortions", "a list of numbers");
    /* The additional coefficients of longer lens models (rational, tilted
     * sensor) must be 0, where these models equal the short one. */
    for (size_t i = n_known; i < n; i++)
        if (k[i] != 0.0)
            return saga_fail(c->error, c->path,
                             s->lens.fisheye
                                 ? "calibrate with OpenCV's fisheye model"
                                 : "calibrate with only k1 k2 p1 p2 k3",
                             "the lens of %s has %zu coefficients, but only "
                             "%zu are supported",
                             s->name, n, n_known);
    s->lens.k1 = k[0];
    s->lens.k2 = k[1];
    s->lens.p1 = s->lens.fisheye ? 0.0 : k[2];
    s->lens.p2 = s->lens.fisheye ? 0.0 : k[3];
    s->lens.k3 = k[s->lens.fisheye ? 2 : 4];
    s->lens.k4 = s->lens.fisheye ? k[3] : 0.0;
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
    s->lens = (saga_lens){
        .fx = m[0], .fy = m[4], .cx = m[2] + 0.5, .cy = m[5] + 0.5
    };
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
        saga_pose_from_turn((double[3]){ r[0], r[1], r[2] }, r);
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

/* Tells whether a camera lacks a key. TOML has no null; some write "null". */
static bool has_none(const json_t *table, const char *key)
{
    const json_t *const value = json_object_get(table, key);
    return !value || (json_is_string(value) &&
                      strcmp(json_string_value(value), "null") == 0);
}

static bool add_camera(calibration *c, const char *key, const json_t *table)
{
    static const saga_note_kind left_out = {
        "cameras: left out, because the calibration has no pose of them or "
        "ignores them: ",
        ""
    };
    /* Caliscope turns pictures only to show and to track them. */
    static const saga_note_kind turned = {
        "cameras: the rotation_count of ",
        " is for caliscope's windows; "
        "pictures are read as they are in the videos, which is what lenses "
        "and poses are for"
    };
    saga_listing *const l = c->listing;
    if (l->n_sources == SAGA_MAX_VIEWS)
        return saga_fail(c->error, c->path, "split the capture",
                         "has more than %d cameras", SAGA_MAX_VIEWS);
    const size_t n = (size_t)l->n_sources + 1;
    saga_source *const more = saga_realloc(l->sources, n, sizeof *more, c->path,
                                           c->error);
    l->sources = more ? more : l->sources;
    double(*const sizes)[2] = saga_realloc(c->sizes, n, sizeof *sizes, c->path,
                                           c->error);
    c->sizes = sizes ? sizes : c->sizes;
    if (!more || !sizes)
        return false;
    saga_source *const s = &more[n - 1];
    *s = (saga_source){ .video = NULL };
    name_camera(s, key, table);
    /* The calibration may have failed for a camera, or the user may have
     * excluded it. */
    if (json_is_true(json_object_get(table, "ignore")) ||
        has_none(table, "rotation") || has_none(table, "translation")) {
        saga_note_each(l->notes, &left_out, "%s", s->name);
        return true;
    }
    if (json_number_value(json_object_get(table, "rotation_count")) != 0.0)
        saga_note_each(l->notes, &turned, "%s", s->name);
    l->n_sources++;
    return read_lens(c, s, table, sizes[n - 1]) && read_pose(c, s, table);
}

/* Programs that have calibrated only lenses may write the same pose for all
 * cameras. No two cameras can be in one place. */
static bool check_poses(const calibration *c)
{
    const saga_source *const s = c->listing->sources;
    for (int i = 1; i < c->listing->n_sources; i++)
        if (memcmp(s[i].rotation, s[0].rotation, sizeof s->rotation) == 0 &&
            memcmp(s[i].translation, s[0].translation, sizeof s->translation) ==
                0)
            return saga_fail(c->error, c->path,
                             "calibrate poses (extrinsics) "
                             "as well",
                             "gives %s and %s the same rotation and "
                             "translation",
                             s[0].name, s[i].name);
    return true;
}

static bool read_cameras(calibration *c)
{
    json_t *const root = saga_toml_read(c->path, c->error);
    json_t *const array = json_object_get(root, "cameras");
    bool ok = root != NULL;
    const char *key;
    json_t *table;
    /* Tables without intrinsics, such as "metadata", are not cameras. */
    json_object_foreach(array ? array : root, key,
                        table) if (ok && json_object_get(table, "matrix"))
        ok = add_camera(c, key, table);
    /* Caliscope's unit is the metre. */
    if (array)
        c->listing->metres = 1.0;
    json_decref(root);
    if (ok && c->listing->n_sources == 0)
        return saga_fail(c->error, c->path,
                         "calibrate poses (extrinsics) as "
                         "well",
                         "has no camera with matrix, rotation and "
                         "translation");
    return ok && saga_listing_check_names(c->listing, c->path, c->error) &&
           check_poses(c);
}

/* ------------------------------------------------------------------- videos */

/* Lists the videos in a folder's part, unless some have been found. */
static bool look_for_videos(calibration *c, const char *folder,
                            const char *part)
{
    if (c->videos.n > 0)
        return true;
    free(c->videos_folder);
    c->videos_folder = saga_path_join(folder, part, c->error);
    return c->videos_folder && saga_folder_list(&c->videos, c->videos_folder,
                                                saga_is_video_name, c->error);
}

/* Takes the videos of caliscope's recordings/, if only one folder in it has
 * any; otherwise none. */
static bool look_in_recordings(calibration *c, const char *folder)
{
    char *const root = saga_path_join(folder, "recordings", c->error);
    saga_names takes = { 0 };
    bool ok = root && saga_folder_list(&takes, root, NULL, c->error);
    size_t last = 0;
    for (size_t i = 0; ok && i < takes.n; i++) {
        ok = look_for_videos(c, root, takes.at[i]);
        if (c->videos.n == 0)
            continue;
        c->n_recordings++;
        last = i;
        saga_names_free(&c->videos);
    }
    if (ok && c->n_recordings == 1)
        ok = look_for_videos(c, root, takes.at[last]);
    saga_names_free(&takes);
    free(root);
    return ok;
}

/* Finds the videos in a folder, or where FreeMoCap, Pose2Sim and caliscope put
 * them; those of the calibration itself come last. */
static bool find_videos(calibration *c, const char *folder)
{
    return look_for_videos(c, folder, "") &&
           look_for_videos(c, folder, "videos") &&
           look_for_videos(c, folder, "synchronized_videos") &&
           (c->videos.n > 0 || look_in_recordings(c, folder)) &&
           (c->n_recordings > 1 ||
            look_for_videos(c, folder, "calibration/extrinsic"));
}

static bool check_files(const calibration *c, const char *folder)
{
    if (!c->path)
        return saga_fail(c->error, folder, "export one", "has no calibration");
    if (c->n_files > 1)
        return saga_fail(c->error, folder, "keep one of them beside the videos",
                         "has %d calibrations, among them %.100s", c->n_files,
                         strrchr(c->path, '/') + 1);
    if (c->n_recordings > 1)
        return saga_fail(c->error, folder,
                         "give the folder of one of them, with the calibration "
                         "copied into it if it is not found from there",
                         "has %d recordings with videos in recordings/, and "
                         "the calibration %.200s",
                         c->n_recordings, c->path);
    return c->videos.n > 0 ||
           saga_fail(c->error, folder, "put them there",
                     "has the calibration "
                     "%.200s, but no videos (.mp4, .mov, .mkv, .avi, .webm, "
                     ".ts ...) beside it, nor in videos/, synchronized_videos/,"
                     " recordings/NAME/ or calibration/extrinsic/",
                     c->path);
}

/* ----------------------------------------------------------- their cameras */

static bool give_videos(calibration *c, const char *folder)
{
    static const saga_note_kind without = {
        "warning: cameras of the calibration that have no video: ",
        "; copy theirs beside the others, if they filmed"
    };
    saga_listing *const l = c->listing;
    const int rule = saga_video_rule(l, &c->videos);
    if (rule < 0)
        return saga_fail(c->error, folder,
                         "name each video as its camera, for "
                         "example cam_0.mp4",
                         "no name of its %zu videos "
                         "(%.60s ...) contains that of one of the %d cameras "
                         "(%s ...)",
                         c->videos.n, c->videos.at[0], l->n_sources,
                         l->sources[0].name);
    /* Videos that no camera takes are only counted. */
    size_t n_used = 0;
    for (int i = 0; i < l->n_sources; i++) {
        const int v = saga_video_of(l, &c->videos, rule, i);
        if (v < 0) {
            saga_note_each(l->notes, &without, "%s", l->sources[i].name);
            continue;
        }
        l->sources[i].video = saga_path_join(c->videos_folder, c->videos.at[v],
                                             c->error);
        if (!l->sources[i].video)
            return false;
        n_used++;
    }
    if (n_used < c->videos.n)
        saga_note(l->notes,
                  "videos: %zu of %zu belong to no camera of the "
                  "calibration",
                  c->videos.n - n_used, c->videos.n);
    return true;
}

/* ----------------------------------------------------------- filling in */

/* Scales a lens to the size of the video's pictures. */
static bool fit_size(const calibration *c, saga_source *s, const double size[2])
{
    if (!saga_source_fit(s, size[0], size[1]))
        return saga_fail(
            c->error, c->path,
            saga_source_fit_remedy(s, size[0], size[1],
                                   "calibrate with pictures "
                                   "that are neither rotated nor cropped"),
            "%s was "
            "calibrated with %g x %g pixels, the video has "
            "%d x %d",
            s->name, size[0], size[1], s->width, s->height);
    if (s->width != size[0] && !strstr(c->listing->notes, "size:"))
        saga_note(c->listing->notes,
                  "size: lenses were calibrated with %g x "
                  "%g pixels and are scaled to the videos' (%s)",
                  size[0], size[1], s->name);
    return true;
}

/* Notes the unit of length. A file without one uses the unit of its board,
 * often millimetres. */
static void note_unit(saga_listing *l)
{
    const saga_source *const s = l->sources;
    double farthest = 0.0;
    for (int i = 0; i < l->n_sources; i++)
        for (int k = 0; k < i; k++) {
            double a[3], b[3];
            saga_pose_centre(s[i].rotation, s[i].translation, a);
            saga_pose_centre(s[k].rotation, s[k].translation, b);
            farthest = fmax(
                farthest, hypot(hypot(a[0] - b[0], a[1] - b[1]), a[2] - b[2]));
        }
    if (farthest <= largest_rig_metres)
        return;
    saga_note(l->notes,
              "unit: cameras are up to %.4g units apart, which "
              "cannot be metres; if they are millimetres, --metres 0.001 "
              "records that in the file",
              farthest);
    l->metres = 0.0;
}

/* Warns if the videos are those by which caliscope or Pose2Sim calibrated. */
static void note_board(const calibration *c)
{
    char real[PATH_MAX];
    if (!realpath(c->videos_folder, real))
        return;
    /* The last two names are calibration/intrinsic or so. */
    const char *const last = strrchr(real, '/');
    static const char above[] = "/calibration";
    const size_t n = sizeof above - 1;
    if ((size_t)(last - real) >= n && memcmp(last - n, above, n) == 0 &&
        (strstr(last, "intrinsic") || strstr(last, "extrinsic")))
        saga_note(c->listing->notes,
                  "warning: the videos in %s are those of the calibration, of "
                  "its board; for the scene, give the folder of a recording",
                  real);
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
        ok = kept_as[i] < 0 ||
             (saga_probe_video(s, c->error) && fit_size(c, s, c->sizes[i]));
    }
    free(kept_as);
    if (!ok)
        return false;
    note_board(c);
    note_unit(l);
    saga_note(l->notes, "points: none (a calibration has none)");
    return saga_listing_match_videos(l, options, c->error) &&
           saga_listing_hold_out(l, options->hold_out, c->error);
}

static void release(calibration *c)
{
    saga_names_free(&c->videos);
    free(c->videos_folder);
    free(c->sizes);
    free(c->path);
}

/* A folder that only contains a calibration somewhere may be another layout, so
 * it must have videos, and no other poses. */
static bool is_there(const char *folder, saga_error *error)
{
    calibration c = { .error = error };
    char *model = NULL;
    bool beside = false;
    bool there = find_calibration(&c, folder, &beside) && c.path;
    if (there && !beside)
        there = !saga_folder_has(folder, "poses_bounds.npy") &&
                saga_colmap_find(&model, folder, error) && !model &&
                find_videos(&c, folder) &&
                (c.videos.n > 0 || c.n_recordings > 1);
    free(model);
    release(&c);
    return there;
}

static bool list(saga_listing *listing, const char *folder,
                 const saga_capture_options *options, saga_error *error)
{
    calibration c = { .listing = listing, .error = error };
    bool beside = false;
    listing->poses = SAGA_POSES_TO_CAMERA;
    const bool ok = find_calibration(&c, folder, &beside) &&
                    find_videos(&c, folder) && check_files(&c, folder) &&
                    read_cameras(&c) && give_videos(&c, folder);
    if (ok && !beside)
        saga_note(listing->notes, "cameras: %s, for the videos in %s", c.path,
                  c.videos_folder);
    const bool filled = ok && fill_in(&c, options);
    release(&c);
    return filled;
}

const saga_loader saga_calibrated_videos_loader = {
    "calibrated videos", "camera_array.toml, calibration.toml",
    "a video for each camera and the calibration in camera_array.toml of "
    "caliscope, or in calibration.toml of Anipose, Pose2Sim or FreeMoCap; also "
    "the folder of a project of caliscope or Pose2Sim",
    is_there, list
};
