/* SPDX-License-Identifier: MIT */
#include "net.h"

#include "alloc.h"
#include "dense.h"
#include "rng.h"
#include "threads.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

enum {
    CHUNK = SAGA_NET_CHUNK,
    MAX_BLOCKS = 32, /* separate sums of gradients */
    MIN_BLOCK = 512  /* points */
};

/* Nanoseconds to add one number of one block. */
#define SUM_NS 0.3

static size_t dim(const saga_net *net, int l)
{
    return (size_t)net->dim[l];
}

static size_t pad(const saga_net *net, int l)
{
    return saga_dense_pad(dim(net, l));
}

size_t saga_net_n_params(const saga_net *net)
{
    size_t n = 0;
    int l;

    for (l = 0; l < net->n_layers; l++)
        n += (dim(net, l) + 1) * dim(net, l + 1);
    return n;
}

void saga_net_bind(saga_net *net, real *params)
{
    int l;

    for (l = 0; l < net->n_layers; l++) {
        net->w[l] = params;
        net->b[l] = params + dim(net, l) * dim(net, l + 1);
        params += (dim(net, l) + 1) * dim(net, l + 1);
    }
}

void saga_net_init(saga_net *net, unsigned long long seed)
{
    int l;

    for (l = 0; l < net->n_layers; l++) {
        const saga_rng r = saga_rng_stream(seed, (uint64_t)l);
        const size_t n = dim(net, l) * dim(net, l + 1);
        /* A uniform number in +-h has variance h^2 / 3. */
        const double gain = l + 1 < net->n_layers ? 6 : 3;
        const double half = sqrt(gain / net->dim[l]);
        size_t i;

        for (i = 0; i < n; i++)
            net->w[l][i] = R(half * (2 * saga_rng_double(r, i) - 1));
        memset(net->b[l], 0, dim(net, l + 1) * sizeof(real));
    }
}

/* --- Packed weights ------------------------------------------------------ */

/* One layer in work->packed: transposed (dim[l], pad(l + 1)), bias
 * (pad(l + 1)), not transposed (dim[l + 1], pad(l)). */
typedef struct {
    const real *across, *bias, *along;
} layer_weights;

static size_t layer_size(const saga_net *net, int l)
{
    return (dim(net, l) + 1) * pad(net, l + 1) + dim(net, l + 1) * pad(net, l);
}

static layer_weights weights_of(const saga_net_work *work, const saga_net *net,
                                int l)
{
    const real *at = work->packed;
    layer_weights lw;
    int i;

    for (i = 0; i < l; i++)
        at += layer_size(net, i);
    lw.across = at;
    lw.bias = lw.across + dim(net, l) * pad(net, l + 1);
    lw.along = lw.bias + pad(net, l + 1);
    return lw;
}

static void pack_layer(real *at, const saga_net *net, int l)
{
    const size_t n_in = dim(net, l), n_out = dim(net, l + 1);
    const size_t wide = pad(net, l + 1), narrow = pad(net, l);
    real *const bias = at + n_in * wide;
    real *const along = bias + wide;
    size_t i, o;

    /* Vectors run along the outputs in the forward pass and along the inputs in
     * the backward pass, so both orders are stored. The padding is 0. */
    memset(at, 0, layer_size(net, l) * sizeof *at);
    memcpy(bias, net->b[l], n_out * sizeof *bias);
    for (o = 0; o < n_out; o++)
        for (i = 0; i < n_in; i++) {
            at[i * wide + o] = net->w[l][o * n_in + i];
            along[o * narrow + i] = net->w[l][o * n_in + i];
        }
}

static size_t packed_size(const saga_net *net)
{
    size_t n = 0;
    int l;

    for (l = 0; l < net->n_layers; l++)
        n += layer_size(net, l);
    return n;
}

static void pack(saga_net_work *work, const saga_net *net)
{
    real *at = work->packed;
    int l;

    for (l = 0; l < net->n_layers; at += layer_size(net, l), l++)
        pack_layer(at, net, l);
}

/* --- Blocks and chunks --------------------------------------------------- */

static size_t widest(const saga_net *net)
{
    size_t top = 0;
    int l;

    for (l = 0; l <= net->n_layers; l++)
        top = pad(net, l) > top ? pad(net, l) : top;
    return top;
}

/* Returns the number of reals in a thread's scratch: three chunks of the widest
 * layer. */
static size_t scratch_size(const saga_net *net)
{
    return 3 * CHUNK * widest(net);
}

/* Returns the number of points in a block, a multiple of CHUNK that depends
 * only on m. */
static size_t block_size(size_t m)
{
    const size_t share = (m + MAX_BLOCKS - 1) / MAX_BLOCKS;
    const size_t n = share > MIN_BLOCK ? share : MIN_BLOCK;

    return (n + CHUNK - 1) / CHUNK * CHUNK;
}

/* Copies n rows to rows of another stride; the excess is 0. */
static void copy_rows(real *to, size_t to_stride, const real *from,
                      size_t from_stride, size_t n)
{
    const size_t len = to_stride < from_stride ? to_stride : from_stride;
    size_t i;

    for (i = 0; i < n; i++) {
        saga_copy_row(to + i * to_stride, from + i * from_stride, len);
        for (size_t k = len; k < to_stride; k++)
            to[i * to_stride + k] = 0;
    }
}

/* --- Forward ------------------------------------------------------------- */

typedef saga_net_pass pass;

/* Returns the scratch of the present thread. */
static real *scratch_of(const pass *p)
{
    return p->work->chunk + scratch_size(p->net) * saga_thread_number();
}

static size_t chunk_at(size_t begin, size_t end)
{
    return end - begin < CHUNK ? end - begin : CHUNK;
}

static void forward_chunk(const pass *p, size_t begin)
{
    const saga_net *const net = p->net;
    const int last = net->n_layers - 1;
    const size_t n = chunk_at(begin, p->m), n_out = dim(net, last + 1);
    const int whole = pad(net, last + 1) == n_out;
    real *const scratch = scratch_of(p);
    saga_dense_rows in = { p->x + begin * dim(net, 0), n, dim(net, 0),
                           dim(net, 0) };
    int l;

    for (l = 0; l <= last; l++) {
        const layer_weights lw = weights_of(p->work, net, l);
        const saga_dense layer = { lw.across, lw.bias, dim(net, l + 1),
                                   l < last, NULL };
        /* Hidden layers are kept for the backward pass, padded. The last layer
         * is written to y if its rows need no padding, otherwise to the scratch
         * first. */
        real *const out = l < last
                              ? p->work->hidden[l] + begin * pad(net, l + 1)
                          : whole ? p->y + begin * n_out
                                  : scratch;

        saga_dense_forward(out, &layer, &in);
        in = (saga_dense_rows){ out, n, dim(net, l + 1), pad(net, l + 1) };
    }
    if (!whole)
        copy_rows(p->y + begin * n_out, n_out, scratch, pad(net, last + 1), n);
}

void saga_net_begin(const saga_net_pass *p)
{
    assert(p->m <= p->work->n_points);
    pack(p->work, p->net);
}

void saga_net_chunk_forward(const saga_net_pass *p, size_t chunk)
{
    forward_chunk(p, chunk * CHUNK);
}

double saga_net_ns(const saga_net *net)
{
    return 10 + 0.02 * (double)saga_net_n_params(net);
}

static void run_chunk(void *user, size_t chunk)
{
    saga_net_chunk_forward(user, chunk);
}

void saga_net_forward(real *y, saga_net_work *work, const real *x, size_t m,
                      const saga_net *net)
{
    pass p = { .net = net, .work = work, .x = x, .y = y, .m = m };

    saga_net_begin(&p);
    saga_parallel(&(saga_tasks){ .run = run_chunk,
                                 .user = &p,
                                 .n = saga_n_parts(m, CHUNK),
                                 .ns = saga_net_ns(net) * (double)m,
                                 .most = work->n_threads });
}

/* --- Backward ------------------------------------------------------------ */

/* Returns the size of a block's padded gradients: for each layer dw
 * (dim[l + 1], pad(l)) and db. */
static size_t partial_size(const saga_net *net)
{
    size_t n = 0;
    int l;

    for (l = 0; l < net->n_layers; l++)
        n += dim(net, l + 1) * (pad(net, l) + 1);
    return n;
}

/* Returns the padded input of layer l for n points from begin on, copied to
 * scratch if it is not padded already. */
static const real *input_of(const pass *p, int l, size_t begin, size_t n,
                            real *scratch)
{
    const size_t n_in = dim(p->net, l);

    if (l > 0)
        return p->work->hidden[l - 1] + begin * pad(p->net, l);
    if (pad(p->net, 0) == n_in)
        return p->x + begin * n_in;
    copy_rows(scratch, pad(p->net, 0), p->x + begin * n_in, n_in, n);
    return scratch;
}

/* Returns the sums of a block. */
static real *partial_of(const pass *p, size_t block)
{
    return p->work->partial + block * partial_size(p->net);
}

/* Returns where the scratch has the gradients of layer l's inputs, or, for
 * l = n_layers, those of the outputs. It holds the padded input and,
 * alternately, two gradients. */
static real *d_layer(const pass *p, int l)
{
    return scratch_of(p) + (size_t)(1 + (l & 1)) * CHUNK * widest(p->net);
}

saga_net_rows saga_net_dy(const saga_net_pass *p)
{
    const int l = p->net->n_layers;

    return (saga_net_rows){ d_layer(p, l), pad(p->net, l) };
}

saga_net_rows saga_net_chunk_backward(const saga_net_pass *p, size_t chunk,
                                      const real *dy, size_t dy_stride)
{
    const saga_net *const net = p->net;
    const size_t begin = chunk * CHUNK, n = chunk_at(begin, p->m);
    saga_dense_rows d = { dy, n, dim(net, net->n_layers), dy_stride };
    real *at = partial_of(p, begin / block_size(p->m)) + partial_size(net);
    int l;

    for (l = net->n_layers - 1;; l--) {
        const size_t n_in = dim(net, l), stride = pad(net, l);
        const saga_dense_rows in = { input_of(p, l, begin, n, scratch_of(p)), n,
                                     n_in, stride };
        const bool is_rectified = l > 0 || p->x_is_rectified;
        const saga_dense back = { .w = weights_of(p->work, net, l).along,
                                  .n_out = n_in,
                                  .active = is_rectified ? in.at : NULL };
        real *const d_in = d_layer(p, l);

        /* Sums are stored from the first layer to the last; the loop starts
         * with the last. */
        at -= d.width * (stride + 1);
        saga_dense_backward(at, &d, &in);
        saga_dense_bias_backward(at + d.width * stride, &d);
        if (l == 0 && p->x_is_constant)
            return (saga_net_rows){ NULL, 0 };
        saga_dense_forward(d_in, &back, &d);
        if (l == 0)
            return (saga_net_rows){ d_in, stride };
        d = (saga_dense_rows){ d_in, n, n_in, stride };
    }
}

size_t saga_net_n_blocks(size_t m)
{
    return saga_n_parts(m, block_size(m));
}

saga_range saga_net_block_chunks(size_t m, size_t block)
{
    return saga_part(saga_n_parts(m, CHUNK), block_size(m) / CHUNK, block);
}

void saga_net_block_begin(const saga_net_pass *p, size_t block)
{
    memset(partial_of(p, block), 0, partial_size(p->net) * sizeof(real));
}

/* There is one sum for each output of each layer, of its weights and bias. */
size_t saga_net_n_sums(const saga_net *net)
{
    size_t n = 0;
    int l;

    for (l = 0; l < net->n_layers; l++)
        n += dim(net, l + 1);
    return n;
}

double saga_net_sums_ns(const saga_net *net, size_t m)
{
    return SUM_NS * (double)(saga_net_n_blocks(m) * saga_net_n_params(net));
}

/* Adds sum number `sum` of all blocks, in their order. */
void saga_net_add_sum(saga_net *d, const saga_net_pass *p, size_t sum)
{
    const size_t size = partial_size(d), n_blocks = saga_net_n_blocks(p->m);
    const real *at = p->work->partial;
    size_t n_in, stride, k, i;
    int l;

    /* Finds the layer of this output, and its row there. */
    for (l = 0; sum >= dim(d, l + 1); l++) {
        at += dim(d, l + 1) * (pad(d, l) + 1);
        sum -= dim(d, l + 1);
    }
    n_in = dim(d, l);
    stride = pad(d, l);
    for (k = 0; k < n_blocks; k++, at += size) {
        for (i = 0; i < n_in; i++)
            d->w[l][sum * n_in + i] += at[sum * stride + i];
        d->b[l][sum] += at[dim(d, l + 1) * stride + sum];
    }
}

typedef struct {
    pass p;
    const real *dy;
    real *dx;
    saga_net *d;
} back;

static void run_block(void *user, size_t block)
{
    const back *const b = user;
    const pass *const p = &b->p;
    const saga_range of = saga_net_block_chunks(p->m, block);
    const size_t n_in = dim(p->net, 0), n_out = dim(p->net, p->net->n_layers);
    size_t i;

    saga_net_block_begin(p, block);
    /* One thread adds the chunks, so the sum of a block has a fixed order. */
    for (i = of.begin; i < of.end; i++) {
        const size_t at = i * CHUNK;
        const saga_net_rows dx = saga_net_chunk_backward(
            p, i, b->dy + at * n_out, n_out);

        if (dx.at)
            copy_rows(b->dx + at * n_in, n_in, dx.at, dx.stride,
                      chunk_at(at, p->m));
    }
}

static void run_sum(void *user, size_t sum)
{
    const back *const b = user;

    saga_net_add_sum(b->d, &b->p, sum);
}

void saga_net_backward(real *dx, saga_net *d, saga_net_work *work,
                       const real *dy, const real *x, size_t m,
                       const saga_net *net)
{
    back b = {
        { .net = net, .work = work, .x = x, .m = m, .x_is_constant = !dx },
        dy,
        dx,
        d
    };
    const size_t n_blocks = saga_net_n_blocks(m);

    assert(m <= work->n_points);
    saga_parallel(&(saga_tasks){ .run = run_block,
                                 .user = &b,
                                 .n = n_blocks,
                                 .ns = 2 * saga_net_ns(net) * (double)m,
                                 .most = work->n_threads });
    saga_parallel(&(saga_tasks){ .run = run_sum,
                                 .user = &b,
                                 .n = saga_net_n_sums(net),
                                 .ns = saga_net_sums_ns(net, m) });
}

/* --- Memory -------------------------------------------------------------- */

void saga_net_free(saga_net_work *work)
{
    int l;

    for (l = 0; l < SAGA_NET_LAYERS; l++)
        free(work->hidden[l]);
    free(work->packed);
    free(work->chunk);
    free(work->partial);
    memset(work, 0, sizeof *work);
}

static real *reals(size_t n, saga_error *error)
{
    return saga_aligned_alloc(64, n * sizeof(real), "a network", error);
}

bool saga_net_reserve(saga_net_work *work, const saga_net *net, size_t m,
                      saga_error *error)
{
    /* The number of blocks of m points (block_size); fewer points give no
     * more. */
    const size_t n_blocks = m < MIN_BLOCK * MAX_BLOCKS
                                ? (m + MIN_BLOCK - 1) / MIN_BLOCK
                                : MAX_BLOCKS;
    bool ok = true;
    int l;

    *work = (saga_net_work){ .n_points = m, .n_threads = saga_n_threads() };
    for (l = 0; l + 1 < net->n_layers; l++) {
        work->hidden[l] = reals(m * pad(net, l + 1), error);
        ok = ok && work->hidden[l];
    }
    work->packed = reals(packed_size(net), error);
    work->chunk = reals(scratch_size(net) * work->n_threads, error);
    work->partial = reals(n_blocks * partial_size(net), error);
    ok = ok && work->packed && work->chunk && work->partial;
    if (!ok)
        saga_net_free(work);
    return ok;
}
