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

/* Copies to the device what stays as long as anchors stay where they are, and
 * the means by which values were predicted last. */
bool saga_away_put_rate(saga_gpu_canvas *g, const saga_rate *r,
                        const saga_scene *s, saga_error *error);

/* As saga_rate_add. If x->feature is NULL, the device has the values and keeps
 * their gradients (gpu_anchors.h), and constants are not measured again. */
bool saga_away_rate(double bits[SAGA_N_STEPS], saga_gpu_canvas *g, saga_rate *r,
                    saga_scene *d, const saga_rate_input *x,
                    const saga_rate_options *o, saga_error *error);

#endif
