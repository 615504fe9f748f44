/* SPDX-License-Identifier: MIT
 *
 * The viewing volume of a file (docs/bitstream.md, Volume): from where, and
 * which way, the film looks well. It is a sector of a ball around the point at
 * which the cameras look: as wide as the cameras stand, and a little wider.
 */
#ifndef SAGA_FILM_VOLUME_H
#define SAGA_FILM_VOLUME_H

#include "view.h"

/* Finds the volume from the cameras of the film's rig; docs/lab/volume.md has
 * what pictures are worth at its ends. Let s be the median,
 * over the cameras, of the angle between a camera and its nearest neighbour, as
 * seen from the pivot. Then
 *
 *     azimuth, elevation   those of the cameras, and s / 4 more, at least 1 and
 *                          at most 5 degrees, elevations within 85 degrees; a
 *                          rig that stands all round has any azimuth
 *     distance             from half of the nearest camera's to 1.05 of the
 *                          farthest's
 *     turn                 a quarter of the angle that the first camera's
 *                          picture spans, along its shorter side
 *     floor                above which 95 % of the opaque primitives of the
 *                          first frame are
 *     start                the camera nearest to the front, which is the middle
 *                          of the rig, or camera 0 if the rig stands all round
 *
 * Cameras that look outwards, from the middle of a scene, have a ball: any
 * direction, and distances up to 1.05 of the farthest camera's. The quality is
 * unknown, 0. Fails if the film has no rig, if all its cameras stand at one
 * point and look along one line, or if the first frame cannot be decoded. */
bool saga_volume_of(saga_volume *volume, saga_film *film, saga_error *error);

/* Sets *out to the file with this volume, or with none if volume is NULL, in
 * place of the one that it had; like saga_aside_put. */
bool saga_volume_put(saga_bytes *out, const char *name, const saga_bytes *film,
                     const saga_volume *volume, saga_error *error);

/* Puts the volume of its rig, with this quality, into a film, whose bytes are
 * replaced. If none can be found, *none says why, and the film stays. */
bool saga_volume_add(saga_bytes *film, const char *name,
                     const uint16_t quality_q8[2], saga_error *none,
                     saga_error *error);

#endif
