/* SPDX-License-Identifier: MIT
 *
 * This table lists all loaders. Detection, the error message for an unknown
 * format, and `saga help check` are made from it. A loader that asks others
 * gets the table from its listing, not from here.
 */
#include "load.h"

extern const saga_loader saga_nerfstudio_loader, saga_blender_loader,
    saga_panoptic_loader, saga_calibrated_videos_loader, saga_neu3d_loader,
    saga_frame_folders_loader, saga_miv_loader, saga_colmap_loader;

/* The most certain signs come first. Frame folders come before the last two,
 * since a COLMAP model may lie beside them. */
static const saga_loader *const loaders[] = { &saga_nerfstudio_loader,
                                              &saga_blender_loader,
                                              &saga_panoptic_loader,
                                              &saga_calibrated_videos_loader,
                                              &saga_neu3d_loader,
                                              &saga_frame_folders_loader,
                                              &saga_miv_loader,
                                              &saga_colmap_loader,
                                              NULL };

enum { N_LOADERS = sizeof loaders / sizeof loaders[0] - 1 };

const saga_loader *saga_loader_at(int i)
{
    return i < N_LOADERS ? loaders[i] : NULL;
}

bool saga_listing_make(saga_listing *listing, const char *path,
                       const saga_capture_options *options, saga_error *error)
{
    listing->loaders = loaders;
    listing->follow_paths = options->follow_paths;
    if (!saga_listing_make_part(listing, path, NULL, options, error) ||
        !saga_listing_judge(listing, error))
        return false;
    saga_listing_note_turns(listing);
    /* Masks are found by the names of pictures, so they come last. */
    return saga_listing_find_masks(listing, path, options->subject, error);
}
