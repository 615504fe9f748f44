/* SPDX-License-Identifier: MIT
 *
 * Whether the poses and lenses of a capture fit its pictures, found without
 * points: features of every two cameras are matched, those are kept that some
 * pair of pinholes may have seen, and the distance is taken of each from the
 * line on which the capture's own cameras would see it (the epipolar line).
 *
 * Where the distances are large, the usual mistakes are undone one after the
 * other; the one after which the pictures fit is named. Nothing is said of
 * cameras that see too little in common.
 */
#ifndef SAGA_CALIBRATION_H
#define SAGA_CALIBRATION_H

#include "capture.h"
#include "refine.h"

/* How camera-to-world matrices (A, b) of a file came to be: rotation A and
 * centre b would be right. */
typedef enum saga_pose_form {
    SAGA_POSE_RIGHT,
    SAGA_POSE_INVERSE,           /* they are world to camera */
    SAGA_POSE_TRANSPOSED,        /* A is that of world to camera, b right */
    SAGA_POSE_TRANSLATION,       /* A is right, b the translation of world to
                                  * camera */
    SAGA_POSE_FORMS
} saga_pose_form;

/* A mistake is undone for all cameras alike. */
typedef struct saga_mistake {
    bool before, after;          /* of the form: camera axes have y and z
                                  * reversed, OpenCV's for OpenGL's */
    saga_pose_form form;
    double focal;                /* lengths of focus times that are right; 1 */
    bool centre;                 /* and centres of the pictures times that */
    int swapped[2];              /* cameras whose pictures are exchanged; -1 */
} saga_mistake;

typedef struct saga_calibration {
    double *off;                 /* (n_views) pixels, the median over the
                                  * cameras it shares matches with of the median
                                  * over these; NaN: too few matches */
    bool *odd;                   /* (n_views) without these, the others fit */
    double *stops;               /* (n_views) exposure against the others', log2
                                  * of light; NaN: too few matches */
    int *shared;                 /* (n_views, n_views) matches that agree; -1:
                                  * not looked for */
    int *n_features;             /* (n_views) corners of its picture */
    double typical;              /* median of all pairs; NaN: of too few */
    double within;               /* pixels: what is below fits */
    int n_pairs, n_fit;          /* pairs with enough matches; that fit */
    bool bad;                    /* too few of them fit */
    bool found;                  /* mistake, with which n_fit becomes */
    saga_mistake mistake;
    int n_fit_then;
    saga_refinement refinement;  /* of small errors; none if a mistake was
                                  * found */
} saga_calibration;

/* Fills *calibration; saga_calibration_free also after a failure. */
bool saga_calibration_find(saga_calibration *calibration,
                           const saga_capture *capture, saga_error *error);
void saga_calibration_free(saga_calibration *calibration);

/* Undoes the mistake of poses and lens in a camera: world to camera rotation,
 * translation, and fx, fy, cx, cy. It leaves exchanged pictures alone. */
void saga_mistake_undo(const saga_mistake *mistake, double rotation[9],
                       double translation[3], double lens[4]);

#endif
