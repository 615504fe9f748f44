/* SPDX-License-Identifier: MIT
 *
 * Loads a capture of any format.
 */
#ifndef SAGA_CAPTURE_LOAD_H
#define SAGA_CAPTURE_LOAD_H

#include "capture.h"

/* Returns the default options: full size, all frames, 4 GiB. */
saga_capture_options saga_capture_defaults(void);

/* Loads the capture in a folder (or its transforms.json). If it fails, *error
 * says why and *capture is empty. */
bool saga_capture_load(saga_capture *capture, const char *path,
                       const saga_capture_options *options, saga_error *error);

/* Sets those members of *capture that are known before a picture is decoded:
 * format, frames, frame rate, bytes of the pictures, number and pixels of the
 * training views, and whether the camera moves. It sets no views and allocates
 * nothing that must be freed. It fails like saga_capture_load, except that it
 * does not check the memory budget. */
bool saga_capture_look(saga_capture *capture, const char *path,
                       const saga_capture_options *options, saga_error *error);

#endif
