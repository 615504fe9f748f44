/* SPDX-License-Identifier: MIT
 *
 * A capture is read here, whichever format it has.
 */
#ifndef SAGA_CAPTURE_LOAD_H
#define SAGA_CAPTURE_LOAD_H

#include "capture.h"

/* Returns options as a user who gives none would have them: full size, all
 * frames, 4 GiB. */
saga_capture_options saga_capture_defaults(void);

/* Loads the capture in a folder (or its transforms.json), whichever format it
 * has. On failure returns false, *error says why and *capture is empty. */
bool saga_capture_load(saga_capture *capture, const char *path,
                       const saga_capture_options *options,
                       saga_error *error);

/* Sets of *capture what is known before a picture is decoded: format, frames,
 * their rate and how many fit, how many views and pixels there are to learn
 * from, whether the camera moves. It fails as
 * saga_capture_load does, but for want of memory, and sets no view nor anything
 * else that would have to be freed. */
bool saga_capture_look(saga_capture *capture, const char *path,
                       const saga_capture_options *options,
                       saga_error *error);

#endif
