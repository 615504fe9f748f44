/* SPDX-License-Identifier: MIT
 *
 * The speed of the integer layers over 10,048 points, one at a time and eight
 * together: 64-64-64-32 (10,240 MAC), for which a target time is set, and the
 * shapes of our models.
 */
#include "bench_table.h"
#include "freed.h"
#include "mlp.h"

#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>

#define WIDTH 80
#define LAYERS 3
#define POINTS 10048
#define BATCH 8

/* The layers' widths, from the input to the output. The first shape has a
 * target time. The others are networks of files, named as in
 * docs/arithmetic.md: Fuse, F_geo, a trained hyperprior, E of coarse anchors,
 * and a small E of fine anchors. */
static const uint16_t shapes[][LAYERS + 1] = {
    { 64, 64, 64, 32 }, { 56, 64, 64, 24 }, { 56, 64, 64, 29 },
    { 37, 32, 32, 24 }, { 72, 32, 32, 56 }, { 24, 8, 8, 8 }
};

typedef struct {
    int16_t w16[LAYERS][WIDTH * WIDTH];
    int8_t w8[LAYERS][WIDTH * WIDTH];
    int32_t bias[LAYERS][WIDTH];
    uint8_t shift[LAYERS][WIDTH];
    int16_t in[POINTS * WIDTH];
    int16_t out[POINTS * WIDTH];
    int16_t hidden[2][BATCH * WIDTH];
} bench;

static uint32_t random_bits(uint64_t *state)
{
    *state = *state * 6364136223846793005u + 1442695040888963407u;
    return (uint32_t)(*state >> 33);
}

/* Fills layers and inputs with random numbers. The weights are the same on
 * every machine, whatever layout its vectors need. */
static void fill(bench *b, const uint16_t *dim)
{
    uint64_t state = 1;

    for (size_t l = 0; l < LAYERS; l++) {
        for (uint32_t row = 0; row < dim[l + 1]; row++) {
            for (uint32_t k = 0; k < saga_mlp_pad(dim[l]); k++) {
                const int w = (int)(random_bits(&state) % 255) - 127;
                const size_t at = saga_mlp_weight_at(dim[l], dim[l + 1], row,
                                                     k);

                b->w8[l][at] = (int8_t)(k < dim[l] ? w : 0);
                b->w16[l][at] = b->w8[l][at];
            }
            b->bias[l][row] = (int32_t)(random_bits(&state) % 65536);
            b->shift[l][row] = 9;
        }
    }
    for (size_t i = 0; i < POINTS * WIDTH; i++)
        b->in[i] = (int16_t)(random_bits(&state) % 8192 - 4096);
}

/* Runs all points through the layers, `batch` at a time; the number of points
 * is a multiple of it. */
static void run_points(bench *b, const saga_layer *layer, uint32_t batch)
{
    const size_t in = saga_mlp_pad(layer[0].n_in);
    const size_t out = saga_mlp_pad(layer[2].n_out);

    for (size_t i = 0; i < POINTS; i += batch) {
        saga_mlp_layer(b->hidden[0], &layer[0], b->in + i * in, batch);
        saga_mlp_layer(b->hidden[1], &layer[1], b->hidden[0], batch);
        saga_mlp_layer(b->out + i * out, &layer[2], b->hidden[1], batch);
    }
}

/* The argument of the function that is timed. */
typedef struct {
    bench *b;
    const saga_layer *layer;
    uint32_t batch;
} job;

static void run_job(void *data)
{
    const job *const j = data;

    run_points(j->b, j->layer, j->batch);
}

static void time_network(bench *b, const uint16_t *dim, int int8,
                         uint32_t batch)
{
    saga_layer layer[LAYERS];
    job j = { b, layer, batch };
    double macs = 0;
    char name[56];
    bench_row *r;

    fill(b, dim);
    for (size_t l = 0; l < LAYERS; l++) {
        layer[l].weight = int8 ? (const void *)b->w8[l] : b->w16[l];
        layer[l].bias = b->bias[l];
        layer[l].shift = b->shift[l];
        layer[l].n_in = dim[l];
        layer[l].n_out = dim[l + 1];
        layer[l].int8 = (uint8_t)int8;
        layer[l].relu = l < LAYERS - 1;
        layer[l].cpu = saga_cpu_best();
        macs += (double)dim[l] * dim[l + 1] * POINTS;
    }
    snprintf(name, sizeof name, "mlp %u-%u-%u-%u %s by %u", dim[0], dim[1],
             dim[2], dim[3], int8 ? "int8" : "int16", batch);
    r = bench_measure(name, run_job, &j);
    r->count = POINTS;
    r->each = "a point";
    r->kind = BENCH_MACS;
    r->work = macs;
}

void bench_mlp(void)
{
    FREED bench *const b = bench_need(sizeof *b);

    for (size_t i = 0; i < sizeof shapes / sizeof *shapes; i++) {
        time_network(b, shapes[i], 0, 1);
        time_network(b, shapes[i], 0, BATCH);
        time_network(b, shapes[i], 1, 1);
        time_network(b, shapes[i], 1, BATCH);
    }
}
