/* SPDX-License-Identifier: MIT
 *
 * Real captures, if ../shared/data has them. studio (Neu3D with a COLMAP model
 * and true depth) is compared with the numbers in its README; person4
 * (nerfstudio with lens distortion) with its own frames as ffmpeg decodes them,
 * and with OpenCV's formula.
 */
#include "capture_files.h"
#include "order.h"
#include "testing.h"

#include <jansson.h>

#define DATA "../shared/data/"

/* Returns true, after a message, if a data set is missing, or under sanitizers,
 * which run the same code on smaller captures. */
static bool left_out(const char *name)
{
    char path[80];

    if (testing_sanitized()) {
        printf("skipped: %s is not read with sanitizers\n", name);
        return true;
    }
    snprintf(path, sizeof path, DATA "%s", name);
    if (saga_path_is_folder(path))
        return false;
    printf("skipped: there is no %s\n", path);
    return true;
}

static saga_capture load_frame(const char *path, bool want_depth)
{
    saga_capture_options o = saga_capture_defaults();

    o.end_frame = 1;
    o.want_depth = want_depth;
    return load_with(path, &o);
}

static double quantile(double *x, int n, double q)
{
    assert_true(n > 0);
    return saga_quantile(x, (size_t)n, q);
}

/* --- studio -------------------------------------------------------------- */

enum { STUDIO_VIEWS = 14, MAX_ID = 4096, MAX_SEEN = 20000 };

/* A COLMAP model in text, read line by line according to its description. */
typedef struct {
    double position[MAX_ID][3];
    int n_training[MAX_ID]; /* distinct views without cam00; -1: no point */
    int image_of_view[STUDIO_VIEWS];
} studio_points;

static FILE *open_text(const char *name)
{
    return must(fopen(name, "r"));
}

static void read_tracks(studio_points *s, char *text, int id)
{
    bool seen[64] = { false };
    int n = 0;

    for (char *at = strtok(text, " \n"); at; at = strtok(NULL, " \n")) {
        const int image = atoi(at);

        assert_in_range(image, 0, 63);
        strtok(NULL, " \n");
        if (image != s->image_of_view[0] && !seen[image])
            n++;
        seen[image] = true;
    }
    s->n_training[id] = n;
}

static void read_studio_points(studio_points *s)
{
    FILE *const file = open_text(DATA "studio/colmap/points3D.txt");
    static char line[1 << 16];

    for (int i = 0; i < MAX_ID; i++)
        s->n_training[i] = -1;
    while (fgets(line, sizeof line, file)) {
        double x[3], error;
        int id, rgb[3], used;

        if (line[0] == '#')
            continue;
        assert_int_equal(sscanf(line, "%d %lf %lf %lf %d %d %d %lf%n", &id, x,
                                x + 1, x + 2, rgb, rgb + 1, rgb + 2, &error,
                                &used),
                         8);
        assert_in_range(id, 0, MAX_ID - 1);
        memcpy(s->position[id], x, sizeof x);
        read_tracks(s, line + used, id);
    }
    fclose(file);
}

static void read_studio_images(studio_points *s)
{
    FILE *const file = open_text(DATA "studio/colmap/images.txt");
    static char line[1 << 20];

    while (fgets(line, sizeof line, file)) {
        const char *const name = strstr(line, " cam");

        if (line[0] == '#')
            continue;
        assert_non_null(name);
        assert_in_range(atoi(name + 4), 0, STUDIO_VIEWS - 1);
        s->image_of_view[atoi(name + 4)] = atoi(line);
        assert_non_null(fgets(line, sizeof line, file));
    }
    fclose(file);
}

/* The distances of all features with a point from the projected points, in
 * pixels, and the relative errors of their depths. */
typedef struct {
    double distance[MAX_SEEN], depth[MAX_SEEN];
    int n;
} studio_errors;

static void measure_line(studio_errors *e, const studio_points *s,
                         const saga_source_view *v, char *text)
{
    for (char *at = strtok(text, " \n"); at; at = strtok(NULL, " \n")) {
        const double x = atof(at), y = atof(strtok(NULL, " \n"));
        const int id = atoi(strtok(NULL, " \n"));
        double uv[2] = { 0 }, z, truth;

        if (id < 0)
            continue;
        assert_true(e->n < MAX_SEEN && s->n_training[id] >= 0);
        assert_true(saga_view_project(v, s->position[id], uv, &z));
        truth = (double)v->depth[0][(int)y * v->width + (int)x];
        e->distance[e->n] = hypot(uv[0] - x, uv[1] - y);
        e->depth[e->n++] = fabs(z - truth) / truth;
    }
}

static void measure_studio(studio_errors *e, const studio_points *s,
                           const saga_capture *c)
{
    FILE *const file = open_text(DATA "studio/colmap/images.txt");
    static char line[1 << 20];

    while (fgets(line, sizeof line, file)) {
        const char *const name = strstr(line, " cam");

        if (line[0] == '#')
            continue;
        assert_non_null(name);
        const saga_source_view *const v = c->views + atoi(name + 4);

        assert_non_null(fgets(line, sizeof line, file));
        measure_line(e, s, v, line);
    }
    fclose(file);
}

static void check_studio_views(const saga_capture *c)
{
    assert_int_equal(c->n_views, STUDIO_VIEWS);
    assert_true(c->fps == 30);
    for (int i = 0; i < STUDIO_VIEWS; i++) {
        const saga_source_view *const v = c->views + i;
        char name[8];

        snprintf(name, sizeof name, "cam%02d", i);
        assert_string_equal(v->name, name);
        assert_int_equal(v->held_out, i == 0);
        assert_true(v->width == 480 && v->height == 270 && v->fx == 400 &&
                    v->fy == 400 && v->cx == 240 && v->cy == 135);
        assert_true(v->near_depth > 0 && v->far_depth > v->near_depth);
    }
}

/* The README gives 2490 points, 11851 observations, a median distance of 0.143
 * px (p90 0.69), and |depth - true| / true with median 0.14 % (p90 1.3 %). */
static void check_studio_points(const saga_capture *c)
{
    static studio_points s;
    static studio_errors e;
    size_t n_kept = 0;

    read_studio_images(&s);
    read_studio_points(&s);
    for (int i = 0; i < MAX_ID; i++)
        n_kept += s.n_training[i] >= 2;
    assert_int_equal(c->n_points, n_kept);
    assert_in_range(n_kept, 2000, 2489);
    measure_studio(&e, &s, c);
    assert_int_equal(e.n, 11851);
    printf("studio: %zu points, reprojection %.3f px median, %.2f px p90; "
           "depth %.2f %% median, %.1f %% p90\n",
           n_kept, quantile(e.distance, e.n, 0.5),
           quantile(e.distance, e.n, 0.9), 100 * quantile(e.depth, e.n, 0.5),
           100 * quantile(e.depth, e.n, 0.9));
    assert_true(fabs(quantile(e.distance, e.n, 0.5) - 0.143) < 0.001);
    assert_true(fabs(quantile(e.distance, e.n, 0.9) - 0.69) < 0.01);
    assert_true(fabs(quantile(e.depth, e.n, 0.5) - 0.0014) < 0.0001);
    assert_true(fabs(quantile(e.depth, e.n, 0.9) - 0.013) < 0.001);
}

/* Pixels of view a are lifted with the true depth and projected into view b.
 * For cam01 to cam02 the README has: 90 % in view, 73 % visible, median
 * difference of colour 3.3. */
static void check_studio_pixels(const saga_capture *c, int from, int to,
                                double in_view, double visible)
{
    const saga_source_view *const a = c->views + from, *const b = c->views + to;
    static double colour[480 * 270];
    const int n = a->width * a->height;
    int n_inside = 0, n_seen = 0;
    double median;

    for (int i = 0; i < n; i++) {
        const double z = (double)a->depth[0][i];
        const double cam[3] = {
            (i % 480 + 0.5 - a->cx) / a->fx * z - a->translation[0],
            (i / 480 + 0.5 - a->cy) / a->fy * z - a->translation[1],
            z - a->translation[2]
        };
        double x[3], uv[2], depth, truth;
        int at;

        for (int k = 0; k < 3; k++)
            x[k] = a->rotation[k] * cam[0] + a->rotation[3 + k] * cam[1] +
                   a->rotation[6 + k] * cam[2];
        if (!saga_view_project(b, x, uv, &depth) || uv[0] < 0 || uv[1] < 0 ||
            uv[0] >= 480 || uv[1] >= 270)
            continue;
        n_inside++;
        at = (int)uv[1] * 480 + (int)uv[0];
        truth = (double)b->depth[0][at];
        if (fabs(depth - truth) > 0.01 * truth)
            continue;
        colour[n_seen++] = abs(saga_capture_frame(c, from, 0)[3 * i + 1] -
                               saga_capture_frame(c, to, 0)[3 * at + 1]);
    }
    median = quantile(colour, n_seen, 0.5);
    printf("studio: %s to %s: in view %.0f %%, visible %.0f %%, green |d| "
           "median %.0f\n",
           a->name, b->name, 100.0 * n_inside / n, 100.0 * n_seen / n, median);
    assert_true(fabs((double)n_inside / n - in_view) < 0.01);
    /* Fewer pixels are visible by the README's test of occlusion, which is
     * stricter. */
    assert_true((double)n_seen / n >= visible && n_seen <= n_inside);
    /* The README's median is smaller, because it interpolates and takes all
     * channels. */
    assert_true(median <= 4);
}

/* Checks that a view sees more than half of the points. */
static void check_points_inside(const saga_capture *c,
                                const saga_source_view *v)
{
    size_t n = 0;

    for (size_t i = 0; i < c->n_points; i++) {
        double uv[2], depth;

        n += saga_view_project(v, c->points[i].position, uv, &depth) &&
             uv[0] >= 0 && uv[1] >= 0 && uv[0] < v->width && uv[1] < v->height;
    }
    assert_true(2 * n > c->n_points);
}

TEST(studio_should_agree_with_its_readme)
{
    FREED_BY(saga_capture_free) saga_capture c;

    if (left_out("studio"))
        skip();
    c = load_frame(DATA "studio", true);
    check_studio_views(&c);
    check_studio_points(&c);
    check_studio_pixels(&c, 1, 2, 0.90, 0.73);
    check_studio_pixels(&c, 0, 11, 0.93, 0.75);
    for (int i = 0; i < c.n_views; i++)
        check_points_inside(&c, &c.views[i]);
}

/* --- person4 ------------------------------------------------------------- */

enum { P_W = 360, P_H = 632 };

/* Decodes the first frame of the file, with its lens distortion. */
static void decode_raw(const char *name, uint8_t *rgb)
{
    char command[400];
    FILE *pipe;

    snprintf(command, sizeof command,
             "ffmpeg -nostdin -v error -i " DATA
             "person4/%s -frames:v 1 -vf scale=in_color_matrix=bt709:"
             "in_range=limited:flags=bicubic+accurate_rnd+full_chroma_int "
             "-pix_fmt rgb24 -f rawvideo -",
             name);
    pipe = popen(command, "r");
    assert_non_null(pipe);
    assert_int_equal(fread(rgb, 3, P_W * P_H, pipe), P_W * P_H);
    assert_int_equal(pclose(pipe), 0);
}

static double number(const json_t *frame, const char *key)
{
    return json_number_value(json_object_get(frame, key));
}

static double bilinear(const uint8_t *rgb, double u, double v, int k)
{
    const int x = (int)floor(u - 0.5), y = (int)floor(v - 0.5);
    const double a = u - 0.5 - x, b = v - 0.5 - y;
    double sum = 0;

    assert_true(u >= 0.5 && v >= 0.5 && u <= P_W - 0.5 && v <= P_H - 0.5);
    for (int i = 0; i < 4; i++) {
        const int xi = x + i % 2 < P_W ? x + i % 2 : x;
        const int yi = y + i / 2 < P_H ? y + i / 2 : y;

        sum += (i % 2 ? a : 1 - a) * (i / 2 ? b : 1 - b) *
               rgb[3 * (yi * P_W + xi) + k];
    }
    return sum;
}

/* Checks that every pixel of the view comes from the place in the frame that
 * OpenCV's formula gives. */
static void check_lens(const saga_capture *c, int view, const json_t *frame)
{
    const double k1 = number(frame, "k1"), k2 = number(frame, "k2");
    const double p1 = number(frame, "p1"), p2 = number(frame, "p2");
    const saga_source_view *const v = c->views + view;
    const uint8_t *const rgb = saga_capture_frame(c, view, 0);
    static uint8_t raw[3 * P_W * P_H];
    double farthest = 0, worst = 0;

    decode_raw(json_string_value(json_object_get(frame, "file_path")), raw);
    for (int i = 0; i < P_W * P_H; i += 7) {
        const double x = (i % P_W + 0.5 - v->cx) / v->fx;
        const double y = (i / P_W + 0.5 - v->cy) / v->fy;
        const double r2 = x * x + y * y, g = 1 + k1 * r2 + k2 * r2 * r2;
        const double xd = x * g + 2 * p1 * x * y + p2 * (r2 + 2 * x * x);
        const double yd = y * g + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y;
        const double from[2] = {
            number(frame, "fl_x") * xd + number(frame, "cx"),
            number(frame, "fl_y") * yd + number(frame, "cy")
        };

        farthest = fmax(
            farthest, hypot(from[0] - i % P_W - 0.5, from[1] - i / P_W - 0.5));
        for (int k = 0; k < 3; k++)
            worst = fmax(worst, fabs(bilinear(raw, from[0], from[1], k) -
                                     rgb[3 * i + k]));
    }
    printf("person4: %s moves pixels by up to %.1f, focal length x %.4f, "
           "worst difference %.2f\n",
           v->name, farthest, v->focal_scale, worst);
    /* The tolerance covers rounding, and positions to 1/512 pixel, which at
     * full contrast are up to 1/2. */
    assert_true(worst < 1.6);
    assert_true(farthest > 0.5);
}

/* Returns the luma at a world point, or -1 if the view does not see it. */
static double luma_at(const saga_capture *c, int view, const double x[3])
{
    const saga_source_view *const v = c->views + view;
    double uv[2], z;

    if (!saga_view_project(v, x, uv, &z) || uv[0] < 0.5 || uv[1] < 0.5 ||
        uv[0] > P_W - 0.5 || uv[1] > P_H - 0.5)
        return -1;
    return 0.3 * bilinear(saga_capture_frame(c, view, 0), uv[0], uv[1], 0) +
           0.6 * bilinear(saga_capture_frame(c, view, 0), uv[0], uv[1], 1) +
           0.1 * bilinear(saga_capture_frame(c, view, 0), uv[0], uv[1], 2);
}

/* Returns the correlation of the points' luma with the view's luma at the same
 * points moved by (dx, dy, 0). A correlation is used because front and rear
 * cameras differ in exposure. */
static double likeness(const saga_capture *c, int view, double dx, double dy)
{
    double n = 0, a = 0, b = 0, aa = 0, bb = 0, ab = 0;

    for (size_t i = 0; i < c->n_points; i++) {
        const saga_point *const p = c->points + i;
        const double x[3] = { p->position[0] + dx, p->position[1] + dy,
                              p->position[2] };
        const double own = 0.3 * p->rgb[0] + 0.6 * p->rgb[1] + 0.1 * p->rgb[2];
        const double seen = luma_at(c, view, x);

        if (seen < 0)
            continue;
        n++;
        a += own;
        b += seen;
        aa += own * own;
        bb += seen * seen;
        ab += own * seen;
    }
    assert_true(n > 500);
    return (n * ab - a * b) / sqrt((n * aa - a * a) * (n * bb - b * b));
}

/* Checks that moving the points by 2 cm in any direction makes the pictures
 * less like them. */
static void check_points(const saga_capture *c, int view)
{
    const double here = likeness(c, view, 0, 0);
    double beside = -1;

    for (int k = 0; k < 8; k++) {
        const double turn = k * 0.7853981633974483;

        beside = fmax(beside,
                      likeness(c, view, 0.02 * cos(turn), 0.02 * sin(turn)));
    }
    printf("person4: %s resembles the points by %.2f, 2 cm beside them by "
           "%.2f\n",
           c->views[view].name, here, beside);
    assert_true(here > beside + 0.1);
}

TEST(person4_should_agree_with_its_lenses_and_points)
{
    json_error_t problem;
    json_t *root;
    FREED_BY(saga_capture_free) saga_capture c;

    if (left_out("person4"))
        skip();
    c = load_frame(DATA "person4", false);
    root = json_load_file(DATA "person4/transforms.json", 0, &problem);
    assert_non_null(root);
    assert_int_equal(c.n_views, 4);
    assert_int_equal(c.n_points, 860);
    assert_true(c.fps == 60);
    for (int v = 0; v < 4; v++) {
        assert_false(c.views[v].held_out);
        check_lens(&c, v,
                   json_array_get(json_object_get(root, "frames"), (size_t)v));
        check_points(&c, v);
    }
    json_decref(root);
}

/* --- Always -------------------------------------------------------------- */

TEST_IN_FOLDER(folder_should_be_refused_when_it_is_no_capture)
{
    refused(f->path, f->path, "no capture of a known format");
    refused(folder_file(f, "nowhere"), "nowhere", "does not exist");
    write_text(f, "x.json", "");
    refused(folder_file(f, "x.json"), "x.json", "not valid JSON");
}
