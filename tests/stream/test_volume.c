/* SPDX-License-Identifier: MIT
 *
 * The viewing volume. The decoder must return the fields that were encoded,
 * must refuse damage of the chunk, and must not read beyond the end of the
 * file. Whatever is found for a rig must be what geometry says.
 */
#include "film_sound.h"
#include "layout.h"
#include "player.h"
#include "saga.h"
#include "splice.h"
#include "testing.h"
#include "film_volume.h"

#include <math.h>

static saga_bytes make(int bounded, int others, int base)
{
    const gen_options o = { .seed = 5,
                            .level = 1,
                            .n_coarse = 3,
                            .tools_fixed = 1,
                            .exposed = others,
                            .named = others,
                            .sounds = others,
                            .bounded = bounded,
                            .n_segments = 2,
                            .base = base };
    saga_bytes f;

    f.data = gen_stream_bytes(&o, &f.nbytes);
    return f;
}

static void assert_volume(const saga_bytes *f, int bounded)
{
    const saga_volume want = gen_stream_volume(bounded);
    saga_volume got;

    memset(&got, 0, sizeof got);
    assert_ok(saga_find_volume(&got, f->data, f->nbytes));
    /* Without the padding at its end. */
    assert_memory_equal(&got, &want,
                        offsetof(saga_volume, quality_q8) +
                            sizeof want.quality_q8);
}

TEST(volumes_should_come_back)
{
    for (int i = 0; i < 4; i++) {
        saga_bytes f = make(0, i & 1, i >> 1);
        saga_volume got = { .start = 7 };

        assert_int_equal(saga_find_volume(&got, f.data, f.nbytes),
                         SAGA_ERR_ARG);
        assert_int_equal(got.start, 7);
        saga_bytes_free(&f);
        for (int bounded = 1; bounded <= 3; bounded++) {
            f = make(bounded, i & 1, i >> 1);
            assert_volume(&f, bounded);
            saga_bytes_free(&f);
        }
    }
}

static saga_status find(const uint8_t *bytes, size_t n)
{
    saga_volume got = { .start = 7 };
    const saga_status s = saga_find_volume(&got, bytes, n);

    assert_true(s == SAGA_OK || got.start == 7);
    return s;
}

TEST(volumes_should_be_refused_when_cut_or_changed)
{
    saga_bytes f = make(1, 1, 0);
    saga_segment first;
    size_t end;

    /* The chunk is the last one before the first segment: 12 + 50 bytes. */
    assert_ok(saga_find(&first, f.data, f.nbytes, 0, 1));
    end = (size_t)first.offset;
    player_check_chunk(find, f.data, f.nbytes, (size_t[]){ end - 62, end }, 0);
    saga_bytes_free(&f);
}

/* With another volume, with another sound, and without, a film keeps its other
 * bytes. */
TEST(volumes_should_be_put_in_replaced_and_removed)
{
    saga_bytes without = make(0, 1, 1), with, silent, back;
    const saga_recording none = { NULL, 0, 0 };
    saga_error error = { "" };
    saga_volume v = gen_stream_volume(1);

    assert_true(saga_volume_put(&with, "it", &without, &v, &error));
    assert_int_equal(with.nbytes, without.nbytes + 62);
    assert_volume(&with, 1);
    v = gen_stream_volume(3);
    assert_true(saga_volume_put(&back, "it", &with, &v, &error));
    assert_int_equal(back.nbytes, with.nbytes);
    assert_volume(&back, 3);
    saga_bytes_free(&back);
    assert_true(saga_sound_put(&silent, "it", &with, &none, &error));
    assert_volume(&silent, 1);
    saga_bytes_free(&silent);
    assert_true(saga_volume_put(&back, "it", &with, NULL, &error));
    assert_int_equal(back.nbytes, without.nbytes);
    assert_memory_equal(back.data, without.data, back.nbytes);
    saga_bytes_free(&back);
    /* A volume that no decoder accepts is not written. */
    v.start = GEN_MAX_CAMERAS;
    assert_false(saga_volume_put(&back, "it", &with, &v, &error));
    assert_null(back.data);
    saga_bytes_free(&with);
    saga_bytes_free(&without);
}

TEST(every_part_of_a_film_should_have_the_volume)
{
    saga_bytes f = make(1, 1, 1), cut = { NULL, 0 };
    saga_splice_part part = { .name = "it",
                              .bytes = f.data,
                              .nbytes = f.nbytes };
    saga_error error = { "" };
    saga_layout layout;
    saga_segment first;

    assert_ok(saga_find(&first, f.data, f.nbytes, 0, 1));
    part.first = first.n_frames;
    assert_true(saga_splice(&cut.data, &cut.nbytes, &part, 1, &error));
    assert_volume(&cut, 1);
    assert_true(saga_layout_read(&layout, "it", cut.data, cut.nbytes, &error));
    assert_int_equal(layout.volume_nbytes, 50);
    assert_int_equal(layout.sound_nbytes, 0);
    assert_int_equal(layout.other_nbytes, 0);
    saga_layout_free(&layout);
    saga_bytes_free(&cut);
    saga_bytes_free(&f);
}

/* Fewer layers look worse, by an amount that is unknown. */
TEST(fewer_layers_should_promise_no_quality)
{
    const gen_options o = { .seed = 5,
                            .level = 1,
                            .n_coarse = 3,
                            .tools_fixed = 1,
                            .bounded = 1,
                            .n_layers = 2 };
    saga_volume want = gen_stream_volume(1), got;
    saga_splice_part part = { .name = "it", .n_layers = 2 };
    saga_bytes f, cut = { NULL, 0 };
    saga_error error = { "" };

    f.data = gen_stream_bytes(&o, &f.nbytes);
    part.bytes = f.data;
    part.nbytes = f.nbytes;
    for (part.n_layers = 2; part.n_layers > 0; part.n_layers--) {
        assert_true(saga_splice(&cut.data, &cut.nbytes, &part, 1, &error));
        assert_ok(saga_find_volume(&got, cut.data, cut.nbytes));
        if (part.n_layers < 2)
            want.quality_q8[0] = want.quality_q8[1] = 0;
        assert_int_equal(got.quality_q8[0], want.quality_q8[0]);
        assert_int_equal(got.quality_q8[1], want.quality_q8[1]);
        assert_int_equal(got.distance_max, want.distance_max);
        saga_bytes_free(&cut);
    }
    saga_bytes_free(&f);
}

/* --- What is found for a rig --------------------------------------------- */

static void assert_close(double got, double want, double most)
{
    if (!(fabs(got - want) <= most))
        fail_msg("%.9g is not %.9g", got, want);
}

/* Returns the azimuth of a camera in the volume, by the formula of section 13
 * of bitstream.md, and sets elevation and distance. */
static double sector_of(double *elevation, double *distance,
                        const saga_volume *v, const saga_camera *c)
{
    double up[3], front[3], side[3], to[3], n = 0, m = 0, k = 0, x[3];

    for (int i = 0; i < 3; i++) {
        n += (double)v->up[i] * v->up[i];
        k += (double)v->up[i] * v->front[i];
    }
    for (int i = 0; i < 3; i++) {
        up[i] = v->up[i] / sqrt(n);
        front[i] = v->front[i] - k / n * v->up[i];
        m += front[i] * front[i];
        to[i] = (double)c->centre[i] - v->pivot[i];
    }
    for (int i = 0; i < 3; i++)
        front[i] /= sqrt(m);
    side[0] = up[1] * front[2] - up[2] * front[1];
    side[1] = up[2] * front[0] - up[0] * front[2];
    side[2] = up[0] * front[1] - up[1] * front[0];
    x[0] = x[1] = x[2] = *distance = 0;
    for (int i = 0; i < 3; i++) {
        x[0] += to[i] * front[i];
        x[1] += to[i] * side[i];
        x[2] += to[i] * up[i];
        *distance += to[i] * to[i];
    }
    *distance = sqrt(*distance);
    *elevation = asin(x[2] / *distance);
    return atan2(x[1], x[0]);
}

/* The cameras of a generated stream look at the middle of the box from a
 * distance of 2.6 * 2^23, from 0.25 radians below; their azimuths differ by
 * 0.7. As seen from there, neighbours are acos(cos^2 0.25 cos 0.7 + sin^2 0.25)
 * = 0.68 apart, so that the margin has its largest value, 5 degrees. */
TEST(the_volume_of_a_rig_should_hold_its_cameras_and_a_margin)
{
    static const double turn = 32768 / 3.14159265358979323846;
    const double margin = 5 * 32768 / 180.0;
    saga_bytes f = make(0, 0, 0);
    saga_error error = { "" };
    saga_film film;
    saga_volume v;

    assert_true(saga_film_open(&film, "it", f.data, f.nbytes, 1, &error));
    assert_true(saga_volume_of(&v, &film, &error));
    for (int i = 0; i < 3; i++)
        assert_close(v.pivot[i], 0, 16);
    assert_close(v.distance_min, 1.3 * (1 << 23), 16);
    assert_close(v.distance_max, 2.73 * (1 << 23), 16);
    assert_close(v.azimuth, 0.7 * turn + margin, 3);
    assert_close(v.elevation_min, -0.25 * turn - margin, 3);
    assert_close(v.elevation_max, -0.25 * turn + margin, 3);
    assert_int_equal(v.start, 1);
    /* 160 x 120 pixels at a focal length of 110. */
    assert_close(v.turn, 0.5 * atan(60 / 110.0) * turn, 1);
    assert_int_equal(v.quality_q8[0] + v.quality_q8[1], 0);
    for (uint32_t i = 0; i < GEN_MAX_CAMERAS; i++) {
        double elevation, distance;
        saga_camera c;
        uint32_t number;

        /* An azimuth grows from up x front on, as angles about up do. */
        assert_true(saga_film_rig(&film, i, &c, &number, &error));
        assert_close(fabs(sector_of(&elevation, &distance, &v, &c)),
                     fabs(0.7 * ((int)i - 1)), 1e-3);
        assert_close(elevation, -0.25, 1e-3);
        assert_close(distance, 2.6 * (1 << 23), 16);
    }
    saga_film_close(&film);
    saga_bytes_free(&f);
}
