/* SPDX-License-Identifier: MIT
 *
 * Reads results of `saga eval --json`: a file holds one result, or several that
 * form a curve, one after the other or in a list.
 */
#ifndef SAGA_RESULTS_H
#define SAGA_RESULTS_H

#include "bd.h"
#include "error.h"
#include "score.h"

#include <jansson.h>

typedef struct saga_results {
    const char *path; /* owned by the caller */
    int n;            /* number of results, at least 1 */
    json_t *result[SAGA_BD_MOST_POINTS];
} saga_results;

/* Reads a file. Refuses results that `saga eval` has not written in this
 * schema, and results whose protocols differ. Call saga_results_free even after
 * a failure. */
bool saga_results_load(saga_results *r, const char *path, saga_error *error);
void saga_results_free(saga_results *r);

/* Views are evaluated in sets: "all", "training", "held_out". */
enum { SAGA_N_SETS = 3 };
extern const char *const saga_set_keys[SAGA_N_SETS];

/* Returns a metric, given by its key, for a set of views; for "all", the mean
 * over the views. NaN if it was not measured. */
double saga_result_value(const json_t *result, const char *set,
                         const char *metric);

/* Returns the size of the file in bytes; 0 if the report has none. */
double saga_result_nbytes(const json_t *result);

/* Returns which part of the protocol differs (frames, cameras, scale), or NULL
 * if the numbers can be compared. */
const char *saga_results_differ(const json_t *a, const json_t *b);

/* Compares two curves in all metrics that both have, for all sets: { SET: {
 * METRIC: { ... } } }. */
json_t *saga_results_bd(const saga_results *anchor, const saga_results *test);

#endif
