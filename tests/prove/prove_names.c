/* SPDX-License-Identifier: MIT
 *
 * The payload of NAME: any bytes of any length up to 40, for one to three
 * cameras.
 */
#include "prove.h"

#include "names.c"

int main(void)
{
    static uint8_t p[40];
    static saga_naming naming;
    uint32_t n;

    any_bytes(p, sizeof p);
    //@ loop unroll 41;
    for (n = 0; n <= sizeof p; n++)
        (void)read_payload(&naming, p, n, any_of(0, 2), any_of(1, 3));
    return 0;
}
