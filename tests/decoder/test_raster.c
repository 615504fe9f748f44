/* SPDX-License-Identifier: MIT
 *
 * Blending in a whole picture. A single splat on black, drawn with 16 bits,
 * shows its weight at every pixel: the touched pixels are compared with double,
 * the weights with the formula of docs/arithmetic.md. Scenes are compared with
 * the integer reference pixel by pixel.
 */
#include "model.h"
#include "raster_scene.h"

#define CUT (SAGA_CUT_LOG2 << 20)

static const double eps = 7e-4;

/* --- One splat ----------------------------------------------------------- */

typedef struct {
    long visible, lost, invented, wrong, near;
} tally;

/* Makes a single splat; returns 0 if it is dropped. It is white on black, so
 * that a sample of 16 bits is its weight times 65535 / 65536. */
static int one_splat(scene *s, ref_splat *ref, gen_rng *r)
{
    const int width = gen_int(r, 1, 40), height = gen_int(r, 1, 40);
    saga_animated a;
    ref_animated ra;

    gen_hard_camera(&s->cam, r, width, height);
    gen_hard_animated(&a, r, &s->cam);
    for (int k = 0; k < 3; k++)
        s->cam.background_q15[k] = 0;
    if (!saga_project(s->splats, &a, &s->cam, 0))
        return 0;
    for (int k = 0; k < 3; k++)
        s->splats->colour_q15[k] = 32768;
    ref_animated_of(&ra, &a);
    return ref_project(ref, &ra, &s->cam);
}

static void tally_pixel(tally *t, const scene *s, const ref_splat *ref, int x,
                        int y, uint32_t value)
{
    const saga_splat *const p = s->splats;
    const double q = ref_q(ref, x + 0.5 - p->mean_q8[0] / 256.0,
                           y + 0.5 - p->mean_q8[1] / 256.0);
    const int32_t q_q20 = ref_q_q20(p, x, y, 0);
    const uint32_t w = q_q20 < CUT ? ref_alpha_q16(q_q20) : 0;

    t->visible += value > 0;
    t->near += fabs(q - 11) <= eps;
    t->lost += value == 0 && q < 11 - eps;
    t->invented += value > 0 && q > 11 + eps;
    t->wrong += value != ((uint64_t)w * 65535 + 32768) >> 16;
}

TEST(splat_should_touch_the_pixels_below_the_cut)
{
    tally t = { 0, 0, 0, 0, 0 };
    gen_rng r = gen_seeded(31);
    scene s;

    new_scene(&s, 1, 1, 1);
    for (int i = 0; i < 15000; i++) {
        const setting with = { 8 << (i & 3), 1, 0, UINT32_MAX };
        ref_splat ref;
        picture p;

        if (!one_splat(&s, &ref, &r))
            continue;
        sort_scene(&s);
        new_picture(&p, s.cam.width, s.cam.height, 16, 0);
        draw(&p, &s, &with);
        for (int y = 0; y < p.height; y++)
            for (int x = 0; x < p.width; x++)
                tally_pixel(&t, &s, &ref, x, y, value_at(&p, x, y, 0));
        free(p.block);
    }
    print_message("%ld pixels visible: %ld lost, %ld invented, %ld not as the "
                  "norm has it; %ld within %g of the cut\n",
                  t.visible, t.lost, t.invented, t.wrong, t.near, eps);
    free_scene(&s);
    assert_true(t.visible > 300000);
    assert_int_equal(t.lost, 0);
    assert_int_equal(t.invented, 0);
    assert_int_equal(t.wrong, 0);
}

/* Makes a splat that no projection would give, with random factors and a mean
 * far outside the picture. Its box is the whole picture, so that only the spans
 * decide which pixels are touched. */
static void any_splat(saga_splat *p, gen_rng *r)
{
    const int32_t top = 720900000; /* 2.6856 in Q28 */

    for (int i = 0; i < 3; i++)
        p->chol_q28[i] = gen_shifted(r, 0, top, 29);
    if (gen_int(r, 0, 1))
        p->chol_q28[1] = -p->chol_q28[1];
    for (int i = 0; i < 2; i++)
        p->mean_q8[i] = gen_shifted(r, -(1 << 23), 1 << 23, 16);
    p->q0_q20 = gen_shifted(r, 0, CUT - 1, 8);
    p->depth = 1 + gen_u32(r) % 1000;
    p->x0 = p->y0 = 0;
    p->x1 = p->y1 = 61;
    for (int i = 0; i < 3; i++)
        p->colour_q15[i] = (uint16_t)gen_int(r, 0, 32768);
}

TEST(rows_should_equal_the_direct_formula)
{
    static const setting with[] = { { 8, 40, 0, UINT32_MAX },
                                    { 64, 40, 0, UINT32_MAX } };
    gen_rng r = gen_seeded(32);
    picture want;
    FREED_BY(free_scene) scene s;

    new_scene(&s, 1, 61, 61);
    for (int i = 0; i < 3000; i++) {
        any_splat(s.splats, &r);
        sort_scene(&s);
        exact_picture(&want, &s, 16);
        expect_with(&s, &with[i & 1], &want);
        free(want.block);
    }
}

/* --- Scenes against the norm --------------------------------------------- */

TEST(scenes_should_be_those_of_the_norm)
{
    gen_rng r = gen_seeded(33);
    picture want;
    scene s;

    for (int i = 0; i < 40; i++) {
        const int width = gen_int(&r, 1, 90), height = gen_int(&r, 1, 70);

        if (i & 1)
            hard_scene(&s, &r, 250, width, height);
        else
            even_scene(&s, &r, 250, width, height);
        exact_picture(&want, &s, all_bits[i / 2 % N_BITS]);
        expect_with(&s, &plain, &want);
        free(want.block);
        free_scene(&s);
    }
}

/* --- The stop ------------------------------------------------------------ */

/* Makes two opaque splats that fill the left half of a tile, and 100 splats
 * behind them that fill all of it. In the left half T is 7 after the first two,
 * so that these pixels are finished. */
static void half_finished_scene(scene *s)
{
    new_scene(s, 102, 16, 16);
    for (uint32_t i = 0; i < s->n; i++) {
        saga_splat *const p = s->splats + i;

        memset(p, 0, sizeof *p);
        p->mean_q8[0] = i < 2 ? 0 : 8 * 256;
        p->mean_q8[1] = 8 * 256;
        p->chol_q28[0] = i < 2 ? 1 << 25 : 1 << 20;
        p->chol_q28[2] = 1 << 20;
        p->q0_q20 = i < 2 ? 0 : 5 << 20;
        p->depth = i + 1;
        p->x1 = p->y1 = 16;
        p->colour_q15[i % 3] = 32768;
    }
    sort_scene(s);
}

/* Returns the blue that a pixel would have if blending did not stop where T is
 * below 8. */
static uint32_t unstopped(const scene *s, int x, int y, int k)
{
    uint64_t sum = 0;
    uint32_t t = 65536;

    for (uint32_t i = 0; i < s->n; i++) {
        const saga_splat *const p = s->splats + s->order[i].index;
        const int32_t q = ref_q_q20(p, x, y, 0);
        const uint32_t a = q < CUT ? ref_alpha_q16(q) : 0;
        const uint32_t w = (a * t + 0x8000) >> 16;

        sum += (uint64_t)w * p->colour_q15[k];
        t -= w;
    }
    sum += (uint64_t)t * s->cam.background_q15[k];
    return (uint32_t)((sum * 65535 + (1 << 30)) >> 31);
}

TEST(stop_should_be_that_of_the_pixel)
{
    static const int32_t tiles[] = { 8, 16, 32, 64 };
    picture want;
    uint32_t diff = 0;
    FREED_BY(free_scene) scene s;

    half_finished_scene(&s);
    s.splats[2].q0_q20 = 0; /* would be skipped if the whole tile stopped */
    s.splats[2].colour_q15[1] = 32768;
    exact_picture(&want, &s, 16);
    for (int i = 0; i < 4; i++) {
        const setting with = { tiles[i], 37, 0, UINT32_MAX };

        expect_with(&s, &with, &want);
    }
    for (int i = 0; i < 256; i++) {
        const int x = i & 15, y = i >> 4;

        diff += value_at(&want, x, y, 2) != unstopped(&s, x, y, 2);
    }
    print_message("a stop of the tile would show at %u of 256 pixels\n", diff);
    assert_true(diff >= 4);
    free(want.block);
}

/* When all pixels of a tile are finished, splats behind are skipped. This must
 * not change the picture. */
TEST(finished_tiles_should_not_change)
{
    static const setting with[] = { { 8, 1, 0, UINT32_MAX },
                                    { 8, 37, 0, 100 },
                                    { 16, 4000, 0, 7 },
                                    { 64, 4000, 1 << 17, UINT32_MAX } };
    gen_rng r = gen_seeded(35);
    picture want;
    FREED_BY(free_scene) scene s;

    even_scene(&s, &r, 1500, 50, 30);
    for (uint32_t i = 0; i < s.n; i++) {
        s.splats[i].q0_q20 >>= 3;
        if (s.splats[i].mean_q8[0] < 40 * 256)
            s.splats[i].q0_q20 = 0;
        s.splats[i].x0 = s.splats[i].y0 = 0; /* the boxes were smaller */
        s.splats[i].x1 = 50;
        s.splats[i].y1 = 30;
    }
    sort_scene(&s);
    exact_picture(&want, &s, 16);
    for (uint32_t i = 0; i < 4; i++)
        expect_with(&s, &with[i], &want);
    free(want.block);
}

/* --- Against double ------------------------------------------------------ */

static void colour_truly(ref_splat *s, uint32_t index)
{
    uint16_t colour[3];

    gen_colour(colour, index);
    for (int k = 0; k < 3; k++)
        s->colour[k] = colour[k] / 32768.0;
}

/* Sets the colours to z and 1, so that blending gives the expected depth. */
static void colour_by_depth(ref_splat *s, uint32_t index)
{
    (void)index;
    s->colour[0] = s->depth;
    s->colour[1] = 1;
    s->colour[2] = 0;
}

typedef void colour_fn(ref_splat *s, uint32_t index);

/* Draws the primitives with the reference in double, from animation to pixels.
 */
static void true_picture(double *rgb, const saga_primitive *p, uint32_t n,
                         const saga_camera *cam, colour_fn *colour)
{
    FREED ref_splat *const splats = need(n * sizeof *splats);
    FREED uint32_t *const order = need(n * sizeof *order);
    uint32_t kept = 0;
    ref_primitive still;
    ref_animated a;

    for (uint32_t i = 0; i < n; i++) {
        ref_primitive_of(&still, p + i, &gen_still_format);
        ref_animate(&a, &still, 0.5);
        if (ref_project(splats + kept, &a, cam))
            colour(splats + kept++, i);
    }
    ref_sort(order, splats, kept);
    ref_blend(rgb, cam, splats, order, kept);
}

static void expect_close(const scene *s, const double *rgb, int bits)
{
    double psnr, steps;
    picture p;

    new_picture(&p, s->cam.width, s->cam.height, bits, 0);
    draw(&p, s, &plain);
    psnr = ref_psnr(&p.pic, &s->cam, rgb, &steps);
    steps *= bits == 16 ? 255.0 / 65535 : 1;
    print_message("%d bits: %.2f dB, at most %.2f of 255\n", bits, psnr, steps);
    assert_true(psnr >= 57);
    assert_true(steps <= 2);
    free(p.block);
}

TEST(picture_should_be_that_of_double)
{
    enum { N = 20000, WIDTH = 320, HEIGHT = 180 };
    FREED saga_primitive *const p = need(N * sizeof *p);
    FREED double *const rgb = need(WIDTH * HEIGHT * 3 * sizeof *rgb);
    gen_rng r = gen_seeded(43);
    FREED_BY(free_scene) scene s;

    new_scene(&s, N, WIDTH, HEIGHT);
    gen_uniform_scene(p, N, &r, &s.cam);
    s.n = gen_splats(s.splats, NULL, p, &gen_still_format, N, &s.cam, 32768);
    sort_scene(&s);
    true_picture(rgb, p, N, &s.cam, colour_truly);
    expect_close(&s, rgb, 8);
    expect_close(&s, rgb, 16);
}

/* Compares depths with the truth. A depth is a mean of the splats' depths,
 * weighted by their alpha. The error of the weights is that of an 8-bit
 * picture; multiplied by the scene's depth it bounds the error of a depth. */
static void expect_depths(const scene *s, const double *truth)
{
    double most_alpha = 0, most = 0, sum = 0;
    long n = 0;
    picture p;

    new_picture(&p, s->cam.width, s->cam.height, SAGA_DEPTH, 0);
    draw(&p, s, &plain);
    for (int i = 0; i < p.width * p.height; i++) {
        const saga_depth *const d = (const saga_depth *)p.pic.rgb + i;
        const double alpha = truth[3 * i + 1];
        double off;

        most_alpha = fmax(most_alpha, fabs(d->weight_q16 / 65536.0 - alpha));
        if (alpha < 0.5)
            continue;
        off = fabs((double)d->sum_q16 / d->weight_q16 / truth[3 * i] * alpha -
                   1);
        most = fmax(most, off);
        sum += off * off;
        n++;
    }
    print_message("alpha at most %.5f off, depth %.5f of itself, %.6f rms\n",
                  most_alpha, most, sqrt(sum / (double)n));
    assert_true(n > p.width * p.height / 2);
    assert_true(most_alpha <= 2.0 / 255);
    assert_true(most <= 2.0 / 255);
    assert_true(sqrt(sum / (double)n) <= 4e-4);
    free(p.block);
}

TEST(depths_should_be_those_of_double)
{
    enum { N = 20000, WIDTH = 320, HEIGHT = 180 };
    FREED saga_primitive *const p = need(N * sizeof *p);
    FREED double *const truth = need(WIDTH * HEIGHT * 3 * sizeof *truth);
    gen_rng r = gen_seeded(44);
    FREED_BY(free_scene) scene s;

    new_scene(&s, N, WIDTH, HEIGHT);
    gen_uniform_scene(p, N, &r, &s.cam);
    memset(s.cam.background_q15, 0, sizeof s.cam.background_q15);
    s.n = gen_splats(s.splats, NULL, p, &gen_still_format, N, &s.cam, 32768);
    sort_scene(&s);
    true_picture(truth, p, N, &s.cam, colour_by_depth);
    expect_depths(&s, truth);
}
