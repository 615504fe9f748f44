/* SPDX-License-Identifier: MIT
 *
 * The public functions: what is in a file, its networks, its segments, views
 * and pictures. The stages themselves are in the other files.
 */
#include "animate.h"
#include "crc32c.h"
#include "fx.h"
#include "head.h"
#include "plan.h"
#include "project.h"
#include "range_dec.h"
#include "raster.h"
#include "reconstruct.h"
#include "splats.h"
#include "syntax.h"

/* Stands at the start of the work block; offsets in plan count from here. */
struct saga_decoder {
    saga_plan plan;
    saga_header header;
    saga_prim_format format;
    saga_counts n;               /* of the decoded layers together */
    uint32_t n_layers;           /* decoded */
    saga_camera camera;          /* of the view */
    uint32_t final_range[3];
    uint64_t box_pixels;         /* of the view that was asked for last */
    uint32_t n_splats;
    uint32_t owner;              /* CRC of the head's last chunk: segments go
                                  * on from it */
    uint32_t n_views;            /* number of the view */
    uint32_t view_digest;        /* of file, segment, time and camera */
    uint32_t cpu;                /* saga_cpu of this machine */
    saga_tally tally;            /* of the call that is open or decode; none of
                                  * its pointers outlives the call */
    uint16_t has_segment, has_view;
};

/* The block begins with so many bytes for this. */
enum { DECODER_NBYTES = 768 };

_Static_assert(sizeof(saga_decoder) <= DECODER_NBYTES, "format: see plan.c");

static uint8_t *block_at(saga_decoder *dec, uint32_t offset)
{
    return (uint8_t *)(void *)dec + offset;
}

static const uint8_t *const_at(const saga_decoder *dec, uint32_t offset)
{
    return (const uint8_t *)(const void *)dec + offset;
}

static saga_primitive *prims_of(saga_decoder *dec)
{
    return (saga_primitive *)(void *)block_at(dec, dec->plan.prims_at);
}

static const saga_primitive *const_prims_of(const saga_decoder *dec)
{
    return (const saga_primitive *)(const void *)
        const_at(dec, dec->plan.prims_at);
}

/* (primitives, plan.colour_stride) */
static int16_t *colours_of(saga_decoder *dec)
{
    return (int16_t *)(void *)block_at(dec, dec->plan.colours_at);
}

/* Of the base and of the segment. */
static uint32_t n_prims(const saga_decoder *dec)
{
    return dec->header.base.prim + dec->n.prim;
}

/* --- Head ---------------------------------------------------------------- */

/* Header and plan of a head; with whole = 1 all of the head must be there. */
static saga_status read_head(saga_header *h, saga_plan *plan,
                             const uint8_t *bytes, size_t n, int whole)
{
    saga_status s = saga_head_read(h, bytes, n);

    if (s)
        return s;
    s = saga_plan_make(plan, h, DECODER_NBYTES);
    if (s)
        return s;
    return whole && n < saga_head_nbytes(h) ? SAGA_ERR_TRUNCATED : SAGA_OK;
}

static void info_of(saga_info *info, const saga_header *h,
                    const saga_plan *plan)
{
    int i;

    info->version = SAGA_VERSION;
    info->level = h->level;
    info->work_nbytes = plan->work_nbytes;
    info->head_nbytes = (size_t)saga_head_nbytes(h);
    info->n_segments = h->n_segments;
    info->n_frames = h->n_frames;
    info->fps_num = h->fps_num;
    info->fps_den = h->fps_den;
    info->n_cameras = h->n_cameras;
    info->n_layers = saga_n_layers(h);
    info->max_coarse = h->max.coarse;
    info->max_fine = h->max.fine;
    info->max_primitives = h->max.prim;
    info->n_weights = 0;
    for (i = 0; i < SAGA_N_NETS; i++)
        info->n_weights += saga_net_macs(&plan->nets.shape[i]);
    info->nets_nbytes = h->nets_nbytes;
    info->tools = h->model.tools;
    info->motion_order = (uint32_t)saga_motion_order(&h->model);
    info->features = h->model.features;
    info->base_coarse = h->base.coarse;
    info->base_fine = h->base.fine;
    info->base_primitives = h->base.prim;
    info->base_nbytes = h->base_nbytes;
    info->base_macs = saga_plan_base_macs(h, &plan->nets, 0);
    info->work = plan->work;
    info->decode_macs = saga_plan_segment_macs(h, &plan->nets, 0);
    info->view_macs = saga_plan_view_macs(&plan->nets, &h->model);
    info->unit_mantissa = h->unit_mantissa;
    info->unit_exponent = h->unit_exponent;
    for (i = 0; i < 3; i++)
        info->centre_mantissa[i] = h->centre_mantissa[i];
    info->centre_exponent = h->centre_exponent;
}

saga_status saga_probe(saga_info *info, const uint8_t *bytes, size_t n)
{
    saga_header h;
    saga_plan plan;
    const saga_status s = read_head(&h, &plan, bytes, n, 0);

    if (s == SAGA_OK)
        info_of(info, &h, &plan);
    return s;
}

/* Fills in everything but the networks. */
static void begin(saga_decoder *dec)
{
    uint8_t *const v = block_at(dec, dec->plan.vectors_at);
    uint32_t i;

    for (i = 0; i < sizeof(saga_vectors); i++)
        v[i] = 0;
    saga_prim_format_of(&dec->format, &dec->header.model);
    dec->has_segment = 0;
    dec->has_view = 0;
    dec->n_splats = 0;
    dec->box_pixels = 0;
    dec->n_views = 0;
    dec->tally.stopped = 0;
    dec->cpu = saga_cpu_best();
}

/* From here on the caller may stop the work, whose beginning is the first
 * reason to ask; or, with NULL, no more. Tells whether it was stopped. */
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

/* The head is there whole. Bytes behind those of the networks are not looked
 * at, so that it does not matter how many a caller has. */
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

/* --- Index and rig ------------------------------------------------------- */

/* The index's payload in a head; every entry is inside it. Bytes behind it are
 * not looked at. */
static saga_status index_of(const uint8_t **entries, saga_header *h,
                            const uint8_t *head, size_t n)
{
    saga_plan plan;
    saga_chunk chunk;
    uint32_t nbytes;
    saga_status s = read_head(h, &plan, head, n, 1);

    if (s)
        return s;
    nbytes = h->n_segments * (uint32_t)SAGA_INDEX_ENTRY_NBYTES;
    s = saga_head_chunk(&chunk, SAGA_CHUNK_INDEX, saga_head_crc(h, head),
                        head + h->header_nbytes, SAGA_CHUNK_NBYTES + nbytes);
    if (s)
        return s;
    if (chunk.nbytes != nbytes)
        return SAGA_ERR_DATA;
    *entries = head + h->header_nbytes + SAGA_CHUNK_NBYTES;
    return SAGA_OK;
}

/* floor(65536 rest / whole) for rest < whole, rest < 2^32: by long division,
 * since a 64-bit quotient is a library call on small machines. */
static int32_t fraction_16(uint64_t rest, uint64_t whole)
{
    uint32_t t = 0;
    int i;

    for (i = 0; i < 16; i++) {
        rest <<= 1;
        t <<= 1;
        if (rest >= whole) {
            rest -= whole;
            t |= 1;
        }
    }
    return (int32_t)t;
}

saga_status saga_find(saga_segment *seg, const uint8_t *head, size_t n,
                      uint32_t frame_num, uint32_t frame_den)
{
    saga_header h;
    const uint8_t *p;
    saga_status s = index_of(&p, &h, head, n);
    uint64_t first = 0;
    uint32_t i;

    if (s)
        return s;
    if (frame_den == 0)
        return SAGA_ERR_ARG;
    for (i = 0; i < h.n_segments; i++) {
        saga_io io = { p, NULL, i * SAGA_INDEX_ENTRY_NBYTES };
        saga_index_entry e;
        uint64_t end;

        saga_index_io(&io, &e);
        end = first + e.n_frames;
        if (e.n_frames == 0 || end > h.n_frames)
            return SAGA_ERR_DATA;
        if (frame_num < end * frame_den) {
            seg->number = i;
            seg->first_frame = (uint32_t)first;
            seg->n_frames = e.n_frames;
            seg->offset = e.offset;
            seg->nbytes = e.nbytes;
            seg->t = fraction_16(frame_num - first * frame_den,
                                 (uint64_t)e.n_frames * frame_den);
            return SAGA_OK;
        }
        first = end;
    }
    return first == h.n_frames ? SAGA_ERR_ARG : SAGA_ERR_DATA;
}

saga_status saga_rig(saga_camera *c, uint32_t *number, const uint8_t *head,
                     size_t n, uint32_t index)
{
    saga_header h;
    saga_rig_camera r;
    saga_io io = { head, NULL, 0 };
    saga_plan plan;
    saga_status s = read_head(&h, &plan, head, n, 0);
    int i;

    if (s)
        return s;
    if (index >= h.n_cameras)
        return SAGA_ERR_ARG;
    io.at = saga_rig_offset(&h) + index * (uint32_t)SAGA_CAMERA_NBYTES;
    saga_camera_io(&io, &r);
    for (i = 0; i < 9; i++)
        c->rotation_q30[i] = r.rotation_q30[i];
    for (i = 0; i < 3; i++) {
        c->centre[i] = r.centre[i];
        c->background_q15[i] = r.background_q15[i];
    }
    for (i = 0; i < 2; i++) {
        c->focal_q16[i] = r.focal_q16[i];
        c->principal_q16[i] = r.principal_q16[i];
    }
    c->near_plane = r.near_plane;
    c->width = r.width;
    c->height = r.height;
    *number = r.number;
    return SAGA_OK;
}

/* --- The base, and a segment --------------------------------------------- */

static void scaffold_of(saga_scaffold *sc, saga_decoder *dec,
                        const saga_counts *n)
{
    const saga_plan *const p = &dec->plan;

    sc->model = &dec->header.model;
    sc->net.nets = &p->nets;
    sc->net.params = block_at(dec, p->nets_at);
    sc->n = *n;
    sc->coarse = (saga_coarse *)(void *)block_at(dec, p->coarse_at);
    sc->coarse_feature =
        (int16_t *)(void *)block_at(dec, p->coarse_feature_at);
    sc->fine = (saga_fine *)(void *)block_at(dec, p->fine_at);
    sc->fine_feature = (int16_t *)(void *)block_at(dec, p->fine_feature_at);
    sc->prim_offset = (int16_t (*)[4])(void *)block_at(dec, p->offsets_at);
    sc->models = (saga_models *)(void *)block_at(dec, p->models_at);
    sc->net.v = (saga_vectors *)(void *)block_at(dec, p->vectors_at);
    sc->net.cpu = (saga_cpu)dec->cpu;
    sc->net.tally = &dec->tally;
    saga_bank_size(&sc->bank, sc->model);
    saga_bank_lay(&sc->bank, block_at(dec, p->bank_at));
}

/* Where the layers of a segment begin. */
static uint32_t layers_at(const saga_decoder *dec)
{
    return SAGA_CHUNK_NBYTES +
           saga_segment_nbytes(saga_n_layers(&dec->header));
}

/* Counts are those that memory is there for, and the layers fill the segment.
 */
static saga_status check_layers(const saga_decoder *dec,
                                const saga_segment_header *seg,
                                uint32_t nbytes)
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

/* Bytes behind those that the index gives to the segment are not looked at. A
 * single layer has all that SEGM leaves. */
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

static int code_chunk(const saga_scaffold *sc, int part, saga_coder *c)
{
    return part == 0 ? saga_syntax_coarse(sc, c)
         : part == 1 ? saga_syntax_fine(sc, c) : saga_syntax_prim(sc, c);
}

/* COAR, FINE or PRIM (part 0..2) at bytes[*at..n); moves *at past it. */
static saga_status read_chunk(saga_decoder *dec, const saga_scaffold *sc,
                              int part, uint32_t *crc, const uint8_t *bytes,
                              size_t n, size_t *at)
{
    const uint32_t type = part == 0 ? SAGA_CHUNK_COARSE
                        : part == 1 ? SAGA_CHUNK_FINE : SAGA_CHUNK_PRIM;
    saga_range_dec range;
    saga_chunk chunk;
    const saga_status s = saga_head_chunk(&chunk, type, dec->owner,
                                          bytes + *at, n - *at);

    if (s)
        return s;
    saga_range_dec_init(&range, bytes + *at + SAGA_CHUNK_NBYTES,
                        chunk.nbytes);
    range.tally = &dec->tally;
    if (!code_chunk(sc, part, &range.coder) ||
        !saga_range_dec_finish(&range))
        return SAGA_ERR_DATA;
    dec->final_range[part] = range.range;
    *crc = chunk.crc;
    *at += SAGA_CHUNK_NBYTES + chunk.nbytes;
    return SAGA_OK;
}

/* The scaffold of bytes[at..n) becomes primitives, the first of which has the
 * number `first`. With is_base = 1 what follows goes on from each chunk. */
static saga_status read_primitives(saga_decoder *dec, const saga_counts *count,
                                   uint32_t first, int is_base,
                                   const uint8_t *bytes, size_t n, size_t at)
{
    const saga_plan *const plan = &dec->plan;
    saga_scaffold sc;
    uint32_t crc;
    int part;

    scaffold_of(&sc, dec, count);
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
    saga_reconstruct(&sc, prims_of(dec) + first, colours_of(dec) +
                     (size_t)first * plan->colour_stride, plan->colour_stride);
    return SAGA_OK;
}

static saga_status read_base(saga_decoder *dec, const uint8_t *bytes)
{
    const saga_header *const h = &dec->header;
    const saga_status s = read_primitives(dec, &h->base, 0, 1, bytes,
                                          h->base_nbytes, 0);

    if (s == SAGA_OK)
        saga_stand_still(prims_of(dec), h->base.prim);
    return s;
}

saga_status saga_open(saga_decoder **dec, void *work, size_t work_nbytes,
                      const uint8_t *head, size_t n, const saga_watch *watch)
{
    saga_decoder *const d = work;
    saga_info info;
    saga_status s;

    *dec = NULL;
    s = saga_probe(&info, head, n);
    if (s)
        return s;
    if ((uintptr_t)work % SAGA_WORK_ALIGN)
        return SAGA_ERR_ALIGN;
    if (work_nbytes < info.work_nbytes)
        return SAGA_ERR_SPACE;
    s = read_head(&d->header, &d->plan, head, n, 1);
    if (s)
        return s;
    begin(d);
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

/* The layers that are whole in bytes[0..n); together they fill the segment. */
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
        s = read_primitives(dec, &l->n, n_prims(dec), 0, bytes,
                            at + l->nbytes, at);
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
                        const uint8_t *bytes, size_t n,
                        const saga_watch *watch)
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
    if (s == SAGA_OK)
        s = read_layers(dec, &seg, bytes, n);
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

/* --- A view -------------------------------------------------------------- */

static const saga_splat *splats_of(const saga_decoder *dec)
{
    return (const saga_splat *)(const void *)
        const_at(dec, dec->plan.splats_at);
}

static const saga_key *keys_of(const saga_decoder *dec)
{
    return (const saga_key *)(const void *)const_at(dec, dec->plan.keys_at);
}

/* Colours of the last seen->n of n splats. */
static void shade(saga_splat *splats, uint32_t n, const saga_decoder *dec,
                  const saga_scaffold *sc, saga_seen *seen)
{
    if (seen->n > 0)
        saga_shade(splats + (n - seen->n), sc, seen, dec->camera.centre);
    seen->n = 0;
}

/* A splat has its colour at once, or waits for it in `seen`. */
static void see(saga_splat *splat, const saga_decoder *dec, uint32_t prim,
                saga_seen *seen)
{
    const int16_t *const base =
        (const int16_t *)(const void *)const_at(dec, dec->plan.colours_at) +
        (size_t)prim * dec->plan.colour_stride;
    int i;

    if (dec->header.model.tools & SAGA_TOOL_VIEW) {
        seen->base[seen->n] = base;
        saga_animate_mean(seen->x[seen->n++], &const_prims_of(dec)[prim],
                          &dec->format, SAGA_T_MID);
        return;
    }
    for (i = 0; i < 3; i++)
        splat->colour_q15[i] = (uint16_t)base[i];
}

/* All primitives that are visible, with keys by depth; returns their number. */
static uint32_t make_splats(saga_splat *splats, saga_key *keys,
                            saga_decoder *dec, int32_t t)
{
    const saga_look look = { &dec->format, &dec->camera, t };
    saga_seen seen = { 0 };
    saga_scaffold sc;
    uint32_t i, n = 0, most;

    scaffold_of(&sc, dec, &dec->n);
    most = saga_shade_points(&sc);
    for (i = 0; i < n_prims(dec); i += SAGA_RUN) {
        const uint32_t left = n_prims(dec) - i;
        uint32_t at = i, visible = saga_splats(
            splats + n, prims_of(dec) + i, left < SAGA_RUN ? left : SAGA_RUN,
            &look, (saga_cpu)dec->cpu);

        for (; visible != 0; visible >>= 1, at++) {
            if (!(visible & 1))
                continue;
            keys[n].depth = splats[n].depth;
            keys[n].index = n;
            see(&splats[n++], dec, at, &seen);
            if (seen.n == most)
                shade(splats, n, dec, &sc, &seen);
        }
    }
    shade(splats, n, dec, &sc, &seen);
    return n;
}

/* A splat that covers a picture covers a tiny one too, and so does any other.
 */
static int costs_too_much(const saga_decoder *dec)
{
    const uint32_t pixels = (uint32_t)dec->camera.width * dec->camera.height;

    return dec->box_pixels >
           (uint64_t)saga_caps[dec->header.level].cover *
               (pixels < SAGA_COVER_PIXELS ? SAGA_COVER_PIXELS : pixels);
}

/* Views of one decoder differ by their number, those of two decoders by what
 * they show. */
static void number_view(saga_decoder *dec, int32_t t)
{
    const uint8_t *const camera = (const uint8_t *)&dec->camera;
    uint32_t crc = dec->owner;

    crc = saga_crc32c(crc, (const uint8_t *)dec->final_range,
                      sizeof dec->final_range);
    crc = saga_crc32c(crc, (const uint8_t *)&t, sizeof t);
    /* Bytes behind the last field are not looked at. */
    dec->view_digest = saga_crc32c(crc, camera,
                                   offsetof(saga_camera, background_q15) +
                                   sizeof dec->camera.background_q15);
    dec->n_views++;
    dec->has_view = 1;
}

saga_status saga_view(saga_decoder *dec, const saga_camera *camera, int32_t t)
{
    saga_splat *const splats =
        (saga_splat *)(void *)block_at(dec, dec->plan.splats_at);
    saga_key *const keys =
        (saga_key *)(void *)block_at(dec, dec->plan.keys_at);
    const saga_status s = saga_camera_check(camera);
    uint32_t n;

    if (!dec->has_segment)
        return SAGA_ERR_STATE;
    if (s)
        return s;
    if (t < 0 || t > SAGA_T_MAX)
        return SAGA_ERR_ARG;
    dec->camera = *camera;
    dec->has_view = 0;
    dec->n_splats = 0;
    n = make_splats(splats, keys, dec, t);
    saga_depth_sort(keys, (saga_key *)(void *)
                    block_at(dec, dec->plan.keys_tmp_at), n);
    dec->box_pixels = saga_raster_boxes(keys, splats, n, camera);
    if (costs_too_much(dec))
        return SAGA_ERR_LEVEL;
    dec->n_splats = n;
    number_view(dec, t);
    return SAGA_OK;
}

_Static_assert(offsetof(saga_job, cursor) ==
               24 + sizeof(void *) + sizeof(size_t), "jobs have no padding");

/* The scratch of a job that has begun numbers the splats of its view and has
 * the layout that its first block gave: this tells them from others. A change
 * of one field always shows. */
static uint32_t digest_of(const saga_decoder *dec, const saga_job *job,
                          const saga_picture *picture)
{
    return saga_crc32c(dec->view_digest ^ (uint32_t)picture->bits,
                       (const uint8_t *)job, offsetof(saga_job, cursor));
}

saga_status saga_draw(const saga_decoder *dec, saga_job *job,
                      const saga_picture *picture, uint32_t budget)
{
    const saga_drawing drawing = { &dec->camera, splats_of(dec), keys_of(dec),
                                   dec->n_splats, (saga_cpu)dec->cpu,
                                   dec->format.is_steep };
    uint32_t digest;

    if (!dec->has_view)
        return SAGA_ERR_STATE;
    if (budget == 0)
        return SAGA_ERR_ARG;
    digest = digest_of(dec, job, picture);
    if (job->cursor[0] == 0) {
        job->cursor[1] = dec->n_views;
        job->cursor[2] = digest;
    }
    if (job->cursor[1] != dec->n_views || job->cursor[2] != digest)
        return SAGA_ERR_STATE;
    return saga_raster(job, picture, &drawing, budget);
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
    saga_animate(out, &const_prims_of(dec)[index], &dec->format, t);
    return SAGA_OK;
}

saga_status saga_colour_at(uint16_t colour_q15[3], saga_decoder *dec,
                           uint32_t index, const int32_t from[3])
{
    saga_seen seen = { 0 };
    saga_scaffold sc;
    saga_splat splat;
    int i;

    if (!dec->has_segment)
        return SAGA_ERR_STATE;
    if (index >= n_prims(dec))
        return SAGA_ERR_ARG;
    for (i = 0; i < 3; i++)
        if (from[i] < -(1 << 29) || from[i] > 1 << 29)
            return SAGA_ERR_ARG;
    scaffold_of(&sc, dec, &dec->n);
    see(&splat, dec, index, &seen);
    if (seen.n > 0)
        saga_shade(&splat, &sc, &seen, from);
    for (i = 0; i < 3; i++)
        colour_q15[i] = splat.colour_q15[i];
    return SAGA_OK;
}

saga_status saga_splat_at(saga_splat *out, const saga_decoder *dec,
                          uint32_t order)
{
    if (!dec->has_view)
        return SAGA_ERR_STATE;
    if (order >= dec->n_splats)
        return SAGA_ERR_ARG;
    *out = splats_of(dec)[keys_of(dec)[order].index];
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
