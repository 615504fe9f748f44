/* SPDX-License-Identifier: MIT
 *
 * The residual hash: which entry of each table belongs to a primitive. The
 * tables are the weights of the first layer of D_res, whose other layer turns
 * the selected entries into corrections of the primitive's attributes. Paper:
 * Overview, Representation (H_r, D_res).
 */
#ifndef SAGA_RESIDUAL_HASH_H
#define SAGA_RESIDUAL_HASH_H

#include "model.h"

#include <stdint.h>

/* The value of a selected entry in the input of D_res, Q12; all others are 0.
 */
enum { SAGA_ENTRY_Q = 12, SAGA_ENTRY_ONE = 1 << SAGA_ENTRY_Q };

/* Returns the input of D_res for the entry of table `level`, counted over all
 * tables. The primitive belongs to the fine anchor of the given rank and has an
 * offset in Q14 of its support, of which the entry's place is the nearest point
 * of a grid with 2^level / 2 points per support on each axis. */
uint32_t saga_hash_entry(const saga_model *m, uint32_t level, uint32_t rank,
                         const int16_t offset_q14[4]);

#endif
