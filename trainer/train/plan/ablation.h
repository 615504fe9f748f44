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
    uint16_t no_teachers;        /* 1: no teachers, however far apart cameras
                                  * are */
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

/* The words of the list: member, word, value and padding in the help, largest
 * number, help. A word that ends in '=' has a number; others stand for 1. */
#define SAGA_ABLATION_WORDS(X) \
    X(no_hyper, "no-hyperprior", "  ", 1, \
      "what a network says of each position") \
    X(no_parent, "no-parent", "      ", 1, "what the coarser tier holds") \
    X(no_bank, "no-bank", "        ", 1, "what the memory bank holds") \
    X(no_base, "no-base", "        ", 1, \
      "what stands still, once for all segments") \
    X(no_steep, "no-steep", "       ", 1, \
      "splats steeper than normal curves") \
    X(no_teachers, "no-teachers", "    ", 1, \
      "pictures between cameras that are far\n" \
      "               apart, drawn by models made for that") \
    X(groups, "groups=", "K       ", SAGA_MAX_GROUPS, \
      "1 to 16 groups of anchors, each coded by\n" \
      "               what the earlier ones hold; 1: none (8)") \
    X(slots, "slots=", "L        ", SAGA_MAX_SLOTS, \
      "a memory bank of 32, 64, 128, 256 or 512\n" \
      "               slots (64, below 40,000 primitives none)") \
    X(plain_update, "plain-update", "   ", 1, \
      "a bank whose slots are told all, not only\n" \
      "               what they do not hold yet") \
    X(raw_networks, "raw-networks", "   ", 1, \
      "parameters unpriced, in steps of 1/2048")

/* A row of the help, which begins a line. */
#define SAGA_ABLATION_HELP(member, word, value, most, help) \
    "\n" word value help

/* Sets *a to what the list says; NULL: all zero. False: a word is none, a
 * number is out of range, or words exclude each other. */
bool saga_ablation_read(saga_ablation *a, const char *list, saga_error *error);

#endif
