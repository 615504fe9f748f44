/* SPDX-License-Identifier: MIT
 *
 * The scene "ring" has fast motion and cameras all round. In the middle of a
 * hall a person runs in a circle, swings a thin baton and throws a ball, which
 * flies, spins and bounces. A cube appears from one picture to the next, and a
 * ball disappears. Two displays show a new picture in every frame; thin poles,
 * a wire and a crate stand still. Units are metres, z is up, and the middle of
 * the floor is at 0.
 *
 * The seed determines colours, textures, shapes, speeds and places, so that
 * another seed gives another scene of the same kind.
 */
#ifndef SAGA_SYNTH_RING_H
#define SAGA_SYNTH_RING_H

#include <stdbool.h>
#include <stdint.h>

enum saga_ring_object {
    SAGA_RING_SHIRT,
    SAGA_RING_TROUSERS,
    SAGA_RING_SKIN,
    SAGA_RING_HEAD,
    SAGA_RING_SHOE,
    SAGA_RING_BATON, /* thin, in the left hand */
    SAGA_RING_BALL,  /* thrown by the right hand */
    SAGA_RING_COMER, /* a cube that appears */
    SAGA_RING_GOER,  /* a ball that disappears */
    SAGA_RING_POLE,  /* thin poles and the wire */
    SAGA_RING_CRATE, /* the crate, and what COMER and GOER stand on */
    SAGA_RING_DISPLAY,
    SAGA_RING_GROUND,
    SAGA_RING_WALL /* walls and ceiling */
};

enum {
    SAGA_RING_N_POLES = 5,
    SAGA_RING_N_COLOURS = 16,
    SAGA_RING_MAX_SHAPES = 40
};

/* The random parameters of a scene. Angles are in turns, times in seconds. */
typedef struct saga_ring_plan {
    uint32_t salt; /* salt of the textures */
    double colour[SAGA_RING_N_COLOURS][3];
    double size, girth; /* size and girth of the body, about 1 */
    double path_radius, path_start, path_turn; /* the runner's circle in metres;
                                                * path_turn in turns per second,
                                                * signed */
    double stride;                             /* pairs of steps per second */
    double release, aim, reach, flight; /* the throw of the ball; aim is the
                                         * angle from forward */
    double comes, goes;
    double place[4]; /* angles of comer, goer, crate and display on
                      * the circle */
    double pole[SAGA_RING_N_POLES][6]; /* foot and top of each pole */
    double light[3];
} saga_ring_plan;

/* A shape is a capsule, a ball (length 0) or a box. */
typedef struct saga_ring_shape {
    enum saga_ring_object object;
    bool is_box;
    double a[3];             /* beginning of the axis, or centre of a box */
    double length, radius;   /* length of a capsule's axis, and radius
                              * around it */
    double half[3];          /* half sides of a box, along its own axes */
    double frame[3][3];      /* rows are the shape's axes; the first is a
                              * capsule's axis, or a head's forward */
    double centre[3], bound; /* a ball that contains the whole shape */
} saga_ring_shape;

/* The positions of all objects at one moment. */
typedef struct saga_ring_state {
    saga_ring_plan plan;
    double seconds;
    saga_ring_shape shape[SAGA_RING_MAX_SHAPES];
    int n_body, n_shapes; /* shapes of the body, which come first, and of
                           * all */
    double body_centre[3], body_bound;
} saga_ring_state;

typedef struct saga_ring_hit {
    double distance; /* distance in lengths of the ray's
                      * direction */
    double position[3], normal[3];
    enum saga_ring_object object;
    int shape; /* index of the shape; -1: the hall */
} saga_ring_hit;

/* Seconds of a round, after which throw, appearance and disappearance
 * repeat. */
#define SAGA_RING_ROUND 2.4

/* Computes the state at any time, which may be negative. */
void saga_ring_at(saga_ring_state *state, uint32_t seed, double seconds);

/* Computes where the ball is some seconds after it left a hand at `from` with
 * the velocity `speed` in m/s. It falls, and bounces off floor and walls. */
void saga_ring_fly(double at[3], const double from[3], const double speed[3],
                   double seconds);

/* Radius of the thrown ball in metres. */
#define SAGA_RING_BALL_RADIUS 0.11

/* Traces a ray from inside the hall, which always hits something. direction may
 * have any length. */
saga_ring_hit saga_ring_trace(const saga_ring_state *state,
                              const double origin[3],
                              const double direction[3]);

/* Computes the linear light that comes back along a ray; channels are 0..1,
 * highlights slightly more. */
void saga_ring_radiance(const saga_ring_state *state, const double origin[3],
                        const double direction[3], double rgb[3]);

/* Half of the hall's width, and its height, in metres. */
#define SAGA_RING_HALL 4.4
#define SAGA_RING_CEILING 3.4

#endif
