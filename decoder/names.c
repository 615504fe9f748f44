/* SPDX-License-Identifier: MIT */
#include "fx.h"
#include "head.h"
#include "saga.h"

/* Returns the length in bytes of the UTF-8 character at s, or 0 if it is
 * invalid: a stray or missing byte, an overlong form, a surrogate, or above
 * U+10FFFF. The 0 at the end of a name cannot be part of a longer character. */
static uint32_t character_nbytes(const char *s)
{
    const uint8_t first = (uint8_t)s[0];
    const uint32_t n = first < 0x80   ? 1
                       : first < 0xc2 ? 0
                       : first < 0xe0 ? 2
                       : first < 0xf0 ? 3
                       : first < 0xf5 ? 4
                                      : 0;
    uint32_t code = first & 0xffu >> (n + 1), i;

    for (i = 1; i < n; i++) {
        if (((uint8_t)s[i] & 0xc0) != 0x80)
            return 0;
        code = code << 6 | ((uint8_t)s[i] & 0x3fu);
    }
    if ((n == 3 && (code < 0x800 || code >> 11 == 0xd800 >> 11)) ||
        (n == 4 && (code < 0x10000 || code > 0x10ffff)))
        return 0;
    return n;
}

static int is_utf8(const char *s)
{
    while (*s) {
        const uint32_t n = character_nbytes(s);

        if (n == 0)
            return 0;
        s += n;
    }
    return 1;
}

/* Reads the name at `at` into naming->name, which holds the previous name; the
 * name begins with `shared` bytes of that. Returns the offset after the name,
 * or 0 if it is invalid. */
static uint32_t read_name(saga_naming *naming, const uint8_t *p, uint32_t at,
                          uint32_t n)
{
    uint32_t shared, more, i;

    if (n - at < 2)
        return 0;
    shared = p[at];
    more = p[at + 1];
    at += 2;
    if (shared + more > SAGA_MAX_NAME || more > n - at)
        return 0;
    for (i = 0; i < shared; i++)
        if (!naming->name[i])
            return 0;
    for (i = 0; i < more; i++) {
        const uint8_t c = p[at + i];

        if (c < 0x20 || c == 0x7f)
            return 0;
        naming->name[shared + i] = (char)c;
    }
    naming->name[shared + more] = 0;
    return is_utf8(naming->name) ? at + more : 0;
}

/* Reads the payload p[0..n). All names are checked, including those after the
 * wanted one. */
static saga_status read_payload(saga_naming *naming, const uint8_t *p,
                                uint32_t n, uint32_t index, uint32_t n_cameras)
{
    saga_naming last = { 0 };
    uint32_t at = 8, i;

    if (n < at)
        return SAGA_ERR_DATA;
    last.metre_mantissa = (int32_t)fx_load32_le(p);
    last.metre_exponent = (int32_t)fx_load32_le(p + 4);
    for (i = 0; i < n_cameras; i++) {
        at = read_name(&last, p, at, n);
        if (!at)
            return SAGA_ERR_DATA;
        if (i == index)
            *naming = last;
    }
    return at == n ? SAGA_OK : SAGA_ERR_DATA;
}

saga_status saga_name_camera(saga_naming *naming, const uint8_t *bytes,
                             size_t n, uint32_t index)
{
    saga_chunk c;
    saga_header h;
    saga_info info;
    uint32_t networks;
    saga_status s = saga_probe(&info, bytes, n);

    if (!s)
        s = saga_head_read(&h, bytes, n);
    if (s)
        return s;
    if (index >= info.n_cameras)
        return SAGA_ERR_ARG;
    if (n < info.head_nbytes || n - info.head_nbytes < 4)
        return SAGA_ERR_TRUNCATED;
    /* The names, if there are any, are the first chunk after the head. */
    networks = saga_head_networks_crc(&h, bytes);
    bytes += info.head_nbytes;
    n -= info.head_nbytes;
    if (fx_load32_le(bytes) != SAGA_CHUNK_NAMES)
        return SAGA_ERR_ARG;
    s = saga_head_chunk(&c, SAGA_CHUNK_NAMES, networks, bytes, n);
    return s ? s
             : read_payload(naming, bytes + SAGA_CHUNK_NBYTES, c.nbytes, index,
                            info.n_cameras);
}
