/* SPDX-License-Identifier: MIT
 *
 * The inside of the canvas on a device, shared by gpu_*.c.
 */
#ifndef SAGA_GPU_STATE_H
#define SAGA_GPU_STATE_H

#include "gpu_frame.h"
#include "gpu_rates.h"
#include "gpu_splat.h"
#include "novel.h"

/* Layers of all networks of primitives together, or of a kind of blocks; then
 * those of F_fine. */
enum {
    SAGA_GPU_FINE_LAYER = 10,
    SAGA_GPU_MOST_LAYERS = SAGA_GPU_FINE_LAYER + SAGA_NET_LAYERS
};

/* The buffers on the device. N: primitives, P: room for pairs; other sizes are
 * in kernels/. */
enum {
    GPU_FRAME,
    GPU_TOTAL,
    GPU_VALUE, /* attributes (N), gradients and moments likewise */
    GPU_GRAD,
    GPU_M,
    GPU_V,
    GPU_BACK,   /* attributes of the backdrop */
    GPU_STAT,   /* (N, 3) grad2d, weight, seen */
    GPU_WORTH,  /* (N) */
    GPU_D_Q0,   /* (N) */
    GPU_CARRY,  /* (N, 5) */
    GPU_SIZES,  /* (groups) */
    GPU_SPLAT,  /* (N, 12) */
    GPU_COUNT,  /* (N) tiles */
    GPU_OFFSET, /* (N) */
    GPU_DEPTH,  /* (N) keys and their values, twice each for the sort */
    GPU_DEPTH_2,
    GPU_ORDER,
    GPU_ORDER_2,
    GPU_TILE, /* (P) */
    GPU_TILE_2,
    GPU_SLOT,
    GPU_SLOT_2,
    GPU_OWNER,   /* (P) */
    GPU_RECORD,  /* (P, 10) */
    GPU_DIGITS,  /* (16, blocks) counts of the sort */
    GPU_SUMS,    /* (blocks + 1) of a scan */
    GPU_RANGE,   /* (tiles, 2) */
    GPU_SQUARES, /* (tiles) */
    GPU_TRUTH,   /* a picture */
    GPU_IMAGE,   /* a picture */
    GPU_STORED,  /* a stored picture */
    /* Networks of N primitives; those of the fit (gpu_networks.h). */
    GPU_FEATURE, /* (N, F) of fine anchors */
    GPU_D_FEATURE,
    GPU_PLACE, /* (N, 4) of primitives */
    GPU_D_PLACE,
    GPU_OFFSET4, /* (N, 4) from the fine anchor, in supports */
    GPU_SUPPORT, /* (N, 4) of fine anchors */
    GPU_D_LOG2,  /* (N, 4) of log2 supports */
    GPU_LEVEL,   /* (N, 2) constants of log2 sizes */
    GPU_LIMIT,   /* (N) outputs from which on log2 sizes cost something */
    GPU_PART,    /* (outputs of F_geo, 2) */
    GPU_PARAM,   /* of all layers */
    GPU_D_PARAM,
    GPU_PARTIAL,   /* (slabs, parameters) */
    GPU_NET_IN,    /* (N, inputs of F_geo) */
    GPU_DIRECTION, /* (N, 3) */
    GPU_LAYER,     /* (N, outputs) of each layer, and gradients likewise */
    GPU_D_LAYER = GPU_LAYER + SAGA_GPU_MOST_LAYERS,
    /* The entropy model (gpu_rates.h). */
    GPU_COARSE = GPU_D_LAYER + SAGA_GPU_MOST_LAYERS, /* (N, F) features */
    GPU_D_COARSE,
    GPU_FINE_OFFSET,                       /* (N, 5) as GROUPS reads them */
    GPU_SPAN,                              /* (N) */
    GPU_PHASE,                             /* (N, 4), of each kind */
    GPU_SIZE = GPU_PHASE + SAGA_N_KINDS,   /* (N, 5) */
    GPU_VALUE4 = GPU_SIZE + SAGA_N_KINDS,  /* (N, 4) */
    GPU_SCALE = GPU_VALUE4 + SAGA_N_KINDS, /* (channels, 3) */
    GPU_MU = GPU_SCALE + SAGA_N_KINDS,     /* (N, channels that learn) */
    GPU_LINKS = GPU_MU + SAGA_N_KINDS,     /* of each SAGA_GPU_LINKS_* */
    GPU_READERS = GPU_LINKS + SAGA_GPU_N_LINKS,    /* the other way round */
    GPU_D_OFFSET = GPU_READERS + SAGA_GPU_N_LINKS, /* (N, 4) */
    GPU_HYPER_IN,                                  /* (rows, inputs) */
    GPU_RATE_IN,
    GPU_D_RATE_IN,
    GPU_D_RATE_OUT, /* (rows, 2 channels) */
    GPU_BITS,       /* (rows, channels) */
    /* Anchors that stay on the device (gpu_anchors.h). */
    GPU_FINE_X,     /* (N, 4) */
    GPU_FINE_EMBED, /* (N, 4) which F_fine embeds */
    GPU_FINE_IN,    /* (N, inputs of F_fine) */
    GPU_LOG2,       /* (N, 4) of supports */
    GPU_PRIM,       /* (N, 4) positions, then their moments likewise */
    GPU_SHIFT,      /* (N, 4) of positions by noise or rounding */
    GPU_N_BUFFERS
};

/* Stored pictures on the device. */
typedef struct saga_gpu_cache {
    saga_gpu_buffer *chunk; /* (n_chunks) of equal size */
    int n_chunks;
    size_t each, per_chunk; /* bytes of a slot, slots of a chunk */
    uint32_t n_slots;       /* that there may be */
    uint32_t n_used, next;  /* slots in use; the one that is replaced next */
    uint32_t *slot_of;      /* (views, frames) 1 + slot, or 0 */
    uint32_t *unseen;       /* (views, frames, sizes) 1 + pixels that do not
                             * count, or 0 if they were not counted */
    uint32_t *picture_in;   /* (n_slots) its picture */
} saga_gpu_cache;

struct saga_gpu_canvas {
    saga_gpu *gpu;
    const saga_pictures *pictures;
    saga_gpu_frame frame;
    saga_gpu_buffer on[GPU_N_BUFFERS]; /* the device */
    saga_gpu_buffer up_frame, up, up_back, up_picture, down;
    const saga_gpu_buffer *from; /* attributes for the next pass, */
    size_t n_from;               /* and their bytes; 0: they are there */
    uint32_t most_pairs;
    uint32_t n_set;                               /* primitives that were put */
    uint32_t attrs;                               /* and their attributes */
    uint32_t n_linked, n_links[SAGA_GPU_N_LINKS]; /* blocks; links of a set */
    saga_gpu_cache cache;
    saga_gpu_canvas *teachers; /* draws their pictures; NULL: none so far */
    saga_gpu_buffer teacher[SAGA_NOVEL_MOST_TEACHERS]; /* there: attributes */
    /* The truth of the next picture. */
    bool is_stored; /* of stored bytes; else it is in GPU_TRUTH */
    bool is_new;    /* the bytes are in up_picture, for the slot */
    uint32_t slot;
};

/* gpu_room.c */
/* Makes buffer b at least nbytes large; if it grows, its content is lost. */
bool saga_gpu_room(saga_gpu_canvas *g, int b, size_t nbytes, const char *what,
                   saga_error *error);
/* The same for a table: buffers from `first` to `last` with n words each. */
typedef struct saga_gpu_need {
    int first, last;
    size_t n;
} saga_gpu_need;
bool saga_gpu_rooms(saga_gpu_canvas *g, const saga_gpu_need *table, size_t n,
                    const char *what, saga_error *error);
#define SAGA_GPU_ROOMS(g, table, what, error) \
    saga_gpu_rooms(g, table, sizeof(table) / sizeof *(table), what, error)
/* Records that n words become 0. */
void saga_gpu_clear(saga_gpu_canvas *g, int buffer, size_t n);
/* Records a kernel, with n_push words of push constants or none; the list of
 * buffers ends with -1. */
void saga_gpu_do_with(saga_gpu_canvas *g, int kernel, size_t n_groups,
                      const int *buffers, const uint32_t *push, size_t n_push);
void saga_gpu_do(saga_gpu_canvas *g, int kernel, size_t n_groups,
                 const int *buffers);

/* gpu_pictures.c: makes the cache; has a stored picture as the truth of the
 * next pass; and records the commands that set GPU_TRUTH. */
bool saga_gpu_begin_pictures(saga_gpu_canvas *g, saga_error *error);
void saga_gpu_end_pictures(saga_gpu_canvas *g);
bool saga_gpu_show_stored(saga_gpu_canvas *g, saga_canvas *canvas,
                          saga_sample sample, saga_error *error);
void saga_gpu_record_truth(saga_gpu_canvas *g);

/* gpu_splat.c: a pass. */
/* Sets the frame for a pass over n primitives with these attributes. */
void saga_gpu_set_frame(saga_gpu_canvas *g, const saga_canvas *c,
                        uint32_t attrs, uint32_t n);

/* A pass with the frame that is set is a list of commands, which runs again
 * with more room if that was short for the pairs of splats and tiles:
 *
 *     saga_gpu_pass p = { .canvas = c };
 *
 *     while (saga_gpu_begin_pass(&p, g, error)) {
 *         saga_gpu_record_lists(g);
 *         ...
 *         saga_gpu_end_pass(&p, g, error);
 *     }
 *
 * Then is_done tells whether it succeeded; else *error is set. `down` has the
 * totals at its begin. If room is short, the word SAGA_GPU_IS_FULL of GPU_TOTAL
 * is 1 after saga_gpu_record_lists, and gradients of attributes are not set. */
typedef struct saga_gpu_pass {
    const saga_canvas *canvas;
    int n_runs; /* that have begun */
    bool is_over, is_done;
} saga_gpu_pass;

bool saga_gpu_begin_pass(saga_gpu_pass *p, saga_gpu_canvas *g,
                         saga_error *error);
void saga_gpu_end_pass(saga_gpu_pass *p, saga_gpu_canvas *g, saga_error *error);

/* Makes room for a pass, with many pairs, for a plan. */
bool saga_gpu_pass_room(saga_gpu_canvas *g, const saga_canvas *c,
                        uint32_t attrs, uint32_t n, saga_error *error);
void saga_gpu_record_lists(saga_gpu_canvas *g);
void saga_gpu_record_tiles(saga_gpu_canvas *g);
void saga_gpu_record_back(saga_gpu_canvas *g);
/* n_sizes: work groups that have left sums of sizes, or 0. */
void saga_gpu_record_sums(saga_gpu_canvas *g, uint32_t n_sizes);
/* Copies n primitives of the host into one block. */
void saga_gpu_pack(real *block, const saga_splat_params *p, size_t n);

/* What a pass has left in `down`: the mean squared error of the picture, and
 * what is behind the totals. */
double saga_gpu_mse(const saga_gpu_canvas *g, const saga_canvas *c);
const real *saga_gpu_after_totals(const saga_gpu_canvas *g);

static inline size_t saga_gpu_groups(size_t n)
{
    return (n + SAGA_GPU_THREADS - 1) / SAGA_GPU_THREADS;
}

static inline float saga_gpu_float(uint32_t bits)
{
    union {
        uint32_t bits;
        float value;
    } u = { bits };

    return u.value;
}

#endif
