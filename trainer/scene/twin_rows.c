/* SPDX-License-Identifier: MIT
 *
 * A stage of the twin works on rows, one for each fine anchor or primitive,
 * which its networks take in chunks.
 */
#include "twin_state.h"

size_t saga_twin_rows(const saga_twin *w, int net)
{
    return net == SAGA_NET_FUSE_C || net == SAGA_NET_FINE ? w->n.fine
           : net >= SAGA_NET_FUSE_F                       ? w->n.prim
                                                          : 0;
}

void saga_twin_attribute_rows(saga_rows rows[SAGA_N_OUTS], const saga_scene *s)
{
    saga_model_rows(rows, &s->model);
    /* A base is still: the model has rows for temporal outputs, but they are
     * not used. */
    for (int a = 0; s->still && a < SAGA_N_ATTRS; a++) {
        const saga_attribute *const k = &saga_attributes[a];

        for (int h = 0; k->is_temporal && h < k->n_outs; h++)
            rows[k->out + h].n = 0;
    }
}

void saga_twin_parts(saga_attr_part *part, const saga_scene *s)
{
    const saga_net *const geo = &s->net[SAGA_NET_GEO];
    saga_rows rows[SAGA_N_OUTS];

    saga_twin_attribute_rows(rows, s);
    for (int i = 0; i < geo->dim[geo->n_layers]; i++)
        part[i] = (saga_attr_part){ .attr = SAGA_N_ATTRS };
    for (int a = 0; a < SAGA_N_ATTRS; a++) {
        const saga_attribute *const k = &saga_attributes[a];

        for (int h = 0; h < k->n_outs; h++) {
            const saga_rows of = rows[k->out + h];

            for (int i = 0; of.net == SAGA_NET_GEO && i < of.n; i++)
                part[of.first + i] = (saga_attr_part){
                    (uint8_t)a, (uint8_t)(h * k->width / k->n_outs + i)
                };
        }
    }
}

double saga_twin_cost(const saga_twin_stage *t, size_t *most)
{
    double ns = SAGA_TWIN_ROW_NS;
    int i;

    *most = 0;
    for (i = 0; i < t->n_nets; i++) {
        const size_t have = t->w->batch[t->nets[i]].work.n_threads;

        if (t->s->net[t->nets[i]].n_layers == 0)
            continue;
        ns += saga_net_ns(&t->s->net[t->nets[i]]);
        *most = *most && *most < have ? *most : have;
    }
    return ns;
}

void saga_twin_do_rows(void (*chunk)(void *, size_t), saga_twin_stage *t,
                       size_t n)
{
    saga_tasks all = { .run = chunk,
                       .user = t,
                       .n = saga_n_parts(n, SAGA_NET_CHUNK) };

    all.ns = saga_twin_cost(t, &all.most) * (double)n;
    saga_parallel(&all);
}

void saga_twin_each_out(const saga_twin_stage *t, saga_range of,
                        saga_twin_out_fn *one)
{
    for (int a = 0; a < SAGA_N_ATTRS; a++) {
        const saga_attribute *const k = &saga_attributes[a];

        for (int h = 0; saga_attr_is_output(k) && h < k->n_outs; h++) {
            const saga_rows rows = t->rows[k->out + h];

            if (rows.n && rows.net == SAGA_NET_GEO)
                one(t, a, (size_t)(h * k->width / k->n_outs), rows, of);
        }
    }
}

saga_net_pass saga_twin_pass(saga_twin *w, const saga_scene *s, int net)
{
    saga_twin_batch *const b = &w->batch[net];

    return (saga_net_pass){ .net = &s->net[net],
                            .work = &b->work,
                            .x = b->in,
                            .y = b->out,
                            .m = saga_twin_rows(w, net),
                            .x_is_constant = net == SAGA_NET_COLOUR_VIEW ||
                                             net == SAGA_NET_RES,
                            .x_is_rectified = net == SAGA_NET_COLOUR };
}

saga_net_rows saga_twin_back(const saga_twin_stage *t, int net, size_t chunk)
{
    const saga_net_pass p = saga_twin_pass(t->w, t->s, net);
    const size_t at = saga_twin_out_at(t->s, net, chunk * SAGA_NET_CHUNK);

    return saga_net_chunk_backward(&p, chunk, t->w->batch[net].d_out + at,
                                   saga_twin_out_at(t->s, net, 1));
}
