/* SPDX-License-Identifier: MIT
 *
 * This program measures the time and the error of each of the decoder's
 * operators, in float64, float32 and integers on the same inputs. Times are CPU
 * nanoseconds of one thread for a unit (minimum, quartiles, median). Errors are
 * differences from float64 over all values. `make numerics` runs it twice, with
 * vector instructions for the integers and without, and draws the results.
 *
 *     bench_numerics NAME [count]
 *
 * NAME is the name of this build's integers in the output, which is JSON. With
 * "count" every operator runs once between two dumps of valgrind's callgrind,
 * which counts instructions.
 */
#include "animate.h"
#include "bench_time.h"
#include "cpu.h"
#include "dense.h"
#include "depth_sort.h"
#include "file.h"
#include "fx.h"
#include "fx_math.h"
#include "gen_scene.h"
#include "interp.h"
#include "memory_bank.h"
#include "mlp.h"
#include "nets.h"
#include "project.h"
#include "raster.h"
#include "reconstruct.h"
#include "ref_scene.h"
#include "splats.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#if defined __has_include
#if __has_include(<valgrind/callgrind.h>)
#include <valgrind/callgrind.h>
#endif
#endif
#ifndef CALLGRIND_ZERO_STATS
#define CALLGRIND_ZERO_STATS
#define CALLGRIND_DUMP_STATS_AT(name) (void)(name)
#endif

enum {
    WIDTH = 64,
    POINTS = 512, /* dense layer, embedding */
    ANCHORS = 512,
    WINDOW = 16,
    NEIGHBOURS = 8,
    FEATURES = 16,
    SOFTMAX_Q8 = 3000,
    SLOTS = 64,
    QUERIES = 64, /* L = D */
    OCTAVES = 4,
    PRIMS = 2048,
    WIDE = 320,
    HIGH = 180,
    PIXELS = WIDE * HIGH,
    SPLATS = 5000,
    LIST = 1 << 14,
    TILE = 16,
    VALUES = 1 << 15, /* a multiple of the counts above */
    REPETITIONS = 15
};

/* Arguments and results of the operators in one type of reals. */
#define REALS(REAL, NAME)                                                  \
    typedef struct {                                                       \
        REAL mean[3], quat[4], slope[4], scale[3], log2_scale[3], opacity, \
            support[3], motion[9], t_centre, log2_width, q0;               \
    } NAME(prim);                                                          \
    typedef struct {                                                       \
        REAL mean[2], chol[3], q0, colour[3];                              \
    } NAME(splat);

#define F32(x) x##_f32
#define F64(x) x##_f64
REALS(float, F32)
REALS(double, F64)

#define FIELDS(REAL, NAME)                                 \
    REAL NAME(x)[VALUES], NAME(y)[VALUES];                 \
    REAL NAME(weight)[WIDTH * WIDTH], NAME(bias)[WIDTH];   \
    REAL NAME(place)[ANCHORS][4], NAME(query)[ANCHORS][4]; \
    REAL NAME(size)[4], NAME(feature)[ANCHORS * FEATURES]; \
    REAL NAME(where)[POINTS][4];                           \
    REAL NAME(start)[SLOTS * SLOTS];                       \
    NAME(prim) NAME(still)[PRIMS], NAME(moved)[PRIMS];     \
    NAME(splat) NAME(splats)[PRIMS], NAME(drawn)[SPLATS];  \
    REAL NAME(plane)[4 * PIXELS];

typedef struct {
    FIELDS(float, F32)
    FIELDS(double, F64)
    int32_t x[VALUES], y[VALUES];
    int16_t in[VALUES], out[VALUES], weight[WIDTH * WIDTH];
    int32_t bias[WIDTH];
    uint8_t shift[WIDTH];
    saga_layer layer;
    saga_model model;
    saga_scaffold sc;
    saga_position query[ANCHORS];
    saga_bank bank;
    int16_t start[SLOTS * SLOTS];
    saga_primitive still[PRIMS];
    saga_animated moved[PRIMS];
    saga_prim_format format;
    saga_camera camera;
    saga_splat projected[PRIMS];
    uint8_t visible[PRIMS];
    saga_splat splats[SPLATS];
    saga_key sorted[SPLATS], keys[SPLATS];
    uint32_t n_splats;
    double n_pairs;
    uint16_t rgb[3 * PIXELS];
    saga_job job;
    uint32_t mask[PRIMS / SAGA_RUN]; /* visible ones, by make_splats */
    saga_cpu cpu;
    struct whole *file;
} data;

/* A file. Decoding its first segment and drawing its first camera's picture are
 * measured like operators. */
struct whole {
    saga_bytes bytes;
    saga_info info;
    saga_segment seg;
    saga_camera camera;
    saga_decoder *dec;
    uint8_t *rgb;
    saga_job job;
    ref_file parts;
    saga_primitive *prims;
    int16_t *colours;
    ref_scene scene;
    ref_splat *splat;
    uint32_t *order;
    double *real_rgb;
};

#define REAL float
#define NAME F32
#define MATH(name) name##f
#include "numerics_real.h"
#undef REAL
#undef NAME
#undef MATH
#define REAL double
#define NAME F64
#define MATH(name) name
#include "numerics_real.h"

/* Runs the trainer's dense layer, which has its own vector code. */
static void dense_float(data *d)
{
    const saga_dense layer = { d->weight_f32, d->bias_f32, WIDTH, 1, NULL };
    const saga_dense_rows x = { d->x_f32, POINTS, WIDTH, WIDTH };

    saga_dense_forward(d->y_f32, &layer, &x);
}

/* --- The integers -------------------------------------------------------- */

static void dense(data *d)
{
    for (int p = 0; p < POINTS; p += SAGA_MAX_POINTS)
        saga_mlp_layer(d->out + p * WIDTH, &d->layer, d->in + p * WIDTH,
                       SAGA_MAX_POINTS);
}

static void interpolate(data *d)
{
    for (uint32_t q = 0; q < ANCHORS; q++) {
        saga_neighbours nb;

        saga_interp_find(&nb, &d->sc, SAGA_TIER_COARSE, &d->query[q], q,
                         SAGA_ALL_GROUPS);
        saga_interp_sum(d->out + q * FEATURES, &d->sc, SAGA_TIER_COARSE, &nb);
    }
}

/* Computes the softmax in the way in which the memory bank is read. */
static void softmax(data *d)
{
    for (int i = 0; i < VALUES; i += SLOTS) {
        const int32_t *const x = d->x + i;
        int32_t *const y = d->y + i, most = x[0];
        uint32_t sum = 0, r;
        int shift;

        /* The softmax is y = 2^(x - most) / sum; subtracting the largest x
         * keeps the powers from overflowing. */
        for (int k = 1; k < SLOTS; k++)
            most = fx_max(most, x[k]);
        for (int k = 0; k < SLOTS; k++)
            y[k] = (most - x[k]) >> 2;
        saga_exp2_neg_each(y, SLOTS);
        for (int k = 0; k < SLOTS; k++)
            sum += (uint32_t)y[k];
        r = saga_recip32(sum, &shift);
        for (int k = 0; k < SLOTS; k++)
            y[k] = (int32_t)fx_rshift64((int64_t)y[k] * r, shift - 14);
    }
}

static void exp2_of(data *d)
{
    memcpy(d->y, d->x, sizeof d->y);
    saga_exp2_neg_each(d->y, VALUES);
}

static void sine(data *d)
{
    saga_sin_turn16_each(d->out, (const uint16_t *)d->in, VALUES, d->cpu);
}

static void softplus(data *d)
{
    for (int i = 0; i < VALUES; i++)
        d->y[i] = saga_softplus2_q12_q20(d->x[i]);
}

static void sigmoid(data *d)
{
    for (int i = 0; i < VALUES; i++)
        d->y[i] = saga_sigmoid_q11_q15((int16_t)d->x[i]);
}

/* A reciprocal's mantissa is stored in y, its exponent in out. */
static void recip16(data *d)
{
    for (int i = 0; i < VALUES; i++) {
        int shift;

        d->y[i] = (int32_t)saga_recip16((uint32_t)d->x[i], &shift);
        d->out[i] = (int16_t)shift;
    }
}

static void recip32(data *d)
{
    for (int i = 0; i < VALUES; i++) {
        int shift;

        d->y[i] = (int32_t)(saga_recip32((uint32_t)d->x[i], &shift) >> 1);
        d->out[i] = (int16_t)(shift - 1);
    }
}

static void root(data *d)
{
    for (int i = 0; i < VALUES; i++) {
        const int zeros = fx_clz32((uint32_t)d->x[i]);
        const saga_float x = { (uint32_t)d->x[i] << zeros >> 1, 31 - zeros };
        const saga_float y = saga_rsqrt(x);

        d->y[i] = (int32_t)y.mant_q30;
        d->out[i] = (int16_t)(30 - y.exp);
    }
}

static void embed(data *d)
{
    for (int p = 0; p < POINTS; p++)
        saga_embed(d->out + 8 * OCTAVES * p, &d->model, d->query[p].x,
                   d->query[p].t, d->cpu);
}

static void bank_read(data *d)
{
    for (int q = 0; q < QUERIES; q++)
        saga_bank_read(d->out + q * SLOTS, &d->bank, d->in + q * SLOTS);
}

static void reset_bank(data *d)
{
    for (uint32_t p = 0; p < SLOTS; p++)
        saga_bank_put(&d->bank, p, d->start + p * SLOTS);
}

static void bank_write(data *d)
{
    reset_bank(d);
    for (uint32_t p = 0; p < SLOTS; p++)
        saga_bank_update(&d->bank, p, d->in + p * SLOTS,
                         (int32_t)(p + 1) * (32768 / SLOTS), 0);
}

static void animate(data *d)
{
    for (int i = 0; i < PRIMS; i++)
        saga_animate(&d->moved[i], &d->still[i], &d->format, 32768);
}

static void project(data *d)
{
    for (int i = 0; i < PRIMS; i++)
        d->visible[i] = (uint8_t)saga_project(&d->projected[i], &d->moved[i],
                                              &d->camera, 0);
}

/* Animates and projects several primitives at a time, as the decoder does. */
static void make_splats(data *d)
{
    const saga_look look = { &d->format, &d->camera, 32768 };

    for (uint32_t i = 0; i < PRIMS; i += SAGA_RUN)
        d->mask[i / SAGA_RUN] = saga_splats(d->projected + i, d->still + i,
                                            SAGA_RUN, &look, d->cpu);
}

static void alpha(data *d)
{
    for (int i = 0; i < VALUES; i++)
        d->y[i] = (int32_t)ref_alpha_q16(d->x[i]);
}

static void blend(data *d)
{
    const saga_drawing drawing = { &d->camera,  d->splats, d->sorted,
                                   d->n_splats, d->cpu,    0 };
    const saga_picture pic = { d->rgb, 6 * WIDE, sizeof d->rgb, 16 };

    memset(d->job.cursor, 0, sizeof d->job.cursor);
    if (saga_raster(&d->job, &pic, &drawing, UINT32_MAX) != SAGA_OK)
        exit(1);
}

static void check(const char *what, int is_right)
{
    if (!is_right) {
        fprintf(stderr, "bench_numerics: %s\n", what);
        exit(1);
    }
}

static void segment(data *d)
{
    struct whole *const w = d->file;

    check("the segment",
          saga_decode(w->dec, &w->seg, w->bytes.data + w->seg.offset,
                      w->seg.nbytes, NULL) == SAGA_OK);
}

static void segment_f64(data *d)
{
    saga_error error = { "" };

    check("the segment", ref_scene_decode(&d->file->scene, &error));
    ref_scene_primitives(&d->file->scene);
}

static void picture(data *d)
{
    struct whole *const w = d->file;
    const size_t stride = 3 * (size_t)w->camera.width;
    const saga_picture pic = { w->rgb, stride, stride * w->camera.height, 8 };

    memset(w->job.cursor, 0, sizeof w->job.cursor);
    check("the picture",
          saga_view(w->dec, &w->camera, w->seg.t) == SAGA_OK &&
              saga_draw(w->dec, &w->job, &pic, UINT32_MAX) == SAGA_OK);
}

static void picture_f64(data *d)
{
    struct whole *const w = d->file;
    const double centre[3] = { w->camera.centre[0], w->camera.centre[1],
                               w->camera.centre[2] };
    uint32_t n = 0;

    for (uint32_t i = 0; i < w->parts.sc.n.prim; i++) {
        ref_animated a;

        ref_animate(&a, &w->scene.prim[i], w->seg.t / 65536.0);
        if (ref_project(&w->splat[n], &a, &w->camera))
            ref_scene_shade(w->splat[n++].colour, &w->scene, i, centre);
    }
    ref_sort(w->order, w->splat, n);
    ref_blend(w->real_rgb, &w->camera, w->splat, w->order, n);
}

/* --- The values to compare ----------------------------------------------- */

enum { INTEGER, FLOAT32, FLOAT64, N_VARIANTS };

typedef struct operator operator;
struct operator
{
    const char *name, *unit;
    double n_units; /* units in a run */
    uint32_t n_values;
    void (*run[N_VARIANTS])(data *); /* NULL if there is no such variant */
    double (*value)(const data *, const operator*, int variant, uint32_t i);
    /* NULL if `saga verify` measures the errors */
    double step; /* what the integers' values are multiplied by */
};

/* Return value i of an operator whose results are in out or y. */
static double of_out(const data *d, const operator* o, int variant, uint32_t i)
{
    return variant == INTEGER   ? d->out[i] * o->step
           : variant == FLOAT32 ? (double)d->y_f32[i]
                                : d->y_f64[i];
}

static double of_y(const data *d, const operator* o, int variant, uint32_t i)
{
    return variant == INTEGER   ? d->y[i] * o->step
           : variant == FLOAT32 ? (double)d->y_f32[i]
                                : d->y_f64[i];
}

/* Returns a reciprocal divided by the correct one. */
static double of_scaled(const data *d, const operator* o, int variant,
                        uint32_t i)
{
    const double right = d->y_f64[i];

    (void)o;
    return (variant == INTEGER   ? ldexp(d->y[i], -d->out[i])
            : variant == FLOAT32 ? (double)d->y_f32[i]
                                 : right) /
           right;
}

static double of_slots(const data *d, const operator* o, int variant,
                       uint32_t i)
{
    return variant == INTEGER   ? d->bank.slot[i] * o->step
           : variant == FLOAT32 ? (double)d->y_f32[i]
                                : d->y_f64[i];
}

/* Returns a coordinate of a position, in units of half the cube. */
static double of_moved(const data *d, const operator* o, int variant,
                       uint32_t i)
{
    const uint32_t p = i / 3, k = i % 3;

    (void)o;
    return (variant == INTEGER   ? d->moved[p].x[k]
            : variant == FLOAT32 ? (double)d->moved_f32[p].mean[k]
                                 : d->moved_f64[p].mean[k]) /
           8388608;
}

static double of_mean(const data *d, const operator* o, int variant, uint32_t i)
{
    const uint32_t p = i / 2, k = i % 2;

    if (!d->visible[p])
        return 0;
    return variant == INTEGER   ? d->projected[p].mean_q8[k] * o->step
           : variant == FLOAT32 ? (double)d->splats_f32[p].mean[k]
                                : d->splats_f64[p].mean[k];
}

/* Returns a coordinate of a splat's mean. make_splats stores the visible splats
 * of a run one after the other, without gaps. */
static double of_splats(const data *d, const operator* o, int variant,
                        uint32_t i)
{
    const uint32_t p = i / 2, k = i % 2, bit = p % SAGA_RUN;
    const uint32_t mask = d->mask[p / SAGA_RUN];
    uint32_t at = p - bit;

    if (!(mask >> bit & 1u))
        return 0;
    for (uint32_t b = 0; b < bit; b++)
        at += mask >> b & 1u;
    return variant == INTEGER   ? d->projected[at].mean_q8[k] * o->step
           : variant == FLOAT32 ? (double)d->splats_f32[p].mean[k]
                                : d->splats_f64[p].mean[k];
}

static double of_conic(const data *d, const operator* o, int variant,
                       uint32_t i)
{
    const uint32_t p = i / 3, k = i % 3;

    if (!d->visible[p])
        return 0;
    return variant == INTEGER   ? d->projected[p].chol_q28[k] * o->step
           : variant == FLOAT32 ? (double)d->splats_f32[p].chol[k]
                                : d->splats_f64[p].chol[k];
}

/* Returns a sample of the picture, 0..1; the background is black. */
static double of_picture(const data *d, const operator* o, int variant,
                         uint32_t i)
{
    const uint32_t at = i % 3 * PIXELS + i / 3;

    (void)o;
    return variant == INTEGER   ? d->rgb[i] / 65535.0
           : variant == FLOAT32 ? (double)d->plane_f32[PIXELS + at]
                                : d->plane_f64[PIXELS + at];
}

/* --- Inputs -------------------------------------------------------------- */

/* Sets x[i] in all three types to x times step. */
static void set_x(data *d, int i, int32_t x, double step)
{
    d->x[i] = x;
    d->x_f64[i] = x * step;
    d->x_f32[i] = (float)d->x_f64[i];
}

static void set_in(data *d, int i, int32_t x, double step)
{
    set_x(d, i, x, step);
    d->in[i] = (int16_t)x;
}

static void prepare_dense(data *d, gen_rng *r)
{
    /* The integers keep weights in the decoder's order, the reals transposed.
     */
    for (int row = 0; row < WIDTH; row++) {
        d->bias[row] = gen_int(r, -(1 << 22), 1 << 22);
        d->bias_f64[row] = d->bias[row] / 16777216.0;
        d->bias_f32[row] = (float)d->bias_f64[row];
        d->shift[row] = 12;
        for (int k = 0; k < WIDTH; k++) {
            const int32_t w = gen_int(r, -1000, 1000);

            d->weight[saga_mlp_weight_at(WIDTH, WIDTH, (uint32_t)row,
                                         (uint32_t)k)] = (int16_t)w;
            d->weight_f64[k * WIDTH + row] = w / 4096.0;
            d->weight_f32[k * WIDTH + row] = (float)(w / 4096.0);
        }
    }
    for (int i = 0; i < POINTS * WIDTH; i++)
        set_in(d, i, gen_int(r, -8192, 8192), 1 / 4096.0);
    d->layer = (saga_layer){ .weight = d->weight,
                             .bias = d->bias,
                             .shift = d->shift,
                             .n_in = WIDTH,
                             .n_out = WIDTH,
                             .relu = 1 };
}

/* Makes anchors along a line, and a point near each. */
static void prepare_places(data *d, gen_rng *r)
{
    enum { HALF = 1 << 18, HALF_T = 1 << 13 };
    saga_coarse *const coarse = calloc(ANCHORS, sizeof *coarse);
    int16_t *const feature = calloc(ANCHORS * FEATURES, sizeof *feature);

    if (!coarse || !feature)
        exit(1);
    memset(&d->model, 0, sizeof d->model);
    d->model.tools = SAGA_TOOL_OPACITY_T;
    d->model.features = FEATURES;
    d->model.octaves = OCTAVES;
    d->model.lambda_t_q8 = 256;
    d->model.tier[0] = (saga_tier){ 1, WINDOW, NEIGHBOURS, 0,
                                    1, 65535,  SOFTMAX_Q8 };
    d->sc.model = &d->model;
    d->sc.n.coarse = ANCHORS;
    d->sc.coarse = coarse;
    d->sc.coarse_feature = feature;
    /* The anchors are 16384 box units apart, plus noise. Each has a query near
     * it, in integers and scaled to cubes of size 1. */
    for (int q = 0; q < ANCHORS; q++) {
        saga_position *const p = &d->query[q];

        coarse[q].depth_x = 5;
        coarse[q].depth_t = 2;
        for (int i = 0; i < 3; i++) {
            coarse[q].x[i] = gen_int(r, -(1 << 20), 1 << 20) +
                             (q - ANCHORS / 2) * 16384;
            p->x[i] = coarse[q].x[i] + gen_int(r, -HALF, HALF);
            p->support[i] = HALF;
            d->place_f64[q][i] = coarse[q].x[i] / 8388608.0;
            d->query_f64[q][i] = p->x[i] / 8388608.0;
            d->where_f64[q][i] = p->x[i] / 33554432.0;
        }
        coarse[q].t = (uint16_t)gen_int(r, 20000, 40000);
        p->t = coarse[q].t + gen_int(r, -HALF_T, HALF_T);
        p->support[3] = HALF_T;
        d->place_f64[q][3] = coarse[q].t / 65536.0;
        d->query_f64[q][3] = p->t / 65536.0;
        d->where_f64[q][3] = (p->t - 32768) / 131072.0;
        for (int i = 0; i < FEATURES; i++) {
            feature[q * FEATURES + i] = (int16_t)gen_int(r, -8192, 8192);
            d->feature_f64[q * FEATURES + i] = feature[q * FEATURES + i] /
                                               4096.0;
        }
    }
    for (int i = 0; i < 4; i++)
        d->size_f64[i] = i < 3 ? HALF / 8388608.0 : HALF_T / 65536.0;
    /* The float variant gets the same numbers. */
    for (int i = 0; i < 4; i++)
        d->size_f32[i] = (float)d->size_f64[i];
    for (int q = 0; q < ANCHORS; q++)
        for (int i = 0; i < 4; i++) {
            d->place_f32[q][i] = (float)d->place_f64[q][i];
            d->query_f32[q][i] = (float)d->query_f64[q][i];
            d->where_f32[q][i] = (float)d->where_f64[q][i];
        }
    for (int i = 0; i < ANCHORS * FEATURES; i++)
        d->feature_f32[i] = (float)d->feature_f64[i];
}

static void prepare_bank(data *d, gen_rng *r)
{
    if (!d->bank.slot) {
        void *block;

        d->bank.n_slots = d->bank.width = SLOTS;
        block = aligned_alloc(16, saga_bank_lay(&d->bank, NULL));
        if (!block)
            exit(1);
        saga_bank_lay(&d->bank, block);
        saga_bank_start(&d->bank);
        memcpy(d->start, d->bank.slot, sizeof d->start);
    }
    /* Each run begins from this state. */
    for (int i = 0; i < SLOTS * SLOTS; i++) {
        d->start_f64[i] = d->start[i] / 4096.0;
        d->start_f32[i] = (float)d->start_f64[i];
    }
    (void)r;
}

static void prepare_read(data *d, gen_rng *r)
{
    prepare_bank(d, r);
    reset_bank(d);
    for (int i = 0; i < QUERIES * SLOTS; i++)
        set_in(d, i, gen_int(r, -4096, 4096), 1 / 1024.0);
}

static void prepare_write(data *d, gen_rng *r)
{
    prepare_bank(d, r);
    for (int i = 0; i < SLOTS * SLOTS; i++)
        set_in(d, i, gen_int(r, -4096, 4096), 1 / 4096.0);
}

/* Makes primitives in front of the camera that move, turn and fade. */
static void prepare_prims(data *d, gen_rng *r)
{
    const saga_prim_format format = { 12, 12, 12, { 12, 12, 12 },
                                      3,  1,  1,  sizeof(saga_primitive),
                                      0 };

    d->format = format;
    gen_front_camera(&d->camera, WIDE, HIGH);
    gen_uniform_scene(d->still, PRIMS, r, &d->camera);
    for (int i = 0; i < PRIMS; i++) {
        saga_primitive *const p = &d->still[i];
        ref_primitive as_real;
        F64(prim) *const q = &d->still_f64[i];

        for (int k = 0; k < 4; k++) {
            p->quat[k] = (int16_t)gen_int(r, -4096, 4096);
            p->slope[k] = (int16_t)gen_int(r, -1024, 1024);
        }
        for (int k = 0; k < 9; k++)
            p->motion[k] = (int16_t)gen_int(r, -2048, 2048);
        for (int k = 0; k < 3; k++)
            p->support[k] = 1 << 15;
        p->opacity = (int16_t)gen_int(r, -8192, 16384);
        p->t_centre = gen_int(r, 0, 65535);
        p->log2_width_q10 = (int16_t)gen_int(r, 14 * 1024, 17 * 1024);
        /* The other variants get the same primitive, first in float64, then in
         * float32. */
        ref_primitive_of(&as_real, p, &format);
        memcpy(q->mean, as_real.mean, sizeof q->mean);
        memcpy(q->quat, as_real.quat, sizeof q->quat);
        memcpy(q->slope, as_real.slope, sizeof q->slope);
        memcpy(q->log2_scale, as_real.log2_scale, sizeof q->log2_scale);
        memcpy(q->support, as_real.support, sizeof q->support);
        memcpy(q->motion, as_real.motion, sizeof q->motion);
        q->opacity = as_real.opacity;
        q->t_centre = as_real.t_centre;
        q->log2_width = as_real.log2_width;
        for (size_t j = 0; j < sizeof *q / sizeof(double); j++)
            ((float *)&d->still_f32[i])[j] = (float)((double *)q)[j];
    }
}

/* Makes the primitives that all three variants project: those that the integers
 * have animated. */
static void prepare_moved(data *d, gen_rng *r)
{
    prepare_prims(d, r);
    animate(d);
    for (int i = 0; i < PRIMS; i++) {
        F64(prim) *const q = &d->moved_f64[i];
        ref_animated a;

        ref_animated_of(&a, &d->moved[i]);
        memcpy(q->mean, a.x, sizeof q->mean);
        memcpy(q->quat, a.quat, sizeof q->quat);
        memcpy(q->scale, a.scale, sizeof q->scale);
        q->q0 = a.q0;
        for (size_t j = 0; j < sizeof *q / sizeof(double); j++)
            ((float *)&d->moved_f32[i])[j] = (float)((double *)q)[j];
    }
    project(d); /* sets which are visible and thus compared */
}

static void prepare_splats(data *d, gen_rng *r)
{
    prepare_prims(d, r);
    make_splats(d);
}

static void prepare_picture(data *d, gen_rng *r)
{
    static saga_primitive prims[SPLATS];

    gen_front_camera(&d->camera, WIDE, HIGH);
    memset(d->camera.background_q15, 0, sizeof d->camera.background_q15);
    gen_uniform_scene(prims, SPLATS, r, &d->camera);
    d->n_splats = gen_splats(d->splats, NULL, prims, &gen_still_format, SPLATS,
                             &d->camera, 32768);
    /* The other variants get the same splats. A pair is a splat and a pixel of
     * its box. */
    d->n_pairs = 0;
    for (uint32_t i = 0; i < d->n_splats; i++) {
        const saga_splat *const s = &d->splats[i];
        F64(splat) *const q = &d->drawn_f64[i];
        ref_splat as_real;

        ref_splat_of(&as_real, s);
        memcpy(q->mean, as_real.mean, sizeof q->mean);
        memcpy(q->chol, as_real.chol, sizeof q->chol);
        memcpy(q->colour, as_real.colour, sizeof q->colour);
        q->q0 = as_real.q0;
        for (size_t j = 0; j < sizeof *q / sizeof(double); j++)
            ((float *)&d->drawn_f32[i])[j] = (float)((double *)q)[j];
        d->keys[i] = d->sorted[i] = (saga_key){ s->depth, i };
        d->n_pairs += (double)(s->x1 - s->x0) * (s->y1 - s->y0);
    }
    saga_depth_sort(d->sorted, d->keys, d->n_splats);
    (void)saga_raster_boxes(d->sorted, d->splats, d->n_splats, &d->camera);
    if (!d->job.scratch) {
        d->job = (saga_job){
            .x1 = WIDE, .y1 = HIGH, .tile = TILE, .list_capacity = LIST
        };
        d->job.scratch_nbytes = SAGA_JOB_NBYTES(TILE, 0) *
                                    (WIDE / TILE * ((HIGH + 15) / TILE)) +
                                8 * (size_t)LIST;
        d->job.scratch = malloc(d->job.scratch_nbytes);
        if (!d->job.scratch)
            exit(1);
    }
}

static void *need(size_t count, size_t size)
{
    void *const p = aligned_alloc(64, (count * size + 127) & ~(size_t)63);

    check("out of memory", p != NULL);
    return p;
}

static void take_apart(struct whole *w)
{
    const saga_model *const m = &w->parts.h.model;
    saga_error error = { "" };
    const char *const why = ref_file_read_layer(&w->parts, w->bytes.data,
                                                w->bytes.nbytes, &w->seg, 0);
    uint32_t n, stride;

    check(why ? why : "", !why);
    n = w->parts.sc.n.prim;
    stride = m->width[SAGA_NET_COLOUR];
    w->prims = need(n, sizeof *w->prims);
    w->colours = need(n, (stride + 3) * sizeof *w->colours);
    saga_reconstruct(&w->parts.sc, w->prims, sizeof *w->prims, w->colours,
                     m->tools & SAGA_TOOL_VIEW ? stride : 3);
    check(error.message,
          ref_scene_make(&w->scene, &w->parts, w->prims, w->colours, &error));
    w->splat = need(n, sizeof *w->splat);
    w->order = need(n, sizeof *w->order);
}

static void prepare_file(data *d, gen_rng *r)
{
    static struct whole w;
    saga_error error = { "" };
    uint32_t number;
    size_t n;

    (void)r;
    if (d->file)
        return;
    d->file = &w;
    check("docs/demo.saga: run this from the root of the tree",
          saga_read_file(&w.bytes, "docs/demo.saga", &error));
    check("docs/demo.saga: refused",
          !saga_probe(&w.info, w.bytes.data, w.bytes.nbytes) &&
              !saga_find(&w.seg, w.bytes.data, w.bytes.nbytes, 0, 1) &&
              !saga_rig(&w.camera, &number, w.bytes.data, w.bytes.nbytes, 0) &&
              !saga_open(&w.dec, need(1, w.info.work_nbytes),
                         w.info.work_nbytes, w.bytes.data, w.bytes.nbytes,
                         NULL));
    /* Both the decoder and the reference in double draw the picture. */
    n = (size_t)w.camera.width * w.camera.height;
    w.rgb = need(n, 3);
    w.real_rgb = need(n, 3 * sizeof *w.real_rgb);
    w.job = (saga_job){ .x1 = w.camera.width,
                        .y1 = w.camera.height,
                        .tile = TILE,
                        .list_capacity = LIST };
    w.job.scratch_nbytes = SAGA_JOB_NBYTES(TILE, LIST) + 16 * n + (1u << 16);
    w.job.scratch = need(1, w.job.scratch_nbytes);
    take_apart(&w);
    segment(d);
}

/* --- The table ----------------------------------------------------------- */

#define RUNS(f)           \
    {                     \
        f, F32(f), F64(f) \
    }

typedef struct {
    operator op;
    void (*prepare)(data *, gen_rng *); /* NULL: VALUES random integers lo..hi,
                                         * times step */
    int32_t lo, hi;
    double step;
} entry;

static const entry entries[] = {
    { { "dense layer 64-64",
        "point",
        POINTS,
        POINTS *WIDTH,
        { dense, dense_float, dense_f64 },
        of_out,
        1 / 4096.0 },
      .prepare = prepare_dense },
    { { "interpolation, 8 of 33", "query", ANCHORS, ANCHORS *FEATURES,
        RUNS(interpolate), of_out, 1 / 4096.0 },
      .prepare = prepare_places },
    { { "softmax of 64", "value", VALUES, VALUES, RUNS(softmax), of_y,
        1 / 16384.0 },
      NULL,
      -(1 << 24),
      1 << 24,
      1 / 4194304.0 },
    { { "2^-x",
        "value",
        VALUES,
        VALUES,
        { exp2_of, exp2_f32, exp2_f64 },
        of_y,
        1 / 32768.0 },
      NULL,
      0,
      (16 << 20) - 1,
      1 / 1048576.0 },
    { { "sine", "value", VALUES, VALUES, RUNS(sine), of_out, 1 / 32768.0 },
      NULL,
      -32768,
      32767,
      1 / 65536.0 },
    { { "softplus", "value", VALUES, VALUES, RUNS(softplus), of_y,
        1 / 1048576.0 },
      NULL,
      -32768,
      32767,
      1 / 4096.0 },
    { { "sigmoid", "value", VALUES, VALUES, RUNS(sigmoid), of_y, 1 / 32768.0 },
      NULL,
      -16384,
      16384,
      1 / 2048.0 },
    { { "1/x, 16 bits",
        "value",
        VALUES,
        VALUES,
        { recip16, reciprocal_f32, reciprocal_f64 },
        of_scaled,
        0 },
      NULL,
      1,
      INT32_MAX,
      1 },
    { { "1/x, 32 bits",
        "value",
        VALUES,
        VALUES,
        { recip32, reciprocal_f32, reciprocal_f64 },
        of_scaled,
        0 },
      NULL,
      1,
      INT32_MAX,
      1 },
    { { "1/sqrt(x)", "value", VALUES, VALUES, RUNS(root), of_scaled, 0 },
      NULL,
      1,
      INT32_MAX,
      1 },
    { { "embedding, 4 octaves", "position", POINTS, POINTS * 8 * OCTAVES,
        RUNS(embed), of_out, 1 / 32768.0 },
      .prepare = prepare_places },
    { { "memory read, 64 slots", "query", QUERIES, QUERIES *SLOTS,
        RUNS(bank_read), of_out, 1 / 4096.0 },
      .prepare = prepare_read },
    { { "memory write", "slot", SLOTS, SLOTS *SLOTS, RUNS(bank_write), of_slots,
        1 / 4096.0 },
      .prepare = prepare_write },
    { { "animate", "primitive", PRIMS, 3 * PRIMS, RUNS(animate), of_moved, 0 },
      .prepare = prepare_prims },
    { { "project: mean", "primitive", PRIMS, 2 * PRIMS, RUNS(project), of_mean,
        1 / 256.0 },
      .prepare = prepare_moved },
    { { "project: conic", "primitive", PRIMS, 3 * PRIMS, RUNS(project),
        of_conic, 1 / 268435456.0 },
      .prepare = prepare_moved },
    { { "animate and project", "primitive", PRIMS, 2 * PRIMS, RUNS(make_splats),
        of_splats, 1 / 256.0 },
      .prepare = prepare_splats },
    { { "alpha", "value", VALUES, VALUES, RUNS(alpha), of_y, 1 / 65536.0 },
      NULL,
      0,
      SAGA_CUT_Q20 - 1,
      1 / 1048576.0 },
    { { "blend", "pixel of a splat", 0, 3 * PIXELS, RUNS(blend), of_picture,
        0 },
      .prepare = prepare_picture },
    { { "segment (demo)",
        "primitive",
        0,
        0,
        { segment, NULL, segment_f64 },
        NULL,
        0 },
      .prepare = prepare_file },
    { { "picture (demo)",
        "pixel",
        0,
        0,
        { picture, NULL, picture_f64 },
        NULL,
        0 },
      .prepare = prepare_file }
};

enum { N_OPERATORS = (int)(sizeof entries / sizeof entries[0]) };

/* --- Measuring ----------------------------------------------------------- */

/* Times an operator. A repetition runs it so often that it takes at least a
 * millisecond. */
static bench_times measure(const operator* o, int variant, data *d)
{
    bench_times t = { { 0 }, 0 };
    double once;
    int runs = 1;

    o->run[variant](d);
    do {
        const double start = bench_now_ms();

        for (int i = 0; i < runs; i++)
            o->run[variant](d);
        once = bench_now_ms() - start;
        if (once < 1)
            runs *= 2;
    } while (once < 1);
    for (int k = 0; k < REPETITIONS; k++) {
        const double start = bench_now_ms();

        for (int i = 0; i < runs; i++)
            o->run[variant](d);
        bench_add(&t, (bench_now_ms() - start) / runs);
    }
    bench_median(&t);
    return t;
}

static void print_times(const bench_times *t, double n_units)
{
    const int at[] = { 0, REPETITIONS / 4, REPETITIONS / 2,
                       3 * REPETITIONS / 4 };

    printf("\"ns\": [");
    for (int i = 0; i < 4; i++)
        printf("%s%.5g", i ? ", " : "", 1e6 * t->ms[at[i]] / n_units);
    printf("]");
}

static void print_errors(const operator* o, int variant, const data *d)
{
    double sum = 0, max = 0, peak = 0;

    for (uint32_t i = 0; i < o->n_values; i++) {
        const double right = o->value(d, o, FLOAT64, i);
        const double e = fabs(o->value(d, o, variant, i) - right);

        sum += e * e;
        max = fmax(max, e);
        peak = fmax(peak, fabs(right));
    }
    printf(", \"rms\": %.5g, \"max\": %.5g, \"peak\": %.5g, \"n\": %u",
           sqrt(sum / o->n_values), max, peak, (unsigned)o->n_values);
}

static void prepare(const entry *e, data *d)
{
    gen_rng r = { 1 };

    if (e->prepare)
        e->prepare(d, &r);
    else
        for (int i = 0; i < VALUES; i++)
            set_in(d, i, gen_int(&r, e->lo, e->hi), e->step);
}

/* Returns the number of units, which for some operators depends on the input.
 */
static double n_units(const entry *e, const data *d)
{
    if (e->prepare == prepare_picture)
        return d->n_pairs;
    if (e->prepare != prepare_file)
        return e->op.n_units;
    return e->op.run[INTEGER] == segment
               ? d->file->parts.sc.n.prim
               : (double)d->file->camera.width * d->file->camera.height;
}

static void report(const entry *e, data *d, const char *name, int is_first)
{
    static const char *const variants[N_VARIANTS] = { NULL, "float32",
                                                      "float64" };
    const double n = n_units(e, d);

    for (int v = N_VARIANTS; v-- > 0;) {
        bench_times t;

        if (!e->op.run[v])
            continue;
        t = measure(&e->op, v, d);
        printf("%s\n    { \"operator\": \"%s\", \"variant\": \"%s\", "
               "\"unit\": \"%s\", \"n_units\": %.0f, ",
               is_first && v == FLOAT64 ? "" : ",", e->op.name,
               v == INTEGER ? name : variants[v], e->op.unit, n);
        print_times(&t, n);
        if (e->op.value)
            print_errors(&e->op, v, d);
        printf(" }");
        fflush(stdout);
    }
}

static void count(const entry *e, data *d)
{
    static const char *const variants[N_VARIANTS] = { "integer", "float32",
                                                      "float64" };

    for (int v = 0; v < N_VARIANTS; v++) {
        char name[80];

        if (!e->op.run[v])
            continue;
        snprintf(name, sizeof name, "%s|%s|%.0f", e->op.name, variants[v],
                 n_units(e, d));
        CALLGRIND_ZERO_STATS;
        e->op.run[v](d);
        CALLGRIND_DUMP_STATS_AT(name);
    }
}

int main(int argc, char **argv)
{
    static data d;
    const int counts = argc > 2 && !strcmp(argv[2], "count");

    if (argc < 2 || argc > 3 || (argc == 3 && !counts)) {
        fprintf(stderr, "usage: bench_numerics NAME [count]\n");
        return 2;
    }
    d.cpu = saga_cpu_best();
    if (!counts)
        printf("{ \"operators\": [");
    for (int i = 0; i < N_OPERATORS; i++) {
        prepare(&entries[i], &d);
        if (counts)
            count(&entries[i], &d);
        else
            report(&entries[i], &d, argv[1], i == 0);
    }
    if (!counts)
        puts("\n] }");
    return 0;
}
