/* SPDX-License-Identifier: MIT
 *
 * Loops over several threads: every part runs exactly once, on threads with
 * distinct numbers, for any number of threads. Little work runs on one thread,
 * and loops may be nested.
 */
#include <stdatomic.h>

#include "testing.h"
#include "threads.h"

#include <pthread.h>
#include <time.h>

#ifndef _OPENMP
#define omp_set_num_threads(n) (void)(n)
#endif

enum { MANY = 1000, MOST = 16 };

static const int counts[] = { 1, 2, 3, MOST };

static int set_up(void **state)
{
    (void)state;
    saga_set_least_work(0);
    return 0;
}

static int tear_down(void **state)
{
    (void)state;
    saga_set_least_work(SAGA_LEAST_WORK);
    omp_set_num_threads(1);
    return 0;
}

typedef struct {
    atomic_int done[MANY];
    atomic_int at_once[MOST]; /* parts that a thread works on at the same
                               * time */
    atomic_size_t highest;    /* the highest thread number */
} record;

static void note(void *user, size_t part)
{
    record *const r = user;
    const size_t number = saga_thread_number();
    size_t high = atomic_load(&r->highest);

    assert_true(number < MOST);
    assert_int_equal(atomic_fetch_add(&r->at_once[number], 1), 0);
    atomic_fetch_add(&r->done[part], 1);
    while (number > high &&
           !atomic_compare_exchange_weak(&r->highest, &high, number))
        ;
    atomic_fetch_sub(&r->at_once[number], 1);
}

TEST(every_part_should_be_done_once)
{
    static record r;

    for (size_t i = 0; i < sizeof counts / sizeof *counts; i++) {
        omp_set_num_threads(counts[i]);
        for (size_t n = 0; n <= MANY; n = 3 * n + 1) {
            memset(&r, 0, sizeof r);
            saga_parallel(&(saga_tasks){ .run = note, .user = &r, .n = n });
            for (size_t k = 0; k < MANY; k++)
                assert_int_equal(r.done[k], k < n);
            assert_true(r.highest < (size_t)counts[i]);
        }
    }
}

/* Threads that wake up late may find the work of a later call, which must be
 * done exactly once, too. */
TEST(short_work_should_follow_upon_short_work)
{
    static record r;

    omp_set_num_threads(3);
    memset(&r, 0, sizeof r);
    for (size_t i = 0; i < 20000; i++)
        saga_parallel(&(saga_tasks){ .run = note, .user = &r, .n = 1 + i % 7 });
    for (size_t i = 0; i < 7; i++)
        assert_int_equal(r.done[i], 20000 / 7 * (7 - i) +
                                        (i < 20000 % 7 ? 20000 % 7 - i : 0));
}

TEST(numbers_should_stay_below_what_there_is_scratch_for)
{
    static record r;

    omp_set_num_threads(MOST);
    for (int i = 0; i < 100; i++) {
        saga_parallel(
            &(saga_tasks){ .run = note, .user = &r, .n = MANY, .most = 2 });
        assert_true(r.highest < 2);
    }
}

static void note_owner(void *user, size_t part)
{
    for (volatile int i = 0; i < 2000; i++)
        ;
    ((size_t *)user)[part] = saga_thread_number();
}

/* A thread must do the first parts of its own share first, and then the last
 * parts of other shares. */
TEST(threads_should_keep_to_their_shares)
{
    enum { TEAM = 3, EACH = 40 };
    size_t owner[TEAM * EACH];

    omp_set_num_threads(TEAM);
    for (int round = 0; saga_n_threads() == TEAM && round < 300; round++) {
        saga_parallel(&(saga_tasks){
            .run = note_owner, .user = owner, .n = TEAM * EACH, .ns = 1e6 });
        for (size_t i = 0; i < TEAM * EACH; i++)
            if (i % EACH > 0 && owner[i] == i / EACH)
                assert_int_equal(owner[i - 1], i / EACH);
    }
}

static void note_apart(void *user, size_t part)
{
    record *const all = user;

    saga_parallel(&(saga_tasks){ .run = note, .user = all + part, .n = 50 });
}

TEST(work_in_work_should_be_done_by_who_has_it)
{
    static record r[8];
    const size_t before = saga_n_regions();

    omp_set_num_threads(3);
    saga_parallel(&(saga_tasks){ .run = note_apart, .user = r, .n = 8 });
    assert_int_equal(saga_n_regions(), before + 1);
    for (size_t i = 0; i < 8; i++)
        for (size_t k = 0; k < 50; k++)
            assert_int_equal(r[i].done[k], 1);
}

static void note_thread(void *user, size_t part)
{
    (void)part;
    assert_true(pthread_equal(*(pthread_t *)user, pthread_self()));
}

TEST(little_work_should_be_done_by_one)
{
    pthread_t self = pthread_self();

    saga_set_least_work(SAGA_LEAST_WORK);
    omp_set_num_threads(3);
    for (int i = 0; i < 1000; i++)
        saga_parallel(&(saga_tasks){ .run = note_thread,
                                     .user = &self,
                                     .n = 100,
                                     .ns = SAGA_LEAST_WORK });
#ifdef _OPENMP
    assert_int_equal(saga_team(2.5 * SAGA_LEAST_WORK), 2);
    assert_int_equal(saga_team(1e9), 3);
#endif
    saga_set_least_work(0);
}

/* Another thread is slow with a part. The caller must do all other parts itself
 * and wait only for this one. */
static void wait_for_other(void *user, size_t part)
{
    atomic_int *const n = user;
    const struct timespec while_ = { 0, 2000000 };

    (void)part;
    if (saga_thread_number() > 0)
        nanosleep(&while_, NULL);
    atomic_fetch_add(n, 1);
}

TEST(caller_should_wait_until_all_is_done)
{
    omp_set_num_threads(3);
    for (int i = 0; i < 50; i++) {
        atomic_int n = 0;

        saga_parallel(&(saga_tasks){
            .run = wait_for_other, .user = &n, .n = 200, .ns = 1e6 });
        assert_int_equal(n, 200);
    }
}

TEST(spans_should_be_cleared_whole)
{
    static unsigned char a[100001], b[3];
    const saga_span spans[] = {
        { a + 1, sizeof a - 2 }, { NULL, 1000 }, { b, 0 }, { b + 1, 1 }
    };

    omp_set_num_threads(3);
    memset(a, 0xa5, sizeof a);
    memset(b, 0xa5, sizeof b);
    saga_clear(spans, 4);
    assert_int_equal(a[0], 0xa5);
    assert_int_equal(a[sizeof a - 1], 0xa5);
    for (size_t i = 1; i + 1 < sizeof a; i++)
        assert_int_equal(a[i], 0);
    assert_memory_equal(b, "\xa5\0\xa5", 3);
}

TEST_GROUP(set_up, tear_down);
