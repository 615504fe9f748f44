/* SPDX-License-Identifier: MIT */
#include "cloud_facts.h"

#include <stdio.h>

/* Why splats are left out; and what is said of splats or of files. */
static const char *const words[SAGA_N_FACTS] = {
    [SAGA_FACT_BROKEN] = "with numbers that are not finite or above a million",
    [SAGA_FACT_ZERO] = "that are rows of zeros",
    [SAGA_FACT_FAINT] = "with opacities below 1/256",
    [SAGA_FACT_SMALL] = "that are less visible than the --primitives kept",
    [SAGA_FACT_UNTURNED] = "rotations of length 0 are read as none",
    [SAGA_FACT_MOVED] = "positions outside the scene's cube are moved to its "
                        "faces",
    [SAGA_FACT_RESIZED] = "scales above a quarter or below a 131,072nd of the "
                          "scene's cube are clamped",
    [SAGA_FACT_LINEAR_SCALE] = "scales are read as lengths; by their size they "
                               "are no logarithms",
    [SAGA_FACT_LOG_SCALE] = "scales are read as logarithms, because some are "
                            "negative",
    [SAGA_FACT_OPACITY] = "opacities are read as they are, because all are in "
                          "0..1, which logits are not",
    [SAGA_FACT_LOGIT] = "opacities are read as logits, because some are not in "
                        "0..1",
    [SAGA_FACT_UNSURE] = "opacities are all in 0..1 and read as logits, which "
                         "makes them 0.50 to 0.73",
    [SAGA_FACT_CODEBOOK] =
        "a list of codes lacks its first number, as in "
        "files of older writers; the list is continued by a step",
    [SAGA_FACT_HARMONICS] = "harmonics of degree 4 are left out",
};

void saga_cloud_facts_add(saga_cloud_facts *sum, const saga_cloud_facts *more)
{
    sum->n += more->n;
    for (int i = 0; i < SAGA_N_FACTS; i++)
        sum->count[i] += more->count[i];
}

/* Writes one line about all splats that are left out. */
static bool note_left_out(char line[SAGA_FACTS_NBYTES],
                          const saga_cloud_facts *facts)
{
    size_t sum = 0;
    int n;

    for (int i = 0; i <= SAGA_FACT_SMALL; i++)
        sum += facts->count[i];
    n = snprintf(line, SAGA_FACTS_NBYTES, "leaves out %zu of %zu splats", sum,
                 facts->n);
    for (int i = 0, any = 0; i <= SAGA_FACT_SMALL; i++)
        if (facts->count[i])
            n += snprintf(line + n, SAGA_FACTS_NBYTES - (size_t)n, "%s %zu %s",
                          any++ ? "," : ":", facts->count[i], words[i]);
    return sum > 0;
}

bool saga_cloud_facts_line(char line[SAGA_FACTS_NBYTES], int *from,
                           const saga_cloud_facts *facts)
{
    /* All kinds of splats that are left out share the first line. */
    if (*from == 0) {
        *from = SAGA_FACT_SMALL + 1;
        if (note_left_out(line, facts))
            return true;
    }
    while (*from < SAGA_N_FACTS && !facts->count[*from])
        ++*from;
    if (*from == SAGA_N_FACTS)
        return false;
    (void)snprintf(line, SAGA_FACTS_NBYTES, "%s (%zu %s%s)", words[*from],
                   facts->count[*from],
                   *from < SAGA_FACT_LINEAR_SCALE ? "splat" : "file",
                   facts->count[*from] == 1 ? "" : "s");
    ++*from;
    return true;
}
