/* SPDX-License-Identifier: MIT
 *
 * Reads Blender's synthetic scenes and those of D-NeRF. Their files have the
 * form of transforms.json; the pictures that a second file lists are held out.
 */
#include "error.h"
#include "file.h"
#include "load.h"

#include <stdlib.h>

static bool is_there(const char *path, saga_error *error)
{
    (void)error;
    return saga_folder_has(path, "transforms_train.json");
}

static bool list(saga_listing *listing, const char *path,
                 const saga_capture_options *options, saga_error *error)
{
    const bool has_test = saga_folder_has(path, "transforms_test.json");
    char *const train = saga_path_join(path, "transforms_train.json", error);
    char *const test = saga_path_join(path, "transforms_test.json", error);
    const bool ok = train && test &&
                    saga_nerfstudio_list(listing, train, has_test ? test : NULL,
                                         options, error);
    free(train);
    free(test);
    return ok;
}

const saga_loader saga_blender_loader = {
    "Blender", "transforms_train.json",
    "transforms_train.json, transforms_test.json, in which pictures are named "
    "without extension; the files of D-NeRF have a time for each picture of "
    "their one moving camera",
    is_there, list
};
