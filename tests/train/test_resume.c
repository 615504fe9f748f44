/* SPDX-License-Identifier: MIT
 *
 * A file must not depend on threads or interruptions. The tests also check what
 * a checkpoint reveals of its training, and which checkpoints are refused.
 */
#include "file.h"
#include "rng.h"
#include "save_header.h"
#include "testing.h"
#include "threads.h"
#include "fx.h"
#include "tiny_training.h"
#include "view.h"

#include <unistd.h>

#ifdef _OPENMP
#include <omp.h>
#endif

TRAINED_GROUP(room, plain);

TEST(train_should_depend_on_the_seed_alone)
{
    saga_train_options o = tiny_defaults();
    const trained again = tiny_train(&room.capture, &o);
    trained other;

    o.seed = 2;
    other = tiny_train(&room.capture, &o);
    assert_true(tiny_same(&plain, &again));
    assert_false(tiny_same(&plain, &other));
    free(again.bytes);
    free(other.bytes);
}

/* --- Threads ------------------------------------------------------------- */

/* Counts how often threads meet in an iteration of the rendering stage: bin n
 * counts the iterations with n regions, the last bin those with more. */
enum { REGIONS = 64 };
typedef struct {
    size_t before;
    int bin[REGIONS + 1], n;
} regions;

static bool count_regions(void *user, const saga_train_progress *p)
{
    regions *const m = user;
    const size_t now = saga_n_regions(), n = now - m->before;

    if (p->stage == SAGA_TRAIN_RENDER && p->iteration > 1) {
        m->bin[n < REGIONS ? n : REGIONS]++;
        m->n++;
    }
    m->before = now;
    return true;
}

/* Returns the median number of regions. Some iterations also refresh, or
 * measure the file. */
static int usual_regions(const regions *m)
{
    int n = 0, sum = m->bin[0];

    while (sum < (m->n + 1) / 2)
        sum += m->bin[++n];
    return n;
}

/* If threads met a hundred times in an iteration, two threads would be slower
 * than one. */
TEST(train_should_not_depend_on_threads_that_seldom_meet)
{
    saga_train_options o = tiny_defaults();
    regions m = { 0 };
    trained other;
#ifdef _OPENMP
    const int before = omp_get_max_threads();

    omp_set_num_threads(before == 1 ? 3 : 1);
#endif
    saga_set_least_work(0);
    o.progress = count_regions;
    o.progress_user = &m;
    other = tiny_train(&room.capture, &o);
    saga_set_least_work(SAGA_LEAST_WORK);
#ifdef _OPENMP
    omp_set_num_threads(before);
#endif
    assert_true(tiny_same(&plain, &other));
    assert_true(m.n > 10);
    assert_true(usual_regions(&m) <= 43);
    free(other.bytes);
}

/* --- Interruptions ------------------------------------------------------- */

/* Trains in pieces: at each stop the training is freed and then resumed from
 * its checkpoint, which before packing must show the final file. The file must
 * equal `whole`. The last entry of stops is never reached. Returns the number
 * of stops. */
static int interrupt(saga_train_options o, const saga_capture *c,
                     const trained *whole, const tiny_stop *stops)
{
    saga_error error = { "" };
    saga_outcome status;
    tiny_stop s = *stops;
    saga_train *t;
    int n = 0;
    trained r;

    o.checkpoint = room.checkpoint;
    tiny_stop_at(&o, &s);
    t = tiny_begin(c, &o);
    while ((status = saga_train_run(t, &error)) == SAGA_STOPPED) {
        assert_null(saga_train_complaint(t));
        saga_train_free(t);
        if (stops[n].stage == SAGA_TRAIN_PACK) {
            assert_true(
                saga_train_peek(&r.bytes, &r.n, room.checkpoint, &error));
            assert_int_equal(r.n, whole->n);
            assert_memory_equal(r.bytes, whole->bytes, r.n);
            free(r.bytes);
        }
        n++;
        if (!s.every)
            s = stops[n];
        t = tiny_resume(c, &o);
    }
    assert_int_equal(status, SAGA_DONE);
    r = tiny_finish(t);
    assert_true(tiny_same(whole, &r));
    free(r.bytes);
    return n;
}

/* Returns three views that are far enough apart for teachers. */
static saga_capture far_apart(void)
{
    saga_synth_options s = synth_options(64, 36, 3, 5, 300);

    s.n_hold_out = 0;
    return tiny_capture(&s);
}

/* Each of the two teachers trains for half the length of the warm-up, which
 * doubles the stage. A checkpoint at half the warm-up's length holds a teacher
 * whose training has ended but whose result is not stored yet. */
static saga_train_options taught(void)
{
    saga_train_options o = tiny_defaults();

    o.n_teachers = 2;
    return o;
}

static saga_train_options of_the_paper(void)
{
    saga_train_options o = tiny_defaults();

    o.paper = true;
    return o;
}

/* The price of bits decides on the number of primitives. Of its stops, the
 * first comes after this was guessed and before it is final. */
static saga_train_options of_a_price(void)
{
    saga_train_options o = tiny_defaults();

    o.free_count = true;
    o.lambda = 4 * plain.report.lambda;
    return o;
}

/* Two classes of anchors. */
static saga_train_options of_classes(void)
{
    saga_train_options o = tiny_defaults();

    o.ablate = "classes";
    return o;
}

/* Tells whether a file has SAGA_TOOL_CLASSES. */
static int has_classes(const trained *file)
{
    /* Byte 72 of the header is the lowest of `tools`. */
    return (int)(fx_load32_le(file->bytes + 72) / SAGA_TOOL_CLASSES & 1u);
}

#define WARM(n)                  \
    {                            \
        SAGA_TRAIN_WARM, n, 0, 0 \
    }
#define RENDER(n)                  \
    {                              \
        SAGA_TRAIN_RENDER, n, 0, 0 \
    }
#define PACK                     \
    {                            \
        SAGA_TRAIN_PACK, 0, 0, 0 \
    }
#define END                          \
    {                                \
        SAGA_TRAIN_N_STAGES, 0, 0, 0 \
    }

TEST(train_should_resume_to_the_same_file)
{
    enum { HALF = TINY_WARM / 2 };
    static const struct {
        const char *name;
        saga_train_options (*options)(void);
        uint32_t least, most; /* primitives */
        tiny_stop at[10];
    } trainings[] = {
        { "plain",
          tiny_defaults,
          150,
          150,
          { WARM(20), WARM(TINY_WARM), RENDER(1), RENDER(44),
            RENDER(TINY_RENDER), PACK, END } },
        { "often",
          tiny_defaults,
          150,
          150,
          { { SAGA_TRAIN_WARM, 0, 11, 0 }, END } },
        { "teachers",
          taught,
          150,
          150,
          { WARM(7), WARM(HALF), WARM(HALF + 1), WARM(TINY_WARM),
            WARM(TINY_WARM + 9), WARM(2 * TINY_WARM), RENDER(11), PACK, END } },
        { "layers",
          tiny_layered,
          150,
          150,
          { WARM(TINY_WARM), RENDER(1), RENDER(44), PACK, END } },
        { "paper",
          of_the_paper,
          150,
          150,
          { RENDER(1), RENDER(44), PACK, END } },
        { "price",
          of_a_price,
          150 / 8,
          149,
          { WARM(TINY_WARM / 4), WARM(TINY_WARM), END } },
        { "classes",
          of_classes,
          150,
          150,
          { WARM(TINY_WARM), RENDER(1), RENDER(44), PACK, END } },
    };

    saga_capture wide = far_apart();

    for (size_t i = 0; i < sizeof trainings / sizeof trainings[0]; i++) {
        const saga_train_options o = trainings[i].options();
        const saga_capture *const c = o.n_teachers ? &wide : &room.capture;
        trained whole;
        int n = 0, stopped;

#ifdef _OPENMP
        omp_set_num_threads(o.n_teachers ? 3 : 1);
#endif
        whole = tiny_train(c, &o);
#ifdef _OPENMP
        omp_set_num_threads(1);
#endif
        print_message("%s\n", trainings[i].name);
        assert_in_range(whole.report.n.prim, trainings[i].least,
                        trainings[i].most);
        assert_int_equal(tiny_same(&whole, &plain), i < 2);
        assert_int_equal(has_classes(&whole),
                         trainings[i].options == of_classes);
        stopped = interrupt(o, c, &whole, trainings[i].at);
        while (trainings[i].at[n].stage != SAGA_TRAIN_N_STAGES)
            n++;
        assert_true(trainings[i].at[0].every ? stopped >= 5 : stopped == n);
        free(whole.bytes);
    }
    saga_capture_free(&wide);
}

TEST(teachers_that_are_switched_off_should_change_nothing)
{
    saga_capture wide = far_apart();
    saga_train_options o = tiny_defaults();
    trained without = tiny_train(&wide, &o), off, with;

    o = taught();
    with = tiny_train(&wide, &o);
    o.ablate = "slots=32,no-teachers";
    off = tiny_train(&wide, &o);
    assert_true(tiny_same(&off, &without));
    assert_false(tiny_same(&with, &without));
    free(without.bytes);
    free(with.bytes);
    free(off.bytes);
    saga_capture_free(&wide);
}

/* Returns options that stop with a checkpoint at a place. */
static saga_train_options stop_at(saga_train_options o, tiny_stop place)
{
    o.checkpoint = room.checkpoint;
    saga_train_free(tiny_train_until(&room.capture, &o, &place));
    o.progress = NULL;
    return o;
}

/* A trial decides on the iterations once; a checkpoint keeps them. */
TEST(train_should_keep_what_its_minutes_gave)
{
    saga_train_options o = tiny_defaults();
    tiny_stop s = { SAGA_TRAIN_WARM, 3, 0, 0 };
    saga_train *t;
    int n;

    o.n_warm = o.n_render = 0;
    o.minutes = 0.5;
    o.checkpoint = room.checkpoint;
    t = tiny_train_until(&room.capture, &o, &s);
    n = saga_train_n_iterations(t);
    assert_true(n >= 100);
    saga_train_free(t);
    o.minutes = 20;
    t = tiny_resume(&room.capture, &o);
    assert_int_equal(saga_train_n_iterations(t), n);
    saga_train_free(t);
    unlink(room.checkpoint);
}

/* --- A look at a checkpoint ---------------------------------------------- */

/* Trains until a stop; returns the file that its checkpoint shows, or NULL if
 * there is none yet. */
static uint8_t *peek_at(saga_train_options o, tiny_stop place, size_t *n,
                        saga_error *error)
{
    uint8_t *bytes = NULL;

    stop_at(o, place);
    *error = (saga_error){ "" };
    if (saga_train_peek(&bytes, n, room.checkpoint, error))
        assert_non_null(bytes);
    else
        assert_null(bytes);
    return bytes;
}

/* Returns the PSNR of the pictures of all training views. */
static double psnr_of(const uint8_t *bytes, size_t n)
{
    uint8_t rgb[3 * 64 * 36];
    double sum = 0, count = 0;
    FREED_BY(saga_film_close) saga_film film;

    assert_done(saga_film_open(&film, "x", bytes, n, 1, &error));
    assert_int_equal(film.info.n_frames, 5);
    assert_int_equal(film.info.n_cameras, 4);
    for (uint32_t v = 0; v < 4; v++)
        for (uint32_t k = 0; k < 5 && !room.capture.views[v].held_out; k++) {
            const uint8_t *const truth = saga_capture_frame(&room.capture,
                                                            (int)v, (int)k);
            saga_camera camera;
            uint32_t number;

            assert_done(saga_film_rig(&film, v, &camera, &number, &error) &&
                        saga_film_draw(&film, &camera, k, 1, rgb, &error));
            for (size_t i = 0; i < sizeof rgb; i++)
                sum += (rgb[i] - truth[i]) * (rgb[i] - truth[i]);
            count += sizeof rgb;
        }
    return 10 * log10(255 * 255 * count / sum);
}

/* A file can be made from any checkpoint: of the warm-up, and of the rendering
 * stage even after its first iteration. At the end of the warm-up it looks like
 * the warm-up, which the rendering stage can hardly surpass in a tiny
 * training. */
TEST(peek_should_show_the_training)
{
    static const tiny_stop at[] = { { SAGA_TRAIN_WARM, 5, 0, 0 },
                                    { SAGA_TRAIN_WARM, 40, 0, 0 },
                                    { SAGA_TRAIN_RENDER, 1, 0, 0 },
                                    { SAGA_TRAIN_RENDER, 44, 0, 0 } };
    enum { N = sizeof at / sizeof at[0] };
    const saga_train_options o = tiny_defaults();
    saga_error error;
    double psnr[N];
    size_t n;

    for (int i = 0; i < N; i++) {
        FREED uint8_t *const bytes = peek_at(o, at[i], &n, &error);

        psnr[i] = psnr_of(bytes, n);
        print_message("%.2f dB, ", psnr[i]);
    }
    print_message("at the end %.2f\n", psnr_of(plain.bytes, plain.n));
    assert_true(psnr[0] > 10 && psnr[1] > psnr[0] + 1);
    assert_true(psnr[2] > 10 && psnr[3] > psnr[2]);
}

/* A training with half the primitives begins with those of another one: at 8 of
 * 40 iterations of the warm-up, with half of a rendering stage that would be
 * 40 (1 / 0.6 - 1) iterations long. */
TEST(train_should_begin_with_a_larger_one)
{
    const tiny_stop end = { SAGA_TRAIN_PACK, 0, 0, 0 };
    saga_train_options o = stop_at(tiny_defaults(), end);
    saga_error error = { "" };
    saga_train *t;
    trained half;

    o.above = o.checkpoint;
    o.checkpoint = NULL;
    o.shorter = 0.5;
    o.n_primitives /= 2;
    t = tiny_begin(&room.capture, &o);
    assert_int_equal(saga_train_iteration(t), TINY_WARM / 5);
    assert_int_equal(saga_train_n_iterations(t), TINY_WARM + 13);
    half = tiny_finish(t);
    assert_int_equal(half.report.n.prim, plain.report.n.prim / 2);
    assert_true(psnr_of(half.bytes, half.n) >
                psnr_of(plain.bytes, plain.n) - 2);
    free(half.bytes);
    o.seed = 7;
    assert_null(saga_train_new(&room.capture, &o, &error));
    assert_non_null(strstr(error.message, "x.saga.ckpt: was begun with --seed "
                                          "1, not 7"));
}

/* --- Refusals ------------------------------------------------------------ */

static bool resume_fails(const saga_train_options *o, const char *says)
{
    saga_error error = { "" };
    saga_train *const t = saga_train_resume(&room.capture, o, &error);
    const bool ok = !t && strstr(error.message, says);

    if (!ok)
        print_error("wanted '%s': '%s'\n", says, error.message);
    saga_train_free(t);
    return ok;
}

static bool resumes_to(const saga_train_options *o, const trained *whole)
{
    trained r = tiny_finish(tiny_resume(&room.capture, o));
    const bool ok = tiny_same(&r, whole);

    free(r.bytes);
    return ok;
}

static saga_train_options stop_in_rendering(void)
{
    return stop_at(tiny_defaults(), (tiny_stop){ SAGA_TRAIN_RENDER, 3, 0, 0 });
}

TEST(train_should_refuse_a_checkpoint_of_other_options)
{
    static const char *const says[] = {
        "--seed 1, not 7",
        "--lambda 0, not 0.25",
        "--iterations 100, not 101",
        "--level 2, not 1",
        "--layers 1, not 2",
        "begun with --ablate 'slots=32', not 'groups=4,raw-networks'",
        "/nowhere/x.ckpt",
        "--model auto, not paper"
    };
    enum { MANY = sizeof says / sizeof says[0] };
    const saga_train_options o = stop_in_rendering();
    saga_train_options p[MANY];

    for (int i = 0; i < MANY; i++)
        p[i] = o;
    p[0].seed = 7;
    p[1].lambda = 0.25;
    p[2].n_render++;
    p[3].level = 1;
    p[4].n_layers = 2;
    p[5].ablate = "groups=4,raw-networks";
    p[6].checkpoint = "/nowhere/x.ckpt";
    p[7].paper = true;
    p[7].n_coarse = p[7].n_fine = 150; /* as it was derived */
    for (int i = 0; i < MANY; i++)
        assert_true(resume_fails(&p[i], says[i]));
}

/* Options on which a warm-up does not depend may change until it ends: a
 * training that continues with other options must give the file of one that
 * began with them. After the warm-up a higher level is no contradiction, since
 * the file keeps to its limits, too. */
TEST(train_should_continue_with_what_is_not_decided_yet)
{
    enum { MANY = 4 };
    saga_train_options with[MANY];

    for (int i = 0; i < MANY; i++)
        with[i] = tiny_layered();
    with[0].level = 3;
    with[1].lambda = 3;
    with[2].n_layers = 1;
    with[3].n_bytes = 9000;
    for (int i = 0; i < MANY; i++) {
        tiny_stop warm = { SAGA_TRAIN_WARM, 3, 0, 0 };
        tiny_stop late = { SAGA_TRAIN_RENDER, 3, 0, 0 };
        const trained whole = tiny_train(&room.capture, &with[i]);

        stop_at(tiny_layered(), warm);
        with[i].checkpoint = room.checkpoint;
        assert_true(resumes_to(&with[i], &whole));
        free(whole.bytes);
        if (i == 0 || i == 3) {
            stop_at(tiny_layered(), late);
            free(tiny_finish(tiny_resume(&room.capture, &with[i])).bytes);
        }
    }
}

/* Writes the first n bytes, one of them changed (none if at >= n). */
static void write_damaged(const saga_bytes *b, size_t n, size_t at)
{
    FILE *const file = must(fopen(room.checkpoint, "wb"));

    if (at < n)
        b->data[at] ^= 0x41;
    assert_int_equal(fwrite(b->data, 1, n, file), n);
    if (at < n)
        b->data[at] ^= 0x41;
    assert_int_equal(fclose(file), 0);
}

/* The place of the options, which include the seed, and of the pictures' digest
 * in a checkpoint. */
enum { HEAD_BEGIN = 32, HEAD_END = 32 + 10 * 8 + 128 };

/* A checkpoint with a changed byte, or cut at any byte, must be refused as
 * damaged. This holds for the seed too: a changed byte in it must not be
 * reported as a different --seed. Behind the seed, which ends at 88, every
 * seventh byte is tried. */
TEST(train_should_refuse_a_damaged_checkpoint)
{
    const saga_train_options o = stop_in_rendering();
    const saga_rng r = saga_rng_stream(1, 1);
    saga_bytes b;

    assert_done(saga_read_file(&b, room.checkpoint, &error));
    assert_true(b.nbytes > 1000);
    for (size_t at = 0; at < HEAD_END; at += at < 88 ? 1 : 7) {
        write_damaged(&b, b.nbytes, at);
        assert_true(resume_fails(&o, at < HEAD_BEGIN
                                         ? "is not a checkpoint of this version"
                                         : "is damaged or cut short"));
    }
    for (uint64_t i = 0; i < 24; i++) {
        const size_t at = HEAD_END +
                          saga_rng_below(r, i, (uint32_t)(b.nbytes - HEAD_END));

        write_damaged(&b, i % 3 ? b.nbytes : at, at);
        assert_true(resume_fails(&o, "is damaged or cut short"));
    }
    write_damaged(&b, 10, b.nbytes);
    assert_true(resume_fails(&o, "is cut short"));
    write_damaged(&b, b.nbytes, b.nbytes);
    saga_train_free(tiny_resume(&room.capture, &o));
    free(b.data);
}

/* Writes the checkpoint with one number changed and its digest computed anew.
 */
static void write_changed(const saga_bytes *b, size_t at, uint64_t value)
{
    FREED uint8_t *const data = must(malloc(b->nbytes));
    FILE *const file = must(fopen(room.checkpoint, "wb"));
    uint64_t sum;

    memcpy(data, b->data, b->nbytes);
    memcpy(data + at, &value, sizeof value);
    sum = saga_digest(SAGA_DIGEST_START, data, b->nbytes - sizeof sum);
    memcpy(data + b->nbytes - sizeof sum, &sum, sizeof sum);
    assert_int_equal(fwrite(data, 1, b->nbytes, file), b->nbytes);
    assert_int_equal(fclose(file), 0);
}

/* Returns the place of the fit's iteration, which is stored after the sizes of
 * its scene. */
static size_t place_of_iteration(const saga_bytes *b, const saga_scene *s)
{
    const uint64_t before[4] = { s->n.coarse, s->n.fine, s->n.prim,
                                 s->n_reals };
    size_t at = 0;

    while (memcmp(b->data + at, before, sizeof before) != 0)
        at++;
    return at + sizeof before;
}

/* A checkpoint with a valid digest must be refused if its numbers would lead
 * outside of arrays: a stage that does not exist, a fit that is missing or
 * present in the wrong stage, an iteration after the last. */
TEST(train_should_refuse_impossible_numbers)
{
    const saga_train_options o = stop_in_rendering();
    const size_t stage = HEAD_BEGIN + offsetof(saga_train_header, stage);
    const size_t fitting = HEAD_BEGIN + offsetof(saga_train_header, fitting);
    saga_error error = { "" };
    saga_train *t = tiny_resume(&room.capture, &o);
    size_t iteration;
    saga_bytes b;

    assert_true(saga_read_file(&b, room.checkpoint, &error));
    iteration = place_of_iteration(&b, &t->render.scene);
    saga_train_free(t);
    {
        const struct {
            size_t at;
            uint64_t value;
        } change[] = { { stage, SAGA_TRAIN_N_STAGES },
                       { stage, UINT64_MAX },
                       { stage, SAGA_TRAIN_WARM },
                       { fitting, 0 },
                       { iteration, (uint64_t)o.n_render + 1 },
                       { iteration, (uint64_t)INT64_MAX + 1 } };

        for (size_t i = 0; i < sizeof change / sizeof change[0]; i++) {
            write_changed(&b, change[i].at, change[i].value);
            assert_true(resume_fails(&o, "contradicts itself"));
        }
    }
    write_changed(&b, iteration, 4);
    t = tiny_resume(&room.capture, &o);
    assert_int_equal(saga_fit_iteration(t->render.fit), 4);
    saga_train_free(t);
    free(b.data);
}

/* A checkpoint must be refused if the pictures that were read have another
 * digest (test_input_layouts.c says what that depends on), or if one camera is
 * moved a little. */
TEST(train_should_refuse_a_checkpoint_of_other_pictures)
{
    const saga_train_options o = stop_in_rendering();
    saga_source_view *const last =
        &room.capture.views[room.capture.n_views - 1];
    const double x = last->translation[0];

    last->digest ^= 1;
    assert_true(resume_fails(&o, "was begun with other pictures"));
    last->digest ^= 1;
    last->translation[0] = nextafter(x, 1e9);
    assert_true(resume_fails(&o, "was begun with other pictures"));
    last->translation[0] = x;
    saga_train_free(tiny_resume(&room.capture, &o));
}
