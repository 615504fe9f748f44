/* SPDX-License-Identifier: MIT
 *
 * The float twin of common/scaffold.c and decoder/reconstruct.c: computes the
 * primitives that saga_splat draws from a scene, and takes the gradients back.
 * Paper: Overview (Representation), Kernel Interpolation.
 *
 * Neighbours and their weights come from the integer path (saga_twin_refresh)
 * and stay the same between refreshes. No gradient flows through them, nor
 * through the local offset o that is embedded. Supports get gradients from
 * motions and times, which are in units of supports, and from the shifts that
 * quantising positions causes.
 */
#ifndef SAGA_TWIN_H
#define SAGA_TWIN_H

#include "arena.h"
#include "links.h"
#include "scene.h"
#include "splat.h"

/* Motion has at least this number of fractional bits, which limits it to
 * 127.996 supports per age^order; larger motion needs larger supports. A
 * coarser format, for a few fast primitives, would cause most of the error of a
 * picture. */
enum { SAGA_TWIN_MOTION_Q = 8 };

/* The largest motion that fits 16 bits. */
#define SAGA_TWIN_MOST_MOTION (R(32767) / (1 << SAGA_TWIN_MOTION_Q))

/* Limits of a primitive's temporal centre. */
#define SAGA_TWIN_CENTRE_MIN (R(SAGA_CENTRE_T_MIN) / 65536)
#define SAGA_TWIN_CENTRE_MAX (R(SAGA_CENTRE_T_END) / 65536)

/* Returns log2 of the least support: one box unit, or one time unit. */
static inline real saga_twin_least_support(size_t axis)
{
    return axis < 3 ? -R(SAGA_LOG2_HALF_X) : -R(SAGA_LOG2_HALF_T + 1);
}

/* The inputs and outputs of a network for many rows. It has memory for the
 * largest number of rows, so passes cannot fail. Gradients are NULL if they are
 * used chunk by chunk, and not kept. */
typedef struct saga_twin_batch {
    real *in, *out;
    real *d_in, *d_out;
    saga_net_work work;
} saga_twin_batch;

typedef struct saga_twin {
    saga_counts n;
    saga_links to_fine, to_prim; /* links from fine anchors to coarse
                                  * ones, and from primitives to fine
                                  * ones */
    bool passes;                 /* F_fine gives each fine anchor its coarse
                                  * anchor's features unchanged */
    bool own[SAGA_N_TIERS];      /* of a tier, whether each row reads its
                                  * own anchor, without Fuse: then features
                                  * and gradients pass without a copy in
                                  * the context */
    bool whole;                  /* whether fine anchor i is also the only one
                                  * that primitive i reads, so that a thread
                                  * can take a chunk through all networks */
    saga_twin_batch batch[SAGA_N_NETS];
    real *fine_feature, *d_fine_feature; /* (n.fine, F) */
    real *log2_support;                  /* (n.fine, 4) clamped */
    real *support;                       /* (n.fine, 4) */
    real *d_log2_support;                /* (n.fine, 4) */
    real *context, *d_context;           /* (max(fine, prim), F) */
    real *fine_offset, *prim_offset;     /* (n, 4) local offsets o */
    real *fine_phase, *prim_phase;       /* (n, 4) positions, with the time in
                                          * -1..1 */
    real *prim_shift;                    /* (n.prim, 4) shift of positions by
                                          * noise or rounding, which is
                                          * proportional to the supports and
                                          * gives these a gradient; 0 if not
                                          * set */
    real correction_price;               /* weight of the mean over primitives
                                          * of |corrections|, L_res of the
                                          * paper; 0 if not set */
    saga_splat_params attr, d_attr;      /* (n.prim) unused attributes are
                                          * NULL */
    real *block;                         /* memory of all arrays above */
} saga_twin;

#define saga_twin_batch_take SAGA_REAL_NAME(saga_twin_batch_take)
#define saga_twin_init SAGA_REAL_NAME(saga_twin_init)
#define saga_twin_free SAGA_REAL_NAME(saga_twin_free)
#define saga_twin_rows SAGA_REAL_NAME(saga_twin_rows)
#define saga_twin_refresh SAGA_REAL_NAME(saga_twin_refresh)
#define saga_twin_offsets SAGA_REAL_NAME(saga_twin_offsets)
#define saga_twin_note_own SAGA_REAL_NAME(saga_twin_note_own)
#define saga_twin_parts SAGA_REAL_NAME(saga_twin_parts)
#define saga_twin_geometry SAGA_REAL_NAME(saga_twin_geometry)
#define saga_twin_colour SAGA_REAL_NAME(saga_twin_colour)
#define saga_twin_clear SAGA_REAL_NAME(saga_twin_clear)
#define saga_twin_colour_backward SAGA_REAL_NAME(saga_twin_colour_backward)
#define saga_twin_anchor_loss SAGA_REAL_NAME(saga_twin_anchor_loss)
#define saga_twin_size_loss SAGA_REAL_NAME(saga_twin_size_loss)
#define saga_twin_backward SAGA_REAL_NAME(saga_twin_backward)

/* Places the arrays of a batch of `rows` rows through a network in an arena,
 * without gradients. */
void saga_twin_batch_take(saga_twin_batch *b, saga_arena *a,
                          const saga_net *net, size_t rows);

/* Allocates memory for scenes with the counts and model of s. Later calls need
 * no memory, except saga_twin_refresh. Returns false with *error set, and
 * nothing to free, if memory is short. */
bool saga_twin_init(saga_twin *w, const saga_scene *s, saga_error *error);
void saga_twin_free(saga_twin *w);

/* Returns the number of rows in the batch of a network. */
size_t saga_twin_rows(const saga_twin *w, int net);

/* Finds the neighbours of all anchors and primitives, and their weights, again
 * after positions have changed: by common/interp.c on rounded positions, as the
 * decoder does. Primitives come last, since their neighbours depend on the
 * supports that F_fine computes for fine anchors. feature is as for
 * saga_twin_geometry. Returns false with *error set if memory is short. */
bool saga_twin_refresh(saga_twin *w, const saga_scene *s, const real *feature,
                       saga_error *error);

/* Notes in w->own and w->whole which rows read only their own anchors.
 * saga_twin_refresh includes it; who sets links otherwise calls it. */
void saga_twin_note_own(saga_twin *w, const saga_scene *s);

/* Sets local offsets and phases from the positions and from the supports of the
 * last saga_twin_geometry. Each iteration of training calls it once;
 * saga_twin_refresh includes it. */
void saga_twin_offsets(saga_twin *w, const saga_scene *s);

/* Computes everything that does not depend on the camera: w->attr without
 * colour, and the colour's pre-activations. feature (n.coarse, F) has the
 * coarse features to use: the scene's own, or with noise, or rounded. */
void saga_twin_geometry(saga_twin *w, const saga_scene *s, const real *feature);

/* Sets w->attr.colour as seen from centre (half-cubes). centre may be NULL to
 * use the directions of the last call, or if the colour does not depend on
 * them. */
void saga_twin_colour(saga_twin *w, const saga_scene *s, const real *centre);

/* Sets w->d_attr and the accumulated gradients to zero, before the first view
 * of an iteration. saga_splat_backward then adds to w->d_attr. Other users of
 * w->fine_feature may add to w->d_fine_feature, before saga_twin_backward. */
void saga_twin_clear(saga_twin *w, const saga_scene *s);

/* Adds weight times the mean over primitives of relu(|o| - 1)^2 (the paper's
 * L_A): its gradients by positions are added to d, those by supports kept for
 * saga_twin_backward. It is called between saga_twin_clear and that. */
void saga_twin_anchor_loss(saga_twin *w, saga_scene *d, const saga_scene *s,
                           real weight);

/* Adds weight times the sum over the first n primitives, and over their axes,
 * of relu(log2 scale - most)^2 to what w->d_attr is the gradient of. most
 * (n.prim) is a log2 size. It is called between saga_twin_clear and
 * saga_twin_backward. */
void saga_twin_size_loss(saga_twin *w, const real *most, uint32_t n,
                         real weight);

/* Takes the gradients w->d_attr.colour back, adds to d and clears them. It is
 * called once for each view, after saga_splat_backward and before the next
 * view's colour. */
void saga_twin_colour_backward(saga_twin *w, saga_scene *d,
                               const saga_scene *s);

/* Takes all other gradients back and adds to d, a scene with the same counts
 * whose reals are gradients. It is called once for each iteration. */
void saga_twin_backward(saga_twin *w, saga_scene *d, const saga_scene *s);

/* Sets which part of which attribute each output of F_geo is. */
void saga_twin_parts(saga_attr_part *part, const saga_scene *s);

#endif
