/* SPDX-License-Identifier: MIT
 *
 * Training, packing and evaluation when memory runs out. Every allocation of
 * each iteration of each stage fails once, in the smallest scene that has all
 * tools and all sources. So does each that finds a film's viewing volume.
 */
#include "capture_files.h"
#include "evaluate.h"
#include "failing_heap.h"
#include "file.h"
#include "film_volume.h"
#include "synth_capture.h"
#include "testing.h"
#include "train.h"

#include <dirent.h>

#ifdef _OPENMP
#include <omp.h>
#endif

/* Returns the stride at which allocations are tried, because sanitizers take
 * long. */
static int stride(void)
{
    return !testing_sanitized() ? 1 : testing_long() ? 17 : 41;
}

typedef struct {
    saga_capture capture;
    saga_train_options options;
    saga_train *train;
    const char *pictures; /* folder for those of an evaluation */
} session;

/* Stops the training after each iteration; packing cannot be stopped. */
static bool stop_at_once(void *user, const saga_train_progress *p)
{
    (void)user;
    return p->stage == SAGA_TRAIN_PACK;
}

static void begin(session *s, folder *f)
{
    const saga_synth_options o = synth_options(16, 12, 3, 2, 20);

    s->capture = synth_capture(folder_file(f, "scene"), &o);
    s->options = saga_train_defaults();
    s->options.n_primitives = 12;
    s->options.n_warm = 2;
    s->options.n_render = 3;
    s->options.motion = SAGA_TRAIN_MOVING;
    s->options.ablate = "slots=32";
    s->options.progress = stop_at_once;
    s->train = NULL;
}

/* Runs the first iteration, or what comes before it. */
static bool begin_training(void *user, saga_error *error)
{
    session *const s = user;

    s->train = saga_train_new(&s->capture, &s->options, error);
    saga_train_free(s->train);
    return s->train != NULL;
}

/* Runs one more iteration, and what follows it. */
static bool go_on_training(void *user, saga_error *error)
{
    session *const s = user;
    const saga_outcome status = saga_train_run(s->train, error);

    saga_train_free(s->train);
    return status >= 0;
}

TEST_IN_FOLDER(training_should_be_refused_when_memory_ends)
{
    saga_outcome status = SAGA_STOPPED;
    saga_error error = { "" };
    session s;
    long n;

    begin(&s, f);
    n = heap_fail_each(begin_training, &s, stride());
    s.train = saga_train_new(&s.capture, &s.options, &error);
    assert_non_null(s.train);
    while (status == SAGA_STOPPED) {
        n += heap_fail_each(go_on_training, &s, stride());
        status = saga_train_run(s.train, &error);
    }
    printf("%ld allocations, 1 in %d failed\n", n, stride());
    assert_true(n > 900);
    assert_int_equal(status, SAGA_DONE);
    saga_train_free(s.train);
    saga_capture_free(&s.capture);
}

/* Resumes from a checkpoint in the rendering stage. */
static bool resume(void *user, saga_error *error)
{
    session *const s = user;
    saga_train *const t = saga_train_resume(&s->capture, &s->options, error);

    saga_train_free(t);
    return t != NULL;
}

TEST_IN_FOLDER(resuming_should_be_refused_when_memory_ends)
{
    saga_error error = { "" };
    session s;

    begin(&s, f);
    s.options.checkpoint = folder_file(f, "checkpoint");
    s.train = saga_train_new(&s.capture, &s.options, &error);
    assert_non_null(s.train);
    for (int i = 0; i < s.options.n_warm + 1; i++)
        assert_int_equal(saga_train_run(s.train, &error), SAGA_STOPPED);
    saga_train_free(s.train);
    assert_true(heap_fail_each(resume, &s, stride()) > 100);
    saga_capture_free(&s.capture);
}

/* --- Evaluation ---------------------------------------------------------- */

/* Removes everything in a folder; returns false if it has a file that is not a
 * picture. */
static bool only_pictures(const char *path)
{
    DIR *const dir = opendir(path);
    bool ok = dir != NULL;

    for (struct dirent *e; dir && (e = readdir(dir)) != NULL;) {
        char file[300];

        if (e->d_name[0] == '.')
            continue;
        ok = ok && saga_has_suffix(e->d_name, ".png");
        snprintf(file, sizeof file, "%s/%s", path, e->d_name);
        unlink(file);
    }
    if (dir)
        closedir(dir);
    return ok;
}

static bool evaluate(void *user, saga_error *error)
{
    session *const s = user;
    const saga_eval_options o = { .pictures = s->pictures };
    saga_film film;
    const saga_eval_maker maker = { .name = "x.saga",
                                    .n_threads = 1,
                                    .draw = saga_eval_draw_film,
                                    .state = &film };
    saga_eval eval = { .n_views = 0 };
    size_t n;
    const uint8_t *const file = saga_train_bytes(s->train, &n);
    bool ok = saga_film_open(&film, "x.saga", file, n, 1, error) &&
              saga_eval_match(&eval, &film, &s->capture, -1, error) &&
              saga_eval_run(&eval, &maker, &s->capture, &o, error);

    saga_eval_free(&eval);
    saga_film_close(&film);
    failing_heap.left = 0;
    if (only_pictures(s->pictures))
        return ok;
    *error = (saga_error){ "" };
    return saga_fail(error, s->pictures, NULL, "half a picture is left");
}

TEST_IN_FOLDER(evaluation_should_be_refused_when_memory_ends)
{
    saga_error error = { "" };
    session s;

    begin(&s, f);
    s.options.progress = NULL;
    s.train = saga_train_new(&s.capture, &s.options, &error);
    assert_non_null(s.train);
    assert_int_equal(saga_train_run(s.train, &error), SAGA_DONE);
    s.pictures = folder_file(f, "out");
    folder_run(f, "mkdir out");
    assert_true(heap_fail_each(evaluate, &s, stride()) > 90);
    saga_train_free(s.train);
    saga_capture_free(&s.capture);
}

/* A file whose volume is not found for want of memory says so. */
static bool add_volume(void *user, saga_error *error)
{
    static const uint16_t unknown[2] = { 0, 0 };
    saga_bytes film = { NULL, 0 };
    saga_error none = { "" };
    const bool ok = saga_read_file(&film, user, error) &&
                    saga_volume_add(&film, "x.saga", unknown, &none, error);

    saga_bytes_free(&film);
    if (saga_failed(&none))
        *error = none;
    return ok && !saga_failed(&none);
}

TEST(lack_of_memory_should_be_told_when_a_volume_is_not_found)
{
    char film[] = "vectors/good/exposures.saga";

    assert_true(heap_fail_each(add_volume, film, 1) > 5);
}

int main(void)
{
#ifdef _OPENMP
    omp_set_num_threads(1);
#endif
    return testing_run();
}
