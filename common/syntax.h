/* SPDX-License-Identifier: MIT
 *
 * The traversal of the entropy-coded chunks. Encoder and decoder share this
 * code and differ only in the coder behind it (prob.h). The traversal reads
 * dequantised values only, so that both pass through the same states.
 *
 * Every function returns 1, or 0 if the symbols are invalid; the stream is then
 * invalid, and the results must be discarded.
 */
#ifndef SAGA_SYNTAX_H
#define SAGA_SYNTAX_H

#include "scaffold.h"

/* NETS: fills block (nets->nbytes, aligned to 16). */
int saga_syntax_networks(const saga_nets *nets, uint8_t *block, saga_coder *c);

/* Initialises adaptive models and bank, before the first chunk of a scaffold.
 */
void saga_syntax_begin(const saga_scaffold *sc);

/* COAR: the tree with the numbers of fine anchors; centres and features of
 * coarse anchors, group by group. */
int saga_syntax_coarse(const saga_scaffold *sc, saga_coder *c);

/* FINE: fine anchors' suffixes, offsets and numbers of primitives; then
 * F_fine. */
int saga_syntax_fine(const saga_scaffold *sc, saga_coder *c);

/* PRIM: primitives' suffixes and offsets. */
int saga_syntax_prim(const saga_scaffold *sc, saga_coder *c);

/* The one of these three that has the number `part`, 0..2. */
int saga_syntax_part(const saga_scaffold *sc, int part, saga_coder *c);

#endif
