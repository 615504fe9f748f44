/* SPDX-License-Identifier: MIT
 *
 * The head: saga_probe, saga_rig and saga_find on any file of up to 640 bytes
 * whose header has the tools and sizes of a row below.
 */
#include "prove.h"

#include "fx.h"
#include "head.h"
#include "plan.h"
#include "work_block.h"

enum {
    N = 640,
    CAMERAS_AT = 14,
    SEGMENTS_AT = 16,
    NETS_AT = 44,
    TOOLS_AT = 72
};

static uint8_t bytes[N];

static uint32_t any(void)
{
    return any_of(0, UINT32_MAX);
}

/* --- Stubs: prove_plan.c is about the plan -------------------------------- */

saga_status saga_plan_make(saga_plan *p, const saga_header *h, uint32_t nbytes)
{
    (void)h;
    (void)nbytes;
    any_bytes(p, sizeof *p);
    return any_of(0, 1) ? SAGA_OK : SAGA_ERR_LEVEL;
}

uint64_t saga_plan_segment_macs(const saga_header *h, const saga_nets *nets,
                                uint32_t each)
{
    (void)h;
    (void)nets;
    (void)each;
    return any();
}

uint64_t saga_plan_base_macs(const saga_header *h, const saga_nets *nets,
                             uint32_t each)
{
    return saga_plan_segment_macs(h, nets, each);
}

uint32_t saga_plan_view_macs(const saga_nets *nets, const saga_model *m)
{
    (void)nets;
    (void)m;
    return any();
}

uint32_t saga_net_macs(const saga_net_shape *shape)
{
    (void)shape;
    return any();
}

/* --- Files ---------------------------------------------------------------- */

/* Returns where the structure Base ends. */
static uint32_t base_end(const saga_header *h)
{
    return saga_rig_offset(h) - (h->model.tools & SAGA_TOOL_CLASSES ? 13 : 0);
}

/* Makes any bytes with tools and sizes of row k; NETS and the base have 8 bytes
 * of payload. Returns any length of a file. */
static size_t begin(uint32_t k)
{
    const uint32_t more = k & 1;
    const uint32_t tools = (k & 2 ? SAGA_TOOL_BANK : 0u) |
                           (k & 4 ? SAGA_TOOL_HASH : 0u) |
                           (k & 8 ? SAGA_TOOL_BASE : 0u) |
                           (k & 16 ? SAGA_TOOL_CLASSES : 0u);
    static saga_header h;

    h.model.tools = tools;
    any_bytes(bytes, N);
    fx_store32_le(bytes + TOOLS_AT, tools);
    fx_store16_le(bytes + CAMERAS_AT, 2 * more);
    fx_store32_le(bytes + SEGMENTS_AT, 1 + more);
    fx_store32_le(bytes + NETS_AT, 8);
    if (tools & SAGA_TOOL_BASE)
        fx_store32_le(bytes + base_end(&h) - 4, 8);
    return any_of(0, N);
}

void prove_probe(void);
void prove_probe(void)
{
    static saga_info info;

    //@ loop unroll 32;
    for (uint32_t k = 0; k < 32; k++)
        (void)saga_probe(&info, bytes, begin(k));
}

void prove_rig(void);
void prove_rig(void)
{
    static saga_camera camera;
    uint32_t number;

    //@ loop unroll 32;
    for (uint32_t k = 0; k < 32; k++)
        (void)saga_rig(&camera, &number, bytes, begin(k), any());
}

void prove_find(void);
void prove_find(void)
{
    static saga_segment seg;

    //@ loop unroll 32;
    for (uint32_t k = 0; k < 32; k++)
        (void)saga_find(&seg, bytes, begin(k), any(), any());
}
