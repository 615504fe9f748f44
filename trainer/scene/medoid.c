/* SPDX-License-Identifier: MIT */
#include "medoid.h"

#include <math.h>
#include <stdlib.h>

enum {
    ROUNDS = 4
}; /* how often members are assigned and medoids
    * moved */

/* Chooses the medoids one by one: each is the member that lowers the cost most,
 * given the earlier ones. The first is the medoid of all members. */
static void seed_medoids(saga_medoid_division *v)
{
    double near[SAGA_MEDOID_MOST];
    uint8_t taken[SAGA_MEDOID_MOST] = { 0 };
    uint32_t i, j, m;

    for (j = 0; j < v->n; j++)
        near[j] = HUGE_VAL;
    for (m = 0; m < v->k; m++) {
        double best = HUGE_VAL;

        for (i = 0; i < v->n; i++) {
            const double *const d = v->distance + i * v->n;
            double cost = 0;

            for (j = 0; j < v->n; j++)
                /* The cost if i became a medoid too, and each member belonged
                 * to its nearest. */
                cost += v->w[j] * (d[j] < near[j] ? d[j] : near[j]);
            if (!taken[i] && cost < best) {
                best = cost;
                v->medoid[m] = i;
            }
        }
        taken[v->medoid[m]] = 1;
        for (j = 0; j < v->n; j++) {
            const double d = v->distance[v->medoid[m] * v->n + j];

            near[j] = d < near[j] ? d : near[j];
        }
    }
}

/* Assigns members to their nearest medoids. A medoid is always assigned to
 * itself, so none is empty even if members coincide. */
static void assign_nearest(saga_medoid_division *v)
{
    uint32_t i, j;

    for (j = 0; j < v->n; j++) {
        const double *const d = v->distance + j * v->n;

        v->of[j] = 0;
        for (i = 1; i < v->k; i++)
            if (d[v->medoid[i]] < d[v->medoid[v->of[j]]])
                v->of[j] = (uint8_t)i;
    }
    for (i = 0; i < v->k; i++)
        v->of[v->medoid[i]] = (uint8_t)i;
}

/* Moves each cluster's medoid to the best of its members. Returns 1 if any
 * changed. */
static int move_medoids(saga_medoid_division *v)
{
    double best[SAGA_MAX_CHILDREN];
    uint32_t medoid[SAGA_MAX_CHILDREN] = { 0 }, i, j;
    int changed = 0;

    for (i = 0; i < v->k; i++)
        best[i] = HUGE_VAL;
    for (i = 0; i < v->n; i++) {
        const uint32_t a = v->of[i];
        double cost = 0;

        /* The cost of member i as the medoid: the weighted distances from it to
         * all members of its cluster. */
        for (j = 0; j < v->n; j++)
            if (v->of[j] == a)
                cost += v->w[j] * v->distance[i * v->n + j];
        if (cost < best[a]) {
            best[a] = cost;
            medoid[a] = i;
        }
    }
    for (i = 0; i < v->k; i++) {
        changed |= medoid[i] != v->medoid[i];
        v->medoid[i] = medoid[i];
    }
    return changed;
}

typedef struct {
    double distance;
    uint16_t member, medoid;
} pair;

static int by_distance(const void *x, const void *y)
{
    const pair *const a = x, *const b = y;

    if (a->distance > b->distance || a->distance < b->distance)
        return a->distance > b->distance ? 1 : -1;
    if (a->member != b->member)
        return a->member > b->member ? 1 : -1;
    return (a->medoid > b->medoid) - (a->medoid < b->medoid);
}

/* Assigns members within the room of their medoids. The nearest pairs are
 * assigned first; a member whose medoid is full goes to the nearest one that is
 * not. */
static void assign_within(saga_medoid_division *v, uint32_t room)
{
    pair pairs[SAGA_MEDOID_MOST * SAGA_MAX_CHILDREN];
    uint32_t count[SAGA_MAX_CHILDREN] = { 0 }, n = 0, i, j;
    uint8_t done[SAGA_MEDOID_MOST] = { 0 };

    for (i = 0; i < v->k; i++) {
        /* Medoids are assigned first, each to itself, which takes one place. */
        v->of[v->medoid[i]] = (uint8_t)i;
        done[v->medoid[i]] = 1;
        count[i] = 1;
    }
    for (j = 0; j < v->n; j++)
        for (i = 0; i < v->k && !done[j]; i++) {
            pairs[n].distance = v->distance[j * v->n + v->medoid[i]];
            pairs[n].member = (uint16_t)j;
            pairs[n++].medoid = (uint16_t)i;
        }
    qsort(pairs, n, sizeof *pairs, by_distance);
    /* There are k room places for n members (saga_tree_need), so all get
     * one. */
    for (i = 0; i < n; i++)
        if (!done[pairs[i].member] && count[pairs[i].medoid] < room) {
            v->of[pairs[i].member] = (uint8_t)pairs[i].medoid;
            done[pairs[i].member] = 1;
            count[pairs[i].medoid]++;
        }
}

void saga_medoid_divide(saga_medoid_division *v, uint32_t room)
{
    seed_medoids(v);
    for (int round = 0; round < ROUNDS; round++) {
        assign_nearest(v);
        if (!move_medoids(v))
            break;
    }
    /* The rounds ignore the limit of members, for the best medoids; it is
     * applied at the end. */
    assign_within(v, room);
}
