/* SPDX-License-Identifier: MIT
 *
 * saga-play draws the pictures of a file with several threads; it is the worked
 * example of docs/threads.md. It prints each picture's CRC-32C, which does not
 * depend on the number of threads, and at the end the time and the CPU time of
 * all threads for a picture.
 *
 *     saga-play FILE [THREADS [CAMERA [PICTURES]]] [OPTIONS]
 *
 * Options may stand anywhere. An output appears when it is complete. A Y4M file
 * does not state its colour matrix. Players use BT.601 up to 576 lines and
 * BT.709 above, and so does saga-play.
 *
 * While other threads draw a picture, the main thread prepares the next one in
 * a second decoder, and then helps to draw. A further thread decodes the next
 * segment in a third decoder.
 */
#include "saga.h"

#include "dec_options.h"
#include "dec_output.h"

#include <pthread.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

enum { MAX_THREADS = 64, ROWS = 32, LIST = 1 << 15, BUDGET = 1 << 22 };
#define NO_SEGMENT 0xffffffffu

/* A decoder's work block, and the number of the segment decoded in it. */
typedef struct {
    void *work;
    saga_decoder *dec;
    uint32_t segment;
} block;

/* A drawing thread and its own scratch memory. */
typedef struct {
    struct player *player;
    void *scratch;
    pthread_t thread;
} painter;

typedef struct player {
    unsigned char *bytes;
    size_t n;
    saga_info info;
    saga_camera camera;
    double seconds; /* limit for decoding a segment, or the base; 0: no
                     * limit */
    block shown[2]; /* blocks for even and odd pictures */
    block ahead;    /* the next segment */
    pthread_t decoding;
    int is_decoding;
    painter painters[MAX_THREADS];
    uint32_t n_threads;
    FILE *out;          /* NULL: CRCs are printed on stdout */
    unsigned char *yuv; /* three planes; NULL: out gets R, G, B */
    /* The picture being drawn. */
    const saga_decoder *dec;
    unsigned char *rgb;
    atomic_int next_row;
} player;

static void quit(int status, const char *what)
{
    fprintf(stderr, "saga-play: %s\n", what);
    exit(status);
}

static void stop(const char *what)
{
    quit(2, what);
}

static void check(saga_status s)
{
    if (s)
        quit(1, saga_status_text(s));
}

static void *need(size_t n)
{
    void *const p = aligned_alloc(64, (n + 63) & ~(size_t)63);

    if (!p)
        stop("out of memory");
    return p;
}

static void read_file(player *p, const char *path)
{
    FILE *const f = fopen(path, "rb");

    if (!f || fseeko(f, 0, SEEK_END))
        stop("cannot read the file");
    p->n = (size_t)ftello(f);
    p->bytes = need(p->n + 1);
    rewind(f);
    if (fread(p->bytes, 1, p->n, f) != p->n)
        stop("cannot read the file");
    fclose(f);
}

/* --- Segments ------------------------------------------------------------ */

static double ms_of(clockid_t clock)
{
    struct timespec t;

    clock_gettime(clock, &t);
    return 1e3 * (double)t.tv_sec + 1e-6 * (double)t.tv_nsec;
}

/* Returns whether the deadline, in ms, has passed; a saga_watch, which a
 * decoder calls in its own thread. */
static int is_late(void *user)
{
    const double *const deadline = user;

    return *deadline > 0 && ms_of(CLOCK_MONOTONIC) > *deadline;
}

static double deadline_of(const player *p)
{
    return p->seconds > 0 ? ms_of(CLOCK_MONOTONIC) + 1e3 * p->seconds : 0;
}

static void check_decoding(const player *p, saga_status s)
{
    if (s == SAGA_ERR_STOPPED) {
        fprintf(stderr,
                "saga-play: decoding took more than %g s; allow more "
                "with --seconds %g\n",
                p->seconds, 6 * p->seconds);
        exit(1);
    }
    check(s);
}

static void open_block(player *p, block *b)
{
    double deadline = deadline_of(p);
    const saga_watch watch = { is_late, &deadline };

    b->work = need(p->info.work_nbytes);
    b->segment = NO_SEGMENT;
    check_decoding(p, saga_open(&b->dec, b->work, p->info.work_nbytes, p->bytes,
                                p->n, &watch));
}

static void decode(player *p, block *b, const saga_segment *seg)
{
    double deadline = deadline_of(p);
    const saga_watch watch = { is_late, &deadline };

    if (seg->offset > p->n || seg->nbytes > p->n - seg->offset)
        quit(1, "the file ends too early");
    check_decoding(p, saga_decode(b->dec, seg, p->bytes + seg->offset,
                                  seg->nbytes, &watch));
    b->segment = seg->number;
}

/* Decodes the next segment; the main function of a thread. */
static void *decode_ahead(void *arg)
{
    player *const p = arg;
    saga_segment seg;

    check(saga_find(&seg, p->bytes, p->n, p->ahead.segment, 1));
    decode(p, &p->ahead, &seg);
    return NULL;
}

static void finish_ahead(player *p)
{
    if (p->is_decoding)
        pthread_join(p->decoding, NULL);
    p->is_decoding = 0;
}

/* Starts to decode the segment after `seg`, if there is one. Until it is
 * decoded, ahead.segment holds its first frame. */
static void begin_ahead(player *p, const saga_segment *seg)
{
    const uint32_t frame = seg->first_frame + seg->n_frames;

    if (frame >= p->info.n_frames)
        return;
    p->ahead.segment = frame;
    p->is_decoding = !pthread_create(&p->decoding, NULL, decode_ahead, p);
    if (!p->is_decoding)
        stop("cannot start a thread");
}

/* Copies a decoded block, which holds offsets and no pointers. */
static void copy(const player *p, block *to, const block *from)
{
    memcpy(to->work, from->work, p->info.work_nbytes);
    to->segment = from->segment;
}

/* Decodes the segment of a frame, unless a block already has it, and makes the
 * splats of the frame in its block. */
static void prepare(player *p, uint32_t frame)
{
    block *const b = &p->shown[frame & 1];
    const block *const other = &p->shown[~frame & 1];
    saga_segment seg;

    check(saga_find(&seg, p->bytes, p->n, frame, 1));
    /* A copy from another block takes less time than decoding again. */
    if (b->segment != seg.number && other->segment == seg.number) {
        copy(p, b, other);
    } else if (b->segment != seg.number) {
        finish_ahead(p);
        if (p->ahead.segment == seg.number)
            copy(p, b, &p->ahead);
        else
            decode(p, b, &seg);
        begin_ahead(p, &seg);
    }
    check(saga_view(b->dec, &p->camera, seg.t));
}

/* --- Pictures ------------------------------------------------------------ */

/* Draws bands of rows until none is left; the main function of a drawing
 * thread. */
static void *paint(void *arg)
{
    const painter *const me = arg;
    player *const p = me->player;
    const size_t line = 3u * p->camera.width;

    /* next_row hands each band to exactly one thread. */
    for (;;) {
        const int32_t y = atomic_fetch_add(&p->next_row, ROWS);
        const int32_t end = y + ROWS < p->camera.height ? y + ROWS
                                                        : p->camera.height;
        saga_picture picture = { p->rgb + line * (size_t)y, line, 0, 8 };
        saga_job job = { .y0 = y,
                         .x1 = p->camera.width,
                         .y1 = end,
                         .tile = 16,
                         .list_capacity = LIST,
                         .scratch = me->scratch };
        saga_status s;

        if (y >= end)
            return NULL;
        picture.nbytes = line * (size_t)(end - y);
        job.scratch_nbytes = SAGA_JOB_NBYTES(16, LIST) +
                             16u * ROWS * (p->camera.width + 16u);
        do
            s = saga_draw(p->dec, &job, &picture, BUDGET);
        while (s == SAGA_AGAIN);
        check(s);
    }
}

/* Draws `frame` with all threads. This thread first prepares the next frame. */
static void draw(player *p, uint32_t frame, int has_next)
{
    uint32_t i;

    p->dec = p->shown[frame & 1].dec;
    atomic_store(&p->next_row, 0);
    for (i = 1; i < p->n_threads; i++)
        if (pthread_create(&p->painters[i].thread, NULL, paint,
                           &p->painters[i]))
            stop("cannot start a thread");
    if (has_next)
        prepare(p, frame + 1);
    paint(&p->painters[0]);
    for (i = 1; i < p->n_threads; i++)
        pthread_join(p->painters[i].thread, NULL);
}

/* --- Output -------------------------------------------------------------- */

/* Luma is (red R + green G + blue B) / 10000. Chroma is (B - luma) /
 * (2 - blue / 5000) and (R - luma) / (2 - red / 5000). */
typedef struct {
    int32_t red, green, blue;
} luma;

static const luma bt601 = { 2990, 5870, 1140 }, bt709 = { 2126, 7152, 722 };

enum { LINES_601 = 576 }; /* players use BT.601 up to this height */

/* Returns offset + num / den, rounded to the nearest integer. It does not
 * overflow: the largest values are those of chroma, where num is at most 224 *
 * 255 * 9278 in magnitude and offset * den at most 128 * 2 * 255 * 9278. */
static unsigned char rounded(int32_t offset, int32_t num, int32_t den)
{
    return (unsigned char)((offset * den + num + den / 2) / den);
}

/* Converts RGB to planes of luma, 16 to 235, and chroma, 16 to 240. */
static void convert(unsigned char *yuv, const unsigned char *rgb,
                    size_t n_pixels, const luma *m)
{
    unsigned char *const cb = yuv + n_pixels, *const cr = cb + n_pixels;
    size_t i;

    for (i = 0; i < n_pixels; i++) {
        const int32_t r = rgb[3 * i], g = rgb[3 * i + 1], b = rgb[3 * i + 2];
        const int32_t y = m->red * r + m->green * g + m->blue * b;

        yuv[i] = rounded(16, 219 * y, 255 * 10000);
        cb[i] = rounded(128, 224 * (10000 * b - y),
                        255 * 2 * (10000 - m->blue));
        cr[i] = rounded(128, 224 * (10000 * r - y), 255 * 2 * (10000 - m->red));
    }
}

static void write_bytes(player *p, const unsigned char *bytes, size_t n)
{
    if (fwrite(bytes, 1, n, p->out) != n || fflush(p->out))
        stop("cannot write the pictures");
}

static void begin_y4m(player *p)
{
    const saga_camera *const c = &p->camera;
    const int has_rate = p->info.fps_num && p->info.fps_den;

    p->yuv = need(3u * c->width * (size_t)c->height);
    if (fprintf(p->out,
                "YUV4MPEG2 W%u H%u F%u:%u Ip A1:1 C444 "
                "XCOLORRANGE=LIMITED\n",
                c->width, c->height, has_rate ? p->info.fps_num : 25,
                has_rate ? p->info.fps_den : 1) < 0)
        stop("cannot write the pictures");
}

static void write_picture(player *p, uint32_t frame)
{
    const size_t n_pixels = p->camera.width * (size_t)p->camera.height;

    if (!p->out) {
        printf("%u %08x\n", frame, saga_crc32c(0, p->rgb, 3 * n_pixels));
        return;
    }
    if (p->yuv) {
        convert(p->yuv, p->rgb, n_pixels,
                p->camera.height <= LINES_601 ? &bt601 : &bt709);
        if (fputs("FRAME\n", p->out) < 0)
            stop("cannot write the pictures");
    }
    write_bytes(p, p->yuv ? p->yuv : p->rgb, 3 * n_pixels);
}

/* --- The command --------------------------------------------------------- */

/* The words of the command line; NULL if not given. */
typedef struct {
    const char *seconds, *y4m, *rgb;
    const char *words[4];
} command;

static const char usage[] =
    "usage: saga-play FILE [THREADS [CAMERA [PICTURES]]] [options]\n"
    "\n"
    "Draws the pictures of a .saga file, with several threads.\n"
    "\n"
    "  saga-play film.saga 2 --y4m - | mpv -\n"
    "      shows a film in a player; ffplay - reads the same\n"
    "\n"
    "CAMERA is the number of a camera of the file (default 0), also as rig:N.\n"
    "PICTURES is how many to draw (default: all). Without an output, the\n"
    "CRC-32C of each picture is printed, which is the same with any number of\n"
    "threads, and at the end the time that a picture takes.\n"
    "\n"
    "  --y4m FILE       write the pictures as YUV4MPEG2: Y'CbCr 4:4:4 with 8\n"
    "                   bits in limited range, by BT.601 up to 576 lines and\n"
    "                   by BT.709 above; - is standard output\n"
    "  --rgb FILE       write R, G and B bytes without a header instead\n"
    "  --seconds S      give up if decoding a segment takes longer\n"
    "  --version        print the version\n"
    "\n"
    "Exit status: 0 done, 1 the file's contents are refused, 2 a mistake in\n"
    "the command line, or a file cannot be read or written.\n";

/* Ends the program for a mistake in the command line. */
static void wrong(const char *what)
{
    fprintf(stderr,
            "saga-play: unknown or wrong option '%s'; see saga-play "
            "--help\n",
            SHOWN(what));
    exit(2);
}

static void read_command(command *c, int argc, char **argv)
{
    const struct {
        const char *name;
        const char **value;
    } options[] = { { "--seconds", &c->seconds },
                    { "--y4m", &c->y4m },
                    { "--rgb", &c->rgb } };
    size_t n_words = 0, k;
    int i;

    /* A word is an option with its value, or one of up to four positions. */
    for (i = 1; i < argc; i++) {
        for (k = 0; k < 3 && strcmp(argv[i], options[k].name) != 0; k++)
            ;
        /* Of two outputs only one would be written. */
        if (k < 3 && i + 1 < argc && !*options[k].value)
            *options[k].value = argv[++i];
        else if (argv[i][0] != '-' && n_words < 4)
            c->words[n_words++] = argv[i];
        else
            wrong(argv[i]);
    }
    if (!c->words[0])
        wrong("");
    if (c->y4m && c->rgb)
        wrong("--y4m --rgb");
}

static uint32_t number_of(const char *word, uint32_t otherwise)
{
    uint32_t number = otherwise;

    if (word && !dec_parse_u32(&number, word, '\0'))
        wrong(word);
    return number;
}

/* The file to which pictures are written, until it is complete. */
static dec_output output;

/* Removes an incomplete file. It runs at exit, because any thread may end the
 * program. */
static void drop_output(void)
{
    if (output.f)
        dec_output_close(&output, 0);
}

static void open_output(player *p, const char *path)
{
    if (!strcmp(path, "-")) {
        p->out = stdout;
        return;
    }
    if (atexit(drop_output) || dec_output_open(&output, path))
        stop("cannot write the pictures");
    p->out = output.f;
}

static void close_output(player *p)
{
    const int failed = output.f ? dec_output_close(&output, 1)
                       : p->out ? fclose(p->out)
                                : 0;

    output.f = NULL;
    if (failed)
        stop("cannot write the pictures");
}

static void open_player(player *p, const char *path, uint32_t camera)
{
    uint32_t number, i;

    read_file(p, path);
    check(saga_probe(&p->info, p->bytes, p->n));
    check(saga_rig(&p->camera, &number, p->bytes, p->n, camera));
    open_block(p, &p->shown[0]);
    open_block(p, &p->shown[1]);
    open_block(p, &p->ahead);
    p->rgb = need(3u * p->camera.width * (size_t)p->camera.height);
    for (i = 0; i < p->n_threads; i++) {
        p->painters[i].player = p;
        p->painters[i].scratch = need(SAGA_JOB_NBYTES(16, LIST) +
                                      16u * ROWS * (p->camera.width + 16u));
    }
}

/* Draws the first n pictures and prints the times. */
static void play(player *p, uint32_t n)
{
    double wall, cpu;
    uint32_t i;

    /* The first segment is decoded before the clocks start. */
    prepare(p, 0);
    wall = ms_of(CLOCK_MONOTONIC);
    cpu = ms_of(CLOCK_PROCESS_CPUTIME_ID);
    for (i = 0; i < n; i++) {
        draw(p, i, i + 1 < n);
        write_picture(p, i);
    }
    finish_ahead(p);
    wall = ms_of(CLOCK_MONOTONIC) - wall;
    cpu = ms_of(CLOCK_PROCESS_CPUTIME_ID) - cpu;
    fprintf(stderr,
            "%u pictures of %ux%u, %u threads: %.2f ms each, "
            "%.2f of CPU\n",
            n, p->camera.width, p->camera.height, p->n_threads,
            n ? wall / n : 0, n ? cpu / n : 0);
}

int main(int argc, char **argv)
{
    static player p;
    command c = { 0 };
    uint32_t n;

    if (argc > 1 && (!strcmp(argv[1], "--help") || !strcmp(argv[1], "-h"))) {
        fputs(usage, stdout);
        return 0;
    }
    if (argc > 1 && !strcmp(argv[1], "--version")) {
        puts("saga-play " SAGA_RELEASE ", format " SAGA_FORMAT);
        return 0;
    }
    read_command(&c, argc, argv);
    if (c.seconds && !dec_parse_seconds(&p.seconds, c.seconds))
        wrong(c.seconds);
    p.n_threads = number_of(c.words[1], 1);
    if (p.n_threads < 1 || p.n_threads > MAX_THREADS)
        wrong(c.words[1]);
    /* A camera is a number, which may have saga-dec's form rig:N. */
    if (c.words[2] && !strncmp(c.words[2], "rig:", 4))
        c.words[2] += 4;
    open_player(&p, c.words[0], number_of(c.words[2], 0));
    if (c.y4m || c.rgb)
        open_output(&p, c.y4m ? c.y4m : c.rgb);
    if (c.y4m)
        begin_y4m(&p);
    n = number_of(c.words[3], p.info.n_frames);
    play(&p, n < p.info.n_frames ? n : p.info.n_frames);
    close_output(&p);
    return 0;
}
