/* SPDX-License-Identifier: MIT
 *
 * Finds the fundamental matrix F of two views from matches, some of which are
 * wrong. Eight matches determine an F. Many eights are drawn, from the most
 * certain matches first, and the F that most matches obey is computed again
 * from these (random samples and consensus, with local optimisation).
 */
#include "matches.h"

#include "linear.h"
#include "rng.h"

#include <math.h>
#include <string.h>

enum {
    EIGHT = 8,     /* matches that determine F up to its scale */
    N_TRIES = 600, /* if a third of the matches are right, one draw in
                    * 6,500 has eight right; if three quarters, as of
                    * the best, one in 10 */
    N_REFITS = 4,
    FEW = 16 /* fewer agreeing matches may be chance */
};

/* Draws end when the chance that all of them had a wrong match is below
 * this. */
#define SURE 0.01
/* Least fraction of the matches that must agree. Of wrong matches about 3 % lie
 * within 2 of 270 pixels of any line. */
#define FEW_PART 0.3
/* A match is kept if its distance is below this, relative to the distance of
 * the second-best place. */
#define SECOND_BEST 0.85
/* Pixels: nearer features are one corner in two sizes. */
#define SAME_PLACE 4.0

/* ------------------------------------------------------------------ pairing */

/* Returns the cosine of two descriptors. Eight partial sums let the compiler
 * use SIMD. */
static float alike(const saga_feature *a, const saga_feature *b)
{
    float sum[8] = { 0.0f };
    for (int i = 0; i < SAGA_FEATURE_NUMBERS; i += 8)
        for (int k = 0; k < 8; k++)
            sum[k] += a->at[i + k] * b->at[i + k];
    return ((sum[0] + sum[4]) + (sum[1] + sum[5])) +
           ((sum[2] + sum[6]) + (sum[3] + sum[7]));
}

static bool same_place(const saga_feature *a, const saga_feature *b)
{
    return fabs(a->x - b->x) < SAME_PLACE && fabs(a->y - b->y) < SAME_PLACE;
}

/* Returns the allowed feature that is nearest to f. *doubt is its distance
 * divided by that of the nearest feature at another place. */
static size_t nearest(const saga_feature *f, const saga_features *to,
                      const saga_match_rule *rule, bool back, double *doubt)
{
    float cosine[SAGA_FEATURES_MOST], second = -1.0f;
    size_t best = 0;
    for (size_t i = 0; i < to->n; i++) {
        const saga_feature *const other = &to->list[i];
        cosine[i] = rule && !rule->may(rule->user, back ? other : f,
                                       back ? f : other)
                        ? -1.0f
                        : alike(f, other);
        best = cosine[i] > cosine[best] ? i : best;
    }
    for (size_t i = 0; i < to->n; i++)
        if (cosine[i] > second && !same_place(&to->list[i], &to->list[best]))
            second = cosine[i];
    /* For unit vectors, |a - b|^2 = 2 - 2 cos. */
    *doubt = sqrt(fmax(1.0 - (double)cosine[best], 0.0) /
                  fmax(1.0 - (double)second, 1e-9));
    return best;
}

/* Tells whether a match between these places is already in the list. */
static bool is_known(const saga_match *m, size_t n, const saga_feature *a,
                     const saga_feature *b)
{
    for (size_t i = 0; i < n; i++)
        if (fabs(m[i].a[0] - a->x) < SAME_PLACE &&
            fabs(m[i].a[1] - a->y) < SAME_PLACE &&
            fabs(m[i].b[0] - b->x) < SAME_PLACE &&
            fabs(m[i].b[1] - b->y) < SAME_PLACE)
            return true;
    return false;
}

static void insert(saga_match *m, size_t n, const saga_match *one)
{
    for (; n > 0 && m[n - 1].doubt > one->doubt; n--)
        m[n] = m[n - 1];
    m[n] = *one;
}

size_t saga_matches_find(saga_match *matches, const saga_features *a,
                         const saga_features *b, const saga_match_rule *rule)
{
    const double alike_least = rule ? rule->alike : -1.0;
    size_t n = 0;
    for (size_t i = 0; i < a->n && b->n > 1; i++) {
        const saga_feature *const from = &a->list[i];
        double doubt, back;
        const size_t k = nearest(from, b, rule, false, &doubt);
        const saga_feature *const to = &b->list[k];
        /* The match back must end at the same place, though possibly in another
         * size. */
        if (doubt > SECOND_BEST || (double)alike(from, to) < alike_least ||
            is_known(matches, n, from, to) ||
            !same_place(&a->list[nearest(to, a, rule, true, &back)], from))
            continue;
        insert(matches, n++,
               &(saga_match){ .a = { from->x, from->y },
                              .b = { to->x, to->y },
                              .doubt = doubt,
                              .of_a = (int)i,
                              .of_b = (int)k });
    }
    return n;
}

/* --------------------------------------------------------------- agreement */

/* Centre and spread of the points in one picture. Numbers around 1 make the
 * matrices well conditioned (Hartley's normalisation). */
typedef struct frame {
    double middle[2], spread;
} frame;

static void make_frame(frame *f, const saga_match *m, size_t n, int second)
{
    *f = (frame){ .spread = 1e-9 };
    for (size_t i = 0; i < n; i++)
        for (int k = 0; k < 2; k++)
            f->middle[k] += (second ? m[i].b : m[i].a)[k] / (double)n;
    for (size_t i = 0; i < n; i++) {
        const double *const p = second ? m[i].b : m[i].a;
        f->spread += hypot(p[0] - f->middle[0], p[1] - f->middle[1]) /
                     (double)n;
    }
}

static void put(double to[3], const frame *f, const double p[2])
{
    to[0] = (p[0] - f->middle[0]) / f->spread;
    to[1] = (p[1] - f->middle[1]) / f->spread;
    to[2] = 1.0;
}

typedef struct fit {
    frame a, b;
    double f[9];
} fit;

/* Sets F to the least-squares solution of (b, 1)^T F (a, 1) = 0 over n matches,
 * which is the eigenvector with the least eigenvalue of the sum of products. */
static void solve(fit *t, const saga_match *const *m, size_t n)
{
    saga_matrix sum, v;
    memset(sum, 0, sizeof sum);
    for (size_t i = 0; i < n; i++) {
        double a[3], b[3], row[9];
        put(a, &t->a, m[i]->a);
        put(b, &t->b, m[i]->b);
        for (int k = 0; k < 9; k++)
            row[k] = b[k / 3] * a[k % 3];
        for (int k = 0; k < 9; k++)
            for (int l = 0; l < 9; l++)
                sum[k][l] += row[k] * row[l];
    }
    saga_eigen(v, sum, 9);
    for (int k = 0; k < 9; k++)
        t->f[k] = v[k][8];
}

/* Returns the distance in pixels of a match's points from each other's epipolar
 * lines, whichever is larger. */
static double distance(const fit *t, const saga_match *m)
{
    double a[3], b[3], la[3] = { 0.0 }, lb[3] = { 0.0 }, product = 0.0;
    put(a, &t->a, m->a);
    put(b, &t->b, m->b);
    for (int k = 0; k < 9; k++) {
        lb[k / 3] += t->f[k] * a[k % 3];
        la[k % 3] += t->f[k] * b[k / 3];
    }
    for (int k = 0; k < 3; k++)
        product += b[k] * lb[k];
    return fmax(t->a.spread * fabs(product) / (hypot(la[0], la[1]) + 1e-12),
                t->b.spread * fabs(product) / (hypot(lb[0], lb[1]) + 1e-12));
}

static size_t obey(const saga_match **ones, const fit *t, const saga_match *m,
                   size_t n, double within)
{
    size_t count = 0;
    for (size_t i = 0; i < n; i++)
        if (distance(t, &m[i]) <= within)
            ones[count++] = &m[i];
    return count;
}

/* Draws eight different matches from the first n. */
static void draw(const saga_match **ones, const saga_match *m, size_t n,
                 saga_rng r, size_t try)
{
    for (size_t k = 0; k < EIGHT; k++) {
        bool again = true;
        for (uint64_t i = 0; again; i++) {
            ones[k] = &m[saga_rng_below(r, (try * EIGHT + k) * 1000 + i,
                                        (uint32_t)n)];
            again = false;
            for (size_t l = 0; l < k; l++)
                again = again || ones[l] == ones[k];
        }
    }
}

/* Tells whether i draws are enough. If `most` of n matches are right, a draw is
 * right with probability p, so all i draws fail with (1 - p)^i. */
static bool enough(size_t i, size_t most, size_t n)
{
    const double p = pow((double)most / (double)n, EIGHT);
    return (double)i * log1p(-fmin(p, 1.0 - 1e-9)) < log(SURE);
}

size_t saga_matches_agree(saga_match *matches, size_t n, double within,
                          uint64_t seed)
{
    const saga_match *ones[SAGA_FEATURES_MOST];
    const saga_rng r = saga_rng_stream(seed, 0);
    fit t, best = { .f = { 0.0 } };
    size_t most = 0, kept = 0;
    if (n < FEW)
        return 0;
    make_frame(&t.a, matches, n, 0);
    make_frame(&t.b, matches, n, 1);
    for (size_t i = 0; i < N_TRIES && !enough(i, most, n); i++) {
        /* Draws come from the 16 most certain matches at first, and from all in
         * the end. */
        draw(ones, matches, FEW + (n - FEW) * i / N_TRIES, r, i);
        solve(&t, ones, EIGHT);
        size_t count = obey(ones, &t, matches, n, within);
        for (int k = 0; k < N_REFITS && count > most && count > EIGHT; k++) {
            most = count;
            best = t;
            solve(&t, ones, count);
            count = obey(ones, &t, matches, n, within);
        }
    }
    if (most < FEW || (double)most < EIGHT + FEW_PART * (double)(n - EIGHT))
        return 0;
    for (size_t i = 0; i < n; i++)
        if (distance(&best, &matches[i]) <= within) {
            const saga_match one = matches[i];
            matches[i] = matches[kept];
            matches[kept++] = one;
        }
    return kept;
}
