/* SPDX-License-Identifier: MIT
 *
 * Reads a plain COLMAP folder: a sparse model in sparse/0, or where
 * saga_colmap_find looks, and pictures in images/, or beside the model's folder
 * if there is no images/.
 *
 * An image of the model is a camera. Its pictures are found in one of these
 * forms:
 *
 *     images/NAME           its only picture. Images with the same pose and the
 *                           same camera of the model are one camera at several
 *                           moments: CAM/0001.jpg CAM/0002.jpg, or 0001/CAM.jpg
 *                           0002/CAM.jpg
 *     images/STEM/          NAME without its extension: a folder of its frames
 *     images/FOLDER/        if every image of the model has a FOLDER of its
 *                           own: all pictures in it are frames
 *
 * The last number in a name is the moment. A missing picture is left out, and
 * so is a camera without any. No camera is held out.
 */
#include "alloc.h"
#include "colmap_views.h"
#include "error.h"
#include "file.h"
#include "moments.h"
#include "notes.h"
#include "order.h"
#include "picture.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

typedef const saga_colmap_image *image_pointer;

typedef struct folder_reader {
    saga_listing *listing;
    const char *model_folder;
    char *root; /* folder of the pictures */
    saga_colmap model;
    int *source_of;          /* (n_images) the source of each image of the
                              * model, -1: none */
    image_pointer *image_of; /* (n_sources) the first image of each source */
    saga_finds finds;
    saga_error *error;
} folder_reader;

static size_t folder_length(const char *name)
{
    const char *const slash = strrchr(name, '/');
    return slash ? (size_t)(slash - name) : 0;
}

static size_t stem_length(const char *name)
{
    const char *const dot = strrchr(name, '.');
    return dot && dot > name + folder_length(name) ? (size_t)(dot - name)
                                                   : strlen(name);
}

/* ------------------------------------------------------- images to cameras */

static int by_pose(const void *a, const void *b)
{
    const image_pointer x = *(const image_pointer *)a;
    const image_pointer y = *(const image_pointer *)b;
    if (x->camera != y->camera)
        return x->camera < y->camera ? -1 : 1;
    /* Only poses that agree in all bits are equal. For other poses, the order
     * does not matter. */
    const int r = memcmp(x->rotation, y->rotation, sizeof x->rotation);
    return r ? r
             : memcmp(x->translation, y->translation, sizeof x->translation);
}

static int by_name(const void *a, const void *b)
{
    const image_pointer x = *(const image_pointer *)a;
    const image_pointer y = *(const image_pointer *)b;
    return saga_compare_names(x->name, y->name);
}

static int by_pose_and_name(const void *a, const void *b)
{
    const int r = by_pose(a, b);
    return r ? r : by_name(a, b);
}

/* Groups the model's images into cameras. Sets source_of, and image_of to the
 * first image of each camera by name, ordered by name. */
static bool group_images(folder_reader *r)
{
    const size_t n = r->model.n_images;
    image_pointer *const sorted = saga_alloc(n, sizeof *sorted, r->model_folder,
                                             r->error);
    r->image_of = saga_alloc(n, sizeof *r->image_of, r->model_folder, r->error);
    r->source_of = saga_alloc(n, sizeof *r->source_of, r->model_folder,
                              r->error);
    r->listing->sources = saga_calloc(n, sizeof *r->listing->sources,
                                      r->model_folder, r->error);
    const bool ok = sorted && r->image_of && r->source_of &&
                    r->listing->sources;
    for (size_t i = 0; ok && i < n; i++)
        sorted[i] = &r->model.images[i];
    /* Images of one camera become neighbours, with the first by name in
     * front. */
    if (ok && n > 0)
        qsort(sorted, n, sizeof *sorted, by_pose_and_name);
    size_t n_sources = 0;
    for (size_t i = 0; ok && i < n; i++)
        if (i == 0 || by_pose(&sorted[i - 1], &sorted[i]) != 0)
            r->image_of[n_sources++] = sorted[i];
    free(sorted);
    if (!ok)
        return false;
    if (n_sources < 1 || n_sources > SAGA_MAX_VIEWS)
        return saga_fail(r->error, r->model_folder,
                         "reconstruct with cameras "
                         "that stand still",
                         "has %zu different cameras, not "
                         "1 to %d",
                         n_sources, SAGA_MAX_VIEWS);
    /* The listing is ordered by names, not by poses. */
    qsort(r->image_of, n_sources, sizeof *r->image_of, by_name);
    r->listing->n_sources = (int)n_sources;
    for (size_t i = 0; i < n; i++) {
        const image_pointer image = &r->model.images[i];
        /* The loop ends, because the image's own camera is in the list. */
        int s = 0;
        while (by_pose(&r->image_of[s], &image) != 0)
            s++;
        r->source_of[i] = s;
    }
    return true;
}

/* ----------------------------------------------------------------- pictures */

/* Tells whether each image of the model is alone in its folder. */
static bool own_folders(const folder_reader *r)
{
    const int n = r->listing->n_sources;
    if ((size_t)n != r->model.n_images)
        return false;
    for (int i = 0; i < n; i++) {
        const char *const name = r->image_of[i]->name;
        const size_t m = folder_length(name);
        if (m == 0 || (i > 0 && folder_length(r->image_of[i - 1]->name) == m &&
                       strncmp(r->image_of[i - 1]->name, name, m) == 0))
            return false; /* equal folders are neighbours by name */
    }
    return true;
}

/* Tells whether a camera has pictures of the same name in several folders. Each
 * folder is then one moment. */
static bool folders_are_moments(const folder_reader *r)
{
    for (size_t i = 0; i < r->model.n_images; i++) {
        const saga_colmap_image *const a = &r->model.images[i];
        const saga_colmap_image *const b = r->image_of[r->source_of[i]];
        if (a != b && strcmp(a->name + folder_length(a->name),
                             b->name + folder_length(b->name)) == 0)
            return true;
    }
    return false;
}

static char *join_part(const folder_reader *r, const char *name, size_t n)
{
    char *const path = saga_listing_join(r->listing, r->root, name,
                                         r->model_folder, r->error);
    if (path)
        path[strlen(path) - (strlen(name) - n)] = '\0';
    return path;
}

/* Adds all pictures in the folder that the first n characters of image i's name
 * give. Sets *found if the folder exists. */
static bool add_folder(folder_reader *r, size_t i, size_t n, bool *found)
{
    char *const folder = join_part(r, r->model.images[i].name, n);
    bool ok = folder != NULL;
    *found = ok && saga_path_is_folder(folder);
    if (*found)
        ok = saga_finds_add_folder(&r->finds, r->source_of[i], folder,
                                   r->error);
    free(folder);
    return ok;
}

static bool add_file(folder_reader *r, size_t i, bool folder_tells, bool *found)
{
    const char *const name = r->model.images[i].name;
    const size_t begin = folder_tells ? 0 : folder_length(name);
    const size_t end = folder_tells ? folder_length(name) : stem_length(name);
    uint64_t moment;
    /* The moment's number is in the folder's name or in the file's own name. */
    char *const path = join_part(r, name, strlen(name));
    *found = path && saga_path_is_file(path);
    if (*found) {
        (void)saga_last_number(name + begin, end - begin, &moment);
        return saga_finds_add(&r->finds, r->source_of[i], moment, path,
                              r->error);
    }
    saga_listing_miss(r->listing, path);
    return path != NULL;
}

static bool find_pictures(folder_reader *r)
{
    const bool own = own_folders(r), tells = folders_are_moments(r);
    size_t n_missing = 0, first = 0;
    for (size_t i = 0; i < r->model.n_images; i++) {
        /* A folder of the image's own comes before the file, because the image
         * is then only one of the frames in that folder. */
        const char *const name = r->model.images[i].name;
        bool found = false;
        if (own && !add_folder(r, i, folder_length(name), &found))
            return false;
        if (!found && !add_file(r, i, tells, &found))
            return false;
        if (!found && stem_length(name) < strlen(name) &&
            !add_folder(r, i, stem_length(name), &found))
            return false;
        first = !found && n_missing == 0 ? i : first;
        n_missing += found ? 0 : 1;
    }
    if (n_missing > 0)
        saga_note(r->listing->notes,
                  "pictures: %zu of the model's %zu are "
                  "missing in %s (%.80s)",
                  n_missing, r->model.n_images, r->root,
                  r->model.images[first].name);
    return true;
}

/* Names a camera by its folder if that holds its frames, otherwise by its
 * picture. If such names are not all different, longer names and then numbers
 * are tried. */
static void name_sources(folder_reader *r)
{
    saga_listing *const l = r->listing;
    const bool frames = r->finds.n > (size_t)l->n_sources;
    for (int scheme = frames && !folders_are_moments(r) ? 0 : 1; scheme < 4;
         scheme++) {
        for (int i = 0; i < l->n_sources; i++) {
            /* The schemes are the folder, the file without its extension, both,
             * and numbers. */
            const char *const name = r->image_of[i]->name;
            const size_t folder = folder_length(name), end = stem_length(name);
            const size_t slash = name[folder] == '/';
            char *const to = l->sources[i].name;
            if (scheme == 0)
                saga_copy_name(to, name, folder);
            else if (scheme == 1)
                saga_copy_name(to, name + folder + slash, end - folder - slash);
            else if (scheme == 2)
                saga_copy_name(to, name, end);
            else
                (void)snprintf(to, SAGA_NAME_NBYTES, "view%03d", i);
        }
        if (saga_listing_names_differ(l))
            return;
    }
}

/* ------------------------------------------------------------------ cameras */

/* Leaves out cameras without pictures, and renumbers image_of and source_of. */
static bool drop_empty(folder_reader *r)
{
    const int n = r->listing->n_sources;
    int *const kept_as = saga_alloc((size_t)n, sizeof *kept_as, r->model_folder,
                                    r->error);
    const bool ok = kept_as &&
                    saga_listing_drop_empty(r->listing, 0, r->listing->n_frames,
                                            kept_as, r->error);
    /* Since kept_as[i] <= i, no entry is overwritten before it has moved. */
    for (int i = 0; ok && i < n; i++)
        if (kept_as[i] >= 0)
            r->image_of[kept_as[i]] = r->image_of[i];
    for (size_t i = 0; ok && i < r->model.n_images; i++)
        r->source_of[i] = kept_as[r->source_of[i]];
    free(kept_as);
    return ok;
}

static bool take_cameras(folder_reader *r)
{
    saga_listing *const l = r->listing;
    for (int i = 0; i < l->n_sources; i++) {
        saga_source *const s = &l->sources[i];
        if (!saga_colmap_adopt(s, &r->model, r->image_of[i], r->model_folder,
                               r->error) ||
            !saga_colmap_measure(s, &r->model, r->image_of[i], r->error))
            return false;
    }
    return saga_colmap_take_points(l, &r->model, r->source_of, r->error);
}

static bool read_folder(folder_reader *r, const saga_capture_options *options)
{
    if (!group_images(r) || !find_pictures(r))
        return false;
    name_sources(r);
    /* Cameras come last: lenses are scaled to the pictures' size, and points
     * are kept by the number of views that see them and are not held out. */
    return saga_listing_take_finds(r->listing, &r->finds, r->error) &&
           drop_empty(r) && saga_listing_probe_pictures(r->listing, r->error) &&
           saga_listing_hold_out(r->listing, options->hold_out, r->error) &&
           take_cameras(r);
}

static char *picture_root(const char *folder, saga_error *error)
{
    char *root = saga_path_join(folder, "images", error);
    if (root && !saga_path_is_folder(root)) {
        free(root);
        root = saga_string_copy(folder, error);
    }
    return root;
}

static bool is_there(const char *folder, saga_error *error)
{
    char *model = NULL;
    const bool there = saga_colmap_find(&model, folder, error) && model;
    free(model);
    return there;
}

bool saga_colmap_list(saga_listing *listing, const char *folder,
                      const char *model_folder,
                      const saga_capture_options *options, saga_error *error)
{
    char *model = NULL;
    folder_reader r = { .listing = listing, .error = error };
    listing->poses = SAGA_POSES_TO_CAMERA;
    bool ok = saga_colmap_find(&model, model_folder, error);
    r.model_folder = model ? model : folder;
    r.root = picture_root(folder, error);
    ok = ok && r.root && saga_colmap_read(&r.model, r.model_folder, error);
    for (size_t i = 0; ok && i < r.model.n_images; i++)
        saga_path_slashes(r.model.images[i].name, r.root);
    ok = ok && read_folder(&r, options);
    saga_finds_free(&r.finds);
    saga_colmap_free(&r.model);
    free(r.image_of);
    free(r.source_of);
    free(r.root);
    free(model);
    return ok;
}

static bool list(saga_listing *listing, const char *folder,
                 const saga_capture_options *options, saga_error *error)
{
    return saga_colmap_list(listing, folder, folder, options, error);
}

const saga_loader saga_colmap_loader = {
    "COLMAP", "sparse/0 beside images/",
    "images/ and the model in sparse/0 or beside images/, text or binary; "
    "frames in a folder for each camera (images/cam01/0001.jpg) or each moment",
    is_there, list
};
