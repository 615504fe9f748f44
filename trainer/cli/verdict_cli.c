/* SPDX-License-Identifier: MIT */
#include "verdict_cli.h"

#include <math.h>

/* Moving pixels count as better than a still picture only if their PSNR is
 * higher by this, in dB. */
#define ABOVE_STILL 1.0

/* Changes in a smaller fraction of the pixels count as noise. */
#define LEAST_SHARE 1e-4

void saga_put_verdict(json_t *report, const saga_verdict *v, const char *better)
{
    const double rest = saga_verdict_rest(v);
    const double moving = saga_change_psnr(&v->file);
    const double as_still = saga_change_psnr(&v->still);
    const bool shown = v->file.n_pixels > 0;
    const bool moves = shown && saga_change_share(&v->file) >= LEAST_SHARE;
    const bool lost = moving < as_still + ABOVE_STILL;
    json_t *const o = json_object();

    saga_put_real(o, "still", rest);
    saga_put_real(o, "moving", moving);
    saga_put_real(o, "moving_as_still", as_still);
    saga_put_real(o, "moving_share", saga_change_share(&v->file));
    /* What the text says. */
    saga_put_flag(o, "/shown", shown);
    if (shown && !isnan(rest))
        saga_put_text(o, "/still_word", saga_verdict_word(rest));
    if (moves)
        saga_put_text(o, "/moving_word",
                      lost ? "no better than a still picture"
                           : saga_verdict_word(moving));
    saga_put_flag(o, "/bad",
                  shown &&
                      (rest < SAGA_VERDICT_BLURRED ||
                       (moves && (lost || moving < SAGA_VERDICT_BLURRED))));
    saga_put_text(o, "/better", better);
    saga_put(report, "psnr_parts", o);
}
