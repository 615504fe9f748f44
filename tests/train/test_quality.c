/* SPDX-License-Identifier: MIT
 *
 * A mean over segments must be the mean over all their pictures, even if a
 * segment has no training pictures or no held-out ones.
 */
#include "quality.h"
#include "testing.h"

#include <math.h>

enum { FRAMES = 2 };

static bool here[FRAMES], nowhere[FRAMES] = { true, true };

/* Two views of two frames, the second one held out, with and without
 * pictures. */
static saga_source_view with[2] = { { .missing = here },
                                    { .missing = here, .held_out = true } };
static saga_source_view without[2] = {
    { .missing = here },
    { .missing = nowhere, .n_missing = FRAMES, .held_out = true }
};

static bool psnr_of(void *user, double *psnr, saga_sample picture,
                    saga_error *error)
{
    (void)error;
    *psnr = *(const double *)user + 10 * picture.view + picture.frame;
    return true;
}

static void add(saga_quality *q, saga_source_view *views, double psnr)
{
    const saga_capture capture = { .n_views = 2,
                                   .n_frames = FRAMES,
                                   .views = views };

    assert_done(saga_quality_add(q, &capture, psnr_of, &psnr, &error));
}

TEST(quality_should_be_the_mean_of_all_segments_pictures)
{
    saga_quality q = { 0 };

    add(&q, with, 20);
    add(&q, with, 30);
    /* Frames 0 and 1 of 20 and 30; the second view's are 10 dB better. */
    assert_true(fabs(q.training - 25.5) < 1e-12);
    assert_true(fabs(q.held_out - 35.5) < 1e-12);
    assert_int_equal(q.n_training, 4);
    assert_int_equal(q.n_held_out, 4);
}

TEST(quality_should_be_nan_until_a_segment_has_a_picture)
{
    saga_quality q = { 0 };

    add(&q, without, 20);
    assert_true(isnan(q.held_out));
    assert_int_equal(q.n_held_out, 0);
    add(&q, with, 30);
    add(&q, without, 40);
    assert_true(fabs(q.held_out - 40.5) < 1e-12);
    assert_true(fabs(q.training - 30.5) < 1e-12);
}
