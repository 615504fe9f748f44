/* SPDX-License-Identifier: MIT
 *
 * Training pictures on the device. A picture is copied there when it is first
 * visited. If not all fit, the oldest gives its place to the next one.
 */
#include "gpu_state.h"

#include "alloc.h"

#include <assert.h>
#include <stdlib.h>
#include <string.h>

/* Slots are in chunks of about this size, and take at most one part in
 * CACHE_PART of the device's memory; of a processor's, which is the host's own,
 * at most CPU_NBYTES. */
enum { CHUNK_NBYTES = 256 << 20, CACHE_PART = 2, CPU_NBYTES = 64 << 20 };

/* Sizes in which a picture is looked at: whole, and halved up to seven times.
 */
enum { N_MIPS = 8 };

/* Copies are of whole words. */
static size_t whole_words(size_t nbytes)
{
    return (nbytes + 3) / 4 * 4;
}

/* Returns the bytes of a view's picture, behind which is its mask. */
static size_t mask_begin(const saga_source_view *v)
{
    return whole_words(saga_view_frame_nbytes(v));
}

static size_t mask_nbytes(const saga_source_view *v)
{
    return v->mask ? saga_view_frame_nbytes(v) / 3 : 0;
}

static size_t largest_nbytes(const saga_capture *c)
{
    size_t most = 0;

    for (int v = 0; v < c->n_views; v++) {
        const saga_source_view *const view = c->views + v;
        const size_t n = mask_begin(view) + whole_words(mask_nbytes(view));

        most = n > most ? n : most;
    }
    return most;
}

/* Returns the number of pictures that a training visits. Of a camera that moves
 * each view has one. */
static size_t n_visited(const saga_capture *c)
{
    size_t n = 0;

    for (int v = 0; v < c->n_views; v++)
        if (!c->views[v].held_out && c->views[v].n_missing < c->n_frames)
            n += (size_t)(c->n_frames - c->views[v].n_missing);
    return n;
}

bool saga_gpu_begin_pictures(saga_gpu_canvas *g, saga_error *error)
{
    const saga_capture *const c = g->pictures->capture;
    const saga_gpu_info *const is = saga_gpu_is(g->gpu);
    saga_gpu_cache *const k = &g->cache;
    const size_t n = (size_t)c->n_views * (size_t)c->n_frames;
    const size_t visited = n_visited(c);
    const size_t pixels = saga_pictures_largest(g->pictures);
    const size_t room = strcmp(is->kind, "cpu") == 0 ? CPU_NBYTES
                                                     : is->memory / CACHE_PART;

    /* The plan of slots, its tables, and the pictures that kernels use. */
    k->each = largest_nbytes(c);
    k->per_chunk = CHUNK_NBYTES / k->each > 0 ? CHUNK_NBYTES / k->each : 1;
    k->n_slots = (uint32_t)(room / k->each < visited ? room / k->each
                                                     : visited);
    if (k->n_slots == 0)
        k->n_slots = 1;
    k->slot_of = saga_calloc(n, sizeof *k->slot_of, "the GPU", error);
    k->unseen = saga_calloc(n, N_MIPS * sizeof *k->unseen, "the GPU", error);
    k->picture_in = saga_calloc(k->n_slots, sizeof *k->picture_in, "the GPU",
                                error);
    k->chunk = saga_calloc(saga_n_parts(k->n_slots, k->per_chunk),
                           sizeof *k->chunk, "the GPU", error);
    return k->slot_of && k->unseen && k->picture_in && k->chunk &&
           saga_gpu_alloc(&g->up_picture, g->gpu, k->each, SAGA_GPU_UP,
                          "a picture", error) &&
           saga_gpu_room(g, GPU_STORED, k->each, "a picture", error) &&
           saga_gpu_room(g, GPU_TRUTH, 3 * pixels * sizeof(real), "a picture",
                         error) &&
           saga_gpu_room(g, GPU_IMAGE, 3 * pixels * sizeof(real), "a picture",
                         error);
}

void saga_gpu_end_pictures(saga_gpu_canvas *g)
{
    for (int i = 0; i < g->cache.n_chunks; i++)
        saga_gpu_free(g->cache.chunk + i, g->gpu);
    free(g->cache.chunk);
    free(g->cache.slot_of);
    free(g->cache.unseen);
    free(g->cache.picture_in);
}

/* Makes the next chunk. The last one has the slots that are left. */
static bool make_chunk(saga_gpu_canvas *g, saga_error *error)
{
    saga_gpu_cache *const k = &g->cache;
    const size_t first = (size_t)k->n_chunks * k->per_chunk;
    const size_t left = k->n_slots - first;

    if (!saga_gpu_alloc(k->chunk + k->n_chunks, g->gpu,
                        (left < k->per_chunk ? left : k->per_chunk) * k->each,
                        SAGA_GPU_LOCAL, "pictures", error))
        return false;
    k->n_chunks++;
    return true;
}

bool saga_gpu_pictures_room(saga_gpu_canvas *g, saga_error *error)
{
    const size_t n = saga_n_parts(g->cache.n_slots, g->cache.per_chunk);

    while ((size_t)g->cache.n_chunks < n)
        if (!make_chunk(g, error))
            return false;
    return true;
}

/* Sets *slot to a free slot, or to the one that is replaced next. */
static bool take_slot(uint32_t *slot, saga_gpu_canvas *g, saga_error *error)
{
    saga_gpu_cache *const k = &g->cache;
    const uint32_t chunk = k->n_used / (uint32_t)k->per_chunk;

    if (k->n_used == k->n_slots) {
        *slot = k->next;
        k->next = (k->next + 1) % k->n_slots;
        k->slot_of[k->picture_in[*slot]] = 0;
        return true;
    }
    if ((int)chunk == k->n_chunks && !make_chunk(g, error))
        return false;
    *slot = k->n_used++;
    return true;
}

/* Copies a picture and its mask to where the device reads them. */
static void copy_picture(uint8_t *to, const saga_capture *c, saga_sample sample)
{
    const saga_source_view *const v = c->views + sample.view;

    memcpy(to, saga_capture_frame(c, sample.view, sample.frame),
           saga_view_frame_nbytes(v));
    if (v->mask)
        memcpy(to + mask_begin(v),
               saga_capture_mask(c, sample.view, sample.frame), mask_nbytes(v));
}

/* Returns the number of pixels that do not count. It is counted once for each
 * size of a picture, and kept with 1 added. */
static size_t n_unseen(saga_gpu_canvas *g, const saga_canvas *canvas,
                       size_t picture, saga_sample sample)
{
    uint32_t *const kept = g->cache.unseen + N_MIPS * picture +
                           (size_t)sample.mip;

    assert(sample.mip < N_MIPS);
    if (*kept == 0)
        *kept = 1 +
                (uint32_t)saga_pictures_n_unseen(canvas, g->pictures, sample);
    return *kept - 1;
}

static void set_stored(saga_gpu_frame *f, const saga_pictures *p,
                       saga_sample sample)
{
    const saga_source_view *const v = p->capture->views + sample.view;

    f->side = 1u << sample.mip;
    f->stride = (uint32_t)saga_view_row_nbytes(v);
    for (size_t i = 0; i < 3; i++)
        f->exposure[i] = (float)p->exposure[3 * (size_t)sample.view + i];
    f->mask_at = v->mask ? (uint32_t)mask_begin(v) : 0;
    f->is_subject = p->capture->subject;
}

bool saga_gpu_show_stored(saga_gpu_canvas *g, saga_canvas *canvas,
                          saga_sample sample, saga_error *error)
{
    const saga_capture *const c = g->pictures->capture;
    const size_t picture = (size_t)sample.view * (size_t)c->n_frames +
                           (size_t)sample.frame;
    uint32_t *const at = g->cache.slot_of + picture;

    g->is_stored = true;
    g->is_new = *at == 0;
    if (g->is_new) {
        if (!take_slot(&g->slot, g, error))
            return false;
        copy_picture(g->up_picture.map, c, sample);
        g->cache.picture_in[g->slot] = (uint32_t)picture;
        *at = g->slot + 1;
    }
    g->slot = *at - 1;
    set_stored(&g->frame, g->pictures, sample);
    canvas->n_unseen = n_unseen(g, canvas, picture, sample);
    return true;
}

void saga_gpu_record_truth(saga_gpu_canvas *g)
{
    const saga_gpu_cache *const k = &g->cache;
    const size_t pixels = (size_t)g->frame.width * g->frame.height;
    const saga_gpu_buffer *const chunk = k->chunk + g->slot / k->per_chunk;
    const size_t at = g->slot % k->per_chunk * k->each;

    if (!g->is_stored)
        return;
    if (g->is_new)
        saga_gpu_copy(g->gpu, chunk, at, &g->up_picture, 0, k->each);
    saga_gpu_copy(g->gpu, &g->on[GPU_STORED], 0, chunk, at, k->each);
    saga_gpu_do(g, SAGA_KERNEL_TRUTH, saga_gpu_groups(pixels),
                (int[]){ GPU_FRAME, GPU_STORED, GPU_TRUTH, -1 });
}
