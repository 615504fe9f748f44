/* SPDX-License-Identifier: MIT
 *
 * The scene "room" is a textured room with a bench. It has a rolling ball, a
 * rotating cube, a pendulum on a thin rod, a ball that appears and disappears,
 * and, standing still, a glossy ball and a thin lamp pole. Units are metres, z
 * is up, y points away from the cameras, and the light is at the front left.
 */
#ifndef SAGA_SYNTH_ROOM_H
#define SAGA_SYNTH_ROOM_H

#include <stdbool.h>

enum saga_room_object {
    SAGA_ROOM_WALLS,
    SAGA_ROOM_BENCH,
    SAGA_ROOM_CUBE,   /* turns */
    SAGA_ROOM_BALL,   /* rolls */
    SAGA_ROOM_GUEST,  /* a ball that appears and disappears */
    SAGA_ROOM_MIRROR, /* glossy */
    SAGA_ROOM_BOB,    /* the pendulum's weight */
    SAGA_ROOM_LAMP,
    SAGA_ROOM_POLE, /* the lamp's thin pole */
    SAGA_ROOM_ROD,  /* the pendulum's thin rod */
    SAGA_ROOM_N_OBJECTS
};

enum { SAGA_ROOM_N_BALLS = 5 }; /* objects BALL .. LAMP, in this order */

/* The positions of all objects at one moment. */
typedef struct saga_room_state {
    double seconds;
    double ball[SAGA_ROOM_N_BALLS][3]; /* centres */
    double radius[SAGA_ROOM_N_BALLS];  /* 0: the ball does not exist */
    double cube_cos, cube_sin;         /* rotation about z */
    double roll_cos, roll_sin;         /* rotation of the rolling ball about
                                        * y */
    double hook[3];                    /* where the pendulum's rod hangs */
} saga_room_state;

typedef struct saga_room_hit {
    double distance; /* distance in lengths of the ray's direction */
    double position[3], normal[3];
    enum saga_room_object object;
} saga_room_hit;

/* Computes the state at any time, which may be negative. All motions are
 * periodic and continuous, except that the guest appears. */
void saga_room_at(saga_room_state *state, double seconds);

/* Traces a ray from inside the room, which always hits something. direction may
 * have any length. */
saga_room_hit saga_room_trace(const saga_room_state *state,
                              const double origin[3],
                              const double direction[3]);

/* Computes the linear light that comes back along a ray; channels are 0..1,
 * highlights slightly more. */
void saga_room_radiance(const saga_room_state *state, const double origin[3],
                        const double direction[3], double rgb[3]);

#endif
