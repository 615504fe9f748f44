/* SPDX-License-Identifier: MIT */
#include "film_moving.h"

#include "alloc.h"
#include "model.h"

#include <inttypes.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#define LN2 0.69314718055994531

/* A splat that hardly fades lasts this long; it has 1 - 5e-5 of its opacity at
 * both ends of the film. */
#define LONG 100.0

/* The decoder's temporal opacity saturates where it has faded by 2^-370, and
 * is a parabola in the logarithm above. */
#define FADED 300.0

/* A primitive at n times of the film, the first and the last frame among
 * them. */
typedef struct {
    int n;
    double *time;       /* (n) 0..1 */
    int32_t *t;         /* (n) the same in units of the segment */
    saga_animated *at;  /* (n) */
    double *weight;     /* (n) opacity, 0 where the decoder draws nothing */
    double square, sum; /* of distances from the line, and of weights, over all
                         * primitives */
} samples;

static double q0_of(const samples *s, int i)
{
    return s->at[i].q0_q20 / 1048576.0;
}

static bool take_times(samples *s, saga_film *film, saga_error *error)
{
    const uint32_t last = film->info.n_frames - 1;
    int32_t a, b;

    s->n = last + 1 > 3 ? (int)last + 1 : 3;
    s->time = saga_alloc((size_t)s->n, sizeof *s->time, "times", error);
    s->t = saga_alloc((size_t)s->n, sizeof *s->t, "times", error);
    s->at = saga_alloc((size_t)s->n, sizeof *s->at, "times", error);
    s->weight = saga_alloc((size_t)s->n, sizeof *s->weight, "times", error);
    if (saga_failed(error) || !saga_film_seek(film, last, 1, &b, error) ||
        !saga_film_seek(film, 0, 1, &a, error))
        return false;
    for (int i = 0; i < s->n; i++) {
        s->time[i] = i / (s->n - 1.0);
        s->t[i] = (int32_t)lrint(a + (b - a) * s->time[i]);
    }
    return true;
}

static void free_times(samples *s)
{
    free(s->time);
    free(s->t);
    free(s->at);
    free(s->weight);
}

/* Samples a primitive; returns whether it is ever drawn. */
static bool take(samples *s, const saga_film *film, uint32_t index)
{
    bool drawn = false;

    for (int i = 0; i < s->n; i++) {
        (void)saga_primitive_at(&s->at[i], film->dec, index, s->t[i]);
        s->weight[i] = s->at[i].q0_q20 < SAGA_CUT_Q20
                           ? exp2(fmin(SAGA_PEAK_LOG2 - q0_of(s, i), 0.0))
                           : 0.0;
        drawn |= s->weight[i] > 0.0;
    }
    return drawn;
}

/* --- Fading -------------------------------------------------------------- */

typedef struct {
    double time, duration, q0; /* q0: at that time */
} fading;

/* Fits ln 2 q0 = a d^2 + b d + c, with d the distance from the clearest sample,
 * by least squares; returns how many samples there were. */
static int fit_parabola(double abc[3], const samples *s, int clearest)
{
    double m[3][4] = { { 0 } }; /* the normal equations, as rows */
    int n = 0;

    for (int i = 0; i < s->n; i++) {
        const double d = s->time[i] - s->time[clearest];
        const double power[3] = { d * d, d, 1.0 };

        if (q0_of(s, i) > q0_of(s, clearest) + FADED)
            continue;
        n++;
        for (int j = 0; j < 3; j++) {
            for (int k = 0; k < 3; k++)
                m[j][k] += power[j] * power[k];
            m[j][3] += power[j] * LN2 * q0_of(s, i);
        }
    }
    if (n < 3)
        return n;
    /* Gauss' elimination; the matrix is positive definite. */
    for (int j = 0; j < 3; j++)
        for (int i = 0; i < 3; i++) {
            const double f = m[i][j] / m[j][j];

            for (int k = 0; k < 4 && i != j; k++)
                m[i][k] -= f * m[j][k];
        }
    for (int j = 0; j < 3; j++)
        abc[j] = m[j][3] / m[j][j];
    return n;
}

/* An opacity that is cut at 1 lasts longer. As in a picture, its area counts:
 * with P = e^A the integral over u of min(1, P e^(-u^2)) is 2 sqrt(A) + P
 * sqrt(pi) erfc(sqrt(A)), that of e^(-u^2) sqrt(pi). */
static double lasts(double q0)
{
    const double a = fmax((SAGA_PEAK_LOG2 - q0) * LN2, 0.0);

    return 2.0 * sqrt(a / M_PI) + exp(a) * erfc(sqrt(a));
}

static fading fading_of(const samples *s)
{
    double abc[3];
    int clearest = 0;
    fading f;

    for (int i = 1; i < s->n; i++)
        if (s->at[i].q0_q20 < s->at[clearest].q0_q20)
            clearest = i;
    f = (fading){ s->time[clearest], LONG, q0_of(s, clearest) };
    /* A splat that two frames show has their distance as its width. */
    if (fit_parabola(abc, s, clearest) < 3) {
        f.duration = 0.5 / (s->n - 1);
    } else if (abc[0] > 0.5 / (LONG * LONG)) {
        /* o exp(-d^2 / (2 duration^2)) has a = 1 / (2 duration^2), and its peak
         * at d = -b / 2a. */
        f.time -= abc[1] / (2.0 * abc[0]);
        f.q0 = (abc[2] - abc[1] * abc[1] / (4.0 * abc[0])) / LN2;
        f.duration = sqrt(0.5 / abc[0]) * lasts(f.q0);
    }
    return f;
}

/* --- Motion -------------------------------------------------------------- */

/* Sets the line x + v (t - time) that is nearest to the curve, in box units, by
 * least squares weighted by opacity; returns the middle of the times in which
 * the splat is drawn. */
static double fit_line(double x[3], double v[3], samples *s, double time)
{
    double sum = 0.0, middle = 0.0, square = 0.0, mean[3] = { 0 };

    /* The weighted means of time and position, through which the line goes. */
    for (int i = 0; i < s->n; i++) {
        sum += s->weight[i];
        middle += s->weight[i] * s->time[i];
        for (int k = 0; k < 3; k++)
            mean[k] += s->weight[i] * s->at[i].x[k];
    }
    middle /= sum;
    for (int k = 0; k < 3; k++) {
        mean[k] /= sum;
        v[k] = 0.0;
    }
    /* v = sum w d (x - mean) / sum w d^2, with d the time from the middle. */
    for (int i = 0; i < s->n; i++) {
        const double d = s->time[i] - middle;

        square += s->weight[i] * d * d;
        for (int k = 0; k < 3; k++)
            v[k] += s->weight[i] * d * (s->at[i].x[k] - mean[k]);
    }
    for (int k = 0; k < 3; k++) {
        v[k] = square > 0.0 ? v[k] / square : 0.0;
        x[k] = mean[k] + v[k] * (time - middle);
    }
    /* Distances from the line, for the report. */
    for (int i = 0; i < s->n; i++)
        for (int k = 0; k < 3; k++) {
            const double off = s->at[i].x[k] - x[k] -
                               v[k] * (s->time[i] - time);

            s->square += s->weight[i] * off * off;
        }
    s->sum += sum;
    return middle;
}

/* --- Splats -------------------------------------------------------------- */

/* Returns the mean widening of the pictures in which the splat is drawn. */
static double widening_of(const samples *s, uint32_t tools)
{
    double sum = 0.0, wider = 0.0;

    for (int i = 0; i < s->n; i++) {
        sum += s->weight[i];
        wider += s->weight[i] * saga_film_widening(q0_of(s, i), tools);
    }
    return wider / sum;
}

/* Appends the primitive that was sampled. It turns, but a line does not: it has
 * the rotation of its middle. */
static void set_splat(saga_cloud *cloud, const saga_film *film, samples *s,
                      const float *colour)
{
    const size_t i = cloud->n++;
    const size_t each = 3 * (size_t)saga_n_harmonics(cloud->degree);
    const saga_metric *const metric = &film->metric;
    const double wider = widening_of(s, film->info.tools);
    const fading f = fading_of(s);
    float *const motion = cloud->motion + SAGA_N_MOTION * i;
    double x[3], v[3];
    const double middle = fit_line(x, v, s, f.time);
    const saga_animated *const at = &s->at[lrint(middle * (s->n - 1))];

    for (size_t k = 0; k < 3; k++) {
        cloud->mean[3 * i + k] = (float)(metric->centre[k] +
                                         metric->unit * x[k]);
        cloud->log_scale[3 * i + k] = (float)(at->log2_scale_q10[k] / 1024.0 *
                                                  LN2 +
                                              log(metric->unit) + wider);
        motion[2 + k] = (float)(metric->unit * v[k]);
    }
    motion[0] = (float)f.time;
    motion[1] = (float)log(f.duration);
    saga_film_quat(cloud->quat + 4 * i, at->quat);
    cloud->logit[i] = saga_film_logit(f.q0);
    memcpy(cloud->colour + each * i, colour, each * sizeof *colour);
}

bool saga_film_moving(saga_cloud *cloud, double *rms,
                      saga_film_colours *colours, saga_film *film,
                      saga_colouring how, saga_error *error)
{
    samples s = { .n = 0 };
    saga_report report;
    bool ok;

    *cloud = (saga_cloud){ .n = 0 };
    if (film->info.n_segments != 1)
        return saga_fail(error, film->name,
                         "`saga cut` takes one of them out; or export a file "
                         "for each frame",
                         "has %" PRIu32 " segments, of which a file of moving "
                         "splats holds one",
                         film->info.n_segments);
    /* The colours and memory of all primitives; those never drawn are left
     * out. */
    ok = take_times(&s, film, error);
    if (ok) {
        (void)saga_tell(&report, film->dec);
        ok = saga_film_colour(colours, film, report.n_primitives, how, error) &&
             saga_cloud_alloc(cloud, report.n_primitives, colours->degree,
                              error) &&
             (cloud->motion = saga_alloc(report.n_primitives,
                                         SAGA_N_MOTION * sizeof(float),
                                         "splats", error)) != NULL;
    }
    if (ok) {
        const size_t each = 3 * (size_t)saga_n_harmonics(cloud->degree);

        cloud->n = 0;
        cloud->n_frames = film->info.n_frames;
        for (uint32_t i = 0; i < report.n_primitives; i++)
            if (take(&s, film, i))
                set_splat(cloud, film, &s, colours->harmonics + each * i);
        *rms = s.sum > 0.0 ? film->metric.unit * sqrt(s.square / s.sum) : 0.0;
    } else {
        saga_cloud_free(cloud);
    }
    free_times(&s);
    return ok;
}
