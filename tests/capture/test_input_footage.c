/* SPDX-License-Identifier: MIT
 *
 * Videos as cameras, phones and cutters write them: their frames belong
 * together by time stamp, and what their tags say is done, or named with the
 * camera. A start of ffmpeg takes a fifth of a second, so that most rows of the
 * tables of files are only read if SAGA_TEST_LONG is set.
 */
#include "load.h"
#include "testing.h"
#include "video_files.h"

static const char *const two[] = { "a.mp4", "b.mp4" };

static bool is_long(void)
{
    return getenv("SAGA_TEST_LONG") != NULL;
}

static void check_notes(const saga_capture *c, const char *what)
{
    if (!strstr(c->notes, what))
        fail_msg("no \"%s\" in: %s", what, c->notes);
}

/* --- Time ---------------------------------------------------------------- */

/* Two cameras made from twelve frames at 25 per second, which their brightness
 * numbers. `a` and `b` are the frames that the moments of the capture show; '-'
 * is a picture that is missing. */
#define FFMPEG "ffmpeg -nostdin -v error -y "
#define KEEP(which)                                       \
    FFMPEG "-i a.mp4 -vf \"select=" which "\" -fps_mode " \
           "passthrough -c:v libx264 -qp 0 "
static const struct {
    const char *how, *a, *b, *note;
    bool always;
} cameras[] = {
    /* Frames were dropped; the counts differ, the moments do not. */
    { KEEP("not(between(n\\,4\\,5))") "b.mp4", "0123456789AB", "0123--6789AB",
      "2 moments lack a picture: b (1 of 2)", false },
    /* Each camera dropped another frame, so that the counts are equal. */
    { KEEP("not(eq(n\\,7))") "c.mp4 && " KEEP(
          "not(eq(n\\,3))") "b.mp4 && "
                            "mv c.mp4 a.mp4",
      "0123456-89AB", "012-456789AB", "2 moments lack a picture: a, b (2 of 2)",
      true },
    /* Stamps wander by up to 0.3 of a frame, as those of phones do. */
    { FFMPEG
      "-i a.mp4 -vf \"setpts=PTS+0.3*sin(N)/25/TB\" -fps_mode "
      "passthrough -c:v libx264 -qp 0 -video_track_timescale 90000 b.mp4",
      "0123456789AB", "0123456789AB", "", false },
    /* The camera began five frames late, which an empty edit says. */
    { KEEP("gte(n\\,5)") "b.mp4", "56789AB", "56789AB",
      "begin up to 5 frames before", false },
    /* A cutter that copies keeps frames before the cut, which an edit list
     * hides; both cameras were cut at frame 5. */
    { FFMPEG "-ss 0.2 -i a.mp4 -c copy b.mp4 && cp b.mp4 a.mp4", "56789AB",
      "56789AB", "", true },
};

static int number_of(const char *shown, int k)
{
    return shown[k] >= 'A' ? shown[k] - 'A' + 10 : shown[k] - '0';
}

static void check_shown(const saga_capture *c, int v, const char *shown)
{
    assert_int_equal(c->n_frames, strlen(shown));
    for (int k = 0; k < c->n_frames; k++) {
        const int got = saga_capture_frame(c, v, k)[0];

        assert_int_equal(saga_capture_has(c, v, k), shown[k] != '-');
        if (shown[k] != '-' && abs(got - grey_of(number_of(shown, k))) > 1)
            fail_msg("moment %d of %c shows grey %d", k, 'a' + v, got);
    }
}

TEST_IN_FOLDER(frames_should_be_paired_by_time_stamp)
{
    write_json(f, "", two, 2);
    write_video(f, "o.mp4", 12, 25, "-g 12 -bf 2");
    for (size_t i = 0; i < sizeof cameras / sizeof cameras[0]; i++) {
        saga_capture c;

        if (!cameras[i].always && !is_long())
            continue;
        folder_run(f, "cp o.mp4 a.mp4 && %s", cameras[i].how);
        c = load(f->path);
        assert_true(fabs(c.fps - 25) < 0.01);
        check_shown(&c, 0, cameras[i].a);
        check_shown(&c, 1, cameras[i].b);
        check_notes(&c, cameras[i].note);
        if (!cameras[i].note[0] && strstr(c.notes, "time:"))
            fail_msg("case %zu: %s", i, c.notes);
        saga_capture_free(&c);
    }
}

/* Stamps of n frames at a rate. */
static double *stamps_of(int n, double rate, double start)
{
    double *const t = malloc((size_t)n * sizeof *t);

    assert_non_null(t);
    for (int k = 0; k < n; k++)
        t[k] = start + k / rate;
    return t;
}

/* At 30 and 30000/1001 frames a second, frame k of the slow camera is taken at
 * 1.001 k. From k = 500 on that is nearest to moment k + 1, so that moment 500
 * has no frame. A start that is shared by both changes nothing. */
TEST(frames_should_be_paired_by_stamp_when_rates_drift)
{
    for (double start = 0; start < 20; start += 10) {
        saga_source s[2] = {
            { .name = "a",
              .video = NULL,
              .info = { .n_frames = 1000, .fps = 30, .steady = true } },
            { .name = "b",
              .video = NULL,
              .info = { .n_frames = 1000,
                        .fps = 30000.0 / 1001,
                        .steady = true } }
        };
        const saga_capture_options o = saga_capture_defaults();
        saga_listing l = { .sources = s, .n_sources = 2 };
        saga_error error = { "" };

        for (int i = 0; i < 2; i++)
            s[i].info.stamps = stamps_of(1000, s[i].info.fps, start);
        assert_false(saga_listing_match_videos(&l, &o, &error));
        assert_says(&error, "a has 1000 frames, b has 1001");
        free(s[1].frames);
        s[1].info.n_frames = 999;
        assert_true(saga_listing_match_videos(&l, &o, &error));
        assert_int_equal(l.n_frames, 1000);
        assert_null(s[0].frames);
        assert_int_equal(s[1].n_moments, 1000);
        for (int k = 0; k < 1000; k++)
            assert_int_equal(saga_source_frame(&s[1], k), k < 500    ? k
                                                          : k == 500 ? -1
                                                                     : k - 1);
        free(s[1].frames);
        for (int i = 0; i < 2; i++)
            free(s[i].info.stamps);
    }
}

/* The second camera began 5.25 frames after the first. Moments count from its
 * first frame, which the first camera's frame 5 precedes by a quarter of a
 * frame, so that its frame 6 is the first that is not earlier. Clocks that
 * begin anywhere, as those of MPEG streams do, tell nothing. */
TEST(starts_should_be_compared_by_stamp)
{
    for (int own = 0; own < 2; own++) {
        saga_source s[2] = {
            { .name = "a",
              .video = (char *)"a",
              .info = { .n_frames = 20, .fps = 25, .own_clock = own } },
            { .name = "b",
              .video = (char *)"b",
              .info = { .n_frames = 20, .fps = 25, .own_clock = own } }
        };
        const saga_capture_options o = saga_capture_defaults();
        saga_listing l = { .sources = s, .n_sources = 2 };
        saga_error error = { "" };

        s[0].info.stamps = stamps_of(20, 25, 1);
        s[1].info.stamps = stamps_of(20, 25, 1.21);
        s[0].info.steady = s[1].info.steady = true;
        assert_true(saga_listing_match_videos(&l, &o, &error));
        assert_true(saga_listing_late(&l, NULL, &error));
        assert_int_equal(l.n_frames, own ? 20 : 14);
        assert_int_equal(saga_source_frame(&s[0], 0), own ? 0 : 6);
        assert_true(fabs(s[0].late - (own ? 0 : 0.75)) < 1e-6);
        assert_int_equal(saga_source_frame(&s[1], 0), 0);
        assert_non_null(strstr(l.notes, own ? "from their first frames"
                                            : "begin up to 5.25 frames"));
        for (int i = 0; i < 2; i++)
            free(s[i].info.stamps);
    }
}

/* A rate in the JSON that is not the videos' is kept, and said. */
TEST(rate_of_the_json_should_be_compared_with_the_videos)
{
    saga_source s = { .name = "a", .info = { .n_frames = 3, .fps = 60 } };
    const saga_capture_options o = saga_capture_defaults();
    saga_listing l = { .sources = &s, .n_sources = 1, .fps = 24 };
    saga_error error = { "" };

    assert_true(saga_listing_match_videos(&l, &o, &error));
    assert_true(l.fps == 24);
    assert_non_null(strstr(l.notes, "\"fps\" says 24 frames per second, the "
                                    "videos have 60"));
}

/* Field i of a film with two fields a frame is grey by i. Deinterlaced at the
 * time of its first field, frame k is grey by 2 k on all lines: a line of the
 * other field lies between lines of 2 k, and in time between 2 k - 1 and
 * 2 k + 1. The first and the last frame have no neighbour. */
TEST_IN_FOLDER(interlaced_frames_should_have_no_combs)
{
    const char *const name[] = { "a.mp4" };
    FREED_BY(saga_capture_free) saga_capture c;
    bytes b = { 0 };

    for (int k = 0; k < 8; k++)
        for (int i = 0; i < 3 * W * H; i++)
            put_le(&b,
                   (uint64_t)(i < W * H ? 20 + 10 * k + 5 * (i / W % 2) : 128),
                   1);
    write_bytes(f, "raw", &b);
    folder_run(f,
               "ffmpeg -nostdin -v error -f rawvideo -pix_fmt yuv444p -s "
               "%dx%d -r 25 -i raw -vf setfield=tff -c:v libx264 -qp 0 "
               "-color_trc arib-std-b67 -flags +ildct+ilme a.mp4",
               W, H);
    write_json(f, "", name, 1);
    c = load(f->path);
    check_notes(&c, "time: interlaced");
    check_notes(&c, "colour: HDR");
    check_notes(&c, ": a (1 of 1)");
    assert_int_equal(c.n_frames, 8);
    for (int k = 1; k < 7; k++)
        for (int i = 0; i < 3 * W * H; i++)
            assert_true(abs(saga_capture_frame(&c, 0, k)[i] -
                            (4 + 10 * k) * 255 / 219) <= 2);
}

/* --- Colour -------------------------------------------------------------- */

/* Tags that are not those of a BT.709 video, and what is said of them. */
static const struct {
    const char *transfer, *primaries, *note;
} colours[] = {
    { "arib-std-b67", "bt2020", "HDR (HLG or PQ) is read as if it were SDR" },
    { "smpte2084", "bt2020", "HDR (HLG or PQ) is read as if it were SDR" },
    { "bt709", "smpte432", "wide primaries (BT.2020 or P3)" },
    { "linear", "bt709", "values are linear or logarithmic" },
    { "bt709", "bt709", NULL },
    { "unknown", "unknown", NULL },
    { "", "", NULL }
};

TEST(colours_should_be_named_by_camera_when_not_those_of_bt709)
{
    for (size_t i = 0; i < sizeof colours / sizeof colours[0]; i++) {
        saga_source s[2] = { { .name = "a", .info = { .n_frames = 1 } },
                             { .name = "b", .info = { .n_frames = 1 } } };
        const saga_capture_options o = saga_capture_defaults();
        saga_listing l = { .sources = s, .n_sources = 2 };
        saga_error error = { "" };

        snprintf(s[1].info.transfer, sizeof s[1].info.transfer, "%s",
                 colours[i].transfer);
        snprintf(s[1].info.primaries, sizeof s[1].info.primaries, "%s",
                 colours[i].primaries);
        assert_true(saga_listing_match_videos(&l, &o, &error));
        assert_int_equal(strstr(l.notes, "colour:") != NULL,
                         colours[i].note != NULL);
        if (colours[i].note) {
            assert_non_null(strstr(l.notes, colours[i].note));
            assert_non_null(strstr(l.notes, ": b (1 of 2)"));
        }
    }
}

TEST_IN_FOLDER(matrix_should_be_refused_when_unknown)
{
    if (!is_long())
        return;
    write_json(f, "", two, 1);
    write_video(f, "a.mp4", 1, 25, "-colorspace ycgco");
    refused(f->path, "a.mp4", "has the colour matrix ycgco");
}

/* RGBA, lossless: colour c of alpha a becomes c a / 255, which is 0 under alpha
 * 0 whatever the colour. Without alpha, RGB has no matrix and stays. */
TEST_IN_FOLDER(pixels_with_alpha_should_lie_over_black)
{
    const char *const name[] = { "a.mov" };

    write_json(f, "", name, 1);
    for (int alpha = is_long() ? 0 : 1; alpha < 2; alpha++) {
        saga_capture c;
        bytes b = { 0 };

        for (int i = 0; i < 4 * W * H; i++)
            put_le(&b, (uint64_t)(i * 7 % 256), 1);
        write_bytes(f, "raw", &b);
        folder_run(f,
                   "ffmpeg -nostdin -v error -f rawvideo -pix_fmt %s -s "
                   "%dx%d -i raw -frames:v 1 -c:v png -y a.mov",
                   alpha ? "rgba" : "rgb24", W, H);
        c = load(f->path);
        assert_int_equal(strstr(c.notes, "alpha:") != NULL, alpha);
        assert_null(strstr(c.notes, "matrix"));
        for (int i = 0; i < 3 * W * H; i++) {
            const int at = alpha ? 4 * (i / 3) + i % 3 : i;
            const int a = alpha ? (4 * (i / 3) + 3) * 7 % 256 : 255;

            assert_int_equal(saga_capture_frame(&c, 0, 0)[i],
                             (at * 7 % 256 * a + 127) / 255);
        }
        saga_capture_free(&c);
    }
}

/* --- Rotation ------------------------------------------------------------ */

/* Writes a display matrix (a b, c d) into the header of an MP4's track, 40
 * bytes behind its name "tkhd", as 16.16. */
static void set_matrix(folder *f, const char *name, const int m[4])
{
    FREED_BY(saga_bytes_free) saga_bytes all;
    static const int at[4] = { 0, 4, 12, 16 };
    size_t k = 0;

    assert_done(saga_read_file(&all, folder_file(f, name), &error));
    while (memcmp(all.data + k, "tkhd", 4) != 0)
        assert_true(++k + 80 < all.nbytes);
    for (int i = 0; i < 4; i++)
        for (int j = 0; j < 4; j++)
            all.data[k + 44 + (size_t)(at[i] + j)] =
                (uint8_t)((uint32_t)(m[i] * 65536) >> (24 - 8 * j));
    write_part(f, name, &(bytes){ all.data, all.nbytes, all.nbytes },
               all.nbytes);
}

/* Returns the stored pixel that is shown at (x, y): a pixel at (sx, sy) from
 * the picture's middle is shown at (a sx + c sy, b sx + d sy) from it. */
static const uint8_t *shown_from(const uint8_t *stored, const int m[4], int x,
                                 int y)
{
    const bool swaps = m[0] == 0;
    const int w = swaps ? H : W, h = swaps ? W : H;
    const int dx = 2 * x - (w - 1), dy = 2 * y - (h - 1);
    const int sx = m[0] * dx + m[1] * dy + W - 1;
    const int sy = m[2] * dx + m[3] * dy + H - 1;

    return stored + 3 * (sy / 2 * W + sx / 2);
}

/* Loads a video of W x H with a matrix for a calibration of `top`. */
static saga_capture load_turned(folder *f, const int m[4], const char *top,
                                const char *note)
{
    const char *const name[] = { "a.mp4" };
    saga_capture c;

    folder_run(f, "cp s.mp4 a.mp4");
    set_matrix(f, "a.mp4", m);
    write_json(f, top, name, 1);
    c = load(f->path);
    check_notes(&c, note);
    return c;
}

static void check_turn(folder *f, const saga_capture *stored, const int m[4],
                       const char *top, const char *note)
{
    const int w = m[0] == 0 ? H : W;
    saga_capture c = load_turned(f, m, top, note);

    assert_int_equal(c.views[0].width, w);
    for (int i = 0; i < W * H; i++)
        assert_memory_equal(
            saga_capture_frame(&c, 0, 0) + 3 * i,
            shown_from(saga_capture_frame(stored, 0, 0), m, i % w, i / w), 3);
    saga_capture_free(&c);
}

/* The calibration's size decides on quarter turns. Where it tells nothing,
 * videos are shown turned, as OpenCV and players do. */
TEST_IN_FOLDER(videos_should_be_turned_as_the_calibration_says)
{
    static const int clockwise[4] = { 0, 1, -1, 0 };
    static const int anticlockwise[4] = { 0, -1, 1, 0 };
    static const int half[4] = { -1, 0, 0, -1 };
    static const char lies[] = "\"w\": 32, \"h\": 16, ";
    static const char stands[] = "\"w\": 16, \"h\": 32, ";
    FREED_BY(saga_capture_free) saga_capture s;

    folder_run(f,
               "ffmpeg -nostdin -v error -f lavfi -i testsrc=s=%dx%d "
               "-frames:v 1 -c:v libx264 -pix_fmt yuv444p -qp 0 s.mp4",
               W, H);
    s = load_turned(f, clockwise, lies, "as they are stored");
    assert_int_equal(s.views[0].width, W);
    check_turn(f, &s, clockwise, stands, "by 90 degrees clockwise");
    if (!is_long())
        return;
    check_turn(f, &s, anticlockwise, "", "by 90 degrees anticlockwise");
    check_turn(f, &s, half, lies, "by 180 degrees");
    folder_run(f, "cp s.mp4 a.mp4");
    set_matrix(f, "a.mp4", (int[4]){ 1, 1, -1, 1 });
    refused(f->path, "a.mp4", "no multiple of 90 degrees");
}

/* --- Strangers ----------------------------------------------------------- */

/* A playlist may name any file or address; its format is named, whatever the
 * file is called. */
TEST_IN_FOLDER(playlists_should_be_refused_by_name)
{
    static const char *const lists[][2] = {
        { "ffconcat version 1.0\nfile b.mp4\n", "\"concat\"" },
        { "#EXTM3U\n#EXT-X-TARGETDURATION:5\n#EXTINF:5,\nb.mp4\n#EXT-X-ENDLIST",
          "\"hls\"" },
    };
    const char *const name[] = { "a.mp4" };

    write_json(f, "", name, 1);
    for (size_t i = 0; i < sizeof lists / sizeof lists[0]; i++) {
        write_text(f, "a.mp4", lists[i][0]);
        refused(f->path, lists[i][1], "can name other files");
    }
}

/* Nothing that is not a picture of the film is taken for it: a file of sound
 * with a cover picture has no video. */
TEST_IN_FOLDER(cover_pictures_should_be_no_video)
{
    const char *const name[] = { "a.mp4" };

    if (!is_long())
        return;
    folder_run(f,
               "ffmpeg -nostdin -v error -f lavfi -i sine=d=0.1 -f lavfi -i "
               "testsrc=s=%dx%d:d=0.04 -map 0 -map 1 -frames:v 1 -c:v png "
               "-disposition:v attached_pic a.mp4",
               W, H);
    write_json(f, "", name, 1);
    refused(f->path, "a.mp4", "has no video stream");
}
