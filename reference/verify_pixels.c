/* SPDX-License-Identifier: MIT */
#include "verify_session.h"

#include "alloc.h"

#include <stdlib.h>
#include <string.h>

/* --- Pixels -------------------------------------------------------------- */

static int by_depth(const void *a, const void *b)
{
    const drawn *const x = a, *const y = b;

    if (x->depth != y->depth)
        return x->depth < y->depth ? -1 : 1;
    return x->prim < y->prim ? -1 : x->prim > y->prim;
}

/* Sorts the splats in the decoder's order. A splat that exists in double only
 * is sorted by its own depth. */
static void sort(session *s)
{
    canvas *const c = &s->c;

    c->n_order = 0;
    for (uint32_t i = 0; i < n_prims(s); i++)
        if (s->e.visible[i] || s->r.visible[i]) {
            c->order[c->n_order].prim = i;
            c->order[c->n_order++].depth = s->e.visible[i]
                                               ? s->e.splat[i].depth
                                               : floor(s->r.splat[i].depth +
                                                       0.5);
        }
    qsort(c->order, c->n_order, sizeof *c->order, by_depth);
}

static void clear(session *s)
{
    const size_t n = s->v->n_pixels;
    canvas *const c = &s->c;

    memset(c->sum, 0, n * sizeof *c->sum);
    memset(c->otherwise, 0, n);
    c->tools = s->e.format.tools;
    for (size_t i = 0; i < n; i++) {
        c->t[i] = 65536;
        c->trans[i] = 1;
        for (int k = 0; k < 3; k++)
            c->rgb[i][k] = 0;
    }
}

/* A splat in integers and in double; NULL if it is not visible there. */
typedef struct {
    const saga_splat *exact;
    const ref_splat *real;
    column q, alpha;
    int drew[2]; /* whether each picture has blended it anywhere */
} pair;

static void blend_pair(canvas *c, pair *p, size_t at, int x, int y)
{
    const int32_t q_q20 = p->exact ? ref_q_q20(p->exact, x, y, c->tools)
                                   : INT32_MAX;
    const double q = p->real ? ref_q_at(p->real, x, y) : INFINITY;
    const int one = ref_blends_exact(c->t[at], q_q20);
    const int other = ref_blends(c->trans[at], q);

    /* If only one picture blends the splat and q is on the same side of the cut
     * in both, the reason is the stop. */
    if (one != other)
        c->otherwise[at] |= (q_q20 < SAGA_CUT_LOG2 << 20) != (q < SAGA_CUT_LOG2)
                                ? CUT
                                : STOP;
    if (one && other && p->q.to) {
        note(p->q, q_q20 / 1048576.0, q);
        note(p->alpha, ref_alpha_q16(q_q20) / 65536.0, ref_alpha(q));
    }
    p->drew[0] |= one;
    p->drew[1] |= other;
    if (one)
        ref_blend_pixel_exact(c->sum[at], &c->t[at], p->exact, q_q20);
    if (other)
        ref_blend_pixel(c->rgb[at], &c->trans[at], p->real, q);
}

static void blend_boxes(session *s, pair *p)
{
    int box[4] = { INT32_MAX, INT32_MAX, 0, 0 }, x, y;

    if (p->real)
        ref_box(box, p->real, s->camera);
    if (p->exact) {
        box[0] = p->exact->x0 < box[0] ? p->exact->x0 : box[0];
        box[1] = p->exact->y0 < box[1] ? p->exact->y0 : box[1];
        box[2] = p->exact->x1 > box[2] ? p->exact->x1 : box[2];
        box[3] = p->exact->y1 > box[3] ? p->exact->y1 : box[3];
    }
    for (y = box[1]; y < box[3]; y++)
        for (x = box[0]; x < box[2]; x++)
            blend_pair(&s->c, p, (size_t)y * s->camera->width + (size_t)x, x,
                       y);
}

void verify_blend(session *s, int from)
{
    enum { ST = SAGA_VERIFY_PIXELS };
    const int is_chain = from == SAGA_VERIFY_SYMBOLS;
    pair p = { NULL, NULL, { NULL, NULL }, { NULL, NULL }, { 0, 0 } };

    if (is_chain || from == ST) {
        p.q = verify_row(s, ST, "-log2 of alpha", "1", ldexp(1, -20),
                         !is_chain);
        p.alpha = verify_row(s, ST, "alpha", "1", ldexp(1, -16), !is_chain);
    }
    /* The splats are blended one by one, front to back, into both pictures. */
    sort(s);
    clear(s);
    for (uint32_t k = 0; k < s->c.n_order; k++) {
        const uint32_t i = s->c.order[k].prim;

        p.exact = s->e.visible[i] ? &s->e.splat[i] : NULL;
        p.real = s->r.visible[i] ? &s->r.splat[i] : NULL;
        p.drew[0] = p.drew[1] = 0;
        blend_boxes(s, &p);
        s->v->n_splats_otherwise += is_chain && p.drew[0] != p.drew[1];
    }
}

/* The sum of squared differences and the largest difference of n samples. */
typedef struct {
    double sum, max;
    uint64_t n;
} gap;

static void widen(gap *g, double difference)
{
    g->sum += difference * difference;
    g->max = fmax(g->max, fabs(difference));
    g->n++;
}

static double psnr_of(const gap *g)
{
    return g->sum > 0 ? 10 * log10(255.0 * 255.0 * (double)g->n / g->sum)
                      : INFINITY;
}

void verify_pixels(session *s, int from)
{
    const saga_camera *const cam = s->camera;
    saga_verify_picture *const to = &s->v->picture[from];
    gap rounded = { 0, 0, 0 }, same = rounded, whole = rounded;
    gap before = rounded;
    column level = { NULL, NULL };

    if (from == SAGA_VERIFY_SYMBOLS || from == SAGA_VERIFY_PIXELS)
        level = verify_row(s, SAGA_VERIFY_PIXELS, "picture before 8 bits",
                           "level", 0, from == SAGA_VERIFY_PIXELS);
    for (size_t i = 0; i < s->v->n_pixels; i++) {
        /* These count the pixels in which the pictures decide differently. */
        to->n_cut += (s->c.otherwise[i] & CUT) != 0;
        to->n_stop += (s->c.otherwise[i] & STOP) != 0;
        for (int k = 0; k < 3; k++) {
            /* norm and value are sum + T background, in integers (Q31) and in
             * double; then follow the decoder's 8-bit sample and the double
             * rounded to 8 bits. */
            const double norm = ((double)s->c.sum[i][k] +
                                 (double)s->c.t[i] * cam->background_q15[k]) /
                                2147483648.0;
            const double value = 255 * (s->c.rgb[i][k] +
                                        s->c.trans[i] * cam->background_q15[k] /
                                            32768.0);
            const int drawn_as = s->e.rgb[3 * i + (size_t)k];
            const double near = ref_clamp(floor(value + 0.5), 0, 255);

            widen(&before, 255 * norm - value);
            widen(&whole, drawn_as - value);
            widen(&rounded, drawn_as - near);
            to->n_far += fabs(drawn_as - near) > 1;
            /* Where the decisions agree, only roundings make a difference. */
            if (!s->c.otherwise[i])
                widen(&same, drawn_as - near);
            if (level.to)
                note(level, 255 * norm, value);
        }
    }
    to->psnr = psnr_of(&rounded);
    to->max = (int)rounded.max;
    to->psnr_real = psnr_of(&whole);
    to->max_real = whole.max;
    to->rms = sqrt(before.sum / (double)before.n);
    to->psnr_same = psnr_of(&same);
    to->max_same = (int)same.max;
}

bool verify_norm(session *s)
{
    const saga_camera *const c = s->camera;
    const size_t stride = 3 * (size_t)c->width;
    uint8_t *const rgb = saga_alloc(s->v->n_pixels, 3, "the picture", s->error);
    const saga_picture pic = { rgb, stride, stride * c->height, 8 };
    bool ok = rgb != NULL;

    for (size_t i = 0; i < s->v->n_pixels && ok; i++) {
        const int x = (int)(i % c->width), y = (int)(i / c->width);

        ref_store_exact(&pic, c, x, y, s->c.sum[i], s->c.t[i]);
        if (memcmp(rgb + 3 * i, s->e.rgb + 3 * i, 3) != 0)
            ok = saga_fail(s->error, s->name,
                           "report this: the decoder is "
                           "wrong",
                           "pixel (%d, %d) is not the norm's", x, y);
    }
    free(rgb);
    return ok;
}
