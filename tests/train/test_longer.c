/* SPDX-License-Identifier: MIT
 *
 * A longer rendering stage must not be worse than a shorter one: from the same
 * warm-up, longer training keeps the quality, for few pictures and for many.
 */
#include "testing.h"
#include "tiny_training.h"
#include "train.h"

#include <unistd.h>

/* Trainings that differ only by chance differ by less than this, in dB. */
#define MOST_LOST 0.3

/* No preset makes fewer than ten visits to a picture. The first rendering stage
 * has this number of visits; the numbers of iterations of the others are
 * listed. */
enum { FEW_VISITS = 10, MOST_RUNS = 4 };

typedef struct {
    int width, height, cameras, frames; /* one camera is held out */
    saga_train_motion motion;
    uint32_t primitives;
    int warm, render[MOST_RUNS]; /* iterations, those growing; 0 ends them */
} training;

static saga_capture capture_of(const training *a)
{
    const saga_synth_options s = synth_options(a->width, a->height, a->cameras,
                                               a->frames, 300);

    return tiny_capture(&s);
}

/* Returns by how many dB the decoded file is better than its warm-up. */
static double gain(const saga_capture *c, const training *a, int render)
{
    saga_train_options o = tiny_options(a->primitives, a->warm, render);
    trained t;
    double more;

    o.motion = a->motion;
    o.lambda = 0; /* the policy chooses it */
    t = tiny_train(c, &o);
    more = t.report.coded.training - t.report.warm.training;
    printf("  %d views, %d frames, %5d iterations: %.2f dB after %.2f, %zu "
           "bytes\n",
           a->cameras - 1, a->frames, render, t.report.coded.training,
           t.report.warm.training, t.n);
    free(t.bytes);
    return more;
}

static bool is_never_worse(const training *a)
{
    FREED_BY(saga_capture_free) saga_capture c = capture_of(a);
    double best = gain(&c, a, FEW_VISITS * (a->cameras - 1) * a->frames);
    bool ok = true;

    for (int i = 0; i < MOST_RUNS && a->render[i]; i++) {
        const double now = gain(&c, a, a->render[i]);

        if (now < best - MOST_LOST) {
            print_error("%d iterations lose %.2f dB\n", a->render[i],
                        best - now);
            ok = false;
        }
        best = fmax(best, now);
    }
    return ok;
}

/* Trains, and checks that the gain does not fall. Skipped under sanitizers,
 * because it tests numbers. */
static void check(const training *a, size_t n)
{
    bool ok = true;

    for (size_t i = 0; i < n; i++)
        ok = (testing_sanitized() || is_never_worse(&a[i])) && ok;
    assert_true(ok);
}

/* With two views 1,500 iterations are 750 visits to a picture. */
TEST(longer_should_not_be_worse)
{
    static const training all[] = {
        { 24, 14, 3, 1, SAGA_TRAIN_STILL, 100, 300, { 1500 } },
        { 24, 14, 3, 2, SAGA_TRAIN_MOVING, 100, 300, { 1500 } }
    };

    check(all, sizeof all / sizeof *all);
}

/* In the first training 5,000 iterations are 1,000 visits: as many as the
 * default preset makes of a still of some ten views. With two views 20,000
 * iterations are 10,000 visits. */
TEST(much_longer_should_not_be_worse)
{
    static const training all[] = {
        { 24, 14, 6, 1, SAGA_TRAIN_STILL, 200, 800, { 1500, 5000 } },
        { 24, 14, 3, 2, SAGA_TRAIN_STILL, 100, 300, { 1500 } },
        { 64, 36, 6, 1, SAGA_TRAIN_STILL, 600, 4800, { 1000, 4000, 16000 } },
        { 48, 27, 3, 1, SAGA_TRAIN_STILL, 400, 3000, { 1000, 4000, 20000 } },
        { 48, 27, 6, 2, SAGA_TRAIN_STILL, 400, 3000, { 1000, 4000, 16000 } },
        { 48, 27, 6, 2, SAGA_TRAIN_MOVING, 300, 3000, { 1000, 4000, 16000 } },
        { 48, 27, 6, 8, SAGA_TRAIN_MOVING, 400, 6000, { 1000, 4000, 16000 } }
    };

    check(all, testing_long() ? sizeof all / sizeof *all : 0);
}
