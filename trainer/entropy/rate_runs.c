/* SPDX-License-Identifier: MIT */
#include "rate_runs.h"

#include "alloc.h"

#include <stdlib.h>
#include <string.h>

/* A run of primitives has at least this number of blocks, so that matrix
 * products are large. */
enum { LEAST_PRIM_RUN = 256 };

static uint32_t most_blocks(const saga_scene *s, int kind)
{
    const uint32_t most = s->model.bank_blocks;

    /* Without a bank nothing is written between blocks, so a run is a whole
     * group. */
    if (!(s->model.tools & SAGA_TOOL_BANK))
        return UINT32_MAX;
    return kind == SAGA_KIND_PRIM && most < LEAST_PRIM_RUN ? LEAST_PRIM_RUN
                                                           : most;
}

static uint32_t n_groups(const saga_scene *s, int kind)
{
    return kind == SAGA_KIND_PRIM ? 1 : s->model.tier[kind].n_groups;
}

static uint32_t group_of(const saga_scene *s, int kind, size_t block)
{
    return kind == SAGA_KIND_COARSE ? s->coarse[block].group
           : kind == SAGA_KIND_FINE ? s->fine[block].group
                                    : 0;
}

size_t saga_rate_runs_most(const saga_scene *s, int kind)
{
    return n_groups(s, kind) +
           saga_rate_n_blocks(s, kind) / most_blocks(s, kind);
}

bool saga_rate_runs_alloc(saga_rate_runs *r, const saga_scene *s, int kind,
                          saga_error *error)
{
    static const char purpose[] = "the order of coding";
    const size_t n = saga_rate_n_blocks(s, kind);

    r->n = 0;
    r->block = saga_calloc(n, sizeof *r->block, purpose, error);
    r->index = saga_calloc(n, sizeof *r->index, purpose, error);
    r->begin = saga_calloc(saga_rate_runs_most(s, kind) + 1, sizeof *r->begin,
                           purpose, error);
    return r->block && r->index && r->begin;
}

void saga_rate_runs_free(saga_rate_runs *r)
{
    free(r->block);
    free(r->index);
    free(r->begin);
    memset(r, 0, sizeof *r);
}

void saga_rate_runs_set(saga_rate_runs *r, const saga_scene *s, int kind)
{
    const uint32_t most = most_blocks(s, kind);
    const size_t n = saga_rate_n_blocks(s, kind);
    uint32_t at = 0, group;
    size_t i;

    r->n = 0;
    for (group = 0; group < n_groups(s, kind); group++) {
        const uint32_t first = at;

        for (i = 0; i < n; i++)
            if (group_of(s, kind, i) == group) {
                /* A run ends with its group, or when it is full. */
                if ((at - first) % most == 0)
                    r->begin[r->n++] = at;
                r->index[i] = at;
                r->block[at++] = (uint32_t)i;
            }
    }
    r->begin[r->n] = at;
}
