/* SPDX-License-Identifier: MIT
 *
 * The pictures of a capture as training sees them: planar, in float.
 */
#ifndef SAGA_TRUTH_H
#define SAGA_TRUTH_H

#include "canvas.h"
#include "capture.h"

/* Pixels of the largest picture, at level 0. */
size_t saga_truth_pixels(const saga_capture *capture);

/* A canvas for any picture of the capture; 0, or -1 without memory. */
int saga_truth_canvas(saga_canvas *canvas, const saga_capture *capture);

/* Sides of the view at a level. */
void saga_truth_size(const saga_shot *view, int level, int *w, int *h);

/* truth (3, H, W), 0..1: the frame averaged over boxes of 2^level pixels a
 * side. */
void saga_truth_load(real *truth, const saga_capture *c, int view, int frame,
                     int level);

#endif
