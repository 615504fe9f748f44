/* SPDX-License-Identifier: MIT
 *
 * A nerfstudio capture is read in stages, one file each: the entries of
 * transforms.json (transforms_entries), the grouping of entries into cameras
 * (transforms_views), the moment of each (transforms_moments), the names of the
 * cameras (transforms_names), and the listing (nerfstudio).
 */
#ifndef SAGA_TRANSFORMS_H
#define SAGA_TRANSFORMS_H

#include "load.h"

#include <jansson.h>

/* Values that are equal in all pictures of a camera. There is no padding, so
 * that bytes can be compared. Unknown values are NaN, with one bit pattern. */
typedef struct saga_entry_camera {
    double pose[12]; /* camera to world, rows of 3 x 4 */
    double fx, fy, cx, cy;
    double k1, k2, k3, p1, p2, k4;
    double fisheye; /* 1 or 0 */
    double width, height, angle_x;
} saga_entry_camera;

typedef struct saga_entry {
    const char *file;         /* the picture's file name as written in the
                               * JSON */
    const char *depth, *mask; /* NULL: none */
    int index;                /* index in "frames" */
    int view;
    bool has_time, held_out;
    double time;
    double late; /* delay after its moment, in frames, 0 to 1 */
    saga_entry_camera key;
} saga_entry;

typedef struct saga_transforms {
    json_t *root;     /* the JSON file that is being read */
    json_t *roots[2]; /* all JSON files */
    const char *path; /* path of the JSON */
    char *folder;
    saga_listing *listing;
    saga_error *error;
    saga_entry *entries;
    int n_entries;
    int n_views;
    int *view_size;          /* (n_views) number of entries */
    int *view_first;         /* (n_views) first entry, once entries are
                              * sorted */
    int fullest;             /* the view with most pictures */
    int n_moments;           /* number of moments if the camera moves;
                              * otherwise 0 */
    double first_time, step; /* time of the first moment, and between two */
    saga_entry **at;         /* (n_views, n_frames) NULL: not listed */
    bool odd_depths, videos;
    int n_missing;
    const char *first_missing; /* path as the JSON has it; NULL: none */
} saga_transforms;

/* Sets *s to the name of a file that an object has under `key`; leaves it
 * unchanged if there is none. */
bool saga_transforms_path(const saga_transforms *r, const json_t *object,
                          int index, const char *key, const char **s);
/* Adds the entries of the file that is being read. */
bool saga_transforms_read_entries(saga_transforms *r);
/* Refuses a file that lists both videos and pictures. */
bool saga_transforms_check_kinds(saga_transforms *r);
/* Reads the frame rate from the file; it is 0 if the file has none. */
bool saga_transforms_read_fps(saga_transforms *r);
/* Returns the number of entries that have a time. */
int saga_transforms_n_timed(const saga_transforms *r);
/* Sorts the entries by camera, then by time, then by name. */
void saga_transforms_sort(saga_transforms *r);
/* Marks the entries that the file's lists declare as held out. */
bool saga_transforms_mark_held_out(saga_transforms *r);

/* Gives every entry its view, and finds out whether the camera moves
 * (n_moments). Sorts the entries, so that those of a view are adjacent. */
bool saga_transforms_find_views(saga_transforms *r);

/* Assigns the entries to n moments. Derives the frame rate from their times if
 * the file has none. */
bool saga_transforms_find_moments(saga_transforms *r, int n);

/* Gives every source of the listing a name; n is the number of moments. */
void saga_transforms_name_views(const saga_transforms *r, int n);

#endif
