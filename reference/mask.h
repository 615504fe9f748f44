/* SPDX-License-Identifier: MIT
 *
 * This file measures how much the anchors of a file have in common (paper:
 * Hierarchical 4D Anchor, shareability). The features of some anchors are
 * masked and recovered from the other anchors, by the file's own interpolation
 * and by two methods that ignore space and time. Everything after the decoded
 * features is computed in double.
 */
#ifndef SAGA_MASK_H
#define SAGA_MASK_H

#include "error.h"
#include "verify.h"

#include <stddef.h>
#include <stdint.h>

/* The methods that recover the features of a masked anchor. */
enum {
    SAGA_RECOVER_NEIGHBOURS, /* the file's interpolation, over the known
                              * anchors nearest in space and time */
    SAGA_RECOVER_RANDOM,     /* the same number of known anchors, drawn from
                              * the whole tier, with the same weights */
    SAGA_RECOVER_MEAN,       /* the mean of all known anchors of the tier */
    SAGA_N_RECOVERS
};

/* The paper does not give its masking ratios. We use five: see saga_mask_file.
 */
enum { SAGA_MASK_SHARES = 5, SAGA_MASK_MAX_ROWS = 2 * SAGA_MASK_SHARES };

typedef struct saga_mask_score {
    double error;            /* rms error of the recovered features, divided by
                              * the rms of the masked ones; 0 if all are equal
                              */
    double cosine;           /* similarity of masked and recovered features: the
                              * mean over anchors where neither is 0; NaN if
                              * there is no such anchor */
    double psnr;             /* PSNR of the picture against the picture without
                              * masking; INFINITY if they are equal */
} saga_mask_score;

/* The result for one tier and one percentage of masked anchors. */
typedef struct saga_mask_row {
    int tier;                /* SAGA_TIER_* */
    int percent;
    uint32_t n, n_masked;    /* anchors */
    uint32_t n_alone;        /* masked anchors without a known neighbour */
    saga_mask_score by[SAGA_N_RECOVERS];
} saga_mask_row;

typedef struct saga_mask {
    uint32_t segment;
    int32_t t;               /* 1/65536 of the segment */
    int n_rows;              /* a tier with a single anchor has no row */
    saga_mask_row row[SAGA_MASK_MAX_ROWS];
} saga_mask;

/* Measures the segment and the picture that view selects, in the file
 * bytes[0..nbytes), which messages call `name`. percent is 1..99, or 0 for 10,
 * 30, 50, 70 and 90 one after the other. Returns false and sets *error if the
 * file is refused or memory is missing. */
bool saga_mask_file(saga_mask *mask, const char *name, const uint8_t *bytes,
                    size_t nbytes, const saga_verify_view *view, int percent,
                    saga_error *error);

#endif
