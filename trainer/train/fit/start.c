/* SPDX-License-Identifier: MIT */
#include "start.h"

#include "adam.h"
#include "alloc.h"
#include "canonical.h"
#include "fit_state.h"
#include "linear.h"
#include "rng.h"
#include "threads.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { STREAM_SIGNS = 110 };

/* Primitives whose features a task fits; nanoseconds that a thread takes for
 * one. */
enum { CODES = 32, CODE_NS = 5000 };

/* Number of pictures that are given random signs; each gives every attribute
 * one more sample. */
enum { N_PICTURES = 64 };

/* Turns of basis and features, each of which is fitted while the other stands
 * still. */
enum { N_TURNS = 6 };

/* What unseen primitives count, of the mean: their attributes are free, but for
 * the networks' sake not arbitrary, since what is nowhere seen today may be
 * tomorrow. */
#define LEAST_WEIGHT 0.1

/* What the square of a feature over its variance counts beside its primitive's
 * error, in errors of a rounded feature (price step^2 / 12): a primitive is not
 * worth far-fetched values. */
#define PRIOR 100

/* Bits that cost next to nothing do not make features larger than this, nor
 * dear ones smaller than a step, or weights would be beyond all formats: their
 * standard deviation, and, with some room in their format to learn in, their
 * magnitude. */
#define MOST_DEVIATION 4.0
#define MOST_FEATURE 24.0

/* Steps of descent that features for given networks take, at rates that fall
 * from the first to the last. */
enum { N_STEPS = 300 };
#define FIRST_RATE 0.1
#define LAST_RATE 0.005

typedef struct {
    saga_splat_params *target;
    size_t n, d, f;              /* primitives, dimensions, features; more
                                  * features than dimensions stay 0 */
    size_t width[SAGA_N_ATTRS];  /* dimensions of each attribute; 0: the model
                                  * has it not, or networks do not give it */
    size_t at[SAGA_N_ATTRS];     /* the first of them */
    double *wanted, *weight;     /* (n, d) */
    double *code;                /* (n, f) */
    saga_matrix basis;           /* (d, f) */
    double mean[SAGA_LINEAR_MOST];
    double log2_support[4];      /* of fine anchors, relative to the cell */
} start;

static const char what[] = "the start of the fit";

/* Returns how many outputs of a model's networks are an attribute's. The centre
 * of a life has none that anything is wanted of: positions have it already. */
static size_t n_outputs(int attr, const saga_model *m)
{
    const saga_attribute *const a = &saga_attributes[attr];
    saga_rows rows[SAGA_N_HEADS];
    size_t n = 0;

    saga_model_rows(rows, m);
    for (int h = 0; saga_attr_is_output(a) && h < a->n_heads; h++)
        n += rows[a->head + h].n;
    return n;
}

static bool init(start *x, const saga_fit *f, saga_error *error)
{
    const saga_model *const m = &f->scene->model;

    x->n = f->scene->n.prim;
    for (int a = 0; a < SAGA_N_ATTRS; a++) {
        x->width[a] = f->twin.attr.of[a] ? n_outputs(a, m) : 0;
        x->at[a] = x->d;
        x->d += x->width[a];
    }
    /* No more than dimensions: a basis has no further directions. */
    x->f = m->features < x->d ? m->features : x->d;
    x->wanted = saga_calloc(x->n * x->d, sizeof *x->wanted, what, error);
    x->weight = saga_calloc(x->n * x->d, sizeof *x->weight, what, error);
    x->code = saga_calloc(x->n * x->f, sizeof *x->code, what, error);
    return x->wanted && x->weight && x->code;
}

static void release(start *x)
{
    free(x->wanted);
    free(x->weight);
    free(x->code);
}

/* --- What pictures say --------------------------------------------------- */

static size_t stride_of(int attr)
{
    return (size_t)saga_attributes[attr].width;
}

/* The gradient of a picture's sum with random signs has, squared, the mean
 * that is looked for: products of two pixels' derivatives cancel. */
static bool add_picture(start *x, saga_fit *f, saga_rng r, uint64_t number,
                        saga_error *error)
{
    saga_canvas *const c = &f->canvas;
    const saga_sample picture = saga_pictures_pick(f->pictures, r, number);
    size_t n;

    saga_pictures_aim(c, f->pictures, picture);
    if (!saga_splat_forward(c, x->target, f->scene->n.prim, error))
        return false;
    n = 3 * (size_t)c->camera.width * (size_t)c->camera.height;
    for (size_t i = 0; i < n; i++)
        /* Sign s_p stands for dL / d pixel p, so that an attribute gets g =
         * sum_p s_p J_p. The signs are independent: the mean of g^2 is sum_p
         * J_p^2. */
        c->d_image[i] = saga_rng_bits(r, (number + 1) << 32 | i) >> 63 ? R(1)
                                                                     : R(-1);
    saga_twin_clear(&f->twin, f->scene);
    if (!saga_splat_backward(&f->twin.d_attr, NULL, c, x->target, error))
        return false;
    for (size_t i = 0; i < x->n; i++) {
        double *w = x->weight + i * x->d;

        for (int a = 0; a < SAGA_N_ATTRS; a++)
            for (size_t k = 0; k < x->width[a]; k++) {
                const double e =
                    (double)f->twin.d_attr.of[a][i * stride_of(a) + k];

                /* The mean over a picture's n values and over pictures: the
                 * unit is that of the mean squared error. */
                *w++ += e * e / ((double)n * N_PICTURES);
            }
    }
    return true;
}

static bool weigh(start *x, saga_fit *f, saga_error *error)
{
    const saga_rng r = saga_rng_stream(f->o.seed, STREAM_SIGNS);

    for (uint64_t i = 0; i < N_PICTURES; i++)
        if (!add_picture(x, f, r, i, error))
            return false;
    return true;
}

/* Returns output `k` of an attribute for the target's value `v`: networks give
 * what it differs from its zero, sizes relative to the cell, motion to the
 * support. *unit: what a unit of the output is, in units of the attribute. */
static double output_of(double *unit, double v, int attr, size_t k,
                        const saga_coarse *cell, const start *x)
{
    const saga_attribute *const a = &saga_attributes[attr];

    *unit = 1;
    if (attr == SAGA_ATTR_OPACITY)
        return fmin(fmax(v, -8), 8);
    v -= a->zero + (k == 0 ? a->first : 0);
    switch (a->unit) {
    /* A cell's half-size is 2^-depth_x, in half-cubes. */
    case SAGA_UNIT_LOG2_LENGTH:
        return v + cell->depth_x;
    /* Its half in time is 2^-(depth_t + 1), in segments. */
    case SAGA_UNIT_LOG2_TIME:
        return v + 1 + cell->depth_t;
    /* The unit is a support, in half-cubes. */
    case SAGA_UNIT_SUPPORT:
        *unit = exp2(x->log2_support[k % 3] - cell->depth_x);
        return v / *unit;
    default:
        return v;
    }
}

/* All fine anchors get one support, relative to their cells: the mean of what
 * holds their primitives within |o| < 0.8, and at least an eighth of the cell,
 * room for them to move. */
static void choose_supports(start *x, const saga_scene *s)
{
    for (uint32_t i = 0; i < s->n.fine; i++) {
        const saga_coarse *const c = &s->coarse[s->fine[i].parent];

        for (size_t k = 0; k < 4; k++) {
            const double half = (double)(k < 3 ? saga_scene_half_x(c)
                                               : saga_scene_half_t(c));
            /* The factor 1.25 below makes an eighth of this tenth, and has the
             * farthest primitive at 0.8 of the support. */
            double most = half / 10;

            for (size_t p = 0; p < s->fine[i].n_prim; p++)
                most = fmax(most, fabs((double)(
                    s->prim_x[4 * (s->fine[i].first_prim + p) + k] -
                    s->fine_x[4 * (size_t)i + k])));
            /* The mean of logarithms: a few wide anchors do not decide for
             * all. */
            x->log2_support[k] += log2(1.25 * most / half) / s->n.fine;
        }
    }
}

static void want(start *x, const saga_fit *f)
{
    const saga_scene *const s = f->scene;

    for (size_t i = 0; i < x->n; i++) {
        const saga_coarse *const cell =
            &s->coarse[s->fine[s->prim_fine[i]].parent];
        size_t at = i * x->d;

        for (int a = 0; a < SAGA_N_ATTRS; a++)
            for (size_t k = 0; k < x->width[a]; k++, at++) {
                const real *const from = x->target->of[a];
                const double v =
                    from ? (double)from[i * stride_of(a) + k] : 0;
                double unit;

                x->wanted[at] = output_of(&unit, v, a, k, cell, x);
                /* An error e of the output is e unit of the attribute. */
                x->weight[at] *= unit * unit;
            }
    }
}

static void raise_weights(start *x)
{
    for (size_t k = 0; k < x->d; k++) {
        double sum = 0;

        for (size_t i = 0; i < x->n; i++)
            sum += x->weight[i * x->d + k];
        for (size_t i = 0; i < x->n; i++)
            /* The last term is for dimensions that no picture shows at all:
             * first_basis divides by their sum. */
            x->weight[i * x->d + k] += LEAST_WEIGHT * sum / (double)x->n +
                                       1e-30;
    }
}

/* --- Basis and features -------------------------------------------------- */

/* Finds principal axes where each dimension is scaled by the root of its mean
 * weight, and each primitive counts by the mean of its weights over those. */
static void first_basis(start *x)
{
    double w[SAGA_LINEAR_MOST] = { 0 };
    saga_matrix c, v;

    memset(c, 0, sizeof c);
    for (size_t k = 0; k < x->d; k++) {
        double sum = 0;

        for (size_t i = 0; i < x->n; i++) {
            w[k] += x->weight[i * x->d + k];
            sum += x->weight[i * x->d + k] * x->wanted[i * x->d + k];
        }
        /* From a sum, w becomes the root of the mean weight. */
        x->mean[k] = sum / w[k];
        w[k] = sqrt(w[k] / (double)x->n);
    }
    /* The covariance, each primitive times its say. */
    for (size_t i = 0; i < x->n; i++) {
        double e[SAGA_LINEAR_MOST], say = 0;

        for (size_t k = 0; k < x->d; k++) {
            say += x->weight[i * x->d + k] / (w[k] * w[k]);
            e[k] = w[k] * (x->wanted[i * x->d + k] - x->mean[k]);
        }
        for (size_t k = 0; k < x->d; k++)
            for (size_t j = 0; j < x->d; j++)
                c[k][j] += say * e[k] * e[j];
    }
    saga_eigen(v, c, x->d);
    for (size_t k = 0; k < x->d; k++)
        for (size_t j = 0; j < x->f; j++)
            /* The strongest axes come first; 1 / w leads back into the
             * dimensions' own units. */
            x->basis[k][j] = v[k][j] / w[k];
}

typedef struct { start *x; const double *ridge; } coding;

static void fit_code(const coding *c, size_t i)
{
    start *const x = c->x;
    double *const b = x->code + i * x->f, trace = 0;
    saga_matrix a;

    memset(a, 0, sizeof a);
    memset(b, 0, x->f * sizeof *b);
    /* Normal equations of sum_k w_k (e_k - (B f)_k)^2 + sum_j ridge_j f_j^2,
     * that is (B' W B + ridge) f = B' W e. The solver reads the lower triangle
     * alone. */
    for (size_t k = 0; k < x->d; k++) {
        const double w = x->weight[i * x->d + k];
        const double e = x->wanted[i * x->d + k] - x->mean[k];

        for (size_t j = 0; j < x->f; j++) {
            b[j] += w * x->basis[k][j] * e;
            for (size_t l = 0; l <= j; l++)
                a[j][l] += w * x->basis[k][j] * x->basis[k][l];
        }
    }
    /* A thousandth of the mean diagonal keeps the system solvable where a
     * primitive's weights say nearly nothing about some feature. */
    for (size_t j = 0; j < x->f; j++)
        trace += a[j][j];
    for (size_t j = 0; j < x->f; j++)
        a[j][j] += c->ridge ? c->ridge[j] : 1e-3 * trace / (double)x->f;
    saga_solve(a, b, x->f);
}

static void code_part(void *user, size_t part)
{
    const coding *const c = user;
    const saga_range of = saga_part(c->x->n, CODES, part);

    for (size_t i = of.begin; i < of.end; i++)
        fit_code(c, i);
}

/* Fits the features of every primitive, given the basis. ridge (f): what the
 * square of each costs; NULL: next to nothing. */
static void fit_codes(start *x, const double *ridge)
{
    coding c = { x, ridge };

    saga_parallel(&(saga_tasks){
        .run = code_part, .user = &c, .n = saga_n_parts(x->n, CODES),
        .ns = (double)CODE_NS * (double)x->n });
}

/* Fits basis and mean of every dimension, given the features. */
static void fit_basis(start *x)
{
    const size_t n = x->f + 1;

    for (size_t k = 0; k < x->d; k++) {
        double b[SAGA_LINEAR_MOST] = { 0 }, z[SAGA_LINEAR_MOST];
        saga_matrix a;

        memset(a, 0, sizeof a);
        /* Regression on (features, 1): the last coefficient is the mean. */
        z[x->f] = 1;
        for (size_t i = 0; i < x->n; i++) {
            const double w = x->weight[i * x->d + k];

            memcpy(z, x->code + i * x->f, x->f * sizeof *z);
            for (size_t j = 0; j < n; j++) {
                b[j] += w * z[j] * x->wanted[i * x->d + k];
                for (size_t l = 0; l <= j; l++)
                    a[j][l] += w * z[j] * z[l];
            }
        }
        for (size_t j = 0; j < n; j++)
            /* Features that depend on each other would make it singular. */
            a[j][j] *= 1 + 1e-6;
        saga_solve(a, b, n);
        memcpy(x->basis[k], b, x->f * sizeof *b);
        x->mean[k] = b[x->f];
    }
}

/* code <- forth code (rows: new features), basis <- basis back, with back the
 * inverse of forth. */
static void change(start *x, saga_matrix forth, saga_matrix back)
{
    double y[SAGA_LINEAR_MOST];

    for (size_t i = 0; i < x->n; i++) {
        double *const c = x->code + i * x->f;

        /* Features y = forth c; the products stay what they were, since B c =
         * (B back) (forth c). */
        for (size_t j = 0; j < x->f; j++) {
            y[j] = 0;
            for (size_t l = 0; l < x->f; l++)
                y[j] += forth[j][l] * c[l];
        }
        memcpy(c, y, x->f * sizeof *c);
    }
    for (size_t k = 0; k < x->d; k++) {
        for (size_t j = 0; j < x->f; j++) {
            y[j] = 0;
            for (size_t l = 0; l < x->f; l++)
                y[j] += x->basis[k][l] * back[l][j];
        }
        memcpy(x->basis[k], y, x->f * sizeof *y);
    }
}

/* Makes features whose unit errors cost `price` each on the mean of the
 * primitives. */
static void scale(start *x, double price)
{
    saga_matrix g, v, forth, back;

    memset(g, 0, sizeof g);
    /* G = B' W B / price, W the mean weights: an error e of the features costs
     * e' G e in units of the price. */
    for (size_t k = 0; k < x->d; k++) {
        double w = 0;

        for (size_t i = 0; i < x->n; i++)
            w += x->weight[i * x->d + k] / ((double)x->n * price);
        for (size_t j = 0; j < x->f; j++)
            for (size_t l = 0; l < x->f; l++)
                g[j][l] += w * x->basis[k][j] * x->basis[k][l];
    }
    saga_eigen(v, g, x->f);
    for (size_t j = 0; j < x->f; j++)
        for (size_t l = 0; l < x->f; l++) {
            /* With G = V D V', forth D^(1/2) V' and back V D^(-1/2) give back'
             * G back = 1. The floor stands for directions that draw nothing. */
            const double root = sqrt(fmax(g[l][l], 1e-12 * g[0][0]));

            forth[l][j] = v[j][l] * root;
            back[j][l] = v[j][l] / root;
        }
    change(x, forth, back);
}

/* Makes features of mean 0 without correlation, that of the largest variance
 * first; variance (f). */
static void decorrelate(start *x, double *variance)
{
    double mean[SAGA_LINEAR_MOST] = { 0 };
    saga_matrix c, v, forth;

    memset(c, 0, sizeof c);
    for (size_t i = 0; i < x->n; i++)
        for (size_t j = 0; j < x->f; j++)
            mean[j] += x->code[i * x->f + j] / (double)x->n;
    /* What the features have in common moves into the dimensions' mean. */
    for (size_t k = 0; k < x->d; k++)
        for (size_t j = 0; j < x->f; j++)
            x->mean[k] += x->basis[k][j] * mean[j];
    for (size_t i = 0; i < x->n; i++) {
        double *const y = x->code + i * x->f;

        for (size_t j = 0; j < x->f; j++)
            y[j] -= mean[j];
        for (size_t j = 0; j < x->f; j++)
            for (size_t l = 0; l < x->f; l++)
                c[j][l] += y[j] * y[l] / (double)x->n;
    }
    /* A rotation, with v as its inverse: what errors cost, which scale has made
     * the same in all directions, stays so. */
    saga_eigen(v, c, x->f);
    for (size_t j = 0; j < x->f; j++)
        for (size_t l = 0; l < x->f; l++)
            forth[l][j] = v[j][l];
    change(x, forth, v);
    for (size_t j = 0; j < x->f; j++)
        variance[j] = c[j][j];
}

/* --- Networks ------------------------------------------------------------ */

/* Hidden units 2 i and 2 i + 1 carry input i < n and its negative through all
 * layers but the last. */
static void carry(saga_net *net, size_t n)
{
    for (int l = 0; l + 1 < net->n_layers; l++) {
        const size_t in = (size_t)net->dim[l];

        memset(net->w[l], 0, 2 * n * in * sizeof(real));
        for (size_t i = 0; i < 2 * n; i++)
            /* The first layer gives ReLU(x) and ReLU(-x). Neither is below 0,
             * so that the others pass them as they are. */
            net->w[l][i * in + (l ? i : i / 2)] = l || i % 2 == 0 ? 1 : -1;
    }
}

/* Sets the last layer's row: bias plus b times what n pairs carry, or n inputs
 * where there is no other layer. */
static void set_row(saga_net *net, size_t row, const double *b, size_t n,
                    double bias)
{
    const int l = net->n_layers - 1;
    const size_t in = (size_t)net->dim[l];
    real *const w = net->w[l] + row * in;

    memset(w, 0, in * sizeof *w);
    /* x = ReLU(x) - ReLU(-x). */
    for (size_t i = 0; i < n; i++)
        if (l == 0) {
            w[i] = (real)b[i];
        } else {
            w[2 * i] = (real)b[i];
            w[2 * i + 1] = (real)-b[i];
        }
    net->b[l][row] = (real)bias;
}

/* Counts the features that a network's hidden units can carry, if it has
 * any. */
static size_t carried(const saga_net *net, size_t n)
{
    const size_t pairs = (size_t)net->dim[1] / 2;

    return net->n_layers > 1 && pairs < n ? pairs : n;
}

/* Makes first outputs = first inputs, the features. */
static void pass_features(saga_net *net, size_t f)
{
    const size_t n = carried(net, f);

    carry(net, n);
    for (size_t i = 0; i < f; i++) {
        double unit[SAGA_LINEAR_MOST] = { 0 };

        unit[i] = 1;
        set_row(net, i, unit, n, 0);
    }
}

static void set_supports(const start *x, saga_fit *f)
{
    const size_t n = f->scene->model.features;

    for (size_t k = 0; k < 4; k++)
        set_row(&f->scene->net[SAGA_NET_FINE], n + k, NULL, 0,
                x->log2_support[k]);
}

static void set_geometry(const start *x, saga_fit *f)
{
    saga_net *const net = &f->scene->net[SAGA_NET_GEO];
    const size_t n = carried(net, x->f);
    const size_t n_rows = (size_t)net->dim[net->n_layers];
    saga_rows rows[SAGA_N_HEADS];

    saga_model_rows(rows, &f->scene->model);
    carry(net, n);
    /* Rows of heads that nothing is wanted of, as the temporal centre's, are
     * 0. */
    for (size_t i = 0; i < n_rows; i++)
        set_row(net, i, NULL, 0, 0);
    for (int a = 0; a < SAGA_N_ATTRS; a++) {
        const saga_rows *const head = &rows[saga_attributes[a].head];

        for (size_t k = 0; k < x->width[a] && head->net == SAGA_NET_GEO; k++)
            set_row(net, head->first + k, x->basis[x->at[a] + k], n,
                    x->mean[x->at[a] + k]);
    }
}

/* The colour itself goes through pairs of hidden units: the first layer, in
 * two parts, makes it of the features and leaves the direction out. */
static void set_colour(const start *x, saga_fit *f)
{
    saga_net *const base = &f->scene->net[SAGA_NET_COLOUR_BASE];
    saga_net *const view = &f->scene->net[SAGA_NET_COLOUR_VIEW];
    saga_net *const net = &f->scene->net[SAGA_NET_COLOUR];
    const size_t in = (size_t)base->dim[0], at = x->at[SAGA_ATTR_COLOUR];

    memset(base->w[0], 0, 6 * in * sizeof(real));
    /* Three pairs, each a colour about its mean; other units stay random, and
     * nothing reads them yet. */
    for (size_t i = 0; i < 6; i++)
        for (size_t j = 0; j < x->f; j++)
            base->w[0][i * in + j] = (real)((i % 2 ? -1 : 1) *
                                            x->basis[at + i / 2][j]);
    /* The direction adds nothing to these six at first; it learns to. */
    if (view->n_layers)
        memset(view->w[0], 0, 6 * (size_t)view->dim[0] * sizeof(real));
    memset(net->w[0], 0, 6 * (size_t)net->dim[0] * sizeof(real));
    for (size_t i = 0; i < 6; i++)
        net->w[0][i * (size_t)net->dim[0] + i] = 1;
    for (size_t k = 0; k < 3; k++) {
        double unit[3] = { 0 };

        /* The mean does not pass a ReLU: it is the last bias. */
        unit[k] = 1;
        set_row(net, k, unit, 3, x->mean[at + k]);
    }
}

/* A coarse anchor has the mean of what its primitives want. */
static void set_features(const start *x, saga_fit *f)
{
    const saga_scene *const s = f->scene;
    const size_t n = s->model.features;
    uint32_t i, c, p;

    memset(s->coarse_feature, 0, s->n.coarse * n * sizeof(real));
    for (i = p = 0; i < s->n.coarse; i++) {
        const uint32_t first = p;

        /* Primitives lie in the order of their anchors: this one's are
         * first..p-1. */
        for (c = 0; c < s->coarse[i].n_fine; c++)
            p += s->fine[s->coarse[i].first_fine + c].n_prim;
        for (c = first; c < p; c++)
            for (size_t k = 0; k < x->f; k++)
                s->coarse_feature[i * n + k] +=
                    (real)(x->code[c * x->f + k] / (p - first));
    }
}

/* --- Networks of one's own ----------------------------------------------- */

/* Returns what a unit of a feature may cost the pictures' mean squared error. A
 * step of it costs price step^2 / 12, which at equal slopes is a bit's worth
 * over 2 ln 2. */
static double price_of(const saga_fit *f)
{
    const double step = saga_fit_feature_step(f->scene);

    return 6 * f->o.price.start / (M_LN2 * step * step);
}

static void limit_codes(start *x)
{
    for (size_t i = 0; i < x->n * x->f; i++)
        x->code[i] = fmin(fmax(x->code[i], -MOST_FEATURE), MOST_FEATURE);
}

/* What never reaches a step is coded as 0 always: a feature whose deviation is
 * a thousandth of one is left out, before its weights leave all formats. */
static void drop_idle(start *x, const double *variance, double step)
{
    for (size_t k = 0; k < x->f; k++)
        for (size_t i = 0; i < x->d && variance[k] < 1e-6 * step * step; i++)
            x->basis[i][k] = 0;
}

static void solve_all(start *x, double price, double step)
{
    double ridge[SAGA_LINEAR_MOST], most;

    /* Basis and features, in turns. */
    first_basis(x);
    for (int i = 0; i < N_TURNS; i++) {
        if (i)
            fit_basis(x);
        fit_codes(x, NULL);
    }
    /* Units that bits are worth; ridge takes the variances, the largest
     * first. */
    scale(x, price);
    decorrelate(x, ridge);
    most = fmin(fmax(ridge[0], step * step), MOST_DEVIATION * MOST_DEVIATION);
    if (ridge[0] > 1e-24 && (ridge[0] < most || ridge[0] > most)) {
        /* Features go with 1 / sqrt(price), variances with 1 / price, so that
         * this makes the largest one `most`. */
        price *= ridge[0] / most;
        scale(x, price);
        decorrelate(x, ridge);
    }
    drop_idle(x, ridge, step);
    /* The last features, with a prior of their own variance: PRIOR (price
     * step^2 / 12) f^2 / variance. */
    for (size_t k = 0; k < x->f; k++)
        ridge[k] = PRIOR * price /
                   (12 / (step * step) * (ridge[k] + 1e-6));
    fit_codes(x, ridge);
    limit_codes(x);
}

/* Makes the twin of the scene as it stands, without noise: what the first
 * iteration finds where later ones find the last one's. */
static bool begin_twin(saga_fit *f, saga_error *error)
{
    const saga_scene *const s = f->scene;

    memcpy(f->feature, s->coarse_feature, (size_t)s->n.coarse *
           s->model.features * sizeof *f->feature);
    memcpy(f->position, s->prim_x, 4 * (size_t)s->n.prim * sizeof *f->position);
    memcpy(f->params, s->params, saga_fit_n_params(s) * sizeof *f->params);
    if (!saga_twin_refresh(&f->twin, &f->used, f->feature, error))
        return false;
    saga_twin_geometry(&f->twin, &f->used, f->feature);
    return true;
}

static void make_networks(start *x, saga_fit *f)
{
    static const int passing[] = { SAGA_NET_FUSE_C, SAGA_NET_FINE,
                                   SAGA_NET_FUSE_F };

    for (size_t i = 0; i < sizeof passing / sizeof *passing; i++)
        if (f->scene->net[passing[i]].n_layers)
            pass_features(&f->scene->net[passing[i]], x->f);
    /* Supports come first: they are the units of the motion that is wanted. */
    choose_supports(x, f->scene);
    set_supports(x, f);
    want(x, f);
    raise_weights(x);
    solve_all(x, price_of(f), saga_fit_feature_step(f->scene));
    set_geometry(x, f);
    set_colour(x, f);
    set_features(x, f);
}

/* --- Given networks ------------------------------------------------------ */

/* Features begin with their mean; their twin is made. */
static bool begin_features(saga_fit *f, saga_error *error)
{
    const real *const mean =
        f->rate.constants.mean[SAGA_KIND_COARSE] + 4;
    const size_t n = f->scene->model.features;

    for (size_t i = 0; i < n * f->scene->n.coarse; i++)
        f->scene->coarse_feature[i] = mean[i % n];
    return begin_twin(f, error);
}

/* Sets the twin's gradients to those of
 * sum_i sum_k w_ik (a_ik - wanted_ik)^2, a and wanted as pictures see them. */
static void pull(const start *x, saga_fit *f)
{
    const saga_splat_params *const has = &f->twin.attr;
    const saga_splat_params *const d = &f->twin.d_attr;
    const double *w = x->weight;

    saga_twin_clear(&f->twin, f->scene);
    /* Motion leaves the network in supports and is wanted in half-cubes: a =
     * motion support, so that both factors get a gradient. */
    for (size_t i = 0; i < x->n; i++)
        for (int a = 0; a < SAGA_N_ATTRS; a++)
            for (size_t k = 0; k < x->width[a]; k++, w++) {
                const bool moves = saga_attributes[a].unit == SAGA_UNIT_SUPPORT;
                const size_t at = i * stride_of(a) + k, axis = 3 * i + k % 3;
                const real *const wants = x->target->of[a];
                const real unit = moves ? has->support[axis] : 1;
                const real e = 2 * (real)*w * (has->of[a][at] * unit -
                                               (wants ? wants[at] : 0));

                d->of[a][at] += e * unit;
                if (moves)
                    d->support[axis] += e * has->of[a][at];
            }
}

/* Adds the gradient of the features' bits, by the constants of their kind. */
static void add_bits(saga_fit *f)
{
    const saga_scene *const s = f->scene;
    const saga_rate_constants *const c = &f->rate.constants;
    const double step = saga_fit_feature_step(s);
    const size_t n = s->model.features;

    for (size_t k = 0; k < n; k++) {
        /* A normal distribution gives f (f - mean)^2 / (2 sigma^2 ln 2) bits
         * and a constant; the derivative is (f - mean) / (sigma^2 ln 2). */
        const double sigma =
            step * exp2((double)c->log2_sigma[SAGA_KIND_COARSE][4 + k]);
        const real price = (real)(f->o.price.start / (M_LN2 * sigma * sigma));

        for (size_t i = k; i < n * s->n.coarse; i += n)
            f->grad.coarse_feature[i] += price *
                (s->coarse_feature[i] - c->mean[SAGA_KIND_COARSE][4 + k]);
    }
}

static bool descend(saga_fit *f, int turn, saga_error *error)
{
    const saga_scene *const s = f->scene;
    const saga_adam adam = saga_adam_default();
    const size_t at = (size_t)(s->coarse_feature - s->reals);
    const double rate = FIRST_RATE * pow(LAST_RATE / FIRST_RATE,
                                         (double)turn / (N_STEPS - 1));
    const saga_adam_tensor t = {
        "coarse features", s->coarse_feature, f->grad.coarse_feature,
        f->m + at, f->v + at, (size_t)s->n.coarse * s->model.features,
        (real)rate
    };

    return saga_adam_update(&adam, &t, 1, (uint64_t)turn + 1, error);
}

/* Colours are looked at from where the pictures were taken. Adam's moments are
 * the fit's, which begins after this. */
static bool find_features(const start *x, saga_fit *f, saga_error *error)
{
    const saga_rng r = saga_rng_stream(f->o.seed, STREAM_SIGNS);
    const size_t n = (size_t)f->scene->n.coarse * f->scene->model.features;
    bool ok = begin_features(f, error);

    for (int i = 0; ok && i < N_STEPS; i++) {
        saga_splat_camera camera;

        saga_pictures_camera(&camera, f->pictures,
                             saga_pictures_pick(f->pictures, r, (uint64_t)i));
        memset(f->grad.reals, 0, f->grad.n_reals * sizeof(real));
        /* Forward. Nothing is drawn: the camera only gives the direction. */
        saga_twin_geometry(&f->twin, &f->used, f->scene->coarse_feature);
        saga_twin_colour(&f->twin, &f->used, camera.centre);
        /* Backward, in the opposite order. */
        pull(x, f);
        saga_twin_colour_backward(&f->twin, &f->grad, &f->used);
        saga_twin_backward(&f->twin, &f->grad, &f->used);
        add_bits(f);
        ok = descend(f, i, error);
    }
    /* The features' format ends at 32; training needs some room. */
    for (size_t i = 0; i < n; i++)
        f->scene->coarse_feature[i] =
            saga_clamp(f->scene->coarse_feature[i], -(real)MOST_FEATURE,
                       (real)MOST_FEATURE);
    /* The rendering's Adam begins anew. */
    memset(f->m, 0, f->scene->n_reals * sizeof *f->m);
    memset(f->v, 0, f->scene->n_reals * sizeof *f->v);
    return ok;
}

/* --- All of it ----------------------------------------------------------- */

bool saga_fit_start(saga_fit *f, saga_splat_params *target, saga_error *error)
{
    start x = { .target = target };
    bool ok;

    /* Before anything is measured: weights are per attribute, and depend on
     * which description of an ellipsoid they are taken of. */
    saga_splat_canonical(target, f->scene->n.prim);
    ok = init(&x, f, error) && weigh(&x, f, error);
    if (ok && f->o.given) {
        /* pull compares attributes themselves, so that weights keep their
         * units. */
        raise_weights(&x);
        ok = find_features(&x, f, error);
    } else if (ok) {
        make_networks(&x, f);
    }
    release(&x);
    return ok && begin_twin(f, error);
}
