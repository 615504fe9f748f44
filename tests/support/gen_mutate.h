/* SPDX-License-Identifier: MIT
 *
 * Damaged streams, and a harness that plays them and tells how far they got.
 * Damage may be signed anew (lengths, index, CRCs), so that it gets past the
 * checks in front, and repaired (counts and lengths of a segment made to fit
 * what its bytes now say), so that it reaches reconstruction and drawing.
 */
#ifndef GEN_MUTATE_H
#define GEN_MUTATE_H

#include "gen_stream.h"
#include "saga.h"

#include <stddef.h>
#include <stdint.h>

/* --- A file in pieces ---------------------------------------------------- */

enum { MUTATE_PARTS = 5 + (1 + 3 * GEN_MAX_LAYERS) * GEN_MAX_SEGMENTS };

/* Payload of a chunk. */
typedef struct mutate_part {
    uint32_t type;
    uint8_t *p;
    size_t n;
} mutate_part;

/* Header, then chunks: index, networks, those of the base if there is one, per
 * segment SEGM and per layer COAR FINE PRIM. */
typedef struct mutate_file {
    uint8_t *header;
    size_t header_nbytes;
    mutate_part part[MUTATE_PARTS];
    uint32_t n_parts;
    uint32_t segments;       /* where those of segments begin: 2, or 5 */
    uint32_t n_layers;       /* of each segment */
} mutate_file;

/* Pieces of a valid file of at most GEN_MAX_SEGMENTS segments; free them. */
void mutate_split(mutate_file *f, const uint8_t *bytes, size_t n);
void mutate_free(mutate_file *f);

/* The bytes (free them), signed: chunk lengths, index, nets_nbytes, those of
 * the base and of layers and all CRCs are those of what is there. */
uint8_t *mutate_join(const mutate_file *f, size_t *n);

/* Writes the CRCs of the header and of all chunks anew, as far as the lengths
 * in the bytes lead. */
void mutate_sign(uint8_t *bytes, size_t n);

/* --- Damage -------------------------------------------------------------- */

typedef enum mutate_class {
    MUTATE_RAW,              /* bytes anywhere, not signed */
    MUTATE_RAW_SIGNED,       /* bytes anywhere, CRCs signed */
    MUTATE_IN_HEADER,        /* fields, signed */
    MUTATE_IN_INDEX,
    MUTATE_IN_NETWORKS,
    MUTATE_IN_BASE,          /* any of its chunks; without one the networks */
    MUTATE_IN_COUNTS,        /* segment header */
    MUTATE_IN_COARSE,
    MUTATE_IN_FINE,
    MUTATE_IN_PRIM,
    MUTATE_IN_ORDER,         /* chunks swapped, dropped, doubled, renamed */
    MUTATE_N_CLASSES
} mutate_class;

extern const char *const mutate_class_text[MUTATE_N_CLASSES];

/* Networks whose outputs lie at the limits, still valid: to be encoded. */
void mutate_extreme_nets(gen_stream *g, uint64_t *r);

/* A damaged copy of a valid file (free it). */
uint8_t *mutate_make(const uint8_t *bytes, size_t n, mutate_class c,
                     uint64_t *r, size_t *n_out);

/* --- Playing ------------------------------------------------------------- */

/* The first stage that refused the stream. */
typedef enum mutate_stage {
    MUTATE_AT_HEADER,
    MUTATE_AT_SIZE,          /* valid, but the harness declines its size */
    MUTATE_AT_INDEX,
    MUTATE_AT_NETWORKS,      /* or the base */
    MUTATE_AT_SEGMENT,       /* segment header, or a chunk's CRC or length */
    MUTATE_AT_TREE,
    MUTATE_AT_COARSE,
    MUTATE_AT_FINE,
    MUTATE_AT_PRIM,
    MUTATE_AT_VIEW,          /* reconstructed; the rig's camera is refused */
    MUTATE_DRAWN,
    MUTATE_N_STAGES
} mutate_stage;

extern const char *const mutate_stage_text[MUTATE_N_STAGES];

typedef struct mutate_result {
    mutate_stage stage;      /* the least of all segments */
    saga_status status;      /* that of the stage */
    const char *broken;      /* a promise of saga.h not kept, or NULL */
    size_t head_nbytes;      /* that open and find both accepted, or 0 */
    uint32_t crc;            /* of all pictures and statuses: the same on every
                              * machine */
    uint32_t n_segments;     /* that decoded */
    struct {
        uint64_t offset;
        uint32_t nbytes;
    } segment[GEN_MAX_SEGMENTS];
} mutate_result;

/* Plays a file as a careful player would, every input in an exact copy: all
 * segments up to GEN_MAX_SEGMENTS, two views each, two small pictures. r: for
 * cameras, times, tiles and budgets. */
void mutate_play(mutate_result *result, const uint8_t *bytes, size_t n,
                 uint64_t *r);

#endif
