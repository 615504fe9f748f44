/* SPDX-License-Identifier: MIT
 *
 * Gradients of the scene's float twin are compared with central differences, in
 * double. The loss is a fixed random combination of every attribute, seen from
 * two cameras, so that each output counts.
 */
#include "rng.h"
#include "testing.h"
#include "twin.h"

/* N_OWN primitives with anchors of their own fill two chunks and a part of a
 * third (SAGA_NET_CHUNK). */
enum { N_FINE = 5, N_PRIM = 11, N_OWN = 300, MOST = N_OWN };

static const double centres[2][3] = { { 2.0, 0.3, -1.0 }, { -1.5, 1.0, 2.0 } };

/* Makes the model. no_fuse: bit SAGA_TIER_*, a tier whose features are not
 * fused. */
static void make_model(saga_model *m, uint32_t tools, uint32_t no_fuse)
{
    memset(m, 0, sizeof *m);
    m->tools = tools;
    m->features = 6;
    m->octaves = 2;
    m->lambda_t_q8 = 256;
    for (int i = 0; i < SAGA_N_KINDS; i++)
        m->sources[i] = SAGA_SOURCE_HYPER;
    for (int i = 0; i < SAGA_N_TIERS; i++)
        m->tier[i] = (saga_tier){ .n_groups = 2,
                                  .window = 8,
                                  .neighbours = 4,
                                  .suffix_bits = 4,
                                  .max_children = 8,
                                  .radius2_q12 = 65535,
                                  .softmax_q8 = 739 };
    for (int i = 0; i < SAGA_N_NETS; i++) {
        m->width[i] = 8;
        m->q_in[i] = 12;
    }
    if (tools & SAGA_TOOL_HASH) {
        m->hash_levels = 3;
        m->hash_log2_entries = 2;
    }
    for (int i = 0; i < SAGA_N_TIERS; i++)
        if (no_fuse >> i & 1u)
            m->width[saga_fuse_net(i)] = 0;
}

/* Makes parameters random, which keeps biases away from 0 and colours away from
 * their limits. */
static void shake(saga_scene *s, saga_rng r, uint64_t k)
{
    for (uint32_t i = 0; i < s->n_reals - (size_t)(s->params - s->reals); i++)
        s->params[i] = 0.5 * s->params[i] + 0.05 * saga_rng_normal(r, k++);
}

/* Makes a scene with two cells of a split root, five fine anchors and eleven
 * primitives. */
static void make_scene(saga_scene *s, uint32_t tools, uint32_t no_fuse)
{
    const saga_counts n = { 2, N_FINE, N_PRIM };
    const saga_rng r = saga_rng_stream(5, 0);
    saga_model m;
    uint64_t k = 0;

    make_model(&m, tools, no_fuse);
    assert_done(saga_scene_init(s, &m, n, 3, 77, &error));
    for (uint32_t i = 0; i < 2; i++) {
        s->coarse[i].depth_x = 1;
        s->coarse[i].cell[0] = (uint16_t)i;
        s->coarse[i].n_fine = (uint8_t)(i ? 2 : 3);
        s->coarse[i].first_fine = i ? 3 : 0;
        saga_scene_cell(s->coarse_x + 4 * i, &s->coarse[i]);
    }
    for (uint32_t i = 0; i < N_FINE; i++) {
        real c[4];

        s->fine[i].parent = i >= 3;
        saga_scene_cell(c, &s->coarse[i >= 3]);
        for (int a = 0; a < 4; a++)
            s->fine_x[4 * i + (uint32_t)a] =
                c[a] + 0.2 * (saga_rng_double(r, k++) - 0.5);
    }
    for (uint32_t i = 0; i < N_PRIM; i++) {
        s->prim_fine[i] = i * N_FINE / N_PRIM;
        for (int a = 0; a < 4; a++)
            s->prim_x[4 * i + (uint32_t)a] =
                s->fine_x[4 * s->prim_fine[i] + (uint32_t)a] +
                0.1 * (saga_rng_double(r, k++) - 0.5);
    }
    for (uint32_t i = 0; i < 2u * m.features; i++)
        s->coarse_feature[i] = saga_rng_normal(r, k++);
    shake(s, r, k);
}

/* Returns the loss: the sum over views of c . colour, and c . everything else.
 * With grad, its derivatives are written into the twin. */
static double functional(const saga_twin *w, int view, int colour_only)
{
    const saga_rng r = saga_rng_stream(9, (uint64_t)view);
    double sum = 0;
    uint64_t k = 0;

    for (int a = 0; a < SAGA_N_ATTRS; a++) {
        const real *const x = w->attr.of[a];
        const size_t n = w->n.prim * (size_t)saga_attributes[a].width;

        if (colour_only && a != SAGA_ATTR_COLOUR)
            continue;
        for (size_t j = 0; x && j < n; j++) {
            const double c = saga_rng_normal(r, k++);

            sum += c * x[j];
            w->d_attr.of[a][j] += c;
        }
    }
    return sum;
}

/* The view directions of the undisturbed scene, because no gradient flows
 * through them. */
static real directions[2][3 * MOST];

/* The positions without noise. */
static real clean[4 * MOST];

/* Moves positions by noise of half a support, as large as supports are at the
 * moment. */
static void shift(saga_twin *w, saga_scene *s)
{
    const saga_rng r = saga_rng_stream(13, 0);

    saga_twin_geometry(w, s, s->coarse_feature);
    for (size_t i = 0; i < 4 * w->n.prim; i++) {
        w->prim_shift[i] = (saga_rng_double(r, i) - 0.5) *
                           w->support[4 * s->prim_fine[i / 4] + i % 4];
        s->prim_x[i] = clean[i] + w->prim_shift[i];
    }
}

/* Returns L_res: the mean over primitives of the sum of |corrections|. */
static double correction_loss(const saga_twin *w, const saga_scene *s)
{
    const saga_net *const net = &s->net[SAGA_NET_RES];
    const size_t n = net->n_layers ? w->n.prim * (size_t)net->dim[net->n_layers]
                                   : 0;
    double sum = 0;

    for (size_t i = 0; i < n; i++)
        sum += fabs(w->batch[SAGA_NET_RES].out[i]);
    return w->correction_price * sum / (double)w->n.prim;
}

/* The size from which on a primitive's costs: the mean over its axes in the
 * undisturbed scene, which one of them or two exceed. */
static real most_size[MOST];

#define SIZE_PRICE 0.3

static double size_loss(const saga_twin *w)
{
    double sum = 0;

    for (size_t i = 0; i < 3 * w->n.prim; i++) {
        const double over = w->attr.log2_scale[i] - most_size[i / 3];

        sum += over > 0 ? over * over : 0;
    }
    return SIZE_PRICE * sum;
}

static double forward(saga_twin *w, saga_scene *s)
{
    real *const in = w->batch[SAGA_NET_COLOUR_VIEW].in;
    double sum;

    shift(w, s);
    saga_twin_geometry(w, s, s->coarse_feature);
    sum = correction_loss(w, s) + size_loss(w);
    for (int view = 0; view < 2; view++) {
        if (s->model.tools & SAGA_TOOL_VIEW)
            memcpy(in, directions[view], 3 * w->n.prim * sizeof *in);
        saga_twin_colour(w, s, NULL);
        sum += functional(w, view, view > 0);
    }
    return sum;
}

/* Checks the directions by docs/arithmetic.md, Shading and Animation: a
 * primitive is seen from its position at mid-segment, and its motion is a
 * polynomial of its age. */
static void check_directions(const saga_twin *w, const real *centre)
{
    const saga_splat_params *const p = &w->attr;

    for (size_t i = 0; i < w->n.prim; i++) {
        const double width = p->log2_width ? exp2(p->log2_width[i]) : 0.5;
        const double dt = 0.5 - (p->t_centre ? p->t_centre[i] : 0);
        const double age = fmin(fmax(dt / fmin(width, 0.5), -4), 4);
        double v[3], n = 0;

        for (size_t k = 0; k < 3; k++) {
            const real *const b = p->motion ? p->motion + 9 * i + k : NULL;

            v[k] = p->mean[3 * i + k] - centre[k];
            if (b)
                v[k] += p->support[3 * i + k] *
                        (b[0] * age + b[3] * age * age + b[6] * pow(age, 3));
            n += v[k] * v[k];
        }
        for (size_t k = 0; k < 3; k++)
            assert_true(fabs(w->batch[SAGA_NET_COLOUR_VIEW].in[3 * i + k] -
                             v[k] / sqrt(n)) < 1e-12);
    }
}

static void gradient(saga_twin *w, saga_scene *d, saga_scene *s)
{
    memcpy(clean, s->prim_x, 4 * w->n.prim * sizeof *clean);
    shift(w, s);
    saga_twin_geometry(w, s, s->coarse_feature);
    for (size_t i = 0; i < w->n.prim; i++)
        most_size[i] = (w->attr.log2_scale[3 * i] +
                        w->attr.log2_scale[3 * i + 1] +
                        w->attr.log2_scale[3 * i + 2]) /
                       3;
    saga_twin_clear(w, s);
    assert_true(size_loss(w) > 0);
    saga_twin_size_loss(w, most_size, w->n.prim, SIZE_PRICE);
    for (int view = 0; view < 2; view++) {
        saga_twin_colour(w, s, centres[view]);
        if (s->model.tools & SAGA_TOOL_VIEW) {
            check_directions(w, centres[view]);
            memcpy(directions[view], w->batch[SAGA_NET_COLOUR_VIEW].in,
                   3 * w->n.prim * sizeof *directions[view]);
        }
        functional(w, view, view > 0);
        saga_twin_colour_backward(w, d, s);
    }
    saga_twin_backward(w, d, s);
}

/* Checks the gradients of a range of parameters. Central differences with a
 * step of 1e-6 have errors of about 1e-9. A few may differ, because a ReLU may
 * change its state within the step. */
static void check_range(saga_twin *w, saga_scene *s, const saga_scene *d,
                        real *at, size_t n, size_t stride)
{
    const double h = 1e-6;
    size_t wrong = 0, tried = 0;

    for (size_t i = 0; i < n; i += stride) {
        const size_t k = (size_t)(at - s->reals) + i;
        const double x = s->reals[k];
        double up, down, want;

        s->reals[k] = x + h;
        up = forward(w, s);
        s->reals[k] = x - h;
        down = forward(w, s);
        s->reals[k] = x;
        want = (up - down) / (2 * h);
        tried++;
        if (fabs(want - d->reals[k]) > 1e-5 * (1 + fabs(want)))
            wrong++;
    }
    if (wrong)
        printf("%zu of %zu differ\n", wrong, tried);
    assert_true(wrong * 100 <= tried);
}

static void run_gradient(uint32_t tools, uint32_t no_fuse, bool still)
{
    saga_scene s, d;
    FREED_BY(saga_twin_free) saga_twin w;

    make_scene(&s, tools, no_fuse);
    s.still = still;
    assert_done(saga_scene_init(&d, &s.model, s.n, 3, 0, &error));
    memset(d.reals, 0, d.n_reals * sizeof *d.reals);
    assert_done(saga_twin_init(&w, &s, &error));
    w.correction_price = 0.7;
    assert_done(saga_twin_refresh(&w, &s, s.coarse_feature, &error));
    assert_int_equal(!w.attr.motion && !w.attr.slope && !w.attr.t_centre &&
                         !w.attr.log2_width,
                     still || !(tools & SAGA_TOOLS_TIME));
    gradient(&w, &d, &s);
    check_range(&w, &s, &d, s.coarse_feature, 2u * s.model.features, 1);
    check_range(&w, &s, &d, s.params, s.n_reals - (size_t)(s.params - s.reals),
                3);
    saga_scene_free(&s);
    saga_scene_free(&d);
}

TEST(twin_gradients_should_match_differences_with_all_tools)
{
    run_gradient(SAGA_TOOLS_PICTURE, 0, false);
}

TEST(twin_gradients_should_match_differences_without_tools)
{
    run_gradient(0, 0, false);
}

TEST(twin_gradients_should_match_differences_without_fuse)
{
    for (uint32_t no_fuse = 1; no_fuse < 4; no_fuse++)
        run_gradient(SAGA_TOOLS_PICTURE, no_fuse, false);
}

/* D_res and its tables, with L_res. */
TEST(twin_gradients_should_match_differences_with_a_hash)
{
    run_gradient(SAGA_TOOLS_PICTURE | SAGA_TOOL_HASH, 0, false);
    run_gradient(SAGA_TOOL_HASH, 3, false);
}

/* Makes a scene whose fine anchors each have a coarse anchor of their own, in a
 * row of cells, and whose F_fine is an identity of one layer. */
static void make_own_scene(saga_scene *s, uint32_t n_fine, uint32_t n_prim)
{
    const saga_counts n = { n_fine, n_fine, n_prim };
    saga_scene shared;
    saga_model m;
    saga_net *net;

    make_scene(&shared, SAGA_TOOLS_PICTURE, 3);
    m = shared.model;
    m.tier[SAGA_TIER_COARSE].neighbours = 1;
    if (n_fine == n_prim)
        m.tier[SAGA_TIER_FINE].neighbours = 1;
    m.width[SAGA_NET_FINE] = 0;
    assert_done(saga_scene_init(s, &m, n, 1, 77, &error));
    for (uint32_t i = 0; i < n_fine; i++) {
        s->coarse[i].depth_x = 9;
        s->coarse[i].cell[0] = (uint16_t)i;
        s->coarse[i].n_fine = 1;
        s->coarse[i].first_fine = s->fine[i].parent = i;
        saga_scene_cell(s->coarse_x + 4 * i, &s->coarse[i]);
        saga_scene_cell(s->fine_x + 4 * i, &s->coarse[i]);
    }
    for (uint32_t i = 0; i < n_prim; i++) {
        s->prim_fine[i] = i * n_fine / n_prim;
        memcpy(s->prim_x + 4 * i, s->fine_x + 4 * s->prim_fine[i],
               4 * sizeof *s->prim_x);
    }
    for (uint32_t i = 0; i < n_fine * m.features; i++)
        s->coarse_feature[i] = saga_rng_normal(saga_rng_stream(5, 1), i);
    shake(s, saga_rng_stream(5, 2), 0);
    net = &s->net[SAGA_NET_FINE];
    memset(net->w[0], 0, saga_net_n_params(net) * sizeof(real));
    for (uint32_t i = 0; i < m.features; i++)
        net->w[0][i * (uint32_t)net->dim[0] + i] = 1;
    for (uint32_t k = 0; k < 4; k++)
        net->b[0][m.features + k] = -1.5 + 0.2 * k;
    saga_scene_free(&shared);
}

/* Where F_fine passes features on, it is not computed. The gradients of
 * features must be those of the computation, which a weight that is not quite 0
 * brings about. */
TEST(features_that_pass_should_be_those_of_the_network)
{
    saga_scene s, d[2];
    saga_net *net;

    make_own_scene(&s, N_FINE, N_PRIM);
    net = &s.net[SAGA_NET_FINE];
    for (int computed = 0; computed < 2; computed++) {
        FREED_BY(saga_twin_free) saga_twin w;

        net->w[0][1] = computed ? 1e-200 : 0;
        assert_done(saga_scene_init(&d[computed], &s.model, s.n, 1, 0, &error));
        memset(d[computed].reals, 0, d[computed].n_reals * sizeof(real));
        assert_done(saga_twin_init(&w, &s, &error));
        assert_done(saga_twin_refresh(&w, &s, s.coarse_feature, &error));
        assert_int_equal(w.passes, !computed);
        gradient(&w, &d[computed], &s);
        if (!computed)
            check_range(&w, &s, &d[0], s.coarse_feature,
                        N_FINE * (size_t)s.model.features, 1);
        memcpy(s.prim_x, clean, 4 * N_PRIM * sizeof *clean);
    }
    for (size_t i = 0; i < N_FINE * (size_t)s.model.features; i++)
        assert_float_equal(d[0].coarse_feature[i], d[1].coarse_feature[i],
                           1e-12);
    for (int i = 0; i < 2; i++)
        saga_scene_free(&d[i]);
    saga_scene_free(&s);
}

/* Where each primitive has anchors of its own, chunks of them go through all
 * networks together. */
TEST(twin_gradients_should_match_differences_of_own_anchors)
{
    saga_scene s, d;
    FREED_BY(saga_twin_free) saga_twin w;
    const saga_rng r = saga_rng_stream(5, 3);

    make_own_scene(&s, N_OWN, N_OWN);
    for (uint32_t i = 0; i < saga_net_n_params(&s.net[SAGA_NET_FINE]); i++)
        s.net[SAGA_NET_FINE].w[0][i] += 0.05 * saga_rng_normal(r, i);
    assert_done(saga_scene_init(&d, &s.model, s.n, 1, 0, &error));
    memset(d.reals, 0, d.n_reals * sizeof *d.reals);
    assert_done(saga_twin_init(&w, &s, &error));
    assert_done(saga_twin_refresh(&w, &s, s.coarse_feature, &error));
    gradient(&w, &d, &s);
    assert_true(w.whole && !w.passes);
    check_range(&w, &s, &d, s.coarse_feature, N_OWN * (size_t)s.model.features,
                7);
    check_range(&w, &s, &d, s.params, s.n_reals - (size_t)(s.params - s.reals),
                3);
    saga_scene_free(&s);
    saga_scene_free(&d);
}

/* A format of 16 bits with 8 fractional bits ends at 127.996. A motion of 300
 * must be cut to that, and its gradient must be 0 unless it points back into
 * the range. */
TEST(motion_should_end_where_its_format_does)
{
    const int last = 2;
    saga_rows rows[SAGA_N_OUTS];
    saga_scene s, d;
    FREED_BY(saga_twin_free) saga_twin w;

    make_scene(&s, SAGA_TOOLS_PICTURE, 0);
    assert_done(saga_scene_init(&d, &s.model, s.n, 3, 0, &error));
    assert_done(saga_twin_init(&w, &s, &error));
    saga_model_rows(rows, &s.model);
    for (int sign = -1; sign <= 1; sign += 2) {
        const uint32_t row = rows[SAGA_OUT_MOTION1].first + 1u;
        const real *const d_row = d.net[SAGA_NET_GEO].b[last] + row;

        s.net[SAGA_NET_GEO].b[last][row] = 300 * sign;
        assert_done(saga_twin_refresh(&w, &s, s.coarse_feature, &error));
        saga_twin_geometry(&w, &s, s.coarse_feature);
        assert_true(w.attr.motion[1] == sign * 32767 / 256.0);
        saga_twin_clear(&w, &s);
        memset(d.reals, 0, d.n_reals * sizeof *d.reals);
        w.d_attr.motion[1] = -sign;
        w.d_attr.motion[0] = -sign;
        w.d_attr.motion[9 + 1] = 2 * sign;
        saga_twin_backward(&w, &d, &s);
        /* The gradient of a bias is the sum of those of its outputs. */
        assert_true(d_row[0] == 2 * sign);
        assert_true(d_row[-1] == -sign);
    }
    saga_scene_free(&s);
    saga_scene_free(&d);
}

/* In a base, the rows of outputs for motion must have no gradient. */
TEST(twin_gradients_should_match_differences_of_what_is_still)
{
    run_gradient(SAGA_TOOLS_PICTURE, 0, true);
}
