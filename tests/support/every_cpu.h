/* SPDX-License-Identifier: MIT
 *
 * The main function of a program whose tests run once for every set of vector
 * instructions that this machine has. The set is in `cpu`.
 */
#ifndef EVERY_CPU_H
#define EVERY_CPU_H

#include "cpu.h"
#include "testing.h"

static saga_cpu cpu;

int main(void)
{
    int failed = 0;

    for (cpu = SAGA_CPU_PLAIN; cpu <= saga_cpu_best(); cpu++)
        failed += testing_run();
    return failed;
}

#endif
