/* SPDX-License-Identifier: MIT */
#include "match_colours.h"

#include "alloc.h"
#include "exposure.h"
#include "order.h"

#include <math.h>
#include <stdlib.h>

enum {
    FEW_PLACES = 10, /* least number of matched places for a result */
    PATCH = 2        /* a patch has this number of pixels on each side
                      * of a match */
};

/* One end of a match: its mean colour and the colour at the other end. */
typedef struct sight {
    int view;
    double rgb[3], other[3];
} sight;

typedef struct sights {
    sight *at; /* (n) both ends of each match */
    size_t n;
} sights;

/* Sets rgb to the mean colour of a patch. Returns false if the patch is cut by
 * the picture's border, or is too dark or too bright. */
static bool colour_at(double rgb[3], const saga_capture *c, int v,
                      const double p[2])
{
    const saga_source_view *const view = &c->views[v];
    const int frame = saga_capture_near(c, v, 0);
    const uint8_t *const all = saga_capture_frame(c, v, frame);
    const int x = (int)p[0], y = (int)p[1];
    /* The patch must lie inside the picture. */
    if (x < PATCH || y < PATCH || x >= view->width - PATCH ||
        y >= view->height - PATCH)
        return false;
    rgb[0] = rgb[1] = rgb[2] = 0.0;
    for (int j = y - PATCH; j <= y + PATCH; j++)
        for (int i = x - PATCH; i <= x + PATCH; i++)
            for (int k = 0; k < 3; k++)
                rgb[k] +=
                    all[((size_t)j * (size_t)view->width + (size_t)i) * 3 +
                        (size_t)k];
    for (int k = 0; k < 3; k++) {
        /* Mean levels outside 10 to 240 are too noisy or may be clipped. */
        rgb[k] /= (2 * PATCH + 1) * (2 * PATCH + 1);
        if (rgb[k] < 10.0 || rgb[k] > 240.0)
            return false;
    }
    return true;
}

/* Collects the matches whose patches have colours that mean something. */
static void gather(sights *to, const saga_pairs *pairs)
{
    for (size_t i = 0; i < pairs->n; i++) {
        const saga_pair *const p = &pairs->list[i];
        for (size_t k = 0; k < p->n; k++) {
            sight *const a = &to->at[to->n], *const b = a + 1;
            if (!colour_at(a->rgb, pairs->capture, p->a, p->matches[k].a) ||
                !colour_at(b->rgb, pairs->capture, p->b, p->matches[k].b))
                continue;
            a->view = p->a;
            b->view = p->b;
            for (int l = 0; l < 3; l++) {
                a->other[l] = b->rgb[l];
                b->other[l] = a->rgb[l];
            }
            to->n += 2;
        }
    }
}

/* Sets log_of, (n_views, 3), to the logarithms of the factors that correct the
 * views' values. */
static bool solve(double *log_of, const sights *s, int n_views,
                  saga_error *error)
{
    saga_exposure_pairs pairs = { .n_views = n_views,
                                  .n_train = n_views,
                                  .n = s->n / 2 };
    int *const all = saga_alloc((size_t)n_views, sizeof *all, "the exposures",
                                error);
    pairs.at = saga_alloc(pairs.n + 1, sizeof *pairs.at, "the exposures",
                          error);
    bool ok = all && pairs.at;
    for (int v = 0; ok && v < n_views; v++)
        all[v] = v;
    for (size_t i = 0; ok && i < pairs.n; i++) {
        const sight *const a = &s->at[2 * i];
        pairs.at[i] = (saga_exposure_pair){ .a = a->view, .b = a[1].view };
        for (int l = 0; l < 3; l++)
            pairs.at[i].log[l] = log(a->rgb[l] / a->other[l]);
    }
    pairs.train = all;
    ok = ok && saga_exposure_solve(log_of, &pairs, error);
    free(all);
    free(pairs.at);
    return ok;
}

/* Returns the median difference of a view's colours from those at the other
 * ends, or a negative number if they are too few. log_of has a logarithm for
 * each view; x is scratch memory. */
static double differ(double *x, const sights *s, int view, const double *log_of,
                     bool swapped)
{
    size_t n = 0;
    for (size_t i = 0; i < s->n; i++) {
        const sight *const a = &s->at[i], *const b = &s->at[i ^ 1];
        double one[3], two[3];
        if (a->view != view)
            continue;
        for (int k = 0; k < 3; k++) {
            one[k] = a->rgb[k] * exp(log_of[a->view]);
            two[k] = a->other[k] * exp(log_of[b->view]);
        }
        x[n++] = saga_colour_apart(one, two, swapped);
    }
    return n < FEW_PLACES ? -1.0 : saga_median(x, n);
}

static void judge(saga_match_colour *colours, const sights *s, int n_views,
                  double *log_of, double *x)
{
    /* Only exposure is corrected: the mean over the channels. Light is about
     * v^2.2, and a stop is a factor of 2. */
    for (int v = 0; v < n_views; v++)
        log_of[v] = (log_of[3 * v] + log_of[3 * v + 1] + log_of[3 * v + 2]) /
                    3.0;
    for (int v = 0; v < n_views; v++) {
        saga_match_colour *const one = &colours[v];
        const double apart = differ(x, s, v, log_of, false);
        *one = (saga_match_colour){ .stops = (double)NAN,
                                    .colour = (double)NAN,
                                    .swapped = (double)NAN };
        if (apart < 0.0)
            continue;
        one->stops = -2.2 / log(2.0) * log_of[v];
        one->colour = apart;
        if (apart > 0.0)
            one->swapped = differ(x, s, v, log_of, true) / apart;
    }
}

bool saga_match_colours_find(saga_match_colour *colours,
                             const saga_pairs *pairs, saga_error *error)
{
    const int n_views = pairs->capture->n_views;
    size_t most = 1;
    for (size_t i = 0; i < pairs->n; i++)
        most += 2 * pairs->list[i].n;
    sights s = { .at = saga_alloc(most + 1, sizeof *s.at, "the colours",
                                  error) };
    double *const x = saga_alloc(most, sizeof *x, "the colours", error);
    double *const log_of = saga_calloc((size_t)n_views * 3, sizeof *log_of,
                                       "the colours", error);
    bool ok = s.at && x && log_of;
    if (ok)
        gather(&s, pairs);
    ok = ok && solve(log_of, &s, n_views, error);
    if (ok)
        judge(colours, &s, n_views, log_of, x);
    free(s.at);
    free(x);
    free(log_of);
    return ok;
}
