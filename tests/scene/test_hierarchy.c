/* SPDX-License-Identifier: MIT
 *
 * Scenes built from flat primitives. Limits, budgets and order are checked with
 * the real traversal (a coder that looks symbols up in the scene), and through
 * bytes (encoder, then decoder and recorder). Hard inputs follow.
 */
#include "encode.h"
#include "fx.h"
#include "hierarchy.h"
#include "morton.h"
#include "ref_recorder.h"
#include "syntax.h"
#include "testing.h"

#include <time.h>

/* --- Flat primitives ----------------------------------------------------- */

typedef struct {
    saga_splat_params p;
    float *score;
    uint32_t n;
    uint64_t seed;
} flat;

static double uniform(uint64_t *seed)
{
    *seed = *seed * 6364136223846793005u + 1442695040888963407u;
    return (double)(*seed >> 40) / (1 << 24);
}

/* Makes primitives that are uniform in the cube and in time, and narrow in
 * time. */
static flat flat_make(uint32_t n, uint64_t seed)
{
    flat f = { .n = n, .seed = seed };

    assert_done(saga_params_alloc(&f.p, SAGA_ATTRS_ALL, n, &error));
    f.score = must(calloc(n + 1u, sizeof *f.score));
    for (uint32_t i = 0; i < n; i++) {
        for (uint32_t k = 0; k < 3; k++) {
            f.p.mean[3 * i + k] = (real)(2 * uniform(&f.seed) - 1);
            f.p.log2_scale[3 * i + k] = (real)(-6 - 2 * uniform(&f.seed));
            f.p.colour[3 * i + k] = (real)uniform(&f.seed);
            f.p.support[3 * i + k] = 1;
        }
        f.p.t_centre[i] = (real)uniform(&f.seed);
        f.p.log2_width[i] = (real)(-4 + uniform(&f.seed));
        f.score[i] = (float)uniform(&f.seed);
    }
    return f;
}

/* Gathers the primitives around a few places, at scales over many octaves. */
static void flat_cluster(flat *f)
{
    double centre[7][3], size[7];

    for (uint32_t i = 0; i < 7; i++) {
        size[i] = exp2(-1 - 8 * uniform(&f->seed));
        for (uint32_t k = 0; k < 3; k++)
            centre[i][k] = 2.2 * uniform(&f->seed) - 1.1;
    }
    for (uint32_t i = 0; i < f->n; i++) {
        const uint32_t c = (uint32_t)(7 * uniform(&f->seed));

        for (uint32_t k = 0; k < 3; k++)
            f->p.mean[3 * i + k] = (real)(centre[c][k] +
                                          size[c] * (uniform(&f->seed) - 0.5));
    }
}

static void flat_free(flat *f)
{
    saga_params_free(&f->p);
    free(f->score);
}

/* --- Models -------------------------------------------------------------- */

enum { ALL_TOOLS = SAGA_TOOL_OPACITY_T | 1u << SAGA_TOOL_MOTION_SHIFT };

static void model_make(saga_model *m, uint32_t tools)
{
    memset(m, 0, sizeof *m);
    m->tools = tools;
    m->features = 5;
    m->octaves = 2;
    m->lambda_t_q8 = 256;
    for (int i = 0; i < SAGA_N_TIERS; i++)
        m->tier[i] = (saga_tier){ .n_groups = 8,
                                  .window = 2,
                                  .neighbours = 2,
                                  .suffix_bits = 4,
                                  .radius2_q12 = 4 << 12,
                                  .softmax_q8 = 739 };
    m->tier[SAGA_TIER_COARSE].max_children = 16;
    m->tier[SAGA_TIER_FINE].max_children = 10;
    for (int i = 0; i < SAGA_N_STEPS; i++)
        m->step_q16[i] = 256u << 16;
    for (int i = 0; i < SAGA_N_OUTS; i++)
        m->out_q[i] = 11;
    for (int i = 0; i < SAGA_N_NETS; i++) {
        m->width[i] = 4;
        m->q_in[i] = 12;
    }
    assert_true(saga_model_is_valid(m));
}

/* --- The traversal over a scene ------------------------------------------ */

/* A coder that answers from a scene's symbols. Every residual is 0. */
typedef struct {
    saga_coder coder;
    const saga_symbols *s;
} lookup;

static void zero_residual(saga_coder *c, saga_at at, int32_t *q,
                          const int16_t *mu, uint32_t step_q16,
                          const uint8_t *scale, uint32_t n)
{
    (void)c;
    (void)at;
    (void)mu;
    (void)step_q16;
    (void)scale;
    memset(q, 0, n * sizeof *q);
}

static uint32_t count_low(const uint32_t *suffix, uint32_t n, uint32_t bit)
{
    uint32_t low = 0;

    for (uint32_t i = 0; i < n; i++) {
        if (suffix[i] >> bit & 1u)
            continue;
        assert_int_equal(low, i);
        low++;
    }
    return low;
}

static uint32_t look_up(saga_coder *c, saga_at at, saga_adaptive *m,
                        uint32_t n_sym)
{
    const saga_symbols *const s = ((lookup *)(void *)c)->s;
    uint32_t sym = 0;

    (void)m;
    if (at.sym == SAGA_SYM_SPLIT || at.sym == SAGA_SYM_OCCUPANCY)
        assert_true(at.index < s->n_nodes);
    if (at.sym == SAGA_SYM_SPLIT)
        sym = s->split[at.index];
    else if (at.sym == SAGA_SYM_OCCUPANCY)
        sym = (uint32_t)s->occupancy[at.index] >> at.bit & 1u;
    else if (at.sym == SAGA_SYM_N_FINE)
        sym = s->n_fine[at.index];
    else if (at.sym == SAGA_SYM_N_PRIM)
        sym = s->n_prim[at.index];
    else if (at.sym == SAGA_SYM_FINE_SUFFIX)
        sym = count_low(s->fine_suffix + at.index, n_sym - 1, at.bit);
    else
        sym = count_low(s->prim_suffix + at.index, n_sym - 1, at.bit);
    assert_true(sym < n_sym);
    return sym;
}

static uint32_t suffix_of(const saga_scene *s, uint32_t rank)
{
    const uint32_t bits = s->model.tier[SAGA_TIER_COARSE].suffix_bits;
    uint32_t v[4];

    for (uint32_t i = 0; i < 4; i++)
        v[i] = (uint32_t)(s->fine[rank].local[i] + 16384) >> (15 - bits);
    return saga_morton_suffix(v, bits);
}

static void symbols_make(saga_symbols *s, const saga_scene *scene)
{
    recorder_alloc_symbols(s, scene->n, scene->model.features, scene->n_nodes);
    s->n_nodes = scene->n_nodes;
    memcpy(s->split, scene->split, scene->n_nodes);
    memcpy(s->occupancy, scene->occupancy, 2u * scene->n_nodes);
    for (uint32_t i = 0; i < scene->n.coarse; i++)
        s->n_fine[i] = scene->coarse[i].n_fine;
    for (uint32_t i = 0; i < scene->n.fine; i++) {
        s->fine_suffix[i] = suffix_of(scene, i);
        s->n_prim[i] = scene->fine[i].n_prim;
    }
}

static void check_fine(const saga_fine *a, const saga_fine *b)
{
    for (int i = 0; i < 3; i++)
        assert_int_equal(a->x[i], b->x[i]);
    assert_int_equal(a->t, b->t);
    assert_int_equal(a->parent, b->parent);
    assert_int_equal(a->group, b->group);
    assert_int_equal(a->n_prim, b->n_prim);
    assert_int_equal(a->first_prim, b->first_prim);
}

static void check_coarse(const saga_coarse *a, const saga_coarse *b)
{
    for (int i = 0; i < 3; i++)
        assert_int_equal(a->cell[i], b->cell[i]);
    assert_int_equal(a->cell_t, b->cell_t);
    assert_int_equal(a->depth_x, b->depth_x);
    assert_int_equal(a->depth_t, b->depth_t);
    assert_int_equal(a->group, b->group);
    assert_int_equal(a->n_fine, b->n_fine);
    assert_int_equal(a->first_fine, b->first_fine);
}

/* Checks that the decoder's traversal of the scene's symbols gives the scene.
 */
static void check_walk(const saga_scene *s, const saga_symbols *symbols)
{
    saga_nets nets;
    FREED_BY(saga_scaffold_free) saga_scaffold sc;
    FREED uint8_t *params;
    lookup c = { .coder.residual = zero_residual,
                 .coder.adaptive = look_up,
                 .s = symbols };

    saga_nets_layout(&nets, &s->model);
    params = must(aligned_alloc(16, nets.nbytes + 16));
    memset(params, 0, nets.nbytes + 16);
    recorder_scaffold(&sc, &s->model, &nets, params, s->n);
    saga_syntax_begin(&sc);
    assert_true(saga_syntax_coarse(&sc, &c.coder));
    assert_true(saga_syntax_fine(&sc, &c.coder));
    assert_true(saga_syntax_prim(&sc, &c.coder));
    for (uint32_t i = 0; i < s->n.coarse; i++)
        check_coarse(&s->coarse[i], &sc.coarse[i]);
    for (uint32_t i = 0; i < s->n.fine; i++)
        check_fine(&s->fine[i], &sc.fine[i]);
}

static void check_symbols(const saga_symbols *a, const saga_symbols *b)
{
    assert_int_equal(a->n_nodes, b->n_nodes);
    assert_memory_equal(&a->n, &b->n, sizeof a->n);
    assert_memory_equal(a->split, b->split, a->n_nodes);
    assert_memory_equal(a->occupancy, b->occupancy, 2u * a->n_nodes);
    assert_memory_equal(a->n_fine, b->n_fine, a->n.coarse);
    assert_memory_equal(a->fine_suffix, b->fine_suffix, 4u * a->n.fine);
    assert_memory_equal(a->n_prim, b->n_prim, a->n.fine);
    assert_memory_equal(a->centre, b->centre, 16u * a->n.coarse);
    assert_memory_equal(a->fine_offset, b->fine_offset, 16u * a->n.fine);
}

/* Checks that the symbols come back after encoding with constant networks and
 * decoding. */
static void check_bytes(const saga_scene *s, const saga_symbols *symbols)
{
    saga_nets shapes;
    saga_net_symbols nets, nets_read;
    FREED_BY(recorder_free_symbols) saga_symbols read;
    saga_encode_sizes sizes;
    saga_encoder *e;
    uint32_t final_range[3];
    FREED uint8_t *bytes;
    size_t n;
    saga_header h = { .model = s->model,
                      .level = 3,
                      .fps_num = 30,
                      .fps_den = 1,
                      .unit_mantissa = 1 };

    saga_nets_layout(&shapes, &s->model);
    recorder_alloc_nets(&nets, &shapes);
    for (int net = 0; net < SAGA_N_NETS; net++)
        for (int i = 0; i < shapes.shape[net].n_layers; i++)
            nets.layer[net][i].step_q16 = 1;
    assert_done(e = saga_encoder_open(&h, NULL, &nets, &error));
    assert_done(saga_encoder_segment(e, symbols, 1, &error));
    assert_done(saga_encoder_finish(e, &bytes, &n, &sizes, &error));
    assert_true(recorder_read(&nets_read, &read, 0, final_range, bytes, n));
    check_symbols(symbols, &read);
    saga_encoder_free(e);
    saga_net_symbols_free(&nets);
    saga_net_symbols_free(&nets_read);
}

/* --- What every scene has to be ------------------------------------------ */

static void check_inside(const saga_scene *s, const real x[4],
                         const saga_coarse *c)
{
    real cell[4];

    saga_scene_cell(cell, c);
    for (int i = 0; i < 4; i++) {
        const real half = i < 3 ? saga_scene_half_x(c) : saga_scene_half_t(c);

        assert_true(fabs((double)(x[i] - cell[i])) <= (double)half);
    }
    if (!saga_is_dynamic(&s->model))
        assert_true(x[3] == R(0.5));
}

/* Checks the fine anchors of one parent: their ranks are consecutive; they lie
 * inside the cell and within half a grid step of the suffix's centre, in
 * ascending order. */
static void check_leaf(const saga_scene *s, uint32_t rank)
{
    const saga_coarse *const c = &s->coarse[rank];
    const saga_tier *const l = s->model.tier;
    const int bits = l[SAGA_TIER_COARSE].suffix_bits;
    real cell[4];

    assert_in_range(c->n_fine, 1, l[SAGA_TIER_COARSE].max_children);
    saga_scene_cell(cell, c);
    check_inside(s, s->coarse_x + 4 * rank, c);
    for (uint32_t i = c->first_fine; i < c->first_fine + c->n_fine; i++) {
        const real *const x = s->fine_x + 4 * i;

        assert_int_equal(s->fine[i].parent, rank);
        assert_in_range(s->fine[i].n_prim, 1, l[SAGA_TIER_FINE].max_children);
        check_inside(s, x, c);
        for (int k = 0; k < 4; k++) {
            const double half = (double)(k < 3 ? saga_scene_half_x(c)
                                               : saga_scene_half_t(c));
            const double o = (double)(x[k] - cell[k]) / half;

            assert_true(fabs(o - s->fine[i].local[k] / 16384.0) <=
                        1.0 / (1 << bits));
        }
        if (i > c->first_fine)
            assert_true(suffix_of(s, i) >= suffix_of(s, i - 1));
    }
}

static real clamped(real x, double lo, double hi)
{
    return (double)x < lo ? (real)lo : (double)x > hi ? (real)hi : x;
}

/* How far primitives may be from their place: 0 unless too many share one. */
static double may_move;

/* Checks that every primitive occurs once, in its place, under an anchor of its
 * cell. */
static void check_prims(const saga_scene *s, const uint32_t *source,
                        const flat *f)
{
    FREED uint8_t *const seen = zeroed(f->n, 1);

    assert_int_equal(s->n.prim, f->n);
    for (uint32_t rank = 0; rank < s->n.prim; rank++) {
        const saga_fine *const a = &s->fine[s->prim_fine[rank]];
        const uint32_t at = source[rank];

        assert_true(at < f->n);
        assert_false(seen[at]);
        seen[at] = 1;
        assert_in_range(rank, a->first_prim, a->first_prim + a->n_prim - 1u);
        check_inside(s, s->prim_x + 4 * rank, &s->coarse[a->parent]);
        for (uint32_t i = 0; i < 3; i++)
            assert_true(fabs((double)s->prim_x[4 * rank + i] -
                             (double)clamped(f->p.mean[3 * at + i], -1,
                                             1 - 0x1p-23)) <= may_move);
        if (saga_is_dynamic(&s->model))
            assert_true(s->prim_x[4 * rank + 3] ==
                        clamped(f->p.t_centre[at], 0, 1 - 0x1p-16));
    }
}

static void check_scene(const saga_scene *s, const uint32_t *source,
                        const flat *f, const saga_hierarchy_options *o)
{
    FREED_BY(recorder_free_symbols) saga_symbols symbols;
    uint32_t fine = 0;

    assert_true(s->n.coarse <= o->max_coarse);
    assert_true(s->n.fine <= o->max_fine);
    for (uint32_t rank = 0; rank < s->n.coarse; rank++) {
        assert_int_equal(s->coarse[rank].first_fine, fine);
        fine += s->coarse[rank].n_fine;
        check_leaf(s, rank);
        if (!saga_is_dynamic(&s->model))
            assert_int_equal(s->coarse[rank].depth_t, 0);
    }
    assert_int_equal(fine, s->n.fine);
    check_prims(s, source, f);
    symbols_make(&symbols, s);
    check_walk(s, &symbols);
    check_bytes(s, &symbols);
}

/* --- Building ------------------------------------------------------------ */

/* The subject of a test: primitives, the model and options for them, and the
 * scene that was built last. A new subject frees the old one. */
static flat f;
static struct {
    saga_model model;
    saga_hierarchy_options o;
} u;
static saga_scene s;

static void given(uint32_t n, uint64_t seed)
{
    flat_free(&f);
    f = flat_make(n, seed);
}

static void limit(uint32_t tools, uint32_t max_coarse, uint32_t max_fine)
{
    model_make(&u.model, tools);
    saga_hierarchy_defaults(&u.o);
    u.o.model = &u.model;
    u.o.max_coarse = max_coarse;
    u.o.max_fine = max_fine;
    u.o.seed = 1;
}

static bool try_build(uint32_t *source, saga_error *why)
{
    const saga_hierarchy_pool pool = { &f.p, f.score, f.n };

    saga_scene_free(&s);
    why->message[0] = '\0';
    return saga_hierarchy_build(&s, source, &pool, &u.o, why);
}

/* Builds and checks a scene. */
static void build(void)
{
    FREED uint32_t *const source = zeroed(f.n, sizeof *source);

    assert_done(try_build(source, &error));
    check_scene(&s, source, &f, &u.o);
}

/* Checks that building is refused. why: the message without its remedy. */
static void refuse(const char *why)
{
    FREED uint32_t *const source = zeroed(f.n, sizeof *source);
    saga_error error;

    assert_false(try_build(source, &error));
    error.message[strcspn(error.message, ";")] = '\0';
    assert_string_equal(error.message, why);
}

static uint32_t max_depth_t(void)
{
    uint32_t depth = 0;

    for (uint32_t i = 0; i < s.n.coarse; i++)
        if (s.coarse[i].depth_t > depth)
            depth = s.coarse[i].depth_t;
    return depth;
}

/* Returns the root mean square distance of primitives from their fine anchors.
 */
static double spread(void)
{
    double sum = 0;

    for (uint32_t i = 0; i < s.n.prim; i++)
        for (int k = 0; k < 3; k++) {
            const double d =
                (double)(s.prim_x[4 * i + (uint32_t)k] -
                         s.fine_x[4 * s.prim_fine[i] + (uint32_t)k]);

            sum += d * d;
        }
    return sqrt(sum / s.n.prim);
}

/* --- Tests --------------------------------------------------------------- */

/* A split adds 15 leaves at most. If the budget of fine anchors is used up,
 * there must be fewer leaves than their budget allows. */
TEST(hierarchy_should_hold_everything_within_its_budgets)
{
    enum { ANY = -1, NO_WIDTH = 1u << SAGA_TOOL_MOTION_SHIFT };
    static const struct {
        const char *name;
        uint32_t n, tools, max_coarse, max_fine, least_coarse;
        uint64_t seed;
        bool clustered;
        int n_fine, splits_time;
    } scenes[] = {
        { "uniform", 3000, ALL_TOOLS, 150, 700, 136, 1, false, 700, 1 },
        { "few anchors", 200, ALL_TOOLS, 200, 30, 1, 17, false, 30, ANY },
        { "clustered", 3000, ALL_TOOLS, 400, 1200, 1, 2, true, 1200, ANY },
        { "without width", 500, NO_WIDTH, 80, 300, 1, 4, false, ANY, 0 },
        { "one", 1, ALL_TOOLS, 50, 300, 1, 5, false, 1, 0 },
    };

    for (size_t i = 0; i < sizeof scenes / sizeof scenes[0]; i++) {
        print_message("%s\n", scenes[i].name);
        given(scenes[i].n, scenes[i].seed);
        if (scenes[i].clustered)
            flat_cluster(&f);
        limit(scenes[i].tools, scenes[i].max_coarse, scenes[i].max_fine);
        build();
        assert_true(s.n.coarse >= scenes[i].least_coarse);
        if (scenes[i].n_fine != ANY)
            assert_int_equal(s.n.fine, scenes[i].n_fine);
        if (scenes[i].splits_time != ANY)
            assert_int_equal(max_depth_t() > 0, scenes[i].splits_time);
    }
}

static void model_vary(saga_model *m, uint64_t *seed)
{
    saga_tier *const l = m->tier;

    model_make(m, (uint32_t)(uniform(seed) * (SAGA_TOOLS_PICTURE + 1)) &
                      SAGA_TOOLS_PICTURE);
    l[0].suffix_bits = (uint8_t)(uniform(seed) * 9);
    l[0].max_children = (uint8_t)(1 + uniform(seed) * 16);
    l[1].max_children = (uint8_t)(1 + uniform(seed) * 16);
    l[0].n_groups = (uint8_t)(1 + uniform(seed) * 16);
    l[1].n_groups = (uint8_t)(1 + uniform(seed) * 16);
}

/* A scene may be refused only because of a budget. */
TEST(hierarchy_should_be_valid_when_limits_vary)
{
    uint64_t seed = 7;
    uint32_t built = 0;

    for (uint32_t round = 0; round < 300; round++) {
        const uint32_t n = (uint32_t)(1 + uniform(&seed) * 250);
        const uint32_t max_coarse = (uint32_t)(1 + uniform(&seed) * n);
        const uint32_t max_fine = (uint32_t)(1 + uniform(&seed) * n);
        FREED uint32_t *const source = zeroed(n, sizeof *source);
        saga_error error;

        given(n, seed + round);
        limit(0, max_coarse, max_fine);
        if (round % 3 == 0)
            u.o.max_coarse = u.o.max_fine = n;
        model_vary(&u.model, &seed);
        if (round & 1u)
            flat_cluster(&f);
        if (try_build(source, &error)) {
            check_scene(&s, source, &f, &u.o);
            built++;
        } else {
            assert_non_null(strstr(error.message, "budget"));
            assert_true(round % 3);
        }
    }
    printf("%u of 300 built\n", (unsigned)built);
    assert_true(built > 150);
}

/* Makes primitives of which half stand still and are always visible, and half
 * move along x. */
static void given_moving(int varies)
{
    given(800, 3);
    for (uint32_t i = 0; i < f.n; i++) {
        f.score[i] = 1;
        f.p.log2_width[i] = 3;
        if (i & 1u)
            continue;
        f.p.log2_width[i] = -4;
        f.p.motion[9 * i] = 1;
        for (uint32_t k = 0; k < 3; k++)
            f.p.mean[3 * i + k] = (real)(-0.7 +
                                         0.1 * (double)f.p.mean[3 * i + k]);
        if (varies)
            f.p.mean[3 * i] += f.p.t_centre[i];
        else
            f.p.t_centre[i] = R(0.4);
    }
}

/* Returns the number of still (odd) or moving primitives under a leaf split in
 * time. Still ones count only in octants where nothing moves. */
static uint32_t n_split(const uint32_t *source, int still)
{
    uint32_t n = 0;

    for (uint32_t i = 0; i < s.n.prim; i++) {
        const real *const x = s.prim_x + 4 * i;

        if (still ? (source[i] & 1u) && (x[1] >= 0 || x[2] >= 0)
                  : !(source[i] & 1u))
            n += s.coarse[s.fine[s.prim_fine[i]].parent].depth_t > 0;
    }
    return n;
}

TEST(hierarchy_should_split_time_only_where_it_varies)
{
    uint32_t source[800];

    limit(ALL_TOOLS, 100, 400);
    given_moving(1);
    assert_done(try_build(source, &error));
    check_scene(&s, source, &f, &u.o);
    assert_true(n_split(source, 0) > 360);
    assert_int_equal(n_split(source, 1), 0);

    given_moving(0);
    build();
    assert_int_equal(max_depth_t(), 0);
}

/* A quarter of the primitives is visible for short times, spread among
 * primitives that are always visible. Cells must not be split in time, unless
 * min_local, the least such part that justifies it, is set to 0. */
TEST(hierarchy_should_not_split_time_for_a_minority)
{
    given(800, 16);
    for (uint32_t i = 0; i < f.n; i++) {
        f.score[i] = 1;
        f.p.log2_width[i] = i % 4 ? 5 : -4;
    }
    limit(ALL_TOOLS, 30, 300);
    build();
    assert_int_equal(max_depth_t(), 0);
    u.o.min_local = 0;
    build();
    assert_true(max_depth_t() > 0);
}

TEST(hierarchy_should_not_split_time_when_model_is_still)
{
    given_moving(1);
    limit(SAGA_TOOL_VIEW, 100, 400);
    build();
    assert_int_equal(max_depth_t(), 0);
    /* Still primitives without scores need only some of the arrays. */
    f.p.t_centre = f.p.motion = f.p.log2_width = f.p.support = NULL;
    f.p.slope = f.p.colour = f.p.log2_scale = NULL;
    free(f.score);
    f.score = NULL;
    build();
}

TEST(hierarchy_should_take_degenerate_inputs)
{
    /* All primitives are at one point and have no importance, which gives one
     * full leaf. */
    given(160, 6);
    limit(ALL_TOOLS, 50, 300);
    for (uint32_t i = 0; i < f.n; i++) {
        memset(f.p.mean + 3 * i, 0, 3 * sizeof *f.p.mean);
        f.p.t_centre[i] = R(0.3);
        f.score[i] = 0;
    }
    build();
    assert_int_equal(s.n.coarse, 1);
    assert_int_equal(s.n.fine, 16);

    /* On a plane. */
    given(1000, 7);
    for (uint32_t i = 0; i < f.n; i++)
        f.p.mean[3 * i + 1] = R(0.125);
    build();
}

/* Two groups of primitives, in one leaf each, differ only in their importance.
 * The more important one must get more fine anchors. */
TEST(hierarchy_should_give_anchors_to_what_matters)
{
    given(120, 14);
    for (uint32_t i = 0; i < f.n; i++) {
        f.score[i] = i & 1u ? 9 : 1;
        for (uint32_t k = 0; k < 3; k++)
            f.p.mean[3 * i + k] =
                i & 1u ? -f.p.mean[3 * (i - 1) + k]
                       : (real)(-0.5 + 0.4 * (double)f.p.mean[3 * i + k]);
    }
    limit(0, 2, 18);
    u.o.beta = 0;
    build();
    assert_int_equal(s.n.coarse, 2);
    /* The 18 fine anchors are divided in the ratio of 1 : sqrt(9), but each of
     * the two leaves of 60 primitives gets 6 to 16. */
    assert_int_equal(s.coarse[0].n_fine, 6);
    assert_int_equal(s.coarse[1].n_fine, 12);
    u.o.max_fine = 24;
    build();
    assert_int_equal(s.coarse[0].n_fine, 8);
    assert_int_equal(s.coarse[1].n_fine, 16);
}

/* With five groups of primitives in one leaf and five anchors, each group must
 * get an anchor. If an anchor has room for eight and a group has ten, two
 * primitives must go to another anchor. */
TEST(hierarchy_should_find_crowds_with_medoids)
{
    given(50, 15);
    for (uint32_t i = 0; i < f.n; i++) {
        const uint32_t crowd = i % 5;

        for (uint32_t k = 0; k < 3; k++)
            f.p.mean[3 * i + k] = (real)(0.2 + 0.15 * crowd +
                                         0.02 * (double)f.p.mean[3 * i + k]);
    }
    limit(0, 1, 5);
    build();
    assert_int_equal(s.n.fine, 5);
    assert_true(spread() < 0.03);
    for (uint32_t i = 0; i < 5; i++)
        assert_int_equal(s.fine[i].n_prim, 10);
    u.o.max_fine = 7;
    u.model.tier[SAGA_TIER_FINE].max_children = 8;
    build();
    for (uint32_t i = 0; i < 7; i++)
        assert_in_range(s.fine[i].n_prim, 1, 8);
}

/* Primitives in the corners of the cube, and far outside of it in space and
 * time, must be moved to the nearest valid positions. */
TEST(hierarchy_should_clamp_what_is_outside)
{
    static const double values[6] = { -1, 1, -1e30, 1e30, 1.5, 0 };
    static const double times[6] = { 0, 1, -3, 7, 0.5, 1e30 };

    given(216, 8);
    for (uint32_t i = 0; i < f.n; i++) {
        f.p.mean[3 * i] = (real)values[i % 6];
        f.p.mean[3 * i + 1] = (real)values[i / 6 % 6];
        f.p.mean[3 * i + 2] = (real)values[i / 36];
        f.p.t_centre[i] = (real)times[(i + i / 6) % 6];
        f.p.motion[9 * i] = R(1e30);
        f.p.log2_scale[3 * i] = R(1e30);
        f.p.log2_width[i] = (real)(values[i % 6]);
    }
    limit(ALL_TOOLS, 200, 216);
    build();
}

/* Cells with too many primitives must be split further, down to the deepest
 * cells, or in time. */
TEST(hierarchy_should_split_further_when_too_many)
{
    given(300, 9);
    limit(ALL_TOOLS, 20, 300);
    for (uint32_t i = 0; i < f.n; i++)
        memset(f.p.mean + 3 * i, 0, 3 * sizeof *f.p.mean);
    /* Primitives that are always visible are no reason to split time; here the
     * limit of primitives requires it. */
    for (uint32_t i = 0; i < f.n; i++)
        f.p.log2_width[i] = 10;
    build();
    assert_true(max_depth_t() > 0);

    /* A cell without time has room for a part of them. The others go to the
     * cells around: 300 fill at most a block of four cells a side, of which
     * there are 2^16 along the cube's side of 2. */
    limit(SAGA_TOOL_VIEW, 300, 300);
    may_move = 4 * 0x1p-15;
    build();
    may_move = 0;
    limit(SAGA_TOOL_VIEW, 20, 300);

    for (uint32_t i = 0; i < f.n; i++)
        f.p.mean[3 * i] = (real)(0.5 + (i & 1u) * 0x1p-15);
    build();
    assert_int_equal(s.n.coarse, 2);
    assert_int_equal(s.coarse[0].depth_x, 16);
}

TEST(hierarchy_should_refuse_when_budgets_are_short)
{
    uint32_t octant[8] = { 0 }, need = 0;
    char text[SAGA_MESSAGE_NBYTES];

    given(1000, 10);
    for (uint32_t i = 0; i < f.n; i++)
        octant[(f.p.mean[3 * i] >= 0) * 4 + (f.p.mean[3 * i + 1] >= 0) * 2 +
               (f.p.mean[3 * i + 2] >= 0)]++;
    for (uint32_t i = 0; i < 8; i++)
        need += (octant[i] + 9) / 10;
    snprintf(text, sizeof text, "%u fine anchors are needed, the budget is 99",
             (unsigned)need);
    limit(ALL_TOOLS, 6, 1000);
    refuse("8 coarse anchors are needed, the budget is 6");
    limit(ALL_TOOLS, 100, 99);
    u.o.max_coarse = 8;
    refuse(text);
    limit(ALL_TOOLS, 0, 99);
    refuse("a budget of anchors is 0");
    limit(ALL_TOOLS, 100, 100);
    u.o.alpha = -1;
    refuse("an option is negative or not finite");
    u.o.alpha = 1;
    u.model.features = 0;
    refuse("the model is not valid");
    model_make(&u.model, 0);
    f.n = 0;
    refuse("there is no primitive");
}

TEST(hierarchy_should_name_what_is_not_finite)
{
    given(20, 11);
    limit(ALL_TOOLS, 20, 20);
    f.p.mean[3 * 17 + 1] = (real)NAN;
    refuse("primitive 17: its mean is not finite");
    f.p.mean[3 * 17 + 1] = 0;
    f.p.opacity[3] = (real)INFINITY;
    refuse("primitive 3: its opacity is not finite");
    f.p.opacity[3] = 0;
    f.p.motion[9 * 19 + 8] = -(real)INFINITY;
    refuse("primitive 19: its motion is not finite");
    f.p.motion[9 * 19 + 8] = 0;
    f.score[0] = (float)NAN;
    refuse("primitive 0: its score is negative or not finite");
    f.score[0] = -1;
    refuse("primitive 0: its score is negative or not finite");
    f.score[0] = 0;
    f.p.quat[79] = (real)NAN;
    refuse("primitive 19: its quat is not finite");
}

static void check_same(const saga_scene *a, const saga_scene *b)
{
    assert_memory_equal(&a->n, &b->n, sizeof a->n);
    assert_int_equal(a->n_nodes, b->n_nodes);
    assert_memory_equal(a->split, b->split, a->n_nodes);
    assert_memory_equal(a->occupancy, b->occupancy, 2u * a->n_nodes);
    assert_memory_equal(a->coarse, b->coarse, a->n.coarse * sizeof *a->coarse);
    assert_memory_equal(a->fine, b->fine, a->n.fine * sizeof *a->fine);
    assert_memory_equal(a->prim_fine, b->prim_fine, 4u * a->n.prim);
    assert_int_equal(a->n_reals, b->n_reals);
    assert_memory_equal(a->reals, b->reals, a->n_reals * sizeof *a->reals);
}

TEST(hierarchy_should_be_the_same_when_built_again)
{
    uint32_t source[2][2000];
    FREED_BY(saga_scene_free) saga_scene first;

    given(2000, 12);
    flat_cluster(&f);
    limit(ALL_TOOLS, 300, 1000);
    assert_done(try_build(source[0], &error));
    first = s;
    memset(&s, 0, sizeof s);
    assert_done(try_build(source[1], &error));
    check_same(&first, &s);
    assert_memory_equal(source[0], source[1], sizeof source[0]);
}

/* The limit is ten times the usual time, for sanitizers and slow machines. */
TEST(hierarchy_should_be_quick_when_large)
{
    enum { N = 20000 };
    FREED uint32_t *const source = zeroed(N, sizeof *source);

    given(N, 13);
    for (int round = 0; round < 2; round++) {
        const clock_t begin = clock();

        if (round)
            flat_cluster(&f);
        limit(ALL_TOOLS, 2000, 6400);
        assert_done(try_build(source, &error));
        assert_true(clock() - begin < 10 * CLOCKS_PER_SEC);
        check_scene(&s, source, &f, &u.o);
    }
}
