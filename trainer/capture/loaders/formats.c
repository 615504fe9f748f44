/* SPDX-License-Identifier: MIT
 *
 * This chooses the loader of a capture by what lies in its folder, and reads
 * the format that is made of others: a folder of frame folders (frame000/,
 * frame001/ ...), of which each is a capture of one moment with the same
 * cameras. The first one tells the cameras and the points, the others bring
 * pictures of the same names; a COLMAP model may also lie beside them.
 */
#include "alloc.h"
#include "error.h"
#include "file.h"
#include "load.h"
#include "moments.h"
#include "notes.h"

#include <dirent.h>
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* ------------------------------------------------------------ frame folders */

/* 0007, frame0007, f7, t_7: letters that begin like a frame or a time, and a
 * number; cam07 is a camera. */
static bool is_frame_name(const char *name)
{
    const size_t letters = strcspn(name, "0123456789");
    return strspn(name + letters, "0123456789") == strlen(name + letters) &&
           name[letters] && (letters == 0 || strchr("fFtT", name[0]));
}

/* Adds the frame folders in a folder, as finds of source 0. */
static bool find_frame_folders(saga_finds *finds, const char *path,
                               saga_error *error)
{
    DIR *const dir = opendir(path);
    /* A path that cannot be opened holds no frames; only missing memory is an
     * error. */
    bool ok = dir || errno != ENOMEM || saga_no_memory(0, path, error);
    for (struct dirent *e; dir && ok && (e = readdir(dir)) != NULL;) {
        uint64_t number;
        if (!is_frame_name(e->d_name) ||
            !saga_last_number(e->d_name, strlen(e->d_name), &number))
            continue;
        char *const folder = saga_path_join(path, e->d_name, error);
        if (folder && !saga_path_is_folder(folder))
            free(folder);
        else
            ok = saga_finds_add(finds, 0, number, folder, error);
    }
    if (dir)
        closedir(dir);
    return ok;
}

static int by_number(const void *a, const void *b)
{
    const saga_found *const x = a, *const y = b;
    if (x->moment != y->moment)
        return x->moment < y->moment ? -1 : 1;
    return strcmp(x->path, y->path);
}

/* Gives a list of one path room for n; one that is not there stays so. */
static bool grow_list(char ***files, size_t n, const char *path,
                      saga_error *error)
{
    if (!*files)
        return true;
    char **const more = saga_calloc(n, sizeof *more, path, error);
    if (!more)
        return false;
    more[0] = (*files)[0];
    free(*files);
    *files = more;
    return true;
}

/* The first path must lie in the first folder, by its name, for the others to
 * have the like. */
static bool is_below(const char *file, const char *folder, saga_error *error)
{
    const size_t n = strlen(folder);
    return (strncmp(file, folder, n) == 0 && file[n] == '/') ||
           saga_fail(error, file, "give names that begin in the frame folder",
                     "is no name in %s, the first of the frame folders",
                     folder);
}

/* Fills a list from its first path: the file of that name in every other
 * folder. Those that are not there are counted. */
static bool fill_list(char **files, const saga_finds *folders, int *n_missing,
                      saga_error *error)
{
    const size_t skip = strlen(folders->items[0].path) + 1;
    if (files && files[0] && !is_below(files[0], folders->items[0].path, error))
        return false;
    for (size_t k = 1; files && files[0] && k < folders->n; k++) {
        char *const path = saga_path_join(folders->items[k].path,
                                          files[0] + skip, error);
        if (!path)
            return false;
        if (saga_path_is_file(path)) {
            files[k] = path;
        } else {
            free(path);
            ++*n_missing;
        }
    }
    return true;
}

static bool add_frames(saga_listing *listing, const saga_finds *folders,
                       saga_error *error)
{
    int n_missing = 0, n_depths = 0;
    bool ok = true;
    for (int i = 0; ok && i < listing->n_sources; i++) {
        saga_source *const s = &listing->sources[i];
        ok = grow_list(&s->pictures, folders->n, listing->path, error) &&
             grow_list(&s->depths, folders->n, listing->path, error);
    }
    if (!ok)
        return false;
    /* Not earlier: saga_listing_free walks so far along every list. */
    listing->n_frames = (int)folders->n;
    for (int i = 0; ok && i < listing->n_sources; i++) {
        saga_source *const s = &listing->sources[i];
        ok = fill_list(s->pictures, folders, &n_missing, error) &&
             fill_list(s->depths, folders, &n_depths, error);
    }
    if (ok && n_missing > 0)
        saga_note(listing->notes, "pictures: %d are missing in the frame "
                  "folders", n_missing);
    if (ok)
        saga_note(listing->notes, "frames: %zu folders; cameras and points are "
                  "those of %s", folders->n, folders->items[0].path);
    return ok;
}

typedef bool list_fn(saga_listing *listing, const char *path,
                     const saga_capture_options *options, saga_error *error);

static list_fn list_one;

static bool list_frame_folders(saga_listing *listing, const char *path,
                               const saga_finds *folders,
                               const saga_capture_options *options,
                               saga_error *error)
{
    /* A COLMAP model beside the folders is of all frames; else the first folder
     * is a capture in itself. */
    const char *const first = folders->items[0].path;
    const bool shared = saga_colmap_folder_is_there(path, error);
    if (saga_failed(error))
        return false;
    if (!(shared ? saga_colmap_folder_list(listing, first, path, options, error)
                 : list_one(listing, first, options, error)))
        return false;
    if (listing->n_frames != 1 || listing->sources[0].video)
        return saga_fail(error, first, "give each frame a folder with one "
                         "picture of each camera", "is the first of %zu frame "
                         "folders but holds videos or several frames itself",
                         folders->n);
    return add_frames(listing, folders, error);
}

/* ------------------------------------------------------------------- choice */

static bool unknown_format(const char *path, saga_error *error)
{
    if (!saga_path_is_folder(path))
        return saga_fail(error, path, "give the folder of a capture, or its "
                         "transforms.json", "does not exist or is neither a "
                         "folder nor a .json file");
    return saga_fail(error, path, "looked for transforms.json, "
                     "transforms_train.json, camNN.mp4, sparse/0 beside "
                     "images/, train_meta.json, MIV's JSON with .yuv, and "
                     "folders of frames; `saga help check` tells the layouts",
                     "holds no capture of a known format");
}

/* Blender's scenes list what is held out in a file of its own. */
static bool list_blender(saga_listing *listing, const char *path,
                         const saga_capture_options *options,
                         saga_error *error)
{
    const bool has_test = saga_folder_has(path, "transforms_test.json");
    char *const train = saga_path_join(path, "transforms_train.json", error);
    char *const test = saga_path_join(path, "transforms_test.json", error);
    const bool ok = train && test &&
                    saga_nerfstudio_list(listing, train,
                                         has_test ? test : NULL, options,
                                         error);
    free(train);
    free(test);
    return ok;
}

/* Lists a capture that is no folder of frame folders. */
static bool list_one(saga_listing *listing, const char *path,
                     const saga_capture_options *options, saga_error *error)
{
    if (saga_has_suffix(path, ".json") && saga_path_is_file(path))
        return saga_nerfstudio_list(listing, path, NULL, options, error);
    char *const json = saga_path_join(path, "transforms.json", error);
    if (!json)
        return false;
    bool ok = false;
    /* Surest signs first. From Neu3D on a search that says no may also have run
     * out of memory, hence saga_failed. */
    if (saga_path_is_file(json))
        ok = saga_nerfstudio_list(listing, json, NULL, options, error);
    else if (saga_folder_has(path, "transforms_train.json"))
        ok = list_blender(listing, path, options, error);
    else if (saga_folder_has(path, "train_meta.json"))
        ok = saga_panoptic_list(listing, path, options, error);
    else if (saga_neu3d_is_there(path, error))
        ok = saga_neu3d_list(listing, path, options, error);
    else if (!saga_failed(error) && saga_miv_is_there(path, error))
        ok = saga_miv_list(listing, path, options, error);
    else if (!saga_failed(error) && saga_colmap_folder_is_there(path, error))
        ok = saga_colmap_folder_list(listing, path, NULL, options, error);
    else if (!saga_failed(error))
        ok = unknown_format(path, error);
    free(json);
    return ok;
}

/* Tells whether a folder holds folders of frames and nothing that says
 * otherwise; they are sorted. */
static bool has_frame_folders(saga_finds *folders, const char *path,
                              saga_error *error)
{
    if (saga_folder_has(path, "transforms.json") ||
        saga_folder_has(path, "transforms_train.json") ||
        saga_folder_has(path, "train_meta.json") ||
        saga_neu3d_is_there(path, error) || saga_failed(error))
        return false;
    /* With images/ it is a COLMAP folder, whose loader reads folders of frames
     * itself. */
    char *const images = saga_path_join(path, "images", error);
    const bool single = images && saga_path_is_folder(images);
    free(images);
    if (!images || single || !find_frame_folders(folders, path, error) ||
        folders->n < 2)
        return false;
    qsort(folders->items, folders->n, sizeof *folders->items, by_number);
    return true;
}

bool saga_listing_make(saga_listing *listing, const char *path,
                       const saga_capture_options *options, saga_error *error)
{
    saga_finds folders = {0};
    listing->follow_paths = options->follow_paths;
    const bool many = has_frame_folders(&folders, path, error);
    const bool ok = !saga_failed(error) &&
                    (many ? list_frame_folders(listing, path, &folders,
                                               options, error)
                          : list_one(listing, path, options, error));
    /* Masks are found by the names of the pictures, so they come last. */
    saga_finds_free(&folders);
    return ok && saga_listing_find_masks(listing, path, error);
}
