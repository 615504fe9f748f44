/* SPDX-License-Identifier: MIT
 *
 * Scratch memory of each thread: which one this is, and how many there may be.
 */
#ifndef SAGA_THREADS_H
#define SAGA_THREADS_H

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

#endif
