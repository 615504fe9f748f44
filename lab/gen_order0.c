/* SPDX-License-Identifier: MIT */
#include "gen_order0.h"

#include "freed.h"
#include "morton.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

enum { BOUND_BITS = 16 }; /* bits for each bound of the alphabet */

static void *must(void *p)
{
    if (!p) {
        fprintf(stderr, "order0: out of memory\n");
        exit(2);
    }
    return p;
}

void order0_channel(order0_row *row, const int32_t *v, size_t stride, size_t n)
{
    int32_t lo = 0, hi = 0;
    FREED uint32_t *count;
    double alphabet;

    for (size_t i = 0; i < n; i++) {
        lo = i == 0 || v[i * stride] < lo ? v[i * stride] : lo;
        hi = i == 0 || v[i * stride] > hi ? v[i * stride] : hi;
    }
    /* First the alphabet is found, then the estimator of gen_order0.h is run
     * symbol by symbol. */
    alphabet = hi - lo + 1.0;
    count = must(calloc((size_t)alphabet, sizeof *count));
    for (size_t i = 0; i < n; i++) {
        uint32_t *const c = &count[v[i * stride] - lo];

        row->adaptive -= log2((*c + 0.5) / ((double)i + alphabet / 2));
        ++*c;
    }
    for (size_t k = 0; k < (size_t)alphabet; k++)
        if (count[k])
            row->entropy -= count[k] * log2(count[k] / (double)n);
    row->adaptive += 2 * BOUND_BITS;
    row->n += n;
}

/* Adds the channels of (n, channels) symbols. Each channel's symbols are taken
 * in the order of their rows, which is that of decoding. */
static void add_channels(order0_row *row, const int32_t *v, size_t channels,
                         size_t n)
{
    for (size_t c = 0; c < channels; c++)
        order0_channel(row, v + c, channels, n);
}

/* Adds the values of each channel of a step, those that are coded. */
static void add_values(order0_row *row, const ref_file *f, int step)
{
    const size_t channels = ref_file_channels(f, step);
    const size_t rows = ref_file_rows(f, step);
    FREED int32_t *const v = must(calloc(rows + 1, sizeof *v));

    for (size_t c = 0; c < channels; c++) {
        size_t n = 0;

        for (size_t i = 0; i < rows; i++)
            if (ref_file_is_coded(f, step, i * channels + c))
                v[n++] = (int32_t)lrint(f->value[step][i * channels + c] *
                                        65536.0 / f->h.model.step_q16[step]);
        order0_channel(row, v, 1, n);
    }
}

static void add_classes(order0_row *row, const ref_file *f)
{
    FREED int32_t *const v = must(calloc(f->s.n.coarse + 1u, sizeof *v));

    for (uint32_t i = 0; i < f->s.n.coarse; i++)
        v[i] = f->s.class[i];
    if (f->h.model.n_classes)
        order0_channel(row, v, 1, f->s.n.coarse);
}

/* Adds the tree as a list of leaves in the order of decoding. A leaf has its
 * coordinates, its depths and its number of fine anchors. */
static void add_tree(order0_row *row, const ref_file *f)
{
    enum { N = 7 };
    int32_t *const v = must(calloc(N * (size_t)f->s.n.coarse + 1, sizeof *v));

    for (uint32_t i = 0; i < f->s.n.coarse; i++) {
        const saga_coarse *const c = &f->sc.coarse[i];
        const int32_t leaf[N] = { c->cell[0], c->cell[1], c->cell[2], c->cell_t,
                                  c->depth_x, c->depth_t, c->n_fine };

        for (size_t k = 0; k < N; k++)
            v[N * (size_t)i + k] = leaf[k];
    }
    add_channels(row, v, N, f->s.n.coarse);
    free(v);
}

static void add_suffixes(order0_row *row, const uint32_t *suffix, uint32_t n)
{
    FREED int32_t *const v = must(calloc(4 * (size_t)n + 1, sizeof *v));

    for (uint32_t i = 0; i < n; i++)
        for (uint32_t axis = 0; axis < 4; axis++)
            v[4 * (size_t)i + axis] = (int32_t)saga_morton_axis(suffix[i],
                                                                axis);
    add_channels(row, v, 4, n);
}

static void add_counts(order0_row *row, const ref_file *f)
{
    FREED int32_t *const v = must(calloc(f->s.n.fine + 1u, sizeof *v));

    for (uint32_t i = 0; i < f->s.n.fine; i++)
        v[i] = f->s.n_prim[i];
    add_channels(row, v, 1, f->s.n.fine);
}

int order0_is_structure(saga_component c)
{
    return c == SAGA_COMPONENT_TREE || c == SAGA_COMPONENT_FINE_SUFFIX ||
           c == SAGA_COMPONENT_N_PRIM || c == SAGA_COMPONENT_CLASS ||
           c == SAGA_COMPONENT_PRIM_SUFFIX;
}

void order0_file(order0_row row[SAGA_N_COMPONENTS], const ref_file *f)
{
    double saga[SAGA_N_COMPONENTS];

    saga_cost_components(saga, f->bits);
    for (int i = 0; i < SAGA_N_COMPONENTS; i++)
        row[i] = (order0_row){ 0, saga[i], 0, 0 };
    add_tree(&row[SAGA_COMPONENT_TREE], f);
    add_classes(&row[SAGA_COMPONENT_CLASS], f);
    add_values(&row[SAGA_COMPONENT_CENTRE], f, SAGA_STEP_CENTRE);
    add_values(&row[SAGA_COMPONENT_FEATURE], f, SAGA_STEP_FEATURE);
    add_suffixes(&row[SAGA_COMPONENT_FINE_SUFFIX], f->s.fine_suffix,
                 f->s.n.fine);
    add_values(&row[SAGA_COMPONENT_FINE_OFFSET], f, SAGA_STEP_FINE);
    add_counts(&row[SAGA_COMPONENT_N_PRIM], f);
    add_suffixes(&row[SAGA_COMPONENT_PRIM_SUFFIX], f->s.prim_suffix,
                 f->s.n.prim);
    add_values(&row[SAGA_COMPONENT_PRIM_OFFSET], f, SAGA_STEP_PRIM);
}
