/* SPDX-License-Identifier: MIT
 *
 * Research switches leave out or change a part of the entropy model or of the
 * training, to measure what it is worth. As text they are a list of words, for
 * example "no-parent,groups=4".
 */
#ifndef SAGA_ABLATION_H
#define SAGA_ABLATION_H

#include "error.h"

#include <stdint.h>

/* All zero is the best setting known. A source that is allowed is still left
 * out where it saves less than its weights take. */
typedef struct saga_ablation {
    uint16_t no_hyper, no_parent, no_bank; /* 1: the source is left out */
    uint16_t no_teachers;  /* 1: no teachers, however far apart the
                            * cameras are */
    uint16_t no_steep;     /* 1: splats are plain normal distributions */
    uint16_t groups;       /* groups of each tier, 1..16; 0: the default
                            * of 8; 1: a single group, so that groups are
                            * no source */
    uint16_t slots;        /* slots of the memory bank: 32, 64, .. 512; 0:
                            * 64 for the paper's model, otherwise none */
    uint16_t plain_update; /* 1: there is a bank, and its update has no
                            * projection */
    uint16_t no_base;      /* 1: no base, even if things stand still */
    uint16_t classes;      /* 1: anchors of what never moves have fewer
                            * features */
    /* These leave parts out of the paper's model (options.h); models without
     * the part do not change. */
    uint16_t no_interpolation; /* 1: K = 1, each anchor and primitive reads
                                * its own parent alone */
    uint16_t no_fuse;          /* 1: no networks Fuse_c and Fuse_f */
    uint16_t no_hash;          /* 1: no residual hash */
    uint16_t paper;            /* not a word: 1 if the options ask for the
                                * paper's model, which has a bank */
    uint16_t raw_networks;     /* 1: the weights of all networks have a step
                                * of 2^-11 and no price; the choice of sources
                                * counts 16 bits for each */
} saga_ablation;

/* The words of the list: member, word, padding in the help, largest number,
 * help. A word that ends in '=' is followed by a number; the others set 1. */
#define SAGA_ABLATION_WORDS(X)                                                 \
    X(no_hyper, "no-hyperprior", "  ", 1,                                      \
      "the network that predicts from positions")                              \
    X(no_parent, "no-parent", "      ", 1, "prediction from the coarser tier") \
    X(no_bank, "no-bank", "        ", 1, "prediction from the memory bank")    \
    X(no_base, "no-base", "        ", 1,                                       \
      "the base, which stores once what stands\n"                              \
      "               still")                                                  \
    X(no_steep, "no-steep", "       ", 1,                                      \
      "splats that fall off more steeply than a\n"                             \
      "               normal distribution")                                    \
    X(no_teachers, "no-teachers", "    ", 1,                                   \
      "extra models that draw views between\n"                                 \
      "               cameras that stand far apart")                           \
    X(groups, "groups=", "K       ", SAGA_MAX_GROUPS,                          \
      "use K groups of anchors, 1 to 16 (default\n"                            \
      "               8); each is predicted from the earlier\n"                \
      "               ones, so 1 switches this off")                           \
    X(slots, "slots=", "L        ", SAGA_MAX_SLOTS,                            \
      "use a memory bank of L slots: 32, 64,\n"                                \
      "               128, 256 or 512 (default: 64 with\n"                     \
      "               --model paper, otherwise no bank)")                      \
    X(plain_update, "plain-update", "   ", 1,                                  \
      "store each token in the bank in full,\n"                                \
      "               instead of only what is new in it")                      \
    X(no_interpolation, "nearest", "        ", 1,                              \
      "with --model paper: interpolation between\n"                            \
      "               the features of neighbours")                             \
    X(no_fuse, "no-fuse", "        ", 1,                                       \
      "with --model paper: the fusing networks")                               \
    X(no_hash, "no-hash", "        ", 1,                                       \
      "with --model paper: the residual hash")                                 \
    X(classes, "classes", "        ", 1,                                       \
      "give fewer features to what never moves")                               \
    X(raw_networks, "raw-networks", "   ", 1,                                  \
      "store network weights in steps of 1/2048,\n"                            \
      "               at no price")

/* A row of the help, on a line of its own. */
#define SAGA_ABLATION_HELP(member, word, value, most, help) "\n" word value help

/* Sets *a to what the list says, to all zero where it is NULL. Returns false
 * with *error set if a word is unknown, a number is out of range, or two words
 * exclude each other. */
bool saga_ablation_read(saga_ablation *a, const char *list, saga_error *error);

#endif
