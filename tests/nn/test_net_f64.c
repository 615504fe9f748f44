/* SPDX-License-Identifier: MIT
 *
 * Networks in double are compared with a naive evaluation, their gradients with
 * finite differences of weights, biases and inputs, the embedding with sine and
 * cosine.
 */
#include "embedding.h"
#include "net.h"
#include "rng.h"
#include "testing.h"

#define TOLERANCE 1e-6

static const saga_net shapes[] = { { .n_layers = 3, .dim = { 7, 13, 9, 5 } },
                                   { .n_layers = 2, .dim = { 16, 32, 3 } },
                                   { .n_layers = 1, .dim = { 1, 1 } },
                                   { .n_layers = 4,
                                     .dim = { 24, 8, 40, 12, 21 } } };
enum { N_SHAPES = sizeof shapes / sizeof *shapes };

static void random_reals(real *x, size_t n, uint64_t stream)
{
    const saga_rng r = saga_rng_stream(17, stream);

    for (size_t i = 0; i < n; i++)
        x[i] = saga_rng_normal(r, i);
}

static double naive(const saga_net *net, const real *x, const real *dy)
{
    double a[64], b[64], sum = 0;

    for (int i = 0; i < net->dim[0]; i++)
        a[i] = x[i];
    for (int l = 0; l < net->n_layers; l++) {
        for (int o = 0; o < net->dim[l + 1]; o++) {
            b[o] = net->b[l][o];
            for (int i = 0; i < net->dim[l]; i++)
                b[o] += net->w[l][o * net->dim[l] + i] * a[i];
            if (l + 1 < net->n_layers && b[o] < 0)
                b[o] = 0;
        }
        memcpy(a, b, sizeof a);
    }
    for (int o = 0; o < net->dim[net->n_layers]; o++)
        sum += a[o] * dy[o];
    return sum;
}

static double loss(const saga_net *net, const real *x, const real *dy, size_t m)
{
    double sum = 0;

    for (size_t i = 0; i < m; i++)
        sum += naive(net, x + i * (size_t)net->dim[0],
                     dy + i * (size_t)net->dim[net->n_layers]);
    return sum;
}

static double worst_error(const saga_net *net, real *v, const real *d, size_t n,
                          const real *x, const real *dy, size_t m)
{
    const double step = 1e-6;
    double top = 0, worst = 0;

    for (size_t i = 0; i < n; i++)
        top = fmax(top, fabs(d[i]));
    for (size_t i = 0; i < n; i++) {
        const double old = v[i];
        double slope;

        v[i] = old + step;
        slope = loss(net, x, dy, m);
        v[i] = old - step;
        slope = (slope - loss(net, x, dy, m)) / (2 * step);
        v[i] = old;
        worst = fmax(worst, fabs(slope - d[i]) / fmax(fabs(slope), 0.01 * top));
    }
    return worst;
}

static void check(saga_net net, size_t m)
{
    const size_t n = saga_net_n_params(&net);
    const size_t n_x = m * (size_t)net.dim[0];
    const size_t n_y = m * (size_t)net.dim[net.n_layers];
    FREED real *const w = calloc(2 * n + 2 * n_x + 2 * n_y, sizeof *w);
    real *const dw = w + n, *const x = dw + n, *const dx = x + n_x;
    real *const y = dx + n_x, *const dy = y + n_y;
    saga_net d = net;
    FREED_BY(saga_net_free) saga_net_work work;
    double sum = 0, e_w, e_x;

    assert_done(saga_net_reserve(&work, &net, m, &error));
    saga_net_bind(&net, w);
    saga_net_bind(&d, dw);
    saga_net_init(&net, 3);
    random_reals(net.b[0], (size_t)net.dim[1], 1);
    random_reals(x, n_x, 2);
    random_reals(dy, n_y, 3);
    saga_net_forward(y, &work, x, m, &net);
    for (size_t i = 0; i < n_y; i++)
        sum += y[i] * dy[i];
    assert_true(fabs(sum - loss(&net, x, dy, m)) < 1e-12 * (double)(n_y + 1));
    saga_net_backward(dx, &d, &work, dy, x, m, &net);
    e_w = worst_error(&net, w, dw, n, x, dy, m);
    e_x = worst_error(&net, x, dx, n_x, x, dy, m);
    printf("  %d layers, %zu points: weights %.1e, input %.1e\n", net.n_layers,
           m, e_w, e_x);
    assert_true(e_w < TOLERANCE && e_x < TOLERANCE);
}

TEST(net_gradient_should_match_differences)
{
    for (int k = 0; k < N_SHAPES; k++) {
        check(shapes[k], 1);
        check(shapes[k], 6);
    }
}

TEST(net_should_accept_no_points)
{
    check(shapes[0], 0);
}

TEST(embedding_should_be_sine_and_cosine)
{
    double u, worst = 0;

    for (u = -9; u < 9; u += 0.0123) {
        real y[2 * 5];

        saga_embedding_forward(y, 10, &u, 1, 1, 5);
        for (int k = 0; k < 5; k++) {
            const double angle = acos(-1) / 2 * (1 << k) * u;

            worst = fmax(worst, fabs(y[2 * k] - sin(angle)));
            worst = fmax(worst, fabs(y[2 * k + 1] - cos(angle)));
        }
    }
    assert_true(worst < 1e-13);
}
