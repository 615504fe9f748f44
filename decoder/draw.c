/* SPDX-License-Identifier: MIT
 *
 * The public functions of a view: they find the splats that a camera sees at a
 * time, sort them, and draw them in jobs.
 */
#include "animate.h"
#include "crc32c.h"
#include "project.h"
#include "raster.h"
#include "reconstruct.h"
#include "splats.h"
#include "work_block.h"

static const saga_splat *splats_of(const saga_decoder *dec)
{
    return (const saga_splat *)(const void *)const_at(dec, dec->plan.splats_at);
}

static const saga_key *keys_of(const saga_decoder *dec)
{
    return (const saga_key *)(const void *)const_at(dec, dec->plan.keys_at);
}

/* Computes the colours of the last seen->n of n splats, seen from `from`. */
static void shade(saga_splat *splats, uint32_t n, const int32_t *from,
                  const saga_scaffold *sc, saga_seen *seen)
{
    if (seen->n > 0)
        saga_shade(splats + (n - seen->n), sc, seen, from);
    seen->n = 0;
}

/* Sets the colour of a splat, or adds it to `seen`, whose colours are computed
 * together. `middle` is the primitive's position at mid-segment, or NULL. */
static void see(saga_splat *splat, const saga_decoder *dec, uint32_t prim,
                const int32_t *middle, saga_seen *seen)
{
    const int16_t *const base = (const int16_t *)(const void *)const_at(
                                    dec, dec->plan.colours_at) +
                                (size_t)prim * dec->plan.colour_stride;
    int i;

    if (dec->header.model.tools & SAGA_TOOL_VIEW) {
        seen->base[seen->n] = base;
        if (middle)
            for (i = 0; i < 3; i++)
                seen->x[seen->n][i] = middle[i];
        else
            saga_animate_mean(seen->x[seen->n], prim_of(dec, prim),
                              &dec->format, SAGA_T_MID);
        seen->n++;
        return;
    }
    for (i = 0; i < 3; i++)
        splat->colour_q15[i] = (uint16_t)base[i];
}

/* Makes the splats of all visible primitives, with keys by depth. Returns their
 * number. */
static uint32_t make_splats(saga_splat *splats, saga_key *keys,
                            saga_decoder *dec, int32_t t)
{
    const saga_look look = { &dec->format, &dec->camera, t };
    saga_seen seen = { 0 };
    saga_scaffold sc;
    uint32_t i, n = 0, most;

    saga_block_scaffold(&sc, dec, &dec->n);
    most = saga_shade_points(&sc);
    for (i = 0; i < n_prims(dec); i += SAGA_RUN) {
        const uint32_t left = n_prims(dec) - i;
        uint32_t at = i,
                 visible = saga_splats(splats + n, prim_of(dec, i),
                                       left < SAGA_RUN ? left : SAGA_RUN, &look,
                                       (saga_cpu)dec->cpu);

        /* Bit k of `visible` stands for primitive i + k. Its splat is shaded
         * later, together with others: networks run on several points. */
        for (; visible != 0; visible >>= 1, at++) {
            if (!(visible & 1))
                continue;
            keys[n].depth = splats[n].depth;
            keys[n].index = n;
            see(&splats[n++], dec, at, NULL, &seen);
            if (seen.n == most)
                shade(splats, n, dec->camera.centre, &sc, &seen);
        }
    }
    shade(splats, n, dec->camera.centre, &sc, &seen);
    return n;
}

/* Returns whether the boxes cover more pixels than the level allows. Small
 * pictures count as SAGA_COVER_PIXELS, because any splat may cover a tiny
 * picture entirely. */
static int costs_too_much(const saga_decoder *dec)
{
    const uint32_t pixels = (uint32_t)dec->camera.width * dec->camera.height;

    return dec->box_pixels >
           (uint64_t)saga_caps[dec->header.level].cover *
               (pixels < SAGA_COVER_PIXELS ? SAGA_COVER_PIXELS : pixels);
}

/* Identifies a view: views of one decoder differ in their number, views of
 * different decoders in file, segment, layers, time or camera. */
static void number_view(saga_decoder *dec, int32_t t)
{
    const uint8_t *const camera = (const uint8_t *)&dec->camera;
    const uint32_t crc = saga_crc32c(dec->segment_digest, (const uint8_t *)&t,
                                     sizeof t);

    /* Padding after the last field is not included. */
    dec->view_digest = saga_crc32c(crc, camera,
                                   offsetof(saga_camera, background_q15) +
                                       sizeof dec->camera.background_q15);
    dec->n_views++;
    dec->has_view = 1;
}

saga_status saga_view(saga_decoder *dec, const saga_camera *camera, int32_t t)
{
    saga_splat *const splats = (saga_splat *)(void *)block_at(
        dec, dec->plan.splats_at);
    saga_key *const keys = (saga_key *)(void *)block_at(dec, dec->plan.keys_at);
    const saga_status s = saga_camera_check(camera);
    uint32_t n;

    if (!dec->has_segment)
        return SAGA_ERR_STATE;
    if (s)
        return s;
    if (t < 0 || t > SAGA_T_MAX)
        return SAGA_ERR_ARG;
    /* If the view costs more than the level allows, no view is left. */
    dec->camera = *camera;
    dec->has_view = 0;
    dec->n_splats = 0;
    n = make_splats(splats, keys, dec, t);
    saga_depth_sort(
        keys, (saga_key *)(void *)block_at(dec, dec->plan.keys_tmp_at), n);
    dec->box_pixels = saga_raster_boxes(keys, splats, n, camera);
    if (costs_too_much(dec))
        return SAGA_ERR_LEVEL;
    dec->n_splats = n;
    number_view(dec, t);
    return SAGA_OK;
}

_Static_assert(offsetof(saga_job, cursor) ==
                   24 + sizeof(void *) + sizeof(size_t),
               "jobs have no padding");

/* Returns a digest of a job's view and first block. The scratch of a job in
 * progress contains splat numbers of its view, in a layout that its first block
 * determines, so that neither may change. The digest changes with any change of
 * one field. */
static uint32_t digest_of(const saga_decoder *dec, const saga_job *job,
                          const saga_picture *picture)
{
    return saga_crc32c(dec->view_digest ^ (uint32_t)picture->bits,
                       (const uint8_t *)job, offsetof(saga_job, cursor));
}

saga_status saga_draw(const saga_decoder *dec, saga_job *job,
                      const saga_picture *picture, uint32_t budget)
{
    const saga_drawing drawing = { &dec->camera,       splats_of(dec),
                                   keys_of(dec),       dec->n_splats,
                                   (saga_cpu)dec->cpu, dec->format.tools };
    uint32_t digest;

    if (!dec->has_view)
        return SAGA_ERR_STATE;
    if (budget == 0)
        return SAGA_ERR_ARG;
    digest = digest_of(dec, job, picture);
    if (job->cursor[0] == 0) {
        job->cursor[1] = dec->n_views;
        job->cursor[2] = digest;
        job->cursor[3] = dec->n_splats;
    }
    /* A digest may collide, if bytes are chosen for it. The scratch has numbers
     * of splats below n_splats, so that this comparison and the one with
     * n_counted in raster_list.c keep every access in bounds even then. */
    if (job->cursor[1] != dec->n_views || job->cursor[2] != digest ||
        job->cursor[3] != dec->n_splats)
        return SAGA_ERR_STATE;
    return saga_raster(job, picture, &drawing, budget);
}

/* Returns whether |x| <= 2^29 in all coordinates. */
static int is_in_space(const int32_t x[3])
{
    int i;

    for (i = 0; i < 3; i++)
        if (x[i] < -(1 << 29) || x[i] > 1 << 29)
            return 0;
    return 1;
}

saga_status saga_colours_at(saga_splat *splats, saga_decoder *dec,
                            const uint32_t *index, uint32_t n,
                            const int32_t from[3], const int32_t (*middle)[3])
{
    saga_seen seen = { 0 };
    saga_scaffold sc;
    uint32_t most, i;

    if (!dec->has_segment)
        return SAGA_ERR_STATE;
    if (!is_in_space(from))
        return SAGA_ERR_ARG;
    for (i = 0; i < n; i++)
        if (index[i] >= n_prims(dec) || (middle && !is_in_space(middle[i])))
            return SAGA_ERR_ARG;
    /* Shade as many points at a time as the networks accept. */
    saga_block_scaffold(&sc, dec, &dec->n);
    most = saga_shade_points(&sc);
    for (i = 0; i < n; i++) {
        see(splats + i, dec, index[i], middle ? middle[i] : NULL, &seen);
        if (seen.n == most)
            shade(splats, i + 1, from, &sc, &seen);
    }
    shade(splats, n, from, &sc, &seen);
    return SAGA_OK;
}

saga_status saga_colour_at(uint16_t colour_q15[3], saga_decoder *dec,
                           uint32_t index, const int32_t from[3])
{
    saga_splat splat;
    const saga_status s = saga_colours_at(&splat, dec, &index, 1, from, NULL);
    int i;

    for (i = 0; !s && i < 3; i++)
        colour_q15[i] = splat.colour_q15[i];
    return s;
}

saga_status saga_splat_at(saga_splat *out, const saga_decoder *dec,
                          uint32_t order)
{
    if (!dec->has_view)
        return SAGA_ERR_STATE;
    if (order >= dec->n_splats)
        return SAGA_ERR_ARG;
    *out = splats_of(dec)[keys_of(dec)[order].index];
    return SAGA_OK;
}
