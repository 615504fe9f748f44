/* SPDX-License-Identifier: MIT
 *
 * What loaders take from a COLMAP model for their listing: the folder of the
 * model, the camera of a source, the points that several training cameras have
 * seen, and the distances of the model's features from the projections of their
 * points.
 */
#ifndef SAGA_COLMAP_VIEWS_H
#define SAGA_COLMAP_VIEWS_H

#include "colmap.h"
#include "load.h"

/* Sets *model to the folder of the COLMAP model in a capture's folder, or to
 * NULL if there is none. The caller frees it. */
bool saga_colmap_find(char **model, const char *folder, saga_error *error);

/* Sets the lens and pose of a source, whose size is known, to those of an
 * image. folder is the model's, for messages. */
bool saga_colmap_adopt(saga_source *source, const saga_colmap *model,
                       const saga_colmap_image *image, const char *folder,
                       saga_error *error);

/* Sets the listing's points to those in the tracks of two or more sources that
 * are not held out. source_of (n_images of the model) has the source of each
 * image; -1: none. */
bool saga_colmap_take_points(saga_listing *listing, const saga_colmap *model,
                             const int *source_of, saga_error *error);

/* Sets n_observations and the reprojection errors of a source. */
bool saga_colmap_measure(saga_source *source, const saga_colmap *model,
                         const saga_colmap_image *image, saga_error *error);

#endif
