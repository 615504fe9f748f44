/* SPDX-License-Identifier: MIT
 *
 * The plan of a header in which every field may have any value, with each
 * choice of the tools BANK and HASH, and none or all of the first eight others.
 */
#include "prove.h"

#include "plan.h"
#include "work_block.h"

int main(void)
{
    static saga_header h;
    static saga_plan plan;
    uint32_t k;

    //@ loop unroll 8;
    for (k = 0; k < 8; k++) {
        const uint32_t tools = (k & 1 ? SAGA_TOOL_BANK : 0u) |
                               (k & 2 ? SAGA_TOOL_HASH : 0u) |
                               (k & 4 ? 255u : 0u);

        any_bytes(&h, sizeof h);
        h.model.tools = tools;
        (void)saga_plan_make(&plan, &h, DECODER_NBYTES);
    }
    return 0;
}
