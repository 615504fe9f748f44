/* SPDX-License-Identifier: MIT
 *
 * Writes one array of floats for each attribute.
 */
#include "cloud_glb.h"

#include "alloc.h"
#include "json_memory.h"
#include "output.h"
#include "put.h"

#include <jansson.h>
#include <math.h>
#include <stdlib.h>

enum { ARRAY_BUFFER = 34962, MOST_ATTRIBUTES = 4 + SAGA_MAX_HARMONICS };

/* An attribute has n_components floats for each splat, which `value`
 * returns. */
typedef struct attribute attribute;
struct attribute {
    char name[GLB_NAME_NBYTES];
    const char *type;
    int n_components;
    int harmonic;
    float (*value)(const saga_cloud *cloud, size_t i, int k,
                   const attribute *a);
};

static float mean(const saga_cloud *c, size_t i, int k, const attribute *a)
{
    (void)a;
    return c->mean[3 * i + (size_t)k];
}

static float scale(const saga_cloud *c, size_t i, int k, const attribute *a)
{
    (void)a;
    return expf(c->log_scale[3 * i + (size_t)k]);
}

/* glTF stores the real part of a quaternion last. */
static float quat(const saga_cloud *c, size_t i, int k, const attribute *a)
{
    (void)a;
    return c->quat[4 * i + (size_t)((k + 1) % 4)];
}

static float opacity(const saga_cloud *c, size_t i, int k, const attribute *a)
{
    (void)k;
    (void)a;
    return (float)(1.0 / (1.0 + exp(-(double)c->logit[i])));
}

static float colour(const saga_cloud *c, size_t i, int k, const attribute *a)
{
    const size_t n = (size_t)saga_n_harmonics(c->degree);

    return c->colour[3 * (n * i + (size_t)a->harmonic) + (size_t)k];
}

/* A cloud and the attributes that the file will have. */
typedef struct {
    const saga_cloud *cloud;
    attribute attribute[MOST_ATTRIBUTES];
    int n; /* number of attributes */
    size_t bin_nbytes;
} glb;

static void list_attributes(glb *g)
{
    attribute *const a = g->attribute;
    int n = 4;

    a[0] = (attribute){ "POSITION", "VEC3", 3, 0, mean };
    a[1] = (attribute){ GLB_SPLATS ":ROTATION", "VEC4", 4, 0, quat };
    a[2] = (attribute){ GLB_SPLATS ":SCALE", "VEC3", 3, 0, scale };
    a[3] = (attribute){ GLB_SPLATS ":OPACITY", "SCALAR", 1, 0, opacity };
    /* Coefficients are ordered by degree, as in a cloud, so n - 4 is the number
     * of the harmonic. */
    for (int degree = 0; degree <= g->cloud->degree; degree++)
        for (int k = 0; k < 2 * degree + 1; k++, n++) {
            a[n] = (attribute){ "", "VEC3", 3, n - 4, colour };
            saga_glb_harmonic_name(a[n].name, degree, k);
        }
    g->n = n;
}

/* --- JSON ---------------------------------------------------------------- */

/* glTF requires the bounds of the positions. */
static void add_bounds(json_t *accessor, const saga_cloud *cloud)
{
    json_t *const low = json_array(), *const high = json_array();

    for (int k = 0; k < 3; k++) {
        float least = INFINITY, most = -INFINITY;

        for (size_t i = 0; i < cloud->n; i++) {
            least = fminf(least, cloud->mean[3 * i + (size_t)k]);
            most = fmaxf(most, cloud->mean[3 * i + (size_t)k]);
        }
        json_array_append_new(low, json_real((double)least));
        json_array_append_new(high, json_real((double)most));
    }
    json_object_set_new(accessor, "min", low);
    json_object_set_new(accessor, "max", high);
}

static json_t *json_primitive(const glb *g)
{
    json_t *const of = json_object();

    for (int i = 0; i < g->n; i++)
        json_object_set_new(of, g->attribute[i].name, json_integer(i));
    return json_pack("{sosis{s{ssssssss}}}", "attributes", of, "mode",
                     GLB_POINTS, "extensions", GLB_SPLATS, "kernel", "ellipse",
                     "colorSpace", GLB_COLOUR_SPACE, "projection",
                     "perspective", "sortingMethod", "cameraDistance");
}

/* Makes the JSON and sets bin_nbytes, the size of the binary chunk. */
static json_t *json_of(glb *g)
{
    const saga_cloud *const cloud = g->cloud;
    json_t *const views = json_array(), *const accessors = json_array();

    /* One accessor and one view per attribute, without gaps between them. */
    for (int i = 0; i < g->n; i++) {
        const attribute *const a = &g->attribute[i];
        const size_t size = 4 * (size_t)a->n_components * cloud->n;
        json_t *const accessor = json_pack(
            "{sisisIss}", "bufferView", i, "componentType", GLB_FLOAT, "count",
            (json_int_t)cloud->n, "type", a->type);

        if (i == 0)
            add_bounds(accessor, cloud);
        json_array_append_new(accessors, accessor);
        json_array_append_new(
            views, json_pack("{sisIsIsi}", "buffer", 0, "byteOffset",
                             (json_int_t)g->bin_nbytes, "byteLength",
                             (json_int_t)size, "target", ARRAY_BUFFER));
        g->bin_nbytes += size;
    }
    return json_pack("{s{ssss}s[s]sis[{s[i]}]s[{si}]s[{s[o]}]s[{sI}]soso}",
                     "asset", "version", "2.0", "generator", "saga export",
                     "extensionsUsed", GLB_SPLATS, "scene", 0, "scenes",
                     "nodes", 0, "nodes", "mesh", 0, "meshes", "primitives",
                     json_primitive(g), "buffers", "byteLength",
                     (json_int_t)g->bin_nbytes, "bufferViews", views,
                     "accessors", accessors);
}

/* --- The file ------------------------------------------------------------ */

/* Writes one attribute of all splats. */
static bool write_attribute(FILE *f, const saga_cloud *cloud,
                            const attribute *a)
{
    bool ok = true;

    for (size_t i = 0; i < cloud->n && ok; i++) {
        uint8_t record[4 * 4], *at = record;

        for (int k = 0; k < a->n_components; k++)
            saga_put_f32(&at, a->value(cloud, i, k, a));
        ok = fwrite(record, 1, (size_t)(at - record), f) ==
             (size_t)(at - record);
    }
    return ok;
}

/* Writes the file's header, the JSON, padded with blanks to a multiple of 4
 * bytes, and the header of the binary chunk. */
static bool write_heads(FILE *f, const char *text, size_t bin_nbytes)
{
    const size_t n = strlen(text), padded = (n + 3) / 4 * 4;
    uint8_t head[20], bin[8], *at = head, *behind = bin;

    saga_put_le(&at, GLB_MAGIC, 4);
    saga_put_le(&at, GLB_VERSION, 4);
    /* The length of the file: 12 bytes for its header, 8 for the JSON chunk's
     * header, the text, 8 for the binary chunk's header, and the floats, which
     * need no padding. */
    saga_put_le(&at, (uint32_t)(20 + padded + 8 + bin_nbytes), 4);
    saga_put_le(&at, (uint32_t)padded, 4);
    saga_put_le(&at, GLB_JSON, 4);
    saga_put_le(&behind, (uint32_t)bin_nbytes, 4);
    saga_put_le(&behind, GLB_BIN, 4);
    return fwrite(head, 1, 20, f) == 20 && fwrite(text, 1, n, f) == n &&
           fwrite("   ", 1, padded - n, f) == padded - n &&
           fwrite(bin, 1, 8, f) == 8;
}

static bool write_file(const char *path, const glb *g, const char *text,
                       saga_error *error)
{
    saga_output out;
    bool ok;

    if (!saga_output_open(&out, path, error))
        return false;
    ok = write_heads(out.file, text, g->bin_nbytes);
    for (int i = 0; i < g->n && ok; i++)
        ok = write_attribute(out.file, g->cloud, &g->attribute[i]);
    return saga_output_close(&out, ok, error);
}

static bool write_glb(const char *path, saga_cloud *cloud, saga_error *error)
{
    glb g = { .cloud = cloud };
    json_t *o;
    char *text;
    bool ok;

    if (!cloud->n)
        return saga_fail(error, path, "choose another frame",
                         "no splat is "
                         "visible, and glTF has no empty arrays");
    saga_cloud_turn(cloud, 2);
    list_attributes(&g);
    saga_json_watch();
    o = json_of(&g);
    /* Nine significant digits distinguish all floats, so the bounds are exactly
     * those of the stored positions. */
    text = o ? json_dumps(o, JSON_COMPACT | JSON_REAL_PRECISION(9)) : NULL;
    ok = !text || saga_json_starved() ? saga_no_memory(0, path, error)
                                      : write_file(path, &g, text, error);
    free(text);
    json_decref(o);
    /* A second half turn restores the axes of PLY. */
    saga_cloud_turn(cloud, 2);
    return ok;
}

const saga_cloud_format saga_glb_format = {
    "glTF",
    ".glb",
    "floats, by KHR_gaussian_splatting; "
    "KHR_gaussian_splatting_compression_spz_2 is read, too",
    saga_is_glb,
    saga_glb_read,
    write_glb,
    { .log_scale = { 0 } }
};
