/* SPDX-License-Identifier: MIT
 *
 * saga help presets prints what --preset decides, from the table in preset.c.
 */
#include "presets_cli.h"

#include "cli.h"
#include "preset.h"

#include <stdio.h>

static const char head[] =
    "How much work `saga encode --preset` puts into a file. Each of\n"
    "--size, --primitives, --iterations, --time and --scale overrides it.\n"
    "\n"
    "preset    primitives  iterations  visits  still: visits  CPU minutes\n";

static const char tail[] =
    "\n"
    "primitives: a factor on the number that the rule gives, which follows\n"
    "pixels and motion.\n"
    "iterations: for all stages of a segment, but at least `visits` to each\n"
    "picture. A still capture has its own number of visits, and no more than\n"
    "fit into its CPU minutes where these are given. `saga check CAPTURE`\n"
    "prints what this comes to. All presets choose tools in the same way, by\n"
    "what these save.\n";

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
