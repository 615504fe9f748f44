/* SPDX-License-Identifier: MIT
 *
 * Saves an encoder to a checkpoint and restores it.
 */
#ifndef SAGA_ENCODE_SAVE_H
#define SAGA_ENCODE_SAVE_H

#include "checkpoint.h"
#include "encode.h"

/* Writes the file as far as it is made. Whether that succeeded is known when
 * the checkpoint is closed. */
void saga_encoder_save(saga_encoder *e, saga_checkpoint *checkpoint);

/* Makes the encoder that was saved; the caller frees it by saga_encoder_free.
 * Returns NULL if memory is short, with *error set, or if the checkpoint does
 * not hold an encoder, which marks it as failed. */
saga_encoder *saga_encoder_restore(saga_checkpoint *checkpoint,
                                   saga_error *error);

#endif
