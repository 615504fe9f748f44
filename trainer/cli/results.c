/* SPDX-License-Identifier: MIT */
#include "results.h"

#include "alloc.h"
#include "file.h"
#include "json_cli.h"
#include "json_memory.h"

#include <math.h>
#include <string.h>

const char *const saga_set_keys[SAGA_N_SETS] = { "all", "training",
                                                 "held_out" };

void saga_results_free(saga_results *r)
{
    for (int i = 0; i < r->n; i++)
        json_decref(r->result[i]);
    r->n = 0;
}

/* --- Loading ------------------------------------------------------------- */

static bool is_result(const json_t *o)
{
    const char *const command = json_string_value(
        json_object_get(o, "command"));

    return json_integer_value(json_object_get(o, "schema")) ==
               SAGA_JSON_SCHEMA &&
           command && !strcmp(command, "eval") &&
           json_array_size(json_object_get(o, "views")) > 0 &&
           json_is_object(json_object_get(o, "protocol"));
}

static bool add(saga_results *r, json_t *o, saga_error *error)
{
    const char *differs;

    if (!is_result(o))
        return saga_fail(error, r->path,
                         "give results of `saga eval --json` "
                         "of this version",
                         "holds something else than results "
                         "of schema %d",
                         SAGA_JSON_SCHEMA);
    differs = r->n ? saga_results_differ(r->result[0], o) : NULL;
    if (differs)
        return saga_fail(error, r->path, "use results of one protocol",
                         "holds results whose %s differ", differs);
    if (r->n == SAGA_BD_MOST_POINTS)
        return saga_fail(error, r->path, "split it",
                         "holds more than %d "
                         "results",
                         SAGA_BD_MOST_POINTS);
    r->result[r->n++] = json_incref(o);
    return true;
}

/* Adds one value from the file: a result or a list of results. */
static bool add_value(saga_results *r, json_t *value, saga_error *error)
{
    if (!json_is_array(value))
        return add(r, value, error);
    for (size_t i = 0; i < json_array_size(value); i++)
        if (!add(r, json_array_get(value, i), error))
            return false;
    return true;
}

static size_t skip_blanks(const char *text)
{
    return strspn(text, " \t\r\n");
}

bool saga_results_load(saga_results *r, const char *path, saga_error *error)
{
    saga_bytes bytes;
    bool ok;
    size_t at;

    *r = (saga_results){ .path = path };
    if (!saga_read_text(&bytes, path, error))
        return false;
    ok = true;
    at = skip_blanks((const char *)bytes.data);
    saga_json_watch();
    /* Values may follow each other without a comma, as `>>curve.json` writes
     * them; jansson reports where each ends. */
    while (ok && at < bytes.nbytes) {
        const char *const text = (const char *)bytes.data + at;
        json_error_t why;
        json_t *const o = json_loadb(text, bytes.nbytes - at,
                                     JSON_DISABLE_EOF_CHECK, &why);

        if (saga_json_starved())
            ok = saga_no_memory(bytes.nbytes, path, error);
        else if (!o)
            ok = saga_fail(error, path, "give results of `saga eval --json`",
                           "is not JSON: %s", why.text);
        else
            ok = add_value(r, o, error);
        /* add() keeps a reference of its own. */
        json_decref(o);
        at += o ? (size_t)why.position : 0;
        at += skip_blanks((const char *)bytes.data + at);
    }
    saga_bytes_free(&bytes);
    return ok && (r->n || saga_fail(error, path,
                                    "give results of `saga eval "
                                    "--json`",
                                    "holds no results"));
}

/* --- What they say ------------------------------------------------------- */

static double number(const json_t *o, const char *key)
{
    const json_t *const v = json_object_get(o, key);

    return json_is_number(v) ? json_number_value(v) : (double)NAN;
}

double saga_result_value(const json_t *result, const char *set,
                         const char *metric)
{
    const json_t *const views = json_object_get(result, "views");
    const size_t n = json_array_size(views);
    double sum = 0.0;

    if (strcmp(set, "all") != 0)
        return number(json_object_get(result, set), metric);
    /* If a view has no number, the mean is NaN, so that no mean is over fewer
     * views. */
    for (size_t i = 0; i < n; i++)
        sum += number(json_array_get(views, i), metric);
    return sum / (double)n;
}

double saga_result_nbytes(const json_t *result)
{
    return json_number_value(json_object_get(result, "nbytes"));
}

const char *saga_results_differ(const json_t *a, const json_t *b)
{
    static const char *const keys[] = { "frames", "cameras", "scale" };
    const json_t *const pa = json_object_get(a, "protocol");
    const json_t *const pb = json_object_get(b, "protocol");

    for (size_t i = 0; i < sizeof keys / sizeof keys[0]; i++)
        if (!json_equal(json_object_get(pa, keys[i]),
                        json_object_get(pb, keys[i])))
            return keys[i];
    return NULL;
}

static void fill(saga_bd_curve *curve, const saga_results *r, const char *set,
                 const saga_metric_row *metric)
{
    curve->n = r->n;
    /* BD-rate needs a metric for which more is better, so LPIPS changes its
     * sign. */
    for (int i = 0; i < r->n; i++)
        curve->point[i] = (saga_bd_point){
            saga_result_nbytes(r->result[i]),
            metric->better * saga_result_value(r->result[i], set, metric->key)
        };
}

/* Returns the BD-rate of two curves for a metric, or NULL if one of them lacks
 * the metric. */
static json_t *bd_of(const saga_results *anchor, const saga_results *test,
                     const char *set, const saga_metric_row *metric)
{
    const double sign = metric->better;
    saga_bd_curve a, t;
    saga_bd bd;

    fill(&a, anchor, set, metric);
    fill(&t, test, set, metric);
    if (!isfinite(a.point[0].quality) || !isfinite(t.point[0].quality))
        return NULL;
    bd = saga_bd_rate(&a, &t);
    return bd.refused ? json_pack("{ss}", "refused", bd.refused)
                      : json_pack("{sfsfsfs[ff]}", "pchip", bd.pchip, "akima",
                                  bd.akima, "overlap", bd.overlap, "range",
                                  sign * bd.lo, sign * bd.hi);
}

json_t *saga_results_bd(const saga_results *anchor, const saga_results *test)
{
    json_t *const o = json_object();
    const saga_metric_row *metric;

    for (int i = 0; i < SAGA_N_SETS; i++) {
        json_t *const set = json_object();

        for (int m = 0; (metric = saga_metric_at(m)); m++) {
            json_t *const bd = metric->compared
                                   ? bd_of(anchor, test, saga_set_keys[i],
                                           metric)
                                   : NULL;

            if (bd)
                saga_json_set_value(set, metric->key, bd);
        }
        saga_json_set_value(o, saga_set_keys[i], set);
    }
    return o;
}
