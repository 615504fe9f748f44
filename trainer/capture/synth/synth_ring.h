/* SPDX-License-Identifier: MIT
 *
 * The scene "ring" has hard motion, with cameras all round. In the middle of a
 * hall somebody runs in a circle, swings a thin baton and throws a ball, which
 * flies, spins and bounces; a cube comes from one picture to the next, and a
 * ball goes; two displays show a new picture in every frame; thin poles, a wire
 * and a crate stand around. Metres, z up, the middle of the floor at 0.
 *
 * A seed draws colours, textures, shapes, speeds and places, so that another
 * seed is another scene of the same kind.
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
    SAGA_RING_BATON,     /* thin, in the left hand */
    SAGA_RING_BALL,      /* thrown by the right hand */
    SAGA_RING_COMER,     /* a cube: not there, then there */
    SAGA_RING_GOER,      /* a ball: there, then not */
    SAGA_RING_POLE,      /* thin; the wire too */
    SAGA_RING_CRATE,     /* and what comer and goer stand on */
    SAGA_RING_DISPLAY,
    SAGA_RING_GROUND,
    SAGA_RING_WALL       /* and the ceiling */
};

enum {
    SAGA_RING_N_POLES = 5,
    SAGA_RING_N_COLOURS = 16,
    SAGA_RING_MAX_SHAPES = 40
};

/* A seed draws this plan; angles are in turns, times in seconds. */
typedef struct saga_ring_plan {
    uint32_t salt;               /* of the textures */
    double colour[SAGA_RING_N_COLOURS][3];
    double size, girth;          /* of the body; about 1 */
    double path_radius, path_start, path_turn; /* turns a second, signed */
    double stride;               /* pairs of steps a second */
    double release, aim, reach, flight;  /* of the throw; aim off forward */
    double comes, goes;
    double place[4];             /* where comer, goer, crate, display stand */
    double pole[SAGA_RING_N_POLES][6];   /* foot, top */
    double light[3];
} saga_ring_plan;

/* A shape is a capsule, a ball (length 0) or a box. */
typedef struct saga_ring_shape {
    enum saga_ring_object object;
    bool is_box;
    double a[3];                 /* where the axis begins; a box's centre */
    double length, radius;       /* of a capsule's axis, and around it */
    double half[3];              /* of a box, along its own axes */
    double frame[3][3];          /* rows are its own axes; the first is the
                                  * capsule's axis, or a head's forward */
    double centre[3], bound;     /* a ball around all of it */
} saga_ring_shape;

/* A state says where things are at one moment. */
typedef struct saga_ring_state {
    saga_ring_plan plan;
    double seconds;
    saga_ring_shape shape[SAGA_RING_MAX_SHAPES];
    int n_body, n_shapes;        /* the body's are first */
    double body_centre[3], body_bound;
} saga_ring_state;

typedef struct saga_ring_hit {
    double distance;             /* in lengths of the direction */
    double position[3], normal[3];
    enum saga_ring_object object;
    int shape;                   /* -1: the hall's own */
} saga_ring_hit;

/* A round takes this time, after which throw, coming and going begin anew. */
#define SAGA_RING_ROUND 2.4

/* Takes any time, also negative. */
void saga_ring_at(saga_ring_state *state, uint32_t seed, double seconds);

/* Finds where the ball is some seconds after it left a hand at `from` with
 * the velocity `speed`, m/s: it falls, bounces off floor and walls. */
void saga_ring_fly(double at[3], const double from[3], const double speed[3],
                   double seconds);

/* The thrown ball has this radius. */
#define SAGA_RING_BALL_RADIUS 0.11

/* From inside the hall something is always hit. direction need not be of unit
 * length. */
saga_ring_hit saga_ring_trace(const saga_ring_state *state,
                              const double origin[3],
                              const double direction[3]);

/* Finds linear light coming back along a ray, each channel 0..1 and a bit. */
void saga_ring_radiance(const saga_ring_state *state, const double origin[3],
                        const double direction[3], double rgb[3]);

/* Half the hall's width, and its height. */
#define SAGA_RING_HALL 4.4
#define SAGA_RING_CEILING 3.4

#endif
