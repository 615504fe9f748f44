/* SPDX-License-Identifier: MIT
 *
 * A refit makes the same scene with another entropy model: it keeps a file's
 * structure, positions, features and reconstruction networks, fits the entropy
 * networks anew on these symbols alone (trainer/entropy), chooses among their
 * sources as the trainer does, and codes everything in closed loop. So
 * ablations of the entropy model compare what one thing costs, instead of two
 * trainings.
 *
 * Residuals are taken against the new mu: values move by half a step at most
 * where the model has one, and networks that run on them follow.
 */
#ifndef GEN_REFIT_H
#define GEN_REFIT_H

#include "ablation.h"
#include "rate_choice.h"
#include "ref_file.h"
#include "train.h"

typedef struct refit_options {
    saga_ablation ablation;      /* a memory bank is tried in any scene */
    int iterations;              /* >= 3 */
    uint64_t seed;
    bool keep;                   /* sources stay, whatever they are worth */
} refit_options;

typedef struct refit_report {
    uint8_t sources[SAGA_N_KINDS]; /* that were kept */
    saga_rate_decision decision;
    double estimate[SAGA_N_STEPS]; /* code lengths of the residuals, bits */
} refit_report;

refit_options refit_defaults(void);

/* Makes the bytes (free them) of the file fitted anew, the same for any number
 * of threads. NULL: done; else why not, a constant string. */
const char *refit_make(uint8_t **out, size_t *n, refit_report *report,
                       const ref_file *in, const refit_options *options);

#endif
