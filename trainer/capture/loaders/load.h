/* SPDX-License-Identifier: MIT
 *
 * A loader lists the contents of a capture before any picture is decoded: it
 * fills a listing. capture_load.c then makes a capture from the listing, in the
 * same way for all layouts.
 */
#ifndef SAGA_LOAD_H
#define SAGA_LOAD_H

#include "capture.h"
#include "picture_turn.h"
#include "remap.h"
#include "video.h"

typedef struct saga_source {
    char name[SAGA_NAME_NBYTES];
    int width, height; /* size of the files' pictures, after turning */
    int orientation;   /* how the files ask to be shown
                        * (picture_turn.h), */
    bool upright;      /* and whether they are */
    saga_lens lens;    /* the lens at this size */
    double rotation[9], translation[3];
    double near_depth, far_depth;
    bool held_out; /* held out by the format */
    int n_observations;
    double reprojection_median, reprojection_p90;

    char *video;          /* path of the video; NULL: pictures */
    char **pictures;      /* (n_frames) paths; NULL: the picture is
                           * missing */
    char **depths;        /* (n_frames) paths or NULL; NULL: no depths */
    char **masks;         /* (n_frames) paths or NULL; NULL: no masks */
    saga_video_info info; /* properties of the video, owned */
    int *frames;          /* (n_moments) the video's frame at each moment
                           * since its first frame, -1: none; NULL: the
                           * frame of that number */
    int n_moments;
    double behind; /* frames by which it began before the last video
                    * that began, by time stamps */
    int skip;      /* number of moments before the first that is
                    * used */
    double late;   /* delay of the first frame that is used, in
                    * frames, 0 to 1 */
} saga_source;

typedef struct saga_listing {
    const char *format;
    const char *path;  /* the capture's folder or file */
    bool follow_paths; /* files outside the capture's folder may be
                        * read */
    const struct saga_loader *const *loaders; /* all loaders, then NULL */
    saga_source *sources;                     /* (n_sources) */
    int n_sources, n_frames; /* number of frames of the whole capture */
    bool moves;              /* one camera moves, with a source for each
                              * picture */
    saga_pose_convention poses;
    double fps;    /* 0: unknown */
    double metres; /* metres per unit of length; 0: unknown */
    saga_point *points;
    size_t n_points;
    char *missing; /* path of the first picture that is missing, or
                    * NULL */
    char notes[SAGA_NOTES_NBYTES];
} saga_listing;

/* Sets which views are held out: those of the option if it is given, otherwise
 * those of the format. It must run before points are counted by training
 * views. */
bool saga_listing_hold_out(saga_listing *listing, const char *names,
                           saga_error *error);
/* Returns "folder/name" like saga_path_join, for a name in a file of the
 * capture. A name that leads out of the capture's folder is refused, unless
 * follow_paths is set: captures are downloaded, and the contents of the files
 * that they name end up in the result. */
char *saga_listing_join(const saga_listing *listing, const char *folder,
                        const char *name, const char *file, saga_error *error);
/* Shifts cameras that began early by their time stamps, or run late by the
 * delays in the option --late, which leaves fewer frames. */
bool saga_listing_late(saga_listing *listing, const char *text,
                       saga_error *error);
/* Turns the pictures of a source, by the rule of picture_turn.h, for a
 * calibration with pictures of width x height. */
void saga_source_turn(saga_source *source, double width, double height);
/* Notes which sources ask to be shown turned, and which are. */
void saga_listing_note_turns(saga_listing *listing);
/* Turns the pictures of a source for a lens that is for pictures of width x
 * height, and scales the lens to their size. Returns false, and changes
 * nothing, if the ratio of the sides differs by more than 1 %: then the
 * pictures were cropped, which scaling cannot undo. */
bool saga_source_fit(saga_source *source, double width, double height);
/* Returns the remedy for pictures that did not fit: `usual`, unless width and
 * height are exchanged, which the files do not tell. */
const char *saga_source_fit_remedy(const saga_source *source, double width,
                                   double height, const char *usual);
void saga_listing_free(saga_listing *listing);
/* Takes the path of a picture that is missing, so that a message can name the
 * first. The path may be NULL. */
void saga_listing_miss(saga_listing *listing, char *path);
/* Drops sources without any picture in frames first..end-1, and notes this.
 * Having no source left is an error. kept_as may be NULL, or is set to each
 * source's new index, -1 for none; it has room for all sources. */
bool saga_listing_drop_empty(saga_listing *listing, int first, int end,
                             int *kept_as, saga_error *error);
/* Returns the path of the first picture of a source, which has one. */
const char *saga_source_picture(const saga_source *source);

/* Sets the size and orientation of every source to those of its first picture,
 * and notes what pictures ask for and do not get. */
bool saga_listing_probe_pictures(saga_listing *listing, saga_error *error);
/* Tells whether every source has a name, and no two have the same name. */
bool saga_listing_names_differ(const saga_listing *listing);
/* Refuses sources without a name, or of the same name, of the file. */
bool saga_listing_check_names(const saga_listing *listing, const char *file,
                              saga_error *error);
/* Checks what all listings must keep: the names, and the lenses, which are only
 * noted. */
bool saga_listing_judge(saga_listing *listing, saga_error *error);
/* Probes the video of a source, and sets its size. */
bool saga_probe_video(saga_source *source, saga_error *error);
/* Returns the number of the video's frame at a moment of the capture, or -1 if
 * the video has none. */
int saga_source_frame(const saga_source *source, int moment);
/* Pairs the frames of all videos by their time stamps, checks that their rates
 * and lengths agree, notes what is unusual, and sets n_frames and fps. */
bool saga_listing_match_videos(saga_listing *listing,
                               const saga_capture_options *options,
                               saga_error *error);

/* Finds masks in folders for the pictures that have none (masks.c). The note
 * about them says whether they are of a subject. */
bool saga_listing_find_masks(saga_listing *listing, const char *path,
                             bool subject, saga_error *error);

/* A loader reads captures of one layout. Each is defined at the end of its own
 * file; formats.c has the table of all. */
typedef struct saga_loader {
    const char *name;   /* name of the layout, in reports, help and
                         * README */
    const char *sign;   /* what identifies the layout, for messages */
    const char *layout; /* its files, for help and README */

    /* Tells whether a path, mostly of a folder, has this layout. It opens no
     * picture. Returns false with *error set if memory is short. */
    bool (*is_there)(const char *path, saga_error *error);

    /* Fills a listing in which only path, format, follow_paths and loaders are
     * set: sources with names, sizes, lenses, poses and files, the number of
     * frames and their rate, points, and notes. It calls saga_listing_hold_out
     * before points are counted. Returns false with *error set on failure; the
     * caller frees the listing in any case. */
    bool (*list)(saga_listing *listing, const char *path,
                 const saga_capture_options *options, saga_error *error);
} saga_loader;

/* Returns loader number i, in the order in which they are asked; NULL after the
 * last. */
const saga_loader *saga_loader_at(int i);

/* Lists the capture at a path by the first loader whose layout it has. */
bool saga_listing_make(saga_listing *listing, const char *path,
                       const saga_capture_options *options, saga_error *error);

/* Lists a part of a capture like saga_listing_make, with all loaders of the
 * listing except `without`, whose layout consists of such parts. */
bool saga_listing_make_part(saga_listing *listing, const char *path,
                            const saga_loader *without,
                            const saga_capture_options *options,
                            saga_error *error);

/* Reads files like transforms.json. test_path is NULL or a second file, whose
 * cameras are held out. */
bool saga_nerfstudio_list(saga_listing *listing, const char *json_path,
                          const char *test_path,
                          const saga_capture_options *options,
                          saga_error *error);

/* Lists a folder of pictures whose COLMAP model is in another folder. */
bool saga_colmap_list(saga_listing *listing, const char *folder,
                      const char *model_folder,
                      const saga_capture_options *options, saga_error *error);

#endif
