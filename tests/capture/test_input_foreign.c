/* SPDX-License-Identifier: MIT
 *
 * Files as other programs leave them: numbers in names without zeros in front,
 * endings in capitals, files of the system between those of the user.
 */
#include "load.h"
#include "order.h"
#include "picture_files.h"
#include "testing.h"

extern const saga_loader saga_neu3d_loader;

enum { W = 16, H = 16 };

/* --- The order of names -------------------------------------------------- */

TEST(names_should_be_in_the_order_of_their_numbers)
{
    /* Every name is before all that follow it. */
    static const char *const sorted[] = { "",
                                          "-1",
                                          "0",
                                          "1",
                                          "1 a",
                                          "2",
                                          "9",
                                          "010",
                                          "10",
                                          "10.5",
                                          "10.40",
                                          "99999999999999999999",
                                          "100000000000000000000",
                                          "A2",
                                          "A10",
                                          "a",
                                          "a0",
                                          "a00001",
                                          "a01",
                                          "a01b3",
                                          "a1",
                                          "a1.mp4",
                                          "a1b2",
                                          "a1b10",
                                          "a2",
                                          "a10",
                                          "a10/b2",
                                          "a10/b10",
                                          "a\303\251" };
    enum { N = sizeof sorted / sizeof *sorted };

    for (int i = 0; i < N; i++)
        for (int k = 0; k < N; k++) {
            const int r = saga_compare_names(sorted[i], sorted[k]);

            if ((r > 0) - (r < 0) != (i > k) - (i < k))
                fail_msg("\"%s\" and \"%s\": %d", sorted[i], sorted[k], r);
        }
}

/* Names of equal length, with zeros in front of their numbers, must keep the
 * order of their bytes. */
TEST(padded_names_should_keep_their_order)
{
    char a[16], b[16];

    for (int i = 0; i < 200; i++)
        for (int k = 0; k < 200; k++) {
            snprintf(a, sizeof a, "cam%02d_%03d", i % 23, i);
            snprintf(b, sizeof b, "cam%02d_%03d", k % 23, k);
            const int r = saga_compare_names(a, b), want = strcmp(a, b);

            assert_int_equal((r > 0) - (r < 0), (want > 0) - (want < 0));
        }
}

static bool is_any(const char *name)
{
    return saga_has_suffix(name, ".png");
}

TEST_IN_FOLDER(folder_should_be_listed_without_hidden_names)
{
    static const char *const want[] = { "f1.PNG", "f2.png", "f10.png" };
    saga_names names;

    folder_run(f, "touch f10.png f2.png f1.PNG ._f1.PNG .png f3.txt png");
    assert_done(saga_folder_list(&names, f->path, is_any, &error));
    assert_int_equal(names.n, 3);
    for (int i = 0; i < 3; i++)
        assert_string_equal(names.at[i], want[i]);
    saga_names_free(&names);
    assert_done(saga_folder_list(&names, "/nowhere", is_any, &error));
    assert_int_equal(names.n, 0);
}

static const int number[] = { 1, 2, 3, 10, 11 };

enum { N_NUMBERS = 5 };

TEST_IN_FOLDER(frames_of_a_list_should_be_in_order)
{
    FREED_BY(saga_capture_free) saga_capture c;
    bytes b = { 0 };
    char name[32];

    /* Two cameras; the entries of each are listed in the order of text. */
    put_text(&b, "{\"fl_x\": 30, \"frames\": [");
    for (int i = 0; i < 2 * N_NUMBERS; i++) {
        const int k = (i + 3) % N_NUMBERS;

        snprintf(name, sizeof name, "f%d_%d.png", number[k], i / N_NUMBERS);
        write_grey(f, name, W, H, 20 * number[k], 20 * number[k]);
        put_text(&b,
                 "%s{\"file_path\": \"%s\", \"transform_matrix\": "
                 "[[1,0,0,%d],[0,1,0,0],[0,0,1,0]]}",
                 i ? ", " : "", name, i / N_NUMBERS);
    }
    put_text(&b, "]}");
    write_bytes(f, "transforms.json", &b);
    c = load(f->path);
    assert_int_equal(c.n_frames, N_NUMBERS);
    for (int v = 0; v < 2; v++)
        for (int k = 0; k < N_NUMBERS; k++)
            assert_int_equal(saga_capture_frame(&c, v, k)[0], 20 * number[k]);
}

TEST_IN_FOLDER(cameras_of_a_model_should_be_in_order)
{
    FREED_BY(saga_capture_free) saga_capture c;
    bytes b = { 0 };
    char name[32];

    folder_run(f, "mkdir -p sparse/0 images");
    write_text(f, "sparse/0/cameras.txt", "1 PINHOLE 16 16 20 20 8 8\n");
    write_text(f, "sparse/0/points3D.txt", "");
    for (int i = 0; i < N_NUMBERS; i++) {
        snprintf(name, sizeof name, "images/c%d.png", number[i]);
        write_grey(f, name, W, H, 20 * number[i], 20 * number[i]);
        put_text(&b, "%d 1 0 0 0 %d 0 0 1 c%d.png\n\n", i + 1, number[i],
                 number[i]);
    }
    write_bytes(f, "sparse/0/images.txt", &b);
    c = load(f->path);
    assert_int_equal(c.n_views, N_NUMBERS);
    for (int i = 0; i < N_NUMBERS; i++) {
        assert_true(c.views[i].translation[0] == number[i]);
        assert_int_equal(saga_capture_frame(&c, i, 0)[0], 20 * number[i]);
    }
}

TEST_IN_FOLDER(rows_should_belong_to_videos_in_order)
{
    const saga_capture_options o = saga_capture_defaults();
    FREED_BY(saga_listing_free) saga_listing l = { .path = f->path };
    bytes b = { 0 };

    folder_run(f, "ffmpeg -nostdin -v error -f lavfi -i testsrc=s=16x16 "
                  "-frames:v 1 cam1.mp4 && for i in 2 3 11; do cp cam1.mp4 "
                  "cam$i.mp4; done; cp cam1.mp4 cam10.MP4; touch ._cam1.mp4");
    put_npy(&b, "<f8", "False", "5, 17");
    for (int i = 0; i < N_NUMBERS; i++) {
        const double row[17] = { 0, 1, 0, number[i], H, 1,  0, 0, 0,
                                 W, 0, 0, -1,        0, 20, 1, 9 };

        for (int k = 0; k < 17; k++)
            put_f64(&b, row[k]);
    }
    write_bytes(f, "poses_bounds.npy", &b);
    assert_done(saga_neu3d_loader.list(&l, f->path, &o, &error));
    assert_int_equal(l.n_sources, N_NUMBERS);
    for (int i = 0; i < N_NUMBERS; i++) {
        char name[16];

        snprintf(name, sizeof name, "cam%d", number[i]);
        assert_string_equal(l.sources[i].name, name);
        assert_true(l.sources[i].translation[0] == -number[i]);
    }
}
