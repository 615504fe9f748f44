/* SPDX-License-Identifier: MIT
 *
 * A whole training on a capture of a few thousand pixels: its file is compared
 * with its float twins; its tools, layers and refusals are tested.
 */
#include "context.h"
#include "fit_state.h"
#include "model.h"
#include "ref_recorder.h"
#include "rng.h"
#include "saga.h"
#include "start.h"
#include "testing.h"
#include "tiny_training.h"
#include "train_state.h"
#include "view.h"

/* --- Fixture ------------------------------------------------------------- */

TRAINED_GROUP(room, unstopped);

/* Trains until the stage begins; returns the training from its checkpoint. */
static saga_train *train_until(saga_train_options *o, saga_train_stage stage)
{
    static tiny_stop place;

    place = (tiny_stop){ stage, -1, 0, 0 };
    o->checkpoint = room.checkpoint;
    return tiny_train_until(&room.capture, o, &place);
}

/* --- What comes out ------------------------------------------------------ */

TEST(train_should_make_a_file_that_decodes)
{
    const trained *const r = &unstopped;
    FREED_BY(saga_pictures_free) saga_pictures pictures;
    saga_splat_camera drawn;
    FREED_BY(saga_film_close) saga_film film;
    uint8_t rgb[3 * 64 * 36];

    assert_done(saga_pictures_init(&pictures, &room.capture, &error));
    assert_done(saga_film_open(&film, "x", r->bytes, r->n, 1, &error));
    assert_int_equal(film.info.n_frames, 5);
    assert_int_equal(film.info.n_cameras, 4);
    assert_int_equal(film.info.max_primitives, 150);
    assert_int_equal(film.info.fps_num, 24 * film.info.fps_den);
    for (uint32_t v = 0; v < 4; v++) {
        saga_camera camera;
        uint32_t number;

        assert_done(saga_film_rig(&film, v, &camera, &number, &error));
        assert_int_equal(number, v);
        assert_int_equal(camera.width, 64);
        /* Both trainings drew what the file's rig lets decoders draw. */
        saga_pictures_camera(&drawn, &pictures,
                             (saga_sample){ .view = (int)v });
        assert_true(fabs((double)drawn.near_plane * pictures.cube.unit -
                         camera.near_plane * film.metric.unit) <=
                    film.metric.unit);
        for (uint32_t k = 0; k < 5; k++)
            assert_done(saga_film_draw(&film, &camera, k, 1, rgb, &error));
    }
    assert_true(r->report.model.training > 10);
    assert_int_equal(r->report.model.n_training, 3 * 5);
    assert_int_equal(r->report.model.n_held_out, 5);
    assert_int_equal(r->report.sizes.total, r->n);
}

/* Checks that bits agree within 0.5 % or 16 bytes, whichever is larger. */
static bool agrees(const char *what, double bits, double wanted)
{
    if (fabs(bits - wanted) <= fmax(128, 0.005 * wanted))
        return true;
    print_error("%s: %.1f bits, not %.1f\n", what, bits, wanted);
    return false;
}

static void chunks_should_be_what_was_spent(const saga_encode_sizes *z)
{
    double sum[SAGA_N_COMPONENTS];

    saga_cost_components(sum, z->spent);
    assert_true(agrees("networks", sum[SAGA_COMPONENT_NETWORKS],
                       8 * (double)z->networks));
    assert_true(agrees("coarse",
                       sum[SAGA_COMPONENT_TREE] + sum[SAGA_COMPONENT_CENTRE] +
                           sum[SAGA_COMPONENT_FEATURE],
                       8 * (double)z->coarse));
    assert_true(agrees("fine",
                       sum[SAGA_COMPONENT_FINE_SUFFIX] +
                           sum[SAGA_COMPONENT_FINE_OFFSET] +
                           sum[SAGA_COMPONENT_N_PRIM],
                       8 * (double)z->fine));
    assert_true(agrees("primitives",
                       sum[SAGA_COMPONENT_PRIM_SUFFIX] +
                           sum[SAGA_COMPONENT_PRIM_OFFSET],
                       8 * (double)z->prim));
}

/* Sets features to multiples of a step. Most are 0 and one in 50 is large, as
 * after many iterations with a high lambda. */
static void make_rare(saga_train *t, double step)
{
    const size_t n = (size_t)t->render.scene.n.coarse *
                     t->render.scene.model.features;
    const saga_rng r = saga_rng_stream(3, 3);

    for (size_t i = 0; i < n; i++) {
        const double x = saga_rng_double(r, 2 * i);
        const double far = 30 + 30 * saga_rng_double(r, 2 * i + 1);
        const double q = x < 0.01 ? far : x < 0.02 ? -far : x < 0.2;

        t->render.scene.coarse_feature[i] = (real)(q * step);
    }
}

/* Keeps the networks of every kind, whatever they are worth. */
static void keep_all(saga_train *t)
{
    memset(t->render.fit->rate.context.keep, 0xff,
           sizeof t->render.fit->rate.context.keep);
}

/* The estimated bits of the rounded residuals must agree with the bits that the
 * encoder spends, and the bits of a chunk with its bytes. This is tested with
 * the result of a training, with features that have long tails, for which a
 * Gaussian estimate would be 3 % too high, and with all entropy networks kept.
 */
TEST(train_should_estimate_what_is_written)
{
    static const uint32_t coded[] = { SAGA_SYM_CENTRE, SAGA_SYM_FEATURE,
                                      SAGA_SYM_FINE_OFFSET,
                                      SAGA_SYM_PRIM_OFFSET };
    saga_train_options o = tiny_defaults();

    o.n_primitives = 1000;
    o.n_coarse = 250;
    for (int variant = 0; variant < 3; variant++) {
        saga_train *const t = variant == 0 ? train_until(&o, SAGA_TRAIN_PACK)
                                           : tiny_resume(&room.capture, &o);
        trained r;

        if (variant == 2)
            keep_all(t);
        if (variant == 1)
            make_rare(
                t, ldexp(t->render.scene.model.step_q16[SAGA_STEP_FEATURE],
                         -16 - t->render.scene.model.out_q[SAGA_OUT_COARSE]));
        r = tiny_finish(t);
        for (size_t i = 0; i < sizeof coded / sizeof coded[0]; i++)
            assert_true(agrees(saga_component_name(saga_component_of(coded[i])),
                               r.report.entropy.estimate[coded[i]],
                               r.report.sizes.bits[coded[i]]));
        /* Packing may leave weights out that the fit counts: 1.4 % here. */
        if (variant < 2)
            assert_true(fabs(r.report.weight_bits /
                                 (r.report.sizes.bits[SAGA_SYM_NET_WEIGHT] +
                                  r.report.sizes.bits[SAGA_SYM_NET_DROP]) -
                             1) < 0.02);
        chunks_should_be_what_was_spent(&r.report.sizes);
        free(r.bytes);
    }
}

/* --- The entropy model's twin -------------------------------------------- */

/* The decoded scene, the rate of its float twin, and the largest differences
 * between this twin and the decoder's integers. */
typedef struct {
    const saga_scene *s;
    saga_rate rate;
    double mu, sigma; /* differences of mu in steps, of sigma in
                       * log2 */
    double read;      /* differences of the vectors read from the
                       * memory bank, whose length is at most 1 */
    size_t n;
} near_integers;

/* Computes again what a block reads from the memory bank, in a run of this
 * block alone on a scaffold that ends with it. */
static void read_alone(const saga_scaffold *sc, int kind, uint32_t rank)
{
    const uint32_t group = kind == SAGA_KIND_COARSE ? sc->coarse[rank].group
                           : kind == SAGA_KIND_FINE ? sc->fine[rank].group
                                                    : 0;
    saga_scaffold alone = *sc;
    saga_run run;

    if (kind == SAGA_KIND_COARSE)
        alone.n.coarse = rank + 1;
    else
        alone.n.fine = rank + 1;
    saga_context_run(&run, &alone, kind, rank, group);
    assert_int_equal(run.n, 1);
    assert_int_equal(run.rank[0], rank);
}

static void compare_read(near_integers *t, const saga_scaffold *sc, int kind,
                         size_t block)
{
    const size_t d = sc->bank.width;
    const real *const read = t->rate.context.bank.kind[kind].read +
                             t->rate.context.kind[kind].runs.index[block] * d;

    read_alone(sc, kind, (uint32_t)block);
    for (size_t i = 0; i < d; i++)
        t->read = fmax(
            t->read, fabs((double)read[i] - sc->bank.round->read[i] / 4096.0));
}

static void compare(void *user, const saga_scaffold *sc, saga_at at,
                    const int16_t *mu, const uint8_t *scale, uint32_t n)
{
    near_integers *const t = user;
    const int is_feature = at.sym == SAGA_SYM_FEATURE;
    const int kind = at.sym == SAGA_SYM_FINE_OFFSET   ? SAGA_KIND_FINE
                     : at.sym == SAGA_SYM_PRIM_OFFSET ? SAGA_KIND_PRIM
                                                      : SAGA_KIND_COARSE;
    const saga_model *const m = &t->s->model;
    const size_t block = kind == SAGA_KIND_PRIM ? t->s->prim_fine[at.index]
                                                : at.index;
    const size_t first = block * saga_n_channels(m, kind) +
                         (is_feature ? 4 : 0);

    for (uint32_t i = 0; i < n; i++) {
        const size_t c = i + (is_feature ? 4 : 0);
        const double lsb = m->step_q16[saga_rate_step_of(kind, c)] / 65536.0;
        const double have = ldexp(
            (double)t->rate.context.kind[kind].mu[first + i],
            saga_rate_value_q(m, kind, c));
        /* The index is log2 sigma rounded to a seventh. */
        const double sigma =
            (double)t->rate.context.kind[kind].log2_sigma[first + i] -
            (scale[i] - SAGA_SCALE_UNIT) / (double)SAGA_SCALE_PER_OCTAVE;

        t->mu = fmax(t->mu, fabs(have - mu[i]) / lsb);
        t->sigma = fmax(t->sigma, fabs(sigma) - 0.5 / SAGA_SCALE_PER_OCTAVE);
        t->n++;
    }
    compare_read(t, sc, kind, block);
}

static void predict_decoded(near_integers *t, saga_twin *w)
{
    const saga_rate_input x = { t->s, w, t->s->coarse_feature };
    double bits[SAGA_N_STEPS] = { 0 };

    assert_done(saga_rate_init(&t->rate, t->s, &error));
    assert_done(saga_rate_refresh(&t->rate, t->s, &error));
    saga_rate_context_begin(&t->rate.context, t->s);
    for (int kind = 0; kind < SAGA_N_KINDS; kind++) {
        assert_true(t->s->model.sources[kind] != 0);
        /* The offsets that groups read. */
        if (kind == SAGA_KIND_FINE)
            saga_rate_code(bits, &t->rate, &x, kind);
        saga_rate_all(&t->rate, &x, kind);
    }
}

/* Uses the plain update of the bank from here on. */
static void write_plainly(saga_train *t)
{
    t->render.scene.model.tools |= SAGA_TOOL_PLAIN_WRITE;
    t->render.fit->used.model.tools |= SAGA_TOOL_PLAIN_WRITE;
}

static void should_be_near(saga_train *t, bool plain)
{
    near_integers near = { 0 };
    const uint8_t *bytes;
    size_t n;

    keep_all(t);
    if (plain)
        write_plainly(t);
    for (int net = 0; net < SAGA_N_NETS; net++)
        t->render.fit->rate.decision.step[net] = ldexp(1, -13);
    assert_done(saga_train_run(t, &error) == SAGA_DONE);
    bytes = saga_train_bytes(t, &n);
    near.s = &t->packed.scene;
    assert_int_equal(!(near.s->model.tools & SAGA_TOOL_PLAIN_WRITE), !plain);
    predict_decoded(&near, &t->packed.twin);
    assert_int_equal(recorder_compare(compare, &near, bytes, n), 1);
    print_message("%zu values: mu within %.4f steps, log2 sigma %.4f, reads "
                  "%.5f\n",
                  near.n, near.mu, near.sigma, near.read);
    assert_true(near.n > 5000);
    assert_true(near.mu < 0.05);
    assert_true(near.sigma < 0.005);
    assert_true(near.read < 0.002);
    saga_rate_free(&near.rate);
    saga_train_free(t);
}

/* The float entropy model must agree with the decoder's integers on a trained
 * scene with all networks, finely quantised. Rounded inputs (2^-10 and finer),
 * hidden units and positions allow a difference of a twentieth of a step in mu
 * and of 0.005 in log2 sigma, beyond the rounding of the index (measured: 0.005
 * and 0.0004). What each block reads from the memory bank, after all its
 * updates, must agree within 8 LSB of Q12 (measured: 1.0). */
TEST(rate_should_be_near_the_integer_path)
{
    saga_train_options o = tiny_defaults();

    o.n_primitives = 600;
    o.n_render = 300;
    should_be_near(train_until(&o, SAGA_TRAIN_PACK), false);
    should_be_near(tiny_resume(&room.capture, &o), true);
}

/* --- The scene's twin ---------------------------------------------------- */

/* Starts the fit again with networks that fuse features: structure and places
 * are the same, parameters differ. */
static void add_fuse(saga_train *t)
{
    saga_scene old = t->render.scene;
    saga_scene *const s = &t->render.scene;
    const saga_fit_options o = { .n_render = t->o.n_render,
                                 .seed = 1,
                                 .price = t->policy.price };
    saga_error error = { "" };
    saga_model m = old.model;

    saga_fit_free(t->render.fit);
    m.width[SAGA_NET_FUSE_C] = m.width[SAGA_NET_FUSE_F] = 32;
    assert_true(saga_scene_init(s, &m, old.n, old.n_nodes, 7, &error));
    memcpy(s->split, old.split, old.n_nodes);
    memcpy(s->occupancy, old.occupancy, old.n_nodes * sizeof *old.occupancy);
    memcpy(s->coarse, old.coarse, old.n.coarse * sizeof *old.coarse);
    memcpy(s->fine, old.fine, old.n.fine * sizeof *old.fine);
    memcpy(s->prim_fine, old.prim_fine, old.n.prim * sizeof *old.prim_fine);
    memcpy(s->reals, old.reals,
           (size_t)(old.params - old.reals) * sizeof *old.reals);
    saga_scene_free(&old);
    t->render.fit = saga_fit_new(s, &t->pictures, &o, &error);
    assert_non_null(t->render.fit);
    assert_true(saga_fit_start(t->render.fit, &t->render.target, &error));
}

/* If bits cost nearly nothing, 16 features for each of 150 primitives must
 * reproduce the warm-up's pictures nearly exactly at the start of the fit. At a
 * higher price of bits the start keeps less, and its PSNR must be lower. */
TEST(fit_should_begin_where_the_warm_up_ends)
{
    static const double lambda[] = { 0.01, 22, 2200 };
    double psnr[3];

    for (int i = 0; i < 3; i++) {
        saga_train_options o = tiny_defaults();
        saga_train *t;

        o.lambda = lambda[i];
        t = train_until(&o, SAGA_TRAIN_RENDER);
        tiny_begin_fit(t);
        psnr[i] = tiny_start_psnr(t);
        saga_train_free(t);
    }
    print_message("start: %.1f, %.1f, %.1f dB beside the warm-up's pictures\n",
                  psnr[0], psnr[1], psnr[2]);
    assert_true(psnr[0] > 40 && psnr[0] > psnr[1] && psnr[1] > psnr[2]);
}

/* Returns the largest difference of log2 scales between twin and decoder. They
 * are outputs of F_geo, so that errors of both tiers' features and networks add
 * up in them. The unit of scales is the box unit, 2^-23 half-cubes. */
static double worst_scale(const saga_train *t)
{
    uint8_t rgb[3 * 64 * 36];
    saga_camera camera;
    double worst = 0;
    FREED_BY(saga_film_close) saga_film film;
    uint32_t number;

    assert_done(saga_film_open(&film, "x", t->packed.bytes, t->packed.nbytes, 1,
                               &error));
    assert_done(saga_film_rig(&film, 0, &camera, &number, &error));
    assert_done(saga_film_draw(&film, &camera, 0, 1, rgb, &error));
    for (uint32_t i = 0; i < t->packed.scene.n.prim; i++) {
        saga_animated a;

        assert_ok(saga_primitive_at(&a, film.dec, i, 0));
        for (uint32_t k = 0; k < 3; k++)
            worst = fmax(
                worst, fabs((double)t->packed.twin.attr.log2_scale[3 * i + k] +
                            23 - a.log2_scale_q10[k] / 1024.0));
    }
    return worst;
}

/* Returns the PSNR between the file's first picture and the same picture drawn
 * by its float twin. Rounding the picture to 8 bits alone gives 58.9 dB. */
static double picture_near(saga_train *t)
{
    const saga_sample first = { 0 };
    uint8_t rgb[TINY_PICTURE];
    FREED_BY(saga_canvas_free) saga_canvas c;
    double sum = 0;

    tiny_draw(rgb, t->packed.bytes, t->packed.nbytes, 0);
    assert_done(saga_pictures_canvas(&c, &t->pictures, &error));
    saga_pictures_aim(&c, &t->pictures, first);
    saga_twin_colour(&t->packed.twin, &t->packed.scene, c.camera.centre);
    assert_done(saga_splat_forward(&c, &t->packed.twin.attr,
                                   t->packed.scene.n.prim, &error));
    for (int i = 0; i < 64 * 36; i++)
        for (int k = 0; k < 3; k++) {
            const double x = (double)c.image[64 * 36 * k + i];

            sum += pow(rgb[3 * i + k] / 255.0 - fmin(fmax(x, 0), 1), 2);
        }
    return -10 * log10(sum / (3 * 64 * 36));
}

/* Runs to the end, and checks that twin and decoder agree. Half an LSB of the
 * outputs is at most 0.0005; inputs and hidden units add to it (measured:
 * 0.0014 and 0.0015). */
static void end_near_the_decoder(saga_train *t, const char *what)
{
    double worst, db;

    assert_done(saga_train_run(t, &error) == SAGA_DONE);
    worst = worst_scale(t);
    db = picture_near(t);
    print_message("%s: log2 scales within %.5f, a picture %.2f dB\n", what,
                  worst, db);
    assert_true(worst < 0.01);
    assert_true(db > 57);
}

TEST(scene_should_be_near_the_integer_path)
{
    for (int fuse = 0; fuse < 2; fuse++) {
        saga_train_options o = tiny_defaults();
        saga_train *t;

        o.lambda = 22;
        t = train_until(&o, SAGA_TRAIN_RENDER);
        if (fuse)
            add_fuse(t);
        end_near_the_decoder(t, fuse ? "with Fuse" : "without Fuse");
        assert_int_equal(t->packed.scene.net[SAGA_NET_FUSE_C].n_layers,
                         2 * fuse);
        assert_int_equal(t->packed.scene.net[SAGA_NET_FUSE_F].n_layers,
                         2 * fuse);
        assert_true(t->packed.scene.model.tools & SAGA_TOOL_VIEW);
        saga_train_free(t);
    }
}

/* All parts of the paper's model must be in the file, but for those that are
 * ablated, and twin and decoder must agree on it. Two primitives share a fine
 * anchor. */
TEST(paper_model_should_be_whole_or_lose_what_is_ablated)
{
    for (int without = 0; without < 2; without++) {
        saga_train_options o = tiny_defaults();
        const saga_model *m;
        saga_train *t;

        o.paper = true;
        o.lambda = 22;
        if (without)
            o.ablate = "no-bank,no-hash,no-fuse,nearest";
        t = train_until(&o, SAGA_TRAIN_RENDER);
        end_near_the_decoder(t, without ? "paper, ablated" : "paper");
        m = &t->packed.scene.model;
        assert_int_equal(!(m->tools & SAGA_TOOL_HASH), without);
        assert_int_equal(!(m->tools & SAGA_TOOL_BANK), without);
        assert_true(without || !(m->tools & SAGA_TOOL_PLAIN_WRITE));
        for (int i = 0; i < SAGA_N_TIERS; i++) {
            assert_int_equal(!m->width[saga_fuse_net(i)], without);
            assert_int_equal(m->tier[i].neighbours == 1, without);
        }
        assert_int_equal(t->packed.scene.n.prim, 150);
        assert_true(t->packed.scene.n.fine <= 75 &&
                    t->packed.scene.n.coarse <= 38);
        saga_train_free(t);
    }
}

/* A motion of 500 supports exceeds the format of 16 bits with 8 fractional
 * bits. It must be cut to 32767 / 256 supports, in the file and in its twin. */
TEST(motion_should_be_cut_where_training_cut_it)
{
    saga_train_options o = tiny_defaults();
    saga_rows rows[SAGA_N_OUTS];
    saga_train *t;
    saga_net *geo;

    o.lambda = 22;
    t = train_until(&o, SAGA_TRAIN_RENDER);
    saga_model_rows(rows, &t->render.scene.model);
    assert_true(rows[SAGA_OUT_MOTION1].n);
    geo = &t->render.scene.net[SAGA_NET_GEO];
    geo->b[geo->n_layers - 1][rows[SAGA_OUT_MOTION1].first] = 500;
    assert_done(saga_train_run(t, &error) == SAGA_DONE);
    assert_int_equal(t->packed.scene.model.out_q[SAGA_OUT_MOTION1], 8);
    for (uint32_t i = 0; i < t->packed.scene.n.prim; i++)
        assert_true(t->packed.twin.attr.motion[9 * i] == R(32767) / 256);
    saga_train_free(t);
}

/* --- Layers -------------------------------------------------------------- */

/* Three layers must have 1, 2 and 4 sevenths of the 150 primitives. */
TEST(layers_should_have_twice_as_many_each)
{
    static const uint32_t n_prim[] = { 21, 43, 86 };
    const saga_train_options o = tiny_layered();
    const trained r = tiny_train(&room.capture, &o);
    saga_segment_header seg;
    saga_segment where;
    saga_io io;

    assert_int_equal(r.report.info.n_layers, 3);
    assert_ok(saga_find(&where, r.bytes, r.n, 0, 1));
    io = (saga_io){ r.bytes + where.offset, NULL, SAGA_CHUNK_NBYTES };
    saga_segment_io(&io, &seg, 3);
    for (int k = 0; k < 3; k++)
        assert_int_equal(seg.layer[k].n.prim, n_prim[k]);
    free(r.bytes);
}

/* A context must not depend on another layer, because the file could not have
 * it. With shared anchors, the estimates must equal what was written. */
TEST(layers_should_be_coded_as_estimated)
{
    static const uint32_t coded[] = { SAGA_SYM_FEATURE, SAGA_SYM_FINE_OFFSET,
                                      SAGA_SYM_PRIM_OFFSET };
    saga_train_options o = tiny_layered();
    saga_train *t;
    trained r;

    o.n_primitives = 1000;
    o.n_coarse = 250;
    o.n_fine = 500;
    t = train_until(&o, SAGA_TRAIN_PACK);
    keep_all(t);
    r = tiny_finish(t);
    for (size_t i = 0; i < sizeof coded / sizeof coded[0]; i++)
        assert_true(agrees(saga_component_name(saga_component_of(coded[i])),
                           r.report.entropy.estimate[coded[i]],
                           r.report.sizes.bits[coded[i]]));
    /* Primitives would be displaced, too, if a layer depended on another. */
    assert_true(fabs(r.report.model.training - r.report.coded.training) < 0.3);
    free(r.bytes);
}

static void links_should_stay_in_a_layer(const saga_links *l,
                                         const saga_scene *s, uint32_t n,
                                         bool prims)
{
    for (uint32_t i = 0; i < n; i++)
        for (uint32_t k = l->begin[i]; k < l->begin[i + 1]; k++) {
            uint32_t of = 0, to = 0;

            for (uint32_t m = 1; m < s->n_layers; m++) {
                const saga_counts *const first = &s->layer[m].first;

                of += i >= (prims ? first->prim : first->fine);
                to += l->rank[k] >= (prims ? first->fine : first->coarse);
            }
            assert_int_equal(of, to);
        }
}

/* Even if all anchors are at the same place, so that all are neighbours of each
 * other, no anchor may be linked to one of another layer. */
TEST(layers_should_not_know_of_each_other)
{
    saga_train_options o = tiny_layered();
    saga_train *t;
    saga_scene *s;

    o.n_primitives = 600;
    o.n_coarse = 150;
    o.n_fine = 300;
    t = train_until(&o, SAGA_TRAIN_PACK);
    s = &t->render.scene;
    for (size_t i = 0; i < 4 * (size_t)s->n.coarse; i++)
        s->coarse_x[i] = 0;
    for (size_t i = 0; i < 4 * (size_t)s->n.fine; i++)
        s->fine_x[i] = 0;
    for (size_t i = 0; i < 4 * (size_t)s->n.prim; i++)
        s->prim_x[i] = 0;
    assert_done(
        saga_twin_refresh(&t->render.fit->twin, s, s->coarse_feature, &error));
    links_should_stay_in_a_layer(&t->render.fit->twin.to_fine, s, s->n.fine,
                                 false);
    links_should_stay_in_a_layer(&t->render.fit->twin.to_prim, s, s->n.prim,
                                 true);
    saga_train_free(t);
}

/* --- Rounding ------------------------------------------------------------ */

/* Decoded primitives must be where training drew them last, because both round
 * against the same means. At most 5 % of the coordinates may differ by a
 * quarter of a step: those that the last iteration moved into another interval,
 * or whose support or mean differs in integers. Without rounding in training,
 * every second coordinate would differ by that much. */
TEST(train_should_draw_positions_as_decoded)
{
    saga_train_options o = tiny_defaults();
    size_t i, far = 0;
    FREED real *drawn;
    double step;
    saga_train *t = train_until(&o, SAGA_TRAIN_PACK);

    assert_int_equal(t->render.scene.n.prim, t->render.scene.n.fine);
    drawn = copy_of(t->render.fit->position,
                    4 * (size_t)t->render.scene.n.prim * sizeof *drawn);
    assert_done(saga_train_run(t, &error) == SAGA_DONE);
    step = saga_rate_prim_step(&t->render.scene);
    for (i = 0; i < 4 * (size_t)t->render.scene.n.prim; i++) {
        const double support = (double)t->packed.twin.support[i];

        far += fabs((double)(drawn[i] - t->packed.scene.prim_x[i])) >
               0.25 * step * support;
    }
    print_message("%zu of %zu coordinates are elsewhere\n", far, i);
    assert_true(far < i / 20);
    saga_train_free(t);
}

/* After features are first rounded, their predicted means must not move any
 * more. */
TEST(entropy_networks_should_stand_still_at_last)
{
    saga_train_options o = tiny_defaults();
    size_t n;
    FREED real *then;
    tiny_stop s = { SAGA_TRAIN_RENDER, (2 * TINY_RENDER + 2) / 3 + 1, 0, 0 };
    saga_train *t = tiny_train_until(&room.capture, &o, &s);

    assert_int_equal(t->render.fit->rate.decision.decided, 1);
    n = saga_rate_n_params(&t->render.scene);
    then = copy_of(t->render.scene.params, n * sizeof *then);
    assert_done(saga_train_run(t, &error) == SAGA_DONE);
    assert_memory_equal(then, t->render.scene.params, n * sizeof *then);
    saga_train_free(t);
}

/* --- What a scene needs -------------------------------------------------- */

static saga_capture one_frame(void)
{
    const saga_synth_options o = synth_options(64, 36, 4, 1, 300);

    return tiny_capture(&o);
}

TEST(train_should_drop_temporal_tools_of_one_frame)
{
    saga_train_options o = tiny_defaults();
    FREED_BY(saga_capture_free) saga_capture c = one_frame();
    trained r;

    o.motion = SAGA_TRAIN_MEASURE;
    r = tiny_train(&c, &o);
    assert_int_equal(
        r.report.info.tools & ~(uint32_t)(SAGA_TOOL_VIEW | SAGA_TOOL_STEEP), 0);
    assert_false(r.report.dynamic);
    free(r.bytes);
}

/* Makes every view show the same picture n times, with the noise of a camera.
 */
static void hold_still(saga_capture *c, int n)
{
    const saga_rng rng = saga_rng_stream(5, 0);

    for (int v = 0; v < c->n_views; v++) {
        saga_source_view *const view = &c->views[v];
        const size_t size = saga_view_frame_nbytes(view);
        uint8_t *const rgb = must(malloc(size * (size_t)n));
        for (size_t i = 0; i < size * (size_t)n; i++) {
            const double x = view->rgb[i % size] +
                             4 * saga_rng_normal(rng, i + ((uint64_t)v << 32));

            rgb[i] = (uint8_t)(x < 0 ? 0 : x > 255 ? 255 : x);
        }
        free(view->rgb);
        view->rgb = rgb;
    }
    c->n_frames = n;
}

TEST(train_should_drop_temporal_tools_when_nothing_moves)
{
    saga_train_options o = tiny_defaults();
    FREED_BY(saga_capture_free) saga_capture c = one_frame();
    trained r;

    hold_still(&c, 6);
    o.motion = SAGA_TRAIN_MEASURE;
    o.n_warm = 800;
    o.n_primitives = 300;
    r = tiny_train(&c, &o);
    print_message("changing %g explained %g\n", r.report.changing,
                  r.report.explained);
    assert_true(r.report.changing > 0.01);
    assert_int_equal(
        r.report.info.tools & ~(uint32_t)(SAGA_TOOL_VIEW | SAGA_TOOL_STEEP), 0);
    free(r.bytes);
}

TEST(train_should_keep_temporal_tools_when_something_moves)
{
    saga_train_options o = tiny_defaults();
    trained r;

    o.motion = SAGA_TRAIN_MEASURE;
    o.n_warm = 800;
    o.n_primitives = 300;
    r = tiny_train(&room.capture, &o);
    print_message("changing %g explained %g\n", r.report.changing,
                  r.report.explained);
    assert_true(r.report.info.tools & SAGA_TOOL_MOTION_MASK);
    free(r.bytes);
}

/* A warm-up as short as this judges no tool, so that the file has all from
 * which its model may choose. */
TEST(train_should_leave_third_order_and_rotation_to_the_paper)
{
    for (int paper = 0; paper < 2; paper++) {
        saga_train_options o = tiny_defaults();
        trained r;

        o.paper = paper != 0;
        r = tiny_train(&room.capture, &o);
        assert_int_equal(saga_tools_order(r.report.info.tools), 2 + paper);
        assert_int_equal((r.report.info.tools & SAGA_TOOL_SLOPE) != 0, paper);
        free(r.bytes);
    }
}

/* --- Levels and options -------------------------------------------------- */

TEST(train_should_obey_level_0)
{
    saga_train_options o = tiny_defaults();
    trained r;

    o.level = 0;
    r = tiny_train(&room.capture, &o);
    assert_int_equal(r.report.info.level, 0);
    assert_true(r.report.info.work_nbytes <= SAGA_WORK_MAX(0));
    free(r.bytes);
}

TEST(train_should_refuse_wrong_options)
{
    static const char *const says[] = {
        "--level 4",         "1025 is more than the 1024 of level 0",
        "--primitives 0",    "--layers 8 are more than the 7",
        "--lambda -1",       "--time -1",
        "--iterations",      "--ablate does not know 'groups=17'",
        "--ablate slots=48", "256 is more than the 128 of level 2"
    };
    enum { MANY = sizeof says / sizeof says[0] };
    saga_train_options o[MANY];

    for (int i = 0; i < MANY; i++)
        o[i] = tiny_defaults();
    o[0].level = 4;
    o[1].level = 0;
    o[1].n_primitives = 1025;
    o[2].n_primitives = 0;
    o[3].n_primitives = 7;
    o[3].n_layers = 8;
    o[4].lambda = -1;
    o[5].minutes = -1;
    o[6].n_warm = 0;
    o[7].ablate = "no-parent,groups=17";
    o[8].ablate = "slots=48";
    o[9].ablate = "slots=256";
    for (int i = 0; i < MANY; i++) {
        saga_error error = { "" };
        saga_train *const t = saga_train_new(&room.capture, &o[i], &error);

        assert_null(t);
        if (!strstr(error.message, says[i]))
            fail_msg("wanted '%s': '%s'", says[i], error.message);
    }
}

/* --- Networks ------------------------------------------------------------ */

/* Returns the largest sum of magnitudes in a row of layer l with its bias. */
static double largest_row(const saga_net *n, int l)
{
    double most = 0;

    for (int row = 0; row < n->dim[l + 1]; row++) {
        double sum = fabs((double)n->b[l][row]);

        for (int k = 0; k < n->dim[l]; k++)
            sum += fabs((double)n->w[l][row * n->dim[l] + k]);
        most = fmax(most, sum);
    }
    return most;
}

/* With raw-networks, weights are coded with a step of 2^-11 instead of learned
 * steps. A decoded weight may differ from the trained one by half a step plus
 * half an LSB of the integer weights. This LSB is at most a quarter of a step
 * or, if that is more, 2^-15 of the largest sum of the magnitudes of a row with
 * its bias, because all rows of a layer have one scale (quantise_nets.c:
 * try_layer), at which every row must stay below 2^16 LSB. A weight whose input
 * has a finer format by n bits has n fewer bits, at most SAGA_N_FINER - 1. */
TEST(train_should_keep_raw_networks_fine)
{
    saga_train_options o = tiny_defaults();
    saga_train *t;

    o.ablate = "raw-networks";
    t = tiny_begin(&room.capture, &o);
    assert_done(saga_train_run(t, &error) == SAGA_DONE);
    for (int net = SAGA_NET_FUSE_C; net <= SAGA_NET_COLOUR; net++)
        for (int l = 0; l < t->render.scene.net[net].n_layers; l++) {
            const saga_net *const n = &t->render.scene.net[net];

            for (int i = 0; i < n->dim[l] * n->dim[l + 1]; i++)
                assert_true(fabs((double)(n->w[l][i] -
                                          t->packed.scene.net[net].w[l][i])) <=
                            ldexp(0.51, -SAGA_RAW_STEP) +
                                ldexp(fmax(ldexp(0.25, -SAGA_RAW_STEP),
                                           ldexp(largest_row(n, l), -15)),
                                      SAGA_N_FINER - 1));
        }
    saga_train_free(t);
}
