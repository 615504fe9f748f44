/* SPDX-License-Identifier: MIT
 *
 * How many primitives a level has room for. It is known before anything is
 * trained, because a decoder's memory and work follow from the model and the
 * counts in the header of a file.
 */
#ifndef SAGA_LEVEL_ROOM_H
#define SAGA_LEVEL_ROOM_H

#include "model.h"
#include "options.h"

/* Returns the largest number of primitives, at most n, with which a file of
 * this model keeps to the level of the options; 0: with none. */
uint32_t saga_room_of_model(const saga_train_options *o, const saga_model *m,
                            uint32_t n);

/* Returns the same before the model is known: for the model that has the
 * picture's tools `tools`, and what else those options may lead to. */
uint32_t saga_room_of_tools(const saga_train_options *o, const saga_ablation *a,
                            uint32_t tools, uint32_t n);

/* Returns the largest number, at most n, that is sure to fit, whatever tools
 * the training chooses. */
uint32_t saga_room_sure(const saga_train_options *o, uint32_t n);

#endif
