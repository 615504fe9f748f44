/* SPDX-License-Identifier: MIT
 *
 * The first primitives are placed at points of the capture, at most half of
 * them, and at the places of pixels drawn at random (flat_sight.c).
 */
#include "flat_state.h"

#include "alloc.h"
#include "plane_sweep.h"
#include "threads.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum {
    PATCH = SAGA_PATCH,
    N_NEIGHBOURS = 3, /* the nearest ones determine the scale */
    N_TRIES = 64 /* draws of a pixel until it is of the subject; a subject that
                  * fills a tenth of the pictures is missed once in 800 times */
};

void saga_flat_add(saga_flat *f, const saga_flat_sight *s, double sigma)
{
    const saga_cube *const cube = &f->pictures->cube;
    const real scale = (real)log2(sigma / cube->unit);
    const uint32_t i = saga_flat_append(f);
    const saga_range this = { i, i + 1 };

    for (size_t a = 0; a < 3; a++) {
        const size_t at = 3 * (size_t)i + a;

        f->value.mean[at] = (real)((s->position[a] - cube->centre[a]) /
                                   cube->unit);
        f->value.log2_scale[at] = scale;
        f->value.colour[at] = s->rgb[a];
    }
    if (f->o.temporal) {
        f->value.t_centre[i] = s->t_centre;
        f->value.log2_width[i] = s->log2_width;
    }
    saga_flat_bound(f, SAGA_ATTR_MEAN, this);
    saga_flat_bound(f, SAGA_ATTR_LOG2_SCALE, this);
    saga_flat_bound(f, SAGA_ATTR_LOG2_WIDTH, this);
}

/* A random pixel. chance, 0..1, determines its depth if that cannot be
 * found. */
typedef struct draw {
    int view, frame;
    double uv[2], chance;
} draw;

static draw any_pixel(const saga_flat *f, uint64_t counter)
{
    const saga_rng r = saga_rng_stream(f->o.seed, FLAT_RNG_SEED);
    const saga_pictures *const p = f->pictures;
    const uint64_t c = counter * 5;
    const int view = p->train[saga_rng_below(r, c, (uint32_t)p->n_train)];
    const saga_source_view *const v = p->capture->views + view;
    const int frame = (int)saga_rng_below(r, c + 1,
                                          (uint32_t)p->capture->n_frames);

    /* A draw depends only on its number, so borrow_part, later, draws the same
     * pixel again. What comes and goes between moments is left to growth. */
    return (draw){
        .view = view,
        .frame = saga_pictures_moment_of(p, frame),
        .uv = { PATCH + saga_rng_double(r, c + 2) * (v->width - 2 * PATCH),
                PATCH + saga_rng_double(r, c + 3) * (v->height - 2 * PATCH) },
        .chance = saga_rng_double(r, c + 4)
    };
}

static bool is_of_subject(const draw *d, const saga_capture *c)
{
    const uint8_t *const mask = saga_capture_mask(c, d->view, d->frame);

    return !mask || mask[(size_t)d->uv[1] * (size_t)c->views[d->view].width +
                         (size_t)d->uv[0]];
}

/* Draws a pixel; of a subject, where there is nothing else to place, one that
 * shows it. */
static draw draw_pixel(const saga_flat *f, uint64_t counter)
{
    const saga_capture *const c = f->pictures->capture;
    draw d = any_pixel(f, counter);

    for (uint64_t i = 1; c->subject && i < N_TRIES && !is_of_subject(&d, c);
         i++)
        d = any_pixel(f, counter + (i << 32));
    return d;
}

/* All sights, and which of them have a trusted depth. */
typedef struct sights {
    saga_flat_sight *at;
    uint8_t *good;
    size_t n;
} sights;

/* A place on an axis, and its number. */
typedef struct along {
    double x;
    size_t i;
} along;

static int compare_along(const void *a, const void *b)
{
    const along *const p = a, *const q = b;

    if (p->x != q->x)
        return p->x < q->x ? -1 : 1;
    return (p->i > q->i) - (p->i < q->i);
}

/* A trusted sight in a picture, at the pixel (u.x, v). */
typedef struct trusted {
    along u;
    double v, depth;
} trusted;

/* The nearest sight so far; of several, that of the lowest number. */
typedef struct nearest {
    double square;
    const trusted *at;
} nearest;

/* Compares a sight with the nearest. Returns false if it and all beyond are too
 * far along u. */
static bool compare(nearest *to, const trusted *t, const draw *d)
{
    const double du = t->u.x - d->uv[0], dv = t->v - d->uv[1];
    const double square = du * du + dv * dv;

    if (du * du > to->square)
        return false;
    if (square < to->square ||
        (square == to->square && to->at && t->u.i < to->at->u.i))
        *to = (nearest){ square, t };
    return true;
}

/* Gives a sight without a trusted depth that of the nearest trusted sight in
 * the same picture. These are sorted by u, and searched in both directions from
 * the sight's own u. */
static void borrow_depth(saga_flat_sight *s, const saga_flat *f, const draw *d,
                         const trusted *list, size_t n)
{
    const saga_source_view *const w = f->pictures->capture->views + d->view;
    const double *const range = f->pictures->range + 2 * d->view;
    nearest best = { INFINITY, NULL };
    size_t begin = 0, end = n;

    while (begin < end) {
        const size_t middle = (begin + end) / 2;

        if (list[middle].u.x < d->uv[0])
            begin = middle + 1;
        else
            end = middle;
    }
    for (size_t i = begin; i < n && compare(&best, list + i, d); i++)
        ;
    for (size_t i = begin; i > 0 && compare(&best, list + i - 1, d); i--)
        ;
    /* Without a trusted sight in the picture, the depth is random, uniform in 1
     * / depth. */
    const double z = best.at ? best.at->depth
                             : 1 / (1 / range[1] +
                                    d->chance * (1 / range[0] - 1 / range[1]));

    s->depth = z;
    s->footprint = z / w->fx;
    saga_view_lift(w, d->uv, z, s->position);
}

static size_t look_at_points(saga_flat_sight *s, const saga_flat *f,
                             size_t room)
{
    const size_t n = f->pictures->capture->n_points;
    const size_t take = n < room ? n : room;
    size_t found = 0;

    /* Points are taken evenly from the list if there is no room for all. A
     * point that no view sees is skipped. */
    for (size_t i = 0; i < take; i++)
        found += saga_flat_look_at_point(
            f, f->pictures->capture->points + i * n / take, s + found);
    return found;
}

typedef struct {
    const sights *all;
    const saga_flat *f;
    size_t from;
    int view;      /* the picture in which depths are borrowed, */
    trusted *list; /* (all->n) and the n_list trusted sights in it */
    size_t n_list;
} job;

static saga_range pixels_of(const job *j, size_t part)
{
    const saga_range of = saga_part(j->all->n - j->from, SAGA_PLANE_PART, part);

    return (saga_range){ j->from + of.begin, j->from + of.end };
}

static void look_part(void *user, size_t part)
{
    const job *const j = user;
    const saga_range of = pixels_of(j, part);

    for (size_t i = of.begin; i < of.end; i++) {
        const draw d = draw_pixel(j->f, i);

        j->all->good[i] = saga_flat_look(j->f, d.view, d.frame, d.uv[0],
                                         d.uv[1], j->all->at + i);
    }
}

static void borrow_part(void *user, size_t part)
{
    const job *const j = user;
    const saga_range of = pixels_of(j, part);

    for (size_t i = of.begin; i < of.end; i++) {
        /* Most sights are trusted, and need no second draw. */
        if (j->all->good[i])
            continue;
        const draw d = draw_pixel(j->f, i);

        if (d.view == j->view)
            borrow_depth(j->all->at + i, j->f, &d, j->list, j->n_list);
    }
}

/* Lists the trusted sights that lie in the job's picture, or beside it. */
static void list_trusted(job *j)
{
    const saga_source_view *const w = j->f->pictures->capture->views + j->view;

    j->n_list = 0;
    for (size_t i = 0; i < j->all->n; i++) {
        trusted *const t = j->list + j->n_list;
        double uv[2];

        if (!j->all->good[i] ||
            !saga_view_project(w, j->all->at[i].position, uv, &t->depth))
            continue;
        t->u = (along){ uv[0], i };
        t->v = uv[1];
        j->n_list++;
    }
    qsort(j->list, j->n_list, sizeof *j->list, compare_along);
}

/* Sets the sights from `from` on by pixels drawn at random. `list` has room for
 * all sights. */
static void look_at_pixels(const sights *all, const saga_flat *f, size_t from,
                           trusted *list)
{
    const saga_pictures *const p = f->pictures;
    job j = { .all = all, .f = f, .from = from, .list = list };
    saga_tasks t = { .run = look_part,
                     .user = &j,
                     .n = saga_n_parts(all->n - from, SAGA_PLANE_PART),
                     .ns = (double)SAGA_PLANE_NS * (double)(all->n - from) };

    saga_parallel(&t);
    t.run = borrow_part;
    for (int k = 0; k < p->n_train; k++) {
        j.view = p->train[k];
        list_trusted(&j);
        saga_parallel(&t);
    }
}

static void note_neighbour(double *best, double d)
{
    int at = N_NEIGHBOURS - 1;

    if (!(d < best[at]))
        return;
    for (; at > 0 && best[at - 1] > d; at--)
        best[at] = best[at - 1];
    best[at] = d;
}

/* Returns the squared distance between the places at ranks a and b. */
static double between(const saga_flat_sight *s, const along *order, size_t a,
                      size_t b)
{
    const double *const p = s[order[a].i].position;
    const double *const q = s[order[b].i].position;

    return (p[0] - q[0]) * (p[0] - q[0]) + (p[1] - q[1]) * (p[1] - q[1]) +
           (p[2] - q[2]) * (p[2] - q[2]);
}

/* Returns the RMS distance to the nearest places. Searches along x in both
 * directions until the distance in x alone exceeds that of the farthest
 * neighbour found. */
static double spacing(const saga_flat_sight *s, const along *order, size_t k,
                      size_t n)
{
    double best[N_NEIGHBOURS] = { INFINITY, INFINITY, INFINITY }, sum = 0;
    int found = 0;
    size_t j;

    /* Points are sorted by x: a search ends where the distance in x alone
     * exceeds the third-best distance. */
    for (j = k + 1; j < n; j++) {
        const double dx = order[j].x - order[k].x;

        if (dx * dx > best[N_NEIGHBOURS - 1])
            break;
        note_neighbour(best, between(s, order, k, j));
    }
    for (j = k; j-- > 0;) {
        const double dx = order[k].x - order[j].x;

        if (dx * dx > best[N_NEIGHBOURS - 1])
            break;
        note_neighbour(best, between(s, order, k, j));
    }
    /* There may be fewer neighbours than N_NEIGHBOURS. */
    for (int i = 0; i < N_NEIGHBOURS; i++)
        if (best[i] < INFINITY) {
            sum += best[i];
            found++;
        }
    return found ? sqrt(sum / found) : INFINITY;
}

static void append_all(saga_flat *f, const saga_flat_sight *s, along *order,
                       size_t n)
{
    for (size_t i = 0; i < n; i++)
        order[i] = (along){ s[i].position[0], i };
    qsort(order, n, sizeof *order, compare_along);
    for (size_t k = 0; k < n; k++) {
        const saga_flat_sight *const at = s + order[k].i;
        double d = spacing(s, order, k, n);

        /* The size is at least one pixel, to be visible, and at most 40. */
        d = d < 40 * at->footprint ? d : 40 * at->footprint;
        d = d > at->footprint ? d : at->footprint;
        saga_flat_add(f, at, 0.5 * d);
    }
}

bool saga_flat_init(saga_flat *f, saga_error *error)
{
    static const char what[] = "the first primitives";
    const size_t asked = (size_t)(f->o.start * (real)f->o.n_primitives);
    const size_t n = asked < 1 ? 1 : asked;
    const sights all = { saga_alloc(n, sizeof *all.at, what, error),
                         saga_alloc(n, 1, what, error), n };
    along *const order = saga_alloc(n, sizeof *order, what, error);
    trusted *const list = saga_alloc(n, sizeof *list, what, error);
    const bool ok = all.at && all.good && order && list &&
                    saga_flat_reserve(f, (uint32_t)n, error);

    if (ok) {
        /* Points are trusted, and take at most half of the places. */
        memset(all.good, 1, n);
        look_at_pixels(&all, f, look_at_points(all.at, f, (n + 1) / 2), list);
        append_all(f, all.at, order, n);
    }
    free(all.at);
    free(all.good);
    free(order);
    free(list);
    return ok;
}
