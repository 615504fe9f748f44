/* SPDX-License-Identifier: MIT
 *
 * What a pass over n primitives tells the kernels net_*.comp, and the table of
 * F_geo's outputs. */
layout(push_constant) uniform push_block
{
    uint n;
    uint n_geo;      /* outputs of F_geo */
    float most_motion;
    float centre_lo; /* bounds of temporal centres */
    float centre_hi;
    float size_price;
};

/* SAGA_UNIT_* of attributes.h, for part_unit(). */
const uint LOG2_LENGTH = 3, IN_SUPPORTS = 4, TIME = 5, LOG2_TIME = 6;

/* Fields of a word of the table of F_geo's outputs: the attribute, which may be
 * none, the component, and the unit. */
uint part_attr(uint word)
{
    return word & 255;
}

uint part_at(uint word)
{
    return word >> 8 & 255;
}

uint part_unit(uint word)
{
    return word >> 16;
}
