/* SPDX-License-Identifier: MIT */
#include "cloud_4dgs_chunk.h"

#include "alloc.h"

#include <math.h>
#include <stdlib.h>

enum {
    MAGIC_NBYTES = SAGA_4DGS_MAGIC_NBYTES,
    MOST_SPLATS = 1 << 24,   /* in a frame */
    MOST_FRAMES = 65535,
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

/* --- Bytes --------------------------------------------------------------- */

/* Takes a text, which is cut for messages; their terminal gets no control
 * characters. */
static void take_text(char name[NAME_NBYTES], saga_cursor *c)
{
    const saga_cursor text = saga_4dgs_block(c, saga_take_le(c, 4));
    size_t n = 0;

    for (; n < saga_left(&text) && n < NAME_NBYTES - 1; n++)
        name[n] = text.next[n] < ' ' || text.next[n] > '~'
                ? '?' : (char)text.next[n];
    name[n] = '\0';
}

/* Takes a list of names with texts. Colours must not be said to be linear. */
static bool take_map(const saga_4dgs *f, saga_cursor *c, saga_error *error)
{
    saga_cursor map = saga_4dgs_block(c, saga_take_le(c, 4));

    while (!map.failed && saga_left(&map)) {
        char key[NAME_NBYTES], value[NAME_NBYTES];

        take_text(key, &map);
        take_text(value, &map);
        if (!strcmp(key, "color_space") &&
            strcmp(value, "srgb-rec709-display") != 0)
            return saga_fail(error, f->path, "export it with colours in sRGB",
                             "has colours in the space '%s'", value);
    }
    return !map.failed ||
           saga_4dgs_damaged(f, "its metadata are cut short", error);
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
    (void)saga_4dgs_block(c, 6 * 8); /* bounds */
    f->degree = (int)saga_take_le(c, 1);
    (void)saga_take_le(c, 1); /* flags of sounds and packing */
    if (c->failed || f->degree > SAGA_MAX_DEGREE ||
        !(f->cutoff >= 0.0 && f->cutoff <= 1.0))
        return saga_4dgs_damaged(f, "its header", error);
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
        return saga_4dgs_damaged(f, "its steps", error);
    if (strcmp(scheme, "uniform-v1") != 0)
        return saga_fail(error, f->path, "export it as uniform-v1", "has "
                         "numbers of the scheme '%s'", scheme);
    f->has_steps = true;
    return true;
}

static bool take_windows(saga_4dgs *f, saga_cursor *c, saga_error *error)
{
    const uint32_t n = (uint32_t)saga_take_le(c, 4);
    const saga_cursor all = saga_4dgs_block(c, (uint64_t)n * 16);

    if (c->failed || f->window)
        return saga_4dgs_damaged(f, "its table of windows", error);
    for (size_t i = 0; i < 2 * (size_t)n; i++)
        if (isnan(saga_load_f64(all.next + 8 * i)))
            return saga_4dgs_damaged(f, "a window", error);
    f->window = all.next;
    f->n_windows = n;
    return true;
}

static bool take_chunk(saga_4dgs *f, saga_cursor *c, saga_error *error)
{
    saga_4dgs_chunk *const all =
        saga_realloc(f->chunks, f->n_chunks + 1, sizeof *all, f->path, error);
    saga_4dgs_chunk k = { .n = 0 };
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
    k.streams = saga_4dgs_block(c, saga_take_le(c, 8));
    if (codec[0])
        return saga_fail(error, f->path, "export it with streams that are "
                         "packed one by one", "has a chunk that is packed as a "
                         "whole, by '%s'", codec);
    if (c->failed || nbytes != saga_left(&k.streams))
        return saga_4dgs_damaged(f, "a chunk", error);
    all[f->n_chunks++] = k;
    return true;
}

/* Takes harmonics of one degree, which belong to the last chunk. */
static bool take_band(saga_4dgs *f, saga_cursor *c, saga_error *error)
{
    const int degree = (int)saga_take_le(c, 1);
    saga_4dgs_chunk *const k = f->n_chunks ? &f->chunks[f->n_chunks - 1] : NULL;

    if (!k || degree < 1 || degree > f->degree || k->band[degree - 1].next)
        return saga_4dgs_damaged(f, "harmonics without a chunk", error);
    k->band[degree - 1] = *c;
    return true;
}

static bool take_record(saga_4dgs *f, int kind, saga_cursor *c,
                        saga_error *error)
{
    char name[NAME_NBYTES];

    if (f->has_head != (kind != HEADER))
        return saga_4dgs_damaged(f, "it does not begin with its only header",
                                 error);
    /* Kinds that are not here have no splats and are skipped. */
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
        record = saga_4dgs_block(&c, saga_take_le(&c, 8));
        if (c.failed)
            return saga_4dgs_damaged(f, "it is cut short", error);
        if (!take_record(f, kind, &record, error))
            return false;
    }
    return (saga_left(&c) == MAGIC_NBYTES &&
            memcmp(c.next, magic, MAGIC_NBYTES) == 0) ||
           saga_4dgs_damaged(f, "it does not end behind its footer", error);
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
                return saga_4dgs_damaged(f, "a chunk without its harmonics",
                                         error);
    }
    if (n != f->n || !f->has_steps)
        return saga_4dgs_damaged(f, "its number of splats, or no steps", error);
    if (!(f->duration > 0.0 && n_frames <= MOST_FRAMES))
        return saga_fail(error, f->path, "take another frame rate (--fps)",
                         "lasts %g s, which are not 1 to %d frames at %g fps",
                         f->duration, MOST_FRAMES, f->fps);
    f->n_frames = n_frames > 1.0 ? (int)n_frames : 1;
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

static life life_of(const saga_4dgs *f, const saga_4dgs_splats *s, uint32_t i)
{
    const uint8_t *const w = f->n_windows
        ? f->window + 16 * (size_t)saga_4dgs_at(&s->a[WINDOW], i, 0) : NULL;
    life l = { .fades = !(saga_4dgs_at(&s->a[FLAGS], i, 0) & 1) };

    l.sigma = exp(saga_4dgs_at(&s->a[SIGMA], i, 0) * f->step[STEP_LOG_SIGMA]);
    if (w) {
        l.from = saga_load_f64(w);
        l.to = saga_load_f64(w + 8);
    }
    l.middle = saga_4dgs_at(&s->a[MIDDLE], i, 0) * time_step(f, &l);
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
static void put_colour(float *to, const saga_4dgs *f, const saga_4dgs_splats *s,
                       uint32_t i)
{
    const saga_4dgs_numbers *const a = &s->a[COLOUR];
    const double g = saga_4dgs_at(a, i, 0);
    const double rgb[3] = {
        saga_4dgs_at(a, i, 1) + g, g, saga_4dgs_at(a, i, 2) + g
    };

    for (int k = 0; k < 3; k++)
        to[k] = (float)((rgb[k] * f->step[STEP_COLOUR] - 0.5) /
                        SAGA_HARMONIC_0);
    for (int d = 0; d < f->degree; d++)
        for (int j = 0, n = 2 * d + 3; j < n; j++)
            for (int k = 0; k < 3; k++) {
                const double x = saga_4dgs_at(&s->band[d], i, k * n + j);

                to[3 * ((d + 1) * (d + 1) + j) + k] =
                    (float)(x * 8.0 / 255.0 - 4.0);
            }
}

/* Adds a splat as it is at a time. */
static void put(saga_cloud *cloud, const saga_4dgs *f,
                const saga_4dgs_splats *s, uint32_t i, const life *l,
                double time, double part)
{
    const size_t to = cloud->n++;
    const double moved = motion_step(f, l) * (time - l->middle);
    double others[3];
    float q[4];

    for (int k = 0; k < 3; k++) {
        const double x = saga_4dgs_at(&s->a[POSITION], i, k);
        const double scale = saga_4dgs_at(&s->a[SCALE], i, k);
        const double rotation = saga_4dgs_at(&s->a[ROTATION], i, k);

        cloud->mean[3 * to + (size_t)k] =
            (float)(f->origin[k] + x * f->step[STEP_POSITION] +
                    saga_4dgs_at(&s->a[MOTION], i, k) * moved);
        cloud->log_scale[3 * to + (size_t)k] =
            (float)(scale * f->step[STEP_LOG_SCALE]);
        others[k] = rotation * f->step[STEP_ROTATION];
    }
    /* The real part is the last. */
    saga_quat_complete(q, saga_4dgs_at(&s->a[ROTATION_INDEX], i, 0), others);
    for (size_t k = 0; k < 4; k++)
        cloud->quat[4 * to + (k + 1) % 4] = q[k];
    cloud->logit[to] = saga_cloud_logit(
        saga_4dgs_at(&s->a[OPACITY], i, 0) * f->step[STEP_OPACITY] * part);
    put_colour(cloud->colour + 3 * (size_t)saga_n_harmonics(f->degree) * to, f,
               s, i);
}

static bool put_chunk(saga_cloud *cloud, const saga_4dgs *f,
                      const saga_4dgs_chunk *k, double time, saga_error *error)
{
    saga_4dgs_splats s;
    const bool ok = saga_4dgs_splats_read(&s, f, k, error);

    for (uint32_t i = 0; i < k->n && ok; i++) {
        const life l = life_of(f, &s, i);
        const double part = part_at(f, &l, time);

        if (part > 0.0)
            put(cloud, f, &s, i, &l, time, part);
    }
    saga_4dgs_splats_free(&s);
    return ok;
}

static bool is_seen(const saga_4dgs_chunk *k, double time)
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
    /* Room for all splats of the chunks that this moment is in. */
    for (size_t i = 0; i < film->n_chunks; i++)
        n += is_seen(&film->chunks[i], time) ? film->chunks[i].n : 0;
    if (n > MOST_SPLATS)
        return saga_fail(error, film->path, "take fewer", "has %llu splats at "
                         "%g s, more than %d", (unsigned long long)n, time,
                         MOST_SPLATS);
    if (!saga_cloud_alloc(cloud, (size_t)n, film->degree, error))
        return false;
    /* Only those that are seen are put; put() counts them. */
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
