/* SPDX-License-Identifier: MIT
 *
 * Writes the head of a file: the cube, the frame rate and the rig of the
 * pictures that it was trained on.
 */
#include "pack.h"

#include "alloc.h"
#include "camera.h"
#include "utf8.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* Returns the mantissa of value = mantissa 2^exponent, within 30 bits. */
static int32_t mantissa_of(double value, int exponent)
{
    return (int32_t)lround(ldexp(value, -exponent));
}

static int exponent_of(double value)
{
    int e;

    /* |value| < 2^e, so the mantissa stays within 30 bits. */
    frexp(value, &e);
    return e - 30;
}

/* Sets the frame rate as a fraction with denominator 1, 1001 or 1000. */
static void set_rate(saga_header *h, double fps)
{
    const double ntsc = fps * 1.001;

    /* Whole rates are exact. So are 24000 / 1001 and the like, which a capture
     * may have rounded to 23.976. */
    h->fps_den = fabs(fps - rint(fps)) < 1e-6     ? 1
                 : fabs(ntsc - rint(ntsc)) < 1e-4 ? 1001
                                                  : 1000;
    h->fps_num = (uint32_t)fmax(1, h->fps_den == 1      ? rint(fps)
                                   : h->fps_den == 1001 ? 1000 * rint(ntsc)
                                                        : rint(1000 * fps));
}

static void set_header(saga_header *h, const saga_pictures *p, int level)
{
    const saga_cube *const cube = &p->cube;
    double most = 1e-9;

    memset(h, 0, sizeof *h);
    /* A box unit is 2^-23 of half the cube, in the unit of the capture. */
    h->unit_exponent = exponent_of(cube->unit / 8388608.0);
    h->unit_mantissa = mantissa_of(cube->unit / 8388608.0, h->unit_exponent);
    /* All axes share one exponent, from the largest. */
    for (int i = 0; i < 3; i++)
        most = fmax(most, fabs(cube->centre[i]));
    h->centre_exponent = exponent_of(most);
    for (int i = 0; i < 3; i++)
        h->centre_mantissa[i] = mantissa_of(cube->centre[i],
                                            h->centre_exponent);
    h->n_cameras = (uint16_t)p->capture->n_views;
    h->level = (uint8_t)level;
    set_rate(h, p->capture->fps);
}

static void copy_camera(saga_rig_camera *r, const saga_camera *c,
                        uint32_t number)
{
    memcpy(r->rotation_q30, c->rotation_q30, sizeof r->rotation_q30);
    memcpy(r->centre, c->centre, sizeof r->centre);
    memcpy(r->focal_q16, c->focal_q16, sizeof r->focal_q16);
    memcpy(r->principal_q16, c->principal_q16, sizeof r->principal_q16);
    memcpy(r->background_q15, c->background_q15, sizeof r->background_q15);
    r->near_plane = c->near_plane;
    r->width = c->width;
    r->height = c->height;
    r->number = number;
}

/* Makes the rig of all cameras of the capture, including held-out ones, in its
 * order. */
static saga_rig_camera *make_rig(const saga_pictures *p, const saga_header *h,
                                 saga_error *error)
{
    const size_t n = (size_t)p->capture->n_views;
    saga_rig_camera *const rig = saga_calloc(n, sizeof *rig, "the cameras",
                                             error);
    saga_metric m;

    /* Cameras are converted with the header's rounded numbers, which are the
     * ones that a decoder has. */
    m.unit = ldexp(h->unit_mantissa, h->unit_exponent);
    for (int i = 0; i < 3; i++)
        m.centre[i] = ldexp(h->centre_mantissa[i], h->centre_exponent);
    for (size_t i = 0; rig && i < n; i++) {
        saga_camera c;

        memset(&c, 0, sizeof c);
        for (int k = 0; k < 3; k++)
            /* The rig has the background colour with which the pictures were
             * trained. */
            c.background_q15[k] = (uint16_t)lrint(32768 *
                                                  (p->background[k] / 255.0));
        if (!saga_camera_of_source_view(&c, &m, &p->capture->views[i],
                                        saga_pictures_near(p, (int)i), error)) {
            free(rig);
            return NULL;
        }
        copy_camera(&rig[i], &c, (uint32_t)i);
    }
    return rig;
}

/* Names the cameras of the rig, in its order, in UTF-8. A name with control
 * characters is not allowed in a file and is left empty. */
static bool name_rig(saga_encoder *e, const saga_capture *c, saga_error *error)
{
    const size_t n = (size_t)c->n_views;
    saga_naming *const names = saga_calloc(n, sizeof *names, "the names",
                                           error);
    bool ok;

    for (size_t i = 0; names && i < n; i++) {
        const char *const name = c->views[i].name;
        size_t k = 0;

        /* The loop stops at the end or at a control character, in which case
         * the name becomes empty. */
        while ((unsigned char)name[k] >= 0x20 && name[k] != 0x7f)
            k++;
        saga_utf8_copy(names[i].name, sizeof names[i].name, name,
                       name[k] ? 0 : k);
    }
    if (names && c->metres > 0) {
        names->metre_exponent = exponent_of(c->metres);
        names->metre_mantissa = mantissa_of(c->metres, names->metre_exponent);
    }
    ok = names && saga_encoder_names(e, names, error);
    free(names);
    return ok;
}

bool saga_pack_open(saga_packed *file, const saga_pack_input *in,
                    const saga_pictures *pictures, int level, saga_error *error)
{
    saga_header h;
    saga_rig_camera *rig;
    bool ok;

    set_header(&h, pictures, level);
    /* The header comes first, because the rig is in its units. */
    rig = make_rig(pictures, &h, error);
    if (!rig)
        return false;
    ok = saga_pack_begin(file, in, &h, rig, error) &&
         name_rig(file->encoder, pictures->capture, error);
    free(rig);
    return ok;
}

/* Returns the gain that undoes an exposure factor of training, within the range
 * of the format. */
static uint16_t gain_of(double factor)
{
    return (uint16_t)lrint(fmin(fmax(4096 / factor, 256), 65535));
}

bool saga_pack_exposures(saga_packed *file, const saga_pictures *p,
                         saga_error *error)
{
    const size_t n = (size_t)p->capture->n_views;
    saga_exposure *exposures;
    bool differ = false, ok;

    /* Factors that are exactly 1 were found to be the same for all cameras. */
    for (size_t i = 0; i < 3 * n; i++)
        differ = differ || p->exposure[i] < 1 || p->exposure[i] > 1;
    if (!differ)
        return true;
    exposures = saga_calloc(n, sizeof *exposures, "the exposures", error);
    for (size_t i = 0; exposures && i < 3 * n; i++)
        exposures[i / 3].gain_q12[i % 3] = gain_of(p->exposure[i]);
    ok = exposures && saga_encoder_exposures(file->encoder, exposures, error);
    free(exposures);
    return ok;
}
