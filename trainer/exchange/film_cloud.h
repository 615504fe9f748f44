/* SPDX-License-Identifier: MIT
 *
 * The splats of a file at a frame. A file's colours may depend on the direction
 * of view by a network; other programs have harmonics instead. They are fitted
 * to what the decoder gives, or the colours are those one camera sees.
 */
#ifndef SAGA_FILM_CLOUD_H
#define SAGA_FILM_CLOUD_H

#include "cloud.h"
#include "view.h"

/* The colours' way into a cloud. Where they do not depend on the view, neither
 * member matters: degree 0 has them exactly. */
typedef struct saga_colouring {
    int camera;              /* of the rig, whose colours are taken; -1: fit */
    int degree;              /* of the fit, 0..3 */
} saga_colouring;

/* This holds a segment's colours, which are the same for all of its frames:
 * the decoder takes the direction of view in the middle of the segment. */
typedef struct saga_film_colours {
    int64_t segment;         /* whose they are; -1: none */
    int degree;
    float *harmonics;        /* (primitives, harmonics, 3) */
    double rms;              /* of a channel towards the rig's cameras, 0..1,
                              * over all primitives; 0 where nothing is fitted
                              */
} saga_film_colours;

/* Gives the splats that frame `frame` shows: those of an opacity above the
 * decoder's cut, 1/256. colours keeps what the next frame needs as well; it
 * begins as { .segment = -1 }, and free() takes its harmonics. */
bool saga_film_cloud(saga_cloud *cloud, saga_film_colours *colours,
                     saga_film *film, uint32_t frame, saga_colouring how,
                     saga_error *error);

#endif
