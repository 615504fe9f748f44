/* SPDX-License-Identifier: MIT
 *
 * Hard cases of decoding: streams whose symbols are all zero or all at their
 * limits, networks of which every layer saturates, and the deepest tree. Each
 * is drawn and compared with double. README.md in this folder has the table.
 */
#include "gen_scene.h"
#include "given_view.h"
#include "reconstruct.h"
#include "ref_file.h"
#include "testing.h"

enum { N_STREAMS = 32, SIDE = 33 };

/* Makes a stream with any tools, banks and networks. */
static void make_stream(gen_stream *g, uint32_t i)
{
    const gen_options o = { .seed = 700 + i,
                            .level = 1 + (i % 8 == 7),
                            .tools = i % 32,
                            .tools_fixed = 1,
                            .bank = (int)(i % 3),
                            .linear = i % 5 == 0 };

    *g = gen_stream_make(&o);
    g->n_frames[0] = 1;
}

/* --- Symbols ------------------------------------------------------------- */

typedef void with_layer(saga_layer_symbols *l, const saga_net_shape *s, int i);

static void each_layer(gen_stream *g, with_layer *f)
{
    saga_net_shape s;

    for (int net = 0; net < SAGA_N_NETS; net++) {
        saga_model_net(&s, &g->header.model, net);
        for (int i = 0; i < s.n_layers; i++)
            f(&g->nets.layer[net][i], &s, i);
    }
}

static void *resized(void *p, size_t n, size_t size)
{
    free(p);
    p = must(calloc(n, size));
    return p;
}

/* Sets the symbols to one leaf, which is the cube, with its anchor and
 * n_children children. Every residual is q, and every suffix is the lowest or
 * the highest. */
static void set_symbols(gen_stream *g, uint32_t n_children, int32_t q)
{
    const saga_model *const m = &g->header.model;
    saga_symbols *const s = &g->segment[0];
    const uint32_t bits[2] = { 4u * m->tier[0].suffix_bits,
                               4u * m->tier[1].suffix_bits };

    s->n_nodes = 1;
    s->split[0] = 0;
    s->occupancy[0] = 0;
    s->n = (saga_counts){ 1, n_children, n_children * n_children };
    s->n_fine = resized(s->n_fine, 1, 1);
    s->n_prim = resized(s->n_prim, n_children, 1);
    s->centre = resized(s->centre, 4, sizeof *s->centre);
    s->feature = resized(s->feature, m->features, sizeof *s->feature);
    s->fine_suffix = resized(s->fine_suffix, s->n.fine, 4);
    s->fine_offset = resized(s->fine_offset, 4u * s->n.fine, 4);
    s->prim_suffix = resized(s->prim_suffix, s->n.prim, 4);
    s->prim_offset = resized(s->prim_offset, 4u * s->n.prim, 4);
    s->n_fine[0] = (uint8_t)n_children;
    memset(s->n_prim, (int)n_children, n_children);
    for (uint32_t i = 0; i < 4; i++)
        s->centre[i] = q;
    for (uint32_t i = 0; i < m->features; i++)
        s->feature[i] = q;
    for (uint32_t i = 0; i < 4 * s->n.fine; i++)
        s->fine_offset[i] = q;
    for (uint32_t i = 0; i < 4 * s->n.prim; i++)
        s->prim_offset[i] = q;
    for (uint32_t i = 0; q > 0 && i < s->n.fine; i++)
        s->fine_suffix[i] = (uint32_t)((1ull << bits[0]) - 1);
    for (uint32_t i = 0; q > 0 && i < s->n.prim; i++)
        s->prim_suffix[i] = (uint32_t)((1ull << bits[1]) - 1);
}

/* --- What they decode to ------------------------------------------------- */

typedef struct {
    ref_file file;
    saga_primitive *prim;
    int16_t *colour; /* (prim, SAGA_MAX_WIDTH) */
} decoded;

static void decode(decoded *d, const given_view *v)
{
    const uint32_t n = v->report.n_primitives;

    assert_null(ref_file_read(&d->file, v->bytes, v->nbytes));
    d->prim = calloc(n, sizeof *d->prim);
    d->colour = calloc(n, SAGA_MAX_WIDTH * sizeof *d->colour);
    assert_true(d->prim && d->colour);
    saga_reconstruct(&d->file.sc, d->prim, sizeof *d->prim, d->colour,
                     SAGA_MAX_WIDTH);
}

static void free_decoded(decoded *d)
{
    free(d->prim);
    free(d->colour);
    ref_file_free(&d->file);
}

static int32_t clamp(int64_t x, int64_t lo, int64_t hi)
{
    return (int32_t)(x < lo ? lo : x > hi ? hi : x);
}

/* Returns a camera outside the cube that sees all of it. */
static saga_camera before(void)
{
    saga_camera c;

    gen_front_camera(&c, SIDE, SIDE);
    c.centre[2] = -(1 << 25);
    return c;
}

/* Compares the picture with double from a stage on; returns the PSNR in dB.
 * Random networks make points of opacity 8, whose edge has a slope of 6 in
 * alpha a pixel: if a mean is wrong by 1/512 of a pixel, the error is two
 * levels. */
static double see(given_view *v, int32_t t, int stage)
{
    const saga_camera c = before();
    saga_verify_picture p;

    given_draw(v, &c, t);
    p = given_verify(v, stage);
    if (p.psnr_same < INFINITY)
        print_message("  %.1f dB, at most %d; %.1f dB, at most %d without %d "
                      "pixels that are cut or stopped otherwise\n",
                      p.psnr, p.max, p.psnr_same, p.max_same,
                      (int)(p.n_cut + p.n_stop));
    assert_true(p.max_same <= 2);
    return p.psnr_same;
}

/* --- All zero ------------------------------------------------------------ */

static void zero_layer(saga_layer_symbols *l, const saga_net_shape *s, int i)
{
    const size_t n_in = s->dim[i], n_out = s->dim[i + 1];

    memset(l->weight, 0, n_in * n_out * sizeof *l->weight);
    memset(l->bias, 0, n_out * sizeof *l->bias);
    memset(l->shift, 0, n_out);
}

/* Returns the centre of the first suffix cell, in Q14. */
static int32_t first_cell(const saga_model *m, int tier)
{
    return (1 << (14 - m->tier[tier].suffix_bits)) - 16384;
}

/* If all symbols are 0, networks return 0, and predictions, features and
 * offsets are 0. There must be one primitive, in the first suffix cell of the
 * first suffix cell of the cube: a half-transparent grey ball with a size of
 * half the cube and half the segment. */
TEST(zero_symbols_should_be_one_grey_ball)
{
    for (uint32_t i = 0; i < N_STREAMS; i++) {
        const saga_model *m;
        FREED_BY(gen_stream_free) gen_stream g;
        FREED_BY(given_close) given_view v;
        FREED_BY(free_decoded) decoded d;
        int32_t o[2];
        saga_splat s;

        make_stream(&g, i);
        m = &g.header.model;
        each_layer(&g, zero_layer);
        set_symbols(&g, 1, 0);
        o[0] = first_cell(m, SAGA_TIER_COARSE);
        o[1] = first_cell(m, SAGA_TIER_FINE);
        given_open_stream(&v, &g);
        decode(&d, &v);
        for (int k = 0; k < 3; k++) {
            assert_int_equal(d.prim[0].x[k],
                             clamp(512 * (o[0] + o[1]), -(1 << 23), 1 << 23));
            assert_int_equal(d.prim[0].support[k], 1 << 23);
            assert_int_equal(d.prim[0].log2_scale_q10[k], 23 << 10);
            assert_int_equal(d.prim[0].quat[1 + k], 0);
            assert_int_equal(d.prim[0].motion[k], 0);
        }
        assert_int_equal(d.prim[0].quat[0], 1 << m->out_q[SAGA_OUT_QUAT]);
        assert_int_equal(d.prim[0].opacity, 0);
        assert_int_equal(
            d.prim[0].t_centre,
            clamp(clamp(32768 + 2 * o[0], 0, 65535) + 2 * o[1], 0, 65535));
        assert_int_equal(d.prim[0].log2_width_q10,
                         m->tools & SAGA_TOOL_OPACITY_T ? 15 << 10 : 0);
        assert_true(see(&v, d.prim[0].t_centre, SAGA_VERIFY_SYMBOLS) >= 62);
        assert_ok(saga_splat_at(&s, v.dec, 0));
        assert_int_equal(s.q0_q20, 3323907); /* log2(1 + 2^3) */
        for (int k = 0; k < 3; k++)
            assert_int_equal(s.colour_q15[k], 16384);
    }
}

/* --- All at their limits ------------------------------------------------- */

/* Makes the largest valid rows: the sum of the weights' magnitudes is near
 * 2^15, the bias near 2^30; signs alternate. No input has a finer format than
 * its layer, which would make weights smaller. */
static void full_layer(saga_layer_symbols *l, const saga_net_shape *s, int i)
{
    const uint32_t n_in = s->dim[i], n_out = s->dim[i + 1];
    const int32_t most = s->int8 ? 127 : 32700;
    const int32_t w = n_in ? clamp(32700 / n_in, 0, most) : 0;

    l->step_q16 = 1;
    l->step_shift = 0;
    l->bias_shift = 14;
    free(l->finer);
    l->finer = NULL;
    for (uint32_t row = 0; row < n_out; row++) {
        for (uint32_t k = 0; k < n_in; k++)
            l->weight[row * n_in + k] = (row + k) & 1 ? w : -w;
        l->bias[row] = row & 1 ? 65535 : -65535;
        l->shift[row] = (uint8_t)(row % 4 ? 0 : 16);
    }
}

/* With the largest steps a residual of +-65535 saturates every value, whatever
 * was predicted. All 256 positions must be in a corner of the cube and at an
 * end of the segment. If the primitives are faint, rounding their alphas to 16
 * bits adds up to a fifth of a level, which may change one channel of a uniform
 * picture by a level, so that the worst picture has 52.9 dB. */
TEST(limits_should_end_in_a_corner)
{
    for (uint32_t i = 0; i < N_STREAMS; i++) {
        const int32_t q = i & 1 ? 65535 : -65535;
        FREED_BY(gen_stream_free) gen_stream g;
        FREED_BY(given_close) given_view v;
        FREED_BY(free_decoded) decoded d;

        make_stream(&g, i);
        each_layer(&g, full_layer);
        for (int k = 0; k < SAGA_N_STEPS; k++)
            g.header.model.step_q16[k] = 0xffffffffu;
        for (int k = 0; k < SAGA_N_TIERS; k++)
            g.header.model.tier[k].max_children = 16;
        set_symbols(&g, 16, q);
        given_open_stream(&v, &g);
        decode(&d, &v);
        assert_int_equal(v.report.n_primitives, 256);
        for (int k = 0; k < 4; k++)
            assert_int_equal(d.file.value[SAGA_STEP_CENTRE][k],
                             q > 0 ? 32767 : -32767);
        for (int k = 0; k < g.header.model.features; k++)
            assert_int_equal(d.file.value[SAGA_STEP_FEATURE][k],
                             q > 0 ? 32767 : -32767);
        for (uint32_t p = 0; p < 256; p++) {
            for (int k = 0; k < 3; k++)
                assert_int_equal(d.prim[p].x[k],
                                 q > 0 ? SAGA_X_MAX : SAGA_X_MIN);
        }
        assert_true(see(&v, 0, SAGA_VERIFY_SYMBOLS) >= 60);
        assert_true(see(&v, 65535, SAGA_VERIFY_SYMBOLS) >= 52);
    }
}

/* --- Networks that saturate ---------------------------------------------- */

/* Makes a layer that saturates: every hidden unit is 32767, and of the last
 * layer's rows the even ones are 32767, the odd ones -32767. Biases of 2^28
 * outweigh 2^7 inputs of 2^15. */
static void saturating_layer(saga_layer_symbols *l, const saga_net_shape *s,
                             int i)
{
    const uint32_t n_in = s->dim[i], n_out = s->dim[i + 1];
    const int is_last = i + 1 == s->n_layers;

    l->step_q16 = 1;
    l->step_shift = 0;
    l->bias_shift = 14;
    for (uint32_t row = 0; row < n_out; row++) {
        const int sign = is_last && row & 1 ? -1 : 1;

        for (uint32_t k = 0; k < n_in; k++)
            l->weight[row * n_in + k] = sign;
        l->bias[row] = sign * 16384;
        l->shift[row] = 0;
    }
}

/* Returns the log2 that a saturated row stands for, in Q10, relative to a
 * half-size `half`. */
static int32_t log2_of(uint32_t row, int q, int half)
{
    const int64_t out = row & 1 ? -32767 : 32767;
    const int64_t q10 = q <= 10 ? out * (1 << (10 - q))
                                : (out + (1 << (q - 11))) >> (q - 10);

    return clamp(q10 + 1024 * half, -32767, 32767);
}

/* With saturated layers the outputs are +-32767, by the number of the row,
 * whatever the features are. The primitives' attributes must have these values
 * in their formats. The motion is so fast that the rounding of a time is
 * visible; therefore the comparison with double begins after the motion. */
TEST(saturated_networks_should_give_their_signs)
{
    uint32_t row;

    for (uint32_t i = 0; i < N_STREAMS; i++) {
        const saga_model *m;
        saga_rows rows[SAGA_N_OUTS];
        FREED_BY(gen_stream_free) gen_stream g;
        FREED_BY(given_close) given_view v;
        FREED_BY(free_decoded) decoded d;

        make_stream(&g, i);
        m = &g.header.model;
        each_layer(&g, saturating_layer);
        saga_model_rows(rows, m);
        given_open_stream(&v, &g);
        decode(&d, &v);
        for (uint32_t p = 0; p < v.report.n_primitives; p++) {
            const saga_fine *fine = d.file.sc.fine;
            const saga_primitive *const prim = &d.prim[p];

            while (p - fine->first_prim >= fine->n_prim)
                fine++;
            row = rows[SAGA_OUT_OPACITY].first;
            assert_int_equal(prim->opacity, row & 1 ? -32767 : 32767);
            for (int k = 0; k < 3; k++) {
                row = rows[SAGA_OUT_SCALE].first + (uint32_t)k;
                assert_int_equal(
                    prim->log2_scale_q10[k],
                    log2_of(row, m->out_q[SAGA_OUT_SCALE],
                            23 - d.file.sc.coarse[fine->parent].depth_x));
                row = rows[SAGA_OUT_SUPPORT].first + (uint32_t)k;
                assert_true(fine->local[k] == 0 || fine->local[k] == 23 << 10 ||
                            m->out_q[SAGA_OUT_SUPPORT] > 10);
            }
            for (int k = 0; k < 4; k++) {
                row = rows[SAGA_OUT_QUAT].first + (uint32_t)k;
                assert_int_equal(
                    prim->quat[k],
                    clamp((row & 1 ? -32767 : 32767) +
                              (k ? 0 : 1 << m->out_q[SAGA_OUT_QUAT]),
                          -32767, 32767));
            }
            row = rows[SAGA_OUT_MOTION1].first;
            if (rows[SAGA_OUT_MOTION1].n)
                assert_int_equal(prim->motion[0], row & 1 ? -32767 : 32767);
        }
        assert_true(see(&v, 32768, SAGA_VERIFY_ANIMATION) >= 62);
    }
}

/* --- Trees --------------------------------------------------------------- */

/* The tree's only leaf is the last corner of the cube after 16 halvings of
 * space and 8 of time. Its cell has a side of 2^8 box units and a duration of
 * 2^8, so that its centre must be half of that before the end. Compared with
 * the leaf of depth 2 that gen_given makes, everything that is relative to the
 * cell must be smaller by 2^14 in space and 2^8 in time. */
TEST(deepest_tree_should_end_in_the_last_corner)
{
    enum { DEPTH = 16, DEPTH_T = 8, CORNER = 3 << 21 };
    const uint32_t tools = SAGA_TOOL_OPACITY_T;
    gen_given p = gen_given_ball(CORNER, 21);
    saga_camera c = before();
    FREED_BY(gen_stream_free) gen_stream g;
    FREED_BY(given_close) given_view v;
    FREED_BY(free_decoded) decoded d;
    saga_symbols *const s = &g.segment[0];

    for (int k = 0; k < 3; k++) {
        p.p.x[k] = CORNER;
        p.p.support[k] = 1 << 20;
    }
    gen_given_make(&g, &p, 1, tools, 1);
    s->n_nodes = DEPTH + 1;
    s->split = resized(s->split, DEPTH + 1, 1);
    s->occupancy = resized(s->occupancy, DEPTH + 1, sizeof *s->occupancy);
    for (uint32_t i = 0; i < DEPTH; i++) {
        s->split[i] = i < DEPTH_T ? 3 : 1;
        s->occupancy[i] = i < DEPTH_T ? 1 << 15 : 1 << 7;
    }
    given_open_stream(&v, &g);
    decode(&d, &v);
    assert_int_equal(d.file.sc.coarse[0].depth_x, DEPTH);
    assert_int_equal(d.file.sc.coarse[0].depth_t, DEPTH_T);
    for (int k = 0; k < 3; k++) {
        assert_int_equal(d.file.sc.coarse[0].cell[k], 65535);
        assert_int_equal(d.prim[0].x[k], (1 << 23) - 128);
        assert_int_equal(d.prim[0].log2_scale_q10[k], (21 - 14) << 10);
        assert_int_equal(d.prim[0].support[k], 1 << (20 - 14));
        c.centre[k] = (1 << 23) - 128 - (k == 2) * (1 << 12);
    }
    assert_int_equal(d.file.sc.coarse[0].cell_t, 255);
    assert_int_equal(d.prim[0].t_centre, 65536 - 128);
    assert_int_equal(d.prim[0].log2_width_q10, (28 - 8) << 10);
    given_draw(&v, &c, 65408);
    assert_true(given_verify(&v, SAGA_VERIFY_SYMBOLS).psnr >= 62);
    assert_true(given_sample(&v, SIDE / 2, SIDE / 2, 0) >= 252);
}
