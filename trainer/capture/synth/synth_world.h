/* SPDX-License-Identifier: MIT
 *
 * One of the built-in scenes at one moment, from which a capture is rendered.
 */
#ifndef SAGA_SYNTH_WORLD_H
#define SAGA_SYNTH_WORLD_H

#include "synth.h"
#include "synth_ring.h"
#include "synth_room.h"

typedef struct saga_synth_world {
    saga_synth_scene scene;
    union {
        saga_room_state room;
        saga_ring_state ring;
    } at;
} saga_synth_world;

/* What a ray hits. */
typedef struct saga_synth_sight {
    double distance; /* distance in lengths of the ray's direction */
    double position[3];
    bool fixed; /* the light does not depend on the direction of
                 * view */
} saga_synth_sight;

void saga_synth_world_at(saga_synth_world *world,
                         const saga_synth_options *options, double seconds);

saga_synth_sight saga_synth_look(const saga_synth_world *world,
                                 const double origin[3],
                                 const double direction[3]);

/* Tells whether a ray first hits the scene's subject (synth.h). */
bool saga_synth_is_subject(const saga_synth_world *world,
                           const double origin[3], const double direction[3]);

/* Computes the linear light along a ray; channels are 0..1, highlights slightly
 * more. */
void saga_synth_light(const saga_synth_world *world, const double origin[3],
                      const double direction[3], double rgb[3]);

#endif
