/* SPDX-License-Identifier: MIT
 *
 * Finds the viewing volume of a film, and checks its values. Nothing that is
 * drawn depends on it.
 */
#include "fx.h"
#include "head.h"
#include "saga.h"
#include "work_block.h"

enum {
    FARTHEST = 1 << 29, /* of a camera, as in the rig */
    HALF_TURN = 32768,
    QUARTER_TURN = 16384
};

/* --- Fields -------------------------------------------------------------- */

/* Returns an integer of 2 or 4 bytes and moves past it. */
static uint32_t take(const uint8_t **p, uint32_t nbytes)
{
    uint32_t i, x = 0;

    for (i = 0; i < nbytes; i++)
        x |= (uint32_t) * (*p)++ << 8 * i;
    return x;
}

static void read_fields(saga_volume *v, const uint8_t *p)
{
    uint32_t i;

    for (i = 0; i < 3; i++)
        v->pivot[i] = (int32_t)take(&p, 4);
    v->distance_min = take(&p, 4);
    v->distance_max = take(&p, 4);
    v->floor = (int32_t)take(&p, 4);
    for (i = 0; i < 3; i++)
        v->up[i] = (int16_t)take(&p, 2);
    for (i = 0; i < 3; i++)
        v->front[i] = (int16_t)take(&p, 2);
    v->azimuth = (uint16_t)take(&p, 2);
    v->elevation_min = (int16_t)take(&p, 2);
    v->elevation_max = (int16_t)take(&p, 2);
    v->turn = (uint16_t)take(&p, 2);
    v->start = (uint16_t)take(&p, 2);
    v->quality_q8[0] = (uint16_t)take(&p, 2);
    v->quality_q8[1] = (uint16_t)take(&p, 2);
}

/* --- Their ranges -------------------------------------------------------- */

/* Returns the scalar product of two directions, Q28, below 2^32. */
static int64_t dot(const int16_t a[3], const int16_t b[3])
{
    return (int64_t)a[0] * b[0] + (int64_t)a[1] * b[1] + (int64_t)a[2] * b[2];
}

static int is_direction(const int16_t a[3])
{
    const int64_t square = dot(a, a);

    return square >= 1 << 27 && square <= 1 << 29;
}

static int is_valid(const saga_volume *v, uint32_t n_cameras)
{
    const int64_t along = dot(v->up, v->front);
    uint32_t i;

    for (i = 0; i < 3; i++)
        if (v->pivot[i] < -FARTHEST || v->pivot[i] > FARTHEST)
            return 0;
    return v->distance_min <= v->distance_max &&
           v->distance_max <= 2u * FARTHEST && is_direction(v->up) &&
           is_direction(v->front) && along >= -(1 << 24) && along <= 1 << 24 &&
           v->azimuth <= HALF_TURN && v->elevation_min >= -QUARTER_TURN &&
           v->elevation_min <= v->elevation_max &&
           v->elevation_max <= QUARTER_TURN && v->turn <= HALF_TURN &&
           v->start < (n_cameras ? n_cameras : 1);
}

saga_status saga_find_volume(saga_volume *volume, const uint8_t *bytes,
                             size_t n)
{
    saga_volume found;
    saga_chunk c;
    saga_header h;
    saga_plan plan;
    size_t at;
    saga_status s = saga_block_plan(&h, &plan, bytes, n, 1);

    if (!s)
        s = saga_head_find(&c, &at, SAGA_CHUNK_VOLUME, &h, bytes, n);
    if (s)
        return s;
    if (c.nbytes != SAGA_VOLUME_NBYTES)
        return SAGA_ERR_DATA;
    read_fields(&found, bytes + at + SAGA_CHUNK_NBYTES);
    if (!is_valid(&found, h.n_cameras))
        return SAGA_ERR_DATA;
    *volume = found;
    return SAGA_OK;
}
