/* SPDX-License-Identifier: MIT
 *
 * How `saga view` follows a training and ends it: by two files beside the
 * checkpoint. The training writes its course to CHECKPOINT.csv, whose lines
 * are those of --log, and keeps it as long as the checkpoint. The page's button
 * makes CHECKPOINT.finish, which asks the training to finish. A request counts
 * for the run that it was made to: the next one removes it.
 */
#ifndef SAGA_FOLLOW_H
#define SAGA_FOLLOW_H

#include "error.h"

typedef struct saga_follow {
    char *output; /* the checkpoint without .ckpt: what is trained */
    char *course, *request;
} saga_follow;

/* Makes the names for a checkpoint, which must end with .ckpt. The caller frees
 * them, also on failure. */
bool saga_follow_names(saga_follow *w, const char *checkpoint,
                       saga_error *error);
void saga_follow_free(saga_follow *w);

/* Asks the training to finish. Returns false with *error set if none is running
 * or the request cannot be written. */
bool saga_follow_ask(const saga_follow *w, saga_error *error);

/* Tells whether a training is asked to finish. */
bool saga_follow_is_asked(const saga_follow *w);

#endif
