/* SPDX-License-Identifier: MIT */
#include "film_cloud.h"

#include "alloc.h"
#include "model.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define LN2 0.69314718055994531

/* --- Colours ------------------------------------------------------------- */

/* Each colour is fitted to what the decoder's network returns for two sets of
 * directions: those of the rig's cameras, where the fit should be accurate, and
 * a sphere of directions, where it should only be plausible. The sphere as a
 * whole has this weight, and the rig's cameras together have 1. */
#define SPHERE_WEIGHT 0.1

enum { N_SPHERE = 64, T_MID = 32768, FAR = 1 << 27, MOST_AWAY = 1 << 29 };

/* The fit of the colours of one segment. */
typedef struct {
    saga_film *film;
    saga_colouring how;
    saga_camera *rig; /* (n_rig) */
    uint32_t n_rig;
    double square; /* sum of squared errors seen from the rig */
    uint64_t n_squares;
} fit;

/* The normal equations for the harmonics of one primitive's colour. */
typedef struct {
    double matrix[SAGA_MAX_HARMONICS][SAGA_MAX_HARMONICS];
    double right[SAGA_MAX_HARMONICS][3];
} normal;

static bool read_rig(fit *f, saga_error *error)
{
    const uint32_t n = f->film->info.n_cameras;

    f->rig = saga_alloc(n, sizeof *f->rig, "the rig", error);
    for (uint32_t i = 0; f->rig && i < n; i++) {
        uint32_t number;

        if (!saga_film_rig(f->film, i, &f->rig[i], &number, error))
            return false;
        /* saga_colour_at refuses points that are further away, and colour_at()
         * relies on it succeeding. */
        for (int a = 0; a < 3; a++)
            if (f->rig[i].centre[a] < -MOST_AWAY ||
                f->rig[i].centre[a] > MOST_AWAY)
                return saga_fail(error, f->film->name, "encode it again",
                                 "its camera %u stands too far away",
                                 (unsigned)i);
        f->n_rig++;
    }
    return f->rig != NULL;
}

/* Sets d to direction i of N_SPHERE, which a spiral of the golden angle spreads
 * evenly. */
static void sphere(double d[3], int i)
{
    /* Slices of a sphere of equal height have equal areas; z is the middle of
     * slice i. */
    const double z = (2.0 * i + 1.0) / N_SPHERE - 1.0;
    const double r = sqrt(1.0 - z * z), angle = 2.399963229728653 * i;

    d[0] = r * cos(angle);
    d[1] = r * sin(angle);
    d[2] = z;
}

/* Sets `from` to a far point from which x is seen in the direction d. */
static void stand(int32_t from[3], const int32_t x[3], const double d[3])
{
    for (int a = 0; a < 3; a++) {
        /* FAR is eight widths of the cube, so that rounding to box units hardly
         * changes the direction. The clamp matters only for primitives that are
         * far outside the cube. */
        const double v = (double)x[a] - d[a] * FAR;

        from[a] = (int32_t)fmin(fmax(v, -MOST_AWAY), MOST_AWAY);
    }
}

/* Sets y to the harmonics for the direction from a point to x. */
static void look(double y[SAGA_MAX_HARMONICS], const int32_t x[3],
                 const int32_t from[3])
{
    double d[3], n = 0.0;

    for (int a = 0; a < 3; a++) {
        d[a] = (double)x[a] - from[a];
        n += d[a] * d[a];
    }
    for (int a = 0; a < 3; a++)
        d[a] /= n > 0.0 ? sqrt(n) : 1.0;
    saga_harmonics(y, d);
}

/* Sets c to the colour of a primitive as seen from a point, minus 1/2. The
 * index is valid and the point is near enough (read_rig, stand), so
 * saga_colour_at cannot fail. */
static void colour_at(double c[3], saga_film *film, uint32_t index,
                      const int32_t from[3])
{
    uint16_t q15[3] = { 0, 0, 0 };

    (void)saga_colour_at(q15, film->dec, index, from);
    for (int k = 0; k < 3; k++)
        c[k] = q15[k] / 32768.0 - 0.5;
}

static void add(normal *e, int n, const double *y, const double c[3],
                double weight)
{
    /* Only the lower triangle is summed, which is all that solve() reads. */
    for (int j = 0; j < n; j++) {
        for (int k = 0; k <= j; k++)
            e->matrix[j][k] += weight * y[j] * y[k];
        for (int k = 0; k < 3; k++)
            e->right[j][k] += weight * y[j] * c[k];
    }
}

/* Solves the normal equations by Cholesky's method; the solution replaces
 * `right`. The matrix is positive definite, because the sphere's directions are
 * included. */
static void solve(normal *e, int n)
{
    double(*const m)[SAGA_MAX_HARMONICS] = e->matrix;

    /* matrix = L L^T; L replaces the matrix. */
    for (int j = 0; j < n; j++)
        for (int i = j; i < n; i++) {
            double v = m[i][j];

            for (int k = 0; k < j; k++)
                v -= m[i][k] * m[j][k];
            m[i][j] = i == j ? sqrt(v) : v / m[j][j];
        }
    for (int c = 0; c < 3; c++) {
        /* Forward: L z = right. */
        for (int j = 0; j < n; j++) {
            for (int k = 0; k < j; k++)
                e->right[j][c] -= m[j][k] * e->right[k][c];
            e->right[j][c] /= m[j][j];
        }
        /* Backward: L^T x = z. */
        for (int j = n; j-- > 0;) {
            for (int k = j + 1; k < n; k++)
                e->right[j][c] -= m[k][j] * e->right[k][c];
            e->right[j][c] /= m[j][j];
        }
    }
}

static void add_error(fit *f, const normal *e, int n, const double *y,
                      const double c[3])
{
    for (int k = 0; k < 3; k++) {
        double v = -c[k];

        for (int j = 0; j < n; j++)
            v += y[j] * e->right[j][k];
        f->square += v * v;
        f->n_squares++;
    }
}

static void fit_one(float *to, fit *f, uint32_t index, const int32_t x[3])
{
    const int n = saga_n_harmonics(f->how.degree);
    normal e = { .matrix = { { 0 } } };
    double y[SAGA_MAX_HARMONICS], c[3];
    int32_t from[3];

    /* Directions all around. stand() may have clamped the point, so look()
     * computes the direction from the point itself. */
    for (int i = 0; i < N_SPHERE; i++) {
        double d[3];

        sphere(d, i);
        stand(from, x, d);
        look(y, x, from);
        colour_at(c, f->film, index, from);
        add(&e, n, y, c, SPHERE_WEIGHT / N_SPHERE);
    }
    /* Directions of the rig's cameras. */
    for (uint32_t i = 0; i < f->n_rig; i++) {
        look(y, x, f->rig[i].centre);
        colour_at(c, f->film, index, f->rig[i].centre);
        add(&e, n, y, c, 1.0 / f->n_rig);
    }
    solve(&e, n);
    /* The remaining error towards the rig is what `saga export` reports. */
    for (uint32_t i = 0; i < f->n_rig; i++) {
        look(y, x, f->rig[i].centre);
        colour_at(c, f->film, index, f->rig[i].centre);
        add_error(f, &e, n, y, c);
    }
    for (int k = 0; k < 3 * n; k++)
        to[k] = (float)e.right[k / 3][k % 3];
}

/* Sets the only coefficient of a colour that does not depend on the view, as
 * seen from one point. */
static void bake_one(float *to, const fit *f, uint32_t index)
{
    static const int32_t anywhere[3] = { 0, 0, 0 };
    const int32_t *const from = f->how.camera >= 0
                                    ? f->rig[f->how.camera].centre
                                    : anywhere;
    double c[3];

    colour_at(c, f->film, index, from);
    /* A constant colour c has the coefficient c / Y_0. */
    for (int k = 0; k < 3; k++)
        to[k] = (float)(c[k] / SAGA_HARMONIC_0);
}

static bool depends_on_view(const saga_film *film)
{
    return (film->info.tools & SAGA_TOOL_VIEW) != 0;
}

static bool fill_colours(saga_film_colours *colours, fit *f, uint32_t n,
                         saga_error *error)
{
    const bool bake = f->how.camera >= 0 || !depends_on_view(f->film);
    size_t each;

    colours->degree = bake ? 0 : f->how.degree;
    each = 3 * (size_t)saga_n_harmonics(colours->degree);
    colours->harmonics = saga_alloc(n, each * sizeof(float), "colours", error);
    if (!colours->harmonics)
        return false;
    for (uint32_t i = 0; i < n; i++) {
        float *const to = colours->harmonics + each * i;
        saga_animated a;

        /* The decoder computes the direction of view once per segment, at the
         * middle of the segment's time; the fit does the same. */
        (void)saga_primitive_at(&a, f->film->dec, i, T_MID);
        if (bake)
            bake_one(to, f, i);
        else
            fit_one(to, f, i, a.x);
    }
    colours->rms = f->n_squares ? sqrt(f->square / (double)f->n_squares) : 0.0;
    return true;
}

bool saga_film_colour(saga_film_colours *colours, saga_film *film, uint32_t n,
                      saga_colouring how, saga_error *error)
{
    fit f = { .film = film, .how = how };
    bool ok;

    /* The previous frame was in the same segment, so its colours are kept. */
    if (colours->segment == film->segment)
        return true;
    free(colours->harmonics);
    *colours = (saga_film_colours){ .segment = -1 };
    ok = read_rig(&f, error);
    if (ok && how.camera >= 0 && (uint32_t)how.camera >= f.n_rig)
        ok = saga_fail(error, film->name, "`saga info` lists them",
                       "has no camera %d; it has %u cameras", how.camera,
                       (unsigned)f.n_rig);
    ok = ok && fill_colours(colours, &f, n, error);
    if (ok)
        colours->segment = film->segment;
    free(f.rig);
    return ok;
}

/* --- Splats -------------------------------------------------------------- */

void saga_film_quat(float q[4], const int32_t v[4])
{
    double n = 0.0;

    for (int k = 0; k < 4; k++)
        n += (double)v[k] * v[k];
    for (int k = 0; k < 4; k++)
        q[k] = n > 0.0 ? (float)(v[k] / sqrt(n)) : k == 0;
}

float saga_film_logit(double q0)
{
    /* With p = 2^-q the opacity, logit p = -ln(1/p - 1) = -ln(2^q - 1). A fully
     * opaque primitive has no finite logit; it gets half a step of q. */
    const double q = fmax(q0 - SAGA_PEAK_LOG2, 0.5 / 1048576.0);

    return (float)-log(expm1(q * LN2));
}

/* A Gaussian of the same area replaces the primitive.
 *
 * With s = log2(e) r^2 / 2, a Gaussian exp(-r^2 / 2) is 2^-s, and its integral
 * over s is 1 / ln 2. The profile P 2^-s cut at 1 adds log2 P to the integral.
 * The steep profile P 2^-(s + s^2/2) falls to 1 at s = u - 1; its integral is u
 * - 1 plus that of the tail. */
double saga_film_widening(double q0, uint32_t tools)
{
    /* `peak` is log2 P, and 0 for a P of 1 or less. */
    const double peak = fmax(SAGA_PEAK_LOG2 - q0, 0.0);
    const double u = sqrt(1.0 + 2.0 * peak);

    /* The area grows by the factor 1 + ln 2 log2 P, each axis by its square
     * root. */
    if (!(tools & SAGA_TOOL_STEEP))
        return 0.5 * log1p(LN2 * peak);
    /* The tail is the integral of the steep profile from s = u - 1 on. Since
     * s + s^2 / 2 = (s + 1)^2 / 2 - 1/2, it is P 2^(1/2) times the integral of
     * 2^(-v^2 / 2) over v = s + 1 from u to infinity. */
    return 0.5 * log(LN2 * (u - 1.0 +
                            exp2(peak + 0.5) * sqrt(M_PI / (2.0 * LN2)) *
                                erfc(u * sqrt(LN2 / 2.0))));
}

static void set_splat(saga_cloud *cloud, const saga_film *film,
                      const saga_animated *a, const float *colour)
{
    const size_t i = cloud->n++;
    const size_t each = 3 * (size_t)saga_n_harmonics(cloud->degree);
    const saga_metric *const metric = &film->metric;
    const double q0 = a->q0_q20 / 1048576.0;
    const double wider = saga_film_widening(q0, film->info.tools);

    /* Positions in box units become the capture's units; log2 scales in Q10
     * become natural logarithms. */
    for (size_t k = 0; k < 3; k++) {
        cloud->mean[3 * i + k] = (float)(metric->centre[k] +
                                         metric->unit * a->x[k]);
        cloud->log_scale[3 * i + k] = (float)(a->log2_scale_q10[k] / 1024.0 *
                                                  LN2 +
                                              log(metric->unit) + wider);
    }
    saga_film_quat(cloud->quat + 4 * i, a->quat);
    cloud->logit[i] = saga_film_logit(q0);
    memcpy(cloud->colour + each * i, colour, each * sizeof *colour);
}

bool saga_film_cloud(saga_cloud *cloud, saga_film_colours *colours,
                     saga_film *film, uint32_t frame, saga_colouring how,
                     saga_error *error)
{
    saga_report report;
    size_t each;
    int32_t t;

    *cloud = (saga_cloud){ .n = 0 };
    if (!saga_film_seek(film, frame, 1, &t, error))
        return false;
    (void)saga_tell(&report, film->dec);
    if (!saga_film_colour(colours, film, report.n_primitives, how, error) ||
        !saga_cloud_alloc(cloud, report.n_primitives, colours->degree, error))
        return false;
    each = 3 * (size_t)saga_n_harmonics(cloud->degree);
    /* The cloud has room for all primitives; from here n counts those drawn at
     * t. */
    cloud->n = 0;
    for (uint32_t i = 0; i < report.n_primitives; i++) {
        saga_animated a;

        (void)saga_primitive_at(&a, film->dec, i, t);
        if (a.q0_q20 < SAGA_CUT_Q20)
            set_splat(cloud, film, &a, colours->harmonics + each * i);
    }
    return true;
}
