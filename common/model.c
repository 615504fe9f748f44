/* SPDX-License-Identifier: MIT */
#include "model.h"

/* Hidden units of the colour network: each primitive's pre-activation is kept
 * (64 bytes) or recomputed per frame. */
enum { MAX_COLOUR_WIDTH = 32 };

const saga_level_caps saga_caps[SAGA_N_PROFILES] = {
    { 256u << 10, 128, 512, 1024, 48000, 32, 1, 32 },
    { 4u << 20, 2000, 6400, 16000, 128000, 64, 0, 64 },
    { 32u << 20, 16000, 64000, 160000, 128000, 64, 0, 128 },
    { 1u << 30, 1u << 22, 1u << 22, 1u << 22, 1000000, 128, 0, 512 },
};

void saga_model_geo_rows(saga_geo_rows *rows, const saga_model *m)
{
    const int order = saga_motion_order(m);
    uint8_t n = 0;

    rows->opacity = n;
    n = (uint8_t)(n + 1);
    rows->scale = n;
    n = (uint8_t)(n + 3);
    rows->quat = n;
    n = (uint8_t)(n + 4);
    rows->slope = n;
    n = (uint8_t)(n + (m->tools & SAGA_TOOL_SLOPE ? 4 : 0));
    rows->time = n;
    n = (uint8_t)(n + (saga_is_dynamic(m) ? 1 : 0));
    rows->width = n;
    n = (uint8_t)(n + (m->tools & SAGA_TOOL_OPACITY_T ? 1 : 0));
    rows->motion = n;
    rows->n = (uint8_t)(n + 3 * order);
}

/* Inputs of a network with sources s: one vector of F per source, D from the
 * memory. */
static uint32_t entropy_inputs(const saga_model *m, uint32_t s)
{
    uint32_t n = 0;

    n += s & SAGA_SOURCE_HYPER ? m->features : 0u;
    n += s & SAGA_SOURCE_PARENT ? m->features : 0u;
    n += s & SAGA_SOURCE_GROUPS ? m->features : 0u;
    n += s & SAGA_SOURCE_MEMORY ? m->memory_width : 0u;
    return n;
}

/* in -> hidden x (n_layers - 1) -> out. */
static void shape_set(saga_net_shape *s, uint32_t n_layers, uint32_t in,
                      uint32_t hidden, uint32_t out)
{
    uint32_t i;

    s->n_layers = (uint8_t)n_layers;
    s->dim[0] = (uint16_t)in;
    for (i = 1; i < n_layers; i++)
        s->dim[i] = (uint16_t)hidden;
    s->dim[n_layers] = (uint16_t)out;
}

static void shape_entropy(saga_net_shape *s, const saga_model *m, int kind,
                          uint32_t width)
{
    const uint32_t in = entropy_inputs(m, m->sources[kind]);

    /* Without a source the parameters are constants: one row of biases. */
    shape_set(s, in ? 3 : 1, in, width, 2 * saga_n_channels(m, kind));
}

static void shape_colour(saga_net_shape *s, const saga_model *m, int net)
{
    const uint32_t width = m->width[SAGA_NET_COLOUR];

    if (net == SAGA_NET_COLOUR_BASE)
        shape_set(s, 1, m->features + saga_pe_size(m), 0, width);
    else if (net == SAGA_NET_COLOUR)
        shape_set(s, 2, width, width, 3);
    else if (m->tools & SAGA_TOOL_VIEW)
        shape_set(s, 1, 3, 0, width);
}

/* A block's side information (place, 4 sizes, count, level) and F values. */
static void shape_memory(saga_net_shape *s, const saga_model *m, int net)
{
    const uint32_t in = saga_pe_size(m) + 6 + m->features;
    const uint32_t hidden = m->width[SAGA_NET_WRITE];

    if (net <= SAGA_NET_AGG)
        shape_set(s, 2, in, m->width[net], m->memory_width);
    else if (net == SAGA_NET_SLOT)
        shape_set(s, 2, m->memory_slots, m->width[net], hidden);
    else if (net == SAGA_NET_WRITE_BASE)
        shape_set(s, 1, m->memory_width, 0, hidden);
    else
        shape_set(s, 1, hidden, 0, m->memory_width + 1u);
}

void saga_model_net(saga_net_shape *s, const saga_model *m, int net)
{
    const uint32_t f = m->features, pe = saga_pe_size(m);
    const uint32_t w = m->width[net];
    saga_geo_rows rows;
    int i;

    for (i = 0; i <= SAGA_MAX_LAYERS; i++)
        s->dim[i] = 0;
    s->n_layers = 0;
    s->int8 = m->int8[net];
    s->q_in = m->q_in[net];
    if (net == SAGA_NET_HYPER) {
        if (saga_any_source(m) & SAGA_SOURCE_HYPER)
            shape_set(s, 3, pe + 5, w, f);
    } else if (net <= SAGA_NET_E_PRIM) {
        shape_entropy(s, m, net - SAGA_NET_E_COARSE, w);
    } else if (net <= SAGA_NET_FUSE_F) {
        if (w)
            shape_set(s, 2, f + pe, w, f);
    } else if (net == SAGA_NET_FINE) {
        shape_set(s, 3, f + pe, w, f + 4);
    } else if (net == SAGA_NET_GEO) {
        saga_model_geo_rows(&rows, m);
        shape_set(s, 3, f + pe, w, rows.n);
    } else if (net < SAGA_NET_QUERY) {
        shape_colour(s, m, net);
    } else if (m->tools & SAGA_TOOL_MEMORY) {
        shape_memory(s, m, net);
    }
}

uint32_t saga_net_macs(const saga_net_shape *s)
{
    uint32_t macs = 0;
    int i;

    for (i = 0; i < s->n_layers; i++)
        macs += (uint32_t)s->dim[i] * s->dim[i + 1];
    return macs;
}

static int level_is_valid(const saga_level *l)
{
    return l->n_groups >= 1 && l->n_groups <= SAGA_MAX_GROUPS &&
           l->window <= SAGA_MAX_WINDOW && l->neighbours >= 1 &&
           l->neighbours <= SAGA_MAX_NEIGHBOURS &&
           l->suffix_bits <= SAGA_MAX_SUFFIX_BITS && l->max_children >= 1 &&
           l->max_children <= SAGA_MAX_CHILDREN && l->softmax_q8 >= 1;
}

static int width_is_valid(const saga_model *m, int net)
{
    const int least = net == SAGA_NET_FUSE_C || net == SAGA_NET_FUSE_F ? 0 : 1;

    return m->width[net] >= least && m->width[net] <= SAGA_MAX_WIDTH;
}

static int nets_are_valid(const saga_model *m)
{
    int i;

    for (i = 0; i < SAGA_N_NETS; i++)
        if (saga_is_described(m, i) &&
            (!width_is_valid(m, i) || m->q_in[i] < 1 || m->q_in[i] > 15 ||
             m->int8[i] > 1))
            return 0;
    for (i = 0; i < SAGA_N_HEADS; i++)
        if (m->head_q[i] > SAGA_MAX_HEAD_Q)
            return 0;
    return m->head_q[SAGA_HEAD_QUAT] <= 14 &&
           m->width[SAGA_NET_COLOUR] <= MAX_COLOUR_WIDTH;
}

static int is_power_of_two(uint32_t x)
{
    return (x & (x - 1)) == 0;
}

/* The tool is on where a kind reads the memory, and only there. */
static int memory_is_valid(const saga_model *m)
{
    const uint32_t slots = m->memory_slots, width = m->memory_width;
    const uint32_t read = saga_any_source(m);

    if (!(m->tools & SAGA_TOOL_MEMORY))
        return !(m->tools & SAGA_TOOL_PLAIN_WRITE) &&
               !(read & SAGA_SOURCE_MEMORY) && slots == 0 && width == 0 &&
               m->memory_blocks == 0;
    return (read & SAGA_SOURCE_MEMORY) && slots >= SAGA_MIN_SLOTS &&
           slots <= SAGA_MAX_SLOTS && is_power_of_two(slots) && width >= 8 &&
           width <= SAGA_MAX_SLOT_WIDTH && width % 8 == 0 &&
           (slots < SAGA_MAX_SLOTS || width >= 16) && m->memory_blocks >= 1;
}

int saga_model_is_valid(const saga_model *m)
{
    int i;

    for (i = 0; i < SAGA_N_LEVELS; i++)
        if (!level_is_valid(&m->level[i]))
            return 0;
    for (i = 0; i < SAGA_N_STEPS; i++)
        if (m->step_q16[i] < 16u << 16)
            return 0;
    /* Sources that a kind cannot have. */
    if ((m->sources[SAGA_KIND_COARSE] & SAGA_SOURCE_PARENT) ||
        (m->sources[SAGA_KIND_PRIM] & SAGA_SOURCE_GROUPS))
        return 0;
    return m->features >= 5 && m->features <= SAGA_MAX_FEATURES &&
           m->octaves >= 1 && m->octaves <= SAGA_MAX_OCTAVES &&
           nets_are_valid(m) && memory_is_valid(m);
}
