/* SPDX-License-Identifier: MIT
 *
 * The loader of Vulkan, which a header contains.
 */
#include "compute_state.h"

#ifdef SAGA_HAS_VULKAN
#define VOLK_IMPLEMENTATION
#include <volk.h>
#endif
