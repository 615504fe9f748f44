/* SPDX-License-Identifier: MIT
 *
 * A dense layer over many rows, y = W x + b: what a pass of it tells the
 * kernels dense_*.comp. Rows of x and y lie one after the other, without
 * gaps. */
#include "group.glsl"

/* Bits of `how`. */
const uint RELU = 1; /* forward: y = max(y, 0); backward: x is such a y */
const uint ADD = 2;  /* to what is there */

layout(push_constant) uniform push_block
{
    uint n_rows;
    uint n_in;
    uint n_out;
    uint at;       /* of W (n_out, n_in), and then b, in the parameters */
    uint how;
    uint n_cols;   /* backward: of the inputs that get gradients, the first */
    uint base;     /* where the parameters of all layers of a pass begin */
    uint n_params; /* of these layers */
    uint n_slabs;  /* of rows, each with a sum of its own */
    uint slab;     /* rows of a slab */
};
