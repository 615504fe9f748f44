/* SPDX-License-Identifier: MIT */
#include "verdict_cli.h"

#include "json_memory.h"

#include <math.h>
#include <stdio.h>

/* dB that what moves has to be above a still picture, to be better than one. */
#define ABOVE_STILL 1.0

/* Fewer pixels than this part are noise, if they change. */
#define LEAST_SHARE 1e-4

/* Tells of what moves; returns whether it should be better. */
static bool print_moving(const saga_verdict *v)
{
    const double moving = saga_change_psnr(&v->file);
    const double as_still = saga_change_psnr(&v->still);
    const bool lost = moving < as_still + ABOVE_STILL;

    printf("; what moves (%.1f %% of the pixels): %.1f dB, %s",
           100 * saga_change_share(&v->file), moving, lost
           ? "no better than a still picture" : saga_verdict_word(moving));
    return lost || moving < SAGA_VERDICT_BLURRED;
}

void saga_verdict_print(const saga_verdict *v, bool best)
{
    const double rest = saga_verdict_rest(v);
    bool bad = rest < SAGA_VERDICT_BLURRED;

    if (v->file.n_pixels == 0)
        return;
    if (isnan(rest))
        printf("  nothing stands still");
    else
        printf("  what stands still: %.1f dB, %s", rest,
               saga_verdict_word(rest));
    if (saga_change_share(&v->file) >= LEAST_SHARE)
        bad = print_moving(v) || bad;
    puts(!bad ? "" : best ? "\n  a larger --size would be better"
                          : "\n  try --preset best, or a larger --size");
}

static json_t *real_or_null(double v)
{
    return isfinite(v) ? json_real(v) : json_null();
}

json_t *saga_verdict_json(const saga_verdict *v)
{
    return json_pack("{sosososo}",
        "still", real_or_null(saga_verdict_rest(v)),
        "moving", real_or_null(saga_change_psnr(&v->file)),
        "moving_as_still", real_or_null(saga_change_psnr(&v->still)),
        "moving_share", real_or_null(saga_change_share(&v->file)));
}

void saga_shutter_print(const saga_shutter_found *found,
                        const saga_capture *capture)
{
    bool any = false;

    for (int i = 0; i < capture->n_views; i++)
        if (found[i].shows) {
            /* A tenth is what is told at least: +-0.0 would claim too much. */
            printf("  %s: the last row is %.1f of a frame (+-%.1f) %s the "
                   "first\n", capture->views[i].name, fabs(found[i].readout),
                   fmax(found[i].spread, 0.1),
                   found[i].readout > 0 ? "behind" : "ahead of");
            any = true;
        }
    if (any)
        puts("  a rolling shutter shows there, against the other cameras: "
             "what moves fast\n  leans and blurs; film with a faster readout "
             "or a global shutter");
}

json_t *saga_shutter_json(const saga_shutter_found *found,
                          const saga_capture *capture)
{
    json_t *const o = json_object();

    for (int i = 0; i < capture->n_views; i++)
        saga_json_set_value(o, capture->views[i].name, json_pack(
            "{sososb}", "frames", real_or_null(found[i].readout),
            "standard_error", real_or_null(found[i].spread),
            "shows", (int)found[i].shows));
    return o;
}
