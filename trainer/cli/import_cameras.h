/* SPDX-License-Identifier: MIT
 *
 * The cameras of saga import, which draw the pictures for the training: those
 * of a file or a path, or rings all around the splats.
 */
#ifndef SAGA_IMPORT_CAMERAS_H
#define SAGA_IMPORT_CAMERAS_H

#include "capture.h"
#include "cli.h"
#include "cloud.h"
#include "error.h"

typedef struct saga_import_cameras {
    const char *file;        /* a film, or a path that saga_path_read can read;
                              * NULL: rings */
    saga_cli_pair size;      /* of the pictures; 0: those of the file */
    const saga_cloud *first; /* the splats of the first frame */
    saga_source_view *view;  /* (n_views) the result, which the caller frees */
    int n_views;
    saga_error *error;
} saga_import_cameras;

/* Sets the views. Returns false with *error set on failure; the caller frees
 * the views in any case. */
bool saga_import_find_cameras(saga_import_cameras *s);

#endif
