/* SPDX-License-Identifier: MIT
 *
 * Orders splats so that neighbours in space are near each other in a file.
 */
#ifndef SAGA_CLOUD_ORDER_H
#define SAGA_CLOUD_ORDER_H

#include "cloud.h"

#include <stdint.h>

/* Returns the indices of the splats, (n), in Morton order of their positions on
 * a grid of 1024 steps over each axis; equals stay in their order. The caller
 * frees them. */
uint32_t *saga_cloud_order(const saga_cloud *cloud, saga_error *error);

#endif
