/* SPDX-License-Identifier: MIT
 *
 * A subject's pictures are over black and its masks are opacities, whatever of
 * the capture says what belongs to it. The expected values follow from grey
 * halves, which scaling by an odd number mixes.
 */
#include "picture_files.h"
#include "video_files.h"

enum { GREY = 201 };

static const char *const picture = "images/a.png";

static saga_capture_options subject(int scale)
{
    saga_capture_options o = saga_capture_defaults();

    o.subject = true;
    o.scale = scale;
    return o;
}

static void write_picture(folder *f)
{
    folder_run(f, "mkdir -p images masks");
    write_grey(f, picture, W, H, GREY, GREY);
    write_json(f, "", &picture, 1);
}

/* Checks opacity and colour of every pixel: in each half that of a mask, in a
 * column that scaling mixes the mean. The colours are over black. */
static void check(folder *f, int scale, int left, int right)
{
    const saga_capture_options o = subject(scale);
    FREED_BY(saga_capture_free) saga_capture c = load_with(f->path, &o);
    const int w = c.views[0].width, half = W / 2;

    assert_true(c.subject);
    for (int i = 0; i < w * c.views[0].height; i++) {
        const int from = i % w * scale, n = half - from;
        const double share = n <= 0 ? 0 : n >= scale ? 1 : n / (double)scale;
        const double mask = share * left + (1 - share) * right;

        assert_near(c.views[0].mask[i], mask, 1.01);
        assert_near(c.views[0].rgb[3 * i], mask * GREY / 255, 1.01);
    }
}

TEST_IN_FOLDER(subject_should_be_cut_out_by_a_mask_of_any_grey)
{
    write_picture(f);
    for (int scale = 1; scale <= 3; scale++) {
        write_grey(f, "masks/a.png", W, H, 0, 255);
        check(f, scale, 0, 255);
        /* The bottom row makes them three values, not two of a plain mask. */
        folder_run(f,
                   "ffmpeg -nostdin -v error -y -f lavfi -i \"color=s=%dx%d,"
                   "format=gray,geq=lum='if(lt(X,%d),64,if(lt(Y,%d),192,191))"
                   "'\" -frames:v 1 masks/a.png",
                   W, H, W / 2, H - 1);
        check(f, scale, 64, 192);
    }
}

TEST_IN_FOLDER(subject_should_be_cut_out_by_opacity)
{
    write_picture(f);
    folder_run(f,
               "ffmpeg -nostdin -v error -y -i %s -vf \"format=rgba,"
               "geq=r=%d:g=%d:b=%d:a='if(lt(X,%d),50,100)'\" images/b.png &&"
               "mv images/b.png %s",
               picture, GREY, GREY, GREY, W / 2, picture);
    check(f, 1, 50, 100);
    check(f, 3, 50, 100);
    /* A mask takes precedence. */
    write_grey(f, "masks/a.png", W, H, 255, 0);
    check(f, 1, 255, 0);
}

/* A subject without excess of green over a green screen: the screen's share of
 * a pixel is its share of the screen's excess. Opacity rises from 0 at 70 % to
 * 1 at 10 %, and of the screen's light nothing remains. */
TEST_IN_FOLDER(subject_should_be_cut_out_by_a_key)
{
    static const int screen[3] = { 40, 200, 10 }, own[3] = { 150, 150, 90 };
    static const double share[4] = { 1, 0.6, 0.3, 0 };
    saga_capture_options o = subject(1);
    saga_capture c;
    uint8_t rgb[3 * W * H];

    for (int i = 0; i < 3 * W * H; i++) {
        const double s = share[i / 3 % W / 8];

        rgb[i] = (uint8_t)lrint(s * screen[i % 3] + (1 - s) * own[i % 3]);
    }
    write_picture(f);
    assert_done(saga_png_write(folder_file(f, picture), W, H, rgb, &error));
    o.keyed = true;
    memcpy(o.key, (uint8_t[]){ 40, 200, 10 }, sizeof o.key);
    c = load_with(f->path, &o);
    for (int i = 0; i < W * H; i++) {
        const double s = share[i % W / 8];
        const double alpha = fmin(fmax((0.7 - s) / 0.6, 0), 1);

        assert_near(c.views[0].mask[i], 255 * alpha, 2);
        for (int k = 0; k < 3; k++)
            assert_near(c.views[0].rgb[3 * i + k], alpha * own[k], 2);
    }
    saga_capture_free(&c);
    memcpy(o.key, (uint8_t[]){ 255, 255, 200 }, sizeof o.key);
    refused_with(f->path, &o, "--key", "no channel is above the others");
    memcpy(o.key, (uint8_t[]){ 0, 0, 255 }, sizeof o.key);
    refused_with(f->path, &o, f->path, "is the whole of all pictures");
}

TEST_IN_FOLDER(subject_should_be_refused_when_nothing_shows_it)
{
    const saga_capture_options o = subject(1);

    write_picture(f);
    refused_with(f->path, &o, picture, "nothing tells the subject");
    write_grey(f, "masks/a.png", W, H, 255, 255);
    refused_with(f->path, &o, f->path, "is the whole of all pictures");
    write_grey(f, "masks/a.png", W, H, 0, 0);
    refused_with(f->path, &o, f->path, "is in none of all pictures");
}
