/* SPDX-License-Identifier: MIT
 *
 * The public functions that need the head of a file but no decoder: the
 * contents of the file, the segment of a frame, the cameras of the rig.
 */
#include "head.h"
#include "work_block.h"

saga_status saga_block_plan(saga_header *h, saga_plan *plan,
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

saga_status saga_block_begin(saga_decoder *dec, size_t nbytes,
                             const uint8_t *head, size_t n)
{
    saga_header header;
    saga_plan plan;
    const saga_status s = saga_block_plan(&header, &plan, head, n, 0);

    if (s)
        return s;
    if ((uintptr_t)dec % SAGA_WORK_ALIGN)
        return SAGA_ERR_ALIGN;
    if (nbytes < plan.work_nbytes)
        return SAGA_ERR_SPACE;
    if (n < saga_head_nbytes(&header))
        return SAGA_ERR_TRUNCATED;
    dec->header = header;
    dec->plan = plan;
    return SAGA_OK;
}

static void info_of(saga_info *info, const saga_header *h,
                    const saga_plan *plan)
{
    int i;

    /* The file: sizes, time, rig. */
    info->version = SAGA_VERSION;
    info->level = h->level;
    info->work_nbytes = plan->work_nbytes;
    info->head_nbytes = (size_t)saga_head_nbytes(h);
    info->n_segments = h->n_segments;
    info->n_frames = h->n_frames;
    info->fps_num = h->fps_num;
    info->fps_den = h->fps_den;
    info->n_cameras = h->n_cameras;
    /* A segment: the most of each tier. */
    info->n_layers = saga_n_layers(h);
    info->max_coarse = h->max.coarse;
    info->max_fine = h->max.fine;
    info->max_primitives = h->max.prim;
    /* The model. */
    info->n_weights = 0;
    for (i = 0; i < SAGA_N_NETS; i++)
        info->n_weights += saga_net_macs(&plan->nets.shape[i]);
    info->nets_nbytes = h->nets_nbytes;
    info->tools = h->model.tools;
    info->motion_order = (uint32_t)saga_motion_order(&h->model);
    info->features = h->model.features;
    /* The base, then multiply-accumulates (plan.c). */
    info->base_coarse = h->base.coarse;
    info->base_fine = h->base.fine;
    info->base_primitives = h->base.prim;
    info->base_nbytes = h->base_nbytes;
    info->base_macs = saga_plan_base_macs(h, &plan->nets, 0);
    info->work = plan->work;
    info->decode_macs = saga_plan_segment_macs(h, &plan->nets, 0);
    info->view_macs = saga_plan_view_macs(&plan->nets, &h->model);
    /* From box units to the capture's unit of length. */
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
    const saga_status s = saga_block_plan(&h, &plan, bytes, n, 0);

    if (s == SAGA_OK)
        info_of(info, &h, &plan);
    return s;
}

/* Finds and checks the payload of the index in a head, which contains all
 * entries. Does not read bytes after it. */
static saga_status index_of(const uint8_t **entries, saga_header *h,
                            const uint8_t *head, size_t n)
{
    saga_plan plan;
    saga_chunk chunk;
    uint32_t nbytes;
    saga_status s = saga_block_plan(h, &plan, head, n, 1);

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

/* Returns floor(65536 rest / whole) for rest < whole, rest < 2^32, by long
 * division, because a 64-bit quotient is a library call on small machines. */
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
    /* Entries are in order of time; the last ends with the last frame. */
    for (i = 0; i < h.n_segments; i++) {
        saga_io io = { p, NULL, i * SAGA_INDEX_ENTRY_NBYTES };
        saga_index_entry e;
        uint64_t end;

        saga_index_io(&io, &e);
        end = first + e.n_frames;
        if (e.n_frames == 0 || end > h.n_frames)
            return SAGA_ERR_DATA;
        /* frame_num / frame_den < end, without a division. */
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
    saga_status s = saga_block_plan(&h, &plan, head, n, 0);
    int i;

    if (s)
        return s;
    if (index >= h.n_cameras)
        return SAGA_ERR_ARG;
    /* Cameras follow the header, all of one size. */
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
