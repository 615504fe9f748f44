/* SPDX-License-Identifier: MIT
 *
 * Splats that move (FTGS PLY): a frame of a file has the places and opacities
 * of the layout's two formulas, and what is not seen in it is left out.
 */
#include "cloud_files.h"
#include "testing.h"

#include <math.h>
#include <unistd.h>

/* The first splat is at (1, 2, 3) at the time 1/2, with the opacity 1/2 and the
 * duration 1. The second lasts for e^-4 around the time 0. */
static const char header[] =
    "ply\nformat ascii 1.0\ncomment time_units normalized\n"
    "comment n_frames 5\ncomment use_velocity %d\nelement vertex 2\n"
    "property float x\nproperty float y\nproperty float z\n"
    "property float f_dc_0\nproperty float f_dc_1\nproperty float f_dc_2\n"
    "property float opacity\nproperty float scale_0\nproperty float scale_1\n"
    "property float scale_2\nproperty float rot_0\nproperty float rot_1\n"
    "property float rot_2\nproperty float rot_3\nproperty float time\n"
    "property float log_duration\nproperty float velocity_0\n"
    "property float velocity_1\nproperty float velocity_2\nend_header\n"
    "1 2 3  0 0 0  0  -1 -1 -1  1 0 0 0  0.5 0  4 0 -8\n"
    "7 7 7  0 0 0  3  -1 -1 -1  1 0 0 0  0 -4  1 1 1\n";

static void read_at(saga_cloud *cloud, uint32_t frame, int use_velocity)
{
    char path[] = "/tmp/saga_test_moving_XXXXXX";
    const int fd = mkstemp(path);
    FILE *const f = fdopen(fd, "w");

    assert_non_null(f);
    fprintf(f, header, use_velocity);
    fclose(f);
    assert_done(saga_cloud_read_frame(cloud, path, frame, 0, &error));
    unlink(path);
    assert_int_equal(cloud->n_frames, 5);
}

TEST(frame_should_have_its_places_and_opacities)
{
    saga_cloud c;

    read_at(&c, 3, 1); /* the time 3/4 */
    assert_int_equal(c.n, 1);
    assert_float_equal(c.mean[0], 2.0f, 1e-6);
    assert_float_equal(c.mean[1], 2.0f, 1e-6);
    assert_float_equal(c.mean[2], 1.0f, 1e-6);
    /* p = exp(-1/32) / 2. */
    assert_float_equal(1.0f / (1.0f + expf(-c.logit[0])), 0.48461664f, 1e-6);
    saga_cloud_free(&c);
}

TEST(short_splat_should_be_seen_in_its_frame)
{
    saga_cloud c;

    read_at(&c, 0, 1);
    assert_int_equal(c.n, 2);
    assert_float_equal(c.mean[3], 7.0f, 1e-6);
    assert_float_equal(c.logit[1], 3.0f, 1e-5);
    saga_cloud_free(&c);
}

TEST(velocity_should_be_ignored_if_the_header_says_so)
{
    saga_cloud c;

    read_at(&c, 3, 0);
    assert_float_equal(c.mean[0], 1.0f, 1e-6);
    saga_cloud_free(&c);
}
