/* SPDX-License-Identifier: MIT
 *
 * The choice of a scene's tools. A primitive that loses a tool must become the
 * nearest one without it. The built-in room is matt and must get no
 * view-dependent colours; the same room with a shine on it must get them.
 */
#include "alloc.h"
#include "pose.h"
#include "splat_animate.h"
#include "testing.h"
#include "tiny_training.h"
#include "tool_choice.h"

enum { N = 200, N_AGES = 401, N_CAMERAS = 17 };

/* --- Primitives without a tool ------------------------------------------- */

/* Makes N primitives with random motions and slopes, and widths of at least an
 * eighth. */
static saga_splat_params primitives(void)
{
    const saga_rng r = saga_rng_stream(3, 0);
    saga_splat_params p;
    saga_error error = { "" };

    assert_true(saga_params_alloc(
        &p, SAGA_ATTRS_ALL & ~SAGA_ATTR_BIT(SAGA_ATTR_SUPPORT), N, &error));
    for (size_t i = 0; i < 9 * N; i++)
        p.motion[i] = (real)saga_rng_normal(r, i);
    for (size_t i = 0; i < 4 * N; i++) {
        p.quat[i] = (real)saga_rng_normal(r, 10000 + i);
        p.slope[i] = (real)saga_rng_normal(r, 20000 + i);
    }
    for (size_t i = 0; i < N; i++) {
        p.t_centre[i] = R(0.5);
        p.log2_width[i] = (real)(i % 4) - 3;
    }
    return p;
}

static uint32_t order(int k)
{
    return (uint32_t)k << SAGA_TOOL_MOTION_SHIFT;
}

/* Returns the sum, over ages of -1 to 1, of the distance that primitive i has
 * moved away, times age^power. */
static double moved_away(const saga_splat_params *p, const saga_splat_params *q,
                         size_t i, int power)
{
    double sum = 0;

    for (int k = 0; k < N_AGES; k++) {
        const double age = 2 * (k + 0.5) / N_AGES - 1;
        const real *const a = p->motion + 9 * i, *const b = q->motion + 9 * i;
        const double from =
            (double)p->mean[3 * i] +
            (((double)a[6] * age + (double)a[3]) * age + (double)a[0]) * age;
        const double to =
            (double)q->mean[3 * i] +
            (((double)b[6] * age + (double)b[3]) * age + (double)b[0]) * age;

        sum += (from - to) * pow(age, power) / N_AGES;
    }
    return sum;
}

/* The residual of a least-squares fit is orthogonal to everything that could be
 * fitted. */
TEST(lower_orders_should_be_the_nearest)
{
    for (int to = 0; to < 3; to++) {
        saga_splat_params p = primitives(), q = primitives();

        /* One order at a time: the next one higher is there already. */
        saga_plan_reduce(&p, N, SAGA_TOOLS_PICTURE - order(2 - to));
        saga_plan_reduce(&q, N, SAGA_TOOLS_PICTURE - order(3 - to));
        for (size_t i = 0; i < N; i++) {
            for (size_t k = 0; k < 9; k++)
                assert_true(k / 3 < (size_t)to || q.motion[9 * i + k] == 0);
            for (int power = 0; power <= to && to > 0; power++)
                assert_true(fabs(moved_away(&p, &q, i, power)) < 1e-4);
        }
        saga_params_free(&p);
        saga_params_free(&q);
    }
}

/* The other tools do the same as before, at every time near the centre. */
TEST(without_opacity_motion_should_stay)
{
    saga_splat_params p = primitives(), q = primitives();
    real mean[2][3 * N], quat[2][4 * N], q0[2][N];
    saga_splat_posed a = { mean[0], quat[0], q0[0] };
    saga_splat_posed b = { mean[1], quat[1], q0[1] };

    saga_plan_reduce(&q, N, SAGA_TOOLS_PICTURE & ~SAGA_TOOL_OPACITY_T);
    assert_null(q.log2_width);
    for (int k = -8; k <= 8; k++) {
        saga_splat_animate_forward(&a, &p, (saga_range){ 0, N },
                                   R(0.5 + k / 64.0));
        saga_splat_animate_forward(&b, &q, (saga_range){ 0, N },
                                   R(0.5 + k / 64.0));
        for (size_t i = 0; i < 3 * N; i++)
            assert_true(fabs((double)(mean[0][i] - mean[1][i])) < 1e-5);
        for (size_t i = 0; i < 4 * N; i++)
            assert_true(fabs((double)(quat[0][i] - quat[1][i])) < 1e-5);
    }
    saga_params_free(&p);
    saga_params_free(&q);
}

/* --- By direction -------------------------------------------------------- */

static double place_of(const saga_source_view *s)
{
    double centre[3];

    saga_pose_centre(s->rotation, s->translation, centre);
    return centre[0];
}

/* Changes red by the place of a camera: the farther to one side it stands, the
 * brighter is the upper half of its pictures, by up to two thirds, and the
 * darker the lower half. So no exposure of the camera explains the change. */
static void shine(saga_capture *c)
{
    double lo = INFINITY, hi = -INFINITY;

    for (int v = 0; v < c->n_views; v++) {
        lo = fmin(lo, place_of(&c->views[v]));
        hi = fmax(hi, place_of(&c->views[v]));
    }
    for (int v = 0; v < c->n_views; v++) {
        saga_source_view *const s = &c->views[v];
        const double side = 2 * (place_of(s) - lo) / (hi - lo) - 1;
        const size_t n = saga_view_frame_nbytes(s) * (size_t)c->n_frames;

        for (size_t i = 0; i < n; i += 3) {
            const size_t row = i / 3 / (size_t)s->width % (size_t)s->height;
            const double by = row < (size_t)s->height / 2 ? side : -side;

            s->rgb[i] = (uint8_t)fmin(255, s->rgb[i] * (0.6 + 0.4 * by));
        }
    }
}

static saga_train_tool tool_of(const saga_capture *c, int tool)
{
    saga_train_options o = saga_train_defaults();
    saga_error error = { "" };
    saga_train_tool r;
    saga_train *t;

    o.n_primitives = 400;
    o.n_warm = 640;
    o.n_render = 2;
    t = saga_train_new(c, &o, &error);
    if (!t || saga_train_run(t, &error) != SAGA_DONE)
        fail_msg("%s", error.message);
    r = saga_train_report_of(t)->tool[tool];
    assert_int_equal(
        r.kept, (saga_train_report_of(t)->info.tools & SAGA_TOOL_VIEW) != 0);
    print_message("worth %.0f, costs %.0f bytes\n", r.worth, r.cost);
    saga_train_free(t);
    return r;
}

TEST(shine_should_be_kept)
{
    const saga_synth_options o = synth_options(64, 36, N_CAMERAS, 1, 300);
    saga_train_tool matt, shiny;
    FREED_BY(saga_capture_free) saga_capture c = tiny_capture(&o);

    matt = tool_of(&c, SAGA_TRAIN_VIEW);
    shine(&c);
    shiny = tool_of(&c, SAGA_TRAIN_VIEW);
    assert_true(matt.asked && shiny.asked);
    assert_false(matt.kept);
    assert_true(shiny.kept && shiny.worth > 3 * shiny.cost);
}
