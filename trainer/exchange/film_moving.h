/* SPDX-License-Identifier: MIT
 *
 * Makes splats that move from a film of one segment, as FreeTimeGS has them: at
 * the time t, 0 at the first frame and 1 at the last, a splat is at mean +
 * velocity (t - time) with the opacity o exp(-((t - time) / duration)^2 / 2).
 */
#ifndef SAGA_FILM_MOVING_H
#define SAGA_FILM_MOVING_H

#include "film_cloud.h"

/* Makes them of all primitives that are visible in a frame. *rms is the
 * distance between the lines and the decoder's curves, in the capture's units,
 * over all frames, weighted by opacity. Colours are as in saga_film_cloud.
 * Fails if the film has several segments, since nothing would end a splat with
 * its segment. */
bool saga_film_moving(saga_cloud *cloud, double *rms,
                      saga_film_colours *colours, saga_film *film,
                      saga_colouring how, saga_error *error);

#endif
