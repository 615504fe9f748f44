/* SPDX-License-Identifier: MIT
 *
 * Looks up in a segment's symbols what the traversal asks for. Encoder and
 * quantiser stand behind it with symbols that they know.
 */
#ifndef SAGA_LOOK_UP_H
#define SAGA_LOOK_UP_H

#include "symbols.h"

/* Returns the adaptive symbol at `at`, one of n_sym where the
 * symbols are valid; n_sym or more where they cannot be coded. */
uint32_t saga_look_up(const saga_symbols *s, saga_at at, uint32_t n_sym);

/* Returns where the residuals of a block begin: 4 of them, or a feature's. */
int32_t *saga_look_up_block(const saga_symbols *s, saga_at at,
                            uint32_t features);

#endif
