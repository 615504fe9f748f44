/* SPDX-License-Identifier: MIT
 *
 * Reads nerfstudio's transforms.json.
 *
 * Each entry of "frames" is one picture with its camera, or one video with all
 * its frames. Intrinsics stand in the entry, or at the top for all entries.
 * transform_matrix is camera to world in OpenGL axes (x right, y up, z
 * backwards). Pictures with the same pose and the same intrinsics are one
 * camera; "time" orders them, and all cameras must have the same times. Without
 * any "time" the order of the file names counts, and a camera with one picture
 * is a still one. A picture is missing if its file does not exist. It is also
 * missing if it is not listed and the other entries have a "time", or a number
 * in their names, that shows which one is left out.
 *
 * A camera that moves (D-NeRF) has its own "time" and pose for each picture.
 * Each picture becomes a camera of its own that lacks all other moments. The
 * number of moments is that of the different times in the training pictures,
 * and moments are evenly spaced; a picture taken between two moments is late
 * after the earlier one.
 *
 * Blender's synthetic scenes have transforms_train.json and
 * transforms_test.json, whose pictures are held out. They have camera_angle_x
 * as their only intrinsic, and file names without extension.
 *
 * "time" is in seconds, or runs from 0 to 1 over the whole capture, unless
 * "fps" at the top sets the rate. Cameras are held out as a whole: those whose
 * files are in test_filenames or val_filenames, or are not in train_filenames
 * if that exists.
 */
#include "transforms.h"

#include "alloc.h"
#include "error.h"
#include "file.h"
#include "json_memory.h"
#include "notes.h"
#include "ply.h"
#include "pose.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* -------------------------------------------------------------- filling in */

static bool split_views(saga_transforms *r)
{
    if (!saga_transforms_mark_held_out(r))
        return false;
    for (int i = 0; i < r->n_entries; i++) {
        const saga_entry *const e = &r->entries[i];
        saga_source *const s = &r->listing->sources[e->view];
        if (i == r->view_first[e->view])
            s->held_out = e->held_out;
        else if (s->held_out != e->held_out)
            return saga_fail(r->error, r->path,
                             "put all pictures of a camera "
                             "into one list, or remove the lists and use "
                             "--hold-out",
                             "the train/test lists hold out "
                             "only some pictures of camera %s (%s differs)",
                             s->name, e->file);
    }
    return true;
}

static char *join(const saga_transforms *r, const char *name)
{
    return saga_listing_join(r->listing, r->folder, name, r->path, r->error);
}

/* Returns the path of a picture, with an extension if the file's name lacks
 * one, as Blender's do. If no file with a known extension exists, the path is
 * returned as it is. */
static char *picture_path(const saga_transforms *r, const char *file)
{
    static const char *const endings[] = { ".png", ".jpg", ".jpeg", ".webp",
                                           ".exr", ".tif", ".tiff" };
    char *const path = join(r, file);
    if (!path || saga_path_is_file(path))
        return path;
    /* Without a file of that name, each known extension is tried. */
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

static bool fill_lens(const saga_transforms *r, saga_source *s,
                      const saga_entry *e)
{
    const saga_entry_camera *const k = &e->key;
    if (k->width > 0.0 && k->height > 0.0)
        saga_source_turn(s, k->width, k->height);
    if ((k->width != 0.0 && k->width != s->width) ||
        (k->height != 0.0 && k->height != s->height))
        return saga_fail(r->error, r->path,
                         saga_source_fit_remedy(
                             s, k->width, k->height,
                             "correct w and h together "
                             "with fl_x fl_y cx cy, or scale the pictures "
                             "back"),
                         "w x h of %s is %g x %g, the file has %d x %d "
                         "pixels",
                         e->file, k->width, k->height, s->width, s->height);
    s->lens = (saga_lens){ .fx = k->fx,
                           .fy = k->fy,
                           .cx = k->cx,
                           .cy = k->cy,
                           .k1 = k->k1,
                           .k2 = k->k2,
                           .k3 = k->k3,
                           .p1 = k->p1,
                           .p2 = k->p2,
                           .k4 = k->k4,
                           .fisheye = k->fisheye != 0.0 };
    /* w = 2 fx tan(angle / 2). If both fl_x and the angle are missing, fx stays
     * NaN and is refused below. */
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
    return saga_fail(r->error, r->path,
                     "give fl_x (pixels) or "
                     "camera_angle_x (radians)",
                     "focal length of %s is missing or not finite", e->file);
}

static bool fill_pose(const saga_transforms *r, saga_source *s,
                      const saga_entry *e)
{
    if (saga_pose_from_opengl(e->key.pose, s->rotation, s->translation))
        return true;
    return saga_fail(r->error, r->path,
                     "export the poses again, without "
                     "scale",
                     "transform_matrix of %s (frames[%d]) is not "
                     "finite or not a rotation (first row %g %g %g %g)",
                     e->file, e->index, e->key.pose[0], e->key.pose[1],
                     e->key.pose[2], e->key.pose[3]);
}

/* Sets the paths of a source's pictures, as far as the files exist. */
static bool fill_pictures(saga_transforms *r, saga_source *s,
                          saga_entry *const *at, int n)
{
    s->pictures = saga_calloc((size_t)n, sizeof *s->pictures, r->path,
                              r->error);
    s->depths = saga_calloc((size_t)n, sizeof *s->depths, r->path, r->error);
    s->masks = saga_calloc((size_t)n, sizeof *s->masks, r->path, r->error);
    bool ok = s->pictures && s->depths && s->masks;
    for (int k = 0; ok && k < n; k++) {
        /* A picture is missing if it has no entry, or no file. */
        char *const path = at[k] ? picture_path(r, at[k]->file) : NULL;
        if (path && saga_path_is_file(path)) {
            s->pictures[k] = path;
        } else {
            ok = path || !at[k];
            saga_listing_miss(r->listing, path);
            r->first_missing = r->first_missing || !at[k] ? r->first_missing
                                                          : at[k]->file;
            r->n_missing++;
        }
        /* Set the depth and the mask that the entry names. */
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

static bool fill_views(saga_transforms *r, int n)
{
    saga_listing *const l = r->listing;
    l->sources = saga_calloc((size_t)r->n_views, sizeof *l->sources, r->path,
                             r->error);
    if (!l->sources)
        return false;
    l->n_sources = r->n_views;
    /* For videos the number of frames is known only after they are probed. */
    l->n_frames = r->videos ? 0 : n;
    saga_transforms_name_views(r, n);
    for (int v = 0; v < r->n_views; v++) {
        saga_source *const s = &l->sources[v];
        const saga_entry *const e = &r->entries[r->view_first[v]];
        s->late = e->late;
        if (!r->videos && !fill_pictures(r, s, r->at + v * n, n))
            return false;
        if (r->videos)
            s->video = join(r, e->file);
        if (r->videos && !(s->video && saga_probe_video(s, r->error)))
            return false;
    }
    /* A view of a moving camera has only one moment; its other moments do not
     * count as missing. */
    const int n_others = l->moves ? r->n_entries * (n - 1) : 0;
    if (r->n_missing > n_others)
        saga_note(l->notes, "pictures: %d are missing (%.100s)",
                  r->n_missing - n_others,
                  r->first_missing ? r->first_missing : "not listed");
    return split_views(r);
}

/* Leaves out cameras without any picture and sets lens and pose of the
 * others. */
static bool place_cameras(saga_transforms *r, int n)
{
    saga_listing *const l = r->listing;
    int *const kept_as = saga_alloc((size_t)r->n_views, sizeof *kept_as,
                                    r->path, r->error);
    /* Empty cameras are dropped first, because a camera's size comes from one
     * of its pictures. */
    bool ok = kept_as && saga_listing_drop_empty(l, 0, n, kept_as, r->error) &&
              (r->videos || saga_listing_probe_pictures(l, r->error));
    for (int v = 0; ok && v < r->n_views; v++) {
        const saga_entry *const e = &r->entries[r->view_first[v]];
        ok = kept_as[v] < 0 || (fill_lens(r, &l->sources[kept_as[v]], e) &&
                                fill_pose(r, &l->sources[kept_as[v]], e));
    }
    free(kept_as);
    return ok;
}

static bool read_ply(saga_transforms *r)
{
    const char *file = NULL;
    size_t n_dropped = 0;
    if (!saga_transforms_path(r, r->root, -1, "ply_file_path", &file))
        return false;
    if (!file) {
        saga_note(r->listing->notes, "points: none (no ply_file_path)");
        return true;
    }
    char *const path = join(r, file);
    const bool ok = path &&
                    saga_ply_read(path, &r->listing->points,
                                  &r->listing->n_points, &n_dropped, r->error);
    free(path);
    if (ok)
        saga_note(r->listing->notes,
                  "points: %zu of unknown visibility, %zu "
                  "dropped as not finite",
                  r->listing->n_points, n_dropped);
    return ok;
}

static bool read_all(saga_transforms *r, const saga_capture_options *options)
{
    if (!saga_transforms_read_fps(r) || !saga_transforms_find_views(r))
        return false;
    /* The number of moments is the number of pictures in the fullest view, or,
     * for a moving camera, the number of different times. */
    const int n = r->n_moments > 0 ? r->n_moments : r->view_size[r->fullest];
    if (!saga_transforms_find_moments(r, n) || !fill_views(r, n) ||
        !place_cameras(r, n))
        return false;
    if (r->videos && !saga_listing_match_videos(r->listing, options, r->error))
        return false;
    if (r->videos && saga_transforms_n_timed(r) > 0)
        saga_note(r->listing->notes, "time: \"time\" of a video is not read; "
                                     "its frames have time stamps");
    if (r->odd_depths)
        saga_note(r->listing->notes, "depth: only .exr files are read");
    return saga_listing_hold_out(r->listing, options->hold_out, r->error) &&
           read_ply(r);
}

/* ------------------------------------------------------------------ a file */

static bool read_json(saga_transforms *r, int which, const char *path)
{
    r->path = path;
    r->root = r->roots[which] = saga_json_read(path, r->error);
    return r->root && saga_transforms_read_entries(r);
}

bool saga_nerfstudio_list(saga_listing *listing, const char *json_path,
                          const char *test_path,
                          const saga_capture_options *options,
                          saga_error *error)
{
    saga_transforms r = { .listing = listing,
                          .error = error,
                          .folder = saga_path_folder(json_path, error) };
    /* The main file is read last, so that r.root is its top when fps, lists and
     * points are looked up. */
    listing->poses = SAGA_POSES_OPENGL;
    const bool ok = r.folder && (!test_path || read_json(&r, 1, test_path)) &&
                    read_json(&r, 0, json_path) &&
                    saga_transforms_check_kinds(&r) && read_all(&r, options);
    /* The JSON is freed last, because the entries' names are strings inside
     * it. */
    json_decref(r.roots[0]);
    json_decref(r.roots[1]);
    free(r.folder);
    free(r.entries);
    free(r.view_size);
    free(r.view_first);
    free(r.at);
    return ok;
}

/* Tells whether a path is itself a JSON file. */
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
    const bool ok = json &&
                    saga_nerfstudio_list(listing, json, NULL, options, error);
    free(json);
    return ok;
}

const saga_loader saga_nerfstudio_loader = {
    "nerfstudio", "transforms.json",
    "transforms.json with pictures, or a video for each camera", is_there, list
};
