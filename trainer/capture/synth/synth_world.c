/* SPDX-License-Identifier: MIT */
#include "synth_world.h"

#include <string.h>

void saga_synth_world_at(saga_synth_world *w, const saga_synth_options *o,
                         double seconds)
{
    w->scene = o->scene;
    if (o->scene == SAGA_SYNTH_RING)
        saga_ring_at(&w->at.ring, o->seed, seconds);
    else
        saga_room_at(&w->at.room, seconds);
}

saga_synth_sight saga_synth_look(const saga_synth_world *w,
                                 const double origin[3],
                                 const double direction[3])
{
    saga_synth_sight sight = { .fixed = true };
    if (w->scene == SAGA_SYNTH_RING) {
        const saga_ring_hit hit = saga_ring_trace(&w->at.ring, origin,
                                                  direction);
        sight.distance = hit.distance;
        memcpy(sight.position, hit.position, sizeof sight.position);
        return sight;
    }
    const saga_room_hit hit = saga_room_trace(&w->at.room, origin, direction);
    sight.distance = hit.distance;
    memcpy(sight.position, hit.position, sizeof sight.position);
    sight.fixed = hit.object != SAGA_ROOM_MIRROR;
    return sight;
}

bool saga_synth_is_subject(const saga_synth_world *w, const double origin[3],
                           const double direction[3])
{
    /* The objects of both scenes are listed with their subjects together. */
    return w->scene == SAGA_SYNTH_RING
               ? saga_ring_trace(&w->at.ring, origin, direction).object <=
                     SAGA_RING_BALL
               : saga_room_trace(&w->at.room, origin, direction).object >
                     SAGA_ROOM_BENCH;
}

void saga_synth_light(const saga_synth_world *w, const double origin[3],
                      const double direction[3], double rgb[3])
{
    if (w->scene == SAGA_SYNTH_RING)
        saga_ring_radiance(&w->at.ring, origin, direction, rgb);
    else
        saga_room_radiance(&w->at.room, origin, direction, rgb);
}
