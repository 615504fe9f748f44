/* SPDX-License-Identifier: MIT
 *
 * A nerfstudio capture is read in stages, a file each: the entries of
 * transforms.json (transforms_entries), which of them are pictures of one
 * camera (transforms_views), the moment of each (transforms_moments), what the
 * cameras are called (transforms_names), and the listing that comes of it
 * (nerfstudio).
 */
#ifndef SAGA_TRANSFORMS_H
#define SAGA_TRANSFORMS_H

#include "load.h"

#include <jansson.h>

/* This has to be the same in all pictures of a camera; no padding, so that
 * bytes can be compared. Unknown values are NaN, kept as one bit pattern. */
typedef struct saga_entry_camera {
    double pose[12];          /* camera to world, rows of 3 x 4 */
    double fx, fy, cx, cy;
    double k1, k2, k3, p1, p2, k4;
    double fisheye;           /* 1 or 0 */
    double width, height, angle_x;
} saga_entry_camera;

typedef struct saga_entry {
    const char *file;         /* in the JSON */
    const char *depth, *mask; /* or NULL */
    int index;                /* in "frames" */
    int view;
    bool has_time, held_out;
    double time;
    double late;              /* frames, after its moment: 0 to 1 */
    saga_entry_camera key;
} saga_entry;

typedef struct saga_transforms {
    json_t *root;             /* of the file that is being read */
    json_t *roots[2];         /* of all files */
    const char *path;         /* of the JSON */
    char *folder;
    saga_listing *listing;
    saga_error *error;
    saga_entry *entries;
    int n_entries;
    int n_views;
    int *view_size;           /* (n_views) */
    int *view_first;          /* (n_views) entry, once they are sorted */
    int fullest;              /* the view with most pictures */
    int n_moments;            /* of a camera that moves; or 0 */
    double first_time, step;  /* of those moments */
    saga_entry **at;          /* (n_views, n frames) NULL: not listed */
    bool odd_depths, videos;
    int n_missing;
    const char *first_missing; /* as the JSON has it; or NULL */
} saga_transforms;

/* Sets *s to a string of an object; it is left alone where there is none. */
bool saga_transforms_string(const saga_transforms *r, const json_t *object,
                            int index, const char *key, const char **s);
/* Adds the entries of the file that is being read. */
bool saga_transforms_read_entries(saga_transforms *r);
/* Refuses a file that lists both videos and pictures. */
bool saga_transforms_check_kinds(saga_transforms *r);
/* Sets the rate that the file tells; 0 where it tells none. */
bool saga_transforms_read_fps(saga_transforms *r);
/* Returns the number of entries that have a time. */
int saga_transforms_n_timed(const saga_transforms *r);
/* Sorts the entries by camera, then by time, then by name. */
void saga_transforms_sort(saga_transforms *r);
/* Marks the entries that the file's lists hold out. */
bool saga_transforms_mark_held_out(saga_transforms *r);

/* Gives every entry its view, and tells whether the camera moves (n_moments);
 * sorts the entries, so that a view's are one run. */
bool saga_transforms_find_views(saga_transforms *r);

/* Places the entries at n moments, and guesses the frame rate from their times
 * where the file tells none. */
bool saga_transforms_find_moments(saga_transforms *r, int n);

/* Gives every source of the listing a name; n is the number of moments. */
void saga_transforms_name_views(const saga_transforms *r, int n);

#endif
