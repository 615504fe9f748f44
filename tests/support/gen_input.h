/* SPDX-License-Identifier: MIT
 *
 * Small valid files of each kind that a capture has, clouds of splats in each
 * format that is imported, and checkpoints; damage to them; and the call of
 * their reader, which may refuse any file but must never crash. Only videos,
 * which ffmpeg reads, are missing.
 */
#ifndef GEN_INPUT_H
#define GEN_INPUT_H

#include <stddef.h>
#include <stdint.h>

typedef enum input_kind {
    INPUT_PNG,
    INPUT_JPEG,
    INPUT_EXR, /* colours */
    INPUT_EXR_DEPTH,
    INPUT_NPY,
    INPUT_PLY,
    INPUT_PLY_TEXT,
    INPUT_JSON,   /* transforms.json, with pictures that exist */
    INPUT_SPORTS, /* train_meta.json, with pictures that exist */
    INPUT_TOML,   /* calibration.toml, without videos */
    INPUT_COLMAP, /* three files in one, each after its length */
    INPUT_COLMAP_TEXT,
    INPUT_CLOUD, /* and four more, of saga_cloud_format_at(0..4) */
    INPUT_CHECKPOINT = INPUT_CLOUD + 5,
    INPUT_FILM, /* a .saga file, for cut, join and mux; also with
                 * its checksums computed anew */
    INPUT_TIFF, /* in strips of LZW, and of JPEG in YCbCr, which
                 * libtiff converts */
    INPUT_TIFF_YCBCR,
    INPUT_WEBP,
    INPUT_N_KINDS
} input_kind;

extern const char *const input_kind_text[INPUT_N_KINDS];

/* Make and remove a folder for the files. input_begin exits if it cannot. */
void input_begin(void);
void input_end(void);

/* Returns a valid file, which the caller frees: tests/corpus/input/seedNN of
 * the kind NN, without its first byte, or one that is made. SAGA_ROOT is the
 * repository's folder, by default ".". */
uint8_t *input_seed(input_kind kind, size_t *n);

/* Returns a damaged copy, which the caller frees. The checksums of a PNG's
 * chunks are made right again. */
uint8_t *input_damage(input_kind kind, const uint8_t *bytes, size_t n,
                      uint64_t *r, size_t *n_out);

/* Reads a file. Returns 1 if it was accepted, 0 if it was refused. A refusal
 * without a message ends the program. */
int input_play(input_kind kind, const uint8_t *bytes, size_t n);

#endif
