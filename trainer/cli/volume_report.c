/* SPDX-License-Identifier: MIT */
#include "volume_report.h"

#include "saga.h"

#include <math.h>
#include <stdbool.h>

static double degrees(int32_t turns)
{
    return turns * 180.0 / 32768;
}

/* Returns dB, or NaN, which becomes null, for what is unknown. */
static double decibels(uint16_t q8)
{
    return q8 ? q8 / 256.0 : (double)NAN;
}

static json_t *direction(const int16_t a[3])
{
    const double n = sqrt((double)a[0] * a[0] + (double)a[1] * a[1] +
                          (double)a[2] * a[2]);

    return json_pack("[fff]", a[0] / n, a[1] / n, a[2] / n);
}

json_t *saga_volume_report(const uint8_t *bytes, size_t n,
                           const saga_metric *metric)
{
    const double *const c = metric->centre, unit = metric->unit;
    json_t *const o = json_object();
    saga_volume v;
    bool has_floor;

    if (saga_find_volume(&v, bytes, n))
        return o;
    has_floor = v.floor != INT32_MIN;
    saga_put(o, "pivot",
             json_pack("[fff]", c[0] + unit * v.pivot[0],
                       c[1] + unit * v.pivot[1], c[2] + unit * v.pivot[2]));
    saga_put_real(o, "nearest", unit * v.distance_min);
    saga_put_real(o, "farthest", unit * v.distance_max);
    saga_put_real(o, "azimuth_degrees", degrees(v.azimuth));
    saga_put_real(o, "lowest_degrees", degrees(v.elevation_min));
    saga_put_real(o, "highest_degrees", degrees(v.elevation_max));
    saga_put_real(o, "turn_degrees", degrees(v.turn));
    saga_put_real(o, "floor", has_floor ? unit * v.floor : (double)NAN);
    saga_put(o, "up", direction(v.up));
    saga_put(o, "front", direction(v.front));
    saga_put_int(o, "start", v.start);
    saga_put_real(o, "psnr_at_cameras", decibels(v.quality_q8[0]));
    saga_put_real(o, "psnr_between", decibels(v.quality_q8[1]));
    /* For the text. */
    saga_put_flag(o, "/closed", v.azimuth == 32768);
    saga_put_flag(o, "/has_floor", has_floor);
    saga_put_real(o, "/below", -unit * v.floor);
    saga_put_flag(o, "/rated", v.quality_q8[0] > 0);
    return o;
}
