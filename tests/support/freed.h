/* SPDX-License-Identifier: MIT
 *
 * Variables that are freed when their block is left in any way, except by a
 * failing test, which uses longjmp.
 */
#ifndef FREED_H
#define FREED_H

#include <stdlib.h>
#include <string.h>

/* Declares that function(pointer to the variable) is called when its block is
 * left. */
#define FREED_BY(function) __attribute__((cleanup(function)))
/* Declares that the variable points to memory from malloc, which is freed. */
#define FREED FREED_BY(free_at)

/* Frees the memory to which the pointer at `at` points. */
static inline void free_at(const void *at)
{
    void *p;

    memcpy(&p, at, sizeof p);
    free(p);
}

#endif
