/* SPDX-License-Identifier: MIT
 *
 * See verify.h. A run begins at a stage: earlier stages are computed by the
 * integer decoder, this one and later ones in double. It gives the result
 * `alone` of its first stage; the run that begins with the symbols gives the
 * results `chain` of all stages.
 */
#include "verify_session.h"

#include "alloc.h"
#include "animate.h"
#include "project.h"
#include "reconstruct.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

const char *const saga_verify_stage[SAGA_VERIFY_N_STAGES] = {
    "symbols", "scaffold", "primitives", "animation", "splats", "pixels"
};

/* --- The integers -------------------------------------------------------- */

static void shade(session *s, uint32_t i)
{
    saga_seen seen = { .n = 1 };
    exact *const e = &s->e;

    seen.base[0] = e->colour + (size_t)i * e->stride;
    saga_animate_mean(seen.x[0], &e->prim[i], &e->format, 32768);
    if (e->model->tools & SAGA_TOOL_VIEW)
        saga_shade(&e->splat[i], &part_of(s, i)->file.sc, &seen,
                   s->camera->centre);
    else
        for (int k = 0; k < 3; k++)
            e->splat[i].colour_q15[k] = (uint16_t)seen.base[0][k];
}

static bool read_part(session *s, const uint8_t *bytes, size_t n,
                      const saga_segment *seg, uint32_t layer)
{
    part *const p = &s->part[s->n_parts++];
    const char *const why = ref_file_read_layer(&p->file, bytes, n, seg, layer);

    if (why)
        return saga_fail(s->error, s->name, "copy the file again", "%s", why);
    p->first = s->e.n;
    s->e.n += p->file.sc.n.prim;
    s->e.model = &p->file.h.model;
    return true;
}

static void reconstruct(session *s, const part *p)
{
    saga_primitive *const prim = s->e.prim + p->first;

    saga_reconstruct(&p->file.sc, prim, sizeof *prim,
                     s->e.colour + (size_t)p->first * s->e.stride, s->e.stride);
    if (p->file.is_base)
        saga_stand_still(prim, sizeof *prim, p->file.sc.n.prim);
}

static bool take_apart(session *s, const uint8_t *bytes, size_t n,
                       const saga_info *info, const saga_segment *seg)
{
    exact *const e = &s->e;

    /* Parts are read in the order in which the decoder numbers primitives. */
    if (info->base_coarse > 0 && !read_part(s, bytes, n, NULL, 0))
        return false;
    for (uint32_t i = 0; i < info->n_layers; i++)
        if (!read_part(s, bytes, n, seg, i))
            return false;
    /* All parts share the arrays of the integers. */
    e->stride = ref_file_colours(&s->part[0].file);
    e->prim = saga_alloc(n_prims(s), sizeof *e->prim, s->name, s->error);
    e->colour = saga_alloc(n_prims(s), e->stride * sizeof *e->colour, s->name,
                           s->error);
    e->moved = saga_alloc(n_prims(s), sizeof *e->moved, s->name, s->error);
    e->splat = saga_alloc(n_prims(s), sizeof *e->splat, s->name, s->error);
    e->visible = saga_calloc(n_prims(s), 1, s->name, s->error);
    if (saga_failed(s->error))
        return false;
    saga_prim_format_of(&e->format, e->model);
    for (int i = 0; i < s->n_parts; i++)
        reconstruct(s, &s->part[i]);
    return true;
}

static void project_all(session *s)
{
    exact *const e = &s->e;

    for (uint32_t i = 0; i < n_prims(s); i++) {
        saga_animate(&e->moved[i], &e->prim[i], &e->format, s->v->t);
        e->visible[i] = (uint8_t)saga_project(&e->splat[i], &e->moved[i],
                                              s->camera, e->format.tools);
        if (e->visible[i])
            shade(s, i);
        s->v->n_splats += e->visible[i];
    }
}

/* Draws the picture with the decoder's own tiles and fast paths. */
static saga_status draw(session *s, saga_decoder *dec)
{
    enum { TILE = 16, LIST = 65536 };
    const saga_camera *const c = s->camera;
    const size_t stride = 3 * (size_t)c->width;
    const saga_picture picture = { s->e.rgb, stride, stride * c->height, 8 };
    saga_job job = { .x1 = c->width,
                     .y1 = c->height,
                     .tile = TILE,
                     .list_capacity = LIST,
                     .scratch_nbytes = SAGA_JOB_NBYTES(TILE, LIST) };
    saga_status status = SAGA_AGAIN;

    job.scratch = saga_alloc(1, job.scratch_nbytes, "the picture", s->error);
    while (job.scratch && status == SAGA_AGAIN)
        status = saga_draw(dec, &job, &picture, 1u << 30);
    free(job.scratch);
    return status;
}

static bool refuse(session *s, saga_status status)
{
    return saga_fail(s->error, s->name, "copy or encode the file again",
                     "it is refused (%s)", saga_status_text(status));
}

static bool decode_and_draw(session *s, const uint8_t *bytes, size_t n,
                            const saga_info *info, const saga_segment *seg)
{
    void *const work = saga_aligned_alloc(SAGA_WORK_ALIGN, info->work_nbytes,
                                          s->name, s->error);
    saga_decoder *dec;
    saga_status status = SAGA_ERR_SPACE;

    s->e.rgb = saga_alloc((size_t)s->camera->width * s->camera->height, 3,
                          "the picture", s->error);
    /* The calls of a player, as README.md lists them. */
    if (work && s->e.rgb)
        status = saga_open(&dec, work, info->work_nbytes, bytes, n, NULL);
    if (status == SAGA_OK)
        status = saga_decode(dec, seg, bytes + seg->offset, seg->nbytes, NULL);
    if (status == SAGA_OK)
        status = saga_view(dec, s->camera, seg->t);
    if (status == SAGA_OK)
        status = draw(s, dec);
    free(work);
    return status == SAGA_OK || refuse(s, status);
}

/* --- In double, from a stage on ------------------------------------------ */

static bool make_scene(session *s, part *p, int from)
{
    ref_scene *const scene = &p->scene;

    ref_scene_reset(scene, s->e.prim + p->first,
                    s->e.colour + (size_t)p->first * s->e.stride);
    if (from == SAGA_VERIFY_SYMBOLS && !ref_scene_decode(scene, s->error))
        return false;
    if (from == SAGA_VERIFY_SCAFFOLD)
        ref_scene_fine(scene);
    if (from <= SAGA_VERIFY_PRIMITIVES)
        ref_scene_primitives(scene);
    return true;
}

static void make_splats(session *s, int from)
{
    real *const r = &s->r;
    double centre[3];

    for (int k = 0; k < 3; k++)
        centre[k] = s->camera->centre[k];
    for (uint32_t i = 0; i < n_prims(s); i++) {
        if (from <= SAGA_VERIFY_ANIMATION)
            ref_animate(&r->moved[i], prim_of(s, i), s->v->t / 65536.0);
        else
            ref_animated_of(&r->moved[i], &s->e.moved[i]);
        /* A run that begins with the pixels takes the integers' splats. */
        if (from > SAGA_VERIFY_SPLATS) {
            r->visible[i] = s->e.visible[i];
            if (r->visible[i])
                ref_splat_of(&r->splat[i], &s->e.splat[i]);
            r->splat[i].tools = s->e.format.tools;
            continue;
        }
        r->visible[i] = (uint8_t)ref_project(&r->splat[i], &r->moved[i],
                                             s->camera);
        r->splat[i].tools = s->e.format.tools;
        if (r->visible[i])
            ref_scene_shade(r->splat[i].colour, &part_of(s, i)->scene,
                            i - part_of(s, i)->first, centre);
    }
}

/* --- Together ------------------------------------------------------------ */

static void tell(const session *s, int from, const char *doing)
{
    if (s->progress)
        s->progress(s->user, (double)from / SAGA_VERIFY_N_STAGES, doing);
}

static bool verify_segments(session *s, int from)
{
    const int is_chain = from == SAGA_VERIFY_SYMBOLS;

    tell(s, from, saga_verify_stage[from]);
    /* The result `alone` of the symbols has predictions from the integers'
     * values. It is taken before make_scene decodes each block in double. */
    for (int i = 0; i < s->n_parts && is_chain; i++)
        if (!ref_scene_contexts(&s->part[i].scene, s->error))
            return false;
    if (is_chain)
        verify_stage(s, from, 1);
    for (int i = 0; i < s->n_parts; i++)
        if (!make_scene(s, &s->part[i], from))
            return false;
    make_splats(s, from);
    if (!is_chain)
        verify_stage(s, from, 1);
    for (int stage = 0; stage < SAGA_VERIFY_N_STAGES && is_chain; stage++)
        verify_stage(s, stage, 0);
    verify_blend(s, from);
    verify_pixels(s, from);
    return !is_chain || verify_norm(s);
}

static bool run_all(session *s)
{
    for (int from = 0; from < SAGA_VERIFY_N_STAGES; from++)
        if (!verify_segments(s, from))
            return false;
    for (int i = 0; i < s->v->n_rows; i++) {
        verify_finish(&s->v->row[i].alone, &s->alone[i]);
        verify_finish(&s->v->row[i].chain, &s->chain[i]);
    }
    return true;
}

static bool reserve(session *s)
{
    const size_t n = s->v->n_pixels;
    const uint32_t m = n_prims(s);
    canvas *const c = &s->c;

    s->r.moved = saga_alloc(m, sizeof *s->r.moved, s->name, s->error);
    s->r.splat = saga_alloc(m, sizeof *s->r.splat, s->name, s->error);
    s->r.visible = saga_calloc(m, 1, s->name, s->error);
    c->order = saga_alloc(m, sizeof *c->order, s->name, s->error);
    c->t = saga_alloc(n, sizeof *c->t, "the picture", s->error);
    c->sum = saga_alloc(n, sizeof *c->sum, "the picture", s->error);
    c->trans = saga_alloc(n, sizeof *c->trans, "the picture", s->error);
    c->rgb = saga_alloc(n, sizeof *c->rgb, "the picture", s->error);
    c->otherwise = saga_alloc(n, 1, "the picture", s->error);
    for (int i = 0; i < s->n_parts && !saga_failed(s->error); i++) {
        part *const p = &s->part[i];

        ref_scene_make(&p->scene, &p->file, s->e.prim + p->first,
                       s->e.colour + (size_t)p->first * s->e.stride, s->error);
    }
    return !saga_failed(s->error);
}

static void give_back(session *s)
{
    free(s->r.moved);
    free(s->r.splat);
    free(s->r.visible);
    free(s->c.order);
    free(s->c.t);
    free(s->c.sum);
    free(s->c.trans);
    free(s->c.rgb);
    free(s->c.otherwise);
    for (int i = 0; i < s->n_parts; i++) {
        ref_scene_free(&s->part[i].scene);
        ref_file_free(&s->part[i].file);
    }
    free(s->e.prim);
    free(s->e.colour);
    free(s->e.moved);
    free(s->e.splat);
    free(s->e.visible);
    free(s->e.rgb);
}

static void describe(session *s, const saga_segment *seg)
{
    s->v->segment = seg->number;
    s->v->t = seg->t;
    for (int i = 0; i < s->n_parts; i++) {
        const saga_counts n = s->part[i].file.sc.n;

        s->v->n_coarse += n.coarse;
        s->v->n_fine += n.fine;
        s->v->n_primitives += n.prim;
    }
    s->v->n_pixels = (uint64_t)s->camera->width * s->camera->height;
}

bool saga_verify_file(saga_verify *v, const char *name, const uint8_t *bytes,
                      size_t nbytes, const saga_verify_view *view,
                      saga_error *error)
{
    session s = { .v = v,
                  .name = name,
                  .camera = &view->camera,
                  .progress = view->progress,
                  .user = view->user,
                  .error = error };
    saga_info info;
    saga_segment seg;
    saga_status status = saga_probe(&info, bytes, nbytes);
    bool ok;

    memset(v, 0, sizeof *v);
    if (status == SAGA_OK)
        status = saga_find(&seg, bytes, nbytes, view->frame_num,
                           view->frame_den);
    if (status == SAGA_OK &&
        (seg.offset > nbytes || seg.nbytes > nbytes - seg.offset))
        status = SAGA_ERR_TRUNCATED;
    if (status)
        return refuse(&s, status);
    /* The decoder draws; then the same bytes are computed in double. */
    ok = decode_and_draw(&s, bytes, nbytes, &info, &seg) &&
         take_apart(&s, bytes, nbytes, &info, &seg);
    if (ok) {
        describe(&s, &seg);
        project_all(&s);
        ok = reserve(&s) && run_all(&s);
    }
    give_back(&s);
    return ok;
}
