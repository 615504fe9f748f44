/* SPDX-License-Identifier: MIT */
#include "bank_twin.h"

#include "alloc.h"
#include "arena.h"
#include "bank_blocks.h"
#include "bank_float.h"
#include "threads.h"

#include <stdlib.h>
#include <string.h>

/* Estimates of time, by which work is divided among threads: nanoseconds for
 * one block to read one slot, and for a round to update one slot. */
enum { READ_NS = 20, SLOT_NS = 200 };

/* --- Memory -------------------------------------------------------------- */

static const char purpose[] = "the memory bank";

/* Places a batch with its gradients. */
static void take_whole(saga_twin_batch *b, saga_arena *a, const saga_net *net,
                       size_t rows)
{
    saga_twin_batch_take(b, a, net, rows);
    b->d_in = saga_arena_take(a, rows * (size_t)net->dim[0]);
    b->d_out = saga_arena_take(a, rows * (size_t)net->dim[net->n_layers]);
}

static void lay_out(saga_bank_twin *m, saga_arena *a, const saga_scene *s)
{
    const saga_net *const net = s->net;
    const size_t slots = m->n_slots, state = slots * m->width;
    size_t n_states = 1;
    int kind;

    for (kind = 0; kind < SAGA_N_KINDS; kind++) {
        saga_bank_twin_kind *const k = &m->kind[kind];
        const size_t blocks = saga_rate_n_blocks(s, kind);
        const size_t runs = saga_rate_runs_most(s, kind);

        take_whole(&k->query, a, &net[SAGA_NET_QUERY], blocks);
        k->d_state = saga_arena_take(a, runs * state);
        k->read = saga_arena_take(a, blocks * m->width);
        k->d_read = saga_arena_take(a, blocks * m->width);
        if (kind == SAGA_KIND_PRIM)
            continue;
        take_whole(&k->token, a, &net[SAGA_NET_AGG], blocks);
        take_whole(&k->base, a, &net[SAGA_NET_WRITE_BASE], runs);
        take_whole(&k->write, a, &net[SAGA_NET_WRITE], runs * slots);
        n_states += runs;
    }
    take_whole(&m->slot, a, &net[SAGA_NET_SLOT], slots);
    /* One state before the first run, and one after each run that writes. */
    m->state = saga_arena_take(a, n_states * state);
    m->d_last = saga_arena_take(a, state);
}

/* Allocates the memory that the networks' passes need. */
static bool reserve(saga_bank_twin *m, const saga_scene *s, saga_error *error)
{
    const saga_net *const net = s->net;
    int kind;

    for (kind = 0; kind < SAGA_N_KINDS; kind++) {
        saga_bank_twin_kind *const k = &m->kind[kind];
        const size_t blocks = saga_rate_n_blocks(s, kind);
        const size_t runs = saga_rate_runs_most(s, kind);

        if (!saga_net_reserve(&k->query.work, &net[SAGA_NET_QUERY], blocks,
                              error))
            return false;
        /* Primitives read the bank but do not write. */
        if (kind == SAGA_KIND_PRIM)
            continue;
        if (!saga_net_reserve(&k->token.work, &net[SAGA_NET_AGG], blocks,
                              error) ||
            !saga_net_reserve(&k->base.work, &net[SAGA_NET_WRITE_BASE], runs,
                              error) ||
            !saga_net_reserve(&k->write.work, &net[SAGA_NET_WRITE],
                              runs * m->n_slots, error))
            return false;
    }
    /* Each thread needs scratch for the operators; slots are embedded once. */
    m->n_threads = saga_n_threads();
    m->scratch = saga_alloc(m->n_threads *
                                saga_bank_float_scratch(m->n_slots, m->width),
                            sizeof *m->scratch, purpose, error);
    return m->scratch && saga_net_reserve(&m->slot.work, &net[SAGA_NET_SLOT],
                                          m->n_slots, error);
}

bool saga_bank_twin_init(saga_bank_twin *m, const saga_scene *s,
                         saga_error *error)
{
    saga_arena a = { NULL, 0 };
    size_t p;

    memset(m, 0, sizeof *m);
    if (!(s->model.tools & SAGA_TOOL_BANK))
        return true;
    m->n_slots = s->model.bank_slots;
    m->width = s->model.bank_width;
    lay_out(m, &a, s);
    m->block = saga_arena_alloc(&a, purpose, error);
    if (m->block)
        lay_out(m, &a, s);
    if (!m->block || !reserve(m, s, error) ||
        !saga_bank_float_start(m->state, m->n_slots, m->width, error)) {
        saga_bank_twin_free(m);
        return false;
    }
    /* The input of SLOT is a slot's index, as a 1 among zeros. */
    for (p = 0; p < m->n_slots; p++)
        m->slot.in[p * m->n_slots + p] = 1;
    return true;
}

void saga_bank_twin_free(saga_bank_twin *m)
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

/* --- Reads --------------------------------------------------------------- */

/* The inputs of a pass over the bank. */
typedef struct {
    saga_bank_twin *m;
    const saga_bank_twin_input *in;
    int reads;
    size_t from, to; /* rounds */
} job;

/* Returns the bank in the state that a run reads. All primitives read the last
 * state. */
static saga_bank_float bank_of(const saga_bank_twin *m,
                               const saga_bank_twin_input *in, size_t run)
{
    const size_t state = in->first + (in->kind == SAGA_KIND_PRIM ? 0 : run);

    return saga_bank_float_of(
        m->state + state * m->n_slots * m->width, m->n_slots, m->width,
        m->scratch + saga_thread_number() *
                         saga_bank_float_scratch(m->n_slots, m->width));
}

/* Calls `run` for rounds from..to-1. `times` is the cost relative to a read. */
static void do_runs(void (*run)(void *, size_t), job *j, int times)
{
    const uint32_t *const begin = j->in->runs->begin;

    saga_parallel(
        &(saga_tasks){ .run = run,
                       .user = j,
                       .n = j->to - j->from,
                       .most = j->m->n_threads,
                       .ns = (double)READ_NS * times * (double)j->m->n_slots *
                             (double)(begin[j->to] - begin[j->from]) });
}

static void read_run(void *user, size_t nth)
{
    const job *const j = user;
    saga_bank_twin *const m = j->m;
    const saga_bank_twin_input *const in = j->in;
    const size_t run = j->from + nth;
    saga_bank_twin_kind *const k = &m->kind[in->kind];
    const saga_bank_float b = bank_of(m, in, run);
    const size_t begin = in->runs->begin[run];

    saga_bank_float_read(k->read + begin * m->width, &b,
                         k->query.out + begin * m->width,
                         in->runs->begin[run + 1] - begin);
}

void saga_bank_twin_read(saga_bank_twin *m, const saga_bank_twin_input *in,
                         size_t from, size_t to)
{
    job j = { .m = m, .in = in, .from = from, .to = to };

    saga_bank_blocks_run(&m->kind[in->kind].query, in, SAGA_NET_QUERY,
                         in->runs->begin[from], in->runs->begin[to]);
    do_runs(read_run, &j, 1);
}

/* Sets d_state of the run and the gradients of its queries. */
static void read_run_backward(void *user, size_t run)
{
    const job *const j = user;
    saga_bank_twin *const m = j->m;
    const saga_bank_twin_input *const in = j->in;
    saga_bank_twin_kind *const k = &m->kind[in->kind];
    const saga_bank_float b = bank_of(m, in, run);
    const size_t d = m->width, n = m->n_slots * d;
    const size_t begin = in->runs->begin[run];

    /* Each run has its own gradients of the state that it read, since several
     * runs, on different threads, may read the same state. They are added in
     * order later. */
    memset(k->d_state + run * n, 0, n * sizeof *k->d_state);
    saga_bank_float_read_backward(
        k->query.d_out + begin * d, k->d_state + run * n, &b,
        k->d_read + begin * d, k->query.out + begin * d,
        in->runs->begin[run + 1] - begin);
}

/* --- Writes -------------------------------------------------------------- */

static int is_plain(const saga_scene *s)
{
    return (s->model.tools & SAGA_TOOL_PLAIN_WRITE) != 0;
}

/* Sets the inputs of WRITE_BASE, the mean token of each run. */
static void take_means(saga_bank_twin_kind *k, const saga_bank_twin_input *in,
                       size_t width, size_t from, size_t to)
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

/* Sets the inputs of WRITE for every round and slot. */
static void add_own(saga_bank_twin *m, saga_bank_twin_kind *k,
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

            for (i = 0; i < hidden; i++)
                h[i] = saga_clamp(base[i] + own[i], 0, most);
        }
}

/* Clamps candidates to +-8 and gates to +-16. */
static void clamp_writes(real *write, size_t n, size_t width)
{
    size_t i;

    for (i = 0; i < n; i++, write += width + 1) {
        saga_rate_clamp(write, width, SAGA_SLOT_Q);
        saga_rate_clamp(write + width, 1, SAGA_GATE_Q);
    }
}

static void run_write(saga_bank_twin *m, const saga_bank_twin_input *in,
                      size_t from, size_t to)
{
    const saga_net *const base = &in->s->net[SAGA_NET_WRITE_BASE];
    const saga_net *const write = &in->s->net[SAGA_NET_WRITE];
    saga_bank_twin_kind *const k = &m->kind[in->kind];
    const size_t d = m->width, hidden = (size_t)write->dim[0];
    const size_t row = from * m->n_slots, rows = (to - from) * m->n_slots;

    /* For each round, WRITE_BASE runs on the mean of its tokens. */
    take_means(k, in, d, from, to);
    saga_rate_clamp(k->base.in + from * d, (to - from) * d,
                    in->s->model.q_in[SAGA_NET_WRITE_BASE]);
    saga_net_forward(k->base.out + from * hidden, &k->base.work,
                     k->base.in + from * d, to - from, base);
    saga_rate_clamp(k->base.out + from * hidden, (to - from) * hidden,
                    in->s->model.q_in[SAGA_NET_WRITE]);
    /* For each round and slot, WRITE runs on the sum of that output and the
     * slot's own vector; it gives the candidate and the gate. */
    add_own(m, k, in->s, from, to);
    saga_net_forward(k->write.out + row * (d + 1), &k->write.work,
                     k->write.in + row * hidden, rows, write);
    clamp_writes(k->write.out + row * (d + 1), rows, d);
}

void saga_bank_twin_begin(saga_bank_twin *m, const saga_scene *s)
{
    const saga_net *const net = &s->net[SAGA_NET_SLOT];

    saga_net_forward(m->slot.out, &m->slot.work, m->slot.in, m->n_slots, net);
    saga_rate_clamp(m->slot.out, m->n_slots * (size_t)net->dim[net->n_layers],
                    s->model.q_in[SAGA_NET_WRITE]);
}

/* Updates slot p in all rounds. */
static void update_slot(void *user, size_t p)
{
    const job *const j = user;
    const saga_bank_twin *const m = j->m;
    const saga_bank_twin_kind *const k = &m->kind[j->in->kind];
    const size_t slots = m->n_slots, d = m->width;
    size_t run;

    for (run = j->from; run < j->to; run++) {
        /* Slots do not read each other, so each can go through all rounds
         * alone. The states are kept for the backward pass. */
        real *const s = m->state + (j->in->first + run) * slots * d + p * d;

        saga_bank_float_update(s + slots * d, s,
                               k->write.out + (run * slots + p) * (d + 1), d,
                               is_plain(j->in->s));
    }
}

/* Calls `run` for every slot; each call covers n_runs rounds. */
static void do_slots(void (*run)(void *, size_t), job *j, size_t n_runs)
{
    const size_t n = j->m->n_slots;

    saga_parallel(
        &(saga_tasks){ .run = run,
                       .user = j,
                       .n = n,
                       .ns = (double)SLOT_NS * (double)n * (double)n_runs });
}

void saga_bank_twin_write(saga_bank_twin *m, const saga_bank_twin_input *in,
                          size_t from, size_t to)
{
    saga_bank_twin_kind *const k = &m->kind[in->kind];
    job j = { .m = m, .in = in, .from = from, .to = to };

    /* All networks run first, for all rounds, because they do not read the
     * slots. Only the updates depend on the previous round. */
    saga_bank_blocks_run(&k->token, in, SAGA_NET_AGG, in->runs->begin[from],
                         in->runs->begin[to]);
    run_write(m, in, from, to);
    do_slots(update_slot, &j, to - from);
}

/* --- Backward of the writes ---------------------------------------------- */

void saga_bank_twin_clear(saga_bank_twin *m, const saga_scene *s)
{
    const size_t hidden = (size_t)s->net[SAGA_NET_WRITE].dim[0];

    memset(m->d_last, 0, m->n_slots * m->width * sizeof *m->d_last);
    memset(m->slot.d_out, 0, m->n_slots * hidden * sizeof *m->slot.d_out);
}

/* Goes back with slot p through all rounds of a tier, from the gradient of the
 * last state to that of the first, adding the gradients of what was read from
 * each. */
static void slot_backward(void *user, size_t p)
{
    const job *const j = user;
    saga_bank_twin *const m = j->m;
    const saga_bank_twin_input *const in = j->in;
    saga_bank_twin_kind *const k = &m->kind[in->kind];
    const size_t slots = m->n_slots, d = m->width;
    real *const last = m->d_last + p * d;
    size_t run, i;

    for (run = in->runs->n; run-- > 0;) {
        const size_t at = run * slots + p;

        /* Until here `last` is the gradient with respect to the slot after the
         * round; from here on with respect to the slot before the round. The
         * blocks of the round have read that slot, which the loop adds. */
        saga_bank_float_update_backward(
            last, k->write.d_out + at * (d + 1),
            m->state + ((in->first + run) * slots + p) * d,
            k->write.out + at * (d + 1), d, is_plain(in->s));
        for (i = 0; j->reads && i < d; i++)
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

/* Distributes the gradients of WRITE's inputs to the rounds' and the slots'
 * summands. */
static void add_own_backward(saga_bank_twin *m, saga_bank_twin_kind *k,
                             const saga_scene *s, size_t n_runs)
{
    const size_t hidden = (size_t)s->net[SAGA_NET_WRITE].dim[0];
    const int q = s->model.q_in[SAGA_NET_WRITE];
    const size_t n = n_runs * m->n_slots * hidden;
    size_t run, p, i;

    /* h = min(max(base + own, 0), most) has no gradient where it is 0, and at
     * `most` only gradients that lead inside. */
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

/* Distributes the gradients of the means to the tokens. */
static void means_backward(saga_bank_twin_kind *k,
                           const saga_bank_twin_input *in, size_t width)
{
    size_t run, at, i;

    saga_rate_through(k->base.d_in, k->base.in, in->runs->n * width,
                      in->s->model.q_in[SAGA_NET_WRITE_BASE]);
    for (run = 0; run < in->runs->n; run++) {
        const size_t begin = in->runs->begin[run];
        const size_t end = in->runs->begin[run + 1];

        for (at = begin; at < end; at++)
            for (i = 0; i < width; i++)
                k->token.d_out[at * width + i] = k->base.d_in[run * width + i] /
                                                 R(end - begin);
    }
}

static void write_backward(saga_bank_twin *m, saga_scene *d,
                           const saga_rate_features *dx,
                           const saga_bank_twin_input *in, int reads)
{
    const saga_net *const net = in->s->net;
    saga_bank_twin_kind *const k = &m->kind[in->kind];
    const size_t rows = in->runs->n * m->n_slots;
    job j = { .m = m, .in = in, .reads = reads };

    /* The order is reversed: slots, WRITE, its two summands, WRITE_BASE, means,
     * tokens. The gradients of the slots' own vectors are complete only after
     * all tiers (saga_bank_twin_end). */
    do_slots(slot_backward, &j, in->runs->n);
    writes_through(&k->write, rows, m->width);
    saga_net_backward(k->write.d_in, &d->net[SAGA_NET_WRITE], &k->write.work,
                      k->write.d_out, k->write.in, rows, &net[SAGA_NET_WRITE]);
    add_own_backward(m, k, in->s, in->runs->n);
    saga_net_backward(k->base.d_in, &d->net[SAGA_NET_WRITE_BASE], &k->base.work,
                      k->base.d_out, k->base.in, in->runs->n,
                      &net[SAGA_NET_WRITE_BASE]);
    means_backward(k, in, m->width);
    saga_bank_blocks_backward(d, dx, &k->token, in, SAGA_NET_AGG);
}

/* Adds the gradients of all primitives' reads from the last state. */
static void add_last(saga_bank_twin *m, size_t n_runs)
{
    const size_t n = m->n_slots * m->width;
    const real *const d = m->kind[SAGA_KIND_PRIM].d_state;
    size_t run, i;

    for (run = 0; run < n_runs; run++)
        for (i = 0; i < n; i++)
            m->d_last[i] += d[run * n + i];
}

/* Goes back through the reads, to the queries and the states. */
static void read_backward(saga_bank_twin *m, saga_scene *d,
                          const saga_rate_features *dx,
                          const saga_bank_twin_input *in)
{
    job j = { .m = m, .in = in, .to = in->runs->n };

    do_runs(read_run_backward, &j, 2);
    if (in->kind == SAGA_KIND_PRIM)
        add_last(m, in->runs->n);
    saga_bank_blocks_backward(d, dx, &m->kind[in->kind].query, in,
                              SAGA_NET_QUERY);
}

void saga_bank_twin_backward(saga_bank_twin *m, saga_scene *d,
                             const saga_rate_features *dx,
                             const saga_bank_twin_input *in, int reads)
{
    /* Reads come first, because the writes start from the gradients of states
     * that reads give. */
    if (reads)
        read_backward(m, d, dx, in);
    if (in->kind != SAGA_KIND_PRIM)
        write_backward(m, d, dx, in, reads);
}

void saga_bank_twin_end(saga_bank_twin *m, saga_scene *d, const saga_scene *s)
{
    const saga_net *const net = &s->net[SAGA_NET_SLOT];

    saga_rate_through(m->slot.d_out, m->slot.out,
                      m->n_slots * (size_t)net->dim[net->n_layers],
                      s->model.q_in[SAGA_NET_WRITE]);
    saga_net_backward(NULL, &d->net[SAGA_NET_SLOT], &m->slot.work,
                      m->slot.d_out, m->slot.in, m->n_slots, net);
}
