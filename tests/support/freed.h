/* SPDX-License-Identifier: MIT
 *
 * Variables that are freed when their block is left in any way, except by a
 * failing test, which uses longjmp.
 */
#ifndef FREED_H
#define FREED_H

#include <stdlib.h>
#include <string.h>

/* The function gets a pointer to the variable. */
#define FREED_BY(function) __attribute__((cleanup(function)))
/* The variable is a pointer to memory from malloc. */
#define FREED FREED_BY(free_at)

/* Frees the memory to which the pointer at `at` points. */
static inline void free_at(const void *at)
{
    void *p;

    memcpy(&p, at, sizeof p);
    free(p);
}

#endif
