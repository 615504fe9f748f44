/* SPDX-License-Identifier: MIT
 *
 * docs/arithmetic.md has the formulas of the projection, in integers; the
 * functions are those of decoder/project.c.
 */
#include "float_splats.h"

#define LOW_PASS 0.1f /* square pixels */
#define K 0.72134752f /* log2(e) / 2 */
#define BORDER 0.15f  /* of a side: slopes are not taken beyond */
#define LN2 0.69314718f
#define FARTHEST 32768.0f /* pixels of a mean from the middle */
#define REACH_2 16.0f     /* (standard deviations)^2: below 11 / K */

enum {
    LANES = 4,
    X = 0,
    QUAT = 3,
    SCALE = 7,
    Q0 = 10,
    N_FIELDS,       /* of saga_animated */
    MIDDLE = 32768, /* of a segment, in time */
    RUN = 64,       /* primitives that are animated together */
    DIGIT = 12,     /* bits that are sorted at a time: depths
                     * mostly differ by less than 2^24 */
    N_DIGITS = 1 << DIGIT
};

typedef float floats __attribute__((vector_size(4 * LANES)));
typedef int32_t ints __attribute__((vector_size(4 * LANES)));

typedef struct {
    int32_t middle[3]; /* the position at t = MIDDLE */
    uint16_t q15[3];
    uint16_t known; /* KEPT_* */
} colour;

typedef struct {
    uint32_t depth;
    uint32_t made; /* index in parts.made */
} key;

/* The memory for n primitives is divided into these parts. */
typedef struct {
    saga_splat *sorted;     /* (n) */
    saga_splat *made;       /* (n) in the order of primitives */
    colour *colours;        /* (n) of primitives */
    uint32_t *prim;         /* (n) of each that is made */
    uint32_t *list;         /* (n) of primitives whose colours are new */
    int32_t (*middle)[3];   /* (n) of these */
    key *keys, *other_keys; /* (n) */
    uint32_t *place;        /* (N_DIGITS) */
} parts;

/* A camera in pixels and box units. */
typedef struct {
    float w[9];
    float focal[2], principal[2], half[2], lo[2], hi[2];
    float near_plane; /* the smallest depth that rounds to it */
    const saga_camera *camera;
} lens;

/* These primitives are projected together. */
typedef struct {
    int32_t field[N_FIELDS][LANES];
    uint32_t prim[LANES];
    int n;
} batch;

/* The projection computes these values. */
typedef struct {
    floats v[3]; /* the camera's coordinates */
    floats mean[2], slope[2];
    floats t[2][3]; /* the ellipsoid's axes in pixels */
    floats g, n, h;
    ints out; /* -1: no splat */
} projected;

/* --- Vectors ------------------------------------------------------------- */

static inline floats to_floats(ints x)
{
    return __builtin_convertvector(x, floats);
}

static inline floats select(ints mask, floats a, floats b)
{
    return (floats)(((ints)a & mask) | ((ints)b & ~mask));
}

static inline floats lower(floats a, floats b)
{
    return select(a < b, a, b);
}

static inline floats higher(floats a, floats b)
{
    return select(a > b, a, b);
}

static inline floats size_of(floats x)
{
    return (floats)((ints)x & INT32_MAX);
}

static inline floats root(floats x)
{
    return (floats){ __builtin_sqrtf(x[0]), __builtin_sqrtf(x[1]),
                     __builtin_sqrtf(x[2]), __builtin_sqrtf(x[3]) };
}

static inline ints field(const batch *b, int k)
{
    ints x;

    __builtin_memcpy(&x, b->field[k], sizeof x);
    return x;
}

/* Returns 2^(x / 1024) with a relative error of 3e-6: a power of two times
 * Taylor's series of e^y for |y| <= ln(2) / 2. */
static inline floats exp2_q10(ints x)
{
    const ints whole = (x + 512) >> 10;
    const floats y = to_floats(x - (whole << 10)) * (LN2 / 1024.0f);
    const floats e =
        1.0f +
        y * (1.0f + y * (1.0f / 2 +
                         y * (1.0f / 6 + y * (1.0f / 24 + y * (1.0f / 120)))));

    return e * (floats)((whole + 127) << 23);
}

/* --- One batch ----------------------------------------------------------- */

static void look_through(lens *l, const saga_camera *c)
{
    int i;

    for (i = 0; i < 9; i++)
        l->w[i] = (float)c->rotation_q30[i] * 0x1p-30f;
    for (i = 0; i < 2; i++) {
        const float side = i ? c->height : c->width;

        l->focal[i] = (float)c->focal_q16[i] * 0x1p-16f;
        l->principal[i] = (float)c->principal_q16[i] * 0x1p-16f;
        l->half[i] = side / 2;
        l->lo[i] = -BORDER * side - l->principal[i];
        l->hi[i] = (1 + BORDER) * side - l->principal[i];
    }
    l->near_plane = (float)c->near_plane - 0.5f;
    l->camera = c;
}

static inline void project_centres(projected *p, const batch *b, const lens *l)
{
    floats d[3], ratio;
    int i;

    for (i = 0; i < 3; i++)
        d[i] = to_floats(field(b, X + i) - l->camera->centre[i]);
    for (i = 0; i < 3; i++)
        p->v[i] = l->w[3 * i] * d[0] + l->w[3 * i + 1] * d[1] +
                  l->w[3 * i + 2] * d[2];
    p->out = p->v[2] < l->near_plane;
    for (i = 0; i < 2; i++) {
        /* The bound itself is outside, but what is just below it may be rounded
         * to it. */
        p->out |= size_of(p->v[i]) > 8.0f * p->v[2];
        ratio = l->focal[i] * (p->v[i] / p->v[2]);
        p->mean[i] = l->principal[i] + ratio;
        p->out |= size_of(p->mean[i] - l->half[i]) > FARTHEST;
        p->slope[i] = higher(lower(ratio, (floats){ 0 } + l->hi[i]),
                             (floats){ 0 } + l->lo[i]);
    }
}

/* Computes the rotation's matrix. A quaternion of zeros is the identity. */
static inline void rotate(floats r[9], const batch *b)
{
    const floats w = to_floats(field(b, QUAT));
    const floats x = to_floats(field(b, QUAT + 1));
    const floats y = to_floats(field(b, QUAT + 2));
    const floats z = to_floats(field(b, QUAT + 3));
    const floats norm = w * w + x * x + y * y + z * z;
    const floats f = 2.0f / higher(norm, (floats){ 0 } + 1.0f);

    r[0] = 1.0f - f * (y * y + z * z);
    r[1] = f * (x * y - w * z);
    r[2] = f * (x * z + w * y);
    r[3] = f * (x * y + w * z);
    r[4] = 1.0f - f * (x * x + z * z);
    r[5] = f * (y * z - w * x);
    r[6] = f * (x * z - w * y);
    r[7] = f * (y * z + w * x);
    r[8] = 1.0f - f * (x * x + y * y);
}

/* Computes T = J W R S, where J is the Jacobian of the projection. */
static inline void project_axes(projected *p, const batch *b, const lens *l)
{
    const floats recip = 1.0f / p->v[2];
    floats r[9], u[3];
    int i, k;

    rotate(r, b);
    for (i = 0; i < 2; i++) {
        for (k = 0; k < 3; k++)
            u[k] = (l->focal[i] * l->w[3 * i + k] - p->slope[i] * l->w[6 + k]) *
                   recip;
        for (k = 0; k < 3; k++)
            p->t[i][k] = (u[0] * r[k] + u[1] * r[3 + k] + u[2] * r[6 + k]) *
                         exp2_q10(field(b, SCALE + k));
    }
}

/* Computes the conic of (A B; B C) = T T^t + d I, whose determinant is
 * |t0 x t1|^2 + d (A0 + C0) + d^2, and finds splats beyond the picture. */
static inline void find_conics(projected *p, const lens *l)
{
    const floats *const s = p->t[0];
    const floats *const t = p->t[1];
    const floats x = s[1] * t[2] - s[2] * t[1];
    const floats y = s[2] * t[0] - s[0] * t[2];
    const floats z = s[0] * t[1] - s[1] * t[0];
    const floats a0 = s[0] * s[0] + s[1] * s[1] + s[2] * s[2];
    const floats c0 = t[0] * t[0] + t[1] * t[1] + t[2] * t[2];
    const floats b = s[0] * t[0] + s[1] * t[1] + s[2] * t[2];
    const floats a[2] = { a0 + LOW_PASS, c0 + LOW_PASS };
    const floats det = x * x + y * y + z * z + LOW_PASS * (a0 + c0) +
                       LOW_PASS * LOW_PASS;
    int i;

    p->h = root(K / a[1]);
    p->g = a[1] * (p->h * root(1.0f / det));
    p->n = b * (p->h * root(1.0f / det));
    for (i = 0; i < 2; i++) {
        const floats beyond = higher(
            size_of(p->mean[i] - l->half[i]) - l->half[i], (floats){ 0 });

        p->out |= beyond * beyond > REACH_2 * a[i];
    }
}

/* Rounds to the nearest integer; gives 0 where there is no splat, since x may
 * be anything there. */
static inline ints nearest(ints out, floats x)
{
    const floats half = select(x < 0.0f, (floats){ 0 } - 0.5f,
                               (floats){ 0 } + 0.5f);

    return __builtin_convertvector(select(out, (floats){ 0 }, x + half), ints);
}

/* Returns the depth as saga_view computes it. With depths in floats, splats of
 * nearly equal depth would change places. */
static uint32_t depth_of(const batch *b, int lane, const saga_camera *c)
{
    int64_t z = (int64_t)1 << 29;
    int i;

    for (i = 0; i < 3; i++)
        z += (int64_t)c->rotation_q30[6 + i] *
             (b->field[X + i][lane] - c->centre[i]);
    return (uint32_t)(z >> 30);
}

/* Projects a batch to made[n..]; returns the number of splats then. */
static uint32_t project(const parts *m, uint32_t n, batch *b, const lens *l)
{
    projected p;
    ints mean[2], chol[3];
    int i;

    project_centres(&p, b, l);
    project_axes(&p, b, l);
    find_conics(&p, l);
    mean[0] = nearest(p.out, p.mean[0] * 256.0f);
    mean[1] = nearest(p.out, p.mean[1] * 256.0f);
    /* The factors of a splat are below 2.7. */
    chol[0] = nearest(p.out, p.g * 0x1p28f);
    chol[1] = nearest(p.out, p.n * 0x1p28f);
    chol[2] = nearest(p.out, p.h * 0x1p28f);
    for (i = 0; i < b->n; i++) {
        saga_splat *const to = m->made + n;

        if (p.out[i])
            continue;
        to->mean_q8[0] = mean[0][i];
        to->mean_q8[1] = mean[1][i];
        to->chol_q28[0] = chol[0][i];
        to->chol_q28[1] = chol[1][i];
        to->chol_q28[2] = chol[2][i];
        to->q0_q20 = b->field[Q0][i];
        to->depth = depth_of(b, i, l->camera);
        m->prim[n++] = b->prim[i];
    }
    b->n = 0;
    return n;
}

/* --- All ----------------------------------------------------------------- */

static void add(batch *b, const saga_visible *visible)
{
    const saga_animated *const from = &visible->at;
    const int n = b->n++;
    int k;

    for (k = 0; k < 3; k++) {
        b->field[X + k][n] = from->x[k];
        b->field[SCALE + k][n] = from->log2_scale_q10[k];
    }
    for (k = 0; k < 4; k++)
        b->field[QUAT + k][n] = from->quat[k];
    b->field[Q0][n] = from->q0_q20;
    b->prim[n] = visible->index;
}

static int32_t make(const parts *m, const saga_decoder *dec, uint32_t n,
                    const lens *l, int32_t t)
{
    uint32_t n_made = 0, first, n_visible, i;
    saga_visible visible[RUN];
    batch b = { .n = 0 };

    for (first = 0; first < n; first += RUN) {
        if (saga_visible_at(visible, &n_visible, dec, first,
                            n - first < RUN ? n - first : RUN, t))
            return -1;
        for (i = 0; i < n_visible; i++) {
            add(&b, visible + i);
            if (b.n == LANES)
                n_made = project(m, n_made, &b, l);
        }
    }
    return (int32_t)project(m, n_made, &b, l);
}

static int find_middle(int32_t x[3], const saga_decoder *dec, uint32_t prim)
{
    saga_animated a;
    int k;

    if (saga_primitive_at(&a, dec, prim, MIDDLE))
        return 0;
    for (k = 0; k < 3; k++)
        x[k] = a.x[k];
    return 1;
}

/* Sets the colours, of which it computes those that are not known yet. Returns
 * 0 if that is refused. */
static int find_colours(const parts *m, saga_decoder *dec, uint32_t n,
                        const int32_t *from)
{
    uint32_t n_new = 0, i;
    int k;

    /* Lists the primitives whose colours are not kept, with their middles. */
    for (i = 0; i < n; i++) {
        colour *const c = m->colours + m->prim[i];

        if (c->known == KEPT_COLOURS)
            continue;
        if (c->known == KEPT_NOTHING &&
            !find_middle(c->middle, dec, m->prim[i]))
            return 0;
        for (k = 0; k < 3; k++)
            m->middle[n_new][k] = c->middle[k];
        m->list[n_new++] = m->prim[i];
    }
    /* Computes these together, and keeps them. */
    if (saga_colours_at(m->sorted, dec, m->list, n_new, from,
                        (const int32_t(*)[3])m->middle))
        return 0;
    for (i = 0; i < n_new; i++) {
        colour *const c = m->colours + m->list[i];

        for (k = 0; k < 3; k++)
            c->q15[k] = m->sorted[i].colour_q15[k];
        c->known = KEPT_COLOURS;
    }
    for (i = 0; i < n; i++)
        for (k = 0; k < 3; k++)
            m->made[i].colour_q15[k] = m->colours[m->prim[i]].q15[k];
    return 1;
}

/* Sorts m->keys by DIGIT bits of their depths. */
static void sort_digit(parts *m, uint32_t n, uint32_t least, int shift)
{
    key *const from = m->keys, *const to = m->other_keys;
    uint32_t sum = 0, i;

    for (i = 0; i < N_DIGITS; i++)
        m->place[i] = 0;
    for (i = 0; i < n; i++)
        m->place[(from[i].depth - least) >> shift & (N_DIGITS - 1)]++;
    for (i = 0; i < N_DIGITS; i++) {
        const uint32_t count = m->place[i];

        m->place[i] = sum;
        sum += count;
    }
    for (i = 0; i < n; i++)
        to[m->place[(from[i].depth - least) >> shift & (N_DIGITS - 1)]++] =
            from[i];
    m->keys = to;
    m->other_keys = from;
}

/* Sorts by depth, then by primitive, as saga_view does. */
static void sort(parts *m, uint32_t n)
{
    uint32_t least = UINT32_MAX, most = 0, i;
    int shift;

    for (i = 0; i < n; i++) {
        const uint32_t depth = m->made[i].depth;

        least = depth < least ? depth : least;
        most = depth > most ? depth : most;
        m->keys[i].depth = depth;
        m->keys[i].made = i;
    }
    for (shift = 0; shift < 32 && n && (most - least) >> shift; shift += DIGIT)
        sort_digit(m, n, least, shift);
    for (i = 0; i < n; i++)
        m->sorted[i] = m->made[m->keys[i].made];
}

/* Forgets what is not kept of n primitives. */
static void forget(const parts *m, uint32_t n, kept_splats kept)
{
    uint32_t i;

    for (i = 0; i < n; i++)
        if (m->colours[i].known > kept)
            m->colours[i].known = (uint16_t)kept;
}

uint64_t float_splats_nbytes(uint32_t n)
{
    return n * (uint64_t)(2 * sizeof(saga_splat) + sizeof(colour) +
                          2 * sizeof(key) + 20) +
           4 * N_DIGITS;
}

int32_t float_splats(void *memory, saga_decoder *dec, uint32_t n,
                     const saga_camera *camera, int32_t t, kept_splats kept)
{
    parts m;
    lens l;
    int32_t n_made;

    /* The parts follow each other without gaps: the size of each element is a
     * multiple of 4, which is the alignment of all. */
    m.sorted = memory;
    m.made = m.sorted + n;
    m.colours = (colour *)(void *)(m.made + n);
    m.prim = (uint32_t *)(void *)(m.colours + n);
    m.list = m.prim + n;
    m.middle = (int32_t(*)[3])(void *)(m.list + n);
    m.keys = (key *)(void *)(m.middle + n);
    m.other_keys = m.keys + n;
    m.place = (uint32_t *)(void *)(m.other_keys + n);
    if (kept != KEPT_COLOURS)
        forget(&m, n, kept);
    look_through(&l, camera);
    n_made = make(&m, dec, n, &l, t);
    if (n_made < 0 || !find_colours(&m, dec, (uint32_t)n_made, camera->centre))
        return -1;
    sort(&m, (uint32_t)n_made);
    return n_made;
}
