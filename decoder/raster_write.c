/* SPDX-License-Identifier: MIT
 *
 * Converts a finished line of a tile, planes T, R, G, B, to samples of the
 * caller's picture: over the background in 8 or 16 bits, or as depths.
 */
#include "fx.h"
#include "raster_state.h"

/* Returns (s max + 2^30) >> 31, which is at most max, for s = C + T background.
 * s <= 2^16 * 2^15, since all weights and the last T add up to 65536. */
static uint16_t finish16(uint32_t s)
{
    FX_ASSERT(s <= 1u << 31);
    return (uint16_t)(((uint64_t)s * 65535 + (1u << 30)) >> 31);
}

/* Returns the sum s as a sample of 0..255, like finish16, but in 32 bits. With
 * s = a 2^23 + b, 255 s is a 2^31 + 256 b - s. The term after a is halved to
 * fit 32 bits, and shifted by 30 instead of 31. */
static uint8_t finish8(uint32_t s)
{
    const int32_t rest = (int32_t)((s & 0x7fffff) << 7) + (1 << 29) -
                         (int32_t)((s + 1) >> 1);

    return (uint8_t)((int32_t)(s >> 23) + (rest >> 30));
}

/* Writes channel k of a line: n samples of 8 bits. */
static void finish_line8(uint8_t *restrict v, const uint32_t *restrict t,
                         const uint32_t *restrict c, uint32_t background,
                         int32_t n)
{
    int32_t i;

    for (i = 0; i < n; i++)
        v[i] = finish8(c[i] + t[i] * background);
}

static void write_line8(const raster *r, uint8_t *p, const uint32_t *t,
                        int32_t n)
{
    const uint32_t plane = 1u << 2 * r->log2_side;
    uint8_t v[3][64];
    uint32_t k;
    int32_t i;

    for (k = 0; k < 3; k++)
        finish_line8(v[k], t, t + plane * (k + 1), r->cam->background_q15[k],
                     n);
    for (i = 0; i < n; i++, p += 3) {
        p[0] = v[0][i];
        p[1] = v[1][i];
        p[2] = v[2][i];
    }
}

static void write_line16(const raster *r, uint16_t *p, const uint32_t *t,
                         int32_t n)
{
    const uint32_t plane = 1u << 2 * r->log2_side;
    uint32_t k;
    int32_t i;

    for (i = 0; i < n; i++, t++)
        for (k = 0; k < 3; k++)
            *p++ = finish16(t[plane * (k + 1)] +
                            *t * r->cam->background_q15[k]);
}

/* Writes depths, which are put together from their three parts (colour_patch).
 */
static void write_depths(const raster *r, saga_depth *p, const uint32_t *t,
                         int32_t n)
{
    const uint32_t plane = 1u << 2 * r->log2_side;
    int32_t i;

    for (i = 0; i < n; i++, t++, p++) {
        p->sum_q16 = ((uint64_t)t[plane] << 22) +
                     ((uint64_t)t[2 * plane] << 11) + t[3 * plane];
        p->weight_q16 = 65536 - *t;
        p->reserved = 0;
    }
}

void saga_raster_write(const raster *r, const uint32_t *t, int32_t x, int32_t y)
{
    const int32_t width = fx_min((int32_t)r->side, r->job->x1 - x);
    /* The caller's picture begins at the corner of the job. */
    void *const line = (uint8_t *)r->pic->rgb +
                       (size_t)(y - r->job->y0) * r->pic->stride_nbytes;
    /* Coordinates of the job, not of the camera's picture. */
    const int32_t at = x - r->job->x0;

    if (r->pic->bits == SAGA_DEPTH)
        write_depths(r, (saga_depth *)line + at, t, width);
    else if (r->pic->bits == 16)
        write_line16(r, (uint16_t *)line + 3 * at, t, width);
    else
        write_line8(r, (uint8_t *)line + 3 * at, t, width);
}
