/* SPDX-License-Identifier: MIT
 *
 * LPIPS (Zhang et al. 2018), version 0.1: how different two pictures look to a
 * network that learned to tell objects apart. The weights are in a file of the
 * user's: AlexNet, SqueezeNet 1.1 or VGG16, with their heads.
 *
 * Pictures go in as they are, 8-bit RGB over [-1, 1]. (Some public code feeds
 * [0, 1] and reports lower values.)
 */
#ifndef SAGA_LPIPS_H
#define SAGA_LPIPS_H

#include "metrics.h"

typedef struct saga_lpips saga_lpips;

/* Loads the weights from a .npz file: convolutions as (out, in, y, x) and heads
 * NET.lin0, NET.lin1, ...; which net it is, their names say: alex.conv1.weight
 * and .bias, squeeze.3.expand1x1.weight, vgg.0.weight (the numbers are those of
 * torchvision's features). NULL: *error says why. */
saga_lpips *saga_lpips_load(const char *path, saga_error *error);
void saga_lpips_free(saga_lpips *l);

/* Returns net and weights in words, for protocols; it lives as long as *l. */
const char *saga_lpips_text(const saga_lpips *l);

/* Sets the distance of two pictures; NaN where they are too small for the net.
 * False: no memory. */
bool saga_lpips_distance(double *distance, const saga_lpips *l,
                         const saga_picture_pair *pair, saga_error *error);

#endif
