/* SPDX-License-Identifier: MIT */
#include "ref_file.h"

#include "alloc.h"
#include "encode.h"
#include "fx.h"
#include "head.h"
#include "plan.h"
#include "range_dec.h"
#include "reconstruct.h"
#include "ref_recorder.h"
#include "saga.h"
#include "syntax.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static void *must(void *p)
{
    if (!p) {
        fprintf(stderr, "ref_file: out of memory\n");
        exit(2);
    }
    return p;
}

uint32_t ref_file_channels(const ref_file *f, int step)
{
    return step == SAGA_STEP_FEATURE ? f->h.model.features : 4u;
}

uint32_t ref_file_rows(const ref_file *f, int step)
{
    return step == SAGA_STEP_FINE   ? f->s.n.fine
           : step == SAGA_STEP_PRIM ? f->s.n.prim
                                    : f->s.n.coarse;
}

static saga_class class_of(const ref_file *f, size_t rank)
{
    return saga_class_of(&f->h.model, f->s.class[rank]);
}

bool ref_file_is_coded(const ref_file *f, int step, size_t i)
{
    const uint32_t n = f->h.model.features;

    return step != SAGA_STEP_FEATURE ||
           saga_class_has(class_of(f, i / n), (uint32_t)(i % n));
}

/* --- Chunks -------------------------------------------------------------- */

/* Takes a chunk of the given type from the beginning of *at. Returns 0 if there
 * is another. */
static int take_chunk(ref_span *payload, recorder_chunks *at, uint32_t type)
{
    saga_chunk chunk;

    payload->p = recorder_chunk(&chunk, type, at);
    payload->n = payload->p ? chunk.nbytes : 0;
    return payload->p != NULL;
}

static void read_rig(ref_file *f, const uint8_t *bytes)
{
    saga_io io = { bytes, NULL, saga_rig_offset(&f->h) };

    f->rig = must(calloc(f->h.n_cameras + 1u, sizeof *f->rig));
    for (uint32_t i = 0; i < f->h.n_cameras; i++)
        saga_camera_io(&io, &f->rig[i]);
}

static int read_nets(ref_file *f)
{
    saga_range_dec range;
    saga_cost cost;
    recorder r;
    int ok;

    saga_nets_layout(&f->shapes, &f->h.model);
    f->params = must(aligned_alloc(16, (f->shapes.nbytes + 31u) / 16 * 16));
    recorder_alloc_nets(&f->nets, &f->shapes);
    /* Three coders in a row: the recorder asks the counter of bits, which asks
     * the range decoder. */
    saga_range_dec_init(&range, f->chunk[REF_NETWORKS].p,
                        f->chunk[REF_NETWORKS].n);
    saga_cost_init(&cost, &range.coder);
    recorder_init(&r, &cost.coder);
    r.nets = &f->nets;
    r.shapes = &f->shapes;
    ok = saga_syntax_networks(&f->shapes, f->params, &r.coder) &&
         saga_range_dec_finish(&range);
    memcpy(f->bits, cost.bits, sizeof f->bits);
    memcpy(f->net_bits, cost.net_bits, sizeof f->net_bits);
    return ok;
}

/* --- The segment --------------------------------------------------------- */

/* Keeps mu, scale and value of a block; a recorder_watch. The recorder has
 * already kept the block's symbols. */
static void keep_values(void *user, const saga_scaffold *sc, saga_at at,
                        const int16_t *mu, const uint8_t *scale, uint32_t n)
{
    ref_file *const f = user;
    const int step = saga_step_of(at.sym);
    const int32_t *const q = step == SAGA_STEP_CENTRE    ? f->s.centre
                             : step == SAGA_STEP_FEATURE ? f->s.feature
                             : step == SAGA_STEP_FINE    ? f->s.fine_offset
                                                         : f->s.prim_offset;
    const size_t first = (size_t)at.index * ref_file_channels(f, step) +
                         at.column;

    (void)sc;
    memcpy(f->mu[step] + first, mu, n * sizeof *mu);
    memcpy(f->scale[step] + first, scale, n);
    for (uint32_t i = 0; i < n; i++)
        f->value[step][first + i] = fx_sat16_64(
            mu[i] +
            fx_rshift64((int64_t)q[first + i] * f->h.model.step_q16[step], 16));
}

/* Sets the features that are 1 and not coded. */
static void set_ones(ref_file *f)
{
    const uint32_t n = f->h.model.features;
    const int q = f->h.model.out_q[SAGA_OUT_COARSE];

    for (size_t i = 0; i < f->s.n.coarse; i++)
        if (class_of(f, i).one < n)
            f->value[SAGA_STEP_FEATURE][i * n + class_of(f, i).one] =
                (int16_t)(q < 15 ? 1 << q : 32767);
}

static int read_scaffold(ref_file *f, recorder_chunks at)
{
    const uint32_t cap_nodes = recorder_nodes(f->n.coarse);
    uint32_t final_range[3];
    saga_cost cost;
    recorder r;
    int ok;

    recorder_alloc_symbols(&f->s, f->n, f->h.model.features, cap_nodes);
    for (int i = 0; i < SAGA_N_STEPS; i++) {
        const size_t n = (size_t)ref_file_rows(f, i) * ref_file_channels(f, i);

        f->value[i] = must(calloc(n + 1, sizeof *f->value[i]));
        f->mu[i] = must(calloc(n + 1, sizeof *f->mu[i]));
        f->scale[i] = must(calloc(n + 1, 1));
    }
    recorder_scaffold(&f->sc, &f->h.model, &f->shapes, f->params, f->n);
    /* recorder_fill sets cost.inner to the range decoder of each chunk. */
    saga_cost_init(&cost, NULL);
    recorder_init(&r, &cost.coder);
    r.watch = keep_values;
    r.user = f;
    r.s = &f->s;
    r.cap_nodes = cap_nodes;
    r.features = f->h.model.features;
    ok = recorder_fill(&r.coder, &cost.inner, &f->sc, final_range, at);
    for (int i = 0; i < SAGA_N_SYMS; i++)
        f->bits[i] += cost.bits[i];
    set_ones(f);
    return ok && take_chunk(&f->chunk[REF_COARSE], &at, SAGA_CHUNK_COARSE) &&
           take_chunk(&f->chunk[REF_FINE], &at, SAGA_CHUNK_FINE) &&
           take_chunk(&f->chunk[REF_PRIM], &at, SAGA_CHUNK_PRIM);
}

static const char *read_parts(ref_file *f, const uint8_t *bytes, size_t n,
                              const saga_segment *seg, uint32_t layer)
{
    recorder_chunks at = recorder_head(&f->h, bytes, n);
    ref_span payload;

    read_rig(f, bytes);
    /* Index, networks and base follow one another in the head of the file. */
    if ((seg && (seg->offset > n || seg->nbytes > n - seg->offset)) ||
        !take_chunk(&payload, &at, SAGA_CHUNK_INDEX))
        return "the index is not valid";
    if (!take_chunk(&f->chunk[REF_NETWORKS], &at, SAGA_CHUNK_NETS) ||
        f->chunk[REF_NETWORKS].n != f->h.nets_nbytes || !read_nets(f))
        return "the networks are not valid";
    if (!seg) {
        f->is_base = 1;
        f->n = f->h.base;
        at.n = f->h.base_nbytes;
        return read_scaffold(f, at) ? NULL : "the base is not valid";
    }
    at = recorder_segment_chunks(&f->h, bytes, seg);
    if (!recorder_segment(&f->segment, &f->h, &at) ||
        !recorder_to_layer(&at, &f->segment, &f->h, layer))
        return "the segment's header is not valid";
    f->n = f->segment.layer[layer].n;
    return read_scaffold(f, at) ? NULL : "the segment is not valid";
}

const char *ref_file_read_layer(ref_file *f, const uint8_t *bytes, size_t n,
                                const saga_segment *seg, uint32_t layer)
{
    const char *why;
    saga_info info;

    memset(f, 0, sizeof *f);
    if (saga_probe(&info, bytes, n) || saga_head_read(&f->h, bytes, n))
        return "the header is not valid";
    why = read_parts(f, bytes, n, seg, layer);
    if (why)
        ref_file_free(f);
    return why;
}

const char *ref_file_read(ref_file *f, const uint8_t *bytes, size_t n)
{
    saga_segment seg;
    saga_info info;

    memset(f, 0, sizeof *f);
    if (saga_probe(&info, bytes, n))
        return "the header is not valid";
    if (info.n_segments != 1 || info.base_coarse > 0)
        return "files of several segments cannot be taken apart yet";
    if (info.n_layers != 1)
        return "files of several layers cannot be taken apart yet";
    /* To find the last frame, saga_find has to read the whole index. */
    if (saga_find(&seg, bytes, n, info.n_frames - 1, 1))
        return "the index is not valid";
    return ref_file_read_layer(f, bytes, n, &seg, 0);
}

uint32_t ref_file_colours(const ref_file *f)
{
    const saga_model *const m = &f->h.model;

    return m->tools & SAGA_TOOL_VIEW ? m->width[SAGA_NET_COLOUR] : 3;
}

bool ref_file_primitives(saga_primitive **prim, int16_t **colour,
                         const ref_file *f, saga_error *error)
{
    const uint32_t stride = ref_file_colours(f);

    *prim = saga_alloc(f->sc.n.prim, sizeof **prim, "the primitives", error);
    *colour = saga_alloc(f->sc.n.prim, stride * sizeof **colour,
                         "the primitives", error);
    if (!*prim || !*colour)
        return false;
    saga_reconstruct(&f->sc, *prim, sizeof **prim, *colour, stride);
    return true;
}

void ref_file_free(ref_file *f)
{
    recorder_free_symbols(&f->s);
    saga_net_symbols_free(&f->nets);
    for (int i = 0; i < SAGA_N_STEPS; i++) {
        free(f->value[i]);
        free(f->mu[i]);
        free(f->scale[i]);
    }
    if (f->sc.model)
        saga_scaffold_free(&f->sc);
    free(f->params);
    free(f->rig);
    memset(f, 0, sizeof *f);
}
