/* SPDX-License-Identifier: MIT
 *
 * The rate of a scene's residuals on a device, for scenes of which each
 * primitive has anchors of its own: entropy/rate_loss.h for gpu/gpu_rates.h.
 */
#ifndef SAGA_AWAY_RATE_H
#define SAGA_AWAY_RATE_H

#include "gpu_rates.h"
#include "rate_loss.h"

/* Tells whether the device can evaluate the rate. The choice of sources may
 * change the answer. */
bool saga_away_can_rate(const saga_gpu *gpu, const saga_rate *r,
                        const saga_scene *s);

/* Copies to the device what stays as long as anchors stay where they are. */
bool saga_away_put_rate(saga_gpu_canvas *g, const saga_rate *r,
                        const saga_scene *s, saga_error *error);

/* As saga_rate_add for values that the device has. It keeps their gradients and
 * means (gpu_anchors.h), and measures no constants. Adds to the networks of
 * d. */
bool saga_away_rate(double bits[SAGA_N_STEPS], saga_gpu_canvas *g, saga_rate *r,
                    saga_scene *d, const saga_scene *s,
                    const saga_rate_options *o, saga_error *error);

/* As saga_away_room, with all sources. */
bool saga_away_rate_room(const saga_gpu *gpu, saga_gpu_canvas *g, saga_scene *s,
                         saga_error *error);

#endif
