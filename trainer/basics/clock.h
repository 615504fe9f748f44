/* SPDX-License-Identifier: MIT
 *
 * A clock that only goes forward tells how long something takes. Where it
 * starts means nothing.
 */
#ifndef SAGA_CLOCK_H
#define SAGA_CLOCK_H

#include <stdint.h>

int64_t saga_clock_ns(void);
double saga_clock_seconds(void);

#endif
