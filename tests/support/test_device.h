/* SPDX-License-Identifier: MIT
 *
 * The device on which tests run: number SAGA_TEST_GPU, or the first one. Tests
 * that need one are skipped without it.
 */
#ifndef TEST_DEVICE_H
#define TEST_DEVICE_H

#include "compute.h"
#include "testing.h"

/* Opens the device, and says which one or why there is none. Returns NULL
 * without one. */
static inline saga_gpu *open_test_device(void)
{
    const char *const number = getenv("SAGA_TEST_GPU");
    saga_error none = { "" };
    saga_gpu *const gpu = saga_gpu_open(number ? atoi(number) : 0, &none);

    if (gpu)
        print_message("on %s\n", saga_gpu_is(gpu)->name);
    else
        print_message("skipped: %s\n", none.message);
    return gpu;
}

/* For a test whose state is the device. */
static inline saga_gpu *test_device_of(void **state)
{
    if (!*state)
        skip();
    return *state;
}

static inline int set_up_device(void **state)
{
    *state = open_test_device();
    return 0;
}

static inline int tear_down_device(void **state)
{
    saga_gpu_close(*state);
    return 0;
}

#endif
