/* SPDX-License-Identifier: MIT
 *
 * Invalid files for ref_file, which takes files apart for tests and
 * experiments. It was written independently of the decoder and must refuse
 * every file that the decoder refuses, with a message and without a crash. The
 * inputs are the vectors and damaged streams; SAGA_TEST_SEED is the number of
 * the first, SAGA_TEST_COUNT their number.
 */
#include "gen_mutate.h"
#include "gen_zeroed.h"
#include "error.h"
#include "file.h"
#include "ref_file.h"
#include "ref_recorder.h"
#include "ref_scene.h"
#include "testing.h"

#include <dirent.h>
#include <math.h>

enum { PER_BASE = 25 };

/* --- What each reader says ----------------------------------------------- */

/* Takes the file apart. Returns NULL, or the reason for which it is refused.
 * The features, of symbols and predictions, are those of the decoder. */
static const char *take_apart(const uint8_t *bytes, size_t n)
{
    ref_file f;
    const char *why = ref_file_read(&f, bytes, n);

    if (why)
        return why;
    assert_memory_equal(f.value[SAGA_STEP_FEATURE], f.sc.coarse_feature,
                        (size_t)f.n.coarse * f.h.model.features *
                            sizeof *f.sc.coarse_feature);
    ref_file_free(&f);
    return NULL;
}

static int record(const uint8_t *bytes, size_t n)
{
    return recorder_compare(NULL, NULL, bytes, n);
}

/* Copies the file without a change: a file that can be read can be written. */
static const char *zero(const uint8_t *bytes, size_t n)
{
    uint8_t *out = NULL;
    size_t n_out;
    const char *const why = zeroed_make(&out, &n_out, bytes, n, ZEROED_NOTHING);

    free(out);
    return why;
}

/* Checks that the file is refused. A file of which only a view is refused
 * counts as good here. */
static void assert_refused(const char *name, const uint8_t *bytes, size_t n)
{
    if (strstr(name, "cover_exceeded"))
        return;
    const char *const apart = take_apart(bytes, n), *const z = zero(bytes, n);

    if (!apart || !apart[0] || !z || !z[0] || record(bytes, n))
        fail_msg("%s: taken apart", name);
}

/* --- Vectors ------------------------------------------------------------- */

static uint32_t for_each(const char *folder,
                         void check(const char *, const uint8_t *, size_t))
{
    DIR *const dir = opendir(folder);
    const struct dirent *e;
    uint32_t n = 0;

    assert_non_null(dir);
    while ((e = readdir(dir)) != NULL) {
        saga_error error = { "" };
        saga_bytes file;
        char path[512];

        if (!strstr(e->d_name, ".saga"))
            continue;
        snprintf(path, sizeof path, "%s/%s", folder, e->d_name);
        assert_true(saga_read_file(&file, path, &error));
        check(path, file.data, file.nbytes);
        saga_bytes_free(&file);
        n++;
    }
    closedir(dir);
    return n;
}

static void check_good(const char *name, const uint8_t *bytes, size_t n)
{
    saga_info info;

    assert_ok(saga_probe(&info, bytes, n));
    if (!record(bytes, n) || (zero(bytes, n) == NULL) !=
                                 (info.base_coarse == 0 && info.n_layers == 1))
        fail_msg("%s is refused", name);
    if ((take_apart(bytes, n) == NULL) !=
        (info.n_segments == 1 && info.n_layers == 1 && info.base_coarse == 0))
        fail_msg("%s, %u segments: %s", name, (unsigned)info.n_segments,
                 take_apart(bytes, n));
}

TEST(good_vectors_should_be_taken_apart)
{
    assert_true(for_each("vectors/good", check_good) >= 10);
}

TEST(bad_vectors_should_be_refused)
{
    assert_true(for_each("vectors/bad", assert_refused) >= 50);
}

/* --- Classes ------------------------------------------------------------- */

/* Decodes a file in double, and returns how many of its features are 1 without
 * being coded. */
static uint32_t check_ones(const uint8_t *bytes, size_t n)
{
    saga_error error = { "" };
    saga_primitive *prim;
    int16_t *colour;
    uint32_t n_ones = 0;
    FREED_BY(ref_file_free) ref_file f;
    FREED_BY(ref_scene_free) ref_scene s;

    assert_null(ref_file_read(&f, bytes, n));
    assert_true(ref_file_primitives(&prim, &colour, &f, &error));
    assert_true(ref_scene_make(&s, &f, prim, colour, &error));
    assert_true(ref_scene_decode(&s, &error));
    for (size_t i = 0; i < (size_t)f.n.coarse * f.h.model.features; i++)
        if (!ref_file_is_coded(&f, SAGA_STEP_FEATURE, i)) {
            assert_true(s.coarse_feature[i] ==
                        ldexp(f.sc.coarse_feature[i],
                              -f.h.model.out_q[SAGA_OUT_COARSE]));
            n_ones += f.sc.coarse_feature[i] != 0;
        }
    free(prim);
    free(colour);
    return n_ones;
}

TEST(features_that_are_not_coded_should_be_exact_in_double)
{
    uint32_t n_ones = 0;

    for (uint64_t seed = 0; seed < 10; seed++) {
        const gen_options o = { .seed = seed, .level = 1, .classes = 3 };
        size_t n;
        FREED uint8_t *const bytes = gen_stream_bytes(&o, &n);

        n_ones += check_ones(bytes, n);
    }
    assert_true(n_ones > 0);
}

/* --- Damaged streams ----------------------------------------------------- */

static uint8_t *make_base(uint64_t number, size_t *n)
{
    const gen_options o = { .seed = number,
                            .n_coarse = 1 + (uint32_t)(number % 5),
                            .bank = (int)(number % 3),
                            .bank_slots = 32,
                            .bank_width = 8,
                            .classes = number % 2
                                           ? 2 + (uint32_t)(number / 2 % 3)
                                           : 0 };

    return gen_stream_bytes(&o, n);
}

/* Returns whether the decoder accepts the only segment, and finds in the index
 * that its frames are all frames of the film. */
static int decodes(const mutate_result *result, const saga_info *info,
                   const uint8_t *bytes, size_t n)
{
    saga_segment last;

    return (result->stage == MUTATE_AT_VIEW || result->stage == MUTATE_DRAWN) &&
           saga_find(&last, bytes, n, info->n_frames - 1, 1) == SAGA_OK;
}

static void play(uint64_t number, const uint8_t *base, size_t n_base,
                 uint32_t n_of[2])
{
    const mutate_class c = (mutate_class)(number % MUTATE_N_CLASSES);
    uint64_t r = number * 0x9e3779b97f4a7c15u;
    mutate_result result;
    saga_info info;
    size_t n;
    FREED uint8_t *const bytes = mutate_make(base, n_base, c, &r, &n);

    mutate_play(&result, bytes, n, &r);
    if (result.stage != MUTATE_AT_SIZE &&
        (saga_probe(&info, bytes, n) || info.n_segments == 1)) {
        const int takes = take_apart(bytes, n) == NULL;

        if (takes != decodes(&result, &info, bytes, n) ||
            record(bytes, n) != takes || (zero(bytes, n) == NULL && !takes))
            fail_msg("stream %llu: %d, %d, %s, %s; decoder: %s",
                     (unsigned long long)number, takes, record(bytes, n),
                     take_apart(bytes, n), zero(bytes, n),
                     mutate_stage_text[result.stage]);
        n_of[takes]++;
    }
}

TEST(damage_should_be_refused_where_the_decoder_refuses)
{
    const uint64_t first = testing_seed(0);
    const uint64_t end = first + testing_count(150, 4000);
    uint32_t n_of[2] = { 0, 0 };
    uint8_t *base = NULL;
    size_t n = 0;

    for (uint64_t i = first; i < end; i++) {
        if (!base || i % PER_BASE == 0) {
            free(base);
            base = make_base(i / PER_BASE, &n);
        }
        play(i, base, n, n_of);
    }
    free(base);
    printf("streams from %llu: %u refused, %u taken apart\n",
           (unsigned long long)first, (unsigned)n_of[0], (unsigned)n_of[1]);
    assert_true(n_of[0] > 0);
}
