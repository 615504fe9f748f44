/* SPDX-License-Identifier: MIT
 *
 * What the host gives for each of n primitives besides features, and what a
 * pass over them tells the kernels net_*.comp. A kernel that includes this has
 * defined given[]: place (n, 4), offset (n, 4), support (n, 4) and level (n, 2)
 * one after the other. */
layout(push_constant) uniform push_block
{
    uint n;
    uint n_geo;      /* outputs of F_geo */
    uint n_features; /* and octaves: the inputs of F_geo */
    uint octaves;
    float most_motion;
    float centre_lo; /* bounds of temporal centres */
    float centre_hi;
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

float place(uint i, uint axis)
{
    return given[4 * i + axis];
}

float offset(uint i, uint axis)
{
    return given[4 * (n + i) + axis];
}

float support(uint i, uint axis)
{
    return given[4 * (2 * n + i) + axis];
}

/* The constants of log2 sizes: k = 0 in space, 1 in time. */
float level(uint i, uint k)
{
    return given[12 * n + 2 * i + k];
}
