/* SPDX-License-Identifier: MIT
 *
 * What cloud_4dgs.c, which reads the records of a .4dgs film and draws splats
 * at a moment, shares with cloud_4dgs_chunk.c, which unpacks a chunk.
 */
#ifndef SAGA_CLOUD_4DGS_CHUNK_H
#define SAGA_CLOUD_4DGS_CHUNK_H

#include "cloud_4dgs.h"
#include "cloud_files.h"

/* Attributes have their numbers in the chunks. */
enum {
    POSITION, SCALE, ROTATION_INDEX, ROTATION, COLOUR, OPACITY, MOTION, MIDDLE,
    SIGMA, FLAGS, WINDOW, N_ATTRIBUTES
};

/* Steps in the order of their record. */
enum {
    STEP_POSITION, STEP_LOG_SCALE, STEP_ROTATION, STEP_COLOUR, STEP_OPACITY,
    STEP_MOTION, STEP_TIME, STEP_LOG_SIGMA, N_STEPS
};

/* The numbers of a stream. */
typedef struct saga_4dgs_numbers {
    int32_t *value;          /* (n, channels), or (channels) of a constant */
    int channels;
    bool constant;
} saga_4dgs_numbers;

typedef struct saga_4dgs_chunk {
    double from, to;         /* seconds */
    uint32_t n;
    saga_cursor streams;
    saga_cursor band[SAGA_MAX_DEGREE]; /* next is NULL: none */
} saga_4dgs_chunk;

struct saga_4dgs {
    const char *path;
    int n_frames, degree;
    double fps, duration;
    double cutoff;           /* splats that have faded below it are not seen */
    double reach;            /* after that many sigmas */
    uint64_t n;              /* splats of all chunks, as the header has it */
    double origin[3], step[N_STEPS];
    const uint8_t *window;   /* (n_windows, 2) f64 seconds */
    uint32_t n_windows;
    saga_4dgs_chunk *chunks;
    size_t n_chunks;
    bool has_head, has_steps;
};

/* The unpacked numbers of a chunk. */
typedef struct saga_4dgs_splats {
    saga_4dgs_numbers a[N_ATTRIBUTES], band[SAGA_MAX_DEGREE];
} saga_4dgs_splats;

/* Takes n bytes, which have a cursor of their own. */
saga_cursor saga_4dgs_block(saga_cursor *c, uint64_t n);

/* Sets the error that the film is damaged. Returns false. */
bool saga_4dgs_damaged(const saga_4dgs *f, const char *what,
                       saga_error *error);

/* Unpacks a chunk. Returns false with *error set if the film is damaged. The
 * caller frees *to by saga_4dgs_splats_free, also after a failure. */
bool saga_4dgs_splats_read(saga_4dgs_splats *to, const saga_4dgs *f,
                           const saga_4dgs_chunk *k, saga_error *error);
void saga_4dgs_splats_free(saga_4dgs_splats *s);

/* Returns a number of splat i. */
int32_t saga_4dgs_at(const saga_4dgs_numbers *a, uint32_t i, int channel);

#endif
