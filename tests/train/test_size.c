/* SPDX-License-Identifier: MIT
 *
 * Files of a given size come near it, and threads and interruptions do not
 * change them.
 */
#include "testing.h"
#include "tiny_training.h"

#include <unistd.h>

#ifdef _OPENMP
#include <omp.h>
#endif

TINY_GROUP(room, 5);

static saga_train_options of_size(size_t n_bytes)
{
    saga_train_options o = tiny_options(300, TINY_WARM, TINY_RENDER);

    o.n_bytes = n_bytes;
    return o;
}

/* Runs until the file is finished, with a new process whenever the progress
 * function stops it. */
static trained encode(const saga_train_options *o)
{
    saga_train *t = tiny_begin(&room.capture, o);
    saga_error error = { "" };

    while (saga_train_run(t, &error) == SAGA_STOPPED) {
        saga_train_free(t);
        t = tiny_resume(&room.capture, o);
    }
    return tiny_finish(t);
}

static bool is_about(size_t n, size_t wanted)
{
    if (fabs((double)n - (double)wanted) <= 0.05 * (double)wanted)
        return true;
    print_error("%zu bytes, not %zu\n", n, wanted);
    return false;
}

/* Networks are most of this scene's file, which can hardly be smaller. A larger
 * size must give cheaper bits. */
TEST(size_should_be_what_was_asked_for)
{
    const saga_train_options any = of_size(0);
    const trained whole = encode(&any);
    const saga_train_options o = of_size(whole.n * 9 / 8);
    const trained larger = encode(&o);

    assert_true(is_about(larger.n, o.n_bytes));
    assert_true(larger.report.lambda < whole.report.lambda / 1.2);
    free(larger.bytes);
    free(whole.bytes);
}

TEST(size_should_survive_threads_and_stops)
{
    saga_train_options o = of_size(7500);
    trained whole = encode(&o), other;
    tiny_stop often = { SAGA_TRAIN_WARM, 0, 31, 0 };

#ifdef _OPENMP
    const int before = omp_get_max_threads();

    omp_set_num_threads(before == 1 ? 2 : 1);
    other = encode(&o);
    omp_set_num_threads(before);
    assert_int_equal(other.n, whole.n);
    assert_memory_equal(other.bytes, whole.bytes, whole.n);
    free(other.bytes);
#endif
    o.checkpoint = room.checkpoint;
    tiny_stop_at(&o, &often);
    other = encode(&o);
    assert_true(often.calls > 100);
    assert_int_equal(other.n, whole.n);
    assert_memory_equal(other.bytes, whole.bytes, whole.n);
    free(other.bytes);
    free(whole.bytes);
}

/* The size may change while there is time left to steer. */
TEST(size_should_be_what_is_asked_for_last)
{
    saga_train_options o = of_size(7500);
    tiny_stop soon = { SAGA_TRAIN_WARM, 5, 0, 0 };
    trained whole, other;

    o.checkpoint = room.checkpoint;
    saga_train_free(tiny_train_until(&room.capture, &o, &soon));
    o.n_bytes = 8000;
    o.progress = NULL;
    other = tiny_finish(tiny_resume(&room.capture, &o));
    o.checkpoint = NULL;
    whole = encode(&o);
    assert_int_equal(other.n, whole.n);
    assert_memory_equal(other.bytes, whole.bytes, whole.n);
    free(other.bytes);
    free(whole.bytes);
    unlink(room.checkpoint);
}
