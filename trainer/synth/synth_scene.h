/* SPDX-License-Identifier: MIT
 *
 * The built-in scene: a textured room with a bench; a ball that rolls, a cube
 * that turns, a pendulum on a thin rod, a ball that appears, a glossy ball
 * and a thin lamp pole that stand still. Metres, z up, y away from the
 * cameras, light from the front left.
 *
 * Everything is made of IEEE additions, products, quotients, square roots and
 * floor, with an own sine: built without contraction (-ffp-contract=off), the
 * same bits come out on every machine.
 */
#ifndef SAGA_SYNTH_SCENE_H
#define SAGA_SYNTH_SCENE_H

#include <stdbool.h>

enum saga_synth_object {
    SAGA_SYNTH_ROOM,
    SAGA_SYNTH_BENCH,
    SAGA_SYNTH_CUBE,     /* turns */
    SAGA_SYNTH_BALL,     /* rolls */
    SAGA_SYNTH_GUEST,    /* appears, goes, comes back */
    SAGA_SYNTH_MIRROR,   /* glossy */
    SAGA_SYNTH_BOB,      /* of the pendulum */
    SAGA_SYNTH_LAMP,
    SAGA_SYNTH_POLE,     /* thin, of the lamp */
    SAGA_SYNTH_ROD,      /* thin, of the pendulum */
    SAGA_SYNTH_N_OBJECTS
};

enum { SAGA_SYNTH_N_BALLS = 5 };  /* BALL .. LAMP, in that order */

/* Where things are at one moment. */
typedef struct saga_synth_state {
    double seconds;
    double ball[SAGA_SYNTH_N_BALLS][3];  /* centres */
    double radius[SAGA_SYNTH_N_BALLS];   /* 0: not there */
    double cube_cos, cube_sin;           /* its turn about z */
    double roll_cos, roll_sin;           /* of the rolling ball, about y */
    double hook[3];                      /* where the rod hangs */
} saga_synth_state;

typedef struct saga_synth_hit {
    double distance;    /* in lengths of the direction */
    double position[3], normal[3];
    enum saga_synth_object object;
} saga_synth_hit;

/* Any time, also negative; all motions are periodic and have no jumps but
 * the guest's coming. */
void saga_synth_at(saga_synth_state *state, double seconds);

/* From inside the room something is always hit. direction need not be of
 * unit length. */
saga_synth_hit saga_synth_trace(const saga_synth_state *state,
                                const double origin[3],
                                const double direction[3]);

/* Linear light coming back along a ray, each channel 0..1 and a bit. */
void saga_synth_radiance(const saga_synth_state *state, const double origin[3],
                         const double direction[3], double rgb[3]);

void saga_synth_sin_cos(double turns, double *s, double *c);

#endif
