/* SPDX-License-Identifier: MIT
 *
 * Command line options that are shared by all commands that examine one picture
 * of a file, as seen by a camera of its rig.
 */
#ifndef SAGA_PICTURE_CLI_H
#define SAGA_PICTURE_CLI_H

#include "cli.h"
#include "error.h"
#include "json_cli.h"
#include "verify.h"
#include "view.h"

typedef struct saga_cli_picture {
    int camera;              /* index in the rig */
    saga_cli_pair frame;     /* time of the picture in frames, a fraction;
                              * default 0/1 */
    saga_cli_pair size;      /* 0: the camera's size */
} saga_cli_picture;

/* Entries for a command's list of options, whose structure `type` holds them in
 * `member`. */
#define SAGA_CLI_PICTURE(type, member) \
    { "--camera", "N", "number of a camera of the file (default 0); `saga " \
      "info`\nlists them", saga_cli_int, offsetof(type, member.camera), 0, \
      65535 }, \
    { "--frame", "N[/D]", "time of the picture in frames (default 0): 15/2 " \
      "is\nhalf-way between frames 7 and 8", saga_cli_fraction, \
      offsetof(type, member.frame), 0, INT32_MAX }, \
    { "--size", "WxH", "size of the picture (default: the camera's). " \
      "Everything\nthat the camera sees stays in the picture", \
      saga_cli_size, offsetof(type, member.size), 1, SAGA_MAX_SIDE }

/* Sets *view to the camera and the time of a picture, and *number to the number
 * that the capture gave the camera. Returns false if the film has no such
 * picture. */
bool saga_cli_picture_view(saga_verify_view *view, uint32_t *number,
                           const saga_film *film, const saga_cli_picture *o,
                           saga_error *error);

/* Adds to a report which picture it describes, and the text for it. The caller
 * adds "segment" and "t", which are known only after decoding. */
void saga_cli_put_picture(json_t *report, const saga_verify_view *view,
                          uint32_t number, int camera);

#define SAGA_CLI_PICTURE_TEXT \
    "{file}, camera {camera} ({number}), {width} x {height}, segment " \
    "{segment} at {t:%.5f}"

#endif
