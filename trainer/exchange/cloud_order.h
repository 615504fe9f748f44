/* SPDX-License-Identifier: MIT
 *
 * Orders splats so that neighbours in space are near each other in a file.
 */
#ifndef SAGA_CLOUD_ORDER_H
#define SAGA_CLOUD_ORDER_H

#include "cloud.h"

#include <stdint.h>

/* Returns the indices of the cloud's n splats, sorted in Morton order of their
 * positions on a grid that divides each axis of the cloud into 1024 steps.
 * Splats in the same cell keep their order. The caller frees the array. */
uint32_t *saga_cloud_order(const saga_cloud *cloud, saga_error *error);

#endif
