/* SPDX-License-Identifier: MIT */
#include "pictures.h"

#include "alloc.h"
#include "camera.h"
#include "checkpoint.h"
#include "model.h"
#include "novel.h"
#include "threads.h"

#include <stdlib.h>
#include <string.h>

/* The background is looked for in N_LOOKED_AT pixels, of SAGA_MOST_LOOKED_AT
 * pictures at most: a film has thousands, and each that is touched is decoded
 * and written to the scratch file. */
enum { MIN_SIDE = 8, N_LOOKED_AT = 20000 };

/* Films of at most this number of frames are looked at in all frames. Moments
 * of ten seconds are then 0.3 seconds apart. */
enum { LEAST_MOMENTS = 32 };

/* Rows of the truth in one task, and nanoseconds for a sample. */
enum { ROWS = 8 };
#define SAMPLE_NS 0.5

/* Streams of random numbers (rng.h). */
enum { STREAM_BEHIND = 501, STREAM_LOOK };

#define NEAR_PART 0.3 /* near plane, over the view's nearest depth */
/* Least part of all pixels that have exactly the background's colour. */
#define BACKGROUND_PART 0.1

static bool find_views(saga_pictures *p, saga_error *error)
{
    const saga_capture *const c = p->capture;

    for (int v = 0; v < c->n_views; v++) {
        const saga_source_view *const s = &c->views[v];

        if (s->held_out || s->n_missing == c->n_frames)
            continue;
        if (s->width < MIN_SIDE || s->height < MIN_SIDE)
            return saga_fail(error, NULL,
                             "use larger pictures or a larger "
                             "--scale",
                             "view %s is %d x %d pixels, at least "
                             "%d x %d are needed",
                             s->name, s->width, s->height, MIN_SIDE, MIN_SIDE);
        p->train[p->n_train++] = v;
    }
    return (p->n_train > 0 && c->n_frames > 0) ||
           saga_fail(error, NULL, "hold out fewer",
                     "nothing to train on: %d "
                     "training views, %d frames",
                     p->n_train, c->n_frames);
}

/* Lists the training pictures that exist, if some are missing. */
static bool find_pictures(saga_pictures *p, saga_error *error)
{
    const int n = p->n_train * p->capture->n_frames;
    int n_missing = 0;

    for (int i = 0; i < p->n_train; i++)
        n_missing += p->capture->views[p->train[i]].n_missing;
    p->n_there = n - n_missing;
    if (n_missing == 0)
        return true;
    p->there = saga_alloc((size_t)n, sizeof *p->there, "the pictures", error);
    p->n_there = 0;
    /* Picture `at` is of frame at / n_train and view at % n_train, so the views
     * of a frame are adjacent. */
    for (int at = 0; p->there && at < n; at++)
        if (saga_capture_has(p->capture, p->train[at % p->n_train],
                             at / p->n_train))
            p->there[p->n_there++] = at;
    return p->there != NULL;
}

static int compare_colours(const void *a, const void *b)
{
    const uint32_t p = *(const uint32_t *)a, q = *(const uint32_t *)b;

    return (p > q) - (p < q);
}

/* Reads pixels of training pictures that are spread evenly. A pixel that does
 * not count gets a value that no other has. */
static void read_colours(uint32_t *colour, const saga_pictures *p)
{
    const size_t n = (size_t)p->n_there;
    const size_t few = n < SAGA_MOST_LOOKED_AT ? n : SAGA_MOST_LOOKED_AT;
    const saga_rng r = saga_rng_stream(1, STREAM_LOOK);

    for (size_t i = 0; i < N_LOOKED_AT; i++) {
        const size_t at = i * few / N_LOOKED_AT * n / few;
        const size_t one = p->there ? (size_t)p->there[at] : at;
        const int view = p->train[one % (size_t)p->n_train];
        const saga_source_view *const v = p->capture->views + view;
        /* Each picture's pixels are spread over all of it. */
        const size_t pixel = saga_rng_below(
            r, i, (uint32_t)((size_t)v->width * (size_t)v->height));
        const int frame = (int)(one / (size_t)p->n_train);
        const uint8_t *const mask = saga_capture_mask(p->capture, view, frame);
        const uint8_t *const rgb = saga_capture_frame(p->capture, view, frame) +
                                   pixel / (size_t)v->width *
                                       saga_view_row_nbytes(v) +
                                   pixel % (size_t)v->width * 3;

        /* Bit 31 is above all colours, and i makes each value unique. */
        colour[i] = mask && !mask[pixel] ? 1u << 31 | (uint32_t)i
                                         : (uint32_t)rgb[0] << 16 |
                                               (uint32_t)rgb[1] << 8 | rgb[2];
    }
}

/* Sets the background to the most frequent colour if it is frequent enough, as
 * for an object in front of a screen. Pictures of rooms or landscapes have no
 * such colour, and get black. */
static bool find_background(saga_pictures *p, saga_error *error)
{
    uint32_t *const colour = saga_alloc(N_LOOKED_AT, sizeof *colour,
                                        "the pictures' colours", error);
    size_t most = (size_t)(BACKGROUND_PART * N_LOOKED_AT), run = 0;

    if (!colour)
        return false;
    read_colours(colour, p);
    qsort(colour, N_LOOKED_AT, sizeof *colour, compare_colours);
    /* After sorting, equal colours form a run; the longest run above the
     * threshold wins. */
    for (size_t i = 0; i < N_LOOKED_AT; i++) {
        run = i > 0 && colour[i] == colour[i - 1] ? run + 1 : 1;
        if (run > most) {
            most = run;
            for (int k = 0; k < 3; k++)
                p->background[k] = (uint8_t)(colour[i] >> (16 - 8 * k));
        }
    }
    free(colour);
    return true;
}

bool saga_pictures_init(saga_pictures *p, const saga_capture *capture,
                        saga_error *error)
{
    const size_t n = (size_t)capture->n_views;

    memset(p, 0, sizeof *p);
    p->capture = capture;
    p->range = saga_calloc(2 * n, sizeof *p->range, "the views", error);
    p->train = saga_calloc(n, sizeof *p->train, "the views", error);
    p->exposure = saga_alloc(3 * n, sizeof *p->exposure, "the views", error);
    for (size_t i = 0; p->exposure && i < 3 * n; i++)
        p->exposure[i] = 1;
    if (p->range && p->train && p->exposure && find_views(p, error) &&
        find_pictures(p, error) &&
        /* A subject is over black already. */
        (capture->subject || find_background(p, error)) &&
        saga_cube_fit(&p->cube, p->range, capture, error))
        return true;
    saga_pictures_free(p);
    return false;
}

void saga_pictures_free(saga_pictures *p)
{
    free(p->range);
    free(p->train);
    free(p->there);
    free(p->exposure);
    memset(p, 0, sizeof *p);
}

static uint64_t digest_view(uint64_t sum, const saga_source_view *v,
                            int n_frames)
{
    const double x[] = { v->width,    v->height, v->fx,         v->fy,
                         v->cx,       v->cy,     v->near_depth, v->far_depth,
                         v->held_out, v->late };

    const size_t n_held = (size_t)saga_view_n_held(v, n_frames);

    /* The digest contains everything that affects training, so a checkpoint of
     * another capture is refused. */
    sum = saga_digest(sum, x, sizeof x);
    sum = saga_digest(sum, v->rotation, sizeof v->rotation);
    sum = saga_digest(sum, v->translation, sizeof v->translation);
    if (v->missing)
        sum = saga_digest(sum, v->missing, (size_t)n_frames);
    if (v->mask)
        sum = saga_digest(sum, v->mask, n_held * saga_view_frame_nbytes(v) / 3);
    return v->digest
               ? saga_digest(sum, &v->digest, sizeof v->digest)
               : saga_digest(sum, v->rgb, n_held * saga_view_frame_nbytes(v));
}

uint64_t saga_pictures_digest(const saga_pictures *p)
{
    const saga_capture *const c = p->capture;
    const double counts[] = { c->n_frames, c->n_views, c->fps };
    uint64_t sum = saga_digest(SAGA_DIGEST_START, counts, sizeof counts);

    for (size_t i = 0; i < c->n_points; i++) {
        const saga_point *const x = &c->points[i];

        sum = saga_digest(sum, x->position, sizeof x->position);
        sum = saga_digest(sum, x->rgb, sizeof x->rgb);
    }
    for (int i = 0; i < c->n_views; i++)
        sum = digest_view(sum, &c->views[i], c->n_frames);
    return sum;
}

saga_sample saga_pictures_pick(const saga_pictures *p, saga_rng rng,
                               uint64_t draw)
{
    const uint32_t one = saga_rng_shuffled(rng, draw, (uint32_t)p->n_there);
    const int at = p->there ? p->there[one] : (int)one;
    saga_sample sample = {
        p->train[at % p->n_train], at / p->n_train, 0, { 0 }
    };

    saga_pictures_set_behind(&sample, p, rng, draw);
    return sample;
}

void saga_pictures_set_behind(saga_sample *sample, const saga_pictures *p,
                              saga_rng rng, uint64_t draw)
{
    const saga_rng r = saga_rng_stream(rng.key, STREAM_BEHIND);

    for (size_t k = 0; p->capture->subject && k < 3; k++)
        sample->behind[k] = (uint8_t)saga_rng_below(r, 3 * draw + k, 256);
}

int saga_pictures_n_moments(const saga_pictures *p)
{
    const int n = p->capture->n_frames, few = SAGA_MOST_LOOKED_AT / p->n_train;
    const int most = few > LEAST_MOMENTS ? few : LEAST_MOMENTS;

    return n < most ? n : most;
}

int saga_pictures_moment(const saga_pictures *p, int k)
{
    const int m = saga_pictures_n_moments(p);

    /* The middles of m equal parts. */
    return (int)((2 * (int64_t)k + 1) * p->capture->n_frames / (2 * m));
}

int saga_pictures_moment_of(const saga_pictures *p, int frame)
{
    const int64_t m = saga_pictures_n_moments(p), n = p->capture->n_frames;

    /* The middle of the frame decides. */
    return saga_pictures_moment(p, (int)((2 * frame + 1) * m / (2 * n)));
}

double saga_pictures_pixels(const saga_pictures *p)
{
    double n = 0;

    for (int i = 0; i < p->n_train; i++) {
        const saga_source_view *const v = &p->capture->views[p->train[i]];

        n += (double)v->width * v->height *
             (p->capture->n_frames - v->n_missing);
    }
    return n;
}

size_t saga_pictures_largest(const saga_pictures *p)
{
    const saga_capture *const c = p->capture;
    size_t most = 0;

    for (int i = 0; i < c->n_views; i++) {
        const size_t n = (size_t)c->views[i].width * (size_t)c->views[i].height;

        most = n > most ? n : most;
    }
    return most;
}

bool saga_pictures_canvas(saga_canvas *canvas, const saga_pictures *p,
                          saga_error *error)
{
    if (!saga_canvas_init(canvas, saga_pictures_largest(p), error))
        return false;
    /* For steep splats q grows by s + s^2 / 2 instead of s. */
    canvas->rules.square = p->tools & SAGA_TOOL_STEEP ? R(0.5) : 0;
    return true;
}

/* Returns a camera of the capture or, from n_views on, of novel.h. */
static const saga_source_view *view_of(const saga_pictures *p, int view)
{
    const int n = p->capture->n_views;

    return view < n ? &p->capture->views[view] : &p->novel->view[view - n];
}

double saga_pictures_near(const saga_pictures *p, int view)
{
    const int n = p->capture->n_views;

    return NEAR_PART *
           (view < n ? p->range[2 * view] : p->novel->nearest[view - n]);
}

void saga_pictures_camera(saga_splat_camera *cam, const saga_pictures *p,
                          saga_sample sample)
{
    const saga_source_view *const v = view_of(p, sample.view);
    const double scale = 1.0 / (1 << sample.mip);
    double c[3];

    saga_source_view_centre(c, v);
    for (int i = 0; i < 9; i++)
        cam->rotation[i] = (real)v->rotation[i];
    for (int i = 0; i < 3; i++) {
        cam->centre[i] = (real)((c[i] - p->cube.centre[i]) / p->cube.unit);
        cam->background[i] = R(p->background[i] + sample.behind[i]) / 255;
    }
    /* Coordinates start at the picture's corner, so halving a picture halves
     * them. Sides are rounded down; the truth too leaves out pixels that do not
     * fill a box. */
    cam->focal[0] = (real)(v->fx * scale);
    cam->focal[1] = (real)(v->fy * scale);
    cam->principal[0] = (real)(v->cx * scale);
    cam->principal[1] = (real)(v->cy * scale);
    cam->near_plane = (real)(saga_pictures_near(p, sample.view) / p->cube.unit);
    cam->width = v->width >> sample.mip;
    cam->height = v->height >> sample.mip;
}

void saga_pictures_aim(saga_canvas *canvas, const saga_pictures *p,
                       saga_sample sample)
{
    const saga_backdrop *const b = p->backdrop;

    saga_pictures_camera(&canvas->camera, p, sample);
    canvas->still = b ? &b->seen[sample.view] : NULL;
    canvas->n_still = b ? b->n : 0;
    /* A camera that is late took frame k at time k + late. */
    canvas->t = (real)((sample.frame + view_of(p, sample.view)->late) /
                       p->capture->n_frames);
}

/* The truth of a stored picture, which is computed some rows at a time. */
typedef struct {
    saga_canvas *canvas;
    const uint8_t *rgb;
    size_t stride;
    const double *exposure; /* (3) of the view */
    int side;               /* side of the boxes that become pixels */
    real level[3][256];     /* table of values, for a picture that is not
                             * halved */
} truth;

static void plain_row(const truth *t, size_t y)
{
    const size_t w = (size_t)t->canvas->camera.width;
    const size_t plane = w * (size_t)t->canvas->camera.height;
    const uint8_t *const from = t->rgb + y * t->stride;
    real *const to = t->canvas->truth + y * w;

    for (size_t x = 0; x < w; x++) {
        to[x] = t->level[0][from[3 * x]];
        to[x + plane] = t->level[1][from[3 * x + 1]];
        to[x + 2 * plane] = t->level[2][from[3 * x + 2]];
    }
}

/* Boxes start at the picture's corner. Pixels that do not fill one are left
 * out. */
static void boxed_row(const truth *t, size_t y)
{
    const size_t w = (size_t)t->canvas->camera.width;
    const size_t plane = w * (size_t)t->canvas->camera.height;
    const size_t side = (size_t)t->side;
    const real white = R(255 * t->side * t->side);

    for (size_t x = 0; x < w; x++)
        for (size_t k = 0; k < 3; k++) {
            const uint8_t *at = t->rgb + y * side * t->stride + x * side * 3 +
                                k;
            /* The integer sum is exact; the only rounding is in the
             * division. */
            int sum = 0;

            for (size_t j = 0; j < side; j++, at += t->stride)
                for (size_t i = 0; i < side; i++)
                    sum += at[3 * i];
            t->canvas->truth[k * plane + y * w + x] = R(t->exposure[k]) *
                                                      R(sum) / white;
        }
}

static void true_rows(void *user, size_t part)
{
    const truth *const t = user;
    const saga_range rows = saga_part((size_t)t->canvas->camera.height, ROWS,
                                      part);

    for (size_t y = rows.begin; y < rows.end; y++)
        if (t->side > 1)
            boxed_row(t, y);
        else
            plain_row(t, y);
}

static void make_truth(truth *t)
{
    const saga_splat_camera *const c = &t->canvas->camera;

    for (int k = 0; t->side == 1 && k < 3; k++)
        for (int i = 0; i < 256; i++)
            t->level[k][i] = R(t->exposure[k]) * R(i) / 255;
    saga_parallel(&(saga_tasks){ .run = true_rows,
                                 .user = t,
                                 .n = saga_n_parts((size_t)c->height, ROWS),
                                 .ns = (double)SAMPLE_NS * t->side * t->side *
                                       3 * c->width * c->height });
}

/* Tells whether any pixel of a box does not count. */
static bool is_unseen(const uint8_t *mask, size_t stride, size_t side)
{
    bool seen = true;

    for (size_t y = 0; y < side; y++)
        seen = seen && !memchr(mask + y * stride, 0, side);
    return !seen;
}

/* Marks the pixels in whose boxes any pixel does not count. */
static void mark_unseen(saga_canvas *canvas, const uint8_t *mask, size_t stride,
                        size_t side)
{
    const size_t w = (size_t)canvas->camera.width;
    const size_t h = (size_t)canvas->camera.height;

    for (size_t i = 0; i < w * h; i++) {
        const bool unseen = is_unseen(
            mask + i / w * side * stride + i % w * side, stride, side);

        for (size_t k = 0; unseen && k < 3; k++)
            /* The truth is never negative, so -1 marks a pixel that does not
             * count. */
            canvas->truth[k * w * h + i] = -1;
        canvas->n_unseen += unseen;
    }
}

size_t saga_pictures_n_unseen(const saga_canvas *canvas, const saga_pictures *p,
                              saga_sample sample)
{
    const size_t w = (size_t)canvas->camera.width;
    const size_t h = (size_t)canvas->camera.height;
    const size_t side = (size_t)1 << sample.mip;
    const size_t stride =
        saga_view_row_nbytes(&p->capture->views[sample.view]) / 3;
    const uint8_t *const mask = saga_capture_mask(p->capture, sample.view,
                                                  sample.frame);
    size_t n = 0;

    for (size_t i = 0; mask && !p->capture->subject && i < w * h; i++)
        n += is_unseen(mask + i / w * side * stride + i % w * side, stride,
                       side);
    return n;
}

/* Puts the background of the canvas behind a subject: adds (1 - mask) b, with
 * the mean of the mask over each pixel's box. */
static void add_behind(saga_canvas *canvas, const uint8_t *mask, size_t stride,
                       size_t side)
{
    const saga_splat_camera *const c = &canvas->camera;
    const size_t w = (size_t)c->width, h = (size_t)c->height;
    const real white = R(255 * side * side);

    for (size_t i = 0; i < w * h; i++) {
        const uint8_t *at = mask + i / w * side * stride + i % w * side;
        int sum = 0;

        for (size_t y = 0; y < side; y++, at += stride)
            for (size_t x = 0; x < side; x++)
                sum += at[x];
        for (size_t k = 0; k < 3; k++)
            canvas->truth[k * w * h + i] += (1 - R(sum) / white) *
                                            c->background[k];
    }
}

void saga_pictures_truth(saga_canvas *canvas, const saga_pictures *p,
                         saga_sample sample)
{
    const size_t stride = saga_view_row_nbytes(&p->capture->views[sample.view]);
    const uint8_t *const mask = saga_capture_mask(p->capture, sample.view,
                                                  sample.frame);
    truth t = { .canvas = canvas,
                .stride = stride,
                .side = 1 << sample.mip,
                .rgb = saga_capture_frame(p->capture, sample.view,
                                          sample.frame),
                .exposure = p->exposure + 3 * (size_t)sample.view };

    make_truth(&t);
    canvas->n_unseen = 0;
    if (mask && p->capture->subject)
        add_behind(canvas, mask, stride / 3, (size_t)1 << sample.mip);
    else if (mask)
        mark_unseen(canvas, mask, stride / 3, (size_t)1 << sample.mip);
}
