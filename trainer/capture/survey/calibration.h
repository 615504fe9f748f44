/* SPDX-License-Identifier: MIT
 *
 * Checks without points whether the poses and lenses of a capture fit its
 * pictures. Features are matched between pairs of views, and the matches that
 * some two pinholes could have seen are kept. The error of a match is its
 * distance from the epipolar lines of the capture's cameras; that of a place
 * which three cameras see is the distance of one sight from where the two other
 * rays meet.
 *
 * If errors are large, the usual mistakes are undone one after the other, and
 * the one after which the pictures fit is reported. Nothing is reported of
 * cameras that have too little in common.
 */
#ifndef SAGA_CALIBRATION_H
#define SAGA_CALIBRATION_H

#include "capture.h"
#include "match_colours.h"
#include "refine.h"

/* The form of the matrices (A, b) in a file, which should be those of its
 * convention: camera to world, or world to camera. */
typedef enum saga_pose_form {
    SAGA_POSE_RIGHT,
    SAGA_POSE_INVERSE,     /* A and b are those of the other direction */
    SAGA_POSE_TRANSPOSED,  /* A is that of the other direction; b is right */
    SAGA_POSE_TRANSLATION, /* A is right; b is that of the other direction */
    SAGA_POSE_FORMS
} saga_pose_form;

/* Camera axes, to be added. */
enum { SAGA_AXIS_X = 1, SAGA_AXIS_Y = 2, SAGA_AXIS_Z = 4, SAGA_AXES = 8 };

/* A mistake that all cameras share. */
typedef struct saga_mistake {
    saga_pose_convention poses; /* the file's convention, */
    saga_pose_form form;        /* its matrices' form, */
    int reversed;               /* and which axes of the cameras are reversed
                                 * once the form is right, as if OpenCV's axes
                                 * were taken for OpenGL's: y + z */
    bool mirrored;  /* the world is a mirror image, as if its z axis was
                     * reversed; any other axis would fit as well */
    double focal;   /* factor by which focal lengths must be
                     * multiplied; 1: they are right */
    bool centre;    /* principal points must be multiplied, too */
    int swapped[2]; /* cameras with exchanged pictures; -1: none */
} saga_mistake;

typedef struct saga_calibration {
    double *off;                /* (n_views) error in pixels: the median over
                                 * the pairs of a view of their median; NaN:
                                 * too few matches */
    bool *odd;                  /* (n_views) the others fit without these */
    saga_match_colour *colours; /* (n_views) */
    int *shared;                /* (n_views, n_views) number of matches that
                                 * agree; -1: not compared */
    double *turned;             /* (n_views, n_views) median distance in pixels
                                 * of these matches from where the second
                                 * camera would see what is far away; NaN: no
                                 * matches */
    int *n_features;            /* (n_views) number of corners in the
                                 * picture */
    double typical;             /* median error of all pairs; NaN: too few
                                 * pairs */
    double within;              /* errors below this, in pixels, count as a
                                 * fit */
    int n_pairs, n_fit;         /* number of pairs with enough matches, and of
                                 * those that fit */
    bool bad;                   /* too few pairs fit */
    bool found;                 /* `mistake` was found; if it is undone,
                                 * n_fit_then pairs fit */
    saga_mistake mistake;
    int n_fit_then;
    saga_refinement refinement; /* correction of small errors; empty if a
                                 * mistake was found */
} saga_calibration;

/* Checks the calibration. saga_calibration_free must be called also after a
 * failure. */
bool saga_calibration_find(saga_calibration *calibration,
                           const saga_capture *capture, saga_error *error);
void saga_calibration_free(saga_calibration *calibration);

/* Undoes the mistake in a camera's pose (rotation and translation of world to
 * camera) and lens (fx, fy, cx, cy). Exchanged pictures are not changed. */
void saga_mistake_undo(const saga_mistake *mistake, double rotation[9],
                       double translation[3], double lens[4]);

#endif
