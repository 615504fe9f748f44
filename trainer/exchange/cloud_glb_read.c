/* SPDX-License-Identifier: MIT */
#include "cloud_glb.h"
#include "cloud_spz.h"

#include "alloc.h"
#include "json_memory.h"

#include <stdlib.h>

#define SPZ_EXTENSION "KHR_gaussian_splatting_compression_spz_2"
#define AGAIN "export it again"

/* A glTF file, divided into its parts. */
typedef struct {
    const char *path;
    json_t *root;
    saga_bytes bin; /* the binary chunk, inside the file's bytes */
    const json_t *primitive, *splats; /* its primitive of splats, and that
                                       * primitive's extension */
    saga_error *error;
} glb;

/* --- JSON ---------------------------------------------------------------- */

static const json_t *item(const glb *g, const char *list, json_int_t i)
{
    const json_t *const array = json_object_get(g->root, list);

    return i < 0 ? NULL : json_array_get(array, (size_t)i);
}

/* Returns an integer member, or -1 if it is missing or not an integer. */
static json_int_t integer(const json_t *object, const char *name)
{
    const json_t *const v = json_object_get(object, name);

    return json_is_integer(v) ? json_integer_value(v) : -1;
}

/* Returns an integer member that may be missing, which means 0. */
static json_int_t offset(const json_t *object, const char *name)
{
    return json_object_get(object, name) ? integer(object, name) : 0;
}

static const json_t *extension(const json_t *object, const char *name)
{
    return json_object_get(json_object_get(object, "extensions"), name);
}

/* --- Chunks -------------------------------------------------------------- */

/* Reads a chunk, which must have this type. */
static bool take_chunk(saga_bytes *chunk, saga_cursor *c, uint32_t type)
{
    const size_t n = (size_t)saga_take_le(c, 4);
    const bool is_it = saga_take_le(c, 4) == type;

    chunk->data = (uint8_t *)(uintptr_t)saga_take(c, n);
    chunk->nbytes = chunk->data ? n : 0;
    return chunk->data && is_it;
}

static bool open_glb(glb *g, const saga_bytes *bytes)
{
    saga_cursor c = { bytes->data, bytes->data + bytes->nbytes, false };
    saga_bytes text;
    uint64_t version;

    saga_take(&c, 4);
    version = saga_take_le(&c, 4);
    saga_take(&c, 4);
    if (version != GLB_VERSION)
        return saga_fail(g->error, g->path, "save it as version 2",
                         "is glTF of version %u", (unsigned)version);
    if (!take_chunk(&text, &c, GLB_JSON) ||
        (saga_left(&c) > 0 && !take_chunk(&g->bin, &c, GLB_BIN)))
        return saga_fail(g->error, g->path, "copy it again",
                         "is cut short in its chunks");
    g->root = saga_json_parse(&text, g->path, g->error);
    return g->root != NULL;
}

/* --- The primitive ------------------------------------------------------- */

/* Returns the mesh that has the only primitive of splats, or -1 if there is
 * none or more than one. */
static json_int_t find_primitive(glb *g)
{
    json_int_t mesh = -1;
    int n = 0;

    for (json_int_t i = 0; item(g, "meshes", i); i++) {
        const json_t *const list = json_object_get(item(g, "meshes", i),
                                                   "primitives");

        /* The last one found is kept; it counts only if it is the only one. */
        for (size_t k = 0; k < json_array_size(list); k++) {
            const json_t *const p = json_array_get(list, k);

            if (!extension(p, GLB_SPLATS))
                continue;
            g->primitive = p;
            g->splats = extension(p, GLB_SPLATS);
            mesh = i;
            n++;
        }
    }
    if (n == 1)
        return mesh;
    saga_fail(g->error, g->path, "export it with one",
              "has %d primitives with " GLB_SPLATS, n);
    return -1;
}

/* Tells whether a list of numbers is missing or has the values that change
 * nothing. */
static bool is_neutral(const json_t *list, const double *neutral)
{
    for (size_t i = 0; i < json_array_size(list); i++)
        if (json_number_value(json_array_get(list, i)) != neutral[i % 16])
            return false;
    return true;
}

static bool is_placed(const json_t *node)
{
    static const double none[16], one[16] = { 1, 1, 1 };
    static const double unit[16] = { 0, 0, 0, 1 };
    static const double matrix[16] = { 1, 0, 0, 0, 0, 1, 0, 0,
                                       0, 0, 1, 0, 0, 0, 0, 1 };

    return !is_neutral(json_object_get(node, "translation"), none) ||
           !is_neutral(json_object_get(node, "scale"), one) ||
           !is_neutral(json_object_get(node, "rotation"), unit) ||
           !is_neutral(json_object_get(node, "matrix"), matrix);
}

static json_int_t parent_of(const glb *g, json_int_t child)
{
    for (json_int_t i = 0; item(g, "nodes", i); i++) {
        const json_t *const list = json_object_get(item(g, "nodes", i),
                                                   "children");

        for (size_t k = 0; k < json_array_size(list); k++)
            if (json_integer_value(json_array_get(list, k)) == child)
                return i;
    }
    return -1;
}

/* Fails if a node moves or turns the mesh, because turned harmonics are not
 * supported. */
static bool check_nodes(const glb *g, json_int_t mesh)
{
    const size_t n = json_array_size(json_object_get(g->root, "nodes"));
    json_int_t at = 0;

    while (item(g, "nodes", at) &&
           integer(item(g, "nodes", at), "mesh") != mesh)
        at++;
    /* Walks towards the root, for at most n nodes, since a bad file may have a
     * cycle. */
    for (size_t i = 0; i < n && item(g, "nodes", at); i++) {
        if (is_placed(item(g, "nodes", at)))
            return saga_fail(g->error, g->path, "apply it to the splats",
                             "its node %d moves, turns or scales them",
                             (int)at);
        at = parent_of(g, at);
    }
    return true;
}

static bool check_splats(const glb *g)
{
    const char *const space = json_string_value(
        json_object_get(g->splats, "colorSpace"));

    return !space || strcmp(space, GLB_COLOUR_SPACE) == 0 ||
           saga_fail(g->error, g->path, "convert them to " GLB_COLOUR_SPACE,
                     "its splats have colours in %.60s", space);
}

/* --- Arrays -------------------------------------------------------------- */

/* A checked accessor: all of its elements lie in the file. */
typedef struct {
    const uint8_t *data;
    size_t n, stride;
    int n_components, size; /* components of an element; bytes of a
                             * component */
    bool is_signed, is_float;
    double unit; /* the integer that stands for 1; 1 if integers
                  * stand for themselves */
} accessor;

/* Finds the bytes of a buffer view. */
static bool find_view(const uint8_t **data, size_t *nbytes, const glb *g,
                      json_int_t index)
{
    const json_t *const view = item(g, "bufferViews", index);
    const json_int_t at = offset(view, "byteOffset");
    const json_int_t n = integer(view, "byteLength");

    /* Buffer 0 is the binary chunk if it has no URI. */
    if (!view || integer(view, "buffer") != 0 || at < 0 || n < 0 ||
        json_object_get(item(g, "buffers", 0), "uri") ||
        (size_t)at > g->bin.nbytes || (size_t)n > g->bin.nbytes - (size_t)at)
        return saga_fail(g->error, g->path, "save it as one .glb file",
                         "buffer view %d is not within its binary chunk of "
                         "%zu bytes",
                         (int)index, g->bin.nbytes);
    *data = g->bin.data + at;
    *nbytes = (size_t)n;
    return true;
}

static bool set_type(accessor *a, const json_t *of)
{
    static const struct {
        json_int_t type;
        int size;
        bool is_signed, is_float;
        double most;
    } types[] = { { 5120, 1, true, false, 127 },
                  { 5121, 1, false, false, 255 },
                  { 5122, 2, true, false, 32767 },
                  { 5123, 2, false, false, 65535 },
                  { GLB_FLOAT, 4, true, true, 1 } };
    const json_int_t type = integer(of, "componentType");

    /* Normalised integers are divided by the largest one. */
    for (size_t i = 0; i < sizeof types / sizeof types[0]; i++)
        if (types[i].type == type) {
            a->size = types[i].size;
            a->is_signed = types[i].is_signed;
            a->is_float = types[i].is_float;
            a->unit = json_is_true(json_object_get(of, "normalized"))
                          ? types[i].most
                          : 1;
            return true;
        }
    return false;
}

static int components_of(const json_t *of)
{
    const char *const type = json_string_value(json_object_get(of, "type"));

    return !type                         ? 0
           : strcmp(type, "SCALAR") == 0 ? 1
           : strcmp(type, "VEC3") == 0   ? 3
           : strcmp(type, "VEC4") == 0   ? 4
                                         : 0;
}

/* Finds the array of a required attribute. */
static bool find_accessor(accessor *a, const glb *g, const char *name,
                          int n_components)
{
    const json_int_t index = integer(
        json_object_get(g->primitive, "attributes"), name);
    const json_t *const of = item(g, "accessors", index);
    const json_t *const view = item(g, "bufferViews",
                                    integer(of, "bufferView"));
    const json_int_t n = integer(of, "count"), at = offset(of, "byteOffset");
    const json_int_t stride = offset(view, "byteStride");
    size_t nbytes, element;

    if (!of)
        return saga_fail(g->error, g->path, AGAIN, "its splats have no %s",
                         name);
    if (!set_type(a, of) || components_of(of) != n_components ||
        json_object_get(of, "sparse") || !view || n < 0 || n > UINT32_MAX ||
        at < 0 || at > UINT32_MAX || stride < 0 || stride > 255)
        return saga_fail(g->error, g->path, AGAIN,
                         "%s has an unsupported "
                         "form",
                         name);
    if (!find_view(&a->data, &nbytes, g, integer(of, "bufferView")))
        return false;
    /* The last element must end inside the view. */
    a->n = (size_t)n;
    a->n_components = n_components;
    element = (size_t)n_components * (size_t)a->size;
    a->stride = stride ? (size_t)stride : element;
    if (a->n && (uint64_t)at + (a->n - 1) * a->stride + element > nbytes)
        return saga_fail(g->error, g->path, "copy it again",
                         "%s announces %zu "
                         "elements, but has %zu bytes",
                         name, a->n, nbytes);
    a->data += at;
    return true;
}

/* Returns component k of element i. */
static double value_of(const accessor *a, size_t i, int k)
{
    const uint8_t *const p = a->data + a->stride * i + (size_t)(k * a->size);
    const uint32_t bits = (uint32_t)saga_load_le(p, a->size);
    /* The sign bit has a negative value. */
    const int64_t sign = a->is_signed ? (int64_t)1 << (8 * a->size - 1) : 0;

    if (a->is_float)
        return saga_load_f32(p);
    return (double)((int64_t)bits - (bits & sign ? 2 * sign : 0)) / a->unit;
}

/* --- Splats -------------------------------------------------------------- */

static int degree_of(const glb *g)
{
    const json_t *const of = json_object_get(g->primitive, "attributes");
    char name[GLB_NAME_NBYTES];
    int degree = 0;

    do
        saga_glb_harmonic_name(name, ++degree, 0);
    while (json_object_get(of, name));
    return degree - 1 < SAGA_MAX_DEGREE ? degree - 1 : SAGA_MAX_DEGREE;
}

enum {
    MEAN,
    ROTATION,
    SCALE,
    OPACITY,
    COLOUR,
    N_ARRAYS = COLOUR + SAGA_MAX_HARMONICS
};

static bool find_arrays(accessor a[N_ARRAYS], const glb *g, int degree)
{
    char name[GLB_NAME_NBYTES];
    bool ok = find_accessor(&a[MEAN], g, "POSITION", 3) &&
              find_accessor(&a[ROTATION], g, GLB_SPLATS ":ROTATION", 4) &&
              find_accessor(&a[SCALE], g, GLB_SPLATS ":SCALE", 3) &&
              find_accessor(&a[OPACITY], g, GLB_SPLATS ":OPACITY", 1);
    int n = COLOUR;

    for (int d = 0; d <= degree; d++)
        for (int k = 0; k < 2 * d + 1 && ok; k++, n++) {
            saga_glb_harmonic_name(name, d, k);
            ok = find_accessor(&a[n], g, name, 3);
        }
    for (int i = 0; i < n && ok; i++)
        ok = a[i].n == a[MEAN].n || saga_fail(g->error, g->path, AGAIN,
                                              "has %zu positions, but %zu "
                                              "elements of another attribute",
                                              a[MEAN].n, a[i].n);
    return ok;
}

static void take_splat(saga_cloud *cloud, size_t i, const accessor *a)
{
    const size_t each = 3 * (size_t)saga_n_harmonics(cloud->degree);

    for (int k = 0; k < 3; k++) {
        cloud->mean[3 * i + (size_t)k] = (float)value_of(&a[MEAN], i, k);
        cloud->log_scale[3 * i + (size_t)k] = (float)value_of(&a[SCALE], i, k);
    }
    /* glTF stores the real part last. */
    for (int k = 0; k < 4; k++)
        cloud->quat[4 * i + (size_t)((k + 1) % 4)] = (float)value_of(
            &a[ROTATION], i, k);
    cloud->logit[i] = (float)value_of(&a[OPACITY], i, 0);
    for (size_t k = 0; k < each; k++)
        cloud->colour[each * i + k] = (float)value_of(&a[COLOUR + k / 3], i,
                                                      (int)(k % 3));
}

static bool read_arrays(saga_cloud *cloud, const glb *g)
{
    const int degree = degree_of(g);
    accessor a[N_ARRAYS];

    if (!find_arrays(a, g, degree) ||
        !saga_cloud_admit(cloud, a[MEAN].n, degree, g->path, g->error))
        return false;
    cloud->form = SAGA_FORM_LINEAR;
    for (size_t i = 0; i < cloud->n; i++)
        take_splat(cloud, i, a);
    saga_cloud_turn(cloud, 2);
    return true;
}

/* Reads splats that are packed as SPZ. Like a file, the SPZ data is converted
 * to PLY's axes. */
static bool read_packed(saga_cloud *cloud, const glb *g, const json_t *packed)
{
    saga_bytes part;
    const uint8_t *data;

    if (!find_view(&data, &part.nbytes, g, integer(packed, "bufferView")))
        return false;
    part.data = (uint8_t *)(uintptr_t)data;
    return saga_is_spz(&part)
               ? saga_spz_read(cloud, &part, g->path, g->error)
               : saga_fail(g->error, g->path, AGAIN,
                           "has no SPZ where " SPZ_EXTENSION " says");
}

bool saga_is_glb(const saga_bytes *bytes)
{
    return bytes->nbytes >= GLB_HEADER_NBYTES &&
           saga_load_le(bytes->data, 4) == GLB_MAGIC;
}

bool saga_glb_read(saga_cloud *cloud, const saga_bytes *bytes, const char *path,
                   saga_error *error)
{
    glb g = { .path = path, .error = error };
    json_int_t mesh;
    bool ok = false;

    if (!open_glb(&g, bytes))
        return false;
    mesh = find_primitive(&g);
    if (mesh >= 0 && check_nodes(&g, mesh) && check_splats(&g)) {
        const json_t *const packed = extension(g.splats, SPZ_EXTENSION);

        ok = packed ? read_packed(cloud, &g, packed) : read_arrays(cloud, &g);
    }
    json_decref(g.root);
    return ok;
}
