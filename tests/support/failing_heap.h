/* SPDX-License-Identifier: MIT
 *
 * A heap whose k-th allocation fails, for every k. This header defines malloc
 * and related functions for the program and all its shared libraries, so that
 * only one file of a program may include it. They call the heap of glibc or of
 * the sanitizer. Allocations of OpenMP's library never fail, because it would
 * end the program.
 *
 * There is only one thread, so that the k-th allocation is always the same.
 */
#ifndef FAILING_HEAP_H
#define FAILING_HEAP_H

#include "error.h"
#include "testing.h"

#include <errno.h>
#include <execinfo.h>
#include <malloc.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#ifdef _OPENMP
#include <omp.h>
#endif

/* --- The heap ------------------------------------------------------------ */

static struct failing_heap {
    uintptr_t openmp[2], libc[2], jpeg[2]; /* code of these libraries */
    long live;                             /* blocks that are not freed */
    long left;          /* allocations until one fails; 0: none does */
    long kept;          /* blocks left by an attempt in which nothing
                         * failed */
    int pipe[2];        /* through which that attempt reports `kept` */
    const void *caller; /* caller of the allocation that failed; NULL: none
                         * failed */
    void *trace[9];     /* its callers */
    int n_trace;
} failing_heap;

void *__libc_malloc(size_t n);
void *__libc_memalign(size_t align, size_t n);
void *__libc_calloc(size_t n, size_t size);
void *__libc_realloc(void *p, size_t n);
void __libc_free(void *p);
#define WEAK __attribute__((weak))
WEAK void *__interceptor_malloc(size_t n);
WEAK void *__interceptor_memalign(size_t align, size_t n);
WEAK void *__interceptor_calloc(size_t n, size_t size);
WEAK void *__interceptor_realloc(void *p, size_t n);
WEAK void __interceptor_free(void *p);
#undef WEAK
/* The loader allocates before ASan can be asked about an address. */
#define EARLY __attribute__((no_sanitize("address")))
#define HEAP(f) (__interceptor_##f ? __interceptor_##f : __libc_##f)

EARLY static inline bool heap_within(const void *at, const uintptr_t range[2])
{
    return (uintptr_t)at >= range[0] && (uintptr_t)at < range[1];
}

/* Returns p and adds n to the number of live blocks if p is not NULL. */
EARLY static inline void *heap_count(void *p, int n)
{
    failing_heap.live += p ? n : 0;
    return p;
}

EARLY static inline bool heap_fails(const void *caller)
{
    struct failing_heap *const h = &failing_heap;

    if (heap_within(caller, h->openmp) || h->left == 0 || --h->left > 0)
        return false;
    h->caller = caller;
    h->n_trace = backtrace(h->trace, 9);
    errno = ENOMEM;
    return true;
}

#define CALLER __builtin_return_address(0)
#define NEW(block) (heap_fails(CALLER) ? NULL : heap_count(block, 1))

EARLY void *malloc(size_t n)
{
    return NEW(HEAP(malloc)(n));
}

EARLY void *calloc(size_t n, size_t size)
{
    return NEW(HEAP(calloc)(n, size));
}

EARLY void *memalign(size_t align, size_t n)
{
    return NEW(HEAP(memalign)(align, n));
}

EARLY void *aligned_alloc(size_t align, size_t n)
{
    return NEW(HEAP(memalign)(align, n));
}

EARLY int posix_memalign(void **p, size_t align, size_t n)
{
    *p = NEW(HEAP(memalign)(align, n));
    return *p ? 0 : ENOMEM;
}

EARLY void *realloc(void *p, size_t n)
{
    if (heap_fails(CALLER))
        return NULL;
    return heap_count(HEAP(realloc)(p, n), p ? 0 : 1);
}

EARLY void free(void *p)
{
    HEAP(free)(heap_count(p, -1));
}

/* Finds the addresses of a library's code. */
static inline void heap_find(uintptr_t range[2], const char *library)
{
    FILE *const maps = fopen("/proc/self/maps", "r");
    char line[512];

    assert_non_null(maps);
    while (fgets(line, sizeof line, maps))
        if (strstr(line, library) && strstr(line, " r-xp "))
            assert_int_equal(
                sscanf(line, "%" SCNxPTR "-%" SCNxPTR, range, range + 1), 2);
    fclose(maps);
}

/* --- Trials -------------------------------------------------------------- */

/* An attempt, which runs in a process of its own. It must free everything,
 * whether it fails or not. If it does not fail it must check its result,
 * because some failures are tolerated: libc can do without the buffer of a
 * file, and libjpeg-turbo takes a smaller block. */
typedef bool heap_attempt(void *user, saga_error *error);

enum { HEAP_FAILED_WELL = 10, HEAP_NEVER_FAILED, HEAP_WRONG };

static inline int heap_complain(long k, const char *what, const char *message)
{
    fprintf(stderr, "allocation %ld: %s: \"%s\"\n", k, what, message);
    backtrace_symbols_fd(failing_heap.trace, failing_heap.n_trace, 2);
    return HEAP_WRONG;
}

/* Runs the attempt with its k-th allocation failing, or none if k = 0. */
static inline int heap_try(long k, heap_attempt *attempt, void *user)
{
    struct failing_heap *const h = &failing_heap;
    saga_error error = { "" };
    long live;
    bool ok;

#ifdef _OPENMP
    /* OpenMP starts anew in a new process. Its first allocations are made here.
     */
    omp_set_num_threads(1);
#pragma omp parallel
    (void)k;
#endif
    live = h->live;
    h->left = k;
    ok = attempt(user, &error);
    h->left = 0;
    if (ok && error.message[0])
        return heap_complain(k, "passes, with a message", error.message);
    if (k == 0 && !ok)
        return heap_complain(k, "fails with all its memory", error.message);
    if (k == 0) {
        h->kept = h->live - live;
        (void)!write(h->pipe[1], &h->kept, sizeof h->kept);
    }
    if (h->live - live > h->kept)
        return heap_complain(k, "leaks", error.message);
    if (ok && !h->caller)
        return HEAP_NEVER_FAILED;
    if (ok)
        return heap_within(h->caller, h->libc) ||
                       heap_within(h->caller, h->jpeg)
                   ? HEAP_FAILED_WELL
                   : heap_complain(k, "goes on", "");
    if (!strstr(error.message, "memory") || !strstr(error.message, "; "))
        return heap_complain(k, "does not say so", error.message);
    return HEAP_FAILED_WELL;
}

static inline int heap_trial(long k, heap_attempt *attempt, void *user)
{
    static const int crashes[] = { SIGSEGV, SIGBUS, SIGFPE, SIGILL };
    int status;
    const pid_t child = fork();

    if (child == 0) {
        /* cmocka's handlers would run the next test in this process. */
        for (int i = 0; i < 4; i++)
            signal(crashes[i], SIG_DFL);
        _exit(heap_try(k, attempt, user));
    }
    if (child < 0 || waitpid(child, &status, 0) != child)
        return HEAP_WRONG;
    if (WIFEXITED(status) && WEXITSTATUS(status) != HEAP_WRONG)
        return WEXITSTATUS(status);
    if (WIFSIGNALED(status))
        fprintf(stderr, "allocation %ld: signal %d\n", k, WTERMSIG(status));
    return HEAP_WRONG;
}

/* Makes every step-th allocation of the attempt fail, one failure for each run.
 * Each failure must give a message about memory with a remedy, without a leak
 * or a crash. Returns the number of allocations. */
static inline long heap_fail_each(heap_attempt *attempt, void *user, int step)
{
    struct failing_heap *const h = &failing_heap;
    int n_wrong = 0, status = 0;
    long k;

    /* The first call of backtrace allocates memory. */
    (void)backtrace(h->trace, 9);
    assert_int_equal(pipe(h->pipe), 0);
    heap_find(h->openmp, "/libgomp");
    heap_find(h->openmp, "/libomp");
    heap_find(h->libc, "/libc.so");
    heap_find(h->jpeg, "/libturbojpeg.so");
    assert_int_equal(heap_trial(0, attempt, user), HEAP_NEVER_FAILED);
    assert_int_equal(read(h->pipe[0], &h->kept, sizeof h->kept),
                     sizeof h->kept);
    for (k = 1; status != HEAP_NEVER_FAILED && n_wrong < 10; k += step) {
        status = heap_trial(k, attempt, user);
        n_wrong += status != HEAP_FAILED_WELL && status != HEAP_NEVER_FAILED;
    }
    close(h->pipe[0]);
    close(h->pipe[1]);
    assert_int_equal(n_wrong, 0);
    return k - step - 1;
}

#endif
