/* SPDX-License-Identifier: MIT
 *
 * Builds the layers of a segment. The warm-up's primitives are sorted by the
 * light that they add to the training pictures and divided among the layers;
 * each layer becomes a hierarchy of its own. The scene concatenates them. A
 * base has one layer.
 */
#include "layers.h"

#include "alloc.h"

#include <stdlib.h>
#include <string.h>

static const char what[] = "the layers";

/* --- Light --------------------------------------------------------------- */

/* Adds to light[i] what primitive i adds to a picture: its blending weight,
 * summed over the pixels. */
static bool add_light(real *light, saga_splat_params *d, saga_canvas *c,
                      const saga_layers_terms *t, saga_sample picture,
                      saga_error *error)
{
    const saga_source_view *const v =
        &t->pictures->capture->views[picture.view];
    const size_t n = 3 * (size_t)v->width * (size_t)v->height;
    saga_splat_stats stats = { NULL, light, NULL };

    saga_pictures_aim(c, t->pictures, picture);
    /* Blending weights do not depend on the loss. The gradients do, but are not
     * used. */
    memset(c->d_image, 0, n * sizeof *c->d_image);
    return saga_splat_forward(c, &t->flat, t->n, error) &&
           saga_splat_backward(d, &stats, c, &t->flat, error);
}

/* Sets light[i] to what primitive i of the warm-up (the stage that fits free
 * Gaussians) adds to the training pictures (add_light), summed over a sample of
 * them. */
static bool measure_light(real *light, const saga_layers_terms *t,
                          saga_error *error)
{
    const saga_capture *const capture = t->pictures->capture;
    saga_splat_params d; /* gradients, which nobody reads */
    saga_canvas c;
    bool ok = saga_params_gather(&d, &t->flat, NULL, t->n, error);

    if (!saga_pictures_canvas(&c, t->pictures, error))
        ok = false;
    for (int v = 0; ok && v < capture->n_views; v++) {
        int frame, i;

        /* The loop ends when the view has no further sample, and skips held-out
         * views. */
        for (i = 0; ok && !capture->views[v].held_out &&
                    (frame = saga_capture_sample(capture, v, i)) >= 0;
             i++)
            ok = add_light(light, &d, &c, t,
                           (saga_sample){ .view = v, .frame = frame }, error);
    }
    saga_canvas_free(&c);
    saga_params_free(&d);
    return ok;
}

/* --- Order --------------------------------------------------------------- */

typedef struct {
    real light;
    uint32_t index;
} lit;

/* Orders by light, the brightest first. */
static int compare(const void *a, const void *b)
{
    const lit *const x = a, *const y = b;

    if (x->light < y->light || x->light > y->light)
        return x->light > y->light ? -1 : 1;
    /* qsort leaves the order of equal elements open, so the index decides. */
    return x->index < y->index ? -1 : x->index > y->index;
}

/* Sets index (n) to the primitives' indices in the pool, in order of light. */
static bool sort_by_light(uint32_t *index, uint32_t n,
                          const saga_layers_terms *t, saga_error *error)
{
    real *const light = saga_calloc(n, sizeof *light, what, error);
    lit *const list = saga_alloc(n, sizeof *list, what, error);
    const bool ok = light && list && measure_light(light, t, error);

    for (uint32_t i = 0; i < n && ok; i++)
        list[i] = (lit){ light[i], i };
    if (ok)
        qsort(list, n, sizeof *list, compare);
    for (uint32_t i = 0; i < n && ok; i++)
        index[i] = list[i].index;
    free(list);
    free(light);
    return ok;
}

/* Returns how many of n primitives the first k of n_layers layers have: each
 * layer has twice as many as the previous one, and at least one. */
static uint32_t n_first(uint32_t n, uint32_t k, uint32_t n_layers)
{
    /* 1 + 2 + ... + 2^(k-1) = 2^k - 1 of 2^n_layers - 1 parts. */
    const uint32_t end = (uint32_t)((uint64_t)n * ((1u << k) - 1) /
                                    ((1u << n_layers) - 1));

    return end > k ? end : k;
}

/* --- Hierarchies --------------------------------------------------------- */

/* A layer, and the index in the pool of each of its primitives. */
typedef struct {
    saga_scene scene;
    uint32_t *source; /* (n.prim) */
} built;

/* Returns a layer's share of a budget, rounded up. */
static uint32_t part_of(uint32_t budget, uint32_t n, uint32_t all)
{
    return (uint32_t)(((uint64_t)budget * n + all - 1) / all);
}

/* Builds a layer of the pool's primitives index[0..n). */
static bool build_one(built *b, const uint32_t *index, uint32_t n,
                      const saga_hierarchy_pool *pool,
                      const saga_hierarchy_options *options, saga_error *error)
{
    saga_hierarchy_options o = *options;
    float *const score = saga_alloc(n, sizeof *score, what, error);
    saga_splat_params own;
    const saga_hierarchy_pool some = { &own, score, n };
    bool ok;

    /* Budgets are proportional to primitives, and rounded up so that every
     * layer has an anchor. */
    o.max_coarse = part_of(o.max_coarse, n, pool->n);
    o.max_fine = part_of(o.max_fine, n, pool->n);
    b->source = saga_alloc(n, sizeof *b->source, what, error);
    ok = saga_params_gather(&own, pool->p, index, n, error) && score &&
         b->source;
    for (uint32_t i = 0; i < n && ok; i++)
        score[i] = pool->score[index[i]];
    ok = ok && saga_hierarchy_build(&b->scene, b->source, &some, &o, error);
    /* Indices into the layer's own pool become indices into the whole pool. */
    for (uint32_t i = 0; ok && i < b->scene.n.prim; i++)
        b->source[i] = index[b->source[i]];
    saga_params_free(&own);
    free(score);
    return ok;
}

/* --- One scene ----------------------------------------------------------- */

static void add(saga_scene_layer *sum, const saga_scene *s)
{
    sum->n.coarse += s->n.coarse;
    sum->n.fine += s->n.fine;
    sum->n.prim += s->n.prim;
    sum->n_nodes += s->n_nodes;
}

/* Appends the structure of a layer to the scene, with its ranks shifted. */
static void copy_structure(saga_scene *s, const saga_scene_layer *l,
                           const saga_scene *from)
{
    const saga_counts first = l->first;

    memcpy(s->split + l->first_node, from->split, l->n_nodes);
    memcpy(s->occupancy + l->first_node, from->occupancy,
           l->n_nodes * sizeof *s->occupancy);
    /* Splits and occupancy hold no ranks; children and parents do. */
    for (uint32_t i = 0; i < l->n.coarse; i++) {
        s->coarse[first.coarse + i] = from->coarse[i];
        s->coarse[first.coarse + i].first_fine += first.fine;
    }
    for (uint32_t i = 0; i < l->n.fine; i++) {
        s->fine[first.fine + i] = from->fine[i];
        s->fine[first.fine + i].parent += first.coarse;
        s->fine[first.fine + i].first_prim += first.prim;
    }
    for (uint32_t i = 0; i < l->n.prim; i++)
        s->prim_fine[first.prim + i] = from->prim_fine[i] + first.fine;
}

static void copy_reals(real *to, const real *from, uint32_t first, uint32_t n,
                       size_t width)
{
    memcpy(to + width * first, from, width * n * sizeof *to);
}

static void copy_layer(saga_scene *s, const saga_scene_layer *l,
                       const saga_scene *from)
{
    const size_t f = s->model.features;

    copy_structure(s, l, from);
    copy_reals(s->coarse_x, from->coarse_x, l->first.coarse, l->n.coarse, 4);
    copy_reals(s->coarse_feature, from->coarse_feature, l->first.coarse,
               l->n.coarse, f);
    copy_reals(s->fine_x, from->fine_x, l->first.fine, l->n.fine, 4);
    copy_reals(s->prim_x, from->prim_x, l->first.prim, l->n.prim, 4);
}

/* Concatenates the layers into one scene. */
static bool merge(saga_scene *s, uint32_t *source, const built *b,
                  uint32_t n_layers, const saga_hierarchy_options *o,
                  saga_error *error)
{
    saga_scene_layer all = { .n_nodes = 0 }, at = { .n_nodes = 0 };

    /* Memory for all layers is allocated first. Networks are made from the
     * seed; those of the layers' own scenes are ignored. */
    for (uint32_t k = 0; k < n_layers; k++)
        add(&all, &b[k].scene);
    if (!saga_scene_init(s, o->model, all.n, all.n_nodes, o->seed, error))
        return false;
    s->n_layers = n_layers;
    for (uint32_t k = 0; k < n_layers; k++) {
        const saga_scene *const one = &b[k].scene;

        s->layer[k] = (saga_scene_layer){ at.n, one->n, at.n_nodes,
                                          one->n_nodes };
        copy_layer(s, &s->layer[k], one);
        memcpy(source + at.n.prim, b[k].source, one->n.prim * sizeof *source);
        add(&at, one);
    }
    return true;
}

/* What is needed to build the layers. */
typedef struct {
    const saga_layers_terms *terms;
    const saga_hierarchy_pool *pool;
    const saga_hierarchy_options *options;
} job;

static bool build_all(saga_scene *s, uint32_t *source, uint32_t *index,
                      const job *j, saga_error *error)
{
    const uint32_t n_layers = j->terms->n_layers, n = j->pool->n;
    built b[SAGA_MAX_LAYERS] = { { .source = NULL } };
    bool ok = sort_by_light(index, n, j->terms, error);
    uint32_t k;

    for (k = 0; k < n_layers && ok; k++) {
        const uint32_t first = n_first(n, k, n_layers);

        /* Layer k has the next brightest primitives. */
        ok = build_one(&b[k], index + first,
                       n_first(n, k + 1, n_layers) - first, j->pool, j->options,
                       error);
    }
    ok = ok && merge(s, source, b, n_layers, j->options, error);
    for (k = 0; k < n_layers; k++) {
        saga_scene_free(&b[k].scene);
        free(b[k].source);
    }
    return ok;
}

bool saga_layers_build(saga_scene *s, uint32_t *source,
                       const saga_layers_terms *terms,
                       const saga_hierarchy_pool *pool,
                       const saga_hierarchy_options *o, saga_error *error)
{
    const job j = { terms, pool, o };
    uint32_t *index;
    bool ok;

    if (terms->n_layers == 1)
        return saga_hierarchy_build(s, source, pool, o, error);
    index = saga_alloc(pool->n, sizeof *index, what, error);
    ok = index && build_all(s, source, index, &j, error);
    free(index);
    return ok;
}
