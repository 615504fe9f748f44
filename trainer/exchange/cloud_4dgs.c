/* SPDX-License-Identifier: MIT */
#include "cloud_4dgs.h"

#include "alloc.h"
#include "cloud_files.h"

#include <math.h>
#include <stdlib.h>
#include <zlib.h>
#include <zstd.h>

enum {
    MAGIC_NBYTES = SAGA_4DGS_MAGIC_NBYTES,
    MOST_SPLATS = 1 << 24,   /* in a frame */
    MOST_FRAMES = 65535,
    ZLIB_RATIO = 1032,       /* highest ratios of packing */
    ZSTD_RATIO = 1 << 15,
    NAME_NBYTES = 64
};

static const uint8_t magic[MAGIC_NBYTES] = {
    0x89, '4', 'D', 'G', 'S', '1', '\r', '\n'
};

/* Kinds of records. */
enum {
    HEADER = 1, FOOTER = 2, STEPS = 3, WINDOWS = 4, CHUNK = 5, BAND = 7,
    METADATA = 0x0b, TRACK = 0x25
};

/* Attributes have their numbers in the chunks. */
enum {
    POSITION, SCALE, ROTATION_INDEX, ROTATION, COLOUR, OPACITY, MOTION, MIDDLE,
    SIGMA, FLAGS, WINDOW, N_ATTRIBUTES
};

static const int n_channels[N_ATTRIBUTES] = { 3, 3, 1, 3, 3, 1, 3, 1, 1, 1, 1 };

/* Steps in the order of their record. */
enum {
    STEP_POSITION, STEP_LOG_SCALE, STEP_ROTATION, STEP_COLOUR, STEP_OPACITY,
    STEP_MOTION, STEP_TIME, STEP_LOG_SIGMA, N_STEPS
};

/* The numbers of a stream. */
typedef struct {
    int32_t *value;          /* (n, channels), or (channels) of a constant */
    int channels;
    bool constant;
} numbers;

typedef struct {
    double from, to;         /* seconds */
    uint32_t n;
    saga_cursor streams;
    saga_cursor band[SAGA_MAX_DEGREE]; /* next is NULL: none */
} chunk;

struct saga_4dgs {
    const char *path;
    int n_frames, degree;
    double fps, duration;
    double cutoff;           /* splats that have faded below it are not seen */
    double reach;            /* after that many sigmas */
    uint64_t n;              /* splats of all chunks, as the header has it */
    double origin[3], step[N_STEPS];
    const uint8_t *window;   /* (n_windows, 2) f64 seconds */
    uint32_t n_windows;
    chunk *chunks;
    size_t n_chunks;
    bool has_head, has_steps;
};

static bool damaged(const saga_4dgs *f, const char *what, saga_error *error)
{
    return saga_fail(error, f->path, "copy it again", "is damaged: %s", what);
}

/* --- Bytes --------------------------------------------------------------- */

/* Takes n bytes, which have a cursor of their own. */
static saga_cursor take_block(saga_cursor *c, uint64_t n)
{
    saga_cursor block = { c->next, c->next, c->failed };

    if (n > saga_left(c))
        c->failed = block.failed = true;
    else if (saga_take(c, (size_t)n))
        block.end += n;
    return block;
}

/* Takes a text, which is cut for messages; their terminal gets no control
 * characters. */
static void take_text(char name[NAME_NBYTES], saga_cursor *c)
{
    const saga_cursor text = take_block(c, saga_take_le(c, 4));
    size_t n = 0;

    for (; n < saga_left(&text) && n < NAME_NBYTES - 1; n++)
        name[n] = text.next[n] < ' ' || text.next[n] > '~'
                ? '?' : (char)text.next[n];
    name[n] = '\0';
}

/* Takes a list of names with texts. Colours must not be said to be linear. */
static bool take_map(const saga_4dgs *f, saga_cursor *c, saga_error *error)
{
    saga_cursor map = take_block(c, saga_take_le(c, 4));

    while (!map.failed && saga_left(&map)) {
        char key[NAME_NBYTES], value[NAME_NBYTES];

        take_text(key, &map);
        take_text(value, &map);
        if (!strcmp(key, "color_space") &&
            strcmp(value, "srgb-rec709-display") != 0)
            return saga_fail(error, f->path, "export it with colours in sRGB",
                             "has colours in the space '%s'", value);
    }
    return !map.failed || damaged(f, "its metadata are cut short", error);
}

/* --- Records ------------------------------------------------------------- */

static bool take_head(saga_4dgs *f, saga_cursor *c, saga_error *error)
{
    char name[NAME_NBYTES];

    take_text(name, c);      /* the profile */
    take_text(name, c);      /* the program that wrote it */
    f->duration = saga_take_f64(c);
    f->n = saga_take_le(c, 8);
    f->cutoff = saga_take_f64(c);
    take_text(name, c);
    (void)take_block(c, 6 * 8); /* bounds */
    f->degree = (int)saga_take_le(c, 1);
    (void)saga_take_le(c, 1); /* flags of sounds and packing */
    if (c->failed || f->degree > SAGA_MAX_DEGREE ||
        !(f->cutoff >= 0.0 && f->cutoff <= 1.0))
        return damaged(f, "its header", error);
    if (strcmp(name, "gaussian-birth") != 0)
        return saga_fail(error, f->path, "export it as gaussian-birth",
                         "has splats of the temporal model '%s'", name);
    f->reach = sqrt(-2.0 * log(f->cutoff));
    f->has_head = true;
    return take_map(f, c, error);
}

static bool take_steps(saga_4dgs *f, saga_cursor *c, saga_error *error)
{
    char scheme[NAME_NBYTES];
    bool ok = true;

    take_text(scheme, c);
    for (int i = 0; i < 3; i++) {
        f->origin[i] = saga_take_f64(c);
        ok = ok && isfinite(f->origin[i]);
    }
    for (int i = 0; i < N_STEPS; i++) {
        f->step[i] = saga_take_f64(c);
        ok = ok && isfinite(f->step[i]) && f->step[i] > 0.0;
    }
    if (c->failed || !ok || f->has_steps)
        return damaged(f, "its steps", error);
    if (strcmp(scheme, "uniform-v1") != 0)
        return saga_fail(error, f->path, "export it as uniform-v1", "has "
                         "numbers of the scheme '%s'", scheme);
    f->has_steps = true;
    return true;
}

static bool take_windows(saga_4dgs *f, saga_cursor *c, saga_error *error)
{
    const uint32_t n = (uint32_t)saga_take_le(c, 4);
    const saga_cursor all = take_block(c, (uint64_t)n * 16);

    if (c->failed || f->window)
        return damaged(f, "its table of windows", error);
    for (size_t i = 0; i < 2 * (size_t)n; i++)
        if (isnan(saga_load_f64(all.next + 8 * i)))
            return damaged(f, "a window", error);
    f->window = all.next;
    f->n_windows = n;
    return true;
}

static bool take_chunk(saga_4dgs *f, saga_cursor *c, saga_error *error)
{
    chunk *const all = saga_realloc(f->chunks, f->n_chunks + 1, sizeof *all,
                                    f->path, error);
    chunk k = { .n = 0 };
    char codec[NAME_NBYTES];
    uint64_t nbytes;

    if (!all)
        return false;
    f->chunks = all;
    k.from = saga_take_f64(c);
    k.to = saga_take_f64(c);
    (void)saga_take_le(c, 4); /* the level */
    k.n = (uint32_t)saga_take_le(c, 4);
    take_text(codec, c);
    nbytes = saga_take_le(c, 8);
    k.streams = take_block(c, saga_take_le(c, 8));
    if (codec[0])
        return saga_fail(error, f->path, "export it with streams that are "
                         "packed one by one", "has a chunk that is packed as a "
                         "whole, by '%s'", codec);
    if (c->failed || nbytes != saga_left(&k.streams))
        return damaged(f, "a chunk", error);
    all[f->n_chunks++] = k;
    return true;
}

/* Takes harmonics of one degree, which belong to the last chunk. */
static bool take_band(saga_4dgs *f, saga_cursor *c, saga_error *error)
{
    const int degree = (int)saga_take_le(c, 1);
    chunk *const k = f->n_chunks ? &f->chunks[f->n_chunks - 1] : NULL;

    if (!k || degree < 1 || degree > f->degree || k->band[degree - 1].next)
        return damaged(f, "harmonics without a chunk", error);
    k->band[degree - 1] = *c;
    return true;
}

static bool take_record(saga_4dgs *f, int kind, saga_cursor *c,
                        saga_error *error)
{
    char name[NAME_NBYTES];

    if (f->has_head != (kind != HEADER))
        return damaged(f, "it does not begin with its only header", error);
    switch (kind) {
    case HEADER:
        return take_head(f, c, error);
    case STEPS:
        return take_steps(f, c, error);
    case WINDOWS:
        return take_windows(f, c, error);
    case CHUNK:
        return take_chunk(f, c, error);
    case BAND:
        return take_band(f, c, error);
    case TRACK:
        return saga_fail(error, f->path, "export it without them", "has "
                         "records of Object Track, which are not read");
    case METADATA:
        take_text(name, c);
        return take_map(f, c, error);
    default:
        return true;
    }
}

/* Takes all records up to the footer, behind which only the magic may be. */
static bool take_records(saga_4dgs *f, saga_cursor c, saga_error *error)
{
    int kind = 0;

    while (kind != FOOTER) {
        saga_cursor record;

        kind = (int)saga_take_le(&c, 1);
        record = take_block(&c, saga_take_le(&c, 8));
        if (c.failed)
            return damaged(f, "it is cut short", error);
        if (!take_record(f, kind, &record, error))
            return false;
    }
    return (saga_left(&c) == MAGIC_NBYTES &&
            memcmp(c.next, magic, MAGIC_NBYTES) == 0) ||
           damaged(f, "it does not end behind its footer", error);
}

/* Checks what the records say together. */
static bool check(saga_4dgs *f, saga_error *error)
{
    const double n_frames = ceil(f->duration * f->fps - 1e-6);
    uint64_t n = 0;

    for (size_t i = 0; i < f->n_chunks; i++) {
        n += f->chunks[i].n;
        for (int d = 0; d < f->degree; d++)
            if (!f->chunks[i].band[d].next)
                return damaged(f, "a chunk without its harmonics", error);
    }
    if (n != f->n || !f->has_steps)
        return damaged(f, "its number of splats, or no steps", error);
    if (!(f->duration > 0.0 && n_frames <= MOST_FRAMES))
        return saga_fail(error, f->path, "take another frame rate (--fps)",
                         "lasts %g s, which are not 1 to %d frames at %g fps",
                         f->duration, MOST_FRAMES, f->fps);
    f->n_frames = n_frames > 1.0 ? (int)n_frames : 1;
    return true;
}

/* --- Streams ------------------------------------------------------------- */

static bool unpack(uint8_t *to, size_t n, const saga_cursor *packed, int codec)
{
    uLongf n_zlib = (uLongf)n;
    uLong n_packed = (uLong)saga_left(packed);

    return codec == 1 ? ZSTD_decompress(to, n, packed->next,
                                        saga_left(packed)) == n
         : uncompress2(to, &n_zlib, packed->next, &n_packed) == Z_OK &&
           n_zlib == n && n_packed == saga_left(packed);
}

/* Makes signed numbers of n symbols in planes of bytes; those of differences
 * are added up, with wrapping, so that damaged files overflow nothing. */
static void join_planes(numbers *to, const uint8_t *planes, size_t n, int width,
                        bool differences)
{
    const size_t channels = (size_t)to->channels;

    for (size_t i = 0; i < n; i++) {
        uint32_t x = 0;

        for (int k = 0; k < width; k++)
            x |= (uint32_t)planes[(size_t)k * n + i] << 8 * k;
        x = x >> 1 ^ (0 - (x & 1));
        if (differences && i >= channels)
            x += (uint32_t)to->value[i - channels];
        to->value[i] = (int32_t)x;
    }
}

enum { DIFFERENCES = 1, CONSTANT = 2 };

/* Takes a stream behind its first byte; it must have a number of splats and
 * channels. */
static bool take_stream(numbers *to, const saga_4dgs *f, saga_cursor *c,
                        uint32_t n, int channels, saga_error *error)
{
    const int width = (int)saga_take_le(c, 1), mode = (int)saga_take_le(c, 1);
    const int codec = (int)saga_take_le(c, 1);
    const bool fits = saga_take_le(c, 1) == (uint64_t)channels &&
                      saga_take_le(c, 4) == n;
    const saga_cursor packed = take_block(c, saga_take_le(c, 8));
    const size_t symbols = (size_t)channels * (mode == CONSTANT ? 1 : n);
    const size_t nbytes = symbols * (size_t)width;
    uint8_t *planes;
    bool ok;

    if (codec > 1)
        return saga_fail(error, f->path, "export it with deflate or zstd",
                         "has a stream that is packed by codec %d", codec);
    if (c->failed || !fits || mode > CONSTANT || to->value ||
        (width != 1 && width != 2 && width != 4) ||
        nbytes / (codec ? ZSTD_RATIO : ZLIB_RATIO) > saga_left(&packed))
        return damaged(f, "the head of a stream", error);
    planes = saga_alloc(nbytes, 1, f->path, error);
    *to = (numbers){ saga_alloc(symbols, sizeof *to->value, f->path, error),
                     channels, mode == CONSTANT };
    ok = planes && to->value &&
         (unpack(planes, nbytes, &packed, codec) ||
          damaged(f, "a stream", error));
    if (ok)
        join_planes(to, planes, symbols, width, mode == DIFFERENCES);
    free(planes);
    return ok;
}

static int32_t at(const numbers *a, uint32_t i, int channel)
{
    const size_t row = a->constant ? 0 : (size_t)i * (size_t)a->channels;

    return a->value[row + (size_t)channel];
}

/* --- Chunks -------------------------------------------------------------- */

/* The unpacked numbers of a chunk. */
typedef struct {
    numbers a[N_ATTRIBUTES], band[SAGA_MAX_DEGREE];
} splats;

static void drop(splats *s)
{
    for (int k = 0; k < N_ATTRIBUTES; k++)
        free(s->a[k].value);
    for (int d = 0; d < SAGA_MAX_DEGREE; d++)
        free(s->band[d].value);
}

/* Takes the attributes that splats must have, and skips others. */
static bool take_attributes(splats *to, const saga_4dgs *f, const chunk *k,
                            saga_error *error)
{
    saga_cursor c = k->streams;

    while (saga_left(&c)) {
        const size_t id = (size_t)saga_take_le(&c, 1);

        if (id >= N_ATTRIBUTES) {
            (void)take_block(&c, 8);
            (void)take_block(&c, saga_take_le(&c, 8));
            if (c.failed)
                return damaged(f, "the streams of a chunk", error);
        } else if (!take_stream(&to->a[id], f, &c, k->n, n_channels[id], error))
            return false;
    }
    for (int i = 0; i < N_ATTRIBUTES; i++)
        if (!to->a[i].value)
            return saga_fail(error, f->path, "copy it again", "has a chunk "
                             "without the stream %d", i);
    return true;
}

/* A harmonic's number is a byte, but comes as any other number. */
static bool take_bands(splats *to, const saga_4dgs *f, const chunk *k,
                       saga_error *error)
{
    for (int d = 0; d < f->degree; d++) {
        const int channels = 3 * (2 * d + 3);
        saga_cursor c = k->band[d];
        numbers *const b = &to->band[d];

        (void)saga_take_le(&c, 1); /* no attribute's number */
        if (!take_stream(b, f, &c, k->n, channels, error))
            return false;
        for (uint32_t i = 0; i < (b->constant ? 1 : k->n); i++)
            for (int j = 0; j < channels; j++)
                if (at(b, i, j) < 0 || at(b, i, j) > 255)
                    return damaged(f, "a harmonic that is no byte", error);
    }
    return true;
}

/* Checks the numbers that choose something. */
static bool check_choices(const splats *s, const saga_4dgs *f, uint32_t n,
                          saga_error *error)
{
    const uint32_t windows = f->n_windows ? f->n_windows : 1;

    for (uint32_t i = 0; i < n; i++) {
        const int32_t window = at(&s->a[WINDOW], i, 0);
        const int32_t missing = at(&s->a[ROTATION_INDEX], i, 0);

        if (window < 0 || (uint32_t)window >= windows || missing < 0 ||
            missing > 3)
            return saga_fail(error, f->path, "copy it again", "has a splat "
                             "with window %d of %u and rotation_index %d",
                             window, (unsigned)windows, missing);
    }
    return true;
}

/* --- Clouds -------------------------------------------------------------- */

/* The life of a splat, in seconds. */
typedef struct {
    bool fades;
    double sigma, from, to;
    double middle;           /* when the opacity is highest and the position is
                              * that stored */
} life;

/* The step of the middle is at most a twentieth of sigma, by halving. */
static double time_step(const saga_4dgs *f, const life *l)
{
    const double whole = f->step[STEP_TIME];
    const double wanted = l->fades ? fmin(whole, 0.05 * l->sigma) : whole;

    return whole * exp2(fmin(fmax(floor(log2(wanted / whole)), -10.0), 0.0));
}

/* Motions have a finer step the longer a splat is seen. */
static double motion_step(const saga_4dgs *f, const life *l)
{
    const double half = l->fades ? f->reach * l->sigma : l->to - l->from;
    const double octave = ceil(log2(fmin(fmax(half, 0.02), 2.0) / 0.5));

    return f->step[STEP_MOTION] * exp2(-fmin(fmax(octave, -4.0), 2.0));
}

static life life_of(const saga_4dgs *f, const splats *s, uint32_t i)
{
    const uint8_t *const w = f->n_windows
        ? f->window + 16 * (size_t)at(&s->a[WINDOW], i, 0) : NULL;
    life l = { .fades = !(at(&s->a[FLAGS], i, 0) & 1) };

    l.sigma = exp(at(&s->a[SIGMA], i, 0) * f->step[STEP_LOG_SIGMA]);
    if (w) {
        l.from = saga_load_f64(w);
        l.to = saga_load_f64(w + 8);
    }
    l.middle = at(&s->a[MIDDLE], i, 0) * time_step(f, &l);
    return l;
}

/* Returns the part of its opacity that a splat has at a time, 0 if it is not
 * there. */
static double part_at(const saga_4dgs *f, const life *l, double time)
{
    const double z = (time - l->middle) / l->sigma;
    const double part = l->fades ? exp(-0.5 * z * z) : 1.0;

    return time >= l->from && time < l->to && part >= f->cutoff ? part : 0.0;
}

/* Sets the colour, whose constant part is stored as what is seen. */
static void put_colour(float *to, const saga_4dgs *f, const splats *s,
                       uint32_t i)
{
    const numbers *const a = &s->a[COLOUR];
    const double g = at(a, i, 0);
    const double rgb[3] = { at(a, i, 1) + g, g, at(a, i, 2) + g };

    for (int k = 0; k < 3; k++)
        to[k] = (float)((rgb[k] * f->step[STEP_COLOUR] - 0.5) /
                        SAGA_HARMONIC_0);
    for (int d = 0; d < f->degree; d++)
        for (int j = 0, n = 2 * d + 3; j < n; j++)
            for (int k = 0; k < 3; k++)
                to[3 * ((d + 1) * (d + 1) + j) + k] =
                    (float)(at(&s->band[d], i, k * n + j) * 8.0 / 255.0 - 4.0);
}

/* Adds a splat as it is at a time. */
static void put(saga_cloud *cloud, const saga_4dgs *f, const splats *s,
                uint32_t i, const life *l, double time, double part)
{
    const size_t to = cloud->n++;
    const double moved = motion_step(f, l) * (time - l->middle);
    double others[3];
    float q[4];

    for (int k = 0; k < 3; k++) {
        cloud->mean[3 * to + (size_t)k] =
            (float)(f->origin[k] +
                    at(&s->a[POSITION], i, k) * f->step[STEP_POSITION] +
                    at(&s->a[MOTION], i, k) * moved);
        cloud->log_scale[3 * to + (size_t)k] =
            (float)(at(&s->a[SCALE], i, k) * f->step[STEP_LOG_SCALE]);
        others[k] = at(&s->a[ROTATION], i, k) * f->step[STEP_ROTATION];
    }
    /* The real part is the last. */
    saga_quat_complete(q, at(&s->a[ROTATION_INDEX], i, 0), others);
    for (size_t k = 0; k < 4; k++)
        cloud->quat[4 * to + (k + 1) % 4] = q[k];
    cloud->logit[to] = saga_cloud_logit(
        at(&s->a[OPACITY], i, 0) * f->step[STEP_OPACITY] * part);
    put_colour(cloud->colour + 3 * (size_t)saga_n_harmonics(f->degree) * to, f,
               s, i);
}

static bool put_chunk(saga_cloud *cloud, const saga_4dgs *f, const chunk *k,
                      double time, saga_error *error)
{
    splats s = { .a = { { .value = NULL } } };
    const bool ok = take_attributes(&s, f, k, error) &&
                    take_bands(&s, f, k, error) &&
                    check_choices(&s, f, k->n, error);

    for (uint32_t i = 0; i < k->n && ok; i++) {
        const life l = life_of(f, &s, i);
        const double part = part_at(f, &l, time);

        if (part > 0.0)
            put(cloud, f, &s, i, &l, time, part);
    }
    drop(&s);
    return ok;
}

static bool is_seen(const chunk *k, double time)
{
    return k->n && time >= k->from && time < k->to;
}

/* --- The film ------------------------------------------------------------ */

bool saga_is_4dgs(const saga_bytes *bytes)
{
    return bytes->nbytes >= MAGIC_NBYTES && memcmp(bytes->data, magic, 5) == 0;
}

saga_4dgs *saga_4dgs_open(const saga_bytes *bytes, const char *path, double fps,
                          saga_error *error)
{
    const saga_cursor c = { bytes->data + MAGIC_NBYTES,
                            bytes->data + bytes->nbytes, false };
    saga_4dgs *const f = saga_calloc(1, sizeof *f, path, error);
    bool ok = f != NULL;

    if (!ok)
        return NULL;
    f->path = path;
    f->fps = fps;
    if (memcmp(bytes->data, magic, MAGIC_NBYTES) != 0)
        ok = saga_fail(error, path, "export it as version 1", "is .4dgs of "
                       "another version than 1, or damaged");
    if (ok && take_records(f, c, error) && check(f, error))
        return f;
    saga_4dgs_free(f);
    return NULL;
}

void saga_4dgs_free(saga_4dgs *film)
{
    if (film)
        free(film->chunks);
    free(film);
}

int saga_4dgs_n_frames(const saga_4dgs *film)
{
    return film->n_frames;
}

bool saga_4dgs_read(saga_cloud *cloud, const saga_4dgs *film, int frame,
                    saga_error *error)
{
    const double time = (frame + 0.5) / film->fps;
    uint64_t n = 0;
    bool ok = true;

    *cloud = (saga_cloud){ .n = 0 };
    for (size_t i = 0; i < film->n_chunks; i++)
        n += is_seen(&film->chunks[i], time) ? film->chunks[i].n : 0;
    if (n > MOST_SPLATS)
        return saga_fail(error, film->path, "take fewer", "has %llu splats at "
                         "%g s, more than %d", (unsigned long long)n, time,
                         MOST_SPLATS);
    if (!saga_cloud_alloc(cloud, (size_t)n, film->degree, error))
        return false;
    cloud->n = 0;
    for (size_t i = 0; i < film->n_chunks && ok; i++)
        if (is_seen(&film->chunks[i], time))
            ok = put_chunk(cloud, film, &film->chunks[i], time, error);
    if (ok && !cloud->n)
        ok = saga_fail(error, film->path, "cut it", "shows no splat at %g s",
                       time);
    if (ok)
        return saga_cloud_tidy(cloud, film->path, error);
    saga_cloud_free(cloud);
    return false;
}
