/* SPDX-License-Identifier: MIT
 *
 * The public functions that fill a decoder: saga_open reads networks and base,
 * saga_decode reads a segment. probe.c has the functions used before them,
 * draw.c those used after them.
 */
#include "animate.h"
#include "crc32c.h"
#include "head.h"
#include "range_dec.h"
#include "reconstruct.h"
#include "syntax.h"
#include "work_block.h"

/* --- Head ---------------------------------------------------------------- */

/* Initialises everything except the networks. */
static void clear_state(saga_decoder *dec)
{
    uint8_t *const v = block_at(dec, dec->plan.vectors_at);
    uint32_t i;

    for (i = 0; i < sizeof(saga_vectors); i++)
        v[i] = 0;
    saga_prim_format_of(&dec->format, &dec->header.model);
    dec->has_segment = 0;
    dec->has_view = 0;
    dec->segment_digest = 0;
    dec->n_splats = 0;
    dec->box_pixels = 0;
    dec->n_views = 0;
    dec->tally.stopped = 0;
    dec->cpu = saga_cpu_best();
}

/* Sets the watch, a function of the caller that may stop the following work, or
 * none if watch is NULL. The work calls the watch when it begins, then after
 * every SAGA_TALLY_EVERY units. Returns whether the previous watch had stopped
 * its work. */
static int set_watch(saga_decoder *dec, const saga_watch *watch)
{
    const saga_watch nobody = { NULL, NULL };
    saga_tally *const m = &dec->tally;
    const int stopped = m->stopped;

    if (watch == NULL)
        watch = &nobody;
    m->stop = watch->stop;
    m->user = watch->user;
    m->done = SAGA_TALLY_EVERY;
    m->stopped = 0;
    return stopped;
}

/* Reads the networks; the head is complete. Does not read bytes after the
 * networks, so that the result does not depend on n. */
static saga_status read_networks(saga_decoder *dec, const uint8_t *head)
{
    const size_t at = dec->header.header_nbytes + SAGA_CHUNK_NBYTES +
                      (size_t)dec->header.n_segments * SAGA_INDEX_ENTRY_NBYTES;
    const saga_plan *const plan = &dec->plan;
    saga_range_dec range;
    saga_chunk chunk;
    saga_status s;

    s = saga_head_chunk(&chunk, SAGA_CHUNK_NETS,
                        saga_head_crc(&dec->header, head), head + at,
                        SAGA_CHUNK_NBYTES + (size_t)dec->header.nets_nbytes);
    if (s)
        return s;
    dec->owner = chunk.crc;
    if (chunk.nbytes != dec->header.nets_nbytes)
        return SAGA_ERR_DATA;
    saga_range_dec_init(&range, head + at + SAGA_CHUNK_NBYTES, chunk.nbytes);
    range.tally = &dec->tally;
    if (!saga_syntax_networks(&plan->nets, block_at(dec, plan->nets_at),
                              &range.coder) ||
        !saga_range_dec_finish(&range))
        return SAGA_ERR_DATA;
    return SAGA_OK;
}

/* --- The base, and a segment --------------------------------------------- */

void saga_block_scaffold(saga_scaffold *sc, saga_decoder *dec,
                         const saga_counts *n)
{
    const saga_plan *const p = &dec->plan;

    sc->model = &dec->header.model;
    sc->net.nets = &p->nets;
    sc->net.params = block_at(dec, p->nets_at);
    sc->n = *n;
    sc->coarse = (saga_coarse *)(void *)block_at(dec, p->coarse_at);
    sc->coarse_feature = (int16_t *)(void *)block_at(dec, p->coarse_feature_at);
    sc->fine = (saga_fine *)(void *)block_at(dec, p->fine_at);
    sc->fine_feature = (int16_t *)(void *)block_at(dec, p->fine_feature_at);
    sc->prim_offset = (int16_t(*)[4])(void *)block_at(dec, p->offsets_at);
    sc->models = (saga_models *)(void *)block_at(dec, p->models_at);
    sc->class_models = sc->model->tools & SAGA_TOOL_CLASSES
                           ? (saga_class_models *)(void *)block_at(
                                 dec, p->class_models_at)
                           : NULL;
    sc->net.v = (saga_vectors *)(void *)block_at(dec, p->vectors_at);
    sc->net.cpu = (saga_cpu)dec->cpu;
    sc->net.tally = &dec->tally;
    saga_bank_size(&sc->bank, sc->model);
    saga_bank_lay(&sc->bank, block_at(dec, p->bank_at));
}

/* Returns the offset of the first layer in a segment. */
static uint32_t layers_at(const saga_decoder *dec)
{
    return SAGA_CHUNK_NBYTES + saga_segment_nbytes(saga_n_layers(&dec->header));
}

/* Checks that the counts of all layers fit in the memory, and that several
 * layers fill the segment exactly. */
static saga_status check_layers(const saga_decoder *dec,
                                const saga_segment_header *seg, uint32_t nbytes)
{
    const saga_counts *const max = &dec->header.max;
    const uint32_t n_layers = saga_n_layers(&dec->header);
    uint64_t end = layers_at(dec);
    uint32_t prim = 0, i;

    for (i = 0; i < n_layers; i++) {
        const saga_counts *const n = &seg->layer[i].n;

        if (n->coarse < 1 || n->coarse > max->coarse || n->fine > max->fine ||
            n->prim > max->prim - prim)
            return SAGA_ERR_DATA;
        prim += n->prim;
        end += seg->layer[i].nbytes;
    }
    return end != nbytes ? SAGA_ERR_DATA : SAGA_OK;
}

/* Reads SEGM. Does not read bytes after those that the index assigns to the
 * segment. A single layer consists of all bytes after SEGM. */
static saga_status read_segment_header(saga_segment_header *seg,
                                       const saga_decoder *dec,
                                       const saga_segment *wanted,
                                       const uint8_t *bytes, size_t n)
{
    const uint32_t n_layers = saga_n_layers(&dec->header);
    saga_chunk chunk;
    saga_io io = { bytes + SAGA_CHUNK_NBYTES, NULL, 0 };
    const saga_status s = saga_head_chunk(
        &chunk, SAGA_CHUNK_SEGMENT, dec->owner, bytes,
        n < wanted->nbytes ? n : wanted->nbytes);

    if (s)
        return s;
    if (chunk.nbytes != saga_segment_nbytes(n_layers))
        return SAGA_ERR_DATA;
    saga_segment_io(&io, seg, n_layers);
    if (n_layers == 1)
        seg->layer[0].nbytes = wanted->nbytes - layers_at(dec);
    if (seg->number != wanted->number || seg->n_frames != wanted->n_frames ||
        seg->first_frame != wanted->first_frame)
        return SAGA_ERR_DATA;
    return check_layers(dec, seg, wanted->nbytes);
}

/* Reads COAR, FINE or PRIM (part 0..2) at bytes[*at..n), and moves *at past it.
 */
static saga_status read_chunk(saga_decoder *dec, const saga_scaffold *sc,
                              int part, uint32_t *crc, const uint8_t *bytes,
                              size_t n, size_t *at)
{
    const uint32_t type = part == 0   ? SAGA_CHUNK_COARSE
                          : part == 1 ? SAGA_CHUNK_FINE
                                      : SAGA_CHUNK_PRIM;
    saga_range_dec range;
    saga_chunk chunk;
    const saga_status s = saga_head_chunk(&chunk, type, dec->owner, bytes + *at,
                                          n - *at);

    if (s)
        return s;
    saga_range_dec_init(&range, bytes + *at + SAGA_CHUNK_NBYTES, chunk.nbytes);
    range.tally = &dec->tally;
    if (!saga_syntax_part(sc, part, &range.coder) ||
        !saga_range_dec_finish(&range))
        return SAGA_ERR_DATA;
    dec->final_range[part] = range.range;
    dec->segment_digest = saga_crc32c(
        dec->segment_digest, (const uint8_t *)&chunk.crc, sizeof chunk.crc);
    *crc = chunk.crc;
    *at += SAGA_CHUNK_NBYTES + chunk.nbytes;
    return SAGA_OK;
}

/* Decodes the scaffold in bytes[at..n) and computes its primitives, the first
 * of which has the number `first`. If is_base is 1, the CRC of each chunk
 * continues in the next chunk. */
static saga_status read_primitives(saga_decoder *dec, const saga_counts *count,
                                   uint32_t first, int is_base,
                                   const uint8_t *bytes, size_t n, size_t at)
{
    const saga_plan *const plan = &dec->plan;
    saga_scaffold sc;
    uint32_t crc;
    int part;

    /* The chunks are COAR, FINE and PRIM, and nothing may follow them. */
    saga_block_scaffold(&sc, dec, count);
    saga_syntax_begin(&sc);
    for (part = 0; part < 3; part++) {
        const saga_status s = read_chunk(dec, &sc, part, &crc, bytes, n, &at);

        if (s)
            return s;
        if (is_base)
            dec->owner = crc;
    }
    if (at != n)
        return SAGA_ERR_DATA;
    saga_reconstruct(&sc,
                     saga_prim_to_set(prims_of(dec), first, dec->format.nbytes),
                     dec->format.nbytes,
                     colours_of(dec) + (size_t)first * plan->colour_stride,
                     plan->colour_stride);
    return SAGA_OK;
}

static saga_status read_base(saga_decoder *dec, const uint8_t *bytes)
{
    const saga_header *const h = &dec->header;
    const saga_status s = read_primitives(dec, &h->base, 0, 1, bytes,
                                          h->base_nbytes, 0);

    if (s == SAGA_OK)
        saga_stand_still(prims_of(dec), dec->format.nbytes, h->base.prim);
    return s;
}

saga_status saga_open(saga_decoder **dec, void *work, size_t work_nbytes,
                      const uint8_t *head, size_t n, const saga_watch *watch)
{
    saga_decoder *const d = work;
    saga_status s;

    *dec = NULL;
    s = saga_block_begin(d, work_nbytes, head, n);
    if (s)
        return s;
    /* Networks come before the base, whose symbols are predicted by them. */
    clear_state(d);
    (void)set_watch(d, watch);
    s = read_networks(d, head);
    if (s == SAGA_OK && (d->header.model.tools & SAGA_TOOL_BASE))
        s = read_base(d, head + (size_t)saga_head_base(&d->header));
    if (set_watch(d, NULL))
        s = SAGA_ERR_STOPPED;
    if (s == SAGA_OK)
        *dec = d;
    return s;
}

/* Decodes the layers that are complete in bytes[0..n). */
static saga_status read_layers(saga_decoder *dec,
                               const saga_segment_header *seg,
                               const uint8_t *bytes, size_t n)
{
    const uint32_t n_layers = saga_n_layers(&dec->header);
    saga_counts *const sum = &dec->n;
    size_t at = layers_at(dec);

    for (dec->n_layers = 0; dec->n_layers < n_layers; dec->n_layers++) {
        const saga_layer_header *const l = &seg->layer[dec->n_layers];
        saga_status s;

        if (l->nbytes > n - at)
            return dec->n_layers > 0 ? SAGA_OK : SAGA_ERR_TRUNCATED;
        s = read_primitives(dec, &l->n, n_prims(dec), 0, bytes, at + l->nbytes,
                            at);
        if (s)
            return s;
        at += l->nbytes;
        sum->coarse += l->n.coarse;
        sum->fine += l->n.fine;
        sum->prim += l->n.prim;
    }
    return SAGA_OK;
}

saga_status saga_decode(saga_decoder *dec, const saga_segment *segment,
                        const uint8_t *bytes, size_t n, const saga_watch *watch)
{
    saga_segment_header seg;
    saga_status s;

    dec->has_segment = 0;
    dec->has_view = 0;
    dec->n_splats = 0;
    dec->box_pixels = 0;
    dec->n.coarse = dec->n.fine = dec->n.prim = 0;
    if (saga_n_layers(&dec->header) == 1 && n < segment->nbytes)
        return SAGA_ERR_TRUNCATED;
    s = read_segment_header(&seg, dec, segment, bytes, n);
    (void)set_watch(dec, watch);
    if (s == SAGA_OK) {
        dec->segment_digest = saga_crc32c(
            dec->owner, (const uint8_t *)&seg.number, sizeof seg.number);
        s = read_layers(dec, &seg, bytes, n);
    }
    if (set_watch(dec, NULL))
        s = SAGA_ERR_STOPPED;
    dec->has_segment = s == SAGA_OK;
    return s;
}

saga_status saga_find_layer(saga_layer_report *layer, const saga_decoder *dec,
                            const saga_segment *segment, const uint8_t *bytes,
                            size_t n, uint32_t index)
{
    const uint32_t n_layers = saga_n_layers(&dec->header);
    saga_segment_header seg;
    const saga_status s = read_segment_header(&seg, dec, segment, bytes, n);
    uint32_t i;

    if (s)
        return s;
    if (index >= n_layers)
        return SAGA_ERR_ARG;
    layer->n_coarse = seg.layer[index].n.coarse;
    layer->n_fine = seg.layer[index].n.fine;
    layer->n_primitives = seg.layer[index].n.prim;
    layer->end = segment->nbytes;
    for (i = n_layers - 1; i > index; i--)
        layer->end -= seg.layer[i].nbytes;
    return SAGA_OK;
}

/* --- Taps ---------------------------------------------------------------- */

saga_status saga_tell(saga_report *report, const saga_decoder *dec)
{
    int i;

    if (!dec->has_segment)
        return SAGA_ERR_STATE;
    report->n_layers = dec->n_layers;
    report->n_coarse = dec->n.coarse;
    report->n_fine = dec->n.fine;
    report->n_primitives = n_prims(dec);
    for (i = 0; i < 3; i++)
        report->final_range[i] = dec->final_range[i];
    report->n_splats = dec->n_splats;
    report->box_pixels = dec->box_pixels;
    return SAGA_OK;
}

saga_status saga_primitive_at(saga_animated *out, const saga_decoder *dec,
                              uint32_t index, int32_t t)
{
    if (!dec->has_segment)
        return SAGA_ERR_STATE;
    if (index >= n_prims(dec) || t < 0 || t > SAGA_T_MAX)
        return SAGA_ERR_ARG;
    saga_animate(out, prim_of(dec, index), &dec->format, t);
    return SAGA_OK;
}

saga_status saga_visible_at(saga_visible *out, uint32_t *n_out,
                            const saga_decoder *dec, uint32_t first, uint32_t n,
                            int32_t t)
{
    uint32_t n_visible = 0, i;

    if (!dec->has_segment)
        return SAGA_ERR_STATE;
    if (first > n_prims(dec) || n > n_prims(dec) - first || t < 0 ||
        t > SAGA_T_MAX)
        return SAGA_ERR_ARG;
    for (i = first; i < first + n; i++)
        if (saga_animate_visible(&out[n_visible].at, prim_of(dec, i),
                                 &dec->format, t))
            out[n_visible++].index = i;
    *n_out = n_visible;
    return SAGA_OK;
}

const char *saga_status_text(saga_status status)
{
    if (status == SAGA_OK)
        return "ok";
    if (status == SAGA_AGAIN)
        return "work left, call again";
    if (status == SAGA_ERR_ARG)
        return "an argument is out of its range";
    if (status == SAGA_ERR_SPACE)
        return "a buffer is too small";
    if (status == SAGA_ERR_ALIGN)
        return "a buffer is misaligned";
    if (status == SAGA_ERR_DATA)
        return "the bytes are not a valid stream";
    if (status == SAGA_ERR_TRUNCATED)
        return "the stream ends too early";
    if (status == SAGA_ERR_VERSION)
        return "the stream needs a newer decoder";
    if (status == SAGA_ERR_LEVEL)
        return "the stream exceeds its level, or this decoder's";
    if (status == SAGA_ERR_STATE)
        return "nothing decoded, no view, or a job that began otherwise";
    if (status == SAGA_ERR_STOPPED)
        return "the caller stopped it";
    return "unknown status";
}
