/* SPDX-License-Identifier: MIT */
#include "gpu_columns.h"
#include "gpu_stages.h"

#include <float.h>
#include <string.h>

static const char what[] = "networks of primitives";

/* --- Layers -------------------------------------------------------------- */

static int n_layers(const saga_gpu_prims *p, int net)
{
    return p->net[net]->n_layers;
}

static void append(saga_gpu_prims_run *s, int net, saga_gpu_layer first)
{
    saga_gpu_layers_append(&s->layers, s->p->net[net], first);
}

/* The colour's hidden layer gets sums from features and from directions, and
 * then is rectified; COLOUR reads it. */
static void append_colour(saga_gpu_prims_run *s)
{
    saga_gpu_layers *const l = &s->layers;
    const bool sees = n_layers(s->p, SAGA_GPU_COLOUR_VIEW) > 0;
    const saga_gpu_layer *const hidden = l->list + l->n;

    append(s, SAGA_GPU_COLOUR_BASE,
           (saga_gpu_layer){ .x = GPU_NET_IN,
                             .d_x = GPU_D_FEATURE,
                             .how = sees ? 0 : SAGA_GPU_RELU,
                             .n_cols = (uint32_t)s->p->features });
    if (sees) {
        append(s, SAGA_GPU_COLOUR_VIEW,
               (saga_gpu_layer){ .x = GPU_DIRECTION,
                                 .d_x = -1,
                                 .how = SAGA_GPU_ADD | SAGA_GPU_RELU });
        l->list[l->n - 1].y = hidden->y;
        l->list[l->n - 1].d_y = hidden->d_y;
    }
    append(s, SAGA_GPU_COLOUR,
           (saga_gpu_layer){ .x = hidden->y,
                             .d_x = hidden->d_y,
                             .how_back = SAGA_GPU_RELU,
                             .n_cols = hidden->n_out });
    s->colour = l->n - 1;
}

static void list_layers(saga_gpu_prims_run *s, const saga_gpu_prims *p)
{
    *s = (saga_gpu_prims_run){ .p = p,
                               .layers = saga_gpu_layers_of(p->n, 0, 0) };
    /* Backward, F_geo is the last that gives gradients to features. */
    append(s, SAGA_GPU_GEO,
           (saga_gpu_layer){ .x = GPU_NET_IN,
                             .d_x = GPU_D_FEATURE,
                             .how_back = SAGA_GPU_ADD,
                             .n_cols = (uint32_t)p->features });
    s->geo = s->layers.n - 1;
    append_colour(s);
}

/* --- Memory -------------------------------------------------------------- */

static size_t widest(const saga_gpu_prims *p)
{
    size_t most = p->features > 4 ? p->features : 4;

    for (int k = 0; k < SAGA_GPU_N_NETS; k++)
        for (int l = 0; n_layers(p, k) && l <= n_layers(p, k); l++)
            most = (size_t)p->net[k]->dim[l] > most ? (size_t)p->net[k]->dim[l]
                                                    : most;
    return most;
}

/* Returns the number of weights and biases of all networks. */
static size_t n_weights(const saga_gpu_prims *p)
{
    size_t n = 0;

    for (int k = 0; k < SAGA_GPU_N_NETS; k++)
        for (int l = 0; l < n_layers(p, k); l++)
            n += (size_t)(p->net[k]->dim[l] + 1) *
                 (size_t)p->net[k]->dim[l + 1];
    return n;
}

bool saga_gpu_can_learn_prims(const saga_gpu *gpu, const saga_gpu_prims *p)
{
    const size_t most = saga_gpu_most(gpu) / sizeof(real);
    const int n = n_layers(p, SAGA_GPU_GEO);
    int sum = 0;

    for (int k = 0; k < SAGA_GPU_N_NETS; k++)
        sum += n_layers(p, k);
    return sum <= SAGA_GPU_FINE_LAYER && n > 0 &&
           p->net[SAGA_GPU_GEO]->dim[n] <= SAGA_GPU_MOST_GEO &&
           n_layers(p, SAGA_GPU_COLOUR_BASE) == 1 &&
           n_layers(p, SAGA_GPU_COLOUR_VIEW) <= 1 &&
           n_layers(p, SAGA_GPU_COLOUR) > 0 && p->n * widest(p) <= most &&
           saga_gpu_layers_fit(gpu, n_weights(p));
}

static size_t n_geo(const saga_gpu_prims_run *s)
{
    return s->layers.list[s->geo].n_out;
}

/* --- Ways ---------------------------------------------------------------- */

/* The constants of F_geo's outputs: a word, and the bits of a real. */
static void set_parts(saga_gpu_prims_run *s)
{
    for (size_t k = 0; k < n_geo(s); k++) {
        const saga_attr_part of = s->p->part[k];
        const bool is_none = of.attr >= SAGA_N_ATTRS;
        const saga_attribute *const a = saga_attributes +
                                        (is_none ? 0 : of.attr);
        const uint32_t unit = is_none ? 0 : (uint32_t)a->unit;
        const float add = unit == SAGA_UNIT_NONE
                              ? (float)(a->zero + (of.part ? 0 : a->first))
                              : 0;

        s->part[k][0] = of.attr | (uint32_t)of.part << 8 | unit << 16;
        memcpy(&s->part[k][1], &add, sizeof add);
    }
}

void saga_gpu_list_prims(saga_gpu_prims_run *s, saga_gpu_ways *ways,
                         const saga_gpu_prims *p)
{
    size_t at = 0;

    list_layers(s, p);
    set_parts(s);
    for (int k = 0; k < SAGA_GPU_N_NETS; k++)
        saga_gpu_layers_ways(ways, &at, p->net[k], p->d_net[k]);
    saga_gpu_ways_append_up(ways, (saga_gpu_way){ .buffer = GPU_PART,
                                                  .n = 2 * n_geo(s),
                                                  .from = s->part });
}

bool saga_gpu_prims_room(saga_gpu_canvas *g, const saga_gpu_prims_run *s,
                         saga_error *error)
{
    const saga_gpu_prims *const p = s->p;
    const size_t n = p->n;
    const saga_gpu_need need[] = {
        { GPU_VALUE, GPU_VALUE, n * saga_attrs_width(p->attrs) },
        { GPU_NET_IN, GPU_NET_IN, n * s->layers.list[0].n_in },
        { GPU_DIRECTION, GPU_DIRECTION, 3 * n }
    };

    return SAGA_GPU_ROOMS(g, need, what, error) &&
           saga_gpu_layers_room(g, &s->layers, what, error);
}

/* --- Recording ----------------------------------------------------------- */

/* parts.glsl */
static void run_net(saga_gpu_canvas *g, const saga_gpu_prims_run *s, int kernel,
                    const int *buffers)
{
    const float reals[] = { (float)s->p->most_motion, (float)s->p->centre_lo,
                            (float)s->p->centre_hi, (float)s->p->size_price };
    uint32_t push[6] = { s->p->n, (uint32_t)n_geo(s) };

    memcpy(push + 2, reals, sizeof reals);
    saga_gpu_do_with(g, kernel, saga_gpu_groups(s->p->n), buffers, push, 6);
}

/* Sets the inputs of F_geo: features, and the embedding of offsets. */
static void record_inputs(saga_gpu_canvas *g, const saga_gpu_prims_run *s)
{
    const saga_gpu_prims *const p = s->p;
    saga_gpu_columns c = { .n_rows = p->n,
                           .n = (uint32_t)p->features,
                           .dim = s->layers.list[0].n_in,
                           .every = 1,
                           .most = FLT_MAX };

    saga_gpu_gather(g, &c, GPU_FEATURE, c.n, -1, GPU_NET_IN);
    c.at = c.n;
    c.n = c.dim - c.at;
    saga_gpu_embed(g, &c, GPU_OFFSET4, GPU_NET_IN);
}

void saga_gpu_prims_forward(saga_gpu_canvas *g, const saga_gpu_prims_run *s)
{
    const saga_gpu_layer *const list = s->layers.list;
    const size_t n = s->p->n;
    const int geo = list[s->geo].y, colour = list[s->colour].y;

    record_inputs(g, s);
    saga_gpu_layers_forward(g, &s->layers, 0, s->geo + 1);
    run_net(g, s, SAGA_KERNEL_NET_VALUES,
            (int[]){ GPU_FRAME, GPU_PLACE, GPU_SUPPORT, GPU_LEVEL, GPU_PART,
                     geo, GPU_VALUE, -1 });
    if (n_layers(s->p, SAGA_GPU_COLOUR_VIEW))
        saga_gpu_do(g, SAGA_KERNEL_NET_DIRECTIONS, saga_gpu_groups(n),
                    (int[]){ GPU_FRAME, GPU_VALUE, GPU_DIRECTION, -1 });
    saga_gpu_layers_forward(g, &s->layers, s->geo + 1, s->colour + 1);
    saga_gpu_do(g, SAGA_KERNEL_NET_COLOURS, saga_gpu_groups(3 * n),
                (int[]){ GPU_FRAME, colour, GPU_VALUE, -1 });
}

void saga_gpu_prims_backward(saga_gpu_canvas *g, const saga_gpu_prims_run *s)
{
    const saga_gpu_layer *const geo = s->layers.list + s->geo;
    const saga_gpu_layer *const colour = s->layers.list + s->colour;

    run_net(g, s, SAGA_KERNEL_NET_GRADIENTS,
            (int[]){ GPU_FRAME, GPU_PLACE, GPU_SUPPORT, GPU_PART, geo->y,
                     colour->y, GPU_GRAD, geo->d_y, colour->d_y, GPU_D_PLACE,
                     GPU_D_LOG2, GPU_LIMIT, -1 });
    saga_gpu_layers_backward(g, &s->layers, 0, s->layers.n);
    saga_gpu_layers_sum(g, &s->layers);
}
