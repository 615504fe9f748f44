/* SPDX-License-Identifier: MIT */
#include "classes.h"

#include "adam.h"
#include "context.h"
#include "fx.h"
#include "net.h"
#include "quantise.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum {
    HIDDEN = 8,
    HIDDEN_Q = 11,               /* +-16, where inputs are about 1 */
    N_STEPS = 400,               /* of Adam */
    MAX_BLOCKS = 8192,           /* that the fit looks at */
    LEAST_BYTES = 64,            /* of a kind's symbols: below, no network */
    PER_NAT = 2                  /* classes */
};

static const float learning_rate = 0.02f;
static const float bias_step = 1.0f / 16;    /* of hidden units and classes */

/* Of the weights, where inputs have a root mean square of 1. */
static const float steps[] = { 0.5f, 0.25f };

static const uint8_t symbol_of[SAGA_N_CLASS_KINDS] = {
    SAGA_SYM_N_FINE, SAGA_SYM_FINE_SUFFIX, SAGA_SYM_N_PRIM,
    SAGA_SYM_PRIM_SUFFIX
};

static void *must(void *p)
{
    if (!p)
        abort();
    return p;
}

/* --- Blocks: what a network sees, and what it should tell ---------------- */

typedef struct {
    int kind;
    uint32_t dim, rows;          /* inputs, outputs */
    uint32_t rank;               /* of the last block */
    uint32_t parent;             /* of the last set */
    size_t n, cap;
    float *in;                   /* (n, dim) */
    float *hits, *of;            /* (n, rows) hits of so many */
} blocks;

static void add_block(blocks *b, const saga_scaffold *sc, uint32_t rank,
                      uint32_t group)
{
    const float unit = ldexpf(1, -sc->model->q_in[SAGA_NET_CLASS + b->kind]);
    uint8_t class[4];
    uint32_t i;

    if (b->n == b->cap) {
        b->cap += b->cap + 1024;
        b->in = must(realloc(b->in, b->cap * b->dim * sizeof *b->in));
        b->hits = must(realloc(b->hits, b->cap * b->rows * sizeof *b->hits));
        b->of = must(realloc(b->of, b->cap * b->rows * sizeof *b->of));
    }
    saga_context_classes(class, sc, b->kind, rank, group);
    for (i = 0; i < b->dim; i++)
        b->in[b->n * b->dim + i] = unit * (float)sc->v->in[i];
    for (i = 0; i < b->rows; i++)
        b->hits[b->n * b->rows + i] = b->of[b->n * b->rows + i] = 0;
    b->rank = rank;
    b->n++;
}

/* Whose children are at and after the given rank; it only grows. */
static uint32_t parent_of(blocks *b, const saga_scaffold *sc, uint32_t rank)
{
    if (b->kind == SAGA_CLASS_FINE_SET)
        while (sc->coarse[b->parent].first_fine +
               sc->coarse[b->parent].n_fine <= rank)
            b->parent++;
    else
        while (sc->fine[b->parent].first_prim +
               sc->fine[b->parent].n_prim <= rank)
            b->parent++;
    return b->parent;
}

/* A halving that the axis' class serves (common/syntax.c, set_model). */
static int has_class(const blocks *b, const saga_scaffold *sc, saga_at at,
                     uint32_t n_points)
{
    const uint32_t bits =
        sc->model->level[b->kind == SAGA_CLASS_PRIM_SET].suffix_bits;

    return at.bit / 4 == bits - 1 && n_points <= SAGA_FEW;
}

/* A saga_encode_watch. */
static void gather(void *user, const saga_scaffold *sc, saga_at at,
                   uint32_t n_sym, uint32_t sym)
{
    blocks *const b = user;
    uint32_t rank = at.index, group = 0, axis = 0;

    if (at.sym != symbol_of[b->kind])
        return;
    if (b->rows == 4) {
        if (!has_class(b, sc, at, n_sym - 1))
            return;
        axis = 3 - (at.bit & 3u);
        rank = parent_of(b, sc, at.index);
    } else if (b->kind == SAGA_CLASS_N_PRIM) {
        group = sc->fine[rank].group;
    }
    if (b->n == 0 || b->rank != rank)
        add_block(b, sc, rank, group);
    b->hits[(b->n - 1) * b->rows + axis] += (float)sym;
    b->of[(b->n - 1) * b->rows + axis] += (float)(n_sym - 1);
}

/* Numbers as hits of what their range leaves open. */
static void centre_numbers(blocks *b)
{
    float least = SAGA_MAX_CHILDREN, most = 0;
    size_t i;

    for (i = 0; i < b->n; i++) {
        least = fminf(least, b->hits[i]);
        most = fmaxf(most, b->hits[i]);
    }
    for (i = 0; i < b->n; i++) {
        b->hits[i] -= least;
        b->of[i] = most - least;
    }
}

/* Some of the blocks, evenly spread. */
static void thin(blocks *b)
{
    const size_t every = b->n / MAX_BLOCKS + 1;
    size_t i, to = 0;

    for (i = 0; i < b->n; i += every, to++) {
        memmove(b->in + to * b->dim, b->in + i * b->dim,
                b->dim * sizeof *b->in);
        memmove(b->hits + to * b->rows, b->hits + i * b->rows,
                b->rows * sizeof *b->hits);
        memmove(b->of + to * b->rows, b->of + i * b->rows,
                b->rows * sizeof *b->of);
    }
    b->n = to;
}

static void free_blocks(blocks *b)
{
    free(b->in);
    free(b->hits);
    free(b->of);
}

/* --- The fit ------------------------------------------------------------- */

typedef struct {
    saga_net net, grad;
    float *params;               /* of net, grad and Adam's moments */
    size_t n_params;
    saga_net_work work;
    float rms;                   /* of the inputs, about their means */
} fit;

static void fit_alloc(fit *f, uint32_t dim, uint32_t rows)
{
    memset(f, 0, sizeof *f);
    f->net.n_layers = 2;
    f->net.dim[0] = (int)dim;
    f->net.dim[1] = HIDDEN;
    f->net.dim[2] = (int)rows;
    f->grad = f->net;
    f->n_params = saga_net_n_params(&f->net);
    f->params = must(calloc(4 * f->n_params, sizeof *f->params));
    saga_net_bind(&f->net, f->params);
    saga_net_bind(&f->grad, f->params + f->n_params);
    f->rms = 1;
}

static void fit_free(fit *f)
{
    free(f->params);
    saga_net_free(&f->work);
}

/* Inputs of mean 0 and a common root mean square of 1. */
static void standardise(fit *f, float *mean, blocks *b)
{
    const size_t n = b->n * b->dim;
    double sum = 0;
    size_t i;

    memset(mean, 0, b->dim * sizeof *mean);
    for (i = 0; i < n; i++)
        mean[i % b->dim] += b->in[i] / (float)b->n;
    for (i = 0; i < n; i++) {
        b->in[i] -= mean[i % b->dim];
        sum += (double)b->in[i] * (double)b->in[i];
    }
    if (sum > 0)
        f->rms = (float)sqrt(sum / (double)n);
    for (i = 0; i < n; i++)
        b->in[i] /= f->rms;
}

/* Gradients of what is minimised. */
static void differentiate(fit *f, float *y, const blocks *b)
{
    const size_t n = b->n * b->rows;
    size_t i;
    int l;

    if (saga_net_forward(y, &f->work, b->in, b->n, &f->net))
        abort();
    for (i = 0; i < n; i++)
        y[i] = b->of[i] / (1 + expf(-y[i])) - b->hits[i];
    memset(f->grad.w[0], 0, f->n_params * sizeof(float));
    if (saga_net_backward(NULL, &f->grad, &f->work, y, b->in, b->n, &f->net))
        abort();
    for (l = 0; l < f->net.n_layers; l++)
        for (i = 0; i < (size_t)(f->net.dim[l] * f->net.dim[l + 1]); i++)
            f->grad.w[l][i] += f->net.w[l][i];
}

static void descend(fit *f, float *y, const blocks *b)
{
    const saga_adam adam = saga_adam_default();
    saga_adam_tensor t = {
        "classes", f->params, f->params + f->n_params,
        f->params + 2 * f->n_params, f->params + 3 * f->n_params,
        f->n_params, 0
    };
    saga_adam_fault fault;
    int i;

    saga_net_init(&f->net, 1);
    for (i = 1; i <= N_STEPS; i++) {
        differentiate(f, y, b);
        t.rate = learning_rate * (float)(N_STEPS + 1 - i) / N_STEPS;
        if (saga_adam_step(&fault, &adam, &t, 1, (uint64_t)i))
            return;
    }
}

/* Takes inputs as they are, and gives classes from the middle one on. */
static void unstandardise(fit *f, const float *mean, float *y, const blocks *b)
{
    const size_t dim = b->dim, n = b->n * b->rows;
    double sum = 0;
    size_t i;

    if (saga_net_forward(y, &f->work, b->in, b->n, &f->net))
        abort();
    for (i = 0; i < HIDDEN * dim; i++) {
        f->net.w[0][i] /= f->rms;
        f->net.b[0][i / dim] -= f->net.w[0][i] * mean[i % dim];
    }
    for (i = 0; i < n; i++)
        sum += (double)y[i];
    for (i = 0; i < b->rows; i++)
        f->net.b[1][i] = PER_NAT * (f->net.b[1][i] -
                                    (float)(sum / (double)n)) + 0.5f;
    for (i = 0; i < HIDDEN * b->rows; i++)
        f->net.w[1][i] *= PER_NAT;
}

static void run_fit(fit *f, blocks *b)
{
    float *const mean = must(malloc(b->dim * sizeof *mean));
    float *const y = must(malloc(b->n * b->rows * sizeof *y));

    standardise(f, mean, b);
    descend(f, y, b);
    unstandardise(f, mean, y, b);
    free(mean);
    free(y);
}

/* Symbols of the network of the kind, in steps of the standardised one. */
static void quantise(saga_net_symbols *out, const fit *f, const saga_model *m,
                     int kind, float step)
{
    const int net = SAGA_NET_CLASS + kind;
    const uint32_t rows = (uint32_t)f->net.dim[2];
    uint8_t hidden[HIDDEN], class[4];
    const saga_layer_values v[2] = {
        { f->net.w[0], f->net.b[0], (uint32_t)f->net.dim[0], HIDDEN,
          m->q_in[net], hidden, step / f->rms, bias_step, m->int8[net] },
        { f->net.w[1], f->net.b[1], HIDDEN, rows, HIDDEN_Q, class,
          PER_NAT * step, bias_step, m->int8[net] }
    };
    int i;

    memset(out, 0, sizeof *out);
    memset(hidden, HIDDEN_Q, sizeof hidden);
    memset(class, 10, sizeof class);
    for (i = 0; i < 2; i++)
        saga_quantise_layer(&out->layer[net][i], &v[i]);
}

/* --- The choice ---------------------------------------------------------- */

typedef struct {
    saga_header *h;
    saga_net_symbols *nets;
    const saga_rig_camera *rig;
    const saga_symbols *s;
    uint32_t n_frames;
    uint32_t may;                /* sources that are there */
    saga_encode_sizes sizes;     /* of the file so far */
} choice;

/* The file with networks of one kind of the caller's own, or NULL; who gathers
 * blocks from it, or NULL. 0: there is no such file. */
static int code(saga_encode_sizes *sizes, const choice *c,
                const saga_header *h, const saga_net_symbols *own, int kind,
                blocks *watch)
{
    saga_net_symbols nets = *c->nets;
    const char *why;
    uint8_t *bytes = NULL;
    saga_encoder *e;
    size_t n;
    int ok;

    if (own)
        memcpy(nets.layer[SAGA_NET_CLASS + kind],
               own->layer[SAGA_NET_CLASS + kind], sizeof nets.layer[0]);
    e = saga_encoder_open(h, c->rig, &nets, &why);
    if (e && watch)
        saga_encoder_watch(e, gather, watch);
    ok = e && saga_encoder_segment(e, c->s, c->n_frames, &why) &&
         saga_encoder_finish(e, &bytes, &n, sizes, &why);
    free(bytes);
    saga_encoder_free(e);
    return ok;
}

/* No source saturates: inputs have the digits of the coarsest, at most 12. */
static uint8_t input_format(const saga_model *m, int kind, uint32_t sources)
{
    const int level = kind == SAGA_CLASS_PRIM_SET ? SAGA_LEVEL_FINE
                                                  : SAGA_LEVEL_COARSE;
    int q = 12;

    if (sources & SAGA_SOURCE_HYPER)
        q = fx_min(q, m->head_q[SAGA_HEAD_HYPER]);
    if (sources & SAGA_SOURCE_PARENT)
        q = fx_min(q, saga_feature_q(m, level));
    return (uint8_t)fx_max(q, 1);
}

static void set_model(saga_model *m, int kind, uint32_t sources)
{
    int net;

    for (net = SAGA_NET_CLASS;
         net < SAGA_N_NETS && !(m->tools & SAGA_TOOL_CLASSES); net++) {
        m->width[net] = HIDDEN;
        m->q_in[net] = 12;
        m->int8[net] = m->int8[SAGA_NET_HYPER];
    }
    m->tools |= SAGA_TOOL_CLASSES;
    m->class_sources[kind] = (uint8_t)sources;
    m->q_in[SAGA_NET_CLASS + kind] = input_format(m, kind, sources);
}

/* Blocks as the kind's network will see them: it has no say yet. 0: none. */
static int gather_blocks(blocks *b, fit *f, const choice *c,
                         const saga_header *h)
{
    saga_net_symbols zero;
    saga_encode_sizes sizes;
    int ok;

    quantise(&zero, f, &h->model, b->kind, 1);
    ok = code(&sizes, c, h, &zero, b->kind, b);
    saga_net_symbols_free(&zero);
    if (!ok || b->n == 0)
        return 0;
    if (b->rows == 1)
        centre_numbers(b);
    thin(b);
    return 1;
}

/* Tells, and takes over what is better than the best so far. best: the file
 * with it. */
static void judge(choice *c, saga_class_gain *g, saga_encode_sizes *best,
                  const saga_encode_sizes *with, const saga_header *h,
                  saga_net_symbols *own, int kind)
{
    const saga_encode_sizes *const was = &c->sizes;
    const double net = (double)with->total - (double)was->total;
    const int at = SAGA_NET_CLASS + kind;
    saga_net_symbols old;

    if (g->sources && net >= g->net)
        return;
    *g = (saga_class_gain){
        h->model.class_sources[kind], net < 0,
        was->bits[symbol_of[kind]] / 8, with->bits[symbol_of[kind]] / 8,
        (double)(with->networks + with->header) -
        (double)(was->networks + was->header), net
    };
    if (!g->kept)
        return;
    *best = *with;
    c->h->model = h->model;
    memcpy(old.layer[at], c->nets->layer[at], sizeof old.layer[at]);
    memcpy(c->nets->layer[at], own->layer[at], sizeof old.layer[at]);
    memcpy(own->layer[at], old.layer[at], sizeof old.layer[at]);
}

static void try_sources(choice *c, saga_class_gain *g, saga_encode_sizes *best,
                        int kind, uint32_t sources)
{
    saga_header h = *c->h;
    saga_net_symbols own;
    saga_encode_sizes sizes;
    saga_net_shape shape;
    blocks b = { .kind = kind };
    fit f;
    size_t i;

    set_model(&h.model, kind, sources);
    if (!saga_model_is_valid(&h.model))
        return;
    saga_model_net(&shape, &h.model, SAGA_NET_CLASS + kind);
    b.dim = shape.dim[0];
    b.rows = shape.dim[2];
    fit_alloc(&f, b.dim, b.rows);
    if (gather_blocks(&b, &f, c, &h)) {
        run_fit(&f, &b);
        for (i = 0; i < sizeof steps / sizeof steps[0]; i++) {
            quantise(&own, &f, &h.model, kind, steps[i]);
            if (code(&sizes, c, &h, &own, kind, NULL))
                judge(c, g, best, &sizes, &h, &own, kind);
            saga_net_symbols_free(&own);
        }
    }
    fit_free(&f);
    free_blocks(&b);
}

int saga_classes_choose(saga_header *h, saga_net_symbols *nets,
                        saga_class_gain gain[SAGA_N_CLASS_KINDS],
                        const saga_rig_camera *rig, const saga_symbols *s,
                        uint32_t n_frames)
{
    static const uint8_t sources[] = {
        SAGA_SOURCE_HYPER, SAGA_SOURCE_HYPER | SAGA_SOURCE_PARENT,
        SAGA_SOURCE_HYPER | SAGA_SOURCE_MEMORY
    };
    choice c = { .h = h, .nets = nets, .rig = rig, .s = s,
                 .n_frames = n_frames, .may = saga_any_source(&h->model) };
    saga_encode_sizes best;
    int kind, any = 0;
    size_t i;

    memset(gain, 0, SAGA_N_CLASS_KINDS * sizeof *gain);
    if (!code(&c.sizes, &c, h, NULL, 0, NULL))
        return 0;
    for (kind = 0; kind < SAGA_N_CLASS_KINDS; kind++) {
        best = c.sizes;
        for (i = 0; i < sizeof sources; i++)
            if (!(sources[i] & ~c.may) &&
                c.sizes.bits[symbol_of[kind]] >= 8 * LEAST_BYTES)
                try_sources(&c, &gain[kind], &best, kind, sources[i]);
        c.sizes = best;
        any |= gain[kind].kept;
    }
    return any;
}

/* --- Names --------------------------------------------------------------- */

const char *saga_class_name(int kind)
{
    static const char *const names[SAGA_N_CLASS_KINDS] = {
        "fine counts", "fine sets", "primitive counts", "primitive sets"
    };

    return names[kind];
}

const char *saga_class_key(int kind)
{
    static const char *const keys[SAGA_N_CLASS_KINDS] = {
        "n_fine", "fine_set", "n_prim", "prim_set"
    };

    return keys[kind];
}
