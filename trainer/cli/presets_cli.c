/* SPDX-License-Identifier: MIT
 *
 * saga help presets: what --preset decides, from the table of preset.c.
 */
#include "presets_cli.h"

#include "cli.h"
#include "preset.h"

#include <stdio.h>

static const char head[] =
    "How much work `saga encode --preset` puts into a file. What is given\n"
    "goes before it: --size, --primitives, --iterations, --time, --scale.\n"
    "\n"
    "preset    primitives  iterations  visits  still: visits  CPU minutes\n";

static const char tail[] =
    "\n"
    "primitives: times those of the rule, which follows pixels and motion.\n"
    "iterations: of all stages of a segment, but each picture has its\n"
    "visits at least. Of a still, which has visits of its own, no more than\n"
    "fit into these CPU minutes, if there are some. `saga check CAPTURE` says\n"
    "what that comes to. All presets choose tools alike: by what they save.\n";

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
