/* SPDX-License-Identifier: MIT */
#include "ply.h"

#include "alloc.h"
#include "error.h"
#include "file.h"
#include "output.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { MAX_PROPERTIES = SAGA_PLY_MOST_PROPERTIES, MAX_LINE = 512 };

enum ply_type {
    PLY_I8,
    PLY_U8,
    PLY_I16,
    PLY_U16,
    PLY_I32,
    PLY_U32,
    PLY_F32,
    PLY_F64
};

static const struct {
    const char *name, *alias;
    int nbytes;
} ply_types[] = {
    [PLY_I8] = { "char", "int8", 1 },
    [PLY_U8] = { "uchar", "uint8", 1 },
    [PLY_I16] = { "short", "int16", 2 },
    [PLY_U16] = { "ushort", "uint16", 2 },
    [PLY_I32] = { "int", "int32", 4 },
    [PLY_U32] = { "uint", "uint32", 4 },
    [PLY_F32] = { "float", "float32", 4 },
    [PLY_F64] = { "double", "float64", 8 },
};

enum {
    FIELD_X,
    FIELD_Y,
    FIELD_Z,
    FIELD_RED,
    FIELD_GREEN,
    FIELD_BLUE,
    N_FIELDS
};

static const char *const point_fields[N_FIELDS] = { "x",   "y",     "z",
                                                    "red", "green", "blue" };

static bool add_property(saga_ply *h, const char *type, const char *name)
{
    if (h->n_properties == MAX_PROPERTIES)
        return false;
    for (size_t t = 0; t < sizeof ply_types / sizeof ply_types[0]; t++) {
        if (strcmp(type, ply_types[t].name) != 0 &&
            strcmp(type, ply_types[t].alias) != 0)
            continue;
        for (int f = 0; f < h->n_fields; f++)
            if (strcmp(name, h->names[f]) == 0)
                h->field[f] = h->n_properties;
        h->type[h->n_properties++] = (uint8_t)t;
        return true;
    }
    return false;
}

/* The state while the header is read; only properties of the element "vertex"
 * count. */
typedef struct ply_state {
    bool seen_format, seen_vertex, in_vertex;
} ply_state;

static bool header_line(saga_ply *h, ply_state *s, const char *line)
{
    char a[32], b[64];
    unsigned long long n;
    if (sscanf(line, "format %31s", a) == 1) {
        s->seen_format = true;
        h->ascii = strcmp(a, "ascii") == 0;
        return h->ascii || strcmp(a, "binary_little_endian") == 0;
    }
    if (sscanf(line, "element %31s %llu", a, &n) == 2) {
        s->in_vertex = strcmp(a, "vertex") == 0 && !s->seen_vertex;
        s->seen_vertex |= s->in_vertex;
        /* Elements after the vertices are not read. Elements before them are
         * refused, because their records would have to be skipped. */
        if (s->in_vertex)
            h->count = n;
        return s->seen_vertex;
    }
    if (s->in_vertex && strncmp(line, "property", 8) == 0)
        /* A list has the type "list", which add_property refuses. */
        return sscanf(line, "property %31s %63s", a, b) == 2 &&
               add_property(h, a, b);
    return true;
}

static bool header_is_whole(const saga_ply *h, const ply_state *s,
                            saga_error *error)
{
    if (!s->seen_format)
        return saga_fail(error, h->path, "export the points as PLY",
                         "has no format line in its header");
    if (!h->n_properties)
        return saga_fail(error, h->path, "export the points as PLY",
                         "has no vertices with properties");
    return true;
}

static bool parse_header(saga_ply *h, saga_error *error)
{
    saga_cursor *const c = &h->cursor;
    char line[MAX_LINE];
    ply_state s = { 0 };
    /* -1 marks a field that the file does not have. */
    for (int f = 0; f < h->n_fields; f++)
        h->field[f] = -1;
    if (!saga_take_line(c, line, sizeof line) || strcmp(line, "ply") != 0)
        return saga_fail(error, h->path, "export the points as PLY",
                         "is not a PLY file");
    /* Lines are read up to end_header, where the checks need all of them. */
    while (saga_take_line(c, line, sizeof line)) {
        if (strcmp(line, "end_header") == 0)
            return header_is_whole(h, &s, error);
        if (!header_line(h, &s, line))
            return saga_fail(error, h->path,
                             "save it as ascii or "
                             "binary_little_endian, with vertices first and "
                             "scalar properties",
                             "header line \"%.80s\" is not "
                             "supported",
                             line);
    }
    return saga_fail(error, h->path, "copy it again",
                     "is cut short in its header");
}

/* Returns the value of a property. A double holds all values of these types. */
static double load_value(const uint8_t *p, int type)
{
    switch (type) {
    case PLY_I8:
        return (int8_t)p[0];
    case PLY_U8:
        return p[0];
    case PLY_I16:
        return (int16_t)(uint16_t)saga_load_le(p, 2);
    case PLY_U16:
        return (double)saga_load_le(p, 2);
    case PLY_I32:
        return (int32_t)(uint32_t)saga_load_le(p, 4);
    case PLY_U32:
        return (double)saga_load_le(p, 4);
    case PLY_F32:
        return saga_load_f32(p);
    default:
        return saga_load_f64(p);
    }
}

static bool take_binary(saga_cursor *c, const saga_ply *h, double *values)
{
    for (int i = 0; i < h->n_properties; i++) {
        const uint8_t *const p = saga_take(
            c, (size_t)ply_types[h->type[i]].nbytes);
        if (!p)
            return false;
        values[i] = load_value(p, h->type[i]);
    }
    return true;
}

/* Reads the values of a vertex from text. The buffer ends in NUL, so that
 * strtod stops there at the latest. */
static bool take_ascii(saga_cursor *c, const saga_ply *h, double *values)
{
    for (int i = 0; i < h->n_properties; i++) {
        const char *const text = (const char *)c->next;
        char *end;
        values[i] = strtod(text, &end);
        if (end == text || (const uint8_t *)end > c->end)
            return false;
        c->next = (const uint8_t *)end;
    }
    return true;
}

/* Converts a colour. Integers have the range of their type, real numbers
 * 0..1. */
static uint8_t colour_byte(double v, int type)
{
    const double unit = type == PLY_F32 || type == PLY_F64 ? 255.0
                        : type == PLY_U16                  ? 1.0 / 257.0
                                                           : 1.0;
    /* 16-bit colours are divided by 257, since 65535 / 257 is 255. */
    const double x = v * unit + 0.5;
    return x >= 255.0 ? 255 : x > 0.0 ? (uint8_t)x : 0;
}

static bool fill_point(saga_point *point, const saga_ply *h,
                       const double *values)
{
    /* Points without a colour are grey. */
    *point = (saga_point){ .rgb = { 128, 128, 128 } };
    for (int i = 0; i < 3; i++) {
        point->position[i] = values[h->field[i]];
        const int colour = h->field[FIELD_RED + i];
        if (colour >= 0)
            point->rgb[i] = colour_byte(values[colour], h->type[colour]);
    }
    return isfinite(point->position[0]) && isfinite(point->position[1]) &&
           isfinite(point->position[2]);
}

/* Returns the least number of bytes for one vertex, which bounds the count
 * before anything is allocated. */
static uint64_t least_nbytes(const saga_ply *h)
{
    uint64_t n = 0;
    /* A number in text takes at least a digit and a separator. */
    for (int i = 0; i < h->n_properties; i++)
        n += h->ascii ? 2 : (uint64_t)ply_types[h->type[i]].nbytes;
    return n;
}

static bool check_length(const saga_ply *h, saga_error *error)
{
    const size_t left = saga_left(&h->cursor);
    /* + 1, because the last number in text may lack its separator. */
    return h->count <= (left + 1) / least_nbytes(h) ||
           saga_fail(error, h->path, "copy it again",
                     "announces %llu points "
                     "but has only %zu bytes left",
                     (unsigned long long)h->count, left);
}

static bool take_vertex(double *values, saga_ply *h, uint64_t i,
                        saga_error *error)
{
    return (h->ascii ? take_ascii(&h->cursor, h, values)
                     : take_binary(&h->cursor, h, values)) ||
           saga_fail(error, h->path, "copy it again",
                     "is cut short at point "
                     "%llu of %llu",
                     (unsigned long long)i, (unsigned long long)h->count);
}

bool saga_ply_open(saga_ply *ply, const saga_bytes *bytes, saga_error *error)
{
    ply->cursor = (saga_cursor){ bytes->data, bytes->data + bytes->nbytes,
                                 false };
    return parse_header(ply, error) && check_length(ply, error);
}

bool saga_ply_next(float *values, saga_ply *ply, uint64_t number,
                   saga_error *error)
{
    double all[MAX_PROPERTIES];
    if (!take_vertex(all, ply, number, error))
        return false;
    for (int f = 0; f < ply->n_fields; f++)
        values[f] = ply->field[f] < 0 ? NAN : (float)all[ply->field[f]];
    return true;
}

static bool read_points(saga_ply *h, const saga_bytes *bytes,
                        saga_point **points, size_t *n_points,
                        size_t *n_dropped, saga_error *error)
{
    double values[MAX_PROPERTIES];
    if (!saga_ply_open(h, bytes, error))
        return false;
    if (h->field[FIELD_X] < 0 || h->field[FIELD_Y] < 0 || h->field[FIELD_Z] < 0)
        return saga_fail(error, h->path, "export positions with the points",
                         "vertices have no x, y, z");
    /* The file is long enough for that count, so the allocation is safe. */
    *points = saga_alloc((size_t)h->count, sizeof **points, h->path, error);
    if (!*points)
        return false;
    for (uint64_t i = 0; i < h->count; i++) {
        if (!take_vertex(values, h, i, error))
            return false;
        if (fill_point(&(*points)[*n_points], h, values))
            ++*n_points;
        else
            ++*n_dropped;
    }
    return true;
}

bool saga_ply_read(const char *path, saga_point **points, size_t *n_points,
                   size_t *n_dropped, saga_error *error)
{
    saga_ply h = { .path = path, .names = point_fields, .n_fields = N_FIELDS };
    saga_bytes bytes;
    *points = NULL;
    *n_points = *n_dropped = 0;
    if (!saga_read_file(&bytes, path, error))
        return false;
    const bool ok = read_points(&h, &bytes, points, n_points, n_dropped, error);
    saga_bytes_free(&bytes);
    if (!ok) {
        free(*points);
        *points = NULL;
        *n_points = 0;
    }
    return ok;
}

static void store_point(uint8_t record[15], const saga_point *point)
{
    for (int i = 0; i < 3; i++) {
        const float x = (float)point->position[i];
        uint32_t bits;
        memcpy(&bits, &x, 4);
        for (int b = 0; b < 4; b++)
            record[4 * i + b] = (uint8_t)(bits >> 8 * b);
        record[12 + i] = point->rgb[i];
    }
}

bool saga_ply_write(const char *path, const saga_point *points, size_t n_points,
                    saga_error *error)
{
    saga_output out;
    if (!saga_output_open(&out, path, error))
        return false;
    bool ok = fprintf(out.file,
                      "ply\nformat binary_little_endian 1.0\n"
                      "element vertex %zu\n"
                      "property float x\nproperty float y\nproperty float z\n"
                      "property uchar red\nproperty uchar green\n"
                      "property uchar blue\nend_header\n",
                      n_points) > 0;
    for (size_t i = 0; ok && i < n_points; i++) {
        uint8_t record[15];
        store_point(record, &points[i]);
        ok = fwrite(record, sizeof record, 1, out.file) == 1;
    }
    return saga_output_close(&out, ok, error);
}
