/* SPDX-License-Identifier: MIT
 *
 * A refit codes the same scene with another entropy model. It keeps a file's
 * structure, positions, features and reconstruction networks. It trains the
 * entropy networks anew on these symbols alone (trainer/entropy), chooses their
 * sources as the trainer does, and codes everything in closed loop. So an
 * ablation compares two entropy models on the same scene, instead of two
 * trainings.
 *
 * Residuals are taken relative to the new mu. Therefore values move by at most
 * half a step, and so do the outputs of the networks that read them.
 */
#ifndef GEN_REFIT_H
#define GEN_REFIT_H

#include "ablation.h"
#include "rate_choice.h"
#include "ref_file.h"
#include "train.h"

typedef struct refit_options {
    saga_ablation ablation; /* the bank is tried in small scenes, too */
    int iterations;         /* >= 3 */
    uint64_t seed;
    bool keep; /* keeps sources that cost more than they save
                */
} refit_options;

typedef struct refit_report {
    uint8_t sources[SAGA_N_KINDS]; /* the sources that were kept */
    saga_rate_decision decision;
    double estimate[SAGA_N_STEPS]; /* code lengths of the residuals, bits */
} refit_report;

refit_options refit_defaults(void);

/* Refits a file. Returns NULL and sets *out to its bytes, which the caller
 * frees; else returns the reason, a constant string. The number of threads does
 * not change the bytes. */
const char *refit_make(uint8_t **out, size_t *n, refit_report *report,
                       const ref_file *in, const refit_options *options);

#endif
