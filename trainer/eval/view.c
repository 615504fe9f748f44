/* SPDX-License-Identifier: MIT */
#include "view.h"

#include "input.h"
#include "layout.h"

#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

#ifdef _OPENMP
#include <omp.h>
#endif

enum {
    TILE = 16,
    LIST = 1 << 15,         /* splats a band sees at a time */
    JOBS_PER_THREAD = 2     /* a job looks at all splats: few are cheaper,
                             * several share the work better */
};

static double seconds(void)
{
    struct timespec t;

    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

saga_metric saga_metric_of(const saga_info *info)
{
    saga_metric m;

    m.unit = ldexp(info->unit_mantissa, info->unit_exponent);
    for (int i = 0; i < 3; i++)
        m.centre[i] = ldexp(info->centre_mantissa[i], info->centre_exponent);
    return m;
}

/* --- Opening ------------------------------------------------------------- */

/* Index, networks or a segment. What no CRC finds wrong was written so: streams
 * of before version 1 is final have no number of their own. */
static bool refuse(const saga_film *film, saga_input_error *error,
                   const char *what, saga_status status)
{
    const char *remedy = "`saga info` tells what is damaged";
    saga_layout layout;

    if (saga_layout_read(&layout, film->bytes, film->nbytes) &&
        !layout.damage[0])
        remedy = "no checksum is wrong, so it was written like this, perhaps "
                 "by an earlier pre-release of saga: encode it again";
    saga_layout_free(&layout);
    return saga_fail(error, film->name, remedy, "%s (%s)", what,
                     saga_status_text(status));
}

static bool open_decoder(saga_film *film, saga_input_error *error)
{
    const size_t n = film->info.work_nbytes + SAGA_WORK_ALIGN - 1;
    const double start = seconds();
    saga_status s;

    film->work = aligned_alloc(SAGA_WORK_ALIGN, n - n % SAGA_WORK_ALIGN);
    if (!film->work)
        return saga_fail(error, film->name, "free some memory",
                         "no memory for the decoder's %zu bytes", n);
    s = saga_open(&film->dec, film->work, film->info.work_nbytes,
                  film->bytes, film->nbytes);
    film->times.head = seconds() - start;
    return s == SAGA_OK || refuse(film, error, "its networks are refused", s);
}

static int threads_of(int wanted)
{
#ifdef _OPENMP
    return wanted > 0 ? wanted : omp_get_max_threads();
#else
    (void)wanted;
    return 1;
#endif
}

bool saga_film_open(saga_film *film, const char *name, const uint8_t *bytes,
                    size_t nbytes, int n_threads, saga_input_error *error)
{
    saga_status s;
    bool ok;

    *film = (saga_film){ .name = name, .bytes = bytes, .nbytes = nbytes,
                         .segment = -1, .n_threads = threads_of(n_threads) };
    s = saga_probe(&film->info, bytes, nbytes);
    ok = s == SAGA_OK ||
         saga_fail(error, name, "`saga info` tells what to do",
                   "its header is refused (%s)", saga_status_text(s));
    if (ok)
        film->metric = saga_metric_of(&film->info);
    ok = ok && open_decoder(film, error);
    if (!ok)
        saga_film_close(film);
    return ok;
}

void saga_film_close(saga_film *film)
{
    free(film->work);
    *film = (saga_film){ .segment = -1 };
}

bool saga_film_rig(const saga_film *film, uint32_t index, saga_camera *camera,
                   uint32_t *number, saga_input_error *error)
{
    if (index >= film->info.n_cameras)
        return saga_fail(error, film->name, "`saga info` lists them",
                         "has no camera %" PRIu32 " in its rig of %" PRIu32,
                         index, film->info.n_cameras);
    return saga_rig(camera, number, film->bytes, film->nbytes, index) ==
           SAGA_OK;
}

/* --- Drawing ------------------------------------------------------------- */

static bool decode(saga_film *film, const saga_segment *seg,
                   saga_input_error *error)
{
    const double start = seconds();
    saga_status s = SAGA_ERR_TRUNCATED;
    char what[40];

    if (film->segment == (int64_t)seg->number)
        return true;
    film->segment = -1;
    if (seg->offset <= film->nbytes &&
        seg->nbytes <= film->nbytes - seg->offset)
        s = saga_decode(film->dec, film->bytes + seg->offset, seg->nbytes);
    snprintf(what, sizeof what, "segment %" PRIu32 " is refused",
             seg->number);
    if (s)
        return refuse(film, error, what, s);
    film->segment = seg->number;
    film->times.segment += seconds() - start;
    film->times.n_segments++;
    return true;
}

/* Rows of one job out of n, whole tiles. */
static void set_rows(saga_job *job, const saga_camera *c, int i, int n)
{
    const int rows = (c->height + TILE - 1) / TILE;

    job->x1 = c->width;
    job->y0 = TILE * (rows * i / n);
    job->y1 = TILE * (rows * (i + 1) / n);
    if (job->y1 > c->height)
        job->y1 = c->height;
    job->tile = TILE;
    job->list_capacity = LIST;
}

/* All rows of a job, in a scratch that holds them all at once. */
static saga_status draw_rows(const saga_film *film, const saga_camera *c,
                             uint8_t *rgb, int i, int n)
{
    const size_t stride = 3 * (size_t)c->width;
    saga_job job = { 0 };
    saga_picture picture = { .stride_nbytes = stride, .bits = 8 };
    saga_status s;
    size_t tiles;

    set_rows(&job, c, i, n);
    tiles = (size_t)((c->width + TILE - 1) / TILE) *
            (size_t)((job.y1 - job.y0 + TILE - 1) / TILE);
    job.scratch_nbytes = SAGA_JOB_NBYTES(TILE, LIST) +
                         SAGA_JOB_NBYTES(TILE, 0) * tiles;
    job.scratch = malloc(job.scratch_nbytes);
    if (!job.scratch)
        return SAGA_ERR_SPACE;
    picture.rgb = rgb + stride * (size_t)job.y0;
    picture.nbytes = stride * (size_t)(job.y1 - job.y0);
    do
        s = saga_draw(film->dec, &job, &picture, UINT32_MAX);
    while (s == SAGA_AGAIN);
    free(job.scratch);
    return s;
}

static saga_status draw(const saga_film *film, const saga_camera *c,
                        uint8_t *rgb)
{
    const int rows = (c->height + TILE - 1) / TILE;
    const int wanted = film->n_threads > 1 ? film->n_threads *
                                             JOBS_PER_THREAD : 1;
    const int n = wanted < rows ? wanted : rows;
    int worst = SAGA_OK;

#pragma omp parallel for num_threads(film->n_threads) schedule(dynamic) \
    reduction(min : worst)
    for (int i = 0; i < n; i++) {
        const int s = draw_rows(film, c, rgb, i, n);

        worst = s < worst ? s : worst;
    }
    return (saga_status)worst;
}

bool saga_film_draw(saga_film *film, const saga_camera *camera,
                    uint32_t frame_num, uint32_t frame_den, uint8_t *rgb,
                    saga_input_error *error)
{
    saga_segment seg;
    saga_status s = saga_find(&seg, film->bytes, film->nbytes, frame_num,
                              frame_den);
    double start, drawn;

    if (s == SAGA_ERR_ARG)
        return saga_fail(error, film->name, "give a time inside it",
                         "has no frame %g among its %" PRIu32,
                         (double)frame_num / frame_den, film->info.n_frames);
    if (s)
        return refuse(film, error, "its index is refused", s);
    if (!decode(film, &seg, error))
        return false;
    start = seconds();
    s = saga_view(film->dec, camera, seg.t);
    drawn = seconds();
    film->times.view += drawn - start;
    if (s == SAGA_OK)
        s = draw(film, camera, rgb);
    film->times.draw += seconds() - drawn;
    film->times.n_views++;
    return s == SAGA_OK || refuse(film, error, "cannot be drawn", s);
}

/* --- Cameras ------------------------------------------------------------- */

void saga_shot_centre(double centre[3], const saga_shot *shot)
{
    for (int i = 0; i < 3; i++)
        centre[i] = -(shot->rotation[i] * shot->translation[0] +
                      shot->rotation[3 + i] * shot->translation[1] +
                      shot->rotation[6 + i] * shot->translation[2]);
}

/* value rounded into *v; false if it lies outside low..high or is NaN. */
static bool take(int32_t *v, double value, double low, double high)
{
    const double r = rint(value);

    if (!(r >= low && r <= high))
        return false;
    *v = (int32_t)r;
    return true;
}

static bool out_of_range(const saga_shot *shot, const char *what, double value,
                         const char *limit, saga_input_error *error)
{
    return saga_fail(error, shot->name, limit, "its %s, %g, cannot be stored",
                     what, value);
}

static bool take_rotation(saga_camera *camera, const saga_shot *shot,
                          saga_input_error *error)
{
    for (int i = 0; i < 3; i++) {
        const double *const r = shot->rotation + 3 * i;
        const double n = sqrt(r[0] * r[0] + r[1] * r[1] + r[2] * r[2]);

        for (int k = 0; k < 3; k++)
            if (!take(&camera->rotation_q30[3 * i + k],
                      ldexp(r[k] / n, 30), -1073741824.0, 1073741824.0))
                return out_of_range(shot, "rotation", r[k],
                                    "rows must be finite and not zero",
                                    error);
    }
    return true;
}

static bool take_lens(saga_camera *camera, const saga_shot *shot,
                      saga_input_error *error)
{
    const double focal[2] = { shot->fx, shot->fy };
    const double principal[2] = { shot->cx, shot->cy };

    for (int i = 0; i < 2; i++) {
        if (!take(&camera->focal_q16[i], ldexp(focal[i], 16), 1.0,
                  2147483647.0))
            return out_of_range(shot, "focal length", focal[i],
                                "it must be above 0 and below 32768 pixels",
                                error);
        if (!take(&camera->principal_q16[i], ldexp(principal[i], 16),
                  -1073741824.0, 1073741824.0))
            return out_of_range(shot, "principal point", principal[i],
                                "it must be within 16384 pixels", error);
    }
    return true;
}

static bool take_place(saga_camera *camera, const saga_metric *metric,
                       const saga_shot *shot, double near_metres,
                       saga_input_error *error)
{
    double centre[3], near_units = rint(near_metres / metric->unit);

    saga_shot_centre(centre, shot);
    for (int i = 0; i < 3; i++)
        if (!take(&camera->centre[i],
                  (centre[i] - metric->centre[i]) / metric->unit,
                  -536870912.0, 536870912.0))
            return out_of_range(shot, "position", centre[i], "it must lie "
                                "within 32 widths of the scene's cube", error);
    if (near_units < 1.0)
        near_units = 1.0;
    return take(&camera->near_plane, near_units, 1.0, 2147483647.0) ||
           out_of_range(shot, "near plane", near_metres, "it must be finite",
                        error);
}

bool saga_camera_of_shot(saga_camera *camera, const saga_metric *metric,
                         const saga_shot *shot, double near_metres,
                         saga_input_error *error)
{
    if (shot->width < 1 || shot->height < 1 ||
        shot->width > SAGA_MAX_SIDE || shot->height > SAGA_MAX_SIDE)
        return out_of_range(shot, "width", shot->width,
                            "sides must be 1 to 16384 pixels", error);
    camera->width = (uint16_t)shot->width;
    camera->height = (uint16_t)shot->height;
    return take_rotation(camera, shot, error) &&
           take_lens(camera, shot, error) &&
           take_place(camera, metric, shot, near_metres, error);
}

void saga_shot_of_camera(saga_shot *shot, const saga_metric *metric,
                         const saga_camera *camera)
{
    double centre[3];

    shot->width = camera->width;
    shot->height = camera->height;
    shot->fx = ldexp(camera->focal_q16[0], -16);
    shot->fy = ldexp(camera->focal_q16[1], -16);
    shot->cx = ldexp(camera->principal_q16[0], -16);
    shot->cy = ldexp(camera->principal_q16[1], -16);
    for (int i = 0; i < 9; i++)
        shot->rotation[i] = ldexp(camera->rotation_q30[i], -30);
    for (int i = 0; i < 3; i++)
        centre[i] = metric->centre[i] + metric->unit * camera->centre[i];
    for (int i = 0; i < 3; i++) {
        const double *const r = shot->rotation + 3 * i;

        shot->translation[i] =
            -(r[0] * centre[0] + r[1] * centre[1] + r[2] * centre[2]);
    }
}
