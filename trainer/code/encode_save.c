/* SPDX-License-Identifier: MIT
 *
 * Saves the encoder to a checkpoint and restores it: the file as far as it is
 * made.
 */
#include "encode_save.h"

#include "alloc.h"
#include "encode_state.h"

static const char what[] = "the file so far";

/* Writes n bytes at *p, or allocates them and reads them. */
static void walk_block(uint8_t **p, size_t n, saga_checkpoint *c,
                       saga_error *error)
{
    /* Not more memory is allocated than the file has bytes left, in case n is
     * damaged. */
    if (c->reading && !c->failed)
        *p = n > saga_left(&c->rest) ? NULL
                                     : saga_aligned_alloc(16, n, what, error);
    c->failed = c->failed || !*p;
    if (!c->failed)
        saga_checkpoint_walk(c, *p, n);
}

static void walk_buffer(saga_buffer *b, saga_checkpoint *c, saga_error *error)
{
    uint64_t n = b->n;

    saga_checkpoint_walk(c, &n, sizeof n);
    if (n > 0)
        walk_block(&b->p, (size_t)n, c, error);
    b->n = b->cap = (size_t)n;
}

static void walk(saga_encoder *e, saga_checkpoint *c, saga_error *error)
{
    uint8_t *rig = (uint8_t *)e->rig, *index = (uint8_t *)e->index;

    saga_checkpoint_walk(c, &e->header, sizeof e->header);
    saga_checkpoint_walk(c, &e->sizes, sizeof e->sizes);
    /* The model determines the sizes of what follows, so it is checked
     * first. */
    c->failed = c->failed || !saga_model_is_valid(&e->header.model);
    if (c->reading && !c->failed)
        saga_nets_layout(&e->nets, &e->header.model);
    walk_block(&rig, e->header.n_cameras * sizeof *e->rig, c, error);
    walk_block(&e->params, e->nets.nbytes, c, error);
    walk_buffer(&e->networks, c, error);
    walk_buffer(&e->base, c, error);
    walk_buffer(&e->aside, c, error);
    walk_buffer(&e->segments, c, error);
    /* There are no segments while the base is made. */
    if (e->header.n_segments)
        walk_block(&index, e->header.n_segments * sizeof *e->index, c, error);
    e->rig = (saga_rig_camera *)(void *)rig;
    e->index = (saga_index_entry *)(void *)index;
}

void saga_encoder_save(saga_encoder *e, saga_checkpoint *c)
{
    walk(e, c, NULL);
}

saga_encoder *saga_encoder_restore(saga_checkpoint *c, saga_error *error)
{
    saga_encoder *const e = saga_calloc(1, sizeof *e, what, error);

    if (!e)
        return NULL;
    walk(e, c, error);
    if (!c->failed)
        return e;
    saga_encoder_free(e);
    return NULL;
}
