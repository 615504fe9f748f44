/* SPDX-License-Identifier: MIT
 *
 * These functions compute positions of anchors in double, and interpolate
 * features around a block. Which anchors are neighbours is taken from the
 * integer decoder.
 */
#ifndef REF_PLACES_H
#define REF_PLACES_H

#include "interp.h"
#include "ref_scene.h"

#define REF_Q14 (1 / 16384.0)

/* A block of the entropy model, or a point around which features are
 * interpolated. */
typedef struct {
    double x[4], support[4], log2_size[4];
    double count;          /* children of the anchor, or for kind FINE of its
                            * parent */
    uint32_t rank, parent; /* ranks of the anchor and of its coarse anchor */
    int kind;
} ref_block;

/* The tables of features that an interpolation reads: those of coarse anchors,
 * those of fine anchors while they are decoded (offset residuals and counts),
 * and those of fine anchors after F_fine has run. */
enum { REF_TABLE_COARSE, REF_TABLE_CONTEXT, REF_TABLE_FINE };

/* Return half the size of a cell along an axis, in units of position, and the
 * log2 of it; the third function sets x to the cell's centre. */
double ref_half_size(const saga_coarse *c, int axis);
double ref_log2_half_size(const saga_coarse *c, int axis);
void ref_cell_centre(double x[4], const saga_coarse *c);

/* Returns the coarse anchor in whose cell a fine anchor lies: its parent. */
const saga_coarse *ref_cell_of(const ref_scene *s, uint32_t fine);

/* Moves x by support times o, and clamps it to the cube and the segment. */
void ref_move(double x[4], const double support[4], const double o[4]);

/* Return, or set o to, the centre of a suffix cell in half-sizes of the
 * parent's cell: along one axis, and along all four for a fine anchor. */
double ref_suffix_axis(uint32_t suffix, uint32_t bits, uint32_t axis);
void ref_fine_suffix(double o[4], const ref_scene *s, uint32_t rank);

/* Sets x to the position of a fine anchor whose offset in its parent's cell is
 * o. */
void ref_fine_place(double x[4], const ref_scene *s, uint32_t rank,
                    const double o[4]);

void ref_block_make(ref_block *b, const ref_scene *s, int kind, uint32_t rank);

/* Return channel i of an anchor's row in a table, and the unit of one last
 * place of that channel. */
double ref_feature_of(const ref_scene *s, int table, uint32_t rank, uint32_t i);
double ref_table_unit(const ref_scene *s, int table, uint32_t i);

/* Set out to F features interpolated at a block: from the given neighbours;
 * from the coarse anchors around a fine anchor, whose offset is already decoded
 * or not; from the earlier groups of the block's own tier. */
void ref_interpolate(double *out, const ref_scene *s, int table,
                     const ref_block *b, const saga_neighbours *nb);
void ref_coarse_at_fine(double *out, const ref_scene *s, const ref_block *b,
                        int is_known);
void ref_earlier_groups(double *out, const ref_scene *s, const ref_block *b);

#endif
