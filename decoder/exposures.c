/* SPDX-License-Identifier: MIT
 *
 * Finds the exposure of a camera in the capture. No function of the decoder
 * applies it to a picture.
 */
#include "fx.h"
#include "head.h"
#include "saga.h"
#include "work_block.h"

enum { LEAST_GAIN_Q12 = 256 }; /* 1/16; the largest is 65535, almost 16 */

/* Reads the payload, which has six bytes for each camera. All gains are
 * checked, including those of other cameras than the wanted one. */
static saga_status read_gains(saga_exposure *exposure, const uint8_t *p,
                              uint32_t n_cameras, uint32_t index)
{
    uint32_t i, k;

    for (i = 0; i < n_cameras; i++)
        for (k = 0; k < 3; k++, p += 2) {
            const uint32_t gain = p[0] | (uint32_t)p[1] << 8;

            if (gain < LEAST_GAIN_Q12)
                return SAGA_ERR_DATA;
            if (i == index)
                exposure->gain_q12[k] = (uint16_t)gain;
        }
    return SAGA_OK;
}

saga_status saga_find_exposure(saga_exposure *exposure, const uint8_t *bytes,
                               size_t n, uint32_t index)
{
    saga_exposure found = { { 0, 0, 0 } };
    saga_chunk c;
    saga_header h;
    saga_plan plan;
    size_t at;
    saga_status s = saga_block_plan(&h, &plan, bytes, n, 0);

    if (s)
        return s;
    if (index >= h.n_cameras)
        return SAGA_ERR_ARG;
    if (n < saga_head_nbytes(&h))
        return SAGA_ERR_TRUNCATED;
    s = saga_head_find(&c, &at, SAGA_CHUNK_EXPOSURES, &h, bytes, n);
    if (s)
        return s;
    if (c.nbytes != h.n_cameras * (uint32_t)SAGA_EXPOSURE_NBYTES)
        return SAGA_ERR_DATA;
    s = read_gains(&found, bytes + at + SAGA_CHUNK_NBYTES, h.n_cameras, index);
    if (!s)
        *exposure = found;
    return s;
}
