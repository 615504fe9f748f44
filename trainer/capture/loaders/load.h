/* SPDX-License-Identifier: MIT
 *
 * A loader finds out what a capture consists of before any picture is decoded:
 * it fills a listing. capture_load.c turns that into a capture, the same way
 * for all layouts.
 */
#ifndef SAGA_LOAD_H
#define SAGA_LOAD_H

#include "capture.h"
#include "remap.h"
#include "video.h"

typedef struct saga_source {
    char name[SAGA_NAME_NBYTES];
    int width, height;        /* of the files */
    saga_lens lens;           /* at that size */
    double rotation[9], translation[3];
    double near_depth, far_depth;
    bool held_out;            /* as the format says */
    int n_observations;
    double reprojection_median, reprojection_p90;

    char *video;              /* path; or NULL and */
    char **pictures;          /* (n_frames) paths, NULL where one is missing */
    char **depths;            /* (n_frames) paths or NULL each; or NULL */
    char **masks;             /* the same */
    saga_video_info info;     /* of the video */
    int skip;                 /* its frames before the capture's first one */
    double late;              /* and the first that is taken is so late */
} saga_source;

typedef struct saga_listing {
    const char *format;
    const char *path;         /* the capture's folder or file */
    bool follow_paths;        /* out of it */
    const struct saga_loader *const *loaders; /* all of them, then NULL */
    saga_source *sources;     /* (n_sources) */
    int n_sources, n_frames;  /* of the whole capture */
    bool moves;               /* the camera: a source for each picture */
    bool opengl;              /* poses had OpenGL's axes in the file */
    double fps;               /* 0: unknown */
    double metres;            /* in its unit of length; 0: unknown */
    saga_point *points;
    size_t n_points;
    char notes[SAGA_NOTES_NBYTES];
} saga_listing;

/* Sets which views are held out: by the option if given, else as the format
 * said. Must run before points are counted by training views. */
bool saga_listing_hold_out(saga_listing *listing, const char *names,
                           saga_error *error);
/* Returns a copy of "folder/name" as saga_path_join does, of a name that stands
 * in a file of the capture. One that leads out of the capture's folder is
 * refused, unless the caller follows such: captures are downloaded, and what
 * they name gets into what is made of them. */
char *saga_listing_join(const saga_listing *listing, const char *folder,
                        const char *name, const char *file, saga_error *error);
/* Shifts cameras that run late, as the option says; fewer frames are left. */
bool saga_listing_late(saga_listing *listing, const char *text,
                       saga_error *error);
void saga_listing_free(saga_listing *listing);
/* Leaves out sources without any picture in frames first..end-1, and says so
 * in the notes; an error if none is left. kept_as, NULL or (n_sources as it
 * was), is set to each one's new index, -1 for none. */
bool saga_listing_drop_empty(saga_listing *listing, int first, int end,
                             int *kept_as, saga_error *error);
/* Sets the size of every source to that of its first picture. */
bool saga_listing_probe_pictures(saga_listing *listing, saga_error *error);
/* Tells whether every source has a name, and no two the same. */
bool saga_listing_names_differ(const saga_listing *listing);
/* Numbers the sources, view000 and on, where their names do not differ. */
void saga_listing_tell_apart(saga_listing *listing);
/* Probes a source's video, checks or sets its size. */
bool saga_probe_video(saga_source *source, saga_listing *listing,
                      saga_error *error);
/* Frame counts and rates of all videos must agree; sets n_frames and fps. */
bool saga_listing_match_videos(saga_listing *listing,
                               const saga_capture_options *options,
                               saga_error *error);

/* Finds the masks of pictures that have none yet, in folders (masks.c). */
bool saga_listing_find_masks(saga_listing *listing, const char *path,
                             saga_error *error);

/* A loader reads one layout of captures; each is defined at the end of its own
 * file, and formats.c has the table of all. */
typedef struct saga_loader {
    const char *name;         /* the layout's, in reports, help and README */
    const char *sign;         /* what it is known by, for a message */
    const char *layout;       /* its files, for help and README */

    /* Tells whether a path, mostly of a folder, has this layout. It opens no
     * picture; false with an error where no memory is left to look. */
    bool (*is_there)(const char *path, saga_error *error);

    /* Fills a listing, of which path, format, follow_paths and loaders alone
     * are set: sources with names, sizes, lenses, poses and files, the number
     * of frames and their rate, points and notes. It calls
     * saga_listing_hold_out, before points are counted. After a failure *error
     * says why, and the caller frees whatever the listing has by then. */
    bool (*list)(saga_listing *listing, const char *path,
                 const saga_capture_options *options, saga_error *error);
} saga_loader;

/* Returns number i of the loaders, in the order in which they are asked; NULL
 * behind the last. */
const saga_loader *saga_loader_at(int i);

/* Lists the capture at a path by the first loader that is there. */
bool saga_listing_make(saga_listing *listing, const char *path,
                       const saga_capture_options *options, saga_error *error);

/* Does the same with every loader of the listing but one, which is made of
 * others. */
bool saga_listing_make_part(saga_listing *listing, const char *path,
                            const saga_loader *without,
                            const saga_capture_options *options,
                            saga_error *error);

/* Reads files like transforms.json. test_path is a second one, whose cameras
 * are held out, or NULL. */
bool saga_nerfstudio_list(saga_listing *listing, const char *json_path,
                          const char *test_path,
                          const saga_capture_options *options,
                          saga_error *error);

/* Lists a folder of pictures by the COLMAP model in another one. */
bool saga_colmap_list(saga_listing *listing, const char *folder,
                      const char *model_folder,
                      const saga_capture_options *options, saga_error *error);

#endif
