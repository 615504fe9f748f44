/* SPDX-License-Identifier: MIT
 *
 * Binary glTF 2.0 with the extension KHR_gaussian_splatting. The file has a
 * JSON chunk and a binary chunk; the JSON says where each array lies in the
 * binary chunk. A primitive of the mode POINTS has one attribute each for
 * positions, rotations (x, y, z, w), scales and opacities, and one for each
 * harmonic. The axes x, y, z point left, up and forward.
 */
#ifndef SAGA_CLOUD_GLB_H
#define SAGA_CLOUD_GLB_H

#include "cloud_files.h"

enum {
    GLB_MAGIC = 0x46546c67,
    GLB_VERSION = 2,
    GLB_HEADER_NBYTES = 12,
    GLB_JSON = 0x4e4f534a,
    GLB_BIN = 0x004e4942, /* the chunks' types */
    GLB_FLOAT = 5126,
    GLB_POINTS = 0,
    GLB_NAME_NBYTES = 64
};

#define GLB_SPLATS "KHR_gaussian_splatting"
#define GLB_COLOUR_SPACE "srgb_rec709_display"

static inline void saga_glb_harmonic_name(char name[GLB_NAME_NBYTES],
                                          int degree, int k)
{
    (void)snprintf(name, GLB_NAME_NBYTES, GLB_SPLATS ":SH_DEGREE_%d_COEF_%d",
                   degree, k);
}

bool saga_is_glb(const saga_bytes *bytes);

/* Reads the file's only primitive of splats, which may be compressed as SPZ
 * (KHR_gaussian_splatting_compression_spz_2). */
bool saga_glb_read(saga_cloud *cloud, const saga_bytes *bytes, const char *path,
                   saga_error *error);

#endif
