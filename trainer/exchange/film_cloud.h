/* SPDX-License-Identifier: MIT
 *
 * Makes a cloud of the splats of one frame of a saga file. In a saga file a
 * network may make colours depend on the direction of view, for which other
 * programs use spherical harmonics. The harmonics are fitted to the colours
 * that the decoder returns; or constant colours are taken as one camera sees
 * them.
 */
#ifndef SAGA_FILM_CLOUD_H
#define SAGA_FILM_CLOUD_H

#include "cloud.h"
#include "view.h"

/* How colours become the harmonics of a cloud. If the file's colours do not
 * depend on the view, both members are ignored, because degree 0 represents
 * them exactly. */
typedef struct saga_colouring {
    int camera; /* the rig's camera whose colours are taken; -1:
                 * fit harmonics */
    int degree; /* degree of the fitted harmonics, 0..3 */
} saga_colouring;

/* The colours of one segment. They are the same for all of its frames, because
 * the decoder computes the direction of view for the middle of the segment. */
typedef struct saga_film_colours {
    int64_t segment; /* the segment; -1: none yet */
    int degree;
    float *harmonics; /* (primitives, harmonics, 3) */
    double rms;       /* error of the fit in one channel, 0..1, seen from
                       * the rig's cameras, over all primitives; 0 if
                       * nothing was fitted */
} saga_film_colours;

/* Makes the cloud of frame `frame`, of all primitives that the decoder draws:
 * those with an opacity above 1/256. `colours` keeps a segment's colours for
 * the following frames; it starts as { .segment = -1 }, and its harmonics are
 * released with free(). */
bool saga_film_cloud(saga_cloud *cloud, saga_film_colours *colours,
                     saga_film *film, uint32_t frame, saga_colouring how,
                     saga_error *error);

/* Makes the colours of the n primitives of the segment that the film has
 * decoded, unless `colours` has them. */
bool saga_film_colour(saga_film_colours *colours, saga_film *film, uint32_t n,
                      saga_colouring how, saga_error *error);

/* Returns the natural logarithm of a splat's widening. Other viewers know only
 * Gaussians, without the codec's flat tops (where the opacity is cut at 1) and
 * steep falloff. Each primitive becomes a Gaussian that covers the same area of
 * a picture. q0 is that of saga_animated. */
double saga_film_widening(double q0, uint32_t tools);

/* Returns the finite logit of the opacity that q0 means, at most 1. */
float saga_film_logit(double q0);

/* Makes a quaternion of saga_animated a unit quaternion. */
void saga_film_quat(float q[4], const int32_t v[4]);

#endif
