/* SPDX-License-Identifier: MIT */
#include "lone.h"

#include "alloc.h"
#include "camera.h"

#include <math.h>
#include <stdlib.h>

/* Views look in a similar direction if the cosine between them is above this,
 * as in plane_sweep.c. */
#define SAME_WAY 0.2

static double depth_of(const saga_pictures *p, int view)
{
    return sqrt(p->range[2 * view] * p->range[2 * view + 1]);
}

double saga_view_angle(const saga_pictures *p, int v, int w)
{
    const saga_source_view *const a = &p->capture->views[v];
    const saga_source_view *const b = &p->capture->views[w];
    double x[3], y[3], square = 0, same = 0;

    saga_source_view_centre(x, a);
    saga_source_view_centre(y, b);
    for (int i = 0; i < 3; i++) {
        square += (x[i] - y[i]) * (x[i] - y[i]);
        same += a->rotation[6 + i] * b->rotation[6 + i];
    }
    return same > SAME_WAY ? 2 * atan(sqrt(square) / 2 /
                                      fmin(depth_of(p, v), depth_of(p, w)))
                           : INFINITY;
}

/* A view that looks in a direction of its own is not alone: no viewer goes from
 * it to another. */
static bool is_lone(const saga_pictures *p, int k)
{
    double nearest = INFINITY;

    for (int i = 0; i < p->n_train; i++)
        if (i != k)
            nearest = fmin(nearest,
                           saga_view_angle(p, p->train[k], p->train[i]));
    return nearest > SAGA_LONE_ANGLE && nearest < INFINITY;
}

bool saga_lone_find(saga_lone *l, const saga_pictures *p, saga_error *error)
{
    const bool any = !p->capture->moves && !p->capture->subject;

    *l = (saga_lone){ .n = 0 };
    l->centre = saga_alloc(3 * (size_t)p->n_train, sizeof *l->centre,
                           "the views", error);
    for (int k = 0; l->centre && any && k < p->n_train; k++)
        if (is_lone(p, k)) {
            saga_splat_camera camera;

            saga_pictures_camera(&camera, p,
                                 (saga_sample){ .view = p->train[k] });
            for (size_t i = 0; i < 3; i++)
                l->centre[3 * (size_t)l->n + i] = camera.centre[i];
            l->n++;
        }
    return l->centre != NULL;
}

void saga_lone_free(saga_lone *l)
{
    free(l->centre);
    *l = (saga_lone){ .n = 0 };
}

real saga_lone_distance(const saga_lone *l, const real *x)
{
    double least = INFINITY;

    for (size_t k = 0; k < (size_t)l->n; k++) {
        double square = 0;

        for (size_t i = 0; i < 3; i++) {
            const double d = (double)(x[i] - l->centre[3 * k + i]);

            square += d * d;
        }
        least = fmin(least, square);
    }
    return (real)sqrt(least);
}
