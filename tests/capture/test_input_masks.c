/* SPDX-License-Identifier: MIT
 *
 * Masks: the tests check which pixels count, for every place in a capture that
 * can say so, and that the value of other pixels has no effect on those that
 * count. They also check cameras that are late by a fraction of a frame.
 */
#include "picture_files.h"
#include "video_files.h"

enum { N_VIEWS = 2, N_FRAMES = 3 };

/* Returns the grey of a picture; each picture has only one. */
static int grey(int view, int frame)
{
    return 40 + 60 * view + 20 * frame;
}

static void write_capture(folder *f, const char *root, const char *also)
{
    bytes b = { 0 };
    char name[80];

    put_text(&b, "{\"fl_x\": 30, \"fps\": 10, \"frames\": [");
    for (int v = 0; v < N_VIEWS; v++) {
        folder_run(f, "mkdir -p %s/cam%d", root, v);
        for (int k = 0; k < N_FRAMES; k++) {
            snprintf(name, sizeof name, "%s/cam%d/%d.png", root, v, k);
            write_grey(f, name, W, H, grey(v, k), grey(v, k));
            put_text(&b,
                     "%s{\"file_path\": \"%s\", \"time\": %g%s, "
                     "\"transform_matrix\": [[1,0,0,%d],[0,1,0,0],[0,0,1,0]]}",
                     v || k ? ", " : "", name, k / 10.0,
                     v == 0 && k == 1 ? also : "", v);
        }
    }
    put_text(&b, "]}");
    write_bytes(f, "transforms.json", &b);
}

/* Checks a picture whose left half is masked and was replaced by the given
 * grey, and whose right half counts. */
static void check_left(const saga_capture *c, int view, int frame, int left)
{
    const uint8_t *const mask = saga_capture_mask(c, view, frame);
    const uint8_t *const rgb = saga_capture_frame(c, view, frame);
    const int w = c->views[view].width, h = c->views[view].height;

    assert_non_null(mask);
    for (int i = 0; i < w * h; i++) {
        assert_int_equal(mask[i], i % w >= w / 2);
        assert_int_equal(rgb[3 * i], mask[i] ? grey(view, frame) : left);
    }
}

static void check_whole(const saga_capture *c, int view, int frame)
{
    const uint8_t *const mask = saga_capture_mask(c, view, frame);
    const uint8_t *const rgb = saga_capture_frame(c, view, frame);

    for (int i = 0; i < W * H; i++) {
        assert_true(!mask || mask[i] == 1);
        assert_int_equal(rgb[3 * i], grey(view, frame));
    }
}

/* Checks a capture in which frame 1 of camera 0 is masked. Of the two
 * neighbours, which are equally near, the earlier one replaces it. */
static void check_one(folder *f)
{
    FREED_BY(saga_capture_free) saga_capture c = load(f->path);

    check_whole(&c, 0, 0);
    check_left(&c, 0, 1, grey(0, 0));
    check_whole(&c, 0, 2);
    assert_null(saga_capture_mask(&c, 1, 0));
    check_whole(&c, 1, 1);
    assert_non_null(strstr(c.notes, "masks: 1 of 6"));
}

TEST_IN_FOLDER(masks_should_be_found_beside_pictures)
{
    static const char *const names[] = { "masks/cam0/1.png",
                                         "masks/cam0/1.png.png" };

    write_capture(f, "images", "");
    folder_run(f, "mkdir -p masks/cam0");
    for (int i = 0; i < 2; i++) {
        write_grey(f, names[i], W, H, 0, 255);
        check_one(f);
        folder_run(f, "rm %s", names[i]);
    }
    folder_run(f, "mkdir -p m; rm -r masks");
    write_grey(f, "m/one.png", W, H, 100, 200);
    write_capture(f, "images", ", \"mask_path\": \"m/one.png\"");
    check_one(f);
    /* Masks are also found if the pictures' folder is not images/. */
    folder_run(f, "mkdir -p masks/p/cam0");
    write_grey(f, "masks/p/cam0/1.png", W, H, 0, 255);
    write_capture(f, "p", "");
    check_one(f);
}

/* A pixel that is masked in all frames must become black. */
TEST_IN_FOLDER(mask_should_be_of_all_frames_when_it_is_the_cameras)
{
    saga_capture_options o = saga_capture_defaults();
    saga_capture c;
    uint8_t rgb[3 * W * H];

    write_capture(f, "images", "");
    folder_run(f, "mkdir -p masks/cam1");
    write_grey(f, "masks/cam1.png", W, H, 0, 255);
    write_grey(f, "masks/cam1/2.png", W, H, 255, 255);
    c = load(f->path);
    check_left(&c, 1, 0, grey(1, 2));
    check_left(&c, 1, 1, grey(1, 2));
    check_whole(&c, 1, 2);
    memset(rgb, 7, sizeof rgb);
    assert_true(saga_capture_forgive(&c, 1, 0, rgb) == 0.5);
    assert_true(rgb[0] == grey(1, 2) && rgb[3 * (W - 1)] == 7);
    assert_true(saga_capture_forgive(&c, 0, 0, rgb) == 1.0);
    saga_capture_free(&c);
    folder_run(f, "rm -r masks/cam1");
    write_grey(f, "masks/cam1.png", W, H, 0, 255);
    o.scale = 2;
    c = load_with(f->path, &o);
    check_left(&c, 1, 1, 0);
    saga_capture_free(&c);
    o.scale = 1;
    o.memory_nbytes = 1000;
    refused_with(f->path, &o, f->path, "--memory");
}

/* The forecast must be 3 bytes for each pixel and frame, one more for cameras
 * with masks, and a thread's work: 7 bytes a pixel for a picture and its depth,
 * and for a mask 4 of opacity and 3 of scaled samples. */
TEST_IN_FOLDER(masks_should_count_in_the_forecast_of_memory)
{
    saga_capture_options o = saga_capture_defaults();
    saga_capture c;

    write_capture(f, "images", "");
    folder_run(f, "mkdir -p masks");
    write_grey(f, "masks/cam1.png", W, H, 0, 255);
    c = load(f->path);
    o.n_threads = 1;
    o.memory_nbytes =
        (uint64_t)(W * H * ((3 * c.n_views + 1) * c.n_frames + 7 + 4 + 3));
    saga_capture_free(&c);
    c = load_with(f->path, &o);
    saga_capture_free(&c);
    o.memory_nbytes--;
    refused_with(f->path, &o, f->path, "--memory");
}

/* A mask may have any two values, of 8 or 16 bits, in grey or in a colour; the
 * larger one counts, and so does a single value except 0. */
TEST_IN_FOLDER(mask_of_any_two_values_should_work)
{
    static const struct {
        int bits, left, right, whole;
    } kinds[] = {
        { 8, 0, 1, 0 },          { 8, 0, 2, 0 },     { 8, 0, 255, 0 },
        { 8, 3, 4, 0 },          { 8, 200, 250, 0 }, { 16, 0, 1, 0 },
        { 16, 0, 255, 0 },       { 16, 0, 256, 0 },  { 16, 0, 65535, 0 },
        { 16, 65278, 65535, 0 }, { 8, 1, 1, 1 },     { 16, 1, 1, 1 },
        { 8, 255, 255, 1 },
    };
    uint8_t rgb[3 * W * H] = { 0 };

    write_capture(f, "images", "");
    folder_run(f, "mkdir -p masks");
    for (size_t i = 0; i <= sizeof kinds / sizeof kinds[0]; i++) {
        FREED_BY(saga_capture_free) saga_capture c = { 0 };
        const int k = i < sizeof kinds / sizeof kinds[0] ? (int)i : 0;
        uint16_t grey16[W * H];

        for (int p = 0; p < W * H; p++) {
            grey16[p] = (uint16_t)(p % W < W / 2 ? kinds[k].left
                                                 : kinds[k].right);
            rgb[3 * p + 1] = p % W < W / 2 ? 0 : 255; /* green */
        }
        if (k < (int)i)
            assert_done(saga_png_write(folder_file(f, "masks/cam1.png"), W, H,
                                       rgb, &error));
        else if (kinds[k].bits == 8)
            write_grey(f, "masks/cam1.png", W, H, kinds[k].left,
                       kinds[k].right);
        else
            assert_done(saga_png_write_grey(folder_file(f, "masks/cam1.png"), W,
                                            H, grey16, &error));
        c = load(f->path);
        if (kinds[k].whole)
            check_whole(&c, 1, 0);
        else
            check_left(&c, 1, 0, 0);
    }
    write_grey(f, "masks/cam1.png", W, H, 0, 0);
    refused(f->path, "masks/cam1.png", "leaves no pixel of camera cam1");
}

/* Ways to store the opacity of a still or of a video; the last ones are only
 * tried if SAGA_TEST_LONG is set. */
static const struct {
    const char *name, *codec;
    int most; /* difference of colours, which may be lossy */
} stored[] = {
    { "a.png", "png", 0 },
    { "a.mov", "qtrle", 0 },
    { "a.webm", "libvpx-vp9 -lossless 1 -pix_fmt yuva420p", 1 },
    { "b.webm", "libvpx -crf 4 -b:v 2M -pix_fmt yuva420p -auto-alt-ref 0", 3 },
    { "b.mov", "prores_ks -profile:v 4444 -pix_fmt yuva444p10le", 3 },
    { "a.mkv", "ffv1 -pix_fmt yuva444p", 1 },
    { "b.mkv", "ffv1 -pix_fmt bgra", 0 },
};
enum { N_STORED = sizeof stored / sizeof *stored, N_ALWAYS = 2 };

/* Writes two frames of alpha 0, 127, 128 and 255, a quarter of the columns
 * each, and of grey 40 under alpha 0, 200 elsewhere, in all ways. */
static int write_opacities(folder *f)
{
    const int n = getenv("SAGA_TEST_LONG") ? N_STORED : N_ALWAYS;
    char all[1200];
    int used = 0;

    for (int i = 0; i < n; i++)
        used += snprintf(all + used, sizeof all - (size_t)used,
                         " -frames:v %d -c:v %s %s", i ? 2 : 1, stored[i].codec,
                         stored[i].name);
    folder_run(f,
               "ffmpeg -nostdin -v error -y -f lavfi -i \"color=s=%dx%d:r=5,"
               "format=rgba,geq=r='if(lt(X,8),40,200)':g='if(lt(X,8),40,200)':"
               "b='if(lt(X,8),40,200)':"
               "a='if(lt(X,8),0,if(lt(X,16),127,if(lt(X,24),128,255)))'\"%s",
               W, H, all);
    return n;
}

static void check_opacities(folder *f, int i, bool masks)
{
    static const int opacity[4] = { 0, 127, 128, 255 };
    saga_capture_options o = saga_capture_defaults();

    o.alpha_masks = masks;
    FREED_BY(saga_capture_free) saga_capture c = load_with(f->path, &o);
    assert_int_equal(c.views[0].mask != NULL, masks);
    for (int k = 0; k < c.n_frames * W * H; k++) {
        const int quarter = k % W / 8, a = opacity[quarter];
        const int grey = masks ? quarter < 2 ? 0 : 200 : (200 * a + 127) / 255;

        if ((masks && c.views[0].mask[k] != (quarter > 1)) ||
            abs(c.views[0].rgb[3 * k] - grey) > stored[i].most)
            fail_msg("%s, masks %d: pixel %d is %d, not %d", stored[i].name,
                     masks, k, c.views[0].rgb[3 * k], grey);
    }
}

/* In stills and videos alike, pixels of alpha 128 to 254 must count with the
 * colour in the file, not with that over black, and other colours must have no
 * effect; and a picture that is transparent is no picture. */
TEST_IN_FOLDER(alpha_should_leave_no_dark_fringe)
{
    saga_capture_options o = saga_capture_defaults();
    const int n = write_opacities(f);

    for (int i = 0; i < n; i++) {
        write_json(f, "", &stored[i].name, 1);
        check_opacities(f, i, false);
        check_opacities(f, i, true);
    }
    folder_run(f, "ffmpeg -nostdin -v error -y -i a.png -frames:v 1 -vf "
                  "lutrgb=a=127 -c:v png a.mov");
    o.alpha_masks = true;
    write_json(f, "", (const char *[]){ "a.mov" }, 1);
    refused_with(f->path, &o, "a.mov", "leaves no pixel");
}

TEST_IN_FOLDER(alpha_should_be_a_mask_when_wanted)
{
    saga_capture_options o = saga_capture_defaults();
    saga_capture c;

    write_capture(f, "images", "");
    folder_run(f,
               "ffmpeg -nostdin -v error -y -i images/cam0/1.png -vf "
               "\"format=rgba,geq=r='r(X,Y)':g='g(X,Y)':b='b(X,Y)':"
               "a='if(lt(X,16),0,255)'\" a.png && mv a.png images/cam0/1.png");
    c = load(f->path);
    assert_null(saga_capture_mask(&c, 0, 1));
    assert_int_equal(saga_capture_frame(&c, 0, 1)[0], 0); /* over black */
    saga_capture_free(&c);
    o.alpha_masks = true;
    c = load_with(f->path, &o);
    check_left(&c, 0, 1, grey(0, 0));
    check_whole(&c, 0, 0);
    check_whole(&c, 1, 1);
    saga_capture_free(&c);
}

TEST_IN_FOLDER(mask_should_be_refused_when_wrong)
{
    write_capture(f, "images", "");
    folder_run(f, "mkdir -p masks/cam0");
    write_grey(f, "masks/cam0/1.png", W / 2, H, 0, 255);
    refused(f->path, "masks/cam0/1.png", "is 16 x 16 pixels, expected 32 x 16");
    write_text(f, "masks/cam0/1.png", "no picture");
    refused(f->path, "masks/cam0/1.png", "is not a PNG");
    folder_run(f, "rm -r masks");
    write_capture(f, "images", ", \"mask_path\": \"none.png\"");
    refused(f->path, "none.png", "cannot be opened");
    write_capture(f, "images", ", \"mask_path\": 7");
    refused(f->path, "transforms.json", "\"mask_path\" in frames[1]");
}

/* Camera 1 runs 1.25 frames late: its second picture was taken 3/4 of a frame
 * after the first picture of camera 0 that is kept. Of each delay, the whole
 * frames must be removed by shifting, and the rest must remain as the view's
 * delay. */
TEST_IN_FOLDER(parts_of_a_frame_should_be_kept)
{
    static const struct {
        const char *late;
        int n_frames, first[N_VIEWS];
        double rest[N_VIEWS];
    } t[] = {
        { "cam1=0.25", 2, { 0, 1 }, { 0, 0.75 } },
        { "cam1=1.25", 1, { 0, 2 }, { 0, 0.75 } },
        { "cam1=-0.5", 2, { 1, 0 }, { 0.5, 0 } },
        { "cam0=1.5,cam1=1.5", 3, { 0, 0 }, { 0, 0 } },
        { "cam1=1", 2, { 0, 1 }, { 0, 0 } },
        { "cam1=0.9999999", 2, { 0, 1 }, { 0, 0 } },
    };
    saga_capture_options o = saga_capture_defaults();

    write_capture(f, "images", "");
    for (size_t i = 0; i < sizeof t / sizeof *t; i++) {
        o.late = t[i].late;
        FREED_BY(saga_capture_free) saga_capture c = load_with(f->path, &o);

        assert_int_equal(c.n_frames, t[i].n_frames);
        for (int v = 0; v < N_VIEWS; v++) {
            assert_int_equal(saga_capture_frame(&c, v, 0)[0],
                             grey(v, t[i].first[v]));
            assert_float_equal(c.views[v].late, t[i].rest[v], 1e-6);
        }
    }
    o.late = "cam1=nan";
    refused_with(f->path, &o, f->path,
                 "is not a camera with a number of "
                 "frames");
}
