/* SPDX-License-Identifier: MIT
 *
 * From an animated primitive to a splat: EWA projection in integers.
 * docs/arithmetic.md derives the formats; norm: Camera, projection, splat.
 */
#ifndef SAGA_PROJECT_H
#define SAGA_PROJECT_H

#include "primitive.h"
#include "saga.h"

/* SAGA_OK, or SAGA_ERR_ARG if a field of c is outside its range. */
saga_status saga_camera_check(const saga_camera *c);

/* Projects a (c was checked). Returns 1 and fills *s, all fields but
 * colour_q15, if the splat may touch a pixel of the picture; 0 if it is
 * dropped, *s then undefined. */
int saga_project(saga_splat *s, const saga_animated *a, const saga_camera *c);

#endif
