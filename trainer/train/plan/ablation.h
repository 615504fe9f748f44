/* SPDX-License-Identifier: MIT
 *
 * Research switches say which part of the entropy model is left out, or is
 * otherwise, to learn what it is worth. As text they are a list of words,
 * "no-parent,groups=4".
 */
#ifndef SAGA_ABLATION_H
#define SAGA_ABLATION_H

#include "error.h"

#include <stdint.h>

/* All zero is what serves best. A source that is allowed is still left out
 * where it is not worth its weights. */
typedef struct saga_ablation {
    uint16_t no_hyper, no_parent, no_bank; /* 1: without these sources */
    uint16_t no_steep;           /* 1: splats are normal distributions */
    uint16_t groups;             /* of each tier, 1..16; 0: 8; 1: none, and
                                  * neither the source */
    uint16_t slots;              /* of the memory bank: 32, 64, .. 512; 0: 64,
                                  * and below 40,000 primitives no bank */
    uint16_t plain_update;       /* 1: a bank, its update without the
                                  * projection */
    uint16_t no_base;            /* 1: no base, whatever stands still */
    uint16_t raw_networks;       /* 1: parameters of all networks in steps of
                                  * 2^-11, unpriced, 16 bits each where sources
                                  * are weighed against them */
} saga_ablation;

/* Sets *a to what the list says; NULL: all zero. False: a word is none, a
 * number is out of range, or words exclude each other. */
bool saga_ablation_read(saga_ablation *a, const char *list, saga_error *error);

#endif
