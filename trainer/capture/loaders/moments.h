/* SPDX-License-Identifier: MIT
 *
 * A loader finds pictures in folders and lists. Each belongs to a source and to
 * a moment, which is a number in its name. This file makes frames of them. If a
 * source lacks a moment, its picture is missing there.
 */
#ifndef SAGA_MOMENTS_H
#define SAGA_MOMENTS_H

#include "load.h"

typedef struct saga_found {
    int source; /* index in the listing */
    uint64_t moment;
    char *path; /* owned */
} saga_found;

typedef struct saga_finds {
    saga_found *items; /* (n) */
    size_t n;
} saga_finds;

/* Finds the last number in the n characters at s. Returns false and sets 0 if
 * there is none. */
bool saga_last_number(const char *s, size_t n, uint64_t *number);

/* Tells by a file name's extension whether it is a video. */
bool saga_is_video_name(const char *name);

/* Adds a picture. It takes ownership of path, also on failure. path may be
 * NULL, which means that its allocation failed. */
bool saga_finds_add(saga_finds *finds, int source, uint64_t moment, char *path,
                    saga_error *error);
/* Adds all pictures of a folder. The last number in a name is the moment. */
bool saga_finds_add_folder(saga_finds *finds, int source, const char *folder,
                           saga_error *error);
void saga_finds_free(saga_finds *finds);

/* Sets n_frames of the listing and the pictures of its sources, in order of
 * moments, and empties finds. If no source has two pictures, all belong to one
 * moment. Two pictures of one source at one moment are an error. */
bool saga_listing_take_finds(saga_listing *listing, saga_finds *finds,
                             saga_error *error);

#endif
