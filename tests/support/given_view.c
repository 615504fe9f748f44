/* SPDX-License-Identifier: MIT
 *
 * See given_view.h.
 */
#include "given_view.h"

#include "animate.h"
#include "testing.h"

/* --- A file -------------------------------------------------------------- */

static uint32_t n_copies(const gen_given *p)
{
    return p->copies ? p->copies : 1;
}

/* Checks the decoded primitives at both ends of the segment and in its
 * middle. */
static void assert_given(const given_view *v)
{
    static const int32_t times[] = { 0, 32768, 65535 };
    const saga_prim_format f = gen_given_format(v->tools);
    saga_animated want, got;
    uint32_t index = 0;

    for (uint32_t i = 0; i < v->n; i++)
        for (uint32_t k = 0; k < n_copies(&v->p[i]); k++, index++)
            for (int j = 0; j < 3; j++) {
                saga_animate(&want, &v->p[i].p, &f, times[j]);
                assert_ok(saga_primitive_at(&got, v->dec, index, times[j]));
                assert_memory_equal(&got, &want, sizeof got);
            }
    assert_int_equal(v->report.n_primitives, index);
}

void given_open_stream(given_view *v, gen_stream *g)
{
    saga_segment seg;
    saga_info info;

    memset(v, 0, sizeof *v);
    gen_stream_encode(g, &v->bytes, &v->nbytes);
    assert_ok(saga_probe(&info, v->bytes, v->nbytes));
    v->work = must(
        aligned_alloc(SAGA_WORK_ALIGN, (info.work_nbytes + 15) & ~(size_t)15));
    assert_ok(saga_open(&v->dec, v->work, info.work_nbytes, v->bytes, v->nbytes,
                        NULL));
    assert_ok(saga_find(&seg, v->bytes, v->nbytes, 0, 1));
    assert_ok(
        saga_decode(v->dec, &seg, v->bytes + seg.offset, seg.nbytes, NULL));
    assert_ok(saga_tell(&v->report, v->dec));
}

void given_open(given_view *v, const gen_given *p, uint32_t n, uint32_t tools)
{
    gen_given copy[GIVEN_MOST];
    gen_stream g;

    assert_in_range(n, 1, GIVEN_MOST);
    memcpy(copy, p, n * sizeof *p);
    gen_given_make(&g, copy, n, tools, 1);
    given_open_stream(v, &g);
    gen_stream_free(&g);
    memcpy(v->p, copy, n * sizeof *copy);
    v->n = n;
    v->tools = tools;
    assert_given(v);
}

void given_close(given_view *v)
{
    free(v->rgb);
    free(v->work);
    free(v->bytes);
}

void given_draw(given_view *v, const saga_camera *cam, int32_t t)
{
    const size_t stride = 3u * cam->width;
    const size_t scratch = SAGA_JOB_NBYTES(64, 4096);
    saga_job job = { .x1 = cam->width,
                     .y1 = cam->height,
                     .tile = 64,
                     .list_capacity = 4096,
                     .scratch_nbytes = scratch };
    saga_picture pic = { .stride_nbytes = stride,
                         .nbytes = stride * cam->height,
                         .bits = 8 };

    free(v->rgb);
    v->rgb = pic.rgb = must(malloc(pic.nbytes));
    v->cam = *cam;
    v->t = t;
    job.scratch = must(malloc(scratch));
    assert_ok(saga_view(v->dec, cam, t));
    assert_ok(saga_draw(v->dec, &job, &pic, UINT32_MAX));
    assert_ok(saga_tell(&v->report, v->dec));
    free(job.scratch);
}

int given_sample(const given_view *v, int x, int y, int channel)
{
    return v->rgb[3 * (y * v->cam.width + x) + channel];
}

/* The file has one frame, so that t is the number of 65536ths of a frame. */
saga_verify_picture given_verify(const given_view *v, int stage)
{
    const saga_verify_view view = { v->cam, (uint32_t)v->t, 65536, NULL, NULL };
    FREED saga_verify *const report = must(malloc(sizeof *report));
    saga_verify_picture picture;

    assert_done(saga_verify_file(report, "the file", v->bytes, v->nbytes, &view,
                                 &error));
    picture = report->picture[stage];
    return picture;
}
