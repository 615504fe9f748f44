/* SPDX-License-Identifier: MIT
 *
 * An encoder goes into a checkpoint, and comes back out of one.
 */
#ifndef SAGA_ENCODE_SAVE_H
#define SAGA_ENCODE_SAVE_H

#include "checkpoint.h"
#include "encode.h"

/* Writes the file as far as it is made; the checkpoint knows whether all of it
 * was written. */
void saga_encoder_save(saga_encoder *e, saga_checkpoint *checkpoint);

/* Makes the encoder that was written (saga_encoder_free). NULL: memory is
 * short, or the checkpoint does not hold one, as it knows. */
saga_encoder *saga_encoder_restore(saga_checkpoint *checkpoint,
                                   saga_error *error);

#endif
