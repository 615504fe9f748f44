/* SPDX-License-Identifier: MIT
 *
 * Results of `saga eval --json`, read again: a file holds one, or several of a
 * curve, one after the other or in a list.
 */
#ifndef SAGA_RESULTS_H
#define SAGA_RESULTS_H

#include "bd.h"
#include "error.h"
#include "score.h"

#include <jansson.h>

typedef struct saga_results {
    const char *path;        /* the caller's */
    int n;                   /* 1 at least */
    json_t *result[SAGA_BD_MOST_POINTS];
} saga_results;

/* Reads a file. Refused is what `saga eval` of this schema has not written, and
 * what has not one protocol. Free it, also after a failure. */
bool saga_results_load(saga_results *r, const char *path, saga_error *error);
void saga_results_free(saga_results *r);

/* Views are judged in sets: "all", "training", "held_out". */
enum { SAGA_N_SETS = 3 };
extern const char *const saga_set_keys[SAGA_N_SETS];

/* Returns a metric, by its key, of a set of views; of all, the mean over the
 * views; NaN where it was not measured. */
double saga_result_value(const json_t *result, const char *set,
                         const char *metric);

/* Returns the file's bytes; 0 where the report has none. */
double saga_result_nbytes(const json_t *result);

/* Says which part of the protocol differs: frames, cameras, scale; NULL: none
 * that would keep the numbers from being compared. */
const char *saga_results_differ(const json_t *a, const json_t *b);

/* Compares two curves by all metrics that both have, in all sets:
 * { SET: { METRIC: { ... } } }. */
json_t *saga_results_bd(const saga_results *anchor, const saga_results *test);

#endif
