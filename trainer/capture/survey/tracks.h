/* SPDX-License-Identifier: MIT
 *
 * Tracks are matches linked over all views: each has the sights of one place.
 * Three sights of a place tell more than pairs do. A camera that is turned
 * towards its neighbour, or a wrong focal length, moves pictures along the
 * epipolar lines of a rig that stands in a row, where pairs see nothing; but
 * the place where two rays meet is then not where the third camera sees it.
 */
#ifndef SAGA_TRACKS_H
#define SAGA_TRACKS_H

#include "bundle.h"
#include "pairs.h"

typedef struct saga_tracks {
    saga_sight *sights; /* (n_sights) sorted by place, then by camera */
    size_t n_sights, n_places;
} saga_tracks;

/* Links the matches of all pairs, and numbers the places. A place that one
 * camera sees twice is left out, because one of its matches is wrong. The
 * caller frees *tracks by saga_tracks_free, also after a failure. */
bool saga_tracks_make(saga_tracks *tracks, const saga_pairs *pairs,
                      saga_error *error);
void saga_tracks_free(saga_tracks *tracks);

/* Returns the number of sights of the place whose first sight has number
 * `first`. */
size_t saga_tracks_length(const saga_tracks *tracks, size_t first);

enum { SAGA_TRANSFER_MOST = 8 };

/* Returns the distance in pixels of sight k from the projection of the place
 * where the rays of the other n - 1 sights meet; infinity if they do not meet
 * in front of all cameras, or nearly parallel. 3 <= n <= SAGA_TRANSFER_MOST. */
double saga_transfer_off(const saga_pinhole *cameras, const saga_sight *sights,
                         size_t n, size_t k);

#endif
