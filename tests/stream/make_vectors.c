/* SPDX-License-Identifier: MIT
 *
 * make_vectors DIR: writes good and bad streams and DIR/MANIFEST. The streams
 * come from gen_stream.h, the checksums from the decoder of this build.
 * Therefore run it only after a change of the format (`make vectors`), and
 * check every difference.
 */
#include "encode.h"
#include "file.h"
#include "freed.h"
#include "fx.h"
#include "gen_extreme.h"
#include "gen_mutate.h"
#include "gen_slow.h"
#include "gen_stream.h"
#include "plan.h"
#include "prob.h"
#include "range_enc.h"
#include "vectors.h"

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { PIXELS_NBYTES = 3 * 640 * 480 };

static uint8_t pixels[PIXELS_NBYTES];
static const char *directory;
static FILE *manifest, *pictures;

static void write_file(const char *name, const uint8_t *p, size_t n)
{
    char path[1024];
    FILE *f;

    snprintf(path, sizeof path, "%s/%s", directory, name);
    f = fopen(path, "wb");
    if (!f || fwrite(p, 1, n, f) != n || fclose(f)) {
        fprintf(stderr, "make_vectors: %s: cannot write\n", path);
        exit(2);
    }
}

/* --- Good ---------------------------------------------------------------- */

/* Writes the MANIFEST lines of the first n_layers of a segment; of all layers
 * if the file is whole. */
static void describe_layers(const char *name, const gen_stream *g,
                            const saga_bytes *file, uint32_t number,
                            uint32_t n_layers, const gen_look *at)
{
    const uint8_t *const bytes = file->data;
    const size_t n = file->nbytes;
    const int32_t t = at->t;
    const uint32_t camera = at->camera;
    saga_nets nets;
    saga_stages st;
    saga_status s;

    saga_nets_layout(&nets, &g->header.model);
    st.symbols = saga_symbols_crc(
        &g->nets, &nets, g->has_base ? &g->base : NULL,
        &g->segment[number * saga_n_layers(&g->header)], n_layers,
        g->header.model.features);
    s = saga_stages_of(&st, bytes, n, number, t, camera, pixels, sizeof pixels);
    if (s) {
        fprintf(stderr, "make_vectors: %s: %s\n", name, saga_status_text(s));
        exit(2);
    }
    fprintf(manifest,
            "%s %" PRIu32 " %08" PRIx32 " %08" PRIx32 " %08" PRIx32
            " %08" PRIx32 " %" PRId32 " %" PRIu32 " %08" PRIx32 " %08" PRIx32
            " %08" PRIx32 "\n",
            name, number, st.symbols, st.final_range[0], st.final_range[1],
            st.final_range[2], t, camera, st.primitives, st.splats, st.frame);
}

/* The pictures of every stream. */
static const gen_look looks[] = { { 0, 0 }, { 40000, 1 } };
enum { N_LOOKS = sizeof looks / sizeof *looks };

/* Writes the MANIFEST lines of a segment, with n more pictures. */
static void describe(const char *name, const gen_stream *g,
                     const saga_bytes *file, uint32_t number,
                     const gen_look *more, int n)
{
    for (int i = 0; i < N_LOOKS + n; i++)
        describe_layers(name, g, file, number, saga_n_layers(&g->header),
                        i < N_LOOKS ? &looks[i] : &more[i - N_LOOKS]);
}

/* Writes the lines of PICTURES of a file: both kinds of its last segment, at a
 * time and a camera that MANIFEST has. */
static void describe_pictures(const char *name, const saga_bytes *file,
                              uint32_t number, const gen_look *look)
{
    const saga_stages_at at = { number, look->t, look->camera };

    for (int i = 0; i < SAGA_N_PICTURE_KINDS; i++) {
        const saga_picture_kind *const kind = &saga_picture_kinds[i];
        uint32_t crc;
        const saga_status s = saga_picture_crc(&crc, file->data, file->nbytes,
                                               &at, kind->bits);

        if (s) {
            fprintf(stderr, "make_vectors: %s: %s\n", name,
                    saga_status_text(s));
            exit(2);
        }
        fprintf(pictures,
                "%s %s %" PRIu32 " %" PRId32 " %" PRIu32 " %08" PRIx32 "\n",
                name, kind->name, number, at.t, at.camera, crc);
    }
}

/* Returns whether each of several layers has something to draw. */
static int is_worth_it(const gen_stream *g, const gen_options *o)
{
    for (uint32_t i = 0; o->n_layers > 1 && i < o->n_layers; i++)
        if (g->segment[i].n.prim < o->n_coarse)
            return 0;
    return g->segment[0].n.coarse >= o->n_coarse / 2;
}

/* Makes the first of the random streams with the seeds o.seed, o.seed + 100,
 * ... that has at least half of the coarse anchors that it may have. */
static void make_good(gen_stream *g, gen_options o)
{
    *g = gen_stream_make(&o);
    while (!is_worth_it(g, &o)) {
        gen_stream_free(g);
        o.seed += 100;
        *g = gen_stream_make(&o);
    }
}

static void write_good(const char *stem, gen_stream *g, const gen_look *more,
                       int n_more)
{
    char name[64];
    FREED uint8_t *bytes;
    size_t n;

    snprintf(name, sizeof name, "good/%s.saga", stem);
    gen_stream_encode(g, &bytes, &n);
    write_file(name, bytes, n);
    for (uint32_t i = 0; i < g->n_segments; i++)
        describe(name, g, &(saga_bytes){ bytes, n }, i, more, n_more);
    describe_pictures(name, &(saga_bytes){ bytes, n }, g->n_segments - 1,
                      n_more ? more : &looks[1]);
}

static void good(const char *stem, gen_options o)
{
    FREED_BY(gen_stream_free) gen_stream g;

    make_good(&g, o);
    write_good(stem, &g, NULL, 0);
}

static void good_extremes(void)
{
    gen_extreme_plan plan;
    gen_stream g;

    for (int i = 0; gen_extreme(&g, i, &plan); i++) {
        write_good(plan.name, &g, plan.look, plan.n_looks);
        gen_stream_free(&g);
    }
}

/* Writes the first stream whose tree reaches the limits of level 0. */
static void good_full(void)
{
    gen_options o = { .seed = 1,
                      .level = 0,
                      .full = 1,
                      .picture = 1,
                      .tools_fixed = 1,
                      .tools = SAGA_TOOLS_PICTURE };
    int found = 0;

    for (; !found; o.seed++) {
        const saga_level_caps *const cap = &saga_caps[0];
        FREED_BY(gen_stream_free) gen_stream g;
        const saga_symbols *const s = &g.segment[0];

        g = gen_stream_make(&o);
        found = s->n.coarse == GEN_FULL_COARSE && s->n.fine == cap->n_fine &&
                s->n.prim == cap->n_prim;
    }
    o.seed--;
    good("level0_full", o);
}

/* Options of streams with the given tools, and with a bank, whose pictures are
 * not empty. */
#define ALL (uint32_t) SAGA_TOOLS_PICTURE
#define DRAWN(given) .picture = 1, .tools_fixed = 1, .tools = given
#define BANK(write, slots, width, blocks)                    \
    .bank = write, .bank_slots = slots, .bank_width = width, \
    .bank_blocks = blocks
#define TABLES(levels, log2_entries) \
    .hash_levels = levels, .hash_log2_entries = log2_entries

/* --- Sound --------------------------------------------------------------- */

static void sound(const char *stem, const uint8_t *bytes, size_t n,
                  saga_status status)
{
    char name[64];

    snprintf(name, sizeof name, "sound/%s.saga", stem);
    write_file(name, bytes, n);
    fprintf(manifest, "%s sound %d\n", name, (int)status);
}

/* Writes a film whose chunk of sound has `more` bytes more than its length
 * field says, or fewer if `more` is negative. */
static void sound_length(const char *stem, const uint8_t *bytes, size_t n,
                         size_t at, int more)
{
    uint8_t *const copy = malloc(n);

    memcpy(copy, bytes, n);
    fx_store32_le(copy + at + 4, fx_load32_le(copy + at + 4) + (uint32_t)more);
    sound(stem, copy, n, more > 1000 ? SAGA_ERR_TRUNCATED : SAGA_ERR_DATA);
    free(copy);
}

/* Writes a film with a changed byte. If it is signed anew, the sound is not a
 * valid Ogg stream. */
static void sound_byte(const char *stem, const uint8_t *bytes, size_t n,
                       size_t at, int is_signed)
{
    uint8_t *const copy = malloc(n);

    memcpy(copy, bytes, n);
    copy[at] ^= 0x55;
    if (is_signed)
        saga_file_sign(copy, n, fx_load32_le(copy + SAGA_MAGIC_NBYTES));
    sound(stem, copy, n, SAGA_ERR_DATA);
    free(copy);
}

/* Writes a film in which the chunk of sound, bytes[at..end), is repeated, so
 * that the segments are no longer where the index says. */
static void sound_twice(const uint8_t *bytes, size_t n, size_t at, size_t end)
{
    uint8_t *const copy = malloc(2 * n);
    const size_t twice = end - at;

    memcpy(copy, bytes, end);
    memcpy(copy + end, bytes + at, twice);
    memcpy(copy + end + twice, bytes + end, n - end);
    sound("twice", copy, n + twice, SAGA_ERR_DATA);
    free(copy);
}

/* Writes a film whose chunk of sound has only its first field. */
static void sound_short(const uint8_t *bytes, size_t n, size_t at, size_t end)
{
    const size_t kept = SAGA_CHUNK_NBYTES + SAGA_SOUND_NBYTES;
    uint8_t *const copy = malloc(n);

    memcpy(copy, bytes, at + kept);
    memcpy(copy + at + kept, bytes + end, n - end);
    fx_store32_le(copy + at + 4, SAGA_SOUND_NBYTES);
    n -= end - at - kept;
    saga_file_sign(copy, n, fx_load32_le(copy + SAGA_MAGIC_NBYTES));
    sound("short", copy, n, SAGA_ERR_DATA);
    free(copy);
}

static void sounds(void)
{
    const gen_options o = { .seed = 42,
                            .level = 0,
                            .n_coarse = 2,
                            DRAWN(0),
                            .no_fuse = 3,
                            .named = 1,
                            .sounds = 1 };
    gen_stream g;
    saga_sound found;
    uint8_t *bytes;
    size_t n, at, end;

    g = gen_stream_make(&o);
    gen_stream_encode(&g, &bytes, &n);
    if (saga_find_sound(&found, bytes, n)) {
        fprintf(stderr, "make_vectors: there is no sound\n");
        exit(2);
    }
    at = (size_t)found.offset - SAGA_SOUND_NBYTES - SAGA_CHUNK_NBYTES;
    end = (size_t)found.offset + found.nbytes;
    sound("sound", bytes, n, SAGA_OK);
    sound("cut", bytes, end - 1, SAGA_ERR_TRUNCATED);
    sound("cut_behind", bytes, end + 3, SAGA_ERR_TRUNCATED);
    sound("enough", bytes, end + 4, SAGA_OK);
    sound_length("longer", bytes, n, at, 1);
    sound_length("shorter", bytes, n, at, -1);
    sound_length("beyond_the_end", bytes, n, at, 1 << 24);
    sound_byte("crc", bytes, n, end - 2, 0);
    sound_byte("names_crc", bytes, n, at - 2, 0);
    sound_byte("not_ogg", bytes, n, at + SAGA_CHUNK_NBYTES + SAGA_SOUND_NBYTES,
               1);
    sound_twice(bytes, n, at, end);
    sound_short(bytes, n, at, end);
    free(bytes);
    bytes = NULL;
    g.sounds = 0;
    gen_stream_encode(&g, &bytes, &n);
    sound("silent", bytes, n, SAGA_ERR_ARG);
    free(bytes);
    gen_stream_free(&g);
}

/* --- Bad ----------------------------------------------------------------- */

/* A change of a member of the header, or of each byte of an array in it: x
 * becomes (x & mask) + plus. */
typedef struct {
    size_t at, nbytes;
    uint32_t mask, plus;
} change;

#define CHANGE(member, mask, plus)                                             \
    {                                                                          \
        offsetof(saga_header, member), sizeof((saga_header *)0)->member, mask, \
            plus                                                               \
    }
#define TO(member, value) CHANGE(member, 0, value)
#define MORE(member, by) CHANGE(member, UINT32_MAX, by)
#define WITH(member, bits) CHANGE(member, ~(uint32_t)(bits), bits)
#define WITHOUT(member, bits) CHANGE(member, ~(uint32_t)(bits), 0)

static void make_change(saga_header *h, change c)
{
    uint8_t *const p = (uint8_t *)h + c.at;
    uint32_t wide;
    uint16_t half;

    if (c.nbytes == sizeof wide) {
        memcpy(&wide, p, sizeof wide);
        wide = (wide & c.mask) + c.plus;
        memcpy(p, &wide, sizeof wide);
    } else if (c.nbytes == sizeof half) {
        memcpy(&half, p, sizeof half);
        half = (uint16_t)((half & c.mask) + c.plus);
        memcpy(p, &half, sizeof half);
    } else {
        for (size_t i = 0; i < c.nbytes; i++)
            p[i] = (uint8_t)((p[i] & c.mask) + c.plus);
    }
}

/* A forbidden header, made by one or two changes, and its status. */
typedef struct {
    const char *stem;
    saga_status status;
    change by[2];
} bad_change;

static void bad(const char *stem, const uint8_t *bytes, size_t n,
                saga_status status)
{
    char name[64];

    snprintf(name, sizeof name, "bad/%s.saga", stem);
    write_file(name, bytes, n);
    fprintf(manifest, "%s status %d\n", name, (int)status);
}

/* Writes a file with changed bytes at `at`, signed anew. */
static void bad_signed(const char *stem, const uint8_t *bytes, size_t n,
                       size_t at, const char *by, size_t n_by,
                       saga_status status)
{
    FREED uint8_t *const copy = malloc(n);

    memcpy(copy, bytes, n);
    memcpy(copy + at, by, n_by);
    mutate_sign(copy, n);
    bad(stem, copy, n, status);
}

/* Writes heads that a future version or an unknown tool has changed. */
static void bad_versions(const uint8_t *bytes, size_t head)
{
    const size_t longer = head + 8;
    FREED uint8_t *const copy = calloc(longer, 1);

    bad_signed("version_zero", bytes, head, 4, "\0", 1, SAGA_ERR_DATA);
    bad_signed("version_zero_reserved", bytes, head, 4, "\0\0\1", 3,
               SAGA_ERR_DATA);
    bad_signed("version_256", bytes, head, 4, "\0\1", 2, SAGA_ERR_VERSION);
    bad_signed("version_reserved", bytes, head, 6, "\1", 1, SAGA_ERR_VERSION);
    /* The unknown tool adds a field of 8 bytes before the cameras. */
    memcpy(copy, bytes, SAGA_HEADER_NBYTES);
    memcpy(copy + SAGA_HEADER_NBYTES + 8, bytes + SAGA_HEADER_NBYTES,
           head - SAGA_HEADER_NBYTES);
    fx_store32_le(copy + SAGA_MAGIC_NBYTES, (uint32_t)longer);
    bad_signed("header_longer", copy, longer, 72, "", 0, SAGA_ERR_DATA);
    copy[73] |= 0x10;
    bad_signed("tool_unknown_longer", copy, longer, 72, "", 0,
               SAGA_ERR_VERSION);
    bad("tool_unknown_crc", copy, longer, SAGA_ERR_VERSION);
    bad("tool_unknown_cut", copy, SAGA_HEADER_NBYTES, SAGA_ERR_VERSION);
    bad("tool_unknown_cut_more", copy, SAGA_HEADER_NBYTES - 1,
        SAGA_ERR_TRUNCATED);
}

/* Writes files in which a chunk of the head is a byte too long or too short;
 * everything after it is present. */
static void bad_lengths_of_head(const uint8_t *bytes, size_t n, size_t head)
{
    const size_t at[2] = { head + 4, head + 4 + SAGA_CHUNK_NBYTES +
                                         SAGA_INDEX_ENTRY_NBYTES };
    static const char *const stem[2][2] = { { "index_longer", "index_shorter" },
                                            { "networks_longer",
                                              "networks_shorter" } };
    char nbytes[4];

    for (int i = 0; i < 2; i++)
        for (int k = 0; k < 2; k++) {
            fx_store32_le((uint8_t *)nbytes,
                          fx_load32_le(bytes + at[i]) + (k ? -1u : 1u));
            bad_signed(stem[i][k], bytes, n, at[i], nbytes, 4,
                       k ? SAGA_ERR_DATA : SAGA_ERR_TRUNCATED);
        }
    /* The index has a wrong offset for the only segment. */
    bad_signed("index_offset_beyond", bytes, n, head + SAGA_CHUNK_NBYTES,
               "\0\0\0\0\0\0\0\x80", 8, SAGA_ERR_TRUNCATED);
    bad_signed("index_offset_at_end", bytes, n, head + SAGA_CHUNK_NBYTES,
               (const char *)(const uint8_t[4]){ (uint8_t)(n & 255),
                                                 (uint8_t)(n >> 8 & 255),
                                                 (uint8_t)(n >> 16 & 255), 0 },
               4, SAGA_ERR_TRUNCATED);
    bad_signed("index_segment_huge", bytes, n, head + SAGA_CHUNK_NBYTES + 8,
               "\xff\xff\xff\xff", 4, SAGA_ERR_TRUNCATED);
}

/* Writes a file with a changed header, signed anew. */
static void bad_header(const bad_change *b, const uint8_t *bytes, size_t n)
{
    FREED uint8_t *const copy = malloc(n);
    saga_io in = { bytes, NULL, SAGA_MAGIC_NBYTES };
    saga_io out = { NULL, copy, SAGA_MAGIC_NBYTES };
    saga_header h;

    memcpy(copy, bytes, n);
    saga_header_io(&in, &h);
    saga_tools_io(&in, &h);
    make_change(&h, b->by[0]);
    make_change(&h, b->by[1]);
    saga_header_io(&out, &h);
    if (saga_rig_offset(&h) <= in.at)
        saga_tools_io(&out, &h);
    mutate_sign(copy, n);
    bad(b->stem, copy, n, b->status);
}

/* Writes the header of the stream o with each of the changes in turn, and
 * nothing after it: a wrong header must be refused before the rest of the file
 * is found to be missing. */
static void bad_headers(const gen_options *o, const bad_change *headers,
                        size_t n_headers)
{
    FREED uint8_t *bytes;
    size_t n;
    FREED_BY(gen_stream_free) gen_stream g = gen_stream_make(o);

    gen_stream_encode(&g, &bytes, &n);
    n = fx_load32_le(bytes + SAGA_MAGIC_NBYTES);
    for (size_t i = 0; i < n_headers; i++)
        bad_header(&headers[i], bytes, n);
    if (g.header.model.tools & SAGA_TOOL_BANK)
        bad("memory_cut_in_networks", bytes, SAGA_HEADER_NBYTES + 7,
            SAGA_ERR_TRUNCATED);
}

/* Writes a file with one changed byte, not signed. */
static void bad_byte(const char *stem, const uint8_t *bytes, size_t n,
                     size_t at, saga_status status)
{
    FREED uint8_t *const copy = malloc(n);

    memcpy(copy, bytes, n);
    copy[at] ^= 0x55;
    bad(stem, copy, n, status);
}

/* Codes a symbol with a new adaptive model. */
static void put(saga_range_enc *e, uint32_t n_sym, uint32_t sym)
{
    saga_adaptive m;

    saga_adaptive_init(&m, n_sym);
    saga_range_enc_interval(e, saga_adaptive_start(&m, sym),
                            sym + 1 < n_sym ? m.start[sym] : SAGA_PROB_TOTAL);
}

/* Writes a file whose networks begin with a layer whose first scale, of a row
 * or of a column, would be -1. */
static void bad_scale(const char *stem, uint32_t mode)
{
    const gen_options o = {
        .seed = 7, .level = 1, .n_coarse = 3, .tools_fixed = 1
    };
    FREED_BY(mutate_free) mutate_file f;
    saga_range_enc e;
    uint8_t *bytes, *changed, begin[16];
    size_t n;
    FREED_BY(gen_stream_free) gen_stream g = gen_stream_make(&o);

    gen_stream_encode(&g, &bytes, &n);
    mutate_split(&f, bytes, n);
    saga_range_enc_init(&e, begin, sizeof begin);
    saga_range_enc_bits(&e, 1, 16); /* step */
    saga_range_enc_bits(&e, 0, 10); /* its shift, the biases' */
    saga_range_enc_bits(&e, SAGA_DROP - 1, 6);
    saga_range_enc_bits(&e, 0, 6); /* scale of biases */
    put(&e, SAGA_N_SCALE_MODES, mode);
    if (mode == SAGA_SCALE_ROW) {
        put(&e, 4, 0); /* shift */
        put(&e, 8, 0);
    }
    put(&e, SAGA_N_DROPS, 1);
    memcpy(f.part[1].p, begin, saga_range_enc_finish(&e));
    changed = mutate_join(&f, &n);
    bad(stem, changed, n, SAGA_ERR_DATA);
    free(changed);
    free(bytes);
}

/* The numbers of the chunks of a file with one segment, as mutate_split counts
 * them. */
enum { PART_SEGMENT = 2, PART_COARSE, PART_FINE, PART_PRIM };

/* Writes a file in which a chunk has `more` zero bytes after its payload, or
 * lacks bytes if `more` is negative. If at < SAGA_SEGMENT_NBYTES, 1 is added to
 * byte `at` of the segment's header. All CRCs are computed anew. */
static void bad_chunk(const char *stem, const uint8_t *bytes, size_t n,
                      int part, int more, size_t at)
{
    FREED_BY(mutate_free) mutate_file f;
    uint8_t *changed, *payload;
    size_t size;

    mutate_split(&f, bytes, n);
    if (at < SAGA_SEGMENT_NBYTES)
        f.part[PART_SEGMENT].p[at]++;
    size = f.part[part].n + (size_t)(more > 0 ? more : 0);
    payload = calloc(size, 1);
    memcpy(payload, f.part[part].p, f.part[part].n);
    free(f.part[part].p);
    f.part[part].p = payload;
    f.part[part].n += (size_t)more;
    changed = mutate_join(&f, &n);
    bad(stem, changed, n, SAGA_ERR_DATA);
    free(changed);
}

/* Writes a file whose index makes the segment one byte too long; `more` bytes
 * follow it. */
static void bad_index(const char *stem, const uint8_t *bytes, size_t n,
                      size_t more, saga_status status)
{
    FREED uint8_t *const copy = calloc(n + more, 1);
    const size_t at = fx_load32_le(bytes + SAGA_MAGIC_NBYTES) +
                      SAGA_CHUNK_NBYTES + 8;

    memcpy(copy, bytes, n);
    fx_store32_le(copy + at, fx_load32_le(copy + at) + 1);
    mutate_sign(copy, n + more);
    bad(stem, copy, n + more, status);
}

/* Writes the head of one file with the segment of another that has the same
 * number, frames and bytes: the same stream with another height of its cameras'
 * pictures. */
static void bad_owner(const uint8_t *bytes, size_t n)
{
    FREED uint8_t *const copy = malloc(n);
    const size_t nets = fx_load32_le(bytes + SAGA_MAGIC_NBYTES) +
                        2 * SAGA_CHUNK_NBYTES + SAGA_INDEX_ENTRY_NBYTES;
    const size_t head = nets + fx_load32_le(bytes + nets - 8);

    memcpy(copy, bytes, n);
    copy[SAGA_HEADER_NBYTES + 74]++;
    mutate_sign(copy, n);
    memcpy(copy + head, bytes + head, n - head);
    bad("segment_of_another_file", copy, n, SAGA_ERR_DATA);
}

/* Writes files whose segments differ from the index, and with bytes left over.
 */
static void bad_segments(void)
{
    const gen_options o = { .seed = 15, .level = 0, .n_coarse = 2 };
    FREED uint8_t *bytes;
    size_t n;
    FREED_BY(gen_stream_free) gen_stream g = gen_stream_make(&o);

    gen_stream_encode(&g, &bytes, &n);
    bad_chunk("segment_number", bytes, n, PART_SEGMENT, 0, 0);
    bad_chunk("segment_first_frame", bytes, n, PART_SEGMENT, 0, 4);
    bad_chunk("segment_frames", bytes, n, PART_SEGMENT, 0, 8);
    bad_chunk("segment_header_longer", bytes, n, PART_SEGMENT, 1,
              SAGA_SEGMENT_NBYTES);
    bad_chunk("coarse_longer", bytes, n, PART_COARSE, 1, SAGA_SEGMENT_NBYTES);
    bad_chunk("fine_longer", bytes, n, PART_FINE, 1, SAGA_SEGMENT_NBYTES);
    bad_chunk("prim_shorter", bytes, n, PART_PRIM, -1, SAGA_SEGMENT_NBYTES);
    bad_index("segment_longer", bytes, n, 1, SAGA_ERR_DATA);
    bad_index("segment_beyond_the_end", bytes, n, 0, SAGA_ERR_TRUNCATED);
    bad_owner(bytes, n);
    bad_versions(bytes, fx_load32_le(bytes + SAGA_MAGIC_NBYTES));
    bad_lengths_of_head(bytes, n, fx_load32_le(bytes + SAGA_MAGIC_NBYTES));
}

/* Writes the head of one file followed by the segment of another. The other
 * file has the same networks, but the last byte of its base is changed and
 * signed anew. */
static void bad_base_owner(const uint8_t *bytes, size_t n, size_t head)
{
    FREED uint8_t *const copy = malloc(n);

    memcpy(copy, bytes, n);
    copy[head - 1]++;
    mutate_sign(copy, n);
    memcpy(copy, bytes, head);
    bad("segment_of_another_base", copy, n, SAGA_ERR_DATA);
}

/* Writes files with forbidden bases. */
static void bad_base(void)
{
    const bad_change headers[] = {
        { "base_coarse_zero", SAGA_ERR_DATA, { TO(base.coarse, 0) } },
        { "base_level",
          SAGA_ERR_LEVEL,
          { TO(base.coarse, saga_caps[1].n_coarse) } },
        { "base_too_long", SAGA_ERR_DATA, { TO(base_nbytes, (1u << 30) + 1) } },
    };
    static const bad_change whole[] = {
        { "base_prim_more", SAGA_ERR_DATA, { MORE(base.prim, 1) } },
        { "base_longer", SAGA_ERR_DATA, { MORE(base_nbytes, 1) } },
        { "base_shorter",
          SAGA_ERR_TRUNCATED,
          { MORE(base_nbytes, UINT32_MAX) } },
    };
    const gen_options o = {
        .seed = 7, .level = 1, .n_coarse = 3, .tools_fixed = 1, .base = 1
    };
    FREED_BY(gen_stream_free) gen_stream g;
    FREED uint8_t *bytes;
    size_t n, head;
    saga_info info;

    bad_headers(&o, headers, sizeof headers / sizeof *headers);
    g = gen_stream_make(&o);
    gen_stream_encode(&g, &bytes, &n);
    saga_probe(&info, bytes, n);
    head = info.head_nbytes;
    for (size_t i = 0; i < sizeof whole / sizeof *whole; i++)
        bad_header(&whole[i], bytes, n);
    bad("base_cut", bytes, head - 5, SAGA_ERR_TRUNCATED);
    bad_byte("crc_base", bytes, n, head - 3, SAGA_ERR_DATA);
    bad_base_owner(bytes, n, head);
}

/* Returns the place of the first segment in a file. */
static saga_segment first_segment(const uint8_t *bytes, size_t n)
{
    saga_segment seg;

    if (saga_find(&seg, bytes, n, 0, 1) != SAGA_OK)
        exit(2);
    return seg;
}

/* Returns the end of a layer of the file's only segment. */
static size_t end_of_layer(const uint8_t *bytes, size_t n, uint32_t layer)
{
    const saga_segment seg = first_segment(bytes, n);
    saga_io io = { bytes + seg.offset, NULL, SAGA_CHUNK_NBYTES };
    saga_segment_header h;
    size_t end = (size_t)seg.offset + seg.nbytes;
    uint32_t n_layers = bytes[13] + 1u;

    saga_segment_io(&io, &h, n_layers);
    while (--n_layers > layer)
        end -= h.layer[n_layers].nbytes;
    return end;
}

/* Writes a file with three layers, cut after the first two, and inside the
 * last. */
static void cut_layers(const gen_options *o)
{
    static const char *const name[] = { "cut/layers_1.saga",
                                        "cut/layers_2.saga",
                                        "cut/layers_2_more.saga" };
    saga_bytes part;
    FREED_BY(gen_stream_free) gen_stream g;
    size_t n;

    make_good(&g, *o);
    gen_stream_encode(&g, &part.data, &n);
    for (size_t i = 0; i < 3; i++) {
        const uint32_t n_layers = i == 0 ? 1 : 2;

        part.nbytes = end_of_layer(part.data, n, n_layers - 1) +
                      (i == 2 ? 7 : 0);
        write_file(name[i], part.data, part.nbytes);
        for (size_t k = 0; k < sizeof looks / sizeof *looks; k++)
            describe_layers(name[i], &g, &part, 0, n_layers, &looks[k]);
    }
    free(part.data);
}

/* Writes a file with numbers added to 4-byte fields of SEGM; all CRCs are
 * computed anew. */
static void bad_lengths(const char *stem, const uint8_t *bytes, size_t n,
                        const int by[2][2], saga_status status)
{
    const saga_segment seg = first_segment(bytes, n);
    FREED uint8_t *const copy = malloc(n);

    memcpy(copy, bytes, n);
    for (int i = 0; i < 2; i++) {
        uint8_t *const p = copy + seg.offset + SAGA_CHUNK_NBYTES + by[i][0];

        fx_store32_le(p, fx_load32_le(p) + (uint32_t)by[i][1]);
    }
    mutate_sign(copy, n);
    bad(stem, copy, n, status);
}

/* Writes files with forbidden layers. */
static void bad_layers(const gen_options *o)
{
    /* Places in SEGM: the number of primitives and the length, of layers 0 and
     * 1. */
    enum { PRIM_0 = 20, NBYTES_0 = 24, PRIM_1 = 36, NBYTES_1 = 40 };
    static const struct {
        const char *stem;
        int change[2][2];
        saga_status status;
    } lengths[] = {
        { "layers_prim_more",
          { { PRIM_0, 1 }, { PRIM_1, -1 } },
          SAGA_ERR_DATA },
        { "layers_longer",
          { { NBYTES_0, 1 }, { NBYTES_1, -1 } },
          SAGA_ERR_DATA },
        { "layers_shorter",
          { { NBYTES_0, -1 }, { NBYTES_1, 1 } },
          SAGA_ERR_TRUNCATED },
        { "layers_not_the_segment",
          { { NBYTES_1, 1 }, { PRIM_0, 0 } },
          SAGA_ERR_DATA },
    };
    static const bad_change together = { "layers_prim_together",
                                         SAGA_ERR_DATA,
                                         { MORE(max.prim, UINT32_MAX) } };
    FREED_BY(gen_stream_free) gen_stream g;
    FREED uint8_t *bytes;
    size_t n, end;

    make_good(&g, *o);
    gen_stream_encode(&g, &bytes, &n);
    for (size_t i = 0; i < sizeof lengths / sizeof *lengths; i++)
        bad_lengths(lengths[i].stem, bytes, n, lengths[i].change,
                    lengths[i].status);
    bad_header(&together, bytes, n);
    bad_signed("layers_index_huge", bytes, n,
               fx_load32_le(bytes + SAGA_MAGIC_NBYTES) + SAGA_CHUNK_NBYTES + 8,
               "\xff\xff\xff\xff", 4, SAGA_ERR_DATA);
    end = end_of_layer(bytes, n, 0);
    bad("layers_cut_in_first", bytes, end - 1, SAGA_ERR_TRUNCATED);
    bad("layers_cut_in_header", bytes,
        (size_t)first_segment(bytes, n).offset + 40, SAGA_ERR_TRUNCATED);
    bad_byte("crc_layer", bytes, n, end + SAGA_CHUNK_NBYTES, SAGA_ERR_DATA);
    /* The changed byte is in the second layer, which is complete in the cut
     * file. */
    bad_byte("crc_layer_cut", bytes, end_of_layer(bytes, n, 1),
             end + SAGA_CHUNK_NBYTES, SAGA_ERR_DATA);
}

/* Writes files with forbidden banks. */
static void bad_memory(void)
{
    static const bad_change headers[] = {
        { "memory_off",
          SAGA_ERR_DATA,
          { WITHOUT(model.tools, SAGA_TOOL_BANK) } },
        { "memory_unread",
          SAGA_ERR_DATA,
          { WITHOUT(model.sources, SAGA_SOURCE_BANK) } },
        { "memory_slots_zero", SAGA_ERR_DATA, { TO(model.bank_slots, 0) } },
        { "memory_slots_96", SAGA_ERR_DATA, { TO(model.bank_slots, 96) } },
        { "memory_slots_1024", SAGA_ERR_DATA, { TO(model.bank_slots, 1024) } },
        { "memory_slots_level", SAGA_ERR_LEVEL, { TO(model.bank_slots, 128) } },
        { "memory_slots_twins",
          SAGA_ERR_DATA,
          { TO(model.bank_slots, 512), TO(model.bank_width, 8) } },
        { "memory_width_zero", SAGA_ERR_DATA, { TO(model.bank_width, 0) } },
        { "memory_width_12", SAGA_ERR_DATA, { TO(model.bank_width, 12) } },
        { "memory_width_72", SAGA_ERR_DATA, { TO(model.bank_width, 72) } },
        { "memory_blocks_zero", SAGA_ERR_DATA, { TO(model.bank_blocks, 0) } },
        { "memory_net_width_zero",
          SAGA_ERR_DATA,
          { TO(model.width[SAGA_NET_QUERY], 0) } },
        { "memory_net_width_level",
          SAGA_ERR_LEVEL,
          { TO(model.width[SAGA_NET_QUERY], 65) } },
    };
    const gen_options o = { .seed = 7,
                            .level = 1,
                            .n_coarse = 3,
                            .tools_fixed = 1,
                            .bank = GEN_BANK_ORTHOGONAL,
                            .bank_slots = 64,
                            .bank_width = 16,
                            .bank_blocks = 4 };

    bad_headers(&o, headers, sizeof headers / sizeof *headers);
}

/* Writes files that lack a necessary network, or change fields of an optional
 * one. */
static void bad_fuse(void)
{
    static const bad_change headers[] = {
        { "width_zero_fine",
          SAGA_ERR_DATA,
          { TO(model.width[SAGA_NET_E_FINE], 0) } },
        { "width_zero_colour_base",
          SAGA_ERR_DATA,
          { TO(model.width[SAGA_NET_COLOUR_BASE], 0) } },
        { "width_129",
          SAGA_ERR_DATA,
          { TO(model.width[SAGA_NET_FUSE_F], 129) } },
        { "no_fuse_q_in_zero",
          SAGA_ERR_DATA,
          { TO(model.width[SAGA_NET_FUSE_C], 0),
            TO(model.q_in[SAGA_NET_FUSE_C], 0) } },
        { "no_fuse_q_too_large",
          SAGA_ERR_DATA,
          { TO(model.width[SAGA_NET_FUSE_C], 0),
            TO(model.out_q[SAGA_OUT_FUSE_C], 21) } },
    };
    const gen_options o = {
        .seed = 7, .level = 1, .n_coarse = 3, .tools_fixed = 1
    };

    bad_headers(&o, headers, sizeof headers / sizeof *headers);
}

/* Writes a file whose header allows one anchor of each tier more than its level
 * does. */
static void bad_slow(const char *stem, int kind)
{
    FREED_BY(gen_stream_free) gen_stream g;
    saga_counts max;
    FREED uint8_t *bytes;
    size_t n;

    gen_slow_make(&g, 0, kind, 4096);
    max = g.header.max;
    gen_stream_encode(&g, &bytes, &n);
    gen_slow_set_max(bytes, max.coarse + 1, max.fine + 1);
    bad(stem, bytes, n, SAGA_ERR_LEVEL);
}

/* Writes files with more work than the level allows. */
static void bad_work(void)
{
    FREED_BY(gen_stream_free) gen_stream g;
    FREED uint8_t *bytes;
    size_t n;

    bad_slow("work_exceeded", GEN_SLOW_WIDE);
    bad_slow("work_of_runs_exceeded", GEN_SLOW_NARROW);
    bad_slow("anchors_exceeded", GEN_SLOW_ANCHORS);
    gen_slow_wall(&g, 0, SAGA_COVER_MAX(0) + 1);
    gen_stream_encode(&g, &bytes, &n);
    bad("cover_exceeded", bytes, n, SAGA_ERR_LEVEL);
}

static void bad_all(void)
{
    static const bad_change headers[] = {
        { "tool_base", SAGA_ERR_DATA, { WITH(model.tools, SAGA_TOOL_BASE) } },
        { "tool_feature_residual",
          SAGA_ERR_VERSION,
          { WITH(model.tools, SAGA_TOOL_FEATURE_RESIDUAL) } },
        { "tool_hash", SAGA_ERR_DATA, { WITH(model.tools, SAGA_TOOL_HASH) } },
        { "tool_memory", SAGA_ERR_DATA, { WITH(model.tools, SAGA_TOOL_BANK) } },
        { "tool_plain_write",
          SAGA_ERR_DATA,
          { WITH(model.tools, SAGA_TOOL_PLAIN_WRITE) } },
        { "tool_unknown", SAGA_ERR_VERSION, { WITH(model.tools, 1u << 12) } },
        { "source_memory",
          SAGA_ERR_DATA,
          { WITH(model.sources[0], SAGA_SOURCE_BANK) } },
        { "source_unknown",
          SAGA_ERR_VERSION,
          { WITH(model.sources[0], SAGA_SOURCES_KNOWN + 1u) } },
        { "layers_without_lengths", SAGA_ERR_DATA, { TO(more_layers, 1) } },
        { "layers_too_many", SAGA_ERR_VERSION, { TO(more_layers, 8) } },
        { "memory_slots", SAGA_ERR_DATA, { TO(model.bank_slots, 64) } },
        { "memory_width", SAGA_ERR_DATA, { TO(model.bank_width, 32) } },
        { "memory_blocks", SAGA_ERR_DATA, { TO(model.bank_blocks, 256) } },
        { "hash_levels", SAGA_ERR_VERSION, { TO(model.hash_levels, 1) } },
        { "hash_size", SAGA_ERR_VERSION, { TO(model.hash_log2_entries, 10) } },
        { "level_unknown", SAGA_ERR_LEVEL, { TO(level, 4) } },
        { "level_exceeded", SAGA_ERR_LEVEL, { TO(level, 0) } },
        { "frames_zero", SAGA_ERR_DATA, { TO(n_frames, 0) } },
        { "segments_zero", SAGA_ERR_DATA, { TO(n_segments, 0) } },
        { "features_too_few", SAGA_ERR_DATA, { TO(model.features, 4) } },
        { "width_zero", SAGA_ERR_DATA, { TO(model.width[0], 0) } },
        { "octaves_too_many", SAGA_ERR_DATA, { TO(model.octaves, 9) } },
        { "groups_too_many",
          SAGA_ERR_DATA,
          { TO(model.tier[0].n_groups, 17) } },
        { "window_too_wide", SAGA_ERR_DATA, { TO(model.tier[1].window, 33) } },
        { "quat_q_too_large",
          SAGA_ERR_DATA,
          { TO(model.out_q[SAGA_OUT_QUAT], 15) } },
        { "rig_length", SAGA_ERR_DATA, { TO(n_cameras, 0) } },
        /* The header's length includes all these cameras, whose bytes are
         * missing. */
        { "cameras_too_many",
          SAGA_ERR_DATA,
          { TO(n_cameras, SAGA_MAX_CAMERAS + 1),
            TO(header_nbytes,
               SAGA_HEADER_NBYTES + 4u +
                   (SAGA_MAX_CAMERAS + 1) * SAGA_CAMERA_NBYTES) } },
        { "step_too_small",
          SAGA_ERR_DATA,
          { TO(model.step_q16[0], 15u << 16) } },
        { "source_coarse_parent",
          SAGA_ERR_DATA,
          { WITH(model.sources[SAGA_KIND_COARSE], SAGA_SOURCE_PARENT) } },
        { "weight_beyond_int8", SAGA_ERR_DATA, { TO(model.int8, 1) } },
        { "more_than_maximum", SAGA_ERR_DATA, { MORE(max.prim, UINT32_MAX) } },
    };
    const gen_options o = {
        .seed = 7, .level = 1, .n_coarse = 3, .tools_fixed = 1
    };
    FREED uint8_t *bytes;
    size_t n, head, half;
    FREED_BY(gen_stream_free) gen_stream g = gen_stream_make(&o);

    gen_stream_encode(&g, &bytes, &n);
    head = SAGA_HEADER_NBYTES + GEN_MAX_CAMERAS * SAGA_CAMERA_NBYTES + 4u;
    half = n / 2;
    for (size_t i = 0; i < sizeof headers / sizeof *headers; i++)
        bad_header(&headers[i], bytes, n);
    bad("empty", bytes, 0, SAGA_ERR_TRUNCATED);
    bad("cut_in_header", bytes, 100, SAGA_ERR_TRUNCATED);
    bad("cut_in_rig", bytes, head - 50, SAGA_ERR_TRUNCATED);
    bad("cut_in_networks", bytes, half, SAGA_ERR_TRUNCATED);
    bad("cut_in_segment", bytes, n - 9, SAGA_ERR_TRUNCATED);
    bad_byte("magic", bytes, n, 1, SAGA_ERR_DATA);
    bad_byte("version", bytes, n, 4, SAGA_ERR_VERSION);
    bad_byte("crc_header", bytes, n, 40, SAGA_ERR_DATA);
    bad_byte("crc_index", bytes, n, head + 14, SAGA_ERR_DATA);
    bad_byte("crc_networks", bytes, n, half, SAGA_ERR_DATA);
    bad_byte("crc_segment", bytes, n, n - 3, SAGA_ERR_DATA);
}

static FILE *begin_list(const char *name)
{
    char path[1024];
    FILE *f;

    snprintf(path, sizeof path, "%s/%s", directory, name);
    f = fopen(path, "w");
    if (!f) {
        fprintf(stderr, "make_vectors: %s: cannot write\n", path);
        exit(2);
    }
    return f;
}

int main(int argc, char **argv)
{
    static const struct {
        const char *stem;
        gen_options o;
    } row[] = {
        { "still", { .seed = 11, .level = 1, .n_coarse = 20, DRAWN(0) } },
        { "motion", { .seed = 12, .level = 1, .n_coarse = 20, DRAWN(ALL) } },
        { "segments",
          { .seed = 13,
            .level = 1,
            .n_coarse = 6,
            DRAWN(ALL & ~(uint32_t)SAGA_TOOL_VIEW),
            .n_segments = 3 } },
        { "random_level0", { .seed = 14, .level = 0, .n_coarse = 12 } },
        { "random_level1", { .seed = 15, .level = 1, .n_coarse = 12 } },
        { "random_level2", { .seed = 16, .level = 2, .n_coarse = 20 } },
        { "random_level3", { .seed = 17, .level = 3, .n_coarse = 12 } },
        { "memory_level0",
          { .seed = 18,
            .level = 0,
            .n_coarse = 20,
            DRAWN(ALL),
            BANK(GEN_BANK_ORTHOGONAL, 32, 16, 3) } },
        { "memory",
          { .seed = 19,
            .level = 1,
            .n_coarse = 20,
            DRAWN(ALL),
            BANK(GEN_BANK_ORTHOGONAL, 64, 32, 256) } },
        { "memory_plain",
          { .seed = 20,
            .level = 1,
            .n_coarse = 20,
            DRAWN(0),
            BANK(GEN_BANK_PLAIN, 64, 8, 1) } },
        { "memory_level2",
          { .seed = 21,
            .level = 2,
            .n_coarse = 12,
            .n_segments = 2,
            BANK(GEN_BANK_PLAIN, 128, 40, 5) } },
        { "memory_level3",
          { .seed = 22,
            .level = 3,
            .n_coarse = 12,
            BANK(GEN_BANK_ORTHOGONAL, 512, 64, 2) } },
        { "no_fuse_coarse",
          { .seed = 25,
            .level = 1,
            .n_coarse = 20,
            DRAWN(ALL),
            .no_fuse = 1 } },
        { "no_fuse_fine",
          { .seed = 26,
            .level = 1,
            .n_coarse = 20,
            DRAWN(ALL),
            .no_fuse = 2 } },
        { "no_fuse",
          { .seed = 27,
            .level = 0,
            .n_coarse = 20,
            DRAWN(ALL),
            .no_fuse = 3 } },
        { "linear",
          { .seed = 28,
            .level = 0,
            .n_coarse = 20,
            DRAWN(ALL),
            .no_fuse = 3,
            .linear = 1 } },
        { "hash",
          { .seed = 43,
            .level = 1,
            .n_coarse = 20,
            DRAWN(ALL),
            .no_fuse = 3,
            .linear = 1,
            TABLES(3, 4) } },
        { "hash_level0",
          { .seed = 44,
            .level = 0,
            .n_coarse = 12,
            DRAWN(ALL & ~(uint32_t)SAGA_TOOL_VIEW),
            .no_fuse = 3,
            .linear = 1,
            .base = 1,
            TABLES(1, 5) } },
        { "hash_level2",
          { .seed = 73,
            .level = 2,
            .n_coarse = 12,
            .n_layers = 2,
            TABLES(1, 9) } },
        { "hash_level3",
          { .seed = 47,
            .level = 3,
            .n_coarse = 12,
            .n_segments = 2,
            BANK(GEN_BANK_ORTHOGONAL, 32, 16, 3),
            TABLES(8, 6) } },
        { "names",
          { .seed = 29,
            .level = 0,
            .n_coarse = 6,
            DRAWN(0),
            .no_fuse = 3,
            .named = 1 } },
        { "base",
          { .seed = 29,
            .level = 1,
            .n_coarse = 12,
            DRAWN(ALL),
            .no_fuse = 3,
            .linear = 1,
            .n_segments = 2,
            .base = 1 } },
        { "base_level0",
          { .seed = 30,
            .level = 0,
            .n_coarse = 12,
            DRAWN(ALL & ~(uint32_t)SAGA_TOOL_VIEW),
            .base = 1,
            BANK(GEN_BANK_ORTHOGONAL, 32, 16, 3) } },
        { "base_level3",
          { .seed = 33,
            .level = 3,
            .n_coarse = 12,
            .n_segments = 2,
            .base = 1 } },
        { "base_names",
          { .seed = 34,
            .level = 0,
            .n_coarse = 6,
            DRAWN(0),
            .no_fuse = 3,
            .n_segments = 2,
            .base = 1,
            .named = 1 } },
        { "sound",
          { .seed = 41,
            .level = 0,
            .n_coarse = 6,
            DRAWN(0),
            .no_fuse = 3,
            .n_segments = 2,
            .named = 1,
            .sounds = 1 } },
        { "exposures",
          { .seed = 43,
            .level = 0,
            .n_coarse = 6,
            DRAWN(0),
            .no_fuse = 3,
            .named = 1,
            .exposed = 1,
            .sounds = 1 } },
        { "exposures_base",
          { .seed = 44,
            .level = 0,
            .n_coarse = 6,
            DRAWN(0),
            .no_fuse = 3,
            .base = 1,
            .exposed = 1 } },
        { "whole",
          { .seed = 74,
            .level = 1,
            .n_coarse = 6,
            DRAWN(ALL | SAGA_TOOL_STEEP),
            .n_segments = 2,
            .n_layers = 2,
            .base = 1,
            .named = 1,
            .exposed = 1,
            .sounds = 1,
            BANK(GEN_BANK_ORTHOGONAL, 64, 8, 3),
            TABLES(2, 3) } },
        { "layers",
          { .seed = 35,
            .level = 1,
            .n_coarse = 12,
            DRAWN(ALL),
            .no_fuse = 3,
            .linear = 1,
            .n_segments = 2,
            .n_layers = 2 } },
        { "layers_base",
          { .seed = 36,
            .level = 1,
            .n_coarse = 6,
            DRAWN(ALL),
            .n_segments = 2,
            .n_layers = 3,
            .base = 1,
            BANK(GEN_BANK_ORTHOGONAL, 64, 16, 5) } },
        { "layers_level3",
          { .seed = 37, .level = 3, .n_coarse = 12, .n_layers = 2 } },
        { "layers_level0",
          { .seed = 38,
            .level = 0,
            .n_coarse = 6,
            DRAWN(ALL & ~(uint32_t)SAGA_TOOL_VIEW),
            .no_fuse = 3,
            .n_layers = 3 } },
        { "steep",
          { .seed = 39,
            .level = 1,
            .n_coarse = 20,
            DRAWN(ALL | SAGA_TOOL_STEEP) } },
        { "steep_level0",
          { .seed = 40,
            .level = 0,
            .n_coarse = 20,
            DRAWN(SAGA_TOOL_STEEP),
            .no_fuse = 3,
            .linear = 1 } },
    };
    const gen_options *const three_layers =
        &row[sizeof row / sizeof *row - 3].o;

    if (argc != 2) {
        fprintf(stderr, "usage: make_vectors DIR\n");
        return 2;
    }
    directory = argv[1];
    manifest = begin_list("MANIFEST");
    pictures = begin_list("PICTURES");
    fputs("# Made by tests/make_vectors. Good: file, segment, CRC of the\n"
          "# symbols, final ranges of the three chunks, time, camera, CRCs of\n"
          "# primitives, splats, frame. Bad: file, `status`, the exact one.\n"
          "# Of sound: file, `sound`, the status of finding it.\n",
          manifest);
    fputs("# Made by tests/make_vectors: file, kind of the picture, segment,\n"
          "# time, camera, CRC of its samples.\n",
          pictures);
    for (size_t i = 0; i < sizeof row / sizeof *row; i++)
        good(row[i].stem, row[i].o);
    good_full();
    good_extremes();
    sounds();
    cut_layers(three_layers);
    bad_all();
    bad_scale("scale_below_zero", SAGA_SCALE_ROW);
    bad_scale("column_scale_below_zero", SAGA_SCALE_COLUMN);
    bad_memory();
    bad_base();
    bad_layers(three_layers);
    bad_fuse();
    bad_segments();
    bad_work();
    const bool failed = fclose(manifest) != 0;
    return fclose(pictures) != 0 || failed;
}
