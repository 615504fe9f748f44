/* SPDX-License-Identifier: MIT
 *
 * A layer of a network from any symbols, for four sizes of layers.
 */
#include "any_coder.h"
#include "prove.h"

#include "syntax_nets.c"

enum { N_IN = 70, N_OUT = 9, N_SIZES = 4 };

int main(void)
{
    static int16_t weights[N_OUT * 80];
    static uint8_t shift[N_OUT];
    static int32_t bias[N_OUT];
    static const uint8_t sizes[N_SIZES][2] = {
        { 0, 5 }, { 3, 1 }, { 64, 2 }, { N_IN, N_OUT }
    };
    saga_coder coder = any_coder;
    net_models models;
    layer_place to;
    int k, i;

    //@ loop unroll 8;
    for (k = 0; k < 2 * N_SIZES; k++) {
        to.weights = (uint8_t *)weights;
        to.shift = shift;
        to.bias = bias;
        to.n_in = sizes[k / 2][0];
        to.n_out = sizes[k / 2][1];
        to.int8 = k & 1;
        to.in.n = any_of(0, to.n_in);
        to.out.n = any_of(0, to.n_out);
        //@ loop unroll 128;
        for (i = 0; i < SAGA_MAX_WIDTH; i++)
            to.in.by[i] = (uint8_t)any_of(0, SAGA_N_FINER - 1);
        (void)code_layer(&to, &models, &coder, 0, 0);
    }
    return 0;
}
