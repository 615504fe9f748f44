/* SPDX-License-Identifier: MIT */
#include "bundle.h"

#include "alloc.h"
#include "linear.h"
#include "pose.h"
#include "vec3.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum {
    N = SAGA_BUNDLE_N,
    MOST_STEPS = 40, /* steps of the Levenberg-Marquardt method */
    MOST_TRIES = 8   /* increases of the damping before a step is given
                      * up */
};

/* Standard deviations of a camera's change, which enter the cost: of its
 * rotation in radians, of its shift in parts of the median depth, of the
 * logarithm of its focal length, and of its centre in parts of the focal
 * length. They keep the world in place, and also the centre, if few sights
 * distinguish it from a rotation. Against a hundred sights of half a pixel they
 * count little. */
static const double loose_turn = 0.02, loose_shift = 0.02, loose_focal = 0.03,
                    loose_centre = 0.005;
static const double enough = 1e-7; /* a smaller relative gain of the cost ends
                                    * the adjustment */
static const double cos_parallel = 0.99985; /* cosine of 1 degree */

typedef struct work {
    saga_bundle *b;
    size_t n;              /* number of unknowns of all cameras */
    double *s;             /* (n, n) lower triangle of the reduced matrix */
    double *g;             /* (n) right side of the equations; then the
                            * step */
    double (*moved)[N];    /* (n_cameras) change since the beginning */
    double *strict;        /* (n_cameras, N) 1 / deviation^2 */
    saga_pinhole *cameras; /* (n_cameras) before a step */
    double (*places)[3];   /* (n_places) before a step */
    double damping;
} work;

/* ----------------------------------------------------------------- a camera */

void saga_bundle_move(saga_pinhole *camera, const double by[SAGA_BUNDLE_N])
{
    double turn[9], r[9], t[3];
    saga_pose_from_turn(by + SAGA_BUNDLE_TURN, turn);
    for (int i = 0; i < 3; i++) {
        t[i] = by[SAGA_BUNDLE_SHIFT + i];
        for (int k = 0; k < 3; k++)
            t[i] += turn[3 * i + k] * camera->translation[k];
        for (int j = 0; j < 3; j++)
            r[3 * i + j] = turn[3 * i] * camera->rotation[j] +
                           turn[3 * i + 1] * camera->rotation[3 + j] +
                           turn[3 * i + 2] * camera->rotation[6 + j];
    }
    memcpy(camera->rotation, r, sizeof r);
    memcpy(camera->translation, t, sizeof t);
    for (int k = 0; k < 2; k++) {
        camera->lens[k] *= exp(by[SAGA_BUNDLE_FOCAL]);
        camera->lens[2 + k] += by[SAGA_BUNDLE_CENTRE + k];
    }
}

bool saga_bundle_differ(double off[2], double by_camera[2][SAGA_BUNDLE_N],
                        double by_place[2][3], const saga_pinhole *camera,
                        const double place[3], const double at[2])
{
    const double *const r = camera->rotation;
    double x[3];
    for (int i = 0; i < 3; i++)
        x[i] = r[3 * i] * place[0] + r[3 * i + 1] * place[1] +
               r[3 * i + 2] * place[2] + camera->translation[i];
    if (!(x[2] > 1e-9))
        return false;
    for (int k = 0; k < 2; k++) {
        /* With u = f x / z + c, du / dX = f / z (1, 0, -x / z), and likewise dv
         * / dX. */
        const double f = camera->lens[k] / x[2], ratio = x[k] / x[2];
        double *const c = by_camera[k];
        double d[3] = { 0.0, 0.0, -f * ratio };
        d[k] = f;
        off[k] = camera->lens[k] * ratio + camera->lens[2 + k] - at[k];
        /* The derivatives of X are e_i x X by turn_i, I by the shift, and R by
         * the place. */
        c[0] = d[2] * x[1] - d[1] * x[2];
        c[1] = d[0] * x[2] - d[2] * x[0];
        c[2] = d[1] * x[0] - d[0] * x[1];
        for (int i = 0; i < 3; i++) {
            c[SAGA_BUNDLE_SHIFT + i] = d[i];
            by_place[k][i] = d[0] * r[i] + d[1] * r[3 + i] + d[2] * r[6 + i];
        }
        c[SAGA_BUNDLE_FOCAL] = camera->lens[k] * ratio;
        c[SAGA_BUNDLE_CENTRE + k] = 1.0;
        c[SAGA_BUNDLE_CENTRE + 1 - k] = 0.0;
    }
    return true;
}

/* Computes the direction of a sight's ray in the world, of length 1. */
static void direction_of(double d[3], const saga_pinhole *c,
                         const saga_sight *s)
{
    const double x = (s->at[0] - c->lens[2]) / c->lens[0];
    const double y = (s->at[1] - c->lens[3]) / c->lens[1];
    const double norm = sqrt(x * x + y * y + 1.0);
    for (int i = 0; i < 3; i++)
        d[i] = (c->rotation[i] * x + c->rotation[3 + i] * y +
                c->rotation[6 + i]) /
               norm;
}

bool saga_bundle_meet(double place[3], const saga_pinhole *cameras,
                      const saga_sight *sights, size_t n)
{
    saga_matrix a;
    double first[3] = { 0.0 }, d[3], centre[3], least = 1.0;
    memset(a, 0, sizeof a);
    place[0] = place[1] = place[2] = 0.0;
    /* The squared distance from a ray is |(I - d d^T) (x - centre)|^2. */
    for (size_t k = 0; k < n; k++) {
        const saga_pinhole *const c = &cameras[sights[k].camera];
        direction_of(d, c, &sights[k]);
        saga_pose_centre(c->rotation, c->translation, centre);
        if (k == 0)
            memcpy(first, d, sizeof first);
        least = fmin(least, dot3(d, first));
        for (int i = 0; i < 3; i++)
            for (int j = 0; j < 3; j++) {
                const double part = (i == j) - d[i] * d[j];
                a[i][j] += part;
                place[i] += part * centre[j];
            }
    }
    if (least > cos_parallel)
        return false;
    saga_solve(a, place, 3);
    for (size_t k = 0; k < n; k++) {
        double off[2], by_camera[2][N], by_place[2][3];
        if (!saga_bundle_differ(off, by_camera, by_place,
                                &cameras[sights[k].camera], place,
                                sights[k].at))
            return false;
    }
    return true;
}

/* --------------------------------------------------------------------- cost */

/* The cost of a sight is Cauchy's, s^2 log(1 + off^2 / s^2): the pull of a
 * wrong match falls with its distance. Least squares with the weight 1 / (1 +
 * off^2 / s^2) have the same gradient. */
static double cost_of(const work *w)
{
    const saga_bundle *const b = w->b;
    const double s2 = b->within * b->within;
    double sum = 0.0;
    for (size_t i = 0; i < b->n_sights; i++) {
        const saga_sight *const s = &b->sights[i];
        double off[2], by_camera[2][N], by_place[2][3];
        if (!saga_bundle_differ(off, by_camera, by_place,
                                &b->cameras[s->camera], b->places[s->place],
                                s->at))
            return (double)INFINITY;
        sum += s2 * log1p((off[0] * off[0] + off[1] * off[1]) / s2);
    }
    for (int i = 0; i < b->n_cameras; i++)
        for (int k = 0; k < N; k++)
            sum += w->strict[i * N + k] * w->moved[i][k] * w->moved[i][k];
    return sum;
}

/* --------------------------------------------------------------------- step */

/* The part of one sight in the normal equations. */
typedef struct part {
    double off[2], by_camera[2][N], by_place[2][3], weight;
    double cross[N][3]; /* W = weight by_camera^T by_place */
} part;

static part part_of(const work *w, const saga_sight *s)
{
    const saga_bundle *const b = w->b;
    part p;
    (void)saga_bundle_differ(p.off, p.by_camera, p.by_place,
                             &b->cameras[s->camera], b->places[s->place],
                             s->at);
    p.weight = 1.0 / (1.0 + (p.off[0] * p.off[0] + p.off[1] * p.off[1]) /
                                (b->within * b->within));
    for (int k = 0; k < N; k++)
        for (int i = 0; i < 3; i++)
            p.cross[k][i] = p.weight * (p.by_camera[0][k] * p.by_place[0][i] +
                                        p.by_camera[1][k] * p.by_place[1][i]);
    return p;
}

/* Sums, for a place, V = sum of weight J^T J and the right side -weight J^T
 * off. Inverts V with damping. */
static void invert_place(double inverse[3][3], double right[3], const work *w,
                         const part *p, size_t n)
{
    double v[3][3] = { { 0.0 } };
    right[0] = right[1] = right[2] = 0.0;
    for (size_t k = 0; k < n; k++)
        for (int l = 0; l < 2; l++)
            for (int i = 0; i < 3; i++) {
                right[i] -= p[k].weight * p[k].by_place[l][i] * p[k].off[l];
                for (int j = 0; j < 3; j++)
                    v[i][j] += p[k].weight * p[k].by_place[l][i] *
                               p[k].by_place[l][j];
            }
    for (int i = 0; i < 3; i++)
        v[i][i] *= 1.0 + w->damping;
    /* Rows of the adjugate are cross products of columns. */
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) {
            const int a = (j + 1) % 3, b = (j + 2) % 3;
            const int c = (i + 1) % 3, d = (i + 2) % 3;
            inverse[i][j] = v[a][c] * v[b][d] - v[a][d] * v[b][c];
        }
    const double det = v[0][0] * inverse[0][0] + v[0][1] * inverse[1][0] +
                       v[0][2] * inverse[2][0];
    for (int i = 0; i < 9; i++)
        inverse[i / 3][i % 3] /= det > 0.0 ? det : 1e300;
}

/* Eliminates a place from the cameras' equations by Schur's complement: S += U
 * - W V^-1 W^T, g += right_camera - W V^-1 right_place. */
static void reduce_place(work *w, const saga_sight *s, const part *p, size_t n)
{
    double inverse[3][3], right[3];
    invert_place(inverse, right, w, p, n);
    for (size_t k = 0; k < n; k++) {
        double *const g = w->g + (size_t)s[k].camera * N;
        for (int a = 0; a < N; a++) {
            double y[3]; /* row a of W V^-1 */
            for (int i = 0; i < 3; i++)
                y[i] = p[k].cross[a][0] * inverse[0][i] +
                       p[k].cross[a][1] * inverse[1][i] +
                       p[k].cross[a][2] * inverse[2][i];
            g[a] -= y[0] * right[0] + y[1] * right[1] + y[2] * right[2];
            double *const row = w->s +
                                ((size_t)s[k].camera * N + (size_t)a) * w->n;
            for (int l = 0; l < 2; l++) {
                g[a] -= p[k].weight * p[k].by_camera[l][a] * p[k].off[l];
                for (int b = 0; b < N; b++)
                    row[s[k].camera * N + b] += p[k].weight *
                                                p[k].by_camera[l][a] *
                                                p[k].by_camera[l][b];
            }
            for (size_t m = 0; m < n; m++)
                for (int b = 0; b < N; b++)
                    row[s[m].camera * N + b] -= y[0] * p[m].cross[b][0] +
                                                y[1] * p[m].cross[b][1] +
                                                y[2] * p[m].cross[b][2];
        }
    }
}

/* Moves a place by V^-1 (right - sum of W^T step), for the cameras' step. */
static void move_place(work *w, const saga_sight *s, const part *p, size_t n)
{
    double inverse[3][3], right[3];
    double *const x = w->b->places[s->place];
    invert_place(inverse, right, w, p, n);
    for (size_t k = 0; k < n; k++)
        for (int a = 0; a < N; a++)
            for (int i = 0; i < 3; i++)
                right[i] -= p[k].cross[a][i] *
                            w->g[(size_t)s[k].camera * N + (size_t)a];
    for (int i = 0; i < 3; i++)
        x[i] += inverse[i][0] * right[0] + inverse[i][1] * right[1] +
                inverse[i][2] * right[2];
}

/* Calls a function for every place with its sights and their parts. A camera
 * sees a place at most once, so that there are enough parts. */
static void each_place(work *w, part *parts,
                       void (*visit)(work *, const saga_sight *, const part *,
                                     size_t))
{
    const saga_bundle *const b = w->b;
    for (size_t i = 0, n; i < b->n_sights; i += n) {
        for (n = 0; i + n < b->n_sights &&
                    b->sights[i + n].place == b->sights[i].place;
             n++)
            parts[n] = part_of(w, &b->sights[i + n]);
        visit(w, b->sights + i, parts, n);
    }
}

/* Solves S x = g in place by Cholesky's method; S is destroyed. */
static void solve(double *s, double *x, size_t n)
{
    for (size_t i = 0; i < n; i++) {
        for (size_t j = 0; j <= i; j++) {
            double sum = s[i * n + j];
            for (size_t k = 0; k < j; k++)
                sum -= s[i * n + k] * s[j * n + k];
            s[i * n + j] = i > j ? sum / s[j * n + j] : sqrt(fmax(sum, 1e-300));
        }
        for (size_t k = 0; k < i; k++)
            x[i] -= s[i * n + k] * x[k];
        x[i] /= s[i * n + i];
    }
    for (size_t i = n; i-- > 0;) {
        for (size_t k = i + 1; k < n; k++)
            x[i] -= s[k * n + i] * x[k];
        x[i] /= s[i * n + i];
    }
}

/* Takes one damped step from the cameras and places that were kept. */
static void adjust_once(work *w, part *parts)
{
    memset(w->s, 0, w->n * w->n * sizeof *w->s);
    memset(w->g, 0, w->n * sizeof *w->g);
    each_place(w, parts, reduce_place);
    for (size_t k = 0; k < w->n; k++) {
        w->s[k * w->n + k] *= 1.0 + w->damping;
        w->s[k * w->n + k] += w->strict[k];
        w->g[k] -= w->strict[k] * w->moved[k / N][k % N];
    }
    solve(w->s, w->g, w->n);
    /* Places are moved first, because their equations refer to the cameras
     * before the step. */
    each_place(w, parts, move_place);
    for (int i = 0; i < w->b->n_cameras; i++) {
        saga_bundle_move(&w->b->cameras[i], w->g + i * N);
        for (int k = 0; k < N; k++)
            w->moved[i][k] += w->g[i * N + k];
    }
}

static void keep(work *w, bool back)
{
    saga_bundle *const b = w->b;
    const size_t n = (size_t)b->n_cameras * sizeof *b->cameras;
    const size_t m = b->n_places * sizeof *b->places;
    memcpy(back ? b->cameras : w->cameras, back ? w->cameras : b->cameras, n);
    memcpy(back ? b->places : w->places, back ? w->places : b->places, m);
    for (size_t k = 0; back && k < w->n; k++)
        w->moved[k / N][k % N] -= w->g[k];
}

static void descend(work *w, part *parts)
{
    double cost = cost_of(w);
    bool more = isfinite(cost);
    w->damping = 1e-3;
    for (int i = 0; more && i < MOST_STEPS; i++) {
        more = false;
        /* A step that raises the cost is undone and tried again with more
         * damping. */
        for (int k = 0; k < MOST_TRIES; k++) {
            keep(w, false);
            adjust_once(w, parts);
            const double now = cost_of(w);
            if (now <= cost) {
                more = cost - now > enough * cost;
                cost = now;
                w->damping /= 8.0;
                break;
            }
            keep(w, true);
            w->damping *= 8.0;
        }
    }
}

static void set_strict(work *w, double depth)
{
    for (int i = 0; i < w->b->n_cameras; i++) {
        const double centre = loose_centre * w->b->cameras[i].lens[0];
        const double loose[N] = { loose_turn,
                                  loose_turn,
                                  loose_turn,
                                  loose_shift * depth,
                                  loose_shift * depth,
                                  loose_shift * depth,
                                  loose_focal,
                                  centre,
                                  centre };
        for (int k = 0; k < N; k++)
            w->strict[i * N + k] = 1.0 / (loose[k] * loose[k]);
    }
}

/* Returns the mean distance of places from the cameras that see them. */
static double depth_of(const saga_bundle *b)
{
    double sum = 0.0, c[3];
    for (size_t i = 0; i < b->n_sights; i++) {
        const saga_sight *const s = &b->sights[i];
        const double *const x = b->places[s->place];
        saga_pose_centre(b->cameras[s->camera].rotation,
                         b->cameras[s->camera].translation, c);
        sum += hypot(hypot(x[0] - c[0], x[1] - c[1]), x[2] - c[2]);
    }
    return sum / (double)b->n_sights;
}

bool saga_bundle_adjust(saga_bundle *bundle, saga_error *error)
{
    static const char what[] = "the cameras";
    const size_t n_cameras = (size_t)bundle->n_cameras;
    work w = { .b = bundle, .n = n_cameras * N };
    if (bundle->n_sights == 0)
        return true;
    w.s = saga_alloc(w.n * w.n, sizeof *w.s, what, error);
    w.g = saga_alloc(w.n, sizeof *w.g, what, error);
    w.moved = saga_calloc(n_cameras, sizeof *w.moved, what, error);
    w.strict = saga_alloc(w.n, sizeof *w.strict, what, error);
    w.cameras = saga_alloc(n_cameras, sizeof *w.cameras, what, error);
    w.places = saga_alloc(bundle->n_places, sizeof *w.places, what, error);
    part *const parts = saga_alloc(n_cameras, sizeof *parts, what, error);
    const bool ok = w.s && w.g && w.moved && w.strict && w.cameras &&
                    w.places && parts;
    /* The pull towards the given cameras depends on the depth of the scene
     * before the first step. */
    if (ok) {
        set_strict(&w, depth_of(bundle));
        descend(&w, parts);
    }
    free(w.s);
    free(w.g);
    free(w.moved);
    free(w.strict);
    free(w.cameras);
    free(w.places);
    free(parts);
    return ok;
}
