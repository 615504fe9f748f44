/* SPDX-License-Identifier: MIT
 *
 * Threads: which one this is, how many there may be, whether there is room for
 * them; and divides work among them.
 *
 * The threads of saga_parallel stay: between two pieces of work they spin for
 * some microseconds and then sleep. Whoever calls works too, and waits only for
 * what others have begun: a thread that is asleep, or that the machine does not
 * run, is not missed. OpenMP's threads all have to arrive at the end of every
 * region, which made two of them slower than one (docs/lab/training-speed.md);
 * it is used where whole pictures are loaded, made or judged.
 */
#ifndef SAGA_THREADS_H
#define SAGA_THREADS_H

#include "error.h"

#include <stddef.h>

#ifdef _OPENMP
#include <omp.h>
#endif

/* Returns how many threads there may be. */
static inline size_t saga_n_threads(void)
{
#ifdef _OPENMP
    return (size_t)omp_get_max_threads();
#else
    return 1;
#endif
}

/* Returns the number of this thread among those that work on something
 * together, below saga_n_threads(). */
size_t saga_thread_number(void);

/* --- Work ---------------------------------------------------------------- */

/* n parts of work are done in any order, each by one thread. */
typedef struct saga_tasks {
    void (*run)(void *user, size_t part);
    void *user;
    size_t n;
    double ns;            /* that one thread takes for all, about: only the
                           * order counts */
    size_t most;          /* threads there is scratch for; 0: for all */
} saga_tasks;

/* Each thread has at least this number of nanoseconds to do, or there are fewer
 * of them: that is several times what it takes to meet. Tests set less, so that
 * small scenes are worked on by all threads too. */
enum { SAGA_LEAST_WORK = 8000 };
void saga_set_least_work(int ns);

/* Does all parts, each thread those of a range of its own as long as there are
 * some: who divides things alike in every stage has them in the same cache. By
 * one thread where that is all that the work feeds, and
 * where several work already. */
void saga_parallel(const saga_tasks *tasks);

/* Returns how many threads work of ns nanoseconds feeds. */
size_t saga_team(double ns);

/* Returns how often saga_parallel was called, however much work there was, but
 * for calls from parts: how often threads may have to wait for each other. */
size_t saga_n_meetings(void);

/* --- Parts --------------------------------------------------------------- */

/* A part of n things, from begin on and before end. */
typedef struct saga_range { size_t begin, end; } saga_range;

/* Counts parts of `size` things. */
static inline size_t saga_n_parts(size_t n, size_t size)
{
    return (n + size - 1) / size;
}

/* Returns part k of them. */
static inline saga_range saga_part(size_t n, size_t size, size_t k)
{
    const size_t begin = k * size;

    return (saga_range){ begin, n - begin < size ? n : begin + size };
}

/* Returns slice k of n: an equal part of n_things, but for multiples of unit.
 * Arrays are divided alike where each has the same number of things of the same
 * owners. */
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
typedef struct saga_span { void *at; size_t nbytes; } saga_span;

/* Sets n spans to zero, by several threads; one at NULL is left out. */
void saga_clear(const saga_span *spans, size_t n);

/* --- Room ---------------------------------------------------------------- */

/* The stack of each thread but the first, as the program asks it of OpenMP
 * (main.c). */
#define SAGA_STACK_NBYTES ((size_t)2 << 20)

/* OpenMP ends the program where a thread cannot be started. Starts n threads
 * while nothing is lost by that, or says that there is no memory for them. */
bool saga_threads_reserve(int n, saga_error *error);

#endif
