/* SPDX-License-Identifier: MIT
 *
 * Chooses the tools of the picture that a scene needs, at the end of the
 * warm-up, before the hierarchy is made. The warm-up's pictures are drawn
 * without each tool, one after the other. The growth of the squared error,
 * divided by the price of bits, is the tool's worth, less what training would
 * win back. Its cost is what the weights of its networks take, not what the
 * features do that it needs.
 */
#include "tool_choice.h"

#include "alloc.h"
#include "linear.h"
#include "splat_age.h"
#include "threads.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* A weight takes about as many bits in all files (policy.c); a row also has a
 * format and a bias, and a layer its steps. */
enum { WEIGHT_BITS = 4, ROW_BITS = 13, LAYER_BITS = 38 };

/* At most this many pictures are drawn, and one for each 32 iterations of the
 * warm-up, since each is drawn some ten times. Fewer than 4 would decide
 * nothing. */
enum { MOST_PICTURES = 32, ITERATIONS_OF_ONE = 32, LEAST_PICTURES = 4 };

/* Steps that find the colours by direction, each of which lowers the error.
 * Directions that spread less than this part of the mean spread count as
 * noise. */
enum { N_STEPS = 3 };
#define SPREAD_FLOOR 0.1

const char *const saga_train_tool_names[SAGA_TRAIN_N_TOOLS] = {
    "motion of order 3", "motion of order 2", "motion of order 1",
    "linear rotation",   "temporal opacity",  "view-dependent colour"
};

/* A picture of a training view. Every view belongs to one of two halves. */
typedef struct {
    saga_sample picture;
    int half;
} look;

typedef struct {
    const saga_tool_question *q;
    saga_tool_choice *to;
    saga_canvas canvas;
    saga_splat_params p; /* the warm-up with the tools that are kept so
                          * far */
    uint32_t n;          /* number of primitives */
    look look[MOST_PICTURES];
    int n_looks;
} trial;

/* --- Pictures ------------------------------------------------------------- */

static void choose_pictures(trial *a)
{
    const saga_pictures *const p = a->q->pictures;
    const saga_capture *const c = p->capture;
    const int n = p->n_train;
    const int by_time = a->q->terms.options->n_warm / ITERATIONS_OF_ONE;
    const int most = by_time < MOST_PICTURES ? by_time : MOST_PICTURES;
    const int every = most > 0 ? (n + most - 1) / most : n;
    const int each = most / n > 0 ? most / n : 1;

    /* Every `every`th view is taken, alternately for either half, at frames in
     * the middle of equal parts of the segment. */
    for (int k = 0; k < n && most >= LEAST_PICTURES; k += every)
        for (int i = 0; i < each; i++) {
            const int view = p->train[k];
            const int frame = saga_capture_near(
                c, view,
                (int)((2 * (int64_t)i + 1) * c->n_frames / (2 * each)));

            if (frame >= 0 && a->n_looks < MOST_PICTURES)
                a->look[a->n_looks++] =
                    (look){ { .view = view, .frame = frame }, k / every % 2 };
        }
}

/* Returns the number of pictures in a half, or of all where half < 0. */
static int count_pictures(const trial *a, int half)
{
    int n = 0;

    for (int i = 0; i < a->n_looks; i++)
        n += half < 0 || a->look[i].half == half;
    return n;
}

static void aim(trial *a, int i)
{
    saga_pictures_aim(&a->canvas, a->q->pictures, a->look[i].picture);
    saga_pictures_truth(&a->canvas, a->q->pictures, a->look[i].picture);
}

/* Returns the mean squared error of all pictures drawn with p, or -1 with
 * *error set if memory is short. */
static double error_of(trial *a, const saga_splat_params *p, saga_error *error)
{
    double sum = 0;

    for (int i = 0; i < a->n_looks; i++) {
        aim(a, i);
        if (!saga_splat_forward(&a->canvas, p, a->n, error))
            return -1;
        sum += saga_canvas_mse(&a->canvas);
    }
    /* Each picture has the same weight, whatever its size. */
    return sum / a->n_looks;
}

/* --- Without a tool ------------------------------------------------------ */

/* Drops the highest order of motion, and changes the lower ones so that the
 * path stays as close as possible for ages of -1 to 1: the best line through
 * age^3 is 3/5 age, the best constant through age^2 is 1/3. */
static void lower_order(saga_splat_params *p, uint32_t n, int order)
{
    for (size_t i = 0; i < n; i++)
        for (size_t k = 0; k < 3; k++) {
            /* b[0], b[3] and b[6] are the coefficients of order 1, 2 and 3 on
             * axis k. */
            real *const b = p->motion + 9 * i + k;

            /* The integral of (a^3 - c a)^2 for a in -1..1 is least at
             * c = (2/5) / (2/3) = 3/5; the mean of a^2 is 1/3. */
            if (order == 3)
                b[0] += R(0.6) * b[6];
            else if (order == 2)
                p->mean[3 * i + k] += b[3] / 3;
            b[3 * (order - 1)] = 0;
        }
}

/* Drops the temporal width. Without one a primitive ages as if its width were
 * half a segment, so its motion is rescaled to stay as it was. */
static void drop_opacity(saga_splat_params *p, uint32_t n)
{
    for (size_t i = 0; i < n; i++) {
        const real faster = saga_splat_ageing(p, i) / 2;

        for (size_t k = 0; k < 3; k++) {
            real *const b = p->motion + 9 * i + k;

            /* Without a width the age is 2 dt; with it, it was `faster` times
             * as much, so that the coefficient of order k is multiplied by
             * faster^k. */
            b[0] *= faster;
            b[3] *= faster * faster;
            b[6] *= faster * faster * faster;
        }
        for (size_t k = 0; p->slope && k < 4; k++)
            p->slope[4 * i + k] *= faster;
    }
    p->log2_width = NULL;
}

/* Changes p to what it is without one temporal tool. */
static void drop_tool(saga_splat_params *p, uint32_t n, int tool)
{
    if (tool == SAGA_TRAIN_SLOPE)
        p->slope = NULL;
    else if (tool == SAGA_TRAIN_OPACITY_T)
        drop_opacity(p, n);
    else
        lower_order(p, n, 3 - tool);
}

void saga_plan_reduce(saga_splat_params *p, uint32_t n, uint32_t tools)
{
    const int order = saga_tools_order(tools);

    /* The tools are dropped in the order in which they were judged, so that the
     * result is the one that was judged. */
    for (int k = 3; k > order; k--)
        drop_tool(p, n, 3 - k);
    if (!(tools & SAGA_TOOL_SLOPE))
        drop_tool(p, n, SAGA_TRAIN_SLOPE);
    if (!(tools & SAGA_TOOL_OPACITY_T))
        drop_tool(p, n, SAGA_TRAIN_OPACITY_T);
}

static uint32_t tools_without(uint32_t tools, int tool)
{
    return tool == SAGA_TRAIN_SLOPE ? tools & ~(uint32_t)SAGA_TOOL_SLOPE
           : tool == SAGA_TRAIN_OPACITY_T
               ? tools & ~(uint32_t)SAGA_TOOL_OPACITY_T
           : tool == SAGA_TRAIN_VIEW ? tools & ~(uint32_t)SAGA_TOOL_VIEW
                                     : tools - (1u << SAGA_TOOL_MOTION_SHIFT);
}

/* --- Worth and cost ------------------------------------------------------ */

/* Returns about how many bits the networks of a scene with these tools take. */
static double network_bits(const saga_tool_question *q, uint32_t tools)
{
    saga_net_shape shape;
    saga_model m;
    double n = 0;

    saga_plan_model(&m, &q->terms, tools | q->pictures->tools);
    for (int i = 0; i < SAGA_N_NETS; i++) {
        saga_model_net(&shape, &m, i);
        n += WEIGHT_BITS * saga_net_macs(&shape);
        for (int k = 0; k < shape.n_layers; k++)
            n += ROW_BITS * shape.dim[k + 1] + LAYER_BITS;
    }
    return n;
}

/* Returns the bytes that training without a tool wins back. Without motion of
 * third order or rotation the warm-up lost as much as two fifths of all
 * primitives' bytes are worth, but after training nothing, or it gained
 * (docs/lab/motion.md). */
static double won_back(const saga_train_options *o, int tool)
{
    return tool == SAGA_TRAIN_MOTION_3 || tool == SAGA_TRAIN_SLOPE
               ? SAGA_PRIMITIVE_BITS / 8 / 2 * o->n_primitives
               : 0;
}

/* Judges a tool whose use lowers the pictures' mean squared error by `less`,
 * and removes it unless it pays. Returns true if it is kept. */
static bool judge(trial *a, int tool, double less)
{
    const saga_tool_question *const q = a->q;
    const uint32_t tools = a->to->tools;
    const uint32_t without = tools_without(tools, tool);
    saga_train_tool *const r = &a->to->tool[tool];

    /* L = 255^2 MSE + lambda bits / pixels, so an error is worth 255^2 MSE
     * pixels / lambda bits. */
    r->worth = less * 255 * 255 * saga_pictures_pixels(q->pictures) /
               (8 * q->lambda);
    r->cost = (network_bits(q, tools) - network_bits(q, without)) / 8 +
              won_back(q->terms.options, tool);
    r->asked = true;
    r->kept = r->worth > r->cost;
    if (!r->kept)
        a->to->tools = without;
    return r->kept;
}

/* Tells whether a tool is judged: not if it is absent, nor if it is a lower
 * order of a motion that pays. */
static bool needs_asking(const saga_tool_choice *c, int tool)
{
    if (tool <= SAGA_TRAIN_MOTION_1)
        return saga_tools_order(c->tools) == 3 - tool;
    return tool != SAGA_TRAIN_SLOPE || (c->tools & SAGA_TOOL_SLOPE);
}

static bool ask_temporal(trial *a, int tool, double *mse, saga_error *error)
{
    saga_splat_params q;
    double more;
    bool ok = saga_params_gather(&q, &a->p, NULL, a->n, error);

    if (ok) {
        /* A copy is drawn without the tool. If the tool does not pay, the copy
         * replaces the primitives for the tools to come. */
        drop_tool(&q, a->n, tool);
        more = error_of(a, &q, error);
        ok = more >= 0;
        if (ok && !judge(a, tool, more - *mse)) {
            const saga_splat_params old = a->p;

            a->p = q;
            q = old;
            *mse = more;
        }
    }
    saga_params_free(&q);
    return ok;
}

/* --- Colour by direction ------------------------------------------------- */

/* Sums for a primitive over the pictures of a half. The first three are of the
 * weight alpha T times 1, the direction, and the products of its components;
 * the last two of what is missing in the colour, times 1 and the direction. */
typedef struct {
    real w, d[3], dd[6], g[3], dg[9];
} sums;

/* A linear change of the colour by direction, about the mean direction: 3x3,
 * rows R, G, B, columns x, y, z. */
typedef struct {
    real mean[3], by[9];
} slant;

typedef struct {
    sums *sum;           /* (n) */
    slant *slant;        /* (n) */
    real *weight;        /* (n) alpha T summed over one picture */
    saga_splat_params d; /* gradients, reused for each picture */
    saga_splat_params p; /* the trial's primitives with `colour`
                          * below */
    real *colour;        /* (n, 3) */
} slanted;

static void direction(real d[3], const trial *a, size_t i)
{
    real n = 0;

    /* From the primitive towards the camera. F_color takes the opposite
     * direction, which makes no difference to a linear change. */
    for (size_t k = 0; k < 3; k++) {
        d[k] = a->canvas.camera.centre[k] - a->p.mean[3 * i + k];
        n += d[k] * d[k];
    }
    n = (real)sqrt((double)n);
    for (size_t k = 0; k < 3; k++)
        d[k] = n > 0 ? d[k] / n : 0;
}

/* Primitives in one task, and nanoseconds for a primitive in each loop. */
enum { PART = 256, SLANT_NS = 40 };

typedef struct {
    slanted *s;
    const trial *a;
} task;

static void run_parts(slanted *s, const trial *a, void (*run)(void *, size_t))
{
    task t = { s, a };

    saga_parallel(&(saga_tasks){ .run = run,
                                 .user = &t,
                                 .n = saga_n_parts(a->n, PART),
                                 .ns = (double)SLANT_NS * a->n });
}

/* Sets the colours of a part as the camera of the canvas sees them. */
static void colour_part(void *user, size_t part)
{
    const trial *const a = ((const task *)user)->a;
    const slanted *const s = ((const task *)user)->s;
    const saga_range of = saga_part(a->n, PART, part);

    for (size_t i = of.begin; i < of.end; i++) {
        const slant *const b = &s->slant[i];
        real d[3];

        direction(d, a, i);
        for (size_t c = 0; c < 3; c++) {
            real x = a->p.colour[3 * i + c];

            for (size_t k = 0; k < 3; k++)
                x += b->by[3 * c + k] * (d[k] - b->mean[k]);
            s->colour[3 * i + c] = saga_clamp(x, 0, 1);
        }
    }
}

/* Adds the drawn picture to the sums of a part. */
static void add_part(void *user, size_t part)
{
    const trial *const a = ((const task *)user)->a;
    const slanted *const s = ((const task *)user)->s;
    const saga_range of = saga_part(a->n, PART, part);
    /* The gradient of a colour is -2 / n_seen sum alpha T (what is missing);
     * this takes the factor away. */
    const real half = R(-0.5 * saga_canvas_n_seen(&a->canvas));

    for (size_t i = of.begin; i < of.end; i++) {
        const real w = s->weight[i];
        sums *const x = &s->sum[i];
        real d[3];

        /* The picture does not show this primitive. */
        if (!(w > 0))
            continue;
        direction(d, a, i);
        x->w += w;
        /* The products are symmetric, so that their lower triangle is
         * enough. */
        for (size_t k = 0, at = 0; k < 3; k++) {
            const real g = half * s->d.colour[3 * i + k];

            x->d[k] += w * d[k];
            for (size_t j = 0; j <= k; j++)
                x->dd[at++] += w * d[k] * d[j];
            x->g[k] += g;
            for (size_t j = 0; j < 3; j++)
                x->dg[3 * k + j] += g * d[j];
        }
    }
}

/* Adds a step to the slant of a primitive. The weights alpha T of all
 * primitives at a pixel add up to at most 1, so all can step at once without
 * overshooting. */
static void add_step(slant *b, const sums *x)
{
    saga_matrix a = { { 0 } };
    double spread = 0;

    /* No picture of this half shows the primitive. */
    if (!(x->w > 0))
        return;
    /* The spread is the trace of the directions' covariance; 0, 2 and 5 are the
     * diagonal of the packed triangle. */
    for (size_t k = 0; k < 3; k++) {
        b->mean[k] = x->d[k] / x->w;
        spread += (double)(x->dd[k == 0   ? 0
                                 : k == 1 ? 2
                                          : 5] -
                           x->d[k] * b->mean[k]);
    }
    /* A regression of what is missing on the direction, both about their means,
     * solves A by = v. A is the covariance, with a ridge so that a primitive
     * seen from one side only gets no slant. */
    for (size_t c = 0; c < 3; c++) {
        double v[3];

        for (size_t k = 0, at = 0; k < 3; k++) {
            for (size_t j = 0; j <= k; j++)
                a[k][j] = (double)(x->dd[at++] - x->d[k] * b->mean[j]);
            a[k][k] += SPREAD_FLOOR * spread + 1e-6 * (double)x->w;
            v[k] = (double)(x->dg[3 * c + k] - x->g[c] * b->mean[k]);
        }
        saga_solve(a, v, 3);
        for (size_t k = 0; k < 3; k++)
            b->by[3 * c + k] += (real)v[k];
    }
}

static void step_part(void *user, size_t part)
{
    const task *const t = user;
    const saga_range of = saga_part(t->a->n, PART, part);

    for (size_t i = of.begin; i < of.end; i++)
        add_step(&t->s->slant[i], &t->s->sum[i]);
}

/* Learns from one picture of a half. */
static bool learn(slanted *s, trial *a, int i, saga_error *error)
{
    saga_splat_stats stats = { .weight = s->weight };
    saga_splat_learning l = { .d = s->d, .stats = &stats };
    saga_span all[SAGA_N_ATTRS];
    const size_t n = a->n;

    aim(a, i);
    run_parts(s, a, colour_part);
    /* Backward passes add to the gradients. Only those of colours are used, but
     * the others need memory too. */
    memset(s->weight, 0, n * sizeof *s->weight);
    saga_clear(all, saga_params_spans(all, &s->d, n));
    if (!saga_splat_learn(&l, &a->canvas, &s->p, a->n, error))
        return false;
    run_parts(s, a, add_part);
    return true;
}

/* Finds the slants from the pictures of one half. */
static bool learn_half(slanted *s, trial *a, int half, saga_error *error)
{
    memset(s->slant, 0, a->n * sizeof *s->slant);
    /* A single step is too short where primitives only partly cover a pixel. */
    for (int step = 0; step < N_STEPS; step++) {
        memset(s->sum, 0, a->n * sizeof *s->sum);
        for (int i = 0; i < a->n_looks; i++)
            if (a->look[i].half == half && !learn(s, a, i, error))
                return false;
        run_parts(s, a, step_part);
    }
    return true;
}

/* Adds to *sum the squared error of the other half's pictures, drawn with the
 * slants that this half found. */
static bool test_half(double *sum, slanted *s, trial *a, int half,
                      saga_error *error)
{
    for (int i = 0; i < a->n_looks; i++) {
        if (a->look[i].half == half)
            continue;
        aim(a, i);
        run_parts(s, a, colour_part);
        if (!saga_splat_forward(&a->canvas, &s->p, a->n, error))
            return false;
        *sum += saga_canvas_mse(&a->canvas) / a->n_looks;
    }
    return true;
}

static void scale_slants(slanted *s, uint32_t n, real by)
{
    for (size_t i = 0; i < n; i++)
        for (size_t k = 0; k < 9; k++)
            s->slant[i].by[k] *= by;
}

/* error holds the errors at 0, 1/2 and 1. Returns by how much the parabola
 * through them falls below error[0] between 0 and 1. */
static double dip(const double error[3])
{
    /* error(x) = error[0] + b x + a x^2 through the three points. */
    const double a = 2 * (error[2] - 2 * error[1] + error[0]);
    const double b = 4 * error[1] - error[2] - 3 * error[0];
    /* x is the lowest point within 0..1, which is an end if the parabola is not
     * convex. */
    const double x = a > 0 ? fmin(fmax(-b / (2 * a), 0), 1)
                           : error[2] < error[0];

    return -(a * x + b) * x;
}

static bool make_slanted(slanted *s, const trial *a, saga_error *error)
{
    /* Colours need no temporal attributes. */
    const uint32_t attrs = saga_attrs_of_tools(a->to->tools, true);

    memset(s, 0, sizeof *s);
    s->sum = saga_calloc(a->n, sizeof *s->sum, "directions", error);
    s->slant = saga_calloc(a->n, sizeof *s->slant, "directions", error);
    s->weight = saga_calloc(a->n, sizeof *s->weight, "directions", error);
    s->colour = saga_calloc(3 * (size_t)a->n, sizeof *s->colour, "directions",
                            error);
    s->p = a->p;
    s->p.colour = s->colour;
    return s->sum && s->slant && s->weight && s->colour &&
           saga_params_alloc(&s->d, attrs, a->n, error);
}

static void free_slanted(slanted *s)
{
    free(s->sum);
    free(s->slant);
    free(s->weight);
    free(s->colour);
    saga_params_free(&s->d);
}

/* Judges whether colours should depend on the direction. One half of the views
 * finds the slants, and the other half is drawn with all and with half of them,
 * from which the best factor is interpolated. What does not help in other views
 * is no reflection but a peculiarity of one view. */
static bool ask_view(trial *a, double mse, saga_error *error)
{
    double sum[3] = { mse, 0, 0 };
    slanted s;
    bool ok = true;

    /* Both halves are needed, one to learn and one to test. */
    if (count_pictures(a, 0) == 0 || count_pictures(a, 1) == 0)
        return true;
    ok = make_slanted(&s, a, error);
    /* The slants are learnt from each half of the pictures and tested on the
     * other half. sum[2] is the error with the whole slants, sum[1] with half
     * of them. */
    for (int half = 0; half < 2 && ok; half++) {
        ok = learn_half(&s, a, half, error) &&
             test_half(&sum[2], &s, a, half, error);
        scale_slants(&s, a->n, R(0.5));
        ok = ok && test_half(&sum[1], &s, a, half, error);
    }
    if (ok)
        judge(a, SAGA_TRAIN_VIEW, dip(sum));
    free_slanted(&s);
    return ok;
}

/* --- All of them --------------------------------------------------------- */

static bool ask_all(trial *a, saga_error *error)
{
    const saga_tool_question *const q = a->q;
    double mse = error_of(a, &a->p, error);
    bool ok = mse >= 0;

    /* The highest order of motion comes first and colour by direction last; a
     * tool that does not pay is gone for all later ones. */
    for (int i = 0; i < SAGA_TRAIN_VIEW && ok; i++)
        if (q->moves && q->terms.options->motion != SAGA_TRAIN_MOVING &&
            needs_asking(a->to, i))
            ok = ask_temporal(a, i, &mse, error);
    return ok && ask_view(a, mse, error);
}

uint32_t saga_plan_all_tools(const saga_train_options *o)
{
    return o->paper ? SAGA_TOOLS_PICTURE
                    : tools_without(tools_without(SAGA_TOOLS_PICTURE,
                                                  SAGA_TRAIN_MOTION_3),
                                    SAGA_TRAIN_SLOPE);
}

bool saga_plan_tools(saga_tool_choice *to, const saga_tool_question *q,
                     saga_error *error)
{
    trial a = { .q = q, .to = to, .n = q->n };
    bool ok = true;

    memset(to, 0, sizeof *to);
    to->tools = saga_plan_all_tools(q->terms.options) &
                ~(q->moves ? 0u : SAGA_TOOLS_TIME);
    choose_pictures(&a);
    if (a.n_looks > 0) {
        ok = saga_pictures_canvas(&a.canvas, q->pictures, error) &&
             saga_params_gather(&a.p, &q->flat, NULL, a.n, error) &&
             ask_all(&a, error);
        saga_params_free(&a.p);
        saga_canvas_free(&a.canvas);
    }
    return ok;
}
