/* SPDX-License-Identifier: MIT
 *
 * The parts of a file as JSON, for the reports of make_order0 and make_refit.
 * It is a header so that the library of the tests' helpers does not need
 * jansson.
 */
#ifndef FILE_JSON_H
#define FILE_JSON_H

#include "rate_loss.h"
#include "ref_file.h"

#include <jansson.h>

/* The bits and the number of parameters (weights and biases) of the entropy
 * networks (saga_is_entropy_net), or of the other networks. */
typedef struct file_json_sum {
    double bits;
    size_t parameters;
} file_json_sum;

static inline file_json_sum file_json_nets(const ref_file *f, bool entropy)
{
    file_json_sum s = { 0, 0 };

    for (int net = 0; net < SAGA_N_NETS; net++) {
        const saga_net_shape *const n = &f->shapes.shape[net];

        if (saga_is_entropy_net(net) != entropy)
            continue;
        s.bits += f->net_bits[net];
        s.parameters += saga_net_macs(n);
        for (int l = 0; l < n->n_layers; l++)
            s.parameters += n->dim[l + 1];
    }
    return s;
}

/* Returns {"entropy": bytes, "entropy_parameters": n} and the same for
 * "reconstruction", as a new reference. */
static inline json_t *file_json_networks(const ref_file *f)
{
    const file_json_sum e = file_json_nets(f, true);
    const file_json_sum r = file_json_nets(f, false);

    return json_pack("{sfsIsfsI}", "entropy", e.bits / 8, "entropy_parameters",
                     (json_int_t)e.parameters, "reconstruction", r.bits / 8,
                     "reconstruction_parameters", (json_int_t)r.parameters);
}

/* Returns the bytes of each component of the file by its key, and "networks" as
 * file_json_networks makes it. */
static inline json_t *file_json_parts(const ref_file *f)
{
    json_t *const o = json_object();
    double bits[SAGA_N_COMPONENTS];

    saga_cost_components(bits, f->bits);
    for (int i = SAGA_COMPONENT_TREE; i < SAGA_N_COMPONENTS; i++)
        json_object_set_new(o, saga_component_key((saga_component)i),
                            json_real(bits[i] / 8));
    json_object_set_new(o, "networks", file_json_networks(f));
    return o;
}

#endif
