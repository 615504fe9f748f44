/* SPDX-License-Identifier: MIT */
#include "render_path.h"

#include "alloc.h"
#include "file.h"
#include "json_memory.h"
#include "picture.h"
#include "vec3.h"

#include <jansson.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

/* The order of the numbers of a key camera. */
enum {
    SECONDS,
    FRAME,
    FOV,
    EYE,
    TARGET = EYE + 3,
    UP = TARGET + 3,
    KEY_LENGTH = UP + 3
};

typedef double key_row[KEY_LENGTH];

typedef struct {
    const char *name; /* name of the file */
    saga_path *path;
    saga_error *error;
} reader;

static const double pi = 3.14159265358979323846;

/* --- Poses --------------------------------------------------------------- */

bool saga_look_at(double rotation[9], const double eye[3],
                  const double target[3], const double up[3])
{
    double *const right = rotation, *const down = rotation + 3;
    double *const forward = rotation + 6;

    for (int i = 0; i < 3; i++)
        forward[i] = target[i] - eye[i];
    if (!normalise3(forward))
        return false;
    /* y is down, so right = forward x up and down = forward x right. If up is
     * parallel to forward, there is no right. */
    cross3(right, forward, up);
    if (!normalise3(right))
        return false;
    cross3(down, forward, right);
    return true;
}

/* Adapts a lens to another size of picture, so that everything that it saw
 * stays visible. */
static void scale_lens(saga_source_view *view, const saga_path_lens *lens)
{
    const double sx = (double)view->width / lens->width;
    const double sy = (double)view->height / lens->height;
    const double scale = fmin(sx, sy);

    /* The smaller factor cuts nothing off. The principal point keeps its scaled
     * offset from the centre. */
    view->fx = scale * lens->fx;
    view->fy = scale * lens->fy;
    view->cx = 0.5 * view->width + scale * (lens->cx - 0.5 * lens->width);
    view->cy = 0.5 * view->height + scale * (lens->cy - 0.5 * lens->height);
}

void saga_path_view(saga_source_view *view, const saga_path_camera *camera,
                    int width, int height)
{
    *view =
        (saga_source_view){ .name = "path", .width = width, .height = height };
    if (camera->fov > 0.0) {
        /* Half of the height is f tan(fov / 2); pi / 360 converts half of the
         * degrees to radians. */
        view->fx = 0.5 * height / tan(camera->fov * pi / 360.0);
        view->fy = view->fx;
        view->cx = 0.5 * width;
        view->cy = 0.5 * height;
    } else {
        scale_lens(view, &camera->lens);
    }
    memcpy(view->rotation, camera->rotation, sizeof view->rotation);
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++)
            view->translation[i] -= view->rotation[3 * i + k] *
                                    camera->centre[k];
}

/* --- JSON ---------------------------------------------------------------- */

static bool bad(const reader *r, size_t i, const char *what)
{
    return saga_fail(r->error, r->name, "`saga help render` has an example",
                     "camera %zu of the path has no valid \"%s\"", i + 1, what);
}

static bool number_of(double *v, const json_t *value)
{
    *v = json_number_value(value);
    return json_is_number(value) && isfinite(*v);
}

/* Reads an array of exactly n numbers. */
static bool numbers_of(double *v, const json_t *array, size_t n)
{
    bool ok = json_is_array(array) && json_array_size(array) == n;

    for (size_t i = 0; ok && i < n; i++)
        ok = number_of(&v[i], json_array_get(array, i));
    return ok;
}

static bool is_fov(double v)
{
    return v > 0.0 && v < 180.0;
}

static bool make_room(const reader *r, double n)
{
    if (!(n >= 1.0 && n <= SAGA_MAX_PATH))
        return saga_fail(r->error, r->name, "give it 1 to 100000",
                         "the path has %.0f pictures", n);
    r->path->n = (int)n;
    r->path->camera = saga_calloc((size_t)n, sizeof *r->path->camera, r->name,
                                  r->error);
    return r->path->camera != NULL;
}

/* Reads rate and size. A missing value stays 0; a size must be valid. */
static bool read_frame(const reader *r, const json_t *fps, const json_t *width,
                       const json_t *height)
{
    saga_path *const p = r->path;

    if (fps && (!number_of(&p->fps, fps) || p->fps <= 0.0))
        return saga_fail(r->error, r->name, "give pictures per second",
                         "its \"fps\" is not a number above 0");
    if (!width && !height)
        return true;
    p->width = (int)json_integer_value(width);
    p->height = (int)json_integer_value(height);
    return saga_check_size(r->name, json_integer_value(width),
                           json_integer_value(height), r->error);
}

/* --- Key cameras --------------------------------------------------------- */

static bool read_key(const reader *r, double *row, const json_t *key, size_t i)
{
    static const struct {
        const char *name;
        int at;
        size_t n; /* 1: a number; otherwise an array of n */
    } parts[] = { { "seconds", SECONDS, 1 }, { "frame", FRAME, 1 },
                  { "fov", FOV, 1 },         { "eye", EYE, 3 },
                  { "target", TARGET, 3 },   { "up", UP, 3 } };

    for (size_t p = 0; p < sizeof parts / sizeof parts[0]; p++) {
        const json_t *const value = json_object_get(key, parts[p].name);
        double *const to = row + parts[p].at;

        if (parts[p].n == 1 ? !number_of(to, value)
                            : !numbers_of(to, value, parts[p].n))
            return bad(r, i, parts[p].name);
    }
    return is_fov(row[FOV]) || bad(r, i, "fov");
}

static int by_seconds(const void *a, const void *b)
{
    const double x = ((const double *)a)[SECONDS];
    const double y = ((const double *)b)[SECONDS];

    return (x > y) - (x < y);
}

/* Returns the slope of number c at key i, from the keys before and after it. At
 * an end the slope of the only adjacent interval is used. */
static double slope(const key_row *key, int n, int i, int c)
{
    const int a = i > 0 ? i - 1 : 0, b = i + 1 < n ? i + 1 : n - 1;
    const double span = key[b][SECONDS] - key[a][SECONDS];

    return span > 0.0 ? (key[b][c] - key[a][c]) / span : 0.0;
}

/* Interpolates a row at a time between the first and the last key. */
static void row_at(double *row, const key_row *key, int n, double seconds)
{
    int i = 0;
    double span, x;

    /* The interval from key i to the next key; the last interval has no upper
     * limit. */
    while (i + 2 < n && key[i + 1][SECONDS] <= seconds)
        i++;
    span = n > 1 ? key[i + 1][SECONDS] - key[i][SECONDS] : 0.0;
    x = span > 0.0 ? (seconds - key[i][SECONDS]) / span : 0.0;
    /* Hermite's cubic in x, which runs from 0 to 1 over the interval: a and b
     * are the values at its ends, m and e the slopes there per interval. */
    for (int c = 0; c < KEY_LENGTH; c++) {
        const double a = key[i][c], b = key[n > 1 ? i + 1 : i][c];
        const double m = span * slope(key, n, i, c);
        const double e = n > 1 ? span * slope(key, n, i + 1, c) : 0.0;

        row[c] = a + x * (m + x * (3.0 * (b - a) - 2.0 * m - e +
                                   x * (2.0 * (a - b) + m + e)));
    }
}

static bool play_keys(const reader *r, const key_row *key, int n)
{
    saga_path *const p = r->path;
    const double fps = p->fps > 0.0 ? p->fps : 30.0;
    const double start = key[0][SECONDS];

    p->fps = fps;
    p->clock = SAGA_PATH_FRAMES;
    /* The small term keeps the last key if its time was rounded down. */
    if (!make_room(r, floor((key[n - 1][SECONDS] - start) * fps + 1e-6) + 1.0))
        return false;
    for (int i = 0; i < p->n; i++) {
        saga_path_camera *const c = &p->camera[i];
        key_row row;

        row_at(row, key, n, start + i / fps);
        if (!is_fov(row[FOV]) ||
            !saga_look_at(c->rotation, row + EYE, row + TARGET, row + UP))
            return saga_fail(r->error, r->name,
                             "keep eye and target apart, "
                             "and up away from the line through both",
                             "picture %d of the path has no direction", i + 1);
        memcpy(c->centre, row + EYE, sizeof c->centre);
        c->fov = row[FOV];
        c->time = row[FRAME];
    }
    return true;
}

static bool read_keys(const reader *r, const json_t *root)
{
    const json_t *const keys = json_object_get(root, "keys");
    const json_t *const size = json_object_get(root, "size");
    const size_t n = json_array_size(keys);
    key_row *key;
    bool ok;

    if (n < 1 || n > SAGA_MAX_PATH)
        return saga_fail(r->error, r->name, "give one or more",
                         "its path has %zu \"keys\"", n);
    key = saga_alloc(n, sizeof *key, r->name, r->error);
    ok = key && read_frame(r, json_object_get(root, "fps"),
                           json_array_get(size, 0), json_array_get(size, 1));
    for (size_t i = 0; ok && i < n; i++)
        ok = read_key(r, key[i], json_array_get(keys, i), i);
    if (ok) {
        /* The file may list keys in any order. */
        qsort(key, n, sizeof *key, by_seconds);
        ok = play_keys(r, (const key_row *)key, (int)n);
    }
    free(key);
    return ok;
}

/* --- nerfstudio ---------------------------------------------------------- */

/* Sets the pose from m, a 3 x 4 camera-to-world matrix with y up and z
 * backwards. */
static bool read_pose(saga_path_camera *c, const double *m)
{
    /* Columns of m are the axes right, up and back. Rows of a rotation here are
     * right, down and forward. */
    for (int i = 0; i < 3; i++) {
        double axis[3] = { m[i], m[4 + i], m[8 + i] };
        const double sign = i ? -1.0 : 1.0;

        if (!normalise3(axis))
            return false;
        for (int k = 0; k < 3; k++)
            c->rotation[3 * i + k] = sign * axis[k];
        c->centre[i] = m[4 * i + 3];
    }
    return true;
}

static bool read_picture(const reader *r, const json_t *picture, size_t i)
{
    saga_path_camera *const c = &r->path->camera[i];
    const json_t *const time = json_object_get(picture, "render_time");
    double m[16];

    if (!numbers_of(m, json_object_get(picture, "camera_to_world"), 16) ||
        !read_pose(c, m))
        return bad(r, i, "camera_to_world");
    if (!number_of(&c->fov, json_object_get(picture, "fov")) || !is_fov(c->fov))
        return bad(r, i, "fov");
    if (time && number_of(&c->time, time))
        r->path->clock = SAGA_PATH_SHARE;
    return true;
}

static bool read_nerfstudio(const reader *r, const json_t *root)
{
    const json_t *const list = json_object_get(root, "camera_path");
    const json_t *const type = json_object_get(root, "camera_type");
    const size_t n = json_array_size(list);
    bool ok = make_room(r, (double)n);

    if (ok && type &&
        (!json_is_string(type) ||
         strcmp(json_string_value(type), "perspective") != 0))
        return saga_fail(r->error, r->name, "export a perspective one",
                         "its \"camera_type\" is not \"perspective\"");
    ok = ok && read_frame(r, json_object_get(root, "fps"),
                          json_object_get(root, "render_width"),
                          json_object_get(root, "render_height"));
    for (size_t i = 0; ok && i < n; i++)
        ok = read_picture(r, json_array_get(list, i), i);
    return ok;
}

/* --- Together ------------------------------------------------------------ */

static bool read_root(const reader *r, const json_t *root)
{
    const char *const format = json_string_value(
        json_object_get(root, "format"));

    if (format && !strcmp(format, "saga camera path 1"))
        return read_keys(r, root);
    if (json_object_get(root, "camera_path"))
        return read_nerfstudio(r, root);
    return saga_fail(r->error, r->name,
                     "save one in `saga view` or in "
                     "nerfstudio's viewer",
                     "is not a camera path");
}

static bool read_json(saga_path *path, const char *name, saga_error *error)
{
    const reader r = { name, path, error };
    json_t *const root = saga_json_read(name, error);
    const bool ok = root && read_root(&r, root);

    json_decref(root);
    return ok;
}

/* Reads COLMAP's files in the folder name[0..n). */
static bool read_beside(saga_path *path, const char *name, size_t n,
                        saga_error *error)
{
    char *const folder = saga_alloc(n + 2, 1, name, error);
    bool ok;

    if (!folder)
        return false;
    memcpy(folder, name, n);
    /* A name without a folder is in the current folder. */
    strcpy(folder + n, n ? "" : ".");
    ok = saga_path_read_colmap(path, folder, saga_has_suffix(name, ".bin"),
                               error);
    free(folder);
    return ok;
}

bool saga_path_read(saga_path *path, const char *name, saga_error *error)
{
    const char *const base = saga_path_base(name);
    bool ok;

    *path = (saga_path){ 0 };
    ok = strcmp(base, "images.txt") != 0 && strcmp(base, "images.bin") != 0
             ? read_json(path, name, error)
             : read_beside(path, name, (size_t)(base - name), error);
    if (!ok)
        saga_path_free(path);
    return ok;
}

void saga_path_free(saga_path *path)
{
    free(path->camera);
    *path = (saga_path){ 0 };
}
