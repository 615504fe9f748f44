/* SPDX-License-Identifier: MIT
 *
 * Networks go from reals to symbols, to the decoder's integers, and back.
 * Layers of random sizes and ranges replace those of random models, and the
 * encoder's traversal dequantises them.
 */
#include "cost.h"
#include "encode.h"
#include "gen_stream.h"
#include "quantise.h"
#include "testing.h"

enum { N_MODELS = 40 };

typedef struct {
    float weight[SAGA_MAX_VECTOR * SAGA_MAX_WIDTH], bias[SAGA_MAX_VECTOR];
    uint8_t q_out[SAGA_MAX_VECTOR], finer[SAGA_MAX_VECTOR];
    saga_layer_values v;
} layer;

static double real_in(uint64_t *r, double lo, double hi)
{
    return lo + (hi - lo) * (double)(gen_random(r) >> 11) * 0x1p-53;
}

/* Makes a layer whose rows have ranges up to `octaves` octaves apart. */
static void make_layer(layer *l, uint32_t n_in, uint32_t n_out, int q_in,
                       int int8, double octaves, uint64_t *r)
{
    for (uint32_t row = 0; row < n_out; row++) {
        const double range = 0.3 * exp2(real_in(r, -octaves, octaves) / 2);

        for (uint32_t k = 0; k < n_in; k++)
            l->weight[row * n_in + k] = (float)(range * real_in(r, -1, 1));
        l->bias[row] = (float)real_in(r, -1, 1);
        l->q_out[row] = (uint8_t)gen_range(r, 8, 10);
    }
    l->v = (saga_layer_values){ l->weight,
                                l->bias,
                                n_in,
                                n_out,
                                q_in,
                                l->q_out,
                                l->finer,
                                0,
                                (float)exp2(real_in(r, -9, -3)),
                                (float)exp2(gen_range(r, -9, -3)),
                                int8,
                                0,
                                0 };
}

/* --- Against the traversal ----------------------------------------------- */

/* Checks that the integers of a row, converted to reals, are those of
 * saga_dequantise_layer. */
static void check_row(const saga_nets *nets, const uint8_t *block, int net,
                      int i, uint32_t row, const layer *l, const float *weight,
                      const float *bias)
{
    saga_layer got;
    int e;

    saga_nets_layer(&got, nets, block, net, i);
    e = got.shift[row] + l->q_out[row] - l->v.q_in;
    for (uint32_t k = 0; k < l->v.n_in; k++) {
        const size_t at = saga_mlp_weight_at(l->v.n_in, l->v.n_out, row, k);
        const int w = got.int8 ? ((const int8_t *)got.weight)[at]
                               : ((const int16_t *)got.weight)[at];

        assert_true(fabs(ldexp(w, (k < l->v.n_finer ? l->finer[k] : 0) - e) -
                         (double)weight[row * l->v.n_in + k]) < 1e-12);
    }
    assert_true(fabs(ldexp(got.bias[row], -e - l->v.q_in) - (double)bias[row]) <
                1e-12);
}

static void quantise(saga_layer_symbols *s, const layer *l)
{
    assert_done(saga_quantise_layer(s, &l->v, &error));
}

static void replace(saga_layer_symbols *s, const layer *l)
{
    uint8_t *const finer = s->finer;

    s->finer = NULL;
    saga_layer_symbols_free(s);
    quantise(s, l);
    s->finer = finer;
}

/* Hidden units of F_fine, F_geo and F_color, and features of fine anchors, have
 * formats of their own. */
static void set_finer(layer *l, const gen_stream *g, int net, int i)
{
    const saga_model *const m = &g->header.model;
    const saga_layer_symbols *before = i ? &g->nets.layer[net][i - 1] : NULL;

    if (i &&
        (net == SAGA_NET_FINE || net == SAGA_NET_GEO || net == SAGA_NET_COLOUR))
        l->v.n_finer = m->width[net];
    if (i == 0 && net == SAGA_NET_COLOUR) {
        l->v.n_finer = m->width[net];
        before = &g->nets.layer[SAGA_NET_COLOUR_BASE][0];
    }
    if (i == 0 && !m->width[SAGA_NET_FUSE_F] &&
        (net == SAGA_NET_GEO || net == SAGA_NET_COLOUR_BASE)) {
        l->v.n_finer = m->features;
        before = &g->nets.layer[SAGA_NET_FINE][m->width[SAGA_NET_FINE] ? 2 : 0];
    }
    if (l->v.n_finer)
        memcpy(l->finer, before->finer, l->v.n_finer);
}

static void check_model(uint64_t seed, double octaves)
{
    const gen_options o = { .seed = seed, .level = 1, .n_segments = 1 };
    static layer l[SAGA_N_NETS][SAGA_MAX_NET_LAYERS];
    static float weight[SAGA_MAX_VECTOR * SAGA_MAX_WIDTH];
    static float bias[SAGA_MAX_VECTOR];
    const saga_nets *nets;
    const uint8_t *block;
    saga_error error = { "" };
    saga_encoder *e;
    uint64_t r = seed;
    saga_net_shape s;
    FREED_BY(gen_stream_free) gen_stream g = gen_stream_make(&o);

    for (int net = 0; net < SAGA_N_NETS; net++) {
        saga_model_net(&s, &g.header.model, net);
        for (int i = 0; i < s.n_layers; i++) {
            make_layer(&l[net][i], s.dim[i], s.dim[i + 1],
                       gen_range(&r, 10, 14), s.int8, octaves, &r);
            set_finer(&l[net][i], &g, net, i);
            replace(&g.nets.layer[net][i], &l[net][i]);
        }
    }
    e = saga_encoder_open(&g.header, g.rig, &g.nets, &error);
    if (!e)
        fail_msg("seed %d: %s", (int)seed, error.message);
    block = saga_encoder_params(e, &nets);
    for (int net = 0; net < SAGA_N_NETS; net++) {
        saga_model_net(&s, &g.header.model, net);
        for (int i = 0; i < s.n_layers; i++) {
            saga_dequantise_layer(weight, bias, &g.nets.layer[net][i],
                                  &l[net][i].v);
            for (uint32_t row = 0; row < s.dim[i + 1]; row++)
                check_row(nets, block, net, i, row, &l[net][i], weight, bias);
        }
    }
    saga_encoder_free(e);
}

/* The symbols of a layer must be valid for rows of any range, and
 * saga_dequantise_layer must give the decoder's values, for int16 and int8. */
TEST(quantiser_should_say_what_the_decoder_has)
{
    for (uint64_t seed = 1; seed <= N_MODELS; seed++)
        check_model(seed, seed % 2 ? 2 : 12);
}

/* --- Precision ----------------------------------------------------------- */

/* Checks the integers of a layer of 64 x 32. Weights must be within `part` of
 * their step plus `slack` of the wanted values, biases within `part` of their
 * step. */
static void check_rounding(const layer *l, double part, double slack)
{
    static float weight[64 * 32], bias[32];
    FREED_BY(saga_layer_symbols_free) saga_layer_symbols s = { .finer = NULL };

    quantise(&s, l);
    saga_dequantise_layer(weight, bias, &s, &l->v);
    for (uint32_t i = 0; i < 64 * 32; i++)
        assert_true(fabs((double)weight[i] - (double)l->weight[i]) <=
                    (double)l->v.step * part + slack);
    for (uint32_t i = 0; i < 32; i++)
        assert_true(fabs((double)bias[i] - (double)l->bias[i]) <=
                    (double)l->v.bias_step * part);
}

/* Weights must be rounded to within half a step plus half an LSB, and biases to
 * within half their own step. With 64 inputs and rows of equal range, sum|w| is
 * below 64 * 0.3 < 2^5, so that a scale of 2^11 is valid and an LSB is at most
 * 2^-11. */
TEST(quantiser_should_round_to_half_a_step)
{
    static layer l;
    uint64_t r = 5;

    for (uint32_t k = 0; k < 50; k++) {
        make_layer(&l, 64, 32, 12, 0, 0, &r);
        check_rounding(&l, 0.5001, 0x1p-12);
    }
}

/* If the largest valid scale, 2^19 for a sum|w| below 64 * 0.3 / 2^7, needs a
 * longer shift than a row of q_out 7 may have, a smaller scale must be used.
 * The row's steps must not change. */
TEST(quantiser_should_keep_steps_where_shifts_end)
{
    static layer l;
    uint64_t r = 7;

    make_layer(&l, 64, 32, 13, 0, 0, &r);
    for (uint32_t i = 0; i < 64 * 32; i++)
        l.weight[i] *= 0x1p-7f;
    for (uint32_t i = 0; i < 32; i++) {
        l.bias[i] *= 0x1p-7f;
        l.q_out[i] = (uint8_t)(i % 2 ? 7 : 13);
    }
    l.v.step = 0x1p-12f;
    l.v.bias_step = 0x1p-12f;
    check_rounding(&l, 0.5 * 1.0001, 0);
}

/* Weights that are multiples of the step must be kept: the symbols must be
 * these multiples, and integers must be within half an LSB of them. */
TEST(quantiser_should_keep_what_is_rounded_already)
{
    static layer l;
    static float weight[64 * 32], bias[32];
    FREED_BY(saga_layer_symbols_free) saga_layer_symbols s = { .finer = NULL };
    uint64_t r = 6;

    make_layer(&l, 64, 32, 12, 0, 0, &r);
    l.v.step = 0.037f;
    for (uint32_t i = 0; i < 64 * 32; i++)
        l.weight[i] = 0.037f * (float)(int)(l.weight[i] / 0.037f);
    quantise(&s, &l);
    saga_dequantise_layer(weight, bias, &s, &l.v);
    for (uint32_t i = 0; i < 64 * 32; i++) {
        assert_int_equal(s.weight[i], lround((double)l.weight[i] / 0.037));
        assert_true(fabs((double)weight[i] - (double)l.weight[i]) <=
                    0x1p-12 + 1e-6);
    }
}

/* Weights of 8 bits that are multiples of a power of two must be kept exactly,
 * up to 127 times this step. In a row with larger weights, the steps of weights
 * and bias must be doubled. */
TEST(quantiser_should_meet_8_bits)
{
    const double step = 0x1p-5;
    static layer l;
    static float weight[64 * 32], bias[32];
    FREED_BY(saga_layer_symbols_free) saga_layer_symbols s = { .finer = NULL };
    uint64_t r = 8;

    make_layer(&l, 64, 32, 12, 1, 0, &r);
    l.v.step = l.v.bias_step = (float)step;
    for (uint32_t row = 0; row < 32; row++) {
        const double unit = row % 3 ? step : 2 * step;

        for (uint32_t k = 0; k < 64; k++)
            l.weight[row * 64 + k] = (float)(unit * gen_range(&r, -127, 127));
        l.weight[row * 64] = (float)(unit * 127);
        l.bias[row] = (float)(unit * gen_range(&r, -99, 99));
    }
    quantise(&s, &l);
    saga_dequantise_layer(weight, bias, &s, &l.v);
    assert_memory_equal(weight, l.weight, sizeof weight);
    assert_memory_equal(bias, l.bias, sizeof bias);
}

/* A row of q_out 9 from inputs of q_in 12 has a shift of 0 at the scale 2^-3,
 * where steps of 1 have become 8. A weight is at most 32767 of these, in 16
 * bits, and a bias 65535, the largest residual; both are rounded, and larger
 * ones are cut. A sum of two weights of 32767 leaves 131,069 below 2^31, less
 * than the largest bias, which is 65535 << 9 in the format of the sum. */
TEST(quantiser_should_cut_a_row_that_no_scale_makes_valid)
{
    static const struct {
        float weight[2], bias;
        int32_t symbol[2], bias_symbol;
        int valid;
    } row[] = {
        { { 32766 * 8 + 3, 0 }, 0, { 32766, 0 }, 0, 1 },
        { { 32767 * 8 + 4, 0 }, 0, { 32767, 0 }, 0, 1 },
        { { 32767 * 8, -32767 * 8 }, 0, { 32767, -32767 }, 0, 1 },
        { { 0, 0 }, 65535 * 8 + 4, { 0, 0 }, 65535, 1 },
        { { 8, -1e30f }, 0, { 1, -32767 }, 0, 1 },
        { { 0, 0 }, -1e30f, { 0, 0 }, -65535, 1 },
        { { 32767 * 8, 32767 * 8 }, 65535 * 8, { 0, 0 }, 0, 0 },
    };
    const uint8_t q_out[2] = { 9, 9 };

    for (size_t i = 0; i < sizeof row / sizeof *row; i++) {
        const float weight[4] = { 1, 1, row[i].weight[0], row[i].weight[1] };
        const float bias[2] = { 1, row[i].bias };
        const saga_layer_values v = { weight, bias,         2, 2, 12,
                                      q_out,  NULL,         0, 1, 1,
                                      0,      SAGA_NET_GEO, 2 };
        FREED_BY(saga_layer_symbols_free)
        saga_layer_symbols s = { .finer = NULL };
        saga_error error = { "" };

        assert_int_equal(saga_quantise_layer(&s, &v, &error), row[i].valid);
        if (row[i].valid) {
            assert_memory_equal(s.weight + 2, row[i].symbol,
                                sizeof row[i].symbol);
            assert_int_equal(s.bias[1], row[i].bias_symbol);
            assert_int_equal(s.shift[1], 0);
        } else {
            assert_string_equal(error.message,
                                "row 1 of layer 2 of network 7 is too large "
                                "to be coded; try another --seed, and report "
                                "this error");
        }
    }
}

/* --- Scales -------------------------------------------------------------- */

/* Checks the scales of rows or columns. Weights are uniform within +-20 steps
 * in the first line, and within half an octave less in each further line. The
 * normal distribution with the fewest bits has their deviation, 20 / sqrt(3)
 * steps, which is scale index 22 + 7 log2(11.5) = 46.7, less 3.5 for each line.
 * Indices must be within 2, because drops are 4 indices apart, plus 0.8,
 * because the deviation of 32 values varies by 0.08. */
static void check_scales(int mode)
{
    static layer l;
    FREED_BY(saga_layer_symbols_free) saga_layer_symbols s = { .finer = NULL };
    double bits = 0, least;
    uint64_t r = 9;

    make_layer(&l, 64, 32, 12, 0, 0, &r);
    l.v.step = 0x1p-8f;
    for (uint32_t row = 0; row < 32; row++)
        for (uint32_t k = 0; k < 64; k++) {
            const uint32_t line = mode == SAGA_SCALE_ROW      ? row % 8
                                  : mode == SAGA_SCALE_COLUMN ? k % 8
                                                              : 0;

            l.weight[row * 64 + k] = (float)(20 * 0x1p-8 * exp2(-0.5 * line) *
                                             real_in(&r, -1, 1));
        }
    quantise(&s, &l);
    assert_int_equal(s.scale_mode, mode);
    for (uint32_t row = 0; row < 32; row++)
        for (uint32_t k = 0; k < 64; k++) {
            const uint32_t line = mode == SAGA_SCALE_ROW      ? row % 8
                                  : mode == SAGA_SCALE_COLUMN ? k % 8
                                                              : 0;
            const uint32_t scale = gen_scale_of(&s, row, k);

            assert_true(fabs(scale - 46.7 + 3.5 * line) <= 4);
            bits += saga_cost_residual(s.weight[row * 64 + k], scale);
        }
    bits += SAGA_QUANTISE_LINE_BITS * saga_scale_lines(s.scale_mode, 64, 32);
    assert_done(saga_quantise_bits(&least, l.weight, 32, 64, 0x1p-8, &error));
    assert_true(fabs(bits - least) < 1e-6 * bits);
}

TEST(quantiser_should_choose_scales_as_weights_spread)
{
    for (int mode = 0; mode < SAGA_N_SCALE_MODES; mode++)
        check_scales(mode);
}
