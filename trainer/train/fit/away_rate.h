/* SPDX-License-Identifier: MIT
 *
 * The rate of a scene's residuals on a device, for scenes of which each
 * primitive has anchors of its own: entropy/rate_loss.h for gpu/gpu_rates.h.
 */
#ifndef SAGA_AWAY_RATE_H
#define SAGA_AWAY_RATE_H

#include "gpu_rates.h"
#include "rate_loss.h"

/* Tells whether each primitive has anchors of its own, with its number. */
bool saga_away_has_own(const saga_scene *s);

/* Tells whether the device can evaluate the rate of such a scene. The choice of
 * sources may change the answer. */
bool saga_away_can_rate(const saga_gpu *gpu, const saga_rate *r,
                        const saga_scene *s);

/* Copies to the device what stays as long as anchors stay where they are. */
bool saga_away_put_rate(saga_gpu_canvas *g, const saga_rate *r,
                        const saga_scene *s, saga_error *error);

enum { SAGA_AWAY_MOST_CHANNELS = 4 + SAGA_MAX_FEATURES };

/* Numbers that a kind reads besides its networks, and its results. */
typedef struct saga_away_channels {
    saga_net constants, d_constants;
    real biases[2 * SAGA_AWAY_MOST_CHANNELS];
    real d_biases[2 * SAGA_AWAY_MOST_CHANNELS];
    real scale[SAGA_AWAY_MOST_CHANNELS][3]; /* unit of mu, its bound, step */
    real bits[SAGA_AWAY_MOST_CHANNELS];
} saga_away_channels;

/* The rate for a device. It is not to be moved, since the first member points
 * to others. */
typedef struct saga_away_rates {
    saga_gpu_rates to;
    saga_scene rounded; /* the scene, with networks as they are coded */
    saga_away_channels kind[SAGA_N_KINDS];
} saga_away_rates;

/* Sets a to the rate of values that the device has: saga_rate_add, but that the
 * device keeps their gradients and means (gpu_anchors.h) and that no constants
 * are measured. Adds to the networks of d. */
void saga_away_list_rates(saga_away_rates *a, saga_rate *r, saga_scene *d,
                          const saga_scene *s, const saga_rate_options *o);

/* Sets bits to those that an iteration has evaluated. */
void saga_away_bits(double bits[SAGA_N_STEPS], const saga_away_rates *a);

#endif
