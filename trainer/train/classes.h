/* SPDX-License-Identifier: MIT
 *
 * Networks that choose among adaptive models of numbers and sets: fitted to the
 * final symbols of a segment, and kept where the file becomes smaller.
 *
 * A network sees what the sources say of a block, in the decoder's integers,
 * and is fitted to log-odds: a number n that lies in a..b counts as n - a hits
 * of b - a, an axis of a set as so many points in lower halves of those that
 * its class serves. Minimised are the code length of the hits and half the
 * square of each weight (of inputs with a root mean square of 1), in nats. With
 * mean the average over blocks and axes,
 *
 *     class = clamp(floor(2 (log-odds - mean) + 1/2) + 4, 0, 7)
 *
 * The network has 8 hidden units; steps of its weights are 1/2 or 1/4. Tried
 * are the hyperprior alone, with the parent and with the memory, as far as
 * residuals read them: then their networks are paid for.
 */
#ifndef SAGA_CLASSES_H
#define SAGA_CLASSES_H

#include "encode.h"

/* What a network is worth to a kind, bytes; of the best that was tried. */
typedef struct saga_class_gain {
    uint32_t sources;            /* SAGA_SOURCE_*; 0: none was tried, since the
                                  * symbols are cheap, or have no source */
    int kept;
    double without, with;        /* the kind's symbols, code length */
    double weights;              /* the network and its part of the header */
    double net;                  /* what the file grows by: kept if below 0 */
} saga_class_gain;

/* For each SAGA_CLASS_* in turn: fits, tries and keeps. Sets gain and, of what
 * is kept, tools, class_sources and the networks' formats in *h, and their
 * symbols in *nets (saga_net_symbols_free them); the rest of both stays. The
 * symbols make a segment of n_frames frames of a file with header h (as
 * saga_encoder_open wants it), without classes. Returns 1 if anything was kept.
 * Aborts without memory. */
int saga_classes_choose(saga_header *h, saga_net_symbols *nets,
                        saga_class_gain gain[SAGA_N_CLASS_KINDS],
                        const saga_rig_camera *rig, const saga_symbols *s,
                        uint32_t n_frames);

/* For people ("fine counts") and as a key ("n_fine"). */
const char *saga_class_name(int kind);
const char *saga_class_key(int kind);

#endif
