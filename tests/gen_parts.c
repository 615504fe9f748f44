/* SPDX-License-Identifier: MIT */
#include "gen_parts.h"

int parts_is_entropy(int net)
{
    return net <= SAGA_NET_E_PRIM || net >= SAGA_NET_QUERY;
}

/* Bits and parameters (weights and biases) of the networks of one sort. */
typedef struct {
    double bits;
    size_t parameters;
} sum;

static sum sum_of(const ref_file *f, int entropy)
{
    sum s = { 0, 0 };

    for (int net = 0; net < SAGA_N_NETS; net++) {
        const saga_net_shape *const n = &f->shapes.shape[net];

        if (parts_is_entropy(net) != entropy)
            continue;
        s.bits += f->net_bits[net];
        s.parameters += saga_net_weights(n);
        for (int l = 0; l < n->n_layers; l++)
            s.parameters += n->dim[l + 1];
    }
    return s;
}

double parts_entropy_bits(const ref_file *f)
{
    return sum_of(f, 1).bits;
}

json_t *parts_networks(const ref_file *f)
{
    const sum e = sum_of(f, 1), r = sum_of(f, 0);

    return json_pack("{sfsIsIsfsIsI}", "entropy", e.bits / 8,
                     "entropy_parameters", (json_int_t)e.parameters,
                     "entropy_raw", (json_int_t)(2 * e.parameters),
                     "reconstruction", r.bits / 8,
                     "reconstruction_parameters", (json_int_t)r.parameters,
                     "reconstruction_raw", (json_int_t)(2 * r.parameters));
}

json_t *parts_json(const ref_file *f)
{
    json_t *const o = json_object();
    double bits[SAGA_N_COMPONENTS];

    saga_cost_components(bits, f->bits);
    for (int i = SAGA_COMPONENT_TREE; i < SAGA_N_COMPONENTS; i++)
        json_object_set_new(o, saga_component_key((saga_component)i),
                            json_real(bits[i] / 8));
    json_object_set_new(o, "networks", parts_networks(f));
    return o;
}
