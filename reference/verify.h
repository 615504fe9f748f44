/* SPDX-License-Identifier: MIT
 *
 * This file measures how exact the integer decoder is on a file. Each of its
 * stages, and the picture, is compared with the same formulas in double
 * (docs/arithmetic.md without its roundings). Symbols, neighbours and the order
 * of splats are taken from the decoder.
 *
 * Each row has two results. `alone` runs one stage in double on the integer
 * inputs of that stage; `chain` runs everything after the symbols in double.
 */
#ifndef SAGA_VERIFY_H
#define SAGA_VERIFY_H

#include "error.h"
#include "saga.h"

#include <stddef.h>
#include <stdint.h>

enum {
    SAGA_VERIFY_SYMBOLS,  /* predictions, and the values decoded with them */
    SAGA_VERIFY_SCAFFOLD, /* fine anchors: features, supports */
    SAGA_VERIFY_PRIMITIVES,
    SAGA_VERIFY_ANIMATION, /* primitives at the picture's time */
    SAGA_VERIFY_SPLATS,    /* primitives projected into the camera */
    SAGA_VERIFY_PIXELS,
    SAGA_VERIFY_N_STAGES
};

extern const char *const saga_verify_stage[SAGA_VERIFY_N_STAGES];

/* Differences between n values in integers and in double, in the unit of the
 * row. */
typedef struct saga_verify_error {
    uint64_t n;
    double max, rms;
    double psnr; /* 20 log10(largest reference / rms), INFINITY
                  * if nothing differs */
} saga_verify_error;

typedef struct saga_verify_row {
    int stage;
    const char *name, *unit;
    double step; /* one last place of the integers, in units; for
                  * features that of the coarsest channel */
    saga_verify_error alone, chain;
} saga_verify_row;

/* The decoder's 8-bit picture compared with a picture in double. Differences
 * are in levels of 255. */
typedef struct saga_verify_picture {
    double psnr;            /* against the double picture rounded to 8 bits */
    double psnr_real;       /* against the double picture itself */
    double rms;             /* rms difference of the integer picture before it
                             * is rounded to 8 bits */
    int max;                /* largest difference from the rounded double
                             * picture */
    uint64_t n_far;         /* samples that differ from it by more than 1 */
    double max_real;        /* largest difference from the double picture
                             * itself */
    uint64_t n_cut, n_stop; /* pixels where one picture blends a splat and the
                             * other does not, because of the cut or the stop
                             */
    double psnr_same;       /* psnr and max over all other pixels */
    int max_same;
} saga_verify_picture;

enum { SAGA_VERIFY_MAX_ROWS = 40 };

typedef struct saga_verify {
    uint32_t n_coarse, n_fine, n_primitives, n_splats;
    uint32_t n_splats_otherwise; /* splats that only one picture blends */
    uint64_t n_pixels;
    uint32_t segment;
    int32_t t; /* time of the picture, in 1/65536 of the
                * segment */
    saga_verify_row row[SAGA_VERIFY_MAX_ROWS];
    int n_rows;
    saga_verify_picture
        picture[SAGA_VERIFY_N_STAGES]; /* [i]: the stages before
                                        * i in integers, i and later stages in
                                        * double */
} saga_verify;

/* A function like the trainer's saga_progress_fn; its result is ignored. */
typedef bool saga_verify_progress(void *user, double done, const char *doing);

/* Selects the picture: that of the camera, frame_num / frame_den frames after
 * the start of the file. progress may be NULL. */
typedef struct saga_verify_view {
    saga_camera camera;
    uint32_t frame_num, frame_den;
    saga_verify_progress *progress;
    void *user;
} saga_verify_view;

/* Verifies the file bytes[0..nbytes), which messages call `name`. Returns false
 * and sets *error if the file is refused, memory is missing, or a pixel of the
 * decoder's picture differs from the integer reference (ref_render.h). */
bool saga_verify_file(saga_verify *v, const char *name, const uint8_t *bytes,
                      size_t nbytes, const saga_verify_view *view,
                      saga_error *error);

#endif
