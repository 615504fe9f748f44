/* SPDX-License-Identifier: MIT */
#include "rate_memory.h"

#include "arena.h"
#include "dense.h"
#include "vec.h"

#include <stdlib.h>
#include <string.h>

#ifdef _OPENMP
#include <omp.h>
#endif

/* Queries that are answered together. */
enum { CHUNK = 128 };

#define LN2 R(0.69314718055994530942)

static int thread_number(void)
{
#ifdef _OPENMP
    return omp_get_thread_num();
#else
    return 0;
#endif
}

static size_t n_threads(void)
{
#ifdef _OPENMP
    return (size_t)omp_get_max_threads();
#else
    return 1;
#endif
}

/* --- Memory -------------------------------------------------------------- */

static void lay_batch(saga_twin_batch *b, saga_arena *a, const saga_net *net,
                      size_t rows)
{
    const size_t in = (size_t)net->dim[0];
    const size_t out = (size_t)net->dim[net->n_layers];

    b->in = saga_arena_take(a, rows * in);
    b->d_in = saga_arena_take(a, rows * in);
    b->out = saga_arena_take(a, rows * out);
    b->d_out = saga_arena_take(a, rows * out);
}

static void lay_out(saga_rate_memory *m, saga_arena *a, const saga_scene *s)
{
    const saga_net *const net = s->net;
    const size_t slots = m->n_slots, state = slots * m->width;
    size_t n_states = 1;
    int kind;

    for (kind = 0; kind < SAGA_N_KINDS; kind++) {
        saga_rate_memory_kind *const k = &m->kind[kind];
        const size_t blocks = saga_rate_n_blocks(s, kind);
        const size_t runs = saga_rate_runs_most(s, kind);

        lay_batch(&k->query, a, &net[SAGA_NET_QUERY], blocks);
        k->d_state = saga_arena_take(a, runs * state);
        k->read = saga_arena_take(a, blocks * m->width);
        k->d_read = saga_arena_take(a, blocks * m->width);
        if (kind == SAGA_KIND_PRIM)
            continue;
        lay_batch(&k->token, a, &net[SAGA_NET_AGG], blocks);
        lay_batch(&k->base, a, &net[SAGA_NET_WRITE_BASE], runs);
        lay_batch(&k->write, a, &net[SAGA_NET_WRITE], runs * slots);
        n_states += runs;
    }
    lay_batch(&m->slot, a, &net[SAGA_NET_SLOT], slots);
    m->state = saga_arena_take(a, n_states * state);
    m->d_last = saga_arena_take(a, state);
}

/* S_0 as the integers have it. */
static int start(saga_rate_memory *m, const saga_scene *s)
{
    saga_memory bank = { .n_slots = s->model.memory_slots,
                         .width = s->model.memory_width };
    const size_t stride = saga_mlp_pad(bank.width);
    uint8_t *const block = aligned_alloc(16, saga_memory_place(&bank, NULL));
    size_t p, i;

    if (!block)
        return -1;
    saga_memory_place(&bank, block);
    saga_memory_start(&bank);
    for (p = 0; p < m->n_slots; p++)
        for (i = 0; i < m->width; i++)
            m->state[p * m->width + i] = R(bank.slot[p * stride + i]) / 4096;
    free(block);
    for (p = 0; p < m->n_slots; p++)
        m->slot.in[p * m->n_slots + p] = 1;
    return 0;
}

int saga_rate_memory_init(saga_rate_memory *m, const saga_scene *s)
{
    saga_arena a = { NULL, 0 };

    memset(m, 0, sizeof *m);
    if (!(s->model.tools & SAGA_TOOL_MEMORY))
        return 0;
    m->n_slots = s->model.memory_slots;
    m->width = s->model.memory_width;
    lay_out(m, &a, s);
    m->block = calloc(a.n + 1, sizeof *m->block);
    if (!m->block)
        return -1;
    a.base = m->block;
    a.n = 0;
    lay_out(m, &a, s);
    if (start(m, s)) {
        saga_rate_memory_free(m);
        return -1;
    }
    return 0;
}

void saga_rate_memory_free(saga_rate_memory *m)
{
    int kind;

    for (kind = 0; kind < SAGA_N_KINDS; kind++) {
        saga_net_free(&m->kind[kind].query.work);
        saga_net_free(&m->kind[kind].token.work);
        saga_net_free(&m->kind[kind].base.work);
        saga_net_free(&m->kind[kind].write.work);
    }
    saga_net_free(&m->slot.work);
    free(m->scratch);
    free(m->block);
    memset(m, 0, sizeof *m);
}

/* --- Inputs of queries and tokens ---------------------------------------- */

/* Queries: what is above a block. Tokens: what the block itself is. Where it
 * lies in x, or in its gradients: NULL where there is nothing. *n values. */
static real *values_of(const saga_rate_memory_input *in,
                       const saga_rate_features *x, size_t block, int is_token,
                       size_t *n)
{
    const size_t f = in->s->model.features;
    const int kind = in->kind;
    real *const from = kind == SAGA_KIND_PRIM ? x->fine
        : kind == SAGA_KIND_FINE ? is_token ? x->offset : x->coarse
        : is_token ? x->coarse : NULL;

    *n = kind == SAGA_KIND_FINE && is_token ? SAGA_RATE_OFFSETS : f;
    if (kind == SAGA_KIND_FINE && !is_token)
        block = in->s->fine[block].parent;
    return from ? from + block * *n : NULL;
}

/* The decoded place of an anchor. */
static void anchor_phase(real phase[4], const saga_rate_memory_input *in,
                         size_t block)
{
    const real *const x = (in->kind == SAGA_KIND_COARSE ? in->s->coarse_x
                                                        : in->s->fine_x) +
                          4 * block;

    memcpy(phase, x, 3 * sizeof *x);
    phase[3] = 2 * x[3] - 1;
}

static void fill_row(real *row, const saga_rate_memory_input *in, int net,
                     size_t block)
{
    const saga_model *const m = &in->s->model;
    const int is_token = net == SAGA_NET_AGG;
    const size_t dim = (size_t)in->s->net[net].dim[0];
    const real *phase = in->phase + 4 * block, *values;
    real anchor[4], *to;
    size_t n;

    if (is_token) {
        anchor_phase(anchor, in, block);
        phase = anchor;
    }
    to = saga_rate_side(row, m, phase, in->size + SAGA_RATE_SIZES * block);
    *to++ = R(in->kind - 1);
    memset(to, 0, m->features * sizeof *to);
    values = values_of(in, &in->x, block, is_token, &n);
    if (values)
        memcpy(to, values, n * sizeof *to);
    saga_rate_clamp(row, dim, m->q_in[net]);
}

/* QUERY or AGG on the blocks of order first .. end - 1. */
static int run_blocks(saga_twin_batch *b, const saga_rate_memory_input *in,
                      int net, size_t first, size_t end)
{
    const saga_net *const f = &in->s->net[net];
    const size_t n_in = (size_t)f->dim[0];
    const size_t n_out = (size_t)f->dim[f->n_layers];
    ptrdiff_t i;

#pragma omp parallel for schedule(static)
    for (i = (ptrdiff_t)first; i < (ptrdiff_t)end; i++)
        fill_row(b->in + (size_t)i * n_in, in, net, in->runs->block[i]);
    if (saga_net_forward(b->out + first * n_out, &b->work,
                         b->in + first * n_in, end - first, f))
        return -1;
    saga_rate_clamp(b->out + first * n_out, (end - first) * n_out,
                    net == SAGA_NET_AGG ? SAGA_SLOT_Q : SAGA_QUERY_Q);
    return 0;
}

/* Of all blocks, from b->d_out. */
static int blocks_backward(saga_scene *d, const saga_rate_features *dx,
                           saga_twin_batch *b, const saga_rate_memory_input *in,
                           int net)
{
    const saga_net *const f = &in->s->net[net];
    const size_t n = saga_rate_n_blocks(in->s, in->kind);
    const size_t n_in = (size_t)f->dim[0];
    const size_t n_out = (size_t)f->dim[f->n_layers];
    const size_t side = n_in - in->s->model.features;
    size_t i, k, have;

    saga_rate_through(b->d_out, b->out, n * n_out,
                      net == SAGA_NET_AGG ? SAGA_SLOT_Q : SAGA_QUERY_Q);
    if (saga_net_backward(b->d_in, &d->net[net], &b->work, b->d_out, b->in, n,
                          f))
        return -1;
    saga_rate_through(b->d_in, b->in, n * n_in, in->s->model.q_in[net]);
    for (i = 0; i < n; i++) {
        real *const to = values_of(in, dx, in->runs->block[i],
                                   net == SAGA_NET_AGG, &have);

        for (k = 0; to && k < have; k++)
            to[k] += b->d_in[i * n_in + side + k];
    }
    return 0;
}

/* --- Reads --------------------------------------------------------------- */

/* A run that reads, in a thread's scratch. */
typedef struct {
    const real *state;           /* (L, D) */
    real *columns;               /* (D, L) the same, transposed */
    real *weight, *d_weight;     /* (CHUNK, L) */
    real *rows;                  /* (CHUNK, D) by order */
    size_t n_slots, width;
} reader;

/* Reals of it. */
static size_t reader_size(const saga_rate_memory *m)
{
    return m->n_slots * m->width + CHUNK * (2 * m->n_slots + m->width);
}

static int alloc_readers(saga_rate_memory *m)
{
    const size_t n = n_threads() * reader_size(m);

    if (n <= m->n_scratch)
        return 0;
    free(m->scratch);
    m->scratch = malloc(n * sizeof *m->scratch);
    m->n_scratch = m->scratch ? n : 0;
    return m->scratch ? 0 : -1;
}

/* Primitives all read the last state. */
static size_t state_of(const saga_rate_memory_input *in, size_t run)
{
    return in->first + (in->kind == SAGA_KIND_PRIM ? 0 : run);
}

static reader reader_of(const saga_rate_memory *m,
                        const saga_rate_memory_input *in, size_t run)
{
    const size_t n = m->n_slots * m->width;
    real *const scratch = m->scratch +
                          (size_t)thread_number() * reader_size(m);
    const reader r = {
        m->state + state_of(in, run) * n, scratch, scratch + n,
        scratch + n + CHUNK * m->n_slots, scratch + n + 2 * CHUNK * m->n_slots,
        m->n_slots, m->width
    };
    size_t p, i;

    for (p = 0; p < m->n_slots; p++)
        for (i = 0; i < m->width; i++)
            r.columns[i * m->n_slots + p] = r.state[p * m->width + i];
    return r;
}

/* Scores to weights that sum to 1. Those 100 and more below the largest have
 * 2^-100. */
static void softmax(real *x, size_t n)
{
    vec most = vec_load(x), sum = vec_zero();
    real top;
    size_t i;

    for (i = VEC_LANES; i < n; i += VEC_LANES)
        most = vec_max(most, vec_load(x + i));
    for (top = most[0], i = 1; i < VEC_LANES; i++)
        top = most[i] > top ? most[i] : top;
    for (i = 0; i < n; i += VEC_LANES) {
        const vec below = vec_set1(top) - vec_load(x + i);
        const vec e = vec_exp2_neg(vec_min(below, vec_set1(100)));

        vec_store(x + i, e);
        sum += e;
    }
    for (top = 1 / vec_sum(sum), i = 0; i < n; i += VEC_LANES)
        vec_store(x + i, vec_load(x + i) * vec_set1(top));
}

/* L and D are whole numbers of vectors: rows are padded as they are. */
static void weigh(const reader *r, const real *query, size_t n)
{
    size_t i;

    saga_dense_forward(r->weight, query, r->width, r->columns, NULL, n,
                       r->width, r->n_slots, 0);
    for (i = 0; i < n; i++)
        softmax(r->weight + i * r->n_slots, r->n_slots);
}

static void read_run(saga_rate_memory *m, const saga_rate_memory_input *in,
                     size_t run)
{
    saga_rate_memory_kind *const k = &m->kind[in->kind];
    const reader r = reader_of(m, in, run);
    const size_t end = in->runs->begin[run + 1], d = m->width;
    size_t at, i;

    for (at = in->runs->begin[run]; at < end; at += CHUNK) {
        const size_t n = end - at < CHUNK ? end - at : CHUNK;

        weigh(&r, k->query.out + at * d, n);
        saga_dense_forward(r.rows, r.weight, m->n_slots, r.state, NULL, n,
                           m->n_slots, d, 0);
        for (i = 0; i < n; i++)
            memcpy(k->read + in->runs->block[at + i] * d, r.rows + i * d,
                   d * sizeof *r.rows);
    }
}

int saga_rate_memory_read(saga_rate_memory *m,
                          const saga_rate_memory_input *in, size_t from,
                          size_t to)
{
    ptrdiff_t run;

    if (alloc_readers(m) ||
        run_blocks(&m->kind[in->kind].query, in, SAGA_NET_QUERY,
                   in->runs->begin[from], in->runs->begin[to]))
        return -1;
#pragma omp parallel for schedule(dynamic, 1)
    for (run = (ptrdiff_t)from; run < (ptrdiff_t)to; run++)
        read_run(m, in, (size_t)run);
    return 0;
}

/* Gradients of scores from those of weights: base 2. */
static void softmax_backward(real *d, const real *weight, size_t n)
{
    vec sum = vec_zero();
    real dot;
    size_t i;

    for (i = 0; i < n; i += VEC_LANES)
        sum = vec_fma(vec_load(d + i), vec_load(weight + i), sum);
    for (dot = vec_sum(sum), i = 0; i < n; i += VEC_LANES)
        vec_store(d + i, vec_set1(LN2) * vec_load(weight + i) *
                         (vec_load(d + i) - vec_set1(dot)));
}

/* Sets the run's d_state and its queries' gradients. */
static void read_run_backward(saga_rate_memory *m,
                              const saga_rate_memory_input *in, size_t run)
{
    saga_rate_memory_kind *const k = &m->kind[in->kind];
    const reader r = reader_of(m, in, run);
    const size_t end = in->runs->begin[run + 1], d = m->width;
    const size_t slots = m->n_slots;
    real *const d_state = k->d_state + run * slots * d;
    size_t at, i;

    memset(d_state, 0, slots * d * sizeof *d_state);
    for (at = in->runs->begin[run]; at < end; at += CHUNK) {
        const size_t n = end - at < CHUNK ? end - at : CHUNK;
        const real *const query = k->query.out + at * d;

        weigh(&r, query, n);
        for (i = 0; i < n; i++)
            memcpy(r.rows + i * d, k->d_read + in->runs->block[at + i] * d,
                   d * sizeof *r.rows);
        saga_dense_forward(r.d_weight, r.rows, d, r.columns, NULL, n, d, slots,
                           0);
        for (i = 0; i < n; i++)
            softmax_backward(r.d_weight + i * slots, r.weight + i * slots,
                             slots);
        saga_dense_forward(k->query.d_out + at * d, r.d_weight, slots, r.state,
                           NULL, n, slots, d, 0);
        saga_dense_backward(d_state, r.weight, slots, r.rows, n, d, slots);
        saga_dense_backward(d_state, r.d_weight, slots, query, n, d, slots);
    }
}

/* --- Update of a slot ---------------------------------------------------- */

static real dot(const real *a, const real *b, size_t n)
{
    real sum = 0;
    size_t i;

    for (i = 0; i < n; i++)
        sum += a[i] * b[i];
    return sum;
}

static real sigmoid(real x)
{
    return 1 / (1 + exp(-x));
}

/* What a slot s becomes by the candidate and gate in write (D + 1). u (D):
 * before its normalisation; returns its length, *along = <v, s>. */
static real update(real *u, real *along, const real *s, const real *write,
                   size_t n, int plain)
{
    const real g = sigmoid(write[n]);
    size_t i;

    *along = plain ? 0 : dot(write, s, n);
    for (i = 0; i < n; i++)
        u[i] = s[i] + g * (write[i] - *along * s[i]);
    return sqrt(dot(u, u, n));
}

static void update_forward(real *to, const real *s, const real *write,
                           size_t n, int plain)
{
    real along, length = update(to, &along, s, write, n, plain);
    size_t i;

    if (length > 0)
        for (i = 0; i < n; i++)
            to[i] /= length;
    else
        memcpy(to, s, n * sizeof *to);
}

/* d: of what the slot became; turns into that of s. Sets d_write (D + 1). */
static void update_backward(real *d, real *d_write, const real *s,
                            const real *write, size_t n, int plain)
{
    const real g = sigmoid(write[n]);
    real u[SAGA_MAX_SLOT_WIDTH], along, d_along = 0, d_gate = 0, part;
    const real length = update(u, &along, s, write, n, plain);
    size_t i;

    memset(d_write, 0, (n + 1) * sizeof *d_write);
    if (!(length > 0))
        return;
    part = dot(d, u, n) / (length * length);
    for (i = 0; i < n; i++) {
        d[i] = (d[i] - part * u[i]) / length;
        d_gate += d[i] * (write[i] - along * s[i]);
        d_along -= g * d[i] * s[i];
    }
    for (i = 0; i < n; i++) {
        d_write[i] = g * d[i] + (plain ? 0 : d_along * s[i]);
        d[i] += plain ? 0 : d_along * write[i] - along * g * d[i];
    }
    d_write[n] = d_gate * g * (1 - g);
}

/* --- Writes -------------------------------------------------------------- */

static int is_plain(const saga_scene *s)
{
    return (s->model.tools & SAGA_TOOL_PLAIN_WRITE) != 0;
}

/* WRITE_BASE's inputs. */
static void take_means(saga_rate_memory_kind *k,
                       const saga_rate_memory_input *in, size_t width,
                       size_t from, size_t to)
{
    size_t run, at, i;

    for (run = from; run < to; run++) {
        const size_t begin = in->runs->begin[run];
        const size_t end = in->runs->begin[run + 1];
        real *const mean = k->base.in + run * width;

        memset(mean, 0, width * sizeof *mean);
        for (at = begin; at < end; at++)
            for (i = 0; i < width; i++)
                mean[i] += k->token.out[at * width + i];
        for (i = 0; i < width; i++)
            mean[i] /= R(end - begin);
    }
}

/* WRITE's inputs: of every step and slot. */
static void add_own(saga_rate_memory *m, saga_rate_memory_kind *k,
                    const saga_scene *s, size_t from, size_t to)
{
    const size_t hidden = (size_t)s->net[SAGA_NET_WRITE].dim[0];
    const real most = saga_rate_most(s->model.q_in[SAGA_NET_WRITE]);
    size_t run, p, i;

    for (run = from; run < to; run++)
        for (p = 0; p < m->n_slots; p++) {
            real *const h = k->write.in + (run * m->n_slots + p) * hidden;
            const real *const base = k->base.out + run * hidden;
            const real *const own = m->slot.out + p * hidden;

            for (i = 0; i < hidden; i++) {
                const real x = base[i] + own[i];

                h[i] = x < 0 ? 0 : x > most ? most : x;
            }
        }
}

/* Candidates to +-8, gates to +-16. */
static void clamp_writes(real *write, size_t n, size_t width)
{
    size_t i;

    for (i = 0; i < n; i++, write += width + 1) {
        saga_rate_clamp(write, width, SAGA_SLOT_Q);
        saga_rate_clamp(write + width, 1, SAGA_GATE_Q);
    }
}

static int run_write(saga_rate_memory *m, const saga_rate_memory_input *in,
                     size_t from, size_t to)
{
    const saga_net *const base = &in->s->net[SAGA_NET_WRITE_BASE];
    const saga_net *const write = &in->s->net[SAGA_NET_WRITE];
    saga_rate_memory_kind *const k = &m->kind[in->kind];
    const size_t d = m->width, hidden = (size_t)write->dim[0];
    const size_t row = from * m->n_slots, rows = (to - from) * m->n_slots;

    take_means(k, in, d, from, to);
    saga_rate_clamp(k->base.in + from * d, (to - from) * d,
                    in->s->model.q_in[SAGA_NET_WRITE_BASE]);
    if (saga_net_forward(k->base.out + from * hidden, &k->base.work,
                         k->base.in + from * d, to - from, base))
        return -1;
    saga_rate_clamp(k->base.out + from * hidden, (to - from) * hidden,
                    in->s->model.q_in[SAGA_NET_WRITE]);
    add_own(m, k, in->s, from, to);
    if (saga_net_forward(k->write.out + row * (d + 1), &k->write.work,
                         k->write.in + row * hidden, rows, write))
        return -1;
    clamp_writes(k->write.out + row * (d + 1), rows, d);
    return 0;
}

int saga_rate_memory_begin(saga_rate_memory *m, const saga_scene *s)
{
    const saga_net *const net = &s->net[SAGA_NET_SLOT];

    if (saga_net_forward(m->slot.out, &m->slot.work, m->slot.in, m->n_slots,
                         net))
        return -1;
    saga_rate_clamp(m->slot.out, m->n_slots * (size_t)net->dim[net->n_layers],
                    s->model.q_in[SAGA_NET_WRITE]);
    return 0;
}

int saga_rate_memory_write(saga_rate_memory *m,
                           const saga_rate_memory_input *in, size_t from,
                           size_t to)
{
    saga_rate_memory_kind *const k = &m->kind[in->kind];
    const size_t slots = m->n_slots, d = m->width;
    const int plain = is_plain(in->s);
    ptrdiff_t p;

    if (run_blocks(&k->token, in, SAGA_NET_AGG, in->runs->begin[from],
                   in->runs->begin[to]) || run_write(m, in, from, to))
        return -1;
#pragma omp parallel for schedule(static)
    for (p = 0; p < (ptrdiff_t)slots; p++) {
        size_t run;

        for (run = from; run < to; run++) {
            real *const s = m->state + (in->first + run) * slots * d +
                            (size_t)p * d;

            update_forward(s + slots * d, s, k->write.out +
                           (run * slots + (size_t)p) * (d + 1), d, plain);
        }
    }
    return 0;
}

/* --- Backward of the writes ---------------------------------------------- */

void saga_rate_memory_clear(saga_rate_memory *m, const saga_scene *s)
{
    const size_t hidden = (size_t)s->net[SAGA_NET_WRITE].dim[0];

    memset(m->d_last, 0, m->n_slots * m->width * sizeof *m->d_last);
    memset(m->slot.d_out, 0, m->n_slots * hidden * sizeof *m->slot.d_out);
}

/* Slot p through all steps of a level, from its last state's gradient to that
 * of the first; with what was read from each. */
static void slot_backward(saga_rate_memory *m, const saga_rate_memory_input *in,
                          size_t p, int reads)
{
    saga_rate_memory_kind *const k = &m->kind[in->kind];
    const size_t slots = m->n_slots, d = m->width;
    real *const last = m->d_last + p * d;
    size_t run, i;

    for (run = in->runs->n; run-- > 0;) {
        const size_t at = run * slots + p;

        update_backward(last, k->write.d_out + at * (d + 1),
                        m->state + ((in->first + run) * slots + p) * d,
                        k->write.out + at * (d + 1), d, is_plain(in->s));
        for (i = 0; reads && i < d; i++)
            last[i] += k->d_state[at * d + i];
    }
}

static void writes_through(saga_twin_batch *b, size_t n, size_t width)
{
    size_t i;

    for (i = 0; i < n; i++) {
        const size_t at = i * (width + 1);

        saga_rate_through(b->d_out + at, b->out + at, width, SAGA_SLOT_Q);
        saga_rate_through(b->d_out + at + width, b->out + at + width, 1,
                          SAGA_GATE_Q);
    }
}

/* From WRITE's inputs to the steps' and the slots' parts of them. */
static void add_own_backward(saga_rate_memory *m, saga_rate_memory_kind *k,
                             const saga_scene *s, size_t n_runs)
{
    const size_t hidden = (size_t)s->net[SAGA_NET_WRITE].dim[0];
    const int q = s->model.q_in[SAGA_NET_WRITE];
    const size_t n = n_runs * m->n_slots * hidden;
    size_t run, p, i;

    for (i = 0; i < n; i++)
        if (!(k->write.in[i] > 0))
            k->write.d_in[i] = 0;
    saga_rate_through(k->write.d_in, k->write.in, n, q);
    memset(k->base.d_out, 0, n_runs * hidden * sizeof *k->base.d_out);
    for (run = 0; run < n_runs; run++)
        for (p = 0; p < m->n_slots; p++) {
            const real *const d = k->write.d_in +
                                  (run * m->n_slots + p) * hidden;

            for (i = 0; i < hidden; i++) {
                k->base.d_out[run * hidden + i] += d[i];
                m->slot.d_out[p * hidden + i] += d[i];
            }
        }
    saga_rate_through(k->base.d_out, k->base.out, n_runs * hidden, q);
}

/* From the means to the tokens. */
static void means_backward(saga_rate_memory_kind *k,
                           const saga_rate_memory_input *in, size_t width)
{
    size_t run, at, i;

    saga_rate_through(k->base.d_in, k->base.in, in->runs->n * width,
                      in->s->model.q_in[SAGA_NET_WRITE_BASE]);
    for (run = 0; run < in->runs->n; run++) {
        const size_t begin = in->runs->begin[run];
        const size_t end = in->runs->begin[run + 1];

        for (at = begin; at < end; at++)
            for (i = 0; i < width; i++)
                k->token.d_out[at * width + i] =
                    k->base.d_in[run * width + i] / R(end - begin);
    }
}

static int write_backward(saga_rate_memory *m, saga_scene *d,
                          const saga_rate_features *dx,
                          const saga_rate_memory_input *in, int reads)
{
    const saga_net *const net = in->s->net;
    saga_rate_memory_kind *const k = &m->kind[in->kind];
    const size_t rows = in->runs->n * m->n_slots;
    ptrdiff_t p;

#pragma omp parallel for schedule(static)
    for (p = 0; p < (ptrdiff_t)m->n_slots; p++)
        slot_backward(m, in, (size_t)p, reads);
    writes_through(&k->write, rows, m->width);
    if (saga_net_backward(k->write.d_in, &d->net[SAGA_NET_WRITE],
                          &k->write.work, k->write.d_out, k->write.in, rows,
                          &net[SAGA_NET_WRITE]))
        return -1;
    add_own_backward(m, k, in->s, in->runs->n);
    if (saga_net_backward(k->base.d_in, &d->net[SAGA_NET_WRITE_BASE],
                          &k->base.work, k->base.d_out, k->base.in,
                          in->runs->n, &net[SAGA_NET_WRITE_BASE]))
        return -1;
    means_backward(k, in, m->width);
    return blocks_backward(d, dx, &k->token, in, SAGA_NET_AGG);
}

/* Primitives: what they all read from the last state. */
static void add_last(saga_rate_memory *m, size_t n_runs)
{
    const size_t n = m->n_slots * m->width;
    const real *const d = m->kind[SAGA_KIND_PRIM].d_state;
    size_t run, i;

    for (run = 0; run < n_runs; run++)
        for (i = 0; i < n; i++)
            m->d_last[i] += d[run * n + i];
}

/* What was read: queries, and the states they were answered from. */
static int read_backward(saga_rate_memory *m, saga_scene *d,
                         const saga_rate_features *dx,
                         const saga_rate_memory_input *in)
{
    ptrdiff_t run;

    if (alloc_readers(m))
        return -1;
#pragma omp parallel for schedule(dynamic, 1)
    for (run = 0; run < (ptrdiff_t)in->runs->n; run++)
        read_run_backward(m, in, (size_t)run);
    if (in->kind == SAGA_KIND_PRIM)
        add_last(m, in->runs->n);
    return blocks_backward(d, dx, &m->kind[in->kind].query, in,
                           SAGA_NET_QUERY);
}

int saga_rate_memory_backward(saga_rate_memory *m, saga_scene *d,
                              const saga_rate_features *dx,
                              const saga_rate_memory_input *in, int reads)
{
    if (reads && read_backward(m, d, dx, in))
        return -1;
    return in->kind == SAGA_KIND_PRIM ? 0
         : write_backward(m, d, dx, in, reads);
}

int saga_rate_memory_end(saga_rate_memory *m, saga_scene *d,
                         const saga_scene *s)
{
    const saga_net *const net = &s->net[SAGA_NET_SLOT];

    saga_rate_through(m->slot.d_out, m->slot.out, m->n_slots *
                      (size_t)net->dim[net->n_layers],
                      s->model.q_in[SAGA_NET_WRITE]);
    return saga_net_backward(NULL, &d->net[SAGA_NET_SLOT], &m->slot.work,
                             m->slot.d_out, m->slot.in, m->n_slots, net);
}
