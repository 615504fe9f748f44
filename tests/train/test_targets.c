/* SPDX-License-Identifier: MIT
 *
 * The targets of the fit. A primitive whose temporal centre is moved must move
 * and turn as before, and fade as much on average; a primitive made still must
 * stay as it was in the middle.
 */
#include "rng.h"
#include "model.h"
#include "splat_animate.h"
#include "targets.h"
#include "testing.h"

enum { N = 200 };

static saga_error error; /* nothing fails here */

static real any(uint64_t *k, real lo, real hi)
{
    return lo + (hi - lo) * (real)saga_rng_float(saga_rng_stream(1, 2), (*k)++);
}

/* Makes primitives of which half have temporal widths of 1/2^2 to 1/2 segment,
 * and half of 2 to 4. */
static saga_splat_params make_primitives(void)
{
    saga_splat_params p;
    uint64_t k = 0;

    assert_true(saga_params_alloc(
        &p, SAGA_ATTRS_ALL & ~SAGA_ATTR_BIT(SAGA_ATTR_SUPPORT), N, &error));
    for (int i = 0; i < N; i++) {
        for (int a = 0; a < 3; a++)
            p.mean[3 * i + a] = any(&k, -1, 1);
        for (int a = 0; a < 4; a++) {
            p.quat[4 * i + a] = any(&k, -1, 1);
            p.slope[4 * i + a] = any(&k, -1, 1);
        }
        for (int a = 0; a < 9; a++)
            p.motion[9 * i + a] = any(&k, -R(0.3), R(0.3));
        p.opacity[i] = any(&k, -3, 3);
        p.t_centre[i] = any(&k, 0, 1);
        p.log2_width[i] = i % 2 ? any(&k, -2, -1) : any(&k, 1, 2);
    }
    return p;
}

typedef struct {
    real mean[3 * N], quat[4 * N], q0[N];
} posed;

static void pose(posed *out, const saga_splat_params *p, real t)
{
    saga_splat_posed to = { out->mean, out->quat, out->q0 };

    saga_splat_animate_forward(&to, p, (saga_range){ 0, N }, t);
}

TEST(centre_should_leave_motion_and_mean_fading)
{
    enum { TIMES = 64 };
    static posed before, after;
    FREED_BY(saga_params_free) saga_splat_params p = make_primitives();
    double faded[2] = { 0 };
    FREED_BY(saga_params_free) saga_splat_params q;

    assert_true(saga_params_gather(&q, &p, NULL, N, &error));
    saga_targets_centre(&q, N);
    for (int k = 0; k < TIMES; k++) {
        pose(&before, &p, (R(k) + R(0.5)) / TIMES);
        pose(&after, &q, (R(k) + R(0.5)) / TIMES);
        for (int i = 0; i < N; i++) {
            for (int a = 0; a < 3; a++)
                assert_true(fabsf(before.mean[3 * i + a] -
                                  after.mean[3 * i + a]) < 1e-5f);
            for (int a = 0; a < 4; a++)
                assert_true(fabsf(before.quat[4 * i + a] -
                                  after.quat[4 * i + a]) < 1e-5f);
            faded[0] += (double)before.q0[i];
            faded[1] += (double)after.q0[i];
        }
    }
    assert_true(fabs(faded[0] / faded[1] - 1) < 1e-4);
    for (int i = 0; i < N; i++)
        assert_true(i % 2 ? q.t_centre[i] == p.t_centre[i]
                          : q.t_centre[i] == R(0.5));
}

TEST(frozen_should_be_what_the_middle_was)
{
    static posed before, after;
    FREED_BY(saga_params_free) saga_splat_params p = make_primitives();
    FREED_BY(saga_params_free) saga_splat_params q;

    assert_true(saga_params_gather(&q, &p, NULL, N, &error));
    saga_targets_freeze(&q, N);
    pose(&before, &p, R(0.5));
    pose(&after, &q, R(0.1));
    assert_null(q.motion);
    for (int i = 0; i < N; i++) {
        for (int a = 0; a < 3; a++)
            assert_true(fabsf(before.mean[3 * i + a] - after.mean[3 * i + a]) <
                        1e-6f);
        assert_true(fabsf(before.q0[i] - after.q0[i]) < 1e-4f);
    }
}
