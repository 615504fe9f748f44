/* SPDX-License-Identifier: MIT
 *
 * Tells whether an ICC profile means sRGB, whatever its name: by its primaries
 * and by its curves at one half. Other profiles are named, not applied.
 */
#include "picture_kinds.h"

#include <math.h>
#include <stdio.h>

typedef struct icc {
    const uint8_t *data;
    size_t nbytes;
} icc;

/* Reads n bytes, the high one first; 0 beyond the end. */
static uint32_t number(const icc *p, size_t at, size_t n)
{
    uint32_t x = 0;
    for (size_t i = 0; i < n && at <= p->nbytes && n <= p->nbytes - at; i++)
        x = x << 8 | p->data[at + i];
    return x;
}

static double fixed(const icc *p, size_t at)
{
    return (int32_t)number(p, at, 4) / 65536.0;
}

static uint32_t four(const char *name)
{
    const icc p = { (const uint8_t *)name, 4 };
    return number(&p, 0, 4);
}

/* Returns where a tag's value begins; 0 if there is none. Entries of the table
 * are name, place, length. */
static size_t find_tag(const icc *p, const char *name)
{
    enum { TABLE = 128, MOST = 100 };
    const uint32_t n = number(p, TABLE, 4);
    for (uint32_t i = 0; i < n && i < MOST; i++) {
        const size_t entry = TABLE + 4 + 12 * (size_t)i;
        if (number(p, entry, 4) == four(name))
            return number(p, entry + 4, 4);
    }
    return 0;
}

/* Returns what a curve makes of one half; -1 if it is not known. */
static double half_of(const icc *p, const char *name)
{
    const size_t at = find_tag(p, name);
    const uint32_t type = number(p, at, 4), n = number(p, at + 8, 4);
    if (at && type == four("curv"))
        return n == 0 ? 0.5
               : n == 1
                   ? pow(0.5, number(p, at + 12, 2) / 256.0)
                   : number(p, at + 12 + (n - 1) / 2 * (size_t)2, 2) / 65535.0;
    if (!at || type != four("para"))
        return -1.0;
    /* (a x + b) ^ g, and what two of the five functions add. */
    const uint32_t kind = n >> 16;
    const double g = fixed(p, at + 12);
    const double a = kind ? fixed(p, at + 16) : 1.0;
    const double b = kind ? fixed(p, at + 20) : 0.0;
    const double more = kind == 2   ? fixed(p, at + 24)
                        : kind == 4 ? fixed(p, at + 32)
                                    : 0.0;
    return pow(a / 2.0 + b, g) + more;
}

/* Powers of 2.2 and 2.4 are near enough to the curve of sRGB. */
static bool has_curve(const icc *p, const char *name)
{
    return fabs(half_of(p, name) - 0.214) < 0.03;
}

static bool is_srgb(const icc *p)
{
    /* The primaries of sRGB, adapted to D50. */
    static const struct {
        const char *colour, *curve;
        double xyz[3];
    } rgb[] = {
        { "rXYZ", "rTRC", { 0.4361, 0.2225, 0.0139 } },
        { "gXYZ", "gTRC", { 0.3851, 0.7169, 0.0971 } },
        { "bXYZ", "bTRC", { 0.1431, 0.0606, 0.7141 } },
    };
    const uint32_t space = number(p, 16, 4);
    if (space == four("GRAY"))
        return has_curve(p, "kTRC");
    if (space != four("RGB "))
        return false;
    for (size_t i = 0; i < 3; i++) {
        const size_t at = find_tag(p, rgb[i].colour);
        for (size_t k = 0; k < 3; k++)
            if (!at || !(fabs(fixed(p, at + 8 + 4 * k) - rgb[i].xyz[k]) < 0.01))
                return false;
        if (!has_curve(p, rgb[i].curve))
            return false;
    }
    return true;
}

/* Writes the description, or the name of the colour space without one. */
static void describe(const icc *p, char *to, size_t n)
{
    size_t at = find_tag(p, "desc"), step = 1, length = 4;
    if (at && number(p, at, 4) == four("desc")) {
        length = number(p, at + 8, 4);
        at += 12;
    } else if (at && number(p, at, 4) == four("mluc")) {
        /* The first of its languages, in UTF-16. */
        length = number(p, at + 20, 4) / 2;
        at += number(p, at + 24, 4);
        step = 2;
    } else {
        at = 16;
    }
    size_t used = 0;
    for (size_t i = 0; i < length && used + 1 < n; i++) {
        const uint32_t c = number(p, at + step * i, step);
        if (c == 0)
            break;
        to[used++] = c >= ' ' && c < 127 && c != '"' ? (char)c : '?';
    }
    to[used] = '\0';
}

void saga_picture_tell_profile(const uint8_t *data, size_t n,
                               saga_picture_look *look)
{
    const icc profile = { data, n };
    char name[48];
    if (look->ignored[0] || is_srgb(&profile))
        return;
    describe(&profile, name, sizeof name);
    (void)snprintf(look->ignored, sizeof look->ignored,
                   "the ICC profile "
                   "\"%s\"",
                   name);
}
