/* SPDX-License-Identifier: MIT
 *
 * LPIPS (Zhang et al. 2018), version 0.1: how different two pictures look to a
 * network that was trained to classify objects. The user supplies the weights
 * in a file: AlexNet, SqueezeNet 1.1 or VGG16, with their LPIPS heads.
 *
 * Pictures enter as 8-bit RGB mapped to [-1, 1]. (Some public code maps to [0,
 * 1] and reports lower values.)
 */
#ifndef SAGA_LPIPS_H
#define SAGA_LPIPS_H

#include "metrics.h"

typedef struct saga_lpips saga_lpips;

/* Loads the weights from a .npz file: convolutions as (out, in, y, x), and
 * heads NET.lin0, NET.lin1, ... The names of the arrays tell which network it
 * is: alex.conv1.weight and .bias, squeeze.3.expand1x1.weight, vgg.0.weight
 * (numbered as in torchvision's features). Returns NULL, with the reason in
 * *error, if it fails. */
saga_lpips *saga_lpips_load(const char *path, saga_error *error);
void saga_lpips_free(saga_lpips *l);

/* Returns a description of network and weights for reports; it lives as long as
 * *l. */
const char *saga_lpips_text(const saga_lpips *l);

/* Sets the distance between two pictures; NaN if they are too small for the
 * network. Fails if memory is short. */
bool saga_lpips_distance(double *distance, const saga_lpips *l,
                         const saga_picture_pair *pair, saga_error *error);

#endif
