/* SPDX-License-Identifier: MIT */
#include "vectors.h"

#include "container.h"
#include "crc32c.h"
#include "fx.h"

#include <stdlib.h>
#include <string.h>

static uint32_t crc_u32(uint32_t crc, uint32_t v)
{
    uint8_t b[4];

    fx_store32_le(b, v);
    return saga_crc32c(crc, b, 4);
}

static uint32_t crc_i32s(uint32_t crc, const int32_t *v, size_t n)
{
    for (size_t i = 0; i < n; i++)
        crc = crc_u32(crc, (uint32_t)v[i]);
    return crc;
}

static uint32_t crc_u32s(uint32_t crc, const uint32_t *v, size_t n)
{
    for (size_t i = 0; i < n; i++)
        crc = crc_u32(crc, v[i]);
    return crc;
}

static uint32_t crc_u8s(uint32_t crc, const uint8_t *v, size_t n)
{
    for (size_t i = 0; i < n; i++)
        crc = crc_u32(crc, v[i]);
    return crc;
}

/* --- Symbols ------------------------------------------------------------- */

static uint32_t layer_crc(uint32_t crc, const saga_layer_symbols *l,
                          uint32_t n_in, uint32_t n_out)
{
    crc = crc_u32(crc, l->step_q16);
    crc = crc_u32(crc, l->step_shift);
    crc = crc_u32(crc, l->bias_shift);
    crc = crc_u32(crc, l->weight_scale);
    crc = crc_u32(crc, l->bias_scale);
    crc = crc_u32(crc, l->scale_mode);
    crc = crc_u8s(crc, l->drop, saga_scale_lines(l->scale_mode, n_in, n_out));
    crc = crc_i32s(crc, l->weight, (size_t)n_in * n_out);
    crc = crc_i32s(crc, l->bias, n_out);
    return crc_u8s(crc, l->shift, n_out);
}

/* Adds the finer formats of n rows to the CRC. */
static uint32_t finer_crc(uint32_t crc, const saga_layer_symbols *l, uint32_t n)
{
    for (uint32_t i = 0; i < n; i++)
        crc = crc_u32(crc, l->finer ? l->finer[i] : 0);
    return crc;
}

static uint32_t scaffold_crc(uint32_t crc, const saga_symbols *s,
                             const saga_model *m)
{
    crc = crc_u32(crc, s->n.coarse);
    crc = crc_u32(crc, s->n.fine);
    crc = crc_u32(crc, s->n.prim);
    crc = crc_u32(crc, s->n_nodes);
    crc = crc_u8s(crc, s->split, s->n_nodes);
    for (uint32_t i = 0; i < s->n_nodes; i++)
        crc = crc_u32(crc, s->occupancy[i]);
    crc = crc_u8s(crc, s->n_fine, s->n.coarse);
    if (m->tools & SAGA_TOOL_CLASSES)
        crc = crc_u8s(crc, s->class, s->n.coarse);
    crc = crc_i32s(crc, s->centre, 4 * (size_t)s->n.coarse);
    crc = crc_i32s(crc, s->feature, m->features * (size_t)s->n.coarse);
    crc = crc_u32s(crc, s->fine_suffix, s->n.fine);
    crc = crc_i32s(crc, s->fine_offset, 4 * (size_t)s->n.fine);
    crc = crc_u8s(crc, s->n_prim, s->n.fine);
    crc = crc_u32s(crc, s->prim_suffix, s->n.prim);
    return crc_i32s(crc, s->prim_offset, 4 * (size_t)s->n.prim);
}

uint32_t saga_symbols_crc(const saga_net_symbols *nets, const saga_nets *shapes,
                          const saga_symbols *base, const saga_symbols *s,
                          uint32_t n_layers, const saga_model *m)
{
    uint32_t crc = 0;

    for (int net = 0; net < SAGA_N_NETS; net++)
        for (int i = 0; i < shapes->shape[net].n_layers; i++) {
            crc = layer_crc(crc, &nets->layer[net][i],
                            shapes->shape[net].dim[i],
                            shapes->shape[net].dim[i + 1]);
            crc = finer_crc(crc, &nets->layer[net][i],
                            saga_nets_n_finer(shapes, net, i));
        }
    if (base)
        crc = scaffold_crc(crc, base, m);
    for (int i = 0; i < (int)n_layers; i++)
        crc = scaffold_crc(crc, &s[i], m);
    return crc;
}

/* --- Decoded stages ------------------------------------------------------ */

static uint32_t primitives_crc(const saga_decoder *dec, uint32_t n, int32_t t)
{
    uint32_t crc = 0;
    saga_animated a;

    for (uint32_t i = 0; i < n; i++) {
        if (saga_primitive_at(&a, dec, i, t))
            return 0;
        crc = crc_i32s(crc, a.x, 3);
        crc = crc_i32s(crc, a.quat, 4);
        crc = crc_i32s(crc, a.log2_scale_q10, 3);
        crc = crc_i32s(crc, &a.q0_q20, 1);
    }
    return crc;
}

static uint32_t splats_crc(const saga_decoder *dec, uint32_t n)
{
    uint32_t crc = 0;
    saga_splat s;

    for (uint32_t i = 0; i < n; i++) {
        if (saga_splat_at(&s, dec, i))
            return 0;
        crc = crc_i32s(crc, s.mean_q8, 2);
        crc = crc_i32s(crc, s.chol_q28, 3);
        crc = crc_i32s(crc, &s.q0_q20, 1);
        crc = crc_u32(crc, s.depth);
        for (int k = 0; k < 3; k++)
            crc = crc_u32(crc, s.colour_q15[k]);
    }
    return crc;
}

saga_status saga_draw_whole(const saga_decoder *dec, const saga_camera *c,
                            const saga_picture *picture)
{
    enum { TILE = 16, LIST = 512 };
    static _Alignas(16) uint8_t scratch[SAGA_JOB_NBYTES(TILE, LIST)];
    saga_job job;
    saga_status s;

    memset(&job, 0, sizeof job);
    job.x1 = c->width;
    job.y1 = c->height;
    job.tile = TILE;
    job.list_capacity = LIST;
    job.scratch = scratch;
    job.scratch_nbytes = sizeof scratch;
    /* The picture does not depend on the budget of each call. */
    do
        s = saga_draw(dec, &job, picture, 1u << 24);
    while (s == SAGA_AGAIN);
    return s;
}

static saga_status draw_frame(uint32_t *crc, const saga_decoder *dec,
                              const saga_camera *c, uint8_t *pixels,
                              size_t nbytes)
{
    const saga_picture picture = { pixels, 3u * c->width, nbytes, 8 };
    const saga_status s = saga_draw_whole(dec, c, &picture);

    if (s == SAGA_OK)
        *crc = saga_crc32c(0, pixels, 3u * c->width * (size_t)c->height);
    return s;
}

const saga_picture_kind saga_picture_kinds[SAGA_N_PICTURE_KINDS + 1] = {
    { "wide", 16 }, { "depth", SAGA_DEPTH }, { "boxes", SAGA_BOXES }
};

/* Returns the CRC of n pixels, whose numbers are in this machine's order of
 * bytes. */
static uint32_t pixels_crc(const void *pixels, size_t n, int bits)
{
    const uint16_t *const wide = pixels;
    const saga_depth *const depth = pixels;
    uint32_t crc = 0;
    uint8_t b[2];

    for (size_t i = 0; bits == 16 && i < 3 * n; i++) {
        fx_store16_le(b, wide[i]);
        crc = saga_crc32c(crc, b, 2);
    }
    for (size_t i = 0; bits == SAGA_DEPTH && i < n; i++) {
        crc = crc_u32(crc, (uint32_t)(depth[i].sum_q16 & 0xffffffffu));
        crc = crc_u32(crc, (uint32_t)(depth[i].sum_q16 >> 32));
        crc = crc_u32(crc, depth[i].weight_q16);
    }
    return crc;
}

/* Returns the CRC of the boxes of the view's splats in the order of drawing. */
static uint32_t boxes_crc(const saga_decoder *dec)
{
    uint32_t crc = 0;
    saga_splat s;

    for (uint32_t i = 0; saga_splat_at(&s, dec, i) == SAGA_OK; i++) {
        const int32_t box[4] = { s.x0, s.y0, s.x1, s.y1 };

        crc = crc_i32s(crc, box, 4);
    }
    return crc;
}

static saga_status draw_picture(uint32_t *crc, const saga_decoder *dec,
                                const saga_camera *c, int bits)
{
    const size_t each = bits == 16 ? 6 : sizeof(saga_depth);
    const size_t n = (size_t)c->width * c->height;
    void *const pixels = malloc(n * each);
    const saga_picture picture = { pixels, each * c->width, n * each, bits };
    const saga_status s = pixels ? saga_draw_whole(dec, c, &picture)
                                 : SAGA_ERR_SPACE;

    if (s == SAGA_OK)
        *crc = pixels_crc(pixels, n, bits);
    free(pixels);
    return s;
}

/* Finds the bytes of segment `number`, by going through the frames of the
 * segments before it. */
static saga_status find_segment(saga_segment *seg, const uint8_t *bytes,
                                size_t n, uint32_t number)
{
    uint32_t frame = 0;
    saga_status s;

    for (;;) {
        s = saga_find(seg, bytes, n, frame, 1);
        if (s || seg->number == number)
            return s;
        frame = seg->first_frame + seg->n_frames;
    }
}

/* Decodes a segment and prepares a view of a camera of the rig, *c. */
static saga_status prepare(saga_camera *c, saga_decoder *dec,
                           const uint8_t *bytes, size_t n,
                           const saga_stages_at *at)
{
    saga_segment seg;
    uint32_t name;
    size_t left;
    saga_status s = find_segment(&seg, bytes, n, at->segment);

    if (s)
        return s;
    if (seg.offset > n)
        return SAGA_ERR_TRUNCATED;
    /* A file that was cut has fewer bytes than its index says. */
    left = n - (size_t)seg.offset;
    s = saga_decode(dec, &seg, bytes + seg.offset,
                    seg.nbytes < left ? seg.nbytes : left, NULL);
    if (s)
        return s;
    s = saga_rig(c, &name, bytes, n, at->camera);
    return s ? s : saga_view(dec, c, at->t);
}

static saga_status run_stages(saga_stages *out, saga_decoder *dec,
                              const saga_camera *c, int32_t t, uint8_t *pixels,
                              size_t pixels_nbytes)
{
    saga_report report;

    saga_tell(&report, dec);
    memcpy(out->final_range, report.final_range, sizeof out->final_range);
    out->primitives = primitives_crc(dec, report.n_primitives, t);
    out->splats = splats_crc(dec, report.n_splats);
    return draw_frame(&out->frame, dec, c, pixels, pixels_nbytes);
}

/* Opens a file and prepares a view. The caller frees *work. */
static saga_status open_view(saga_decoder **dec, void **work, saga_camera *c,
                             const uint8_t *bytes, size_t n,
                             const saga_stages_at *at)
{
    saga_info info;
    saga_status s = saga_probe(&info, bytes, n);

    *work = NULL;
    if (s)
        return s;
    *work = aligned_alloc(SAGA_WORK_ALIGN, info.work_nbytes);
    if (!*work)
        return SAGA_ERR_SPACE;
    s = saga_open(dec, *work, info.work_nbytes, bytes, n, NULL);
    return s ? s : prepare(c, *dec, bytes, n, at);
}

saga_status saga_stages_of(saga_stages *stages, const uint8_t *bytes, size_t n,
                           uint32_t number, int32_t t, uint32_t camera,
                           uint8_t *pixels, size_t pixels_nbytes)
{
    const saga_stages_at at = { number, t, camera };
    saga_decoder *dec;
    saga_camera c;
    void *work;
    saga_status s = open_view(&dec, &work, &c, bytes, n, &at);

    if (!s)
        s = run_stages(stages, dec, &c, t, pixels, pixels_nbytes);
    free(work);
    return s;
}

saga_status saga_picture_crc(uint32_t *crc, const uint8_t *bytes, size_t n,
                             const saga_stages_at *at, int bits)
{
    saga_decoder *dec;
    saga_camera c;
    void *work;
    saga_status s = open_view(&dec, &work, &c, bytes, n, at);

    if (!s && bits == SAGA_BOXES)
        *crc = boxes_crc(dec);
    else if (!s)
        s = draw_picture(crc, dec, &c, bits);
    free(work);
    return s;
}
