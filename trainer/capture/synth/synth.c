/* SPDX-License-Identifier: MIT */
#include "synth.h"

#include "alloc.h"
#include "error.h"
#include "file.h"
#include "output.h"
#include "picture.h"
#include "ply.h"
#include "pose.h"
#include "ring_motion.h"
#include "synth_math.h"
#include "synth_world.h"

#include <dirent.h>
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#ifdef _OPENMP
#include <omp.h>
#else
#define omp_get_max_threads() 1
#endif
#include <sys/stat.h>
#include <unistd.h>

saga_synth_options saga_synth_defaults(saga_synth_scene scene)
{
    saga_synth_options o = {
        .scene = scene, .width = 320, .height = 180, .n_cameras = 10,
        .n_hold_out = 2, .n_frames = 24, .fps = 24.0, .samples = 2,
        .depth_every = 12, .n_points = 3000, .seed = 1};
    if (scene == SAGA_SYNTH_RING) {
        o.n_cameras = 14;
        o.n_frames = 32;
        o.fps = 30.0;
        o.samples = 3;
    }
    return o;
}

static bool check_options(const saga_synth_options *o, const char *folder,
                          saga_error *error)
{
    const struct {
        const char *name;
        int value, low, high;
    } ranges[] = {
        {"width", o->width, 8, 4096},
        {"height", o->height, 8, 4096},
        {"cameras", o->n_cameras, 2, 99},
        {"held-out cameras", o->n_hold_out, 0, o->n_cameras - 2},
        {"frames", o->n_frames, 1, 100000},
        {"samples per axis", o->samples, 1, 8},
        {"depth every", o->depth_every, 0, 100000},
        {"points", o->n_points, 0, 1000000},
    };
    for (size_t i = 0; i < sizeof ranges / sizeof ranges[0]; i++) {
        char remedy[64];
        (void)snprintf(remedy, sizeof remedy, "use %d to %d", ranges[i].low,
                       ranges[i].high);
        if (ranges[i].value < ranges[i].low ||
            ranges[i].value > ranges[i].high)
            return saga_fail(error, folder, remedy, "%s: %d is out of range",
                             ranges[i].name, ranges[i].value);
    }
    if (!(o->fps > 0.0 && o->fps <= 10000.0))
        return saga_fail(error, folder, "use more than 0, up to 10000",
                         "frame rate %g is out of range", o->fps);
    return true;
}

/* ----------------------------------------------------------------- cameras */

/* Held-out views lie between training views, never at an arc's end if
 * avoidable. */
static bool is_held_out(const saga_synth_options *o, int index)
{
    for (int k = 0; k < o->n_hold_out; k++)
        if (index == (k + 1) * o->n_cameras / (o->n_hold_out + 1))
            return true;
    return false;
}

/* A stand says where a camera is, what it looks at, and its focal length in
 * widths of the picture. */
typedef struct stand {
    double centre[3], target[3], focal;
} stand;

static stand stand_on_arc(const saga_synth_options *o, int index)
{
    stand a = {.target = {0.0, 0.45, 0.82}, .focal = 0.9};
    /* 50 degrees of an arc, at two heights in turn. */
    const double turn = (-25.0 + 50.0 * index / (o->n_cameras - 1)) / 360.0;
    double s, c;
    saga_synth_sin_cos(turn, &s, &c);
    a.centre[0] = a.target[0] + 3.2 * s;
    a.centre[1] = a.target[1] - 3.2 * c;
    a.centre[2] = index % 2 ? 1.80 : 1.20;
    return a;
}

/* Goes all round, as people put tripods: evenly, but not quite. */
static stand stand_on_ring(const saga_synth_options *o, int index)
{
    stand a = {.target = {0.0, 0.0, 0.92}, .focal = 0.8};
    const double off = saga_ring_draw(o->seed, 500 + index, -0.1, 0.1);
    const double away = saga_ring_draw(o->seed, 600 + index, 3.1, 3.3);
    double s, c;
    saga_synth_sin_cos((index + off) / o->n_cameras, &s, &c);
    a.centre[0] = away * c;
    a.centre[1] = away * s;
    a.centre[2] = (index % 2 ? 1.95 : 1.05) +
                  saga_ring_draw(o->seed, 700 + index, -0.08, 0.08);
    return a;
}

void saga_synth_view(const saga_synth_options *options, int index,
                     saga_shot *view)
{
    const stand at = options->scene == SAGA_SYNTH_RING
                         ? stand_on_ring(options, index)
                         : stand_on_arc(options, index);
    double right[3], down[3], forward[3], n2 = 0.0;
    for (int i = 0; i < 3; i++) {
        forward[i] = at.target[i] - at.centre[i];
        n2 += forward[i] * forward[i];
    }
    for (int i = 0; i < 3; i++)
        forward[i] /= sqrt(n2);
    /* right = forward x up, down = forward x right */
    const double h = sqrt(forward[0] * forward[0] + forward[1] * forward[1]);
    right[0] = forward[1] / h;
    right[1] = -forward[0] / h;
    right[2] = 0.0;
    down[0] = forward[1] * right[2] - forward[2] * right[1];
    down[1] = forward[2] * right[0] - forward[0] * right[2];
    down[2] = forward[0] * right[1] - forward[1] * right[0];
    *view = (saga_shot){.width = options->width, .height = options->height,
                        .held_out = is_held_out(options, index),
                        .original_width = options->width,
                        .original_height = options->height,
                        .focal_scale = 1.0};
    /* Square pixels, and the principal point in the picture's middle. */
    view->fx = view->fy = at.focal * options->width;
    view->cx = 0.5 * options->width;
    view->cy = 0.5 * options->height;
    (void)snprintf(view->name, sizeof view->name, "cam%02d", index % 100);
    (void)saga_pose_from_axes(right, down, forward, at.centre, view->rotation,
                              view->translation);
}

/* Finds the direction of a pixel position, with z = 1 in the camera: the
 * distance along it is the depth. */
static void pixel_direction(const saga_shot *view, double u, double v,
                            double d[3])
{
    const double x = (u - view->cx) / view->fx, y = (v - view->cy) / view->fy;
    for (int i = 0; i < 3; i++)
        d[i] = view->rotation[i] * x + view->rotation[3 + i] * y +
               view->rotation[6 + i];
}

/* --------------------------------------------------------------- rendering */

typedef struct synth_job {
    const saga_synth_options *options;
    char *folder;             /* being filled */
    int lock;                 /* on it */
    saga_shot *views;         /* (n_cameras) */
    saga_error *error;
    const char *target;       /* final name, for messages */
    int first_failed, n_done; /* guarded by "omp critical(saga_synth)" */
} synth_job;

/* Turns light to 8 bits: gamma 2, exact on every machine. */
static uint8_t display(double light)
{
    const double x = sqrt(light > 0.0 ? light : 0.0) * 255.0 + 0.5;
    return x >= 255.0 ? 255 : (uint8_t)x;
}

static void render_pixel(const synth_job *job, const saga_synth_world *world,
                         const saga_shot *view, const double origin[3], int x,
                         int y, uint8_t *rgb)
{
    const int n = job->options->samples;
    double sum[3] = {0};
    for (int k = 0; k < n * n; k++) {
        double d[3], light[3];
        pixel_direction(view, x + (k % n + 0.5) / n, y + (k / n + 0.5) / n,
                        d);
        saga_synth_light(world, origin, d, light);
        for (int c = 0; c < 3; c++)
            sum[c] += light[c] < 1.0 ? light[c] : 1.0;
    }
    for (int c = 0; c < 3; c++)
        rgb[c] = display(sum[c] / (n * n));
}

static void render(const synth_job *job, int camera, int frame, uint8_t *rgb)
{
    const saga_shot *const view = &job->views[camera];
    saga_synth_world world;
    double origin[3];
    saga_synth_world_at(&world, job->options, frame / job->options->fps);
    saga_pose_centre(view->rotation, view->translation, origin);
    for (int y = 0; y < view->height; y++)
        for (int x = 0; x < view->width; x++, rgb += 3)
            render_pixel(job, &world, view, origin, x, y, rgb);
}

static void render_depth(const synth_job *job, int camera, int frame,
                         float *depth)
{
    const saga_shot *const view = &job->views[camera];
    saga_synth_world world;
    double origin[3], d[3];
    saga_synth_world_at(&world, job->options, frame / job->options->fps);
    saga_pose_centre(view->rotation, view->translation, origin);
    for (int y = 0; y < view->height; y++)
        for (int x = 0; x < view->width; x++) {
            pixel_direction(view, x + 0.5, y + 0.5, d);
            *depth++ = (float)saga_synth_look(&world, origin, d).distance;
        }
}

enum { MAX_PATH = 1200 };

static void picture_path(const synth_job *job, const char *kind,
                         const char *ending, int camera, int frame,
                         char path[MAX_PATH])
{
    (void)snprintf(path, MAX_PATH, "%s%s%s/%s/%05d.%s", job->folder,
                   job->folder[0] ? "/" : "", kind, job->views[camera].name,
                   frame, ending);
}

static bool has_depth(const saga_synth_options *o, int frame)
{
    return o->depth_every > 0 && frame % o->depth_every == 0;
}

static bool write_picture(const synth_job *job, int camera, int frame,
                          saga_error *error)
{
    const int w = job->options->width, h = job->options->height;
    const size_t n = (size_t)w * (size_t)h;
    const bool exr = job->options->exr;
    char path[MAX_PATH];
    uint8_t *const rgb = saga_alloc(n, 3, job->target, error);
    float *const depth = saga_alloc(n, sizeof *depth, job->target, error);
    bool ok = rgb && depth;
    if (ok) {
        render(job, camera, frame, rgb);
        picture_path(job, "images", exr ? "exr" : "png", camera, frame, path);
        ok = exr ? saga_exr_write(path, w, h, rgb, error)
                 : saga_png_write(path, w, h, rgb, error);
    }
    if (ok && has_depth(job->options, frame)) {
        render_depth(job, camera, frame, depth);
        picture_path(job, "depth", "exr", camera, frame, path);
        ok = saga_exr_write_depth(path, w, h, depth, error);
    }
    free(rgb);
    free(depth);
    return ok;
}

static void picture_done(synth_job *job, int item, bool ok,
                         const saga_error *error)
{
    const saga_synth_options *const o = job->options;
#pragma omp critical(saga_synth)
    {
        job->n_done++;
        /* The failure of the lowest number is told, whichever came first. -1,
         * a cancel, is below all of them. */
        if (!ok && item < job->first_failed) {
            job->first_failed = item;
            *job->error = *error;
        }
        if (job->first_failed == INT32_MAX && o->progress &&
            !o->progress(o->progress_user,
                         (double)job->n_done / (o->n_cameras * o->n_frames),
                         "rendering")) {
            job->first_failed = -1;
            saga_fail(job->error, job->target, NULL, "cancelled");
        }
    }
}

static bool picture_skipped(synth_job *job, int item)
{
    bool skip;
#pragma omp critical(saga_synth)
    /* Later pictures need not be made; earlier ones go on, since one of them
     * may fail and be the one to tell. */
    skip = job->first_failed < item;
    return skip;
}

static bool write_pictures(synth_job *job)
{
    const saga_synth_options *const o = job->options;
    const int n_threads = o->n_threads > 0 ? o->n_threads
                                           : omp_get_max_threads();
#pragma omp parallel for schedule(dynamic, 1) num_threads(n_threads)
    for (int i = 0; i < o->n_cameras * o->n_frames; i++) {
        saga_error error = { "" };
        if (picture_skipped(job, i))
            continue;
        const bool ok =
            write_picture(job, i / o->n_frames, i % o->n_frames, &error);
        picture_done(job, i, ok, &error);
    }
    return job->first_failed == INT32_MAX;
}

/* ------------------------------------------------------------------ points */

static uint32_t next_random(uint64_t *state)
{
    *state = *state * 6364136223846793005u + 1442695040888963407u;
    /* A linear congruential step, whose low bits are poor, then a mix of which
     * only the high half is used. */
    uint64_t x = *state ^ *state >> 33;
    x *= 0xff51afd7ed558ccdu;
    return (uint32_t)(x >> 32);
}

static double random_unit(uint64_t *state)
{
    return (next_random(state) + 0.5) * (1.0 / 4294967296.0);
}

/* Sums four uniforms, scaled to variance 1: near enough to a Gaussian, and
 * never far out. */
static double random_bell(uint64_t *state)
{
    double sum = -2.0;
    for (int i = 0; i < 4; i++)
        sum += random_unit(state);
    /* Four uniforms have a variance of 4 / 12; times sqrt(3) it is 1. */
    return sum * 1.7320508075688772;
}

static void radiance_at(const saga_shot *view, const saga_synth_world *world,
                        const double origin[3], double u, double v,
                        double rgb[3])
{
    double d[3];
    pixel_direction(view, u, v, d);
    saga_synth_light(world, origin, d, rgb);
}

/* Says how much the picture changes over 1.5 pixels, in display units 0..1. */
static double contrast(const saga_shot *view, const saga_synth_world *world,
                       const double origin[3], double u, double v,
                       double rgb[3])
{
    double other[3], sum = 0.0;
    radiance_at(view, world, origin, u, v, rgb);
    for (int k = 0; k < 2; k++) {
        radiance_at(view, world, origin, u + (k ? 0.0 : 1.5),
                    v + (k ? 1.5 : 0.0), other);
        for (int c = 0; c < 3; c++)
            sum += fabs(sqrt(other[c]) - sqrt(rgb[c]));
    }
    return sum / 3.0;
}

/* Says whether a training view but the one it came from sees it unhidden. */
static bool seen_again(const synth_job *job, const saga_synth_world *world,
                       const double point[3], int from)
{
    for (int i = 0; i < job->options->n_cameras; i++) {
        const saga_shot *const v = &job->views[i];
        double uv[2], z, origin[3], d[3];
        if (i == from || v->held_out || !saga_view_project(v, point, uv, &z))
            continue;
        if (uv[0] < 0.0 || uv[1] < 0.0 || uv[0] >= v->width ||
            uv[1] >= v->height)
            continue;
        saga_pose_centre(v->rotation, v->translation, origin);
        pixel_direction(v, uv[0], uv[1], d);
        /* That view sees the point if what lies first along the ray is as far.
         * */
        if (fabs(saga_synth_look(world, origin, d).distance - z) < 0.005 * z)
            return true;
    }
    return false;
}

/* Tries once; noise is as of half a pixel across and three times that along. */
static bool sample_point(const synth_job *job, const saga_synth_world *world,
                         uint64_t *random, saga_point *point)
{
    const int camera =
        (int)(random_unit(random) * job->options->n_cameras);
    const saga_shot *const view = &job->views[camera];
    const double u = random_unit(random) * view->width;
    const double v = random_unit(random) * view->height;
    const double dice = random_unit(random);
    double origin[3], d[3], rgb[3];
    if (view->held_out)
        return false;
    saga_pose_centre(view->rotation, view->translation, origin);
    /* Points come from where pictures have texture, as those of structure from
     * motion do; a few from anywhere. */
    if (dice > 0.06 + 6.0 * contrast(view, world, origin, u, v, rgb))
        return false;
    pixel_direction(view, u, v, d);
    const saga_synth_sight hit = saga_synth_look(world, origin, d);
    if (!hit.fixed ||
        !seen_again(job, world, hit.position, camera))
        return false;
    /* Half a pixel at that distance. */
    const double across = 0.5 * hit.distance / view->fx;
    const double along = 3.0 * across * random_bell(random);
    for (int i = 0; i < 3; i++) {
        point->position[i] = hit.position[i] +
                             across * random_bell(random) + along * d[i];
        point->rgb[i] = display(rgb[i]);
    }
    return true;
}

static bool write_points(const synth_job *job)
{
    const int wanted = job->options->n_points;
    saga_point *const points = saga_alloc((size_t)wanted, sizeof *points,
                                          job->target, job->error);
    uint64_t random = job->options->seed * 0x9e3779b97f4a7c15u + 1;
    saga_synth_world world;
    size_t n = 0;
    char path[MAX_PATH];
    if (!points)
        return false;
    saga_synth_world_at(&world, job->options, 0.0);
    /* The points are those of moment 0. A scene without texture gives up after
     * 100 tries for each, and has fewer. */
    for (long tries = 0; n < (size_t)wanted && tries < 100L * wanted; tries++)
        if (sample_point(job, &world, &random, &points[n]))
            n++;
    (void)snprintf(path, sizeof path, "%s/points.ply", job->folder);
    const bool ok = saga_ply_write(path, points, n, job->error);
    free(points);
    return ok;
}

/* -------------------------------------------------------------------- json */

static void write_matrix(FILE *f, const saga_shot *view)
{
    double centre[3];
    saga_pose_centre(view->rotation, view->translation, centre);
    fprintf(f, "\"transform_matrix\": [");
    for (int i = 0; i < 3; i++) {
        const double *const r = view->rotation;
        /* From camera to world; axes are right, up and backwards, as the format
         * has them: y and z of ours with the other sign. */
        fprintf(f, "[%.17g, %.17g, %.17g, %.17g], ", r[i], -r[3 + i],
                -r[6 + i], centre[i]);
    }
    fprintf(f, "[0, 0, 0, 1]]");
}

static void write_frame(FILE *f, const synth_job *job, int camera, int frame)
{
    synth_job relative = *job;
    char none[] = "", path[MAX_PATH];
    const saga_synth_options *const o = job->options;
    relative.folder = none;
    picture_path(&relative, "images", o->exr ? "exr" : "png", camera, frame,
                 path);
    fprintf(f, "  {\"file_path\": \"%s\", \"time\": %.17g,\n", path,
            frame / o->fps);
    if (has_depth(o, frame)) {
        picture_path(&relative, "depth", "exr", camera, frame, path);
        fprintf(f, "   \"depth_file_path\": \"%s\",\n", path);
    }
    fprintf(f, "   ");
    write_matrix(f, &job->views[camera]);
    fprintf(f, "}%s\n",
            camera == o->n_cameras - 1 && frame == o->n_frames - 1 ? "" : ",");
}

static void write_list(FILE *f, const synth_job *job, const char *key,
                       bool held_out)
{
    const saga_synth_options *const o = job->options;
    synth_job relative = *job;
    char none[] = "", path[MAX_PATH];
    const char *separator = "";
    relative.folder = none;
    fprintf(f, " \"%s\": [", key);
    for (int c = 0; c < o->n_cameras; c++)
        for (int k = 0; k < o->n_frames; k++) {
            if (job->views[c].held_out != held_out)
                continue;
            picture_path(&relative, "images", o->exr ? "exr" : "png", c, k,
                         path);
            fprintf(f, "%s\n  \"%s\"", separator, path);
            separator = ",";
        }
    fprintf(f, "],\n");
}

static bool write_json(const synth_job *job)
{
    const saga_synth_options *const o = job->options;
    const saga_shot *const view = &job->views[0];
    char path[MAX_PATH];
    saga_output out;
    (void)snprintf(path, sizeof path, "%s/transforms.json", job->folder);
    if (!saga_output_open(&out, path, job->error))
        return false;
    FILE *const f = out.file;
    fprintf(f, "{\n \"camera_model\": \"PINHOLE\",\n \"fps\": %.17g,\n"
            " \"w\": %d, \"h\": %d,\n \"fl_x\": %.17g, \"fl_y\": %.17g,\n"
            " \"cx\": %.17g, \"cy\": %.17g,\n"
            " \"ply_file_path\": \"points.ply\",\n",
            o->fps, o->width, o->height, view->fx, view->fy, view->cx,
            view->cy);
    write_list(f, job, "train_filenames", false);
    write_list(f, job, "test_filenames", true);
    fprintf(f, " \"frames\": [\n");
    for (int c = 0; c < o->n_cameras; c++)
        for (int k = 0; k < o->n_frames; k++)
            write_frame(f, job, c, k);
    fprintf(f, " ]\n}\n");
    return saga_output_close(&out, true, job->error);
}

/* ----------------------------------------------------------------- folders */

/* Removes a folder and the plain files in it. */
static void remove_flat(const char *path)
{
    DIR *const dir = opendir(path);
    char file[MAX_PATH + 300];
    for (struct dirent *e; dir && (e = readdir(dir)) != NULL;) {
        if (strcmp(e->d_name, ".") == 0 || strcmp(e->d_name, "..") == 0)
            continue;
        (void)snprintf(file, sizeof file, "%s/%s", path, e->d_name);
        (void)unlink(file);
    }
    if (dir)
        closedir(dir);
    (void)rmdir(path);
}

static const char *const kinds[] = {"images", "depth"};

static void remove_all(const synth_job *job)
{
    char path[MAX_PATH];
    /* The folders that this run has made, and the plain files in them. */
    for (int k = 0; k < 2; k++) {
        for (int c = 0; c < job->options->n_cameras; c++) {
            (void)snprintf(path, sizeof path, "%s/%s/%s", job->folder,
                           kinds[k], job->views[c].name);
            remove_flat(path);
        }
        (void)snprintf(path, sizeof path, "%s/%s", job->folder, kinds[k]);
        remove_flat(path);
    }
    remove_flat(job->folder);
}

static bool make_folder(const synth_job *job, const char *path)
{
    return mkdir(path, 0777) == 0 ||
           saga_fail_errno(job->error, job->target, "choose a place that can "
                           "be written", "folder cannot be made");
}

static bool make_folders(const synth_job *job)
{
    char path[MAX_PATH];
    for (int k = 0; k < (job->options->depth_every > 0 ? 2 : 1); k++) {
        (void)snprintf(path, sizeof path, "%s/%s", job->folder, kinds[k]);
        if (!make_folder(job, path))
            return false;
        for (int c = 0; c < job->options->n_cameras; c++) {
            (void)snprintf(path, sizeof path, "%s/%s/%s", job->folder,
                           kinds[k], job->views[c].name);
            if (!make_folder(job, path))
                return false;
        }
    }
    return true;
}

/* Makes it beside the final place, so that rename can move it in one step. */
static bool make_temporary(synth_job *job)
{
    size_t n = strlen(job->target);
    while (n > 1 && job->target[n - 1] == '/')
        n--;
    if (n > MAX_PATH - 200)
        return saga_fail(job->error, job->target, "use a shorter one",
                         "path is too long");
    char *const target = saga_alloc(n + 1, 1, job->target, job->error);
    if (!target)
        return false;
    memcpy(target, job->target, n);
    target[n] = '\0';
    job->folder = saga_output_folder(target, &job->lock, job->error);
    free(target);
    return job->folder != NULL;
}

static bool fill_folder(synth_job *job)
{
    if (!make_folders(job) || !write_pictures(job) || !write_points(job) ||
        !write_json(job))
        return false;
    /* All or nothing: the name is there only once the capture is whole. */
    return rename(job->folder, job->target) == 0 ||
           saga_fail_errno(job->error, job->target, "remove it or choose "
                           "another name", "is in the way");
}

/* Refuses a folder of files at the start, not after the rendering. */
static bool check_free(const synth_job *job)
{
    DIR *const dir = opendir(job->target);
    int n = 0;
    if (!dir && (errno == ENOENT))
        return true;
    for (struct dirent *e; dir && (e = readdir(dir)) != NULL;)
        n += strcmp(e->d_name, ".") != 0 && strcmp(e->d_name, "..") != 0;
    if (dir)
        closedir(dir);
    return (dir && n == 0) ||
           saga_fail(job->error, job->target, "remove it or choose another "
                     "name", "exists and is not an empty folder");
}

bool saga_synth_write(const char *folder, const saga_synth_options *options,
                      saga_error *error)
{
    synth_job job = {.options = options, .error = error, .target = folder,
                     .first_failed = INT32_MAX};
    *error = (saga_error){ "" };
    if (!check_options(options, folder, error) || !check_free(&job))
        return false;
    job.views = saga_calloc((size_t)options->n_cameras, sizeof *job.views,
                            folder, error);
    if (!job.views)
        return false;
    for (int i = 0; i < options->n_cameras; i++)
        saga_synth_view(options, i, &job.views[i]);
    bool ok = make_temporary(&job);
    if (ok) {
        ok = fill_folder(&job);
        if (!ok)
            remove_all(&job);
        close(job.lock);
    }
    free(job.folder);
    free(job.views);
    return ok;
}
