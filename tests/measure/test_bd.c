/* SPDX-License-Identifier: MIT
 *
 * The BD-rate is tested on curves whose result is known: with a constant factor
 * between them, on a parabola, and at a point where the two splines must
 * differ. Invalid curves are refused.
 */
#include "bd.h"
#include "testing.h"

static saga_bd_curve curve(int n, const double *nbytes, const double *quality)
{
    saga_bd_curve c = { .n = n };

    for (int i = 0; i < n; i++)
        c.point[i] = (saga_bd_point){ nbytes[i], quality[i] };
    return c;
}

static const double bytes[] = { 20e3, 41e3, 79e3, 170e3, 333e3 };
static const double psnr[] = { 27.1, 29.9, 31.6, 34.7, 35.9 };

TEST(bd_rate_should_be_a_factor_when_curves_differ_by_it)
{
    double fewer[5];
    saga_bd_curve a = curve(5, bytes, psnr), b;

    for (int i = 0; i < 5; i++)
        fewer[i] = 0.8 * bytes[4 - i];
    b = curve(5, fewer, (const double[]){ 35.9, 34.7, 31.6, 29.9, 27.1 });
    assert_near(saga_bd_rate(&a, &b).pchip, -20.0, 1e-9);
    assert_near(saga_bd_rate(&a, &b).akima, -20.0, 1e-9);
    assert_near(saga_bd_rate(&b, &a).pchip, 25.0, 1e-9);
    assert_near(saga_bd_rate(&a, &a).akima, 0.0, 1e-9);
    assert_near(saga_bd_rate(&a, &a).overlap, 1.0, 1e-12);
}

/* Akima's spline is exact on parabolas, also on a part of a curve. log bytes =
 * 9 + q^2 / 50 is compared with 9 + q / 5: over [4, 10] their means must be 9 +
 * 52 / 50 and 9 + 7 / 5. */
TEST(bd_rate_should_be_exact_on_a_parabola)
{
    double q[6], nbytes[6], p[6], line[6];
    saga_bd_curve a, b;
    saga_bd bd;

    for (int i = 0; i < 6; i++) {
        q[i] = 2 * i;
        nbytes[i] = exp(9 + q[i] * q[i] / 50);
        p[i] = 4 + 2 * i;
        line[i] = exp(9 + p[i] / 5);
    }
    a = curve(6, nbytes, q);
    b = curve(6, line, p);
    bd = saga_bd_rate(&a, &b);
    assert_null(bd.refused);
    assert_near(bd.lo, 4, 0);
    assert_near(bd.hi, 10, 0);
    assert_near(bd.akima, 100 * (exp(1.4 - 1.04) - 1), 1e-9);
    /* Monotone cubics are not exact on a parabola, but must be near. */
    assert_near(bd.pchip, bd.akima, 0.5);
    assert_true(fabs(bd.pchip - bd.akima) > 1e-6);
}

/* The expected values come from lab/bd_rate.py, an independent
 * implementation. */
TEST(bd_rate_should_be_that_of_the_laboratory)
{
    static const double q[] = { 28.0, 30.5, 33.0, 36.4 };
    const saga_bd_curve a = curve(5, bytes, psnr);
    const saga_bd_curve b = curve(
        4, (const double[]){ 18e3, 36e3, 90e3, 250e3 }, q);

    assert_near(saga_bd_rate(&a, &b).pchip, -23.335992583781117, 1e-9);
}

static void refused(const saga_bd_curve *a, const saga_bd_curve *b,
                    const char *why)
{
    const saga_bd bd = saga_bd_rate(a, b);

    assert_non_null(bd.refused);
    assert_non_null(strstr(bd.refused, why));
    assert_true(isnan(bd.pchip) && isnan(bd.akima));
}

TEST(bd_rate_should_be_refused_when_it_means_nothing)
{
    saga_bd_curve a = curve(5, bytes, psnr), b = a;

    b.n = 3;
    refused(&a, &b, "four points");
    refused(&b, &a, "four points");
    b = a;
    b.point[2].quality = (double)INFINITY;
    refused(&a, &b, "not measured");
    b = a;
    b.point[1].quality = b.point[2].quality + 1;
    refused(&a, &b, "does not grow");
    b = a;
    b.point[2].quality = b.point[1].quality;
    refused(&a, &b, "does not grow");
    for (int i = 0; i < 5; i++)
        b.point[i].quality = a.point[i].quality + 6.7;
    refused(&a, &b, "too little"); /* the curves share 2.1 of 8.8 dB */
    for (int i = 0; i < 5; i++)
        b.point[i].quality = a.point[i].quality + 6.5;
    assert_null(saga_bd_rate(&a, &b).refused);
    for (int i = 0; i < 5; i++)
        b.point[i].quality = a.point[i].quality + 9.0;
    refused(&a, &b, "too little");
}
