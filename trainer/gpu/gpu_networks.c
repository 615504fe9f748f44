/* SPDX-License-Identifier: MIT
 *
 * Layers are listed once for a pass; forward they run in the order of the list,
 * and backward in the other.
 */
#include "gpu_networks.h"

#include "gpu_state.h"

#include <string.h>

static const char what[] = "networks of primitives";

/* The rows of a slab, whose gradients one group adds; there are at most
 * MOST_SLABS, so that adding these stays short. */
enum { LEAST_SLAB = 64, MOST_SLABS = 1024 };

/* dense.glsl */
enum { RELU = 1, ADD = 2 };

/* Reals of a primitive that the host gives, and gradients that it gets. */
enum { GIVEN = 14, D_GIVEN = 8 };

/* A layer, by its buffers. d_x is -1 if the inputs need no gradients. */
typedef struct {
    int x, y, d_y, d_x;
    uint32_t n_in, n_out, at, how, how_back, n_cols;
} layer;

struct saga_gpu_networks {
    const saga_gpu_prims *p;
    layer list[SAGA_GPU_MOST_LAYERS];
    int n;
    int geo, colour; /* the last layers of F_geo and of the colour */
    uint32_t n_params, slab, n_slabs;
    uint32_t at[SAGA_GPU_N_NETS]; /* of their parameters */
};

/* --- Layers -------------------------------------------------------------- */

static int n_layers(const saga_gpu_prims *p, int net)
{
    return p->net[net]->n_layers;
}

/* Appends the layers of a network, whose first reads x. */
static void append(saga_gpu_networks *s, int net, layer first)
{
    const saga_net *const from = s->p->net[net];
    const int last = from->n_layers - 1;

    s->at[net] = s->n_params;
    for (int l = 0; l <= last; l++) {
        layer *const to = s->list + s->n;

        *to = l ? (layer){ .x = to[-1].y,
                           .d_x = to[-1].d_y,
                           .how_back = RELU,
                           .n_cols = (uint32_t)from->dim[l] }
                : first;
        to->y = GPU_LAYER + s->n;
        to->d_y = GPU_D_LAYER + s->n;
        to->n_in = (uint32_t)from->dim[l];
        to->n_out = (uint32_t)from->dim[l + 1];
        to->at = s->n_params;
        to->how |= l < last ? RELU : 0;
        s->n_params += (to->n_in + 1) * to->n_out;
        s->n++;
    }
}

/* The colour's hidden layer gets sums from features and from directions, and
 * then is rectified; COLOUR reads it. */
static void append_colour(saga_gpu_networks *s)
{
    const uint32_t f = (uint32_t)s->p->features;
    const bool sees = n_layers(s->p, SAGA_GPU_COLOUR_VIEW) > 0;
    const layer *const hidden = s->list + s->n;

    append(s, SAGA_GPU_COLOUR_BASE,
           (layer){ .x = GPU_NET_IN,
                    .d_x = GPU_D_FEATURE,
                    .how = sees ? 0 : RELU,
                    .n_cols = f });
    if (sees) {
        append(s, SAGA_GPU_COLOUR_VIEW,
               (layer){ .x = GPU_DIRECTION, .d_x = -1, .how = ADD | RELU });
        s->list[s->n - 1].y = hidden->y;
        s->list[s->n - 1].d_y = hidden->d_y;
    }
    append(s, SAGA_GPU_COLOUR,
           (layer){ .x = hidden->y,
                    .d_x = hidden->d_y,
                    .how_back = RELU,
                    .n_cols = hidden->n_out });
    s->colour = s->n - 1;
}

static void list_layers(saga_gpu_networks *s, const saga_gpu_prims *p)
{
    *s = (saga_gpu_networks){ .p = p };
    /* Backward, F_geo is the last that gives gradients to features. */
    append(s, SAGA_GPU_GEO,
           (layer){ .x = GPU_NET_IN,
                    .d_x = GPU_D_FEATURE,
                    .how_back = ADD,
                    .n_cols = (uint32_t)p->features });
    s->geo = s->n - 1;
    append_colour(s);
    s->slab = p->n / MOST_SLABS + 1;
    s->slab = s->slab < LEAST_SLAB ? LEAST_SLAB : s->slab;
    s->n_slabs = (uint32_t)saga_n_parts(p->n, s->slab);
}

/* --- Memory -------------------------------------------------------------- */

static size_t widest(const saga_gpu_prims *p)
{
    size_t most = p->features > GIVEN ? p->features : GIVEN;

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
    int sum = 0;

    for (int k = 0; k < SAGA_GPU_N_NETS; k++)
        sum += n_layers(p, k);
    return sum <= SAGA_GPU_MOST_LAYERS && n_layers(p, SAGA_GPU_GEO) > 0 &&
           n_layers(p, SAGA_GPU_COLOUR_BASE) == 1 &&
           n_layers(p, SAGA_GPU_COLOUR_VIEW) <= 1 &&
           n_layers(p, SAGA_GPU_COLOUR) > 0 && p->n * widest(p) <= most &&
           MOST_SLABS * n_weights(p) <= most;
}

static size_t n_geo(const saga_gpu_networks *s)
{
    return s->list[s->geo].n_out;
}

/* Reals that go up and down in a pass. */
static size_t n_up(const saga_gpu_networks *s)
{
    return s->p->n * (s->p->features + GIVEN) + 2 * n_geo(s) + s->n_params;
}

static size_t n_down(const saga_gpu_networks *s)
{
    return s->p->n * (s->p->features + D_GIVEN) + s->n_params;
}

static bool make_room(saga_gpu_canvas *g, const saga_gpu_networks *s,
                      saga_error *error)
{
    const saga_gpu_prims *const p = s->p;
    const size_t n = p->n, word = sizeof(real);
    const struct {
        int buffer;
        size_t n;
    } need[] = { { GPU_VALUE, n * saga_attrs_width(p->attrs) },
                 { GPU_FEATURE, n * p->features },
                 { GPU_D_FEATURE, n * p->features },
                 { GPU_GIVEN, n * GIVEN },
                 { GPU_D_GIVEN, n * D_GIVEN },
                 { GPU_PART, 2 * n_geo(s) },
                 { GPU_PARAM, s->n_params },
                 { GPU_D_PARAM, s->n_params },
                 { GPU_PARTIAL, (size_t)s->n_slabs * s->n_params },
                 { GPU_NET_IN, n * s->list[0].n_in },
                 { GPU_DIRECTION, 3 * n } };

    for (size_t i = 0; i < sizeof need / sizeof need[0]; i++)
        if (!saga_gpu_room(g, need[i].buffer, need[i].n * word, what, error))
            return false;
    for (int i = 0; i < s->n; i++)
        if (!saga_gpu_room(g, s->list[i].y, n * s->list[i].n_out * word, what,
                           error) ||
            !saga_gpu_room(g, s->list[i].d_y, n * s->list[i].n_out * word, what,
                           error))
            return false;
    return saga_gpu_grow(&g->up, g->gpu, n_up(s) * word, SAGA_GPU_UP, what,
                         error) &&
           saga_gpu_grow(&g->down, g->gpu,
                         (SAGA_GPU_N_TOTALS + n_down(s)) * word, SAGA_GPU_DOWN,
                         what, error);
}

/* --- Ways ---------------------------------------------------------------- */

static real *put(real *to, const real *from, size_t n)
{
    memcpy(to, from, n * sizeof *to);
    return to + n;
}

/* Lays what goes up into its buffer, in the order of record_networks. */
static void pack(saga_gpu_canvas *g, const saga_gpu_networks *s)
{
    const saga_gpu_prims *const p = s->p;
    const size_t n = p->n;
    real *to = g->up.map;

    to = put(to, p->feature, n * p->features);
    to = put(to, p->place, 4 * n);
    to = put(to, p->offset, 4 * n);
    to = put(to, p->support, 4 * n);
    to = put(to, p->level, 2 * n);
    for (int k = 0; k < SAGA_GPU_N_NETS; k++)
        if (n_layers(p, k))
            to = put(to, p->net[k]->w[0], saga_net_n_params(p->net[k]));
    for (size_t k = 0; k < n_geo(s); k++) {
        const saga_attr_part of = p->part[k];
        const bool is_none = of.attr >= SAGA_N_ATTRS;
        const saga_attribute *const a = saga_attributes +
                                        (is_none ? 0 : of.attr);
        const uint32_t unit = is_none ? 0 : (uint32_t)a->unit;
        const uint32_t word = of.attr | (uint32_t)of.part << 8 | unit << 16;
        const real add = unit == SAGA_UNIT_NONE
                             ? R(a->zero + (of.part ? 0 : a->first))
                             : 0;

        memcpy(to++, &word, sizeof word);
        *to++ = add;
    }
}

/* Adds the gradients of a pass. */
typedef struct {
    const saga_gpu_prims *p;
    const real *feature, *place, *support;
} adding;

/* Primitives in one task, and nanoseconds for one. */
enum { PART = 1024, ADD_NS = 15 };

static void add(real *to, const real *from, size_t begin, size_t end)
{
    for (size_t i = begin; i < end; i++)
        to[i] += from[i];
}

static void add_part(void *user, size_t part)
{
    const adding *const j = user;
    const saga_range of = saga_part(j->p->n, PART, part);
    const size_t f = j->p->features;

    add(j->p->d_feature, j->feature, f * of.begin, f * of.end);
    add(j->p->d_place, j->place, 4 * of.begin, 4 * of.end);
    add(j->p->d_log2_support, j->support, 4 * of.begin, 4 * of.end);
}

static void add_gradients(const saga_gpu_canvas *g, const saga_gpu_networks *s)
{
    const saga_gpu_prims *const p = s->p;
    const size_t n = p->n;
    const real *const down = saga_gpu_after_totals(g);
    adding j = { .p = p,
                 .feature = down,
                 .place = down + n * p->features,
                 .support = down + n * (p->features + 4) };
    const real *params = down + n * (p->features + D_GIVEN);

    saga_parallel(&(saga_tasks){ .run = add_part,
                                 .user = &j,
                                 .n = saga_n_parts(n, PART),
                                 .ns = (double)ADD_NS * (double)n });
    for (int k = 0; k < SAGA_GPU_N_NETS; k++)
        if (n_layers(p, k))
            add(p->d_net[k]->w[0], params + s->at[k], 0,
                saga_net_n_params(p->net[k]));
}

/* --- Recording ----------------------------------------------------------- */

/* given.glsl */
static void run_net(saga_gpu_canvas *g, int kernel, size_t n_threads,
                    const int *buffers)
{
    const saga_gpu_networks *const s = g->networks;
    const saga_gpu_prims *const p = s->p;
    const real bounds[] = { p->most_motion, p->centre_lo, p->centre_hi };
    uint32_t push[7] = { p->n, (uint32_t)n_geo(s), (uint32_t)p->features,
                         (uint32_t)p->octaves };

    memcpy(push + 4, bounds, sizeof bounds);
    saga_gpu_do_with(g, kernel, saga_gpu_groups(n_threads), buffers, push, 7);
}

/* dense.glsl */
static void run_layer(saga_gpu_canvas *g, int kernel, size_t n_groups,
                      const layer *l, uint32_t how, const int *buffers)
{
    const saga_gpu_networks *const s = g->networks;

    saga_gpu_do_with(g, kernel, n_groups, buffers,
                     (uint32_t[]){ s->p->n, l->n_in, l->n_out, l->at, how,
                                   l->n_cols, s->n_params, s->n_slabs,
                                   s->slab },
                     9);
}

static void forward(saga_gpu_canvas *g, int from, int to)
{
    const saga_gpu_networks *const s = g->networks;

    for (int i = from; i <= to; i++) {
        const layer *const l = s->list + i;

        run_layer(g, SAGA_KERNEL_DENSE_FORWARD,
                  saga_gpu_groups((size_t)s->p->n * l->n_out), l, l->how,
                  (int[]){ l->x, GPU_PARAM, l->y, -1 });
    }
}

static void backward(saga_gpu_canvas *g)
{
    const saga_gpu_networks *const s = g->networks;

    for (int i = s->n - 1; i >= 0; i--) {
        const layer *const l = s->list + i;

        run_layer(g, SAGA_KERNEL_DENSE_WEIGHTS, s->n_slabs, l, 0,
                  (int[]){ l->x, l->d_y, GPU_PARTIAL, -1 });
        if (l->d_x >= 0)
            run_layer(g, SAGA_KERNEL_DENSE_BACK,
                      saga_gpu_groups((size_t)s->p->n * l->n_cols), l,
                      l->how_back,
                      (int[]){ l->d_y, GPU_PARAM, l->x, l->d_x, -1 });
    }
    run_layer(g, SAGA_KERNEL_DENSE_SUM, saga_gpu_groups(s->n_params), s->list,
              0, (int[]){ GPU_PARTIAL, GPU_D_PARAM, -1 });
}

/* Records the way of n reals up, from real number *at on. */
static void send(saga_gpu_canvas *g, int buffer, size_t *at, size_t n)
{
    saga_gpu_copy(g->gpu, &g->on[buffer], 0, &g->up, *at * sizeof(real),
                  n * sizeof(real));
    *at += n;
}

static void record_networks(saga_gpu_canvas *g)
{
    const saga_gpu_networks *const s = g->networks;
    const size_t n = s->p->n;
    const int geo = s->list[s->geo].y, colour = s->list[s->colour].y;
    size_t at = 0;

    send(g, GPU_FEATURE, &at, n * s->p->features);
    send(g, GPU_GIVEN, &at, n * GIVEN);
    send(g, GPU_PARAM, &at, s->n_params);
    send(g, GPU_PART, &at, 2 * n_geo(s));
    run_net(g, SAGA_KERNEL_NET_INPUTS, n * s->list[0].n_in,
            (int[]){ GPU_FEATURE, GPU_GIVEN, GPU_NET_IN, -1 });
    forward(g, 0, s->geo);
    run_net(g, SAGA_KERNEL_NET_VALUES, n,
            (int[]){ GPU_FRAME, GPU_GIVEN, GPU_PART, geo, GPU_VALUE, -1 });
    if (n_layers(s->p, SAGA_GPU_COLOUR_VIEW))
        saga_gpu_do(g, SAGA_KERNEL_NET_DIRECTIONS, saga_gpu_groups(n),
                    (int[]){ GPU_FRAME, GPU_VALUE, GPU_DIRECTION, -1 });
    forward(g, s->geo + 1, s->colour);
    saga_gpu_do(g, SAGA_KERNEL_NET_COLOURS, saga_gpu_groups(3 * n),
                (int[]){ GPU_FRAME, colour, GPU_VALUE, -1 });
}

static void record_learning(saga_gpu_canvas *g)
{
    const saga_gpu_networks *const s = g->networks;
    const layer *const geo = s->list + s->geo, *const colour = s->list +
                                                               s->colour;
    const size_t n = s->p->n, word = sizeof(real);
    const struct {
        int buffer;
        size_t n;
    } down[] = { { GPU_D_FEATURE, n * s->p->features },
                 { GPU_D_GIVEN, n * D_GIVEN },
                 { GPU_D_PARAM, s->n_params } };
    size_t at = SAGA_GPU_N_TOTALS * word;

    saga_gpu_record_truth(g);
    saga_gpu_record_tiles(g);
    saga_gpu_record_back(g);
    saga_gpu_record_sums(g, 0);
    run_net(g, SAGA_KERNEL_NET_GRADIENTS, n,
            (int[]){ GPU_FRAME, GPU_GIVEN, GPU_PART, geo->y, colour->y,
                     GPU_GRAD, geo->d_y, colour->d_y, GPU_D_GIVEN, -1 });
    backward(g);
    for (size_t i = 0; i < sizeof down / sizeof down[0]; i++) {
        saga_gpu_copy(g->gpu, &g->down, at, &g->on[down[i].buffer], 0,
                      down[i].n * word);
        at += down[i].n * word;
    }
}

bool saga_gpu_learn_prims(saga_gpu_canvas *g, double *mse,
                          const saga_gpu_prims *p, const saga_canvas *c,
                          saga_error *error)
{
    saga_gpu_networks s;
    bool ok;

    list_layers(&s, p);
    saga_gpu_set_frame(g, c, p->attrs, p->n);
    g->n_set = 0;
    g->n_up = 0;
    if (!make_room(g, &s, error))
        return false;
    pack(g, &s);
    g->networks = &s;
    g->record_networks = record_networks;
    ok = saga_gpu_pass(g, c, record_learning, error);
    g->networks = NULL;
    if (!ok)
        return false;
    add_gradients(g, &s);
    *mse = (double)saga_gpu_float(
               ((const uint32_t *)g->down.map)[SAGA_GPU_SQUARES]) /
           saga_canvas_n_seen(c);
    return true;
}
