/* SPDX-License-Identifier: MIT */
#include "cloud_order.h"

#include "alloc.h"

#include <math.h>
#include <stdlib.h>

enum { AXIS_BITS = 10 };

typedef struct {
    uint32_t key, index;
} keyed;

static int by_key(const void *a, const void *b)
{
    const keyed *const x = a, *const y = b;

    return x->key != y->key ? (x->key > y->key) - (x->key < y->key)
                            : (x->index > y->index) - (x->index < y->index);
}

static void find_bounds(double least[3], double most[3], const saga_cloud *c)
{
    for (size_t a = 0; a < 3; a++) {
        least[a] = INFINITY;
        most[a] = -INFINITY;
        for (size_t i = 0; i < c->n; i++) {
            least[a] = fmin(least[a], (double)c->mean[3 * i + a]);
            most[a] = fmax(most[a], (double)c->mean[3 * i + a]);
        }
    }
}

/* Interleaves the bits: bit b of axis a becomes bit 3 b + a. */
static uint32_t key_of(const float x[3], const double least[3],
                       const double most[3])
{
    uint32_t key = 0;

    for (int a = 0; a < 3; a++) {
        const double extent = most[a] - least[a];
        const double part = extent > 0.0 ? ((double)x[a] - least[a]) / extent
                                         : 0.0;
        const uint32_t step = (uint32_t)fmin(part * (1 << AXIS_BITS),
                                             (1 << AXIS_BITS) - 1);

        for (int b = 0; b < AXIS_BITS; b++)
            key |= (step >> b & 1u) << (3 * b + a);
    }
    return key;
}

uint32_t *saga_cloud_order(const saga_cloud *cloud, saga_error *error)
{
    keyed *const keys = saga_alloc(cloud->n, sizeof *keys, "splats", error);
    uint32_t *const order = saga_alloc(cloud->n, sizeof *order, "splats",
                                       error);
    double least[3], most[3];

    if (keys && order) {
        find_bounds(least, most, cloud);
        for (size_t i = 0; i < cloud->n; i++)
            keys[i] = (keyed){ key_of(cloud->mean + 3 * i, least, most),
                               (uint32_t)i };
        qsort(keys, cloud->n, sizeof *keys, by_key);
        for (size_t i = 0; i < cloud->n; i++)
            order[i] = keys[i].index;
        free(keys);
        return order;
    }
    free(keys);
    free(order);
    return NULL;
}
