/* SPDX-License-Identifier: MIT
 *
 * This program measures on a file how much error each number format causes. The
 * reference draws a picture in double, and again with one rounding, coarser or
 * finer than the decoder's, at a time. It prints, as JSON, the difference
 * between the two pictures before they are rounded to 8 bits.
 *
 *     make_formats FILE.saga [CAMERA [FRAME]]
 */
#include "file.h"
#include "reconstruct.h"
#include "ref_scene.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { EXACT = 0 };

/* Numbers of fractional bits, or EXACT for no rounding. A splat is cut off
 * where q reaches `cut`. */
typedef struct {
    int mean, factor, q, table, alpha, trans, colour;
    double cut;
} format;

static const format exact = { EXACT, EXACT, EXACT, EXACT,
                              EXACT, EXACT, EXACT, SAGA_CUT_LOG2 };
static const format norm = { 8, 28, 20, 11, 16, 16, 15, SAGA_CUT_LOG2 };

typedef struct {
    ref_file file;
    ref_scene scene;
    ref_rounding rounding;
    saga_camera camera;
    saga_primitive *prims;
    int16_t *colours;
    int32_t t;
    ref_splat *splat;           /* one for each primitive */
    uint8_t *visible;           /* whether each primitive is visible */
    uint32_t *order, n;         /* the order of blending of the exact picture,
                                 * which all pictures use */
    double *rgb, *base, *trans; /* a picture, the exact picture, T */
    double n_pairs;             /* number of pixels blended, over all splats */
    int n_printed;
} session;

static void *need(size_t count, size_t size)
{
    void *const p = calloc(count + 1, size);

    if (!p) {
        fprintf(stderr, "make_formats: out of memory\n");
        exit(2);
    }
    return p;
}

static void refuse(const char *name, const char *why)
{
    fprintf(stderr, "make_formats: %s: %s\n", name, why);
    exit(1);
}

/* --- Rounding ------------------------------------------------------------ */

static double nearest(double x, int bits)
{
    return bits == EXACT ? x : ldexp(floor(ldexp(x, bits) + 0.5), -bits);
}

static double down(double x, int bits)
{
    return bits == EXACT ? x : ldexp(floor(ldexp(x, bits)), -bits);
}

/* Returns 2^(3 - q) from a table with 2^bits cells for each unit of q, whose
 * values are those in the middle of the cells. */
static double look_up(double q, int bits)
{
    return exp2(SAGA_PEAK_LOG2 -
                (bits == EXACT ? q : down(q, bits) + ldexp(0.5, -bits)));
}

static void blend_splat(session *s, const ref_splat *exact_splat,
                        const format *f)
{
    const int width = s->camera.width;
    const double floor_t = SAGA_T_FLOOR_Q16 / 65536.0;
    ref_splat p = *exact_splat;
    int box[4];

    /* The splat's numbers are rounded first, then those of each pixel. */
    for (int i = 0; i < 2; i++)
        p.mean[i] = nearest(p.mean[i], f->mean);
    for (int i = 0; i < 3; i++) {
        p.chol[i] = nearest(p.chol[i], f->factor);
        p.colour[i] = nearest(p.colour[i], f->colour);
    }
    p.q0 = nearest(p.q0, f->q);
    ref_box(box, &p, &s->camera);
    for (int y = box[1]; y < box[3]; y++)
        for (int x = box[0]; x < box[2]; x++) {
            const int at = y * width + x;
            const double q = nearest(ref_q_at(&p, x, y), f->q);
            double w;

            if (q >= f->cut || s->trans[at] < floor_t)
                continue;
            w = fmin(down(look_up(q, f->table), f->alpha),
                     SAGA_ALPHA_CAP_Q16 / 65536.0);
            w = nearest(w * s->trans[at], f->trans);
            for (int i = 0; i < 3; i++)
                s->rgb[3 * at + i] += w * p.colour[i];
            s->trans[at] -= w;
            s->n_pairs++;
        }
}

static void draw(session *s, const format *f)
{
    const int n = s->camera.width * s->camera.height;

    s->n_pairs = 0;
    for (int i = 0; i < n; i++)
        s->trans[i] = 1;
    for (int i = 0; i < 3 * n; i++)
        s->rgb[i] = 0;
    for (uint32_t k = 0; k < s->n; k++)
        if (s->visible[s->order[k]])
            blend_splat(s, s->splat + s->order[k], f);
    for (int i = 0; i < 3 * n; i++)
        s->rgb[i] += s->trans[i / 3] * s->camera.background_q15[i % 3] /
                     32768.0;
}

/* --- The scene ----------------------------------------------------------- */

static void decode(session *s)
{
    double centre[3];

    for (int i = 0; i < 3; i++)
        centre[i] = s->camera.centre[i];
    ref_scene_reset(&s->scene, s->prims, s->colours);
    ref_scene_fine(&s->scene);
    ref_scene_primitives(&s->scene);
    for (uint32_t i = 0; i < s->n; i++) {
        ref_animated a;

        ref_animate(&a, &s->scene.prim[i], s->t / 65536.0);
        s->visible[i] = (uint8_t)ref_project(&s->splat[i], &a, &s->camera);
        if (s->visible[i])
            ref_scene_shade(s->splat[i].colour, &s->scene, i, centre);
    }
}

static void tell(session *s, const char *what, const char *value, int is_chosen)
{
    const int n = 3 * s->camera.width * s->camera.height;
    double sum = 0, max = 0;

    for (int i = 0; i < n; i++) {
        const double d = 255 * (s->rgb[i] - s->base[i]);

        sum += d * d;
        max = fmax(max, fabs(d));
    }
    printf("%s\n    { \"format\": \"%s\", \"value\": \"%s\", \"chosen\": %s, "
           "\"rms\": %.6g, \"max\": %.6g, \"n_pairs\": %.0f }",
           s->n_printed++ ? "," : "", what, value, is_chosen ? "true" : "false",
           sqrt(sum / n), max, s->n_pairs);
}

/* --- Formats ------------------------------------------------------------- */

static void try_bits(session *s, const char *what, size_t offset,
                     const int *bits)
{
    for (; *bits; bits++) {
        format f = exact;
        int chosen;
        char value[16];

        memcpy(&chosen, (const char *)&norm + offset, sizeof chosen);
        memcpy((char *)&f + offset, bits, sizeof *bits);
        snprintf(value, sizeof value, "%d", *bits);
        draw(s, &f);
        tell(s, what, value, *bits == chosen);
    }
}

static void try_pictures(session *s)
{
    static const int mean[] = { 2, 3, 4, 5, 6, 7, 8, 9, 10, 0 };
    static const int factor[] = { 10, 12, 14, 16, 20, 24, 28, 0 };
    static const int q[] = { 8, 10, 12, 14, 16, 20, 0 };
    static const int table[] = { 4, 5, 6, 7, 8, 9, 10, 11, 12, 0 };
    static const int alpha[] = { 8, 10, 12, 14, 16, 18, 0 };
    static const int trans[] = { 10, 12, 14, 16, 18, 0 };
    static const int colour[] = { 6, 8, 10, 12, 15, 0 };

    /* One format is changed at a time, then all are the decoder's, then the cut
     * has earlier values. */
    try_bits(s, "sub-pixel bits", offsetof(format, mean), mean);
    try_bits(s, "bits of g, n, h", offsetof(format, factor), factor);
    try_bits(s, "bits of q", offsetof(format, q), q);
    try_bits(s, "log2 of the table of 2^-q", offsetof(format, table), table);
    try_bits(s, "bits of alpha", offsetof(format, alpha), alpha);
    try_bits(s, "bits of T", offsetof(format, trans), trans);
    try_bits(s, "bits of colour", offsetof(format, colour), colour);
    draw(s, &norm);
    tell(s, "all of a picture", "norm", 1);
    for (int cut = 5; cut <= 10; cut++) {
        format f = exact;
        char value[16];

        f.cut = cut + SAGA_PEAK_LOG2;
        snprintf(value, sizeof value, "1/%d", 1 << cut);
        draw(s, &f);
        tell(s, "smallest alpha", value, f.cut == SAGA_CUT_LOG2);
    }
}

static void try_activations(session *s)
{
    static const int bits[] = { -8, -6, -4, -3, -2, -1, 0, 1, 2, 3, 4, 6 };
    ref_rounding *const r = &s->rounding;

    /* First all inputs of a layer have the same step, then each has its own. */
    r->is_on = 1;
    for (r->by_unit = 0; r->by_unit < 2; r->by_unit++)
        for (size_t i = 0; i < sizeof bits / sizeof bits[0]; i++) {
            char value[16];

            r->bits = bits[i];
            snprintf(value, sizeof value, "%d", 16 + bits[i]);
            decode(s);
            draw(s, &exact);
            tell(s,
                 r->by_unit ? "bits of activations, by unit"
                            : "bits of activations",
                 value, bits[i] == 0 && !r->by_unit);
        }
    r->is_on = 0;
}

/* Rounds the weights of each row to the step with which the largest one takes
 * `bits` bits, including the sign. */
static void round_weights(ref_nets *n, int bits)
{
    for (int net = 0; net < SAGA_N_NETS; net++)
        for (int i = 0; i < n->shape[net].n_layers; i++)
            for (uint32_t row = 0; row < n->shape[net].dim[i + 1]; row++) {
                const uint32_t n_in = n->shape[net].dim[i];
                double *const w = n->weight[net][i] + row * n_in;
                double most = 0, step;

                for (uint32_t k = 0; k < n_in; k++)
                    most = fmax(most, fabs(w[k]));
                step = most / (ldexp(1, bits - 1) - 1);
                for (uint32_t k = 0; k < n_in && step > 0; k++)
                    w[k] = step * floor(w[k] / step + 0.5);
            }
}

static void try_weights(session *s)
{
    static const int bits[] = { 14, 12, 10, 8, 7, 6 };

    for (size_t i = 0; i < sizeof bits / sizeof bits[0]; i++) {
        saga_error error = { "" };
        char value[16];

        ref_nets_free(&s->scene.nets);
        if (!ref_nets_make(&s->scene.nets, s->scene.model, &s->file.shapes,
                           s->file.params, &s->file.nets, &error))
            refuse("networks", error.message);
        round_weights(&s->scene.nets, bits[i]);
        snprintf(value, sizeof value, "%d", bits[i]);
        decode(s);
        draw(s, &exact);
        tell(s, "bits of weights", value, 0);
    }
}

/* --- Together ------------------------------------------------------------ */

static void open_file(session *s, const char *name, const saga_bytes *b,
                      uint32_t camera, uint32_t frame)
{
    const saga_model *const m = &s->file.h.model;
    saga_error error = { "" };
    saga_segment seg;
    uint32_t number, stride;
    const char *why;

    if (saga_rig(&s->camera, &number, b->data, b->nbytes, camera) ||
        saga_find(&seg, b->data, b->nbytes, frame, 1))
        refuse(name, "no such camera or frame");
    why = ref_file_read_layer(&s->file, b->data, b->nbytes, &seg, 0);
    if (why)
        refuse(name, why);
    s->t = seg.t;
    stride = m->tools & SAGA_TOOL_VIEW ? m->width[SAGA_NET_COLOUR] : 3;
    s->prims = need(s->file.sc.n.prim, sizeof *s->prims);
    s->colours = need(s->file.sc.n.prim, stride * sizeof *s->colours);
    saga_reconstruct(&s->file.sc, s->prims, sizeof *s->prims, s->colours,
                     stride);
    if (!ref_scene_make(&s->scene, &s->file, s->prims, s->colours, &error))
        refuse(name, error.message);
    s->scene.nets.rounding = &s->rounding;
    s->n = s->file.sc.n.prim;
    s->splat = need(s->n, sizeof *s->splat);
    s->visible = need(s->n, 1);
    s->order = need(s->n, sizeof *s->order);
}

int main(int argc, char **argv)
{
    static session s;
    saga_error error = { "" };
    saga_bytes b;
    size_t n;

    if (argc < 2 || argc > 4) {
        fprintf(stderr, "usage: make_formats FILE.saga [CAMERA [FRAME]]\n");
        return 2;
    }
    if (!saga_read_file(&b, argv[1], &error))
        refuse(argv[1], error.message);
    open_file(&s, argv[1], &b, argc > 2 ? (uint32_t)atoi(argv[2]) : 0,
              argc > 3 ? (uint32_t)atoi(argv[3]) : 0);
    n = (size_t)s.camera.width * s.camera.height;
    s.rgb = need(n, 3 * sizeof *s.rgb);
    s.base = need(n, 3 * sizeof *s.base);
    s.trans = need(n, sizeof *s.trans);
    /* The exact picture is drawn first; all others are compared with it. */
    decode(&s);
    ref_sort(s.order, s.splat, s.n);
    draw(&s, &exact);
    memcpy(s.base, s.rgb, 3 * n * sizeof *s.base);
    printf("{ \"formats\": [");
    try_pictures(&s);
    try_activations(&s);
    try_weights(&s);
    puts("\n] }");
    return 0;
}
