/* SPDX-License-Identifier: MIT
 *
 * All loaders stand in one table here, from which detection, the message about
 * what is no capture, and `saga help check` are made.
 */
#include "error.h"
#include "file.h"
#include "load.h"

#include <stdio.h>

extern const saga_loader saga_nerfstudio_loader, saga_blender_loader,
    saga_panoptic_loader, saga_neu3d_loader, saga_frame_folders_loader,
    saga_miv_loader, saga_colmap_loader;

/* The surest signs come first. Frame folders come before the last two, since a
 * COLMAP model may lie beside them. */
static const saga_loader *const loaders[] = {
    &saga_nerfstudio_loader, &saga_blender_loader, &saga_panoptic_loader,
    &saga_neu3d_loader, &saga_frame_folders_loader, &saga_miv_loader,
    &saga_colmap_loader,
};

enum { N_LOADERS = sizeof loaders / sizeof loaders[0] };

const saga_loader *saga_loader_at(int i)
{
    return i < N_LOADERS ? loaders[i] : NULL;
}

static bool unknown_format(const char *path, saga_error *error)
{
    char looked[400];
    size_t n = (size_t)snprintf(looked, sizeof looked, "looked for ");
    if (!saga_path_is_folder(path))
        return saga_fail(error, path, "give the folder of a capture, or its "
                         "transforms.json", "does not exist or is neither a "
                         "folder nor a .json file");
    for (int i = 0; i < N_LOADERS && n < sizeof looked; i++)
        n += (size_t)snprintf(looked + n, sizeof looked - n, "%s%s",
                              loaders[i]->sign,
                              i + 1 < N_LOADERS ? ", "
                                                : "; `saga help check` tells "
                                                  "the layouts");
    return saga_fail(error, path, looked,
                     "holds no capture of a known format");
}

bool saga_listing_make_part(saga_listing *listing, const char *path,
                            const saga_loader *without,
                            const saga_capture_options *options,
                            saga_error *error)
{
    const saga_loader *found = NULL;
    /* A search that says no may also have run out of memory. */
    for (int i = 0; i < N_LOADERS && !found && !saga_failed(error); i++)
        if (loaders[i] != without && loaders[i]->is_there(path, error))
            found = loaders[i];
    if (saga_failed(error))
        return false;
    if (!found)
        return unknown_format(path, error);
    listing->format = found->name;
    return found->list(listing, path, options, error);
}

bool saga_listing_make(saga_listing *listing, const char *path,
                       const saga_capture_options *options, saga_error *error)
{
    listing->follow_paths = options->follow_paths;
    /* Masks are found by the names of the pictures, so they come last. */
    return saga_listing_make_part(listing, path, NULL, options, error) &&
           saga_listing_find_masks(listing, path, error);
}
