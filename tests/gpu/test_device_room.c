/* SPDX-License-Identifier: MIT
 *
 * The room on a device that is told before a training, against what the
 * training then makes there. It must not be less, and may be more by what
 * nobody knows before: how far the warm-up grows, pairs of splats and tiles,
 * tools and sources that are given up. SAGA_TEST_GPU is the number of the
 * device; the first one is the default. Without a device the tests are skipped.
 */
#include "device_room.h"
#include "test_device.h"
#include "tiny_training.h"

TEST_GROUP(set_up_device, tear_down_device);

/* Buffers have their size after a few iterations. */
enum { WARM = 10, RENDER = 20 };

/* A case, and the part by which the plan may exceed the truth. */
typedef struct {
    const char *name;
    uint32_t n;
    int n_frames;
    bool paper;
    double over;
} variant;

/* The paper's model gives nothing up. The many have more features than they
 * keep tools for. */
static const variant variants[] = { { "film", 300, 3, false, 0.12 },
                                    { "many", 1000, 3, false, 0.25 },
                                    { "still", 300, 1, false, 0.12 },
                                    { "paper", 300, 3, true, 0 } };

static bool agree(saga_gpu *gpu, const variant *v)
{
    saga_train_options o = tiny_options(v->n, WARM, RENDER);
    saga_device_room plan;
    tiny t;
    trained file;
    double made;

    tiny_open(&t, v->n_frames);
    o.paper = v->paper;
    o.gpu = gpu;
    assert_done(saga_train_device_room(&plan, &t.capture, &o, &error));
    assert_int_equal(saga_gpu_count(gpu, false), 0);
    file = tiny_train(&t.capture, &o);
    made = (double)saga_gpu_count(gpu, false);
    print_message("%s: %.0f bytes planned (%.0f and %.0f), %.0f made, %.3f\n",
                  v->name, (double)plan.need, (double)plan.warm,
                  (double)plan.render, made, (double)plan.need / made);
    free(file.bytes);
    tiny_close(&t);
    return made > 0 && made <= (double)plan.need &&
           (double)plan.need <= (1 + v->over) * made;
}

TEST(a_plan_should_have_the_room_of_the_training)
{
    saga_gpu *const gpu = test_device_of(state);
    bool ok = true;

    for (size_t i = 0; i < sizeof variants / sizeof variants[0]; i++)
        ok = agree(gpu, &variants[i]) && ok;
    assert_true(ok);
}

/* Three views that are far apart, between which two teachers draw: in a moving
 * scene during the warm-up, in a still also while rendering. The rendering
 * stage takes more, so that a moving scene is compared before it. */
static void has_teachers(saga_gpu *gpu, int n_frames, int stage, int iteration)
{
    saga_synth_options s = synth_options(64, 36, 3, n_frames, 300);
    saga_train_options o = tiny_options(300, WARM, RENDER);
    tiny_stop stop = { .stage = stage, .iteration = iteration };
    saga_device_room plan;
    saga_capture c;
    saga_train *t;
    double made, planned;

    s.n_hold_out = 0;
    c = tiny_capture(&s);
    o.n_teachers = 2;
    o.gpu = gpu;
    assert_done(saga_train_device_room(&plan, &c, &o, &error));
    planned = (double)(stage == SAGA_TRAIN_WARM ? plan.warm : plan.render);
    t = tiny_train_until(&c, &o, &stop);
    made = (double)saga_gpu_count(gpu, false);
    print_message("%.0f bytes planned, %.0f made, %.3f\n", planned, made,
                  planned / made);
    assert_true(made <= planned);
    assert_true(planned <= (n_frames > 1 ? 1.1 : 1.2) * made);
    saga_train_free(t);
    saga_capture_free(&c);
}

TEST(a_plan_should_have_the_room_of_teachers)
{
    saga_gpu *const gpu = test_device_of(state);

    has_teachers(gpu, 5, SAGA_TRAIN_WARM, 2 * WARM - 1);
    has_teachers(gpu, 1, SAGA_TRAIN_RENDER, RENDER - 1);
}

/* Records of pairs alone are more than the 4 GiB that any buffer may have. */
TEST(a_plan_should_refuse_what_no_buffer_can_have)
{
    saga_gpu *const gpu = test_device_of(state);
    saga_train_options o = tiny_options(1 << 24, WARM, RENDER);
    saga_device_room plan;
    saga_error refusal = { "" };
    tiny t;

    tiny_open(&t, 3);
    o.gpu = gpu;
    assert_false(saga_train_device_room(&plan, &t.capture, &o, &refusal));
    assert_non_null(strstr(refusal.message, "use fewer --primitives"));
    assert_int_equal(plan.need + plan.warm + plan.render, 0);
    assert_true(plan.is_refused);
    tiny_close(&t);
}
