/* SPDX-License-Identifier: MIT
 *
 * A capture is rendered of a world: one of the scenes at one moment.
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

/* A sight is what a ray meets. */
typedef struct saga_synth_sight {
    double distance;         /* in lengths of the direction */
    double position[3];
    bool fixed;              /* looks the same from elsewhere */
} saga_synth_sight;

void saga_synth_world_at(saga_synth_world *world,
                         const saga_synth_options *options, double seconds);

saga_synth_sight saga_synth_look(const saga_synth_world *world,
                                 const double origin[3],
                                 const double direction[3]);

/* Finds the linear light, each channel 0..1 and a bit. */
void saga_synth_light(const saga_synth_world *world, const double origin[3],
                      const double direction[3], double rgb[3]);

#endif
