/* SPDX-License-Identifier: MIT
 *
 * Exposures of cameras, estimated from pairs of colours that are made here with
 * known factors for each camera and channel, must be those factors.
 */
#include "exposure.h"
#include "testing.h"

enum { N_VIEWS = 5, N_PAIRS = 400 };

/* The cameras whose exposures are estimated, and the brightness of all: the
 * third is half as bright and reddish, the fifth is in no pair. */
static const int train[] = { 0, 1, 2, 3 };
static const double factor[N_VIEWS][3] = { { 1, 1, 1 },
                                           { 1.2, 1.2, 1.2 },
                                           { 0.6, 0.5, 0.4 },
                                           { 1, 0.9, 1.1 },
                                           { 1, 1, 1 } };

/* Makes pairs of the colours that two of the four cameras have of a place. Each
 * seventh pair is an outlier, as if the two cameras showed different
 * surfaces. */
static void make_pairs(saga_exposure_pair *at)
{
    for (int i = 0; i < N_PAIRS; i++) {
        at[i].a = i % 4;
        at[i].b = (i + 1 + i / 4 % 3) % 4;
        for (int k = 0; k < 3; k++)
            at[i].log[k] = i % 7 == 0
                               ? 0.9 - 0.31 * (i % 5)
                               : log(factor[at[i].a][k] / factor[at[i].b][k]);
    }
}

TEST(pairs_should_give_the_factors_back)
{
    saga_exposure_pair at[N_PAIRS];
    const saga_exposure_pairs pairs = { at, N_PAIRS, N_VIEWS, train, 4 };
    double found[3 * N_VIEWS], sum[3] = { 0 };
    saga_error error;

    make_pairs(at);
    assert_true(saga_exposure_solve(found, &pairs, &error));
    for (int v = 0; v < 4; v++)
        for (int k = 0; k < 3; k++) {
            sum[k] += found[3 * v + k];
            /* An exposure must be one over the planted factor. It is compared
             * relative to the first camera's, because a factor that all cameras
             * share shows in no pair. */
            assert_true(fabs(found[3 * v + k] - found[k] +
                             log(factor[v][k] / factor[0][k])) < 0.02);
        }
    for (int k = 0; k < 3; k++) {
        assert_true(fabs(sum[k]) < 1e-9);
        assert_true(found[3 * 4 + k] == 0);
    }
    /* The channel with the widest range is blue, from 0.4 to 1.2. */
    assert_true(fabs(saga_exposure_span(found, &pairs) - log(3)) < 0.04);
}

TEST(places_should_tell_stops_unless_cut_off)
{
    static const double grey[] = { 100, 100, 100 }, white[] = { 250, 250, 250 };
    double stops, twice[3];

    /* Doubling the light multiplies a display value by 2^(1 / 2.2). */
    for (int k = 0; k < 3; k++)
        twice[k] = 100 * exp2(1 / 2.2);
    assert_true(saga_exposure_compare(&stops, twice, grey));
    assert_true(fabs(stops - 1) < 1e-12);
    assert_true(fabs(saga_exposure_gain(1) - twice[0] / 100) < 1e-12);
    assert_false(saga_exposure_compare(&stops, grey, white));
}

TEST(error_should_be_what_the_best_factor_leaves)
{
    /* Red is half of the truth. Green is right in the first pixel and wrong in
     * the second. Blue is 0 instead of 3, which no factor corrects. */
    static const uint8_t made[] = { 10, 20, 0, 30, 20, 0 };
    static const uint8_t truth[] = { 20, 20, 3, 60, 10, 3 };
    saga_exposure_sums sums[3] = { { 0 } };

    assert_int_equal(saga_exposure_add(sums, made, truth, NULL, 2), 2);
    /* The error of green with f = 600 / 800 is (15 - 20)^2 + (15 - 10)^2 = 50,
     * that of blue 9 + 9, that of red 0. */
    assert_true(fabs(saga_exposure_error(sums) - 68) < 1e-9);
}

TEST(masked_pixels_should_not_hold_the_factor)
{
    /* The first pixel is half as bright as it should be, which a factor of two
     * corrects. The second is right, but masked; if it counted, there would be
     * an error. */
    static const uint8_t made[] = { 10, 20, 30, 90, 90, 90 };
    static const uint8_t truth[] = { 20, 40, 60, 90, 90, 90 };
    static const uint8_t mask[] = { 1, 0 };
    saga_exposure_sums sums[3] = { { 0 } };

    assert_int_equal(saga_exposure_add(sums, made, truth, mask, 2), 1);
    assert_true(fabs(saga_exposure_error(sums)) < 1e-9);
}
