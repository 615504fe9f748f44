/* SPDX-License-Identifier: MIT */
#include "check_fix.h"

#include "file.h"
#include "json_memory.h"
#include "output.h"
#include "pose.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

/* The keys that describe a lens. They stand in an entry or, if all cameras
 * share the lens, at the top of the file. */
static const char *const lens_keys[] = {
    "fl_x", "fl_y",           "cx",          "cy", "k1", "k2", "k3", "k4", "p1",
    "p2",   "camera_angle_x", "camera_model"
};
enum {
    N_FOCAL = 2,
    N_CENTRE = 4
}; /* numbers of keys that m->focal
    * multiplies: focal lengths alone; with
    * the centre */

/* --- Cameras ------------------------------------------------------------- */

/* Reads the pose of an entry as the loader does. Returns false if it has
 * none. */
static bool pose_of(const json_t *entry, double rotation[9],
                    double translation[3])
{
    const json_t *const m = json_object_get(entry, "transform_matrix");
    double rows[12];

    for (size_t i = 0; i < 12; i++)
        rows[i] = json_number_value(
            json_array_get(json_array_get(m, i / 4), i % 4));
    return saga_pose_from_opengl(rows, rotation, translation);
}

/* Returns the view that has an entry's pose, or -1 if the entry has no
 * pictures. */
static int view_of(const json_t *entry, const saga_capture *c)
{
    double rotation[9], translation[3];

    if (!pose_of(entry, rotation, translation))
        return -1;
    for (int v = 0; v < c->n_views; v++)
        if (memcmp(c->views[v].rotation, rotation, sizeof rotation) == 0 &&
            memcmp(c->views[v].translation, translation, sizeof translation) ==
                0)
            return v;
    return -1;
}

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

/* --- The mistake undone -------------------------------------------------- */

/* Multiplies the lengths in pixels that an object, which is an entry or the top
 * of the file, has. */
static void scale_lens(json_t *object, const saga_mistake *m)
{
    const int n = m->centre ? N_CENTRE : N_FOCAL;
    const json_t *const angle = json_object_get(object, "camera_angle_x");

    for (int i = 0; i < n; i++) {
        const json_t *const x = json_object_get(object, lens_keys[i]);

        if (x)
            saga_json_set_value(object, lens_keys[i],
                                json_real(m->focal * json_number_value(x)));
    }
    /* The picture's width is 2 f tan(angle / 2). */
    if (angle)
        saga_json_set_value(
            object, "camera_angle_x",
            json_real(2 * atan(tan(json_number_value(angle) / 2) / m->focal)));
}

/* Corrects the pose and the lens of every entry. */
static void turn_entries(json_t *frames, const saga_mistake *m)
{
    for (size_t i = 0; i < json_array_size(frames); i++) {
        json_t *const entry = json_array_get(frames, i);
        double r[9], t[3], lens[4] = { 0 };

        scale_lens(entry, m);
        if (!pose_of(entry, r, t))
            continue;
        saga_mistake_undo(m, r, t, lens);
        saga_json_set_value(entry, "transform_matrix", matrix_of(r, t));
    }
}

/* Gives the entries of two views each other's pose and lens. */
static void exchange(json_t *frames, const saga_mistake *m,
                     const saga_capture *c)
{
    json_t *const before = json_deep_copy(frames);
    const json_t *first[2] = { NULL, NULL };

    /* The first entry of each of the two views has the pose that the other
     * view's entries receive. */
    for (size_t i = 0; i < json_array_size(before); i++)
        for (int k = 0; k < 2; k++)
            if (!first[k] &&
                view_of(json_array_get(before, i), c) == m->swapped[k])
                first[k] = json_array_get(before, i);
    for (size_t i = 0; i < json_array_size(before); i++) {
        json_t *const entry = json_array_get(frames, i);
        const int v = view_of(entry, c);
        const json_t *const other = v == m->swapped[0]   ? first[1]
                                    : v == m->swapped[1] ? first[0]
                                                         : NULL;

        if (v < 0 || !other)
            continue;
        saga_json_set_value(
            entry, "transform_matrix",
            json_deep_copy(json_object_get(other, "transform_matrix")));
        /* If the lens stands at the top of the file, the entries have none of
         * these keys. */
        for (size_t k = 0; k < sizeof lens_keys / sizeof *lens_keys; k++) {
            json_t *const x = json_object_get(other, lens_keys[k]);

            (void)json_object_del(entry, lens_keys[k]);
            if (x)
                saga_json_set_value(entry, lens_keys[k], json_deep_copy(x));
        }
    }
    json_decref(before);
}

/* --- Cameras refined ----------------------------------------------------- */

/* Returns a length in pixels that an entry or the top of the file has, or else
 * `missing`. */
static double length_of(const json_t *entry, const json_t *root,
                        const char *key, double missing)
{
    const json_t *x = json_object_get(entry, key);

    x = x ? x : json_object_get(root, key);
    return x ? json_number_value(x) : missing;
}

/* Writes the lens of a refined camera into an entry. The pinhole of the loaded
 * pictures has the lens' centre; both focal lengths change alike. */
static void refine_lens(json_t *entry, const json_t *root,
                        const saga_source_view *view,
                        const saga_pinhole *refined)
{
    const double width = view->original_width, height = view->original_height;
    const double was[4] = { view->fx, view->fy, view->cx, view->cy };
    const json_t *const own = json_object_get(entry, "camera_angle_x");
    const double angle = json_number_value(
        own ? own : json_object_get(root, "camera_angle_x"));
    double lens[N_CENTRE];

    lens[0] = length_of(entry, root, "fl_x", width / 2 / tan(angle / 2));
    lens[1] = length_of(entry, root, "fl_y", lens[0]);
    lens[2] = length_of(entry, root, "cx", width / 2);
    lens[3] = length_of(entry, root, "cy", height / 2);
    for (int k = 0; k < 2; k++) {
        lens[2 + k] += (refined->lens[2 + k] - was[2 + k]) * lens[k] / was[k];
        lens[k] *= refined->lens[k] / was[k];
    }
    for (int k = 0; k < N_CENTRE; k++)
        saga_json_set_value(entry, lens_keys[k], json_real(lens[k]));
}

static void refine_entries(json_t *root, const saga_refinement *r,
                           const saga_capture *c)
{
    json_t *const frames = json_object_get(root, "frames");

    for (size_t i = 0; i < json_array_size(frames); i++) {
        json_t *const entry = json_array_get(frames, i);
        const int v = view_of(entry, c);

        if (v < 0)
            continue;
        refine_lens(entry, root, &c->views[v], &r->cameras[v]);
        saga_json_set_value(
            entry, "transform_matrix",
            matrix_of(r->cameras[v].rotation, r->cameras[v].translation));
    }
}

/* --- Files --------------------------------------------------------------- */

/* Returns the folder part of a path, with the slash at its end, or "./". The
 * caller frees it. */
static char *folder_of(const char *path, saga_error *error)
{
    const char *const slash = strrchr(path, '/');
    char *const folder = saga_string_copy(slash ? path : "./", error);

    if (folder && slash)
        folder[slash - path + 1] = '\0';
    return folder;
}

/* Tells whether two paths lead to the same file or folder. */
static bool is_same(const char *a, const char *b)
{
    struct stat x, y;

    return stat(a, &x) == 0 && stat(b, &y) == 0 && x.st_dev == y.st_dev &&
           x.st_ino == y.st_ino;
}

/* Checks that the new file is in the folder of the old one, because the paths
 * of pictures in it are relative to that folder. */
static bool check_place(const char *path, const char *json, saga_error *error)
{
    char *const folder = folder_of(json, error);
    char *const there = folder_of(path, error);
    bool ok = folder && there;

    if (ok) {
        ok = is_same(folder, there) && !is_same(path, json);
        if (!ok)
            saga_fail(error, path, NULL,
                      "the paths of the pictures are "
                      "relative to the capture's folder, so that the file "
                      "must lie there under a new name; give --fix %s%s",
                      folder, "transforms-fixed.json");
    }
    free(folder);
    free(there);
    return ok;
}

static bool write_json(const char *path, const json_t *root, saga_error *error)
{
    saga_output out;
    bool ok;

    if (!saga_output_open(&out, path, error))
        return false;
    ok = json_dumpf(root, out.file, JSON_INDENT(1) | JSON_REAL_PRECISION(17)) ==
             0 ||
         saga_fail_errno(error, path, NULL, "cannot be written");
    return saga_output_close(&out, ok, error);
}

bool saga_check_fix(const char *path, const char *name,
                    const saga_survey *survey, const saga_capture *capture,
                    saga_error *error)
{
    const saga_calibration *const fit = &survey->calibration;
    const saga_mistake *const m = &fit->mistake;
    char *const json = saga_path_is_folder(name)
                           ? saga_path_join(name, "transforms.json", error)
                           : saga_string_copy(name, error);
    json_t *root = NULL;
    bool ok = json &&
              (saga_path_is_file(json) ||
               saga_fail(error, name,
                         "correct the cameras in the "
                         "program that made them",
                         "--fix works only for captures "
                         "with a transforms.json")) &&
              check_place(path, json, error);

    /* If there is nothing to correct, nothing is read or written. */
    if (ok && !fit->found && !fit->refinement.helps) {
        fputs("check: nothing was found that --fix could correct\n", stderr);
    } else if (ok) {
        root = saga_json_read(json, error);
        ok = root != NULL;
    }
    if (root) {
        json_t *const frames = json_object_get(root, "frames");

        /* The lens that all cameras share, then the lens and the pose of each
         * entry. */
        saga_json_watch();
        if (fit->found && m->mirrored &&
            json_object_del(root, "ply_file_path") == 0)
            fputs("check: the points are left out, because they lie in the "
                  "mirrored world\n",
                  stderr);
        if (!fit->found) {
            refine_entries(root, &fit->refinement, capture);
        } else {
            scale_lens(root, m);
            if (m->swapped[0] >= 0)
                exchange(frames, m, capture);
            else
                turn_entries(frames, m);
        }
        ok = !saga_json_starved() && !saga_json_lost()
                 ? write_json(path, root, error)
                 : saga_no_memory(0, path, error);
    }
    json_decref(root);
    free(json);
    return ok;
}
