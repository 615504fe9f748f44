/* SPDX-License-Identifier: MIT */
#include "render_picture.h"

#include "alloc.h"
#include "file.h"
#include "picture.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static const char what[] = "the picture";

/* Largest distance of a camera from the cube's middle on each axis, in box
 * units (saga.h). */
#define MOST_CENTRE 536870912.0

int saga_sight_eyes(const saga_sight *s)
{
    return s->base > 0.0 ? 2 : 1;
}

static size_t pixel_nbytes(const saga_sight *s)
{
    return s->kind == SAGA_SIGHT_COLOUR ? 3 : sizeof(float);
}

/* Tells whether the decoder draws colours. */
static bool has_colour(const saga_sight *s)
{
    return s->kind == SAGA_SIGHT_COLOUR || s->kind == SAGA_SIGHT_RGBA;
}

/* Tells whether an eye is drawn directly into the picture, which needs no
 * conversion for the colours of one eye. */
static bool is_drawn_in_place(const saga_sight *s)
{
    return s->kind == SAGA_SIGHT_COLOUR && saga_sight_eyes(s) == 1;
}

bool saga_sight_alloc(saga_sight *s, size_t n, saga_error *error)
{
    const size_t drawn = has_colour(s) ? 3 : sizeof(saga_depth);
    const bool both = s->kind == SAGA_SIGHT_RGBA;

    s->eye = saga_alloc(n, drawn, what, error);
    if (both)
        s->opacity = saga_alloc(n, sizeof *s->opacity, what, error);
    s->all = is_drawn_in_place(s) ? s->eye
                                  : saga_alloc(n * (size_t)saga_sight_eyes(s),
                                               pixel_nbytes(s), what, error);
    return s->eye && s->all && (s->opacity || !both);
}

void saga_sight_free(saga_sight *s)
{
    if (s->all != s->eye)
        free(s->all);
    free(s->eye);
    free(s->opacity);
    s->eye = s->all = s->opacity = NULL;
}

/* --- Drawing ------------------------------------------------------------- */

/* Moves a camera to its right by a distance in the capture's units. */
static bool step_aside(saga_camera *c, const saga_film *film, double aside,
                       saga_error *error)
{
    /* The first row of the rotation, in Q30, is the camera's right. */
    for (int i = 0; i < 3; i++) {
        const double at = c->centre[i] + rint(aside / film->metric.unit *
                                              ldexp(c->rotation_q30[i], -30));

        if (!(fabs(at) <= MOST_CENTRE))
            return saga_fail(error, "--stereo", "give a smaller distance",
                             "an eye would stand outside 32 widths of the "
                             "scene's cube");
        c->centre[i] = (int32_t)at;
    }
    return true;
}

/* Converts drawn depths or opacities to floats. */
static void take_values(float *to, const saga_sight *s, size_t first, size_t n,
                        double unit)
{
    const saga_depth *const d = (const saga_depth *)s->eye + first;

    /* A depth is sum / weight. A weight of 0 means that the pixel shows
     * nothing, which is depth 0. */
    for (size_t i = 0; i < n; i++)
        to[i] = s->kind == SAGA_SIGHT_ALPHA ? (float)(d[i].weight_q16 / 65536.0)
                : d[i].weight_q16
                    ? (float)(unit * ((double)d[i].sum_q16 / d[i].weight_q16))
                    : 0.0f;
}

/* Divides drawn colours, which are over black, by the opacity: what is shown
 * over b is then alpha colour + (1 - alpha) b. */
static void take_colours(uint8_t *to, const saga_sight *s, size_t first,
                         size_t n)
{
    const saga_depth *const d = s->opacity + first;
    const uint8_t *const rgb = (const uint8_t *)s->eye + 3 * first;

    for (size_t i = 0; i < n; i++) {
        const uint32_t a = d[i].weight_q16;

        for (size_t k = 0; k < 3; k++) {
            const uint32_t c = a ? (rgb[3 * i + k] * 65536u + a / 2) / a : 0;

            to[4 * i + k] = (uint8_t)(c < 255 ? c : 255);
        }
        to[4 * i + 3] = (uint8_t)((255 * a + 32768) / 65536);
    }
}

/* Copies what was drawn for an eye to its place in the picture. */
static void place(const saga_sight *s, const saga_camera *c, int eye,
                  double unit)
{
    const size_t width = c->width, row = width * (size_t)saga_sight_eyes(s);

    for (size_t y = 0; y < c->height; y++) {
        const size_t to = y * row + (size_t)eye * width;

        if (s->kind == SAGA_SIGHT_COLOUR)
            memcpy((uint8_t *)s->all + 3 * to,
                   (const uint8_t *)s->eye + 3 * y * width, 3 * width);
        else if (s->kind == SAGA_SIGHT_RGBA)
            take_colours((uint8_t *)s->all + 4 * to, s, y * width, width);
        else
            take_values((float *)s->all + to, s, y * width, width, unit);
    }
}

/* Draws an eye; for SAGA_SIGHT_RGBA over black. */
static bool draw_eye(saga_sight *s, saga_film *film, saga_camera *c,
                     const uint32_t frame[2], saga_error *error)
{
    if (!has_colour(s))
        return saga_film_draw_depth(film, c, frame[0], frame[1], s->eye, error);
    if (s->kind == SAGA_SIGHT_RGBA)
        memset(c->background_q15, 0, sizeof c->background_q15);
    if (!saga_film_draw(film, c, frame[0], frame[1], s->eye, error))
        return false;
    if (s->rig >= 0)
        saga_film_expose(film, (uint32_t)s->rig, s->eye,
                         (size_t)c->width * c->height);
    return s->kind == SAGA_SIGHT_COLOUR ||
           saga_film_draw_depth(film, c, frame[0], frame[1], s->opacity, error);
}

bool saga_sight_draw(saga_sight *s, saga_film *film, const saga_camera *camera,
                     uint32_t frame_num, uint32_t frame_den, saga_error *error)
{
    if (saga_sight_eyes(s) * camera->width > SAGA_MAX_SIDE)
        return saga_fail(error, "--stereo", "give a --size of half of that",
                         "two pictures of %d pixels side by side are wider "
                         "than %d",
                         camera->width, SAGA_MAX_SIDE);
    /* The two eyes are half of their distance to either side. */
    for (int eye = 0; eye < saga_sight_eyes(s); eye++) {
        saga_camera c = *camera;

        if (s->base > 0.0 &&
            !step_aside(&c, film, eye ? 0.5 * s->base : -0.5 * s->base, error))
            return false;
        if (!draw_eye(s, film, &c, (uint32_t[]){ frame_num, frame_den }, error))
            return false;
        if (!is_drawn_in_place(s))
            place(s, &c, eye, film->metric.unit);
    }
    return true;
}

/* --- Writing ------------------------------------------------------------- */

static bool write_grey(const saga_sight *s, const char *name, int width,
                       int height, saga_error *error)
{
    const size_t n = (size_t)width * (size_t)height;
    const double scale = s->kind == SAGA_SIGHT_DEPTH ? 1000.0 : 65535.0;
    const float *const value = s->all;
    uint16_t *const grey = saga_alloc(n, sizeof *grey, name, error);
    bool ok;

    if (!grey)
        return false;
    /* PNG stores depths in thousandths; larger ones than 16 bits hold become
     * 65535. */
    for (size_t i = 0; i < n; i++)
        grey[i] = (uint16_t)fmin(rint(scale * (double)value[i]), 65535.0);
    ok = saga_png_write_grey(name, width, height, grey, error);
    free(grey);
    return ok;
}

bool saga_sight_write(const saga_sight *s, const char *name, int width,
                      int height, saga_error *error)
{
    const bool exr = saga_has_suffix(name, ".exr");
    const int all = width * saga_sight_eyes(s);

    if (s->kind == SAGA_SIGHT_COLOUR)
        return exr ? saga_exr_write(name, all, height, s->all, error)
                   : saga_png_write(name, all, height, s->all, error);
    if (s->kind == SAGA_SIGHT_RGBA)
        return saga_png_write_rgba(name, all, height, s->all, error);
    if (!exr)
        return write_grey(s, name, all, height, error);
    return s->kind == SAGA_SIGHT_DEPTH
               ? saga_exr_write_depth(name, all, height, s->all, error)
               : saga_exr_write_alpha(name, all, height, s->all, error);
}
