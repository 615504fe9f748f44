/* SPDX-License-Identifier: MIT
 *
 * Columns at .. at + n_cols - 1 of the inputs of a network, of which row r is
 * for block first + every r: what a pass over them tells the kernels that set
 * the inputs and that take gradients back. Inputs are clamped to +-most. */
#include "group.glsl"

layout(push_constant) uniform push_block
{
    uint n_rows;
    uint n_cols;
    uint dim;       /* columns of all inputs */
    uint at;
    uint first;
    uint every;
    float most;
    uint have;      /* gather: reals of a block; the other columns are 0 */
    uint is_linked; /* 0: a row reads its block; 1: what the links say */
    uint n_blocks;
    uint n_links;
    uint adds;      /* scatter: to what is there */
};
