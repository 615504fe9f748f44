/* SPDX-License-Identifier: MIT
 *
 * The scene "room" is a textured room with a bench; a ball that rolls, a cube
 * that turns, a pendulum on a thin rod, a ball that appears, a glossy ball and
 * a thin lamp pole that stand still. Metres, z up, y away from the cameras,
 * light from the front left.
 */
#ifndef SAGA_SYNTH_ROOM_H
#define SAGA_SYNTH_ROOM_H

#include <stdbool.h>

enum saga_room_object {
    SAGA_ROOM_WALLS,
    SAGA_ROOM_BENCH,
    SAGA_ROOM_CUBE,     /* turns */
    SAGA_ROOM_BALL,     /* rolls */
    SAGA_ROOM_GUEST,    /* appears, goes, comes back */
    SAGA_ROOM_MIRROR,   /* glossy */
    SAGA_ROOM_BOB,      /* of the pendulum */
    SAGA_ROOM_LAMP,
    SAGA_ROOM_POLE,     /* thin, of the lamp */
    SAGA_ROOM_ROD,      /* thin, of the pendulum */
    SAGA_ROOM_N_OBJECTS
};

enum { SAGA_ROOM_N_BALLS = 5 };  /* BALL .. LAMP, in that order */

/* A state says where things are at one moment. */
typedef struct saga_room_state {
    double seconds;
    double ball[SAGA_ROOM_N_BALLS][3];  /* centres */
    double radius[SAGA_ROOM_N_BALLS];   /* 0: not there */
    double cube_cos, cube_sin;           /* its turn about z */
    double roll_cos, roll_sin;           /* of the rolling ball, about y */
    double hook[3];                      /* where the rod hangs */
} saga_room_state;

typedef struct saga_room_hit {
    double distance;    /* in lengths of the direction */
    double position[3], normal[3];
    enum saga_room_object object;
} saga_room_hit;

/* Takes any time, also negative; all motions are periodic and have no jumps but
 * the guest's coming. */
void saga_room_at(saga_room_state *state, double seconds);

/* From inside the room something is always hit. direction need not be of
 * unit length. */
saga_room_hit saga_room_trace(const saga_room_state *state,
                              const double origin[3],
                              const double direction[3]);

/* Finds linear light coming back along a ray, each channel 0..1 and a bit. */
void saga_room_radiance(const saga_room_state *state, const double origin[3],
                        const double direction[3], double rgb[3]);

#endif
