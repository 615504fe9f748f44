/* SPDX-License-Identifier: MIT
 *
 * Names the cameras of transforms.json, which have no names there, by the names
 * and folders of their files.
 */
#include "transforms.h"

#include "file.h"
#include "notes.h"

#include <stdio.h>
#include <string.h>

static size_t stem_length(const char *base)
{
    const char *const dot = strrchr(base, '.');
    return dot && dot != base ? (size_t)(dot - base) : strlen(base);
}

/* Sets `name` to the last folder of a path, empty if it has none. */
static void folder_name(const char *file, char name[SAGA_NAME_NBYTES])
{
    const char *const base = saga_path_base(file);
    const char *start = base > file ? base - 1 : base;
    const char *const end = start;
    while (start > file && start[-1] != '/')
        start--;
    saga_copy_name(name, start, (size_t)(end - start));
}

/* Makes the name "train_r_003" from "train/r_003.png". */
static void folder_and_stem(const char *file, char name[SAGA_NAME_NBYTES])
{
    const char *const base = saga_path_base(file);
    char folder[SAGA_NAME_NBYTES], both[2 * SAGA_NAME_NBYTES];
    folder_name(file, folder);
    (void)snprintf(both, sizeof both, "%s_%.*s", folder, (int)stem_length(base),
                   base);
    saga_copy_name(name, both, strlen(both));
}

/* Sets `name` to the common beginning of a camera's pictures without the frame
 * number: "cam03_f000" and "cam03_f001" give "cam03". */
static void common_prefix(const saga_entry *e, int n,
                          char name[SAGA_NAME_NBYTES])
{
    const char *const base = saga_path_base(e[0].file);
    size_t len = stem_length(base);
    /* The stem is shortened to what all names begin with. */
    for (int k = 1; k < n; k++) {
        const char *const other = saga_path_base(e[k].file);
        size_t i = 0;
        while (i < len && other[i] == base[i])
            i++;
        len = i;
    }
    while (len > 0 && ((unsigned char)base[len] & 0xc0) == 0x80)
        len--; /* never cut a UTF-8 character */
    /* Removes the frame number's first digits, then letters before them that
     * follow a separator, then separators: "cam03_f00" becomes "cam03". */
    while (len > 0 && base[len - 1] >= '0' && base[len - 1] <= '9')
        len--;
    size_t letters = len;
    while (letters > 0 && (base[letters - 1] | 32) >= 'a' &&
           (base[letters - 1] | 32) <= 'z')
        letters--;
    if (letters > 0 && strchr("_-. ", base[letters - 1]))
        len = letters;
    while (len > 0 && strchr("_-. ", base[len - 1]))
        len--;
    saga_copy_name(name, base, len);
}

void saga_transforms_name_views(const saga_transforms *r, int n)
{
    saga_listing *const listing = r->listing;
    for (int scheme = n > 1 ? 0 : 2; scheme < 5; scheme++) {
        /* The schemes are the folder, the common beginning of the names, the
         * first name, the first name with its folder, and numbers. The first
         * two need several pictures. */
        for (int v = 0; v < r->n_views; v++) {
            const saga_entry *const e = &r->entries[r->view_first[v]];
            char *const name = listing->sources[v].name;
            const char *const base = saga_path_base(e->file);
            if (scheme == 0)
                folder_name(e->file, name);
            else if (scheme == 1)
                common_prefix(e, r->view_size[v], name);
            else if (scheme == 2)
                saga_copy_name(name, base, stem_length(base));
            else if (scheme == 3)
                folder_and_stem(e->file, name);
            else
                (void)snprintf(name, SAGA_NAME_NBYTES, "view%03d", v);
        }
        if (saga_listing_names_differ(listing))
            return;
    }
}
