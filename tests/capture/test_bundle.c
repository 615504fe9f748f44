/* SPDX-License-Identifier: MIT
 *
 * Bundle adjustment: derivatives against finite differences, cameras that were
 * disturbed by known amounts against the true ones, wrong matches among right
 * ones, and the refinement of a capture, which has to help where cameras are
 * disturbed and to leave alone what is right.
 */
#include "bundle.h"
#include "refine.h"
#include "synth_fixture.h"
#include "testing.h"

enum { W = 240, H = 136, N_VIEWS = 8, N_PLACES = 300 };

static int make_room(void **state)
{
    const saga_synth_options s = synth_options(W, H, N_VIEWS, 1, 100);

    return synth_enter(state, &s);
}

TEST_GROUP(make_room, synth_leave);

static uint32_t seed = 1;

/* Returns a random number, uniform in [-1, 1). */
static double even(void)
{
    seed = seed * 1664525u + 1013904223u;
    return (double)(seed >> 8) / (1 << 23) - 1;
}

/* --- Derivatives ---------------------------------------------------------- */

TEST(derivatives_should_be_finite_differences)
{
    const double step = 1e-6;
    const double place[3] = { 0.3, -0.7, 2.1 }, at[2] = { 17, 33 };
    saga_pinhole c = { { 0.8, 0.6, 0, -0.6, 0.8, 0, 0, 0, 1 },
                       { 0.2, -0.1, 0.9 },
                       { 310, 290, 121, 66 } };
    double off[2], more[2], less[2], j[2][SAGA_BUNDLE_N], q[2][3];
    double j_[2][SAGA_BUNDLE_N], q_[2][3];

    assert_true(saga_bundle_differ(off, j, q, &c, place, at));
    for (int k = 0; k < SAGA_BUNDLE_N; k++) {
        double by[SAGA_BUNDLE_N] = { 0 };
        saga_pinhole a = c, b = c;

        by[k] = step;
        saga_bundle_move(&a, by);
        by[k] = -step;
        saga_bundle_move(&b, by);
        assert_true(saga_bundle_differ(more, j_, q_, &a, place, at) &&
                    saga_bundle_differ(less, j_, q_, &b, place, at));
        for (int l = 0; l < 2; l++)
            assert_true(fabs((more[l] - less[l]) / (2 * step) - j[l][k]) <
                        1e-6 * (1 + fabs(j[l][k])));
    }
    for (int k = 0; k < 3; k++) {
        double a[3], b[3];

        for (int i = 0; i < 3; i++) {
            a[i] = place[i] + (i == k ? step : 0);
            b[i] = place[i] - (i == k ? step : 0);
        }
        assert_true(saga_bundle_differ(more, j_, q_, &c, a, at) &&
                    saga_bundle_differ(less, j_, q_, &c, b, at));
        for (int l = 0; l < 2; l++)
            assert_true(fabs((more[l] - less[l]) / (2 * step) - q[l][k]) <
                        1e-6 * (1 + fabs(q[l][k])));
    }
    c.translation[2] = -5;
    assert_false(saga_bundle_differ(off, j, q, &c, place, at));
}

/* --- Cameras -------------------------------------------------------------- */

/* Disturbs a camera as much as a good calibration may be wrong: by 0.2 degrees,
 * 2 mm, 1 % of the focal length, and 1 pixel of the principal point. */
static void disturb(saga_pinhole *c)
{
    double by[SAGA_BUNDLE_N];

    for (int i = 0; i < 3; i++) {
        by[SAGA_BUNDLE_TURN + i] = 0.0035 * even();
        by[SAGA_BUNDLE_SHIFT + i] = 0.002 * even();
    }
    by[SAGA_BUNDLE_FOCAL] = 0.01 * even();
    by[SAGA_BUNDLE_CENTRE] = even();
    by[SAGA_BUNDLE_CENTRE + 1] = even();
    saga_bundle_move(c, by);
}

/* Returns the root mean square distance, in pixels, between the projections of
 * the places by cameras a and by cameras b. */
static double differ(const saga_pinhole *a, const saga_pinhole *b,
                     double (*places)[3])
{
    double sum = 0, off[2], at[2], j[2][SAGA_BUNDLE_N], q[2][3];
    static const double origin[2];

    for (int v = 0; v < N_VIEWS; v++)
        for (int i = 0; i < N_PLACES; i++) {
            (void)saga_bundle_differ(at, j, q, &a[v], places[i], origin);
            (void)saga_bundle_differ(off, j, q, &b[v], places[i], at);
            sum += off[0] * off[0] + off[1] * off[1];
        }
    return sqrt(sum / (N_VIEWS * N_PLACES));
}

/* Places near the room's points are projected by the true cameras, with noise
 * of 0.1 pixels and one coordinate in twenty wrong by up to 40 pixels. From
 * these sights and disturbed cameras, adjustment must halve the cameras' error.
 * The adjusted places, projected by the adjusted cameras, must be within 0.1
 * pixels of the true sights. */
TEST(adjustment_should_find_what_was_disturbed)
{
    const saga_capture *const c = *state;
    static double truth[N_PLACES][3], places[N_PLACES][3];
    static saga_sight sights[N_PLACES * N_VIEWS];
    static const double origin[2];
    saga_pinhole right[N_VIEWS], moved[N_VIEWS];
    saga_bundle b = { .cameras = moved,
                      .n_cameras = N_VIEWS,
                      .within = 1,
                      .places = places,
                      .n_places = N_PLACES };
    double before, after, j[2][SAGA_BUNDLE_N], q[2][3];

    for (int v = 0; v < N_VIEWS; v++)
        right[v] = moved[v] = saga_pinhole_of(&c->views[v]);
    for (int v = 0; v < N_VIEWS; v++)
        disturb(&moved[v]);
    for (int i = 0; i < N_PLACES; i++) {
        memcpy(truth[i], c->points[i % (int)c->n_points].position,
               sizeof truth[i]);
        for (int k = 0; k < 3; k++)
            truth[i][k] += 0.2 * even();
        for (int v = 0; v < N_VIEWS; v++) {
            saga_sight *const s = &sights[b.n_sights++];

            *s = (saga_sight){ .camera = v, .place = (size_t)i };
            assert_true(
                saga_bundle_differ(s->at, j, q, &right[v], truth[i], origin));
            for (int k = 0; k < 2; k++)
                s->at[k] += v > 1 && even() > 0.95 ? 40 * even() : 0.1 * even();
        }
        assert_true(
            saga_bundle_meet(places[i], moved, sights + i * N_VIEWS, 2) ||
            saga_bundle_meet(places[i], moved, sights + i * N_VIEWS, N_VIEWS));
    }
    b.sights = sights;
    before = differ(right, moved, truth);
    assert_done(saga_bundle_adjust(&b, &error));
    after = differ(right, moved, truth);
    print_message("%.3f pixels off before, %.3f after\n", before, after);
    assert_true(after < before / 2);
    /* The places may have moved together with the cameras; therefore the sights
     * are compared with projections of the adjusted places. */
    {
        double sum = 0, at[2], off[2];

        for (int v = 0; v < N_VIEWS; v++)
            for (int i = 0; i < N_PLACES; i++) {
                (void)saga_bundle_differ(at, j, q, &right[v], truth[i], origin);
                (void)saga_bundle_differ(off, j, q, &moved[v], places[i], at);
                sum += off[0] * off[0] + off[1] * off[1];
            }
        sum = sqrt(sum / (N_VIEWS * N_PLACES));
        print_message("%.3f pixels between places and their sights\n", sum);
        assert_true(sum < 0.1);
    }
}

/* --- Tracks --------------------------------------------------------------- */

/* Three cameras stand in a row, so that epipolar lines are rows of pixels. A
 * sight that is moved along its row remains on the lines of both others, but
 * their rays tell where it belongs. */
TEST(third_sight_should_tell_what_pairs_cannot)
{
    static const double place[3] = { 0.4, 0.3, 6 }, origin[2];
    static const double far[3] = { 0.4, 0.3, 600 };
    saga_pinhole c[3];
    saga_sight s[3], distant[3];
    double j[2][SAGA_BUNDLE_N], q[2][3];
    bool front;

    for (int v = 0; v < 3; v++) {
        c[v] = (saga_pinhole){ { 1, 0, 0, 0, 1, 0, 0, 0, 1 },
                               { -v, 0, 0 },
                               { 300, 300, 160, 90 } };
        s[v] = distant[v] = (saga_sight){ .camera = v };
        assert_true(
            saga_bundle_differ(s[v].at, j, q, &c[v], place, origin) &&
            saga_bundle_differ(distant[v].at, j, q, &c[v], far, origin));
    }
    for (size_t k = 0; k < 3; k++) {
        assert_true(saga_transfer_off(c, s, 3, k) < 1e-9);
        assert_true(isinf(saga_transfer_off(c, distant, 3, k)));
    }
    s[1].at[0] += 7;
    for (int v = 0; v < 3; v += 2) {
        const saga_match m = { .a = { s[v].at[0], s[v].at[1] },
                               .b = { s[1].at[0], s[1].at[1] } };
        const saga_epipolar e = saga_epipolar_between(&c[v], &c[1]);

        assert_true(saga_epipolar_off(&c[v], &c[1], &e, &m, 1, &front) < 1e-9);
    }
    assert_true(fabs(saga_transfer_off(c, s, 3, 1) - 7) < 1e-9);
}

/* Features of three views are linked by the matches of two pairs. A fourth
 * match gives the second place two features of one view, so that it is left
 * out. */
TEST(tracks_should_link_matches_of_pairs)
{
    saga_feature f[3][3] = { { { .x = 0 } } };
    saga_features features[3] = { { f[0], 3 }, { f[1], 3 }, { f[2], 3 } };
    saga_match ab[2] = { { .of_a = 1, .of_b = 2 }, { .of_a = 0, .of_b = 0 } };
    saga_match bc[3] = { { .of_a = 2, .of_b = 0 },
                         { .of_a = 0, .of_b = 1 },
                         { .of_a = 1, .of_b = 1 } };
    saga_pair list[2] = { { 0, 1, 2, ab }, { 1, 2, 3, bc } };
    const saga_capture c = { .n_views = 3 };
    const saga_pairs pairs = {
        .capture = &c, .features = features, .list = list, .n = 2
    };
    FREED_BY(saga_tracks_free) saga_tracks t;

    for (int v = 0; v < 3; v++)
        for (int i = 0; i < 3; i++)
            f[v][i].x = 10 * v + i;
    assert_done(saga_tracks_make(&t, &pairs, &error));
    assert_int_equal(t.n_places, 1);
    assert_int_equal(t.n_sights, 3);
    assert_int_equal(saga_tracks_length(&t, 0), 3);
    for (int v = 0; v < 3; v++)
        assert_int_equal(t.sights[v].camera, v);
    assert_true(t.sights[0].at[0] == 1 && t.sights[1].at[0] == 12 &&
                t.sights[2].at[0] == 20);
}

/* --- A capture ------------------------------------------------------------ */

static saga_refinement refine(const saga_capture *c)
{
    saga_refinement r = { 0 };
    FREED_BY(saga_pairs_free) saga_pairs pairs;
    FREED_BY(saga_tracks_free) saga_tracks tracks;

    assert_done(saga_pairs_look(&pairs, c, 0, &error) &&
                saga_pairs_list(&pairs, &error) &&
                saga_pairs_match(&pairs, saga_pair_agree, &error));
    assert_done(saga_tracks_make(&tracks, &pairs, &error) &&
                saga_refine(&r, &pairs, &tracks, &error));
    return r;
}

TEST(refinement_should_help_disturbed_cameras_only)
{
    saga_capture c = *(const saga_capture *)*state;
    FREED saga_source_view *const views = must(malloc(N_VIEWS * sizeof *views));
    saga_refinement right = refine(&c), r;

    memcpy(views, c.views, N_VIEWS * sizeof *views);
    for (int v = 0; v < N_VIEWS; v++) {
        saga_pinhole p = saga_pinhole_of(&views[v]);

        disturb(&p);
        memcpy(views[v].rotation, p.rotation, sizeof p.rotation);
        memcpy(views[v].translation, p.translation, sizeof p.translation);
        views[v].fx = p.lens[0];
        views[v].fy = p.lens[1];
        views[v].cx = p.lens[2];
        views[v].cy = p.lens[3];
    }
    c.views = views;
    r = refine(&c);
    print_message("right: %.3f to %.3f; disturbed: %.3f to %.3f\n",
                  right.before, right.after, r.before, r.after);
    assert_false(right.helps);
    assert_true(r.helps);
    /* Refinement must remove nine tenths of the error that the disturbance
     * added. */
    assert_true(r.after - right.before < 0.1 * (r.before - right.before));
    saga_refinement_free(&right);
    saga_refinement_free(&r);
}
