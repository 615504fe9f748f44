/* SPDX-License-Identifier: MIT
 *
 * A cloud is written in the formats that viewers of splats read, and read from
 * PLY. A file appears whole or not at all.
 *
 *     PLY   the layout of the first Gaussian splatting: x y z nx ny nz f_dc
 *           f_rest opacity scale rot, floats; normals are zeros. Exact.
 *     SPZ   version 3, by its public description: 24-bit positions, 8-bit
 *           opacities, colours and scales, 10-bit quaternions, gzipped
 *     GLB   glTF with the extension KHR_gaussian_splatting, floats. Exact.
 *
 * The cloud has PLY's axes; SPZ and GLB turn it as they have theirs, and back.
 */
#ifndef SAGA_CLOUD_FILES_H
#define SAGA_CLOUD_FILES_H

#include "cloud.h"

bool saga_cloud_write_ply(const char *path, const saga_cloud *cloud,
                          saga_error *error);

/* Reads splats of any degree 0..3, ascii or binary; those with numbers that are
 * not finite, or too faint to be drawn, are left out. Fails where a property of
 * theirs is missing, or where none is left. */
bool saga_cloud_read_ply(saga_cloud *cloud, const char *path,
                         saga_error *error);

/* Fails where positions are so far out that 24 bits have none for them. */
bool saga_cloud_write_spz(const char *path, saga_cloud *cloud,
                          saga_error *error);

/* Fails where there is no splat: glTF has no empty arrays. */
bool saga_cloud_write_glb(const char *path, saga_cloud *cloud,
                          saga_error *error);

#endif
