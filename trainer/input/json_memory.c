/* SPDX-License-Identifier: MIT */
#include "json_memory.h"

#include <jansson.h>
#include <stdlib.h>

static _Thread_local bool starved; /* jansson passes us no context */

static void *allocate(size_t nbytes)
{
    void *const p = malloc(nbytes);
    starved |= !p;
    return p;
}

void saga_json_watch(void)
{
    starved = false;
    json_set_alloc_funcs(allocate, free);
}

bool saga_json_starved(void)
{
    return starved;
}
