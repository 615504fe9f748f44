/* SPDX-License-Identifier: MIT
 *
 * Captures from strangers. Input that would make ffmpeg read other files, make
 * a program wait for ever, or let training continue with meaningless numbers,
 * is refused with a helpful message.
 */
#include "child.h"
#include "picture_files.h"
#include "testing.h"
#include "video_files.h"

#include <sys/stat.h>
#include <time.h>

static const char *const videos[] = { "a.mp4", "b.mp4" };
static const char *const pictures[] = { "a.png", "b.png", "b.png" };

/* --- Videos -------------------------------------------------------------- */

/* The mp4 is cut after the box that lists its frames, so that all frames are
 * missing. */
TEST_IN_FOLDER(video_should_be_refused_when_cut_before_its_frames)
{
    write_video(f, "b.mp4", 5, 10, "-movflags +faststart");
    folder_run(f, "head -c $(($(grep -abom1 mdat b.mp4 | cut -d: -f1) + 4)) "
                  "b.mp4 >a.mp4");
    write_json(f, "", videos, 2);
    refused(f->path, "a.mp4", "it may be cut short");
}

TEST(child_should_be_given_up_when_it_hangs)
{
    static const char *const argv[] = { "sleep", "100", NULL };
    const time_t start = time(NULL);
    saga_child child;
    char byte;

    assert_done(saga_child_start(&child, argv, &error));
    assert_int_equal(child.patience, SAGA_CHILD_PATIENCE);
    child.patience = 1;
    assert_int_equal(saga_child_read(&child, &byte, 1), 0);
    assert_int_equal(saga_child_end(&child, false), -1);
    assert_string_equal(child.tail, "it printed nothing for 1 s");
    assert_true(time(NULL) - start < 50);
}

TEST_IN_FOLDER(folder_of_temporary_files_should_be_blamed)
{
    const char *const old = getenv("TMPDIR");
    FREED char *const before = old ? strdup(old) : NULL;

    write_video(f, "a.mp4", 5, 10, "");
    write_json(f, "", videos, 1);
    setenv("TMPDIR", "/nowhere/at/all", 1);
    refused(f->path, "/nowhere/at/all", "set TMPDIR to a folder");
    if (before)
        setenv("TMPDIR", before, 1);
    else
        unsetenv("TMPDIR");
}

/* --- Pipes --------------------------------------------------------------- */

TEST_IN_FOLDER(pipe_should_not_be_waited_for)
{
    saga_capture c;

    write_grey(f, "b.png", W, H, 0, 0);
    assert_int_equal(mkfifo(folder_file(f, "a.png"), 0600), 0);
    write_json(f, "", pictures, 2);
    alarm(120);
    c = load(f->path);
    assert_int_equal(c.n_views, 1);
    saga_capture_free(&c);
    folder_run(f, "rm transforms.json && mkfifo transforms.json");
    refused(folder_file(f, "transforms.json"), "transforms.json",
            "give the folder of a capture");
    folder_run(f, "rm transforms.json");
    write_json(f, "\"ply_file_path\": \"p.ply\", ", pictures + 1, 2);
    assert_int_equal(mkfifo(folder_file(f, "p.ply"), 0600), 0);
    refused(f->path, "p.ply", "is not a regular file");
    alarm(0);
}

/* --- Numbers ------------------------------------------------------------- */

TEST_IN_FOLDER(focal_length_should_be_refused_when_absurd)
{
    static const char *const absurd[] = { "\"fl_x\": 1e-5, ",
                                          "\"fl_x\": 0.6, ",
                                          "\"fl_x\": 1e9, ",
                                          "\"fl_x\": 30, \"fl_y\": 1e-300, ",
                                          "\"camera_angle_x\": 3.14159, ",
                                          "\"camera_angle_x\": 1e-6, " };
    FREED_BY(saga_capture_free) saga_capture c;

    write_grey(f, "a.png", W, H, 0, 0);
    write_grey(f, "b.png", W, H, 0, 0);
    for (size_t i = 0; i < sizeof absurd / sizeof *absurd; i++) {
        write_json(f, absurd[i], pictures, 2);
        refused(f->path, f->path, "focal lengths of");
    }
    write_json(f, "\"fl_x\": 0.7, ", pictures, 2);
    c = load(f->path);
}

TEST_IN_FOLDER(frame_rate_should_be_refused_when_absurd)
{
    static const char *const absurd[] = { "1e-300", "0.05", "1e6", "1e300" };
    FREED_BY(saga_capture_free) saga_capture c;
    char also[80];

    write_grey(f, "a.png", W, H, 0, 0);
    write_grey(f, "b.png", W, H, 0, 0);
    for (size_t i = 0; i < sizeof absurd / sizeof *absurd; i++) {
        snprintf(also, sizeof also, "\"fps\": %s, ", absurd[i]);
        write_json(f, also, pictures, 2);
        refused(f->path, f->path, "its frame rate is");
    }
    write_json(f, "\"fps\": 0.1, ", pictures, 2);
    c = load(f->path);
    assert_true(c.fps == 0.1);
}

/* The message must name the option of `saga encode` that gives more memory. */
TEST_IN_FOLDER(memory_should_be_asked_for_by_its_option)
{
    saga_capture_options o = saga_capture_defaults();

    write_grey(f, "a.png", W, H, 0, 0);
    write_grey(f, "b.png", W, H, 0, 0);
    write_json(f, "", pictures, 2);
    o.memory_nbytes = 100;
    refused_with(f->path, &o, f->path, "; use --memory 1 (GiB)");
}
