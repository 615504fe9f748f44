/* SPDX-License-Identifier: MIT */
#include "scaffold.h"

#include "fx.h"

void saga_bank_size(saga_bank *bank, const saga_model *m)
{
    bank->n_slots = m->bank_slots;
    bank->width = m->bank_width;
    bank->hidden = m->width[SAGA_NET_WRITE];
}

void saga_position_cell(saga_position *p, const saga_coarse *c)
{
    const int log2_x = SAGA_LOG2_HALF_X - c->depth_x;
    const int log2_t = SAGA_LOG2_HALF_T - c->depth_t;
    int i;

    for (i = 0; i < 3; i++) {
        p->x[i] = SAGA_X_MIN + (2 * (int32_t)c->cell[i] + 1) * (1 << log2_x);
        p->support[i] = 1 << log2_x;
        p->log2_support_q10[i] = log2_x * 1024;
    }
    p->t = (2 * (int32_t)c->cell_t + 1) * (1 << log2_t);
    p->support[3] = 1 << log2_t;
    p->log2_support_q10[3] = log2_t * 1024;
}

/* Products fit in 64 bits: |support * offset| <= 2^23 * 2^15. */
void saga_position_move(saga_position *p, const int16_t offset_q14[4])
{
    int i;

    for (i = 0; i < 3; i++)
        p->x[i] = fx_clamp64(
            p->x[i] + fx_rshift64((int64_t)p->support[i] * offset_q14[i], 14),
            SAGA_X_MIN, SAGA_X_MAX);
    p->t = fx_clamp64(
        p->t + fx_rshift64((int64_t)p->support[3] * offset_q14[3], 14), 0,
        SAGA_T_MAX);
}

void saga_position_fine(saga_position *p, const saga_fine *f)
{
    int i;

    for (i = 0; i < 3; i++)
        p->x[i] = f->x[i];
    p->t = f->t;
    for (i = 0; i < 4; i++) {
        p->support[i] = f->support[i];
        p->log2_support_q10[i] = f->local[i];
    }
}
