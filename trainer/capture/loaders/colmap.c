/* SPDX-License-Identifier: MIT */
#include "colmap_job.h"

#include "error.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* ------------------------------------------------------------------ binary */

static bool cut_short(const saga_colmap_job *job, const char *what,
                      size_t index)
{
    return saga_fail(job->error, job->file, "copy or export the model again",
                     "is cut short or damaged at %s %zu", what, index);
}

/* Reads a count. A count is refused if that number of items, of `least` bytes
 * each, cannot fit into the rest of the file. */
static bool take_count(const saga_colmap_job *job, saga_cursor *c, size_t least,
                       const char *what, uint64_t *count)
{
    *count = saga_take_le(c, 8);
    if (!c->failed && *count <= saga_left(c) / least)
        return true;
    return saga_fail(job->error, job->file, "copy or export the model again",
                     "announces %llu %s but has only %zu bytes left",
                     (unsigned long long)*count, what, saga_left(c));
}

static bool binary_cameras(const saga_colmap_job *job, saga_cursor *c)
{
    uint64_t n;
    /* A camera has an id, a model, width and height, and at least three
     * parameters. */
    if (!take_count(job, c, 4 + 4 + 16 + 24, "cameras", &n))
        return false;
    for (uint64_t i = 0; i < n; i++) {
        const uint32_t id = (uint32_t)saga_take_le(c, 4);
        const uint32_t model = (uint32_t)saga_take_le(c, 4);
        const double width = (double)saga_take_le(c, 8);
        const double height = (double)saga_take_le(c, 8);
        double params[SAGA_COLMAP_MAX_PARAMS] = { 0 };
        if (!c->failed && model >= SAGA_COLMAP_N_LENSES) {
            char text[24];
            (void)snprintf(text, sizeof text, "number %u", (unsigned)model);
            return saga_colmap_lens_unknown(job, text);
        }
        for (int p = 0; !c->failed && p < saga_colmap_lenses[model].n_params;
             p++)
            params[p] = saga_take_f64(c);
        if (c->failed)
            return cut_short(job, "camera", (size_t)i);
        if (!saga_colmap_add_camera(job, id, width, height, (int)model, params))
            return false;
    }
    return true;
}

static bool binary_observations(const saga_colmap_job *job, saga_cursor *c,
                                saga_colmap_image *image)
{
    uint64_t n;
    /* A feature is u, v and the id of a point, which is 2^64 - 1, read as -1,
     * if the feature has no point. */
    if (!take_count(job, c, 24, "features", &n))
        return false;
    for (uint64_t k = 0; k < n; k++) {
        const double u = saga_take_f64(c), v = saga_take_f64(c);
        const int64_t point = (int64_t)saga_take_le(c, 8);
        if (!saga_colmap_add_observation(job, image, u, v, point))
            return false;
    }
    return true;
}

static bool binary_images(const saga_colmap_job *job, saga_cursor *c)
{
    uint64_t n;
    /* An image has an id, a pose of 7 numbers, the camera's id, a name, of
     * which only the NUL is certain, and the number of features. */
    if (!take_count(job, c, 4 + 56 + 4 + 1 + 8, "images", &n))
        return false;
    for (uint64_t i = 0; i < n; i++) {
        const uint32_t id = (uint32_t)saga_take_le(c, 4);
        double pose[7];
        for (int k = 0; k < 7; k++)
            pose[k] = saga_take_f64(c);
        const uint32_t camera = (uint32_t)saga_take_le(c, 4);
        /* The name ends with a NUL. */
        const uint8_t *const end = memchr(c->next, 0, saga_left(c));
        if (c->failed || !end)
            return cut_short(job, "image", (size_t)i);
        const char *const name = (const char *)c->next;
        const size_t name_len = (size_t)(end - c->next);
        (void)saga_take(c, name_len + 1);
        saga_colmap_image *const image = saga_colmap_add_image(
            job, id, pose, camera, name, name_len);
        if (!image || !binary_observations(job, c, image))
            return false;
    }
    return true;
}

static bool binary_points(const saga_colmap_job *job, saga_cursor *c)
{
    uint64_t n;
    /* A point has an id, a position, a colour, an error, and the length of its
     * track. */
    if (!take_count(job, c, 8 + 24 + 3 + 8 + 8, "points", &n))
        return false;
    for (uint64_t i = 0; i < n; i++) {
        const uint64_t id = saga_take_le(c, 8);
        double position[3];
        for (int k = 0; k < 3; k++)
            position[k] = saga_take_f64(c);
        const uint8_t *const rgb = saga_take(c, 3);
        (void)saga_take(c, 8); /* reprojection error */
        uint64_t n_tracks;
        if (c->failed)
            return cut_short(job, "point", (size_t)i);
        saga_colmap_point *const point = saga_colmap_add_point(job, id,
                                                               position, rgb);
        if (!point || !take_count(job, c, 8, "track elements", &n_tracks))
            return false;
        /* A track's element is the id of an image and the index of a feature,
         * which is ignored. */
        for (uint64_t k = 0; k < n_tracks; k++) {
            const uint32_t image = (uint32_t)saga_take_le(c, 4);
            (void)saga_take(c, 4);
            if (!saga_colmap_add_track(job, point, image))
                return false;
        }
    }
    return true;
}

/* ----------------------------------------------------------------- reading */

static int by_image_id(const void *a, const void *b)
{
    const saga_colmap_image *const x = a, *const y = b;
    return (x->id > y->id) - (x->id < y->id);
}

static int by_point_id(const void *a, const void *b)
{
    const saga_colmap_point *const x = a, *const y = b;
    return (x->id > y->id) - (x->id < y->id);
}

typedef bool colmap_parse(const saga_colmap_job *job, saga_cursor *c);

static bool read_part(saga_colmap *model, const char *folder, const char *name,
                      colmap_parse *parse, saga_error *error)
{
    char *const path = saga_path_join(folder, name, error);
    saga_bytes bytes;
    bool ok = path && (saga_has_suffix(name, ".txt")
                           ? saga_read_text(&bytes, path, error)
                           : saga_read_file(&bytes, path, error));
    if (ok) {
        const char *const text = (const char *)bytes.data;
        const saga_colmap_job job = { model, path, text, error };
        saga_cursor c = { bytes.data, bytes.data + bytes.nbytes, false };
        ok = parse(&job, &c);
        saga_bytes_free(&bytes);
    }
    free(path);
    return ok;
}

static bool all_there(const char *folder, const char *ending)
{
    static const char *const stems[] = { "cameras", "images", "points3D" };
    for (int i = 0; i < 3; i++) {
        char name[32];
        (void)snprintf(name, sizeof name, "%s%s", stems[i], ending);
        if (!saga_folder_has(folder, name))
            return false;
    }
    return true;
}

bool saga_colmap_is_there(const char *folder)
{
    return all_there(folder, ".bin") || all_there(folder, ".txt");
}

bool saga_colmap_read_images(saga_colmap *model, const char *folder,
                             bool binary, saga_error *error)
{
    *model = (saga_colmap){ 0 };
    const bool ok = binary ? read_part(model, folder, "cameras.bin",
                                       binary_cameras, error) &&
                                 read_part(model, folder, "images.bin",
                                           binary_images, error)
                           : read_part(model, folder, "cameras.txt",
                                       saga_colmap_text_cameras, error) &&
                                 read_part(model, folder, "images.txt",
                                           saga_colmap_text_images, error);
    if (!ok) {
        saga_colmap_free(model);
        return false;
    }
    /* saga_colmap_image_of searches by bisection. */
    if (model->n_images)
        qsort(model->images, model->n_images, sizeof *model->images,
              by_image_id);
    return true;
}

bool saga_colmap_read(saga_colmap *model, const char *folder, saga_error *error)
{
    const bool binary = all_there(folder, ".bin");
    if (!saga_colmap_read_images(model, folder, binary, error))
        return false;
    const bool ok = binary ? read_part(model, folder, "points3D.bin",
                                       binary_points, error)
                           : read_part(model, folder, "points3D.txt",
                                       saga_colmap_text_points, error);
    if (!ok) {
        saga_colmap_free(model);
        return false;
    }
    if (model->n_points)
        qsort(model->points, model->n_points, sizeof *model->points,
              by_point_id);
    return true;
}

void saga_colmap_free(saga_colmap *model)
{
    for (size_t i = 0; i < model->n_images; i++)
        free(model->images[i].name);
    free(model->cameras);
    free(model->images);
    free(model->points);
    free(model->observations);
    free(model->tracks);
    *model = (saga_colmap){ 0 };
}

const saga_colmap_camera *saga_colmap_camera_of(const saga_colmap *model,
                                                uint32_t id)
{
    for (size_t i = 0; i < model->n_cameras; i++)
        if (model->cameras[i].id == id)
            return &model->cameras[i];
    return NULL;
}

const saga_colmap_camera *saga_colmap_camera_for(const saga_colmap *model,
                                                 const saga_colmap_image *image,
                                                 const char *folder,
                                                 saga_error *error)
{
    const saga_colmap_camera *const camera = saga_colmap_camera_of(
        model, image->camera);
    if (!camera)
        (void)saga_fail(error, folder, "export the model again",
                        "image %s names camera %u, which is missing",
                        image->name, (unsigned)image->camera);
    return camera;
}

const saga_colmap_image *saga_colmap_image_of(const saga_colmap *model,
                                              uint32_t id)
{
    const saga_colmap_image key = { .id = id };
    return model->n_images == 0 ? NULL
                                : bsearch(&key, model->images, model->n_images,
                                          sizeof *model->images, by_image_id);
}

const saga_colmap_point *saga_colmap_point_of(const saga_colmap *model,
                                              uint64_t id)
{
    const saga_colmap_point key = { .id = id };
    return model->n_points == 0 ? NULL
                                : bsearch(&key, model->points, model->n_points,
                                          sizeof *model->points, by_point_id);
}
