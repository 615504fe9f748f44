/* SPDX-License-Identifier: MIT */
#include "flat_state.h"

#include "alloc.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { COARSEST_WIDTH = 150, MAX_MIP = 3 };

static const char what[] = "the warm-up";

saga_splat_params saga_flat_params(const saga_flat *f)
{
    return f->value;
}
int saga_flat_iteration(const saga_flat *f)
{
    return f->iteration;
}
uint32_t saga_flat_count(const saga_flat *f)
{
    return f->n;
}

uint32_t saga_flat_attrs(uint32_t temporal)
{
    uint32_t attrs = saga_attrs_of_tools(temporal, temporal == 0);

    for (int a = 0; a < SAGA_N_ATTRS; a++)
        if (!(saga_attributes[a].rate > 0))
            attrs &= ~SAGA_ATTR_BIT(a);
    return attrs;
}

static size_t width_of(int attr)
{
    return (size_t)saga_attributes[attr].width;
}

/* --- Room ---------------------------------------------------------------- */

static bool enlarge(real **p, size_t old, size_t cap, saga_error *error)
{
    real *const q = saga_realloc(*p, cap, sizeof *q, what, error);

    if (!q)
        return false;
    *p = q;
    memset(q + old, 0, (cap - old) * sizeof *q);
    return true;
}

/* They are set before they are read. */
static bool enlarge_moments(saga_flat *f, size_t cap, saga_error *error)
{
    saga_flat_moment *const was = saga_realloc(f->was, cap, sizeof *was, what,
                                               error);

    if (was)
        f->was = was;
    return was;
}

static bool enlarge_stats(saga_flat *f, size_t old, size_t cap,
                          saga_error *error)
{
    saga_splat_stats *const s = &f->stats;
    uint32_t *const seen = saga_realloc(s->seen, cap, sizeof *seen, what,
                                        error);

    if (!seen)
        return false;
    memset(seen + old, 0, (cap - old) * sizeof *seen);
    s->seen = seen;
    return enlarge(&s->grad2d, old, cap, error) &&
           enlarge(&s->weight, old, cap, error) &&
           enlarge(&f->worth, old, cap, error) &&
           enlarge(&f->step, 3 * old, 3 * cap, error) &&
           enlarge_moments(f, cap, error);
}

bool saga_flat_reserve(saga_flat *f, uint32_t n, saga_error *error)
{
    const uint32_t cap = n + n / 4 + 16, old = f->cap;

    if (n <= f->cap)
        return true;
    /* New memory is zero, including gradients, moments and statistics. */
    for (int a = 0; a < SAGA_N_ATTRS; a++) {
        const size_t w = width_of(a);

        if (f->attrs & SAGA_ATTR_BIT(a) &&
            (!enlarge(&f->value.of[a], w * old, w * cap, error) ||
             !enlarge(&f->grad.of[a], w * old, w * cap, error) ||
             !enlarge(&f->m.of[a], w * old, w * cap, error) ||
             !enlarge(&f->v.of[a], w * old, w * cap, error)))
            return false;
    }
    if (!enlarge_stats(f, old, cap, error))
        return false;
    f->cap = cap;
    return true;
}

void saga_flat_free_set(saga_flat *f)
{
    for (int a = 0; a < SAGA_N_ATTRS; a++) {
        free(f->value.of[a]);
        free(f->grad.of[a]);
        free(f->m.of[a]);
        free(f->v.of[a]);
    }
    free(f->stats.grad2d);
    free(f->stats.weight);
    free(f->worth);
    free(f->step);
    free(f->was);
    free(f->stats.seen);
}

/* --- Primitives ---------------------------------------------------------- */

void saga_flat_forget(saga_flat *f, uint32_t i)
{
    for (int a = 0; a < SAGA_N_ATTRS; a++) {
        const size_t w = width_of(a);

        if (!f->value.of[a])
            continue;
        memset(f->m.of[a] + w * i, 0, w * sizeof(real));
        memset(f->v.of[a] + w * i, 0, w * sizeof(real));
    }
    f->stats.grad2d[i] = f->stats.weight[i] = f->worth[i] = 0;
    f->stats.seen[i] = 0;
}

uint32_t saga_flat_append(saga_flat *f)
{
    const uint32_t i = f->n++;

    for (int a = 0; a < SAGA_N_ATTRS; a++) {
        const saga_attribute *const k = &saga_attributes[a];
        const size_t w = width_of(a);

        for (size_t j = 0; f->value.of[a] && j < w; j++)
            f->value.of[a][w * i + j] = (real)(k->start +
                                               (j == 0 ? k->first : 0));
    }
    saga_flat_forget(f, i);
    return i;
}

static void copy(saga_splat_params *p, uint32_t to, uint32_t from)
{
    for (int a = 0; a < SAGA_N_ATTRS; a++) {
        const size_t w = width_of(a);

        if (p->of[a])
            memcpy(p->of[a] + w * to, p->of[a] + w * from, w * sizeof(real));
    }
}

uint32_t saga_flat_append_copy(saga_flat *f, uint32_t from)
{
    const uint32_t i = saga_flat_append(f);

    copy(&f->value, i, from);
    return i;
}

void saga_flat_bound(saga_flat *f, int attr, saga_range of)
{
    const size_t w = width_of(attr);
    real *const x = f->value.of[attr];

    for (size_t i = w * of.begin; x && i < w * of.end; i++)
        x[i] = saga_clamp(x[i], f->rule[attr].lo, f->rule[attr].hi);
}

/* Returns by how much the age grows in a unit of time, as saga_splat_ageing. Of
 * most primitives it is 2, which need not be computed. */
static double ageing(real log2_width)
{
    return log2_width >= -1 ? 2 : exp2(-(double)log2_width);
}

void saga_flat_keep_path(saga_flat *f, size_t i, saga_flat_moment was)
{
    const saga_splat_params *const p = &f->value;
    /* Ages change by some 1e-3 in a step. The step rounds coefficients by
     * 2^-24, which is far less than what Adam changes. */
    const double then = ageing(was.log2_width);
    const real ratio = (real)(then / ageing(p->log2_width[i]));
    const real late = (real)(((double)p->t_centre[i] - (double)was.t_centre) *
                             then);

    if (ratio == 1 && late == 0)
        return;
    /* With age = late + ratio age', b1 age + b2 age^2 + b3 age^3 is expanded in
     * the new age'; the place at age' = 0 goes to the mean. */
    for (size_t a = 0; a < 3; a++) {
        real *const b = p->motion + 9 * i + a;

        p->mean[3 * i + a] += ((b[6] * late + b[3]) * late + b[0]) * late;
        b[0] = ratio * ((3 * b[6] * late + 2 * b[3]) * late + b[0]);
        b[3] = ratio * ratio * (3 * b[6] * late + b[3]);
        b[6] = ratio * ratio * ratio * b[6];
    }
    for (size_t a = 0; p->slope && a < 4; a++) {
        p->quat[4 * i + a] += late * p->slope[4 * i + a];
        p->slope[4 * i + a] *= ratio;
    }
}

static void move(saga_flat *f, uint32_t to, uint32_t from)
{
    saga_splat_stats *const s = &f->stats;

    copy(&f->value, to, from);
    copy(&f->m, to, from);
    copy(&f->v, to, from);
    s->grad2d[to] = s->grad2d[from];
    s->weight[to] = s->weight[from];
    f->worth[to] = f->worth[from];
    s->seen[to] = s->seen[from];
}

void saga_flat_keep(saga_flat *f, const uint8_t *keep)
{
    uint32_t i, n = 0;

    for (i = 0; i < f->n; i++)
        if (keep[i]) {
            /* Primitives only move to lower indices, in order, so none is
             * overwritten before it has moved. */
            if (n != i)
                move(f, n, i);
            n++;
        }
    f->n = n;
}

void saga_flat_axes(real axes[3][3], const real *q)
{
    const real n = q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3];
    /* A quaternion of length 0 stands for no rotation. s = 2 / |q|^2 makes the
     * matrix a rotation for any length. Rows are the primitive's axes. */
    const real w = n > 0 ? q[0] : 1, x = q[1], y = q[2], z = q[3];
    const real s = n > 0 ? 2 / n : 2;
    const real m[3][3] = {
        { 1 - s * (y * y + z * z), s * (x * y + w * z), s * (x * z - w * y) },
        { s * (x * y - w * z), 1 - s * (x * x + z * z), s * (y * z + w * x) },
        { s * (x * z + w * y), s * (y * z - w * x), 1 - s * (x * x + y * y) }
    };

    memcpy(axes, m, sizeof m);
}

/* --- Pictures of it ------------------------------------------------------ */

static int most_mips(const saga_pictures *p)
{
    int widest = 0, mip = 0;

    for (int k = 0; k < p->n_train; k++) {
        const saga_source_view *const v = p->capture->views + p->train[k];

        widest = v->width > widest ? v->width : widest;
    }
    /* Pictures are halved while the widest view stays at least COARSEST_WIDTH
     * pixels wide. */
    while (mip < MAX_MIP && (widest >> mip) / 2 >= COARSEST_WIDTH)
        mip++;
    return mip;
}

int saga_flat_mip_at(const saga_flat *f, int iteration)
{
    const int mips = most_mips(f->pictures);
    const double coarse = (double)f->o.coarse * f->o.n_iterations;

    if (mips == 0 || iteration >= coarse)
        return 0;
    /* Starts with the smallest pictures; each size has an equal number of
     * iterations. */
    return mips - (int)(iteration * mips / coarse);
}

double saga_flat_work(const saga_pictures *p, const saga_flat_options *o,
                      int n_iterations)
{
    /* This part of an iteration's time follows the pixels: a picture of half
     * the width takes 0.39 and 0.40 of the time with 20,000 and 100,000
     * primitives at 1352x1014, and 0.4 by this. Placing all primitives takes as
     * long as this many iterations (130 with 12,000 at 676x507). */
    const double by_pixels = 0.8, births = 150;
    const int mips = most_mips(p);
    const double each = mips ? (double)o->coarse * o->n_iterations / mips : 0;
    const double growing = FLAT_GROW_END * o->n_iterations;
    double work = n_iterations, pixels = 1;

    /* The smallest pictures come first. */
    for (int mip = 1; mip <= mips; mip++) {
        const double before = each * (mips - mip);

        pixels /= 4;
        work -= by_pixels * (1 - pixels) *
                fmin(fmax(n_iterations - before, 0), each);
    }
    return work + (o->given ? 0 : births * fmin(n_iterations / growing, 1));
}

real saga_flat_rate(const saga_flat *f, int attr)
{
    const saga_flat_rule *const r = &f->rule[attr];
    const double k = (double)f->iteration / f->o.n_iterations;

    return (real)(r->rate * pow(r->rate_end / r->rate, k));
}

/* beta1, beta2, eps, and `most`, the limit of a gradient in root mean squares.
 * most is above 1 / sqrt(1 - beta2), so that it limits no gradient: a new
 * primitive starts without moments, and at first its gradients are far above
 * their root mean square. */
static const saga_adam adam = { R(0.9), R(0.995), R(1e-15), R(16) };

const saga_adam *saga_flat_adam(void)
{
    return &adam;
}

bool saga_flat_draw(saga_flat *f, saga_sample sample, saga_error *error)
{
    saga_pictures_aim(&f->canvas, f->pictures, sample);
    saga_pictures_truth(&f->canvas, f->pictures, sample);
    return f->gpu ? saga_gpu_draw(f->gpu, &f->canvas, &f->value, f->n, error)
                  : saga_splat_forward(&f->canvas, &f->value, f->n, error);
}
