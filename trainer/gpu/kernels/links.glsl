/* SPDX-License-Identifier: MIT
 *
 * Links between blocks (scene/links.h), or the other way round: of each block
 * where its links begin, then of all links the ranks, then the bits of their
 * weights. */
layout(std430, set = 0, binding = 0) readonly buffer link_block
{
    uint link[];
};

uint link_begin(uint block)
{
    return link[block];
}

uint link_rank(uint i)
{
    return link[n_blocks + 1 + i];
}

float link_weight(uint i)
{
    return uintBitsToFloat(link[n_blocks + 1 + n_links + i]);
}
