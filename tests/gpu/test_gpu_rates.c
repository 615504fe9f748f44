/* SPDX-License-Identifier: MIT
 *
 * The rate of residuals on a device against the host's float, whose gradients
 * finite differences in double hold (test_rate_f64), and the cost of values
 * against that in double. Both round, in different orders: bits may differ by
 * 1e-5 and gradients by 1e-4 of a tensor's largest. SAGA_TEST_GPU is the number
 * of the device; the first one is the default. Without a device the tests are
 * skipped.
 */
#include "away_rate.h"
#include "gpu_spoil.h"
#include "gpu_stages.h"
#include "gpu_ways.h"
#include "gpu_world.h"
#include "near.h"
#include "rate_bits.h"
#include "rate_scene.h"
#include "rate_values.h"

#include <math.h>

enum { DEPTH = 3 };

TEST_GROUP(set_up_world, tear_down_world);

/* --- Cases --------------------------------------------------------------- */

/* A case: the sources that are kept, and what an iteration does. */
typedef struct {
    const char *name;
    uint8_t keep[SAGA_N_KINDS];
    bool has_classes, rounding;
    uint32_t first, every;
    real gain;       /* of the last layers, which values at bounds need */
    uint8_t hyper_q; /* format of HYPER's outputs */
} variant;

enum { ALL = 7, HYPER = SAGA_SOURCE_HYPER, PARENT = SAGA_SOURCE_PARENT };

static const variant variants[] = {
    { "all sources", { ALL, ALL, ALL }, false, false, 0, 1, 1, 10 },
    { "a quarter", { ALL, ALL, ALL }, false, true, 3, 4, 1, 10 },
    { "classes", { ALL, 0, ALL }, true, false, 1, 4, 1, 10 },
    { "some sources", { HYPER, PARENT, HYPER }, false, true, 0, 4, 1, 10 },
    { "constants", { 0, 0, 0 }, false, false, 2, 4, 1, 10 },
    { "bounds", { ALL, ALL, ALL }, false, false, 0, 1, 300, 15 },
};

static void make(rate_scene *f, const variant *v)
{
    saga_model m;

    rate_scene_model(&m);
    m.out_q[SAGA_OUT_HYPER] = v->hyper_q;
    if (v->has_classes)
        rate_scene_classes(&m);
    rate_scene_make_own(f, &m, DEPTH);
    memcpy(f->r.context.keep, v->keep, sizeof v->keep);
    f->o.first = v->first;
    f->o.every = v->every;
    f->o.rounding = v->rounding;
    for (int i = 0; i < SAGA_NET_FUSE_C; i++) {
        const saga_net *const net = &f->s.net[i];
        const int last = net->n_layers - 1;
        const size_t n = (size_t)(net->dim[last] + 1) *
                         (size_t)net->dim[last + 1];

        for (size_t k = 0; k < n; k++)
            net->w[last][k] *= v->gain;
    }
}

static saga_rate_input input_of(rate_scene *f)
{
    return (saga_rate_input){ &f->s, &f->w, f->s.coarse_feature };
}

/* What a device evaluates, with the gradients of values in the scene's places,
 * but those of primitives' offsets. */
typedef struct {
    double bits[SAGA_N_STEPS];
    real *d_offset; /* (n, 4) to be freed */
} rated;

/* Evaluates values that are on the device. */
static void evaluate(double bits[SAGA_N_STEPS], saga_gpu_canvas *g,
                     rate_scene *f)
{
    saga_gpu_ways w = { .n_up = 0 };
    saga_gpu_rates_run run;
    saga_away_rates a;

    saga_away_list_rates(&a, &f->r, &f->d, &f->s, &f->o);
    saga_gpu_list_rates(&run, &w, &a.to);
    assert_done(saga_gpu_rates_room(g, &run, &error));
    assert_done(saga_gpu_ways_room(g, w.up, w.n_up, "rates", &error));
    assert_done(saga_gpu_ways_back(g, w.down, w.n_down, "rates", &error));
    saga_gpu_ways_pack(g, w.up, w.n_up);
    saga_gpu_begin(g->gpu);
    saga_gpu_ways_send(g, w.up, w.n_up);
    saga_gpu_record_rates(g, &run);
    saga_gpu_ways_fetch(g, w.down, w.n_down);
    assert_done(saga_gpu_finish(g->gpu, &error));
    saga_gpu_ways_take(g, w.down, w.n_down);
    saga_away_bits(bits, &a);
}

/* Takes values to the device, and gradients and means back. */
static rated rate_away(saga_gpu *gpu, saga_gpu_canvas *g, rate_scene *f)
{
    saga_rate_kind *const prim = &f->r.context.kind[SAGA_KIND_PRIM];
    const saga_rate_input x = input_of(f);
    const size_t n = f->s.n.coarse, m = n * f->s.model.features;
    rated r = { .d_offset = zeroed(4 * n, sizeof *r.d_offset) };
    FREED real *const value = zeroed(4 * n, sizeof *value);
    FREED real *const zero = zeroed(m > 4 * n ? m : 4 * n, sizeof *zero);
    const saga_gpu_way up[] = {
        { .buffer = GPU_COARSE, .n = m, .from = x.feature },
        { .buffer = GPU_FEATURE, .n = m, .from = f->w.fine_feature },
        { .buffer = GPU_SIZE + SAGA_KIND_PRIM, .n = 5 * n, .from = prim->size },
        { .buffer = GPU_VALUE4 + SAGA_KIND_PRIM, .n = 4 * n, .from = value },
        { .buffer = GPU_MU + SAGA_KIND_COARSE, .n = m, .from = zero },
        { .buffer = GPU_MU + SAGA_KIND_PRIM, .n = 4 * n, .from = zero },
        { .buffer = GPU_D_COARSE, .n = m, .from = zero },
        { .buffer = GPU_D_FEATURE, .n = m, .from = zero },
        { .buffer = GPU_D_OFFSET, .n = 4 * n, .from = zero }
    };
    const saga_gpu_way down[] = {
        { .buffer = GPU_D_COARSE, .n = m, .to = f->d.coarse_feature },
        { .buffer = GPU_D_FEATURE, .n = m, .to = f->w.d_fine_feature },
        { .buffer = GPU_D_OFFSET, .n = 4 * n, .to = r.d_offset },
        { .buffer = GPU_MU + SAGA_KIND_COARSE, .n = m, .to = f->r.mu_feature },
        { .buffer = GPU_MU + SAGA_KIND_PRIM, .n = 4 * n, .to = f->r.mu_offset }
    };

    for (uint32_t i = 0; i < n; i++) {
        double y[SAGA_RATE_ROW];

        saga_rate_place_prims(prim, &f->s, &f->w, &i, 1);
        saga_rate_read_block(y, &f->r, &x, SAGA_KIND_PRIM, i);
        for (size_t k = 0; k < 4; k++)
            value[4 * i + k] = R(y[k]);
    }
    /* The host measures constants in each evaluation. */
    for (int kind = 0; kind < SAGA_N_KINDS; kind++)
        if (kind != SAGA_KIND_FINE && !f->r.context.keep[kind])
            saga_rate_measure(&f->r, &x, kind);
    assert_true(saga_away_can_rate(gpu, &f->r, &f->s));
    assert_done(saga_gpu_ways_put(g, up, 9, "values", &error));
    assert_done(saga_away_put_rate(g, &f->r, &f->s, &error));
    evaluate(r.bits, g, f);
    assert_done(saga_gpu_ways_get(g, down, 5, "gradients", &error));
    return r;
}

/* --- Comparisons --------------------------------------------------------- */

/* A mean is rounded to its format, in which it may differ by a unit. */
static bool means_are_near(const char *name, const real *x, const real *y,
                           size_t n, real unit)
{
    for (size_t i = 0; i < n; i++)
        if (!(fabsf(x[i] - y[i]) <= R(1.01) * unit)) {
            print_error("%s, mean %zu: %g rather than %g\n", name, i,
                        (double)x[i], (double)y[i]);
            return false;
        }
    return true;
}

static bool nets_are_near(const char *name, const rate_scene *a,
                          const rate_scene *b)
{
    bool ok = true;

    for (int net = 0; net < SAGA_NET_FUSE_C; net++) {
        const saga_net *const d = &b->d.net[net];

        if (d->n_layers)
            ok = is_near(name, "a network", a->d.net[net].w[0], d->w[0],
                         saga_net_n_params(d), 1e-4) &&
                 ok;
    }
    return ok;
}

static bool agree(saga_gpu *gpu, saga_gpu_canvas *g, const variant *v)
{
    FREED_BY(rate_scene_free) rate_scene host, away;
    double bits[SAGA_N_STEPS];
    rated r;
    saga_rate_input x;
    size_t n, f;
    bool ok = true;

    make(&host, v);
    make(&away, v);
    n = host.s.n.coarse;
    f = host.s.model.features;
    x = input_of(&host);
    saga_rate_add(bits, &host.r, &host.d, &x, &host.o);
    r = rate_away(gpu, g, &away);
    for (int k = 0; k < SAGA_N_STEPS; k++)
        ok = is_near(v->name, "bits", &(real){ R(r.bits[k]) },
                     &(real){ R(bits[k]) }, 1, 1e-5) &&
             ok;
    ok = is_near(v->name, "features", away.d.coarse_feature,
                 host.d.coarse_feature, n * f, 1e-4) &&
         ok;
    ok = is_near(v->name, "fine features", away.w.d_fine_feature,
                 host.w.d_fine_feature, n * f, 1e-4) &&
         ok;
    /* Those of offsets are in supports, and none is clamped. */
    for (size_t i = 0; i < 4 * n; i++)
        r.d_offset[i] /= host.w.support[i];
    ok = is_near(v->name, "positions", r.d_offset, host.d.prim_x, 4 * n,
                 1e-4) &&
         ok;
    ok = nets_are_near(v->name, &away, &host) && ok;
    ok = means_are_near(v->name, away.r.mu_feature, host.r.mu_feature, n * f,
                        R(1) / 1024) &&
         ok;
    ok = means_are_near(v->name, away.r.mu_offset, host.r.mu_offset, 4 * n,
                        R(1) / 16384) &&
         ok;
    free(r.d_offset);
    return ok;
}

/* All use one canvas, whose buffers have no numbers before a case. The first is
 * done again, with buffers that are there. */
TEST(rates_should_agree_with_the_host)
{
    world *const w = world_of(state);
    const size_t n = sizeof variants / sizeof variants[0];
    saga_gpu_canvas *g;
    bool ok = true;

    assert_done(g = saga_gpu_canvas_new(w->gpu, &w->pictures, &error));
    for (size_t i = 0; i <= n; i++) {
        spoil(g);
        ok = agree(w->gpu, g, &variants[i % n]) && ok;
    }
    saga_gpu_canvas_free(g);
    assert_true(ok);
}

/* Inputs from a bank stay in a network when the choice of sources has dropped
 * it, and no kernel sets them. */
TEST(a_model_with_a_bank_should_stay_with_the_host)
{
    world *const w = world_of(state);
    FREED_BY(rate_scene_free) rate_scene f;

    make(&f, &variants[0]);
    assert_true(saga_away_can_rate(w->gpu, &f.r, &f.s));
    f.s.model.sources[SAGA_KIND_FINE] |= SAGA_SOURCE_BANK;
    assert_int_equal(f.r.context.keep[SAGA_KIND_FINE] & SAGA_SOURCE_BANK, 0);
    assert_false(saga_away_can_rate(w->gpu, &f.r, &f.s));
}

/* Values from the mean to tens of thousands of steps off, under deviations from
 * the coder's first scale to its last. */
TEST(a_cost_should_be_that_of_double)
{
    world *const w = world_of(state);
    saga_gpu_canvas *g;
    const variant v = { "", { 0, 0, 0 }, false, true, 0, 1, 1, 10 };
    FREED_BY(rate_scene_free) rate_scene f;
    double sum = 0;
    rated r;
    saga_rate_constants c = { .mean = { { 0 } } };
    real *slope;
    size_t n_features, n;

    assert_done(g = saga_gpu_canvas_new(w->gpu, &w->pictures, &error));
    make(&f, &v);
    n_features = f.s.model.features;
    n = (size_t)f.s.n.coarse * n_features;
    slope = zeroed(n, sizeof *slope);
    for (size_t k = 0; k < 4 + n_features; k++)
        c.log2_sigma[SAGA_KIND_COARSE][k] = R(
            SAGA_RATE_LOG2_MIN + (SAGA_RATE_LOG2_MAX - SAGA_RATE_LOG2_MIN) *
                                     (double)k / (double)(3 + n_features));
    saga_rate_give(&f.r, &c);
    for (size_t i = 0; i < n; i++) {
        const double step = saga_rate_step_size(&f.s.model, SAGA_KIND_COARSE,
                                                4);
        const size_t block = i / n_features;
        const double steps = (block % 2 ? -1 : 1) *
                             exp2((double)block / 32 - 2);
        const real y = f.s.coarse_feature[i] = R(steps * step);
        const saga_rate_cost cost = saga_rate_bits(
            (double)y / step,
            (double)c.log2_sigma[SAGA_KIND_COARSE][4 + i % n_features]);

        sum += cost.bits;
        slope[i] = R((double)f.o.weight * cost.d_v / step);
    }
    r = rate_away(w->gpu, g, &f);
    free(r.d_offset);
    saga_gpu_canvas_free(g);
    assert_true(is_near("double", "bits",
                        &(real){ R(r.bits[SAGA_STEP_FEATURE]) },
                        &(real){ R(sum) }, 1, 1e-5));
    assert_true(
        is_near("double", "features", f.d.coarse_feature, slope, n, 1e-4));
    free(slope);
}
