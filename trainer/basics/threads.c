/* SPDX-License-Identifier: MIT
 *
 * The worker threads form one pool. Each thread of a team has a share of the
 * work's parts and takes parts from its beginning; a thread whose share is
 * empty takes from the ends of the others'. In this way a thread handles the
 * same data in every stage of an iteration, in its own cache, which is many
 * times faster than data that another core has written.
 *
 * The two ends of a share and the number of the work are one atomic value. A
 * thread that succeeds in moving an end has therefore taken a part of that very
 * work. The description of the work is written before the shares and stays
 * valid until all parts are done.
 */
#include "threads.h"

#include "alloc.h"
#include "clock.h"

#include <pthread.h>
#include <sched.h>
#include <stdatomic.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* A thread looks for work for AWAKE_NS nanoseconds before it sleeps, longer
 * than the gap between two pieces of work in an iteration. It reads the clock
 * after every LOOKS looks. Sleeping threads are woken for work of at least
 * WORTH_WAKING times the least work of a thread. */
enum { AWAKE_NS = 50000, LOOKS = 32, WORTH_WAKING = 5 };

/* A share has bits for its end, its beginning and the number of the work. */
enum { MOST_THREADS = 256, END_BITS = 20, MOST_PARTS = (1 << END_BITS) - 1 };

/* --- The pool ------------------------------------------------------------ */

typedef struct {
    _Alignas(64) _Atomic uint64_t left;
} share;

typedef struct {
    atomic_flag busy;      /* set while a caller has the pool */
    _Atomic uint64_t work; /* its number */
    _Atomic(void (*)(void *, size_t)) run;
    _Atomic(void *) user;
    atomic_size_t team; /* number of threads that may take parts */
    atomic_size_t n_regions;
    atomic_int n_asleep;
    _Alignas(64) atomic_size_t done; /* parts done */
    share of[MOST_THREADS];
    size_t n_threads; /* started so far; changed only by the thread
                       * that set `busy` */
    pthread_mutex_t gate;
    pthread_cond_t call;
} thread_pool;

static thread_pool pool = { .busy = ATOMIC_FLAG_INIT,
                            .n_threads = 1,
                            .gate = PTHREAD_MUTEX_INITIALIZER,
                            .call = PTHREAD_COND_INITIALIZER };

/* The index of this thread in the pool, and whether it is working with the
 * thread_pool. */
static _Thread_local size_t number;
static _Thread_local bool is_at_work;

size_t saga_thread_number(void)
{
#ifdef _OPENMP
    if (!is_at_work)
        return (size_t)omp_get_thread_num();
#endif
    return number;
}

static void pause_a_little(void)
{
#if defined __x86_64__ || defined __i386__
    __builtin_ia32_pause();
#endif
}

static uint64_t share_of(uint64_t work, size_t begin, size_t end)
{
    return (work << END_BITS | begin) << END_BITS | end;
}

/* Takes a part of a share and does it. Returns false if none is left. If moving
 * the end succeeds, this work is not finished yet, so run and user are those of
 * this work. */
static bool take(share *from, bool is_own)
{
    uint64_t left = atomic_load(&from->left);

    for (;;) {
        void (*const run)(void *, size_t) = atomic_load(&pool.run);
        void *const user = atomic_load(&pool.user);
        const size_t end = left & MOST_PARTS;
        const size_t begin = left >> END_BITS & MOST_PARTS;

        /* A thread that woke late may be outside the team of this work. */
        if (begin == end || number >= atomic_load(&pool.team))
            return false;
        /* The owner takes from the beginning, others from the end. If another
         * thread was faster, or the work has changed, the exchange fails and
         * reloads `left`. */
        if (atomic_compare_exchange_weak(
                &from->left, &left,
                is_own ? left + ((uint64_t)1 << END_BITS) : left - 1)) {
            run(user, is_own ? begin : end - 1);
            atomic_fetch_add_explicit(&pool.done, 1, memory_order_release);
            return true;
        }
    }
}

/* Runs parts until none is left: first those of the thread's own share, then
 * those of other shares. */
static void help(void)
{
    const size_t team = atomic_load(&pool.team);
    size_t i;

    if (number < team)
        for (i = 0; i < team; i++)
            while (take(&pool.of[(number + i) % team], i == 0))
                ;
}

/* Returns true if the number of the work changes from `last` within
 * AWAKE_NS. */
static bool look_for_work(uint64_t last)
{
    const int64_t until = saga_clock_ns() + AWAKE_NS;

    do
        for (int i = 0; i < LOOKS; i++) {
            if (atomic_load_explicit(&pool.work, memory_order_acquire) != last)
                return true;
            pause_a_little();
        }
    while (saga_clock_ns() < until);
    return false;
}

static void sleep_until_called(uint64_t last)
{
    pthread_mutex_lock(&pool.gate);
    /* The thread counts itself before it checks the work's number. Therefore
     * the announcer either sees a sleeper or has already set the number. */
    atomic_fetch_add(&pool.n_asleep, 1);
    while (atomic_load(&pool.work) == last)
        pthread_cond_wait(&pool.call, &pool.gate);
    atomic_fetch_sub(&pool.n_asleep, 1);
    pthread_mutex_unlock(&pool.gate);
}

static void *serve(void *user)
{
    uint64_t last = 0;

    number = (size_t)(uintptr_t)user;
    is_at_work = true;
    for (;;) {
        if (!look_for_work(last))
            sleep_until_called(last);
        last = atomic_load(&pool.work);
        help();
    }
    return NULL;
}

/* Starts threads until the pool has n. If one cannot be started, the pool stays
 * smaller. */
static void start_threads(size_t n)
{
    pthread_attr_t attr;
    pthread_t thread;

    if (n <= pool.n_threads || pthread_attr_init(&attr) != 0)
        return;
    (void)pthread_attr_setstacksize(&attr, SAGA_STACK_NBYTES);
    (void)pthread_attr_setdetachstate(&attr, PTHREAD_CREATE_DETACHED);
    while (pool.n_threads < n &&
           pthread_create(&thread, &attr, serve,
                          (void *)(uintptr_t)pool.n_threads) == 0)
        pool.n_threads++;
    pthread_attr_destroy(&attr);
}

/* --- Work ---------------------------------------------------------------- */

static size_t least(size_t a, size_t b)
{
    return a < b ? a : b;
}

static atomic_int least_work = SAGA_LEAST_WORK;

void saga_set_least_work(int ns)
{
    atomic_store(&least_work, ns);
}

static double least_ns(void)
{
    return atomic_load_explicit(&least_work, memory_order_relaxed);
}

size_t saga_team(double ns)
{
    const size_t now = least(saga_n_threads(), MOST_THREADS);
    const double each = least_ns();

    return ns >= each * (double)now ? now
           : ns >= 2 * each         ? (size_t)(ns / each)
                                    : 1;
}

size_t saga_n_regions(void)
{
    return atomic_load_explicit(&pool.n_regions, memory_order_relaxed);
}

static void announce(const saga_tasks *t, size_t team)
{
    const uint64_t work = atomic_load(&pool.work) + 1;

    atomic_store(&pool.run, t->run);
    atomic_store(&pool.user, t->user);
    atomic_store(&pool.team, team);
    atomic_store(&pool.done, 0);
    /* Shares are written after the rest of the description, so that a thread
     * that takes a part finds it complete. The number, for which others wait,
     * is written last. */
    for (size_t i = 0; i < team; i++)
        atomic_store(&pool.of[i].left,
                     share_of(work, t->n * i / team, t->n * (i + 1) / team));
    atomic_store(&pool.work, work);
    if (t->ns >= (double)WORTH_WAKING * least_ns() &&
        atomic_load(&pool.n_asleep) > 0) {
        /* With the mutex held, no thread can be between its check of the number
         * and its wait. */
        pthread_mutex_lock(&pool.gate);
        pthread_cond_broadcast(&pool.call);
        pthread_mutex_unlock(&pool.gate);
    }
}

/* Waits for the parts that other threads have begun. These may need this core
 * to run, so after a while it yields. */
static void await(size_t n)
{
    for (int i = 0; atomic_load_explicit(&pool.done, memory_order_acquire) < n;
         i++)
        if (i < 100 * LOOKS)
            pause_a_little();
        else
            sched_yield();
}

static void run_alone(const saga_tasks *t)
{
    for (size_t i = 0; i < t->n; i++)
        t->run(t->user, i);
}

static bool is_nested(void)
{
#ifdef _OPENMP
    if (omp_in_parallel())
        return true;
#endif
    return is_at_work;
}

void saga_parallel(const saga_tasks *t)
{
    size_t team = least(saga_team(t->ns), t->n);

    if (t->most)
        team = least(team, t->most);
    if (!is_at_work)
        atomic_fetch_add_explicit(&pool.n_regions, 1, memory_order_relaxed);
    /* One thread does all the work if more would not pay, inside other work,
     * and while another caller has the pool. */
    if (team < 2 || t->n > MOST_PARTS || is_nested() ||
        atomic_flag_test_and_set(&pool.busy)) {
        run_alone(t);
        return;
    }
    /* The caller is thread 0 of the team. */
    is_at_work = true;
    start_threads(team);
    announce(t, team);
    help();
    await(t->n);
    is_at_work = false;
    atomic_flag_clear(&pool.busy);
}

/* --- Clearing ------------------------------------------------------------ */

/* Approximate bytes cleared in one part, and nanoseconds for a byte. */
enum { PART = 32768, LINE = 64 };
#define CLEAR_NS 0.02

typedef struct {
    const saga_span *span;
    size_t n_spans, n_parts;
} clearing;

/* Clears the same part of every span. */
static void clear_part(void *user, size_t part)
{
    const clearing *const c = user;

    for (size_t i = 0; i < c->n_spans; i++) {
        const saga_span *const s = c->span + i;
        const saga_range of = saga_slice(s->nbytes, LINE, part, c->n_parts);

        if (s->at)
            memset((char *)s->at + of.begin, 0, of.end - of.begin);
    }
}

void saga_clear(const saga_span *spans, size_t n)
{
    size_t nbytes = 0;
    clearing c = { spans, n, 0 };

    for (size_t i = 0; i < n; i++)
        nbytes += spans[i].at ? spans[i].nbytes : 0;
    c.n_parts = saga_n_parts(nbytes, PART);
    saga_parallel(&(saga_tasks){ .run = clear_part,
                                 .user = &c,
                                 .n = c.n_parts,
                                 .ns = CLEAR_NS * (double)nbytes });
}

/* --- Room for threads ---------------------------------------------------- */

/* Threads that all wait until the last has started. */
typedef struct {
    pthread_mutex_t gate; /* held by the thread that starts them */
    pthread_t *thread;
    int n;
} crowd;

static void *wait_at_gate(void *user)
{
    crowd *const c = user;

    pthread_mutex_lock(&c->gate);
    pthread_mutex_unlock(&c->gate);
    return NULL;
}

/* Starts n threads at the same time and ends them. Returns false if one cannot
 * be started. */
static bool try_threads(crowd *c, int n)
{
    pthread_attr_t attr;
    bool ok = pthread_attr_init(&attr) == 0;

    if (!ok)
        return false;
    (void)pthread_attr_setstacksize(&attr, SAGA_STACK_NBYTES);
    /* No thread ends before the last has started, so that all exist at the same
     * time. */
    pthread_mutex_lock(&c->gate);
    while (ok && c->n < n) {
        ok = pthread_create(&c->thread[c->n], &attr, wait_at_gate, c) == 0;
        c->n += ok;
    }
    pthread_mutex_unlock(&c->gate);
    while (c->n > 0)
        pthread_join(c->thread[--c->n], NULL);
    pthread_attr_destroy(&attr);
    return ok;
}

bool saga_threads_reserve(int n, saga_error *error)
{
    crowd c = { .gate = PTHREAD_MUTEX_INITIALIZER };
    char what[32];
    bool ok;

    if (n <= 1)
        return true;
    (void)snprintf(what, sizeof what, "%d threads", n);
    c.thread = saga_alloc((size_t)n, sizeof *c.thread, what, error);
    if (!c.thread)
        return false;
    ok = try_threads(&c, n - 1);
    free(c.thread);
    if (!ok)
        return saga_no_memory((size_t)n * SAGA_STACK_NBYTES, what, error);
        /* Starts OpenMP's own threads before the memory is used for something
         * else. */
#pragma omp parallel num_threads(n)
    {
    }
    if (!atomic_flag_test_and_set(&pool.busy)) {
        start_threads((size_t)n);
        atomic_flag_clear(&pool.busy);
    }
    return true;
}
