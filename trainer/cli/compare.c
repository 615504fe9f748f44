/* SPDX-License-Identifier: MIT
 *
 * saga compare says how two results of `saga eval` differ, or by how much two
 * curves of them do: Bjontegaard's delta.
 */
#include "bd.h"
#include "cli.h"
#include "commands.h"
#include "file.h"
#include "json_cli.h"
#include "json_memory.h"
#include "results.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

typedef struct {
    bool json;
} options;

typedef struct {
    saga_results a, b;
    saga_error error;
} session;

/* --- Two results --------------------------------------------------------- */

static void print_pair(const session *s)
{
    const json_t *const a = s->a.result[0], *const b = s->b.result[0];
    const double na = saga_result_nbytes(a), nb = saga_result_nbytes(b);

    printf("%s against %s\n\n%-12s %-9s %12s %12s %12s\n", s->b.path,
           s->a.path, "metric", "views", "A", "B", "B - A");
    if (na > 0.0 && nb > 0.0)
        printf("%-12s %-9s %12.0f %12.0f %+10.2f %%\n", "bytes", "", na, nb,
               100.0 * (nb / na - 1.0));
    for (int m = 0; m < SAGA_N_METRICS; m++)
        for (int i = 0; i < SAGA_N_SETS; i++) {
            const saga_metric_key *const key = &saga_metric_keys[m];
            const double x = saga_result_value(a, saga_set_keys[i], key);
            const double y = saga_result_value(b, saga_set_keys[i], key);

            if (isfinite(x) && isfinite(y))
                printf("%-12s %-9s %12.5f %12.5f %+12.5f\n", key->name,
                       saga_set_keys[i], x, y, y - x);
        }
}

static json_t *json_pair(const session *s)
{
    const json_t *const a = s->a.result[0], *const b = s->b.result[0];
    json_t *const o = json_object();

    for (int i = 0; i < SAGA_N_SETS; i++) {
        json_t *const set = json_object();

        for (int m = 0; m < SAGA_N_METRICS; m++) {
            const saga_metric_key *const key = &saga_metric_keys[m];
            const double d = saga_result_value(b, saga_set_keys[i], key) -
                             saga_result_value(a, saga_set_keys[i], key);

            if (isfinite(d))
                saga_json_set_value(set, key->key, json_real(d));
        }
        saga_json_set_value(o, saga_set_keys[i], set);
    }
    return o;
}

/* --- Two curves ---------------------------------------------------------- */

static void print_curves(const session *s)
{
    printf("%s (%d results) against %s (%d): bytes at equal quality\n\n"
           "%-12s %-9s %9s %9s %9s %9s %9s\n", s->b.path, s->b.n, s->a.path,
           s->a.n, "metric", "views", "overlap", "from", "to", "PCHIP",
           "Akima");
    for (int m = 0; m < SAGA_N_METRICS; m++)
        for (int i = 0; i < SAGA_N_SETS; i++) {
            const double sign = saga_metric_keys[m].sign;
            saga_bd bd;

            if (!saga_results_bd_of(&bd, &s->a, &s->b, i, m))
                continue;
            printf("%-12s %-9s ", saga_metric_keys[m].name, saga_set_keys[i]);
            if (bd.refused)
                printf("        -  %s\n", bd.refused);
            else
                printf("%7.0f %% %9.4f %9.4f %+7.2f %% %+7.2f %%\n",
                       100.0 * bd.overlap, sign * bd.lo, sign * bd.hi,
                       bd.pchip, bd.akima);
        }
    puts("\nBD-rate: the mean difference of log bytes over quality; where "
         "PCHIP and\nAkima differ much, the points are too few.");
}

/* --- Together ------------------------------------------------------------ */

static int print_json(const session *s, bool curves)
{
    json_t *o;

    saga_json_watch();
    o = saga_cli_json_head("compare", s->b.path);
    saga_json_merge_object(o, json_pack("{ssso}", "anchor", s->a.path,
                                        curves ? "bd_rate" : "difference",
                                        curves ? saga_results_bd(&s->a, &s->b)
                                               : json_pair(s)));
    return saga_cli_print_json(o, 9, s->b.path);
}

static int load(session *s, saga_results *r, const char *path)
{
    if (saga_results_load(r, path, &s->error))
        return SAGA_EXIT_OK;
    return saga_cli_error(saga_path_is_file(path) ? SAGA_EXIT_DATA
                                                  : SAGA_EXIT_USAGE,
                          "compare: %s", s->error.message);
}

static int judge(session *s, const options *o)
{
    const char *const differs = saga_results_differ(s->a.result[0],
                                                    s->b.result[0]);
    const bool curves = s->a.n > 1 || s->b.n > 1;

    if (differs)
        return saga_cli_error(SAGA_EXIT_DATA, "compare: the %s of %s and %s "
                              "differ, so their numbers do not compare; "
                              "evaluate both alike", differs, s->a.path,
                              s->b.path);
    if (o->json)
        return print_json(s, curves);
    if (curves)
        print_curves(s);
    else
        print_pair(s);
    return SAGA_EXIT_OK;
}

static int run(int argc, char **argv)
{
    options o = { false };
    const char *names[2];
    session s = { .error = { "" } };
    int status = saga_cli_parse(&saga_command_compare, &o, names, argc, argv);

    if (status != SAGA_CLI_GO_ON)
        return status;
    status = load(&s, &s.a, names[0]);
    if (!status)
        status = load(&s, &s.b, names[1]);
    if (!status)
        status = judge(&s, &o);
    saga_results_free(&s.a);
    saga_results_free(&s.b);
    return status;
}

static const saga_cli_option option_list[] = {
    { "--json", NULL, "the same as JSON", saga_cli_flag,
      offsetof(options, json), 0, 0 }
};

const saga_command saga_command_compare = {
    "compare", "A.json B.json", 2, "how two results differ, or two curves",
    "Reads what `saga eval --json` wrote. Of two results it tells the\n"
    "difference of each metric. A file may hold several, of one capture at\n"
    "several rates (`saga eval ... --json >>curve.json`): then it tells\n"
    "Bjontegaard's delta, how many per cent more bytes B takes than A at\n"
    "equal quality, by monotone cubics (PCHIP) and by Akima's spline. That\n"
    "needs four points on each curve, quality that grows with the bytes, and\n"
    "a quarter of the wider range in common. Results of other frames, cameras\n"
    "or scales are refused.\n",
    option_list, (int)(sizeof option_list / sizeof option_list[0]), run, NULL
};
