/* SPDX-License-Identifier: MIT
 *
 * A folder of frame folders (frame000/, frame001/ ...) is a capture whose parts
 * are captures of one moment with the same cameras. The first one has the
 * cameras and the points; the others have pictures of the same names. The
 * cameras may also come from a COLMAP model beside the folders.
 */
#include "alloc.h"
#include "colmap_views.h"
#include "error.h"
#include "file.h"
#include "moments.h"
#include "notes.h"
#include "order.h"

#include <stdlib.h>
#include <string.h>

extern const saga_loader saga_frame_folders_loader;

/* Accepts 0007, frame0007, f7 and t_7: a number, or a number after letters that
 * begin like "frame" or "time". cam07 is a camera. */
static bool is_frame_name(const char *name)
{
    const size_t letters = strcspn(name, "0123456789");
    return strspn(name + letters, "0123456789") == strlen(name + letters) &&
           name[letters] && (letters == 0 || strchr("fFtT", name[0]));
}

/* Adds the frame folders in a folder to `finds`, all for source 0. */
static bool find_frame_folders(saga_finds *finds, const char *path,
                               saga_error *error)
{
    saga_names names;
    bool ok = saga_folder_list(&names, path, is_frame_name, error);
    for (size_t i = 0; ok && i < names.n; i++) {
        uint64_t number;
        (void)saga_last_number(names.at[i], strlen(names.at[i]), &number);
        char *const folder = saga_path_join(path, names.at[i], error);
        if (folder && !saga_path_is_folder(folder))
            free(folder);
        else
            ok = saga_finds_add(finds, 0, number, folder, error);
    }
    saga_names_free(&names);
    return ok;
}

static int by_number(const void *a, const void *b)
{
    const saga_found *const x = a, *const y = b;
    if (x->moment != y->moment)
        return x->moment < y->moment ? -1 : 1;
    return saga_compare_names(x->path, y->path);
}

/* Replaces a list of one path by one with room for n. A list that is NULL stays
 * NULL. */
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

/* Checks that the first path lies in the first folder, because the paths in the
 * other folders are derived from it. */
static bool is_below(const char *file, const char *folder, saga_error *error)
{
    const size_t n = strlen(folder);
    return (strncmp(file, folder, n) == 0 && file[n] == '/') ||
           saga_fail(error, file, "use picture paths inside the frame folder",
                     "does not lie in %s, the first of the frame folders",
                     folder);
}

/* Fills a list with the files that have the first file's name in the other
 * folders, and counts the missing ones. */
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
    /* n_frames is set only now, because saga_listing_free reads that number of
     * items of each list. */
    listing->n_frames = (int)folders->n;
    for (int i = 0; ok && i < listing->n_sources; i++) {
        saga_source *const s = &listing->sources[i];
        ok = fill_list(s->pictures, folders, &n_missing, error) &&
             fill_list(s->depths, folders, &n_depths, error);
    }
    if (ok && n_missing > 0)
        saga_note(listing->notes,
                  "pictures: %d are missing in the frame "
                  "folders",
                  n_missing);
    if (ok)
        saga_note(listing->notes,
                  "frames: %zu folders; cameras and points are "
                  "those of %s",
                  folders->n, folders->items[0].path);
    return ok;
}

static bool list_folders(saga_listing *listing, const char *path,
                         const saga_finds *folders,
                         const saga_capture_options *options, saga_error *error)
{
    /* A COLMAP model beside the folders serves all frames. Without one, the
     * first folder is a capture by itself. */
    const char *const first = folders->items[0].path;
    char *model = NULL;
    bool ok = saga_colmap_find(&model, path, error);
    const bool shared = model != NULL;
    free(model);
    if (!ok)
        return false;
    ok = shared ? saga_colmap_list(listing, first, path, options, error)
                : saga_listing_make_part(listing, first,
                                         &saga_frame_folders_loader, options,
                                         error);
    if (!ok)
        return false;
    if (listing->n_frames != 1 || listing->sources[0].video)
        return saga_fail(error, first,
                         "give each frame a folder with one "
                         "picture of each camera",
                         "is the first of %zu frame "
                         "folders but holds videos or several frames itself",
                         folders->n);
    return add_frames(listing, folders, error);
}

/* A folder with images/ is left to COLMAP's loader, which reads folders of
 * frames itself. */
static bool is_there(const char *path, saga_error *error)
{
    saga_finds folders = { 0 };
    char *const images = saga_path_join(path, "images", error);
    const bool there = images && !saga_path_is_folder(images) &&
                       find_frame_folders(&folders, path, error) &&
                       folders.n > 1;
    saga_finds_free(&folders);
    free(images);
    return there;
}

static bool list(saga_listing *listing, const char *path,
                 const saga_capture_options *options, saga_error *error)
{
    saga_finds folders = { 0 };
    bool ok = find_frame_folders(&folders, path, error);
    if (ok) {
        qsort(folders.items, folders.n, sizeof *folders.items, by_number);
        ok = list_folders(listing, path, &folders, options, error);
    }
    saga_finds_free(&folders);
    return ok;
}

const saga_loader saga_frame_folders_loader = {
    "frame folders", "folders of frames",
    "frame000/, frame001/ ..., each of which holds one moment in one of the "
    "other layouts, or all of which share a COLMAP model that lies next to "
    "them",
    is_there, list
};
