/* SPDX-License-Identifier: MIT */
#include "model.h"

/* Largest width of the colour network. Each primitive's pre-activations are
 * stored, two bytes each. */
enum { MAX_COLOUR_WIDTH = 32 };

/* Finest Q format of quaternions, in which 1 fits in 16 bits. */
enum { MAX_QUAT_Q = 14 };

/* The format of embeddings, and the finest format of any input. */
enum { MAX_INPUT_Q = 15 };

const saga_level_caps saga_caps[SAGA_N_PROFILES] = {
    { 256u << 10, 512, 512, 1024, 48000, 5120, 1ull << 28, 32, 512, 32, 1 },
    { 4u << 20, 16000, 16000, 16000, 128000, 160000, 1ull << 32, 64, 1024, 64,
      0 },
    { 32u << 20, 160000, 160000, 160000, 128000, 1600000, 1ull << 35, 128, 4096,
      64, 0 },
    { 1u << 30, 1u << 22, 1u << 22, 1u << 22, 524288, 1u << 23, 1ull << 39, 512,
      16384, 128, 0 },
};

/* --- Outputs ------------------------------------------------------------- */

/* Numbers of rows that depend on the model; and formats other than those of
 * outputs. */
enum { ROWS_F = 128, ROWS_C, ROWS_V, ROWS_D, ROWS_BLOCK };
enum { FIXED = 64, LIKE_INPUT = 128 };

/* Consecutive rows of a network's outputs share a format: SAGA_OUT_*,
 * FIXED + Q, or LIKE_INPUT + the network that takes them. */
typedef struct {
    uint8_t net, format, n;
    uint8_t most_q; /* see saga_rows */
    uint8_t order;  /* least motion order */
    uint32_t tools; /* any of these SAGA_TOOL_* bits; 0: always */
} output;

enum {
    FROM_BASE = LIKE_INPUT + SAGA_NET_COLOUR,
    FROM_WRITE = LIKE_INPUT + SAGA_NET_WRITE
};

/* The outputs of all networks, in the order of their rows. A predicted mu has
 * the format of the value that it predicts. */
static const output outputs[] = {
    { SAGA_NET_HYPER, SAGA_OUT_HYPER, ROWS_F, 12, 0, 0 },
    { SAGA_NET_E_COARSE, FIXED + 14, 4, 0, 0, 0 },
    { SAGA_NET_E_COARSE, SAGA_OUT_COARSE, ROWS_F, 12, 0, 0 },
    { SAGA_NET_E_COARSE, SAGA_OUT_SIGMA, ROWS_BLOCK, 12, 0, 0 },
    { SAGA_NET_E_FINE, FIXED + 14, 4, 0, 0, 0 },
    { SAGA_NET_E_FINE, SAGA_OUT_SIGMA, ROWS_BLOCK, 12, 0, 0 },
    { SAGA_NET_E_PRIM, FIXED + 14, 4, 0, 0, 0 },
    { SAGA_NET_E_PRIM, SAGA_OUT_SIGMA, ROWS_BLOCK, 12, 0, 0 },
    { SAGA_NET_FUSE_C, SAGA_OUT_FUSE_C, ROWS_F, MAX_INPUT_Q, 0, 0 },
    { SAGA_NET_FUSE_F, SAGA_OUT_FUSE_F, ROWS_F, MAX_INPUT_Q, 0, 0 },
    { SAGA_NET_FINE, SAGA_OUT_FINE, ROWS_F, MAX_INPUT_Q, 0, 0 },
    { SAGA_NET_FINE, SAGA_OUT_SUPPORT, 4, 12, 0, 0 },
    { SAGA_NET_GEO, SAGA_OUT_OPACITY, 1, 12, 0, 0 },
    { SAGA_NET_GEO, SAGA_OUT_SCALE, 3, 12, 0, 0 },
    { SAGA_NET_GEO, SAGA_OUT_QUAT, 4, MAX_QUAT_Q, 0, 0 },
    { SAGA_NET_GEO, SAGA_OUT_SLOPE, 4, 15, 0, SAGA_TOOL_SLOPE },
    { SAGA_NET_GEO, SAGA_OUT_TIME, 1, 15, 0, SAGA_TOOLS_TIME },
    { SAGA_NET_GEO, SAGA_OUT_WIDTH, 1, 12, 0, SAGA_TOOL_OPACITY_T },
    { SAGA_NET_GEO, SAGA_OUT_MOTION1, 3, 15, 1, 0 },
    { SAGA_NET_GEO, SAGA_OUT_MOTION2, 3, 15, 2, 0 },
    { SAGA_NET_GEO, SAGA_OUT_MOTION3, 3, 15, 3, 0 },
    { SAGA_NET_COLOUR_BASE, FROM_BASE, ROWS_C, 0, 0, 0 },
    { SAGA_NET_COLOUR_VIEW, FROM_BASE, ROWS_C, 0, 0, 0 },
    { SAGA_NET_COLOUR, SAGA_OUT_COLOUR, 3, 14, 0, 0 },
    { SAGA_NET_QUERY, FIXED + SAGA_QUERY_Q, ROWS_D, 0, 0, 0 },
    { SAGA_NET_AGG, FIXED + SAGA_SLOT_Q, ROWS_D, 0, 0, 0 },
    { SAGA_NET_SLOT, FROM_WRITE, ROWS_V, 0, 0, 0 },
    { SAGA_NET_WRITE_BASE, FROM_WRITE, ROWS_V, 0, 0, 0 },
    { SAGA_NET_WRITE, FIXED + SAGA_SLOT_Q, ROWS_D, 0, 0, 0 },
    { SAGA_NET_WRITE, FIXED + SAGA_GATE_Q, 1, 0, 0, 0 },
};

enum { N_OUTPUTS = (int)(sizeof outputs / sizeof outputs[0]) };

static int is_fuse(int net)
{
    return net == SAGA_NET_FUSE_C || net == SAGA_NET_FUSE_F;
}

static uint32_t n_rows(const saga_model *m, const output *o)
{
    const uint8_t by_model[] = { m->features, m->width[SAGA_NET_COLOUR],
                                 m->width[SAGA_NET_WRITE], m->bank_width };

    if ((o->tools && !(m->tools & o->tools)) ||
        saga_motion_order(m) < o->order ||
        (is_fuse(o->net) && !m->width[o->net]))
        return 0;
    if (o->n == ROWS_BLOCK)
        return saga_n_channels(m, o->net - SAGA_NET_E_COARSE);
    return o->n < ROWS_F ? o->n : by_model[o->n - ROWS_F];
}

static uint32_t n_outputs(const saga_model *m, int net)
{
    uint32_t n = 0;
    int i;

    for (i = 0; i < N_OUTPUTS; i++)
        n += outputs[i].net == net ? n_rows(m, &outputs[i]) : 0;
    return n;
}

void saga_model_rows(saga_rows rows[SAGA_N_OUTS], const saga_model *m)
{
    uint32_t first = 0;
    int i;

    for (i = 0; i < N_OUTPUTS; i++) {
        const output *const o = &outputs[i];
        const uint32_t n = n_rows(m, o);

        if (i == 0 || o->net != o[-1].net)
            first = 0;
        if (o->format < SAGA_N_OUTS) {
            rows[o->format].net = o->net;
            rows[o->format].first = (uint8_t)first;
            rows[o->format].n = (uint8_t)n;
            rows[o->format].most_q = o->most_q;
        }
        first += n;
    }
}

int saga_output_q(const saga_model *m, int net, uint32_t row)
{
    const output *o = outputs;

    /* A row of D_res has the format of the row that it corrects. */
    if (net == SAGA_NET_RES) {
        const uint32_t n_geo = n_outputs(m, SAGA_NET_GEO);

        net = row < n_geo ? SAGA_NET_GEO : SAGA_NET_COLOUR_BASE;
        row -= row < n_geo ? 0 : n_geo;
    }
    while (o->net != net)
        o++;
    for (; row >= n_rows(m, o); o++)
        row -= n_rows(m, o);
    return o->format >= LIKE_INPUT ? m->q_in[o->format - LIKE_INPUT]
           : o->format >= FIXED    ? o->format - FIXED
                                   : m->out_q[o->format];
}

/* --- Shapes -------------------------------------------------------------- */

/* Returns the number of inputs of an entropy network with sources s: F for each
 * source, D for the bank. */
static uint32_t entropy_inputs(const saga_model *m, uint32_t s)
{
    uint32_t n = 0;

    n += s & SAGA_SOURCE_HYPER ? m->features : 0u;
    n += s & SAGA_SOURCE_PARENT ? m->features : 0u;
    n += s & SAGA_SOURCE_GROUPS ? m->features : 0u;
    n += s & SAGA_SOURCE_BANK ? m->bank_width : 0u;
    return n;
}

/* Returns the number of inputs of a network. Query and Agg read a block's
 * embedding, 4 sizes, count, kind and F values. */
static uint32_t n_inputs(const saga_model *m, int net)
{
    const uint32_t pe = saga_pe_size(m), local = m->features + pe;
    const uint32_t n[SAGA_N_NETS] = {
        [SAGA_NET_HYPER] = pe + 5,
        [SAGA_NET_E_COARSE] = entropy_inputs(m, m->sources[SAGA_KIND_COARSE]),
        [SAGA_NET_E_FINE] = entropy_inputs(m, m->sources[SAGA_KIND_FINE]),
        [SAGA_NET_E_PRIM] = entropy_inputs(m, m->sources[SAGA_KIND_PRIM]),
        [SAGA_NET_FUSE_C] = local,
        [SAGA_NET_FUSE_F] = local,
        [SAGA_NET_FINE] = local,
        [SAGA_NET_GEO] = local,
        [SAGA_NET_COLOUR_BASE] = local,
        [SAGA_NET_COLOUR_VIEW] = 3,
        [SAGA_NET_COLOUR] = m->width[SAGA_NET_COLOUR],
        [SAGA_NET_QUERY] = local + 6,
        [SAGA_NET_AGG] = local + 6,
        [SAGA_NET_SLOT] = m->bank_slots,
        [SAGA_NET_WRITE_BASE] = m->bank_width,
        [SAGA_NET_WRITE] = m->width[SAGA_NET_WRITE],
        [SAGA_NET_RES] = (uint32_t)m->hash_levels << m->hash_log2_entries
    };

    return n[net];
}

static int exists(const saga_model *m, int net)
{
    return net == SAGA_NET_HYPER ? (saga_any_source(m) & SAGA_SOURCE_HYPER) != 0
           : is_fuse(net)        ? m->width[net] != 0
           : net == SAGA_NET_COLOUR_VIEW ? (m->tools & SAGA_TOOL_VIEW) != 0
                                         : saga_is_described(m, net);
}

void saga_model_net(saga_net_shape *s, const saga_model *m, int net)
{
    static const uint8_t n_layers[SAGA_N_NETS] = {
        [SAGA_NET_HYPER] = 3,       [SAGA_NET_E_COARSE] = 3,
        [SAGA_NET_E_FINE] = 3,      [SAGA_NET_E_PRIM] = 3,
        [SAGA_NET_FUSE_C] = 2,      [SAGA_NET_FUSE_F] = 2,
        [SAGA_NET_FINE] = 3,        [SAGA_NET_GEO] = 3,
        [SAGA_NET_COLOUR_BASE] = 1, [SAGA_NET_COLOUR_VIEW] = 1,
        [SAGA_NET_COLOUR] = 2,      [SAGA_NET_QUERY] = 2,
        [SAGA_NET_AGG] = 2,         [SAGA_NET_SLOT] = 2,
        [SAGA_NET_WRITE_BASE] = 1,  [SAGA_NET_WRITE] = 1,
        [SAGA_NET_RES] = 2
    };
    int i;

    for (i = 0; i <= SAGA_MAX_NET_LAYERS; i++)
        s->dim[i] = 0;
    s->n_layers = 0;
    s->int8 = m->int8[net];
    s->q_in = m->q_in[net];
    if (!exists(m, net))
        return;
    s->dim[0] = (uint16_t)n_inputs(m, net);
    /* Without sources the parameters are constants, the biases of one layer. */
    s->n_layers = s->dim[0] && m->width[net] ? n_layers[net] : 1;
    for (i = 1; i < s->n_layers; i++)
        s->dim[i] = m->width[net];
    /* D_res has a row for each row that it corrects. */
    s->dim[s->n_layers] = (uint16_t)(net != SAGA_NET_RES
                                         ? n_outputs(m, net)
                                         : n_outputs(m, SAGA_NET_GEO) +
                                               n_outputs(m,
                                                         SAGA_NET_COLOUR_BASE));
}

uint32_t saga_net_macs(const saga_net_shape *s)
{
    uint32_t macs = 0;
    int i;

    for (i = 0; i < s->n_layers; i++)
        macs += (uint32_t)s->dim[i] * s->dim[i + 1];
    return macs;
}

/* --- Validity ------------------------------------------------------------ */

static int tier_is_valid(const saga_tier *l)
{
    return l->n_groups >= 1 && l->n_groups <= SAGA_MAX_GROUPS &&
           l->window <= SAGA_MAX_WINDOW && l->neighbours >= 1 &&
           l->neighbours <= SAGA_MAX_NEIGHBOURS &&
           l->suffix_bits <= SAGA_MAX_SUFFIX_BITS && l->max_children >= 1 &&
           l->max_children <= SAGA_MAX_CHILDREN && l->softmax_q8 >= 1;
}

static int width_is_valid(const saga_model *m, int net)
{
    const int may_be_0 = is_fuse(net) || net == SAGA_NET_FINE ||
                         net == SAGA_NET_GEO;

    return m->width[net] >= (may_be_0 ? 0 : 1) &&
           m->width[net] <= SAGA_MAX_WIDTH;
}

static int nets_are_valid(const saga_model *m)
{
    int i;

    for (i = 0; i < SAGA_N_NETS; i++)
        if (saga_is_described(m, i) &&
            (!width_is_valid(m, i) || m->q_in[i] < 1 ||
             m->q_in[i] > MAX_INPUT_Q || m->int8[i] > 1))
            return 0;
    for (i = 0; i < SAGA_N_OUTS; i++)
        if (m->out_q[i] > SAGA_MAX_OUT_Q)
            return 0;
    return m->out_q[SAGA_OUT_QUAT] <= MAX_QUAT_Q &&
           m->width[SAGA_NET_COLOUR] <= MAX_COLOUR_WIDTH;
}

static int is_power_of_two(uint32_t x)
{
    return (x & (x - 1)) == 0;
}

/* Returns whether the bank's sizes are valid, and whether the tool is on
 * exactly if at least one kind reads the bank. */
static int bank_is_valid(const saga_model *m)
{
    const uint32_t slots = m->bank_slots, width = m->bank_width;
    const uint32_t read = saga_any_source(m);

    if (!(m->tools & SAGA_TOOL_BANK))
        return !(m->tools & SAGA_TOOL_PLAIN_WRITE) &&
               !(read & SAGA_SOURCE_BANK) && slots == 0 && width == 0 &&
               m->bank_blocks == 0;
    return (read & SAGA_SOURCE_BANK) && slots >= SAGA_MIN_SLOTS &&
           slots <= SAGA_MAX_SLOTS && is_power_of_two(slots) && width >= 8 &&
           width <= SAGA_MAX_SLOT_WIDTH && width % 8 == 0 &&
           (slots < SAGA_MAX_SLOTS || width >= 16) && m->bank_blocks >= 1;
}

static int hash_is_valid(const saga_model *m)
{
    const uint32_t levels = m->hash_levels, bits = m->hash_log2_entries;

    /* Sizes without the tool need a newer decoder (decoder/plan.c). */
    if (!(m->tools & SAGA_TOOL_HASH))
        return 1;
    return levels >= 1 && levels <= SAGA_MAX_HASH_LEVELS && bits >= 1 &&
           bits <= 9 && levels << bits <= SAGA_MAX_ENTRIES;
}

/* Returns whether each class has features of the model, and the others that
 * the header has room for are 0. */
static int classes_are_valid(const saga_model *m)
{
    uint32_t i;

    if (!(m->tools & SAGA_TOOL_CLASSES))
        return 1;
    if (m->n_classes < 2 || m->n_classes > SAGA_MAX_CLASSES)
        return 0;
    for (i = 0; i < SAGA_MAX_CLASSES; i++) {
        const saga_class c = m->classes[i];

        if (i >= m->n_classes
                ? c.first || c.n || c.one
                : (uint32_t)c.first + c.n > m->features ||
                      c.one > m->features || saga_class_has(c, c.one))
            return 0;
    }
    return 1;
}

int saga_model_is_valid(const saga_model *m)
{
    int i;

    for (i = 0; i < SAGA_N_TIERS; i++)
        if (!tier_is_valid(&m->tier[i]))
            return 0;
    for (i = 0; i < SAGA_N_STEPS; i++)
        if (m->step_q16[i] < 16u << 16)
            return 0;
    /* These kinds cannot have these sources. */
    if ((m->sources[SAGA_KIND_COARSE] & SAGA_SOURCE_PARENT) ||
        (m->sources[SAGA_KIND_PRIM] & SAGA_SOURCE_GROUPS))
        return 0;
    return m->features >= 5 && m->features <= SAGA_MAX_FEATURES &&
           m->octaves >= 1 && m->octaves <= SAGA_MAX_OCTAVES &&
           nets_are_valid(m) && bank_is_valid(m) && hash_is_valid(m) &&
           classes_are_valid(m);
}
