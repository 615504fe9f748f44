/* SPDX-License-Identifier: MIT */
#include "attributes.h"

#include "alloc.h"

#include <stdlib.h>
#include <string.h>

#define ROW(word, title, ...) \
    [SAGA_ATTR_##word] = { .name = #title, __VA_ARGS__ },

const saga_attribute saga_attributes[SAGA_N_ATTRS] = { SAGA_ATTR_LIST(ROW) };

static bool has(uint32_t set, int attr)
{
    return set >> attr & 1;
}

size_t saga_attrs_width(uint32_t set)
{
    size_t n = 0;

    for (int a = 0; a < SAGA_N_ATTRS; a++)
        n += has(set, a) ? (size_t)saga_attributes[a].width : 0;
    return n;
}

size_t saga_attr_n_outputs(int attr, const saga_model *m)
{
    const saga_attribute *const a = &saga_attributes[attr];
    saga_rows rows[SAGA_N_OUTS];
    size_t n = 0;

    saga_model_rows(rows, m);
    for (int h = 0; saga_attr_is_output(a) && h < a->n_outs; h++)
        n += rows[a->out + h].n;
    return n;
}

uint32_t saga_attrs_of_tools(uint32_t tools, bool is_still)
{
    uint32_t set = 0;

    for (int a = 0; a < SAGA_N_ATTRS; a++) {
        const saga_attribute *const k = &saga_attributes[a];

        if ((!k->tools || (k->tools & tools)) && !(is_still && k->is_temporal))
            set |= SAGA_ATTR_BIT(a);
    }
    return set;
}

real *saga_params_lay(saga_splat_params *p, real *block, uint32_t set, size_t n)
{
    for (int a = 0; a < SAGA_N_ATTRS; a++) {
        p->of[a] = has(set, a) ? block : NULL;
        block += has(set, a) ? n * (size_t)saga_attributes[a].width : 0;
    }
    return block;
}

bool saga_params_alloc(saga_splat_params *p, uint32_t set, size_t n,
                       saga_error *error)
{
    real *const block = saga_calloc(n, saga_attrs_width(set) * sizeof *block,
                                    "primitives", error);

    if (block)
        saga_params_lay(p, block, set, n);
    else
        *p = (saga_splat_params){ .mean = NULL };
    return block != NULL;
}

uint32_t saga_attrs_of(const saga_splat_params *p)
{
    uint32_t set = 0;

    for (int a = 0; a < SAGA_N_ATTRS; a++)
        set |= p->of[a] ? SAGA_ATTR_BIT(a) : 0;
    return set;
}

void saga_params_copy(const saga_splat_params *to,
                      const saga_splat_params *from, size_t n)
{
    for (int a = 0; a < SAGA_N_ATTRS; a++)
        if (from->of[a])
            memcpy(to->of[a], from->of[a],
                   n * (size_t)saga_attributes[a].width * sizeof(real));
}

bool saga_params_gather(saga_splat_params *p, const saga_splat_params *from,
                        const uint32_t *source, size_t n, saga_error *error)
{
    if (!saga_params_alloc(p, saga_attrs_of(from), n, error))
        return false;
    if (!source) {
        saga_params_copy(p, from, n);
        return true;
    }
    for (int a = 0; a < SAGA_N_ATTRS; a++) {
        const size_t w = (size_t)saga_attributes[a].width;

        for (size_t i = 0; p->of[a] && i < n; i++)
            memcpy(p->of[a] + w * i, from->of[a] + w * source[i],
                   w * sizeof(real));
    }
    return true;
}

void saga_params_free(saga_splat_params *p)
{
    /* All arrays are in one block, which begins with the mean. */
    free(p->mean);
    *p = (saga_splat_params){ .mean = NULL };
}

size_t saga_params_spans(saga_span spans[SAGA_N_ATTRS],
                         const saga_splat_params *p, size_t n)
{
    for (int a = 0; a < SAGA_N_ATTRS; a++)
        spans[a] = (saga_span){ p->of[a], n * (size_t)saga_attributes[a].width *
                                              sizeof(real) };
    return SAGA_N_ATTRS;
}
