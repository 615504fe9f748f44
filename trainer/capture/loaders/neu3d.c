/* SPDX-License-Identifier: MIT
 *
 * Reads Neu3D / DyNeRF captures: camNN.mp4 and poses_bounds.npy, with one row
 * per video in the order of the sorted names. A COLMAP sparse model gives the
 * points. It also gives the cameras if poses_bounds.npy is missing or has
 * another world frame.
 *
 * A row has a 3 x 5 matrix, row-major, with the columns down, right, backwards,
 * centre and (H, W, f) of the camera; then the near and the far depth. H, W and
 * f are in pixels of the original pictures, so f is scaled by the width of the
 * video. Pixels are square, and the principal point is the picture's centre.
 */
#include "colmap_views.h"

#include "alloc.h"
#include "error.h"
#include "file.h"
#include "load.h"
#include "notes.h"
#include "npy.h"
#include "pose.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* ------------------------------------------------------------ the videos */

static bool is_camera_video(const char *name)
{
    return strncmp(name, "cam", 3) == 0 && saga_has_suffix(name, ".mp4");
}

static bool is_there(const char *folder, saga_error *error)
{
    saga_names names;
    const bool found =
        saga_folder_list(&names, folder, is_camera_video, error) && names.n > 0;
    saga_names_free(&names);
    return found;
}

static bool add_video(saga_listing *listing, const char *folder,
                      const char *name, saga_error *error)
{
    if (listing->n_sources == SAGA_MAX_VIEWS)
        return saga_fail(error, folder, "split the capture",
                         "has more than %d videos", SAGA_MAX_VIEWS);
    saga_source *const more = saga_realloc(listing->sources,
                                           (size_t)listing->n_sources + 1,
                                           sizeof *more, folder, error);
    if (!more)
        return false;
    listing->sources = more;
    saga_source *const source = &more[listing->n_sources++];
    *source = (saga_source){ .video = saga_path_join(folder, name, error) };
    saga_copy_name(source->name, name, strlen(name) - strlen(".mp4"));
    source->held_out = strcmp(source->name, "cam00") == 0;
    return source->video != NULL;
}

static bool list_videos(saga_listing *listing, const char *folder,
                        saga_error *error)
{
    saga_names names;
    bool ok = saga_folder_list(&names, folder, is_camera_video, error);
    for (size_t i = 0; ok && i < names.n; i++)
        ok = add_video(listing, folder, names.at[i], error);
    saga_names_free(&names);
    for (int i = 0; ok && i < listing->n_sources; i++)
        ok = saga_probe_video(&listing->sources[i], error);
    /* A single camera is needed for training, so that it is not held out. */
    if (listing->n_sources == 1)
        listing->sources[0].held_out = false;
    return ok;
}

/* ------------------------------------------------------- poses_bounds.npy */

static bool row_intrinsics(saga_source *source, double h, double w, double f,
                           const char *path, saga_error *error)
{
    if (!(h >= 1.0 && w >= 1.0 && f > 0.0 && h < 1e6 && w < 1e6))
        return saga_fail(error, path, "correct columns 5, 10 and 15",
                         "row of %s has height %g, width %g, focal length %g",
                         source->name, h, w, f);
    if (!saga_source_fit(source, w, h))
        return saga_fail(
            error, path,
            saga_source_fit_remedy(source, w, h,
                                   "scale the videos alike on both "
                                   "axes, do not crop them"),
            "row of %s is for %g x %g pixels, the video has "
            "%d x %d",
            source->name, w, h, source->width, source->height);
    /* The file has one focal length, for the width; the principal point is the
     * picture's middle. */
    const double focal = f * (source->width / w);
    source->lens = (saga_lens){ .fx = focal,
                                .fy = focal,
                                .cx = source->width / 2.0,
                                .cy = source->height / 2.0 };
    return true;
}

static bool row_camera(saga_source *source, const double *row, const char *path,
                       saga_error *error)
{
    double axis[3][3], centre[3];
    for (int i = 0; i < 3; i++) {
        axis[0][i] = row[5 * i + 1];  /* right */
        axis[1][i] = row[5 * i];      /* down */
        axis[2][i] = -row[5 * i + 2]; /* forward */
        centre[i] = row[5 * i + 3];
    }
    if (!saga_pose_from_axes(axis[0], axis[1], axis[2], centre,
                             source->rotation, source->translation))
        return saga_fail(error, path,
                         "export the poses again, columns down, "
                         "right, backwards",
                         "row of %s is not finite or not "
                         "a rotation (first column %g %g %g)",
                         source->name, row[0], row[5], row[10]);
    const double near = row[15], far = row[16];
    if (isfinite(near) && isfinite(far) && near > 0.0 && far > near) {
        source->near_depth = near;
        source->far_depth = far;
    }
    return row_intrinsics(source, row[4], row[9], row[14], path, error);
}

static bool read_poses(saga_listing *listing, const char *path,
                       saga_error *error)
{
    saga_npy npy;
    if (!saga_npy_read(&npy, path, error))
        return false;
    bool ok = true;
    if (npy.cols != 17)
        ok = saga_fail(error, path, "save N rows of 17 numbers",
                       "has %zu columns", npy.cols);
    else if (npy.rows != (size_t)listing->n_sources)
        ok = saga_fail(error, path,
                       "remove or add videos so that there is "
                       "one per row, in sorted order",
                       "has %zu rows but there are %d videos cam*.mp4",
                       npy.rows, listing->n_sources);
    for (int i = 0; ok && i < listing->n_sources; i++)
        ok = row_camera(&listing->sources[i], npy.data + 17 * i, path, error);
    saga_npy_free(&npy);
    return ok;
}

/* ---------------------------------------------------------- COLMAP's model */

/* Tells whether a camera's name fits an image: "cam01" fits "cam01.png",
 * "x/cam01.jpg" and "cam01/0000.png". */
static bool names_image(const char *name, const char *image)
{
    const size_t n = strlen(name);
    for (const char *p = image; p;) {
        /* The name may be any folder of the path, or the file's name without
         * its extension. */
        if (strncmp(p, name, n) == 0 && (p[n] == '\0' || p[n] == '/' ||
                                         (p[n] == '.' && !strchr(p + n, '/'))))
            return true;
        p = strchr(p, '/');
        p = p ? p + 1 : NULL;
    }
    return false;
}

/* Sets image_of to the first image of each view, or to -1 if it has none. */
static void match_images(const saga_listing *listing, const saga_colmap *model,
                         int *image_of)
{
    for (int i = 0; i < listing->n_sources; i++) {
        image_of[i] = -1;
        for (size_t k = 0; k < model->n_images && image_of[i] < 0; k++)
            if (names_image(listing->sources[i].name, model->images[k].name))
                image_of[i] = (int)k;
    }
}

/* Returns the largest distance between the two centres of a camera, as a
 * fraction of the rig's size. If the world frames differ, it is about one. */
static double disagreement(const saga_listing *listing,
                           const saga_colmap *model, const int *image_of)
{
    double size = 0.0, worst = 0.0, first[3] = { 0 };
    for (int i = 0; i < listing->n_sources; i++) {
        const saga_source *const s = &listing->sources[i];
        double a[3], b[3], d2 = 0.0, r2 = 0.0;
        /* The rig's size is the largest distance from the first camera. */
        saga_pose_centre(s->rotation, s->translation, a);
        if (i == 0)
            memcpy(first, a, sizeof first);
        for (int k = 0; k < 3; k++)
            r2 += (a[k] - first[k]) * (a[k] - first[k]);
        size = fmax(size, sqrt(r2));
        if (image_of[i] < 0)
            continue;
        const saga_colmap_image *const m = &model->images[image_of[i]];
        /* The distance between this camera's two centres counts. */
        saga_pose_centre(m->rotation, m->translation, b);
        for (int k = 0; k < 3; k++)
            d2 += (a[k] - b[k]) * (a[k] - b[k]);
        worst = fmax(worst, sqrt(d2));
    }
    return worst / fmax(size, 1e-9);
}

static bool all_matched(const saga_listing *listing, const int *image_of,
                        const char **missing)
{
    for (int i = 0; i < listing->n_sources; i++)
        if (image_of[i] < 0) {
            *missing = listing->sources[i].name;
            return false;
        }
    return true;
}

static bool adopt_cameras(saga_listing *listing, const saga_colmap *model,
                          const int *image_of, const char *folder,
                          saga_error *error)
{
    listing->poses = SAGA_POSES_TO_CAMERA;
    for (int i = 0; i < listing->n_sources; i++)
        if (!saga_colmap_adopt(&listing->sources[i], model,
                               &model->images[image_of[i]], folder, error))
            return false;
    return true;
}

static int view_of_image(const saga_listing *listing, const char *image)
{
    for (int i = 0; i < listing->n_sources; i++)
        if (names_image(listing->sources[i].name, image))
            return i;
    return -1;
}

/* Returns the number of each image's view (n_images), -1 for none. The caller
 * frees the list. */
static int *map_images(const saga_listing *listing, const saga_colmap *model,
                       saga_error *error)
{
    int *const view = saga_alloc(model->n_images, sizeof *view, listing->path,
                                 error);
    for (size_t k = 0; view && k < model->n_images; k++)
        view[k] = view_of_image(listing, model->images[k].name);
    return view;
}

static bool measure_views(saga_listing *listing, const saga_colmap *model,
                          const int *image_of, saga_error *error)
{
    for (int i = 0; i < listing->n_sources; i++)
        if (image_of[i] >= 0 &&
            !saga_colmap_measure(&listing->sources[i], model,
                                 &model->images[image_of[i]], error))
            return false;
    return true;
}

/* World frames are the same if poses agree within 0.1 % of the rig's size.
 * COLMAP then used these poses or refined them by a negligible amount. */
static const double same_frame = 1e-3;

static bool use_model(saga_listing *listing, const saga_colmap *model,
                      const char *folder, bool have_poses, int *image_of,
                      saga_error *error)
{
    const char *missing = "";
    match_images(listing, model, image_of);
    const bool complete = all_matched(listing, image_of, &missing);
    const double off = have_poses ? disagreement(listing, model, image_of)
                                  : 0.0;
    /* If there are no other poses, the model must have all cameras. If the
     * poses have another world frame, cameras and points both come from the
     * model, or neither does. */
    if (!complete && !have_poses)
        return saga_fail(error, folder,
                         "add poses_bounds.npy or reconstruct "
                         "with all cameras",
                         "no image of the COLMAP model "
                         "belongs to %s",
                         missing);
    if (!complete && off > same_frame) {
        saga_note(listing->notes,
                  "points: none; COLMAP's model has another "
                  "world frame than poses_bounds.npy and lacks %s",
                  missing);
        return true;
    }
    if (!have_poses || off > same_frame) {
        if (!adopt_cameras(listing, model, image_of, folder, error))
            return false;
        if (have_poses)
            saga_note(listing->notes,
                      "cameras: from COLMAP's model, since "
                      "poses_bounds.npy has another world frame (centres "
                      "differ by %.3g rig diameters)",
                      off);
        else
            saga_note(listing->notes, "cameras: from COLMAP's model");
    }
    int *const view = map_images(listing, model, error);
    const bool ok = view &&
                    saga_colmap_take_points(listing, model, view, error);
    free(view);
    return ok && measure_views(listing, model, image_of, error);
}

static bool read_model(saga_listing *listing, const char *folder,
                       bool have_poses, saga_error *error)
{
    saga_colmap model;
    if (!saga_colmap_read(&model, folder, error))
        return false;
    int *const image_of = saga_alloc((size_t)listing->n_sources,
                                     sizeof *image_of, folder, error);
    const bool ok = image_of && use_model(listing, &model, folder, have_poses,
                                          image_of, error);
    free(image_of);
    saga_colmap_free(&model);
    return ok;
}

/* ------------------------------------------------------------------- depth */

/* Finds a source's files depth/NAME_fKKK.exr, as far as they exist. */
static bool find_depths_of(saga_source *s, const saga_listing *listing,
                           const char *folder, saga_error *error)
{
    for (int k = 0; k < listing->n_frames; k++) {
        char name[SAGA_NAME_NBYTES + 32];
        (void)snprintf(name, sizeof name, "depth/%s_f%03d.exr", s->name, k);
        if (!saga_folder_has(folder, name))
            continue;
        if (!s->depths)
            s->depths = saga_calloc((size_t)listing->n_frames,
                                    sizeof *s->depths, folder, error);
        if (!s->depths)
            return false;
        s->depths[k] = saga_path_join(folder, name, error);
        if (!s->depths[k])
            return false;
    }
    return true;
}

static bool find_depths(saga_listing *listing, const char *folder,
                        saga_error *error)
{
    for (int i = 0; i < listing->n_sources; i++)
        if (!find_depths_of(&listing->sources[i], listing, folder, error))
            return false;
    return true;
}

static bool list(saga_listing *listing, const char *folder,
                 const saga_capture_options *options, saga_error *error)
{
    if (!list_videos(listing, folder, error))
        return false;
    /* Views are held out before points are read, because only points that
     * training views see are kept. */
    if (!saga_listing_check_names(listing, folder, error) ||
        !saga_listing_match_videos(listing, options, error) ||
        !saga_listing_hold_out(listing, options->hold_out, error))
        return false;
    char *const poses = saga_path_join(folder, "poses_bounds.npy", error);
    char *model = NULL;
    bool ok = poses && saga_colmap_find(&model, folder, error);
    const bool have_poses = ok && saga_path_is_file(poses);
    if (ok && !have_poses && !model)
        ok = saga_fail(error, folder,
                       "add one of them; docs/from-cameras.md "
                       "explains how to calibrate cameras",
                       "has %d videos but no calibration: no "
                       "poses_bounds.npy, COLMAP model in colmap/ or sparse/0, "
                       "camera_array.toml or calibration.toml",
                       listing->n_sources);
    ok = ok && (!have_poses || read_poses(listing, poses, error));
    if (ok && model)
        ok = read_model(listing, model, have_poses, error);
    else if (ok)
        saga_note(listing->notes, "points: none (no COLMAP model in colmap/ or "
                                  "sparse/0)");
    ok = ok && (!options->want_depth || find_depths(listing, folder, error));
    free(poses);
    free(model);
    return ok;
}

const saga_loader saga_neu3d_loader = {
    "Neu3D", "camNN.mp4", "camNN.mp4 and poses_bounds.npy, or a COLMAP model",
    is_there, list
};
