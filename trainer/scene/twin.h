/* SPDX-License-Identifier: MIT
 *
 * The float twin of common/scaffold.c and decoder/reconstruct.c goes from a
 * scene to the primitives saga_splat draws, and back with the gradients. Paper:
 * Overview (Representation), Kernel Interpolation.
 *
 * Neighbours and their weights come from the integer path (saga_twin_refresh)
 * and stand still between refreshes; no gradient flows through them, nor
 * through the local offset o that the embedding sees. Supports learn from
 * motions and times that are in them, and from what quantising positions in
 * them has moved.
 */
#ifndef SAGA_TWIN_H
#define SAGA_TWIN_H

#include "arena.h"
#include "links.h"
#include "scene.h"
#include "splat.h"

/* Motion has at least this number of bits behind the point, and so at most
 * 127.996 supports per age^order: what is cut goes on in larger supports.
 * Rounded more coarsely, for the sake of a few, it is most of what a picture is
 * off. */
enum { SAGA_TWIN_MOTION_Q = 8 };

/* A batch goes through a network: what goes in and comes out, and gradients.
 * Room is made for the most rows there will be: passes do not fail. */
typedef struct saga_twin_batch {
    real *in, *out, *d_in, *d_out;
    saga_net_work work;
} saga_twin_batch;

typedef struct saga_twin {
    saga_counts n;
    saga_links to_fine, to_prim;
    saga_twin_batch batch[SAGA_N_NETS];
    real *fine_feature, *d_fine_feature;  /* (n.fine, F) */
    real *log2_support;                   /* (n.fine, 4) clamped */
    real *support;                        /* (n.fine, 4) */
    real *d_log2_support;                 /* (n.fine, 4) */
    real *context, *d_context;            /* (max(fine, prim), F) */
    real *fine_offset, *prim_offset;      /* (n, 4) local offsets o */
    real *fine_phase, *prim_phase;        /* (n, 4) positions, time in -1..1 */
    real *prim_shift;                     /* (n.prim, 4) how far noise or
                                           * rounding has moved positions, in
                                           * the supports' proportion: supports
                                           * learn by it; 0 where nobody sets
                                           * it */
    saga_splat_params attr, d_attr;       /* (n.prim): all but unused ones */
    real *block;                          /* memory of all of these */
} saga_twin;

#define saga_twin_batch_take SAGA_REAL_NAME(saga_twin_batch_take)
#define saga_twin_init SAGA_REAL_NAME(saga_twin_init)
#define saga_twin_free SAGA_REAL_NAME(saga_twin_free)
#define saga_twin_rows SAGA_REAL_NAME(saga_twin_rows)
#define saga_twin_refresh SAGA_REAL_NAME(saga_twin_refresh)
#define saga_twin_offsets SAGA_REAL_NAME(saga_twin_offsets)
#define saga_twin_geometry SAGA_REAL_NAME(saga_twin_geometry)
#define saga_twin_colour SAGA_REAL_NAME(saga_twin_colour)
#define saga_twin_clear SAGA_REAL_NAME(saga_twin_clear)
#define saga_twin_colour_backward \
    SAGA_REAL_NAME(saga_twin_colour_backward)
#define saga_twin_anchor_loss SAGA_REAL_NAME(saga_twin_anchor_loss)
#define saga_twin_backward SAGA_REAL_NAME(saga_twin_backward)

/* Lays out the batch of `rows` rows through a network. */
void saga_twin_batch_take(saga_twin_batch *b, saga_arena *a,
                          const saga_net *net, size_t rows);

/* Takes memory for scenes of s's counts and model, and for all that is done
 * with them but saga_twin_refresh. False: nothing is to be freed. */
bool saga_twin_init(saga_twin *w, const saga_scene *s, saga_error *error);
void saga_twin_free(saga_twin *w);

/* Returns how many points go through a network: rows of its batch. */
size_t saga_twin_rows(const saga_twin *w, int net);

/* Finds neighbours and weights anew, by common/interp.c on rounded positions;
 * those of primitives on the supports that F_fine gives with the new ones of
 * fine anchors. feature as for saga_twin_geometry. False: no memory. */
bool saga_twin_refresh(saga_twin *w, const saga_scene *s, const real *feature,
                       saga_error *error);

/* Sets local offsets and phases, from the positions and the supports of the
 * last saga_twin_geometry; a step of training does it once. Refresh includes
 * it. */
void saga_twin_offsets(saga_twin *w, const saga_scene *s);

/* Sets everything that does not depend on the camera: w->attr without colour,
 * the colour's pre-activations. feature (n.coarse, F) are the coarse features
 * to use, the scene's own or with noise or rounded. */
void saga_twin_geometry(saga_twin *w, const saga_scene *s,
                        const real *feature);

/* Sets w->attr.colour, seen from centre (half-cubes); NULL: the directions of
 * the last call again (or the model has no view dependence). */
void saga_twin_colour(saga_twin *w, const saga_scene *s, const real *centre);

/* Sets w->d_attr and the accumulated gradients to zero: before the first view
 * of a step. saga_splat_backward then adds to w->d_attr, and whoever else reads
 * w->fine_feature may add to w->d_fine_feature before saga_twin_backward. */
void saga_twin_clear(saga_twin *w, const saga_scene *s);

/* Adds weight times the mean over primitives of relu(|o| - 1)^2 (the paper's
 * L_A) to the gradients: of positions into d, of supports for
 * saga_twin_backward. Between saga_twin_clear and that. */
void saga_twin_anchor_loss(saga_twin *w, saga_scene *d, const saga_scene *s,
                           real weight);

/* Takes w->d_attr.colour (and clears it) and adds to d: once per view, after
 * saga_splat_backward and before the next view's colour. */
void saga_twin_colour_backward(saga_twin *w, saga_scene *d,
                               const saga_scene *s);

/* Takes the rest and adds to d, a scene of the same counts whose reals are
 * gradients: once per step. */
void saga_twin_backward(saga_twin *w, saga_scene *d, const saga_scene *s);

#endif
