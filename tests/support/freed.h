/* SPDX-License-Identifier: MIT
 *
 * Variables that are freed where their block ends, however it is left; but
 * those of a test that fails, which is left by longjmp.
 */
#ifndef FREED_H
#define FREED_H

#include <stdlib.h>
#include <string.h>

/* function: gets a pointer to the variable. */
#define FREED_BY(function) __attribute__((cleanup(function)))
/* A pointer to what malloc gave. */
#define FREED FREED_BY(free_at)

/* at: where the pointer is. */
static inline void free_at(const void *at)
{
    void *p;

    memcpy(&p, at, sizeof p);
    free(p);
}

#endif
