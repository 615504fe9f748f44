/* SPDX-License-Identifier: MIT
 *
 * Reads COLMAP's model as text. Every word counts, so that a line that is out
 * of step, or a number in another notation, is reported with its line.
 */
#include "colmap_job.h"

#include "error.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const char blanks[] = " \t\r";

/* Returns the next line, ended by a NUL, or NULL at the end of the file.
 * Comments are skipped. Empty lines are skipped only if asked, since the second
 * line of an image may be empty. */
static const char *next_line(saga_cursor *c, bool skip_empty)
{
    while (saga_left(c) > 0) {
        uint8_t *const line = (uint8_t *)(uintptr_t)c->next;
        uint8_t *const end = memchr(line, '\n', saga_left(c));
        /* The caller owns the bytes, so that they may be written. A NUL follows
         * them, which ends a last line without '\n'. */
        c->next = end ? end + 1 : c->end;
        if (end)
            *end = 0;
        const char *const text = (const char *)line;
        if (text[0] == '#' || (skip_empty && !text[strspn(text, blanks)]))
            continue;
        return text;
    }
    return NULL;
}

/* Reports the word at `at`, or the end of its line, where the line should have
 * number `index` of what is listed in `wanted`. */
static bool bad_word(const saga_colmap_job *job, const char *at, int index,
                     const char *wanted)
{
    static const char remedy[] = "export the model again; each image takes two "
                                 "lines, the second of which may be empty";
    const size_t n = strcspn(at, blanks);
    size_t line = 1;
    /* Each line that has been read ends in a NUL. */
    for (const char *p = job->text; p < at; p++)
        line += *p == '\0';
    return n == 0 ? saga_fail(job->error, job->file, remedy,
                              "line %zu ends "
                              "before number %d of %s",
                              line, index, wanted)
                  : saga_fail(job->error, job->file, remedy,
                              "line %zu has "
                              "\"%.*s\" for number %d of %s",
                              line, (int)(n < 40 ? n : 40), at, index, wanted);
}

/* Reads n numbers, which begin at number `index` of what is wanted. */
static bool take_numbers(const saga_colmap_job *job, const char **text,
                         double *x, int n, int index, const char *wanted)
{
    for (int i = 0; i < n; i++)
        if (!saga_take_number(text, &x[i]))
            return bad_word(job, *text, index + i, wanted);
    return true;
}

/* Reads an integer of `least` to `most`. */
static bool take_integer(const char **text, int64_t *x, int64_t least,
                         int64_t most)
{
    *text += strspn(*text, blanks);
    char *end;
    const size_t n = strcspn(*text, blanks);
    const long long value = strtoll(*text, &end, 10);
    if (n == 0 || end != *text + n || value < least || value > most)
        return false;
    *text = end;
    *x = value;
    return true;
}

static bool take_id(const saga_colmap_job *job, const char **text, int64_t *id,
                    int index, const char *wanted)
{
    return take_integer(text, id, 0, UINT32_MAX) ||
           bad_word(job, *text, index, wanted);
}

bool saga_colmap_text_cameras(const saga_colmap_job *job, saga_cursor *c)
{
    static const char head[] = "CAMERA_ID MODEL WIDTH HEIGHT PARAMS";
    for (const char *line; (line = next_line(c, true)) != NULL;) {
        int64_t id;
        char name[32], wanted[80];
        double size[2], params[SAGA_COLMAP_MAX_PARAMS] = { 0 };
        if (!take_id(job, &line, &id, 1, head))
            return false;
        line += strspn(line, blanks);
        const size_t n = strcspn(line, blanks);
        (void)snprintf(name, sizeof name, "%.*s", (int)(n < 31 ? n : 31), line);
        line += n;
        /* The number of parameters follows from the kind of camera. */
        int i = 0;
        while (saga_colmap_lenses[i].name &&
               strcmp(name, saga_colmap_lenses[i].name) != 0)
            i++;
        const saga_colmap_lens *const lens = &saga_colmap_lenses[i];
        if (!lens->name)
            return saga_colmap_lens_unknown(job, name);
        (void)snprintf(wanted, sizeof wanted, "camera %u (%s %s)", (unsigned)id,
                       name, lens->params);
        if (!take_numbers(job, &line, size, 2, 3, head) ||
            !take_numbers(job, &line, params, lens->n_params, 1, wanted))
            return false;
        line += strspn(line, blanks);
        if (*line)
            return bad_word(job, line, lens->n_params + 1, wanted);
        if (!saga_colmap_add_camera(job, (uint32_t)id, size[0], size[1], i,
                                    params))
            return false;
    }
    return true;
}

static bool text_observations(const saga_colmap_job *job, const char *line,
                              saga_colmap_image *image)
{
    char wanted[80];
    (void)snprintf(wanted, sizeof wanted,
                   "the features of image %u "
                   "(X Y POINT3D_ID each)",
                   (unsigned)image->id);
    for (int i = 1; line[strspn(line, blanks)]; i += 3) {
        double uv[2];
        int64_t point;
        if (!take_numbers(job, &line, uv, 2, i, wanted))
            return false;
        if (!take_integer(&line, &point, -1, INT64_MAX))
            return bad_word(job, line, i + 2, wanted);
        if (!saga_colmap_add_observation(job, image, uv[0], uv[1], point))
            return false;
    }
    return true;
}

bool saga_colmap_text_images(const saga_colmap_job *job, saga_cursor *c)
{
    static const char head[] =
        "an image (IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME)";
    for (const char *line; (line = next_line(c, true)) != NULL;) {
        int64_t id, camera;
        double pose[7];
        if (!take_id(job, &line, &id, 1, head) ||
            !take_numbers(job, &line, pose, 7, 2, head) ||
            !take_id(job, &line, &camera, 9, head))
            return false;
        /* A name may have blanks, but does not end in one. */
        line += strspn(line, blanks);
        size_t n = strlen(line);
        while (n > 0 && strchr(blanks, line[n - 1]))
            n--;
        if (n == 0)
            return bad_word(job, line, 10, head);
        saga_colmap_image *const image = saga_colmap_add_image(
            job, (uint32_t)id, pose, (uint32_t)camera, line, n);
        if (!image)
            return false;
        /* The second line has the features. It may be empty, and missing at the
         * end of the file. */
        const char *const second = next_line(c, false);
        if (second && !text_observations(job, second, image))
            return false;
    }
    return true;
}

bool saga_colmap_text_points(const saga_colmap_job *job, saga_cursor *c)
{
    static const char head[] = "a point (POINT3D_ID X Y Z R G B ERROR TRACK)";
    for (const char *line; (line = next_line(c, true)) != NULL;) {
        int64_t id, image, feature;
        double x[7]; /* position, colour, error */
        if (!take_integer(&line, &id, 0, INT64_MAX))
            return bad_word(job, line, 1, head);
        if (!take_numbers(job, &line, x, 7, 2, head))
            return false;
        uint8_t rgb[3];
        for (int k = 0; k < 3; k++)
            rgb[k] = (uint8_t)fmin(fmax(x[3 + k], 0.0), 255.0);
        saga_colmap_point *const point = saga_colmap_add_point(
            job, (uint64_t)id, x, rgb);
        if (!point)
            return false;
        /* The track is pairs of an image and a feature, to the end of the
         * line. */
        for (int i = 9; line[strspn(line, blanks)]; i += 2)
            if (!take_id(job, &line, &image, i, head) ||
                !take_id(job, &line, &feature, i + 1, head) ||
                !saga_colmap_add_track(job, point, (uint32_t)image))
                return false;
    }
    return true;
}
