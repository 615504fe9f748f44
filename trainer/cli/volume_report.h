/* SPDX-License-Identifier: MIT
 *
 * Reports the viewing volume of a file, for saga info, eval and volume.
 */
#ifndef SAGA_VOLUME_REPORT_H
#define SAGA_VOLUME_REPORT_H

#include "camera.h"
#include "json_cli.h"

#include <stddef.h>
#include <stdint.h>

/* Returns the volume of a file's bytes[0..n), in units of the capture and in
 * degrees; an empty object if it has none, or a damaged one. */
json_t *saga_volume_report(const uint8_t *bytes, size_t n,
                           const saga_metric *metric);

/* The lines that print it, from the key "volume" of a report. */
#define SAGA_VOLUME_LINES                                                     \
    { "volume", NULL,                                                         \
      "volume      around ({volume.pivot.0:%.4g}, {volume.pivot.1:%.4g}, "    \
      "{volume.pivot.2:%.4g}), {volume.nearest:%.4g} to "                     \
      "{volume.farthest:%.4g} units away\n"                                   \
      "            from {volume.lowest_degrees:%.0f} to "                     \
      "{volume.highest_degrees:%.0f} degrees up, " },                         \
        { "volume./closed", NULL, "all round\n" },                            \
        { "volume&!volume./closed", NULL,                                     \
          "up to {volume.azimuth_degrees:%.0f} degrees to the sides\n" },     \
        { "volume", NULL,                                                     \
          "            looks past its middle by up to "                       \
          "{volume.turn_degrees:%.0f} degrees, begins at camera "             \
          "{volume.start}\n" },                                               \
        { "volume./has_floor", NULL,                                          \
          "            the floor is {volume./below:%.4g} units below its "    \
          "middle\n" },                                                       \
    {                                                                         \
        "volume./rated", NULL,                                                \
            "            expected PSNR: {volume.psnr_at_cameras:%.1f} dB at " \
            "trained cameras, {volume.psnr_between:%.1f} dB between them\n"   \
    }

#endif
