/* SPDX-License-Identifier: MIT
 *
 * Divides work among threads. It also tells the number of the present thread,
 * how many there may be, and whether the machine has memory for them.
 *
 * The threads of saga_parallel persist. Between two pieces of work they spin
 * for some microseconds and then sleep. The calling thread works too, and waits
 * only for parts that others have begun, so a thread that sleeps or is not
 * scheduled does not delay it. With OpenMP, all threads must arrive at the end
 * of every region, which made two threads slower than one
 * (docs/lab/README.md); OpenMP is used where whole pictures are loaded,
 * made or judged.
 */
#ifndef SAGA_THREADS_H
#define SAGA_THREADS_H

#include "error.h"

#include <stddef.h>

#ifdef _OPENMP
#include <omp.h>
#endif

/* Returns the largest number of threads. */
static inline size_t saga_n_threads(void)
{
#ifdef _OPENMP
    return (size_t)omp_get_max_threads();
#else
    return 1;
#endif
}

/* Returns the index of this thread among those that work together, below
 * saga_n_threads(). */
size_t saga_thread_number(void);

/* --- Work ---------------------------------------------------------------- */

/* n parts of work, done in any order, each by one thread. */
typedef struct saga_tasks {
    void (*run)(void *user, size_t part);
    void *user;
    size_t n;
    double ns;   /* time of all parts on one thread, about; only its
                  * order of magnitude matters */
    size_t most; /* most threads, because of scratch memory; 0: no
                  * limit */
} saga_tasks;

/* The least work for one thread, in nanoseconds; with less, fewer threads are
 * used. It is several times the cost of starting and waiting. Tests set less,
 * so that small scenes use all threads too. */
enum { SAGA_LEAST_WORK = 8000 };
void saga_set_least_work(int ns);

/* Does all parts and returns. Each thread starts with a range of its own, so
 * that stages which divide their data equally find it in the same cache. One
 * thread does all parts if there is too little work, or if several threads are
 * working already. */
void saga_parallel(const saga_tasks *tasks);

/* Returns the number of threads for work of ns nanoseconds. */
size_t saga_team(double ns);

/* Returns how often saga_parallel was called, except from parts of work. It
 * counts how often threads may have to wait for each other. */
size_t saga_n_regions(void);

/* --- Parts --------------------------------------------------------------- */

/* The elements from index `begin` to index `end` - 1. */
typedef struct saga_range {
    size_t begin, end;
} saga_range;

/* Returns the number of parts into which n elements are divided, `size` in
 * each. */
static inline size_t saga_n_parts(size_t n, size_t size)
{
    return (n + size - 1) / size;
}

/* Returns the elements of part k, if n elements are divided into parts of
 * `size`. */
static inline saga_range saga_part(size_t n, size_t size, size_t k)
{
    const size_t begin = k * size;

    return (saga_range){ begin, n - begin < size ? n : begin + size };
}

/* Returns slice k of n equal slices of n_things, rounded to multiples of unit.
 * Arrays with the same number of things are divided equally. */
static inline saga_range saga_slice(size_t n_things, size_t unit, size_t k,
                                    size_t n)
{
    const size_t units = saga_n_parts(n_things, unit);
    const size_t begin = units * k / n * unit;
    const size_t end = units * (k + 1) / n * unit;

    return (saga_range){ begin < n_things ? begin : n_things,
                         end < n_things ? end : n_things };
}

/* A piece of memory. */
typedef struct saga_span {
    void *at;
    size_t nbytes;
} saga_span;

/* Sets n spans to zero, with several threads. A span at NULL is skipped. */
void saga_clear(const saga_span *spans, size_t n);

/* --- Memory of threads --------------------------------------------------- */

/* The stack of each thread except the first, which the program also requests
 * from OpenMP (main.c). */
#define SAGA_STACK_NBYTES ((size_t)2 << 20)

/* Starts n threads before any work is done, because OpenMP aborts the program
 * if it cannot start one later. Returns false with *error set if there is no
 * memory for them. */
bool saga_threads_reserve(int n, saga_error *error);

#endif
