/* SPDX-License-Identifier: MIT */
#include "import_cameras.h"

#include "alloc.h"
#include "cloud_capture.h"
#include "container.h"
#include "file.h"
#include "orbit.h"
#include "render_path.h"
#include "view.h"

#include <math.h>
#include <stdio.h>

/* By default N_RINGS rings of N_ROUND cameras look at the splats from
 * outside. */
enum { N_RINGS = 3, N_ROUND = 8, SIDE = 400 };

#define FIELD_OF_VIEW 45.0
/* Distance from the centre, in radii of the scene. */
#define DISTANCE 2.5

static bool alloc_views(saga_import_cameras *s, int n)
{
    s->view = saga_calloc((size_t)n, sizeof *s->view, "cameras", s->error);
    s->n_views = s->view ? n : 0;
    for (int i = 0; i < s->n_views; i++) {
        (void)snprintf(s->view[i].name, sizeof s->view[i].name, "%d", i);
        s->view[i].focal_scale = 1.0;
    }
    return s->view != NULL;
}

static int width_of(const saga_import_cameras *s, int otherwise)
{
    return s->size.a ? s->size.a : otherwise;
}

static int height_of(const saga_import_cameras *s, int otherwise)
{
    return s->size.b ? s->size.b : otherwise;
}

/* Places cameras all around the splats. By custom, y points down in a cloud. */
static bool ring(saga_import_cameras *s)
{
    const int w = width_of(s, SIDE), h = height_of(s, SIDE);
    const double up[3] = { 0, -1, 0 };
    double centre[3], radius;

    if (!saga_cloud_extent(centre, &radius, s->first, s->error) ||
        !alloc_views(s, N_RINGS * N_ROUND))
        return false;
    /* The rings are 15 degrees below the centre, 15 and 45 degrees above it.
     * Each is turned by half a step relative to the one below. Higher means
     * smaller y. */
    for (int i = 0; i < s->n_views; i++) {
        saga_path_camera c = { .fov = FIELD_OF_VIEW };
        const double lift = (i / N_ROUND - 0.5) * M_PI / 6;
        const double turn = 2 * M_PI * (i % N_ROUND + 0.5 * (i / N_ROUND)) /
                            N_ROUND;

        c.centre[0] = centre[0] + DISTANCE * radius * cos(lift) * cos(turn);
        c.centre[1] = centre[1] - DISTANCE * radius * sin(lift);
        c.centre[2] = centre[2] + DISTANCE * radius * cos(lift) * sin(turn);
        (void)saga_look_at(c.rotation, c.centre, centre, up);
        saga_path_view(&s->view[i], &c, w, h);
        /* The sphere with four fifths of the opacity is 1.5 to 3.5 radii away;
         * the depth range has room for splats outside it. */
        s->view[i].near_depth = 0.8 * radius;
        s->view[i].far_depth = 4.5 * radius;
    }
    return true;
}

static bool path_cameras(saga_import_cameras *s)
{
    saga_path path;
    bool ok;

    if (!saga_path_read(&path, s->file, s->error))
        return false;
    ok = path.n <= SAGA_MAX_CAMERAS
             ? alloc_views(s, path.n)
             : saga_fail(s->error, s->file, "use a path with fewer pictures",
                         "has %d "
                         "pictures, more than the %d cameras of a file",
                         path.n, SAGA_MAX_CAMERAS);
    for (int i = 0; i < s->n_views && ok; i++) {
        const saga_path_camera *const c = &path.camera[i];
        /* --size takes precedence. Without it, a camera with a lens has the
         * lens's size, and a camera with a field of view has the path's
         * size. */
        const int width = c->fov > 0.0 ? path.width : c->lens.width;
        const int height = c->fov > 0.0 ? path.height : c->lens.height;

        saga_path_view(&s->view[i], c, width_of(s, width ? width : SIDE),
                       height_of(s, height ? height : SIDE));
    }
    saga_path_free(&path);
    return ok;
}

/* Takes the cameras of another file's rig. */
static bool rig_cameras(saga_import_cameras *s)
{
    saga_bytes bytes;
    saga_film film = { .segment = -1 };
    bool ok;

    if (!saga_read_file(&bytes, s->file, s->error))
        return false;
    ok =
        saga_film_open(&film, s->file, bytes.data, bytes.nbytes, 1, s->error) &&
        (film.info.n_cameras > 0 ||
         saga_fail(s->error, s->file, "give another file", "has no cameras")) &&
        alloc_views(s, (int)film.info.n_cameras);
    for (int i = 0; i < s->n_views && ok; i++) {
        saga_camera c;
        uint32_t number;

        ok = saga_film_rig(&film, (uint32_t)i, &c, &number, s->error);
        /* --size changes the number of pixels, not what the camera sees. */
        if (ok && s->size.a)
            saga_camera_resize(&c, s->size.a, s->size.b);
        if (ok)
            saga_source_view_of_camera(&s->view[i], &film.metric, &c);
    }
    saga_film_close(&film);
    saga_bytes_free(&bytes);
    return ok;
}

/* Tells whether saga_path_read can read a file: JSON, or COLMAP's images. */
static bool is_path(const char *name)
{
    return saga_has_suffix(name, ".json") ||
           saga_has_suffix(name, "images.txt") ||
           saga_has_suffix(name, "images.bin");
}

bool saga_import_find_cameras(saga_import_cameras *s)
{
    return !s->file           ? ring(s)
           : is_path(s->file) ? path_cameras(s)
                              : rig_cameras(s);
}
