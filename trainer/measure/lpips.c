/* SPDX-License-Identifier: MIT */
#include "lpips.h"

#include "alloc.h"
#include "conv.h"
#include "npz.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <zlib.h>

/* --- What the nets look like --------------------------------------------- */

typedef enum {
    CONV, /* followed by ReLU */
    FIRE, /* 1x1, then 1x1 and 3x3 in parallel */
    POOL,
    TAP, /* the two pictures are compared here */
    END
} kind;

typedef struct {
    kind kind;
    const char *name; /* name of its weights in the file */
    int size, stride, pad;
} step;

static const step alex[] = { { CONV, "conv1", 11, 4, 2 },
                             { .kind = TAP },
                             { POOL, NULL, 3, 2, 0 },
                             { CONV, "conv2", 5, 1, 2 },
                             { .kind = TAP },
                             { POOL, NULL, 3, 2, 0 },
                             { CONV, "conv3", 3, 1, 1 },
                             { .kind = TAP },
                             { CONV, "conv4", 3, 1, 1 },
                             { .kind = TAP },
                             { CONV, "conv5", 3, 1, 1 },
                             { .kind = TAP },
                             { .kind = END } };

static const step squeeze[] = { { CONV, "0", 3, 2, 0 },
                                { .kind = TAP },
                                { POOL, NULL, 3, 2, 0 },
                                { .kind = FIRE, .name = "3" },
                                { .kind = FIRE, .name = "4" },
                                { .kind = TAP },
                                { POOL, NULL, 3, 2, 0 },
                                { .kind = FIRE, .name = "6" },
                                { .kind = FIRE, .name = "7" },
                                { .kind = TAP },
                                { POOL, NULL, 3, 2, 0 },
                                { .kind = FIRE, .name = "9" },
                                { .kind = TAP },
                                { .kind = FIRE, .name = "10" },
                                { .kind = TAP },
                                { .kind = FIRE, .name = "11" },
                                { .kind = TAP },
                                { .kind = FIRE, .name = "12" },
                                { .kind = TAP },
                                { .kind = END } };

static const step vgg[] = {
    { CONV, "0", 3, 1, 1 },  { CONV, "2", 3, 1, 1 },  { .kind = TAP },
    { POOL, NULL, 2, 2, 0 }, { CONV, "5", 3, 1, 1 },  { CONV, "7", 3, 1, 1 },
    { .kind = TAP },         { POOL, NULL, 2, 2, 0 }, { CONV, "10", 3, 1, 1 },
    { CONV, "12", 3, 1, 1 }, { CONV, "14", 3, 1, 1 }, { .kind = TAP },
    { POOL, NULL, 2, 2, 0 }, { CONV, "17", 3, 1, 1 }, { CONV, "19", 3, 1, 1 },
    { CONV, "21", 3, 1, 1 }, { .kind = TAP },         { POOL, NULL, 2, 2, 0 },
    { CONV, "24", 3, 1, 1 }, { CONV, "26", 3, 1, 1 }, { CONV, "28", 3, 1, 1 },
    { .kind = TAP },         { .kind = END }
};

typedef struct {
    const char *key, *name;
    const step *steps;
    bool ceil; /* pools count a last window that is not full */
} net;

static const net nets[] = { { "alex", "AlexNet", alex, false },
                            { "squeeze", "SqueezeNet 1.1", squeeze, true },
                            { "vgg", "VGG16", vgg, false } };

enum {
    N_NETS = (int)(sizeof nets / sizeof nets[0]),
    MAX_CONVS = 32,
    MAX_TAPS = 8,
    NAME = 64
};

struct saga_lpips {
    const net *net;
    saga_conv conv[MAX_CONVS];
    int n_convs;
    double *head[MAX_TAPS]; /* (planes at the tap) */
    int n_taps;
    char text[256];
};

/* The network's input is (x - shift) / scale for R, G and B, where the samples
 * x are in [-1, 1]. */
static const double shift[3] = { -.030, -.088, -.188 };
static const double scale[3] = { .458, .448, .450 };

/* --- Loading ------------------------------------------------------------- */

void saga_lpips_free(saga_lpips *l)
{
    if (!l)
        return;
    for (int i = 0; i < l->n_convs; i++)
        saga_conv_free(&l->conv[i]);
    for (int i = 0; i < l->n_taps; i++)
        free(l->head[i]);
    free(l);
}

/* The state while the steps of a network are loaded. */
typedef struct {
    saga_lpips *l;
    const saga_npz *npz;
    int n_planes; /* planes after the steps so far */
    saga_error *error;
} loading;

/* Reads NET.NAME[.MORE]; refuses an array that does not hold `n` numbers in
 * `sides` dimensions. */
static bool read_array(saga_npy *a, const loading *s, const char *name,
                       const char *more)
{
    char key[2 * NAME];

    snprintf(key, sizeof key, "%s.%s%s", s->l->net->key, name, more);
    return saga_npz_read(a, s->npz, key, s->error);
}

static bool refuse(const loading *s, const char *name, const saga_npy *a)
{
    return saga_fail(s->error, s->npz->path,
                     "give weights of LPIPS 0.1 as "
                     "docs/metrics.md describes them",
                     "has %s of %zu x %zu x %zu x %zu", name, a->side[0],
                     a->side[1], a->side[2], a->side[3]);
}

/* Loads a convolution with n_in input planes; the file gives n_out. */
static bool load_conv(loading *s, const step *like, const char *name, int n_in)
{
    saga_conv *const c = &s->l->conv[s->l->n_convs];
    saga_npy w, b = { 0 };
    bool ok = read_array(&w, s, name, ".weight") &&
              read_array(&b, s, name, ".bias");

    /* The array's shape must be that of the network. Only n_out comes from the
     * file, so it is bounded; all other sides follow from the steps before. */
    if (ok && (w.n_sides != 4 || w.side[0] > 4096 || w.side[0] < 1 ||
               w.side[1] != (size_t)n_in || w.side[2] != (size_t)like->size ||
               w.side[3] != (size_t)like->size))
        ok = refuse(s, name, &w);
    if (ok && (b.n_sides != 1 || b.side[0] != w.side[0]))
        ok = refuse(s, name, &b);
    if (ok) {
        *c = (saga_conv){ .n_out = (int)w.side[0],
                          .n_in = n_in,
                          .size = like->size,
                          .stride = like->stride,
                          .pad = like->pad };
        s->l->n_convs++;
        ok = saga_conv_pack(c, w.data, b.data, s->error);
    }
    saga_npy_free(&w);
    saga_npy_free(&b);
    return ok;
}

/* Loads the three convolutions of a fire module; the outputs of c[0] are the
 * inputs of c[1] and c[2]. */
static bool load_fire(loading *s, const char *name)
{
    static const step one = { CONV, NULL, 1, 1, 0 },
                      three = { CONV, NULL, 3, 1, 1 };
    const saga_conv *const c = &s->l->conv[s->l->n_convs];
    char part[NAME];
    bool ok;

    snprintf(part, sizeof part, "%s.squeeze", name);
    ok = load_conv(s, &one, part, s->n_planes);
    snprintf(part, sizeof part, "%s.expand1x1", name);
    ok = ok && load_conv(s, &one, part, c[0].n_out);
    snprintf(part, sizeof part, "%s.expand3x3", name);
    ok = ok && load_conv(s, &three, part, c[0].n_out);
    /* join() puts the outputs of the two expanding convolutions one after the
     * other. */
    if (ok)
        s->n_planes = c[1].n_out + c[2].n_out;
    return ok;
}

static bool load_head(loading *s)
{
    char name[NAME];
    saga_npy a;
    bool ok;

    snprintf(name, sizeof name, "lin%d", s->l->n_taps);
    ok = read_array(&a, s, name, "") &&
         ((a.n_sides == 1 && a.side[0] == (size_t)s->n_planes) ||
          refuse(s, name, &a));
    if (ok) {
        s->l->head[s->l->n_taps++] = a.data;
        a.data = NULL;
    }
    saga_npy_free(&a);
    return ok;
}

static bool load_steps(loading *s)
{
    for (const step *p = s->l->net->steps; p->kind != END; p++) {
        bool ok = true;

        if (p->kind == CONV) {
            ok = load_conv(s, p, p->name, s->n_planes);
            if (ok)
                s->n_planes = s->l->conv[s->l->n_convs - 1].n_out;
        } else if (p->kind == FIRE) {
            ok = load_fire(s, p->name);
        } else if (p->kind == TAP) {
            ok = load_head(s);
        }
        if (!ok)
            return false;
    }
    return true;
}

static const net *find_net(const saga_npz *npz, saga_error *error)
{
    char name[NAME];

    for (int i = 0; i < N_NETS; i++) {
        snprintf(name, sizeof name, "%s.lin0", nets[i].key);
        if (saga_npz_has(npz, name))
            return &nets[i];
    }
    saga_fail(error, npz->path,
              "give weights of LPIPS 0.1 as "
              "docs/metrics.md describes them",
              "has neither alex.lin0 nor squeeze.lin0 nor vgg.lin0");
    return NULL;
}

saga_lpips *saga_lpips_load(const char *path, saga_error *error)
{
    saga_lpips *const l = saga_calloc(1, sizeof *l, path, error);
    saga_npz npz = { 0 };
    loading s = { l, &npz, 3, error };
    bool ok = l && saga_npz_open(&npz, path, error);

    if (ok) {
        l->net = find_net(&npz, error);
        ok = l->net && load_steps(&s);
    }
    if (ok)
        snprintf(l->text, sizeof l->text,
                 "v0.1, %s, 8-bit RGB over [-1, 1], "
                 "weights with CRC-32 %08lx",
                 l->net->name,
                 crc32(0, npz.bytes.data, (uInt)npz.bytes.nbytes));
    saga_npz_close(&npz);
    if (ok)
        return l;
    saga_lpips_free(l);
    return NULL;
}

const char *saga_lpips_text(const saga_lpips *l)
{
    return l->text;
}

/* --- Comparing ----------------------------------------------------------- */

/* One picture on its way through the network. */
typedef struct {
    const saga_lpips *l;
    saga_planes now;
    int n_convs; /* used so far */
    int n_threads;
    saga_error *error;
} walk;

static bool first_planes(walk *w, const uint8_t *rgb, int width, int height)
{
    const size_t n = (size_t)width * (size_t)height;

    w->now = (saga_planes){ .n = 3, .height = height, .width = width };
    w->now.v = saga_alloc(3 * n, sizeof *w->now.v, "comparing two pictures",
                          w->error);
    for (size_t i = 0; w->now.v && i < 3 * n; i++) {
        /* Convert interleaved bytes to planes of samples in [-1, 1], shifted
         * and scaled as in the network's training. */
        const size_t c = i / n;

        w->now.v[i] = (float)((rgb[3 * (i % n) + c] / 127.5 - 1.0 - shift[c]) /
                              scale[c]);
    }
    return w->now.v;
}

/* Replaces the current planes by `next`. */
static void move_on(walk *w, saga_planes next)
{
    free(w->now.v);
    w->now = next;
}

static bool next_conv(saga_planes *out, walk *w, const saga_planes *in)
{
    return saga_conv_run(out, &w->l->conv[w->n_convs++], in, w->n_threads,
                         w->error);
}

/* Appends b's planes to a's, which have the same size. */
static bool join(saga_planes *out, const saga_planes *a, const saga_planes *b,
                 saga_error *error)
{
    const size_t one = (size_t)a->height * (size_t)a->width;
    const size_t na = one * (size_t)a->n, nb = one * (size_t)b->n;

    *out = *a;
    out->n = a->n + b->n;
    out->v = saga_alloc(na + nb, sizeof *out->v, "comparing two pictures",
                        error);
    if (!out->v)
        return false;
    memcpy(out->v, a->v, na * sizeof *out->v);
    memcpy(out->v + na, b->v, nb * sizeof *out->v);
    return true;
}

static bool next_fire(saga_planes *out, walk *w)
{
    saga_planes few = { 0 }, one = { 0 }, three = { 0 };
    const bool ok = next_conv(&few, w, &w->now) && next_conv(&one, w, &few) &&
                    next_conv(&three, w, &few) &&
                    join(out, &one, &three, w->error);

    free(few.v);
    free(one.v);
    free(three.v);
    return ok;
}

/* Takes one step other than TAP. */
static bool take(walk *w, const step *p)
{
    saga_planes next = { 0 };
    const bool ok = p->kind == CONV ? next_conv(&next, w, &w->now)
                    : p->kind == FIRE
                        ? next_fire(&next, w)
                        : saga_pool_max(&next, &w->now, p->size, p->stride,
                                        w->l->net->ceil, w->error);

    move_on(w, next);
    return ok;
}

/* Returns the divisor that gives a pixel's vector the length 1. */
static double length(const float *v, int n, size_t stride)
{
    double sum = 0.0;

    for (int c = 0; c < n; c++)
        sum += (double)v[(size_t)c * stride] * (double)v[(size_t)c * stride];
    return sqrt(sum) + 1e-10;
}

/* Returns the mean over pixels of the weighted squared differences between
 * vectors of length 1. */
static double compare(const saga_planes *a, const saga_planes *b,
                      const double *head)
{
    const size_t n = (size_t)a->height * (size_t)a->width;
    double sum = 0.0;

    for (size_t i = 0; i < n; i++) {
        /* Both vectors are normalised, so that only their directions count;
         * then each channel has its learned weight. */
        const double la = length(a->v + i, a->n, n);
        const double lb = length(b->v + i, b->n, n);

        for (int c = 0; c < a->n; c++) {
            const size_t at = (size_t)c * n + i;
            const double d = (double)a->v[at] / la - (double)b->v[at] / lb;

            sum += head[c] * d * d;
        }
    }
    return sum / (double)n;
}

/* Takes both pictures through the network. If no pixels are left, the picture
 * was too small and the distance is NaN. */
static bool walk_both(double *distance, walk *a, walk *b)
{
    int tap = 0;

    *distance = 0.0;
    for (const step *p = a->l->net->steps; p->kind != END; p++) {
        /* Both pictures advance together, so that only the planes of one step
         * are in memory. */
        if (p->kind == TAP)
            *distance += compare(&a->now, &b->now, a->l->head[tap++]);
        else if (!take(a, p) || !take(b, p))
            return false;
        if (!a->now.v) {
            *distance = (double)NAN;
            return true;
        }
    }
    return true;
}

bool saga_lpips_distance(double *distance, const saga_lpips *l,
                         const saga_picture_pair *of, saga_error *error)
{
    walk a = { .l = l, .n_threads = of->n_threads, .error = error };
    walk b = a;
    const bool ok = first_planes(&a, of->a, of->width, of->height) &&
                    first_planes(&b, of->b, of->width, of->height) &&
                    walk_both(distance, &a, &b);

    free(a.now.v);
    free(b.now.v);
    return ok;
}
