/* SPDX-License-Identifier: MIT
 *
 * saga compare tells how two results of `saga eval` differ. For two curves of
 * results it computes the Bjontegaard delta rate.
 */
#include "bd.h"
#include "cli.h"
#include "commands.h"
#include "file.h"
#include "json_cli.h"
#include "results.h"

#include <math.h>

typedef struct {
    bool json;
} options;

typedef struct {
    saga_results a, b;
    saga_error error;
} session;

/* --- Two results --------------------------------------------------------- */

static const saga_line pair_text[] = {
    { "", NULL,
      "{file} against {anchor}\n\nmetric       views                "
      "A            B        B - A\n" },
    { "/bytes", NULL,
      "bytes                  {/bytes.a:%12.0f} "
      "{/bytes.b:%12.0f} {/bytes.more:%+10.2f} %\n" },
    { "", "/rows",
      "{label:%-12s} {set:%-9s} {a:%12.5f} {b:%12.5f} "
      "{more:%+12.5f}\n" }
};

/* Adds a row with the values that both results have for a metric in a set of
 * views; nothing if one of them lacks it. */
static void put_difference(const session *s, json_t *rows, json_t *set,
                           const saga_metric_row *m, const char *name)
{
    const double x = saga_result_value(s->a.result[0], name, m->key);
    const double y = saga_result_value(s->b.result[0], name, m->key);

    if (!isfinite(x) || !isfinite(y))
        return;
    saga_put_real(set, m->key, y - x);
    saga_put_item(rows, json_pack("{sssssfsfsf}", "label", m->label, "set",
                                  name, "a", x, "b", y, "more", y - x));
}

static void put_pair(json_t *o, const session *s)
{
    const double na = saga_result_nbytes(s->a.result[0]);
    const double nb = saga_result_nbytes(s->b.result[0]);
    json_t *const all = json_object(), *const rows = json_array();
    const saga_metric_row *m;

    for (int i = 0; i < SAGA_N_SETS; i++)
        saga_put(all, saga_set_keys[i], json_object());
    for (int k = 0; (m = saga_metric_at(k)); k++)
        for (int i = 0; i < SAGA_N_SETS && m->compared; i++)
            put_difference(s, rows, json_object_get(all, saga_set_keys[i]), m,
                           saga_set_keys[i]);
    saga_put(o, "difference", all);
    saga_put(o, "/rows", rows);
    if (na > 0.0 && nb > 0.0)
        saga_put(o, "/bytes",
                 json_pack("{sfsfsf}", "a", na, "b", nb, "more",
                           100.0 * (nb / na - 1.0)));
}

/* --- Two curves ---------------------------------------------------------- */

static const saga_line curve_text[] = {
    { "", NULL,
      "{file} ({/n.b} results) against {anchor} ({/n.a}): bytes at "
      "equal quality\n\nmetric       views       overlap      from        to "
      "    PCHIP     Akima\n" },
    { "", "/rows", "{label:%-12s} {set:%-9s} " },
    { "bd.refused", "/rows", "        -  {bd.refused}\n" },
    { "!bd.refused", "/rows",
      "{bd.overlap*100:%7.0f} % {bd.range.0:%9.4f} "
      "{bd.range.1:%9.4f} {bd.pchip:%+7.2f} % {bd.akima:%+7.2f} %\n" },
    { "", NULL,
      "\nBD-rate: the mean difference of log bytes over quality; "
      "where PCHIP and\nAkima differ much, the points are too few.\n" }
};

static void put_curves(json_t *o, const session *s)
{
    json_t *const bd = saga_results_bd(&s->a, &s->b);
    json_t *const rows = json_array();
    const saga_metric_row *m;

    for (int k = 0; (m = saga_metric_at(k)); k++)
        for (int i = 0; i < SAGA_N_SETS; i++) {
            json_t *const set = json_object_get(bd, saga_set_keys[i]);
            json_t *const one = json_object_get(set, m->key);

            if (one)
                saga_put_item(rows,
                              json_pack("{sssssO}", "label", m->label, "set",
                                        saga_set_keys[i], "bd", one));
        }
    saga_put(o, "bd_rate", bd);
    saga_put(o, "/rows", rows);
    saga_put(o, "/n", json_pack("{sisi}", "a", s->a.n, "b", s->b.n));
}

/* --- Together ------------------------------------------------------------ */

static int tell(const session *s, bool json)
{
    const saga_print_style how = { json, 9, s->b.path };
    json_t *const o = saga_cli_json_head("compare", s->b.path);

    saga_put_text(o, "anchor", s->a.path);
    if (s->a.n > 1 || s->b.n > 1) {
        put_curves(o, s);
        return saga_cli_print_report(o, &how, SAGA_LINES(curve_text));
    }
    put_pair(o, s);
    return saga_cli_print_report(o, &how, SAGA_LINES(pair_text));
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

    if (differs)
        return saga_cli_error(SAGA_EXIT_DATA,
                              "compare: the %s of %s and %s "
                              "differ, so that they cannot be compared; "
                              "evaluate both with the same options",
                              differs, s->a.path, s->b.path);
    return tell(s, o->json);
}

static int run_compare(int argc, char **argv)
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
    { "--json", NULL, "print the comparison as JSON", saga_cli_flag,
      offsetof(options, json), 0, 0 }
};

const saga_command saga_command_compare = {
    "compare",
    "A.json B.json",
    2,
    "compares two results of eval, or two curves",
    "Reads two results of `saga eval --json` and prints the difference of\n"
    "each metric. If each file holds several results of one capture at\n"
    "several rates (`saga eval ... --json >>curve.json`), it prints the\n"
    "Bjontegaard delta rate: how many per cent more bytes B takes than A at\n"
    "equal quality. The curves are interpolated by monotone cubics (PCHIP)\n"
    "and by Akima's spline. This needs at least four points on each curve, a\n"
    "quality that grows with the bytes, and an overlap of at least a quarter\n"
    "of the wider range. Results of different frames, cameras or scales are\n"
    "refused.\n",
    option_list,
    (int)(sizeof option_list / sizeof option_list[0]),
    run_compare,
    NULL
};
