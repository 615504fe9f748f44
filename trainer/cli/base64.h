/* SPDX-License-Identifier: MIT
 *
 * Pages have their pictures inside, as base64 (RFC 4648).
 */
#ifndef SAGA_BASE64_H
#define SAGA_BASE64_H

#include "error.h"

#include <stddef.h>
#include <stdint.h>

/* Returns `prefix` with n bytes behind it, for the caller to free; NULL: no
 * memory. */
char *saga_base64(const char *prefix, const uint8_t *bytes, size_t n,
                  saga_error *error);

#endif
