/* SPDX-License-Identifier: MIT
 *
 * saga help presets prints what --preset decides, from the table in preset.c.
 */
#include "presets_cli.h"

#include "cli.h"
#include "preset.h"

#include <stdio.h>

static const char head[] =
    "How much work `saga encode --preset` spends on a file. The options\n"
    "--size, --primitives, --iterations, --time and --scale override it.\n"
    "\n"
    "preset    primitives  iterations  visits  still: visits  CPU minutes\n";

static const char tail[] =
    "\n"
    "primitives: a factor. It multiplies the number of primitives that saga\n"
    "chooses from the pixels and the motion of the capture.\n"
    "iterations: of all stages of a segment together. There are more if that\n"
    "is needed to train on each picture `visits` times.\n"
    "still: a capture of a still scene has a number of visits of its own, and\n"
    "no more of them than fit into the CPU minutes, if these are given.\n"
    "`saga check CAPTURE` prints the numbers for a capture. All presets use\n"
    "the tools of the format that save bytes, as --model auto says.\n";

void saga_presets_help(void)
{
    const saga_preset *p;

    fputs(head, stdout);
    for (int i = 0; (p = saga_preset_at(i)); i++) {
        printf("%-10s%10.1f%12d%8d%15d", p->name, p->primitives, p->iterations,
               p->visits, p->still_visits);
        if (p->still_minutes > 0)
            printf("%13.2f\n", p->still_minutes);
        else
            printf("%13s\n", "-");
    }
    putchar('\n');
    for (int i = 0; (p = saga_preset_at(i)); i++)
        saga_cli_row(p->name, p->plus);
    fputs(tail, stdout);
}
