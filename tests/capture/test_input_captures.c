/* SPDX-License-Identifier: MIT
 *
 * Real captures, if ../shared/data has them, against their READMEs. Their
 * points must have the colours that each view shows where it sees them, which
 * takes right poses, lenses and frames.
 */
#include "capture_files.h"
#include "order.h"
#include "testing.h"

#define DATA "../shared/data/"

/* Returns the luma at a world point, or -1 if the view does not see it. */
static double luma_at(const saga_capture *c, int view, const double x[3])
{
    const saga_source_view *const v = c->views + view;
    const uint8_t *rgb = saga_capture_frame(c, view, 0);
    double uv[2], z;

    if (!saga_view_project(v, x, uv, &z) || uv[0] < 0 || uv[1] < 0 ||
        uv[0] >= v->width || uv[1] >= v->height)
        return -1;
    rgb += 3 * ((int)uv[1] * v->width + (int)uv[0]);
    return 0.3 * rgb[0] + 0.6 * rgb[1] + 0.1 * rgb[2];
}

/* Returns the correlation of the points' luma with the view's luma at the same
 * points moved by (dx, dy, 0), because cameras differ in exposure. Sets n to
 * the number of points that are seen. */
static double likeness(const saga_capture *c, int view, double dx, double dy,
                       int *n)
{
    double a = 0, b = 0, aa = 0, bb = 0, ab = 0;

    *n = 0;
    for (size_t i = 0; i < c->n_points; i++) {
        const saga_point *const p = c->points + i;
        const double x[3] = { p->position[0] + dx, p->position[1] + dy,
                              p->position[2] };
        const double own = 0.3 * p->rgb[0] + 0.6 * p->rgb[1] + 0.1 * p->rgb[2];
        const double seen = luma_at(c, view, x);

        if (seen < 0)
            continue;
        ++*n;
        a += own;
        b += seen;
        aa += own * own;
        bb += seen * seen;
        ab += own * seen;
    }
    return (*n * ab - a * b) / sqrt((*n * aa - a * a) * (*n * bb - b * b));
}

static const struct {
    const char *name;
    int n_views, least_points, most_points, n_observations;
    double fps, median, p90; /* frames a second; distances of features from the
                              * projected points, in pixels */
    double by;   /* metres by which points are moved, and the least loss */
    double loss; /* of correlation */
} captures[] = {
    { "studio", 14, 2000, 2489, 11851, 30, 0.143, 0.69, 0.05, 0.05 },
    { "person4", 4, 860, 860, 0, 60, 0, 0, 0.02, 0.1 },
};

TEST(captures_should_agree_with_their_readmes)
{
    for (size_t i = 0; i < sizeof captures / sizeof captures[0]; i++) {
        FREED_BY(saga_capture_free) saga_capture c = { .n_views = 0 };
        saga_capture_options o = saga_capture_defaults();
        double median[16], p90[16];
        char path[80];
        int n_seen = 0, n;

        snprintf(path, sizeof path, DATA "%s", captures[i].name);
        /* Sanitizers run the same code on smaller captures. */
        if (testing_sanitized() || !saga_path_is_folder(path)) {
            print_message("skipped: %s\n", path);
            continue;
        }
        o.end_frame = 1;
        o.want_depth = true;
        c = load_with(path, &o);
        assert_int_equal(c.n_views, captures[i].n_views);
        assert_in_range(c.n_points, captures[i].least_points,
                        captures[i].most_points);
        assert_true(c.fps == captures[i].fps);
        assert_int_equal(c.views[0].depth != NULL, i == 0);
        for (int v = 0; v < c.n_views; v++) {
            const double here = likeness(&c, v, 0, 0, &n);
            double beside = -1;

            assert_true(2 * n > (int)c.n_points);
            for (int k = 0; k < 8; k++)
                beside = fmax(
                    beside, likeness(&c, v, captures[i].by * cos(k * M_PI / 4),
                                     captures[i].by * sin(k * M_PI / 4), &n));
            print_message("%s resembles the points by %.2f, beside them %.2f\n",
                          c.views[v].name, here, beside);
            assert_true(here > beside + captures[i].loss);
            n_seen += c.views[v].n_observations;
            median[v] = c.views[v].reprojection_median;
            p90[v] = c.views[v].reprojection_p90;
        }
        /* The README's are over all views; these are of the middle view. */
        assert_int_equal(n_seen, captures[i].n_observations);
        if (n_seen > 0) {
            assert_near(saga_quantile(median, (size_t)c.n_views, 0.5),
                        captures[i].median, 0.01);
            assert_near(saga_quantile(p90, (size_t)c.n_views, 0.5),
                        captures[i].p90, 0.1);
        }
    }
}

TEST_IN_FOLDER(folder_should_be_refused_when_it_is_no_capture)
{
    refused(f->path, f->path, "no capture of a known format");
    refused(folder_file(f, "nowhere"), "nowhere", "does not exist");
    write_text(f, "x.json", "");
    refused(folder_file(f, "x.json"), "x.json", "not valid JSON");
}
