/* SPDX-License-Identifier: MIT
 *
 * Reads a sequence in the form of MPEG's immersive video (MIV): a JSON file of
 * "cameras", and for each view NAME_texture_WxH_yuv420p10le.yuv (or yuv420p, 8
 * bits), with NAME_depth_WxH_yuv420p16le.yuv or 10le beside it (miv_depth.h).
 * "sourceCameraNames" lists the views; without it all views except "viewport"
 * and "center" are read. Untagged YUV is taken as BT.709, limited range.
 *
 * Axes are x forward, y left, z up. "Rotation" has yaw, pitch and roll in
 * degrees; Rz(yaw) Ry(pitch) Rx(roll) maps camera to scene. The corner of a
 * picture is (0, 0). A perspective view is a pinhole with "Focal" and
 * "Principle_point". An equirectangular view becomes faces of 90 degrees side
 * by side over "Hor_range", with one more up and one down if it shows the whole
 * sphere. An orthographic view cannot be shown by a pinhole, so only its depth
 * is used.
 */
#include "alloc.h"
#include "error.h"
#include "file.h"
#include "json_memory.h"
#include "load.h"
#include "miv_depth.h"
#include "notes.h"
#include "picture.h"
#include "pose.h"
#include "utf8.h"

#include <jansson.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#define DEGREE 0.017453292519943295

typedef struct miv_reader {
    saga_listing *listing;
    const char *folder;
    char *path; /* path of the JSON */
    json_t *root;
    double fps;
    int frame; /* the first wanted frame */
    int n_left_out, n_depths;
    saga_error *error;
} miv_reader;

/* One camera of the JSON and its files. */
typedef struct miv_camera {
    const json_t *json;
    const char *name;
    char *video;
    saga_video_info info;
    char *depth; /* or NULL */
    int depth_width, depth_height, depth_bits;
    double matrix[9]; /* camera to scene */
    double centre[3];
} miv_camera;

/* ---------------------------------------------------------------- the JSON */

/* Reads an array of n numbers. */
static bool get_numbers(const miv_reader *r, const miv_camera *c,
                        const char *key, int n, double *to)
{
    const json_t *const a = json_object_get(c->json, key);
    for (int i = 0; i < n; i++) {
        const json_t *const x = json_array_get(a, (size_t)i);
        if (!json_is_number(x))
            return saga_fail(r->error, r->path, "correct the camera",
                             "\"%s\" of camera %s is missing or not %d "
                             "numbers",
                             key, c->name, n);
        to[i] = json_number_value(x);
    }
    return true;
}

static bool is_source(const miv_reader *r, const char *name)
{
    const json_t *const list = json_object_get(r->root, "sourceCameraNames");
    if (!json_is_array(list))
        return strcmp(name, "viewport") != 0 && strcmp(name, "center") != 0;
    for (size_t i = 0; i < json_array_size(list); i++) {
        const char *const s = json_string_value(json_array_get(list, i));
        if (s && strcmp(s, name) == 0)
            return true;
    }
    return false;
}

static bool get_pose(const miv_reader *r, miv_camera *c)
{
    double angle[3];
    if (!get_numbers(r, c, "Rotation", 3, angle) ||
        !get_numbers(r, c, "Position", 3, c->centre))
        return false;
    const double cy = cos(angle[0] * DEGREE), sy = sin(angle[0] * DEGREE);
    const double cp = cos(angle[1] * DEGREE), sp = sin(angle[1] * DEGREE);
    const double cr = cos(angle[2] * DEGREE), sr = sin(angle[2] * DEGREE);
    /* Rz(yaw) Ry(pitch) Rx(roll) multiplied out, row by row. */
    const double m[9] = { cy * cp,
                          cy * sp * sr - sy * cr,
                          cy * sp * cr + sy * sr,
                          sy * cp,
                          sy * sp * sr + cy * cr,
                          sy * sp * cr - cy * sr,
                          -sp,
                          cp * sr,
                          cp * cr };
    memcpy(c->matrix, m, sizeof m);
    return true;
}

/* ----------------------------------------------------------------- textures */

/* Reads the size and the pixel format from the part of a name after
 * "_texture_". Returns false if it has another form. */
static bool parse_texture(const char *s, saga_video_info *info)
{
    char format[24];
    int used = 0;
    if (sscanf(s, "%5dx%5d_%23[a-z0-9]%n", &info->width, &info->height, format,
               &used) != 3 ||
        strcmp(s + used, ".yuv") != 0)
        return false;
    info->raw = strcmp(format, "yuv420p10le") == 0 ? "yuv420p10le"
                : strcmp(format, "yuv420p") == 0   ? "yuv420p"
                                                   : NULL;
    return info->raw != NULL;
}

/* Reads size and pixel format like parse_texture from the part of a name after
 * "_depth_". */
static bool parse_depth(const char *s, miv_camera *c)
{
    char format[24];
    int used = 0;
    if (sscanf(s, "%5dx%5d_%23[a-z0-9]%n", &c->depth_width, &c->depth_height,
               format, &used) != 3 ||
        strcmp(s + used, ".yuv") != 0)
        return false;
    c->depth_bits = strcmp(format, "yuv420p16le") == 0   ? 16
                    : strcmp(format, "yuv420p10le") == 0 ? 10
                                                         : 0;
    return c->depth_bits > 0;
}

static bool is_raw(const char *name)
{
    return saga_has_suffix(name, ".yuv");
}

/* Finds the texture and the depth of a camera in the folder. */
static bool find_files(const miv_reader *r, miv_camera *c)
{
    const size_t n = strlen(c->name);
    saga_names names;
    bool ok = saga_folder_list(&names, r->folder, is_raw, r->error);
    for (size_t i = 0; ok && i < names.n; i++) {
        const char *const name = names.at[i];
        char **to = NULL;
        if (strncmp(name, c->name, n) != 0)
            continue;
        /* The "_" after the name keeps camera v1 from taking files of v10. */
        if (!c->video && strncmp(name + n, "_texture_", 9) == 0 &&
            parse_texture(name + n + 9, &c->info))
            to = &c->video;
        else if (!c->depth && strncmp(name + n, "_depth_", 7) == 0 &&
                 parse_depth(name + n + 7, c))
            to = &c->depth;
        if (to)
            *to = saga_path_join(r->folder, name, r->error);
        ok = !to || *to;
    }
    saga_names_free(&names);
    return c->video || !ok
               ? ok
               : saga_fail(r->error, r->folder,
                           "name it NAME_texture_WxH_"
                           "yuv420p10le.yuv or NAME_texture_WxH_yuv420p.yuv",
                           "has no texture of camera %s", c->name);
}

/* Checks a texture's size. The number of frames follows from the size of the
 * file. */
static bool measure_texture(const miv_reader *r, miv_camera *c)
{
    struct stat st;
    double size[2];
    if (!get_numbers(r, c, "Resolution", 2, size))
        return false;
    if (size[0] != c->info.width || size[1] != c->info.height)
        return saga_fail(r->error, c->video, "correct the name or the JSON",
                         "has %d x %d pixels by its name, but %g x %g by "
                         "\"Resolution\"",
                         c->info.width, c->info.height, size[0], size[1]);
    if (!saga_check_size(c->video, c->info.width, c->info.height, r->error))
        return false;
    if (c->info.width % 2 || c->info.height % 2)
        return saga_fail(r->error, c->video, "export it with even sides",
                         "has odd sides, %d x %d, which 4:2:0 does not allow",
                         c->info.width, c->info.height);
    /* 4:2:0 has 3/2 samples per pixel; a sample of 10 bits takes two bytes. */
    const long long frame = (long long)c->info.width * c->info.height * 3 / 2 *
                            (strcmp(c->info.raw, "yuv420p") == 0 ? 1 : 2);
    const long long n = stat(c->video, &st) == 0 ? (long long)st.st_size : 0;
    if (n < frame || n % frame != 0 || n / frame > SAGA_MAX_FRAMES)
        return saga_fail(r->error, c->video, "copy it again",
                         "has %lld "
                         "bytes, which is not 1 to %d frames of %lld bytes "
                         "each",
                         n, SAGA_MAX_FRAMES, frame);
    c->info.n_frames = (int)(n / frame);
    c->info.fps = r->fps;
    (void)snprintf(c->info.matrix, sizeof c->info.matrix, "bt709");
    return true;
}

/* ------------------------------------------------------------------ sources */

/* Adds a source with the given right, down and forward axes in the camera's
 * coordinates (x forward, y left, z up). `suffix` makes the names of faces
 * different. */
static saga_source *add_source(const miv_reader *r, const miv_camera *c,
                               const double axes[3][3], const char *suffix)
{
    saga_listing *const l = r->listing;
    double world[3][3];
    saga_source *const more = saga_realloc(l->sources, (size_t)l->n_sources + 1,
                                           sizeof *more, r->path, r->error);
    if (!more)
        return NULL;
    l->sources = more;
    saga_source *const s = &more[l->n_sources];
    char begin[51], name[2 * SAGA_NAME_NBYTES];
    /* The name is cut rather than the suffix, so that names of faces differ. */
    saga_utf8_copy(begin, sizeof begin, c->name, strlen(c->name));
    (void)snprintf(name, sizeof name, "%s%s", begin, suffix);
    *s = (saga_source){ .width = c->info.width,
                        .height = c->info.height,
                        .info = c->info };
    s->video = saga_string_copy(c->video, r->error);
    if (!s->video)
        return NULL;
    l->n_sources++;
    saga_copy_name(s->name, name, strlen(name));
    /* The source's axes in the scene are the camera's matrix times `axes`. */
    for (int a = 0; a < 3; a++)
        for (int i = 0; i < 3; i++)
            world[a][i] = c->matrix[3 * i] * axes[a][0] +
                          c->matrix[3 * i + 1] * axes[a][1] +
                          c->matrix[3 * i + 2] * axes[a][2];
    if (!saga_pose_from_axes(world[0], world[1], world[2], c->centre,
                             s->rotation, s->translation)) {
        saga_fail(r->error, r->path, "correct the camera",
                  "\"Rotation\" or "
                  "\"Position\" of camera %s is not finite",
                  c->name);
        return NULL;
    }
    return s;
}

/* Reads "Depth_range". Its far end may be a string, which means infinity. */
static bool get_depth_range(const miv_reader *r, const miv_camera *c,
                            double range[2])
{
    const json_t *const a = json_object_get(c->json, "Depth_range");
    const json_t *const far = json_array_get(a, 1);
    range[0] = json_number_value(json_array_get(a, 0));
    range[1] = json_is_string(far) ? INFINITY : json_number_value(far);
    return (range[0] > 0.0 && range[1] > range[0]) ||
           saga_fail(r->error, r->path, "correct the camera",
                     "\"Depth_range\" "
                     "of camera %s is not a range of depths above 0",
                     c->name);
}

static bool add_perspective(const miv_reader *r, const miv_camera *c)
{
    static const double axes[3][3] = { { 0, -1, 0 },
                                       { 0, 0, -1 },
                                       { 1, 0, 0 } };
    double f[2], p[2], range[2];
    if (!get_numbers(r, c, "Focal", 2, f) ||
        !get_numbers(r, c, "Principle_point", 2, p))
        return false;
    /* The axes are right, down and forward, which are the camera's -y, -z and
     * x. */
    saga_source *const s = add_source(r, c, axes, "");
    if (!s)
        return false;
    s->lens = (saga_lens){ .fx = f[0], .fy = f[1], .cx = p[0], .cy = p[1] };
    if (!json_object_get(c->json, "Depth_range"))
        return true;
    if (!get_depth_range(r, c, range))
        return false;
    /* If the far end is infinite, the range stays 0 and 0, which means
     * unknown. */
    if (isfinite(range[1])) {
        s->near_depth = range[0];
        s->far_depth = range[1];
    }
    return true;
}

/* Adds a face that looks `yaw` to the left and `pitch` upwards, in radians. */
static bool add_face(const miv_reader *r, const miv_camera *c,
                     const saga_lens *lens, double yaw, double pitch,
                     const char *suffix)
{
    const double cy = cos(yaw), sy = sin(yaw), cp = cos(pitch), sp = sin(pitch);
    /* The axes are right, down and forward, which are -y, -z and x of the
     * camera if yaw and pitch are 0. */
    const double axes[3][3] = { { sy, -cy, 0.0 },
                                { cy * sp, sy * sp, -cp },
                                { cy * cp, sy * cp, sp } };
    saga_source *const s = add_source(r, c, axes, suffix);
    if (!s)
        return false;
    s->lens = *lens;
    /* The turn maps the face's axes to those of the picture, which are right,
     * down and forward: the camera's -y, -z and x. */
    for (int a = 0; a < 3; a++) {
        s->lens.turn[a] = -axes[a][1];
        s->lens.turn[3 + a] = -axes[a][2];
        s->lens.turn[6 + a] = axes[a][0];
    }
    return true;
}

static bool add_equirectangular(const miv_reader *r, const miv_camera *c)
{
    double h[2], v[2];
    char suffix[16];
    if (!get_numbers(r, c, "Hor_range", 2, h) ||
        !get_numbers(r, c, "Ver_range", 2, v))
        return false;
    const double wide = h[1] - h[0], high = v[1] - v[0];
    if (!(wide >= 90.0 && wide <= 360.0 && high >= 90.0 && high <= 180.0))
        return saga_fail(r->error, r->path, "give degrees",
                         "\"Hor_range\" %g "
                         "to %g, \"Ver_range\" %g to %g of camera %s are no "
                         "ranges of 90 to 360 and 90 to 180",
                         h[0], h[1], v[0], v[1], c->name);
    saga_lens lens = { .equirect = true };
    lens.fx = c->info.width / (wide * DEGREE);
    lens.fy = c->info.height / (high * DEGREE);
    /* Longitude grows to the left and latitude upwards. The left side is at
     * h[1] and the top at v[1], so the pixel of 0 degrees is h[1] and v[1] in
     * radians times the pixels per radian away. */
    lens.cx = h[1] * DEGREE * lens.fx;
    lens.cy = v[1] * DEGREE * lens.fy;
    const int n = (int)(wide / 90.0);
    /* Faces lie side by side from left to right, centred in the range. */
    for (int i = 0; i < n; i++) {
        const double yaw = (h[0] + h[1]) / 2.0 + 90.0 * ((n - 1) / 2.0 - i);
        (void)snprintf(suffix, sizeof suffix, "_%d", i);
        if (!add_face(r, c, &lens, yaw * DEGREE, (v[0] + v[1]) / 2.0 * DEGREE,
                      suffix))
            return false;
    }
    return wide < 360.0 || high < 180.0 ||
           (add_face(r, c, &lens, 0.0, 90.0 * DEGREE, "_up") &&
            add_face(r, c, &lens, 0.0, -90.0 * DEGREE, "_down"));
}

/* Sets the coefficients that give the direction of a pixel (miv_depth.h). */
static bool get_directions(const miv_reader *r, const miv_camera *c,
                           saga_miv_depth *d)
{
    double h[2], v[2];
    const double w = c->info.width, high = c->info.height;
    if (d->kind == SAGA_MIV_PINHOLE) {
        if (!get_numbers(r, c, "Focal", 2, h) ||
            !get_numbers(r, c, "Principle_point", 2, v))
            return false;
        /* Slopes are (cx - u) / fx to the left and (cy - v) / fy upwards. */
        const double a[4] = { v[0] / h[0], -1.0 / h[0], v[1] / h[1],
                              -1.0 / h[1] };
        memcpy(d->a, a, sizeof a);
    } else if (d->kind == SAGA_MIV_EQUIRECT) {
        if (!get_numbers(r, c, "Hor_range", 2, h) ||
            !get_numbers(r, c, "Ver_range", 2, v))
            return false;
        /* Longitude runs from h[1] at the left side to h[0] at the right,
         * latitude from v[1] at the top to v[0] at the bottom. */
        const double a[4] = { h[1] * DEGREE, (h[0] - h[1]) * DEGREE / w,
                              v[1] * DEGREE, (v[0] - v[1]) * DEGREE / high };
        memcpy(d->a, a, sizeof a);
    } else {
        const double ow = json_number_value(
            json_object_get(c->json, "OrthoWidth"));
        const double oh = json_number_value(
            json_object_get(c->json, "OrthoHeight"));
        if (!(ow > 0.0 && oh > 0.0))
            return saga_fail(r->error, r->path, "correct the camera",
                             "\"OrthoWidth\" or \"OrthoHeight\" of camera %s "
                             "is not above 0",
                             c->name);
        const double a[4] = { -ow / 2.0, ow / w, -oh / 2.0, oh / high };
        memcpy(d->a, a, sizeof a);
    }
    return true;
}

/* All views together give about this number of points at most. */
enum { MOST_POINTS = 50000 };

static bool add_depth(miv_reader *r, const miv_camera *c, int kind)
{
    const json_t *const cameras = json_object_get(r->root, "cameras");
    saga_miv_depth d = {
        .texture = c->video,
        .depth = c->depth,
        .width = c->info.width,
        .height = c->info.height,
        .depth_bits = c->depth_bits,
        .texture_bits = strcmp(c->info.raw, "yuv420p") == 0 ? 8 : 10,
        .kind = (unsigned)kind,
        .has_invalid = json_is_true(json_object_get(c->json, "HasInvalidDepth"))
    };
    double range[2];
    if (!c->depth)
        return true;
    if (c->depth_width != d.width || c->depth_height != d.height)
        return saga_fail(r->error, c->depth,
                         "export it at the size of its "
                         "texture",
                         "has %d x %d pixels, not %d x %d", c->depth_width,
                         c->depth_height, d.width, d.height);
    if (!get_depth_range(r, c, range) || !get_directions(r, c, &d))
        return false;
    d.near = range[0];
    d.far = range[1];
    /* Depth is taken from the first wanted frame, where training starts. */
    d.frame = r->frame < c->info.n_frames ? r->frame : 0;
    memcpy(d.matrix, c->matrix, sizeof d.matrix);
    memcpy(d.centre, c->centre, sizeof d.centre);
    r->n_depths++;
    /* Each camera of the file has an equal share of the points, even if it is
     * no source. */
    return saga_miv_take_points(
        r->listing, &d, (int)(MOST_POINTS / json_array_size(cameras)) + 1,
        r->error);
}

static bool add_camera(miv_reader *r, miv_camera *c)
{
    const char *const projection = json_string_value(
        json_object_get(c->json, "Projection"));
    /* A camera becomes at most six sources: four faces around, one up, one
     * down. */
    if (r->listing->n_sources > SAGA_MAX_VIEWS - 8)
        return saga_fail(r->error, r->path, "split the capture",
                         "has more than %d views", SAGA_MAX_VIEWS);
    if (!get_pose(r, c) || !find_files(r, c) || !measure_texture(r, c))
        return false;
    if (projection && strcmp(projection, "Perspective") == 0)
        return add_perspective(r, c) && add_depth(r, c, SAGA_MIV_PINHOLE);
    if (projection && strcmp(projection, "Equirectangular") == 0)
        return add_equirectangular(r, c) && add_depth(r, c, SAGA_MIV_EQUIRECT);
    if (projection && strcmp(projection, "Orthographic") == 0) {
        r->n_left_out++;
        return add_depth(r, c, SAGA_MIV_ORTHO);
    }
    return saga_fail(r->error, r->path,
                     "render it as Perspective or "
                     "Equirectangular",
                     "\"Projection\" of camera %s is %s, "
                     "which is not supported",
                     c->name, projection ? projection : "missing");
}

static bool add_cameras(miv_reader *r)
{
    const json_t *const cameras = json_object_get(r->root, "cameras");
    const json_t *const fps = json_object_get(r->root, "Fps");
    bool ok = true;
    r->fps = json_is_number(fps) ? json_number_value(fps) : 0.0;
    if (json_is_true(json_object_get(r->root, "lengthsInMeters")))
        r->listing->metres = 1.0;
    /* Cameras that are no sources are skipped. */
    for (size_t i = 0; ok && i < json_array_size(cameras); i++) {
        miv_camera c = { .json = json_array_get(cameras, i) };
        c.name = json_string_value(json_object_get(c.json, "Name"));
        if (!c.name)
            ok = saga_fail(r->error, r->path, "name it",
                           "\"Name\" of "
                           "cameras[%zu] is missing or not a string",
                           i);
        else if (is_source(r, c.name))
            ok = add_camera(r, &c);
        free(c.video);
        free(c.depth);
    }
    if (ok && r->listing->n_sources == 0)
        ok = saga_fail(r->error, r->path, "list them in sourceCameraNames",
                       "has no source camera and no orthographic camera");
    return ok;
}

/* --------------------------------------------------------------- the folder */

static bool is_json(const char *name)
{
    return saga_has_suffix(name, ".json");
}

/* Returns the path of the first JSON file in a folder; NULL if there is none,
 * or no video without a header beside it. The caller frees it. */
static char *find_json(const char *folder, saga_error *error)
{
    saga_names raw, json = { 0 };
    char *path = NULL;
    if (saga_folder_list(&raw, folder, is_raw, error) && raw.n > 0 &&
        saga_folder_list(&json, folder, is_json, error) && json.n > 0)
        path = saga_path_join(folder, json.at[0], error);
    saga_names_free(&raw);
    saga_names_free(&json);
    return path;
}

static bool is_there(const char *folder, saga_error *error)
{
    char *const json = find_json(folder, error);
    free(json);
    return json != NULL;
}

static bool list(saga_listing *listing, const char *folder,
                 const saga_capture_options *options, saga_error *error)
{
    miv_reader r = { .listing = listing,
                     .folder = folder,
                     .error = error,
                     .frame = options->first_frame };
    char *const json = find_json(folder, error);
    r.path = json;
    r.root = r.path ? saga_json_read(r.path, error) : NULL;
    /* All sources must be known before their names, frame counts and held-out
     * views are settled. */
    bool ok = r.root && add_cameras(&r) &&
              saga_listing_check_names(listing, r.path, error) &&
              saga_listing_match_videos(listing, options, error) &&
              saga_listing_hold_out(listing, options->hold_out, error);
    if (ok)
        saga_note(listing->notes,
                  "colour: YUV is assumed to be BT.709 with "
                  "limited range; points: %zu from the depth of %d views",
                  listing->n_points, r.n_depths);
    if (ok && r.n_left_out > 0)
        saga_note(listing->notes,
                  "cameras: of %d orthographic ones only the "
                  "depth is used",
                  r.n_left_out);
    json_decref(r.root);
    free(json);
    return ok;
}

const saga_loader saga_miv_loader = {
    "MPEG MIV", "MIV's JSON with .yuv",
    "NAME.json and VIEW_texture_WxH_yuv420p10le.yuv, perspective or "
    "equirectangular (a sphere is converted to the faces of a cube); points "
    "are taken from VIEW_depth_WxH_yuv420p16le.yuv; tested on files of our own "
    "only",
    is_there, list
};
