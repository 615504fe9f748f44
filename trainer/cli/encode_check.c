/* SPDX-License-Identifier: MIT
 *
 * The quality that saga encode reports is measured on the finished file, which
 * is opened again. Its pictures are compared with the capture's, and with
 * pictures that the float model draws from the same symbols.
 */
#include "encode_session.h"

#include "alloc.h"
#include "cli.h"
#include "file.h"
#include "metrics.h"
#include "splice.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* A prediction may draw and learn this part of the pixels that the training
 * does. It then takes at most 5 % of its time (docs/lab/volume.md). */
#define MOST_WORK 0.06

typedef struct {
    double sum[2], even[2], agree[2]; /* sums of PSNR in dB; index 1: held-out
                                       * views, index 0: the others */
    int n[2], n_agree[2];             /* numbers of pictures in these sums */
    bool has_float; /* the segment's float model is in memory */
} tally;

/* Returns the PSNR of a decoded picture against the truth as training sees it,
 * which is the truth multiplied by the camera's exposure factors. */
static double evened_psnr(const saga_encode_session *s, int view, int frame,
                          const uint8_t *rgb)
{
    const double *const x = saga_train_exposure(s->train) + 3 * view;
    const saga_source_view *const v = &s->capture.views[view];
    const size_t n = (size_t)v->width * (size_t)v->height;
    const uint8_t *const truth = saga_capture_frame(&s->capture, view, frame);
    const uint8_t *const mask = saga_capture_mask(&s->capture, view, frame);
    double sum = 0;
    size_t counting = 0;

    /* Training saw the truth times the factors of its camera. Masked pixels
     * count neither in the sum nor in the number of pixels. */
    for (size_t i = 0; i < n; i++) {
        counting += !mask || mask[i];
        for (int k = 0; k < 3 && (!mask || mask[i]); k++) {
            const double e = x[k] * truth[3 * i + (size_t)k] -
                             rgb[3 * i + (size_t)k];

            sum += e * e;
        }
    }
    return saga_psnr(sum / (3.0 * (double)counting));
}

double saga_encode_exposure(const saga_encode_session *s)
{
    const double *const x = saga_train_exposure(s->train);
    double most = 1;

    for (int k = 0; k < 3; k++) {
        double lo = INFINITY, hi = 0;

        for (int i = 0; i < s->capture.n_views; i++)
            if (!s->capture.views[i].held_out) {
                lo = fmin(lo, x[3 * i + k]);
                hi = fmax(hi, x[3 * i + k]);
            }
        most = fmax(most, hi / lo);
    }
    return most - 1;
}

/* Sets *psnr to the PSNR between a decoded picture and the picture that the
 * float model draws from the same symbols. */
static bool compare_float(saga_encode_session *s, double *psnr,
                          const uint8_t *rgb, int view, int frame)
{
    const saga_source_view *const v = &s->capture.views[view];
    const size_t n = (size_t)v->width * (size_t)v->height;
    float *const image = saga_alloc(3 * n, sizeof *image, v->name, &s->error);
    double sum = 0;

    if (!image || !saga_train_draw(s->train, image, view, frame, &s->error)) {
        free(image);
        return false;
    }
    /* The float image has planes, (3, H, W); the decoded picture has pixels,
     * (H, W, 3). */
    for (size_t i = 0; i < 3 * n; i++) {
        const double x = (double)image[i % 3 * n + i / 3];
        const double e = 255 * fmin(fmax(x, 0), 1) - rgb[i];

        sum += e * e;
    }
    free(image);
    *psnr = saga_psnr(sum / (3.0 * (double)n));
    return true;
}

/* Tells whether the float model in memory is that of a segment. Memory holds
 * the model of the segment that was trained last. */
static bool has_float(const saga_encode_session *s, int segment)
{
    /* With --networks and without a base, the first segment was read from that
     * file in coded form, so no float model of it exists here. */
    return segment == saga_train_segment(s->train) &&
           !(s->o->networks && !saga_encode_has_base(s) &&
             segment == saga_train_first(s->train));
}

/* A view of the capture, and the film that shows it. */
typedef struct {
    saga_film *film;
    saga_camera camera;
    int view;
    int first;       /* frame of the film that is the segment's first */
    uint8_t *rgb;    /* a picture, owned by the look */
    uint8_t *filmed; /* the same in the tone of the camera, if the file
                      * has its exposure */
} look;

static void close_look(look *l)
{
    free(l->rgb);
    free(l->filmed);
}

/* Opens a look. The caller closes it, even if this fails. */
static bool open_look(look *l, saga_encode_session *s, saga_film *film,
                      int segment, int view)
{
    const saga_source_view *const v = &s->capture.views[view];
    uint32_t number;

    /* A file made with --only has no other segment than this one. */
    *l = (look){
        .film = film,
        .view = view,
        .first = s->o->networks ? 0 : saga_encode_begin(s, segment),
        .rgb = saga_alloc(saga_view_frame_nbytes(v), 1, v->name, &s->error),
        .filmed = saga_alloc(saga_view_frame_nbytes(v), 1, v->name, &s->error)
    };
    return l->rgb && l->filmed &&
           saga_film_rig(film, (uint32_t)view, &l->camera, &number, &s->error);
}

/* Draws a frame and sets *psnr, as filmed; to NaN if the mask covers the whole
 * frame. */
static bool draw_look(look *l, double *psnr, saga_encode_session *s, int frame)
{
    const saga_source_view *const v = &s->capture.views[l->view];
    const uint8_t *const truth = saga_capture_frame(&s->capture, l->view,
                                                    frame);
    double counting;

    if (!saga_film_draw_late(l->film, &l->camera, (uint32_t)(l->first + frame),
                             v->late, l->rgb, &s->error))
        return false;
    /* Masked pixels are set to the truth, so their error is 0. Dividing the
     * mean by the fraction of other pixels gives the mean over those. */
    memcpy(l->filmed, l->rgb, saga_view_frame_nbytes(v));
    saga_film_expose(l->film, (uint32_t)l->view, l->filmed,
                     saga_view_frame_nbytes(v) / 3);
    (void)saga_capture_forgive(&s->capture, l->view, frame, l->rgb);
    counting = saga_capture_forgive(&s->capture, l->view, frame, l->filmed);
    *psnr = counting > 0 ? saga_psnr(saga_mse(l->filmed, truth,
                                              saga_view_frame_nbytes(v)) /
                                     counting)
                         : (double)NAN;
    return true;
}

/* Adds the PSNR of a drawn frame to the tally. */
static bool judge_frame(saga_encode_session *s, const look *l, double psnr,
                        int frame, tally *t)
{
    const int set = s->capture.views[l->view].held_out;

    if (!isnan(psnr)) {
        t->sum[set] += psnr;
        t->even[set] += evened_psnr(s, l->view, frame, l->rgb);
        t->n[set]++;
    }
    if (!t->has_float)
        return true;
    t->n_agree[set]++;
    if (!compare_float(s, &psnr, l->rgb, l->view, frame))
        return false;
    t->agree[set] += psnr;
    return true;
}

static bool compare_view(saga_encode_session *s, saga_film *film, int segment,
                         int view, tally *t)
{
    const saga_source_view *const v = &s->capture.views[view];
    /* The verdict needs to know what stands still, which pictures of a moving
     * camera do not show. */
    const bool judged = !v->held_out && !s->capture.moves;
    uint8_t *const median = !judged ? NULL
                                    : saga_verdict_median(&s->capture, view,
                                                          &s->error);
    look l;
    bool ok = open_look(&l, s, film, segment, view) && (median || !judged);
    int frame;

    t->has_float = has_float(s, segment);
    for (int i = 0;
         ok && (frame = saga_capture_sample(&s->capture, view, i)) >= 0; i++) {
        double psnr;

        ok = draw_look(&l, &psnr, s, frame);
        if (ok && median)
            saga_verdict_add(&s->result.verdict, median,
                             saga_capture_frame(&s->capture, view, frame),
                             l.filmed, saga_view_frame_nbytes(v) / 3);
        ok = ok && judge_frame(s, &l, psnr, frame, t);
    }
    close_look(&l);
    free(median);
    return ok;
}

static bool compare_cut(saga_encode_session *s, saga_encode_cut *c, int segment,
                        int view)
{
    const int set = s->capture.views[view].held_out;
    look l;
    bool ok = open_look(&l, s, &c->film, segment, view);
    int frame;

    for (int i = 0;
         ok && (frame = saga_capture_sample(&s->capture, view, i)) >= 0; i++) {
        double psnr;

        ok = draw_look(&l, &psnr, s, frame);
        if (ok && !isnan(psnr)) {
            c->sum[set] += psnr;
            c->n[set]++;
        }
    }
    close_look(&l);
    return ok;
}

/* Opens the file cut after each layer except the last. */
static bool open_cuts(saga_encode_session *s, const saga_bytes *file)
{
    for (int k = 0; k + 1 < s->o->layers; k++) {
        saga_encode_cut *const c = &s->result.cut[k];
        const saga_splice_part part = { .name = s->o->output,
                                        .bytes = file->data,
                                        .nbytes = file->nbytes,
                                        .n_layers = (uint32_t)k + 1 };

        if (!saga_splice(&c->bytes.data, &c->bytes.nbytes, &part, 1,
                         &s->error) ||
            !saga_film_open(&c->film, s->o->output, c->bytes.data,
                            c->bytes.nbytes, s->o->capture.threads, &s->error))
            return false;
    }
    return true;
}

static void close_cuts(saga_encode_session *s)
{
    for (int k = 0; k + 1 < s->o->layers; k++) {
        saga_film_close(&s->result.cut[k].film);
        saga_bytes_free(&s->result.cut[k].bytes);
    }
}

static int written_but(const saga_encode_session *s)
{
    return saga_cli_error(SAGA_EXIT_USAGE,
                          "encode: the file was written, but: "
                          "%s",
                          s->error.message);
}

static int compare_segment(saga_encode_session *s, saga_film *film, int segment,
                           tally *t)
{
    /* A single segment is still in memory from training. With --networks the
     * program trains a single one, too: that of --only. */
    const bool is_there = s->n_segments == 1 || s->o->networks;
    const int status = is_there ? SAGA_EXIT_OK : saga_encode_load(s, segment);

    for (int v = 0; !status && v < s->capture.n_views; v++) {
        bool ok = compare_view(s, film, segment, v, t);

        for (int k = 0; ok && k + 1 < s->o->layers; k++)
            ok = compare_cut(s, &s->result.cut[k], segment, v);
        if (!ok)
            return written_but(s);
    }
    return status;
}

/* --- Between the cameras ------------------------------------------------- */

double saga_encode_between(const saga_encode_result *r)
{
    return r->decoded.n_held_out ? r->decoded.held_out
           : r->predicted        ? r->between.psnr
                                 : (double)NAN;
}

/* Tells whether a prediction takes little time beside the training. */
static bool is_small(const saga_encode_session *s)
{
    const saga_capture *const c = &s->capture;

    return c->n_learned > 0 &&
           saga_between_work(c) < MOST_WORK *
                                      saga_train_n_iterations(s->train) *
                                      c->learned_pixels / c->n_learned;
}

/* Predicts the quality between the cameras from the capture in memory, which is
 * that of the last segment. A part of a film has no use for it. A film is
 * finished even if that fails. */
static void predict(saga_encode_session *s)
{
    saga_encode_result *const r = &s->result;
    const bool asked = s->o->only < 0 && r->decoded.n_training > 0;
    saga_error failure = { "" };

    r->is_short = asked && !is_small(s);
    r->predicted = asked && !r->is_short &&
                   saga_between_predict(
                       &r->between, &s->capture, saga_train_exposure(s->train),
                       r->decoded.training, (uint64_t)s->o->seed, &failure);
    if (saga_failed(&failure))
        saga_cli_error(SAGA_EXIT_OK,
                       "encode: no prediction between cameras: %s",
                       failure.message);
}

/* Returns a mean PSNR, in dB, as the volume has it: Q8, at least 1, or 0 if it
 * is unknown. */
static uint16_t quality_q8(double psnr)
{
    return isnan(psnr) ? 0 : (uint16_t)fmin(fmax(rint(256 * psnr), 1), 65535);
}

/* Writes the file once more, with its viewing volume and the quality that was
 * measured or predicted. A part of a film gets none, because the quality is
 * that of the whole film. */
static bool add_volume(saga_encode_session *s, saga_bytes *bytes)
{
    const uint16_t quality[2] = { quality_q8(s->result.decoded.training),
                                  quality_q8(saga_encode_between(&s->result)) };

    if (s->o->only >= 0)
        return true;
    saga_layout_free(&s->result.layout);
    return saga_encode_add_volume(s, bytes, quality) &&
           saga_output_write(s->o->output, bytes->data, bytes->nbytes,
                             &s->error) &&
           saga_layout_read(&s->result.layout, s->o->output, bytes->data,
                            bytes->nbytes, &s->error);
}

int saga_encode_check(saga_encode_session *s)
{
    tally t = { .has_float = false };
    saga_bytes bytes = { NULL, 0 };
    saga_film film = { .segment = -1 };
    int status = SAGA_EXIT_OK;

    if (!saga_read_file(&bytes, s->o->output, &s->error) ||
        !saga_film_open(&film, s->o->output, bytes.data, bytes.nbytes,
                        s->o->capture.threads, &s->error) ||
        !saga_layout_read(&s->result.layout, s->o->output, bytes.data,
                          bytes.nbytes, &s->error) ||
        !open_cuts(s, &bytes))
        status = written_but(s);
    for (int i = 0; !status && i < s->n_segments; i++)
        if (s->o->only < 0 || s->o->only == i)
            status = compare_segment(s, &film, i, &t);
    for (int k = 0; k + 1 < s->o->layers; k++)
        s->result.cut[k].quality = saga_quality_of(s->result.cut[k].sum,
                                                   s->result.cut[k].n);
    close_cuts(s);
    s->result.decoded = saga_quality_of(t.sum, t.n);
    saga_film_close(&film);
    if (!status) {
        predict(s);
        if (!add_volume(s, &bytes))
            status = written_but(s);
    }
    for (int k = 0; !status && k + 1 < s->o->layers; k++)
        s->result.cut[k].nbytes = saga_layout_cut(&s->result.layout,
                                                  (uint32_t)k + 1);
    saga_bytes_free(&bytes);
    if (saga_encode_exposure(s) > 0)
        s->result.evened = saga_quality_of(t.even, t.n);
    s->result.agreement = saga_quality_of(t.agree, t.n_agree);
    return status;
}
