/* SPDX-License-Identifier: MIT */
#include "montage.h"

#include "alloc.h"
#include "error.h"
#include "picture.h"

#include <stdlib.h>
#include <string.h>

typedef struct {
    uint8_t *rgb;
    int width, height;
} canvas;

void saga_difference(uint8_t *out, const uint8_t *a, const uint8_t *b, size_t n,
                     int gain)
{
    for (size_t i = 0; i < n; i++) {
        const int d = gain * (a[i] > b[i] ? a[i] - b[i] : b[i] - a[i]);

        out[i] = (uint8_t)(d < 255 ? d : 255);
    }
}

static void paste(canvas *to, const saga_still *s, int x, int y)
{
    for (int row = 0; row < s->height; row++)
        memcpy(
            to->rgb + 3 * ((size_t)(y + row) * (size_t)to->width + (size_t)x),
            s->rgb + 3 * (size_t)row * (size_t)s->width, 3 * (size_t)s->width);
}

bool saga_montage_write(const char *path, const saga_still *stills, int n,
                        int columns, saga_error *error)
{
    const int across = n < columns ? n : columns;
    int w = 0, h = 0;
    canvas c;
    bool ok;

    for (int i = 0; i < n; i++) {
        w = stills[i].width > w ? stills[i].width : w;
        h = stills[i].height > h ? stills[i].height : h;
    }
    /* Each place is as large as the largest picture plus a gap; the last column
     * and row have no gap after them. */
    w += SAGA_MONTAGE_GAP;
    h += SAGA_MONTAGE_GAP;
    c.width = w * across - SAGA_MONTAGE_GAP;
    c.height = h * ((n + columns - 1) / columns) - SAGA_MONTAGE_GAP;
    c.rgb = saga_alloc((size_t)c.width * (size_t)c.height, 3, path, error);
    if (!c.rgb)
        return false;
    /* Places without a picture stay grey. */
    memset(c.rgb, 128, 3 * (size_t)c.width * (size_t)c.height);
    for (int i = 0; i < n; i++)
        paste(&c, &stills[i], w * (i % columns), h * (i / columns));
    ok = saga_png_write(path, c.width, c.height, c.rgb, error);
    free(c.rgb);
    return ok;
}

bool saga_montage_compare(const char *path, const saga_still *truth,
                          const saga_still *decode, int gain, saga_error *error)
{
    const size_t n = 3 * (size_t)truth->width * (size_t)truth->height;
    uint8_t *const d = saga_alloc(n, 1, path, error);
    const saga_still three[3] = { *truth,
                                  *decode,
                                  { d, truth->width, truth->height } };
    bool ok;

    if (!d)
        return false;
    saga_difference(d, truth->rgb, decode->rgb, n, gain);
    ok = saga_montage_write(path, three, 3, 3, error);
    free(d);
    return ok;
}
