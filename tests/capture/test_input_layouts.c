/* SPDX-License-Identifier: MIT
 *
 * The built-in room, written in the layouts of COLMAP and Blender and as stills
 * of every format, must be loaded with the same cameras and pixels. Missing
 * pictures are left out, invalid files refused.
 */
#include "scene_layouts.h"
#include "testing.h"

/* --- COLMAP -------------------------------------------------------------- */

TEST_IN_FOLDER(colmap_folder_should_be_the_scene)
{
    FREED_BY(saga_capture_free) saga_capture c;

    write_model(f, "sparse/0", camera_alone, 1);
    write_pictures(f, "images", camera_alone, 0, 1);
    check_same(f->path, "COLMAP, text", 1, LOSSLESS);
    /* Programs that export for COLMAP may write no folder sparse/. */
    folder_run(f, "mv sparse/0/* . && rm -r sparse");
    check_same(f->path, "COLMAP, text beside images/", 1, LOSSLESS);
    c = load(f->path);
    assert_int_equal(c.n_points, scene.n_points);
    assert_true(fabs(c.points[0].position[1] - scene.points[0].position[1]) <
                1e-9);
}

TEST_IN_FOLDER(colmap_folder_should_have_frames_by_camera)
{
    /* Every picture is in the COLMAP model. */
    write_model(f, "sparse/0", camera_and_number, N_FRAMES);
    write_pictures(f, "images", camera_and_number, 0, N_FRAMES);
    check_same(f->path, "COLMAP, a folder for each camera", N_FRAMES, LOSSLESS);
    /* Only the first picture of each camera is in the model. */
    write_model(f, "sparse/0", camera_and_number, 1);
    check_same(f->path, "the same, first pictures in the model", N_FRAMES,
               LOSSLESS);
    /* The model has a picture cam00.png, and the frames are in the folder
     * cam00/. */
    write_model(f, "sparse/0", camera_alone, 1);
    check_same(f->path, "the same, pictures of cameras in the model", N_FRAMES,
               LOSSLESS);
    /* The pictures' folders lie next to sparse/, without a folder images/. */
    folder_run(f, "mv images/* . && rmdir images");
    check_same(f->path, "the same, without images/", N_FRAMES, LOSSLESS);
}

TEST_IN_FOLDER(colmap_folder_should_have_frames_by_moment)
{
    write_model(f, "sparse/0", number_and_camera, N_FRAMES);
    write_pictures(f, "images", number_and_camera, 0, N_FRAMES);
    check_same(f->path, "COLMAP, a folder for each moment", N_FRAMES, LOSSLESS);
}

TEST_IN_FOLDER(frame_folders_should_be_the_scene)
{
    /* The moments t8, t9, t10 must be ordered by number, not by letters. One
     * COLMAP model lies next to their folders. */
    write_pictures(f, ".", number_and_camera, 0, N_FRAMES);
    write_model(f, "sparse/0", camera_alone, 1);
    check_same(f->path, "frame folders, a COLMAP model beside them", N_FRAMES,
               LOSSLESS);
    /* Each moment's folder is a capture of its own. */
    folder_run(f, "for t in t8 t9 t10; do mkdir $t/images && mv $t/*.png "
                  "$t/images && cp -r sparse $t; done; rm -r sparse t9/sparse");
    check_same(f->path, "frame folders, COLMAP in each", N_FRAMES, LOSSLESS);
}

/* The digest of a view's pictures must not depend on threads nor on where they
 * are kept, but on each of them and on their order. */
TEST_IN_FOLDER(digest_should_depend_on_all_pictures)
{
    FREED_BY(saga_capture_free) saga_capture a, b, swapped, other;
    saga_capture_options o = saga_capture_defaults();

    write_model(f, "sparse/0", camera_alone, 1);
    write_pictures(f, "images", camera_and_number, 0, N_FRAMES);
    o.n_threads = 3;
    a = load_with(f->path, &o);
    o.n_threads = 1;
    o.scratch = f->path;
    b = load_with(f->path, &o);
    folder_run(f, "cd images/cam01 && set -- * && mv $1 x && mv $2 $1 && "
                  "mv x $2");
    swapped = load_with(f->path, &o);
    folder_run(f, "cd images/cam02 && set -- * && cp $1 $3");
    other = load_with(f->path, &o);
    for (int v = 0; v < N_VIEWS; v++) {
        assert_true(a.views[v].digest != 0);
        assert_true(a.views[v].digest == b.views[v].digest);
        assert_true((b.views[v].digest == swapped.views[v].digest) == (v != 1));
        assert_true((swapped.views[v].digest == other.views[v].digest) ==
                    (v != 2));
    }
}

/* --- Blender ------------------------------------------------------------- */

/* The capture has three training cameras and one test camera; names have no
 * extension. */
TEST_IN_FOLDER(blender_scene_should_be_the_scene)
{
    double camera = 0;
    saga_capture c;

    write_json(f, "transforms_train.json", camera_alone, 0, 3, 1, "./train");
    write_json(f, "transforms_test.json", camera_alone, 3, 4, 1, "./train");
    write_pictures(f, "train", camera_alone, 0, 1);
    c = load(f->path);
    /* Views are in the order in which files are read: the test file first. */
    assert_int_equal(c.n_views, N_VIEWS);
    for (int v = 0; v < N_VIEWS; v++) {
        const int from = (v + 3) % N_VIEWS;

        camera = fmax(camera, check_camera(&c.views[v], &scene.views[from]));
        assert_int_equal(c.views[v].held_out, v == 0);
        assert_memory_equal(saga_capture_frame(&c, v, 0),
                            saga_capture_frame(&scene, from, 0), 3 * W * H);
    }
    add_row("Blender", 1, camera, LOSSLESS);
    saga_capture_free(&c);
    write_text(f, "transforms_test.json", "[]");
    refused(f->path, "transforms_test.json", "is not an object");
}

/* Writes a file for one moving camera, with the pictures of views from..to-1 at
 * the given times, in the form of D-NeRF. */
static void write_moving(folder *f, const char *path, int from, int to,
                         const double *time)
{
    bytes b = { 0 };

    put_text(&b, "{\"camera_angle_x\": %.17g, \"frames\": [",
             2 * atan(W / (2 * scene.views[0].fx)));
    for (int v = from; v < to; v++) {
        put_text(&b,
                 "%s{\"file_path\": \"./train/cam%02d\", "
                 "\"rotation\": 0.1, \"time\": %.17g, ",
                 v > from ? ", " : "", v, time[v]);
        put_pose(&b, v);
        put_text(&b, "}");
    }
    put_text(&b, "]}");
    write_bytes(f, path, &b);
}

/* Compares a picture of a moving camera with the picture of view `from` of the
 * scene at time k. */
static double check_moving(const saga_capture *c, int view, int from, int k,
                           double late)
{
    const double camera = check_camera(&c->views[view], &scene.views[from]);

    assert_true(fabs(c->views[view].late - late) < 1e-9);
    for (int i = 0; i < c->n_frames; i++) {
        assert_int_equal(saga_capture_has(c, view, i), i == k);
        /* The picture in memory is shared by all moments. */
        assert_memory_equal(saga_capture_frame(c, view, i),
                            saga_capture_frame(&scene, from, 0), 3 * W * H);
    }
    return camera;
}

/* The capture has three training pictures, each at its own time, and one test
 * picture, whose time is a quarter of the way from the first moment to the
 * second. */
TEST_IN_FOLDER(moving_camera_should_have_a_view_for_each_picture)
{
    static const double time[] = { 0.5, 0, 1, 0.125 };
    saga_capture_options o = saga_capture_defaults();
    saga_capture c;

    write_moving(f, "transforms_train.json", 0, 3, time);
    write_moving(f, "transforms_test.json", 3, 4, time);
    write_pictures(f, "train", camera_alone, 0, 1);
    c = load(f->path);
    assert_true(c.moves);
    assert_int_equal(c.n_views, N_VIEWS);
    assert_int_equal(c.n_frames, 3);
    add_row(
        "D-NeRF, one camera that moves", 3,
        fmax(
            fmax(check_moving(&c, 0, 3, 0, 0.25), check_moving(&c, 1, 0, 1, 0)),
            fmax(check_moving(&c, 2, 1, 0, 0), check_moving(&c, 3, 2, 2, 0))),
        LOSSLESS);
    assert_true(c.views[0].held_out && !c.views[1].held_out);
    assert_non_null(strstr(c.notes, "its 4 pictures are views of 3 moments"));
    saga_capture_free(&c);
    /* If only a range of moments is loaded, all views must stay. */
    o.first_frame = 1;
    o.end_frame = 2;
    c = load_with(f->path, &o);
    assert_true(c.moves && c.n_views == N_VIEWS);
    for (int v = 0; v < N_VIEWS; v++)
        assert_int_equal(saga_capture_has(&c, v, 0), v == 1);
    saga_capture_free(&c);
    /* A delay given as an option must be added to that of the times. */
    o.first_frame = o.end_frame = 0;
    o.late = "cam03=-1";
    c = load_with(f->path, &o);
    assert_int_equal(c.n_frames, 2);
    assert_true(saga_capture_has(&c, 0, 0) && saga_capture_has(&c, 1, 0) &&
                saga_capture_has(&c, 3, 1) && !saga_capture_has(&c, 2, 0));
    assert_true(fabs(c.views[0].late - 0.25) < 1e-9 && c.views[1].late == 0);
    saga_capture_free(&c);
}

/* The memory needed is that of the existing pictures, not of all views at all
 * times. */
TEST_IN_FOLDER(moving_camera_should_need_no_memory_for_what_is_missing)
{
    static const double time[] = { 0, 0.25, 0.5, 1 };
    saga_capture_options o = saga_capture_defaults();
    FREED_BY(saga_capture_free) saga_capture c;

    write_moving(f, "transforms.json", 0, 4, time);
    write_pictures(f, "train", camera_alone, 0, 1);
    o.n_threads = 1;
    /* The limit is enough for four pictures in RGB and one thread's work, not
     * for 16 pictures. */
    o.memory_nbytes = W * H * (4 * 3 + 3 * 7);
    c = load_with(f->path, &o);
    assert_int_equal(c.n_frames, 4);
    /* Times are multiples of a quarter, but four views make four frames, which
     * are thirds of the time. */
    assert_true(fabs(c.views[1].late - 0.75) < 1e-9 &&
                saga_capture_has(&c, 1, 0));
    assert_true(fabs(c.views[2].late - 0.5) < 1e-9 &&
                saga_capture_has(&c, 2, 1));
}

/* The number of poses is below SAGA_MAX_VIEWS, but the number of pictures is
 * above it, and each picture would become a view. The capture must be refused
 * before any picture is opened. */
TEST_IN_FOLDER(moving_camera_should_be_refused_when_it_has_too_many_pictures)
{
    const int n_poses = SAGA_MAX_VIEWS - 10, n = SAGA_MAX_VIEWS + 1;
    bytes b = { 0 };

    put_text(&b, "{\"camera_angle_x\": 1, \"frames\": [");
    for (int i = 0; i < n; i++)
        put_text(&b,
                 "%s{\"file_path\": \"%d\", \"time\": %d, "
                 "\"transform_matrix\": [[1, 0, 0, %d], [0, 1, 0, 0], "
                 "[0, 0, 1, 0], [0, 0, 0, 1]]}",
                 i ? ", " : "", i, i, i % n_poses);
    put_text(&b, "]}");
    write_bytes(f, "transforms.json", &b);
    refused(f->path, "transforms.json",
            "more than 4096 pictures of a camera that moves");
}

TEST_IN_FOLDER(listed_pictures_should_have_any_ending)
{
    write_json(f, "transforms.json", camera_and_number, 0, N_VIEWS, N_FRAMES,
               "p");
    write_pictures(f, "p", camera_and_number, 0, N_FRAMES);
    check_same(f->path, "nerfstudio, pictures", N_FRAMES, LOSSLESS);
    folder_run(f, "for p in p/*/*.png; do mv $p ${p%%png}jpg; done");
    check_same(f->path, "nerfstudio, pictures of another ending", N_FRAMES,
               LOSSLESS);
    /* Windows writes a byte order mark and separates folders by "\". */
    folder_run(f, "sed -i '1s/^/\\xef\\xbb\\xbf/; s#p/cam#p\\\\\\\\cam#g' "
                  "transforms.json && grep -q 'p..cam' transforms.json");
    check_same(f->path, "nerfstudio, as written on Windows", N_FRAMES,
               LOSSLESS);
}

/* --- Stills -------------------------------------------------------------- */

static void convert(folder *f, const char *ending, const char *how)
{
    folder_run(f,
               "ffmpeg -nostdin -v error -i images/cam%%02d.png %s -f image2 "
               "-start_number 0 images/cam%%02d.%s && rm images/*.png && "
               "sed -i s/png/%s/ sparse/0/images.txt",
               how, ending, ending);
}

TEST_IN_FOLDER(stills_should_be_the_scene_in_every_format)
{
    static const struct {
        const char *ending, *how;
        double least;
    } t[] = {
        { "jpg", "-q:v 1 -qmin 1 -pix_fmt yuvj444p", 40 },
        { "webp", "-c:v libwebp -lossless 1", LOSSLESS },
        { "tif", "", LOSSLESS },
        /* ffmpeg widens 8 bits by a shift, so that white is 65,280 of 65,535:
         * half of the levels come back one lower. */
        { "tiff", "-compression_algo lzw -pix_fmt rgb48le", 51 },
    };
    char name[40];

    for (size_t i = 0; i < sizeof t / sizeof *t; i++) {
        folder_run(f, "rm -rf images");
        write_model(f, "sparse/0", camera_alone, 1);
        write_pictures(f, "images", camera_alone, 0, 1);
        convert(f, t[i].ending, t[i].how);
        snprintf(name, sizeof name, "COLMAP, pictures .%s", t[i].ending);
        check_same(f->path, name, 1, t[i].least);
    }
}

TEST_IN_FOLDER(jpegs_should_be_refused_when_damaged)
{
    write_model(f, "sparse/0", camera_alone, 1);
    write_pictures(f, "images", camera_alone, 0, 1);
    convert(f, "jpg", "-q:v 2");
    folder_run(f, "cp images/cam01.jpg whole; head -c 900 whole "
                  ">images/cam01.jpg");
    refused(f->path, "images/cam01.jpg", "is damaged");
    folder_run(f, "head -c 300 whole >images/cam01.jpg");
    refused(f->path, "images/cam01.jpg", "is damaged");
    folder_run(f, "printf 'GIF89a..........' >images/cam01.jpg");
    refused(f->path, "images/cam01.jpg",
            "not a PNG, JPEG, WebP, "
            "TIFF or OpenEXR");
    folder_run(f, "printf 'RIFF....WEBPVP8 ' >images/cam01.jpg");
    refused(f->path, "images/cam01.jpg", "WebP is damaged");
}

/* --- What is missing ----------------------------------------------------- */

TEST_IN_FOLDER(missing_pictures_should_be_left_out)
{
    saga_capture c;

    write_model(f, "sparse/0", camera_and_number, N_FRAMES);
    write_pictures(f, "images", camera_and_number, 0, N_FRAMES);
    folder_run(f, "rm images/cam02/f_0000.png images/cam00/*");
    c = load(f->path);
    assert_int_equal(c.n_views, N_VIEWS - 1);
    assert_int_equal(c.n_frames, N_FRAMES);
    assert_string_equal(c.views[1].name, "cam02");
    assert_false(saga_capture_has(&c, 1, 0));
    assert_true(saga_capture_has(&c, 1, 1) && saga_capture_has(&c, 0, 0));
    assert_memory_equal(saga_capture_frame(&c, 1, 0),
                        saga_capture_frame(&scene, 2, 1), 3 * W * H);
    assert_memory_equal(saga_capture_frame(&c, 1, 2),
                        saga_capture_frame(&scene, 2, 2), 3 * W * H);
    assert_non_null(strstr(c.notes, "and left out: cam00\n"));
    assert_non_null(strstr(c.notes, "most of them to cam02 (1 of 3)"));
    saga_capture_free(&c);
    folder_run(f, "rm images/*/*");
    refused(f->path, f->path,
            "none of its 4 cameras has a picture; the first would be ");
    refused(f->path, f->path, "images/cam00/f_0000.png");
}

/* The numbers in the pictures' names tell which moment is missing from the
 * list. */
TEST_IN_FOLDER(unlisted_pictures_should_be_left_out)
{
    FREED_BY(saga_capture_free) saga_capture c;

    write_json(f, "transforms.json", camera_and_number, 0, N_VIEWS, N_FRAMES,
               "p");
    write_pictures(f, "p", camera_and_number, 0, N_FRAMES);
    folder_run(f, "rm p/cam03/f_0020.png && sed -i "
                  "'s/{\"file_path\": \"p.cam01.f_0010\"[^}]*}, //' "
                  "transforms.json");
    c = load(f->path);
    assert_int_equal(c.n_views, N_VIEWS);
    for (int v = 0; v < N_VIEWS; v++)
        for (int k = 0; k < N_FRAMES; k++) {
            const bool there = saga_capture_has(&c, v, k);

            assert_int_equal(there, !(v == 1 && k == 1) && !(v == 3 && k == 2));
            if (there)
                assert_memory_equal(saga_capture_frame(&c, v, k),
                                    saga_capture_frame(&scene, v, k),
                                    3 * W * H);
        }
    assert_non_null(strstr(c.notes, "pictures: 2 are missing"));
}

/* Frame k of a camera that is one frame late must be its picture k + 1. */
TEST_IN_FOLDER(late_cameras_should_be_shifted)
{
    saga_capture_options o = saga_capture_defaults();
    saga_capture c;

    write_model(f, "sparse/0", camera_and_number, 1);
    write_pictures(f, "images", camera_and_number, 0, N_FRAMES);
    o.late = "cam01=1,cam03=-1";
    c = load_with(f->path, &o);
    assert_int_equal(c.n_frames, N_FRAMES - 2);
    for (int v = 0; v < N_VIEWS; v++)
        assert_memory_equal(saga_capture_frame(&c, v, 0),
                            saga_capture_frame(&scene, v,
                                               v == 1   ? 2
                                               : v == 3 ? 0
                                                        : 1),
                            3 * W * H);
    saga_capture_free(&c);
    o.late = "cam01=3";
    refused_with(f->path, &o, f->path, "leaves none of 3 frames");
    o.late = "cam9=1";
    refused_with(f->path, &o, f->path, "--late names \"cam9\"");
    o.late = "cam01";
    refused_with(f->path, &o, f->path,
                 "\"cam01\" is not a camera with "
                 "a number");
    o.late = "cam01=x";
    refused_with(f->path, &o, f->path,
                 "\"cam01=x\" is not a camera with "
                 "a number");
}

TEST_IN_FOLDER(colmap_folder_should_be_refused_when_wrong)
{
    write_model(f, "sparse/0", camera_and_number, N_FRAMES);
    write_pictures(f, "images", camera_and_number, 0, N_FRAMES);
    folder_run(f, "mv images/cam01/f_0020.png images/cam01/g_0010.png");
    write_model(f, "sparse/0", camera_and_number, 1);
    refused(f->path, "images/cam01/g_0010.png",
            "second picture of camera "
            "cam01 with the number 10");
    write_text(f, "sparse/0/images.txt", "# none\n");
    refused(f->path, "sparse/0", "has 0 different cameras");
}
