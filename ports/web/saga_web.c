/* SPDX-License-Identifier: MIT
 *
 * The decoder for WebAssembly. saga.js calls the functions of this file, which
 * take and return plain numbers and call saga.h. One instance of the module is
 * one open file.
 *
 * Anything larger than a number goes through memory: a function returns an
 * address, where JavaScript reads or writes. Above the program's own memory
 * lie, in the order of the calls,
 *
 *     head | work block | a segment's bytes, or picture and scratch
 *
 * Memory grows as needed. Therefore JavaScript must take a new view of the
 * memory after every function here that takes a size, and after saga_web_draw.
 */
#include "float_splats.h"
#include "saga.h"

enum {
    PAGE = 65536, /* bytes by which WebAssembly's memory grows */
    ALIGN = 64,
    TILE = 32,
    LIST = 1 << 15,        /* splats that a band sees at a time */
    RUN = 64,              /* primitives that are animated together */
    INVISIBLE_Q0 = 1 << 26 /* an opacity of 2^-61 */
};

/* saga_info for JavaScript, which reads all structures as 32-bit integers. */
typedef struct {
    uint32_t version, level, work_nbytes, head_nbytes;
    uint32_t n_segments, n_frames, fps_num, fps_den;
    uint32_t n_cameras, max_primitives;
    int32_t unit_mantissa, unit_exponent;
    int32_t centre_mantissa[3], centre_exponent;
    uint32_t tools;
} web_info;

typedef struct {
    int32_t rotation_q30[9], centre[3], focal_q16[2], principal_q16[2];
    int32_t near_plane, width, height, background_q15[3];
    int32_t number; /* in the capture */
} web_camera;

typedef struct {
    uint32_t number, first_frame, n_frames;
    uint32_t offset[2]; /* low half, high half */
    uint32_t nbytes;
    int32_t t;
} web_segment;

typedef struct {
    uint32_t offset; /* in the head's memory */
    uint32_t nbytes;
    int32_t start;
} web_sound;

/* A primitive at a time, from saga_visible_at and saga_colour_at. If it is
 * invisible, only its q0 is set, to INVISIBLE_Q0. */
typedef struct {
    saga_animated at;
    uint16_t colour_q15[4]; /* the last one is 0 */
} web_gaussian;

_Static_assert(sizeof(web_gaussian) == 52, "layout of a Gaussian");

typedef struct {
    uint32_t width, height; /* pixels */
    const uint8_t *rgb;     /* (height, width, 3) */
    const uint8_t *rgba;    /* (height, width, 4), opaque */
    uint32_t n_primitives, n_splats;
} web_picture;

/* --- Functions for JavaScript --------------------------------------------- */

/* Exports a function under its C name. */
#define EXPORT(name) __attribute__((export_name(#name)))

/* Returns memory for the first nbytes of a file, which must be written there
 * before saga_web_probe, or NULL if memory is missing. Closes the open file. */
EXPORT(saga_web_head) uint8_t *saga_web_head(uint32_t nbytes);

/* Calls saga_probe on the bytes of the head so far; saga_web_info returns the
 * result. */
EXPORT(saga_web_probe) int32_t saga_web_probe(void);
EXPORT(saga_web_info) const web_info *saga_web_info(void);

/* Calls saga_open on the whole head, with a work block after the head. */
EXPORT(saga_web_open) int32_t saga_web_open(void);

/* Returns the camera that saga_web_rig writes and saga_web_view reads. */
EXPORT(saga_web_camera) web_camera *saga_web_camera(void);
EXPORT(saga_web_rig) int32_t saga_web_rig(uint32_t index);

/* Returns the status of reading the cameras' names, which must be in the head's
 * memory. If it is SAGA_OK, all names are right. */
EXPORT(saga_web_find_names) int32_t saga_web_find_names(void);

/* Returns the status of saga_find_volume for the head's memory, which may hold
 * the chunk of the volume in the place of the sound. The file need not be
 * open. JavaScript reads the fields. */
EXPORT(saga_web_find_volume) int32_t saga_web_find_volume(void);

/* Calls saga_find_sound; saga_web_sound returns the result. The head's memory
 * must hold the file up to 4 bytes after the end of its sound. The file need
 * not be open. */
EXPORT(saga_web_find_sound) int32_t saga_web_find_sound(void);
EXPORT(saga_web_sound) const web_sound *saga_web_sound(void);

/* Calls saga_find; saga_web_segment returns the result. */
EXPORT(saga_web_find)
int32_t saga_web_find(uint32_t frame_num, uint32_t frame_den);
EXPORT(saga_web_segment) const web_segment *saga_web_segment(void);

/* Returns memory for a segment's bytes, which must be written there before
 * saga_web_decode, or NULL if memory is missing. The last picture is lost.
 * saga_web_decode names the segment by its first frame. */
EXPORT(saga_web_input) uint8_t *saga_web_input(uint32_t nbytes);
EXPORT(saga_web_decode)
int32_t saga_web_decode(uint32_t first_frame, uint32_t nbytes);

/* Returns the work block, whose size is in saga_web_info, or NULL if no file is
 * open. Instead of calling saga_web_decode, JavaScript may copy the work block
 * of another instance there, which was opened with the same head and has
 * decoded a segment, and then call saga_web_adopt. */
EXPORT(saga_web_work) uint8_t *saga_web_work(void);
EXPORT(saga_web_adopt) int32_t saga_web_adopt(void);

/* Call saga_view for the camera at saga_web_camera, and draw its picture, which
 * saga_web_picture returns. */
EXPORT(saga_web_view) int32_t saga_web_view(int32_t t);
EXPORT(saga_web_draw) int32_t saga_web_draw(void);

/* Returns the splats that the camera at saga_web_camera sees at time t, to be
 * drawn by JavaScript (float_splats.h), or NULL if memory is missing or nothing
 * is decoded. Their number is in saga_web_picture. The segment's bytes and the
 * last picture are lost. */
EXPORT(saga_web_splats) const saga_splat *saga_web_splats(int32_t t);

/* Returns the segment's primitives at time t, with the colours that the camera
 * at saga_web_camera sees from its centre, or NULL if memory is missing or
 * nothing is decoded. Their number is in saga_web_picture. Invisible ones keep
 * their places, so that an engine may draw them in the order of another time.
 * The segment's bytes and the last picture are lost. */
EXPORT(saga_web_gaussians) const web_gaussian *saga_web_gaussians(int32_t t);

/* Returns the results of saga_web_view and saga_web_draw. */
EXPORT(saga_web_picture) const web_picture *saga_web_picture(void);

/* Returns the CRC-32C of the last picture's R, G, B bytes. */
EXPORT(saga_web_crc) uint32_t saga_web_crc(void);

EXPORT(saga_web_status_text) const char *saga_web_status_text(int32_t status);

/* A function of JavaScript. It returns a value other than 0 if decoding takes
 * too long and should stop. */
__attribute__((import_module("env"), import_name("stop"))) int32_t
saga_web_stop(void);

/* --- State --------------------------------------------------------------- */

static struct {
    saga_info info;
    saga_decoder *dec;
    uint8_t *head, *work, *input;
    size_t head_nbytes;
    saga_camera view;   /* of the last saga_web_view */
    saga_camera looked; /* of the last saga_web_splats, whose colours are in the
                         * input's memory; width 0: they are gone */
    web_info told;
    web_camera camera;
    web_segment segment;
    web_sound sound;
    web_picture picture;
} web;

extern uint8_t __heap_base; /* set by the linker: the first free byte */

/* --- Memory -------------------------------------------------------------- */

static uint8_t *align_up(uint8_t *p)
{
    return (uint8_t *)(((uintptr_t)p + ALIGN - 1) / ALIGN * ALIGN);
}

/* Grows memory until it has nbytes from `from` on. Returns 0 if it cannot. */
static int reach(const uint8_t *from, uint64_t nbytes)
{
    const uint64_t end = (uintptr_t)from + nbytes;
    const uint64_t have = (uint64_t)__builtin_wasm_memory_size(0) * PAGE;

    if (end <= have)
        return 1;
    if (end > 0xffff0000u)
        return 0;
    return __builtin_wasm_memory_grow(
               0, (size_t)((end - have + PAGE - 1) / PAGE)) != (size_t)-1;
}

/* --- Time limit ---------------------------------------------------------- */

static int ask(void *user)
{
    (void)user;
    return saga_web_stop();
}

static const saga_watch watch = { ask, NULL };

/* --- A file -------------------------------------------------------------- */

uint8_t *saga_web_head(uint32_t nbytes)
{
    web.dec = NULL;
    web.looked.width = 0;
    web.head = align_up(&__heap_base);
    web.head_nbytes = nbytes;
    return reach(web.head, nbytes) ? web.head : NULL;
}

static void write_info(void)
{
    const saga_info *const from = &web.info;
    web_info *const to = &web.told;
    int i;

    to->version = from->version;
    to->level = from->level;
    to->work_nbytes = from->work_nbytes;
    to->head_nbytes = from->head_nbytes;
    to->n_segments = from->n_segments;
    to->n_frames = from->n_frames;
    to->fps_num = from->fps_num;
    to->fps_den = from->fps_den;
    to->n_cameras = from->n_cameras;
    to->max_primitives = from->base_primitives + from->max_primitives;
    to->unit_mantissa = from->unit_mantissa;
    to->unit_exponent = from->unit_exponent;
    for (i = 0; i < 3; i++)
        to->centre_mantissa[i] = from->centre_mantissa[i];
    to->centre_exponent = from->centre_exponent;
    to->tools = from->tools;
}

int32_t saga_web_probe(void)
{
    const saga_status s = saga_probe(&web.info, web.head, web.head_nbytes);

    if (s == SAGA_OK)
        write_info();
    return s;
}

const web_info *saga_web_info(void)
{
    return &web.told;
}

int32_t saga_web_open(void)
{
    const size_t nbytes = web.info.work_nbytes;

    web.work = align_up(web.head + web.head_nbytes);
    if (!reach(web.work, nbytes))
        return SAGA_ERR_SPACE;
    web.input = align_up(web.work + nbytes);
    return saga_open(&web.dec, web.work, nbytes, web.head, web.head_nbytes,
                     &watch);
}

web_camera *saga_web_camera(void)
{
    return &web.camera;
}

int32_t saga_web_rig(uint32_t index)
{
    web_camera *const to = &web.camera;
    saga_camera c;
    uint32_t number;
    const saga_status s = saga_rig(&c, &number, web.head, web.head_nbytes,
                                   index);
    int i;

    if (s)
        return s;
    for (i = 0; i < 9; i++)
        to->rotation_q30[i] = c.rotation_q30[i];
    for (i = 0; i < 3; i++) {
        to->centre[i] = c.centre[i];
        to->background_q15[i] = c.background_q15[i];
    }
    for (i = 0; i < 2; i++) {
        to->focal_q16[i] = c.focal_q16[i];
        to->principal_q16[i] = c.principal_q16[i];
    }
    to->near_plane = c.near_plane;
    to->width = c.width;
    to->height = c.height;
    to->number = (int32_t)number;
    return SAGA_OK;
}

int32_t saga_web_find_names(void)
{
    saga_naming naming;

    return saga_name_camera(&naming, web.head, web.head_nbytes, 0);
}

int32_t saga_web_find_volume(void)
{
    saga_volume volume;

    return saga_find_volume(&volume, web.head, web.head_nbytes);
}

/* --- Sound --------------------------------------------------------------- */

int32_t saga_web_find_sound(void)
{
    saga_sound found;
    const saga_status s = saga_find_sound(&found, web.head, web.head_nbytes);

    if (s)
        return s;
    web.sound.offset = (uint32_t)found.offset;
    web.sound.nbytes = found.nbytes;
    web.sound.start = found.start;
    return SAGA_OK;
}

const web_sound *saga_web_sound(void)
{
    return &web.sound;
}

/* --- A segment ----------------------------------------------------------- */

int32_t saga_web_find(uint32_t frame_num, uint32_t frame_den)
{
    web_segment *const to = &web.segment;
    saga_segment seg;
    const saga_status s = saga_find(&seg, web.head, web.head_nbytes, frame_num,
                                    frame_den);

    if (s)
        return s;
    to->number = seg.number;
    to->first_frame = seg.first_frame;
    to->n_frames = seg.n_frames;
    to->offset[0] = (uint32_t)seg.offset;
    to->offset[1] = (uint32_t)(seg.offset >> 32);
    to->nbytes = seg.nbytes;
    to->t = seg.t;
    return SAGA_OK;
}

const web_segment *saga_web_segment(void)
{
    return &web.segment;
}

uint8_t *saga_web_input(uint32_t nbytes)
{
    web.looked.width = 0;
    return reach(web.input, nbytes) ? web.input : NULL;
}

int32_t saga_web_decode(uint32_t first_frame, uint32_t nbytes)
{
    saga_segment seg;
    saga_status s = saga_find(&seg, web.head, web.head_nbytes, first_frame, 1);

    if (s)
        return s;
    s = web.dec ? saga_decode(web.dec, &seg, web.input, nbytes, &watch)
                : SAGA_ERR_STATE;
    return s ? s : saga_web_adopt();
}

uint8_t *saga_web_work(void)
{
    return web.dec ? web.work : NULL;
}

int32_t saga_web_adopt(void)
{
    saga_report report;
    const saga_status s = web.dec ? saga_tell(&report, web.dec)
                                  : SAGA_ERR_STATE;

    web.view.width = web.looked.width = 0;
    if (s == SAGA_OK)
        web.picture.n_primitives = report.n_primitives;
    return s;
}

/* --- A picture ----------------------------------------------------------- */

static int get_camera(saga_camera *to)
{
    const web_camera *const from = &web.camera;
    int i;

    if (from->width < 1 || from->width > 16384 || from->height < 1 ||
        from->height > 16384)
        return 0;
    for (i = 0; i < 9; i++)
        to->rotation_q30[i] = from->rotation_q30[i];
    for (i = 0; i < 3; i++) {
        to->centre[i] = from->centre[i];
        to->background_q15[i] = (uint16_t)from->background_q15[i];
    }
    for (i = 0; i < 2; i++) {
        to->focal_q16[i] = from->focal_q16[i];
        to->principal_q16[i] = from->principal_q16[i];
    }
    to->near_plane = from->near_plane;
    to->width = (uint16_t)from->width;
    to->height = (uint16_t)from->height;
    return 1;
}

int32_t saga_web_view(int32_t t)
{
    saga_report report;
    saga_status s;

    web.view.width = 0;
    if (!get_camera(&web.view))
        return SAGA_ERR_ARG;
    s = web.dec ? saga_view(web.dec, &web.view, t) : SAGA_ERR_STATE;
    if (s == SAGA_OK && saga_tell(&report, web.dec) == SAGA_OK)
        web.picture.n_splats = report.n_splats;
    return s;
}

static void expand(uint8_t *rgba, const uint8_t *rgb, size_t n_pixels)
{
    size_t i;

    for (i = 0; i < n_pixels; i++) {
        rgba[4 * i] = rgb[3 * i];
        rgba[4 * i + 1] = rgb[3 * i + 1];
        rgba[4 * i + 2] = rgb[3 * i + 2];
        rgba[4 * i + 3] = 255;
    }
}

static saga_status draw_all(uint8_t *rgb, uint8_t *scratch, size_t nbytes)
{
    const uint32_t width = web.view.width, height = web.view.height;
    saga_picture picture;
    saga_job job;
    saga_status s;
    int i;

    job.x0 = job.y0 = 0;
    job.x1 = (int32_t)width;
    job.y1 = (int32_t)height;
    job.tile = TILE;
    job.list_capacity = LIST;
    job.scratch = scratch;
    job.scratch_nbytes = nbytes;
    for (i = 0; i < 4; i++)
        job.cursor[i] = 0;
    picture.rgb = rgb;
    picture.stride_nbytes = 3 * width;
    picture.nbytes = (size_t)3 * width * height;
    picture.bits = 8;
    do
        s = saga_draw(web.dec, &job, &picture, UINT32_MAX);
    while (s == SAGA_AGAIN);
    return s;
}

int32_t saga_web_draw(void)
{
    const uint32_t width = web.view.width, height = web.view.height;
    const size_t n_pixels = (size_t)width * height;
    const uint64_t n_tiles = (uint64_t)((width + TILE - 1) / TILE) *
                             ((height + TILE - 1) / TILE);
    const uint64_t nbytes = SAGA_JOB_NBYTES(TILE, LIST) +
                            SAGA_JOB_NBYTES(TILE, 0) * n_tiles;
    web_picture *const p = &web.picture;
    uint8_t *const rgb = web.input;
    uint8_t *rgba, *scratch;
    saga_status s;

    if (!web.dec || !width)
        return SAGA_ERR_STATE;
    web.looked.width = 0;
    /* The picture takes the place of the segment's bytes: R, G, B, then R, G,
     * B, A, then scratch. */
    if (!reach(rgb, 7 * (uint64_t)n_pixels + nbytes + 2 * ALIGN))
        return SAGA_ERR_SPACE;
    rgba = align_up(rgb + 3 * n_pixels);
    scratch = align_up(rgba + 4 * n_pixels);
    s = draw_all(rgb, scratch, (size_t)nbytes);
    if (s)
        return s;
    expand(rgba, rgb, n_pixels);
    p->width = width;
    p->height = height;
    p->rgb = rgb;
    p->rgba = rgba;
    return SAGA_OK;
}

/* Returns what the input's memory has for a camera at this place. */
static kept_splats kept_for(const int32_t *centre)
{
    const saga_camera *const c = &web.looked;

    if (!c->width)
        return KEPT_NOTHING;
    return c->centre[0] == centre[0] && c->centre[1] == centre[1] &&
                   c->centre[2] == centre[2]
               ? KEPT_COLOURS
               : KEPT_POSITIONS;
}

const saga_splat *saga_web_splats(int32_t t)
{
    const uint32_t n = web.picture.n_primitives;
    const kept_splats kept = kept_for(web.camera.centre);
    int32_t n_splats;

    web.looked.width = 0;
    if (!web.dec || !reach(web.input, float_splats_nbytes(n)) ||
        !get_camera(&web.looked))
        return NULL;
    n_splats = float_splats(web.input, web.dec, n, &web.looked, t, kept);
    if (n_splats < 0) {
        web.looked.width = 0;
        return NULL;
    }
    web.picture.n_splats = (uint32_t)n_splats;
    return (const saga_splat *)(void *)web.input;
}

const web_gaussian *saga_web_gaussians(int32_t t)
{
    const uint32_t n = web.picture.n_primitives;
    web_gaussian *const first = (web_gaussian *)(void *)web.input;
    saga_visible visible[RUN];
    uint32_t n_visible, i, k;

    web.looked.width = 0;
    if (!web.dec || !reach(web.input, (uint64_t)n * sizeof *first))
        return NULL;
    /* All primitives are there, so that their order stays; those that are not
     * seen at this time have an opacity of 0. */
    for (i = 0; i < n; i++)
        first[i] = (web_gaussian){ .at = { .q0_q20 = INVISIBLE_Q0 } };
    for (i = 0; i < n; i += RUN) {
        if (saga_visible_at(visible, &n_visible, web.dec, i,
                            n - i < RUN ? n - i : RUN, t))
            return NULL;
        for (k = 0; k < n_visible; k++) {
            web_gaussian *const to = first + visible[k].index;

            to->at = visible[k].at;
            if (saga_colour_at(to->colour_q15, web.dec, visible[k].index,
                               web.camera.centre))
                return NULL;
        }
    }
    web.picture.n_splats = n;
    return first;
}

const web_picture *saga_web_picture(void)
{
    return &web.picture;
}

uint32_t saga_web_crc(void)
{
    const web_picture *const p = &web.picture;

    return saga_crc32c(0, p->rgb, (size_t)3 * p->width * p->height);
}

const char *saga_web_status_text(int32_t status)
{
    return saga_status_text((saga_status)status);
}
