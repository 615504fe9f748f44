/* SPDX-License-Identifier: MIT
 *
 * Files of a given size come near it, and threads and interruptions do not
 * change them. Files of a level with too little room keep to it.
 */
#include "level_room.h"
#include "saga.h"
#include "testing.h"
#include "tiny_training.h"
#include "train_state.h"

#include <unistd.h>

#ifdef _OPENMP
#include <omp.h>
#endif

TINY_GROUP(room, 5);

/* These three replace level_room.c in this program. The tools take from the
 * room of levels 2 and 3 alone, and there only beyond 130,857 primitives, which
 * train for a minute of CPU; so the tests set the room themselves. */
static uint32_t level_has = 100000;

uint32_t saga_room_of_model(const saga_train_options *o, const saga_model *m,
                            uint32_t n)
{
    (void)o;
    (void)m;
    return n < level_has ? n : level_has;
}

uint32_t saga_room_of_tools(const saga_train_options *o, const saga_ablation *a,
                            uint32_t tools, uint32_t n)
{
    (void)o;
    (void)a;
    (void)tools;
    return n;
}

uint32_t saga_room_sure(const saga_train_options *o, uint32_t n)
{
    return saga_room_of_model(o, NULL, n);
}

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

static void same(trained other, const trained *whole)
{
    assert_int_equal(other.n, whole->n);
    assert_memory_equal(other.bytes, whole->bytes, whole->n);
    free(other.bytes);
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
    same(other, &whole);
#endif
    o.checkpoint = room.checkpoint;
    tiny_stop_at(&o, &often);
    other = encode(&o);
    assert_true(often.calls > 100);
    same(other, &whole);
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
    same(other, &whole);
    free(whole.bytes);
    unlink(room.checkpoint);
}

static int compare_opacity(const void *a, const void *b)
{
    const real x = *(const real *)a, y = *(const real *)b;

    return (x < y) - (x > y);
}

/* Returns a sorted copy of n opacities, the highest first. */
static real *sorted(const real *opacity, size_t n)
{
    real *const of = copy_of(opacity, n * sizeof *of);

    qsort(of, n, sizeof *of, compare_opacity);
    return of;
}

/* If the chosen tools leave less room than was known at the start, the fit must
 * begin with the most opaque primitives of the warm-up, and the file must have
 * as many as there is room for. */
TEST(level_should_leave_out_the_faintest)
{
    enum { N = 300, ROOM = 200 };
    saga_train_options o = tiny_options(N, TINY_WARM, TINY_RENDER);
    tiny_stop begun = { SAGA_TRAIN_RENDER, -1, 0, 0 };
    FREED real *all = NULL, *kept = NULL;
    uint8_t rgb[TINY_PICTURE];
    saga_info info;
    saga_train *t;
    trained r;

    level_has = ROOM;
    t = tiny_train_until(&room.capture, &o, &begun);
    assert_int_equal(t->render.scene.n.prim, ROOM);
    all = sorted(saga_flat_params(t->warm.flat).opacity, N);
    kept = sorted(t->render.target.opacity, ROOM);
    /* The targets' opacities are rounded once more. */
    for (int i = 0; i < ROOM; i++)
        assert_true(fabs((double)kept[i] - (double)all[i]) < 1e-5);
    assert_true(all[ROOM - 1] - all[N - 1] > 0.1);
    r = tiny_finish(t);
    level_has = 100000;
    assert_int_equal(r.report.n_left_out, N - ROOM);
    assert_ok(saga_probe(&info, r.bytes, r.n));
    assert_int_equal(info.max_primitives, ROOM);
    tiny_draw(rgb, r.bytes, r.n, 0);
    free(r.bytes);
}
