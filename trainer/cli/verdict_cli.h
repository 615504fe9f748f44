/* SPDX-License-Identifier: MIT
 *
 * What `saga encode` says at its end: how well still and moving parts are
 * represented.
 */
#ifndef SAGA_VERDICT_CLI_H
#define SAGA_VERDICT_CLI_H

#include "json_cli.h"
#include "verdict.h"

/* Adds "psnr_parts" to a report: {"still", "moving", "moving_as_still",
 * "moving_share"}, null if there are no such pixels. If the quality is bad, the
 * text suggests what to try; `better` is a preset that would help, or NULL. */
void saga_put_verdict(json_t *report, const saga_verdict *v,
                      const char *better);

/* The lines that print it. */
#define SAGA_VERDICT_LINES                                               \
    { "psnr_parts./still_word", NULL,                                    \
      "  things that stand still: "                                      \
      "{psnr_parts.still:%.1f} dB, {psnr_parts./still_word}" },          \
        { "psnr_parts./shown&!psnr_parts./still_word", NULL,             \
          "  nothing stands still" },                                    \
        { "psnr_parts./moving_word", NULL,                               \
          "; things that move "                                          \
          "({psnr_parts.moving_share*100:%.1f} % of the pixels): "       \
          "{psnr_parts.moving:%.1f} dB, {psnr_parts./moving_word}" },    \
        { "psnr_parts./bad&psnr_parts./better", NULL,                    \
          "\n  try --preset {psnr_parts./better}, or a larger --size" }, \
        { "psnr_parts./bad&!psnr_parts./better", NULL,                   \
          "\n  a larger --size would be better" },                       \
    {                                                                    \
        "psnr_parts./shown", NULL, "\n"                                  \
    }

#endif
