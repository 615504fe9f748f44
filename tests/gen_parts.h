/* SPDX-License-Identifier: MIT
 *
 * What a file consists of, as JSON, for the reports of make_order0 and
 * make_refit. The entropy networks are those that a decoder runs to know how
 * residuals are coded, constants and the memory's networks among them; the
 * others reconstruct.
 */
#ifndef GEN_PARTS_H
#define GEN_PARTS_H

#include "ref_file.h"

#include <jansson.h>

int parts_is_entropy(int net);

/* Code length of all entropy networks, bits. */
double parts_entropy_bits(const ref_file *f);

/* {"entropy": bytes, "entropy_parameters": n, "entropy_raw": bytes at 16 bits
 * a parameter, and the same of "reconstruction"}; a new reference. */
json_t *parts_networks(const ref_file *f);

/* Bytes by component's key, and "networks" as above. */
json_t *parts_json(const ref_file *f);

#endif
