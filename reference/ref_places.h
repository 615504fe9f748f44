/* SPDX-License-Identifier: MIT
 *
 * Where anchors are, and what a block finds around it: features interpolated
 * in double, from the neighbours that the integer decoder has.
 */
#ifndef REF_PLACES_H
#define REF_PLACES_H

#include "interp.h"
#include "ref_scene.h"

#define REF_Q14 (1 / 16384.0)

/* A block of the entropy model, or a point that looks for neighbours. */
typedef struct {
    double x[4], support[4], log2_size[4];
    double count;            /* children, known before it */
    uint32_t rank, parent;   /* parent: coarse */
    int kind;
} ref_block;

/* Tables of features that an interpolation reads: coarse anchors', fine
 * anchors' as contexts see them, fine anchors' when F_fine has run. */
enum { REF_TABLE_COARSE, REF_TABLE_CONTEXT, REF_TABLE_FINE };

/* Half-sizes of a cell on an axis, in units of position; their log2; its
 * centre. */
double ref_half_size(const saga_coarse *c, int axis);
double ref_log2_half_size(const saga_coarse *c, int axis);
void ref_cell_centre(double x[4], const saga_coarse *c);

/* The cell that a fine anchor lies in is its parent's. */
const saga_coarse *ref_cell_of(const ref_scene *s, uint32_t fine);

/* x + support o, clamped to the segment. */
void ref_move(double x[4], const double support[4], const double o[4]);

/* The centre of a suffix cell on an axis, and a fine anchor's on all, in
 * half-sizes of the parent's cell. */
double ref_suffix_axis(uint32_t suffix, uint32_t bits, uint32_t axis);
void ref_fine_suffix(double o[4], const ref_scene *s, uint32_t rank);

/* The place of a fine anchor with the offset o from its parent's cell. */
void ref_fine_place(double x[4], const ref_scene *s, uint32_t rank,
                    const double o[4]);

void ref_block_make(ref_block *b, const ref_scene *s, int kind, uint32_t rank);

/* Channel i of an anchor in a table, and the last place of that channel. */
double ref_feature_of(const ref_scene *s, int table, uint32_t rank,
                      uint32_t i);
double ref_table_unit(const ref_scene *s, int table, uint32_t i);

/* F features around a block: of given neighbours; of coarse anchors around a
 * fine one, whose offset is known or not; of its tier's earlier groups. */
void ref_interpolate(double *out, const ref_scene *s, int table,
                     const ref_block *b, const saga_neighbours *nb);
void ref_coarse_at_fine(double *out, const ref_scene *s, const ref_block *b,
                        int is_known);
void ref_earlier_groups(double *out, const ref_scene *s, const ref_block *b);

#endif
