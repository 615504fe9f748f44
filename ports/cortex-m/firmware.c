/* SPDX-License-Identifier: MIT
 *
 * A decoder for level 0 on a microcontroller, with static buffers and saga.h
 * alone. It decodes every stream in flash (build.sh puts them there) and draws
 * each segment from two cameras. For each picture it prints over semihosting a
 * line of vectors/MANIFEST without the checksums of the symbols:
 *
 *     FILE SEGMENT RANGE RANGE RANGE T CAMERA PRIMITIVES SPLATS FRAME
 *
 * Lines that begin with `#` are measurements. With an argument, the last
 * picture is written to a PPM file of that name on the host.
 */
#include "boot.h"
#include "semihost.h"

#include "saga.h"

/* A stream of level 0 may need a work block of 256 KiB. Here the work block,
 * the buffers below and the stack together have 256 KiB, so that streams that
 * need more than this are refused. */
enum { WORK_NBYTES = 234 << 10 };

/* Pictures are drawn in strips with the height of a tile. */
enum { MOST_WIDTH = 160, TILE = 16, LIST = 256, BUDGET = 1 << 20 };

static struct {
    _Alignas(SAGA_WORK_ALIGN) uint8_t work[WORK_NBYTES];
    _Alignas(4) uint8_t scratch[SAGA_JOB_NBYTES(TILE, LIST)];
    uint8_t strip[3 * MOST_WIDTH * TILE];
} memory;

/* A stream in flash. build.sh writes the table of streams, which ends with a
 * NULL name. */
typedef struct {
    const char *name;
    const uint8_t *bytes, *end;
} stream;

extern const stream streams[];

/* --- Printing ------------------------------------------------------------ */

static void field(uint32_t x)
{
    semihost_text(" ");
    semihost_hex(x);
}

static void measured(const char *name, uint32_t x)
{
    semihost_text(name);
    semihost_text(" ");
    semihost_decimal(x);
}

static int refuse(const stream *f, const char *what, saga_status s)
{
    semihost_text("FAIL ");
    semihost_text(f->name);
    semihost_text(": ");
    semihost_text(what);
    semihost_text(": ");
    semihost_text(saga_status_text(s));
    semihost_text("\n");
    return 1;
}

/* --- Checksums ----------------------------------------------------------- */

static uint32_t crc_of(uint32_t crc, const int32_t *x, int n)
{
    int i;

    for (i = 0; i < n; i++) {
        const uint32_t v = (uint32_t)x[i];
        const uint8_t b[4] = { (uint8_t)v, (uint8_t)(v >> 8),
                               (uint8_t)(v >> 16), (uint8_t)(v >> 24) };

        crc = saga_crc32c(crc, b, 4);
    }
    return crc;
}

static uint32_t primitives_crc(const saga_decoder *dec, uint32_t n, int32_t t)
{
    uint32_t crc = 0, i;
    saga_animated a;

    for (i = 0; i < n && !saga_primitive_at(&a, dec, i, t); i++) {
        crc = crc_of(crc, a.x, 3);
        crc = crc_of(crc, a.quat, 4);
        crc = crc_of(crc, a.log2_scale_q10, 3);
        crc = crc_of(crc, &a.q0_q20, 1);
    }
    return crc;
}

static uint32_t splats_crc(const saga_decoder *dec, uint32_t n)
{
    uint32_t crc = 0, i;
    saga_splat s;
    int k;

    for (i = 0; i < n && !saga_splat_at(&s, dec, i); i++) {
        const int32_t depth = (int32_t)s.depth;

        crc = crc_of(crc, s.mean_q8, 2);
        crc = crc_of(crc, s.chol_q28, 3);
        crc = crc_of(crc, &s.q0_q20, 1);
        crc = crc_of(crc, &depth, 1);
        for (k = 0; k < 3; k++) {
            const int32_t colour = s.colour_q15[k];

            crc = crc_of(crc, &colour, 1);
        }
    }
    return crc;
}

/* --- A picture ----------------------------------------------------------- */

/* A picture of a segment, with its checksums and times. */
typedef struct {
    saga_camera camera;
    uint32_t index; /* index of the camera in the rig */
    int32_t t;
    int file; /* handle of the file on the host; -1: none */
    uint32_t primitives, splats, frame; /* checksums */
    uint64_t view, draw; /* ticks that saga_view and drawing took */
} picture;

static saga_status draw_strip(picture *p, const saga_decoder *dec, int32_t y0,
                              int32_t y1)
{
    const size_t stride = 3u * p->camera.width;
    const size_t n = stride * (size_t)(y1 - y0);
    const saga_picture to = { memory.strip, stride, sizeof memory.strip, 8 };
    saga_job job = { .x1 = p->camera.width,
                     .y0 = y0,
                     .y1 = y1,
                     .tile = TILE,
                     .list_capacity = LIST,
                     .scratch = memory.scratch,
                     .scratch_nbytes = sizeof memory.scratch };
    const uint64_t begin = boot_ticks();
    saga_status s;

    do
        s = saga_draw(dec, &job, &to, BUDGET);
    while (s == SAGA_AGAIN);
    p->draw += boot_ticks() - begin;
    if (s)
        return s;
    p->frame = saga_crc32c(p->frame, memory.strip, n);
    return p->file < 0 || semihost_write(p->file, memory.strip, n)
               ? SAGA_OK
               : SAGA_ERR_SPACE;
}

static saga_status draw(picture *p, const saga_decoder *dec)
{
    saga_status s = SAGA_OK;
    int32_t y;

    for (y = 0; y < p->camera.height && !s; y += TILE)
        s = draw_strip(p, dec, y,
                       y + TILE < p->camera.height ? y + TILE
                                                   : p->camera.height);
    return s;
}

static char *put_decimal(char *to, uint32_t x)
{
    uint32_t unit = 1;

    while (x / unit >= 10)
        unit *= 10;
    for (; unit; unit /= 10)
        *to++ = (char)('0' + x / unit % 10);
    return to;
}

static int begin_ppm(const char *path, const saga_camera *c)
{
    const int file = semihost_create(path);
    char text[32] = "P6\n", *end = put_decimal(text + 3, c->width);

    *end++ = ' ';
    end = put_decimal(end, c->height);
    *end++ = '\n';
    end = put_decimal(end, 255);
    *end++ = '\n';
    return file >= 0 && semihost_write(file, text, (size_t)(end - text)) ? file
                                                                         : -1;
}

/* --- A stream ------------------------------------------------------------ */

/* Makes the splats of a picture and their checksums, everything except the
 * pixels. */
static saga_status look(picture *p, saga_decoder *dec, const stream *f)
{
    saga_report report;
    uint64_t begin;
    uint32_t name;
    saga_status s = saga_rig(&p->camera, &name, f->bytes,
                             (size_t)(f->end - f->bytes), p->index);

    if (s)
        return s;
    if (p->camera.width > MOST_WIDTH)
        return SAGA_ERR_SPACE;
    begin = boot_ticks();
    s = saga_view(dec, &p->camera, p->t);
    p->view = boot_ticks() - begin;
    if (s)
        return s;
    saga_tell(&report, dec);
    p->primitives = primitives_crc(dec, report.n_primitives, p->t);
    p->splats = splats_crc(dec, report.n_splats);
    return SAGA_OK;
}

static void tell(const picture *p, const saga_decoder *dec, const stream *f,
                 uint32_t segment)
{
    saga_report report;
    int i;

    saga_tell(&report, dec);
    measured(f->name, segment);
    for (i = 0; i < 3; i++)
        field(report.final_range[i]);
    measured("", (uint32_t)p->t);
    measured("", p->index);
    field(p->primitives);
    field(p->splats);
    field(p->frame);
    semihost_text("\n# picture");
    measured(" splats", report.n_splats);
    measured(" view", (uint32_t)p->view);
    measured(" draw", (uint32_t)p->draw);
    semihost_text("\n");
}

/* Draws and reports a picture of the decoded segment. */
static int show(picture p, saga_decoder *dec, const stream *f, uint32_t segment,
                const char *path)
{
    saga_status s = look(&p, dec, f);

    if (s)
        return refuse(f, "view", s);
    p.file = path[0] ? begin_ppm(path, &p.camera) : -1;
    if (path[0] && p.file < 0)
        return refuse(f, path, SAGA_ERR_ARG);
    s = draw(&p, dec);
    if (p.file >= 0)
        semihost_close(p.file);
    if (s)
        return refuse(f, "drawing", s);
    tell(&p, dec, f, segment);
    return 0;
}

static int decode(const stream *f, saga_decoder *dec, const saga_segment *seg)
{
    const uint64_t begin = boot_ticks();
    const saga_status s = saga_decode(dec, seg, f->bytes + seg->offset,
                                      seg->nbytes, NULL);
    const uint32_t ticks = (uint32_t)(boot_ticks() - begin);
    saga_report report;

    if (s)
        return refuse(f, "segment", s);
    saga_tell(&report, dec);
    semihost_text("# segment");
    measured(" coarse", report.n_coarse);
    measured(" fine", report.n_fine);
    measured(" primitives", report.n_primitives);
    measured(" decode", ticks);
    semihost_text("\n");
    return 0;
}

/* Opens a stream with a decoder in the work block. */
static saga_status open_head(saga_decoder **dec, saga_info *info,
                             const stream *f)
{
    const size_t n = (size_t)(f->end - f->bytes);
    const uint64_t begin = boot_ticks();
    saga_status s = saga_probe(info, f->bytes, n);

    if (!s && info->work_nbytes > sizeof memory.work)
        s = SAGA_ERR_SPACE;
    if (!s)
        s = saga_open(dec, memory.work, info->work_nbytes, f->bytes, n, NULL);
    if (s)
        return s;
    semihost_text("# file ");
    measured(f->name, (uint32_t)n);
    measured(" weights", info->n_weights);
    measured(" work", (uint32_t)info->work_nbytes);
    measured(" macs", (uint32_t)info->decode_macs);
    measured(" open", (uint32_t)(boot_ticks() - begin));
    semihost_text("\n");
    return SAGA_OK;
}

/* Decodes every segment and draws it at two times from two cameras, as in
 * vectors/MANIFEST. */
static int play(const stream *f, const char *path)
{
    const picture first = { .index = 0, .t = 0 };
    const picture second = { .index = 1, .t = 40000 };
    uint32_t frame = 0;
    saga_decoder *dec;
    saga_segment seg;
    saga_info info;
    saga_status s = open_head(&dec, &info, f);

    if (s)
        return refuse(f, "head", s);
    for (; frame < info.n_frames; frame = seg.first_frame + seg.n_frames) {
        s = saga_find(&seg, f->bytes, (size_t)(f->end - f->bytes), frame, 1);
        if (s)
            return refuse(f, "index", s);
        if (decode(f, dec, &seg) || show(first, dec, f, seg.number, "") ||
            show(second, dec, f, seg.number, path))
            return 1;
    }
    return 0;
}

/* --- The whole ----------------------------------------------------------- */

/* A turn of the loop that calibrates the timer has two instructions. */
enum { CALIBRATION_TURNS = 1 << 20, CALIBRATION_EACH = 2 };

static void calibrate(void)
{
    const uint64_t begin = boot_ticks();
    uint32_t n = CALIBRATION_TURNS;

    __asm__ volatile("1: subs %0, #1\n\tbne 1b" : "+l"(n) : : "cc");
    semihost_text("# timer");
    measured(" instructions", CALIBRATION_EACH * CALIBRATION_TURNS);
    measured(" ticks", (uint32_t)(boot_ticks() - begin));
    semihost_text("\n");
}

int main(void)
{
    char path[64];
    const stream *f;

    calibrate();
    semihost_arguments(path, sizeof path);
    for (f = streams; f->name; f++)
        if (play(f, f[1].name ? "" : path))
            return 1;
    semihost_text("# memory");
    measured(" work", sizeof memory.work);
    measured(" scratch", sizeof memory.scratch);
    measured(" strip", sizeof memory.strip);
    measured(" stack", boot_stack_nbytes());
    semihost_text("\n");
    return 0;
}
