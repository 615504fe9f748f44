/* SPDX-License-Identifier: MIT */
#include "filmed.h"

#include <string.h>

/* Chroma rows are kept in a ring, of which five are in use. */
enum { RING = 8 };

/* The kernel at distances 1.75, 0.75, 0.25 and 1.25 of the four samples around
 * an even column or row, and in reverse order for an odd one, in 1/16384 and in
 * 1/4096. Each is rounded together with the rest of the one before it, from
 * left to right, so that the sum is exact. In columns and rows 0 and 2, ffmpeg
 * leaves out the first sample, which is beyond the border. */
enum { EVEN, ODD, BORDER };
static const int32_t across[3][4] = { { -461, 3943, 14284, -1382 },
                                      { -1382, 14284, 3943, -461 },
                                      { 0, 3835, 13894, -1345 } };
static const int32_t down[3][4] = { { -115, 985, 3572, -346 },
                                    { -346, 3572, 985, -115 },
                                    { 0, 959, 3473, -336 } };

#if SAGA_ISA == 1

typedef struct colour_matrix {
    const char *name;
    int32_t cr_red, cb_blue, cb_green, cr_green; /* in 1/65536, for limited
                                                  * range; green is less */
} colour_matrix;

/* With luma's weights r, g, b of red, green and blue: 2 (1 - r), 2 (1 - b),
 * 2 b (1 - b) / g and 2 r (1 - r) / g, each times 255/224. */
static const colour_matrix matrices[] = {
    { "bt709", 117489, 138438, 13975, 34925 },
    { "smpte170m", 104597, 132201, 25675, 53279 },
    { "bt470bg", 104597, 132201, 25675, 53279 },
    { "smpte240m", 117579, 136230, 16907, 35559 },
    { "bt2020", 110013, 140363, 12277, 42626 },
    { "fcc", 104448, 132798, 24759, 53109 },
};

/* Returns x / 65536 in 1/8192, rounded. */
static int32_t rounded(int64_t x)
{
    return (int32_t)((x * 8192 + 32768) >> 16);
}

bool saga_filmed_init(saga_filmed *f, int depth, const char *matrix,
                      bool full_range)
{
    const colour_matrix *m = NULL;
    /* Full range has 255 levels of chroma instead of 224; ffmpeg rounds
     * towards 0. */
    const int64_t part = full_range ? 224 : 255;

    *f = (saga_filmed){ .depth = 0 };
    for (size_t i = 0; i < sizeof matrices / sizeof matrices[0]; i++)
        if (strcmp(matrix, matrices[i].name) == 0)
            m = &matrices[i];
    if (!m || (depth != 8 && depth != 10))
        return false;
    *f = (saga_filmed){ .depth = depth,
                        .luma = full_range ? 8192 : rounded(65536 * 255 / 219),
                        .offset = full_range ? 0 : 16 * 512,
                        .cr_red = rounded(m->cr_red * part / 255),
                        .cr_green = rounded(-(m->cr_green * part / 255)),
                        .cb_green = rounded(-(m->cb_green * part / 255)),
                        .cb_blue = rounded(m->cb_blue * part / 255) };
    return true;
}

#endif

/* Reads n samples, of 8 bits or of more in two bytes, as numbers of 16 bits. */
static void read_samples(int16_t *restrict to, const uint8_t *restrict from,
                         size_t n, int depth)
{
    if (depth == 8)
        for (size_t i = 0; i < n; i++)
            to[i] = from[i];
    else
        /* Bits above the depth would overflow below. */
        for (size_t i = 0; i < n; i++)
            to[i] = (int16_t)((from[2 * i] | from[2 * i + 1] << 8) & 1023);
}

/* Returns a sample of 15 bits from four of `depth` bits. The largest sum, 1023
 * (3943 + 14284), is below 2^25. */
static inline int16_t sample(const int16_t p[4], const int32_t t[4], int depth)
{
    const int32_t x = (p[0] * t[0] + p[1] * t[1] + p[2] * t[2] + p[3] * t[3]) >>
                      (depth - 1);

    return (int16_t)(x > 32767 ? 32767 : x);
}

/* Makes 2 n samples from n. padded: (n + 4), from two samples before the
 * first. */
static void widen(int16_t *restrict to, const int16_t *restrict padded,
                  size_t n, int depth)
{
    for (size_t i = 0; i < n; i++) {
        to[2 * i] = sample(padded + i, across[EVEN], depth);
        to[2 * i + 1] = sample(padded + i + 1, across[ODD], depth);
    }
    to[0] = sample(padded, across[BORDER], depth);
    to[2] = sample(padded + 1, across[BORDER], depth);
}

static void chroma_row(int16_t *to, const uint8_t *from, size_t n, int depth,
                       int16_t *padded)
{
    read_samples(padded + 2, from, n, depth);
    padded[0] = padded[1] = padded[2];
    padded[n + 2] = padded[n + 3] = padded[n + 1];
    widen(to, padded, n, depth);
}

/* A row of a picture. */
typedef struct row {
    const saga_filmed *filmed;
    size_t width;
    const int16_t *luma;
    int32_t *chroma; /* (2, width) */
    const int32_t *taps;
} row;

/* Interpolates chroma along columns; the result is 512 for a level of 8 bits,
 * around 0. */
static void lower(int32_t *restrict to, const int16_t *const at[4],
                  const row *r)
{
    const int16_t *const a = at[0], *const b = at[1];
    const int16_t *const c = at[2], *const d = at[3];
    const int32_t t0 = r->taps[0], t1 = r->taps[1];
    const int32_t t2 = r->taps[2], t3 = r->taps[3];
    const size_t n = r->width;

    /* A sum is at most 32767 (985 + 3572) < 2^28, and the middle is 2^26. */
    for (size_t x = 0; x < n; x++)
        to[x] = (a[x] * t0 + b[x] * t1 + c[x] * t2 + d[x] * t3 + 512 -
                 (128 << 19)) >>
                10;
}

/* Returns the level of a value in 1/2^22. Values wrap at 2^32 as they do in
 * ffmpeg, which only colours that no camera sees reach. */
static inline uint8_t level(uint32_t value)
{
    const int32_t x = (int32_t)value >> 22;

    return (uint8_t)(x < 0 ? 0 : x > 255 ? 255 : x);
}

/* Computes red, green and blue as three rows. */
static void colour_row(uint8_t *restrict to, const row *r)
{
    const uint32_t cr_red = (uint32_t)r->filmed->cr_red;
    const uint32_t cr_green = (uint32_t)r->filmed->cr_green;
    const uint32_t cb_green = (uint32_t)r->filmed->cb_green;
    const uint32_t cb_blue = (uint32_t)r->filmed->cb_blue;
    const int32_t offset = r->filmed->offset, gain = r->filmed->luma;
    const int shift = 17 - r->filmed->depth;
    const int16_t *const luma = r->luma;
    const int32_t *const cb = r->chroma, *const cr = cb + r->width;
    uint8_t *restrict const green = to + r->width;
    uint8_t *restrict const blue = green + r->width;
    const size_t n = r->width;

    for (size_t x = 0; x < n; x++) {
        const uint32_t y = (uint32_t)(((luma[x] << shift) - offset) * gain) +
                           (1u << 21);
        const uint32_t u = (uint32_t)cb[x], v = (uint32_t)cr[x];

        to[x] = level(y + v * cr_red);
        green[x] = level(y + v * cr_green + u * cb_green);
        blue[x] = level(y + u * cb_blue);
    }
}

static void interleave(uint8_t *restrict rgb, const uint8_t *restrict from,
                       size_t n)
{
    for (size_t x = 0; x < n; x++) {
        rgb[3 * x] = from[x];
        rgb[3 * x + 1] = from[n + x];
        rgb[3 * x + 2] = from[2 * n + x];
    }
}

void saga_filmed_develop(uint8_t *rgb, const uint8_t *picture,
                         const saga_filmed *f, const int size[2], void *room)
{
    const size_t w = (size_t)size[0], h = (size_t)size[1], n = w / 2;
    const size_t each = f->depth > 8 ? 2 : 1;
    const uint8_t *const cb = picture + w * h * each;
    const uint8_t *const cr = cb + w * h / 4 * each;
    int32_t *const chroma = room;
    int16_t *const ring = (int16_t *)(chroma + 2 * w);
    int16_t *const line = ring + 2 * RING * w;
    uint8_t *const colours = (uint8_t *)(line + w + 8);
    row r = { .filmed = f, .width = w, .luma = line, .chroma = chroma };
    size_t n_wide = 0; /* chroma rows so far */

    for (size_t y = 0; y < h; y++) {
        /* Row y lies between chroma rows first + 1 and first + 2, where row 0
         * has number 2. */
        const size_t first = y / 2 + y % 2;
        const int16_t *from[2][4];

        for (; n_wide < h / 2 && n_wide <= first + 1; n_wide++) {
            const size_t at = n_wide * n * each, to = n_wide % RING;

            chroma_row(ring + to * w, cb + at, n, f->depth, line);
            chroma_row(ring + (RING + to) * w, cr + at, n, f->depth, line);
        }
        for (size_t k = 0; k < 4; k++) {
            size_t at = first + k < 2 ? 0 : first + k - 2;

            at = (at < h / 2 ? at : h / 2 - 1) % RING;
            from[0][k] = ring + at * w;
            from[1][k] = ring + (RING + at) * w;
        }
        r.taps = down[y % 2 ? ODD : y < 4 ? BORDER : EVEN];
        lower(chroma, from[0], &r);
        lower(chroma + w, from[1], &r);
        read_samples(line, picture + y * w * each, w, f->depth);
        colour_row(colours, &r);
        interleave(rgb + 3 * y * w, colours, w);
    }
}

SAGA_ISA_CHOOSE(saga_filmed_develop);
