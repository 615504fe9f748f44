/* SPDX-License-Identifier: MIT */
#include "gpu_blocks.h"

#include "alloc.h"
#include "gpu_frame.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

static const char what[] = "features";

/* kernels/blocks.glsl */
typedef struct {
    uint32_t n_blocks, n_groups, width, stride, number;
    float c1, c2, beta1, beta2, eps, most, rate;
} push;

/* Words of the flag. */
enum { IS_UNSOUND, IS_IDLE, N_FLAGS };

struct saga_gpu_blocks {
    saga_gpu *gpu;
    saga_gpu_buffer state, x, g, span, flag; /* the device */
    saga_gpu_buffer up, down;
};

/* --- Memory -------------------------------------------------------------- */

static size_t state_nbytes(size_t n, size_t width)
{
    return saga_block_adam_size(n, width) * sizeof(real);
}

static size_t rows_nbytes(const saga_block_adam *b)
{
    return b->n * b->stride * sizeof *b->x;
}

bool saga_gpu_has_blocks(const saga_gpu *gpu, size_t n, size_t width)
{
    return state_nbytes(n, width) <= saga_gpu_most(gpu);
}

saga_gpu_blocks *saga_gpu_blocks_new(saga_gpu *gpu, saga_error *error)
{
    saga_gpu_blocks *const s = saga_calloc(1, sizeof *s, "the GPU", error);

    if (!s)
        return NULL;
    s->gpu = gpu;
    if (saga_gpu_alloc(&s->flag, gpu, N_FLAGS * sizeof(uint32_t),
                       SAGA_GPU_LOCAL, what, error))
        return s;
    saga_gpu_blocks_free(s);
    return NULL;
}

void saga_gpu_blocks_free(saga_gpu_blocks *s)
{
    if (!s)
        return;
    saga_gpu_free(&s->state, s->gpu);
    saga_gpu_free(&s->x, s->gpu);
    saga_gpu_free(&s->g, s->gpu);
    saga_gpu_free(&s->span, s->gpu);
    saga_gpu_free(&s->flag, s->gpu);
    saga_gpu_free(&s->up, s->gpu);
    saga_gpu_free(&s->down, s->gpu);
    free(s);
}

/* Makes room for blocks on the device, and for a way of `way` bytes up or down.
 */
static bool make_room(saga_gpu_blocks *s, const saga_block_adam *b,
                      saga_gpu_buffer *way, size_t nbytes, saga_error *error)
{
    return saga_gpu_grow(&s->state, s->gpu, state_nbytes(b->n, b->width),
                         SAGA_GPU_LOCAL, what, error) &&
           saga_gpu_grow(&s->x, s->gpu, rows_nbytes(b), SAGA_GPU_LOCAL, what,
                         error) &&
           saga_gpu_grow(&s->g, s->gpu, rows_nbytes(b), SAGA_GPU_LOCAL, what,
                         error) &&
           saga_gpu_grow(&s->span, s->gpu, b->n * sizeof(uint32_t),
                         SAGA_GPU_LOCAL, what, error) &&
           saga_gpu_grow(way, s->gpu, nbytes,
                         way == &s->up ? SAGA_GPU_UP : SAGA_GPU_DOWN, what,
                         error);
}

/* --- Ways ---------------------------------------------------------------- */

static void pack_spans(uint32_t *to, const saga_block_adam *b)
{
    const saga_block_span all = { 0, (uint8_t)b->width };

    for (size_t i = 0; i < b->n; i++) {
        const saga_block_span has = b->span ? b->span[i] : all;

        to[i] = has.first + 256u * has.n;
    }
}

/* Bytes of state, blocks and spans on their way. */
static size_t put_nbytes(const saga_block_adam *b)
{
    return state_nbytes(b->n, b->width) + rows_nbytes(b) +
           b->n * sizeof(uint32_t);
}

bool saga_gpu_blocks_put(saga_gpu_blocks *s, const saga_block_adam *b,
                         saga_error *error)
{
    const size_t state = state_nbytes(b->n, b->width), rows = rows_nbytes(b);
    const size_t spans = b->n * sizeof(uint32_t);
    char *up;

    if (!make_room(s, b, &s->up, put_nbytes(b), error))
        return false;
    up = s->up.map;
    memcpy(up, b->state, state);
    memcpy(up + state, b->x, rows);
    pack_spans((uint32_t *)(void *)(up + state + rows), b);
    saga_gpu_begin(s->gpu);
    saga_gpu_copy(s->gpu, &s->state, 0, &s->up, 0, state);
    saga_gpu_copy(s->gpu, &s->x, 0, &s->up, state, rows);
    saga_gpu_copy(s->gpu, &s->span, 0, &s->up, state + rows, spans);
    if (!saga_gpu_finish(s->gpu, error))
        return false;
    /* A step needs a fortieth of this. */
    saga_gpu_free(&s->up, s->gpu);
    return true;
}

bool saga_gpu_blocks_get(saga_gpu_blocks *s, const saga_block_adam *b,
                         saga_error *error)
{
    const size_t state = state_nbytes(b->n, b->width);

    if (!make_room(s, b, &s->down, state, error))
        return false;
    saga_gpu_begin(s->gpu);
    saga_gpu_copy(s->gpu, &s->down, 0, &s->state, 0, state);
    if (!saga_gpu_finish(s->gpu, error))
        return false;
    memcpy(b->state, s->down.map, state);
    saga_gpu_free(&s->down, s->gpu);
    return true;
}

/* --- A step -------------------------------------------------------------- */

static push push_of(const saga_block_adam *b, const saga_adam *a, uint64_t step)
{
    /* A group of the state has as many reals as one block alone. */
    const size_t group = saga_block_adam_size(1, b->width);

    return (push){ .n_blocks = (uint32_t)b->n,
                   .n_groups = (uint32_t)(saga_block_adam_size(b->n, b->width) /
                                          group),
                   .width = (uint32_t)b->width,
                   .stride = (uint32_t)b->stride,
                   .number = (uint32_t)step,
                   .c1 = (float)(1 - pow((double)a->beta1, (double)step)),
                   .c2 = (float)(1 - pow((double)a->beta2, (double)step)),
                   .beta1 = (float)a->beta1,
                   .beta2 = (float)a->beta2,
                   .eps = (float)a->eps,
                   .most = (float)a->most,
                   .rate = (float)b->rate };
}

static const size_t flags_nbytes = N_FLAGS * sizeof(uint32_t);

bool saga_gpu_blocks_room(saga_gpu_blocks *s, const saga_block_adam *b,
                          saga_error *error)
{
    return make_room(s, b, &s->down, flags_nbytes + rows_nbytes(b), error);
}

void saga_gpu_blocks_begin(saga_gpu_blocks *s, const saga_gpu_buffer *unless,
                           size_t at)
{
    saga_gpu_fill(s->gpu, &s->flag, 0, flags_nbytes, 0);
    if (unless)
        saga_gpu_copy(s->gpu, &s->flag, IS_IDLE * sizeof(uint32_t), unless, at,
                      sizeof(uint32_t));
}

static void record(saga_gpu_blocks *s, int kernel, const push *p, size_t groups,
                   const saga_gpu_buffer *gradients)
{
    const saga_gpu_job job = { .kernel = kernel,
                               .buffer = { &s->state, gradients, &s->span,
                                           &s->flag, &s->x },
                               .push = p,
                               .push_nbytes = sizeof *p,
                               .n_groups = (uint32_t)groups };

    saga_gpu_run(s->gpu, &job);
}

void saga_gpu_blocks_record(saga_gpu_blocks *s, const saga_block_adam *b,
                            const saga_adam *adam, uint64_t step,
                            const saga_gpu_buffer *gradients)
{
    const push p = push_of(b, adam, step);

    record(s, SAGA_KERNEL_BLOCKS_REMEMBER, &p, p.n_groups, gradients);
    record(s, SAGA_KERNEL_BLOCKS_TURN, &p,
           saga_n_parts(b->n, SAGA_BLOCK_TURN_EVERY), gradients);
    record(s, SAGA_KERNEL_BLOCKS_STEP, &p, p.n_groups, gradients);
    saga_gpu_copy(s->gpu, &s->down, 0, &s->flag, 0, flags_nbytes);
}

bool saga_gpu_blocks_are_sound(const saga_gpu_blocks *s, uint64_t step,
                               saga_error *error)
{
    const uint32_t *const flag = s->down.map;

    return !flag[IS_UNSOUND] ||
           saga_fail(error, NULL, "try another --seed, and report this error",
                     "a feature, a position or a gradient is not finite at "
                     "step %llu",
                     (unsigned long long)step);
}

void saga_gpu_blocks_fetch(saga_gpu_blocks *s, const saga_block_adam *b)
{
    saga_gpu_copy(s->gpu, &s->down, flags_nbytes, &s->x, 0, rows_nbytes(b));
}

void saga_gpu_blocks_take(const saga_gpu_blocks *s, const saga_block_adam *b)
{
    memcpy(b->x, (const char *)s->down.map + flags_nbytes, rows_nbytes(b));
}

bool saga_gpu_blocks_step(saga_gpu_blocks *s, const saga_block_adam *b,
                          const saga_adam *adam, uint64_t step,
                          saga_error *error)
{
    const size_t rows = rows_nbytes(b);

    if (!make_room(s, b, &s->up, rows, error) ||
        !saga_gpu_blocks_room(s, b, error))
        return false;
    memcpy(s->up.map, b->g, rows);
    saga_gpu_begin(s->gpu);
    saga_gpu_copy(s->gpu, &s->g, 0, &s->up, 0, rows);
    saga_gpu_blocks_begin(s, NULL, 0);
    saga_gpu_blocks_record(s, b, adam, step, &s->g);
    saga_gpu_blocks_fetch(s, b);
    if (!saga_gpu_finish(s->gpu, error) ||
        !saga_gpu_blocks_are_sound(s, step, error))
        return false;
    saga_gpu_blocks_take(s, b);
    return true;
}

/* --- What others see ----------------------------------------------------- */

const saga_gpu_buffer *saga_gpu_blocks_rows(const saga_gpu_blocks *s)
{
    return &s->x;
}

const saga_gpu_buffer *saga_gpu_blocks_flag(const saga_gpu_blocks *s)
{
    return &s->flag;
}

bool saga_gpu_blocks_look(saga_gpu_blocks *s, const saga_block_adam *b,
                          saga_error *error)
{
    if (!saga_gpu_blocks_room(s, b, error))
        return false;
    saga_gpu_begin(s->gpu);
    saga_gpu_blocks_fetch(s, b);
    if (!saga_gpu_finish(s->gpu, error))
        return false;
    saga_gpu_blocks_take(s, b);
    return true;
}

bool saga_gpu_blocks_plan(saga_gpu_blocks *s, const saga_block_adam *b,
                          saga_error *error)
{
    bool ok = make_room(s, b, &s->up, put_nbytes(b), error);

    /* As blocks_put, blocks_step and blocks_get one after the other. */
    saga_gpu_free(&s->up, s->gpu);
    ok = ok && make_room(s, b, &s->up, rows_nbytes(b), error) &&
         make_room(s, b, &s->down, state_nbytes(b->n, b->width), error);
    saga_gpu_free(&s->down, s->gpu);
    return ok && saga_gpu_blocks_room(s, b, error);
}
