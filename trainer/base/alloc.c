/* SPDX-License-Identifier: MIT */
#include "alloc.h"

#include <stdint.h>
#include <stdlib.h>

void *saga_alloc(size_t count, size_t size)
{
    if (size != 0 && count > SIZE_MAX / size)
        return NULL;
    const size_t nbytes = count * size;
    return malloc(nbytes ? nbytes : 1);
}

void *saga_calloc(size_t count, size_t size)
{
    return calloc(count ? count : 1, size ? size : 1);
}
