/* SPDX-License-Identifier: MIT
 *
 * Patches of the plane sweep against their definition in double: pixels, or
 * bilinear interpolation between pixels' centres, times the camera's exposure.
 * The depths that a sweep finds are tested in test_flat.c.
 */
#include "capture.h"
#include "plane_sweep.h"
#include "rng.h"
#include "testing.h"

enum { W = 13, H = 9, SIDE = SAGA_PATCH_SIDE };

/* One picture of noise, in a block of exact size. */
typedef struct {
    double exposure[3];
    saga_source_view view;
    saga_capture capture;
    saga_pictures pictures;
} one_view;

static int set_up(void **state)
{
    const saga_rng r = saga_rng_stream(3, 1);
    one_view *const o = zeroed(1, sizeof *o);
    uint8_t rgb[3 * W * H];

    for (size_t i = 0; i < sizeof rgb; i++)
        rgb[i] = (uint8_t)saga_rng_below(r, i, 256);
    for (size_t k = 0; k < 3; k++)
        o->exposure[k] = 0.8 + 0.3 * (double)k;
    o->view.width = W;
    o->view.height = H;
    o->view.rgb = copy_of(rgb, sizeof rgb);
    o->capture.views = &o->view;
    o->capture.n_views = o->capture.n_frames = 1;
    o->pictures.capture = &o->capture;
    o->pictures.exposure = o->exposure;
    *state = o;
    return 0;
}

static int tear_down(void **state)
{
    one_view *const o = *state;

    free(o->view.rgb);
    free(o);
    return 0;
}

TEST_GROUP(set_up, tear_down);

/* Returns channel k of the picture at (u, v), where pixel (x, y) has its centre
 * at (x + 0.5, y + 0.5). */
static double value_at(const one_view *o, double u, double v, int k)
{
    const double x = floor(u - 0.5), y = floor(v - 0.5);
    const double a = u - 0.5 - x, b = v - 0.5 - y;
    double sum = 0;

    for (int i = 0; i < 4; i++) {
        const double part = (i & 1 ? a : 1 - a) * (i & 2 ? b : 1 - b);
        const int at = ((int)y + i / 2) * W + (int)x + i % 2;

        if (part > 0)
            sum += part * o->view.rgb[3 * at + k];
    }
    return sum * o->exposure[k] / 255;
}

/* Values up to 1.4 are rounded some four times. */
static void assert_patch(const one_view *o, const saga_patch *p, double u,
                         double v)
{
    for (int y = 0; y < SIDE; y++) {
        for (int i = 0; i < 3 * SIDE; i++)
            assert_near(
                (double)p->at[y][i],
                value_at(o, u - SAGA_PATCH + i / 3, v - SAGA_PATCH + y, i % 3),
                1e-6);
        for (int i = 3 * SIDE; i < SAGA_PATCH_ROW; i++)
            assert_true(p->at[y][i] == 0);
    }
}

TEST(a_patch_should_have_the_pixels)
{
    const one_view *const o = *state;
    saga_patch p;

    for (int y = 0; y < H; y++)
        for (int x = 0; x < W; x++) {
            const bool inside = x >= SAGA_PATCH && x < W - SAGA_PATCH &&
                                y >= SAGA_PATCH && y < H - SAGA_PATCH;

            assert_int_equal(
                saga_patch_cut(&p, &o->pictures, 0, 0, x + 0.5, y + 0.5),
                inside);
            if (inside)
                assert_patch(o, &p, x + 0.5, y + 0.5);
        }
}

/* All places of which the pixels on both sides exist, up to the last one. */
TEST(a_patch_between_pixels_should_be_interpolated)
{
    static const double part[] = { 0, 0.25, 0.5, 0.999 };
    const one_view *const o = *state;
    saga_patch p;

    for (int y = -1; y <= H; y++)
        for (int x = -1; x <= W; x++)
            for (int i = 0; i < 16; i++) {
                const double u = x + 0.5 + part[i % 4];
                const double v = y + 0.5 + part[i / 4];
                const bool inside = x >= SAGA_PATCH && x + 1 < W - SAGA_PATCH &&
                                    y >= SAGA_PATCH && y + 1 < H - SAGA_PATCH;

                assert_int_equal(
                    saga_patch_between(&p, &o->pictures, 0, 0, u, v), inside);
                if (inside)
                    assert_patch(o, &p, u, v);
            }
    assert_false(saga_patch_between(&p, &o->pictures, 0, 0, NAN, 4));
}

/* A pixel that does not count excludes all patches that read it, of which
 * those between pixels read one more row and column. */
TEST(a_mask_should_exclude_patches)
{
    enum { X = 6, Y = 4 };
    one_view *const o = *state;
    uint8_t mask[W * H];
    saga_patch p;

    memset(mask, 1, sizeof mask);
    mask[Y * W + X] = 0;
    o->view.mask = mask;
    for (int y = SAGA_PATCH; y < H - SAGA_PATCH - 1; y++)
        for (int x = SAGA_PATCH; x < W - SAGA_PATCH - 1; x++) {
            const bool at = abs(x - X) <= SAGA_PATCH &&
                            abs(y - Y) <= SAGA_PATCH;
            const bool by = x >= X - SAGA_PATCH - 1 && x <= X + SAGA_PATCH &&
                            y >= Y - SAGA_PATCH - 1 && y <= Y + SAGA_PATCH;

            assert_int_equal(
                saga_patch_cut(&p, &o->pictures, 0, 0, x + 0.5, y + 0.5), !at);
            assert_int_equal(
                saga_patch_between(&p, &o->pictures, 0, 0, x + 0.7, y + 0.7),
                !by);
        }
    o->view.mask = NULL;
}

TEST(a_distance_should_be_the_mean_difference)
{
    const one_view *const o = *state;
    saga_patch a, b;
    double sum = 0;

    assert_true(saga_patch_cut(&a, &o->pictures, 0, 0, 3, 3));
    assert_true(saga_patch_between(&b, &o->pictures, 0, 0, 8.3, 5.1));
    for (int y = 0; y < SIDE; y++)
        for (int i = 0; i < 3 * SIDE; i++)
            sum += fabs((double)a.at[y][i] - (double)b.at[y][i]);
    assert_near(saga_patch_distance(&a, &b), sum / (3 * SIDE * SIDE), 1e-7);
    assert_true(saga_patch_distance(&a, &a) == 0);
}
