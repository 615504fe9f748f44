/* SPDX-License-Identifier: MIT
 *
 * glTF files made by hand: packed and integer attributes, and files that must
 * be refused.
 */
#include "cloud_files.h"
#include "gen_cloud.h"
#include "put.h"
#include "testing.h"

#include <unistd.h>

/* The values of one splat, and a file that has them with a rotation of 16 bits
 * and an opacity of 8 bits. */
static const float mean[3] = { 1, 2, 3 }, scale[3] = { 1, 0.5f, 0.25f };
static const float colour[3] = { 0.5f, 0, -0.5f };

static const char *const whole =
    "{\"asset\":{\"version\":\"2.0\"},\"meshes\":[{\"primitives\":[{\"mode\":0,"
    "\"attributes\":{\"POSITION\":0,\"KHR_gaussian_splatting:ROTATION\":1,"
    "\"KHR_gaussian_splatting:SCALE\":2,\"KHR_gaussian_splatting:OPACITY\":3,"
    "\"KHR_gaussian_splatting:SH_DEGREE_0_COEF_0\":4},\"extensions\":{"
    "\"KHR_gaussian_splatting\":{\"kernel\":\"ellipse\","
    "\"colorSpace\":\"srgb_rec709_display\"}}}]}],"
    "\"nodes\":[{\"mesh\":0},{\"children\":[0],\"scale\":[1,1,1]}],"
    "\"buffers\":[{\"byteLength\":56}],\"bufferViews\":["
    "{\"buffer\":0,\"byteLength\":12},"
    "{\"buffer\":0,\"byteOffset\":12,\"byteLength\":8},"
    "{\"buffer\":0,\"byteOffset\":20,\"byteLength\":12,\"byteStride\":12},"
    "{\"buffer\":0,\"byteOffset\":32,\"byteLength\":4},"
    "{\"buffer\":0,\"byteOffset\":36,\"byteLength\":20}],\"accessors\":["
    "{\"bufferView\":0,\"componentType\":5126,\"count\":1,\"type\":\"VEC3\"},"
    "{\"bufferView\":1,\"componentType\":5122,\"normalized\":true,\"count\":1,"
    "\"type\":\"VEC4\"},"
    "{\"bufferView\":2,\"componentType\":5126,\"count\":1,\"type\":\"VEC3\"},"
    "{\"bufferView\":3,\"componentType\":5121,\"normalized\":true,\"count\":1,"
    "\"type\":\"SCALAR\"},"
    "{\"bufferView\":4,\"byteOffset\":8,\"componentType\":5126,\"count\":1,"
    "\"type\":\"VEC3\"}]}";

static void put_floats(uint8_t **at, const float v[3])
{
    for (int k = 0; k < 3; k++)
        saga_put_f32(at, v[k]);
}

/* Writes the binary chunk that `whole` describes. */
static size_t put_bin(uint8_t *to)
{
    uint8_t *at = to;

    put_floats(&at, mean);
    /* The quaternion of -60 degrees around x is (-1/2, 0, 0, sqrt(3/4)) in the
     * order x, y, z, w, up to rounding. */
    saga_put_le(&at, (uint32_t)-16384, 2);
    saga_put_le(&at, 0, 4);
    saga_put_le(&at, 28377, 2);
    put_floats(&at, scale);
    saga_put_le(&at, 51, 4);
    saga_put_le(&at, 0, 4);
    saga_put_le(&at, 0, 4);
    put_floats(&at, colour);
    return (size_t)(at - to);
}

/* Reads a file made of a text chunk and a binary chunk; `why` gets the reason
 * of a refusal. */
static bool read_glb(saga_cloud *cloud, const char *text, const uint8_t *bin,
                     size_t nbytes, saga_error *why)
{
    char path[] = "/tmp/saga_test_glb_XXXXXX";
    const int fd = mkstemp(path);
    FILE *const f = fd < 0 ? NULL : fdopen(fd, "wb");
    uint8_t head[20], *at = head, tail[8], *behind = tail;
    bool ok;

    assert_non_null(f);
    saga_put_le(&at, 0x46546c67, 4);
    saga_put_le(&at, 2, 4);
    saga_put_le(&at, (uint32_t)(28 + strlen(text) + nbytes), 4);
    saga_put_le(&at, (uint32_t)strlen(text), 4);
    saga_put_le(&at, 0x4e4f534a, 4);
    saga_put_le(&behind, (uint32_t)nbytes, 4);
    saga_put_le(&behind, 0x004e4942, 4);
    fwrite(head, 1, sizeof head, f);
    fwrite(text, 1, strlen(text), f);
    fwrite(tail, 1, sizeof tail, f);
    fwrite(bin, 1, nbytes, f);
    assert_int_equal(fclose(f), 0);
    *why = (saga_error){ "" };
    ok = saga_cloud_read(cloud, path, 0, why);
    unlink(path);
    return ok;
}

static void near(float value, double wanted)
{
    assert_near((double)value, wanted, 1e-4);
}

TEST(integers_should_be_read_as_what_they_stand_for)
{
    FREED_BY(saga_cloud_free) saga_cloud c;
    uint8_t bin[64];
    const size_t n = put_bin(bin);
    saga_error why;

    if (!read_glb(&c, whole, bin, n, &why))
        fail_msg("%s", why.message);
    assert_int_equal(c.n, 1);
    assert_int_equal(c.degree, 0);
    /* Half a turn around z gives the axes of PLY. */
    near(c.mean[0], -1);
    near(c.mean[1], -2);
    near(c.mean[2], 3);
    near(c.quat[0], sqrt(0.75));
    near(c.quat[1], 0.5);
    for (int k = 0; k < 3; k++) {
        near(c.log_scale[k], -k * log(2));
        near(c.colour[k], (double)colour[k]);
    }
    near(c.logit[0], log(0.2 / 0.8));
}

/* Scales that are negative are logarithms, and opacities above 1 logits. */
TEST(logarithms_and_logits_should_be_found)
{
    static const float logs[3] = { -1, -2, 0.5f };
    FREED_BY(saga_cloud_free) saga_cloud c;
    uint8_t bin[64], *at = bin + 20;
    const size_t n = put_bin(bin);
    FREED char *const text = strdup(whole);
    saga_error why;

    put_floats(&at, logs);
    /* The opacity is an integer that stands for itself: the byte is 51. */
    memcpy(strstr(strstr(text, "5121"), "true"), "null", 4);
    if (!read_glb(&c, text, bin, n, &why))
        fail_msg("%s", why.message);
    for (int k = 0; k < 3; k++)
        near(c.log_scale[k], (double)logs[k]);
    near(c.logit[0], 16); /* what is cut there */
    assert_int_equal(c.facts.count[SAGA_FACT_LOG_SCALE], 1);
    assert_int_equal(c.facts.count[SAGA_FACT_LOGIT], 1);
}

TEST(packed_splats_should_be_read_as_the_file_alone)
{
    FREED_BY(saga_cloud_free) saga_cloud a;
    FREED_BY(saga_cloud_free) saga_cloud b;
    saga_cloud none;
    saga_bytes spz;
    char text[512];
    saga_error why;

    assert_done(
        saga_read_file(&spz, "tests/exchange/theirs/version3.spz", &error));
    (void)snprintf(text, sizeof text,
                   "{\"meshes\":[{\"primitives\":[{"
                   "\"extensions\":{\"KHR_gaussian_splatting\":{"
                   "\"extensions\":{\"KHR_gaussian_splatting_compression_spz_2"
                   "\":{\"bufferView\":0}}}}}]}],\"buffers\":[{\"byteLength\":"
                   "%zu}],\"bufferViews\":[{\"buffer\":0,\"byteLength\":%zu}]}",
                   spz.nbytes, spz.nbytes);
    if (!read_glb(&a, text, spz.data, spz.nbytes, &why))
        fail_msg("%s", why.message);
    assert_done(
        saga_cloud_read(&b, "tests/exchange/theirs/version3.spz", 0, &error));
    assert_int_equal(a.n, b.n);
    assert_memory_equal(a.mean, b.mean, a.n * 3 * sizeof(float));
    assert_memory_equal(a.colour, b.colour, a.n * 48 * sizeof(float));
    /* If the buffer view does not hold the whole SPZ, the file must be
     * refused. */
    assert_false(read_glb(&none, text, spz.data, spz.nbytes - 1, &why));
    saga_bytes_free(&spz);
}

/* Checks that `whole` with a piece of its text replaced is refused. */
static void refused(const char *piece, const char *other, const char *says)
{
    const char *const at = strstr(whole, piece);
    uint8_t bin[64];
    const size_t n = put_bin(bin);
    char text[4096];
    saga_cloud c;
    saga_error why;

    assert_non_null(at);
    (void)snprintf(text, sizeof text, "%.*s%s%s", (int)(at - whole), whole,
                   other, at + strlen(piece));
    if (read_glb(&c, text, bin, n, &why))
        fail_msg("%s is taken", other);
    if (!strstr(why.message, says))
        fail_msg("%s: not \"%s\"", why.message, says);
}

TEST(others_should_be_refused)
{
    refused("\"scale\":[1,1,1]", "\"scale\":[1,2,1]", "its node 1 moves");
    refused("{\"mesh\":0}", "{\"mesh\":0,\"rotation\":[1,0,0,0]}",
            "its node 0 moves");
    refused("{\"mesh\":0}", "{\"mesh\":0,\"children\":[1],\"scale\":[2,2,2]}",
            "its node 0 moves");
    refused("srgb_rec709_display", "lin_rec709_display",
            "colours in lin_rec709_display");
    refused("SH_DEGREE_0", "SH_DEGREE_9", "have no KHR_gaussian_splatting:SH_");
    refused("\"KHR_gaussian_splatting\":{", "\"KHR_points\":{",
            "has 0 primitives");
    refused("\"buffer\":0,\"byteLength\":12", "\"buffer\":0,\"byteLength\":57",
            "not within its binary chunk of 56 bytes");
    refused("\"byteOffset\":36", "\"byteOffset\":-1", "buffer view 4");
    refused("\"buffer\":0", "\"buffer\":1", "buffer view 0");
    refused("\"buffers\":[{", "\"buffers\":[{\"uri\":\"x.bin\",",
            "save it as one .glb file");
    refused("\"byteOffset\":8", "\"byteOffset\":12", "announces 1 elements");
    refused("\"count\":1", "\"count\":2", "POSITION announces 2 elements");
    refused("\"count\":1", "\"count\":1e9", "POSITION has an unsupported form");
    refused("\"count\":1", "\"count\":-1", "POSITION has an unsupported form");
    refused("\"type\":\"SCALAR\"", "\"type\":\"VEC3\"",
            "OPACITY has an unsupported form");
    refused("5121", "5125", "OPACITY has an unsupported form");
    refused("{\"asset\"", "[{\"asset\"", "is not valid JSON");
}
