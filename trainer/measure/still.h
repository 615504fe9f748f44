/* SPDX-License-Identifier: MIT
 *
 * The still part of a long capture, as a capture of one frame: of each view
 * the temporal median of pictures that lie evenly over all of its frames. A
 * pixel counts that is near it in three quarters of them: where something is
 * at times, and at times not, nobody says here what is behind. The capture
 * comes in parts, of which one at a time is in memory.
 */
#ifndef SAGA_STILL_H
#define SAGA_STILL_H

#include "capture.h"

/* Number of pictures of each view that are looked at, all if there are fewer:
 * an odd number, so that the median is one of their values. */
enum { SAGA_STILL_PICTURES = 15 };

/* Zero it, add all parts, finish. */
typedef struct saga_still {
    saga_capture capture;        /* of the pictures so far; its own */
    int n;                       /* of them, of each view */
    bool *seen;                  /* (views) some picture was there */
} saga_still;

/* Takes from a part, which begins with frame `first` of the n_frames, what is
 * looked at; all parts have the same views. Fails where memory is short, or
 * where a part has other views than the first. */
bool saga_still_add(saga_still *still, const saga_capture *part, int first,
                    int n_frames, saga_error *error);

/* Makes *capture (saga_capture_free it), in which a view is missing that was
 * missing throughout; nothing is left of *still then. Fails where memory is
 * short. */
bool saga_still_finish(saga_capture *capture, saga_still *still,
                       saga_error *error);
void saga_still_free(saga_still *still);

#endif
