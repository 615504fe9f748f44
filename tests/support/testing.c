/* SPDX-License-Identifier: MIT
 *
 * See testing.h.
 */
#include "testing.h"

enum { MOST = 128 };

/* Entries that are not used have no function. */
static struct CMUnitTest tests[MOST];
static size_t n_tests;
static CMFixtureFunction group_enter, group_leave;

void testing_add(const char *name, CMUnitTestFunction test,
                 CMFixtureFunction enter, CMFixtureFunction leave)
{
    if (n_tests == MOST)
        abort();
    tests[n_tests++] = (struct CMUnitTest){ name, test, enter, leave, NULL };
}

void testing_group(CMFixtureFunction enter, CMFixtureFunction leave)
{
    group_enter = enter;
    group_leave = leave;
}

int testing_run(void)
{
    return cmocka_run_group_tests(tests, group_enter, group_leave);
}

uint64_t testing_seed(uint64_t otherwise)
{
    const char *const s = getenv("SAGA_TEST_SEED");

    return s ? strtoull(s, NULL, 0) : otherwise;
}

uint32_t testing_count(uint32_t few, uint32_t many)
{
    const char *const s = getenv("SAGA_TEST_COUNT");

    if (s)
        return (uint32_t)strtoul(s, NULL, 0);
    if (!testing_long())
        return few;
    /* Sanitized programs take three times as long. */
    if (testing_sanitized())
        many /= 8;
    return many > few ? many : few;
}

bool testing_long(void)
{
    return getenv("SAGA_TEST_LONG") != NULL;
}

bool testing_sanitized(void)
{
    return getenv("SAGA_TEST_SANITIZED") != NULL;
}

void testing_near(double value, double wanted, double within, const char *file,
                  int line)
{
    if (fabs(value - wanted) <= within)
        return;
    print_error("%.17g is not within %g of %.17g\n", value, within, wanted);
    _fail(file, line);
}

void *must(void *p)
{
    assert_non_null(p);
    return p;
}

void *zeroed(size_t n, size_t size)
{
    return must(calloc(n ? n : 1, size));
}

void *copy_of(const void *p, size_t n)
{
    uint8_t *const copy = must(malloc(n ? n : 1));

    if (n > 0)
        memcpy(copy, p, n);
    return copy;
}
