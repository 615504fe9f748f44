/* SPDX-License-Identifier: MIT
 *
 * Exposures of cameras. The decoder must return the gains that were encoded,
 * must refuse damage of the chunk, and must not read beyond the end of the
 * file. Sound and segments behind the chunk must keep their bytes.
 */
#include "file.h"
#include "layout.h"
#include "player.h"
#include "saga.h"
#include "splice.h"
#include "testing.h"

static saga_bytes make(int exposed, int named, int base)
{
    const gen_options o = { .seed = 5,
                            .level = 1,
                            .n_coarse = 3,
                            .tools_fixed = 1,
                            .exposed = exposed,
                            .named = named,
                            .sounds = 1,
                            .n_segments = 2,
                            .base = base };
    saga_bytes f;

    f.data = gen_stream_bytes(&o, &f.nbytes);
    return f;
}

static void assert_gains(const uint8_t *bytes, size_t n)
{
    for (uint32_t i = 0; i < GEN_MAX_CAMERAS; i++) {
        const saga_exposure want = gen_stream_exposure(i);
        saga_exposure got;

        assert_ok(saga_find_exposure(&got, bytes, n, i));
        assert_memory_equal(&got, &want, sizeof want);
    }
}

TEST(exposures_should_come_back)
{
    for (int i = 0; i < 4; i++) {
        saga_bytes f = make(1, i & 1, i >> 1);
        saga_exposure got = { { 1, 2, 3 } };

        assert_gains(f.data, f.nbytes);
        assert_int_equal(
            saga_find_exposure(&got, f.data, f.nbytes, GEN_MAX_CAMERAS),
            SAGA_ERR_ARG);
        assert_int_equal(got.gain_q12[2], 3);
        saga_bytes_free(&f);
        f = make(0, i & 1, i >> 1);
        assert_int_equal(saga_find_exposure(&got, f.data, f.nbytes, 0),
                         SAGA_ERR_ARG);
        saga_bytes_free(&f);
    }
}

/* The chunk has a head of 12 bytes and 6 bytes for each camera. */
TEST(exposures_should_move_sound_and_segments_and_change_neither)
{
    saga_bytes with = make(1, 1, 1), without = make(0, 1, 1);
    const size_t nbytes = 12 + 6 * GEN_MAX_CAMERAS;
    saga_sound a, b;
    saga_segment s, t;

    assert_int_equal(with.nbytes - without.nbytes, nbytes);
    assert_ok(saga_find_sound(&a, with.data, with.nbytes));
    assert_ok(saga_find_sound(&b, without.data, without.nbytes));
    assert_int_equal(a.offset - b.offset, nbytes);
    assert_int_equal(a.nbytes, b.nbytes);
    assert_memory_equal(with.data + a.offset, without.data + b.offset,
                        a.nbytes);
    for (uint32_t frame = 0;
         saga_find(&s, with.data, with.nbytes, frame, 1) == SAGA_OK; frame++) {
        assert_ok(saga_find(&t, without.data, without.nbytes, frame, 1));
        assert_int_equal(s.offset - t.offset, nbytes);
        assert_int_equal(s.nbytes, t.nbytes);
        assert_memory_equal(with.data + s.offset, without.data + t.offset,
                            s.nbytes);
    }
    saga_bytes_free(&with);
    saga_bytes_free(&without);
}

static saga_status find(const uint8_t *bytes, size_t n)
{
    saga_exposure got = { { 1, 2, 3 } };
    const saga_status s = saga_find_exposure(&got, bytes, n, 0);

    assert_true(s == SAGA_OK || got.gain_q12[0] == 1);
    return s;
}

TEST(exposures_should_be_refused_when_cut_or_changed)
{
    saga_bytes f = make(1, 1, 0);
    saga_sound sound;
    size_t end;

    assert_ok(saga_find_sound(&sound, f.data, f.nbytes));
    end = (size_t)sound.offset - 16;
    player_check_chunk(find, f.data, f.nbytes,
                       (size_t[]){ end - 12 - 6 * GEN_MAX_CAMERAS, end }, 0);
    assert_gains(f.data, end);
    saga_bytes_free(&f);
}

/* A cut film has the exposures of all cameras, but no sound. */
TEST(every_part_of_a_film_should_have_the_exposures)
{
    saga_bytes f = make(1, 1, 1);
    saga_splice_part part[2] = {
        { .name = "it", .bytes = f.data, .nbytes = f.nbytes }
    };
    saga_error error = { "" };
    saga_layout layout;
    saga_segment first;
    uint8_t *cut[2], *joined;
    size_t n[2], n_joined;

    assert_ok(saga_find(&first, f.data, f.nbytes, 0, 1));
    part[0].end = first.n_frames;
    assert_true(saga_splice(&cut[0], &n[0], part, 1, &error));
    part[0].first = first.n_frames;
    part[0].end = 0;
    assert_true(saga_splice(&cut[1], &n[1], part, 1, &error));
    for (int i = 0; i < 2; i++) {
        assert_gains(cut[i], n[i]);
        part[i] =
            (saga_splice_part){ .name = "it", .bytes = cut[i], .nbytes = n[i] };
    }
    assert_true(saga_splice(&joined, &n_joined, part, 2, &error));
    assert_gains(joined, n_joined);
    assert_true(saga_layout_read(&layout, "it", joined, n_joined, &error));
    assert_int_equal(layout.exposures_nbytes, 6 * GEN_MAX_CAMERAS);
    assert_int_equal(layout.other_nbytes, 0);
    saga_layout_free(&layout);
    free(cut[0]);
    free(cut[1]);
    free(joined);
    saga_bytes_free(&f);
}
