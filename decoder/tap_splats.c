/* SPDX-License-Identifier: MIT
 *
 * Copies the splats of a view in bulk, for programs that draw them themselves.
 */
#include "saga.h"

/* Programs describe a vertex buffer by these offsets, which saga.h documents.
 */
_Static_assert(sizeof(saga_splat) == 44 && offsetof(saga_splat, mean_q8) == 0 &&
                   offsetof(saga_splat, chol_q28) == 8 &&
                   offsetof(saga_splat, q0_q20) == 20 &&
                   offsetof(saga_splat, depth) == 24 &&
                   offsetof(saga_splat, colour_q15) == 28 &&
                   offsetof(saga_splat, x0) == 34,
               "layout of a splat");

saga_status saga_splats_at(saga_splat *out, const saga_decoder *dec,
                           uint32_t first, uint32_t n)
{
    saga_report report;
    saga_splat probe;
    const saga_status s = saga_tell(&report, dec);
    uint32_t i;

    if (s)
        return s;
    /* There is no first splat before a view is prepared, and none in a view
     * without splats. */
    if (report.n_splats == 0 && saga_splat_at(&probe, dec, 0) == SAGA_ERR_STATE)
        return SAGA_ERR_STATE;
    if (first > report.n_splats || n > report.n_splats - first)
        return SAGA_ERR_ARG;
    for (i = 0; i < n; i++)
        (void)saga_splat_at(out + i, dec, first + i);
    return SAGA_OK;
}
