/* SPDX-License-Identifier: MIT
 *
 * saga: decoder for volumetric video. The only public header.
 *
 * Conventions
 *
 * - The decoder allocates nothing, has no global state, uses no floating point
 *   and needs nothing of the C library except mem*. All its memory is one block
 *   that the caller provides; saga_probe computes its size from the header.
 * - The same bytes and the same camera give the same pixels on every machine.
 * - Pointers must not be NULL unless a function allows it. No function keeps a
 *   pointer to input bytes or pictures after it returns.
 * - A saga_decoder may be moved or copied with memcpy to another block of the
 *   same size and alignment, because it holds offsets and no pointers.
 * - Threads: two threads must not change one decoder at the same time. After
 *   saga_view, any number of threads may call saga_draw on the same decoder,
 *   each with its own saga_job.
 * - C++ may include this header: its functions have C linkage.
 * - Input is not trusted. For any bytes, every function returns, and it never
 *   reads or writes outside the memory that it was given. Loops are bounded by
 *   counts that were checked against the header, and the level of a file bounds
 *   the time that they take.
 * - Bytes may change while a function reads them, as those of a mapped file
 *   may: the above still holds, although what the function returns is then
 *   undefined. saga_open copies the header and checks the copy; saga_decode and
 *   saga_find check the fields that they have read.
 * - Stack: each function uses at most 4 KiB, not counting the function that a
 *   saga_watch calls.
 * - Units: positions are in box units, in which the cube of a segment is
 *   [-2^23, 2^23) on each axis; times are in 1/65536 of a segment.
 */
#ifndef SAGA_H
#define SAGA_H

#include <stddef.h>
#include <stdint.h>

/* The version of this library and of its programs, and that of the format of
 * files, of which a file has the number before the point (saga_info). Format
 * 1.0 is frozen: what a file shows does not change with the library
 * (docs/bitstream.md, section 16). */
#define SAGA_RELEASE "0.1.0"
#define SAGA_FORMAT "1.0"

#ifdef __cplusplus
extern "C" {
#endif

typedef enum saga_status {
    SAGA_OK = 0,
    SAGA_AGAIN = 1,           /* not finished: call again with the same job */
    SAGA_ERR_ARG = -1,        /* an argument is out of its range */
    SAGA_ERR_SPACE = -2,      /* a buffer is too small */
    SAGA_ERR_ALIGN = -3,      /* a buffer is misaligned */
    SAGA_ERR_DATA = -10,      /* the bytes are not a valid stream */
    SAGA_ERR_TRUNCATED = -11, /* more bytes are needed */
    SAGA_ERR_VERSION = -12,   /* the file needs a newer decoder */
    SAGA_ERR_LEVEL = -13,     /* the file exceeds its level, or this build's */
    SAGA_ERR_STATE = -20,  /* there is no segment or no view, or the job began
                            * with another view or first block */
    SAGA_ERR_STOPPED = -21 /* the caller's watch stopped it */
} saga_status;

/* A pinhole camera with x right, y down, z forward. All fields are integers,
 * because the bits of every picture depend on them; the caller rounds, and
 * files store rounded cameras. */
typedef struct saga_camera {
    int32_t rotation_q30[9];    /* rows: camera axes in box axes; for each row
                                 * sum |r| <= 1.7321 * 2^30 */
    int32_t centre[3];          /* box units, |c| <= 2^29 */
    int32_t focal_q16[2];       /* pixels, > 0 */
    int32_t principal_q16[2];   /* pixels; (0, 0) is the corner of the picture,
                                 * |p| <= 2^30 */
    int32_t near_plane;         /* box units, >= 1 */
    uint16_t width, height;     /* pixels, 1..16384 */
    uint16_t background_q15[3]; /* R, G, B, 0..32768 */
} saga_camera;

/* A primitive at one time in one camera (norm: docs/arithmetic.md). */
typedef struct saga_splat {
    int32_t mean_q8[2];     /* pixels */
    int32_t chol_q28[3];    /* g, n, h: factor of the conic in log2 units; bit
                             * 6 of the tools selects the fall-off */
    int32_t q0_q20;         /* 3 - log2 of the peak opacity, [0, 11) */
    uint32_t depth;         /* z in box units, >= 1 */
    uint16_t colour_q15[3]; /* R, G, B, 0..32768 */
    int16_t x0, y0, x1, y1; /* pixels touched lie in [x0, x1) x [y0, y1) */
} saga_splat;

/* The destination of a picture: rows of R, G, B samples of 8 or 16 bits, or
 * rows of saga_depth. */
typedef struct saga_picture {
    void *rgb;            /* first sample of the job's pixel (x0, y0);
                           * uint8_t, uint16_t (aligned to 2) or saga_depth
                           * (aligned to 8) */
    size_t stride_nbytes; /* distance of rows; a multiple of 2 for 16 bits,
                           * of 8 for SAGA_DEPTH */
    size_t nbytes;        /* capacity from rgb on */
    int bits;             /* 8, 16 or SAGA_DEPTH */
} saga_picture;

enum { SAGA_DEPTH = 64 }; /* the value of `bits` for saga_depth samples */

/* The depth and the opacity of a pixel. Each splat at the pixel has a blending
 * weight w and a mean at depth z along the camera's axis. The expected depth is
 * sum_q16 / weight_q16. The background does not contribute. */
typedef struct saga_depth {
    uint64_t sum_q16;    /* sum of w z, z in box units, >= 1; below 2^48 */
    uint32_t weight_q16; /* sum of w, which is alpha, 0..65536; 0 if there
                          * is no splat */
    uint32_t reserved;   /* written as 0 */
} saga_depth;

/* A rectangle of the picture that one thread draws, and its progress.
 * Set the first block of fields, zero the second, and call saga_draw until it
 * returns something other than SAGA_AGAIN. While a job is in progress, its
 * first block, the view and `bits` of the picture must not change, or saga_draw
 * refuses it; to begin anew, zero the second block. The caller must not change
 * the bytes of the scratch before the job ends. */
typedef struct saga_job {
    int32_t x0, y0, x1, y1; /* inside the camera's picture, not empty */
    int32_t tile;           /* side of a tile in pixels: 8, 16, 32 or 64; has
                             * no effect on the pixels */
    uint32_t list_capacity; /* entries of the splat list, >= 1; no effect on
                             * the pixels */
    void *scratch;          /* aligned to 4, of at least
                             * SAGA_JOB_NBYTES(tile, list_capacity) bytes */
    size_t scratch_nbytes;  /* with more bytes, several tiles share one pass
                             * over the splats */

    uint32_t cursor[4]; /* internal: progress, and a check of the first
                         * block; zero at the start */
} saga_job;

/* Number of bytes of scratch that the smallest band, a single tile, needs. */
#define SAGA_JOB_NBYTES(tile, list_capacity) \
    ((size_t)(tile) * (size_t)(tile)*16u + (size_t)(list_capacity)*8u + 264u)

/* --- Files ----------------------------------------------------------------
 *
 * A file begins with its head, which is followed by segments. The head holds
 * header, index, networks, and possibly the base, that is the primitives that
 * stand still throughout the file. To show one picture a player needs the head
 * and one segment:
 *
 *     saga_probe(&info, bytes, n);             sizes of memory and head
 *     saga_open(&dec, work, info.work_nbytes, bytes, info.head_nbytes, NULL);
 *     saga_find(&seg, bytes, info.head_nbytes, frame, 1);
 *     saga_decode(dec, &seg, bytes + seg.offset, seg.nbytes, NULL);
 *     saga_view(dec, &camera, seg.t);
 *     while (saga_draw(dec, &job, &picture, budget) == SAGA_AGAIN) ;
 */

enum { SAGA_WORK_ALIGN = 16 };

/* Largest work_nbytes of a level 0..3, for static arrays. */
#define SAGA_WORK_MAX(level)      \
    ((level) == 0   ? 256ul << 10 \
     : (level) == 1 ? 4ul << 20   \
     : (level) == 2 ? 32ul << 20  \
                    : 1ul << 30)

/* Largest ratio, by level, of the pixels in the boxes of a view's splats to the
 * pixels of the picture; a picture with fewer than 65,536 pixels counts as
 * 65,536. */
#define SAGA_COVER_MAX(level) \
    ((level) == 0 ? 512u : (level) == 1 ? 1024u : (level) == 2 ? 4096u : 16384u)

typedef struct saga_info {
    uint32_t version, level;
    size_t work_nbytes; /* exact size of the block that saga_open needs */
    size_t head_nbytes; /* size of the head: header, index, networks,
                         * base */
    uint32_t n_segments, n_frames;
    uint32_t fps_num, fps_den;     /* frames per second */
    uint32_t n_cameras;            /* cameras of the rig */
    uint32_t n_layers;             /* layers of each segment, 1..8 */
    uint32_t max_coarse, max_fine; /* largest counts of any layer */
    uint32_t max_primitives;       /* largest count of any segment, all layers
                                    * together */
    uint32_t base_coarse, base_fine, base_primitives; /* counts of the base; 0
                                                       * without one */
    uint32_t base_nbytes;  /* coded size of the base, part of head_nbytes */
    uint32_t n_weights;    /* weights of all networks */
    uint32_t nets_nbytes;  /* coded size of the networks */
    uint32_t tools;        /* tools of the header, docs/bitstream.md */
    uint32_t motion_order; /* 0..3 */
    uint32_t features;
    uint64_t decode_macs; /* multiply-accumulates of networks and bank for a
                           * segment with the maximal counts; with a bank or
                           * layers an upper bound */
    uint64_t base_macs;   /* the same for the base, in saga_open */
    uint64_t work;        /* the number that the level limits: both of these,
                           * plus 4,096 for each run of a network on a point
                           */
    uint32_t view_macs;   /* multiply-accumulates for each visible primitive
                           * of a view */
    /* world = centre + box units * unit, in the capture's unit of length. If
     * saga_naming has the scale, metres = world * metre. Each of these values
     * is mantissa * 2^exponent */
    int32_t unit_mantissa, unit_exponent;
    int32_t centre_mantissa[3], centre_exponent;
} saga_info;

/* Reads the header and fills *info.
 * bytes[0..n): the start of the file, for any n. Bytes after those that a
 * function needs make no difference, here and below.
 * Returns SAGA_OK; TRUNCATED if the header is longer than n; DATA, VERSION or
 * LEVEL. If the file has a newer version or an unknown tool, the status is
 * VERSION, and the checksum is not checked. On an error *info is undefined. */
saga_status saga_probe(saga_info *info, const uint8_t *bytes, size_t n);

typedef struct saga_decoder saga_decoder;

/* Lets the caller stop saga_open or saga_decode. `stop` is called at the
 * beginning, and then about every million multiply-accumulates or equivalent
 * work, that is well below every millisecond on a desktop. It may read a clock,
 * for example, but must not use the decoder. */
typedef struct saga_watch {
    int (*stop)(void *user); /* returns other than 0 to stop */
    void *user;              /* the argument of stop */
} saga_watch;

/* Makes a decoder in work[0..work_nbytes), aligned to SAGA_WORK_ALIGN, from the
 * head of the file, and decodes the base. *dec points into work. The caller
 * owns work and may reuse it at any time; there is no close function.
 * watch: may be NULL.
 * Returns SAGA_OK; SPACE or ALIGN; TRUNCATED if n < info.head_nbytes; DATA,
 * VERSION or LEVEL; STOPPED. On an error *dec is NULL. */
saga_status saga_open(saga_decoder **dec, void *work, size_t work_nbytes,
                      const uint8_t *head, size_t n, const saga_watch *watch);

typedef struct saga_segment {
    uint32_t number; /* 0.. */
    uint32_t first_frame, n_frames;
    uint64_t offset; /* place of its bytes in the file */
    uint32_t nbytes;
    int32_t t; /* the wanted time within the segment, 0..65535 */
} saga_segment;

/* Finds the segment that contains time frame_num / frame_den, counted in frames
 * from the start of the file, and the place of its bytes. head as for
 * saga_open.
 * Returns SAGA_OK; ARG if frame_den is 0 or the time is past the end; else as
 * saga_open. */
saga_status saga_find(saga_segment *seg, const uint8_t *head, size_t n,
                      uint32_t frame_num, uint32_t frame_den);

/* Gets camera `index` of the rig, 0..info.n_cameras-1, and its number in the
 * capture. head[0..n): the start of the file, at least its header.
 * Returns SAGA_OK; ARG; else as saga_probe. */
saga_status saga_rig(saga_camera *camera, uint32_t *number, const uint8_t *head,
                     size_t n, uint32_t index);

enum { SAGA_MAX_NAME = 63 }; /* bytes, without the 0 at the end */

typedef struct saga_naming {
    char name[SAGA_MAX_NAME + 1]; /* valid UTF-8 without control characters,
                                   * with a 0 at its end; may be empty */
    int32_t metre_mantissa, metre_exponent; /* metres in the capture's unit of
                                             * length, mantissa * 2^exponent;
                                             * unknown if the mantissa is 0 */
} saga_naming;

/* Gets the name of camera `index` in the capture, and the capture's unit of
 * length. bytes[0..n): the start of the file. The chunk of names, if there is
 * one, follows the head directly.
 * Returns SAGA_OK; ARG if there is no such camera or the file has no names;
 * TRUNCATED if more bytes are needed; DATA; else as saga_probe. */
saga_status saga_name_camera(saga_naming *naming, const uint8_t *bytes,
                             size_t n, uint32_t index);

typedef struct saga_exposure {
    uint16_t gain_q12[3]; /* R, G, B, 256..65535; 4096 is 1 */
} saga_exposure;

/* Gets the exposure of camera `index` in the capture. The decoder draws all
 * views in one tone, that of the mean camera. In the tone of this camera, a
 * sample s of channel k of a picture, 0..255 or 0..65535, is
 *
 *     min((s * gain_q12[k] + 2048) >> 12, 255 or 65535)
 *
 * where the product and the sum fit in uint32_t. saga_draw does not apply it.
 * bytes[0..n): the start of the file. The chunk of exposures, if there is one,
 * follows the names, or the head.
 * Returns SAGA_OK; ARG if there is no such camera or the file has no
 * exposures, and then the cameras have one tone; TRUNCATED if more bytes are
 * needed; DATA; else as saga_probe. On an error *exposure is unchanged. */
saga_status saga_find_exposure(saga_exposure *exposure, const uint8_t *bytes,
                               size_t n, uint32_t index);

typedef struct saga_sound {
    uint64_t offset; /* offset of its bytes from the start of the
                      * file */
    uint32_t nbytes;
    int32_t start; /* time of the file at which it begins, in 1/48000
                    * of a second; negative if it began before */
} saga_sound;

/* Finds the sound of a film, which is one Ogg stream of Opus for a player of
 * sound. Nothing of it is checked but its first four bytes. bytes[0..n): the
 * start of the file. The chunk of sound, if there is one, follows names and
 * exposures, or the head.
 * Returns SAGA_OK; ARG if the film is silent; TRUNCATED if more bytes are
 * needed, at most 4 behind the sound; DATA if the chunk is damaged or a second
 * one follows; else as saga_probe. */
saga_status saga_find_sound(saga_sound *sound, const uint8_t *bytes, size_t n);

/* From where a film looks well. An eye at azimuth a, elevation e and distance d
 * from the pivot stands at
 *
 *     pivot + d (cos e (cos a front + sin a side) + sin e up),
 *     side = up x front
 *
 * in the box, with `up` scaled to length 1, and `front` without its part along
 * `up`, scaled likewise. It is inside if |a| <= azimuth and e and d are in
 * their ranges. Angles are in pi / 32768, distances in box units. */
typedef struct saga_volume {
    int32_t pivot[3];                    /* within +-2^29 */
    uint32_t distance_min, distance_max; /* 0..2^30, in order */
    int32_t floor;    /* height of the floor above the pivot along up, mostly
                       * negative; -2^31: unknown */
    int16_t up[3];    /* Q14, within 0.71 and 1.42 of length 1 */
    int16_t front[3]; /* the same, nearly perpendicular to up */
    uint16_t azimuth; /* 0..32768; 32768 is all round */
    int16_t elevation_min, elevation_max; /* -16384..16384, in order */
    uint16_t turn;  /* 0..32768: how far the eye may look away from the
                     * pivot; 32768 is anywhere */
    uint16_t start; /* camera of the rig with which a player begins; 0 if
                     * there is none */
    uint16_t quality_q8[2]; /* expected PSNR in dB, Q8: at cameras that
                             * training saw, and half way between neighbours;
                             * 0: unknown */
} saga_volume;

/* Finds the viewing volume. bytes[0..n): the start of the file. The chunk of
 * the volume, if there is one, follows names, exposures and sound, or the head;
 * bytes without the sound, and with the volume in its place, give the same.
 * Returns SAGA_OK; ARG if the file has none; TRUNCATED if more bytes are
 * needed; DATA; else as saga_probe. On an error *volume is unchanged. */
saga_status saga_find_volume(saga_volume *volume, const uint8_t *bytes,
                             size_t n);

/* Decodes the bytes[0..n) of a segment into primitives, which replace those of
 * an earlier segment. segment: as from saga_find. Its number and frames must
 * equal those in the bytes, so that segments cannot be confused. Bytes of
 * another file are refused too, because their checksums depend on its networks.
 * A segment of several layers may be truncated. Its complete layers are
 * decoded, and saga_tell reports their number; the first must be complete.
 * watch: may be NULL.
 * Returns SAGA_OK, TRUNCATED, DATA or STOPPED. After an error the decoder holds
 * no segment, but remains usable for this or another segment. */
saga_status saga_decode(saga_decoder *dec, const saga_segment *segment,
                        const uint8_t *bytes, size_t n,
                        const saga_watch *watch);

/* The number of bytes at the start of a segment that describe all its layers.
 */
enum { SAGA_LAYERS_NBYTES = 152 };

typedef struct saga_layer_report {
    uint32_t n_coarse, n_fine, n_primitives;
    uint32_t end; /* number of bytes of the segment up to the end of
                   * this layer: a player may stop reading there */
} saga_layer_report;

/* Gets the counts of layer `index` of a segment, 0..info.n_layers-1, and its
 * end. segment: as from saga_find; bytes[0..n): the start of the segment.
 * Returns SAGA_OK; ARG if there is no such layer; TRUNCATED if more bytes are
 * needed, at most SAGA_LAYERS_NBYTES; DATA. */
saga_status saga_find_layer(saga_layer_report *layer, const saga_decoder *dec,
                            const saga_segment *segment, const uint8_t *bytes,
                            size_t n, uint32_t index);

/* Prepares a picture: animates the primitives to time t (0..65535), projects
 * them into the camera, and sorts the splats. Jobs of the previous view become
 * invalid.
 * Returns SAGA_OK; ARG if t or a field of the camera is out of range, and then
 * the previous view remains; STATE without a segment; LEVEL if the boxes of the
 * splats cover more than SAGA_COVER_MAX, and then there is no view. */
saga_status saga_view(saga_decoder *dec, const saga_camera *camera, int32_t t);

/* Draws a part of a job (see saga_job). budget >= 1 bounds the work of the
 * call: one unit is a test of a splat, or a row of a splat blended in a tile.
 * Returns SAGA_OK when the job is finished; SAGA_AGAIN when the budget is used
 * up; ARG, SPACE or ALIGN for invalid job, picture or budget; STATE if there is
 * no view, or if the job began with another view, first block or `bits` and
 * must begin anew. Pixels outside the job's rectangle are not written; pixels
 * inside are written once, with their final values. */
saga_status saga_draw(const saga_decoder *dec, saga_job *job,
                      const saga_picture *picture, uint32_t budget);

/* Returns a description of a status, "unknown status" for other values. */
const char *saga_status_text(saga_status status);

/* Returns the CRC-32C of p[0..n), continuing crc (0 at the start). The CRC of a
 * picture covers its 8-bit R, G, B bytes, rows from the top, without the bytes
 * between rows. */
uint32_t saga_crc32c(uint32_t crc, const uint8_t *p, size_t n);

/* --- Taps: for vectors, export and references ---------------------------- */

typedef struct saga_report {
    uint32_t n_layers;         /* number of decoded layers */
    uint32_t n_coarse, n_fine; /* anchors of all decoded layers together */
    uint32_t n_primitives;   /* primitives of base and layers. Those of the base
                              * are numbered first, then layer by layer */
    uint32_t final_range[3]; /* range of the coder after each chunk of the last
                              * decoded layer */
    uint32_t n_splats;       /* splats of the last view; 0 without a view */
    uint64_t box_pixels;     /* number of pixels in the boxes of all splats, a
                              * bound on the cost of a picture. It is that of
                              * the last requested view, even if it was refused
                              * with LEVEL; 0 before the first */
} saga_report;

/* Returns SAGA_OK, or STATE without a segment. */
saga_status saga_tell(saga_report *report, const saga_decoder *dec);

/* A primitive at one time. */
typedef struct saga_animated {
    int32_t x[3];              /* mean, box units, saturated at +-2^29 */
    int32_t quat[4];           /* w, x, y, z; not normalised; all 0: identity */
    int32_t log2_scale_q10[3]; /* standard deviations, log2 of box units */
    int32_t q0_q20;            /* 3 - log2 of opacity times temporal opacity, a
                                * product that may exceed 1; from 11 on it is
                                * invisible */
} saga_animated;

/* Computes primitive `index` at time t (0..65535). Returns SAGA_OK, ARG or
 * STATE. */
saga_status saga_primitive_at(saga_animated *out, const saga_decoder *dec,
                              uint32_t index, int32_t t);

/* A primitive that is visible at one time. */
typedef struct saga_visible {
    saga_animated at;
    uint32_t index;
} saga_visible;

/* Computes those of primitives first..first+n-1 that are visible at time t
 * (0..65535), in ascending order, as saga_primitive_at does, in less time.
 * Writes them to `out`, which has room for n, and their number to *n_out.
 * Returns SAGA_OK, ARG or STATE; on an error nothing is written. */
saga_status saga_visible_at(saga_visible *out, uint32_t *n_out,
                            const saga_decoder *dec, uint32_t first, uint32_t n,
                            int32_t t);

/* Computes the colour of primitive `index` as seen from `from`, in box units,
 * |from| <= 2^29. The view remains valid, but no other thread may use the
 * decoder during the call, because it uses working memory of the decoder.
 * Returns SAGA_OK, ARG or STATE. */
saga_status saga_colour_at(uint16_t colour_q15[3], saga_decoder *dec,
                           uint32_t index, const int32_t from[3]);

/* Sets colour_q15 of splats[0..n) to the colours of primitives index[0..n), as
 * saga_colour_at does, in less time. middle[i] is the position of primitive
 * index[i] in the middle of the segment, that is x of saga_primitive_at for t =
 * 32768. A program that keeps these positions saves their computation; if
 * `middle` is NULL, they are computed. On an error nothing is written. */
saga_status saga_colours_at(saga_splat *splats, saga_decoder *dec,
                            const uint32_t *index, uint32_t n,
                            const int32_t from[3], const int32_t (*middle)[3]);

/* Gets splat number `order` of the last view, in drawing order, nearest first.
 * Returns SAGA_OK, ARG or STATE. */
saga_status saga_splat_at(saga_splat *out, const saga_decoder *dec,
                          uint32_t order);

/* Copies splats first..first+n-1 of the last view, in drawing order, to
 * out[0..n). saga_tell reports the number of splats. A program that draws on a
 * graphics processor needs nothing else.
 *
 * A splat has 44 bytes, in the machine's byte order: mean_q8 at 0, chol_q28 at
 * 8, q0_q20 at 20, depth at 24, colour_q15 at 28, the box at 34, padding at 42.
 * The array can be used directly as a vertex buffer of integers. In floats, for
 * a pixel whose centre is at distance dx, dy from the mean,
 *
 *     v = g dx - n dy,  w = h dy,  s = v^2 + w^2
 *     q = q0 + s, or q0 + s + s^2 / 2 if info.tools has bit 6
 *     alpha = min(2^(3 - q), 0.99) if q < 11, else 0
 *
 * Splats are blended front to back, starting with T = 1: C += T alpha colour,
 * then T *= 1 - alpha; at the end C += T background. Blending in 16-bit floats
 * gives at least 50 dB relative to saga_draw.
 * Returns SAGA_OK; ARG if there are fewer splats; STATE without a view. On an
 * error nothing is written. */
saga_status saga_splats_at(saga_splat *out, const saga_decoder *dec,
                           uint32_t first, uint32_t n);

#ifdef __cplusplus
}
#endif

#endif
