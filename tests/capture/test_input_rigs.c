/* SPDX-License-Identifier: MIT
 *
 * The built-in room, written in the layouts with many cameras (nerfstudio and
 * Neu3D with videos, Panoptic Sports, MPEG immersive video), must be loaded
 * with the same cameras and pixels.
 */
#include "scene_layouts.h"
#include "testing.h"

/* --- Videos -------------------------------------------------------------- */

/* ffmpeg's options for lossless video, and for chroma at half resolution as in
 * videos of cameras. */
static const char *const in_rgb = "-c:v libx264rgb -qp 0";
static const char *const in_420 =
    "-c:v libx264 -crf 4 -pix_fmt yuv420p -vf scale=out_color_matrix=bt709:"
    "flags=accurate_rnd+full_chroma_inp -colorspace bt709";

TEST_IN_FOLDER(nerfstudio_videos_should_be_the_scene)
{
    write_json(f, "transforms.json", video_alone, 0, N_VIEWS, 1, ".");
    write_videos(f, in_420);
    check_same(f->path, "nerfstudio, videos, 4:2:0", N_FRAMES, 40);
}

/* Writes poses_bounds.npy. A camera has 3 rows of five columns (down, right,
 * backwards, centre, and one of height, width and focal length), then near and
 * far. */
static void write_bounds(folder *f)
{
    bytes b = { 0 };

    put_npy(&b, "<f8", "False", "4, 17");
    for (int v = 0; v < N_VIEWS; v++) {
        const saga_source_view *const s = &scene.views[v];
        const double *const r = s->rotation, *const t = s->translation;
        const double size[] = { H, W, s->fx };

        for (int i = 0; i < 3; i++) {
            put_f64(&b, r[3 + i]);
            put_f64(&b, r[i]);
            put_f64(&b, -r[6 + i]);
            put_f64(&b, -(r[i] * t[0] + r[3 + i] * t[1] + r[6 + i] * t[2]));
            put_f64(&b, size[i]);
        }
        put_f64(&b, 0.5);
        put_f64(&b, 25);
    }
    write_bytes(f, "poses_bounds.npy", &b);
}

TEST_IN_FOLDER(neu3d_should_be_the_scene)
{
    write_bounds(f);
    write_videos(f, in_rgb);
    check_same(f->path, "Neu3D, poses_bounds.npy", N_FRAMES, LOSSLESS);
    folder_run(f, "rm poses_bounds.npy");
    write_model(f, "sparse/0", camera_alone, 1);
    check_same(f->path, "Neu3D, COLMAP model", N_FRAMES, LOSSLESS);
}

/* --- Panoptic Sports ----------------------------------------------------- */

static void number_alone(char name[80], int view, int frame)
{
    snprintf(name, 80, "%d/%06d.png", view, frame);
}

/* Writes one list of the file, with an entry for each moment and view. */
typedef void entry_fn(bytes *b, int view, int frame);

static void put_list(bytes *b, const char *key, int from, int to,
                     entry_fn *put_entry)
{
    put_text(b, ", \"%s\": [", key);
    for (int k = 0; k < N_FRAMES; k++) {
        put_text(b, k ? ", [" : "[");
        for (int v = from; v < to; v++) {
            put_text(b, v > from ? ", " : "");
            put_entry(b, v, k);
        }
        put_text(b, "]");
    }
    put_text(b, "]");
}

static void put_k(bytes *b, int view, int frame)
{
    const saga_source_view *const s = &scene.views[view];

    (void)frame;
    put_text(b, "[[%.17g, 0, %.17g], [0, %.17g, %.17g], [0, 0, 1]]", s->fx,
             s->cx, s->fy, s->cy);
}

static void put_w2c(bytes *b, int view, int frame)
{
    const saga_source_view *const s = &scene.views[view];

    (void)frame;
    put_text(b, "[");
    for (int i = 0; i < 3; i++)
        put_text(b, "[%.17g, %.17g, %.17g, %.17g], ", s->rotation[3 * i],
                 s->rotation[3 * i + 1], s->rotation[3 * i + 2],
                 s->translation[i]);
    put_text(b, "[0, 0, 0, 1]]");
}

static void put_fn(bytes *b, int view, int frame)
{
    char name[80];

    number_alone(name, view, frame);
    put_text(b, "\"%s\"", name);
}

static void put_id(bytes *b, int view, int frame)
{
    (void)frame;
    put_text(b, "%d", view);
}

static void write_meta(folder *f, const char *name, int from, int to)
{
    bytes b = { 0 };

    put_text(&b, "{\"w\": %d, \"h\": %d", W, H);
    put_list(&b, "k", from, to, put_k);
    put_list(&b, "w2c", from, to, put_w2c);
    put_list(&b, "fn", from, to, put_fn);
    put_list(&b, "cam_id", from, to, put_id);
    put_text(&b, "}");
    write_bytes(f, name, &b);
}

/* Writes init_pt_cld.npz, a ZIP with one stored array of seven columns: a
 * point, and a point that is not finite. */
static void write_cloud(folder *f)
{
    static const char code[] =
        "import struct, zipfile\n"
        "head = \"{'descr': '<f8', 'fortran_order': False, 'shape': (2, 7)}\""
        "\nrows = (1, 2, 3, 1, .5, -1, 0, 1, float('nan'), 3, 0, 0, 0, 0)\n"
        "zipfile.ZipFile('init_pt_cld.npz', 'w').writestr('data.npy', "
        "b'\\x93NUMPY\\1\\0' + struct.pack('<H', len(head) + 1) + "
        "head.encode() + b'\\n' + struct.pack('<14d', *rows))\n";

    write_text(f, "cloud.py", code);
    folder_run(f, "python3 cloud.py");
}

TEST_IN_FOLDER(panoptic_sports_should_be_the_scene)
{
    FREED_BY(saga_capture_free) saga_capture c;

    write_meta(f, "train_meta.json", 0, 3);
    write_meta(f, "test_meta.json", 3, 4);
    write_pictures(f, "ims", number_alone, 0, N_FRAMES);
    check_same(f->path, "Panoptic Sports", N_FRAMES, LOSSLESS);
    write_cloud(f);
    folder_run(f, "rm ims/1/000002.png");
    c = load(f->path);
    assert_int_equal(c.n_points, 1);
    assert_true(c.points[0].position[2] == 3 && c.points[0].rgb[0] == 255 &&
                c.points[0].rgb[1] == 128 && c.points[0].rgb[2] == 0);
    assert_true(c.views[3].held_out && !c.views[0].held_out);
    assert_false(saga_capture_has(&c, 1, 2));
    assert_int_equal(c.views[1].n_missing, 1);
}

TEST_IN_FOLDER(panoptic_sports_should_be_refused_when_wrong)
{
    static const struct {
        const char *edit, *what;
    } t[] = {
        { "s/.w2c.: ..../&5/", "not a rotation (first row 5" },
        { "s/\\(.w2c.: ....[^,]*,[^,]*,[^,]*,\\)[^]]*/\\1 5/", "moves" },
        { "s/.k.: ..../&5/", "moves" },
        { "s/.k.: .*, .w2c/\"k\": [], \"w2c/", "\"k\"[0][0] is missing" },
        { "s/.cam_id.: ..0/\"cam_id\": [[-3/", "\"cam_id\"[0][0]" },
        { "s/.cam_id.: ..0/\"cam_id\": [[1/", "camera 1 moves" },
        { "s/.w.: 64/\"w\": 63/", "is 64 x 48 pixels, expected 63 x 48" },
        { "s/.w.: 64/\"w\": 0/", "\"w\" is missing or not 1" },
        { "s/.fn.: .*, .cam_id/\"fn\": [], \"cam_id/", "has 0 moments" },
        { "s/.fn.: ..\"/\"fn\": [[7, \"/", "\"fn\"[0][0]" },
        { "s/..$//", "not valid JSON" },
    };

    write_pictures(f, "ims", number_alone, 0, N_FRAMES);
    for (size_t i = 0; i < sizeof t / sizeof *t; i++) {
        write_meta(f, "train_meta.json", 0, 4);
        folder_run(f, "sed -i '%s' train_meta.json", t[i].edit);
        refused(f->path, f->path, t[i].what);
    }
    write_meta(f, "train_meta.json", 0, 4);
    write_meta(f, "test_meta.json", 3, 4);
    refused(f->path, "test_meta.json", "camera 3 is in train_meta.json and in");
}

/* --- MPEG MIV ------------------------------------------------------------ */

static const double degree = 3.14159265358979323846 / 180;

/* Sets angle to yaw, pitch and roll, in degrees, of the matrix whose columns
 * are forward, left and up. */
static void angles_of(const saga_source_view *s, double angle[3])
{
    const double *const right = s->rotation, *const down = right + 3;
    const double *const forward = right + 6;

    angle[0] = atan2(forward[1], forward[0]) / degree;
    angle[1] = -asin(forward[2]) / degree;
    angle[2] = atan2(-right[2], -down[2]) / degree;
}

static void write_miv_json(folder *f)
{
    bytes b = { 0 };

    put_text(&b, "{\"Version\": \"4.0\", \"Content_name\": \"room\", \"Fps\": "
                 "24, \"sourceCameraNames\": [\"cam00\", \"cam01\", \"cam02\", "
                 "\"cam03\"], \"cameras\": [{\"Name\": \"viewport\"}");
    for (int v = 0; v < N_VIEWS; v++) {
        const saga_source_view *const s = &scene.views[v];
        const double *const r = s->rotation, *const t = s->translation;
        double a[3];

        angles_of(s, a);
        put_text(&b,
                 ", {\"Name\": \"%s\", \"Position\": [%.17g, %.17g, "
                 "%.17g], \"Rotation\": [%.17g, %.17g, %.17g], ",
                 s->name, -(r[0] * t[0] + r[3] * t[1] + r[6] * t[2]),
                 -(r[1] * t[0] + r[4] * t[1] + r[7] * t[2]),
                 -(r[2] * t[0] + r[5] * t[1] + r[8] * t[2]), a[0], a[1], a[2]);
        put_text(&b,
                 "\"Projection\": \"Perspective\", \"Resolution\": [%d, "
                 "%d], \"Focal\": [%.17g, %.17g], \"Principle_point\": [%.17g, "
                 "%.17g], \"Depth_range\": [0.5, 25], \"BitDepthColor\": 10, "
                 "\"ColorSpace\": \"YUV420\"}",
                 W, H, s->fx, s->fy, s->cx, s->cy);
    }
    put_text(&b, "]}");
    write_bytes(f, "room.json", &b);
}

/* Writes the first picture of each view, with chroma at half resolution and
 * with 10 and 8 bits in turn. */
static void write_textures(folder *f)
{
    bytes inputs = { 0 }, outputs = { 0 };

    for (int v = 0; v < N_VIEWS; v++) {
        const char *const pixels = v % 2 ? "yuv420p" : "yuv420p10le";

        put_text(&inputs, "-i p/cam%02d/f_0000.png ", v);
        put_text(&outputs,
                 "-map %d -vf scale=out_color_matrix=bt709:out_range=limited:"
                 "flags=accurate_rnd+full_chroma_inp -pix_fmt %s -f rawvideo "
                 "cam%02d_texture_%dx%d_%s.yuv ",
                 v, pixels, v, W, H, pixels);
    }
    run_ffmpeg(f, &inputs, &outputs);
}

TEST_IN_FOLDER(miv_should_be_the_scene)
{
    FREED_BY(saga_capture_free) saga_capture c;

    write_pictures(f, "p", camera_and_number, 0, 1);
    write_miv_json(f);
    write_textures(f);
    /* 4:2:0 keeps a quarter of the colour samples, so that the tolerance is
     * large. */
    check_same(f->path, "MPEG MIV, 4:2:0, 10 and 8 bits", 1, 40);
    c = load(f->path);
    assert_true(c.fps == 24 && c.views[2].near_depth == 0.5 &&
                c.views[2].far_depth == 25);
}

/* Turns d about an axis (0 is x, 1 y, 2 z) by a right-handed angle in degrees.
 */
static void turn(double d[3], int axis, double angle)
{
    const int a = (axis + 1) % 3, b = (axis + 2) % 3;
    const double c = cos(angle * degree), s = sin(angle * degree);
    const double x = d[a], y = d[b];

    d[a] = c * x - s * y;
    d[b] = s * x + c * y;
}

/* Returns the brightness, 0 to 1, that the scene has in direction d. */
static double light_from(const double d[3])
{
    return 0.5 + 0.4 * sin(3 * d[0] + 4 * d[1] - 2 * d[2] + 1);
}

/* Writes two grey 10-bit frames of an equirectangular camera that is turned by
 * 30, 20 and 10 degrees. The second frame has half the light. */
static void write_sphere(folder *f, int w, int h, double wide)
{
    bytes b = { 0 };
    char name[60];

    for (int k = 0; k < 2; k++) {
        for (int i = 0; i < w * h; i++) {
            const double phi = wide * (0.5 - (i % w + 0.5) / w) * degree;
            const double theta = 180 * (0.5 - (i / w + 0.5) / h) * degree;
            double d[3] = { cos(theta) * cos(phi), cos(theta) * sin(phi),
                            sin(theta) };

            turn(d, 0, 10);
            turn(d, 1, 20);
            turn(d, 2, 30);
            put_le(&b, (uint64_t)(64.5 + 876 * light_from(d) / (k + 1)), 2);
        }
        for (int i = 0; i < w * h / 2; i++)
            put_le(&b, 512, 2);
    }
    snprintf(name, sizeof name, "v0_texture_%dx%d_yuv420p10le.yuv", w, h);
    write_bytes(f, name, &b);
    put_text(&b,
             "{\"cameras\": [{\"Name\": \"v0\", \"Position\": [1, 2, 3], "
             "\"Rotation\": [30, 20, 10], \"Projection\": \"Equirectangular\", "
             "\"Resolution\": [%d, %d], \"Hor_range\": [%g, %g], "
             "\"Ver_range\": [-90, 90]}]}",
             w, h, -wide / 2, wide / 2);
    write_bytes(f, "sphere.json", &b);
}

static void check_faces(folder *f, int n_faces, int side)
{
    saga_capture c = load(f->path);
    double worst = 0;
    int n_off = 0;

    assert_int_equal(c.n_views, n_faces);
    assert_int_equal(c.n_frames, 2);
    for (int v = 0; v < n_faces; v++) {
        const saga_source_view *const s = &c.views[v];

        assert_true(s->width == side && s->height == side);
        for (int i = 0; i < 2 * side * side; i++) {
            const int k = i / (side * side), x = i % side;
            const int y = i / side % side;
            const double uv[2] = { x + 0.5, y + 0.5 };
            double d[3], n, want;

            saga_view_lift(s, uv, 1, d);
            for (int a = 0; a < 3; a++)
                d[a] -= a + 1;
            n = sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]);
            for (int a = 0; a < 3; a++)
                d[a] /= n;
            want = 255 * light_from(d) / (k + 1);
            want -= saga_capture_frame(&c, v, k)[3 * (y * side + x) + 1];
            worst = fmax(worst, fabs(want));
            n_off += fabs(want) > 1.7;
        }
    }
    saga_capture_free(&c);
    /* At the seam and at the poles the nearest source pixel is taken, up to
     * half a pixel away: 0.5 pi / 128 radians of brightness that changes by up
     * to 5.4 * 0.4 * 255 per radian. */
    assert_true(n_off < 2 * side * side * n_faces / 50 && worst < 6.8);
}

TEST_IN_FOLDER(equirectangular_views_should_become_faces)
{
    write_sphere(f, 256, 128, 360);
    check_faces(f, 6, 81); /* faces of 256 / pi pixels */
    folder_run(f, "rm *.yuv");
    write_sphere(f, 128, 128, 180);
    check_faces(f, 2, 81);
}

TEST_IN_FOLDER(miv_should_be_refused_when_wrong)
{
    static const struct {
        const char *edit, *what;
    } t[] = {
        { "s/Equirect/Orthograph/", "Orthographangular, which is not" },
        { "s/.Hor_range.: ..180/\"Hor_range\": [170/", "170 to 180" },
        { "s/.Ver_range.*]}]/\"x\": 1}]/", "\"Ver_range\" of camera v0" },
        { "s/.Position.: .1/\"Position\": [null/", "\"Position\" of camera" },
        { "s/.256, 128./[256, 64]/", "256 x 64 by \"Resolution\"" },
        { "s/v0/v1/", "has no texture of camera v1" },
        { "s/\"v0\"/7/", "\"Name\" of cameras[0]" },
        { "s/.cameras.: .*]/\"cameras\": []/", "has no source camera" },
        { "s/]}$//", "not valid JSON" },
    };

    for (size_t i = 0; i < sizeof t / sizeof *t; i++) {
        write_sphere(f, 256, 128, 360);
        folder_run(f, "sed -i '%s' sphere.json", t[i].edit);
        refused(f->path, f->path, t[i].what);
    }
    write_sphere(f, 256, 128, 360);
    folder_run(f, "truncate -s -1 *.yuv");
    refused(f->path, ".yuv", "196607 bytes, which is not 1 to");
}
