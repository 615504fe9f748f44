/* SPDX-License-Identifier: MIT */
#include "ogg_opus.h"

#include "file.h"

#include <inttypes.h>
#include <string.h>

enum {
    PAGE_NBYTES = 27, /* size of a page's header without its lacing
                       * table */
    HEAD_NBYTES = 19, /* least size of the packet OpusHead */
    CONTINUED = 1,
    FIRST = 2,
    LAST = 4 /* flags of a page */
};

/* The state of a walk from page to page; `at` is the start of the next page. */
typedef struct {
    const char *name;
    const uint8_t *bytes;
    size_t n, at;
    uint32_t serial, number; /* number of the stream; number of the next page */
    int64_t granule;         /* samples up to the end of the last page */
    bool ended;
} walk;

typedef struct {
    const uint8_t *payload;
    size_t nbytes;
    int flags;
} page;

static bool bad(const walk *w, const char *what, saga_error *error)
{
    return saga_fail(error, w->name,
                     "make it with opusenc, or with ffmpeg's "
                     "-c:a libopus",
                     "it is not a complete Ogg Opus stream: "
                     "at byte %zu %s",
                     w->at, what);
}

/* Returns the CRC of a page as Ogg defines it: polynomial 0x04c11db7, highest
 * bit first, initial value 0. The CRC's own bytes, 22 to 25, count as zeros. */
static uint32_t page_crc(const uint8_t *p, size_t n)
{
    uint32_t crc = 0;

    for (size_t i = 0; i < n; i++) {
        crc ^= i >= 22 && i < 26 ? 0 : (uint32_t)p[i] << 24;
        for (int k = 0; k < 8; k++)
            crc = crc & 0x80000000u ? crc << 1 ^ 0x04c11db7u : crc << 1;
    }
    return crc;
}

/* Returns the size of the page at w->at, or 0 if it is cut off. */
static size_t page_nbytes(const walk *w)
{
    const uint8_t *const p = w->bytes + w->at;
    const size_t left = w->n - w->at;
    size_t nbytes = PAGE_NBYTES;

    if (left < nbytes || left - nbytes < p[26])
        return 0;
    nbytes += p[26];
    for (int i = 0; i < p[26]; i++)
        nbytes += p[PAGE_NBYTES + i];
    return nbytes <= left ? nbytes : 0;
}

/* Checks the order of the pages. The first page sets the stream's number. */
static bool check_place(walk *w, const uint8_t *p, saga_error *error)
{
    const uint32_t serial = (uint32_t)saga_load_le(p + 14, 4);

    if (w->number == 0)
        w->serial = serial;
    if (serial != w->serial || w->ended ||
        (w->number == 0) != ((p[5] & FIRST) != 0))
        return bad(w, "another stream begins", error);
    if (saga_load_le(p + 18, 4) != w->number)
        return bad(w, "a page is missing", error);
    return true;
}

static bool next_page(page *to, walk *w, saga_error *error)
{
    const uint8_t *const p = w->bytes + w->at;
    const size_t nbytes = page_nbytes(w);
    int64_t granule;

    if (w->n - w->at < 5 || memcmp(p, "OggS", 5) != 0)
        return bad(w, "no page begins", error);
    if (nbytes == 0)
        return bad(w, "a page is cut off", error);
    if (page_crc(p, nbytes) != saga_load_le(p + 22, 4))
        return bad(w, "a page has a wrong checksum", error);
    if (!check_place(w, p, error))
        return false;
    /* The granule is -1 if no packet ends in the page. */
    granule = (int64_t)saga_load_le(p + 6, 8);
    if (granule != -1 && granule < w->granule)
        return bad(w, "time goes back", error);
    w->granule = granule == -1 ? w->granule : granule;
    w->ended = p[5] & LAST;
    w->number++;
    to->payload = p + PAGE_NBYTES + p[26];
    to->nbytes = nbytes - PAGE_NBYTES - p[26];
    to->flags = p[5];
    w->at += nbytes;
    return true;
}

bool saga_is_ogg_opus(const uint8_t *bytes, size_t n)
{
    const size_t payload = n > PAGE_NBYTES ? PAGE_NBYTES + (size_t)bytes[26]
                                           : n;

    return n >= payload + 8 && memcmp(bytes, "OggS", 4) == 0 &&
           memcmp(bytes + payload, "OpusHead", 8) == 0;
}

/* Reads the first two pages: OpusHead describes the stream, OpusTags names
 * it. */
static bool read_headers(saga_ogg_opus *opus, walk *w, saga_error *error)
{
    page head, tags;

    if (!next_page(&head, w, error))
        return false;
    if (head.nbytes < HEAD_NBYTES || memcmp(head.payload, "OpusHead", 8) != 0 ||
        head.payload[8] > 15 || head.payload[9] == 0)
        return bad(w, "a header of Opus is missing", error);
    opus->n_channels = head.payload[9];
    opus->pre_skip = (uint32_t)saga_load_le(head.payload + 10, 2);
    if (!next_page(&tags, w, error))
        return false;
    return (tags.nbytes >= 8 && memcmp(tags.payload, "OpusTags", 8) == 0) ||
           bad(w, "its tags are missing", error);
}

bool saga_ogg_opus_read(saga_ogg_opus *opus, const char *name,
                        const uint8_t *bytes, size_t n, saga_error *error)
{
    walk w = { .name = name, .bytes = bytes, .n = n };
    page p;

    *opus = (saga_ogg_opus){ 0 };
    if (!read_headers(opus, &w, error))
        return false;
    while (w.at < n)
        if (!next_page(&p, &w, error))
            return false;
    if (w.granule <= (int64_t)opus->pre_skip)
        return bad(&w, "it ends before any sound", error);
    opus->n_samples = (uint64_t)w.granule - opus->pre_skip;
    return true;
}
