/* SPDX-License-Identifier: MIT
 *
 * A program of tests is a file in which each test begins with TEST(name). There
 * is no list of tests: each registers itself before main, and main, which is in
 * testing_main.c, runs them in the order of the file. This header includes
 * cmocka with everything that it needs, and the headers of C that most tests
 * need.
 */
#ifndef TESTING_H
#define TESTING_H

#include <inttypes.h>
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "error.h"
#include "freed.h"

void testing_add(const char *name, CMUnitTestFunction test,
                 CMFixtureFunction enter, CMFixtureFunction leave);
/* Sets the functions that run before the first test, to set *state, and after
 * the last test. */
void testing_group(CMFixtureFunction enter, CMFixtureFunction leave);
/* Runs all tests; returns the number of failures. */
int testing_run(void);

#define TESTING_BEFORE_MAIN(function) \
    __attribute__((constructor)) static void function(void)

/* Declares a test, whose body follows and can use `state`. */
#define TEST(name) TEST_WITH(name, NULL, NULL)

/* Declares a test with a function that makes its *state and one that frees it.
 */
#define TEST_WITH(name, enter, leave)           \
    static void name(void **state);             \
    TESTING_BEFORE_MAIN(add_##name)             \
    {                                           \
        testing_add(#name, name, enter, leave); \
    }                                           \
    static void name(void **state __attribute__((unused)))

/* Declares a test like TEST_WITH, whose body gets its *state as `type *f`. */
#define TEST_OF_WITH(type, name, enter, leave) \
    static void name##_of(type *f);            \
    TEST_WITH(name, enter, leave)              \
    {                                          \
        name##_of(*state);                     \
    }                                          \
    static void name##_of(type *f __attribute__((unused)))
#define TEST_OF(type, name) TEST_OF_WITH(type, name, NULL, NULL)

/* Declares a fixture for all tests of the program. */
#define TEST_GROUP(enter, leave)     \
    TESTING_BEFORE_MAIN(add_group)   \
    {                                \
        testing_group(enter, leave); \
    }                                \
    struct testing_needs_a_semicolon

/* Returns the number in SAGA_TEST_SEED, or `otherwise` if it is not set. */
uint64_t testing_seed(uint64_t otherwise);
/* Returns the number in SAGA_TEST_COUNT; if it is not set, `few`, or with
 * SAGA_TEST_LONG `many`, of which sanitized programs make an eighth. */
uint32_t testing_count(uint32_t few, uint32_t many);
bool testing_long(void);
/* Returns whether SAGA_TEST_SANITIZED is set; then tests of numerical results
 * are skipped. */
bool testing_sanitized(void);

/* Checks that a call of the decoder returns SAGA_OK. */
#define assert_ok(call) assert_int_equal(call, SAGA_OK)
/* Checks that a call with the argument `&error` succeeds; prints its message if
 * not. */
#define assert_done(call)                             \
    do {                                              \
        saga_error error = { "" };                    \
        if (!(call))                                  \
            fail_msg("%s: %s", #call, error.message); \
    } while (0)

/* Checks that a number is within some distance of another. */
#define assert_near(value, wanted, within) \
    testing_near(value, wanted, within, __FILE__, __LINE__)
void testing_near(double value, double wanted, double within, const char *file,
                  int line);

/* Returns p; fails the test if it is NULL. */
void *must(void *p);
/* Returns n zeroed elements of `size` bytes; at least one byte. */
void *zeroed(size_t n, size_t size);
/* Returns a copy of exact size, so that sanitizers see every read past its end.
 */
void *copy_of(const void *p, size_t n);

#endif
