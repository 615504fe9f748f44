/* SPDX-License-Identifier: MIT */
#include "page_text.h"

#include "alloc.h"

#include <stdint.h>
#include <string.h>

void saga_page_put(FILE *page, const char *text)
{
    for (const char *c = text; *c; c++)
        if (strchr("<>&\"'", *c))
            fprintf(page, "&#%d;", *c);
        else
            fputc(*c, page);
}

char *saga_page_address(const char *folder, size_t n, const char *name,
                        saga_error *error)
{
    static const char plain[] = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRST"
                                "UVWXYZ0123456789.-_";
    /* The slash and the NUL, and each character of the name at most three. */
    char *const address = saga_alloc(n + 2 + 3 * strlen(name), 1, name, error);
    char *to = address;

    if (!address)
        return NULL;
    to += sprintf(to, "%.*s/", (int)n, folder);
    for (const char *c = name; *c; c++)
        to += strchr(plain, *c) ? sprintf(to, "%c", *c)
                                : sprintf(to, "%%%02X", (uint8_t)*c);
    return address;
}
