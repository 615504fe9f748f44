/* SPDX-License-Identifier: MIT
 *
 * The counter of bits is compared with symbols counted by hand; with the bytes
 * of chunks of random streams; and with the expected code length of symbols
 * drawn from their distributions.
 */
#include "cost.h"
#include "encode.h"
#include "fx.h"
#include "gen_stream.h"
#include "testing.h"

static int is_near(double x, double wanted)
{
    if (fabs(x - wanted) < 1e-6)
        return 1;
    print_error("%.7f instead of %.7f\n", x, wanted);
    return 0;
}

/* --- By hand ------------------------------------------------------------- */

/* The residual's cost must be that of its interval. Row 22 of the table has the
 * starts 0, 12549, 28389, 32359, 32751 and 32767, so that M = 4. */
TEST(residual_should_cost_its_interval)
{
    assert_true(is_near(saga_cost_residual(0, 22), 1.3847152));
    assert_true(is_near(saga_cost_residual(1, 22), 2.0487153));
    assert_true(is_near(saga_cost_residual(-1, 22), 2.0487153));
    /* The frequency is (32767 - 32751) / 2 = 8 of 2^15. */
    assert_true(is_near(saga_cost_residual(4, 22), 12));
    assert_true(is_near(saga_cost_residual(-4, 22), 12));
    /* The escape has a frequency of 1 of 2^15. |q| = 5 is the first value of
     * the Exp-Golomb code of order 3; then comes the sign. */
    assert_true(is_near(saga_cost_residual(5, 22), 15 + 1 + 3 + 1));
    assert_true(is_near(saga_cost_residual(-12, 22), 15 + 1 + 3 + 1));
    assert_true(is_near(saga_cost_residual(13, 22), 15 + 2 + 4 + 1));
    /* The code has ones for the orders 3 to 15; order 16 is the last, so that
     * no zero follows. */
    assert_true(is_near(saga_cost_residual(-65535, 22), 15 + 13 + 16 + 1));
}

/* The coder below fails at this index, which is the number of a network. */
enum { BROKEN = SAGA_N_NETS - 1 };

/* A coder that returns 0, 1, -1, ... as residuals, the last symbol of each
 * adaptive model, and ones for uniform bits. */
static void plain_residual(saga_coder *c, saga_at at, int32_t *q,
                           const int16_t *mu, uint32_t step_q16,
                           const uint8_t *scale, uint32_t n)
{
    (void)mu;
    (void)step_q16;
    (void)scale;
    for (uint32_t i = 0; i < n; i++)
        q[i] = i == 0 ? 0 : i & 1u ? 1 : -1;
    c->error = at.index == BROKEN;
}

static uint32_t plain_adaptive(saga_coder *c, saga_at at, saga_adaptive *m,
                               uint32_t n_sym)
{
    saga_adaptive_update(m, n_sym, n_sym - 1);
    c->error = at.index == BROKEN;
    return n_sym - 1;
}

static uint32_t plain_uniform(saga_coder *c, saga_at at, uint32_t bits)
{
    c->error = at.index == BROKEN;
    return (1u << bits) - 1;
}

static saga_at at_symbol(uint8_t sym, uint32_t index)
{
    const saga_at at = { index, 0, 0, 0, sym };

    return at;
}

TEST(counter_should_add_up_by_kind)
{
    static const uint8_t scale[3] = { 22, 22, 22 };
    saga_coder plain = { plain_residual, plain_adaptive, plain_uniform, 0 };
    saga_adaptive m;
    saga_cost k;
    saga_coder *const c = &k.coder;
    int32_t q[3];

    saga_adaptive_init(&m, 4);
    saga_cost_init(&k, &plain);
    c->residual(c, at_symbol(SAGA_SYM_CENTRE, 0), q, NULL, 1, scale, 3);
    assert_int_equal(q[2], -1);
    assert_int_equal(c->adaptive(c, at_symbol(SAGA_SYM_SPLIT, 0), &m, 4), 3);
    assert_int_equal(c->adaptive(c, at_symbol(SAGA_SYM_SPLIT, 1), &m, 4), 3);
    assert_int_equal(c->uniform(c, at_symbol(SAGA_SYM_NET_STEP, 0), 16), 65535);
    assert_true(is_near(k.bits[SAGA_SYM_CENTRE], 1.3847152 + 2 * 2.0487153));
    /* The first symbol has a frequency of 8192 of 2^15. It moves the starts by
     * an eighth, to 7168, 14336 and 21504, which leaves 11264 for the next. */
    assert_true(is_near(k.bits[SAGA_SYM_SPLIT], 2 + 15 - log2(11264)));
    /* The last of three symbols also has the remainder of 32768 / 3. */
    saga_adaptive_init(&m, 3);
    assert_int_equal(c->adaptive(c, at_symbol(SAGA_SYM_N_FINE, 0), &m, 3), 2);
    assert_true(is_near(k.bits[SAGA_SYM_N_FINE], 15 - log2(10924)));
    assert_true(is_near(k.bits[SAGA_SYM_NET_STEP], 16));
    assert_true(is_near(k.bits[SAGA_SYM_FEATURE], 0));
}

TEST(counter_should_pass_errors_on)
{
    static const uint8_t scale[1] = { 22 };
    saga_coder plain = { plain_residual, plain_adaptive, plain_uniform, 0 };
    saga_adaptive m;
    saga_cost k;
    saga_coder *const c = &k.coder;
    int32_t q;

    saga_adaptive_init(&m, 2);
    saga_cost_init(&k, &plain);
    c->residual(c, at_symbol(SAGA_SYM_CENTRE, 0), &q, NULL, 1, scale, 1);
    assert_int_equal(c->error, 0);
    c->residual(c, at_symbol(SAGA_SYM_CENTRE, BROKEN), &q, NULL, 1, scale, 1);
    assert_int_equal(c->error, 1);
    saga_cost_init(&k, &plain);
    c->adaptive(c, at_symbol(SAGA_SYM_SPLIT, BROKEN), &m, 2);
    assert_int_equal(c->error, 1);
    saga_cost_init(&k, &plain);
    c->uniform(c, at_symbol(SAGA_SYM_NET_STEP, BROKEN), 16);
    assert_int_equal(c->error, 1);
}

/* --- Streams ------------------------------------------------------------- */

static saga_encode_sizes encode(const gen_stream *g, uint32_t first,
                                uint32_t n_segments)
{
    saga_encode_sizes sizes;
    saga_error error = { "" };
    saga_encoder *const e = saga_encoder_open(&g->header, g->rig, &g->nets,
                                              &error);
    FREED uint8_t *bytes;
    size_t n;

    if (!e)
        fail_msg("%s", error.message);
    for (uint32_t i = first; i < first + n_segments; i++)
        if (!saga_encoder_segment(e, &g->segment[i], g->n_frames[i], &error))
            fail_msg("%s", error.message);
    if (!saga_encoder_finish(e, &bytes, &n, &sizes, &error))
        fail_msg("%s", error.message);
    saga_encoder_free(e);
    return sizes;
}

enum { CHUNK_NETWORKS, CHUNK_COARSE, CHUNK_FINE, CHUNK_PRIM, N_CHUNKS };

static int chunk_of(int component)
{
    return component < SAGA_COMPONENT_TREE          ? CHUNK_NETWORKS
           : component < SAGA_COMPONENT_FINE_SUFFIX ? CHUNK_COARSE
           : component < SAGA_COMPONENT_PRIM_SUFFIX ? CHUNK_FINE
                                                    : CHUNK_PRIM;
}

/* Adds the bits of each kind, all of which must be >= 0, to those of its chunk.
 */
static void sum_chunks(double sum[N_CHUNKS], const double bits[SAGA_N_SYMS])
{
    double by_component[SAGA_N_COMPONENTS];

    memset(sum, 0, N_CHUNKS * sizeof *sum);
    for (int i = 0; i < SAGA_N_SYMS; i++)
        assert_true(bits[i] >= 0);
    saga_cost_components(by_component, bits);
    for (int i = 0; i < SAGA_N_COMPONENTS; i++)
        sum[chunk_of(i)] += by_component[i];
}

static void chunk_bytes(double nbytes[N_CHUNKS], const saga_encode_sizes *z)
{
    nbytes[CHUNK_NETWORKS] = (double)z->networks;
    nbytes[CHUNK_COARSE] = (double)z->coarse;
    nbytes[CHUNK_FINE] = (double)z->fine;
    nbytes[CHUNK_PRIM] = (double)z->prim;
}

/* Returns whether bits and bytes agree within 0.5 % or 16 bytes, whichever is
 * larger. */
static int agrees(double bits, double nbytes)
{
    return fabs(nbytes - bits / 8) <= fmax(16, 0.005 * nbytes);
}

/* A random stream has escapes everywhere. Its bits must still be counted to the
 * byte. */
TEST(spent_should_be_the_bytes_of_random_streams)
{
    for (uint64_t k = 0; k < 200; k++) {
        const gen_options o = { .seed = testing_seed(1) + k,
                                .level = (int)(k % 4),
                                .n_coarse = k % 5 ? 0 : 100,
                                .picture = k % 8 == 7 };
        double bits[N_CHUNKS], nbytes[N_CHUNKS];
        FREED_BY(gen_stream_free) gen_stream g = gen_stream_make(&o);
        saga_encode_sizes z = encode(&g, 0, 1);

        sum_chunks(bits, z.spent);
        chunk_bytes(nbytes, &z);
        for (int i = 0; i < N_CHUNKS; i++)
            if (bits[i] > 8 * nbytes[i] + 0.01 ||
                bits[i] < 8 * nbytes[i] - 16 || !agrees(bits[i], nbytes[i]))
                fail_msg("seed %d, chunk %d: %.1f bits spent, %.0f bytes",
                         (int)o.seed, i, bits[i], nbytes[i]);
    }
}

TEST(segments_should_add_up)
{
    const gen_options o = { .seed = testing_seed(1), .n_segments = 3 };
    saga_encode_sizes all, one[3];
    FREED_BY(gen_stream_free) gen_stream g = gen_stream_make(&o);

    all = encode(&g, 0, 3);
    for (uint32_t i = 0; i < 3; i++)
        one[i] = encode(&g, i, 1);
    for (uint32_t k = 0; k < SAGA_N_SYMS; k++) {
        const double sum = k < SAGA_SYM_NET_STEP
                               ? one[0].bits[k] + one[1].bits[k] +
                                     one[2].bits[k]
                               : one[0].bits[k];

        assert_true(is_near(all.bits[k], sum));
    }
}

/* --- Symbols that follow their distributions ----------------------------- */

static double uniform_in(uint64_t *r)
{
    return ((double)(gen_random(r) >> 11) + 0.5) * 0x1p-53;
}

/* Draws a rounded normal number with the scale's sigma, within +-limit. */
static int32_t draw(uint64_t *r, uint32_t scale, int32_t limit)
{
    const double sigma = exp2(((double)scale - SAGA_SCALE_UNIT) /
                              SAGA_SCALE_PER_OCTAVE);
    const double x = sqrt(-2 * log(uniform_in(r))) *
                     cos(6.28318530717958648 * uniform_in(r));

    return fx_clamp((int32_t)lround(sigma * x), -limit, limit);
}

static void draw_layer(saga_layer_symbols *l, const saga_net_shape *s, int i,
                       uint64_t *r)
{
    const size_t n_in = s->dim[i];

    for (size_t k = 0; k < n_in * s->dim[i + 1]; k++)
        l->weight[k] = draw(r, gen_scale_of(l, k / n_in, k % n_in),
                            s->int8 ? 127 : 2000);
    for (size_t k = 0; k < s->dim[i + 1]; k++)
        l->bias[k] = draw(r, l->bias_scale, SAGA_MAX_RESIDUAL);
}

/* Makes an entropy network that gives mu = 0 and one scale index for any input,
 * by its biases alone. Returns the index. */
static uint32_t constant_entropy(saga_layer_symbols *l, const saga_net_shape *s,
                                 int i, int sigma_q)
{
    const int32_t sigma = fx_min(2 << sigma_q, 32767);
    const uint32_t n_out = s->dim[i + 1];

    memset(l->weight, 0, (size_t)s->dim[i] * n_out * sizeof *l->weight);
    memset(l->shift, 0, n_out);
    l->weight_scale = 0;
    l->scale_mode = SAGA_SCALE_TENSOR;
    l->bias_shift = 0;
    l->bias_scale = 63;
    for (uint32_t k = 0; k < n_out; k++)
        l->bias[k] = i + 1 == s->n_layers && k >= n_out / 2 ? sigma : 0;
    return SAGA_SCALE_UNIT +
           (uint32_t)fx_rshift(sigma * SAGA_SCALE_PER_OCTAVE, sigma_q);
}

static void draw_residuals(int32_t *q, size_t n, uint64_t *r, uint32_t scale)
{
    for (size_t i = 0; i < n; i++)
        q[i] = draw(r, scale, SAGA_MAX_RESIDUAL);
}

/* Draws the symbols of a random stream again, from the distributions that code
 * them. */
static void redraw(gen_stream *g, uint64_t *r)
{
    const saga_model *const m = &g->header.model;
    saga_symbols *const s = &g->segment[0];
    uint32_t scale = 0;
    saga_net_shape shape;

    for (int net = 0; net < SAGA_N_NETS; net++) {
        saga_model_net(&shape, m, net);
        for (int i = 0; i < shape.n_layers; i++) {
            saga_layer_symbols *const l = &g->nets.layer[net][i];

            if (net >= SAGA_NET_E_COARSE && net <= SAGA_NET_E_PRIM)
                scale = constant_entropy(l, &shape, i,
                                         m->out_q[SAGA_OUT_SIGMA]);
            else
                draw_layer(l, &shape, i, r);
        }
    }
    draw_residuals(s->centre, 4 * (size_t)s->n.coarse, r, scale);
    draw_residuals(s->feature, m->features * (size_t)s->n.coarse, r, scale);
    draw_residuals(s->fine_offset, 4 * (size_t)s->n.fine, r, scale);
    draw_residuals(s->prim_offset, 4 * (size_t)s->n.prim, r, scale);
}

TEST(length_should_be_the_bytes_of_likely_streams)
{
    for (uint64_t k = 0; k < 200; k++) {
        const gen_options o = { .seed = testing_seed(1) + k,
                                .level = (int)(k % 4),
                                .picture = 1,
                                .n_coarse = k % 5 ? 0 : 100 };
        uint64_t r = o.seed;
        double bits[N_CHUNKS], nbytes[N_CHUNKS];
        saga_encode_sizes z;
        FREED_BY(gen_stream_free) gen_stream g = gen_stream_make(&o);

        redraw(&g, &r);
        z = encode(&g, 0, 1);
        sum_chunks(bits, z.bits);
        chunk_bytes(nbytes, &z);
        for (int i = 0; i < N_CHUNKS; i++)
            if (!agrees(bits[i], nbytes[i]))
                fail_msg("seed %d, chunk %d: %.1f bits, %.0f bytes",
                         (int)o.seed, i, bits[i], nbytes[i]);
    }
}

/* --- Components ---------------------------------------------------------- */

TEST(components_should_hold_all_kinds)
{
    double bits[SAGA_N_SYMS], sum[SAGA_N_COMPONENTS], total = 0;

    for (uint32_t i = 0; i < SAGA_N_SYMS; i++)
        bits[i] = 1 << i;
    saga_cost_components(sum, bits);
    for (uint32_t i = 0; i < SAGA_N_COMPONENTS; i++) {
        assert_true(sum[i] > 0);
        assert_true(saga_component_name((saga_component)i)[0] != 0);
        assert_null(strchr(saga_component_key((saga_component)i), ' '));
        total += sum[i];
    }
    assert_true(is_near(total, (1 << SAGA_N_SYMS) - 1));
    assert_true(is_near(sum[SAGA_COMPONENT_TREE],
                        (1 << SAGA_SYM_SPLIT) + (1 << SAGA_SYM_OCCUPANCY) +
                            (1 << SAGA_SYM_N_FINE)));
    assert_true(is_near(sum[SAGA_COMPONENT_FEATURE], 1 << SAGA_SYM_FEATURE));
}
