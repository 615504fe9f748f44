/* SPDX-License-Identifier: MIT
 *
 * Videos with calibrations in TOML. The built-in room, written in the formats
 * of caliscope, Anipose, Pose2Sim and FreeMoCap, must be loaded with the same
 * cameras and pixels. The lens is compared with OpenCV's formula, and the names
 * in the calibration must find their videos.
 */
#include "load.h"
#include "scene_layouts.h"
#include "testing.h"
#include "toml.h"

extern const saga_loader saga_calibrated_videos_loader;

/* --- The scene ----------------------------------------------------------- */

/* Writes the rotation vector of a rotation whose angle is neither 0 nor 180
 * degrees: its axis is that of the antisymmetric part. */
static void put_turn(bytes *b, const double r[9])
{
    const double axis[3] = { r[7] - r[5], r[2] - r[6], r[3] - r[1] };
    const double sine = hypot(hypot(axis[0], axis[1]), axis[2]) / 2;
    const double angle = atan2(sine, (r[0] + r[4] + r[8] - 1) / 2);

    assert_true(sine > 1e-3);
    put_text(b, "[%.17g, %.17g, %.17g]", axis[0] * angle / sine / 2,
             axis[1] * angle / sine / 2, axis[2] * angle / sine / 2);
}

/* The form in which a program writes a camera: its table and its name, which
 * have the number of the view plus `first`, and its unit of length. */
typedef struct {
    const char *table, *name;
    int first;
    double units;
    int matrix; /* the rotation is 3 x 3 */
} form;

static void put_camera(bytes *b, const form *o, int view)
{
    const saga_source_view *const s = &scene.views[view];
    const double *const r = s->rotation, *const t = s->translation;

    put_text(b, o->table, view + o->first);
    if (o->name) {
        put_text(b, "name = \"");
        put_text(b, o->name, view + o->first);
        put_text(b, "\"\n");
    }
    put_text(b,
             "size = [ %d.0, %d,]\ndistortions = [ 0.0, 0.0, 0.0, 0.0]\n"
             "matrix = [ [ %.17g, 0.0, %.17g,], [ 0.0, %.17g, %.17g,], "
             "[ 0.0, 0.0, 1.0,],]\nrotation = ",
             W, H, s->fx, s->cx - 0.5, s->fy, s->cy - 0.5);
    if (o->matrix)
        put_text(b,
                 "[[%.17g, %.17g, %.17g], [%.17g, %.17g, %.17g], "
                 "[%.17g, %.17g, %.17g]]",
                 r[0], r[1], r[2], r[3], r[4], r[5], r[6], r[7], r[8]);
    else
        put_turn(b, r);
    put_text(b, "\ntranslation = [%.17g, %.17g, %.17g]\nfisheye = false\n\n",
             t[0] * o->units, t[1] * o->units, t[2] * o->units);
}

static void write_calibration(folder *f, const char *name, const form *o)
{
    bytes b = { 0 };

    for (int v = 0; v < N_VIEWS; v++)
        put_camera(&b, o, v);
    put_text(&b, "[metadata]\nadjusted = false\nerror = 0.0\n");
    write_bytes(f, name, &b);
}

/* Loads the capture and compares it with the scene, except names and the unit.
 * Returns the metres in its unit of length; 0: unknown. */
static double check_form(const char *path, const char *layout, const form *o,
                         const char *names)
{
    saga_capture c = load(path);
    double most = 0;

    assert_int_equal(c.n_views, N_VIEWS);
    assert_int_equal(c.n_frames, N_FRAMES);
    assert_true(o->units == 1 || strstr(c.notes, "--metres 0.001"));
    assert_true(o->units != 1 || !strstr(c.notes, "unit:"));
    for (int v = 0; v < N_VIEWS; v++) {
        saga_source_view want = scene.views[v];

        snprintf(want.name, sizeof want.name, names, v + o->first);
        for (int i = 0; i < 3; i++)
            want.translation[i] *= o->units;
        most = fmax(most, check_camera(&c.views[v], &want));
        assert_memory_equal(saga_capture_frame(&c, v, 1),
                            saga_capture_frame(&scene, v, 1), 3 * W * H);
    }
    const double metres = c.metres;

    add_row(layout, N_FRAMES, most, LOSSLESS);
    saga_capture_free(&c);
    return metres;
}

static const char in_rgb[] = "-c:v libx264rgb -qp 0";

/* All layouts have the same videos, which are coded once. */
TEST_IN_FOLDER(layouts_should_be_the_scene)
{
    form o = { "[cameras.%d]\n", NULL, 0, 1, 0 };
    const form anipose = { "[cam_%d]\n", "cam%02d", 0, 1000, 0 };
    const form pose2sim = { "[cam_%02d]\n", "int_cam%d_img", 1, 1, 0 };

    write_videos(f, in_rgb);
    write_calibration(f, "camera_array.toml", &o);
    write_calibration(f, "camera_array_aniposelib.toml", &o);
    check_form(f->path, "caliscope", &o, "cam_%d");
    o.matrix = 1;
    write_calibration(f, "camera_array.toml", &o);
    assert_true(check_form(f->path, "caliscope, rotations as matrices", &o,
                           "cam_%d") == 1);
    folder_run(f, "rm *.toml");
    write_calibration(f, "calibration.toml", &anipose);
    check_form(f->path, "Anipose, in millimetres", &anipose, "cam%02d");
    /* FreeMoCap has the videos one folder down. */
    folder_run(f, "mkdir synchronized_videos && mv *.mp4 synchronized_videos &&"
                  " mv calibration.toml take_camera_calibration.toml");
    check_form(f->path, "FreeMoCap", &anipose, "cam%02d");
    /* Pose2Sim counts from 1, and its videos only have the same numbers. */
    folder_run(f, "rm *.toml; mkdir videos && for i in 0 1 2 3; do "
                  "mv synchronized_videos/cam0$i.mp4 videos/c$((i + 1)).MP4 || "
                  "exit; done; touch videos/._c1.MP4");
    write_calibration(f, "Calib_scene.toml", &pose2sim);
    check_form(f->path, "Pose2Sim", &pose2sim, "int_cam%d_img");
}

/* Checks that the capture's notes have this text. */
static void assert_notes(const char *path, const char *text)
{
    saga_capture c = load(path);

    if (!strstr(c.notes, text))
        fail_msg("no '%s' in: %s", text, c.notes);
    saga_capture_free(&c);
}

/* A workspace of caliscope, with the board's videos beside the calibration. The
 * workspace may be given, or the folder of one recording; if there are two, it
 * has to be the latter. */
TEST_IN_FOLDER(workspace_of_caliscope_should_be_the_scene)
{
    static const form o = { "[cameras.%d]\n", NULL, 0, 1, 0 };
    static const char volume[] = "calibration/extrinsic/capture_volume";
    char path[2][SAGA_MESSAGE_NBYTES];

    write_videos(f, in_rgb);
    folder_run(f,
               "mkdir -p recordings/walk %s && for i in 0 1 2 3; do "
               "cp cam0$(((i + 1) %% 4)).mp4 "
               "calibration/extrinsic/cam_$i.mp4 && "
               "cp cam0$i.mp4 recordings/walk/cam_$i.mp4 || exit; done; "
               "rm *.mp4",
               volume);
    snprintf(path[0], sizeof path[0], "%s/camera_array.toml", volume);
    write_calibration(f, path[0], &o);
    check_form(f->path, "caliscope, workspace", &o, "cam_%d");
    snprintf(path[0], sizeof path[0], "%s/recordings/walk", f->path);
    check_form(path[0], "caliscope, recording", &o, "cam_%d");
    /* The board's videos are no scene. */
    snprintf(path[1], sizeof path[1], "%s/calibration/extrinsic", f->path);
    assert_notes(path[1], "extrinsic are those of the calibration, of its");
    folder_run(f, "mv recordings/walk/cam_3.mp4 .");
    assert_notes(path[0], "have no video: cam_3; copy theirs");
    folder_run(f, "mv cam_3.mp4 recordings/walk");
    folder_run(f, "cp -r recordings/walk recordings/jump");
    refused(f->path, f->path, "has 2 recordings with videos");
    check_form(path[0], "caliscope, one of two", &o, "cam_%d");
    /* The same without a folder of that name is no workspace. */
    folder_run(f, "mv recordings takes");
    snprintf(path[1], sizeof path[1], "%s/takes/walk", f->path);
    refused(path[1], path[1], "");
}

/* --- One camera ---------------------------------------------------------- */

/* Writes a camera's calibration with some text at its end, and a video of 64 x
 * 48 pixels. */
static void write_camera(folder *f, const char *more)
{
    bytes b = { 0 };

    if (!saga_folder_has(f->path, "cam_0.mp4"))
        folder_run(f, "ffmpeg -nostdin -v error -f lavfi -i testsrc=s=64x48 "
                      "-frames:v 2 cam_0.mp4");
    put_text(&b,
             "[cam_0]\nsize = [128, 96]\n"
             "matrix = [[100, 0, 61.5], [0, 104, 50.5], [0, 0, 1]]\n"
             "rotation = [0, 0, 0]\ntranslation = [0, 0, 0]\n%s",
             more);
    write_bytes(f, "calibration.toml", &b);
}

static saga_listing list_it(folder *f)
{
    const saga_capture_options o = saga_capture_defaults();
    saga_listing l = { .path = f->path };

    assert_done(saga_calibrated_videos_loader.list(&l, f->path, &o, &error));
    return l;
}

/* The expected values come from OpenCV's formula, at pixels of 128 x 96,
 * relative to the centre of the first pixel. */
TEST_IN_FOLDER(lens_should_be_opencv_s_at_the_size_of_the_video)
{
    const double k1 = -0.3, k2 = 0.1, p1 = 0.01, p2 = -0.02, k3 = 0.05;
    const double x = 0.3, y = -0.2, r2 = x * x + y * y;
    const double g = 1 + k1 * r2 + k2 * r2 * r2 + k3 * r2 * r2 * r2;
    const double u = 100 * (x * g + 2 * p1 * x * y + p2 * (r2 + 2 * x * x)) +
                     61.5;
    const double v = 104 * (y * g + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y) +
                     50.5;
    FREED_BY(saga_listing_free) saga_listing l = { 0 };
    double uv[2];

    write_camera(f, "distortions = [[-0.3, 0.1, 0.01, -0.02, 0.05, 0, 0, 0]]");
    l = list_it(f);
    saga_lens_project(&l.sources[0].lens, x, y, uv);
    assert_true(fabs(uv[0] - (u + 0.5) / 2) < 1e-12);
    assert_true(fabs(uv[1] - (v + 0.5) / 2) < 1e-12);
    assert_non_null(strstr(l.notes, "scaled to the videos'"));
}

TEST_IN_FOLDER(fisheye_should_be_opencv_s)
{
    const double x = 0.3, y = -0.4, a = atan(0.5), a2 = a * a;
    const double d = a *
                     (1 + a2 * (0.1 + a2 * (0.02 + a2 * (0.03 + a2 * 0.04))));
    FREED_BY(saga_listing_free) saga_listing l = { 0 };
    double uv[2];

    write_camera(f, "distortions = [0.1, 0.02, 0.03, 0.04]\nfisheye = true");
    l = list_it(f);
    saga_lens_project(&l.sources[0].lens, x, y, uv);
    assert_true(fabs(uv[0] - (100 * x / 0.5 * d + 62) / 2) < 1e-12);
    assert_true(fabs(uv[1] - (104 * y / 0.5 * d + 51) / 2) < 1e-12);
}

TEST_IN_FOLDER(calibration_should_be_refused_when_wrong)
{
    static const struct {
        const char *more, *what;
    } t[] = {
        { "", "\"distortions\" of cam_0 is missing" },
        { "distortions = [1, 2, 3, 4, 5, 6]", "has 6 coefficients" },
        { "distortions = [1, 2, 3, 4, 5]\nfisheye = true", "but only 4" },
        { "distortions = [0]\n[cam_1]\nmatrix = [[1, 2], [3]]\nrotation = []\n"
          "translation = 0",
          "\"size\" of cam_1 is missing" },
        { "distortions = [0]\nfisheye = maybe", "line 7: a value is not" },
        { "distortions = [0]\nsize = [1]", "line 7: a key occurs twice" },
    };
    static const struct {
        const char *edit, *what;
    } edits[] = {
        { "s/128, 96/96, 128/", "calibrated with 96 x 128 pixels, the video" },
        { "s/128, 96/0, 96/", "\"size\" of cam_0 is missing or not" },
        { "s/\\[100, 0/[100, 2/", "has a skew of 2" },
        { "s/rotation.*/rotation = [1, 2]/", "\"rotation\" of cam_0" },
        { "s/rotation.*/rotation = [1, 0, 0, 0, 1, 0, 0, 0, 2]/",
          "not a rotation" },
        { "s/rotation.*//", "has no camera with matrix, rotation and" },
        { "s/^.cam_0.*/[cam_0]\\nignore = true/", "has no camera with" },
        { "s/cam_0/cam_9/", "no name of its 1 videos (cam_0.mp4 ...)" },
    };

    for (size_t i = 0; i < sizeof t / sizeof *t; i++) {
        write_camera(f, t[i].more);
        refused(f->path, "calibration.toml", t[i].what);
    }
    for (size_t i = 0; i < sizeof edits / sizeof *edits; i++) {
        write_camera(f, "distortions = [0]");
        folder_run(f, "sed -i '%s' calibration.toml", edits[i].edit);
        refused(f->path, f->path, edits[i].what);
    }
    write_camera(f, "distortions = [0]\n[cam_1]\nname = 'cam_0'\n"
                    "size = [128, 96]\nmatrix = [99, 0, 63, 0, 99, 47, 0, 0, "
                    "1]\nrotation = [0, 0, 0]\ntranslation = [1, 0, 0]\n"
                    "distortions = [0]");
    refused(f->path, "calibration.toml",
            "cameras 1 and 2 have the same name, cam_0");
    write_camera(f, "distortions = [0]");
    folder_run(f, "cp calibration.toml calib2.toml");
    refused(f->path, f->path, "has 2 calibrations, among them");
    folder_run(f, "rm calib2.toml *.mp4");
    refused(f->path, f->path, "but no videos (.mp4");
}

TEST_IN_FOLDER(calibration_should_be_noted_when_odd)
{
    FREED_BY(saga_capture_free) saga_capture c = { 0 };

    write_camera(f, "distortions = [0]\nrotation_count = 1");
    folder_run(f, "sed -i s/104/106/ calibration.toml");
    c = load(f->path);
    assert_non_null(strstr(c.notes, "the rotation_count of cam_0 is for"));
    assert_non_null(strstr(c.notes, "1 camera are more than 5 % apart (cam_0: "
                                    "50 and 53 pixels)"));
}

/* --- Names --------------------------------------------------------------- */

/* For cameras and videos with these names, the video that each camera gets; "-"
 * for none. */
TEST_IN_FOLDER(names_should_find_their_videos)
{
    static const char *const t[][3][4] = {
        { { "A", "B" },
          { "x-camA.mp4", "x-camB.avi" },
          { "x-camA.mp4", "x-camB.avi" } },
        { { "1", "11" },
          { "cam1.mp4", "cam11.mp4" },
          { "cam1.mp4", "cam11.mp4" } },
        { { "Cam1", "cam2" },
          { "a_1.mp4", "cam1.mp4", "cam2.mkv" },
          { "cam1.mp4", "cam2.mkv" } },
        { { "cam_0", "cam_1" }, { "port_1.mp4" }, { "-", "port_1.mp4" } },
        /* A second take of one camera cannot be told from the first. */
        { { "cam_0", "cam_1" },
          { "a_0.mp4", "b_0.mp4", "b_1.mp4" },
          { "-", "b_1.mp4" } },
    };

    write_camera(f, "distortions = [0]");
    folder_run(f, "mv cam_0.mp4 video");
    for (size_t i = 0; i < sizeof t / sizeof *t; i++) {
        bytes b = { 0 };
        int n = 0;

        for (int k = 0; k < 4 && t[i][0][k]; k++)
            put_text(&b,
                     "[c%d]\nname = '%s'\nsize = [64, 48]\n"
                     "matrix = [99, 0, 31, 0, 99, 23, 0, 0, 1]\n"
                     "distortions = [0]\nrotation = [0, 0, 0]\n"
                     "translation = [%d, 0, 0]\n",
                     k, t[i][0][k], k);
        write_bytes(f, "calibration.toml", &b);
        for (int k = 0; k < 4 && t[i][1][k]; k++)
            folder_run(f, "cp video %s", t[i][1][k]);
        FREED_BY(saga_listing_free) saga_listing l = list_it(f);
        for (int k = 0; k < 4 && t[i][2][k]; k++) {
            if (t[i][2][k][0] == '-')
                continue;
            assert_string_equal(strrchr(l.sources[n].video, '/') + 1,
                                t[i][2][k]);
            assert_string_equal(l.sources[n++].name, t[i][0][k]);
        }
        assert_int_equal(l.n_sources, n);
        folder_run(f, "rm -f *.mp4 *.avi *.mkv");
    }
}

/* --- TOML ---------------------------------------------------------------- */

TEST_IN_FOLDER(toml_should_be_read_as_a_tree)
{
    static const struct {
        const char *toml, *json;
    } t[] = {
        { "", "{}" },
        { "\xef\xbb\xbf"
          "a = 1",
          "{\"a\":1.0}" },
        { "a = 1\r\n# c\n\tb-2 = -2.5e1 # d\n", "{\"a\":1.0,\"b-2\":-25.0}" },
        { "a = 1_000\nb = \"x # \\\" \\\\\"\nc = 'C:\\x'",
          "{\"a\":1000.0,\"b\":\"x # \\\" \\\\\",\"c\":\"C:\\\\x\"}" },
        { "a = [ [1, 2], # e\n [true, 'x',],\n[],]\n",
          "{\"a\":[[1.0,2.0],[true,\"x\"],[]]}" },
        { "[a]\nb = false\n[ a . 'c d' ]\ne = 1\n[f]\n",
          "{\"a\":{\"b\":false,\"c d\":{\"e\":1.0}},\"f\":{}}" },
    };

    for (size_t i = 0; i < sizeof t / sizeof *t; i++) {
        json_t *tree;

        write_text(f, "x", t[i].toml);
        assert_done((tree = saga_toml_read(folder_file(f, "x"), &error)) !=
                    NULL);
        FREED char *const text = json_dumps(tree, JSON_COMPACT);
        assert_string_equal(text, t[i].json);
        json_decref(tree);
    }
}

TEST_IN_FOLDER(toml_should_be_refused_with_the_line)
{
    static const struct {
        const char *toml, *what;
    } t[] = {
        { "a = \n", "line 1: a value is not" },
        { "a = 1 2\n", "line 1: a line has something" },
        { "\n\na = [1 2]\n", "line 3: a list has no comma" },
        { "a = [\n1,\n", "line 3: a value is not" },
        { "a = [[[[[[[[[1", "line 1: lists are nested too deeply" },
        { "[a.b.c.d.e.f.g.h.i]", "line 1: tables are nested too deeply" },
        { "a = 1\n[a]\n", "line 2: a table has the name of a value" },
        { "[a\n", "line 1: a table's name does not end" },
        { "[[a]]\n", "line 1: lists of tables" },
        { "a = 'x\ny'", "line 1: a string does not end" },
        { "a = \"\\n\"", "line 1: a string has an escape" },
        { "a = '\xff'", "line 1: a string is not valid UTF-8" },
        { "a = 1\n[b.c]\nd = [1, nan]",
          "line 3: a value is not a string, a "
          "finite number, true, false or a list of these (\"nan\" for d of "
          "b.c)" },
        { "a = -nan(ind)", "(\"-nan\" for a)" },
        { "a = 0x10", "(\"0x10\" for a)" },
        { "a = 1.#QNAN", "(\"1.#QNAN\" for a)" },
        { "a = 1,5", "line 1: a line has something" },
        { "\xff\xfe"
          "a",
          "is text in UTF-16; save it as UTF-8" },
        { "a = 1979-05-27", "line 1: a value is not" },
        { "= 1", "line 1: a key is missing" },
        { "a.b = 1", "line 1: there is no = after a key" },
        { "a = 1\na = 2", "line 2: a key occurs twice" },
    };

    for (size_t i = 0; i < sizeof t / sizeof *t; i++) {
        saga_error error = { "" };

        write_text(f, "x", t[i].toml);
        assert_null(saga_toml_read(folder_file(f, "x"), &error));
        assert_says(&error, t[i].what);
    }
}
