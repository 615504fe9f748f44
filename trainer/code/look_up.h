/* SPDX-License-Identifier: MIT
 *
 * Finds in a segment's symbols what the traversal asks for. Encoder and
 * quantiser use it to code symbols that are known already.
 */
#ifndef SAGA_LOOK_UP_H
#define SAGA_LOOK_UP_H

#include "symbols.h"

/* Returns the adaptive symbol at `at`. It is below n_sym, or not, if the
 * symbols are invalid and cannot be coded. */
uint32_t saga_look_up(const saga_symbols *s, saga_at at, uint32_t n_sym);

/* Returns the address of a block's residuals: 4 of them, or those of its
 * features. */
int32_t *saga_look_up_block(const saga_symbols *s, saga_at at,
                            uint32_t features);

#endif
