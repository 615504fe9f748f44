/* SPDX-License-Identifier: MIT */
#include "cloud_splat4d.h"

#include "alloc.h"
#include "byte_planes.h"
#include "cloud_files.h"
#include "json_memory.h"

#include <math.h>
#include <stdlib.h>
#include <zstd.h>

enum {
    HEAD_NBYTES = SAGA_SPLAT4D_HEAD_NBYTES, /* in front of the JSON */
    MOST_SPLATS = 1 << 26,
    MOST_FRAMES = 65535
};

#define AGAIN "export it again"
#define COPY "copy it again"

/* Attributes have their numbers in the groups. */
enum { POSITION, ROTATION, COLOUR, OPACITY, SCALE, N_ATTRIBUTES };

static const int n_channels[N_ATTRIBUTES] = { 3, 4, 3, 1, 3 };

/* Orders of the streams in the section of what stands still. */
static const int mask_order[N_ATTRIBUTES] = {
    POSITION, ROTATION, COLOUR, OPACITY, SCALE
};
static const int value_order[N_ATTRIBUTES] = {
    POSITION, SCALE, COLOUR, OPACITY, ROTATION
};

/* Unpacked numbers. */
typedef struct {
    uint8_t *planes;         /* (width, n) */
    size_t n;
    int width;
} stream;

typedef struct {
    double step;             /* of values that move */
    double still_step;       /* of those that stand still */
    int32_t *still;          /* (n, channels) */
    uint32_t *moving;        /* (n_moving) numbers of splats */
    size_t n_moving;
    int32_t *value;          /* (n_moving, channels) at film.frame */
    stream change;           /* (frames - 1, n_moving, channels) of the group */
} attribute;

typedef struct {
    size_t offset, nbytes;
    int first, last;         /* frames */
} group;

struct saga_splat4d {
    const char *path;
    const saga_bytes *bytes;
    size_t n;                /* splats */
    int n_frames, n_groups;
    double fps;
    group *groups;
    attribute attributes[N_ATTRIBUTES];
    int group, frame;        /* whose values are there; -1: none */
};

/* --- Streams ------------------------------------------------------------- */

static uint32_t number_at(const stream *s, size_t i)
{
    return saga_plane_number(s->planes, s->n, s->width, i);
}

static int32_t signed_at(const stream *s, size_t i)
{
    return (int32_t)saga_plane_sign(number_at(s, i));
}

/* Adds with wrapping, so that damaged files overflow nothing. */
static int32_t sum(int32_t a, int32_t b)
{
    return (int32_t)((uint32_t)a + (uint32_t)b);
}

static void drop(stream *s)
{
    free(s->planes);
    *s = (stream){ .n = 0 };
}

/* Unpacks a stream that must have n numbers. */
static bool unpack(stream *s, const saga_splat4d *f, size_t n, int width,
                   const uint8_t *packed, size_t packed_nbytes,
                   saga_error *error)
{
    const size_t nbytes = n * (size_t)width;

    *s = (stream){ .n = n, .width = width };
    if (!packed || (width != 1 && width != 2 && width != 4) ||
        nbytes / SAGA_ZSTD_RATIO > packed_nbytes)
        return saga_fail(error, f->path, COPY, "has a stream of %zu numbers of "
                         "%d bytes in %zu bytes", n, width, packed_nbytes);
    s->planes = saga_alloc(nbytes, 1, f->path, error);
    if (!s->planes)
        return false;
    if (ZSTD_decompress(s->planes, nbytes, packed, packed_nbytes) == nbytes)
        return true;
    drop(s);
    return saga_fail(error, f->path, COPY, "has a stream that is damaged");
}

/* Takes a stream with its own head. */
static bool take_stream(stream *s, const saga_splat4d *f, saga_cursor *c,
                        size_t n, saga_error *error)
{
    const int width = (int)saga_take_le(c, 1);
    const uint64_t count = saga_take_le(c, 4);
    const size_t packed_nbytes = (size_t)saga_take_le(c, 4);
    const uint8_t *const packed = saga_take(c, packed_nbytes);

    if (count != n)
        return saga_fail(error, f->path, COPY, "has a stream of %llu numbers, "
                         "not %zu", (unsigned long long)count, n);
    return unpack(s, f, n, width, packed, packed_nbytes, error);
}

/* --- The head ------------------------------------------------------------ */

static double real_of(const json_t *root, const char *part, const char *key)
{
    const json_t *const of = part ? json_object_get(root, part) : root;

    return json_number_value(json_object_get(of, key));
}

/* Returns a whole number, or -1 if there is none from 0 to `most`. */
static int64_t whole_of(const json_t *of, const char *key, int64_t most)
{
    const json_t *const value = json_object_get(of, key);
    const json_int_t x = json_integer_value(value);

    return json_is_integer(value) && x >= 0 && x <= most ? x : -1;
}

static bool take_steps(saga_splat4d *f, const json_t *root, saga_error *error)
{
    static const char *const keys[N_ATTRIBUTES] = {
        "pos", "rot", "rgb", "alpha", "scale_log"
    };
    bool ok = true;

    for (int k = 0; k < N_ATTRIBUTES; k++) {
        attribute *const a = &f->attributes[k];

        a->step = real_of(root, "steps", keys[k]);
        a->still_step = k == POSITION ? real_of(root, "steps", "base_pos")
                      : k == SCALE ? real_of(root, "steps", "base_scale_log")
                      : 1.0;
        ok = ok && a->step > 0.0 && isfinite(a->step) &&
             a->still_step > 0.0 && isfinite(a->still_step);
    }
    return ok || saga_fail(error, f->path, AGAIN, "has steps of quantisation "
                           "that are not above 0");
}

static bool take_part(size_t *offset, size_t *nbytes, const saga_splat4d *f,
                      const json_t *of)
{
    const int64_t end = (int64_t)f->bytes->nbytes;
    const int64_t first = whole_of(of, "offset", end);
    const int64_t n = whole_of(of, "len", end);

    *offset = (size_t)first;
    *nbytes = (size_t)n;
    return first >= 0 && n >= 0 && n <= end - first;
}

static bool take_groups(saga_splat4d *f, const json_t *root,
                        saga_error *error)
{
    const json_t *const list = json_object_get(root, "gops");
    int next = 0;
    bool ok = true;

    f->n_groups = (int)json_array_size(list);
    if (f->n_groups < 1 || f->n_groups > f->n_frames)
        return saga_fail(error, f->path, AGAIN, "has %d groups of frames for "
                         "%d frames", f->n_groups, f->n_frames);
    f->groups = saga_calloc((size_t)f->n_groups, sizeof *f->groups, f->path,
                            error);
    if (!f->groups)
        return false;
    /* Each group begins behind the one before, and the last ends the film. */
    for (int i = 0; i < f->n_groups && ok; i++) {
        const json_t *const of = json_array_get(list, (size_t)i);
        group *const g = &f->groups[i];

        g->first = (int)whole_of(of, "f0", f->n_frames - 1);
        g->last = (int)whole_of(of, "f1", f->n_frames - 1);
        ok = take_part(&g->offset, &g->nbytes, f, of) && g->first == next &&
             g->last >= next;
        next = g->last + 1;
    }
    return (ok && next == f->n_frames) ||
           saga_fail(error, f->path, COPY, "has groups that are not all "
                     "frames, or not in the file");
}

static bool take_head(saga_splat4d *f, const json_t *root, saga_error *error)
{
    const int64_t n = whole_of(root, "n", MOST_SPLATS);
    const int64_t n_frames = whole_of(root, "t", MOST_FRAMES);

    f->fps = real_of(root, NULL, "fps");
    if (n < 1 || n_frames < 1 || !(f->fps > 0.0) || !isfinite(f->fps))
        return saga_fail(error, f->path, "take fewer", "has not 1 to %d "
                         "splats, 1 to %d frames and a frame rate",
                         MOST_SPLATS, MOST_FRAMES);
    f->n = (size_t)n;
    f->n_frames = (int)n_frames;
    return take_steps(f, root, error) && take_groups(f, root, error);
}

/* --- What stands still --------------------------------------------------- */

/* Lists the splats whose bit is 0. Bits begin with a byte's highest. */
static bool take_moving(saga_splat4d *f, attribute *a, saga_cursor *c,
                        int channels, saga_error *error)
{
    stream bits;

    if (!take_stream(&bits, f, c, (f->n + 7) / 8, error))
        return false;
    if (bits.width == 1)
        a->moving = saga_alloc(f->n, sizeof *a->moving, f->path, error);
    else
        saga_fail(error, f->path, COPY, "has a bitmap of wide numbers");
    for (size_t i = 0; i < f->n && a->moving; i++)
        if (!(bits.planes[i / 8] >> (7 - i % 8) & 1))
            a->moving[a->n_moving++] = (uint32_t)i;
    drop(&bits);
    if (a->moving)
        a->value = saga_alloc(a->n_moving * (size_t)channels,
                              sizeof *a->value, f->path, error);
    return a->value != NULL;
}

/* Takes a value for each splat. Those with a step of their own are differences
 * from splat to splat. */
static bool take_still(saga_splat4d *f, int k, saga_cursor *c,
                       saga_error *error)
{
    const size_t channels = (size_t)n_channels[k], n = f->n * channels;
    const bool differs = k == POSITION || k == SCALE;
    attribute *const a = &f->attributes[k];
    stream values;

    if (!take_stream(&values, f, c, n, error))
        return false;
    a->still = saga_alloc(n, sizeof *a->still, f->path, error);
    for (size_t i = 0; i < n && a->still; i++)
        a->still[i] = !differs ? (int32_t)number_at(&values, i)
                    : sum(i < channels ? 0 : a->still[i - channels],
                          signed_at(&values, i));
    drop(&values);
    return a->still != NULL;
}

static bool take_section(saga_splat4d *f, const json_t *root,
                         saga_error *error)
{
    saga_cursor c = { NULL, NULL, false };
    size_t offset, nbytes;
    bool ok = take_part(&offset, &nbytes, f,
                        json_object_get(root, "static_section"));

    if (!ok)
        return saga_fail(error, f->path, COPY, "has no section of what stands "
                         "still");
    c.next = f->bytes->data + offset;
    c.end = c.next + nbytes;
    for (int i = 0; i < N_ATTRIBUTES && ok; i++)
        ok = take_moving(f, &f->attributes[mask_order[i]], &c,
                         n_channels[mask_order[i]], error);
    for (int i = 0; i < N_ATTRIBUTES && ok; i++)
        ok = take_still(f, value_order[i], &c, error);
    return ok;
}

/* --- Groups -------------------------------------------------------------- */

/* One stream of a group, from the list at its beginning. */
typedef struct {
    int attribute, kind, width;
    size_t n, packed_nbytes;
} entry;

enum { KEY, CHANGE };

static entry take_entry(saga_cursor *c)
{
    entry e;

    e.attribute = (int)saga_take_le(c, 1);
    e.kind = (int)saga_take_le(c, 1);
    e.width = (int)saga_take_le(c, 1);
    e.n = (size_t)saga_take_le(c, 4);
    e.packed_nbytes = (size_t)saga_take_le(c, 4);
    return e;
}

/* Takes the values of a group's first frame, or the differences of all others.
 */
static bool take_entry_stream(saga_splat4d *f, const entry *e, const group *g,
                              saga_cursor *c, saga_error *error)
{
    attribute *const a = &f->attributes[e->attribute];
    const size_t each = a->n_moving * (size_t)n_channels[e->attribute];
    const size_t n = e->kind == KEY ? each : each * (size_t)(g->last -
                                                             g->first);
    const uint8_t *const packed = saga_take(c, e->packed_nbytes);
    stream s;

    if (e->n != n)
        return saga_fail(error, f->path, COPY, "has a group with %zu numbers, "
                         "not %zu", e->n, n);
    if (!unpack(&s, f, n, e->width, packed, e->packed_nbytes, error))
        return false;
    if (e->kind == CHANGE) {
        drop(&a->change);
        a->change = s;
        return true;
    }
    for (size_t i = 0; i < n; i++)
        a->value[i] = signed_at(&s, i);
    drop(&s);
    return true;
}

/* Tells whether each moving attribute has its streams. */
static bool is_whole(const saga_splat4d *f, const group *g, unsigned seen)
{
    bool ok = true;

    for (int k = 0; k < N_ATTRIBUTES; k++)
        if (f->attributes[k].n_moving)
            ok = ok && seen >> (2 * k) & 1 &&
                 (g->last == g->first || seen >> (2 * k + 1) & 1);
    return ok;
}

/* Moves to the first frame of a group. */
static bool enter(saga_splat4d *f, int number, saga_error *error)
{
    const group *const g = &f->groups[number];
    const uint8_t *const p = f->bytes->data + g->offset;
    saga_cursor list = { p, p + g->nbytes, false };
    const int n = (int)saga_take_le(&list, 2);
    saga_cursor c = list;
    unsigned seen = 0;
    bool ok = saga_take(&c, (size_t)n * 11) != NULL;

    /* Until the group is whole there is no frame, and changes of the group
     * before do not go on. */
    f->frame = -1;
    for (int k = 0; k < N_ATTRIBUTES; k++)
        drop(&f->attributes[k].change);
    for (int i = 0; i < n && ok; i++) {
        const entry e = take_entry(&list);

        if (e.attribute >= N_ATTRIBUTES || e.kind > CHANGE)
            ok = false;
        else if (!take_entry_stream(f, &e, g, &c, error))
            return false;
        else
            seen |= 1u << (2 * e.attribute + e.kind);
    }
    if (!ok || !is_whole(f, g, seen))
        return saga_fail(error, f->path, COPY, "lacks streams of the group "
                         "from frame %d on", g->first);
    f->group = number;
    f->frame = g->first;
    return true;
}

static void step(saga_splat4d *f)
{
    const size_t at = (size_t)(f->frame - f->groups[f->group].first);

    for (int k = 0; k < N_ATTRIBUTES; k++) {
        attribute *const a = &f->attributes[k];
        const size_t each = a->n_moving * (size_t)n_channels[k];

        for (size_t i = 0; i < each; i++)
            a->value[i] = sum(a->value[i], signed_at(&a->change,
                                                     at * each + i));
    }
    f->frame++;
}

static bool go_to(saga_splat4d *f, int frame, saga_error *error)
{
    int number = 0;

    while (f->groups[number].last < frame)
        number++;
    if ((f->group != number || f->frame < 0 || f->frame > frame) &&
        !enter(f, number, error))
        return false;
    while (f->frame < frame)
        step(f);
    return true;
}

/* --- Clouds -------------------------------------------------------------- */

/* Sets an attribute of one splat from its numbers. Rotations and colours that
 * stand still are bytes. */
static void put(saga_cloud *cloud, size_t i, int k, const int32_t *v,
                double by, bool still)
{
    double x[4];

    for (int c = 0; c < n_channels[k]; c++) {
        x[c] = v[c] * by;
        if (k == COLOUR || k == OPACITY)
            x[c] = fmin(fmax(x[c], 0.0), 255.0) / 255.0;
        else if (k == ROTATION && still)
            x[c] -= 128.0;
    }
    for (int c = 0; c < n_channels[k]; c++)
        if (k == POSITION)
            cloud->mean[3 * i + (size_t)c] = (float)x[c];
        else if (k == ROTATION)
            cloud->quat[4 * i + (size_t)c] = (float)(x[c] / 128.0);
        else if (k == COLOUR)
            cloud->colour[3 * i + (size_t)c] =
                (float)((x[c] - 0.5) / SAGA_HARMONIC_0);
        else if (k == OPACITY)
            cloud->logit[i] = saga_cloud_logit(x[c]);
        else
            cloud->log_scale[3 * i + (size_t)c] = (float)x[c];
}

static void put_all(saga_cloud *cloud, const saga_splat4d *f, int k)
{
    const attribute *const a = &f->attributes[k];
    const size_t channels = (size_t)n_channels[k];

    for (size_t i = 0; i < f->n; i++)
        put(cloud, i, k, a->still + channels * i, a->still_step, true);
    for (size_t m = 0; m < a->n_moving; m++)
        put(cloud, a->moving[m], k, a->value + channels * m, a->step, false);
}

/* --- The film ------------------------------------------------------------ */

bool saga_is_splat4d(const saga_bytes *bytes)
{
    return bytes->nbytes >= HEAD_NBYTES && memcmp(bytes->data, "SP4D", 4) == 0;
}

static json_t *take_json(const saga_splat4d *f, saga_error *error)
{
    const uint8_t *const p = f->bytes->data;
    const size_t n = (size_t)saga_load_le(p + 8, 4);
    const unsigned version = (unsigned)saga_load_le(p + 4, 2);
    saga_bytes text = { f->bytes->data + HEAD_NBYTES, n };

    if (version != 1) {
        saga_fail(error, f->path, "save it as version 1",
                  "is .splat4d of version %u", version);
        return NULL;
    }
    if (n > f->bytes->nbytes - HEAD_NBYTES) {
        saga_fail(error, f->path, COPY, "is cut short in its header");
        return NULL;
    }
    return saga_json_parse(&text, f->path, error);
}

saga_splat4d *saga_splat4d_open(const saga_bytes *bytes, const char *path,
                                saga_error *error)
{
    saga_splat4d *const f = saga_calloc(1, sizeof *f, path, error);
    json_t *root;
    bool ok;

    if (!f)
        return NULL;
    f->path = path;
    f->bytes = bytes;
    f->frame = -1;
    root = take_json(f, error);
    ok = root && take_head(f, root, error) && take_section(f, root, error);
    json_decref(root);
    if (ok)
        return f;
    saga_splat4d_free(f);
    return NULL;
}

void saga_splat4d_free(saga_splat4d *film)
{
    for (int k = 0; k < N_ATTRIBUTES && film; k++) {
        attribute *const a = &film->attributes[k];

        free(a->still);
        free(a->moving);
        free(a->value);
        drop(&a->change);
    }
    if (film)
        free(film->groups);
    free(film);
}

int saga_splat4d_n_frames(const saga_splat4d *film)
{
    return film->n_frames;
}

double saga_splat4d_fps(const saga_splat4d *film)
{
    return film->fps;
}

bool saga_splat4d_read(saga_cloud *cloud, saga_splat4d *film, int frame,
                       saga_error *error)
{
    *cloud = (saga_cloud){ .n = 0 };
    if (!go_to(film, frame, error) ||
        !saga_cloud_alloc(cloud, film->n, 0, error))
        return false;
    for (int k = 0; k < N_ATTRIBUTES; k++)
        put_all(cloud, film, k);
    return saga_cloud_tidy(cloud, film->path, error);
}
