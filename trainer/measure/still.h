/* SPDX-License-Identifier: MIT
 *
 * Reduces a long capture to its still part, a capture of one frame: for each
 * view, the temporal median of pictures that are spread evenly over all its
 * frames. A pixel counts if it is near the median in three quarters of these
 * pictures; the others are masked, because something covers the background
 * there at times. The capture is given in parts, so that only one part need be
 * in memory.
 */
#ifndef SAGA_STILL_H
#define SAGA_STILL_H

#include "capture.h"

/* Number of pictures used of each view (all of them if there are fewer): an odd
 * number, so that the median is one of their values. */
enum { SAGA_STILL_PICTURES = 15 };

/* Usage: initialise with zeros but for the folder, add all parts, finish. */
typedef struct saga_still {
    const char *folder;   /* of the file that has the pictures if those of the
                           * parts are in a file; NULL: they are in memory */
    saga_capture capture; /* the pictures taken so far, at `room` until they are
                           * finished; owned by saga_still */
    uint8_t *room;
    saga_scratch file;
    int n;          /* pictures taken so far of each view */
    int n_finished; /* views that have a median of their own */
    bool *seen;     /* (views): some part had a picture of this view */
} saga_still;

/* Takes the pictures it needs from a part, which begins with frame `first` of
 * the n_frames of the capture. Fails if memory is short, or if a part has other
 * views than the first. */
bool saga_still_add(saga_still *still, const saga_capture *part, int first,
                    int n_frames, saga_error *error);

/* Makes *capture, which saga_capture_free releases, and empties *still. A view
 * that was missing in all parts is missing in *capture. Fails if memory is
 * short. */
bool saga_still_finish(saga_capture *capture, saga_still *still,
                       saga_error *error);
void saga_still_free(saga_still *still);

#endif
