/* SPDX-License-Identifier: MIT
 *
 * How much the anchors of a file have in common (paper: Hierarchical 4D Anchor,
 * shareability): the features of a share of them are masked and recovered from
 * the others, by the file's own interpolation and by two that know nothing of
 * space and time. Everything is in double, from the decoded features on.
 */
#ifndef SAGA_MASK_H
#define SAGA_MASK_H

#include "error.h"
#include "verify.h"

#include <stddef.h>
#include <stdint.h>

/* Features are recovered from one of these. */
enum {
    SAGA_RECOVER_NEIGHBOURS, /* the interpolation of the file, over the anchors
                              * that are known: nearest in space and time */
    SAGA_RECOVER_RANDOM,     /* as many known ones from anywhere in the level,
                              * with the same weights */
    SAGA_RECOVER_MEAN,       /* the mean of all known ones */
    SAGA_N_RECOVERS
};

/* The paper's masking ratios are not known; these are ours. */
enum { SAGA_MASK_SHARES = 5, SAGA_MASK_MAX_ROWS = 2 * SAGA_MASK_SHARES };

typedef struct saga_mask_score {
    double error;            /* rms of what is wrong over rms of what was
                              * masked; 0 where both are */
    double cosine;           /* between an anchor's features and what was
                              * recovered, mean over those that are not 0; NaN
                              * of none */
    double psnr;             /* of the picture, against the one with nothing
                              * masked; INFINITY where they are equal */
} saga_mask_score;

/* A level with so much of it masked. */
typedef struct saga_mask_row {
    int tier;                /* SAGA_TIER_* */
    int percent;
    uint32_t n, n_masked;    /* anchors */
    uint32_t n_alone;        /* masked, without a known neighbour */
    saga_mask_score by[SAGA_N_RECOVERS];
} saga_mask_row;

typedef struct saga_mask {
    uint32_t segment;
    int32_t t;               /* 1/65536 of the segment */
    int n_rows;              /* levels of a single anchor have none */
    saga_mask_row row[SAGA_MASK_MAX_ROWS];
} saga_mask;

/* The segment and the picture are view's, of the file bytes[0..nbytes) that
 * messages call `name`. percent 1..99; 0: 10, 30, 50, 70 and 90. False: *error
 * says why. */
bool saga_mask_file(saga_mask *mask, const char *name, const uint8_t *bytes,
                    size_t nbytes, const saga_verify_view *view, int percent,
                    saga_error *error);

#endif
