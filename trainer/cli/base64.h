/* SPDX-License-Identifier: MIT
 *
 * Encodes the pictures that a page contains as base64 (RFC 4648).
 */
#ifndef SAGA_BASE64_H
#define SAGA_BASE64_H

#include "error.h"

#include <stddef.h>
#include <stdint.h>

/* Returns `prefix` followed by the n bytes in base64, a string that the caller
 * frees; NULL if memory is short. */
char *saga_base64(const char *prefix, const uint8_t *bytes, size_t n,
                  saga_error *error);

#endif
