/* SPDX-License-Identifier: MIT
 *
 * There is one crew. Its work is a count of parts that are left, together with
 * the number of the work, in one atomic value: whoever takes a part counts it
 * down, and has taken it of that very work. What the parts are is written
 * before the count and stays until all are done.
 */
#include "threads.h"

#include "alloc.h"

#include <pthread.h>
#include <sched.h>
#include <stdatomic.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

/* Nanoseconds that a thread looks for work before it sleeps: longer than what
 * is between two pieces of an iteration. Looks between two at the clock. Work
 * of so many nanoseconds wakes those that sleep. */
enum { AWAKE_NS = 50000, LOOKS = 32, WAKE_NS = 40000 };

enum { MOST_THREADS = 1024 };

/* --- The crew ------------------------------------------------------------ */

typedef struct {
    atomic_flag busy;            /* somebody's work is done */
    _Atomic uint64_t left;       /* parts; above 32 bits, the work's number */
    _Alignas(64) atomic_size_t done; /* parts */
    _Atomic(void (*)(void *, size_t)) run;
    _Atomic(void *) user;
    atomic_size_t n, team;       /* parts; threads that may take some */
    atomic_size_t n_meetings;
    atomic_int n_asleep;
    size_t n_threads;            /* started, by whoever has `busy` */
    pthread_mutex_t gate;
    pthread_cond_t work;
} crew;

static crew all = { .busy = ATOMIC_FLAG_INIT, .n_threads = 1,
                    .gate = PTHREAD_MUTEX_INITIALIZER,
                    .work = PTHREAD_COND_INITIALIZER };

/* A thread's number among those of the crew, and whether it works with them. */
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

static int64_t now_ns(void)
{
    struct timespec t;

    clock_gettime(CLOCK_MONOTONIC, &t);
    return (int64_t)t.tv_sec * 1000000000 + t.tv_nsec;
}

static uint32_t n_left(void)
{
    return (uint32_t)atomic_load_explicit(&all.left, memory_order_acquire);
}

/* Does parts until none is left. Where the count could be taken down the work
 * is not done, so what was read of it before is of this work. */
static void help(void)
{
    uint64_t left = atomic_load_explicit(&all.left, memory_order_acquire);

    while ((uint32_t)left > 0) {
        void (*const run)(void *, size_t) = atomic_load(&all.run);
        void *const user = atomic_load(&all.user);
        const size_t part = atomic_load(&all.n) - (uint32_t)left;

        if (number >= atomic_load(&all.team)) {
            pause_a_little();
            return;
        }
        if (!atomic_compare_exchange_weak(&all.left, &left, left - 1))
            continue;
        run(user, part);
        atomic_fetch_add_explicit(&all.done, 1, memory_order_release);
        left = atomic_load_explicit(&all.left, memory_order_acquire);
    }
}

/* Returns whether there was work before AWAKE_NS were over. */
static bool look_for_work(void)
{
    const int64_t until = now_ns() + AWAKE_NS;

    do
        for (int i = 0; i < LOOKS; i++) {
            if (n_left() > 0)
                return true;
            pause_a_little();
        }
    while (now_ns() < until);
    return false;
}

static void sleep_until_called(void)
{
    pthread_mutex_lock(&all.gate);
    atomic_fetch_add(&all.n_asleep, 1);
    while ((uint32_t)atomic_load(&all.left) == 0)
        pthread_cond_wait(&all.work, &all.gate);
    atomic_fetch_sub(&all.n_asleep, 1);
    pthread_mutex_unlock(&all.gate);
}

static void *serve(void *user)
{
    number = (size_t)(uintptr_t)user;
    is_at_work = true;
    for (;;) {
        if (!look_for_work())
            sleep_until_called();
        help();
    }
    return NULL;
}

/* Starts what is missing of n threads; does with fewer where there is no room
 * for more. */
static void enlist(size_t n)
{
    pthread_attr_t attr;
    pthread_t thread;

    if (n <= all.n_threads || pthread_attr_init(&attr) != 0)
        return;
    (void)pthread_attr_setstacksize(&attr, SAGA_STACK_NBYTES);
    (void)pthread_attr_setdetachstate(&attr, PTHREAD_CREATE_DETACHED);
    while (all.n_threads < n && pthread_create(
               &thread, &attr, serve, (void *)(uintptr_t)all.n_threads) == 0)
        all.n_threads++;
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

size_t saga_team(double ns)
{
    const size_t now = least(saga_n_threads(), MOST_THREADS);
    const double each = atomic_load_explicit(&least_work,
                                             memory_order_relaxed);

    return ns >= each * (double)now ? now
         : ns >= 2 * each ? (size_t)(ns / each) : 1;
}

size_t saga_n_meetings(void)
{
    return atomic_load_explicit(&all.n_meetings, memory_order_relaxed);
}

/* Publishes the work; the number of the last one goes on. */
static void announce(const saga_tasks *t, size_t team)
{
    const uint64_t last = atomic_load(&all.left) >> 32;

    atomic_store(&all.run, t->run);
    atomic_store(&all.user, t->user);
    atomic_store(&all.n, t->n);
    atomic_store(&all.team, team);
    atomic_store(&all.done, 0);
    atomic_store(&all.left, (last + 1) << 32 | t->n);
    if (t->ns >= WAKE_NS && atomic_load(&all.n_asleep) > 0) {
        pthread_mutex_lock(&all.gate);
        pthread_cond_broadcast(&all.work);
        pthread_mutex_unlock(&all.gate);
    }
}

/* Waits for the parts that others have begun. These may not be running: after a
 * while the core is theirs. */
static void await(size_t n)
{
    for (int i = 0; atomic_load_explicit(&all.done, memory_order_acquire) < n;
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
        atomic_fetch_add_explicit(&all.n_meetings, 1, memory_order_relaxed);
    if (team < 2 || t->n > UINT32_MAX || is_nested() ||
        atomic_flag_test_and_set(&all.busy)) {
        run_alone(t);
        return;
    }
    is_at_work = true;
    enlist(team);
    announce(t, team);
    help();
    await(t->n);
    is_at_work = false;
    atomic_flag_clear(&all.busy);
}

/* --- Clearing ------------------------------------------------------------ */

/* Bytes that are cleared at a time; nanoseconds that a thread takes for all of
 * them. */
enum { PART = 32768, CLEAR_NS = 600 };

typedef struct { const saga_span *span; } clearing;

static size_t n_parts(const saga_span *s)
{
    return s->at ? saga_n_parts(s->nbytes, PART) : 0;
}

static void clear_part(void *user, size_t nth)
{
    const saga_span *s = ((const clearing *)user)->span;
    saga_range of;

    for (; nth >= n_parts(s); s++)
        nth -= n_parts(s);
    of = saga_part(s->nbytes, PART, nth);
    memset((char *)s->at + of.begin, 0, of.end - of.begin);
}

void saga_clear(const saga_span *spans, size_t n)
{
    clearing c = { spans };
    saga_tasks t = { .run = clear_part, .user = &c };

    for (size_t i = 0; i < n; i++)
        t.n += n_parts(spans + i);
    t.ns = (double)CLEAR_NS * (double)t.n;
    saga_parallel(&t);
}

/* --- Room for threads ---------------------------------------------------- */

/* These threads wait until all of them are there. */
typedef struct {
    pthread_mutex_t gate;        /* held by whoever starts them */
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

/* Starts n threads at once and ends them; false where there is no room. */
static bool try_threads(crowd *c, int n)
{
    pthread_attr_t attr;
    bool ok = pthread_attr_init(&attr) == 0;

    if (!ok)
        return false;
    (void)pthread_attr_setstacksize(&attr, SAGA_STACK_NBYTES);
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
    /* OpenMP's own, before the memory is used for something else. */
#pragma omp parallel num_threads(n)
    {
    }
    if (!atomic_flag_test_and_set(&all.busy)) {
        enlist((size_t)n);
        atomic_flag_clear(&all.busy);
    }
    return true;
}
