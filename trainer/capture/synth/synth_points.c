/* SPDX-License-Identifier: MIT
 *
 * Makes points of the built-in scenes as structure from motion would find them:
 * textured places that several cameras see, with noise.
 */
#include "synth_job.h"

#include "alloc.h"
#include "ply.h"
#include "pose.h"
#include "synth_world.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

/* ----------------------------------------------------------- random numbers */

static uint32_t next_random(uint64_t *state)
{
    *state = *state * 6364136223846793005u + 1442695040888963407u;
    /* A linear congruential step has poor low bits, so they are mixed in and
     * only the high half of the product is used. */
    uint64_t x = *state ^ *state >> 33;
    x *= 0xff51afd7ed558ccdu;
    return (uint32_t)(x >> 32);
}

static double random_unit(uint64_t *state)
{
    return (next_random(state) + 0.5) * (1.0 / 4294967296.0);
}

/* Returns the sum of four uniform numbers, scaled to variance 1. That is nearly
 * a Gaussian without outliers. */
static double random_bell(uint64_t *state)
{
    double sum = -2.0;
    for (int i = 0; i < 4; i++)
        sum += random_unit(state);
    /* Four uniforms have a variance of 4 / 12; times sqrt(3) it is 1. */
    return sum * 1.7320508075688772;
}

/* ------------------------------------------------------------------- points */

static void radiance_at(const saga_source_view *view,
                        const saga_synth_world *world, const double origin[3],
                        double u, double v, double rgb[3])
{
    double d[3];
    saga_synth_direction(view, u, v, d);
    saga_synth_light(world, origin, d, rgb);
}

/* Returns the change of the picture over 1.5 pixels, in display units 0..1. */
static double contrast(const saga_source_view *view,
                       const saga_synth_world *world, const double origin[3],
                       double u, double v, double rgb[3])
{
    double other[3], sum = 0.0;
    radiance_at(view, world, origin, u, v, rgb);
    for (int k = 0; k < 2; k++) {
        radiance_at(view, world, origin, u + (k ? 0.0 : 1.5),
                    v + (k ? 1.5 : 0.0), other);
        for (int c = 0; c < 3; c++)
            sum += fabs(sqrt(other[c]) - sqrt(rgb[c]));
    }
    return sum / 3.0;
}

/* Tells whether any other training view sees the point unhidden. */
static bool seen_again(const saga_synth_job *job, const saga_synth_world *world,
                       const double point[3], int from)
{
    for (int i = 0; i < job->options->n_cameras; i++) {
        const saga_source_view *const v = &job->views[i];
        double uv[2], z, origin[3], d[3];
        if (i == from || v->held_out || !saga_view_project(v, point, uv, &z))
            continue;
        if (uv[0] < 0.0 || uv[1] < 0.0 || uv[0] >= v->width ||
            uv[1] >= v->height)
            continue;
        saga_pose_centre(v->rotation, v->translation, origin);
        saga_synth_direction(v, uv[0], uv[1], d);
        /* The view sees the point if the first hit along the ray is at the same
         * distance. */
        if (fabs(saga_synth_look(world, origin, d).distance - z) < 0.005 * z)
            return true;
    }
    return false;
}

/* Tries to make one point. Its noise is half a pixel across the ray, and three
 * times that along it. */
static bool sample_point(const saga_synth_job *job,
                         const saga_synth_world *world, uint64_t *random,
                         saga_point *point)
{
    const int camera = (int)(random_unit(random) * job->options->n_cameras);
    const saga_source_view *const view = &job->views[camera];
    const double u = random_unit(random) * view->width;
    const double v = random_unit(random) * view->height;
    const double dice = random_unit(random);
    double origin[3], d[3], rgb[3];
    if (view->held_out)
        return false;
    saga_pose_centre(view->rotation, view->translation, origin);
    /* As in structure from motion, points come mostly from textured places; a
     * few come from anywhere. */
    if (dice > 0.06 + 6.0 * contrast(view, world, origin, u, v, rgb))
        return false;
    saga_synth_direction(view, u, v, d);
    const saga_synth_sight hit = saga_synth_look(world, origin, d);
    if (!hit.fixed || !seen_again(job, world, hit.position, camera))
        return false;
    /* The noise across the ray is half a pixel at this distance. */
    const double across = 0.5 * hit.distance / view->fx;
    const double along = 3.0 * across * random_bell(random);
    for (int i = 0; i < 3; i++) {
        point->position[i] = hit.position[i] + across * random_bell(random) +
                             along * d[i];
        point->rgb[i] = saga_synth_display(rgb[i]);
    }
    return true;
}

bool saga_synth_write_points(const saga_synth_job *job)
{
    const int wanted = job->options->n_points;
    saga_point *const points = saga_alloc((size_t)wanted, sizeof *points,
                                          job->target, job->error);
    uint64_t random = job->options->seed * 0x9e3779b97f4a7c15u + 1;
    saga_synth_world world;
    size_t n = 0;
    char path[SAGA_SYNTH_PATH];
    if (!points)
        return false;
    saga_synth_world_at(&world, job->options, 0.0);
    /* The points are those at time 0. In a scene without texture this gives up
     * after 100 tries per point and returns fewer points. */
    for (long tries = 0; n < (size_t)wanted && tries < 100L * wanted; tries++)
        if (sample_point(job, &world, &random, &points[n]))
            n++;
    (void)snprintf(path, sizeof path, "%s/points.ply", job->folder);
    const bool ok = saga_ply_write(path, points, n, job->error);
    free(points);
    return ok;
}
