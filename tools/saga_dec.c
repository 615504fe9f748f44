/* SPDX-License-Identifier: MIT
 *
 * saga-dec draws a picture from a .saga file. It consists of the decoder
 * library and code that reads and writes files. It allocates nothing: all
 * memory is static, enough for the level that is chosen when building (make
 * LEVEL=n).
 */
#include "saga.h"

#include "dec_options.h"
#include "dec_output.h"

#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

#ifndef SAGA_LEVEL
#define SAGA_LEVEL 2
#endif

enum { BAND = 16, LIST = 4096, MAX_WIDTH = 16384, BUDGET = 1 << 20 };

/* The longest header, which has 1024 cameras, fits. */
enum { PROBE_NBYTES = 1 << 17 };

/* A head or a segment is read as a whole. Coded, it is smaller than the work
 * block that decodes it. */
#define INPUT_NBYTES (SAGA_WORK_MAX(SAGA_LEVEL) + PROBE_NBYTES)

static struct {
    _Alignas(SAGA_WORK_ALIGN) unsigned char work[SAGA_WORK_MAX(SAGA_LEVEL)];
    _Alignas(16) unsigned char scratch[SAGA_JOB_NBYTES(64, LIST)];
    unsigned char input[INPUT_NBYTES];
    unsigned char rows[3 * MAX_WIDTH * BAND];
} memory;

/* --- Messages ------------------------------------------------------------ */

static int refuse(const char *file, const char *what, saga_status s)
{
    fprintf(stderr, "saga-dec: %s: %s: %s\n", SHOWN(file), SHOWN(what),
            saga_status_text(s));
    if (s == SAGA_ERR_DATA)
        fprintf(
            stderr,
            "saga-dec: this is not a .saga file, or it is damaged "
            "(see `saga info`),\nor a program from before format " SAGA_FORMAT
            " wrote it and it must be encoded again\n");
    if (s == SAGA_ERR_SPACE || s == SAGA_ERR_LEVEL)
        fprintf(stderr,
                "saga-dec: this build has the memory of level %d, %lu "
                "bytes; build with `make LEVEL=3` for more\n",
                SAGA_LEVEL, (unsigned long)SAGA_WORK_MAX(SAGA_LEVEL));
    return 1;
}

static int fail(const char *file, const char *what)
{
    fprintf(stderr, "saga-dec: %s: %s: %s\n", SHOWN(file), what,
            errno ? strerror(errno) : "too short");
    return 2;
}

/* --- Input --------------------------------------------------------------- */

/* Reads up to n bytes at offset into the input buffer, at most its size.
 * Returns the number of bytes read, 0 beyond the end of the file, or -1. */
static long read_at(FILE *f, uint64_t offset, size_t n)
{
    struct stat info;

    errno = 0;
    if (fstat(fileno(f), &info))
        return -1;
    if (offset > (uint64_t)info.st_size)
        return 0;
    if (fseeko(f, (off_t)offset, SEEK_SET))
        return -1;
    if (n > sizeof memory.input)
        n = sizeof memory.input;
    n = fread(memory.input, 1, n, f);
    return ferror(f) ? -1 : (long)n;
}

static int read_camera_file(saga_camera *c, const char *name)
{
    long long v[22];
    int n = 0, ch, i;
    FILE *const f = fopen(name, "r");

    if (!f)
        return fail(name, "cannot open");
    while (n < 22 && (ch = fgetc(f)) != EOF) {
        if (ch == '#') {
            while (ch != EOF && ch != '\n')
                ch = fgetc(f);
        } else if (ch == '-' || (ch >= '0' && ch <= '9')) {
            ungetc(ch, f);
            if (fscanf(f, "%lld", &v[n]) != 1 || v[n] > INT32_MAX ||
                v[n] < INT32_MIN)
                break;
            n++;
        }
    }
    fclose(f);
    /* Sizes and the background must fit in 16 bits; the list of numbers ends at
     * one that does not. */
    for (i = 17; i < n; i++)
        if (v[i] < 0 || v[i] > 65535)
            n = i;
    if (n < 22) {
        fprintf(stderr,
                "saga-dec: %s: number %d of the camera's 22 integers "
                "is missing or out of range\n",
                SHOWN(name), n + 1);
        return 2;
    }
    for (i = 0; i < 9; i++)
        c->rotation_q30[i] = (int32_t)v[i];
    for (i = 0; i < 3; i++) {
        c->centre[i] = (int32_t)v[9 + i];
        c->background_q15[i] = (uint16_t)v[19 + i];
    }
    for (i = 0; i < 2; i++) {
        c->focal_q16[i] = (int32_t)v[12 + i];
        c->principal_q16[i] = (int32_t)v[14 + i];
    }
    c->near_plane = (int32_t)v[16];
    c->width = (uint16_t)v[17];
    c->height = (uint16_t)v[18];
    return 0;
}

static int read_camera(saga_camera *c, const dec_options *o, size_t head_nbytes)
{
    const char *text = o->camera;
    uint32_t index, number;
    saga_status s;

    if (!strncmp(text, "rig:", 4))
        text += 4;
    else if (!dec_parse_u32(&index, text, '\0'))
        return read_camera_file(c, text);
    if (!dec_parse_u32(&index, text, '\0')) {
        fprintf(stderr,
                "saga-dec: '%s' is not a camera of the file; see "
                "--info\n",
                SHOWN(o->camera));
        return 2;
    }
    s = saga_rig(c, &number, memory.input, head_nbytes, index);
    return s ? refuse(o->file, o->camera, s) : 0;
}

/* --- Output -------------------------------------------------------------- */

/* Draws rows y0..y1 of the view into memory.rows. */
static saga_status draw_band(const saga_decoder *dec, const saga_camera *c,
                             int32_t y0, int32_t y1)
{
    saga_picture picture;
    saga_job job;
    saga_status s;

    memset(&job, 0, sizeof job);
    job.x1 = c->width;
    job.y0 = y0;
    job.y1 = y1;
    job.tile = BAND;
    job.list_capacity = LIST;
    job.scratch = memory.scratch;
    job.scratch_nbytes = sizeof memory.scratch;
    picture.rgb = memory.rows;
    picture.stride_nbytes = 3u * c->width;
    picture.nbytes = sizeof memory.rows;
    picture.bits = 8;
    /* saga_draw returns after each BUDGET of work. */
    do
        s = saga_draw(dec, &job, &picture, BUDGET);
    while (s == SAGA_AGAIN);
    return s;
}

/* Draws the picture band by band, writes it to f, which may be NULL, and
 * updates its CRC. Returns an exit status. */
static int draw(const dec_options *o, const saga_decoder *dec,
                const saga_camera *c, FILE *f, uint32_t *crc)
{
    int32_t y;

    for (y = 0; y < c->height; y += BAND) {
        const int32_t end = y + BAND < c->height ? y + BAND : c->height;
        const size_t n = 3u * c->width * (size_t)(end - y);
        const saga_status s = draw_band(dec, c, y, end);

        if (s)
            return refuse(o->file, "cannot draw", s);
        *crc = saga_crc32c(*crc, memory.rows, n);
        errno = 0;
        if (f && fwrite(memory.rows, 1, n, f) != n)
            return fail(o->out, "cannot write");
    }
    return 0;
}

static int write_picture(const dec_options *o, const saga_decoder *dec,
                         const saga_camera *c, uint32_t *crc)
{
    static dec_output out;
    int status;

    if (dec_output_open(&out, o->out))
        return fail(o->out, "cannot write");
    fprintf(out.f, "P6\n%u %u\n255\n", c->width, c->height);
    status = draw(o, dec, c, out.f, crc);
    if (dec_output_close(&out, !status) && !status)
        return fail(o->out, "cannot write");
    return status;
}

static void print_info(const saga_info *i)
{
    printf("version     %" PRIu32 ", level %" PRIu32 "\n"
           "segments    %" PRIu32 ", frames %" PRIu32 " at %" PRIu32 "/%" PRIu32
           " per second\n"
           "cameras     %" PRIu32 "\n"
           "at most     %" PRIu32 " coarse, %" PRIu32 " fine anchors, %" PRIu32
           " primitives a segment\n"
           "networks    %" PRIu32 " weights in %" PRIu32 " bytes\n"
           "memory      %zu bytes\n"
           "decoding    %" PRIu64 " multiply-accumulates a segment, %" PRIu32
           " a primitive and picture\n",
           i->version, i->level, i->n_segments, i->n_frames, i->fps_num,
           i->fps_den, i->n_cameras, i->max_coarse, i->max_fine,
           i->max_primitives, i->n_weights, i->nets_nbytes, i->work_nbytes,
           i->decode_macs, i->view_macs);
    if (i->n_layers > 1)
        printf("layers      %" PRIu32 "\n", i->n_layers);
    if (i->base_coarse)
        printf("base        %" PRIu32 " coarse, %" PRIu32
               " fine anchors, %" PRIu32 " primitives in %" PRIu32 " bytes\n",
               i->base_coarse, i->base_fine, i->base_primitives,
               i->base_nbytes);
}

/* --- Together ------------------------------------------------------------ */

static double now(void)
{
    struct timespec t;

    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static int is_late(void *user)
{
    return now() > *(const double *)user;
}

static int refuse_late(const dec_options *o)
{
    fprintf(stderr,
            "saga-dec: %s: decoding took more than %g s; allow more "
            "with --seconds %g\n",
            SHOWN(o->file), o->seconds, 6 * o->seconds);
    return 1;
}

static int refuse_cover(const dec_options *o, const saga_decoder *dec,
                        uint32_t level, const saga_camera *c)
{
    saga_report r;

    saga_tell(&r, dec);
    fprintf(stderr,
            "saga-dec: %s: the stream exceeds its level: splats would "
            "cover the picture %.0f times, level %" PRIu32 " allows %u; move "
            "the camera away\n",
            SHOWN(o->camera), (double)r.box_pixels / c->width / c->height,
            level, SAGA_COVER_MAX(level));
    return 1;
}

/* Reads and decodes a segment. A file that ends early may still have complete
 * layers, so that missing bytes are not an error here. A segment that claims to
 * be larger than the buffer is decoded as far as it was read: if its beginning
 * is already wrong, that is the error that is reported. */
static int decode(const dec_options *o, FILE *f, saga_decoder *dec,
                  const saga_segment *seg, const saga_watch *watch)
{
    const size_t most = sizeof memory.input;
    const long n = read_at(f, seg->offset, seg->nbytes);
    saga_status s;

    if (n < 0)
        return fail(o->file, "cannot read the segment");
    s = saga_decode(dec, seg, memory.input, (size_t)n, watch);
    if (s == SAGA_ERR_STOPPED)
        return refuse_late(o);
    if (s != SAGA_ERR_DATA && (size_t)n == most && seg->nbytes > most)
        s = SAGA_ERR_SPACE;
    return s ? refuse(o->file, "cannot decode the segment", s) : 0;
}

/* Reads, decodes and draws from the open file f. Returns an exit status. */
static int draw_picture(const dec_options *o, FILE *f, const saga_info *info)
{
    double deadline = now() + o->seconds;
    const saga_watch clock = { is_late, &deadline };
    const saga_watch *const watch = o->seconds > 0 ? &clock : NULL;
    saga_decoder *dec;
    saga_segment seg;
    saga_camera camera;
    saga_status s;
    uint32_t crc = 0;
    long n;
    int status;

    /* The head of the file has the networks and the base, which are the
     * primitives that all segments share. */
    n = read_at(f, 0, info->head_nbytes);
    if (n < 0)
        return fail(o->file, "cannot read the head");
    if (info->work_nbytes > sizeof memory.work ||
        ((size_t)n == sizeof memory.input &&
         info->head_nbytes > sizeof memory.input))
        return refuse(o->file, "cannot decode", SAGA_ERR_SPACE);
    s = saga_open(&dec, memory.work, sizeof memory.work, memory.input,
                  (size_t)n, watch);
    if (s == SAGA_ERR_STOPPED)
        return refuse_late(o);
    if (s)
        return refuse(o->file, "cannot decode the networks", s);
    status = read_camera(&camera, o, info->head_nbytes);
    if (status)
        return status;
    /* Find and decode the segment at this time. */
    s = saga_find(&seg, memory.input, info->head_nbytes, o->time_num,
                  o->time_den);
    if (s)
        return refuse(o->file, "cannot find the time", s);
    status = decode(o, f, dec, &seg, watch);
    if (status)
        return status;
    /* Draw the picture. */
    s = saga_view(dec, &camera, seg.t);
    if (s == SAGA_ERR_LEVEL)
        return refuse_cover(o, dec, info->level, &camera);
    if (s)
        return refuse(o->camera, "cannot use the camera", s);
    status = o->out ? write_picture(o, dec, &camera, &crc)
                    : draw(o, dec, &camera, NULL, &crc);
    if (!status && o->crc)
        printf("%08" PRIx32 "\n", crc);
    return status;
}

/* Flushes stdout. Returns status, or a failure if that could not be written,
 * for example because the disk is full. */
static int flushed(int status)
{
    errno = 0;
    if ((fflush(stdout) || ferror(stdout)) && !status)
        return fail("standard output", "cannot write");
    return status;
}

/* Opens a file without blocking, so that a pipe without a writer is refused
 * instead of waited for. */
static FILE *open_input(const char *name)
{
    const int fd = open(name, O_RDONLY | O_NONBLOCK);
    struct stat info;

    if (fd < 0 || fstat(fd, &info)) {
        fail(name, "cannot open");
        return NULL;
    }
    if (S_ISREG(info.st_mode))
        return fdopen(fd, "rb");
    close(fd);
    fprintf(stderr, "saga-dec: %s: is not a regular file\n", SHOWN(name));
    return NULL;
}

int main(int argc, char **argv)
{
    dec_options o = { .time_den = 1 };
    saga_info info;
    saga_status s;
    FILE *f;
    long n;
    int status = 0;

    if (argc > 1 && !strcmp(argv[1], "--help")) {
        fputs(dec_usage, stdout);
        return flushed(0);
    }
    if (argc > 1 && !strcmp(argv[1], "--version")) {
        printf("saga-dec %s, format %s, level %d\n", SAGA_RELEASE, SAGA_FORMAT,
               SAGA_LEVEL);
        return flushed(0);
    }
    if (!dec_parse_options(&o, argc, argv))
        return 2;
    /* The header tells whether this is a .saga file, before more is read. */
    f = open_input(o.file);
    if (!f)
        return 2;
    n = read_at(f, 0, PROBE_NBYTES);
    s = n < 0 ? SAGA_OK : saga_probe(&info, memory.input, (size_t)n);
    if (n < 0)
        status = fail(o.file, "cannot read");
    else if (s)
        status = refuse(o.file, "not a file that this decoder supports", s);
    else if (o.info)
        print_info(&info);
    else
        status = draw_picture(&o, f, &info);
    fclose(f);
    return flushed(status);
}
