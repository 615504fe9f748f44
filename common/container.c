/* SPDX-License-Identifier: MIT */
#include "container.h"

#include "crc32c.h"
#include "fx.h"

const uint8_t saga_magic[SAGA_MAGIC_NBYTES] = { 'S',          'A', 'G', 'A',
                                                SAGA_VERSION, 0,   0,   0 };

static void field(saga_io *f, uint32_t *v, uint32_t nbytes)
{
    uint32_t i, x = 0;

    for (i = 0; i < nbytes; i++) {
        if (f->out)
            f->out[f->at + i] = (uint8_t)(*v >> 8 * i & 255u);
        else
            x |= (uint32_t)f->in[f->at + i] << 8 * i;
    }
    if (!f->out)
        *v = x;
    f->at += nbytes;
}

static void u32(saga_io *f, uint32_t *v)
{
    field(f, v, 4);
}

/* A value that is read may have been left unset by the caller. */
static void i32(saga_io *f, int32_t *v)
{
    uint32_t x = f->out ? (uint32_t)*v : 0;

    field(f, &x, 4);
    *v = (int32_t)x;
}

static void u16(saga_io *f, uint16_t *v)
{
    uint32_t x = f->out ? *v : 0u;

    field(f, &x, 2);
    *v = (uint16_t)x;
}

static void u8(saga_io *f, uint8_t *v)
{
    uint32_t x = f->out ? *v : 0u;

    field(f, &x, 1);
    *v = (uint8_t)x;
}

static void tier_fields(saga_io *f, saga_tier *l)
{
    u8(f, &l->n_groups);
    u8(f, &l->window);
    u8(f, &l->neighbours);
    u8(f, &l->suffix_bits);
    u8(f, &l->max_children);
    u16(f, &l->radius2_q12);
    u16(f, &l->softmax_q8);
}

static void network_fields(saga_io *f, saga_model *m, int first, int end)
{
    int i;

    for (i = first; i < end; i++) {
        u8(f, &m->width[i]);
        u8(f, &m->q_in[i]);
        u8(f, &m->int8[i]);
    }
}

static void class_fields(saga_io *f, saga_model *m)
{
    int i;

    u8(f, &m->n_classes);
    for (i = 0; i < SAGA_MAX_CLASSES; i++) {
        u8(f, &m->classes[i].first);
        u8(f, &m->classes[i].n);
        u8(f, &m->classes[i].one);
    }
}

static void model_fields(saga_io *f, saga_model *m)
{
    int i;

    u32(f, &m->tools);
    for (i = 0; i < SAGA_N_KINDS; i++)
        u8(f, &m->sources[i]);
    u8(f, &m->features);
    u8(f, &m->octaves);
    u16(f, &m->lambda_t_q8);
    for (i = 0; i < SAGA_N_TIERS; i++)
        tier_fields(f, &m->tier[i]);
    for (i = 0; i < SAGA_N_STEPS; i++)
        u32(f, &m->step_q16[i]);
    for (i = 0; i < SAGA_HEADER_OUTS; i++)
        u8(f, &m->out_q[i]);
    network_fields(f, m, 0, SAGA_NET_QUERY);
    u16(f, &m->bank_slots);
    u8(f, &m->bank_width);
    u16(f, &m->bank_blocks);
    u8(f, &m->hash_levels);
    u8(f, &m->hash_log2_entries);
}

void saga_header_io(saga_io *f, saga_header *h)
{
    int i;

    /* Fields of absent tools are 0. */
    if (!f->out)
        *h = (saga_header){ 0 };
    u32(f, &h->header_nbytes);
    u8(f, &h->level);
    u8(f, &h->more_layers);
    u16(f, &h->n_cameras);
    u32(f, &h->n_segments);
    u32(f, &h->n_frames);
    u32(f, &h->fps_num);
    u32(f, &h->fps_den);
    u32(f, &h->max.coarse);
    u32(f, &h->max.fine);
    u32(f, &h->max.prim);
    u32(f, &h->nets_nbytes);
    i32(f, &h->unit_mantissa);
    i32(f, &h->unit_exponent);
    for (i = 0; i < 3; i++)
        i32(f, &h->centre_mantissa[i]);
    i32(f, &h->centre_exponent);
    model_fields(f, &h->model);
}

void saga_tools_io(saga_io *f, saga_header *h)
{
    saga_model *const m = &h->model;

    if (m->tools & SAGA_TOOL_BANK)
        network_fields(f, m, SAGA_NET_QUERY, SAGA_NET_RES);
    if (m->tools & SAGA_TOOL_HASH)
        network_fields(f, m, SAGA_NET_RES, SAGA_N_NETS);
    if (m->tools & SAGA_TOOL_BASE) {
        u32(f, &h->base.coarse);
        u32(f, &h->base.fine);
        u32(f, &h->base.prim);
        u32(f, &h->base_nbytes);
    }
    if (m->tools & SAGA_TOOL_CLASSES)
        class_fields(f, m);
}

void saga_camera_io(saga_io *f, saga_rig_camera *c)
{
    int i;

    u32(f, &c->number);
    for (i = 0; i < 9; i++)
        i32(f, &c->rotation_q30[i]);
    for (i = 0; i < 3; i++)
        i32(f, &c->centre[i]);
    for (i = 0; i < 2; i++)
        i32(f, &c->focal_q16[i]);
    for (i = 0; i < 2; i++)
        i32(f, &c->principal_q16[i]);
    i32(f, &c->near_plane);
    u16(f, &c->width);
    u16(f, &c->height);
    for (i = 0; i < 3; i++)
        u16(f, &c->background_q15[i]);
}

void saga_segment_io(saga_io *f, saga_segment_header *s, uint32_t n_layers)
{
    uint32_t i;

    u32(f, &s->number);
    u32(f, &s->first_frame);
    u32(f, &s->n_frames);
    for (i = 0; i < n_layers; i++) {
        saga_layer_header *const l = &s->layer[i];

        u32(f, &l->n.coarse);
        u32(f, &l->n.fine);
        u32(f, &l->n.prim);
        if (n_layers > 1)
            u32(f, &l->nbytes);
        else if (!f->out)
            l->nbytes = 0;
    }
}

void saga_index_io(saga_io *f, saga_index_entry *e)
{
    const uint64_t offset = f->out ? e->offset : 0;
    uint32_t low = (uint32_t)(offset & 0xffffffffu);
    uint32_t high = (uint32_t)(offset >> 32);

    u32(f, &low);
    u32(f, &high);
    u32(f, &e->nbytes);
    u32(f, &e->n_frames);
    e->offset = (uint64_t)high << 32 | low;
}

void saga_chunk_io(saga_io *f, saga_chunk *c)
{
    u32(f, &c->type);
    u32(f, &c->nbytes);
    u32(f, &c->crc);
}

uint32_t saga_chunk_crc(uint32_t owner, const saga_chunk *c,
                        const uint8_t *payload)
{
    uint8_t head[8];

    fx_store32_le(head, c->type);
    fx_store32_le(head + 4, c->nbytes);
    return saga_crc32c(saga_crc32c(owner, head, 8), payload, c->nbytes);
}
