/* SPDX-License-Identifier: MIT */
#include "tally.h"

#include <stddef.h>

int saga_tally_add(saga_tally *m, uint32_t units)
{
    if (m == NULL || m->stop == NULL)
        return 0;
    m->done += units;
    if (m->done >= SAGA_TALLY_EVERY && !m->stopped) {
        m->done = 0;
        m->stopped = m->stop(m->user);
    }
    return m->stopped != 0;
}
