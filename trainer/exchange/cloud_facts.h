/* SPDX-License-Identifier: MIT
 *
 * What a reader of splats has left out, changed, or read otherwise than the
 * format says. Readers count, and the command prints a line for each kind.
 */
#ifndef SAGA_CLOUD_FACTS_H
#define SAGA_CLOUD_FACTS_H

#include <stdbool.h>
#include <stddef.h>

typedef enum saga_cloud_fact {
    /* Splats that are left out. */
    SAGA_FACT_BROKEN,
    SAGA_FACT_ZERO,
    SAGA_FACT_FAINT,
    SAGA_FACT_SMALL,
    /* Splats that are changed. */
    SAGA_FACT_UNTURNED,
    SAGA_FACT_MOVED,
    SAGA_FACT_RESIZED,
    /* Files that are read in a way of their own. */
    SAGA_FACT_LINEAR_SCALE,
    SAGA_FACT_LOG_SCALE,
    SAGA_FACT_OPACITY,
    SAGA_FACT_LOGIT,
    SAGA_FACT_UNSURE,
    SAGA_FACT_CODEBOOK,
    SAGA_FACT_HARMONICS,
    SAGA_N_FACTS
} saga_cloud_fact;

typedef struct saga_cloud_facts {
    size_t n; /* number of splats in the files */
    size_t count[SAGA_N_FACTS];
} saga_cloud_facts;

void saga_cloud_facts_add(saga_cloud_facts *sum, const saga_cloud_facts *more);

/* Writes the next line about the facts, without a file's name. `from` starts as
 * 0 and is advanced. Returns false if no line is left. */
enum { SAGA_FACTS_NBYTES = 320 };
bool saga_cloud_facts_line(char line[SAGA_FACTS_NBYTES], int *from,
                           const saga_cloud_facts *facts);

#endif
