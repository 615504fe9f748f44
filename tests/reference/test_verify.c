/* SPDX-License-Identifier: MIT
 *
 * The integer decoder is compared with the reference in double, on all good
 * vectors, whose networks are random and hard, and on the demo's file, which
 * was trained. The reference itself fails if the decoder's pixels differ from
 * the integer reference.
 */
#include "file.h"
#include "testing.h"
#include "verify.h"

#include <dirent.h>

static void verify(saga_verify *v, const char *path, uint32_t frame)
{
    saga_verify_view view = { .frame_num = frame, .frame_den = 1 };
    FREED_BY(saga_bytes_free) saga_bytes file;
    uint32_t number;

    assert_done(saga_read_file(&file, path, &error));
    assert_ok(saga_rig(&view.camera, &number, file.data, file.nbytes, 0));
    assert_done(
        saga_verify_file(v, path, file.data, file.nbytes, &view, &error));
}

static const saga_verify_row *row_of(const saga_verify *v, int stage,
                                     const char *name)
{
    for (int i = 0; i < v->n_rows; i++)
        if (v->row[i].stage == stage && !strcmp(v->row[i].name, name))
            return &v->row[i];
    fail_msg("no row %s", name);
    return NULL;
}

/* Returns the largest error of a stage alone, in steps of its format. */
static double steps(const saga_verify *v, int stage, const char *name)
{
    const saga_verify_row *const r = row_of(v, stage, name);

    return r->alone.max / r->step;
}

/* Checks the stages with few roundings. A value that is rounded once from exact
 * integers must be within half a step, since the approximations before it
 * (2^-29 of x/z) are far smaller. A primitive's position is rounded once, and
 * its support, by which up to twice the value is multiplied, once more. */
static void check_roundings(const saga_verify *v)
{
    assert_true(steps(v, SAGA_VERIFY_SPLATS, "mean") < 0.51);
    assert_true(steps(v, SAGA_VERIFY_SPLATS, "depth") < 0.51);
    assert_true(steps(v, SAGA_VERIFY_PRIMITIVES, "position") < 1.51);
}

/* Checks the error of the pixels, computed from the decoder's own splats. The
 * fraction of q has 8 bits, so that an alpha has a relative error of
 * 2^-9 log(2) and an absolute one of 2^-16; q itself adds 5e-4. The weights of
 * a pixel add each of these at most once, T doubles them, and a splat at the
 * cut changes a pixel by at most one level. At an opacity of 8 the edge of the
 * smallest splat changes alpha by 6.4 a pixel, or by 12.6 if it is steep. A
 * mean that is wrong by 1/512 of a pixel then changes it by three levels, or by
 * six. */
static void check_pixels(const saga_verify *v, int most)
{
    const double relative = (1 / 512.0 + 5e-4) * log(2) + 1 / 256.0;
    const saga_verify_row *const r = row_of(v, SAGA_VERIFY_PIXELS,
                                            "picture before 8 bits");

    assert_true(r->alone.max < 1 + 2 * 255 * relative);
    assert_true(v->picture[SAGA_VERIFY_PIXELS].max <= 1);
    assert_true(v->picture[SAGA_VERIFY_PIXELS].psnr > 60);
    assert_true(v->picture[SAGA_VERIFY_ANIMATION].max <= most);
    assert_true(v->picture[SAGA_VERIFY_ANIMATION].psnr > 60);
}

/* Checks the stages with networks of three layers. Random weights may enlarge
 * an error of one step ten times. A wrong formula would give errors of 2^9
 * steps and more. */
static void check_networks(const saga_verify *v)
{
    for (int i = 0; i < v->n_rows; i++) {
        const saga_verify_row *const r = &v->row[i];

        if (r->stage > SAGA_VERIFY_PRIMITIVES || r->alone.n == 0 ||
            !strcmp(r->name, "position"))
            continue;
        if (r->alone.rms > 64 * r->step)
            fail_msg("%s %s: rms %g in steps of %g",
                     saga_verify_stage[r->stage], r->name, r->alone.rms,
                     r->step);
    }
}

TEST(vectors_should_be_near_double_in_every_stage)
{
    DIR *const dir = opendir("vectors/good");
    const struct dirent *e;
    int n = 0;

    assert_non_null(dir);
    while ((e = readdir(dir)) != NULL) {
        saga_verify v;
        char path[512];

        if (!strstr(e->d_name, ".saga"))
            continue;
        snprintf(path, sizeof path, "vectors/good/%s", e->d_name);
        verify(&v, path, 0);
        check_networks(&v);
        if (v.n_splats > 0) {
            check_roundings(&v);
            check_pixels(&v, strstr(path, "steep") ? 6 : 3);
        }
        n++;
    }
    closedir(dir);
    assert_true(n >= 10);
}

/* In a trained file, the picture computed in double from the symbols, or from
 * the decoder's scaffold, must be near the decoder's. One pixel of it differs
 * by two levels, because a splat there is visible for 1/250 of the segment. */
TEST(demo_should_be_near_double_as_a_whole)
{
    const saga_verify_picture *p;
    saga_verify v;

    verify(&v, "docs/demo.saga", 12);
    p = &v.picture[SAGA_VERIFY_SYMBOLS];
    printf("  %.2f dB, %d level%s\n", p->psnr, p->max, p->max == 1 ? "" : "s");
    assert_true(v.n_splats > 1000);
    assert_true(p->psnr > 61);
    assert_true(p->max <= 2);
    p = &v.picture[SAGA_VERIFY_SCAFFOLD];
    assert_true(p->psnr >= 62);
    assert_true(p->max <= 2);
    assert_true(row_of(&v, SAGA_VERIFY_SCAFFOLD, "fine feature")->chain.psnr >
                80);
}

TEST(bad_files_should_be_refused)
{
    static const char *const name[] = { "crc_segment", "crc_header",
                                        "cut_in_segment" };
    const saga_verify_view view = { .frame_den = 1 };

    for (size_t i = 0; i < sizeof name / sizeof name[0]; i++) {
        saga_error error = { "" };
        FREED_BY(saga_bytes_free) saga_bytes file;
        saga_verify v;
        char path[512];

        snprintf(path, sizeof path, "vectors/bad/%s.saga", name[i]);
        assert_true(saga_read_file(&file, path, &error));
        assert_false(
            saga_verify_file(&v, path, file.data, file.nbytes, &view, &error));
        assert_non_null(strstr(error.message, path));
    }
}
