/* SPDX-License-Identifier: MIT
 *
 * Arrays and points are read from files whose bytes are put together here from
 * the descriptions of the formats, not by the functions that read them. The
 * same files are also cut short, made invalid, or given wrong sizes.
 */
#include "capture_files.h"
#include "npy.h"
#include "ply.h"
#include "testing.h"

/* --- npy ----------------------------------------------------------------- */

static bytes npy_bytes(int version, const char *header)
{
    bytes b = { 0 };

    put(&b, "\x93NUMPY", 6);
    put_le(&b, (uint64_t)version, 2);
    put_le(&b, strlen(header), version == 1 ? 2 : 4);
    put_text(&b, "%s", header);
    return b;
}

static saga_npy read_npy(folder *f, bytes *b)
{
    saga_npy a;

    write_bytes(f, "a.npy", b);
    assert_done(saga_npy_read(&a, folder_file(f, "a.npy"), &error));
    return a;
}

static void refused_npy(folder *f, bytes *b, const char *what)
{
    saga_error error = { "" };
    saga_npy a;

    write_bytes(f, "a.npy", b);
    assert_false(saga_npy_read(&a, folder_file(f, "a.npy"), &error));
    assert_says(&error, "a.npy");
    assert_says(&error, what);
    assert_says(&error, "; save");
    assert_null(a.data);
}

/* Entry (r, c) of 2 x 3 is 10 r + c + 1/4. */
TEST_IN_FOLDER(npy_should_be_read_in_every_order_and_version)
{
    for (int way = 0; way < 12; way++) {
        const int version = way % 3 + 1;
        const bool fortran = way / 3 % 2, single = way / 6;
        char header[200];
        FREED_BY(saga_npy_free) saga_npy a;
        bytes b;

        snprintf(header, sizeof header,
                 "{'descr': '<f%d', 'fortran_order': "
                 "%s, 'shape': (2, 3), }      \n",
                 single ? 4 : 8, fortran ? "True" : "False");
        b = npy_bytes(version, header);
        for (int i = 0; i < 6; i++) {
            const int r = fortran ? i % 2 : i / 3;
            const int c = fortran ? i / 2 : i % 3;

            if (single)
                put_f32(&b, 10 * r + c + 0.25);
            else
                put_f64(&b, 10 * r + c + 0.25);
        }
        a = read_npy(f, &b);
        assert_int_equal(a.rows, 2);
        assert_int_equal(a.cols, 3);
        for (int i = 0; i < 6; i++)
            assert_true(a.data[i] == 10 * (i / 3) + i % 3 + 0.25);
    }
}

TEST_IN_FOLDER(npy_should_be_read_with_one_dimension)
{
    bytes b = npy_bytes(1, "{\"shape\":(2,),\"fortran_order\":False,"
                           "\"descr\":\"<f8\"}");
    FREED_BY(saga_npy_free) saga_npy a;

    put_f64(&b, -7);
    put_f64(&b, 1e300);
    a = read_npy(f, &b);
    assert_int_equal(a.rows, 2);
    assert_int_equal(a.cols, 1);
    assert_true(a.data[0] == -7 && a.data[1] == 1e300);
}

TEST_IN_FOLDER(npy_should_be_refused_when_it_is_something_else)
{
    static const char *const headers[] = {
        "{'descr': '>f8', 'fortran_order': False, 'shape': (1,), }",
        "{'descr': '<i8', 'fortran_order': False, 'shape': (1,), }",
        "{'descr': [('a', '<f8')], 'fortran_order': False, 'shape': (1,), }",
        "{'descr': '<f8', 'fortran_order': Maybe, 'shape': (1,), }",
        "{'descr': '<f8', 'fortran_order': False, 'shape': (1, 1, 1), }",
        "{'descr': '<f8', 'fortran_order': False, 'shape': (-1, 1), }",
        "{'descr': '<f8', 'fortran_order': False, 'shape': (), }",
        "{'descr': '<f8', 'fortran_order': False, 'shape': (1",
        "{'descr': '<f8', 'fortran_order': False}",
        "{'fortran_order': False, 'shape': (1,), 'descr':",
        ""
    };
    char longest[4096];
    bytes b;

    for (size_t i = 0; i < sizeof headers / sizeof headers[0]; i++) {
        b = npy_bytes(1, headers[i]);
        put_f64(&b, 1);
        refused_npy(f, &b, "has an unsupported header");
    }
    /* The header is as long as is allowed, and the key stands at its very end,
     * without a value. */
    memset(longest, ' ', sizeof longest);
    strcpy(longest + 4095 - 8, "'descr':");
    memcpy(longest, "'fortran_order': False", 22);
    b = npy_bytes(2, longest);
    refused_npy(f, &b, "has an unsupported header");
    b = (bytes){ 0 };
    put_text(&b, "not an array");
    refused_npy(f, &b, "is not an .npy file");
}

TEST_IN_FOLDER(npy_should_be_refused_when_its_size_lies)
{
    static const struct {
        const char *shape, *what;
    } t[] = { { "(2, 3)", "announces 2 x 3 numbers of 8 bytes but holds 40" },
              { "(0, 3)", "announces 0 x 3" },
              { "(4611686018427387904, 8)", "has an unsupported header" },
              { "(1000000000000000000, 1000000000000000000)", "announces" },
              { "(99999999999999999999999999,)",
                "has an unsupported header" } };
    bytes b;

    for (size_t i = 0; i < sizeof t / sizeof t[0]; i++) {
        char header[200];

        snprintf(header, sizeof header,
                 "{'descr': '<f8', 'fortran_order': "
                 "False, 'shape': %s, }",
                 t[i].shape);
        b = npy_bytes(1, header);
        for (int k = 0; k < 5; k++)
            put_f64(&b, k);
        refused_npy(f, &b, t[i].what);
    }
    b = npy_bytes(1, "{'descr': '<f8', 'fortran_order': False, ...");
    b.n = 40;
    refused_npy(f, &b, "its header is cut short");
    b = npy_bytes(9, "{}");
    refused_npy(f, &b, "is not an .npy file");
}

/* --- PLY ----------------------------------------------------------------- */

typedef struct {
    saga_point *points;
    size_t n, dropped;
} cloud;

static cloud read_ply(folder *f, bytes *b)
{
    cloud c;

    write_bytes(f, "p.ply", b);
    assert_done(saga_ply_read(folder_file(f, "p.ply"), &c.points, &c.n,
                              &c.dropped, &error));
    return c;
}

static void refused_ply(folder *f, bytes *b, const char *what)
{
    saga_error error = { "" };
    cloud c;

    write_bytes(f, "p.ply", b);
    assert_false(saga_ply_read(folder_file(f, "p.ply"), &c.points, &c.n,
                               &c.dropped, &error));
    assert_says(&error, "p.ply");
    assert_says(&error, what);
    assert_says(&error, "; ");
    assert_null(c.points);
}

static void check_two(cloud *c)
{
    assert_int_equal(c->n, 2);
    for (int i = 0; i < 2; i++) {
        const saga_point *const p = c->points + i;

        assert_true(p->position[0] == 0.5 + i && p->position[1] == -2 &&
                    p->position[2] == 1024);
        assert_int_equal(p->rgb[0], 200 + i);
        assert_int_equal(p->rgb[1], 20);
        assert_int_equal(p->rgb[2], 2);
    }
    free(c->points);
}

TEST_IN_FOLDER(ply_should_be_read_as_text)
{
    bytes b = { 0 };
    cloud c;

    put_text(&b,
             "ply\r\nformat ascii 1.0\r\ncomment by hand\r\n"
             "element vertex 3\r\nproperty uchar green\r\nproperty float x\r\n"
             "property double z\r\nproperty float y\r\nproperty uchar red\r\n"
             "property int spare\r\nproperty uchar blue\r\n"
             "element face 1\r\nproperty list uchar int vertex_indices\r\n"
             "end_header\r\n20 0.5 1024 -2 200 7 2\r\n20 1.5 1.024e3 -2.0 201 "
             "-7 2\r\n20 nan 0 0 1 1 1\r\n3 0 1 2\r\n");
    c = read_ply(f, &b);
    assert_int_equal(c.dropped, 1);
    check_two(&c);
}

TEST_IN_FOLDER(ply_should_be_read_as_little_endian_bytes)
{
    bytes b = { 0 };
    cloud c;

    put_text(&b,
             "ply\nformat binary_little_endian 1.0\nelement vertex 2\n"
             "property float64 x\nproperty short y\nproperty float32 z\n"
             "property ushort red\nproperty float green\nproperty int8 blue\n"
             "property uint flags\nend_header\n");
    for (int i = 0; i < 2; i++) {
        put_f64(&b, 0.5 + i);
        put_le(&b, 0xfffe, 2); /* -2 */
        put_f32(&b, 1024);
        put_le(&b, (uint64_t)(200 + i) * 257, 2);
        put_f32(&b, 20 / 255.0);
        put_le(&b, 2, 1);
        put_le(&b, 0x0a0a0a0a, 4);
    }
    c = read_ply(f, &b);
    assert_int_equal(c.dropped, 0);
    check_two(&c);
}

TEST_IN_FOLDER(ply_should_be_grey_without_colours_and_may_be_empty)
{
    bytes b = { 0 };
    cloud c;

    put_text(&b, "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\n"
                 "property float y\nproperty float z\nend_header\n1 2 3");
    c = read_ply(f, &b);
    assert_int_equal(c.n, 1);
    assert_int_equal(c.points[0].rgb[2], 128);
    free(c.points);
    put_text(&b, "ply\nformat ascii 1.0\nelement vertex 0\nproperty float x\n"
                 "property float y\nproperty float z\nend_header\n");
    c = read_ply(f, &b);
    assert_int_equal(c.n, 0);
    free(c.points);
}

TEST_IN_FOLDER(ply_should_come_back_as_it_was_written)
{
    saga_point points[3] = { { { 1, 2.5, -3 }, { 0, 128, 255 } },
                             { { -1e9, 0, 1e-9 }, { 1, 2, 3 } },
                             { { NAN, 0, 0 }, { 0, 0, 0 } } };
    cloud c;

    assert_done(saga_ply_write(folder_file(f, "q.ply"), points, 3, &error));
    assert_done(saga_ply_read(folder_file(f, "q.ply"), &c.points, &c.n,
                              &c.dropped, &error));
    assert_int_equal(c.n, 2);
    assert_int_equal(c.dropped, 1);
    for (int i = 0; i < 2; i++)
        for (int k = 0; k < 3; k++) {
            assert_true(c.points[i].position[k] ==
                        (double)(float)points[i].position[k]);
            assert_int_equal(c.points[i].rgb[k], points[i].rgb[k]);
        }
    free(c.points);
}

TEST_IN_FOLDER(ply_should_be_refused_when_it_is_wrong)
{
#define HEAD(format, count)                                    \
    "ply\nformat " format " 1.0\nelement vertex " count        \
    "\nproperty float x\nproperty float y\nproperty float z\n" \
    "end_header\n"
    static const struct {
        const char *text, *what;
    } t[] = {
        { "obj\n", "is not a PLY file" },
        { "", "is not a PLY file" },
        { HEAD("binary_big_endian", "1"), "format binary_big_endian" },
        { HEAD("ascii", "2") "1 2 3\n4.25 5.125", "cut short at point 1 of 2" },
        { HEAD("ascii", "1") "1 two 3\n", "cut short at point 0 of 1" },
        { HEAD("binary_little_endian", "2") "12345678901234567890",
          "announces 2 points but has only 20 bytes" },
        { HEAD("ascii", "18446744073709551615") "1 2 3\n",
          "announces 18446744073709551615 points" },
        { HEAD("binary_little_endian", "1537228672809129302") "123",
          "announces 1537228672809129302 points" },
        { HEAD("ascii", "-1") "1 2 3\n", "points but has only 6 bytes" },
        { "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\n"
          "property float z\nend_header\n1 2\n",
          "no x, y, z" },
        { "ply\nelement vertex 1\nproperty float x\nproperty float y\n"
          "property float z\nend_header\n0 0 0 0 0 0 0\n",
          "no format" },
        { "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\n",
          "cut short in its header" },
        { "ply\nformat ascii 1.0\nelement face 1\nproperty list uchar int i\n"
          "element vertex 1\n",
          "\"element face 1\" is not supported" },
        { "ply\nformat ascii 1.0\nelement vertex 1\nproperty list uchar int "
          "i\n",
          "\"property list uchar int i\" is not supported" },
        { "ply\nformat ascii 1.0\nelement vertex 1\nproperty half x\n",
          "\"property half x\" is not supported" }
    };

    for (size_t i = 0; i < sizeof t / sizeof t[0]; i++) {
        bytes b = { 0 };

        put(&b, t[i].text, strlen(t[i].text));
        refused_ply(f, &b, t[i].what);
    }
}
