/* SPDX-License-Identifier: MIT */
#include "subject.h"

#include "error.h"

#include <math.h>
#include <string.h>

/* Least excess of a screen's colour. */
enum { LEAST_EXCESS = 64 };

/* A pixel with this part of the screen's excess is transparent: a screen is not
 * evenly bright. With that part it is opaque: light of the screen falls on the
 * subject. */
#define CLEAR 0.7
#define OPAQUE 0.1

void saga_subject_cut(uint8_t *rgb, const uint8_t *mask, size_t n)
{
    for (size_t i = 0; i < 3 * n; i++)
        rgb[i] = (uint8_t)((rgb[i] * mask[i] + 127) / 255);
}

/* Returns by how much a channel is above both others. */
static int excess(const uint8_t *rgb, int channel)
{
    const int a = rgb[(channel + 1) % 3], b = rgb[(channel + 2) % 3];

    return rgb[channel] - (a > b ? a : b);
}

static int strongest(const uint8_t *rgb)
{
    return rgb[1] >= rgb[0] ? rgb[2] > rgb[1] ? 2 : 1 : rgb[2] > rgb[0] ? 2 : 0;
}

bool saga_subject_check_key(const uint8_t key[3], saga_error *error)
{
    return excess(key, strongest(key)) >= LEAST_EXCESS ||
           saga_fail(error, "--key",
                     "give the colour of a green or blue screen, or masks",
                     "in %02X%02X%02X no channel is above the others by %d",
                     key[0], key[1], key[2], LEAST_EXCESS);
}

void saga_subject_key(uint8_t *rgb, uint8_t *mask, size_t n,
                      const uint8_t key[3])
{
    const int channel = strongest(key);
    const double most = excess(key, channel);

    /* A pixel p = m F + (1 - m) K of subject F and key K has the excess
     * (1 - m) of the key's, if the subject has none: s = 1 - m. */
    for (size_t i = 0; i < n; i++, rgb += 3, mask += 3) {
        const double s = fmax(excess(rgb, channel) / most, 0);
        const double alpha = fmin(fmax((CLEAR - s) / (CLEAR - OPAQUE), 0), 1);

        memset(mask, (int)lrint(255 * alpha), 3);
        for (int k = 0; k < 3; k++) {
            const double own = s < CLEAR ? (rgb[k] - s * key[k]) / (1 - s) : 0;

            rgb[k] = (uint8_t)lrint(alpha * fmin(fmax(own, 0), 255));
        }
    }
}

bool saga_subject_is_all(const uint8_t *bytes, size_t n, uint8_t value)
{
    size_t i = 0;

    while (i < n && bytes[i] == value)
        i++;
    return i == n;
}

bool saga_subject_check(const saga_capture *c, const char *path,
                        saga_error *error)
{
    bool none = true, all = true;

    for (int v = 0; v < c->n_views; v++) {
        const saga_source_view *const view = &c->views[v];
        const size_t n = (size_t)view->width * (size_t)view->height *
                         (size_t)saga_view_n_held(view, c->n_frames);

        if (view->n_missing == c->n_frames)
            continue;
        none = none && saga_subject_is_all(view->mask, n, 0);
        all = all && saga_subject_is_all(view->mask, n, 255);
    }
    return (!none && !all) ||
           saga_fail(error, path,
                     "make the masks white, or the pictures opaque, where the "
                     "subject is, and black or transparent elsewhere, or look "
                     "at the colour of --key",
                     "the subject of --subject is %s all pictures",
                     none ? "in none of" : "the whole of");
}
