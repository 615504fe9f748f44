/* SPDX-License-Identifier: MIT
 *
 * Devices, buffers and lists of commands (compute.h), by sums that the host
 * makes as well; and what the kernels' SPIR-V asks of a device. SAGA_TEST_GPU
 * is the number of the device; the first one is the default. Without a device
 * the tests that need one are skipped.
 */
#include "compute.h"
#include "test_device.h"

enum { MOST = 40000, BLOCK = 1024 };

TEST_GROUP(set_up_device, tear_down_device);

/* --- SPIR-V -------------------------------------------------------------- */

enum {
    MAGIC = 0x07230203,
    OP_CAPABILITY = 17,
    OP_DECORATE = 71,
    CAPABILITY_SHADER = 1,
    DECORATION_BINDING = 33,
    DECORATION_SET = 34
};

TEST(kernels_should_ask_for_their_buffers_and_plain_shaders_only)
{
    for (int k = 0; k < SAGA_N_KERNELS; k++) {
        const saga_gpu_kernel *const from = &saga_gpu_kernels[k];
        const uint32_t *const code = from->code;
        const size_t n = from->nbytes / sizeof *code;
        uint32_t most = 0;

        assert_int_equal(code[0], MAGIC);
        /* The high half of an instruction's first word is its length. */
        for (size_t i = 5; i < n; i += code[i] >> 16) {
            const uint32_t op = code[i] & 0xffff;

            assert_true(code[i] >> 16 > 0);
            if (op == OP_CAPABILITY)
                assert_int_equal(code[i + 1], CAPABILITY_SHADER);
            if (op == OP_DECORATE && code[i + 2] == DECORATION_SET)
                assert_int_equal(code[i + 3], 0);
            if (op == OP_DECORATE && code[i + 2] == DECORATION_BINDING &&
                code[i + 3] > most)
                most = code[i + 3];
        }
        if ((int)most + 1 != from->n_buffers)
            fail_msg("%s: %u buffers rather than %d", from->name, most + 1,
                     from->n_buffers);
        assert_true(from->n_buffers <= SAGA_GPU_MOST_BUFFERS);
    }
}

/* --- Devices ------------------------------------------------------------- */

TEST(a_device_that_is_not_there_should_be_refused)
{
    const int absent[] = { -1, 99 };
    saga_gpu_info one;
    saga_error e = { "" };

    test_device_of(state);
    assert_true(saga_gpu_list(&one, 1, &e) >= 1);
    assert_true(one.version[0] == 1 && one.version[1] >= 1);
    for (size_t i = 0; i < 2; i++) {
        assert_null(saga_gpu_open(absent[i], &e));
        assert_non_null(strstr(e.message, "there is no device"));
        assert_non_null(strstr(e.message, "saga devices"));
    }
}

TEST(two_devices_should_work_at_once)
{
    saga_gpu *const g = test_device_of(state), *other;
    saga_gpu_buffer a, b;

    (void)g;
    assert_done((other = saga_gpu_open(0, &error)) != NULL);
    assert_done(saga_gpu_alloc(&b, other, 64, SAGA_GPU_DOWN, "b", &error));
    assert_done(saga_gpu_alloc(&a, g, 64, SAGA_GPU_DOWN, "a", &error));
    saga_gpu_begin(other);
    saga_gpu_begin(g);
    saga_gpu_fill(g, &a, 0, 64, 1);
    saga_gpu_fill(other, &b, 0, 64, 2);
    assert_done(saga_gpu_finish(g, &error));
    assert_done(saga_gpu_finish(other, &error));
    assert_int_equal(((uint32_t *)a.map)[15], 1);
    assert_int_equal(((uint32_t *)b.map)[15], 2);
    saga_gpu_free(&b, other);
    saga_gpu_close(other);
    saga_gpu_free(&a, g);
}

/* --- Buffers ------------------------------------------------------------- */

TEST(copies_and_fills_should_come_in_their_order)
{
    enum { N = 1000 };
    saga_gpu *const g = test_device_of(state);
    saga_gpu_buffer up, on, down;
    uint32_t want[N];

    assert_done(
        saga_gpu_alloc(&up, g, sizeof want, SAGA_GPU_UP, "a", &error) &&
        saga_gpu_alloc(&on, g, sizeof want, SAGA_GPU_LOCAL, "b", &error) &&
        saga_gpu_alloc(&down, g, sizeof want, SAGA_GPU_DOWN, "c", &error));
    assert_non_null(up.map);
    assert_non_null(down.map);
    assert_null(on.map);
    for (uint32_t i = 0; i < N; i++) {
        ((uint32_t *)up.map)[i] = i * 2654435761u;
        /* 7 words are filled after the copy; the copy back is moved by 3. */
        want[i] = i < 3                       ? 5
                  : i - 3 >= 10 && i - 3 < 17 ? 9
                                              : (i - 3) * 2654435761u;
    }
    saga_gpu_begin(g);
    saga_gpu_fill(g, &down, 0, sizeof want, 5);
    saga_gpu_copy(g, &on, 0, &up, 0, sizeof want);
    saga_gpu_fill(g, &on, 40, 28, 9);
    saga_gpu_copy(g, &down, 12, &on, 0, sizeof want - 12);
    saga_gpu_copy(g, &down, 0, &up, 0, 0);
    assert_done(saga_gpu_finish(g, &error));
    assert_memory_equal(down.map, want, sizeof want);
    saga_gpu_free(&up, g);
    saga_gpu_free(&on, g);
    saga_gpu_free(&down, g);
    assert_null(up.map);
    saga_gpu_free(&up, g);
}

TEST(a_buffer_should_grow_and_never_shrink)
{
    saga_gpu *const g = test_device_of(state);
    saga_gpu_buffer b = { 0 };
    uint64_t first;

    assert_done(saga_gpu_grow(&b, g, 400, SAGA_GPU_UP, "a", &error));
    first = b.buffer;
    assert_done(saga_gpu_grow(&b, g, 16, SAGA_GPU_UP, "a", &error));
    assert_true(b.buffer == first && b.nbytes == 400);
    assert_done(saga_gpu_grow(&b, g, 401, SAGA_GPU_UP, "a", &error));
    assert_true(b.nbytes >= 401);
    memset(b.map, 1, 401);
    saga_gpu_free(&b, g);
}

TEST(memory_that_is_not_there_should_be_an_error_with_a_remedy)
{
    saga_gpu *const g = test_device_of(state);
    saga_gpu_buffer b;
    saga_error e = { "" };

    /* Half of the space of addresses that a process can have. */
    assert_false(
        saga_gpu_alloc(&b, g, (size_t)1 << 46, SAGA_GPU_LOCAL, "a test", &e));
    assert_true(b.buffer == 0 && b.memory == 0);
    assert_non_null(strstr(e.message, "MiB for a test"));
    assert_non_null(strstr(e.message, "--device cpu"));
    assert_done(saga_gpu_alloc(&b, g, 64, SAGA_GPU_LOCAL, "a", &error));
    saga_gpu_free(&b, g);
}

/* --- Kernels ------------------------------------------------------------- */

/* The exclusive sums of `from`, on the device. */
typedef struct {
    saga_gpu_buffer frame, from, to, sums;
} sums_of;

static void make(sums_of *s, saga_gpu *g)
{
    memset(s, 0, sizeof *s);
    assert_done(
        saga_gpu_alloc(&s->frame, g, 4096, SAGA_GPU_LOCAL, "a", &error) &&
        saga_gpu_alloc(&s->from, g, 4 * MOST, SAGA_GPU_UP, "a", &error) &&
        saga_gpu_alloc(&s->to, g, 4 * MOST, SAGA_GPU_DOWN, "a", &error) &&
        saga_gpu_alloc(&s->sums, g, 4096, SAGA_GPU_LOCAL, "a", &error));
}

static void drop(sums_of *s, saga_gpu *g)
{
    saga_gpu_free(&s->frame, g);
    saga_gpu_free(&s->from, g);
    saga_gpu_free(&s->to, g);
    saga_gpu_free(&s->sums, g);
}

/* Records the three kernels of a scan over n numbers, the first and last with
 * some groups that have nothing to do. */
static void scan(const sums_of *s, saga_gpu *g, uint32_t n, uint32_t idle)
{
    const uint32_t blocks = (n + BLOCK - 1) / BLOCK;
    const uint32_t push[] = { n, 0 };
    const saga_gpu_job first = { .kernel = SAGA_KERNEL_SCAN,
                                 .buffer = { &s->frame, &s->from, &s->from,
                                             &s->to, &s->sums },
                                 .push = push,
                                 .push_nbytes = sizeof push,
                                 .n_groups = blocks + idle };
    const saga_gpu_job top = { .kernel = SAGA_KERNEL_SCAN_TOP,
                               .buffer = { &s->frame, &s->sums },
                               .push = &blocks,
                               .push_nbytes = sizeof blocks,
                               .n_groups = 1 };
    const saga_gpu_job add = { .kernel = SAGA_KERNEL_SCAN_ADD,
                               .buffer = { &s->frame, &s->to, &s->sums },
                               .push = push,
                               .push_nbytes = sizeof *push,
                               .n_groups = blocks + idle };

    saga_gpu_run(g, &first);
    saga_gpu_run(g, &top);
    saga_gpu_run(g, &add);
}

TEST(kernels_should_run_in_turn_in_any_number_of_groups)
{
    /* With 40,000 idle groups there are more than one row of them. */
    const struct {
        uint32_t n, idle;
    } list[] = { { 1, 0 },         { BLOCK - 1, 0 }, { BLOCK, 0 },
                 { BLOCK + 1, 0 }, { MOST, 0 },      { 5000, 40000 } };
    saga_gpu *const g = test_device_of(state);
    sums_of s;
    uint32_t *from;

    make(&s, g);
    from = s.from.map;
    for (uint32_t i = 0; i < MOST; i++)
        from[i] = (i * 2654435761u) >> 24;
    for (size_t k = 0; k < sizeof list / sizeof list[0]; k++) {
        const uint32_t n = list[k].n, *const to = s.to.map;
        uint32_t sum = 0;

        saga_gpu_begin(g);
        saga_gpu_fill(g, &s.to, 0, 4 * MOST, 77);
        scan(&s, g, n, list[k].idle);
        assert_done(saga_gpu_finish(g, &error));
        for (uint32_t i = 0; i < n; i++) {
            assert_int_equal(to[i], sum);
            sum += from[i];
        }
        assert_true(n == MOST || to[n] == 77);
    }
    drop(&s, g);
}

TEST(a_list_that_is_too_long_should_be_an_error_and_the_next_one_work)
{
    saga_gpu *const g = test_device_of(state);
    saga_error e = { "" };
    sums_of s;

    make(&s, g);
    saga_gpu_begin(g);
    for (int i = 0; i < 300; i++)
        scan(&s, g, 1, 0);
    assert_false(saga_gpu_finish(g, &e));
    assert_non_null(strstr(e.message, "more than 512 jobs"));
    *(uint32_t *)s.from.map = 3;
    saga_gpu_begin(g);
    scan(&s, g, 1, 0);
    assert_done(saga_gpu_finish(g, &error));
    assert_int_equal(*(uint32_t *)s.to.map, 0);
    drop(&s, g);
}

TEST(times_should_be_of_the_runs_since_they_were_switched_on)
{
    saga_gpu *const g = test_device_of(state);
    uint64_t n_runs;
    double seconds;
    sums_of s;

    make(&s, g);
    saga_gpu_time(g, true);
    for (int i = 0; i < 2; i++) {
        saga_gpu_begin(g);
        scan(&s, g, MOST, 0);
        scan(&s, g, MOST, 0);
        assert_done(saga_gpu_finish(g, &error));
    }
    seconds = saga_gpu_seconds(g, SAGA_KERNEL_SCAN, &n_runs);
    /* A device may have no clock. */
    assert_true(n_runs == 4 ? seconds > 0 && seconds < 60 : n_runs == 0);
    assert_true(saga_gpu_seconds(g, SAGA_KERNEL_TILES, &n_runs) == 0);
    assert_int_equal(n_runs, 0);
    saga_gpu_time(g, false);
    saga_gpu_begin(g);
    scan(&s, g, 1, 0);
    assert_done(saga_gpu_finish(g, &error));
    assert_true(saga_gpu_seconds(g, SAGA_KERNEL_SCAN, &n_runs) == 0);
    assert_int_equal(n_runs, 0);
    drop(&s, g);
}
