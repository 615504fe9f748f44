/* SPDX-License-Identifier: MIT
 *
 * A loader finds pictures in folders and in lists, each of one source and of
 * one moment, which is a number in its name. Here they become the frames of the
 * sources; where a source lacks a moment, its picture is missing.
 */
#ifndef SAGA_MOMENTS_H
#define SAGA_MOMENTS_H

#include "load.h"

typedef struct saga_found {
    int source;               /* index in the listing */
    uint64_t moment;
    char *path;               /* owned */
} saga_found;

typedef struct saga_finds {
    saga_found *items;        /* (n) */
    size_t n;
} saga_finds;

/* Finds the last number in the n characters at s; false and 0 if there is
 * none. */
bool saga_last_number(const char *s, size_t n, uint64_t *number);

/* Tells from its ending whether a file is a still picture that can be read. */
bool saga_is_picture_name(const char *name);

/* Adds one; takes path over, also on failure. path may be NULL: there was no
 * memory for it. */
bool saga_finds_add(saga_finds *finds, int source, uint64_t moment, char *path,
                    saga_error *error);
/* Adds every picture of a folder, with the last number in its name. */
bool saga_finds_add_folder(saga_finds *finds, int source, const char *folder,
                           saga_error *error);
void saga_finds_free(saga_finds *finds);

/* Sets n_frames of the listing and pictures of its sources, ordered by moment;
 * empties finds. Where no source has two pictures, all are of one moment. Two
 * pictures of a source and a moment are an error. */
bool saga_listing_take_finds(saga_listing *listing, saga_finds *finds,
                             saga_error *error);

#endif
