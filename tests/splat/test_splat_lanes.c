/* SPDX-License-Identifier: MIT
 *
 * Primitives are computed in the lanes of vectors. Whatever a primitive's
 * neighbours are, and whether it is in a full vector or at the end of a range,
 * its numbers have the same bits, and nothing else is written.
 */
#include "splat_animate.h"
#include "splat_project.h"
#include "splat_scene.h"
#include "testing.h"

/* Not a multiple of any number of lanes. */
enum { N = 37, W = 64, H = 48 };

static saga_error error; /* nothing fails here */

/* All that the four operators write for N primitives. */
typedef struct {
    saga_splat_2d splat[N];
    real extent[N];
    saga_splat_params d;
    real grad2d[N], weight[N];
    uint32_t seen[N];
} result;

static const real unwritten = 77;

static fixture *make(void)
{
    fixture *const f = new_fixture(N, W, H, 5, 4);

    /* Some are behind the camera, too faint, or of no size and no rotation. */
    f->p.mean[3 * 4 + 2] = -9;
    f->p.opacity[9] = -30;
    f->p.quat[4 * 11] = f->p.quat[4 * 11 + 1] = 0;
    f->p.quat[4 * 11 + 2] = f->p.quat[4 * 11 + 3] = 0;
    f->p.log2_scale[3 * 20] = 99;
    f->p.log2_width[21] = -40;
    f->c.t = R(0.4);
    assert_true(saga_splat_forward(&f->c, &f->p, N, &error));
    assert_true(saga_splat_backward(&f->d, NULL, &f->c, &f->p, &error));
    return f;
}

/* Runs the operators on a range, after everything was set to `unwritten`. */
static void run(result *r, fixture *f, saga_range of)
{
    saga_splat_work *const w = &f->c.splat;
    saga_splat_stats stats = { r->grad2d, r->weight, r->seen };

    saga_splat_animate_forward(&w->posed, &f->p, of, f->c.t);
    saga_splat_project_forward(&f->c, &f->p, of);
    saga_splat_project_backward(&r->d, &stats, &f->c, &f->p, of);
    saga_splat_animate_backward(&r->d, &f->c, &f->p, of);
    memcpy(r->splat + of.begin, w->splat + of.begin,
           (of.end - of.begin) * sizeof *r->splat);
    memcpy(r->extent + of.begin, w->extent + of.begin,
           (of.end - of.begin) * sizeof *r->extent);
}

static result *new_result(void)
{
    result *const r = calloc(1, sizeof *r);

    r->d = scene_alloc(N);
    for (size_t i = 0; i < scene_reals(N); i++)
        r->d.mean[i] = unwritten;
    for (size_t i = 0; i < N; i++)
        r->grad2d[i] = r->weight[i] = unwritten;
    return r;
}

static void free_result(result *r)
{
    saga_params_free(&r->d);
    free(r);
}

static void assert_same(const result *a, const result *b)
{
    assert_memory_equal(a->splat, b->splat, sizeof a->splat);
    assert_memory_equal(a->extent, b->extent, sizeof a->extent);
    assert_memory_equal(a->d.mean, b->d.mean, scene_reals(N) * sizeof(real));
    assert_memory_equal(a->grad2d, b->grad2d, sizeof a->grad2d);
    assert_memory_equal(a->weight, b->weight, sizeof a->weight);
    assert_memory_equal(a->seen, b->seen, sizeof a->seen);
}

TEST(each_primitive_should_have_the_same_bits_alone)
{
    fixture *const f = make();
    result *const all = new_result(), *const alone = new_result();

    run(all, f, (saga_range){ 0, N });
    for (size_t i = 0; i < N; i++)
        run(alone, f, (saga_range){ i, i + 1 });
    assert_same(all, alone);
    free_result(all);
    free_result(alone);
    free_fixture(f);
}

/* The gradients of primitives outside of the range keep their values. */
TEST(only_the_range_should_be_written)
{
    fixture *const f = make();
    result *const r = new_result();
    const saga_range of = { 8, 24 };

    run(r, f, of);
    for (int a = 0; a < SAGA_N_ATTRS; a++) {
        const size_t w = (size_t)saga_attributes[a].width;

        for (size_t i = 0; i < w * N; i++)
            if (i / w < of.begin || i / w >= of.end)
                assert_true(r->d.of[a][i] == unwritten);
    }
    for (size_t i = 0; i < N; i++)
        if (i < of.begin || i >= of.end)
            assert_true(r->weight[i] == unwritten && r->seen[i] == 0);
    free_result(r);
    free_fixture(f);
}

/* Places are those to which animation moves the means. */
TEST(places_should_be_those_of_animation)
{
    fixture *const f = make();
    real place[3 * N];

    saga_splat_place(place, &f->p, (saga_range){ 0, N }, f->c.t);
    assert_memory_equal(place, f->c.splat.posed.mean, sizeof place);
    free_fixture(f);
}

/* -log2 of the opacity has the value in double, by the library's functions, to
 * a few units in the last place of its terms, whose largest is 3. */
TEST(opacity_should_match_double)
{
    FREED_BY(saga_params_free) saga_splat_params p = scene_alloc(N);
    real mean[3 * N], quat[4 * N], q0[N];
    saga_splat_posed posed = { mean, quat, q0 };
    double worst = 0;

    for (size_t i = 0; i < N; i++) {
        p.opacity[i] = R(-18 + (double)i);
        p.log2_width[i] = R(3);
        p.t_centre[i] = R(0.5);
    }
    saga_splat_animate_forward(&posed, &p, (saga_range){ 0, N }, R(0.5));
    for (size_t i = 0; i < N; i++) {
        const double x = 3 - (double)p.opacity[i];
        const double right = (x > 0 ? x : 0) + log2(1 + exp2(-fabs(x))) - 3;

        const double off = fabs((double)q0[i] - right) / (3 + fabs(right));

        assert_true(off < 3 * 0x1p-24);
        worst = fmax(worst, off);
    }
    printf("  largest error %.1e\n", worst);
}
