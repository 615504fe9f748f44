/* SPDX-License-Identifier: MIT
 *
 * The room that a training takes on a device, known before it begins.
 */
#ifndef SAGA_DEVICE_ROOM_H
#define SAGA_DEVICE_ROOM_H

#include "capture.h"
#include "options.h"

typedef struct saga_device_room {
    uint64_t warm;   /* bytes of the device's own memory in the warm-up, */
    uint64_t render; /* and in the rendering stage */
    uint64_t need;   /* the larger of both */
    uint64_t memory; /* what the device has */
    bool is_refused; /* a buffer would be larger than the device allows */
} saga_device_room;

/* Finds the room of training a segment, of which the capture has at least
 * cameras and frames, with n_primitives, on o->gpu. The same functions make the
 * buffers of the training, so that only what nobody knows before is estimated:
 * a moving scene is assumed to have all temporal tools of its model, segments
 * to have a base with as many primitives, and the warm-up to grow as far as it
 * may. Buffers must not be there yet. Returns false with *error set, and a
 * remedy, if a buffer would be larger than the device allows, or if the host's
 * memory is short; then *room is all zero but for is_refused. */
bool saga_train_device_room(saga_device_room *room, const saga_capture *capture,
                            const saga_train_options *o, saga_error *error);

/* Tells what is short and what helps, if the room is larger than the device's
 * memory. Returns whether it fits. */
bool saga_train_fits_device(const saga_device_room *room,
                            const saga_train_options *o, saga_error *error);

#endif
