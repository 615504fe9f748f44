/* SPDX-License-Identifier: MIT
 *
 * Checks a file against the limits of a level on a decoder's memory and work.
 * The error names the quantity that is too large.
 */
#include "pack.h"

#include "model.h"

#include <inttypes.h>

bool saga_pack_within(const saga_info *i, int level, saga_error *error)
{
    const saga_level_caps *const caps = &saga_caps[level];
    const struct { const char *what; uint64_t value, cap; } needs[] = {
        { "coarse anchors", i->base_coarse + i->max_coarse, caps->n_coarse },
        { "fine anchors", i->base_fine + i->max_fine, caps->n_fine },
        { "primitives", i->base_primitives + i->max_primitives, caps->n_prim },
        { "weights", i->n_weights, caps->n_weights },
        { "bytes of the decoder's memory", i->work_nbytes, caps->work_nbytes },
        { "anchors in all layers and the base together",
          (uint64_t)i->n_layers * (i->max_coarse + i->max_fine) +
          i->base_coarse + i->base_fine, caps->n_anchors },
        { "units of a decoder's work a segment", i->work, caps->work }
    };
    const char *const remedy = level < SAGA_N_PROFILES - 1
        ? "take fewer --primitives or --layers, or a higher --level"
        : "take fewer --primitives or --layers";

    for (size_t k = 0; k < sizeof needs / sizeof *needs; k++)
        if (needs[k].value > needs[k].cap)
            return saga_fail(error, NULL, remedy, "the file would need %" PRIu64
                             " %s, level %d has %" PRIu64, needs[k].value,
                             needs[k].what, level, needs[k].cap);
    return true;
}
