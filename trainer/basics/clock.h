/* SPDX-License-Identifier: MIT
 *
 * A monotonic clock, for durations. Its origin is arbitrary.
 */
#ifndef SAGA_CLOCK_H
#define SAGA_CLOCK_H

#include <stdint.h>

int64_t saga_clock_ns(void);
double saga_clock_seconds(void);

#endif
