/* SPDX-License-Identifier: MIT */
#include "check_fix.h"

#include "alloc.h"
#include "file.h"
#include "json_memory.h"
#include "load.h"
#include "output.h"
#include "ply.h"
#include "pose.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

typedef struct writer {
    const saga_listing *listing;
    const saga_capture *capture; /* loaded from the listing */
    const saga_calibration *fit;
    const char *folder; /* paths are relative to it */
    saga_error *error;
} writer;

/* --- Cameras ------------------------------------------------------------- */

typedef struct camera {
    saga_lens lens;
    double rotation[9], translation[3]; /* world to camera */
} camera;

/* Multiplies or shifts the lens of the file as refinement did with that of the
 * loaded pictures, which may be smaller, and undistorted. */
static void refine_lens(saga_lens *lens, const saga_source_view *view,
                        const saga_pinhole *refined)
{
    const double was[4] = { view->fx, view->fy, view->cx, view->cy };
    double *const own[4] = { &lens->fx, &lens->fy, &lens->cx, &lens->cy };
    for (int k = 0; k < 2; k++) {
        *own[2 + k] += (refined->lens[2 + k] - was[2 + k]) * *own[k] / was[k];
        *own[k] *= refined->lens[k] / was[k];
    }
}

/* Returns the camera that took the pictures of a source. */
static camera corrected(const writer *w, int v)
{
    const saga_mistake *const m = &w->fit->mistake;
    const int from = !w->fit->found       ? v
                     : v == m->swapped[0] ? m->swapped[1]
                     : v == m->swapped[1] ? m->swapped[0]
                                          : v;
    /* A mistake of all cameras is undone; otherwise each was refined. */
    const saga_source *const s = &w->listing->sources[from];
    camera c = { .lens = s->lens };
    memcpy(c.rotation, s->rotation, sizeof c.rotation);
    memcpy(c.translation, s->translation, sizeof c.translation);
    if (w->fit->found) {
        double lens[4] = { s->lens.fx, s->lens.fy, s->lens.cx, s->lens.cy };
        saga_mistake_undo(m, c.rotation, c.translation, lens);
        c.lens.fx = lens[0];
        c.lens.fy = lens[1];
        c.lens.cx = lens[2];
        c.lens.cy = lens[3];
    } else {
        const saga_pinhole *const refined = &w->fit->refinement.cameras[v];
        memcpy(c.rotation, refined->rotation, sizeof c.rotation);
        memcpy(c.translation, refined->translation, sizeof c.translation);
        refine_lens(&c.lens, &w->capture->views[v], refined);
    }
    return c;
}

/* Returns camera to world, in OpenGL's axes. */
static json_t *matrix_of(const double rotation[9], const double translation[3])
{
    json_t *const m = json_array();
    double centre[3];

    saga_pose_centre(rotation, translation, centre);
    for (int i = 0; i < 4; i++) {
        json_t *const row = json_array();

        for (int k = 0; k < 4; k++) {
            const double sign = k == 1 || k == 2 ? -1 : 1;
            const double x = i == 3   ? (k == 3)
                             : k == 3 ? centre[i]
                                      : sign * rotation[3 * k + i];

            saga_json_append_item(row, json_real(x));
        }
        saga_json_append_item(m, row);
    }
    return m;
}

/* --- Entries ------------------------------------------------------------- */

/* Returns the path of a file as the new file names it. */
static json_t *path_of(const writer *w, const char *path)
{
    const size_t n = strlen(w->folder);
    if (strncmp(path, w->folder, n) == 0 && path[n] == '/')
        path += n + strspn(path + n, "/");
    return json_string(path);
}

/* Puts the lens into an entry; what is 0 is left out. */
static void put_lens(json_t *entry, const saga_source *s, const saga_lens *lens)
{
    const struct {
        const char *key;
        double value;
    } numbers[] = {
        { "w", s->width },    { "h", s->height }, { "fl_x", lens->fx },
        { "fl_y", lens->fy }, { "cx", lens->cx }, { "cy", lens->cy },
        { "k1", lens->k1 },   { "k2", lens->k2 }, { "k3", lens->k3 },
        { "k4", lens->k4 },   { "p1", lens->p1 }, { "p2", lens->p2 },
    };
    for (size_t i = 0; i < sizeof numbers / sizeof numbers[0]; i++)
        if (numbers[i].value != 0.0)
            saga_json_set_value(entry, numbers[i].key,
                                json_real(numbers[i].value));
    if (lens->fisheye)
        saga_json_set_value(entry, "camera_model",
                            json_string("OPENCV_FISHEYE"));
}

/* Returns the time of a moment: in seconds, or, if the frame rate is unknown,
 * as a part of the whole capture. */
static double time_of(const writer *w, const saga_source *s, int moment)
{
    const saga_listing *const l = w->listing;
    const double frames = moment + (l->moves ? s->late : 0.0);
    return l->fps > 0.0      ? frames / l->fps
           : l->n_frames > 1 ? frames / (l->n_frames - 1)
                             : 0.0;
}

/* Returns the entry of a source's video, or of its picture at a moment. */
static json_t *entry_of(const writer *w, const saga_source *s, int moment,
                        const camera *c)
{
    json_t *const entry = json_object();
    const char *const depth = s->depths ? s->depths[moment] : NULL;
    const char *const mask = s->masks ? s->masks[moment] : NULL;
    saga_json_set_value(entry, "file_path",
                        path_of(w, s->video ? s->video : s->pictures[moment]));
    if (!s->video)
        saga_json_set_value(entry, "time", json_real(time_of(w, s, moment)));
    if (depth)
        saga_json_set_value(entry, "depth_file_path", path_of(w, depth));
    if (mask)
        saga_json_set_value(entry, "mask_path", path_of(w, mask));
    put_lens(entry, s, &c->lens);
    saga_json_set_value(entry, "transform_matrix",
                        matrix_of(c->rotation, c->translation));
    return entry;
}

/* Adds the entries of a source to the list, and their paths to that of the
 * pictures held out, if the source is. */
static void put_source(json_t *frames, json_t *held_out, const writer *w, int v)
{
    const saga_source *const s = &w->listing->sources[v];
    const camera c = corrected(w, v);
    for (int k = 0; k < (s->video ? 1 : w->listing->n_frames); k++) {
        if (!s->video && !s->pictures[k])
            continue;
        json_t *const entry = entry_of(w, s, k, &c);
        if (s->held_out)
            saga_json_append_item(
                held_out, json_incref(json_object_get(entry, "file_path")));
        saga_json_append_item(frames, entry);
    }
}

/* Returns the whole file. `points` is the name of the file with the points;
 * NULL: there are none. */
static json_t *root_of(const writer *w, const char *points)
{
    json_t *const root = json_object();
    json_t *const frames = json_array(), *const held_out = json_array();
    if (w->listing->fps > 0.0)
        saga_json_set_value(root, "fps", json_real(w->listing->fps));
    if (points)
        saga_json_set_value(root, "ply_file_path", json_string(points));
    for (int v = 0; v < w->listing->n_sources; v++)
        put_source(frames, held_out, w, v);
    if (json_array_size(held_out) > 0)
        saga_json_set_value(root, "val_filenames", json_incref(held_out));
    json_decref(held_out);
    saga_json_set_value(root, "frames", frames);
    return root;
}

/* --- Files --------------------------------------------------------------- */

/* Tells whether two paths lead to the same file or folder. */
static bool is_same(const char *a, const char *b)
{
    struct stat x, y;
    return stat(a, &x) == 0 && stat(b, &y) == 0 && x.st_dev == y.st_dev &&
           x.st_ino == y.st_ino;
}

/* Checks that the new file is in the capture's folder, because the paths of
 * pictures in it are relative to that folder, and a JSON file of its own. */
static bool check_place(const char *path, const char *name, const char *folder,
                        saga_error *error)
{
    char *const there = saga_path_folder(path, error);
    char *const own = saga_path_join(folder, "transforms.json", error);
    const bool ok = there && own &&
                    ((is_same(folder, there) && !is_same(path, own) &&
                      !is_same(path, name) && saga_has_suffix(path, ".json")) ||
                     saga_fail(error, path, NULL,
                               "the paths of the pictures are relative to the "
                               "capture's folder, so that the file must lie "
                               "there under a new name; give --fix "
                               "%s/transforms-fixed.json",
                               folder));
    free(there);
    free(own);
    return ok;
}

/* Tells whether what was built since saga_json_watch is whole. */
static bool check_built(const char *path, saga_error *error)
{
    if (saga_json_starved())
        return saga_no_memory(0, path, error);
    return !saga_json_lost() ||
           saga_fail(error, path, "give the capture's files names in UTF-8",
                     "JSON cannot hold a name of them");
}

static bool write_json(const char *path, const json_t *root, saga_error *error)
{
    saga_output out;
    if (!saga_output_open(&out, path, error))
        return false;
    const bool ok = json_dumpf(root, out.file,
                               JSON_INDENT(1) | JSON_REAL_PRECISION(17)) == 0 ||
                    saga_fail_errno(error, path, NULL, "cannot be written");
    return saga_output_close(&out, ok, error);
}

/* Writes the points beside the new file: "x.json.ply" beside "x.json", a name
 * that no file of a capture has. */
static bool write_all(const writer *w, const char *path)
{
    const saga_listing *const l = w->listing;
    const bool mirrored = w->fit->found && w->fit->mistake.mirrored;
    const size_t nbytes = strlen(path) + sizeof ".ply";
    char *const points = saga_alloc(nbytes, 1, path, w->error);
    if (!points)
        return false;
    (void)snprintf(points, nbytes, "%s.ply", path);
    const char *const name = saga_path_base(points);
    const bool any = l->n_points > 0 && !mirrored;
    if (l->n_points > 0 && mirrored)
        fputs("check: the points are left out, because they lie in the "
              "mirrored world\n",
              stderr);
    saga_json_watch();
    json_t *const root = root_of(w, any ? name : NULL);
    const bool ok = check_built(path, w->error) &&
                    (!any || saga_ply_write(points, l->points, l->n_points,
                                            w->error)) &&
                    write_json(path, root, w->error);
    json_decref(root);
    free(points);
    return ok;
}

/* Checks that a JSON file can describe the listing. */
static bool check_kind(const saga_listing *l, saga_error *error)
{
    bool ok = true;
    for (int v = 0; v < l->n_sources; v++)
        ok = ok && !l->sources[v].lens.equirect && !l->sources[v].info.raw;
    return ok || saga_fail(error, l->path,
                           "correct the cameras in the program that made them",
                           "--fix cannot describe %s in a transforms.json",
                           l->format);
}

bool saga_check_fix(const char *path, const char *name,
                    const saga_capture_options *options,
                    const saga_survey *survey, const saga_capture *capture,
                    saga_error *error)
{
    saga_listing listing = { .path = name };
    char *const folder = saga_path_is_folder(name)
                             ? saga_string_copy(name, error)
                             : saga_path_folder(name, error);
    const writer w = { &listing, capture, &survey->calibration, folder, error };
    bool ok = folder && check_place(path, name, folder, error);
    /* If there is nothing to correct, nothing is read or written. */
    if (ok && !w.fit->found && !w.fit->refinement.helps)
        fputs("check: nothing was found that --fix could correct\n", stderr);
    else
        ok = ok && saga_listing_make(&listing, name, options, error) &&
             check_kind(&listing, error) && write_all(&w, path);
    saga_listing_free(&listing);
    free(folder);
    return ok;
}
