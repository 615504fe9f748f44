/* SPDX-License-Identifier: MIT
 *
 * Damaged streams, and a harness that plays them and reports how far they got.
 * Damaged streams may be signed, that is get new lengths, index and CRCs, so
 * that they pass the first checks. They may also be repaired, that is get
 * counts and lengths that fit the damaged bytes, so that they reach
 * reconstruction and drawing.
 */
#ifndef GEN_MUTATE_H
#define GEN_MUTATE_H

#include "gen_stream.h"
#include "saga.h"

#include <stddef.h>
#include <stdint.h>

/* Returns p, or ends the program if memory is short. */
void *mutate_must(void *p);

/* --- A file in pieces ---------------------------------------------------- */

enum { MUTATE_PARTS = 5 + (1 + 3 * GEN_MAX_LAYERS) * GEN_MAX_SEGMENTS };

/* The payload of a chunk. */
typedef struct mutate_part {
    uint32_t type;
    uint8_t *p;
    size_t n;
} mutate_part;

/* A header and the chunks: index, networks, COAR FINE PRIM of the base if there
 * is one, and for each segment SEGM and for each layer COAR FINE PRIM. */
typedef struct mutate_file {
    uint8_t *header;
    size_t header_nbytes;
    mutate_part part[MUTATE_PARTS];
    uint32_t n_parts;
    uint32_t segments; /* index of the first segment's SEGM: 2 or 5 */
    uint32_t n_layers; /* layers of each segment */
} mutate_file;

/* Splits a valid file with at most GEN_MAX_SEGMENTS segments into its parts,
 * which mutate_free frees. */
void mutate_split(mutate_file *f, const uint8_t *bytes, size_t n);
void mutate_free(mutate_file *f);

/* Returns the bytes, which the caller frees. They are signed: the lengths of
 * chunks, networks, base and layers, the index and all CRCs fit the parts. */
uint8_t *mutate_join(const mutate_file *f, size_t *n);

/* Computes the CRCs of the header and of all chunks anew, as far as the lengths
 * in the bytes are plausible. */
void mutate_sign(uint8_t *bytes, size_t n);

/* Computes the CRC of the chunk at p[0..n) anew, which continues that of its
 * owner. Returns the chunk's length with its header, or 0 if n is less. */
size_t mutate_sign_chunk(uint8_t *p, size_t n, uint32_t owner);

/* --- Damage -------------------------------------------------------------- */

typedef enum mutate_class {
    MUTATE_RAW,        /* any bytes are changed; not signed */
    MUTATE_RAW_SIGNED, /* any bytes are changed, then CRCs computed */
    MUTATE_IN_HEADER,  /* fields of the header, signed */
    MUTATE_IN_INDEX,
    MUTATE_IN_NETWORKS,
    MUTATE_IN_BASE,   /* any chunk of the base; without base the networks
                       */
    MUTATE_IN_COUNTS, /* segment header */
    MUTATE_IN_COARSE,
    MUTATE_IN_FINE,
    MUTATE_IN_PRIM,
    MUTATE_IN_ORDER, /* chunks swapped, dropped, doubled, renamed */
    MUTATE_N_CLASSES
} mutate_class;

/* Makes networks whose outputs lie at their limits but are valid. */
void mutate_extreme_nets(gen_stream *g, uint64_t *r);

/* Returns a damaged copy of a valid file, which the caller frees. */
uint8_t *mutate_make(const uint8_t *bytes, size_t n, mutate_class c,
                     uint64_t *r, size_t *n_out);

/* --- Playing ------------------------------------------------------------- */

/* The first stage that refused the stream. */
typedef enum mutate_stage {
    MUTATE_AT_HEADER,
    MUTATE_AT_SIZE, /* valid, but the harness declines its size */
    MUTATE_AT_INDEX,
    MUTATE_AT_NETWORKS, /* the networks or the base */
    MUTATE_AT_SEGMENT,  /* any chunk of a segment */
    MUTATE_AT_VIEW,     /* reconstruction succeeds; the rig's camera is
                         * refused */
    MUTATE_DRAWN,
    MUTATE_N_STAGES
} mutate_stage;

extern const char *const mutate_stage_text[MUTATE_N_STAGES];

typedef struct mutate_result {
    mutate_stage stage;  /* the earliest of all segments */
    saga_status status;  /* status at that stage */
    const char *broken;  /* a broken promise of saga.h, or NULL */
    size_t head_nbytes;  /* bytes of a head that saga_open and saga_find
                          * accept, or 0 */
    uint32_t crc;        /* CRC of all pictures and statuses, the same on
                          * every machine */
    uint32_t n_segments; /* number of decoded segments */
    struct {
        uint64_t offset;
        uint32_t nbytes;
    } segment[GEN_MAX_SEGMENTS];
} mutate_result;

/* Plays a file as a careful player would, with every input in a copy of its
 * exact size: at most GEN_MAX_SEGMENTS segments, with two views and two small
 * pictures of each. Cameras, times, tiles and budgets come from r. */
void mutate_play(mutate_result *result, const uint8_t *bytes, size_t n,
                 uint64_t *r);

/* Looks at a segment that dec has decoded, as mutate_play does: asks for all of
 * its primitives and draws two views. bytes[0..n): the head, which *info
 * describes. Of *result it changes broken, stage, status and crc. */
void mutate_look(mutate_result *result, saga_decoder *dec,
                 const saga_info *info, const uint8_t *bytes, size_t n,
                 uint64_t *r);

#endif
