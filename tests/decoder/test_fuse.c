/* SPDX-License-Identifier: MIT
 *
 * A stream without Fuse must decode to the same as a stream whose Fuse networks
 * are exact identities. The three header bytes of a network that does not exist
 * must have no effect.
 */
#include "gen_stream.h"
#include "plan.h"
#include "testing.h"
#include "vectors.h"

enum { N_STREAMS = 12, N_PIXELS = 160 * 120 };

/* --- Streams ------------------------------------------------------------- */

/* Makes a stream without Fuse. The formats of both tiers' features differ; all
 * channels have the same format, because Fuse takes one. */
static void make_plain(gen_stream *g, uint64_t seed)
{
    const gen_options o = {
        .seed = seed, .level = 3, .n_coarse = 12, .picture = 1, .no_fuse = 3
    };

    *g = gen_stream_make(&o);
    g->header.model.out_q[SAGA_OUT_COARSE] = 10;
    g->header.model.out_q[SAGA_OUT_FINE] = 9;
    for (int i = 0; i < SAGA_MAX_NET_LAYERS; i++) {
        free(g->nets.layer[SAGA_NET_FINE][i].finer);
        g->nets.layer[SAGA_NET_FINE][i].finer = NULL;
    }
}

/* Makes a layer of zeros. */
static void make_layer(saga_layer_symbols *l, const saga_net_shape *s, int i)
{
    const size_t n_out = s->dim[i + 1];

    memset(l, 0, sizeof *l);
    l->step_q16 = 1;
    l->weight = zeroed(s->dim[i] * n_out, sizeof *l->weight);
    l->bias = zeroed(n_out, sizeof *l->bias);
    l->shift = zeroed(n_out, sizeof *l->shift);
}

/* Adds the network of a tier: two hidden units for each feature x, max(x, 0)
 * and max(-x, 0), and their difference. Input and output have the features' own
 * format, so that nothing is rounded or cut off. */
static void add_identity(gen_stream *g, int tier)
{
    saga_model *const m = &g->header.model;
    const int net = saga_fuse_net(tier);
    saga_layer_symbols *const l = g->nets.layer[net];
    const uint32_t f = m->features;
    saga_net_shape s;

    m->q_in[net] = (uint8_t)saga_feature_q(m, tier);
    m->out_q[tier == SAGA_TIER_COARSE ? SAGA_OUT_FUSE_C : SAGA_OUT_FUSE_F] =
        m->q_in[net];
    m->width[net] = (uint8_t)(2 * f);
    saga_model_net(&s, m, net);
    make_layer(&l[0], &s, 0);
    make_layer(&l[1], &s, 1);
    for (uint32_t k = 0; k < f; k++) {
        l[0].weight[2 * k * s.dim[0] + k] = 1;
        l[0].weight[(2 * k + 1) * s.dim[0] + k] = -1;
        l[1].weight[k * s.dim[1] + 2 * k] = 1;
        l[1].weight[k * s.dim[1] + 2 * k + 1] = -1;
    }
}

/* --- What they decode to ------------------------------------------------- */

typedef struct {
    saga_stages stages;
    saga_info info;
    size_t nbytes;
} played;

static played play(gen_stream *g)
{
    static uint8_t pixels[3 * N_PIXELS];
    FREED uint8_t *bytes;
    played p = { 0 };

    gen_stream_encode(g, &bytes, &p.nbytes);
    assert_ok(saga_probe(&p.info, bytes, p.nbytes));
    assert_ok(saga_stages_of(&p.stages, bytes, p.nbytes, 0, 40000, 0, pixels,
                             sizeof pixels));
    return p;
}

static void assert_same_stages(const saga_stages *a, const saga_stages *b)
{
    assert_memory_equal(a->final_range, b->final_range, sizeof a->final_range);
    assert_int_equal(a->primitives, b->primitives);
    assert_int_equal(a->splats, b->splats);
    assert_int_equal(a->frame, b->frame);
}

TEST(absence_should_be_identity)
{
    for (uint32_t i = 0; i < N_STREAMS; i++) {
        FREED_BY(gen_stream_free) gen_stream g;
        played none;

        make_plain(&g, testing_seed(1) + i);
        none = play(&g);
        assert_true(none.stages.frame != 0);
        /* The order of the tiers alternates, so that each tier's network is
         * once the only one. */
        for (int tier = 0; tier < SAGA_N_TIERS; tier++) {
            played with;

            add_identity(&g, (tier + (int)i) % 2);
            with = play(&g);
            assert_same_stages(&with.stages, &none.stages);
        }
    }
}

/* Without Fuse a decoder must save exactly the multiply-accumulates of its
 * networks, (F + 8 octaves) W + W F for each point (bitstream.md, section 9):
 * of the coarse tier for each fine anchor, of the fine tier for each primitive.
 */
TEST(absence_should_spare_all_work)
{
    for (uint32_t i = 0; i < N_STREAMS; i++) {
        FREED_BY(gen_stream_free) gen_stream g;
        played none, with;
        uint64_t coarse, fine;

        make_plain(&g, testing_seed(1) + i);
        none = play(&g);
        add_identity(&g, SAGA_TIER_COARSE);
        add_identity(&g, SAGA_TIER_FINE);
        with = play(&g);
        coarse = fine = (2u * g.header.model.features +
                         8u * g.header.model.octaves) *
                        (2u * g.header.model.features);
        assert_int_equal(with.info.n_weights - none.info.n_weights,
                         coarse + fine);
        assert_int_equal(with.info.decode_macs - none.info.decode_macs,
                         coarse * g.segment[0].n.fine +
                             fine * g.segment[0].n.prim);
        assert_true(none.info.work_nbytes < with.info.work_nbytes);
        assert_true(none.nbytes < with.nbytes);
    }
}

/* Header fields of networks that do not exist must not change any decoded
 * value. */
TEST(formats_of_the_absent_should_be_ignored)
{
    for (uint32_t i = 0; i < N_STREAMS; i++) {
        FREED_BY(gen_stream_free) gen_stream g;
        saga_model *const m = &g.header.model;
        played one, other;

        make_plain(&g, testing_seed(1) + i);
        one = play(&g);
        m->out_q[SAGA_OUT_FUSE_C] = 0;
        m->out_q[SAGA_OUT_FUSE_F] = SAGA_MAX_OUT_Q;
        m->q_in[SAGA_NET_FUSE_C] = 1;
        m->q_in[SAGA_NET_FUSE_F] = 15;
        m->int8[SAGA_NET_FUSE_C] ^= 1;
        m->int8[SAGA_NET_FUSE_F] ^= 1;
        other = play(&g);
        assert_same_stages(&other.stages, &one.stages);
        assert_int_equal(other.nbytes, one.nbytes);
        assert_int_equal(other.info.work_nbytes, one.info.work_nbytes);
        assert_int_equal(other.info.decode_macs, one.info.decode_macs);
    }
}
