/* SPDX-License-Identifier: MIT
 *
 * Which video belongs to which camera of a calibration, by their names.
 */
#ifndef SAGA_VIDEO_OWNER_H
#define SAGA_VIDEO_OWNER_H

#include "file.h"
#include "load.h"

/* Returns the rule by which most cameras of the listing have a video, or -1 if
 * none has one. videos: names of files. */
int saga_video_rule(const saga_listing *listing, const saga_names *videos);

/* Returns the only video that belongs by this rule to a camera, and to no other
 * camera, or -1. */
int saga_video_of(const saga_listing *listing, const saga_names *videos,
                  int rule, int camera);

#endif
