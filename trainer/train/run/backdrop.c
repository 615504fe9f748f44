/* SPDX-License-Identifier: MIT
 *
 * The decoded base is the backdrop of all segments. The colours of its
 * primitives are kept for each view, and all pictures are drawn with it.
 */
#include "train_state.h"

#include "alloc.h"

#include <stdlib.h>
#include <string.h>

static const char what[] = "the base";

/* Returns the attributes of a base that are equal for all views. */
static uint32_t shared_attrs(void)
{
    return saga_attrs_of_tools(0, true) & ~SAGA_ATTR_BIT(SAGA_ATTR_COLOUR);
}

size_t saga_train_base_reals(uint32_t n, int n_views)
{
    const int colour = saga_attributes[SAGA_ATTR_COLOUR].width;

    return n * (saga_attrs_width(shared_attrs()) +
                (size_t)colour * (size_t)n_views);
}

bool saga_train_alloc_base(saga_backdrop *b, uint32_t n, int n_views,
                           saga_error *error)
{
    const size_t width = (size_t)saga_attributes[SAGA_ATTR_COLOUR].width;
    saga_splat_params p;
    real *colour;

    memset(b, 0, sizeof *b);
    b->seen = saga_calloc((size_t)n_views, sizeof *b->seen, what, error);
    b->block = saga_alloc(saga_train_base_reals(n, n_views), sizeof *b->block,
                          what, error);
    if (!b->seen || !b->block) {
        saga_train_free_base(b);
        return false;
    }
    /* The shared attributes come first, then the colours of each view;
     * checkpoints rely on this order of the block. */
    colour = saga_params_lay(&p, b->block, shared_attrs(), n);
    for (int v = 0; v < n_views; v++) {
        b->seen[v] = p;
        b->seen[v].colour = colour + width * n * (size_t)v;
    }
    b->n = n;
    return true;
}

void saga_train_free_base(saga_backdrop *b)
{
    free(b->seen);
    free(b->block);
    memset(b, 0, sizeof *b);
}

bool saga_train_keep_base(saga_train *t, saga_error *error)
{
    const saga_splat_params *const from = &t->packed.twin.attr;
    const size_t n = t->packed.scene.n.prim;
    saga_backdrop *const b = &t->backdrop;

    if (!saga_train_alloc_base(b, (uint32_t)n, t->capture->n_views, error))
        return false;
    for (int a = 0; a < SAGA_N_ATTRS; a++)
        if (shared_attrs() & SAGA_ATTR_BIT(a))
            memcpy(b->seen->of[a], from->of[a],
                   n * (size_t)saga_attributes[a].width * sizeof(real));
    /* Cameras do not move, so a view sees the same colours at all times. The
     * other attributes are shared. */
    for (int v = 0; v < t->capture->n_views; v++) {
        saga_splat_camera camera;

        saga_pictures_camera(&camera, &t->pictures, (saga_sample){ .view = v });
        saga_twin_colour(&t->packed.twin, &t->packed.scene, camera.centre);
        memcpy(b->seen[v].colour, from->colour, 3 * n * sizeof(real));
    }
    return true;
}

void saga_train_show_base(saga_train *t)
{
    t->pictures.backdrop = t->backdrop.n ? &t->backdrop : NULL;
}
