/* SPDX-License-Identifier: MIT */
#include "ref_bank.h"

#include "alloc.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

double ref_dot(const double *a, const double *b, uint32_t n)
{
    double sum = 0;

    for (uint32_t i = 0; i < n; i++)
        sum += a[i] * b[i];
    return sum;
}

/* Sets slot p to its initial state. All elements have the same magnitude; the
 * sign of element d is the parity of p AND a^d, where a generates the field of
 * L elements (poly: its polynomial's low bits, for L = 32 to 512). */
static void start_slot(double *slot, const ref_bank *m, uint32_t p)
{
    static const uint32_t poly[5] = { 5, 3, 3, 29, 17 };
    const uint32_t low = poly[(int)log2(m->n_slots) - 5];
    uint32_t power = 1;

    for (uint32_t d = 0; d < m->width; d++) {
        int ones = 0;

        for (uint32_t both = p & power; both; both &= both - 1)
            ones++;
        slot[d] = (ones % 2 ? -1 : 1) / sqrt(m->width);
        power *= 2;
        if (power & m->n_slots)
            power ^= m->n_slots ^ low;
    }
}

bool ref_bank_begin(ref_bank *m, const ref_nets *n, saga_error *error)
{
    double one[SAGA_MAX_SLOTS];

    memset(m, 0, sizeof *m);
    m->n_slots = n->model->bank_slots;
    m->width = n->model->bank_width;
    m->hidden = n->model->width[SAGA_NET_WRITE];
    if (!m->n_slots)
        return true;
    m->slot = saga_alloc(m->n_slots, m->width * sizeof *m->slot,
                         "the memory bank", error);
    m->own = saga_alloc(m->n_slots, m->hidden * sizeof *m->own,
                        "the memory bank", error);
    if (!m->slot || !m->own)
        return false;
    /* The output of the network SLOT depends only on the number of the slot, so
     * that it is computed once here. */
    for (uint32_t p = 0; p < m->n_slots; p++) {
        start_slot(m->slot + p * m->width, m, p);
        memset(one, 0, sizeof one);
        one[p] = 1;
        ref_nets_run(m->own + p * m->hidden, n, SAGA_NET_SLOT, one);
    }
    return true;
}

void ref_bank_end(ref_bank *m)
{
    free(m->slot);
    free(m->own);
}

void ref_bank_read(double *out, const ref_bank *m, const double *query)
{
    double weight[SAGA_MAX_SLOTS], most = -INFINITY, sum = 0;

    for (uint32_t p = 0; p < m->n_slots; p++) {
        weight[p] = ref_dot(query, m->slot + p * m->width, m->width);
        most = fmax(most, weight[p]);
    }
    for (uint32_t p = 0; p < m->n_slots; p++) {
        weight[p] = exp2(weight[p] - most);
        sum += weight[p];
    }
    for (uint32_t d = 0; d < m->width; d++) {
        out[d] = 0;
        for (uint32_t p = 0; p < m->n_slots; p++)
            out[d] += weight[p] / sum * m->slot[p * m->width + d];
    }
}

/* s = Norm(s + g (v - <v, s> s)). v[width] is the argument of the gate g, a
 * logistic function. */
static void update_slot(double *slot, const ref_nets *n, const ref_bank *m,
                        const double *v)
{
    const double gate = 1 / (1 + exp(-v[m->width]));
    const double along = n->model->tools & SAGA_TOOL_PLAIN_WRITE
                             ? 0
                             : ref_dot(slot, v, m->width);
    double u[SAGA_MAX_SLOT_WIDTH], length;

    for (uint32_t d = 0; d < m->width; d++)
        u[d] = slot[d] +
               gate * ref_saturate(v[d] - along * slot[d], 1 / 4096.0);
    length = sqrt(ref_dot(u, u, m->width));
    for (uint32_t d = 0; d < m->width && length > 0; d++)
        slot[d] = u[d] / length;
}

void ref_bank_end_round(ref_bank *m, const ref_nets *n)
{
    const double unit = ldexp(1, -n->model->q_in[SAGA_NET_WRITE]);
    double base[SAGA_MAX_VECTOR], h[SAGA_MAX_VECTOR], v[SAGA_MAX_VECTOR];

    for (uint32_t d = 0; d < m->width; d++)
        m->sum[d] /= m->n;
    ref_nets_run(base, n, SAGA_NET_WRITE_BASE, m->sum);
    for (uint32_t p = 0; p < m->n_slots; p++) {
        for (uint32_t i = 0; i < m->hidden; i++)
            h[i] = fmax(
                0, ref_saturate(base[i] + m->own[p * m->hidden + i], unit));
        ref_nets_run(v, n, SAGA_NET_WRITE, h);
        update_slot(m->slot + p * m->width, n, m, v);
    }
    memset(m->sum, 0, sizeof m->sum);
    m->n = 0;
}
