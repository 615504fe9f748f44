/* SPDX-License-Identifier: MIT
 *
 * The networks of primitives on a device against the host's float, whose
 * gradients finite differences in double hold (test_twin_gradient_f64). Both
 * round, in different orders: errors of pictures may differ by 1e-5 and
 * gradients by 1e-4 of a tensor's largest. SAGA_TEST_GPU is the number of the
 * device; the first one is the default. Without a device the test is skipped.
 */
#include "fit_away.h"
#include "gpu_spoil.h"
#include "gpu_stages.h"
#include "gpu_ways.h"
#include "gpu_world.h"
#include "near.h"
#include "rng.h"

enum { N = 700, FEATURES = 20, MOST = 64 };

TEST_GROUP(set_up_world, tear_down_world);

/* --- A scene ------------------------------------------------------------- */

/* A case: tools, hidden units of F_geo or none, whether it is a base, how many
 * primitives are drawn, and whether values are at their bounds. */
typedef struct {
    const char *name;
    uint32_t tools;
    uint8_t width, octaves;
    bool still;
    uint32_t drawn;
    bool is_bounded;
} variant;

static const variant variants[] = {
    { "still", 0, 0, 1, false, N, false },
    { "moving", SAGA_TOOL_MOTION_MASK | SAGA_TOOL_SLOPE | SAGA_TOOL_OPACITY_T,
      0, 1, false, N, false },
    { "lines", 1 << SAGA_TOOL_MOTION_SHIFT | SAGA_TOOL_OPACITY_T, 0, 1, false,
      N, false },
    { "deep", SAGA_TOOLS_PICTURE, 40, 1, false, N, false },
    { "base", SAGA_TOOLS_PICTURE, 8, 2, true, N, false },
    { "a_part", SAGA_TOOLS_PICTURE, 12, 1, false, 333, false },
    { "bounds", SAGA_TOOLS_PICTURE, 0, 1, false, N, true },
};

static saga_model model_of(const variant *v)
{
    saga_model m = { .tools = v->tools,
                     .features = FEATURES,
                     .octaves = v->octaves,
                     .lambda_t_q8 = 256 };

    for (int i = 0; i < SAGA_N_KINDS; i++)
        m.sources[i] = SAGA_SOURCE_HYPER;
    for (int i = 0; i < SAGA_N_NETS; i++) {
        m.width[i] = 8;
        m.q_in[i] = 12;
    }
    m.width[SAGA_NET_GEO] = v->width;
    m.width[SAGA_NET_FINE] = 0;
    m.width[SAGA_NET_FUSE_C] = m.width[SAGA_NET_FUSE_F] = 0;
    return m;
}

/* Primitives in the middle of the cube, about as large as a few pixels; each
 * with a coarse and a fine anchor of its own. */
static void make_scene(saga_scene *s, const variant *v)
{
    const saga_model m = model_of(v);
    const saga_rng r = saga_rng_stream(3, 1);
    uint64_t k = 0;

    assert_done(
        saga_scene_init(s, &m, (saga_counts){ N, N, N }, 1, 77, &error));
    s->still = v->still;
    for (uint32_t i = 0; i < N; i++) {
        s->coarse[i].depth_x = (uint8_t)(5 + i % 2);
        s->coarse[i].depth_t = (uint8_t)(i % 3);
        s->fine[i].parent = i;
        s->prim_fine[i] = i;
        for (size_t a = 0; a < 4; a++) {
            s->fine_x[4 * i + a] = a < 3 ? saga_rng_float(r, k++) - R(0.5)
                                         : saga_rng_float(r, k++);
            s->prim_x[4 * i + a] = s->fine_x[4 * i + a] +
                                   R(0.02) * (saga_rng_float(r, k++) - R(0.5));
        }
    }
    for (size_t i = 0; i < (size_t)N * FEATURES; i++)
        s->coarse_feature[i] = R(0.6) * R(saga_rng_normal(r, k++));
    for (real *p = s->params; p < s->reals + s->n_reals; p++)
        *p += R(0.05) * R(saga_rng_normal(r, k++));
}

/* Moves outputs to their bounds, which about half of the primitives pass: the
 * motion of the third order, temporal centres, and colours. */
static void approach_bounds(saga_scene *s)
{
    const saga_net *const geo = &s->net[SAGA_NET_GEO];
    const saga_net *const colour = &s->net[SAGA_NET_COLOUR];
    saga_attr_part part[MOST];

    saga_twin_parts(part, s);
    for (int k = 0; k < geo->dim[geo->n_layers]; k++) {
        real *const b = geo->b[geo->n_layers - 1] + k;

        if (part[k].attr == SAGA_ATTR_MOTION && part[k].part >= 6)
            *b = SAGA_TWIN_MOST_MOTION;
        if (part[k].attr == SAGA_ATTR_T_CENTRE)
            *b = 4;
    }
    for (int k = 0; k < 3; k++)
        colour->b[colour->n_layers - 1][k] += R(k - 1) * R(0.5);
}

static void link_own(saga_links *l)
{
    l->n = N;
    for (uint32_t i = 0; i < N; i++) {
        l->begin[i] = i;
        l->rank[i] = i;
        l->weight[i] = 1;
    }
    l->begin[N] = N;
}

/* --- Both ways ----------------------------------------------------------- */

/* A twin of the scene, and gradients: of networks, and of what they read. */
typedef struct {
    saga_scene d;
    saga_twin w;
    double mse;
} result;

static void begin(result *r, const saga_scene *s)
{
    assert_done(saga_scene_init(&r->d, &s->model, s->n, 1, 0, &error));
    memset(r->d.reals, 0, r->d.n_reals * sizeof(real));
    assert_done(saga_twin_init(&r->w, s, &error));
    link_own(&r->w.to_fine);
    link_own(&r->w.to_prim);
    saga_twin_note_own(&r->w, s);
    /* Offsets are in the supports of the last pass. */
    saga_twin_geometry(&r->w, s, s->coarse_feature);
    saga_twin_offsets(&r->w, s);
    saga_twin_clear(&r->w, s);
}

static void end(result *r)
{
    saga_twin_free(&r->w);
    saga_scene_free(&r->d);
}

/* The sizes from which on primitives cost something: those of an output of 0,
 * which about half of the outputs exceed. The price is as steep as a picture's
 * gradients. */
static void limit_sizes(real most[N], const saga_scene *s)
{
    for (size_t i = 0; i < N; i++)
        most[i] = -R(s->coarse[i].depth_x);
}

#define SIZE_PRICE R(1e-4)

static void on_host(result *r, saga_canvas *c, const saga_scene *s, uint32_t n)
{
    saga_splat_learning l = { .d = r->w.d_attr };
    real most[N];

    limit_sizes(most, s);
    saga_twin_geometry(&r->w, s, s->coarse_feature);
    saga_twin_colour(&r->w, s, c->camera.centre);
    assert_done(saga_splat_learn(&l, c, &r->w.attr, n, &error));
    r->mse = l.mse;
    saga_twin_colour_backward(&r->w, &r->d, s);
    saga_twin_size_loss(&r->w, most, n, SIZE_PRICE);
    saga_twin_backward(&r->w, &r->d, s);
}

/* Runs the networks of the first n primitives before and after a picture. */
static void learn(double *mse, saga_gpu_canvas *g, const saga_canvas *c,
                  const saga_away *a, uint32_t n)
{
    saga_gpu_pass pass = { .canvas = c };
    saga_gpu_ways w = { .n_up = 0 };
    saga_gpu_prims_run run;
    saga_away_prims p;
    saga_error failure = { "" };

    saga_away_list_prims(&p, a, n);
    saga_gpu_list_prims(&run, &w, &p.to);
    saga_gpu_set_frame(g, c, p.to.attrs, n);
    assert_done(saga_gpu_prims_room(g, &run, &error));
    assert_done(saga_gpu_ways_room(g, w.up, w.n_up, "networks", &error));
    assert_done(saga_gpu_ways_back(g, w.down, w.n_down, "networks", &error));
    saga_gpu_ways_pack(g, w.up, w.n_up);
    while (saga_gpu_begin_pass(&pass, g, &failure)) {
        saga_gpu_ways_send(g, w.up, w.n_up);
        saga_gpu_prims_forward(g, &run);
        saga_gpu_record_lists(g);
        saga_gpu_record_truth(g);
        saga_gpu_record_tiles(g);
        saga_gpu_record_back(g);
        saga_gpu_record_sums(g, 0);
        saga_gpu_prims_backward(g, &run);
        saga_gpu_ways_fetch(g, w.down, w.n_down);
        saga_gpu_end_pass(&pass, g, &failure);
    }
    assert_true(pass.is_done);
    saga_gpu_ways_take(g, w.down, w.n_down);
    *mse = saga_gpu_mse(g, c);
}

/* Takes what the networks read to the device, and the gradients back. */
static void on_gpu(result *r, saga_gpu_canvas *g, saga_gpu *gpu,
                   const saga_canvas *c, const saga_scene *s, uint32_t n)
{
    const saga_away a = { .scene = s, .d = &r->d, .size_price = SIZE_PRICE };
    const size_t f = (size_t)N * FEATURES, zeros = f > 4 * N ? f : 4 * N;
    FREED real *const zero = zeroed(zeros, sizeof *zero);
    real level[2 * N], most[N], limit[N];
    const saga_gpu_way up[] = {
        { .buffer = GPU_FEATURE, .n = f, .from = r->w.fine_feature },
        { .buffer = GPU_PLACE, .n = 4 * N, .from = s->prim_x },
        { .buffer = GPU_OFFSET4, .n = 4 * N, .from = r->w.prim_offset },
        { .buffer = GPU_SUPPORT, .n = 4 * N, .from = r->w.support },
        { .buffer = GPU_LEVEL, .n = 2 * N, .from = level },
        { .buffer = GPU_LIMIT, .n = N, .from = limit },
        { .buffer = GPU_D_FEATURE, .n = f, .from = zero },
        { .buffer = GPU_D_PLACE, .n = 4 * N, .from = zero },
        { .buffer = GPU_D_LOG2, .n = 4 * N, .from = zero }
    };
    const saga_gpu_way down[] = {
        { .buffer = GPU_D_FEATURE, .n = f, .to = r->w.d_fine_feature },
        { .buffer = GPU_D_PLACE, .n = 4 * N, .to = r->d.prim_x },
        { .buffer = GPU_D_LOG2, .n = 4 * N, .to = r->w.d_log2_support }
    };

    saga_twin_geometry(&r->w, s, s->coarse_feature);
    saga_away_levels(level, s);
    limit_sizes(most, s);
    saga_away_limits(limit, most, level, N);
    assert_true(saga_away_can(gpu, &a));
    assert_done(saga_gpu_ways_put(g, up, 9, "values", &error));
    learn(&r->mse, g, c, &a, n);
    assert_done(saga_gpu_ways_get(g, down, 3, "gradients", &error));
}

/* --- The comparison ------------------------------------------------------ */

/* Returns whether gradients are there, and near the host's. */
static bool agrees(const char *scene, const char *of, const real *x,
                   const real *y, size_t n)
{
    return largest(y, n) > 0 && is_near(scene, of, x, y, n, 1e-4);
}

static bool nets_are_near(const variant *v, const saga_scene *a,
                          const saga_scene *b)
{
    static const struct {
        int net;
        const char *name;
    } list[] = { { SAGA_NET_GEO, "F_geo" },
                 { SAGA_NET_COLOUR_BASE, "base" },
                 { SAGA_NET_COLOUR_VIEW, "view" },
                 { SAGA_NET_COLOUR, "colour" } };
    bool ok = true;

    for (size_t i = 0; i < sizeof list / sizeof list[0]; i++) {
        const saga_net *const n = &a->net[list[i].net];

        for (int l = 0; l < n->n_layers; l++)
            ok = agrees(v->name, list[i].name, n->w[l],
                        b->net[list[i].net].w[l],
                        (size_t)(n->dim[l] + 1) * (size_t)n->dim[l + 1]) &&
                 ok;
    }
    return ok;
}

static bool agree(world *w, saga_gpu_canvas *g, const variant *v)
{
    const saga_sample sample = { .view = w->pictures.train[1], .frame = 2 };
    FREED_BY(saga_canvas_free) saga_canvas c = { 0 };
    FREED_BY(saga_scene_free) saga_scene s;
    FREED_BY(end) result host = { .mse = 0 };
    FREED_BY(end) result away = { .mse = 0 };
    bool ok;

    make_scene(&s, v);
    if (v->is_bounded)
        approach_bounds(&s);
    begin(&host, &s);
    begin(&away, &s);
    assert_done(saga_pictures_canvas(&c, &w->pictures, &error));
    assert_done(saga_gpu_show(g, &c, sample, &error));
    on_gpu(&away, g, w->gpu, &c, &s, v->drawn);
    saga_pictures_truth(&c, &w->pictures, sample);
    on_host(&host, &c, &s, v->drawn);
    ok = is_near(v->name, "error", &(real){ R(away.mse) },
                 &(real){ R(host.mse) }, 1, 1e-5);
    ok = agrees(v->name, "features", away.w.d_fine_feature,
                host.w.d_fine_feature, (size_t)N * FEATURES) &&
         ok;
    ok = agrees(v->name, "positions", away.d.prim_x, host.d.prim_x,
                4 * (size_t)N) &&
         ok;
    /* What stands still has none. */
    ok = is_near(v->name, "supports", away.w.d_log2_support,
                 host.w.d_log2_support, 4 * (size_t)N, 1e-4) &&
         ok;
    ok = nets_are_near(v, &away.d, &host.d) && ok;
    return ok;
}

/* All use one canvas, whose buffers have no numbers before a case. The first is
 * done again, with buffers that are there. */
TEST(networks_should_agree_with_the_host)
{
    world *const w = world_of(state);
    const size_t n = sizeof variants / sizeof variants[0];
    saga_gpu_canvas *g;
    bool ok = true;

    assert_done(g = saga_gpu_canvas_new(w->gpu, &w->pictures, &error));
    for (size_t i = 0; i <= n; i++) {
        spoil(g);
        ok = agree(w, g, &variants[i % n]) && ok;
    }
    saga_gpu_canvas_free(g);
    assert_true(ok);
}
