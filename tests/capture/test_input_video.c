/* SPDX-License-Identifier: MIT
 *
 * Video through ffmpeg. Frames made here and stored without loss must come back
 * in the right order, number and colour. Cameras that do not fit together, and
 * files that cannot be decoded, are refused.
 */
#include "load.h"
#include "video.h"
#include "video_files.h"

static const char *const two[] = { "a.mp4", "b.mp4" };

/* --- Frames -------------------------------------------------------------- */

static void check_frames(const saga_capture *c, int first, int n)
{
    assert_int_equal(c->n_frames, n);
    assert_int_equal(c->first_frame, first);
    for (int v = 0; v < c->n_views; v++)
        for (int k = 0; k < n; k++)
            for (int i = 0; i < 3 * W * H; i++)
                assert_true(abs(saga_capture_frame(c, v, k)[i] -
                                grey_of(first + k)) <= 1);
}

TEST_IN_FOLDER(video_should_give_its_frames_in_order)
{
    saga_capture_options o = saga_capture_defaults();
    saga_capture c;

    write_video(f, "a.mp4", 12, 25, "-bf 3");
    write_video(f, "b.mp4", 12, 25, "-g 1");
    write_json(f, "", two, 2);
    c = load(f->path);
    assert_int_equal(c.n_views, 2);
    assert_string_equal(c.views[0].name, "a");
    assert_true(c.fps == 25);
    assert_true(strstr(c.notes, "without a matrix tag") != NULL);
    check_frames(&c, 0, 12);
    saga_capture_free(&c);
    o.first_frame = 3;
    o.end_frame = 7;
    c = load_with(f->path, &o);
    check_frames(&c, 3, 4);
    saga_capture_free(&c);
    o.end_frame = 13;
    refused_with(f->path, &o, f->path,
                 "--frames 3:13 is not in the capture's "
                 "12 frames");
    o.end_frame = 3;
    refused_with(f->path, &o, f->path, "--frames 3:3 is empty");
}

TEST_IN_FOLDER(video_should_give_the_same_for_any_threads)
{
    saga_capture_options o = saga_capture_defaults();
    saga_capture a, b;

    folder_run(f,
               "ffmpeg -nostdin -v error -f lavfi -i testsrc=s=%dx%d:r=10:"
               "d=0.5 -c:v libx264 a.mp4 && cp a.mp4 b.mp4",
               W, H);
    write_json(f, "", two, 2);
    o.n_threads = 1;
    a = load_with(f->path, &o);
    o.n_threads = 2;
    b = load_with(f->path, &o);
    for (int v = 0; v < 2; v++)
        assert_memory_equal(a.views[v].rgb, b.views[v].rgb, 5 * 3 * W * H);
    saga_capture_free(&a);
    saga_capture_free(&b);
}

/* --- Colour -------------------------------------------------------------- */

static double bounded(double x)
{
    return fmin(fmax(x, 0), 255);
}

/* Y'CbCr to R'G'B' from a matrix's kr and kb (BT.601, BT.709), by its
 * definition: Y = kr R + kg G + kb B, Cb = (B - Y) / (2 (1 - kb)). */
static void convert(double out[3], const double ycc[3], double kr, double kb,
                    bool full)
{
    const double y = full ? ycc[0] : (ycc[0] - 16) * 255 / 219;
    const double s = full ? 1 : 255.0 / 224;
    const double cb = (ycc[1] - 128) * s, cr = (ycc[2] - 128) * s;
    const double r = y + 2 * (1 - kr) * cr, b = y + 2 * (1 - kb) * cb;

    out[0] = bounded(r);
    out[1] = bounded((y - kr * r - kb * b) / (1 - kr - kb));
    out[2] = bounded(b);
}

static void check_colour(folder *f, const char *tags, double kr, double kb,
                         bool full)
{
    static const double colours[4][3] = {
        { 90, 110, 160 }, { 150, 160, 100 }, { 60, 128, 140 }, { 200, 120, 128 }
    };
    const char *const name[] = { "c.mp4" };
    FREED_BY(saga_capture_free) saga_capture c;
    bytes b = { 0 };

    for (int k = 0; k < 4; k++)
        for (int i = 0; i < 3 * W * H; i++)
            put_le(&b, (uint64_t)colours[k][i / (W * H)], 1);
    write_bytes(f, "raw", &b);
    folder_run(f,
               "ffmpeg -nostdin -v error -f rawvideo -pix_fmt yuv444p "
               "%s -s %dx%d -r 5 -i raw -c:v libx264 -qp 0 %s -y c.mp4",
               tags, W, H, tags);
    write_json(f, "", name, 1);
    c = load(f->path);
    assert_int_equal(strstr(c.notes, "without a matrix tag") != NULL, !*tags);
    for (int k = 0; k < 4; k++) {
        double rgb[3];

        convert(rgb, colours[k], kr, kb, full);
        for (int i = 0; i < 3; i++)
            assert_true(fabs(saga_capture_frame(&c, 0, k)[i] - rgb[i]) < 1.5);
    }
}

TEST_IN_FOLDER(colour_should_follow_the_tags)
{
    check_colour(f, "", 0.2126, 0.0722, false);
    check_colour(f, "-colorspace smpte170m", 0.299, 0.114, false);
    check_colour(f, "-colorspace bt709 -color_range pc", 0.2126, 0.0722, true);
    check_colour(f, "-colorspace bt2020nc", 0.2627, 0.0593, false);
}

/* --- Refusing ------------------------------------------------------------ */

TEST_IN_FOLDER(videos_should_be_refused_when_counts_differ)
{
    saga_capture_options o = saga_capture_defaults();
    saga_capture c;

    write_video(f, "a.mp4", 6, 25, "");
    write_video(f, "b.mp4", 4, 25, "");
    write_json(f, "", two, 2);
    refused(f->path, "b.mp4: unequal frame counts: b has 4 frames, a has 6",
            "--frames 0:4");
    o.end_frame = 4;
    c = load_with(f->path, &o);
    check_frames(&c, 0, 4);
    saga_capture_free(&c);
    o.end_frame = 5;
    refused_with(f->path, &o, "b.mp4", "unequal frame counts");
    /* If a delay is given, videos of different lengths must be accepted, and
     * frame k of b must be paired with frame k + 1 of a. */
    o.end_frame = 0;
    o.late = "a=1";
    c = load_with(f->path, &o);
    assert_int_equal(c.n_frames, 3);
    assert_non_null(strstr(c.notes, "b has 4 frames, a has 6"));
    saga_capture_free(&c);
    o.late = NULL;
    o.any_length = true;
    assert_done(saga_capture_look(&c, f->path, &o, &error));
    assert_int_equal(c.n_frames, 4);
}

TEST_IN_FOLDER(videos_should_be_refused_when_rates_differ)
{
    write_video(f, "a.mp4", 4, 25, "");
    write_video(f, "b.mp4", 4, 30, "");
    write_json(f, "", two, 2);
    refused(f->path, "b.mp4", "has 30 frames per second, a has 25");
}

/* Checks whether two videos of n frames with different rates are accepted, in
 * both orders. */
static void check_rates(double a, double b, int n, int end, bool pass)
{
    for (int turned = 0; turned < 2; turned++) {
        saga_source s[2] = {
            { .name = "a", .info = { .n_frames = n, .fps = turned ? b : a } },
            { .name = "b", .info = { .n_frames = n, .fps = turned ? a : b } }
        };
        saga_capture_options o = saga_capture_defaults();
        saga_listing l = { .sources = s, .n_sources = 2 };
        saga_error error = { "" };

        o.end_frame = end;
        assert_int_equal(saga_listing_match_videos(&l, &o, &error), pass);
        if (!pass)
            assert_says(&error, "frames per second");
    }
}

/* At 30 and 30000/1001 frames a second, the difference grows by a thousandth of
 * a frame with each frame. Frame 499 is 0.499 frames from its counterpart;
 * frame 500 is half a frame from it, so that the next frame would fit equally
 * well. The rates must be accepted up to frame 499. */
TEST(rates_should_differ_by_less_than_half_a_frame_at_the_end)
{
    const double ntsc = 30000.0 / 1001.0;

    check_rates(30, 30, 100000, 0, true);
    check_rates(0, 0, 100, 0, true); /* unknown */
    check_rates(30, ntsc, 500, 0, true);
    check_rates(30, ntsc, 502, 0, false);
    check_rates(30, ntsc, 100000, 0, false);
    check_rates(30, ntsc, 100000, 500, true);
    /* Containers round times to milliseconds, so that 600 frames may take
     * 20.000 or 20.001 s. */
    check_rates(600 / 20.0, 600 / 20.001, 600, 0, true);
    /* Different nominal rates must be refused even for short videos. */
    check_rates(24, 25, 2, 0, false);
}

TEST_IN_FOLDER(video_should_be_refused_when_it_is_missing_or_no_video)
{
    write_video(f, "a.mp4", 4, 25, "");
    write_json(f, "", two, 2);
    refused(f->path, "b.mp4", "video is missing");
    write_text(f, "b.mp4", "moving pictures");
    refused(f->path, "b.mp4", "is not a video that ffprobe can read");
    write_text(f, "b.mp4", "");
    refused(f->path, "b.mp4", "is not a video that ffprobe can read");
    folder_run(f, "ffmpeg -nostdin -v error -f lavfi -i sine=d=0.1 -y b.mp4");
    refused(f->path, "b.mp4", "has no video stream");
}

/* One file is cut, another has changed bytes in its middle. */
TEST_IN_FOLDER(video_should_be_refused_when_it_is_damaged)
{
    const char *const name[] = { "a.mkv" };
    FREED_BY(saga_bytes_free) saga_bytes all;
    bytes part;

    folder_run(f,
               "ffmpeg -nostdin -v error -f lavfi -i testsrc=s=%dx%d:r=10:"
               "d=1 -c:v libx264 -g 2 -t 1 a.mkv",
               8 * W, 8 * H);
    assert_done(saga_read_file(&all, folder_file(f, "a.mkv"), &error));
    part = (bytes){ all.data, all.nbytes, all.nbytes };
    write_json(f, "", name, 1);
    write_part(f, "a.mkv", &part, all.nbytes * 3 / 4);
    refused(f->path, "a.mkv", "encode the video again");
    for (size_t i = all.nbytes / 2; i < all.nbytes / 2 + 400; i++)
        all.data[i] ^= 0x55;
    write_part(f, "a.mkv", &part, all.nbytes);
    refused(f->path, "a.mkv", "encode the video again");
}

/* No name may be understood as an option, a protocol or a part of a command. */
TEST_IN_FOLDER(video_should_be_found_whatever_its_name)
{
    static const char *const odd[] = { "-a;'b $(c).mp4", "concat:d|e.mp4" };
    FREED_BY(saga_capture_free) saga_capture c;

    write_video(f, "a.mp4", 3, 25, "");
    folder_run(f, "cp a.mp4 \"./-a;'b \\$(c).mp4\" && cp a.mp4 "
                  "'concat:d|e.mp4'");
    write_json(f, "", odd, 2);
    c = load(f->path);
    check_frames(&c, 0, 3);
    assert_string_equal(c.views[0].name, "-a;'b $(c)");
}

static bool stop_at_once(void *user, double done, const char *doing)
{
    (void)done;
    (void)doing;
    ++*(int *)user;
    return false;
}

TEST_IN_FOLDER(loading_should_stop_when_told)
{
    saga_capture_options o = saga_capture_defaults();
    saga_error error;
    saga_capture c;
    int calls = 0;

    write_video(f, "a.mp4", 3, 25, "");
    folder_run(f, "cp a.mp4 b.mp4");
    write_json(f, "", two, 2);
    o.n_threads = 1;
    o.progress = stop_at_once;
    o.progress_user = &calls;
    assert_false(saga_capture_load(&c, f->path, &o, &error));
    assert_says(&error, "cancelled");
    assert_int_equal(calls, 1);
}

/* The memory needed is 32 x 16 x 3 x 12 bytes of pictures and one decoded
 * picture with its depth, 7 bytes per pixel: 22,016. One byte less must be
 * refused, and the remedies that the message names must work. */
TEST_IN_FOLDER(loading_should_be_refused_when_memory_is_short)
{
    saga_capture_options o = saga_capture_defaults();
    saga_capture c;

    write_video(f, "a.mp4", 12, 25, "");
    write_json(f, "", two, 1);
    o.n_threads = 1;
    o.memory_nbytes = 22016;
    c = load_with(f->path, &o);
    saga_capture_free(&c);
    o.memory_nbytes = 22015;
    refused_with(f->path, &o, "1 cameras x 12 frames of 32 x 16",
                 "use --scale 1/2, --frames 0:11, or");
    o.end_frame = 11;
    c = load_with(f->path, &o);
    saga_capture_free(&c);
    o.end_frame = 0;
    o.scale = 2;
    c = load_with(f->path, &o);
    saga_capture_free(&c);
}

/* --- The scratch file ---------------------------------------------------- */

/* Compares all pictures and masks, read by several threads. The pictures of b
 * must be as filmed before, if that is said, and RGB after. */
static void check_equal(const saga_capture *a, const saga_capture *b,
                        bool as_filmed)
{
    const int n = a->n_frames;
    int n_wrong = 0;

    assert_int_equal(b->n_frames, n);
    for (int v = 0; v < a->n_views; v++) {
        assert_null(a->views[v].as_filmed);
        assert_true((b->views[v].as_filmed != NULL) == as_filmed);
        assert_true(a->views[v].digest == b->views[v].digest);
        for (int k = 0; as_filmed && k < n; k++)
            assert_int_equal(b->views[v].as_filmed[k], 1);
        assert_int_equal(!a->views[v].mask, !b->views[v].mask);
    }
#pragma omp parallel for num_threads(4) reduction(+ : n_wrong)
    for (int i = 0; i < 2 * n * a->n_views; i++) {
        const int v = i / 2 / n, k = i / 2 % n;
        const size_t size = saga_view_frame_nbytes(&a->views[v]);
        const uint8_t *const mask = saga_capture_mask(a, v, k);

        n_wrong += memcmp(saga_capture_frame(a, v, k),
                          saga_capture_frame(b, v, k), size) != 0;
        n_wrong += mask &&
                   memcmp(mask, saga_capture_mask(b, v, k), size / 3) != 0;
    }
    assert_int_equal(n_wrong, 0);
    for (int k = 0; as_filmed && k < n; k++)
        assert_int_equal(b->views[0].as_filmed[k], 0);
}

/* Pictures in a file must be those in memory, for every way in which a video is
 * read (test_filmed.c compares them with ffmpeg). */
TEST_IN_FOLDER(scratch_should_hold_what_memory_holds)
{
    static const struct {
        const char *pixels, *more;
        int scale;
        bool mask, as_filmed;
    } given[] = {
        { "yuv420p", "-colorspace bt709 -color_range tv", 1, false, true },
        { "yuv420p", "-colorspace smpte170m -color_range pc", 1, false, true },
        { "yuv420p10le", "", 1, false, true },
        { "yuv420p", "-colorspace bt2020nc", 2, false, false },
        { "yuv420p", "", 1, true, false },
        { "yuv444p", "", 1, false, false },
    };

    for (size_t i = 0; i < sizeof given / sizeof *given; i++) {
        FREED_BY(saga_capture_free) saga_capture a, b;
        saga_capture_options o = saga_capture_defaults();

        folder_run(f,
                   "rm -rf masks && ffmpeg -nostdin -v error -y -f lavfi -i "
                   "testsrc2=s=%dx%d:r=10:d=0.6 -pix_fmt %s %s -c:v libx264 "
                   "a.mp4 && cp a.mp4 b.mp4",
                   W, H, given[i].pixels, given[i].more);
        if (given[i].mask)
            folder_run(f,
                       "mkdir masks && ffmpeg -nostdin -v error -y -f lavfi -i "
                       "color=white:s=%dx%d,format=gray,pad=%d:%d "
                       "-frames:v 1 masks/a.png && cp masks/a.png masks/b.png",
                       W / 2, H, W, H);
        write_json(f, "", two, 2);
        o.first_frame = 1;
        o.n_threads = 2;
        o.scale = given[i].scale;
        a = load_with(f->path, &o);
        o.scratch = f->path;
        b = load_with(f->path, &o);
        assert_null(a.pixels.at);
        assert_int_equal(b.pixels.nbytes, b.picture_nbytes);
        check_equal(&a, &b, given[i].as_filmed);
    }
}

/* Only a file's pages are beyond the budget: with one, 7 bytes a pixel suffice
 * for a thread, and pictures that are few stay in memory. */
TEST_IN_FOLDER(scratch_should_not_count_in_the_budget)
{
    const uint64_t nbytes = 12 * 3 * W * H;
    saga_capture_options o = saga_capture_defaults();
    saga_capture c;

    write_video(f, "a.mp4", 12, 25, "");
    write_json(f, "", two, 1);
    o.n_threads = 1;
    o.memory_nbytes = 7 * W * H;
    refused_with(f->path, &o, f->path, "--memory");
    o.scratch = f->path;
    o.little_nbytes = nbytes - 1;
    c = load_with(f->path, &o);
    assert_int_equal(c.pixels.nbytes, nbytes);
    check_frames(&c, 0, 12);
    saga_capture_free(&c);
    o.memory_nbytes--;
    refused_with(f->path, &o, f->path, "--memory");
    o.memory_nbytes = 1 << 20;
    o.little_nbytes = nbytes;
    c = load_with(f->path, &o);
    assert_null(c.pixels.at);
    saga_capture_free(&c);
    o.little_nbytes = 0;
    o.scratch = "/no/such/folder";
    refused_with(f->path, &o, o.scratch, "--scratch");
}
