/* SPDX-License-Identifier: MIT */
#include "colmap_views.h"

#include "alloc.h"
#include "error.h"
#include "file.h"
#include "notes.h"
#include "order.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

bool saga_colmap_find(char **model, const char *folder, saga_error *error)
{
    static const char *const places[] = { "colmap/sparse/0", "sparse/0",
                                          "colmap", "sparse", "" };
    for (size_t i = 0; i < sizeof places / sizeof places[0]; i++) {
        *model = saga_path_join(folder, places[i], error);
        if (!*model)
            return false;
        if (saga_colmap_is_there(*model))
            return true;
        free(*model);
    }
    *model = NULL;
    return true;
}

/* If the model was made from pictures of another size, the lens is scaled. */
bool saga_colmap_adopt(saga_source *s, const saga_colmap *model,
                       const saga_colmap_image *image, const char *folder,
                       saga_error *error)
{
    const saga_colmap_camera *const camera = saga_colmap_camera_for(
        model, image, folder, error);
    if (!camera)
        return false;
    s->lens = camera->lens;
    if (!saga_source_fit(s, camera->width, camera->height))
        return saga_fail(
            error, folder,
            saga_source_fit_remedy(s, camera->width, camera->height,
                                   "reconstruct from uncropped frames"),
            "camera of %s has %d x %d pixels, its pictures "
            "%d x %d",
            s->name, camera->width, camera->height, s->width, s->height);
    memcpy(s->rotation, image->rotation, sizeof s->rotation);
    memcpy(s->translation, image->translation, sizeof s->translation);
    return true;
}

/* Returns the number of distinct training views in a point's track. `now` must
 * be new for each point. */
static int count_training_views(const saga_listing *listing,
                                const saga_colmap *model, const int *view,
                                const saga_colmap_point *point, size_t *stamp,
                                size_t now)
{
    int n = 0;
    for (size_t t = 0; t < point->count; t++) {
        const saga_colmap_image *const image = saga_colmap_image_of(
            model, model->tracks[point->first + t]);
        const int v = image ? view[image - model->images] : -1;
        if (v < 0 || listing->sources[v].held_out || stamp[v] == now)
            continue;
        /* stamp[v] is the last point that counted view v, so that nothing has
         * to be cleared between points. */
        stamp[v] = now;
        n++;
    }
    return n;
}

bool saga_colmap_take_points(saga_listing *listing, const saga_colmap *model,
                             const int *view, saga_error *error)
{
    size_t *const stamp = saga_calloc((size_t)listing->n_sources, sizeof *stamp,
                                      listing->path, error);
    listing->points = saga_alloc(model->n_points, sizeof *listing->points,
                                 listing->path, error);
    size_t n_few = 0, n_bad = 0;
    for (size_t k = 0; stamp && listing->points && k < model->n_points; k++) {
        const saga_colmap_point *const p = &model->points[k];
        const int n = count_training_views(listing, model, view, p, stamp,
                                           k + 1);
        const bool finite = isfinite(p->position[0]) &&
                            isfinite(p->position[1]) &&
                            isfinite(p->position[2]);
        /* A point is kept only if two training views see it, so that held-out
         * views add no knowledge. */
        n_bad += finite ? 0 : 1;
        n_few += finite && n < 2 ? 1 : 0;
        if (!finite || n < 2)
            continue;
        saga_point *const to = &listing->points[listing->n_points++];
        memcpy(to->position, p->position, sizeof to->position);
        memcpy(to->rgb, p->rgb, sizeof to->rgb);
    }
    const bool ok = stamp && listing->points;
    free(stamp);
    if (!ok)
        return false;
    saga_note(listing->notes,
              "points: %zu of COLMAP's %zu kept, %zu dropped "
              "(seen by fewer than 2 training cameras), %zu not finite",
              listing->n_points, model->n_points, n_few, n_bad);
    return true;
}

/* Measures the distances between all features and their points as the loaded
 * camera projects them, which shows a wrong convention or a wrong size at
 * once. */
bool saga_colmap_measure(saga_source *s, const saga_colmap *model,
                         const saga_colmap_image *image, saga_error *error)
{
    const saga_colmap_camera *const camera = saga_colmap_camera_of(
        model, image->camera);
    if (!camera)
        return true;
    double *const e = saga_alloc(image->count, sizeof *e, image->name, error);
    int n = 0;
    for (size_t k = 0; e && k < image->count; k++) {
        const saga_colmap_observation *const o =
            &model->observations[image->first + k];
        const saga_colmap_point *const p = saga_colmap_point_of(model,
                                                                o->point);
        double c[3], uv[2];
        if (!p)
            continue;
        for (int i = 0; i < 3; i++)
            c[i] = s->rotation[3 * i] * p->position[0] +
                   s->rotation[3 * i + 1] * p->position[1] +
                   s->rotation[3 * i + 2] * p->position[2] + s->translation[i];
        e[n] = 1e9; /* the point is behind the camera */
        if (c[2] > 0.0) {
            saga_lens_project(&s->lens, c[0] / c[2], c[1] / c[2], uv);
            /* Features are in pixels of the model's pictures, errors in pixels
             * of the loaded ones. */
            const double du = uv[0] - o->u * s->width / camera->width;
            const double dv = uv[1] - o->v * s->height / camera->height;
            e[n] = sqrt(du * du + dv * dv);
        }
        n++;
    }
    if (n > 0) {
        qsort(e, (size_t)n, sizeof *e, saga_by_value);
        s->n_observations = n;
        s->reprojection_median = e[n / 2];
        s->reprojection_p90 = e[(size_t)n * 9 / 10];
    }
    free(e);
    return e != NULL;
}
