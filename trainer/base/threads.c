/* SPDX-License-Identifier: MIT */
#include "threads.h"

#include "alloc.h"

#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>

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
    return true;
}
