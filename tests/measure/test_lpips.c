/* SPDX-License-Identifier: MIT
 *
 * Convolution and pooling are compared with their definitions, and LPIPS with
 * the reference values that came with the weights, if ../shared/data has them.
 */
#include "conv.h"
#include "file.h"
#include "lpips.h"
#include "picture.h"
#include "testing.h"

#define DATA "../shared/data/lpips/"

static saga_error error;

static uint32_t state_of_random = 1;

static double next(void)
{
    state_of_random = state_of_random * 1664525u + 1013904223u;
    return (state_of_random >> 8) / 8388608.0 - 1.0;
}

static double *numbers(size_t n)
{
    double *const v = must(malloc(n * sizeof *v));

    for (size_t i = 0; i < n; i++)
        v[i] = next();
    return v;
}

static saga_planes planes(int n, int height, int width)
{
    saga_planes p = { n, height, width, NULL };
    const size_t all = (size_t)(n * height * width);

    p.v = must(malloc(all * sizeof *p.v));
    for (size_t i = 0; i < all; i++)
        p.v[i] = (float)next();
    return p;
}

static double at(const saga_planes *p, int c, int y, int x)
{
    return y < 0 || y >= p->height || x < 0 || x >= p->width
               ? 0.0
               : (double)p->v[(c * p->height + y) * p->width + x];
}

/* Computes one output of a convolution by the definition. */
static double convolve(const saga_conv *c, const double *w, double bias,
                       const saga_planes *in, const int to[3])
{
    double sum = bias;

    for (int i = 0; i < c->n_in; i++)
        for (int y = 0; y < c->size; y++)
            for (int x = 0; x < c->size; x++)
                sum += w[((to[0] * c->n_in + i) * c->size + y) * c->size + x] *
                       at(in, i, to[1] * c->stride + y - c->pad,
                          to[2] * c->stride + x - c->pad);
    return sum > 0.0 ? sum : 0.0;
}

TEST(convolution_should_be_its_definition)
{
    static const struct {
        int n_out, n_in, size, stride, pad, height, width;
    } cases[] = { { 5, 3, 3, 1, 1, 9, 13 },
                  { 8, 2, 11, 4, 2, 31, 26 },
                  { 3, 7, 1, 1, 0, 10, 11 },
                  { 4, 4, 5, 1, 2, 4, 3 },
                  { 1, 1, 3, 2, 0, 17, 33 } };

    for (size_t k = 0; k < sizeof cases / sizeof cases[0]; k++) {
        saga_conv c = { .n_out = cases[k].n_out,
                        .n_in = cases[k].n_in,
                        .size = cases[k].size,
                        .stride = cases[k].stride,
                        .pad = cases[k].pad };
        saga_planes in = planes(c.n_in, cases[k].height, cases[k].width);
        FREED double *const w = numbers(
            (size_t)(c.n_out * c.n_in * c.size * c.size));
        FREED double *const b = numbers((size_t)c.n_out);
        saga_planes out;

        assert_true(saga_conv_pack(&c, w, b, &error));
        assert_true(saga_conv_run(&out, &c, &in, 1 + (int)k % 3, &error));
        assert_int_equal(out.n, c.n_out);
        assert_int_equal(out.height,
                         (in.height + 2 * c.pad - c.size) / c.stride + 1);
        for (int o = 0; o < out.n; o++)
            for (int y = 0; y < out.height; y++)
                for (int x = 0; x < out.width; x++) {
                    const int to[3] = { o, y, x };

                    assert_true(fabs(at(&out, o, y, x) -
                                     convolve(&c, w, b[o], &in, to)) < 2e-5);
                }
        saga_conv_free(&c);
        free(in.v);
        free(out.v);
    }
}

/* Returns the number of windows of 3 samples, 2 apart, along a side: those that
 * fit and, with `ceil`, one more that begins inside if these do not reach the
 * end. */
static int windows(int side, bool ceil)
{
    const int full = (side - 3) / 2 + 1;

    return full + (ceil && 2 * (full - 1) + 3 < side);
}

TEST(pooling_should_take_the_last_window_when_ceil)
{
    for (int side = 3; side < 12; side++)
        for (int ceil = 0; ceil < 2; ceil++) {
            saga_planes in = planes(2, side, side + 1), out;

            assert_true(saga_pool_max(&out, &in, 3, 2, ceil, &error));
            assert_int_equal(out.height, windows(side, ceil));
            assert_int_equal(out.width, windows(side + 1, ceil));
            for (int c = 0; c < 2; c++)
                for (int y = 0; y < out.height; y++)
                    for (int x = 0; x < out.width; x++) {
                        double most = -2.0;

                        for (int i = 0; i < 9; i++)
                            if (2 * y + i / 3 < in.height &&
                                2 * x + i % 3 < in.width)
                                most = fmax(most, at(&in, c, 2 * y + i / 3,
                                                     2 * x + i % 3));
                        assert_true(at(&out, c, y, x) == most);
                    }
            free(in.v);
            free(out.v);
        }
}

enum { SIDE = 64 };

/* The distances that the data's README gives, computed with numpy. */
static const struct {
    const char *weights;
    double distance[2];
} references[] = { { "lpips_alex_v0.1.npz", { 0.721881, 0.137566 } },
                   { "lpips_squeeze_v0.1.npz", { 0.711047, 0.147902 } } };

static void load(uint8_t *rgb, const char *name)
{
    char path[80];

    snprintf(path, sizeof path, DATA "%s", name);
    if (!saga_picture_read(
            path, &(saga_picture_wish){ .width = SIDE, .height = SIDE }, rgb,
            &error))
        fail_msg("%s", error.message);
}

TEST(lpips_should_be_the_reference_values)
{
    static uint8_t truth[3 * SIDE * SIDE], other[2][3 * SIDE * SIDE];

    if (!saga_path_is_folder(DATA)) {
        printf("skipped: there is no " DATA "\n");
        return;
    }
    load(truth, "ex_ref.png");
    load(other[0], "ex_p0.png");
    load(other[1], "ex_p1.png");
    for (int i = 0; i < 2; i++) {
        char path[80];
        saga_lpips *l;
        double d, again;

        snprintf(path, sizeof path, DATA "%s", references[i].weights);
        l = saga_lpips_load(path, &error);
        if (!l)
            fail_msg("%s", error.message);
        for (int k = 0; k < 2; k++) {
            saga_picture_pair p = { truth, other[k], SIDE, SIDE, 1 };

            assert_true(saga_lpips_distance(&d, l, &p, &error));
            if (!(fabs(d - references[i].distance[k]) < 1e-5))
                fail_msg("%s: %.8f", references[i].weights, d);
            p.n_threads = 3;
            assert_true(saga_lpips_distance(&again, l, &p, &error));
            assert_true(d == again);
            p.b = truth;
            assert_true(saga_lpips_distance(&d, l, &p, &error));
            assert_true(d == 0.0);
            p.width = p.height = 12;
            assert_true(saga_lpips_distance(&d, l, &p, &error));
            assert_true(isnan(d));
        }
        saga_lpips_free(l);
    }
}
