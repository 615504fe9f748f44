/* SPDX-License-Identifier: MIT
 *
 * How exact the integer decoder is on a file: each of its stages, and the
 * picture, beside the same formulas in double (docs/arithmetic.md without its
 * roundings). Symbols, neighbours and the order of splats are the decoder's.
 *
 * Rows come twice: `alone`, a stage in double on what the integers gave it, and
 * `chain`, everything in double since the symbols.
 */
#ifndef SAGA_VERIFY_H
#define SAGA_VERIFY_H

#include "error.h"
#include "saga.h"

#include <stddef.h>
#include <stdint.h>

enum {
    SAGA_VERIFY_SYMBOLS,     /* predictions, and what is decoded with them */
    SAGA_VERIFY_SCAFFOLD,    /* fine anchors: features, supports */
    SAGA_VERIFY_PRIMITIVES,
    SAGA_VERIFY_ANIMATION,   /* primitives at the time */
    SAGA_VERIFY_SPLATS,      /* in the camera */
    SAGA_VERIFY_PIXELS,
    SAGA_VERIFY_N_STAGES
};

extern const char *const saga_verify_stage[SAGA_VERIFY_N_STAGES];

/* Differences of n values, in units of the row. */
typedef struct saga_verify_error {
    uint64_t n;
    double max, rms;
    double psnr;             /* 20 log10(largest reference / rms), INFINITY
                              * where nothing differs */
} saga_verify_error;

typedef struct saga_verify_row {
    int stage;
    const char *name, *unit;
    double step;             /* last place of the integers, in units; of
                              * features the coarsest channel's */
    saga_verify_error alone, chain;
} saga_verify_row;

/* The decoder's 8-bit picture beside one in double. */
typedef struct saga_verify_picture {
    double psnr;             /* against that rounded to 8 bits */
    double psnr_real;        /* against that itself */
    double rms;              /* levels, before the norm rounds to 8 bits */
    int max;                 /* levels of 255, rounded to 8 bits */
    uint64_t n_far;          /* samples that are more than a level off so */
    double max_real;
    uint64_t n_cut, n_stop;  /* pixels where one of the two blends a splat and
                              * the other does not, at the cut or the stop */
    double psnr_same;        /* psnr and max of all other pixels */
    int max_same;
} saga_verify_picture;

enum { SAGA_VERIFY_MAX_ROWS = 40 };

typedef struct saga_verify {
    uint32_t n_coarse, n_fine, n_primitives, n_splats;
    uint32_t n_splats_otherwise; /* only one of the two blends them */
    uint64_t n_pixels;
    uint32_t segment;
    int32_t t;               /* 1/65536 of the segment */
    saga_verify_row row[SAGA_VERIFY_MAX_ROWS];
    int n_rows;
    saga_verify_picture picture[SAGA_VERIFY_N_STAGES]; /* [i]: integers before
                              * stage i, double from there on */
} saga_verify;

/* As trainer's saga_progress_fn; what it returns is not looked at. */
typedef bool saga_verify_progress(void *user, double done, const char *doing);

/* The picture is the camera's at frame_num / frame_den frames from the start
 * of the file. progress may be NULL. */
typedef struct saga_verify_view {
    saga_camera camera;
    uint32_t frame_num, frame_den;
    saga_verify_progress *progress;
    void *user;
} saga_verify_view;

/* bytes[0..nbytes) is a file, `name` what messages call it. False: *error says
 * why; also where the decoder's picture is not the norm's, pixel by pixel. */
bool saga_verify_file(saga_verify *v, const char *name, const uint8_t *bytes,
                      size_t nbytes, const saga_verify_view *view,
                      saga_error *error);

#endif
