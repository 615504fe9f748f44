/* SPDX-License-Identifier: MIT
 *
 * The float rasteriser is compared with the integer decoder (animate, project
 * and raster) on the same primitives. The PSNR between the two pictures must be
 * at least 55 dB.
 */
#include "animate.h"
#include "project.h"
#include "raster.h"
#include "splat_scene.h"
#include "testing.h"

/* Box units per unit of scene_random; Q formats of the outputs. */
#define UNIT 2097152.0
enum { Q_QUAT = 12, Q_MOTION = 12, Q_OPACITY = 10, LIST = 4096 };

/* The time, in 65536ths of the segment. */
enum { TIME = 22937 };

static int32_t quantise(double x, double lo, double hi)
{
    return (int32_t)lround(fmin(fmax(x, lo), hi));
}

static int16_t to_int16(real x, double scale)
{
    return (int16_t)quantise((double)x * scale, -32767, 32767);
}

/* Rounds primitive i of p to what the decoder can hold, and returns the
 * decoder's primitive. */
static saga_primitive round_primitive(saga_splat_params *p, size_t i)
{
    saga_primitive o;

    for (size_t a = 0; a < 3; a++) {
        real *const x = p->mean + 3 * i + a, *const s = p->support + 3 * i + a;
        real *const l = p->log2_scale + 3 * i + a;

        o.x[a] = quantise((double)*x * UNIT, -8388608, 8388607);
        o.support[a] = quantise((double)*s * UNIT, 1, 8388608);
        o.log2_scale_q10[a] = to_int16(*l + 21, 1024);
        *x = (real)o.x[a];
        *s = (real)o.support[a];
        *l = (real)o.log2_scale_q10[a] / 1024;
    }
    for (size_t a = 0; a < 9; a++) {
        o.motion[a] = to_int16(p->motion[9 * i + a], 1 << Q_MOTION);
        p->motion[9 * i + a] = (real)o.motion[a] / (1 << Q_MOTION);
    }
    for (size_t a = 0; a < 4; a++) {
        o.quat[a] = to_int16(p->quat[4 * i + a], 1 << Q_QUAT);
        o.slope[a] = to_int16(p->slope[4 * i + a], 1 << Q_QUAT);
        p->quat[4 * i + a] = (real)o.quat[a] / (1 << Q_QUAT);
        p->slope[4 * i + a] = (real)o.slope[a] / (1 << Q_QUAT);
    }
    o.opacity = to_int16(p->opacity[i], 1 << Q_OPACITY);
    p->opacity[i] = (real)o.opacity / (1 << Q_OPACITY);
    o.t_centre = quantise((double)p->t_centre[i] * 65536, -32768, 98303);
    p->t_centre[i] = (real)o.t_centre / 65536;
    o.log2_width_q10 = to_int16(p->log2_width[i] + 16, 1024);
    p->log2_width[i] = (real)o.log2_width_q10 / 1024 - 16;
    return o;
}

static saga_camera round_camera(saga_splat_camera *cam)
{
    saga_camera c;

    for (int i = 0; i < 9; i++) {
        c.rotation_q30[i] = (int32_t)lround((double)cam->rotation[i] *
                                            1073741824.0);
        cam->rotation[i] = (real)(c.rotation_q30[i] / 1073741824.0);
    }
    for (int i = 0; i < 3; i++) {
        c.centre[i] = (int32_t)lround((double)cam->centre[i] * UNIT);
        c.background_q15[i] = (uint16_t)lround((double)cam->background[i] *
                                               32768);
        cam->centre[i] = (real)c.centre[i];
    }
    for (int i = 0; i < 2; i++) {
        c.focal_q16[i] = (int32_t)lround((double)cam->focal[i] * 65536);
        c.principal_q16[i] = (int32_t)lround((double)cam->principal[i] * 65536);
    }
    c.near_plane = (int32_t)lround((double)cam->near_plane * UNIT);
    cam->near_plane = (real)c.near_plane;
    c.width = (uint16_t)cam->width;
    c.height = (uint16_t)cam->height;
    return c;
}

/* Draws the decoder's picture with 16 bits. */
static void draw_integers(uint16_t *rgb, const saga_primitive *prim,
                          const saga_splat_params *p, uint32_t n,
                          const saga_camera *cam, uint32_t tools)
{
    static const saga_prim_format format = { .q_quat = Q_QUAT,
                                             .q_slope = Q_QUAT,
                                             .q_opacity = Q_OPACITY,
                                             .q_motion = { Q_MOTION, Q_MOTION,
                                                           Q_MOTION },
                                             .motion_order = 3,
                                             .has_slope = 1,
                                             .has_width = 1 };
    FREED saga_splat *const s = calloc(n, sizeof *s);
    FREED saga_key *const keys = calloc(2 * n, sizeof *keys);
    saga_drawing drawing = { cam, s, keys, 0, saga_cpu_best(), tools };
    const size_t nbytes = 1u << 22;
    const saga_picture pic = { rgb, 6u * cam->width,
                               6u * (size_t)cam->width * cam->height, 16 };
    saga_job job = { .x1 = cam->width,
                     .y1 = cam->height,
                     .tile = 16,
                     .list_capacity = LIST,
                     .scratch = malloc(nbytes),
                     .scratch_nbytes = nbytes };
    uint32_t m = 0;

    for (uint32_t i = 0; i < n; i++) {
        saga_animated moved;

        saga_animate(&moved, prim + i, &format, TIME);
        if (!saga_project(s + i, &moved, cam, tools))
            continue;
        for (int a = 0; a < 3; a++)
            s[i].colour_q15[a] = (uint16_t)lround(
                (double)p->colour[3 * i + (uint32_t)a] * 32768);
        keys[m++] = (saga_key){ s[i].depth, i };
    }
    saga_depth_sort(keys, keys + n, m);
    (void)saga_raster_boxes(keys, s, m, cam);
    drawing.n = m;
    while (saga_raster(&job, &pic, &drawing, 1u << 20) == SAGA_AGAIN)
        ;
    free(job.scratch);
}

static saga_error error; /* nothing fails here */

static double compare(uint32_t n, int width, int height, uint64_t seed,
                      double px, double stretch, int is_steep)
{
    const size_t plane = (size_t)width * (size_t)height;
    FREED_BY(saga_params_free) saga_splat_params p = scene_alloc(n);
    saga_splat_camera cam = scene_camera(width, height, 0.15);
    FREED saga_primitive *const prim = calloc(n, sizeof *prim);
    FREED uint16_t *const rgb = calloc(3 * plane, sizeof *rgb);
    FREED_BY(saga_canvas_free) saga_canvas canvas;
    saga_camera camera;
    double mse = 0, worst = 0;

    scene_random(&p, n, seed, px);
    for (size_t i = 0; i < n; i++) {
        p.log2_scale[3 * i] += (real)stretch;
        prim[i] = round_primitive(&p, i);
    }
    /* The decoder's picture of the rounded primitives. */
    camera = round_camera(&cam);
    assert_ok(saga_camera_check(&camera));
    draw_integers(rgb, prim, &p, n, &camera, is_steep ? SAGA_TOOL_STEEP : 0);
    /* The trainer's picture is drawn and compared. */
    assert_true(saga_canvas_init(&canvas, plane, &error));
    canvas.camera = cam;
    canvas.t = TIME / 65536.0f;
    canvas.rules.square = is_steep ? R(0.5) : 0;
    assert_true(saga_splat_forward(&canvas, &p, n, &error));
    for (size_t i = 0; i < plane; i++)
        for (size_t c = 0; c < 3; c++) {
            const double d = (double)canvas.image[c * plane + i] -
                             rgb[3 * i + c] / 65535.0;

            mse += d * d / (double)(3 * plane);
            worst = fmax(worst, fabs(d));
        }
    mse = -10 * log10(mse);
    printf("  %u %sprimitives, %u visible, stretch 2^%g: %.1f dB, largest "
           "difference %.2f of 255\n",
           n, is_steep ? "steep " : "", canvas.splat.n_visible, stretch, mse,
           255 * worst);
    return mse;
}

TEST(twins_should_draw_the_same_picture)
{
    for (int is_steep = 0; is_steep < 2; is_steep++) {
        assert_true(compare(2000, 320, 180, 1, 1, 0, is_steep) > 55);
        assert_true(compare(300, 97, 61, 2, 3, 0, is_steep) > 55);
        assert_true(compare(300, 97, 61, 3, 0.1, 7, is_steep) > 55);
    }
}
