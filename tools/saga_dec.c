/* SPDX-License-Identifier: MIT
 *
 * saga-dec: a picture from a .saga file, with the decoder library and the
 * reading and writing of files, nothing else. It allocates nothing: all memory
 * is static, its size a level's, chosen when building (make LEVEL=n).
 */
#include "saga.h"

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

#ifndef SAGA_LEVEL
#define SAGA_LEVEL 2
#endif

enum { BAND = 16, LIST = 4096, MAX_WIDTH = 16384, BUDGET = 1 << 20 };

/* The longest header: 1024 cameras. */
enum { PROBE_NBYTES = 1 << 17 };

/* A head or a segment is read at once, and is smaller coded than decoded. */
#define INPUT_NBYTES (SAGA_WORK_MAX(SAGA_LEVEL) + PROBE_NBYTES)

static struct {
    _Alignas(SAGA_WORK_ALIGN) unsigned char work[SAGA_WORK_MAX(SAGA_LEVEL)];
    _Alignas(16) unsigned char scratch[SAGA_JOB_NBYTES(64, LIST)];
    unsigned char input[INPUT_NBYTES];
    unsigned char rows[3 * MAX_WIDTH * BAND];
} memory;

typedef struct {
    const char *file, *camera, *out;
    uint32_t time_num, time_den;
    double seconds;          /* of decoding, at most; 0: any */
    int crc, info;
} options;

static const char usage[] =
    "usage: saga-dec FILE --camera CAM [--time N/D] (-o OUT.ppm | --crc)\n"
    "       saga-dec FILE --info\n"
    "       saga-dec --version\n"
    "\n"
    "Draws one picture of a .saga file, the same bits on every machine.\n"
    "\n"
    "  --camera rig:N   camera N of the rig stored in the file (--info lists\n"
    "                   how many there are)\n"
    "  --camera FILE    a text file of 22 integers in saga_camera's order\n"
    "                   (decoder/saga.h): rotation 9, centre 3, focal 2,\n"
    "                   principal 2, near plane, width, height, background 3;\n"
    "                   # begins a comment\n"
    "  --time N/D       the time in frames, a fraction (default 0/1; 15/2\n"
    "                   lies half-way between frames 7 and 8)\n"
    "  -o OUT.ppm       write the picture (8 bits, binary PPM); a device or a\n"
    "                   pipe is written directly\n"
    "  --seconds S      give up when decoding takes longer (default: never;\n"
    "                   the longest file of level 2 takes some seconds)\n"
    "  --crc            print the CRC-32C of its pixels instead\n"
    "  --info           print what the header says and stop\n"
    "  --version        print the program's version and the level of its\n"
    "                   memory\n"
    "\n"
    "Exit status: 0 done, 1 the stream or the camera is refused, 2 a file or\n"
    "the command line.\n";

/* --- Messages ------------------------------------------------------------ */

static int refuse(const char *file, const char *what, saga_status s)
{
    fprintf(stderr, "saga-dec: %s: %s: %s\n", file, what,
            saga_status_text(s));
    if (s == SAGA_ERR_DATA)
        fprintf(stderr, "saga-dec: no .saga file, a damaged one (`saga info` "
                "tells), or one\nof an earlier pre-release of saga\n");
    if (s == SAGA_ERR_SPACE || s == SAGA_ERR_LEVEL)
        fprintf(stderr, "saga-dec: this build's memory is level %d's, %lu "
                "bytes; build with `make LEVEL=3` for more\n", SAGA_LEVEL,
                (unsigned long)SAGA_WORK_MAX(SAGA_LEVEL));
    return 1;
}

static int fail(const char *file, const char *what)
{
    fprintf(stderr, "saga-dec: %s: %s: %s\n", file, what,
            errno ? strerror(errno) : "too short");
    return 2;
}

/* --- Command line -------------------------------------------------------- */

/* A number of 32 bits, all of text up to `end`. */
static int parse_u32(uint32_t *v, const char *text, char end)
{
    char *stop;
    unsigned long long x;

    errno = 0;
    x = strtoull(text, &stop, 10);
    *v = (uint32_t)x;
    return text[0] >= '0' && text[0] <= '9' && *stop == end && !errno &&
           x <= 0xffffffffu;
}

static int parse_time(options *o, const char *text)
{
    const char *const slash = strchr(text, '/');

    o->time_den = 1;
    if (!slash)
        return parse_u32(&o->time_num, text, '\0');
    return parse_u32(&o->time_num, text, '/') &&
           parse_u32(&o->time_den, slash + 1, '\0') && o->time_den > 0;
}

static int parse_seconds(options *o, const char *text)
{
    char *stop;

    o->seconds = strtod(text, &stop);
    return stop != text && *stop == '\0' && o->seconds > 0 &&
           o->seconds <= 1e9;
}

static int parse_options(options *o, int argc, char **argv)
{
    int i;

    for (i = 1; i < argc; i++) {
        const char *const value = i + 1 < argc ? argv[i + 1] : NULL;

        if (!strcmp(argv[i], "--crc"))
            o->crc = 1;
        else if (!strcmp(argv[i], "--info"))
            o->info = 1;
        else if (!strcmp(argv[i], "--camera") && value)
            o->camera = argv[++i];
        else if (!strcmp(argv[i], "-o") && value)
            o->out = argv[++i];
        else if (!strcmp(argv[i], "--time") && value && parse_time(o, value))
            i++;
        else if (!strcmp(argv[i], "--seconds") && value &&
                 parse_seconds(o, value))
            i++;
        else if (argv[i][0] != '-' && !o->file)
            o->file = argv[i];
        else {
            fprintf(stderr, "saga-dec: cannot use '%s'%s%s; --help explains\n",
                    argv[i], value ? " with " : "", value ? value : "");
            return 0;
        }
    }
    if (!o->file || (!o->info && (!o->camera || (!o->crc && !o->out)))) {
        fputs(usage, stderr);
        return 0;
    }
    return 1;
}

/* --- Input --------------------------------------------------------------- */

/* Up to n bytes at offset into the input buffer, as many as it holds; how many
 * came, 0 beyond the file's end, or -1. */
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
    for (i = 17; i < n; i++)
        if (v[i] < 0 || v[i] > 65535)
            n = i;
    if (n < 22) {
        fprintf(stderr, "saga-dec: %s: number %d of the camera's 22 integers "
                "is missing or out of range\n", name, n + 1);
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

static int read_camera(saga_camera *c, const options *o, size_t head_nbytes)
{
    uint32_t index, number;
    saga_status s;

    if (strncmp(o->camera, "rig:", 4) != 0)
        return read_camera_file(c, o->camera);
    if (!parse_u32(&index, o->camera + 4, '\0')) {
        fprintf(stderr, "saga-dec: '%s' names no camera of the rig\n",
                o->camera);
        return 2;
    }
    s = saga_rig(c, &number, memory.input, head_nbytes, index);
    return s ? refuse(o->file, o->camera, s) : 0;
}

/* --- Output -------------------------------------------------------------- */

/* Rows y0..y1 of the view into memory.rows. */
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
    do
        s = saga_draw(dec, &job, &picture, BUDGET);
    while (s == SAGA_AGAIN);
    return s;
}

/* The picture band by band: into f (may be NULL) and its CRC. 0, 1 or 2. */
static int draw(const options *o, const saga_decoder *dec,
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

/* A picture's file: written beside its place and renamed when it is whole, as
 * all output of saga is. What is no regular file is written directly. */
typedef struct {
    FILE *f;
    char path[PATH_MAX];         /* links followed */
    char part[PATH_MAX];         /* empty: written directly */
} output;

#define PART ".saga-part-"

/* Removes a part whose writer was killed: nobody has it locked. */
static void remove_part(const char *part)
{
    const int fd = open(part, O_RDONLY | O_NOFOLLOW | O_NONBLOCK);
    struct stat info;

    if (fd < 0)
        return;
    if (fstat(fd, &info) == 0 && S_ISREG(info.st_mode) &&
        flock(fd, LOCK_EX | LOCK_NB) == 0)
        unlink(part);
    close(fd);
}

/* Looks for parts of the path that are left. */
static void sweep(const char *path)
{
    const char *const slash = strrchr(path, '/');
    const char *const base = slash ? slash + 1 : path;
    const int n = (int)(base - path);
    const size_t n_base = strlen(base);
    static char folder[PATH_MAX], part[PATH_MAX];
    struct dirent *e;
    DIR *dir;

    snprintf(folder, sizeof folder, "%.*s", n, path);
    dir = opendir(n ? folder : ".");
    while (dir && (e = readdir(dir)) != NULL) {
        const char *const rest = e->d_name + n_base + sizeof PART - 1;

        if (strncmp(e->d_name, base, n_base) != 0 ||
            strncmp(e->d_name + n_base, PART, sizeof PART - 1) != 0 ||
            !*rest || rest[strspn(rest, "0123456789-")])
            continue;
        if (snprintf(part, sizeof part, "%s%s", folder, e->d_name) <
            (int)sizeof part)
            remove_part(part);
    }
    if (dir)
        closedir(dir);
}

/* A new part, locked as long as it is open; -1 with errno. */
static int create_part(output *out, const struct stat *old)
{
    int fd = -1, i;

    for (i = 0; i < 1000 && fd < 0; i++) {
        struct stat info;

        if (snprintf(out->part, sizeof out->part, "%s" PART "%ld-%d",
                     out->path, (long)getpid(), i) >= (int)sizeof out->part)
            errno = ENAMETOOLONG;
        else
            fd = open(out->part, O_WRONLY | O_CREAT | O_EXCL, 0666);
        if (fd < 0 && errno != EEXIST)
            return -1;
        if (fd < 0)
            continue;
        /* Another one's sweep may have taken it before it was locked. */
        flock(fd, LOCK_EX);
        if (fstat(fd, &info) == 0 && info.st_nlink > 0)
            break;
        close(fd);
        fd = -1;
    }
    if (fd >= 0 && old)
        fchmod(fd, old->st_mode & 0777);
    return fd;
}

static int open_output(output *out, const char *name)
{
    struct stat old;
    int exists, fd;

    out->part[0] = '\0';
    if (strlen(name) >= sizeof out->path) {
        errno = ENAMETOOLONG;
        return fail(name, "cannot write");
    }
    if (!realpath(name, out->path))
        strcpy(out->path, name);
    exists = stat(out->path, &old) == 0;
    if (exists && !S_ISREG(old.st_mode)) {
        fd = open(out->path, O_WRONLY);
    } else {
        sweep(out->path);
        fd = create_part(out, exists ? &old : NULL);
    }
    out->f = fd < 0 ? NULL : fdopen(fd, "wb");
    return out->f ? 0 : fail(name, "cannot write");
}

/* status: of what was written. */
static int close_output(output *out, const char *name, int status)
{
    if (!status && fflush(out->f))
        status = fail(name, "cannot write");
    if (!status && out->part[0] && rename(out->part, out->path))
        status = fail(name, "cannot write");
    if (fclose(out->f) && !status && !out->part[0])
        status = fail(name, "cannot write");
    if (status && out->part[0])
        unlink(out->part);
    return status;
}

static int write_picture(const options *o, const saga_decoder *dec,
                         const saga_camera *c, uint32_t *crc)
{
    static output out;
    int status = open_output(&out, o->out);

    if (status)
        return status;
    fprintf(out.f, "P6\n%u %u\n255\n", c->width, c->height);
    status = draw(o, dec, c, out.f, crc);
    return close_output(&out, o->out, status);
}

static void print_info(const saga_info *i)
{
    printf("version     %" PRIu32 ", level %" PRIu32 "\n"
           "segments    %" PRIu32 ", frames %" PRIu32 " at %" PRIu32 "/%"
           PRIu32 " per second\n"
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
        printf("base        %" PRIu32 " coarse, %" PRIu32 " fine anchors, %"
               PRIu32 " primitives in %" PRIu32 " bytes\n", i->base_coarse,
               i->base_fine, i->base_primitives, i->base_nbytes);
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

static int refuse_late(const options *o)
{
    fprintf(stderr, "saga-dec: %s: decoding took more than %g s; allow more "
            "with --seconds %g\n", o->file, o->seconds, 6 * o->seconds);
    return 1;
}

static int refuse_cover(const options *o, const saga_decoder *dec,
                        uint32_t level, const saga_camera *c)
{
    saga_report r;

    saga_tell(&r, dec);
    fprintf(stderr, "saga-dec: %s: the stream exceeds its level: splats would "
            "cover the picture %.0f times, level %" PRIu32 " allows %u; move "
            "the camera away\n", o->camera,
            (double)r.box_pixels / c->width / c->height, level,
            SAGA_COVER_MAX(level));
    return 1;
}

/* A file that ends early may still have layers that are whole. A segment that
 * claims to be larger than all memory is looked at nevertheless: its beginning
 * tells whether that is so. */
static int decode(const options *o, FILE *f, saga_decoder *dec,
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

/* Reads, decodes and draws; f is the open file. */
static int run(const options *o, FILE *f, const saga_info *info)
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
    s = saga_find(&seg, memory.input, info->head_nbytes, o->time_num,
                  o->time_den);
    if (s)
        return refuse(o->file, "cannot find the time", s);
    status = decode(o, f, dec, &seg, watch);
    if (status)
        return status;
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

/* Output that could not be written is a failure: the disk may be full. */
static int flushed(int status)
{
    errno = 0;
    if ((fflush(stdout) || ferror(stdout)) && !status)
        return fail("standard output", "cannot write");
    return status;
}

/* The file, without waiting for somebody to write into a pipe. */
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
    fprintf(stderr, "saga-dec: %s: is not a regular file\n", name);
    return NULL;
}

int main(int argc, char **argv)
{
    options o = { .time_den = 1 };
    saga_info info;
    saga_status s;
    FILE *f;
    long n;
    int status = 0;

    if (argc > 1 && !strcmp(argv[1], "--help")) {
        fputs(usage, stdout);
        return flushed(0);
    }
    if (argc > 1 && !strcmp(argv[1], "--version")) {
        printf("saga-dec %s, level %d\n", SAGA_RELEASE, SAGA_LEVEL);
        return flushed(0);
    }
    if (!parse_options(&o, argc, argv))
        return 2;
    f = open_input(o.file);
    if (!f)
        return 2;
    n = read_at(f, 0, PROBE_NBYTES);
    s = n < 0 ? SAGA_OK : saga_probe(&info, memory.input, (size_t)n);
    if (n < 0)
        status = fail(o.file, "cannot read");
    else if (s)
        status = refuse(o.file, "not a stream this decoder takes", s);
    else if (o.info)
        print_info(&info);
    else
        status = run(&o, f, &info);
    fclose(f);
    return flushed(status);
}
