/* SPDX-License-Identifier: MIT
 *
 * The main function of a program of tests that does not define one.
 */
#include "testing.h"

int main(void)
{
    return testing_run();
}
