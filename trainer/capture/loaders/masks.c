/* SPDX-License-Identifier: MIT
 *
 * Masks mark the pixels that count, or a subject, with white, or with the
 * larger value if they have only two. They lie in masks/ beside images/, or in
 * the capture's folder if it has no images/, and have the name of their picture
 * with .png instead of its extension or after it. masks/CAMERA.png is for all
 * pictures of a camera. A format may also give the masks itself.
 */
#include "load.h"

#include "alloc.h"
#include "error.h"
#include "file.h"
#include "notes.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* Returns the path of the mask masks/NAME + `behind` in the folder that the
 * first n characters of `root` give. Returns NULL if there is no such file or
 * if memory runs out; *ok is false only for the latter. */
static char *find_mask(const char *root, size_t n, const char *name,
                       size_t n_name, const char *behind, bool *ok,
                       saga_error *error)
{
    const size_t room = n + n_name + strlen(behind) + sizeof "/masks/";
    char *const path = saga_alloc(room, 1, root, error);
    *ok = path != NULL;
    if (!path)
        return NULL;
    (void)snprintf(path, room, "%.*s/masks/%.*s%s", (int)n, root, (int)n_name,
                   name, behind);
    if (saga_path_is_file(path))
        return path;
    free(path);
    return NULL;
}

/* Returns the mask of a picture, or NULL; n is the length of the capture's
 * folder in its path. */
static char *mask_of(const char *picture, size_t n, bool *ok, saga_error *error)
{
    static const char images[] = "/images/";
    const char *name = picture + n + 1, *at = picture + n;
    /* The mask lies beside the last images/ in the path below the capture's
     * folder. */
    for (const char *p = at; (p = strstr(p, images)) != NULL; p++) {
        n = (size_t)(p - picture);
        name = p + sizeof images - 1;
    }
    const size_t whole = strlen(name);
    const char *const dot = strrchr(name, '.');
    char *const mask = find_mask(picture, n, name,
                                 dot ? (size_t)(dot - name) : whole, ".png", ok,
                                 error);
    return mask || !*ok ? mask
                        : find_mask(picture, n, name, whole, ".png", ok, error);
}

static bool make_room(saga_source *s, int n, saga_error *error)
{
    if (!s->masks)
        s->masks = saga_calloc((size_t)n, sizeof *s->masks, s->name, error);
    return s->masks != NULL;
}

/* Sets the masks of a source that the format did not give, and adds the number
 * of all its masks to *n_found. */
static bool find_masks(const saga_listing *l, saga_source *s, const char *root,
                       int *n_found, saga_error *error)
{
    const size_t n_root = strlen(root);
    bool ok;
    char *const all = find_mask(root, n_root, s->name, strlen(s->name), ".png",
                                &ok, error);
    for (int k = 0; ok && k < l->n_frames; k++) {
        const char *const picture = s->pictures ? s->pictures[k] : NULL;
        char *mask = NULL;
        if (s->masks && s->masks[k])
            continue;
        /* A mask from the format comes first, then one named like the picture,
         * then one named like the camera. */
        if (picture && strncmp(picture, root, n_root) == 0)
            mask = mask_of(picture, n_root, &ok, error);
        if (ok && !mask && all) {
            mask = saga_string_copy(all, error);
            ok = mask != NULL;
        }
        if (ok && mask)
            ok = make_room(s, l->n_frames, error);
        if (ok && mask)
            s->masks[k] = mask;
        else
            free(mask);
    }
    free(all);
    for (int k = 0; ok && s->masks && k < l->n_frames; k++)
        *n_found += s->masks[k] != NULL;
    return ok;
}

bool saga_listing_find_masks(saga_listing *listing, const char *path,
                             bool subject, saga_error *error)
{
    char *const root = saga_string_copy(path, error);
    bool ok = root != NULL;
    int n = 0;
    /* A path to a file means its folder; a slash at the end is removed. */
    if (ok && !saga_path_is_folder(root)) {
        char *const slash = strrchr(root, '/');
        *(slash ? slash : root) = '\0';
    }
    for (size_t k = ok ? strlen(root) : 0; k > 1 && root[k - 1] == '/';)
        root[--k] = '\0';
    for (int i = 0; ok && i < listing->n_sources; i++)
        ok = find_masks(listing, &listing->sources[i], root, &n, error);
    if (ok && n > 0)
        saga_note(listing->notes,
                  "masks: %d of %d pictures have one; pixels "
                  "that are not white are %s",
                  n, listing->n_sources * listing->n_frames,
                  subject ? "transparent" : "ignored");
    free(root);
    return ok;
}
