/* SPDX-License-Identifier: MIT
 *
 * The plan of a header in which every field may have any value.
 */
#include "prove.h"

#include "plan.h"
#include "work_block.h"

int main(void)
{
    static saga_header h;
    static saga_plan plan;

    any_bytes(&h, sizeof h);
    (void)saga_plan_make(&plan, &h, DECODER_NBYTES);
    return 0;
}
