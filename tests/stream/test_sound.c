/* SPDX-License-Identifier: MIT
 *
 * The sound of a film: the stream that was put in comes back, pictures and
 * segments keep their bytes, and damaged sound is refused before it is used.
 */
#include "film_sound.h"
#include "gen_sound.h"
#include "ogg_opus.h"
#include "player.h"
#include "saga.h"
#include "splice.h"
#include "testing.h"

static saga_bytes make(int sounds, int base)
{
    const gen_options o = { .seed = 5,
                            .level = 1,
                            .n_coarse = 3,
                            .tools_fixed = 1,
                            .named = 1,
                            .sounds = sounds,
                            .n_segments = 2,
                            .base = base };
    saga_bytes f;

    f.data = gen_stream_bytes(&o, &f.nbytes);
    return f;
}

static saga_bytes put(const saga_bytes *film, const saga_recording *sound)
{
    saga_error error = { "" };
    saga_bytes out;

    if (!saga_sound_put(&out, "it", film, sound, &error))
        fail_msg("%s", error.message);
    return out;
}

TEST(sound_should_come_back)
{
    uint8_t ogg[GEN_SOUND_NBYTES];

    gen_sound(ogg);
    for (int base = 0; base < 2; base++) {
        saga_bytes f = make(1, base);
        saga_sound sound;

        assert_int_equal(saga_find_sound(&sound, f.data, f.nbytes), SAGA_OK);
        assert_int_equal(sound.start, -4800);
        assert_int_equal(sound.nbytes, sizeof ogg);
        assert_memory_equal(f.data + sound.offset, ogg, sizeof ogg);
        saga_bytes_free(&f);
    }
}

TEST(film_should_be_what_it_was_without_its_sound)
{
    static const saga_recording silence = { NULL, 0, 0 };

    for (int base = 0; base < 2; base++) {
        saga_bytes with = make(1, base), without = make(0, base);
        saga_bytes again = put(&with, &silence);
        saga_sound sound;
        saga_segment a, b;

        assert_int_equal(again.nbytes, without.nbytes);
        assert_memory_equal(again.data, without.data, without.nbytes);
        assert_int_equal(saga_find_sound(&sound, again.data, again.nbytes),
                         SAGA_ERR_ARG);
        assert_int_equal(saga_find(&a, with.data, with.nbytes, 0, 1), SAGA_OK);
        assert_int_equal(saga_find(&b, again.data, again.nbytes, 0, 1),
                         SAGA_OK);
        assert_int_equal(a.offset - b.offset, 12 + 4 + GEN_SOUND_NBYTES);
        assert_int_equal(a.nbytes, b.nbytes);
        assert_memory_equal(with.data + a.offset, again.data + b.offset,
                            a.nbytes);
        saga_bytes_free(&with);
        saga_bytes_free(&without);
        saga_bytes_free(&again);
    }
}

static saga_status find(const uint8_t *bytes, size_t n)
{
    saga_sound other;

    return saga_find_sound(&other, bytes, n);
}

TEST(sound_should_be_refused_when_cut_or_changed)
{
    saga_bytes f = make(1, 0);
    saga_sound sound;
    size_t begin;

    assert_ok(saga_find_sound(&sound, f.data, f.nbytes));
    begin = (size_t)sound.offset - 16;
    player_check_chunk(find, f.data, f.nbytes,
                       (size_t[]){ begin, begin + 16 + sound.nbytes }, 4);
    saga_bytes_free(&f);
}

static bool is_read(const uint8_t *ogg, size_t n)
{
    saga_error error = { "" };
    saga_ogg_opus opus;

    return saga_ogg_opus_read(&opus, "it", ogg, n, &error);
}

TEST(stream_should_be_told)
{
    uint8_t ogg[GEN_SOUND_NBYTES];
    saga_error error = { "" };
    saga_ogg_opus opus;

    gen_sound(ogg);
    assert_true(saga_is_ogg_opus(ogg, sizeof ogg));
    assert_true(saga_ogg_opus_read(&opus, "it", ogg, sizeof ogg, &error));
    assert_int_equal(opus.n_channels, 1);
    assert_int_equal(opus.pre_skip, 192);
    assert_int_equal(opus.n_samples, 5 * 960 - 192);
}

TEST(damaged_stream_should_be_refused)
{
    uint8_t ogg[2 * GEN_SOUND_NBYTES];
    const size_t n = GEN_SOUND_NBYTES, audio = 47 + 48;

    /* Every byte has a checksum, and a page that is missing shows. */
    gen_sound(ogg);
    for (size_t i = 0; i < n; i++) {
        ogg[i] ^= 0x10;
        assert_false(is_read(ogg, n));
        ogg[i] ^= 0x10;
        assert_false(is_read(ogg, i));
    }
    memmove(ogg + 47, ogg + audio, n - audio);
    assert_false(is_read(ogg, n - 48));
    /* Of these the checksums are right. */
    static const struct {
        size_t at;
        uint8_t by;
    } change[] = {
        { 47 + 48 + 14, 1 },   /* another stream's page */
        { 47 + 48 + 18, 1 },   /* another page's number */
        { 47 + 48 + 7, 0x12 }, /* ends before the pre-skip */
        { 47 + 48 + 4, 1 },    /* another version of Ogg */
        { 28 + 8, 0x10 },      /* another version of Opus */
        { 28 + 9, 1 },         /* no channel */
        { 47 + 28, 1 },        /* no tags */
        { 5, 2 }               /* no beginning */
    };
    for (size_t i = 0; i < sizeof change / sizeof *change; i++) {
        gen_sound(ogg);
        assert_true(is_read(ogg, n));
        ogg[change[i].at] ^= change[i].by;
        gen_sound_sign(ogg + (change[i].at >= audio ? audio
                              : change[i].at >= 47  ? 47
                                                    : 0));
        assert_false(is_read(ogg, n));
    }
    /* A second stream behind the first. */
    gen_sound(ogg);
    gen_sound(ogg + n);
    assert_false(is_read(ogg, 2 * n));
}

TEST(sound_should_stay_with_all_frames_alone)
{
    saga_bytes f = make(1, 0);
    saga_splice_part part = { .name = "it",
                              .bytes = f.data,
                              .nbytes = f.nbytes };
    saga_error error = { "" };
    saga_segment first;
    saga_sound sound;
    uint8_t *cut;
    size_t n;

    assert_true(saga_splice(&cut, &n, &part, 1, &error));
    assert_int_equal(n, f.nbytes);
    assert_memory_equal(cut, f.data, n);
    free(cut);
    assert_int_equal(saga_find(&first, f.data, f.nbytes, 0, 1), SAGA_OK);
    part.end = first.n_frames;
    assert_true(saga_splice(&cut, &n, &part, 1, &error));
    assert_int_equal(saga_find_sound(&sound, cut, n), SAGA_ERR_ARG);
    free(cut);
    saga_bytes_free(&f);
}

/* saga_file_sign, which computes the CRCs anew, follows the chunks, so that the
 * file must have no other bytes. */
TEST(film_with_bytes_behind_it_should_be_refused)
{
    static const saga_recording silence = { NULL, 0, 0 };
    saga_bytes f = make(1, 0), out;
    saga_error error = { "" };

    f.data = realloc(f.data, f.nbytes + 1);
    f.data[f.nbytes++] = 0;
    assert_false(saga_sound_put(&out, "it", &f, &silence, &error));
    assert_null(out.data);
    saga_bytes_free(&f);
}
