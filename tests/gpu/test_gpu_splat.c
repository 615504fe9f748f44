/* SPDX-License-Identifier: MIT
 *
 * The kernels against the host's float, whose gradients are tested against
 * finite differences in double (test_splat_gradient_f64). Both round, in
 * different orders: pictures may differ by 1e-5 and gradients by 1e-4 of the
 * tensor's largest magnitude. SAGA_TEST_GPU is the number of the device; the
 * first one is the default. Without a device the tests are skipped.
 */
#include "flat_state.h"
#include "gpu_spoil.h"
#include "gpu_ways.h"
#include "gpu_world.h"
#include "novel.h"
#include "near.h"
#include "splat_scene.h"

TEST_GROUP(set_up_world, tear_down_world);

/* --- A pass -------------------------------------------------------------- */

/* Changes the scene of a case. */
typedef void change(fixture *f);

static void leave_it(fixture *f)
{
    (void)f;
}

/* Thin in one axis, long in another. */
static void make_needles(fixture *f)
{
    for (size_t i = 0; i < f->n; i++) {
        f->p.log2_scale[3 * i] = -12;
        f->p.log2_scale[3 * i + 1] = -1;
    }
}

/* Half of them behind the camera or at its plane. */
static void move_behind(fixture *f)
{
    for (size_t i = 0; i < f->n; i += 2)
        f->p.mean[3 * i + 2] -= 4 - R(1e-3) * R(i % 3);
}

/* All on one tile, and smaller than a pixel. */
static void gather_all(fixture *f)
{
    for (size_t i = 0; i < f->n; i++) {
        f->p.mean[3 * i] = R(0.01) * R(i % 7);
        f->p.mean[3 * i + 1] = R(0.01) * R(i % 5);
        for (size_t a = 0; a < 3; a++)
            f->p.log2_scale[3 * i + a] = -9 + R(0.5) * R(a);
        f->p.opacity[i] = -4;
    }
}

/* Each covers the whole picture: many records for each. */
static void make_large(fixture *f)
{
    for (size_t i = 0; i < f->n; i++) {
        f->p.opacity[i] = -3;
        for (size_t a = 0; a < 3; a++)
            f->p.log2_scale[3 * i + a] = 3 + R(0.1) * R(a);
    }
}

static void hide_all(fixture *f)
{
    for (size_t i = 0; i < f->n; i++)
        f->p.opacity[i] = -9;
}

/* Ages and widths at their limits. */
static void hurry(fixture *f)
{
    for (size_t i = 0; i < f->n; i++) {
        f->p.log2_width[i] = i % 2 ? -4 : 3;
        f->p.t_centre[i] = R(0.5) + R(0.001) * R(i % 400);
        for (size_t a = 0; a < 9; a++)
            f->p.motion[9 * i + a] *= 4;
    }
}

static void steepen(fixture *f)
{
    f->c.rules.square = R(0.5);
}

static void detach(fixture *f)
{
    f->c.rules.detach_time = 1;
}

static void keep_order(fixture *f)
{
    f->c.rules.order = 2;
}

static const struct {
    const char *name;
    size_t n;
    double px;
    change *change;
} cases[] = { { "few", 3, 4, leave_it },
              { "many", 3000, 2, leave_it },
              { "odd_number", 1025, 3, leave_it },
              { "one", 1, 8, leave_it },
              { "needles", 500, 4, make_needles },
              { "behind", 800, 4, move_behind },
              { "one_tile", 30000, 1, gather_all },
              { "large", 300, 1, make_large },
              { "nothing_visible", 100, 3, hide_all },
              { "fast", 2000, 3, hurry },
              { "steep", 1000, 3, steepen },
              { "detached", 1000, 3, detach },
              { "second_order", 1000, 3, keep_order } };

static bool agree(const world *w, fixture *f, const char *name)
{
    const saga_sample sample = { .view = w->pictures.train[1], .frame = 2 };
    FREED_BY(saga_params_free) saga_splat_params other = scene_alloc(f->n);
    FREED_BY(saga_params_free) saga_splat_params before = scene_alloc(f->n);
    saga_splat_learning on_host = { .d = f->d }, on_gpu = { .d = other };
    saga_splat_learning first = { .d = before };
    saga_gpu_canvas *g;
    const saga_splat_camera camera = f->c.camera;
    const size_t plane = 3 * f->plane;
    real *const image = malloc(plane * sizeof *image);
    bool ok;

    assert_done(g = saga_gpu_canvas_new(w->gpu, &w->pictures, &error));
    assert_done(saga_gpu_show(g, &f->c, sample, &error));
    saga_pictures_truth(&f->c, &w->pictures, sample);
    f->c.camera = camera;
    f->c.t = R(0.5);
    f->c.still = NULL;
    /* The first pass makes the buffers; the second must not read them. */
    assert_done(
        saga_gpu_learn(g, &first, &f->c, &f->p, (uint32_t)f->n, &error));
    spoil(g);
    assert_done(
        saga_gpu_learn(g, &on_gpu, &f->c, &f->p, (uint32_t)f->n, &error));
    assert_done(
        saga_splat_learn(&on_host, &f->c, &f->p, (uint32_t)f->n, &error));
    assert_done(saga_gpu_draw(g, &f->c, &f->p, (uint32_t)f->n, &error));
    memcpy(image, f->c.image, plane * sizeof *image);
    assert_done(saga_splat_forward(&f->c, &f->p, (uint32_t)f->n, &error));
    ok = is_near(name, "picture", image, f->c.image, plane, 1e-5);
    ok = is_near(name, "error", &(real){ R(on_gpu.mse) },
                 &(real){ R(on_host.mse) }, 1, 1e-5) &&
         ok;
    for (int a = 0; a < SAGA_N_ATTRS; a++)
        ok = is_near(name, saga_attributes[a].name, other.of[a], f->d.of[a],
                     f->n * (size_t)saga_attributes[a].width, 1e-4) &&
             ok;
    free(image);
    saga_gpu_canvas_free(g);
    return ok;
}

TEST(a_pass_should_agree_with_the_host)
{
    const world *const w = world_of(state);
    bool ok = true;

    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        fixture *const f = new_fixture(cases[i].n, W, H, 7 + i, cases[i].px);

        cases[i].change(f);
        ok = agree(w, f, cases[i].name) && ok;
        free_fixture(f);
    }
    assert_true(ok);
}

/* --- Stored pictures ----------------------------------------------------- */

/* There is room for those that are learned, and for no others. */
TEST(held_out_and_missing_pictures_should_have_no_room)
{
    world *const w = world_of(state);
    saga_source_view *const one = w->capture.views + w->pictures.train[0];
    saga_gpu_canvas *g;

    assert_in_range(w->pictures.n_train, 1, VIEWS - 1);
    one->n_missing = 3;
    assert_done(g = saga_gpu_canvas_new(w->gpu, &w->pictures, &error));
    assert_int_equal(g->cache.n_slots, w->pictures.n_train * FRAMES - 3);
    one->n_missing = 0;
    saga_gpu_canvas_free(g);
}

/* --- Masks --------------------------------------------------------------- */

/* A case: how often the picture is halved, and whether masks are opacities. */
static const struct {
    const char *name;
    int mip;
    bool subject;
} masked[] = { { "mask", 0, false },
               { "halved mask", 1, false },
               { "subject", 0, true },
               { "halved subject", 1, true } };

/* Returns a mask for all frames: blocks of 0 and 1, or opacities. */
static uint8_t *new_mask(bool subject)
{
    uint8_t *const mask = calloc((size_t)W * H * FRAMES, 1);

    for (size_t i = 0; i < (size_t)W * H * FRAMES; i++)
        mask[i] = subject ? (uint8_t)(i * 37 % 256)
                          : (uint8_t)(i / 5 % 3 > 0 || i / W % 4 > 1);
    return mask;
}

/* Compares what a pass has as its truth. */
static bool masks_agree(world *w, fixture *f, size_t number)
{
    const char *const name = masked[number].name;
    const saga_sample sample = { .view = w->pictures.train[1],
                                 .frame = 2,
                                 .mip = masked[number].mip,
                                 .behind = { 200, 100, 50 } };
    saga_source_view *const view = w->capture.views + sample.view;
    FREED_BY(saga_params_free) saga_splat_params other = scene_alloc(f->n);
    FREED_BY(saga_canvas_free) saga_canvas canvas = { 0 };
    saga_splat_learning on_host = { .d = f->d }, on_gpu = { .d = other };
    const size_t n = 3 * (size_t)(W >> sample.mip) * (size_t)(H >> sample.mip);
    real *const truth = calloc(n, sizeof *truth);
    const saga_gpu_way way = {
        .buffer = GPU_TRUTH, .n = n, .to = truth, .replaces = true
    };
    saga_gpu_canvas *g;
    size_t n_unseen;
    bool ok;

    view->mask = new_mask(masked[number].subject);
    w->capture.subject = masked[number].subject;
    assert_done(saga_pictures_canvas(&canvas, &w->pictures, &error));
    assert_done(g = saga_gpu_canvas_new(w->gpu, &w->pictures, &error));
    assert_done(saga_gpu_show(g, &canvas, sample, &error));
    n_unseen = canvas.n_unseen;
    assert_done(
        saga_gpu_learn(g, &on_gpu, &canvas, &f->p, (uint32_t)f->n, &error));
    assert_done(saga_gpu_ways_get(g, &way, 1, "a picture", &error));
    assert_done(saga_novel_show(&canvas, &w->pictures, sample, &error));
    assert_done(
        saga_splat_learn(&on_host, &canvas, &f->p, (uint32_t)f->n, &error));
    assert_int_equal(n_unseen, canvas.n_unseen);
    assert_true(n_unseen > 0 || masked[number].subject);
    ok = is_near(name, "truth", truth, canvas.truth, n, 1e-6);
    ok = is_near(name, "error", &(real){ R(on_gpu.mse) },
                 &(real){ R(on_host.mse) }, 1, 1e-5) &&
         ok;
    w->capture.subject = false;
    free(view->mask);
    view->mask = NULL;
    free(truth);
    saga_gpu_canvas_free(g);
    return ok;
}

TEST(masks_should_count_as_on_the_host)
{
    world *const w = world_of(state);
    fixture *const f = new_fixture(300, W, H, 5, 4);
    bool ok = true;

    for (size_t i = 0; i < sizeof masked / sizeof masked[0]; i++)
        ok = masks_agree(w, f, i) && ok;
    free_fixture(f);
    assert_true(ok);
}

/* --- Pairs --------------------------------------------------------------- */

/* A million splats, each on as many tiles as a picture of 4096 x 4096 has, are
 * more pairs than a word can count. */
TEST(more_pairs_than_a_word_should_be_too_many)
{
    enum { N = 1 << 20, TILES = 1 << 16 };
    const world *const w = world_of(state);
    const uint32_t n = N, is_listed = 0, blocks = N / SAGA_GPU_BLOCK;
    const size_t at = blocks * sizeof(uint32_t);
    saga_gpu_buffer down = { 0 };
    saga_gpu_canvas *g;

    assert_done(g = saga_gpu_canvas_new(w->gpu, &w->pictures, &error));
    assert_done(saga_gpu_room(g, GPU_COUNT, N * sizeof n, "counts", &error));
    assert_done(saga_gpu_room(g, GPU_ORDER, N * sizeof n, "counts", &error));
    assert_done(saga_gpu_room(g, GPU_OFFSET, N * sizeof n, "sums", &error));
    assert_done(saga_gpu_room(g, GPU_SUMS, at + sizeof n, "sums", &error));
    assert_done(saga_gpu_alloc(&down, w->gpu, sizeof n, SAGA_GPU_DOWN, "a sum",
                               &error));
    saga_gpu_begin(w->gpu);
    saga_gpu_fill(w->gpu, &g->on[GPU_COUNT], 0, N * sizeof n, TILES);
    saga_gpu_do_with(
        g, SAGA_KERNEL_SCAN, blocks,
        (int[]){ GPU_FRAME, GPU_COUNT, GPU_ORDER, GPU_OFFSET, GPU_SUMS, -1 },
        (uint32_t[]){ n, is_listed }, 2);
    saga_gpu_do_with(g, SAGA_KERNEL_SCAN_TOP, 1,
                     (int[]){ GPU_FRAME, GPU_SUMS, -1 }, &blocks, 1);
    saga_gpu_copy(w->gpu, &down, 0, &g->on[GPU_SUMS], at, sizeof n);
    assert_done(saga_gpu_finish(w->gpu, &error));
    assert_int_equal(*(const uint32_t *)down.map, INT32_MAX);
    saga_gpu_free(&down, w->gpu);
    saga_gpu_canvas_free(g);
}

/* --- Teachers ------------------------------------------------------------ */

/* Two teachers, whose mean is drawn while a set of the warm-up is on the
 * device: the set must come back unchanged. */
TEST(teachers_should_draw_as_on_the_host)
{
    world *const w = world_of(state);
    fixture *const f = new_fixture(700, W, H, 3, 3), *const g = new_fixture(
                                                         500, W, H, 4, 5);
    const saga_sample sample = { .view = w->capture.n_views, .frame = 1 };
    FREED_BY(saga_params_free) saga_splat_params other = scene_alloc(f->n);
    FREED_BY(saga_params_free) saga_splat_params moments = scene_alloc(f->n);
    const size_t n = 3 * (size_t)W * H;
    real *const truth = calloc(n, sizeof *truth);
    /* Moments are the values again; the sums do not matter here. */
    uint32_t *const seen = calloc(f->n, sizeof *seen);
    const saga_splat_stats stats = { truth, truth, seen };
    const saga_gpu_set put = { .n = (uint32_t)f->n,
                               .value = f->p,
                               .m = f->p,
                               .v = f->p,
                               .stats = stats,
                               .worth = truth },
                       back = { .n = (uint32_t)f->n,
                                .value = other,
                                .m = moments,
                                .v = moments,
                                .stats = stats,
                                .worth = truth };
    const saga_gpu_way way = {
        .buffer = GPU_TRUTH, .n = n, .to = truth, .replaces = true
    };
    saga_source_view between = w->capture.views[w->pictures.train[0]];
    double nearest = w->pictures.range[0];
    saga_novel novel = { .view = &between, .nearest = &nearest, .n_views = 1 };
    FREED_BY(saga_canvas_free) saga_canvas canvas = { 0 };
    saga_gpu_canvas *on;

    assert_done(saga_pictures_canvas(&novel.canvas, &w->pictures, &error));
    assert_done(saga_pictures_canvas(&canvas, &w->pictures, &error));
    assert_done(saga_novel_teach(&novel, &f->p, (uint32_t)f->n, &error));
    assert_done(saga_novel_teach(&novel, &g->p, (uint32_t)g->n, &error));
    w->pictures.novel = &novel;
    assert_done(on = saga_gpu_canvas_new(w->gpu, &w->pictures, &error));
    assert_done(saga_gpu_put(on, &put, &error));
    /* Twice, as teachers are drawn first when they come, and then there. */
    assert_done(saga_gpu_show(on, &canvas, sample, &error));
    assert_done(saga_gpu_show(on, &canvas, sample, &error));
    assert_done(saga_gpu_ways_get(on, &way, 1, "a picture", &error));
    assert_done(saga_novel_show(&canvas, &w->pictures, sample, &error));
    assert_true(largest(canvas.truth, n) > 0.1);
    assert_true(is_near("teachers", "truth", truth, canvas.truth, n, 1e-5));
    assert_done(saga_gpu_get(on, &back, &error));
    for (int a = 0; a < SAGA_N_ATTRS; a++)
        assert_memory_equal(other.of[a], f->p.of[a],
                            f->n * (size_t)saga_attributes[a].width *
                                sizeof(real));
    w->pictures.novel = NULL;
    saga_gpu_canvas_free(on);
    free(seen);
    novel.view = NULL;
    novel.nearest = NULL;
    saga_novel_free(&novel);
    free(truth);
    free_fixture(f);
    free_fixture(g);
}

/* --- Steps --------------------------------------------------------------- */

enum { STEPPED = 700 };

/* A set of the warm-up. */
typedef struct {
    saga_splat_params value, m, v;
    real sums[3 * STEPPED];
    uint32_t seen[STEPPED];
} flat_set;

static flat_set *new_set(void)
{
    flat_set *const s = zeroed(1, sizeof *s);

    s->value = scene_alloc(STEPPED);
    s->m = scene_alloc(STEPPED);
    s->v = scene_alloc(STEPPED);
    return s;
}

static void free_set(flat_set *s)
{
    saga_params_free(&s->value);
    saga_params_free(&s->m);
    saga_params_free(&s->v);
    free(s);
}

/* Returns a set after a step of the fixture's primitives, of which `lacks` is
 * an attribute that they do not have or -1. The device has room for so many
 * pairs at first; 0: for enough. */
static flat_set *stepped(const world *w, fixture *f, const saga_gpu_rules *r,
                         int lacks, uint32_t room)
{
    const saga_sample sample = { .view = w->pictures.train[0], .frame = 1 };
    const saga_splat_camera camera = f->c.camera;
    flat_set *const s = new_set();
    saga_gpu_set set = { .n = STEPPED,
                         .value = f->p,
                         .m = s->m,
                         .v = s->v,
                         .stats = { s->sums, s->sums + STEPPED, s->seen },
                         .worth = s->sums + 2 * STEPPED };
    saga_gpu_canvas *g;
    double mse;

    if (lacks >= 0)
        set.value.of[lacks] = set.m.of[lacks] = set.v.of[lacks] = NULL;
    assert_done(g = saga_gpu_canvas_new(w->gpu, &w->pictures, &error));
    assert_done(saga_gpu_show(g, &f->c, sample, &error));
    f->c.camera = camera;
    g->most_pairs = room;
    assert_done(saga_gpu_put(g, &set, &error));
    assert_done(saga_gpu_step(g, &mse, &f->c, r, &error));
    set.value = s->value;
    if (lacks >= 0)
        set.value.of[lacks] = NULL;
    assert_done(saga_gpu_get(g, &set, &error));
    saga_gpu_canvas_free(g);
    return s;
}

static saga_gpu_rules new_rules(const saga_adam *adam)
{
    saga_gpu_rules r = { .adam = adam, .step = 1 };

    for (int a = 0; a < SAGA_N_ATTRS; a++) {
        r.lo[a] = -1000;
        r.hi[a] = 1000;
    }
    return r;
}

/* Primitives that do not rotate have no slopes, whose place in the block is
 * that of others. If centres in time alone learn, what does not move on a path
 * must stay, bit by bit. */
TEST(a_step_should_not_turn_what_has_no_slope)
{
    const saga_adam adam = saga_adam_default();
    saga_gpu_rules rules = new_rules(&adam);
    fixture *const f = new_fixture(STEPPED, W, H, 3, 3);
    flat_set *s;

    rules.rate[SAGA_ATTR_T_CENTRE] = R(0.01);
    s = stepped(world_of(state), f, &rules, SAGA_ATTR_SLOPE, 0);
    assert_memory_not_equal(s->value.t_centre, f->p.t_centre,
                            STEPPED * sizeof(real));
    assert_memory_equal(s->value.quat, f->p.quat, 4 * STEPPED * sizeof(real));
    assert_memory_equal(s->value.log2_width, f->p.log2_width,
                        STEPPED * sizeof(real));
    free_set(s);
    free_fixture(f);
}

/* With too little room for pairs the list of commands runs again. */
TEST(a_step_that_runs_again_should_be_done_once)
{
    const world *const w = world_of(state);
    const saga_adam adam = saga_adam_default();
    saga_gpu_rules rules = new_rules(&adam);
    fixture *const f = new_fixture(STEPPED, W, H, 3, 3);
    const uint64_t before = saga_gpu_n_lists(w->gpu);
    uint64_t once;
    flat_set *a, *b;

    for (int i = 0; i < SAGA_N_ATTRS; i++)
        rules.rate[i] = R(0.01);
    a = stepped(w, f, &rules, -1, 0);
    once = saga_gpu_n_lists(w->gpu) - before;
    b = stepped(w, f, &rules, -1, 64);
    assert_int_equal(saga_gpu_n_lists(w->gpu) - before, 2 * once + 1);
    for (int i = 0; i < SAGA_N_ATTRS; i++) {
        const size_t n = STEPPED * (size_t)saga_attributes[i].width;

        assert_memory_equal(a->value.of[i], b->value.of[i], n * sizeof(real));
        assert_memory_equal(a->m.of[i], b->m.of[i], n * sizeof(real));
        assert_memory_equal(a->v.of[i], b->v.of[i], n * sizeof(real));
    }
    assert_memory_equal(a->sums, b->sums, sizeof a->sums);
    assert_memory_equal(a->seen, b->seen, sizeof a->seen);
    free_set(a);
    free_set(b);
    free_fixture(f);
}

/* --- Trainings ----------------------------------------------------------- */

static double train(saga_flat **f, const world *w, saga_gpu *gpu,
                    int iterations)
{
    saga_flat_options o = saga_flat_defaults();
    double mse, sum = 0;

    o.n_primitives = 400;
    o.n_iterations = iterations;
    o.gpu = gpu;
    assert_done(*f = saga_flat_new(&w->pictures, &o, &error));
    for (int i = 0; i < iterations; i++) {
        assert_done(saga_flat_iterate(*f, &mse, &error));
        sum += i >= iterations - 20 ? mse / 20 : 0;
    }
    return sum;
}

/* Two trainings on the device must give the same bits, and fit as one on the
 * host does. Values drift apart from the host's, since Adam's first steps have
 * the gradient's sign, also where it is nearly 0; the errors of the pictures
 * must not. */
TEST(trainings_should_be_the_same_bits_and_fit_as_on_the_host)
{
    const world *const w = world_of(state);
    const int n = testing_long() ? 200 : 60;
    saga_flat *a, *b, *host;
    const double on_gpu = train(&a, w, w->gpu, n);
    const double on_host = train(&host, w, NULL, n);

    print_message("mean squared errors: %g on the device, %g on the host\n",
                  on_gpu, on_host);
    assert_int_equal(a->n, host->n);
    /* 0.4 dB */
    assert_true(fabs(log(on_gpu / on_host)) < 0.1);
    saga_flat_free(host);
    train(&b, w, w->gpu, n);
    assert_int_equal(a->n, b->n);
    for (int k = 0; k < SAGA_N_ATTRS; k++)
        if (a->value.of[k])
            assert_memory_equal(a->value.of[k], b->value.of[k],
                                (size_t)saga_attributes[k].width * a->n *
                                    sizeof(real));
    saga_flat_free(a);
    saga_flat_free(b);
}
