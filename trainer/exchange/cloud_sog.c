/* SPDX-License-Identifier: MIT
 *
 * Writes SOG. Lists of codes have equal steps, so that the error of a number is
 * at most half a step; each splat has a row of its own in the palette.
 */
#include "cloud_sog.h"

#include "alloc.h"
#include "cloud_order.h"
#include "json_memory.h"
#include "output.h"
#include "zip_write.h"

#include <math.h>
#include <stdlib.h>
#include <webp/encode.h>

/* A range of numbers, coded with SOG_CODES equal steps. */
typedef struct {
    double least, most;
} range;

/* A cloud while its file is written. */
typedef struct {
    const saga_cloud *cloud;
    uint32_t *order;      /* (n) indices of splats in the file's order */
    size_t width, height; /* size of the pictures with a pixel per splat */
    range mean[3], scale, sh0, rest;
    uint8_t *rgba; /* pixels of the current picture */
    saga_zip_out zip;
    const char *path;
    saga_error *error;
} writer;

static size_t n_rest(const writer *w)
{
    return (size_t)saga_n_harmonics(w->cloud->degree) - 1;
}

/* --- Ranges -------------------------------------------------------------- */

static void widen(range *r, double v)
{
    r->least = fmin(r->least, v);
    r->most = fmax(r->most, v);
}

/* Returns the stored value of a coordinate; its steps are fine near the
 * origin. */
static double kept(float x)
{
    return copysign(log1p(fabs((double)x)), (double)x);
}

static void find_ranges(writer *w)
{
    const saga_cloud *const c = w->cloud;
    const size_t n = 3 * (size_t)saga_n_harmonics(c->degree);
    const range none = { INFINITY, -INFINITY };

    w->mean[0] = w->mean[1] = w->mean[2] = none;
    w->scale = w->sh0 = w->rest = none;
    for (size_t i = 0; i < c->n; i++) {
        for (size_t k = 0; k < 3; k++) {
            widen(&w->mean[k], kept(c->mean[3 * i + k]));
            widen(&w->scale, (double)c->log_scale[3 * i + k]);
        }
        for (size_t k = 0; k < n; k++)
            widen(k < 3 ? &w->sh0 : &w->rest, (double)c->colour[n * i + k]);
    }
}

/* Returns the number of the nearest of `most` + 1 equal steps in a range. */
static uint32_t code_of(const range *r, double v, double most)
{
    const double extent = r->most - r->least;

    return extent > 0.0 ? (uint32_t)lrint(most * (v - r->least) / extent) : 0;
}

static uint8_t code(const range *r, float v)
{
    return (uint8_t)code_of(r, (double)v, SOG_CODES - 1);
}

/* --- Pixels -------------------------------------------------------------- */

typedef void put_pixel_fn(uint8_t p[4], const writer *w, size_t i);

static void put_low(uint8_t p[4], const writer *w, size_t i)
{
    for (int a = 0; a < 3; a++)
        p[a] = (uint8_t)code_of(
            &w->mean[a], kept(w->cloud->mean[3 * i + (size_t)a]), 65535.0);
}

static void put_high(uint8_t p[4], const writer *w, size_t i)
{
    for (int a = 0; a < 3; a++)
        p[a] = (uint8_t)(code_of(&w->mean[a],
                                 kept(w->cloud->mean[3 * i + (size_t)a]),
                                 65535.0) >>
                         8);
}

static void put_scale(uint8_t p[4], const writer *w, size_t i)
{
    for (size_t a = 0; a < 3; a++)
        p[a] = code(&w->scale, w->cloud->log_scale[3 * i + a]);
}

static void put_quat(uint8_t p[4], const writer *w, size_t i)
{
    const float *const q = w->cloud->quat + 4 * i;
    uint32_t code[3];

    p[3] = (uint8_t)(SOG_FIRST_MODE + saga_quat_code(code, q, 255.0));
    for (int n = 0; n < 3; n++)
        p[n] = (uint8_t)code[n];
}

static void put_sh0(uint8_t p[4], const writer *w, size_t i)
{
    for (size_t c = 0; c < 3; c++)
        p[c] = code(&w->sh0, w->cloud->colour[3 * (n_rest(w) + 1) * i + c]);
    p[3] = (uint8_t)lrint(255.0 / (1.0 + exp(-(double)w->cloud->logit[i])));
}

/* --- Pictures ------------------------------------------------------------ */

static bool add_picture(writer *w, const char *name, size_t width,
                        size_t height)
{
    uint8_t *webp = NULL;
    const size_t n = WebPEncodeLosslessRGBA(w->rgba, (int)width, (int)height,
                                            (int)(4 * width), &webp);
    const bool ok = n > 0 ? saga_zip_add(&w->zip, name, webp, n, w->error)
                          : saga_no_memory(0, w->path, w->error);

    WebPFree(webp);
    return ok;
}

/* Adds a picture with a pixel per splat; pixels after the last splat are 0. */
static bool add_splats(writer *w, const char *name, put_pixel_fn *put)
{
    memset(w->rgba, 0, 4 * w->width * w->height);
    for (size_t k = 0; k < w->cloud->n; k++) {
        uint8_t *const p = w->rgba + 4 * k;

        p[3] = 255;
        put(p, w, w->order[k]);
    }
    return add_picture(w, name, w->width, w->height);
}

/* Adds the palette. Its row k belongs to splat k of the order. */
static bool add_palette(writer *w)
{
    const size_t n = n_rest(w), width = SOG_ROWS_ABREAST * n;
    const size_t height = (w->cloud->n + SOG_ROWS_ABREAST - 1) /
                          SOG_ROWS_ABREAST;

    memset(w->rgba, 0, 4 * width * height);
    for (size_t i = 0; i < w->cloud->n * n; i++) {
        const size_t splat = w->order[i / n], k = i % n + 1;
        const float *const colour = w->cloud->colour +
                                    3 * ((n + 1) * splat + k);

        for (size_t c = 0; c < 3; c++)
            w->rgba[4 * i + c] = code(&w->rest, colour[c]);
        w->rgba[4 * i + 3] = 255;
    }
    return add_picture(w, "shN_centroids.webp", width, height);
}

static bool add_labels(writer *w)
{
    memset(w->rgba, 0, 4 * w->width * w->height);
    for (size_t k = 0; k < w->cloud->n; k++) {
        w->rgba[4 * k] = (uint8_t)k;
        w->rgba[4 * k + 1] = (uint8_t)(k >> 8);
        w->rgba[4 * k + 3] = 255;
    }
    return add_picture(w, "shN_labels.webp", w->width, w->height);
}

/* --- The text ------------------------------------------------------------ */

static json_t *codebook(const range *r)
{
    json_t *const list = json_array();

    for (int k = 0; k < SOG_CODES; k++)
        saga_json_append_item(
            list,
            json_real(r->least + (r->most - r->least) * k / (SOG_CODES - 1)));
    return list;
}

static json_t *json_of(const writer *w)
{
    const range *const m = w->mean;
    json_t *const meta = json_pack(
        "{sis{ss}sIs{s[fff]s[fff]s[ss]}s{sos[s]}s{s[s]}s{sos[s]}}", "version",
        SOG_VERSION, "asset", "generator", "saga export", "count",
        (json_int_t)w->cloud->n, "means", "mins", m[0].least, m[1].least,
        m[2].least, "maxs", m[0].most, m[1].most, m[2].most, "files",
        "means_l.webp", "means_u.webp", "scales", "codebook",
        codebook(&w->scale), "files", "scales.webp", "quats", "files",
        "quats.webp", "sh0", "codebook", codebook(&w->sh0), "files",
        "sh0.webp");

    if (w->cloud->degree)
        saga_json_set_value(
            meta, "shN",
            json_pack("{sIsisos[ss]}", "count", (json_int_t)w->cloud->n,
                      "bands", w->cloud->degree, "codebook", codebook(&w->rest),
                      "files", "shN_centroids.webp", "shN_labels.webp"));
    return meta;
}

static bool add_meta(writer *w)
{
    json_t *meta;
    char *text;
    bool ok;

    saga_json_watch();
    meta = json_of(w);
    text = meta ? json_dumps(meta, JSON_COMPACT | JSON_REAL_PRECISION(9))
                : NULL;
    ok = text && !saga_json_starved() && !saga_json_lost()
             ? saga_zip_add(&w->zip, "meta.json", (const uint8_t *)text,
                            strlen(text), w->error)
             : saga_no_memory(0, w->path, w->error);
    free(text);
    json_decref(meta);
    return ok;
}

/* --- The file ------------------------------------------------------------ */

static bool add_all(writer *w)
{
    return add_splats(w, "means_l.webp", put_low) &&
           add_splats(w, "means_u.webp", put_high) &&
           add_splats(w, "scales.webp", put_scale) &&
           add_splats(w, "quats.webp", put_quat) &&
           add_splats(w, "sh0.webp", put_sh0) &&
           (!w->cloud->degree || (add_palette(w) && add_labels(w))) &&
           add_meta(w);
}

static bool write_file(writer *w)
{
    saga_output out;
    bool ok;

    if (!saga_output_open(&out, w->path, w->error))
        return false;
    w->zip = (saga_zip_out){ .file = out.file, .path = w->path };
    ok = add_all(w);
    ok = saga_zip_end(&w->zip, ok);
    return saga_output_close(&out, ok, w->error);
}

static bool write_sog(const char *path, saga_cloud *cloud, saga_error *error)
{
    writer w = { .cloud = cloud, .path = path, .error = error };
    bool ok;

    if (!cloud->n)
        return saga_fail(error, path, "choose another frame",
                         "no splat is "
                         "visible, and SOG has no empty pictures");
    if (cloud->degree && cloud->n > SOG_MOST_ROWS)
        return saga_fail(error, path, "give --sh 0",
                         "SOG cannot hold the "
                         "harmonics of %zu splats, only of %d",
                         cloud->n, SOG_MOST_ROWS);
    /* Pictures are square as far as possible. rgba also has room for the
     * palette with its last line. */
    w.width = (size_t)ceil(sqrt((double)cloud->n));
    w.height = (cloud->n + w.width - 1) / w.width;
    w.order = saga_cloud_order(cloud, error);
    w.rgba = saga_alloc(w.width * w.height +
                            (cloud->n + SOG_ROWS_ABREAST) * n_rest(&w),
                        4, path, error);
    find_ranges(&w);
    ok = w.order && w.rgba && write_file(&w);
    free(w.order);
    free(w.rgba);
    return ok;
}

const saga_cloud_format saga_sog_format = {
    "SOG",
    ".sog",
    "16-bit positions, all else 8 bits, in WebP pictures; "
    "meta.json beside its pictures is read, too",
    saga_is_sog,
    saga_sog_read,
    write_sog,
    { .log_scale = { 0 } }
};
