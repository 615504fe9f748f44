/* SPDX-License-Identifier: MIT */
#include "cloud_sog.h"

#include "alloc.h"
#include "json_memory.h"
#include "zip.h"

#include <math.h>
#include <stdlib.h>
#include <webp/decode.h>

enum {
    MOST_SPLATS = 1 << 28,     /* pixels of a WebP picture */
    MOST_META_NBYTES = 1 << 22 /* it has some thousand numbers */
};

#define AGAIN "export it again"

/* A picture of the set, with pixels R, G, B, A. */
typedef struct {
    uint8_t *rgba; /* released with WebPFree */
    size_t width, height;
} picture;

enum { MEANS_L, MEANS_U, SCALES, QUATS, SH0, CENTROIDS, LABELS, N_PICTURES };

/* The place of a picture's name in meta.json: item `index` of KEY.files. */
static const struct {
    const char *key;
    size_t index;
} places[N_PICTURES] = { { "means", 0 }, { "means", 1 }, { "scales", 0 },
                         { "quats", 0 }, { "sh0", 0 },   { "shN", 0 },
                         { "shN", 1 } };

/* A SOG file, divided into its parts. */
typedef struct {
    const char *path;
    saga_zip zip;
    bool is_zip; /* otherwise the pictures lie beside meta.json */
    json_t *meta;
    size_t n, n_rows; /* number of splats; number of rows of the
                       * palette */
    int degree;
    size_t n_mended; /* lists of codes that lacked their first number */
    double least[3], most[3]; /* range of the stored positions */
    double scale[SOG_CODES], sh0[SOG_CODES], rest[SOG_CODES];
    picture pictures[N_PICTURES];
    saga_error *error;
} sog;

/* --- The text ------------------------------------------------------------ */

static const json_t *entry(const sog *s, const char *key, const char *name)
{
    return json_object_get(json_object_get(s->meta, key), name);
}

/* Older writers left out the first number of a list of codes, which has no end
 * on that side; the list goes on as it does between its ends. */
static bool mend_codebook(double *to, size_t n, sog *s)
{
    if (n != SOG_CODES)
        return false;
    to[0] = to[1] + (to[1] - to[n - 1]) / (double)(n - 1);
    s->n_mended++;
    return true;
}

/* Reads a list of n numbers. */
static bool take_numbers(double *to, size_t n, sog *s, const char *key,
                         const char *name)
{
    const json_t *const list = entry(s, key, name);

    if (json_array_size(list) != n)
        return saga_fail(s->error, s->path, AGAIN,
                         "%s.%s has %zu numbers, not "
                         "%zu",
                         key, name, json_array_size(list), n);
    for (size_t i = n; i-- > 0;) {
        const json_t *const item = json_array_get(list, i);

        if (json_is_number(item))
            to[i] = json_number_value(item);
        else if (i > 0 || !json_is_null(item) || !mend_codebook(to, n, s))
            return saga_fail(s->error, s->path, AGAIN,
                             "%s.%s[%zu] is not a "
                             "number",
                             key, name, i);
    }
    return true;
}

/* Reads the codes of the harmonics above the constant one. */
static bool take_palette(sog *s)
{
    const json_int_t bands = json_integer_value(entry(s, "shN", "bands"));
    const json_int_t n = json_integer_value(entry(s, "shN", "count"));

    if (!json_object_get(s->meta, "shN"))
        return true;
    if (bands < 1 || bands > SAGA_MAX_DEGREE || n < 1 || n > SOG_MOST_ROWS)
        return saga_fail(s->error, s->path, AGAIN,
                         "has %d bands of harmonics "
                         "and %d rows in their palette",
                         (int)bands, (int)n);
    s->degree = (int)bands;
    s->n_rows = (size_t)n;
    return take_numbers(s->rest, SOG_CODES, s, "shN", "codebook");
}

static bool take_meta(sog *s)
{
    const json_int_t version = json_integer_value(
        json_object_get(s->meta, "version"));
    const json_t *const count = json_object_get(s->meta, "count");
    const json_int_t n = json_is_integer(count) ? json_integer_value(count)
                                                : -1;

    if (version != SOG_VERSION)
        return saga_fail(s->error, s->path, "save it as version 2",
                         "is not "
                         "SOG, or of version %d",
                         (int)version);
    if (n < 0 || n > MOST_SPLATS)
        return saga_fail(s->error, s->path, AGAIN,
                         "has a count of splats that "
                         "is no number of 0 to %d",
                         MOST_SPLATS);
    s->n = (size_t)n;
    return take_numbers(s->least, 3, s, "means", "mins") &&
           take_numbers(s->most, 3, s, "means", "maxs") &&
           take_numbers(s->scale, SOG_CODES, s, "scales", "codebook") &&
           take_numbers(s->sh0, SOG_CODES, s, "sh0", "codebook") &&
           take_palette(s);
}

static bool open_meta(sog *s, const saga_bytes *bytes)
{
    saga_bytes text;

    s->is_zip = saga_zip_open(&s->zip, bytes, s->path);
    if (!s->is_zip) {
        s->meta = saga_json_parse(bytes, s->path, s->error);
    } else if (saga_zip_read(&text, &s->zip, "meta.json", MOST_META_NBYTES,
                             s->error)) {
        s->meta = saga_json_parse(&text, s->path, s->error);
        saga_bytes_free(&text);
    }
    return s->meta && take_meta(s);
}

/* --- Pictures ------------------------------------------------------------ */

/* Reads a file beside meta.json; its name must not lead anywhere else. */
static bool read_beside(saga_bytes *bytes, const sog *s, const char *name)
{
    const char *const slash = strrchr(s->path, '/');
    char *folder, *path = NULL;
    bool ok;

    if (strchr(name, '/'))
        return saga_fail(s->error, s->path, "keep all files in one folder",
                         "names the file %.200s", name);
    folder = saga_string_copy(s->path, s->error);
    if (folder) {
        folder[slash ? slash - s->path : 0] = '\0';
        path = saga_path_join(folder, name, s->error);
    }
    ok = path && saga_read_file(bytes, path, s->error);
    free(folder);
    free(path);
    return ok;
}

/* Returns the most pixels of a picture. Each splat has at most 15; small
 * pictures may have a few more. */
static size_t most_pixels(const sog *s)
{
    return 16 * s->n + 65536;
}

static bool decode(picture *p, const sog *s, const saga_bytes *bytes,
                   const char *name)
{
    int width, height;

    if (!WebPGetInfo(bytes->data, bytes->nbytes, &width, &height))
        return saga_fail(s->error, s->path, "save it as lossless WebP",
                         "%.200s is not a WebP picture", name);
    if ((size_t)width * (size_t)height > most_pixels(s))
        return saga_fail(s->error, s->path, AGAIN,
                         "%.200s has %dx%d pixels, "
                         "for %zu splats",
                         name, width, height, s->n);
    p->rgba = WebPDecodeRGBA(bytes->data, bytes->nbytes, &width, &height);
    p->width = (size_t)width;
    p->height = (size_t)height;
    return p->rgba || saga_fail(s->error, s->path, "copy it again",
                                "%.200s is damaged", name);
}

static bool read_picture(sog *s, int i)
{
    const json_t *const files = entry(s, places[i].key, "files");
    const char *const name = json_string_value(
        json_array_get(files, places[i].index));
    saga_bytes bytes;
    bool ok;

    if (!name)
        return saga_fail(s->error, s->path, AGAIN, "%s has no file number %zu",
                         places[i].key, places[i].index);
    /* A lossless picture hardly grows by its coding. */
    if (!(s->is_zip ? saga_zip_read(&bytes, &s->zip, name,
                                    8 * (uint64_t)most_pixels(s), s->error)
                    : read_beside(&bytes, s, name)))
        return false;
    ok = decode(&s->pictures[i], s, &bytes, name);
    saga_bytes_free(&bytes);
    return ok;
}

/* Checks a picture's size. The palette has its own; all others need a pixel for
 * each splat. */
static bool check_size(const sog *s, int i)
{
    const picture *const p = &s->pictures[i];
    const size_t n_rest = (size_t)saga_n_harmonics(s->degree) - 1;
    const bool enough = i == CENTROIDS
                            ? p->width == SOG_ROWS_ABREAST * n_rest &&
                                  p->height * SOG_ROWS_ABREAST >= s->n_rows
                            : p->width * p->height >= s->n;

    return enough || saga_fail(s->error, s->path, "copy it again",
                               "has %zux"
                               "%zu pixels in picture %zu of %s, for %zu "
                               "splats and %zu rows of a palette",
                               p->width, p->height, places[i].index,
                               places[i].key, s->n, s->n_rows);
}

static bool read_pictures(sog *s)
{
    const int n = s->degree ? N_PICTURES : CENTROIDS;
    bool ok = true;

    for (int i = 0; i < n && ok; i++)
        ok = read_picture(s, i) && check_size(s, i);
    return ok;
}

/* --- Splats -------------------------------------------------------------- */

static const uint8_t *pixel(const sog *s, int of, size_t i)
{
    return s->pictures[of].rgba + 4 * i;
}

static void take_position(float x[3], const sog *s, size_t i)
{
    for (int a = 0; a < 3; a++) {
        const double part =
            (pixel(s, MEANS_U, i)[a] << 8 | pixel(s, MEANS_L, i)[a]) / 65535.0;
        const double v = s->least[a] + part * (s->most[a] - s->least[a]);

        x[a] = (float)copysign(expm1(fabs(v)), v);
    }
}

static bool take_rotation(float q[4], const sog *s, size_t i)
{
    const uint8_t *const p = pixel(s, QUATS, i);
    const uint32_t code[3] = { p[0], p[1], p[2] };
    const int largest = p[3] - SOG_FIRST_MODE;

    if (largest < 0)
        return saga_fail(s->error, s->path, "copy it again",
                         "the rotation of "
                         "splat %zu has mode %d, not 252 to 255",
                         i, p[3]);
    saga_quat_decode(q, largest, code, 255.0);
    return true;
}

static bool take_rest(float *colour, const sog *s, size_t i)
{
    const uint8_t *const p = pixel(s, LABELS, i);
    const size_t row = (size_t)(p[0] | p[1] << 8);
    const size_t n_rest = (size_t)saga_n_harmonics(s->degree) - 1;
    const size_t first = row / SOG_ROWS_ABREAST * SOG_ROWS_ABREAST * n_rest +
                         row % SOG_ROWS_ABREAST * n_rest;

    if (row >= s->n_rows)
        return saga_fail(s->error, s->path, "copy it again",
                         "splat %zu has "
                         "row %zu of a palette of %zu",
                         i, row, s->n_rows);
    for (size_t k = 0; k < n_rest; k++)
        for (size_t c = 0; c < 3; c++)
            colour[3 * (k + 1) + c] =
                (float)s->rest[pixel(s, CENTROIDS, first + k)[c]];
    return true;
}

static bool take_splat(saga_cloud *cloud, size_t i, const sog *s)
{
    const size_t each = 3 * (size_t)saga_n_harmonics(s->degree);
    float *const colour = cloud->colour + each * i;

    take_position(cloud->mean + 3 * i, s, i);
    for (size_t k = 0; k < 3; k++) {
        cloud->log_scale[3 * i + k] = (float)s->scale[pixel(s, SCALES, i)[k]];
        colour[k] = (float)s->sh0[pixel(s, SH0, i)[k]];
    }
    cloud->logit[i] = saga_cloud_logit(pixel(s, SH0, i)[3] / 255.0);
    return take_rotation(cloud->quat + 4 * i, s, i) &&
           (!s->degree || take_rest(colour, s, i));
}

static bool take_splats(saga_cloud *cloud, const sog *s)
{
    bool ok = true;

    for (size_t i = 0; i < s->n && ok; i++)
        ok = take_splat(cloud, i, s);
    cloud->facts.count[SAGA_FACT_CODEBOOK] += s->n_mended > 0;
    return ok;
}

bool saga_is_sog(const saga_bytes *bytes)
{
    const uint8_t *const p = bytes->data;
    const size_t bom = saga_bom_nbytes(p, bytes->nbytes);

    return bytes->nbytes >= bom + 4 &&
           (memcmp(p, "PK\3\4", 4) == 0 || p[bom] == '{');
}

bool saga_sog_read(saga_cloud *cloud, const saga_bytes *bytes, const char *path,
                   saga_error *error)
{
    sog s = { .path = path, .error = error };
    const bool ok = open_meta(&s, bytes) &&
                    saga_cloud_admit(cloud, s.n, s.degree, path, error) &&
                    read_pictures(&s) && take_splats(cloud, &s);

    if (!ok)
        saga_cloud_free(cloud);
    json_decref(s.meta);
    for (int i = 0; i < N_PICTURES; i++)
        WebPFree(s.pictures[i].rgba);
    return ok;
}
