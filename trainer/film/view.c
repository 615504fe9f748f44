/* SPDX-License-Identifier: MIT */
#include "view.h"

#include "alloc.h"
#include "clock.h"
#include "error.h"
#include "layout.h"
#include "threads.h"

#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#ifdef _OPENMP
#include <omp.h>
#endif

enum {
    TILE = 16,
    LIST = 1 << 15,        /* splats that a band can list at a time */
    SCRATCH_ALIGN = 64,    /* a cache line, so that threads share none */
    JOBS_PER_THREAD = 2,   /* a job goes through all splats, so fewer jobs cost
                            * less, but several per thread share the work
                            * better */
    MAX_SCRATCH = 64 << 20 /* per thread; a picture that needs more is drawn in
                            * bands, each of which goes through all splats once
                            * more */
};

/* --- Opening ------------------------------------------------------------- */

/* Returns whether the deadline, in saga_clock_seconds(), has passed. */
static int is_late(void *user)
{
    const double *const deadline = user;

    return *deadline > 0.0 && saga_clock_seconds() > *deadline;
}

static double deadline_of(const saga_film *film)
{
    return film->seconds > 0.0 ? saga_clock_seconds() + film->seconds : 0.0;
}

static bool refuse_late(const saga_film *film, saga_error *error)
{
    char remedy[60];

    snprintf(remedy, sizeof remedy, "allow more with --seconds %g",
             6 * film->seconds);
    return saga_fail(error, film->name, remedy, "decoding took more than %g s",
                     film->seconds);
}

/* Reports that the index, the networks or a segment are refused. If no CRC is
 * wrong, the file was written like this, perhaps by a program from before the
 * format was frozen, whose files have the number of version 1 too. */
static bool refuse(const saga_film *film, const char *what, saga_status status,
                   saga_error *error)
{
    const char *remedy = "`saga info` shows what is damaged, or whether "
                         "a program from before format " SAGA_FORMAT
                         " wrote it";
    saga_error ignored = { "" };
    saga_layout layout;

    if (status == SAGA_ERR_STOPPED)
        return refuse_late(film, error);
    if (status == SAGA_ERR_TRUNCATED)
        return saga_fail(error, film->name,
                         "the file is cut short or damaged: copy it again, or "
                         "see `saga info`",
                         "%s (%s)", what, saga_status_text(status));
    /* The decoder only returns a status; a walk over the file finds which chunk
     * is damaged and whether its CRC is right. */
    if (saga_layout_read(&layout, film->name, film->bytes, film->nbytes,
                         &ignored) &&
        !layout.damage[0])
        remedy = "no checksum is wrong, so it was written like this, perhaps "
                 "by a program from before format " SAGA_FORMAT
                 ": encode it again";
    saga_layout_free(&layout);
    return saga_fail(error, film->name, remedy, "%s (%s)", what,
                     saga_status_text(status));
}

static bool open_decoder(saga_film *film, saga_error *error)
{
    const double start = saga_clock_seconds();
    double deadline = deadline_of(film);
    const saga_watch watch = { is_late, &deadline };
    saga_status s;

    film->work = saga_aligned_alloc(SAGA_WORK_ALIGN, film->info.work_nbytes,
                                    film->name, error);
    if (!film->work)
        return false;
    s = saga_open(&film->dec, film->work, film->info.work_nbytes, film->bytes,
                  film->nbytes, &watch);
    film->times.head = saga_clock_seconds() - start;
    return s == SAGA_OK || refuse(film, "its networks are refused", s, error);
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

/* Opens the file named in *film. */
static bool open_film(saga_film *film, saga_error *error)
{
    const saga_status s = saga_probe(&film->info, film->bytes, film->nbytes);
    bool ok = s == SAGA_OK ||
              saga_fail(error, film->name, "`saga info` says what to do",
                        "its header is refused (%s)", saga_status_text(s));

    if (ok)
        film->metric = saga_metric_of(&film->info);
    ok = ok && open_decoder(film, error);
    if (!ok)
        saga_film_close(film);
    return ok;
}

bool saga_film_open(saga_film *film, const char *name, const uint8_t *bytes,
                    size_t nbytes, int n_threads, saga_error *error)
{
    *film = (saga_film){ .name = name,
                         .bytes = bytes,
                         .nbytes = nbytes,
                         .segment = -1,
                         .n_threads = threads_of(n_threads) };
    return open_film(film, error);
}

bool saga_film_open_within(saga_film *film, const char *name,
                           const saga_bytes *bytes, double seconds_most,
                           saga_error *error)
{
    *film = (saga_film){ .name = name,
                         .bytes = bytes->data,
                         .nbytes = bytes->nbytes,
                         .segment = -1,
                         .n_threads = threads_of(0),
                         .seconds = seconds_most };
    return open_film(film, error);
}

void saga_film_close(saga_film *film)
{
    free(film->work);
    *film = (saga_film){ .segment = -1 };
}

void saga_film_expose(const saga_film *film, uint32_t index, uint8_t *rgb,
                      size_t n)
{
    saga_exposure e;
    uint8_t to[3][256];

    if (saga_find_exposure(&e, film->bytes, film->nbytes, index))
        return;
    for (uint32_t k = 0; k < 3; k++)
        for (uint32_t s = 0; s < 256; s++) {
            const uint32_t x = (s * e.gain_q12[k] + 2048) >> 12;

            to[k][s] = (uint8_t)(x < 255 ? x : 255);
        }
    for (size_t i = 0; i < 3 * n; i++)
        rgb[i] = to[i % 3][rgb[i]];
}

bool saga_film_find_camera(uint32_t *index, const saga_film *film,
                           const char *name, saga_error *error)
{
    const uint32_t n = film->info.n_cameras;
    /* saga-dec takes a number in either form, too. */
    const char *const digits = strncmp(name, "rig:", 4) ? name : name + 4;
    char *end;
    const unsigned long number = strtoul(digits, &end, 10);
    /* Names take precedence, because a camera named 3 may have another
     * number. */
    for (*index = 0; *index < n; ++*index) {
        saga_naming naming;
        saga_film_naming(film, *index, &naming);
        if (!strcmp(naming.name, name))
            return true;
    }
    *index = (uint32_t)number;
    return (digits[0] >= '0' && digits[0] <= '9' && !*end && number < n) ||
           saga_fail(error, film->name, "`saga info` lists them",
                     "has no camera %s; it has %" PRIu32 " cameras", name, n);
}

bool saga_film_rig(const saga_film *film, uint32_t index, saga_camera *camera,
                   uint32_t *number, saga_error *error)
{
    if (index >= film->info.n_cameras)
        return saga_fail(error, film->name, "`saga info` lists them",
                         "has no camera %" PRIu32 "; it has %" PRIu32
                         " cameras",
                         index, film->info.n_cameras);
    const saga_status s = saga_rig(camera, number, film->bytes, film->nbytes,
                                   index);
    return s == SAGA_OK || refuse(film, "its rig is refused", s, error);
}

void saga_film_naming(const saga_film *film, uint32_t index,
                      saga_naming *naming)
{
    if (saga_name_camera(naming, film->bytes, film->nbytes, index))
        *naming = (saga_naming){ .name = "" };
}

/* --- Drawing ------------------------------------------------------------- */

/* Returns the number of bytes that the file has of a segment. If the file ends
 * early, the first layers may still be complete. */
static size_t bytes_there(const saga_film *film, const saga_segment *seg)
{
    const size_t left = seg->offset <= film->nbytes
                            ? film->nbytes - (size_t)seg->offset
                            : 0;

    return seg->nbytes < left ? seg->nbytes : left;
}

static bool decode(saga_film *film, const saga_segment *seg, saga_error *error)
{
    const double start = saga_clock_seconds();
    double deadline = deadline_of(film);
    const saga_watch watch = { is_late, &deadline };
    saga_status s = SAGA_ERR_TRUNCATED;
    char what[40];

    if (film->segment == (int64_t)seg->number)
        return true;
    /* Until decoding has succeeded, the decoder holds no segment to draw. */
    film->segment = -1;
    if (seg->offset <= film->nbytes)
        s = saga_decode(film->dec, seg, film->bytes + seg->offset,
                        bytes_there(film, seg), &watch);
    snprintf(what, sizeof what, "segment %" PRIu32 " is refused", seg->number);
    if (s)
        return refuse(film, what, s, error);
    film->segment = seg->number;
    film->times.segment += saga_clock_seconds() - start;
    film->times.n_segments++;
    return true;
}

/* Sets the rows of job i of n: whole rows of tiles. */
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

/* Returns the bytes of scratch in which any of n jobs can draw all its rows at
 * once, or as many of its rows as fit MAX_SCRATCH. */
static size_t scratch_nbytes(const saga_camera *c, int n)
{
    const int rows = (c->height + TILE - 1) / TILE;
    const size_t row = SAGA_JOB_NBYTES(TILE, 0) *
                       (size_t)((c->width + TILE - 1) / TILE);
    const size_t wanted = (size_t)((rows + n - 1) / n),
                 most = MAX_SCRATCH / row;
    const size_t nbytes = SAGA_JOB_NBYTES(TILE, LIST) +
                          row * (wanted < most ? wanted : most);

    return (nbytes + SCRATCH_ALIGN - 1) / SCRATCH_ALIGN * SCRATCH_ALIGN;
}

/* Where a whole picture is drawn: rows without padding. */
typedef struct {
    uint8_t *pixels;
    size_t pixel_nbytes;
    int bits; /* per sample, as in saga_picture */
} target;

/* Draws all rows of a job. */
static saga_status draw_rows(const saga_film *film, const saga_camera *c,
                             const target *to, saga_job job)
{
    const size_t stride = to->pixel_nbytes * c->width;
    saga_picture picture = { .stride_nbytes = stride, .bits = to->bits };
    saga_status s;

    picture.rgb = to->pixels + stride * (size_t)job.y0;
    picture.nbytes = stride * (size_t)(job.y1 - job.y0);
    do
        s = saga_draw(film->dec, &job, &picture, UINT32_MAX);
    while (s == SAGA_AGAIN);
    return s;
}

static bool draw(const saga_film *film, const saga_camera *c, const target *to,
                 saga_error *error)
{
    const int rows = (c->height + TILE - 1) / TILE;
    const int wanted = film->n_threads > 1 ? film->n_threads * JOBS_PER_THREAD
                                           : 1;
    const int n = wanted < rows ? wanted : rows;
    const int n_threads = film->n_threads < n ? film->n_threads : n;
    const size_t each = scratch_nbytes(c, n);
    uint8_t *const scratch = saga_aligned_alloc(
        SCRATCH_ALIGN, (size_t)n_threads * each, "drawing", error);
    int worst = SAGA_OK;

    if (!scratch)
        return false;
/* Jobs are whole rows of tiles and share no pixel, so their order is free. */
#pragma omp parallel for num_threads(n_threads) schedule(dynamic) \
    reduction(min                                                 \
              : worst)
    for (int i = 0; i < n; i++) {
        saga_job job = { .scratch = scratch + saga_thread_number() * each,
                         .scratch_nbytes = each };
        int s;

        set_rows(&job, c, i, n);
        s = draw_rows(film, c, to, job);
        worst = s < worst ? s : worst;
    }
    free(scratch);
    return worst == SAGA_OK ||
           refuse(film, "cannot be drawn", (saga_status)worst, error);
}

bool saga_film_seek(saga_film *film, uint32_t frame_num, uint32_t frame_den,
                    int32_t *t, saga_error *error)
{
    saga_segment seg;
    const saga_status s = saga_find(&seg, film->bytes, film->nbytes, frame_num,
                                    frame_den);

    if (s == SAGA_ERR_ARG)
        return saga_fail(error, film->name, "give a time inside it",
                         "has no frame %g among its %" PRIu32,
                         (double)frame_num / frame_den, film->info.n_frames);
    if (s)
        return refuse(film, "its index is refused", s, error);
    *t = seg.t;
    return decode(film, &seg, error);
}

static bool draw_at(saga_film *film, const saga_camera *camera,
                    uint32_t frame_num, uint32_t frame_den, const target *to,
                    saga_error *error)
{
    saga_status s;
    double start, drawn;
    int32_t t;
    bool ok;

    if (!saga_film_seek(film, frame_num, frame_den, &t, error))
        return false;
    start = saga_clock_seconds();
    s = saga_view(film->dec, camera, t);
    drawn = saga_clock_seconds();
    film->times.view += drawn - start;
    if (s)
        return refuse(film, "cannot be drawn", s, error);
    ok = draw(film, camera, to, error);
    film->times.draw += saga_clock_seconds() - drawn;
    film->times.n_views++;
    return ok;
}

bool saga_film_draw(saga_film *film, const saga_camera *camera,
                    uint32_t frame_num, uint32_t frame_den, uint8_t *rgb,
                    saga_error *error)
{
    const target to = { rgb, 3, 8 };

    return draw_at(film, camera, frame_num, frame_den, &to, error);
}

bool saga_film_draw_depth(saga_film *film, const saga_camera *camera,
                          uint32_t frame_num, uint32_t frame_den,
                          saga_depth *depth, saga_error *error)
{
    const target to = { (uint8_t *)depth, sizeof *depth, SAGA_DEPTH };

    return draw_at(film, camera, frame_num, frame_den, &to, error);
}

/* Returns the numerator of a late frame's time, and sets its denominator: steps
 * of 1/65536, the resolution of a segment's time, if 32 bits suffice. */
static uint32_t late_time(uint32_t *den, uint32_t frame, double late)
{
    *den = late > 0.0 && frame < 65535 ? 65536 : 1;
    return frame * *den + (uint32_t)lrint(late * (*den - 1));
}

bool saga_film_draw_late(saga_film *film, const saga_camera *camera,
                         uint32_t frame, double late, uint8_t *rgb,
                         saga_error *error)
{
    uint32_t den;
    const uint32_t num = late_time(&den, frame, late);

    return saga_film_draw(film, camera, num, den, rgb, error);
}

bool saga_film_draw_depth_late(saga_film *film, const saga_camera *camera,
                               uint32_t frame, double late, saga_depth *depth,
                               saga_error *error)
{
    uint32_t den;
    const uint32_t num = late_time(&den, frame, late);

    return saga_film_draw_depth(film, camera, num, den, depth, error);
}
