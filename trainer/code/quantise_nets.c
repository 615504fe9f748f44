/* SPDX-License-Identifier: MIT */
/* Symbols of the networks, which are quantised before the closed loop. */
#include "quantise.h"

#include "alloc.h"
#include "cost.h"
#include "fx.h"
#include "prob.h"

#include <limits.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

static const char out_of_what[] = "symbols of the networks";

static int finer_of(const saga_layer_values *v, uint32_t k)
{
    return k < v->n_finer ? v->finer[k] : 0;
}

/* Returns the integer weight for symbol q of input k. */
static int64_t weight_of(const saga_layer_symbols *s,
                         const saga_layer_values *v, int32_t q, uint32_t k)
{
    return fx_rshift64((int64_t)q * s->step_q16,
                       s->step_shift + finer_of(v, k));
}

/* Returns the largest symbol of input k whose integer weight is at most limit:
 * the weight is q step_q16 / 2^shift, rounded. */
static double most_symbol(const saga_layer_symbols *s,
                          const saga_layer_values *v, uint32_t k, int limit)
{
    const double q = floor(ldexp(limit, s->step_shift + finer_of(v, k)) /
                           s->step_q16);

    return fmin(q, SAGA_MAX_RESIDUAL);
}

/* Sets the symbols of a row whose weights have the scale 2^e. Values that are
 * too large for the format become the largest that fit if `cut` is set, and
 * make the row invalid otherwise. Returns 1 if the row is valid. */
static int set_row(saga_layer_symbols *out, const saga_layer_values *v,
                   uint32_t row, int e, bool cut)
{
    /* An integer weight is q step_q16 / 2^step_shift in Q e; `step` is the real
     * value of one q. The sum has the Q format of input times weight, e + q_in,
     * and so has the bias, apart from bias_shift. */
    const double step = ldexp(out->step_q16, -out->step_shift - e);
    double bias = floor(
        ldexp((double)v->bias[row], e + v->q_in - out->bias_shift) + 0.5);
    const size_t at = (size_t)row * v->n_in;
    const int32_t limit = v->int8 ? 127 : 32767;
    int64_t sum = 0;
    uint32_t k;

    /* The shift converts from the format of the sum to that of the output. */
    out->shift[row] = (uint8_t)(e + v->q_in - v->q_out[row]);
    if (cut)
        bias = fmin(fmax(bias, -SAGA_MAX_RESIDUAL), SAGA_MAX_RESIDUAL);
    if (fabs(bias) > SAGA_MAX_RESIDUAL)
        return 0;
    out->bias[row] = (int32_t)bias;
    for (k = 0; k < v->n_in; k++) {
        double q = floor((double)v->weight[at + k] / step + 0.5);
        int64_t w;

        if (cut) {
            const double most = most_symbol(out, v, k, limit);

            q = fmin(fmax(q, -most), most);
        }
        if (fabs(q) > SAGA_MAX_RESIDUAL)
            return 0;
        /* The limit is for the decoder's integer weight, which has fewer bits
         * for a finer input. */
        w = llabs(weight_of(out, v, (int32_t)q, k));
        if (w > limit)
            return 0;
        out->weight[at + k] = (int32_t)q;
        sum += w;
    }
    return saga_mlp_row_is_valid(
        sum, (int64_t)bias * ((int64_t)1 << out->bias_shift), out->shift[row]);
}

/* Returns the exponent nearest to the wanted one at which the row's shift, q_in
 * + exponent - q_out, is in 0..24. */
static int row_exponent(const saga_layer_values *v, uint32_t row, int wanted)
{
    const int least = (int)v->q_out[row] - v->q_in;

    return fx_clamp(wanted, least, least + 24);
}

/* Returns the largest scale that the shifts of all rows allow. A row with a
 * smaller scale than the others would have larger steps. */
static int most_exponent(const saga_layer_values *v)
{
    int most = INT_MAX;
    uint32_t row;

    for (row = 0; row < v->n_out; row++)
        most = fx_min(most, row_exponent(v, row, INT_MAX));
    return most;
}

/* Sets the fields of the steps for weights of scale 2^e. The step of weights
 * gets as many digits as fit. */
static void set_steps(saga_layer_symbols *out, const saga_layer_values *v,
                      int e)
{
    const double step = ldexp((double)v->step, e);
    int size;

    /* Shifting by 16 - size gives step_q16 its full 16 bits. */
    frexp(step, &size); /* step < 2^size */
    out->step_shift = (uint8_t)fx_clamp(16 - size, 0, 31);
    out->step_q16 = (uint32_t)fmin(
        fmax(floor(ldexp(step, out->step_shift) + 0.5), 1), 65535);
    out->bias_shift = (uint8_t)fx_clamp(
        ilogb((double)v->bias_step) + v->q_in + e, 0, 31);
}

/* Sets all rows at the scale 2^e, or the nearest that their shifts allow.
 * Returns 0 if a row is not valid. */
static int try_layer(saga_layer_symbols *out, const saga_layer_values *v, int e)
{
    uint32_t row;

    set_steps(out, v, e);
    for (row = 0; row < v->n_out; row++)
        if (!set_row(out, v, row, row_exponent(v, row, e), false))
            return 0;
    return 1;
}

/* Sets all rows at the scale 2^e. The scale of a row that is not valid there is
 * halved, which doubles its steps, until it is. A shift cannot be negative: at
 * its last scale a row is cut to what fits. Returns false with *error set if
 * even then the sum of a row may overflow. */
static bool force_layer(saga_layer_symbols *out, const saga_layer_values *v,
                        int e, saga_error *error)
{
    uint32_t row;

    set_steps(out, v, e);
    for (row = 0; row < v->n_out; row++) {
        const int least = (int)v->q_out[row] - v->q_in;
        int k = row_exponent(v, row, e);

        while (!set_row(out, v, row, k, k == least))
            if (--k < least)
                return saga_fail(error, NULL,
                                 "try another --seed, and report this error",
                                 "row %u of layer %d of network %d is too "
                                 "large to be coded",
                                 (unsigned)row, v->layer, v->net);
    }
    return true;
}

/* Bits of residuals that share a scale, for each scale. */
typedef struct {
    double at[SAGA_N_SCALES];
} scale_bits;

static void add_bits(scale_bits *b, const scale_bits *more)
{
    uint32_t i;

    for (i = 0; i < SAGA_N_SCALES; i++)
        b->at[i] += more->at[i];
}

static scale_bits residual_bits(int32_t q)
{
    scale_bits b;
    uint32_t i;

    for (i = 0; i < SAGA_N_SCALES; i++)
        b.at[i] = saga_cost_residual(q, i);
    return b;
}

/* A table of the bits of residuals -SMALL .. SMALL, which occur many times in a
 * layer and take long to compute. */
enum { SMALL = 63 };

typedef struct {
    bool known[2 * SMALL + 1];
    scale_bits bits[2 * SMALL + 1];
} small_bits;

static scale_bits remembered_bits(small_bits *s, int32_t q)
{
    if (q < -SMALL || q > SMALL)
        return residual_bits(q);
    if (!s->known[q + SMALL])
        s->bits[q + SMALL] = residual_bits(q);
    s->known[q + SMALL] = true;
    return s->bits[q + SMALL];
}

static uint8_t least_scale(const scale_bits *b)
{
    int best = 0, i;

    for (i = 1; i < SAGA_N_SCALES; i++)
        if (b->at[i] < b->at[best])
            best = i;
    return (uint8_t)best;
}

static uint8_t bias_scale(const int32_t *q, uint32_t n)
{
    scale_bits b = { { 0 } };
    uint32_t i;

    for (i = 0; i < n; i++) {
        const scale_bits one = residual_bits(q[i]);

        add_bits(&b, &one);
    }
    return least_scale(&b);
}

/* The scales of a layer's weights, and the bits with them. */
typedef struct {
    double bits;
    uint8_t mode, scale, drop[SAGA_MAX_VECTOR];
} layer_scales;

/* Returns the best drop of each line (row or column) from a given scale. */
static layer_scales drop_from(uint8_t scale, uint32_t mode,
                              const scale_bits *line, uint32_t n)
{
    layer_scales s = {
        (double)SAGA_QUANTISE_LINE_BITS * n, (uint8_t)mode, scale, { 0 }
    };
    uint32_t i;
    uint8_t d;

    for (i = 0; i < n; i++) {
        const double *const at = line[i].at;

        for (d = 1; d < SAGA_N_DROPS && d * SAGA_DROP <= scale; d++)
            if (at[scale - d * SAGA_DROP] < at[scale - s.drop[i] * SAGA_DROP])
                s.drop[i] = d;
        s.bits += at[scale - s.drop[i] * SAGA_DROP];
    }
    return s;
}

/* Replaces *best if a scale for each line takes fewer bits. The layer's scale
 * is within one drop of the highest. */
static void try_lines(layer_scales *best, uint32_t mode, const scale_bits *line,
                      uint32_t n)
{
    int top = 0, scale;
    uint32_t i;

    for (i = 0; i < n; i++)
        top = fx_max(top, least_scale(&line[i]));
    for (scale = fx_max(top - SAGA_DROP + 1, 0); scale <= top; scale++) {
        const layer_scales s = drop_from((uint8_t)scale, mode, line, n);

        if (s.bits < best->bits)
            *best = s;
    }
}

/* Finds the scales that take the fewest bits for residuals q (rows,
 * columns). */
static bool least_scales(layer_scales *best, const int32_t *q, uint32_t rows,
                         uint32_t columns, saga_error *error)
{
    scale_bits *const row = saga_calloc(rows + columns, sizeof *row,
                                        out_of_what, error);
    scale_bits *column, all = { { 0 } };
    small_bits small = { .known = { false } };
    uint32_t i, k;

    if (!row)
        return false;
    column = row + rows;
    for (i = 0; i < rows; i++)
        for (k = 0; k < columns; k++) {
            /* A residual counts for its row and for its column. */
            const scale_bits one = remembered_bits(&small,
                                                   q[(size_t)i * columns + k]);

            add_bits(&row[i], &one);
            add_bits(&column[k], &one);
        }
    for (i = 0; i < rows; i++)
        add_bits(&all, &row[i]);
    best->mode = SAGA_SCALE_TENSOR;
    best->scale = least_scale(&all);
    best->bits = all.at[best->scale];
    try_lines(best, SAGA_SCALE_ROW, row, rows);
    try_lines(best, SAGA_SCALE_COLUMN, column, columns);
    free(row);
    return true;
}

static bool set_scales(saga_layer_symbols *out, uint32_t rows, uint32_t columns,
                       saga_error *error)
{
    layer_scales s;
    uint32_t n;

    if (!least_scales(&s, out->weight, rows, columns, error))
        return false;
    n = saga_scale_lines(s.mode, columns, rows);
    out->weight_scale = s.scale;
    out->scale_mode = s.mode;
    out->drop = saga_alloc(n, 1, out_of_what, error);
    if (!out->drop)
        return false;
    memcpy(out->drop, s.drop, n);
    out->bias_scale = bias_scale(out->bias, rows);
    return true;
}

bool saga_quantise_bits(double *bits, const real *w, size_t rows,
                        size_t columns, double step, saga_error *error)
{
    int32_t *const q = saga_alloc(rows * columns, sizeof *q, out_of_what,
                                  error);
    layer_scales s;
    bool ok;
    size_t i;

    if (!q)
        return false;
    for (i = 0; i < rows * columns; i++)
        q[i] = (int32_t)lrint((double)w[i] / step);
    ok = least_scales(&s, q, (uint32_t)rows, (uint32_t)columns, error);
    free(q);
    if (ok)
        *bits = s.bits;
    return ok;
}

bool saga_quantise_layer(saga_layer_symbols *out, const saga_layer_values *v,
                         saga_error *error)
{
    /* `unit` is the scale at which a step is 1 to 2 units; 15 more are the
     * limit of 16-bit weights. */
    const int unit = (int)ceil(-log2((double)v->step));
    int e = fx_min(unit + 15, most_exponent(v));

    out->weight = saga_calloc((size_t)v->n_in * v->n_out, sizeof *out->weight,
                              out_of_what, error);
    out->bias = saga_calloc(v->n_out, sizeof *out->bias, out_of_what, error);
    out->shift = saga_calloc(v->n_out, 1, out_of_what, error);
    if (!out->weight || !out->bias || !out->shift)
        return false;
    /* The scale is reduced from the largest until all rows are valid. The
     * larger the integers, the closer they are to multiples of the step. */
    while (e > unit && !try_layer(out, v, e))
        e--;
    return (e > unit || force_layer(out, v, unit, error)) &&
           set_scales(out, v->n_out, v->n_in, error);
}

void saga_dequantise_layer(real *weight, real *bias,
                           const saga_layer_symbols *s,
                           const saga_layer_values *v)
{
    uint32_t row, k;

    for (row = 0; row < v->n_out; row++) {
        /* e is the exponent that set_row had, computed from the shift. */
        const int e = (int)s->shift[row] + v->q_out[row] - v->q_in;
        const size_t at = (size_t)row * v->n_in;

        for (k = 0; k < v->n_in; k++)
            weight[at + k] = (real)ldexp(
                (double)weight_of(s, v, s->weight[at + k], k),
                finer_of(v, k) - e);
        bias[row] = (real)ldexp(s->bias[row], s->bias_shift - e - v->q_in);
    }
}
