/* SPDX-License-Identifier: MIT
 *
 * The start of the fit depends on small linear algebra, which is compared with
 * its definitions, and on the canonical form of primitives, which is compared
 * with their pictures.
 */
#include "canonical.h"
#include "canvas.h"
#include "linear.h"
#include "model.h"
#include "rng.h"
#include "splat.h"
#include "testing.h"

/* --- Linear algebra ------------------------------------------------------ */

/* Makes a = g g^T + ridge, which is positive definite; its rank without the
 * ridge is the number of columns of g. */
static void make_symmetric(saga_matrix a, size_t n, size_t rank, double ridge)
{
    const saga_rng r = saga_rng_stream(11, n);

    for (size_t i = 0; i < n; i++)
        for (size_t j = 0; j < n; j++) {
            a[i][j] = i == j ? ridge : 0;
            for (size_t k = 0; k < rank; k++)
                a[i][j] += saga_rng_normal(r, i * 100 + k) *
                           saga_rng_normal(r, j * 100 + k);
        }
}

TEST(solve_should_invert_the_product)
{
    for (size_t n = 1; n <= SAGA_LINEAR_MOST; n++) {
        double b[SAGA_LINEAR_MOST] = { 0 };
        saga_matrix a;

        make_symmetric(a, n, n, 0.1);
        for (size_t i = 0; i < n; i++)
            for (size_t j = 0; j < n; j++)
                b[i] += a[i][j] * (1 + (double)j);
        saga_solve(a, b, n);
        for (size_t i = 0; i < n; i++)
            assert_true(fabs(b[i] - 1 - (double)i) < 1e-7);
    }
}

/* Unknowns that occur in no equation must be 0, and the others must be found.
 */
TEST(solve_should_leave_out_what_has_no_say)
{
    enum { N = 9 };
    double b[SAGA_LINEAR_MOST] = { 0 };
    saga_matrix a;

    make_symmetric(a, N, N, 0.1);
    for (size_t i = 0; i < N; i++)
        for (size_t j = 0; j < N; j++) {
            if (i % 3 == 1 || j % 3 == 1)
                a[i][j] = 0;
            b[i] += a[i][j] * (1 + (double)j);
        }
    saga_solve(a, b, N);
    for (size_t i = 0; i < N; i++)
        assert_true(fabs(b[i] - (i % 3 == 1 ? 0 : 1 + (double)i)) < 1e-7);
}

/* Eigenvalues and eigenvectors must reproduce the matrix, even if it is
 * singular and has eigenvalues of 0. */
TEST(eigen_should_take_matrices_apart)
{
    for (size_t n = 1; n <= SAGA_LINEAR_MOST; n += 3) {
        saga_matrix a, v, whole;

        make_symmetric(a, n, (n + 1) / 2, 0);
        memcpy(whole, a, sizeof a);
        saga_eigen(v, a, n);
        for (size_t i = 0; i < n; i++) {
            assert_true(i == 0 || a[i][i] <= a[i - 1][i - 1]);
            assert_true(i < (n + 1) / 2 || fabs(a[i][i]) < 1e-9);
            for (size_t j = 0; j < n; j++) {
                double product = 0, dot = 0;

                for (size_t k = 0; k < n; k++) {
                    product += v[i][k] * a[k][k] * v[j][k];
                    dot += v[k][i] * v[k][j];
                }
                assert_true(fabs(product - whole[i][j]) < 1e-9);
                assert_true(fabs(dot - (i == j)) < 1e-12);
            }
        }
    }
}

/* --- Canonical form ------------------------------------------------------ */

enum { N = 60, SIDE = 48 };

static saga_splat_params make_primitives(void)
{
    const uint32_t attrs = saga_attrs_of_tools(SAGA_TOOL_SLOPE, false);
    const saga_rng r = saga_rng_stream(5, 5);
    saga_splat_params p;
    uint64_t at = 0;

    assert_done(saga_params_alloc(&p, attrs, N, &error));
    for (size_t i = 0; i < N; i++) {
        for (size_t k = 0; k < 4; k++) {
            p.quat[4 * i + k] = (real)(3 * saga_rng_normal(r, at++));
            p.slope[4 * i + k] = (real)saga_rng_normal(r, at++);
        }
        for (size_t k = 0; k < 3; k++) {
            p.mean[3 * i + k] = (real)(0.3 * saga_rng_normal(r, at++));
            p.log2_scale[3 * i + k] = (real)(-4 + saga_rng_normal(r, at++));
            p.colour[3 * i + k] = saga_rng_float(r, at++);
        }
        p.opacity[i] = 1;
        p.t_centre[i] = saga_rng_float(r, at++);
    }
    return p;
}

static void draw(real *image, saga_canvas *c, const saga_splat_params *p)
{
    c->camera = (saga_splat_camera){ .rotation = { 1, 0, 0, 0, 1, 0, 0, 0, 1 },
                                     .centre = { 0, 0, -2 },
                                     .focal = { SIDE, SIDE },
                                     .principal = { SIDE / 2, SIDE / 2 },
                                     .near_plane = R(0.1),
                                     .width = SIDE,
                                     .height = SIDE };
    c->rules.cut = 30; /* nothing jumps across it */
    c->t = R(0.4);
    assert_done(saga_splat_forward(c, p, N, &error));
    memcpy(image, c->image, 3 * SIDE * SIDE * sizeof *image);
}

TEST(canonical_form_should_draw_the_same)
{
    static real before[3 * SIDE * SIDE], after[3 * SIDE * SIDE];
    FREED_BY(saga_params_free) saga_splat_params p = make_primitives();
    double bright = 0;
    FREED_BY(saga_canvas_free) saga_canvas c;

    assert_done(saga_canvas_init(&c, SIDE * SIDE, &error));
    draw(before, &c, &p);
    saga_splat_canonical(&p, N);
    draw(after, &c, &p);
    for (size_t i = 0; i < 3 * SIDE * SIDE; i++) {
        bright += (double)before[i];
        assert_true(fabsf(before[i] - after[i]) < 2e-5f);
    }
    assert_true(bright > 100);
    for (size_t i = 0; i < N; i++) {
        const real *const q = p.quat + 4 * i;

        assert_true(fabsf(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] +
                          q[3] * q[3] - 1) < 1e-5f);
        /* No rotation is farther than 62.8 degrees from the nearest symmetry
         * of the cube, hence w >= cos(31.4 degrees). */
        assert_true(q[0] > R(0.853));
    }
}
