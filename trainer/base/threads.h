/* SPDX-License-Identifier: MIT
 *
 * This tells of threads: which one this is, how many there may be, whether
 * there is room for so many.
 */
#ifndef SAGA_THREADS_H
#define SAGA_THREADS_H

#include "error.h"

#include <stddef.h>

#ifdef _OPENMP
#include <omp.h>
#endif

static inline size_t saga_thread_number(void)
{
#ifdef _OPENMP
    return (size_t)omp_get_thread_num();
#else
    return 0;
#endif
}

static inline size_t saga_n_threads(void)
{
#ifdef _OPENMP
    return (size_t)omp_get_max_threads();
#else
    return 1;
#endif
}

/* Of each thread but the first: what the program asks of OpenMP (main.c). */
#define SAGA_STACK_NBYTES ((size_t)2 << 20)

/* OpenMP ends the program where a thread cannot be started. Starts n threads
 * while nothing is lost by that, or says that there is no memory for them. */
bool saga_threads_reserve(int n, saga_error *error);

#endif
