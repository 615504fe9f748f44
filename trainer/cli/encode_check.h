/* SPDX-License-Identifier: MIT
 *
 * The quality of the finished file, as the integer decoder decodes it.
 */
#ifndef SAGA_ENCODE_CHECK_H
#define SAGA_ENCODE_CHECK_H

#include "between.h"
#include "layout.h"
#include "train.h"
#include "verdict.h"
#include "view.h"

struct saga_encode_session;

/* The file cut after a layer, and its quality as the integer decoder decodes
 * it. */
typedef struct saga_encode_cut {
    saga_bytes bytes; /* bytes of the film, while it is open */
    saga_film film;
    size_t nbytes;
    double sum[2]; /* sums of PSNRs in dB: training, held out */
    int n[2];      /* number of pictures in them */
    saga_quality quality;
} saga_encode_cut;

/* Quality and layout of the finished file, set by saga_encode_check. */
typedef struct saga_encode_result {
    saga_layout layout;
    saga_quality decoded;
    saga_quality evened;    /* the same, compared with pictures whose exposure
                             * is evened out as in training; 0 pictures:
                             * exposures are equal */
    saga_quality agreement; /* PSNR between decoded pictures and the float
                             * model's pictures for the same symbols */
    saga_verdict verdict;   /* over the training views */
    saga_between between;   /* the prediction between the cameras */
    bool predicted;         /* there is a prediction, of NaN if no camera
                             * stands between others */
    bool is_short;          /* there is none: the training is too short */
    saga_encode_cut cut[SAGA_MAX_LAYERS]; /* the file cut after each layer
                                           * except the last */
} saga_encode_result;

/* Returns the PSNR to expect between the cameras: that of held-out views or, if
 * there are none, the prediction; NaN if neither is known. */
double saga_encode_between(const saga_encode_result *result);

int saga_encode_check(struct saga_encode_session *s);

#endif
