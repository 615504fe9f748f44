/* SPDX-License-Identifier: MIT
 *
 * The decoder's operators in floating point, written without regard to number
 * formats. bench_numerics.c includes this file twice, with REAL as float and as
 * double. NAME(x) gives the functions their names, MATH(f) is the function of
 * math.h.
 */

static inline void NAME(dense)(data *d)
{
    for (int p = 0; p < POINTS; p++) {
        REAL *const y = d->NAME(y) + p * WIDTH;

        for (int row = 0; row < WIDTH; row++)
            y[row] = d->NAME(bias)[row];
        for (int k = 0; k < WIDTH; k++)
            for (int row = 0; row < WIDTH; row++)
                y[row] += d->NAME(weight)[k * WIDTH + row] *
                          d->NAME(x)[p * WIDTH + k];
        for (int row = 0; row < WIDTH; row++)
            y[row] = y[row] < 0 ? 0 : y[row];
    }
}

/* Finds the K nearest anchors in the window, in ascending order, by insertion.
 * Returns their number. */
static int NAME(nearest)(REAL *dist, int *rank, const data *d, int q)
{
    const int first = q > WINDOW ? q - WINDOW : 0;
    const int last = q + WINDOW < ANCHORS ? q + WINDOW : ANCHORS - 1;
    int n = 0;

    for (int b = first; b <= last; b++) {
        REAL sum = 0;
        int i;

        for (i = 0; i < 4; i++) {
            const REAL u = (d->NAME(query)[q][i] - d->NAME(place)[b][i]) /
                           (2 * d->NAME(size)[i]);

            sum += u * u;
        }
        if (n < NEIGHBOURS)
            n++;
        else if (dist[n - 1] <= sum)
            continue;
        for (i = n - 1; i > 0 && dist[i - 1] > sum; i--) {
            dist[i] = dist[i - 1];
            rank[i] = rank[i - 1];
        }
        dist[i] = sum;
        rank[i] = b;
    }
    return n;
}

static void NAME(interpolate)(data *d)
{
    for (int q = 0; q < ANCHORS; q++) {
        REAL *const y = d->NAME(y) + q * FEATURES;
        REAL w[NEIGHBOURS], sum = 0;
        int rank[NEIGHBOURS];
        const int n = NAME(nearest)(w, rank, d, q);
        const REAL least = w[0];

        for (int k = 0; k < n; k++) {
            w[k] = MATH(exp2)((least - w[k]) * (REAL)SOFTMAX_Q8 / 256);
            sum += w[k];
        }
        for (int i = 0; i < FEATURES; i++)
            y[i] = 0;
        for (int k = 0; k < n; k++)
            for (int i = 0; i < FEATURES; i++)
                y[i] += w[k] / sum * d->NAME(feature)[rank[k] * FEATURES + i];
    }
}

static void NAME(softmax_of)(REAL *y, const REAL *x, int n)
{
    REAL most = x[0], sum = 0;

    for (int i = 1; i < n; i++)
        most = x[i] > most ? x[i] : most;
    for (int i = 0; i < n; i++) {
        y[i] = MATH(exp2)(x[i] - most);
        sum += y[i];
    }
    for (int i = 0; i < n; i++)
        y[i] /= sum;
}

static void NAME(softmax)(data *d)
{
    for (int i = 0; i < VALUES; i += SLOTS)
        NAME(softmax_of)(d->NAME(y) + i, d->NAME(x) + i, SLOTS);
}

static void NAME(exp2)(data *d)
{
    for (int i = 0; i < VALUES; i++)
        d->NAME(y)[i] = MATH(exp2)(-d->NAME(x)[i]);
}

static void NAME(sine)(data *d)
{
    for (int i = 0; i < VALUES; i++)
        d->NAME(y)[i] = MATH(sin)((REAL)6.283185307179586 * d->NAME(x)[i]);
}

static void NAME(softplus)(data *d)
{
    for (int i = 0; i < VALUES; i++)
        d->NAME(y)[i] = MATH(log2)(1 + MATH(exp2)(d->NAME(x)[i]));
}

static void NAME(sigmoid)(data *d)
{
    for (int i = 0; i < VALUES; i++)
        d->NAME(y)[i] = 1 / (1 + MATH(exp)(-d->NAME(x)[i]));
}

static void NAME(reciprocal)(data *d)
{
    for (int i = 0; i < VALUES; i++)
        d->NAME(y)[i] = 1 / d->NAME(x)[i];
}

static void NAME(root)(data *d)
{
    for (int i = 0; i < VALUES; i++)
        d->NAME(y)[i] = 1 / MATH(sqrt)(d->NAME(x)[i]);
}

static void NAME(embed)(data *d)
{
    for (int p = 0; p < POINTS; p++)
        for (int i = 0; i < 4; i++)
            for (int k = 0; k < OCTAVES; k++) {
                REAL *const y = d->NAME(y) + 8 * OCTAVES * p + 2 * OCTAVES * i +
                                2 * k;
                const REAL turn = d->NAME(where)[p][i] * (REAL)(1 << k) *
                                  (REAL)6.283185307179586;

                y[0] = MATH(sin)(turn);
                y[1] = MATH(cos)(turn);
            }
}

static REAL NAME(dot)(const REAL *a, const REAL *b, int n)
{
    REAL sum = 0;

    for (int i = 0; i < n; i++)
        sum += a[i] * b[i];
    return sum;
}

static void NAME(bank_read)(data *d)
{
    REAL w[SLOTS];

    for (int q = 0; q < QUERIES; q++) {
        REAL *const y = d->NAME(y) + q * SLOTS;

        for (int p = 0; p < SLOTS; p++)
            w[p] = NAME(dot)(d->NAME(x) + q * SLOTS, d->NAME(start) + p * SLOTS,
                             SLOTS);
        NAME(softmax_of)(w, w, SLOTS);
        for (int i = 0; i < SLOTS; i++)
            y[i] = 0;
        for (int p = 0; p < SLOTS; p++)
            for (int i = 0; i < SLOTS; i++)
                y[i] += w[p] * d->NAME(start)[p * SLOTS + i];
    }
}

static void NAME(bank_write)(data *d)
{
    memcpy(d->NAME(y), d->NAME(start), SLOTS * SLOTS * sizeof(REAL));
    for (int p = 0; p < SLOTS; p++) {
        REAL *const s = d->NAME(y) + p * SLOTS;
        const REAL *const v = d->NAME(x) + p * SLOTS;
        const REAL gate = (REAL)(p + 1) / SLOTS;
        const REAL along = NAME(dot)(s, v, SLOTS);
        REAL scale;

        for (int i = 0; i < SLOTS; i++)
            s[i] += gate * (v[i] - along * s[i]);
        scale = 1 / MATH(sqrt)(NAME(dot)(s, s, SLOTS));
        for (int i = 0; i < SLOTS; i++)
            s[i] *= scale;
    }
}

static REAL NAME(clamped)(REAL x, REAL lo, REAL hi)
{
    return x < lo ? lo : x > hi ? hi : x;
}

static void NAME(animate)(data *d)
{
    for (int p = 0; p < PRIMS; p++) {
        const NAME(prim) *const a = &d->NAME(still)[p];
        NAME(prim) *const b = &d->NAME(moved)[p];
        const REAL dt = (REAL)0.5 - a->t_centre;
        const REAL width = MATH(exp2)(a->log2_width);
        const REAL u = dt / width;
        const REAL age = NAME(clamped)(
            dt / (width < (REAL)0.5 ? width : (REAL)0.5), -4, 4);

        for (int i = 0; i < 3; i++) {
            b->mean[i] = a->mean[i] +
                         a->support[i] * age *
                             (a->motion[i] + age * (a->motion[3 + i] +
                                                    age * a->motion[6 + i]));
            b->scale[i] = MATH(exp2)(a->log2_scale[i]);
        }
        for (int i = 0; i < 4; i++)
            b->quat[i] = a->quat[i] + a->slope[i] * age;
        b->q0 = MATH(log2)(1 + MATH(exp2)(SAGA_PEAK_LOG2 - a->opacity)) +
                (REAL)1.4426950408889634 * NAME(clamped)(u * u, 0, 256);
    }
}

/* Sets t to the rows of the Jacobian times rotation times scales. */
static void NAME(map)(REAL t[2][3], const NAME(prim) * p, const REAL slope[2],
                      REAL z)
{
    const REAL f = WIDE / z;
    const REAL w = p->quat[0], x = p->quat[1], y = p->quat[2];
    const REAL v = p->quat[3], n = 1 / (w * w + x * x + y * y + v * v);
    const REAL r[3][3] = { { w * w + x * x - y * y - v * v, 2 * (x * y - w * v),
                             2 * (x * v + w * y) },
                           { 2 * (x * y + w * v), w * w - x * x + y * y - v * v,
                             2 * (y * v - w * x) },
                           { 2 * (x * v - w * y), 2 * (y * v + w * x),
                             w * w - x * x - y * y + v * v } };

    for (int i = 0; i < 2; i++)
        for (int k = 0; k < 3; k++)
            t[i][k] = f * (r[i][k] - slope[i] * r[2][k]) * p->scale[k] * n;
}

/* Projects for a camera at the origin that looks along z. Positions are in box
 * units. */
static void NAME(project)(data *d)
{
    for (int p = 0; p < PRIMS; p++) {
        const NAME(prim) *const a = &d->NAME(moved)[p];
        const REAL z = a->mean[2], half[2] = { WIDE / (REAL)2, HIGH / (REAL)2 };
        const REAL k = (REAL)(1.4426950408889634 / 2), pass = (REAL)0.1;
        REAL slope[2], t[2][3], aa, ab, bb, c, det;
        NAME(splat) *const s = &d->NAME(splats)[p];

        for (int i = 0; i < 2; i++) {
            slope[i] = a->mean[i] / z;
            s->mean[i] = half[i] + WIDE * slope[i];
            slope[i] = NAME(clamped)(slope[i], -half[i] * (REAL)1.3 / WIDE,
                                     half[i] * (REAL)1.3 / WIDE);
        }
        /* The covariance is widened by the low-pass before the conic is
         * factored. */
        NAME(map)(t, a, slope, z);
        aa = NAME(dot)(t[0], t[0], 3) + pass;
        ab = NAME(dot)(t[0], t[1], 3);
        bb = NAME(dot)(t[1], t[1], 3) + pass;
        det = aa * bb - ab * ab;
        c = MATH(sqrt)(k / bb);
        s->chol[2] = c;
        s->chol[0] = MATH(sqrt)(k * bb / det);
        s->chol[1] = s->chol[0] * ab / bb;
        s->q0 = a->q0;
    }
}

static void NAME(make_splats)(data *d)
{
    NAME(animate)(d);
    NAME(project)(d);
}

static void NAME(alpha)(data *d)
{
    for (int i = 0; i < VALUES; i++) {
        const REAL a = MATH(exp2)(SAGA_PEAK_LOG2 - d->NAME(x)[i]);

        d->NAME(y)[i] = a < (REAL)0.99 ? a : (REAL)0.99;
    }
}

/* Blends splat by splat over its box. The plane of T comes first, then those of
 * the three colours. */
static void NAME(blend)(data *d)
{
    REAL *const t = d->NAME(plane), *const rgb = t + PIXELS;

    for (int i = 0; i < PIXELS; i++)
        t[i] = 1;
    for (int i = 0; i < 3 * PIXELS; i++)
        rgb[i] = 0;
    for (uint32_t k = 0; k < d->n_splats; k++) {
        const saga_splat *const box = &d->splats[d->sorted[k].index];
        const NAME(splat) *const s = &d->NAME(drawn)[d->sorted[k].index];

        for (int y = box->y0; y < box->y1; y++)
            for (int x = box->x0; x < box->x1; x++) {
                const int at = y * WIDE + x;
                const REAL dx = (REAL)x + (REAL)0.5 - s->mean[0];
                const REAL dy = (REAL)y + (REAL)0.5 - s->mean[1];
                const REAL v = s->chol[0] * dx - s->chol[1] * dy;
                const REAL w = s->chol[2] * dy;
                const REAL q = s->q0 + v * v + w * w;
                REAL a;

                if (q >= SAGA_CUT_LOG2 || t[at] < (REAL)(8 / 65536.0))
                    continue;
                a = MATH(exp2)(SAGA_PEAK_LOG2 - q);
                a = (a < (REAL)0.99 ? a : (REAL)0.99) * t[at];
                rgb[at] += a * s->colour[0];
                rgb[PIXELS + at] += a * s->colour[1];
                rgb[2 * PIXELS + at] += a * s->colour[2];
                t[at] -= a;
            }
    }
}
