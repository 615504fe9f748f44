/* SPDX-License-Identifier: MIT */
#include "numbered.h"

#include "alloc.h"

#include <stdio.h>
#include <string.h>

/* Returns the %d in a name and sets *n to its length; NULL if there is none or
 * another %. */
static const char *find_number(const char *name, int *width, size_t *n)
{
    const char *const at = strchr(name, '%');
    const char *p = at ? at + 1 : NULL;

    *width = 0;
    while (p && *p >= '0' && *p <= '9' && *width < 10)
        *width = 10 * *width + (*p++ - '0');
    if (!p || *p != 'd' || *width > 20 || strchr(p, '%'))
        return NULL;
    *n = (size_t)(p + 1 - at);
    return at;
}

bool saga_is_numbered(const char *name)
{
    size_t n;
    int width;

    return find_number(name, &width, &n) != NULL;
}

char *saga_numbered_name(const char *name, int number, saga_error *error)
{
    const size_t room = strlen(name) + 32;
    char *const to = saga_alloc(room, 1, name, error);
    size_t n;
    int width;
    const char *const at = find_number(name, &width, &n);

    if (to && at)
        snprintf(to, room, "%.*s%0*d%s", (int)(at - name), name, width, number,
                 at + n);
    else if (to)
        snprintf(to, room, "%s", name);
    return to;
}
