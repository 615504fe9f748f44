/* SPDX-License-Identifier: MIT
 *
 * The one traversal: each syntax element of the entropy-coded chunks is written
 * once, here, with a coder behind it (prob.h). It keeps dequantised values
 * only, so encoder and decoder walk through the same states.
 *
 * Every function returns 1, or 0 if the symbols cannot be (then the stream is
 * invalid, and what was filled is to be thrown away).
 */
#ifndef SAGA_SYNTAX_H
#define SAGA_SYNTAX_H

#include "scaffold.h"

/* Networks chunk: fills block (nets->nbytes, aligned to 16). */
int saga_syntax_networks(const saga_nets *nets, uint8_t *block,
                         saga_coder *c);

/* Fresh adaptive models and bank; before the first chunk of a scaffold. */
void saga_syntax_begin(const saga_scaffold *sc);

/* COAR: the tree with the numbers of fine anchors; centres and features of
 * coarse anchors, group by group. */
int saga_syntax_coarse(const saga_scaffold *sc, saga_coder *c);

/* FINE: fine anchors' suffixes, offsets and numbers of primitives; then
 * F_fine. */
int saga_syntax_fine(const saga_scaffold *sc, saga_coder *c);

/* PRIM: primitives' suffixes and offsets. */
int saga_syntax_prim(const saga_scaffold *sc, saga_coder *c);

#endif
