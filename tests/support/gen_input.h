/* SPDX-License-Identifier: MIT
 *
 * Files as a capture consists of them, small and valid; damage to them; and
 * the reader of their kind, which may refuse anything and may crash at
 * nothing. Of the readers of trainer/capture only those of ffmpeg are
 * missing: video, WebP, TIFF.
 */
#ifndef GEN_INPUT_H
#define GEN_INPUT_H

#include <stddef.h>
#include <stdint.h>

typedef enum input_kind {
    INPUT_PNG,
    INPUT_JPEG,
    INPUT_EXR,               /* colours */
    INPUT_EXR_DEPTH,
    INPUT_NPY,
    INPUT_PLY,
    INPUT_PLY_TEXT,
    INPUT_JSON,              /* transforms.json, with pictures that exist */
    INPUT_SPORTS,            /* train_meta.json, with pictures that exist */
    INPUT_TOML,              /* calibration.toml, without videos */
    INPUT_COLMAP,            /* three files in one: each after its length */
    INPUT_COLMAP_TEXT,
    INPUT_N_KINDS
} input_kind;

extern const char *const input_kind_text[INPUT_N_KINDS];

/* A folder of its own for the files; exits where there is none. */
void input_begin(void);
void input_end(void);

/* A valid file (free it). */
uint8_t *input_seed(input_kind kind, size_t *n);

/* A damaged copy (free it). What checks itself, a PNG's chunks, is signed. */
uint8_t *input_damage(input_kind kind, const uint8_t *bytes, size_t n,
                      uint64_t *r, size_t *n_out);

/* Reads it: 1 if it was taken, 0 if it was refused. A refusal without a message
 * ends the program. */
int input_play(input_kind kind, const uint8_t *bytes, size_t n);

#endif
