/* SPDX-License-Identifier: MIT
 *
 * saga: decoder for volumetric video. The only public header.
 *
 * Conventions
 *
 * - The decoder allocates nothing, keeps no global state, uses no floating
 *   point and needs no C library (mem* at most). All its memory is one block
 *   of the caller's, whose size saga_probe tells from the file's header.
 * - The same bytes and the same camera give the same pixels on every machine.
 * - Pointers must not be NULL unless said otherwise. Functions keep no pointer
 *   to input bytes or pictures after they return.
 * - A saga_decoder may be moved or copied with memcpy to another block of the
 *   same size and alignment: it holds offsets, no pointers.
 * - Threads: one decoder must not be changed by two threads at once. After
 *   saga_view, any number of threads may call saga_draw on the same decoder,
 *   each with its own saga_job.
 * - C++ may include this header: its functions have C linkage.
 * - Input is not trusted: whatever the bytes, every function returns, never
 *   reads or writes outside what it was given, and its loops are bounded by
 *   counts checked against the header. A file's level bounds the time that
 *   they take.
 * - Stack: at most 4 KiB below any of these functions; what a saga_watch calls
 *   comes on top.
 * - Units: positions are box units, the cube of a segment is [-2^23, 2^23) on
 *   each axis; times are 1/65536 of a segment.
 */
#ifndef SAGA_H
#define SAGA_H

#include <stddef.h>
#include <stdint.h>

/* The version of this library and of the programs that come with it. A file
 * has a version of its own (saga_info). */
#define SAGA_RELEASE "0.1.0"

#ifdef __cplusplus
extern "C" {
#endif

typedef enum saga_status {
    SAGA_OK = 0,
    SAGA_AGAIN = 1,          /* work left: call again with the same job */
    SAGA_ERR_ARG = -1,       /* an argument is out of its range */
    SAGA_ERR_SPACE = -2,     /* a buffer is too small */
    SAGA_ERR_ALIGN = -3,     /* a buffer is misaligned */
    SAGA_ERR_DATA = -10,     /* the bytes are not a valid stream */
    SAGA_ERR_TRUNCATED = -11,/* more bytes are needed */
    SAGA_ERR_VERSION = -12,  /* needs a newer decoder */
    SAGA_ERR_LEVEL = -13,    /* exceeds its declared level, or this build's */
    SAGA_ERR_STATE = -20,    /* nothing decoded, no view, or the job began with
                              * another view or first block */
    SAGA_ERR_STOPPED = -21   /* the caller's watch had enough of it */
} saga_status;

/* A pinhole camera; x right, y down, z forward. Integers only, since the bits
 * of every picture depend on it: the host rounds, files store the rounded one.
 */
typedef struct saga_camera {
    int32_t rotation_q30[9]; /* rows: camera axes in box axes; for each row
                              * sum |r| <= 1.7321 * 2^30 */
    int32_t centre[3];       /* box units, |c| <= 2^29 */
    int32_t focal_q16[2];    /* pixels, > 0 */
    int32_t principal_q16[2];/* pixels; (0, 0) is the corner of the picture,
                              * |p| <= 2^30 */
    int32_t near_plane;      /* box units, >= 1 */
    uint16_t width, height;  /* pixels, 1..16384 */
    uint16_t background_q15[3]; /* R, G, B, 0..32768 */
} saga_camera;

/* A primitive at one time in one camera (norm: docs/arithmetic.md). */
typedef struct saga_splat {
    int32_t mean_q8[2];      /* pixels */
    int32_t chol_q28[3];     /* g, n, h: factor of the conic in log2 units; how
                              * it falls off, bit 6 of the tools says */
    int32_t q0_q20;          /* 3 - log2 of the peak opacity, [0, 11) */
    uint32_t depth;          /* z in box units, >= 1 */
    uint16_t colour_q15[3];  /* R, G, B, 0..32768 */
    int16_t x0, y0, x1, y1;  /* pixels touched lie in [x0, x1) x [y0, y1) */
} saga_splat;

/* Where a picture goes: rows of R, G, B samples of 8 or 16 bits, or of
 * saga_depth. */
typedef struct saga_picture {
    void *rgb;               /* first sample of the job's pixel (x0, y0);
                              * uint8_t, uint16_t (aligned to 2) or saga_depth
                              * (aligned to 8) */
    size_t stride_nbytes;    /* from one row to the next; a multiple of 2 for
                              * 16 bits, of 8 for SAGA_DEPTH */
    size_t nbytes;           /* capacity from rgb on */
    int bits;                /* 8, 16 or SAGA_DEPTH */
} saga_picture;

enum { SAGA_DEPTH = 64 };    /* in place of bits: no colours, but saga_depth */

/* How far away a pixel is, and how opaque. The splats that its colour is mixed
 * of have weights w, front to back, and means whose depth along the camera's
 * axis is z: sum_q16 / weight_q16 is the expected depth. Nothing stands for the
 * background. */
typedef struct saga_depth {
    uint64_t sum_q16;        /* of w z, z in box units, >= 1; below 2^48 */
    uint32_t weight_q16;     /* of w: alpha, 0..65536; 0: no splat is there */
    uint32_t reserved;       /* written as 0 */
} saga_depth;

/* A rectangle of the picture to be drawn by one thread, and its progress.
 * Set the first block, zero the second, call saga_draw until it returns
 * something other than SAGA_AGAIN. A job remembers the view, the first block
 * and the picture's bits with which it began, and is refused with others: zero
 * the second block again for those. The bytes of the scratch stay as they are
 * until it ends. */
typedef struct saga_job {
    int32_t x0, y0, x1, y1;  /* inside the camera's picture, not empty */
    int32_t tile;            /* side of a tile in pixels: 8, 16, 32 or 64; has
                              * no effect on the pixels */
    uint32_t list_capacity;  /* entries of the splat list, >= 1; no effect on
                              * the pixels */
    void *scratch;           /* aligned to 4, of at least
                              * SAGA_JOB_NBYTES(tile, list_capacity) bytes */
    size_t scratch_nbytes;   /* more lets a band of several tiles share one
                              * pass over the splats */

    uint32_t cursor[4];      /* internal: progress, what it began with; zero at
                              * the start */
} saga_job;

/* Bytes of scratch the smallest band (one tile) needs. */
#define SAGA_JOB_NBYTES(tile, list_capacity) \
    ((size_t)(tile) * (size_t)(tile) * 16u + (size_t)(list_capacity) * 8u + \
     264u)

/* --- Files ----------------------------------------------------------------
 *
 * A file begins with its head (header, index, networks, and the base: what
 * stands still in all of it, if the file has one); then come segments. To show
 * one picture a player needs the head and one segment:
 *
 *     saga_probe(&info, bytes, n);             how much memory, how many bytes
 *     saga_open(&dec, work, info.work_nbytes, bytes, info.head_nbytes, NULL);
 *     saga_find(&seg, bytes, info.head_nbytes, frame, 1);
 *     saga_decode(dec, &seg, bytes + seg.offset, seg.nbytes, NULL);
 *     saga_view(dec, &camera, seg.t);
 *     while (saga_draw(dec, &job, &picture, budget) == SAGA_AGAIN) ;
 */

enum { SAGA_WORK_ALIGN = 16 };

/* Largest work_nbytes of a level 0..3: for static arrays. */
#define SAGA_WORK_MAX(level) \
    ((level) == 0 ? 256ul << 10 : (level) == 1 ? 4ul << 20 : \
     (level) == 2 ? 32ul << 20 : 1ul << 30)

/* The boxes of a view's splats cover the picture this many times at most, one
 * of less than 65,536 pixels as if it had as many. */
#define SAGA_COVER_MAX(level) \
    ((level) == 0 ? 512u : (level) == 1 ? 1024u : (level) == 2 ? 4096u : 16384u)

typedef struct saga_info {
    uint32_t version, level;
    size_t work_nbytes;      /* of the block saga_open needs, exactly */
    size_t head_nbytes;      /* header, index, networks, base: the file's
                              * start */
    uint32_t n_segments, n_frames;
    uint32_t fps_num, fps_den; /* frames per second */
    uint32_t n_cameras;      /* of the rig */
    uint32_t n_layers;       /* of each segment, 1..8 */
    uint32_t max_coarse, max_fine; /* of any layer */
    uint32_t max_primitives; /* of any segment, all layers together */
    uint32_t base_coarse, base_fine, base_primitives; /* of the base; 0 without
                              * one */
    uint32_t base_nbytes;    /* of the head's */
    uint32_t n_weights;      /* of all networks */
    uint32_t nets_nbytes;    /* coded size of the networks */
    uint32_t tools;          /* as in the header, docs/bitstream.md */
    uint32_t motion_order;   /* 0..3 */
    uint32_t features;
    uint64_t decode_macs;    /* multiply-accumulates of networks and bank to
                              * decode a segment of the maximal counts; the
                              * most there can be, with a bank or layers */
    uint64_t base_macs;      /* the same for the base, in saga_open */
    uint64_t work;           /* what the level bounds of both together: as many,
                              * and 4,096 for each run of a network on a point
                              */
    uint32_t view_macs;      /* the same per visible primitive and view */
    /* world = centre + box units * unit, in the capture's unit of length, of
     * which saga_naming may tell the metres: metres = world * metre. Each value
     * is mantissa * 2^exponent */
    int32_t unit_mantissa, unit_exponent;
    int32_t centre_mantissa[3], centre_exponent;
} saga_info;

/* A header says this, before anything is done.
 * bytes[0..n): the file's start, n any size. How many bytes lie behind what a
 * function needs makes no difference, here and below.
 * SAGA_OK; TRUNCATED: the header is longer than n; DATA, VERSION, LEVEL. A
 * file of a newer version, or with a tool that this library does not know, is
 * VERSION before its checksum is looked at. On an error *info is undefined. */
saga_status saga_probe(saga_info *info, const uint8_t *bytes, size_t n);

typedef struct saga_decoder saga_decoder;

/* Who waits for saga_open or saga_decode is asked whether to stop: at the
 * beginning, then after about a million multiply-accumulates each time or what
 * takes as long, well below a millisecond on a desktop. The answer may depend
 * on anything, such as a clock; the function must not use the decoder. */
typedef struct saga_watch {
    int (*stop)(void *user); /* not 0: stop */
    void *user;              /* what it is given */
} saga_watch;

/* Starts a decoder in work[0..work_nbytes), aligned to SAGA_WORK_ALIGN, from
 * the file's head, whose base it decodes. *dec points into work, which belongs
 * to the decoder until the caller takes it back; there is nothing to close.
 * watch: may stop it; NULL: nobody does.
 * SAGA_OK; SPACE, ALIGN; TRUNCATED: n < info.head_nbytes; DATA, VERSION,
 * LEVEL; STOPPED. On an error *dec is NULL. */
saga_status saga_open(saga_decoder **dec, void *work, size_t work_nbytes,
                      const uint8_t *head, size_t n, const saga_watch *watch);

typedef struct saga_segment {
    uint32_t number;         /* 0.. */
    uint32_t first_frame, n_frames;
    uint64_t offset;         /* of its bytes in the file */
    uint32_t nbytes;
    int32_t t;               /* of the wanted time in it, 0..65535 */
} saga_segment;

/* The segment that shows time frame_num / frame_den, counted in frames from
 * the file's start, and where its bytes are. head as for saga_open.
 * SAGA_OK; ARG: frame_den is 0 or the time lies past the end; else as
 * saga_open. */
saga_status saga_find(saga_segment *seg, const uint8_t *head, size_t n,
                      uint32_t frame_num, uint32_t frame_den);

/* Camera `index` of the capture rig, 0..info.n_cameras-1, and the number the
 * capture gives it. head[0..n): the file's start, of which the header is
 * needed. SAGA_OK; ARG; else as saga_probe. */
saga_status saga_rig(saga_camera *camera, uint32_t *number,
                     const uint8_t *head, size_t n, uint32_t index);

enum { SAGA_MAX_NAME = 63 }; /* bytes, without the 0 at the end */

typedef struct saga_naming {
    char name[SAGA_MAX_NAME + 1]; /* UTF-8, which is checked, 0 at the end; no
                              * control characters; may be empty */
    int32_t metre_mantissa, metre_exponent; /* metres that the capture's unit
                              * of length has: mantissa * 2^exponent; mantissa
                              * 0: unknown */
} saga_naming;

/* Tells the capture's name of camera `index` of the rig, and its unit of
 * length. bytes[0..n): the file's start; a chunk of names lies right behind
 * the head, and the first segment behind that.
 * SAGA_OK; ARG: there is no such camera, or the file has no names; TRUNCATED:
 * more bytes are needed; DATA; else as saga_probe. */
saga_status saga_name_camera(saga_naming *naming, const uint8_t *bytes,
                             size_t n, uint32_t index);

/* Decodes a segment's bytes[0..n) into primitives, in place of an earlier
 * one. segment: as saga_find gave it; its number and frames must be those that
 * the bytes tell, so that one segment does not pass for another. Bytes of
 * another file are refused as well: their checksums go on from its networks'.
 * A segment of several layers may be cut: those that are whole in the bytes are
 * decoded, and saga_tell says how many; the first one must be there.
 * watch: may stop it; NULL: nobody does.
 * SAGA_OK; TRUNCATED, DATA, STOPPED: no segment is decoded then. The decoder is
 * as good as before: it may decode the same segment again, or another one. */
saga_status saga_decode(saga_decoder *dec, const saga_segment *segment,
                        const uint8_t *bytes, size_t n,
                        const saga_watch *watch);

/* This number of bytes at the start of a segment tells of all its layers. */
enum { SAGA_LAYERS_NBYTES = 152 };

typedef struct saga_layer_report {
    uint32_t n_coarse, n_fine, n_primitives;
    uint32_t end;            /* number of bytes of the segment that hold it
                              * and the layers before it: where a player may
                              * stop */
} saga_layer_report;

/* Tells the counts of layer `index` of a segment, 0..info.n_layers-1, and
 * where it ends. segment: as saga_find gave it; bytes[0..n): its beginning.
 * SAGA_OK; ARG: there is no such layer; TRUNCATED: more bytes are needed, at
 * most SAGA_LAYERS_NBYTES; DATA. */
saga_status saga_find_layer(saga_layer_report *layer, const saga_decoder *dec,
                            const saga_segment *segment, const uint8_t *bytes,
                            size_t n, uint32_t index);

/* Prepares a picture: primitives at time t (0..65535) as sorted splats in the
 * camera. It ends the jobs of the view before.
 * SAGA_OK; ARG: t or a field of the camera, the view before stays; STATE: no
 * segment; LEVEL: the boxes of its splats cover more than the level allows,
 * SAGA_COVER_MAX, and there is no view then. */
saga_status saga_view(saga_decoder *dec, const saga_camera *camera,
                      int32_t t);

/* Draws some of a job: see saga_job. budget >= 1 bounds the work of the call:
 * one unit is a splat looked at or a row of a splat in a tile blended.
 * SAGA_OK: finished; SAGA_AGAIN: budget spent, call again; ARG, SPACE, ALIGN:
 * job, picture or budget; STATE: no view, or the job began with another one, or
 * with another first block or other bits, and must begin anew. Pixels outside
 * the job's rectangle are not touched; those inside are written when final. */
saga_status saga_draw(const saga_decoder *dec, saga_job *job,
                      const saga_picture *picture, uint32_t budget);

/* A sentence for a status; "unknown status" for other values. */
const char *saga_status_text(saga_status status);

/* CRC-32C of p[0..n), continuing crc (0 at the start). A picture's is over its
 * 8-bit R, G, B bytes, rows from the top, without what lies between rows. */
uint32_t saga_crc32c(uint32_t crc, const uint8_t *p, size_t n);

/* --- Taps: for vectors, export and references ---------------------------- */

typedef struct saga_report {
    uint32_t n_layers;       /* that are decoded */
    uint32_t n_coarse, n_fine; /* of these, all together */
    uint32_t n_primitives;   /* of base and layers: those of the base have the
                              * first numbers, then layer by layer */
    uint32_t final_range[3]; /* of the coder after each chunk of the last */
    uint32_t n_splats;       /* of the last view; 0 without one */
    uint64_t box_pixels;     /* pixels of the splats' boxes, added up: what a
                              * picture of the view costs at most. Of the last
                              * view that was asked for, also of one that costs
                              * too much; 0 before the first one */
} saga_report;

/* SAGA_OK, or STATE without a segment. */
saga_status saga_tell(saga_report *report, const saga_decoder *dec);

/* A primitive at one time. */
typedef struct saga_animated {
    int32_t x[3];            /* mean, box units, saturated at +-2^29 */
    int32_t quat[4];         /* w, x, y, z; not normalised; all 0: identity */
    int32_t log2_scale_q10[3]; /* standard deviations, log2 of box units */
    int32_t q0_q20;          /* 3 - log2 of opacity times temporal opacity,
                              * which may exceed 1; 11 and more is invisible */
} saga_animated;

/* Primitive `index` at time t (0..65535). SAGA_OK, ARG, STATE. */
saga_status saga_primitive_at(saga_animated *out, const saga_decoder *dec,
                              uint32_t index, int32_t t);

/* The colour that primitive `index` has for a camera at `from`: box units,
 * |from| <= 2^29. It changes nothing but working memory, so the view stays; no
 * other thread may use the decoder meanwhile. SAGA_OK, ARG, STATE. */
saga_status saga_colour_at(uint16_t colour_q15[3], saga_decoder *dec,
                           uint32_t index, const int32_t from[3]);

/* Splat number `order` of the last view in drawing order, nearest first.
 * SAGA_OK, ARG, STATE. */
saga_status saga_splat_at(saga_splat *out, const saga_decoder *dec,
                          uint32_t order);

/* Splats first..first+n-1 of the last view in drawing order at out[0..n), which
 * has room for n: what a graphics processor needs for the picture, in the
 * caller's buffer. saga_tell says how many there are.
 *
 * A splat has 44 bytes, in the machine's order: mean_q8 at 0, chol_q28 at 8,
 * q0_q20 at 20, depth at 24, colour_q15 at 28, the box at 34, padding at 42. So
 * the array is a vertex buffer of integers as it is. In floats, a pixel whose
 * centre is dx, dy away from the mean has
 *
 *     v = g dx - n dy,  w = h dy,  s = v^2 + w^2
 *     q = q0 + s, or q0 + s + s^2 / 2 where info.tools has bit 6
 *     alpha = min(2^(3 - q), 0.99) where q < 11, else 0
 *
 * and is mixed front to back, C += T alpha colour, T *= 1 - alpha, from T = 1
 * on; the background comes last, C += T background. Blending in 16-bit floats
 * gives 50 dB and more beside saga_draw.
 * SAGA_OK; ARG: there are fewer; STATE: no view. On an error nothing is
 * written. */
saga_status saga_splats_at(saga_splat *out, const saga_decoder *dec,
                           uint32_t first, uint32_t n);

#ifdef __cplusplus
}
#endif

#endif
