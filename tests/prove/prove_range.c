/* SPDX-License-Identifier: MIT
 *
 * The range decoder: from any state, on any bytes, each call ends with a state
 * of which the same is true, and with a symbol in its range.
 */
#include "prove.h"

#include "range_dec.h"

enum { N = 64 };

static uint8_t bytes[N];

/* Calls keep only pos <= n + 3; everything else may have any value. */
static void any_state(saga_range_dec *d)
{
    saga_range_dec_init(d, bytes, any_of(0, N));
    d->pos = any_of(0, N + 3);
    d->range = any_of(0, UINT32_MAX);
    d->code = any_of(0, UINT32_MAX);
    d->coder.error = Frama_C_interval(0, 1);
}

static void any_model(saga_adaptive *m)
{
    uint32_t i;

    //@ loop unroll 17;
    for (i = 0; i < SAGA_MAX_ADAPTIVE - 1; i++)
        m->start[i] = (uint16_t)any_of(0, 65535);
    m->seen = (uint16_t)any_of(0, 255);
}

static const saga_at at;

static void residuals(void)
{
    saga_range_dec d;
    uint8_t scale;
    int32_t q;

    //@ loop unroll 64;
    for (scale = 0; scale < 64; scale++) {
        any_state(&d);
        d.coder.residual(&d.coder, at, &q, NULL, 1, &scale, 1);
        //@ check d.pos <= N + 3;
        //@ check -65535 <= q <= 65535;
    }
}

static void symbols(void)
{
    saga_range_dec d;
    saga_adaptive m;
    uint32_t n_sym, sym;

    //@ loop unroll 17;
    for (n_sym = 2; n_sym <= SAGA_MAX_ADAPTIVE; n_sym++) {
        any_state(&d);
        any_model(&m);
        sym = d.coder.adaptive(&d.coder, at, &m, n_sym);
        //@ check sym < n_sym;
        //@ check d.pos <= N + 3 && m.seen <= 255;
        (void)sym;
    }
}

static void fields(void)
{
    saga_range_dec d;
    uint32_t bits, v;

    //@ loop unroll 17;
    for (bits = 1; bits <= 16; bits++) {
        any_state(&d);
        v = d.coder.uniform(&d.coder, at, bits);
        //@ check v < (1 << bits);
        //@ check d.pos <= N + 3;
        (void)v;
    }
}

int main(void)
{
    any_bytes(bytes, N);
    residuals();
    symbols();
    fields();
    return 0;
}
