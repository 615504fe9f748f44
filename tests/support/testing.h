/* SPDX-License-Identifier: MIT
 *
 * A program of tests is a file in which each test begins with TEST(name). There
 * is no list of them: each tells of itself before main, which testing_main.c
 * has and which runs them in the order of the file. Brings cmocka with what it
 * wants, and the headers of C that most tests need.
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
/* Set what runs before the first test, whose *state it sets, and after the
 * last. */
void testing_group(CMFixtureFunction enter, CMFixtureFunction leave);
/* Runs them all; returns the number of failures. */
int testing_run(void);

#define TESTING_BEFORE_MAIN(function) \
    __attribute__((constructor)) static void function(void)

/* A test; its body follows, which sees `state`. */
#define TEST(name) TEST_WITH(name, NULL, NULL)

/* The same, between a function that makes its *state and one that frees it. */
#define TEST_WITH(name, enter, leave) \
    static void name(void **state); \
    TESTING_BEFORE_MAIN(add_##name) \
    { \
        testing_add(#name, name, enter, leave); \
    } \
    static void name(void **state __attribute__((unused)))

/* The same, whose *state is seen as `type *f`. */
#define TEST_OF_WITH(type, name, enter, leave) \
    static void name##_of(type *f); \
    TEST_WITH(name, enter, leave) \
    { \
        name##_of(*state); \
    } \
    static void name##_of(type *f __attribute__((unused)))
#define TEST_OF(type, name) TEST_OF_WITH(type, name, NULL, NULL)

/* One fixture for all tests of the program. */
#define TEST_GROUP(enter, leave) \
    TESTING_BEFORE_MAIN(add_group) \
    { \
        testing_group(enter, leave); \
    } \
    struct testing_needs_a_semicolon

/* The number in SAGA_TEST_SEED, or else this one. */
uint64_t testing_seed(uint64_t otherwise);
/* The number in SAGA_TEST_COUNT, or else `many` with SAGA_TEST_LONG and `few`
 * without. */
uint32_t testing_count(uint32_t few, uint32_t many);
bool testing_long(void);
/* With SAGA_TEST_SANITIZED, what is about numbers is left out. */
bool testing_sanitized(void);

/* A call of the decoder. */
#define assert_ok(call) assert_int_equal(call, SAGA_OK)
/* A call that gets `&error`, of which the test then tells. */
#define assert_done(call) \
    do { \
        saga_error error = { "" }; \
        if (!(call)) \
            fail_msg("%s: %s", #call, error.message); \
    } while (0)

/* p, which fails the test if it is NULL. */
void *must(void *p);
/* n zeroed bytes, at least one. */
void *zeroed(size_t n, size_t size);
/* An exact-size copy, so that the sanitizers see every read past its end. */
void *copy_of(const void *p, size_t n);

#endif
