/* SPDX-License-Identifier: MIT
 *
 * The rate of networks' parameters. Gradients are compared with central
 * differences, bits with the code length by the integers of common/prob.h. The
 * rounding of layers is tested on inputs for which its result, or a bound of
 * its error, can be derived.
 */
#include "cost.h"
#include "quantise.h"
#include "rng.h"
#include "testing.h"
#include "weight_rate.h"
#include "weight_round.h"

/* --- A scene's networks -------------------------------------------------- */

enum { FIRST = SAGA_NET_FUSE_C, SECOND = SAGA_NET_COLOUR, N_PARAMS = 60 };

/* Networks with 3-4-2 and 5-4-2 units, and one without inputs, which has no
 * tensors. */
typedef struct {
    saga_net net[SAGA_N_NETS];
    double x[N_PARAMS], y[N_PARAMS], dx[N_PARAMS], c[N_PARAMS];
    saga_weights w;
} fixture;

static void set_dims(saga_net *net, int a, int b, int c)
{
    net->n_layers = 2;
    net->dim[0] = a;
    net->dim[1] = b;
    net->dim[2] = c;
}

/* Makes the columns of the first layer and the rows of the third so different
 * that each gets a deviation of its own, none below that of the lowest scale.
 */
static void spread(fixture *f)
{
    double *const columns = f->x + f->w.tensor[0].at;
    double *const rows = f->x + f->w.tensor[4].at;

    for (int i = 0; i < 4 * 3; i++)
        columns[i] *= exp2(-2 * (i % 3));
    for (int i = 0; i < 4 * 5; i++)
        rows[i] *= exp2(-1.5 * (i / 5));
}

static void begin(fixture *f)
{
    const uint8_t int8[SAGA_N_NETS] = { 0 };
    const saga_rng r = saga_rng_stream(3, 0);

    memset(f, 0, sizeof *f);
    set_dims(&f->net[FIRST], 3, 4, 2);
    set_dims(&f->net[SECOND], 5, 4, 2);
    f->net[SAGA_NET_E_PRIM].n_layers = 1;
    f->net[SAGA_NET_E_PRIM].dim[1] = 7;
    saga_net_bind(&f->net[FIRST], f->x);
    saga_net_bind(&f->net[SECOND], f->x + saga_net_n_params(&f->net[FIRST]));
    assert_int_equal(saga_net_n_params(&f->net[FIRST]) +
                         saga_net_n_params(&f->net[SECOND]),
                     N_PARAMS);
    for (size_t i = 0; i < N_PARAMS; i++) {
        f->x[i] = saga_rng_normal(r, i);
        f->c[i] = saga_rng_normal(r, 1000 + i);
    }
    saga_weights_list(&f->w, f->net, int8, f->x);
    for (int t = 0; t < f->w.n; t++)
        f->w.log2_step[t] = -5.3 + 0.7 * t;
    spread(f);
}

TEST(list_should_hold_every_parameter_once)
{
    static fixture f;
    int seen[N_PARAMS] = { 0 };

    begin(&f);
    assert_int_equal(f.w.n, 8);
    for (int t = 0; t < f.w.n; t++)
        for (size_t i = 0; i < f.w.tensor[t].rows * f.w.tensor[t].cols; i++)
            seen[f.w.tensor[t].at + i]++;
    for (size_t i = 0; i < N_PARAMS; i++)
        assert_int_equal(seen[i], 1);
    assert_int_equal(saga_weights_find(&f.w, FIRST, 1), 2);
    assert_int_equal(f.w.tensor[6].rows, 2);
    assert_int_equal(f.w.tensor[6].cols, 4);
    assert_int_equal(f.w.tensor[7].cols, 1);
    assert_int_equal(saga_weights_find(&f.w, SAGA_NET_E_PRIM, 0), -1);
}

/* The first step of a tensor must be 1/64 of its root mean square; for biases
 * that are 0 or small, 1/64 of that of their layer's weights. */
TEST(steps_should_begin_fine)
{
    static fixture f;

    begin(&f);
    for (size_t i = 0; i < N_PARAMS; i++)
        f.x[i] = i % 2 ? 2 : -2;
    for (size_t i = 0; i < f.w.tensor[1].rows; i++)
        f.x[f.w.tensor[1].at + i] = 0;
    for (size_t i = 0; i < f.w.tensor[3].rows; i++)
        f.x[f.w.tensor[3].at + i] = 8;
    for (size_t i = 0; i < f.w.tensor[4].rows * f.w.tensor[4].cols; i++)
        f.x[f.w.tensor[4].at + i] = 0.25;
    saga_weights_start(&f.w, f.x);
    assert_float_equal(f.w.log2_step[0], -5, 1e-9);
    assert_float_equal(f.w.log2_step[1], -5, 1e-9);
    assert_float_equal(f.w.log2_step[3], -3, 1e-9);
    assert_float_equal(f.w.log2_step[4], -8, 1e-9);
    assert_float_equal(f.w.log2_step[5], -5, 1e-9);
}

/* A network that is fixed must stay as it is, without noise, bits or
 * gradients. */
TEST(fixed_weights_should_stay)
{
    static fixture f;
    real d[N_PARAMS];
    size_t first, end;

    begin(&f);
    saga_weights_fix(&f.w, SECOND);
    first = f.w.tensor[4].at;
    end = f.w.tensor[6].at;
    saga_weights_start(&f.w, f.x);
    assert_true(f.w.log2_step[4] == 0);
    assert_true(f.w.log2_step[5] == -SAGA_FIXED_BIAS);
    memcpy(f.y, f.x, sizeof f.y);
    saga_weights_noise(f.y, f.x, &f.w, 0, 0.5, 3);
    for (size_t i = 0; i < N_PARAMS; i++)
        d[i] = 1;
    saga_weights_rate(d, &f.w, f.y, f.x, 1);
    for (size_t i = 0; i < N_PARAMS; i++)
        assert_int_equal(f.y[i] == f.x[i] && d[i] == 0, i >= first && i < end);
    for (int t = 4; t < 6; t++)
        assert_true(f.w.bits[t] == 0 && f.w.d_log2_step[t] == 0);
}

/* --- Noise --------------------------------------------------------------- */

/* Noise must be uniform in +-noise step / 2, with a variance of
 * (noise step)^2 / 12. Tensors that are rounded must get none. */
TEST(noise_should_have_the_size_of_the_step)
{
    static fixture f;
    double square[8] = { 0 };

    begin(&f);
    for (int k = 0; k < 2000; k++) {
        saga_weights_noise(f.y, f.x, &f.w, 2, 0.5, (uint64_t)k);
        for (int t = 0; t < f.w.n; t++)
            for (size_t i = 0; i < f.w.tensor[t].rows * f.w.tensor[t].cols;
                 i++) {
                const double e = f.y[f.w.tensor[t].at + i] -
                                 f.x[f.w.tensor[t].at + i];
                const double size = 0.5 * saga_weights_step(&f.w, t);

                assert_true(fabs(e) <= (t < 2 ? 0 : size / 2));
                square[t] += e * e * 12 / (size * size) /
                             (double)(f.w.tensor[t].rows * f.w.tensor[t].cols);
            }
    }
    for (int t = 2; t < f.w.n; t++)
        assert_true(fabs(square[t] / 2000 - 1) < 0.05);
}

/* The format has powers of two as steps of biases, and any step for weights.
 * Integer weights of 8 bits represent multiples of a step exactly only if it is
 * a power of two, so that these must be powers of two as well. */
TEST(steps_should_be_powers_of_two_where_others_are_missed)
{
    static fixture f;

    begin(&f);
    f.w.log2_step[0] = f.w.log2_step[1] = -3.4;
    f.w.log2_step[3] = -3.5;
    f.w.log2_step[4] = -3.4;
    f.w.tensor[4].int8 = true;
    assert_true(fabs(saga_weights_step(&f.w, 0) - exp2(-3.4)) < 1e-15);
    assert_true(fabs(saga_weights_step(&f.w, 1) - 0.125) < 1e-15);
    assert_true(fabs(saga_weights_step(&f.w, 3) - 0.125) < 1e-15);
    assert_true(fabs(saga_weights_step(&f.w, 4) - 0.125) < 1e-15);
}

/* --- Gradients ----------------------------------------------------------- */

/* Returns sum c y + price bits(y), where y is x with noise; the distortion is
 * linear in y. The deviations are measured on `at` and constant, as in a step
 * of training. */
static double loss(fixture *f, const double *at, double price)
{
    static double unused[N_PARAMS];
    double sum = 0;

    saga_weights_noise(f->y, f->x, &f->w, 0, 1, 77);
    for (size_t i = 0; i < N_PARAMS; i++)
        sum += f->c[i] * f->y[i];
    return sum + price * saga_weights_rate(unused, &f->w, f->y, at, price);
}

static int is_close(double a, double b)
{
    return fabs(a - b) <= 1e-6 * (1 + fabs(a) + fabs(b));
}

TEST(rate_should_have_the_gradient_of_its_differences)
{
    static fixture f;
    static double at[N_PARAMS];
    const double price = 0.3, h = 1e-5;
    saga_weights analytic;

    begin(&f);
    memcpy(at, f.x, sizeof at);
    memcpy(f.dx, f.c, sizeof f.dx);
    loss(&f, at, price);
    saga_weights_rate(f.dx, &f.w, f.y, at, price);
    analytic = f.w;
    assert_int_equal(f.w.mode[0], SAGA_SCALE_COLUMN);
    assert_int_equal(f.w.mode[4], SAGA_SCALE_ROW);
    assert_int_equal(f.w.mode[6], SAGA_SCALE_TENSOR);
    for (size_t i = 0; i < N_PARAMS; i++) {
        double up, down;

        f.x[i] = at[i] + h;
        up = loss(&f, at, price);
        f.x[i] = at[i] - h;
        down = loss(&f, at, price);
        f.x[i] = at[i];
        assert_true(is_close(f.dx[i], (up - down) / (2 * h)));
    }
    /* Only the gradients of the weights' steps are compared, because the steps
     * of biases are rounded to powers of two. */
    for (int t = 0; t < f.w.n; t += 2) {
        const double was = f.w.log2_step[t];
        double up, down;

        f.w.log2_step[t] = was + h;
        up = loss(&f, at, price);
        f.w.log2_step[t] = was - h;
        down = loss(&f, at, price);
        f.w.log2_step[t] = was;
        assert_true(is_close(analytic.d_log2_step[t], (up - down) / (2 * h)));
    }
}

/* --- Bits ---------------------------------------------------------------- */

/* A layer of 200 x 100 weights with a step of 1/16, for the comparison of its
 * estimated bits with code lengths. */
enum { ROWS = 200, COLS = 100 };

typedef struct {
    double x[ROWS * COLS + ROWS], y[ROWS * COLS + ROWS];
    saga_weights w;
} layer;

static double sigma_of(int mode, size_t i)
{
    return mode == SAGA_SCALE_ROW      ? 5 * exp2(-0.01 * (double)(i / COLS))
           : mode == SAGA_SCALE_COLUMN ? 5 * exp2(-0.05 * (double)(i % COLS))
                                       : 2.5;
}

static void begin_layer(layer *l, int mode)
{
    static double dx[ROWS * COLS + ROWS];
    const uint8_t int8[SAGA_N_NETS] = { 0 };
    const saga_rng r = saga_rng_stream(9, 1);
    saga_net net[SAGA_N_NETS];

    memset(l, 0, sizeof *l);
    memset(net, 0, sizeof net);
    net[FIRST].n_layers = 1;
    net[FIRST].dim[0] = COLS;
    net[FIRST].dim[1] = ROWS;
    saga_net_bind(&net[FIRST], l->x);
    saga_weights_list(&l->w, net, int8, l->x);
    l->w.log2_step[0] = -4;
    for (size_t i = 0; i < ROWS * COLS; i++)
        l->x[i] = l->y[i] =
            floor(sigma_of(mode, i) * saga_rng_normal(r, i) + 0.5) / 16;
    saga_weights_rate(dx, &l->w, l->y, l->x, 0);
    assert_int_equal(l->w.mode[0], mode);
}

/* For normally distributed weights with a deviation of 2.5 steps, the estimated
 * bits must be within 0.5 % of the code length with the nearest scale of the
 * integer tables. Scales are 1/7 octave apart, and frequencies have 15 bits. */
TEST(rate_should_be_what_the_integers_take)
{
    static layer l;
    double bits = 0;

    begin_layer(&l, SAGA_SCALE_TENSOR);
    for (size_t i = 0; i < ROWS * COLS; i++)
        bits += saga_cost_residual((int32_t)(16 * l.y[i]), SAGA_SCALE_UNIT + 9);
    print_message("  %.0f bits, integers %.0f\n", l.w.bits[0], bits);
    assert_true(fabs(l.w.bits[0] / bits - 1) < 0.005);
}

/* The deviations of the rows or columns fall from 5 steps to 1.25, or to 0.16.
 * The format's scales of rows and columns are 4/7 octave apart. A deviation
 * that is wrong by a factor e^d takes d^2 nats more. On average over
 * d = +-(2/7) ln 2 these are 0.019 bits, 1 % of the 2 bits of a weight. */
TEST(rate_should_be_that_of_scales_by_line)
{
    static layer l;
    static real y[ROWS * COLS];

    for (int mode = SAGA_SCALE_ROW; mode < SAGA_N_SCALE_MODES; mode++) {
        const double side = SAGA_QUANTISE_LINE_BITS *
                            (mode == SAGA_SCALE_ROW ? ROWS : COLS);
        saga_error error = { "" };
        double bits;

        begin_layer(&l, mode);
        for (size_t i = 0; i < ROWS * COLS; i++)
            y[i] = (real)l.y[i];
        assert_true(saga_quantise_bits(&bits, y, ROWS, COLS, 1.0 / 16, &error));
        bits -= side;
        print_message("  %.0f bits, integers %.0f\n", l.w.bits[0], bits);
        assert_true(l.w.bits[0] < bits && bits < 1.012 * l.w.bits[0]);
    }
}

/* --- Rounding ------------------------------------------------------------ */

enum { POINTS = 400, IN = 12, OUT = 5 };

/* Makes inputs that are linear combinations of `ranks` independent ones. */
static void make_inputs(double *x, int ranks)
{
    const saga_rng r = saga_rng_stream(4, (uint64_t)ranks);

    for (size_t p = 0; p < POINTS; p++)
        for (size_t c = 0; c < IN; c++) {
            double sum = 0;

            for (int k = 0; k < ranks; k++)
                sum += saga_rng_normal(r, p * 100 + (size_t)k) *
                       saga_rng_normal(r, 1000000 + c * 100 + (size_t)k);
            x[p * IN + c] = sum;
        }
}

static void make_weights(double *w, double *b)
{
    const saga_rng r = saga_rng_stream(8, 0);

    for (size_t i = 0; i < IN * OUT; i++)
        w[i] = saga_rng_normal(r, i);
    for (size_t i = 0; i < OUT; i++)
        b[i] = saga_rng_normal(r, 500 + i);
}

/* Returns the mean squared difference between the outputs of two layers. */
static double output_error(const double *x, const double *w, const double *b,
                           const double *w0, const double *b0)
{
    double sum = 0;

    for (size_t p = 0; p < POINTS; p++)
        for (size_t o = 0; o < OUT; o++) {
            double e = b[o] - b0[o];

            for (size_t c = 0; c < IN; c++)
                e += (w[o * IN + c] - w0[o * IN + c]) * x[p * IN + c];
            sum += e * e;
        }
    return sum / (POINTS * OUT);
}

static void round_plainly(double *x, size_t n, double step)
{
    for (size_t i = 0; i < n; i++)
        x[i] = step * floor(x[i] / step + 0.5);
}

static void round_both(double *plain, double *ours, const double *x)
{
    double w0[IN * OUT], b0[OUT], w[IN * OUT], b[OUT];
    const saga_weight_round_input in = {
        x, POINTS, IN, IN, OUT, 0.25, 0.125, 0
    };

    make_weights(w0, b0);
    memcpy(w, w0, sizeof w);
    memcpy(b, b0, sizeof b);
    round_plainly(w, IN * OUT, 0.25);
    round_plainly(b, OUT, 0.125);
    *plain = output_error(x, w, b, w0, b0);
    memcpy(w, w0, sizeof w);
    memcpy(b, b0, sizeof b);
    assert_done(saga_weight_round(w, b, &in, &error));
    for (size_t i = 0; i < IN * OUT; i++)
        assert_true(fabs(w[i] / 0.25 - rint(w[i] / 0.25)) < 1e-12);
    for (size_t i = 0; i < OUT; i++)
        assert_true(fabs(b[i] / 0.125 - rint(b[i] / 0.125)) < 1e-12);
    *ours = output_error(x, w, b, w0, b0);
}

/* If inputs span only three dimensions, errors of weights in the other nine
 * directions do not change the outputs. Rounding must use this. */
TEST(rounding_should_hide_errors_where_no_input_goes)
{
    static double x[POINTS * IN];
    double plain, ours;

    make_inputs(x, 3);
    round_both(&plain, &ours, x);
    print_message("  3 of 12 dimensions: %.2g instead of %.2g\n", ours, plain);
    assert_true(ours < plain / 20);
    make_inputs(x, 12);
    round_both(&plain, &ours, x);
    print_message("  12 of 12 dimensions: %.2g instead of %.2g\n", ours, plain);
    assert_true(ours < plain);
}

/* If inputs are orthogonal to each other and to the constant input of the bias
 * (columns of a Hadamard matrix), no error can compensate for another. Each
 * weight must be rounded to nearest. */
TEST(rounding_should_be_plain_for_orthogonal_inputs)
{
    double x[16 * IN], w[IN * OUT], b[OUT], w0[IN * OUT], b0[OUT];
    const saga_weight_round_input in = { x, 16, IN, IN, OUT, 0.25, 0.125, 0 };

    for (size_t p = 0; p < 16; p++)
        for (size_t c = 0; c < IN; c++) {
            const size_t common = p & (c + 1);
            const size_t ones = (common & 1) + (common >> 1 & 1) +
                                (common >> 2 & 1) + (common >> 3 & 1);

            x[p * IN + c] = ones % 2 ? -1 : 1;
        }
    make_weights(w, b);
    memcpy(w0, w, sizeof w);
    memcpy(b0, b, sizeof b);
    assert_done(saga_weight_round(w, b, &in, &error));
    round_plainly(w0, IN * OUT, 0.25);
    round_plainly(b0, OUT, 0.125);
    assert_memory_equal(w, w0, sizeof w);
    assert_memory_equal(b, b0, sizeof b);
}

/* If all inputs are constant, the errors of all weights can be moved into the
 * bias, which is rounded last. Only its own error remains, at most half its
 * step, apart from a thousandth of the sum because of damping. */
TEST(rounding_should_end_with_the_bias)
{
    static double x[POINTS * IN];
    double w[IN * OUT], b[OUT], w0[IN * OUT], b0[OUT];
    const saga_weight_round_input in = {
        x, POINTS, IN, IN, OUT, 0.25, 0.125, 0
    };

    for (size_t i = 0; i < POINTS * IN; i++)
        x[i] = 1;
    make_weights(w, b);
    memcpy(w0, w, sizeof w);
    memcpy(b0, b, sizeof b);
    assert_done(saga_weight_round(w, b, &in, &error));
    for (size_t o = 0; o < OUT; o++) {
        double e = b[o] - b0[o];

        for (size_t c = 0; c < IN; c++)
            e += w[o * IN + c] - w0[o * IN + c];
        assert_true(fabs(e) <= 0.125 / 2 + 0.003);
    }
}

/* Returns whether all weights of a row and its bias are multiples of `times`
 * times their steps. */
static int is_multiple(const double *w, double b, double times)
{
    for (int c = 0; c < IN; c++)
        if (remainder(w[c], 0.25 * times) != 0)
            return 0;
    return remainder(b, 0.125 * times) == 0;
}

/* If a row has a weight of 100 steps and 30 are the limit, the steps of its
 * weights and of its bias must become four times as large. Other rows must keep
 * their steps. */
TEST(rounding_should_double_the_steps_of_large_rows)
{
    static double x[POINTS * IN];
    double w[IN * OUT], b[OUT], w0[IN * OUT], b0[OUT];
    const saga_weight_round_input all = {
        x, POINTS, IN, IN, OUT, 0.25, 0.125, 0
    };
    saga_weight_round_input limited = all;

    make_inputs(x, 3);
    make_weights(w0, b0);
    w0[IN + 5] = 25;
    memcpy(w, w0, sizeof w);
    memcpy(b, b0, sizeof b);
    assert_done(saga_weight_round(w, b, &all, &error));
    limited.most = 30;
    assert_done(saga_weight_round(w0, b0, &limited, &error));
    for (size_t o = 0; o < OUT; o++) {
        for (size_t c = 0; c < IN; c++)
            assert_true(fabs(w0[o * IN + c]) <= 30 * 0.25 * (o == 1 ? 4 : 1));
        if (o != 1)
            assert_memory_equal(w0 + o * IN, w + o * IN, IN * sizeof *w);
    }
    assert_false(is_multiple(w + IN, b[1], 4));
    assert_true(is_multiple(w0 + IN, b0[1], 4));
}
