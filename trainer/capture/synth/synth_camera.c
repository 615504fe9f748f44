/* SPDX-License-Identifier: MIT
 *
 * Places the cameras of the built-in scenes, on an arc or in a ring.
 */
#include "synth_job.h"

#include "pose.h"
#include "ring_motion.h"
#include "synth_math.h"
#include "vec3.h"

#include <math.h>
#include <stdio.h>

/* Tells whether a view is held out. Such views lie between training views, and
 * at an arc's end only if there is no other choice. */
static bool is_held_out(const saga_synth_options *o, int index)
{
    for (int k = 0; k < o->n_hold_out; k++)
        if (index == (k + 1) * o->n_cameras / (o->n_hold_out + 1))
            return true;
    return false;
}

/* The position of a camera, the point that it looks at, and its focal length in
 * widths of the picture. */
typedef struct stand {
    double centre[3], target[3], focal;
} stand;

static stand stand_on_arc(const saga_synth_options *o, int index)
{
    stand a = { .target = { 0.0, 0.45, 0.82 }, .focal = 0.9 };
    /* The arc spans 50 degrees; heights alternate between two values. */
    const double turn = (-25.0 + 50.0 * index / (o->n_cameras - 1)) / 360.0;
    double s, c;
    saga_synth_sin_cos(turn, &s, &c);
    a.centre[0] = a.target[0] + 3.2 * s;
    a.centre[1] = a.target[1] - 3.2 * c;
    a.centre[2] = index % 2 ? 1.80 : 1.20;
    return a;
}

/* Places a camera in a ring, evenly except for random offsets, as people place
 * tripods. */
static stand stand_on_ring(const saga_synth_options *o, int index)
{
    stand a = { .target = { 0.0, 0.0, 0.92 }, .focal = 0.8 };
    const double off = saga_ring_draw(o->seed, 500 + index, -0.1, 0.1);
    const double away = saga_ring_draw(o->seed, 600 + index, 3.1, 3.3);
    double s, c;
    saga_synth_sin_cos((index + off) / o->n_cameras, &s, &c);
    a.centre[0] = away * c;
    a.centre[1] = away * s;
    a.centre[2] = (index % 2 ? 1.95 : 1.05) +
                  saga_ring_draw(o->seed, 700 + index, -0.08, 0.08);
    return a;
}

void saga_synth_view(const saga_synth_options *options, int index,
                     saga_source_view *view)
{
    const stand at = options->scene == SAGA_SYNTH_RING
                         ? stand_on_ring(options, index)
                         : stand_on_arc(options, index);
    double right[3], down[3], forward[3], n2 = 0.0;
    for (int i = 0; i < 3; i++) {
        forward[i] = at.target[i] - at.centre[i];
        n2 += forward[i] * forward[i];
    }
    for (int i = 0; i < 3; i++)
        forward[i] /= sqrt(n2);
    /* The axes are right = forward x up and down = forward x right. */
    const double h = sqrt(forward[0] * forward[0] + forward[1] * forward[1]);
    right[0] = forward[1] / h;
    right[1] = -forward[0] / h;
    right[2] = 0.0;
    cross3(down, forward, right);
    *view = (saga_source_view){ .width = options->width,
                                .height = options->height,
                                .held_out = is_held_out(options, index),
                                .original_width = options->width,
                                .original_height = options->height,
                                .focal_scale = 1.0 };
    /* Pixels are square, and the principal point is the picture's centre. */
    view->fx = view->fy = at.focal * options->width;
    view->cx = 0.5 * options->width;
    view->cy = 0.5 * options->height;
    (void)snprintf(view->name, sizeof view->name, "cam%02d", index % 100);
    (void)saga_pose_from_axes(right, down, forward, at.centre, view->rotation,
                              view->translation);
}

void saga_synth_direction(const saga_source_view *view, double u, double v,
                          double d[3])
{
    const double x = (u - view->cx) / view->fx, y = (v - view->cy) / view->fy;
    for (int i = 0; i < 3; i++)
        d[i] = view->rotation[i] * x + view->rotation[3 + i] * y +
               view->rotation[6 + i];
}
