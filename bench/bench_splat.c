/* SPDX-License-Identifier: MIT
 *
 * The speed of the trainer's float rasteriser, stage by stage.
 */
#include "bench_table.h"
#include "freed.h"
#include "rng.h"
#include "splat_animate.h"
#include "splat_project.h"
#include "splat_raster.h"
#include "splat_tiles.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

enum {
    ANIMATE,
    PROJECT,
    TILES,
    FORWARD,
    BACKWARD,
    PROJECT_B,
    ANIMATE_B,
    N_STAGES
};

static const char *const stage_name[N_STAGES] = { "animate",     "project",
                                                  "tiles",       "forward",
                                                  "backward",    "project back",
                                                  "animate back" };

/* Makes primitives with uniformly random positions and lognormal standard
 * deviations, whose median is sigma_px pixels before the low-pass. */
static saga_splat_params random_scene(uint32_t n, const saga_splat_camera *cam,
                                      double sigma_px, double spread)
{
    saga_error error = { "" };
    saga_splat_params p;

    if (!saga_params_alloc(&p, SAGA_ATTRS_ALL, n, &error))
        exit(1);
    for (uint32_t i = 0; i < n && sigma_px > 0; i++) {
        const saga_rng r = saga_rng_stream(7, i);
        const real z = 2 + 4 * saga_rng_float(r, 0);

        p.mean[3 * i] = (saga_rng_float(r, 1) - 0.5f) * R(cam->width) * z /
                        cam->focal[0];
        p.mean[3 * i + 1] = (saga_rng_float(r, 2) - 0.5f) * R(cam->height) * z /
                            cam->focal[1];
        p.mean[3 * i + 2] = z;
        for (int k = 0; k < 3; k++) {
            p.log2_scale[3 * i + (uint32_t)k] = R(
                log2(sigma_px * (double)(z / cam->focal[0])) +
                spread * saga_rng_normal(r, 3 + (uint64_t)k));
            p.colour[3 * i + (uint32_t)k] = saga_rng_float(r, 6 + (uint64_t)k);
            p.support[3 * i + (uint32_t)k] = 0.1f;
        }
        for (int k = 0; k < 4; k++)
            p.quat[4 * i + (uint32_t)k] = R(
                saga_rng_normal(r, 10 + (uint64_t)k));
        /* The opacity is 1 / (1 + 2^-normal), which is below 1; the parameter o
         * solves it for 8 / (1 + 2^(3 - o)). */
        p.opacity[i] = R(
            3 - log2(8 * (1 + exp2(-1.44 * saga_rng_normal(r, 14))) - 1));
        p.t_centre[i] = 0.5f;
        p.log2_width[i] = 4;
    }
    return p;
}

static double lap(bench_times *b, double *start)
{
    const double now = bench_now_ms();

    bench_add(b, now - *start);
    *start = bench_now_ms();
    return now;
}

/* Times the stages. spread is the deviation of the log2 of the primitives'
 * standard deviations: 0.7 gives ellipsoids, 2 mostly needles and discs. */
static void time_splats(uint32_t n, int width, int height, double sigma_px,
                        double spread, int reps)
{
    const saga_splat_camera cam = { .rotation = { 1, 0, 0, 0, 1, 0, 0, 0, 1 },
                                    .focal = { R(width), R(width) },
                                    .principal = { R(width) / 2,
                                                   R(height) / 2 },
                                    .near_plane = 0.1f,
                                    .width = width,
                                    .height = height };
    const size_t plane = (size_t)width * (size_t)height;
    saga_splat_params p = random_scene(n, &cam, sigma_px, spread);
    saga_splat_params d = random_scene(n, &cam, 0, 0);
    const saga_range all = { 0, n };
    saga_error error = { "" };
    FREED_BY(saga_canvas_free) saga_canvas c;
    bench_times times[N_STAGES];

    memset(times, 0, sizeof times);
    if (!saga_canvas_init(&c, plane, &error))
        exit(1);
    c.camera = cam;
    c.t = 0.5f;
    for (size_t k = 0; k < 3 * plane; k++)
        c.d_image[k] = saga_rng_float(saga_rng_stream(3, 3), k) - 0.5f;
    for (int rep = 0; rep < reps + 1; rep++) {
        double at;

        /* A whole pass warms the caches before its stages are timed alone. */
        saga_splat_forward(&c, &p, n, &error);
        saga_splat_backward(&d, NULL, &c, &p, &error);
        at = bench_now_ms();
        saga_splat_animate_forward(&c.splat.posed, &p, all, c.t);
        lap(&times[ANIMATE], &at);
        saga_splat_project_forward(&c, &p, all);
        lap(&times[PROJECT], &at);
        saga_splat_tiles(&c, &error);
        lap(&times[TILES], &at);
        saga_splat_raster_forward(&c);
        lap(&times[FORWARD], &at);
        saga_splat_raster_backward(&c);
        lap(&times[BACKWARD], &at);
        saga_splat_project_backward(&d, NULL, &c, &p, all);
        lap(&times[PROJECT_B], &at);
        saga_splat_animate_backward(&d, &c, &p, all);
        lap(&times[ANIMATE_B], &at);
    }
    for (int s = 0; s < N_STAGES; s++) {
        char name[56];
        bench_row *r;

        snprintf(name, sizeof name, "float %s, %dx%d%s", stage_name[s], width,
                 height, spread > 1 ? ", needles" : "");
        r = bench_row_add(name, &times[s]);
        r->count = n;
        r->each = "a splat";
    }
    saga_params_free(&p);
    saga_params_free(&d);
}

void bench_splat(void)
{
    time_splats(50000, 640, 360, 1.33, 0.7, 15);
    time_splats(10000, 320, 180, 0.67, 0.7, 15);
    time_splats(20000, 640, 360, 1.33, 2, 15);
}
