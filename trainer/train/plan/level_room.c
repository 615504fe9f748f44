/* SPDX-License-Identifier: MIT */
#include "level_room.h"

#include "container.h"
#include "encode.h"
#include "policy.h"
#include "saga.h"
#include "scene_model.h"
#include "tool_choice.h"

#include <string.h>

/* Tells whether a decoder accepts a file whose segment has these counts. No
 * number depends on the cameras, the networks' values or the other chunks. */
static bool accepted(const saga_model *m, const saga_counts *n, int level,
                     int n_layers)
{
    saga_header h = { .level = (uint8_t)level,
                      .fps_num = 1,
                      .fps_den = 1,
                      .n_segments = 1,
                      .n_frames = 1,
                      .max = *n,
                      .more_layers = (uint8_t)(n_layers - 1),
                      .model = *m };
    uint8_t bytes[SAGA_HEADER_MAX_NBYTES + 4] = { 0 };
    saga_io io = { NULL, bytes, SAGA_MAGIC_NBYTES };
    saga_info info;

    memcpy(bytes, saga_magic, SAGA_MAGIC_NBYTES);
    h.header_nbytes = saga_rig_end(&h) + 4;
    saga_header_io(&io, &h);
    saga_tools_io(&io, &h);
    saga_file_sign(bytes, h.header_nbytes, h.header_nbytes);
    return saga_probe(&info, bytes, h.header_nbytes) == SAGA_OK;
}

static uint32_t at_most(uint32_t a, uint32_t b)
{
    return a < b ? a : b;
}

/* Tells whether n primitives fit, with as many anchors as they can have. */
static bool fits(const saga_train_options *o, const saga_model *m, uint32_t n)
{
    const int n_layers = o->n_layers > 1 ? o->n_layers : 1;
    const uint32_t parts = (1u << n_layers) - 1;
    /* Anchors are those of the largest layer, which is the last; layers.c
     * rounds its share up. */
    const uint32_t last =
        (uint32_t)(((uint64_t)n * (parts / 2 + 1) + parts - 1) / parts);
    saga_train_options with = *o;
    saga_counts counts;

    with.n_primitives = n;
    saga_options_derive(&with);
    counts = (saga_counts){ at_most(with.n_coarse, last),
                            at_most(with.n_fine, last), n };
    return accepted(m, &counts, o->level, n_layers);
}

/* Makes the model that n primitives may lead to. The price of bits is not known
 * yet; the lowest makes the widest networks. */
static void make_model(saga_model *m, const saga_train_options *o,
                       const saga_ablation *a, uint32_t tools, uint32_t n)
{
    const saga_policy policy = saga_policy_of(0, 1e12, n);
    saga_train_options with = *o;
    const saga_model_terms terms = { &with, a, &policy };

    with.n_primitives = n;
    saga_options_derive(&with);
    saga_plan_model(m, &terms, tools | saga_plan_splats(o, a));
}

/* --- The largest number -------------------------------------------------- */

/* Halves the interval until it is empty. model: NULL, or the model for all
 * numbers. */
static uint32_t most(const saga_train_options *o, const saga_ablation *a,
                     uint32_t tools, const saga_model *model, uint32_t n)
{
    uint32_t lo = 0, hi = at_most(n, saga_caps[o->level].n_prim);

    while (lo < hi) {
        const uint32_t middle = hi - (hi - lo) / 2;
        saga_model m;

        if (!model)
            make_model(&m, o, a, tools, middle);
        if (fits(o, model ? model : &m, middle))
            lo = middle;
        else
            hi = middle - 1;
        /* The first trial is the whole number, which mostly fits. */
    }
    return lo;
}

uint32_t saga_room_of_model(const saga_train_options *o, const saga_model *m,
                            uint32_t n)
{
    return most(o, NULL, 0, m, n);
}

uint32_t saga_room_of_tools(const saga_train_options *o, const saga_ablation *a,
                            uint32_t tools, uint32_t n)
{
    return most(o, a, tools, NULL, n);
}

uint32_t saga_room_sure(const saga_train_options *o, uint32_t n)
{
    saga_ablation a;
    saga_error ignored = { "" };

    /* A list that cannot be read is an error later. */
    if (!saga_options_ablation(&a, o, &ignored))
        memset(&a, 0, sizeof a);
    return saga_room_of_tools(
        o, &a,
        o->motion == SAGA_TRAIN_STILL ? SAGA_TOOL_VIEW : saga_plan_all_tools(o),
        n);
}
