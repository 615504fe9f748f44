/* SPDX-License-Identifier: MIT
 *
 * A listing takes this from COLMAP's model: where the model is, the camera of a
 * source, the points that several training cameras have seen, and how far the
 * model's own features lie from where the camera puts their points.
 */
#ifndef SAGA_COLMAP_VIEWS_H
#define SAGA_COLMAP_VIEWS_H

#include "colmap.h"
#include "load.h"

/* Sets *model to the folder of the model in a capture's folder (free it), NULL
 * if there is none. */
bool saga_colmap_find(char **model, const char *folder, saga_error *error);

/* Sets lens and pose of a source, whose size is known, to those of an image;
 * folder is the model's, for messages. */
bool saga_colmap_adopt(saga_source *source, const saga_colmap *model,
                       const saga_colmap_image *image, const char *folder,
                       saga_error *error);

/* Sets the listing's points: those in the tracks of two or more sources that
 * are not held out. source_of (n_images of the model) says which source an
 * image belongs to, -1 for none. */
bool saga_colmap_take_points(saga_listing *listing, const saga_colmap *model,
                             const int *source_of, saga_error *error);

/* Sets n_observations and the reprojection errors of a source. */
bool saga_colmap_measure(saga_source *source, const saga_colmap *model,
                         const saga_colmap_image *image, saga_error *error);

#endif
