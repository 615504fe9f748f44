/* SPDX-License-Identifier: MIT
 *
 * Splats on their way to other programs and back. The cloud of a film is
 * compared with the decoder's integers; spherical harmonics are checked to be
 * an orthonormal basis. test_cloud_files.c tests the files.
 */
#include "cloud_capture.h"
#include "file.h"
#include "film_cloud.h"
#include "gen_cloud.h"
#include "model.h"
#include "testing.h"

static saga_error error;

/* --- Harmonics ----------------------------------------------------------- */

/* With 400 slices and 16 steps, a polynomial of degree 6 is integrated to 1e-4.
 * Gauss-Legendre quadrature would need fewer points, but more code. */
enum { SLICES = 400, STEPS = 16 };

TEST(harmonics_should_be_orthonormal)
{
    double sum[SAGA_MAX_HARMONICS][SAGA_MAX_HARMONICS] = { { 0 } };

    for (int i = 0; i < SLICES; i++)
        for (int j = 0; j < STEPS; j++) {
            const double z = (2.0 * i + 1) / SLICES - 1, r = sqrt(1 - z * z);
            const double a = 2 * M_PI * j / STEPS;
            const double d[3] = { r * cos(a), r * sin(a), z };
            double y[SAGA_MAX_HARMONICS];

            saga_harmonics(y, d);
            for (int k = 0; k < SAGA_MAX_HARMONICS; k++)
                for (int l = 0; l < SAGA_MAX_HARMONICS; l++)
                    sum[k][l] += y[k] * y[l] * 4 * M_PI / (SLICES * STEPS);
        }
    for (int k = 0; k < SAGA_MAX_HARMONICS; k++)
        for (int l = 0; l < SAGA_MAX_HARMONICS; l++)
            assert_near(sum[k][l], k == l, 2e-4);
}

TEST(turned_harmonics_should_see_the_turned_direction)
{
    static const int axes[2] = { 0, 2 };
    const double d[3] = { 0.36, 0.48, -0.8 };
    double y[SAGA_MAX_HARMONICS], z[SAGA_MAX_HARMONICS];

    saga_harmonics(y, d);
    for (int i = 0; i < 2; i++) {
        double e[3];

        for (int a = 0; a < 3; a++)
            e[a] = a == axes[i] ? d[a] : -d[a];
        saga_harmonics(z, e);
        for (int k = 0; k < SAGA_MAX_HARMONICS; k++)
            assert_near(z[k], saga_harmonic_turned(k, axes[i]) * y[k], 1e-12);
    }
}

/* --- A film's cloud ------------------------------------------------------ */

/* Sets c to the covariance for a quaternion of any length and deviations s. */
static void covariance(double c[9], const double q[4], const double s[3])
{
    const double n = q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3];
    const double w = q[0], x = q[1], y = q[2], z = q[3];
    const double r[9] = { w * w + x * x - y * y - z * z, 2 * (x * y - w * z),
                          2 * (x * z + w * y),           2 * (x * y + w * z),
                          w * w - x * x + y * y - z * z, 2 * (y * z - w * x),
                          2 * (x * z - w * y),           2 * (y * z + w * x),
                          w * w - x * x - y * y + z * z };

    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) {
            c[3 * i + j] = 0;
            for (int k = 0; k < 3; k++)
                c[3 * i + j] += r[3 * i + k] * r[3 * j + k] * s[k] * s[k] /
                                (n * n);
        }
}

/* Returns the area that min(1, P 2^-fall(s)) covers, by the midpoint rule over
 * s, which is proportional to r^2. */
static double covered(double peak, bool is_steep)
{
    const double step = 1e-3;
    double sum = 0;

    for (double s = step / 2; s < 40; s += step)
        sum += step * fmin(1, peak * exp2(is_steep ? -s - s * s / 2 : -s));
    return sum;
}

static void check_splat(const saga_cloud *cloud, size_t i,
                        const saga_film *film, const saga_animated *a)
{
    /* The normal distribution min(1, P) exp(-r^2 / (2 w^2)) must cover the same
     * area. */
    const saga_metric *const m = &film->metric;
    const bool is_steep = (film->info.tools & SAGA_TOOL_STEEP) != 0;
    const double peak = exp2(3 - a->q0_q20 / 1048576.0);
    const double wide = sqrt(log(2) * covered(peak, is_steep) / fmin(1, peak));
    double q[4], s[3], c[9], p[4], t[3], d[9], most = 0;

    for (size_t k = 0; k < 4; k++) {
        q[k] = (double)cloud->quat[4 * i + k];
        p[k] = a->quat[k];
    }
    for (size_t k = 0; k < 3; k++) {
        assert_near((double)cloud->mean[3 * i + k],
                    m->centre[k] + m->unit * a->x[k], 1e-6);
        s[k] = exp((double)cloud->log_scale[3 * i + k]);
        t[k] = m->unit * wide * exp2(a->log2_scale_q10[k] / 1024.0);
        most = fmax(most, t[k] * t[k]);
    }
    covariance(c, q, s);
    covariance(d, p, t);
    for (int k = 0; k < 9; k++)
        assert_near(c[k], d[k], 1e-5 * most);
    assert_near(1 / (1 + exp(-(double)cloud->logit[i])), fmin(1, peak), 1e-6);
}

static void check_cloud(const char *name)
{
    saga_film_colours colours = { .segment = -1 };
    const saga_colouring how = { .camera = 1, .degree = 3 };
    FREED_BY(saga_bytes_free) saga_bytes bytes;
    FREED_BY(saga_film_close) saga_film film;
    saga_cloud cloud;
    saga_report report;
    size_t n = 0;
    int32_t t;

    assert_true(saga_read_file(&bytes, name, &error));
    assert_true(
        saga_film_open(&film, name, bytes.data, bytes.nbytes, 1, &error));
    assert_true(saga_film_cloud(&cloud, &colours, &film, 7, how, &error));
    assert_int_equal(cloud.degree, 0);
    assert_true(saga_film_seek(&film, 7, 1, &t, &error));
    assert_ok(saga_tell(&report, film.dec));
    for (uint32_t i = 0; i < report.n_primitives; i++) {
        saga_animated a;
        saga_camera c;
        uint16_t colour[3];
        uint32_t number;

        assert_ok(saga_primitive_at(&a, film.dec, i, t));
        if (a.q0_q20 >= 11 << 20)
            continue;
        check_splat(&cloud, n, &film, &a);
        assert_true(saga_film_rig(&film, 1, &c, &number, &error));
        assert_ok(saga_colour_at(colour, film.dec, i, c.centre));
        for (size_t k = 0; k < 3; k++)
            assert_near(0.5 + 0.28209479177387814 *
                                  (double)cloud.colour[3 * n + k],
                        colour[k] / 32768.0, 1e-6);
        n++;
    }
    assert_int_equal(n, cloud.n);
    assert_true(n > 5);
    saga_cloud_free(&cloud);
    free(colours.harmonics);
}

TEST(cloud_should_be_the_primitives_of_a_frame)
{
    check_cloud("vectors/good/motion.saga");
    check_cloud("vectors/good/steep.saga");
}

/* --- Where it is --------------------------------------------------------- */

TEST(far_off_splats_should_not_move_the_scene)
{
    double centre[3], radius, again[3], same;
    FREED_BY(saga_cloud_free) saga_cloud cloud;

    gen_cloud(&cloud, 200, 0);
    assert_true(saga_cloud_extent(centre, &radius, &cloud, &error));
    assert_true(radius > 0.5 && radius < 2);
    cloud.mean[3 * 150] = 1e5f;
    cloud.mean[3 * 151 + 1] = -1e5f;
    assert_true(saga_cloud_extent(again, &same, &cloud, &error));
    assert_near(same, radius, 0.05);
    for (int k = 0; k < 3; k++)
        assert_near(again[k], centre[k], 0.1);
}
