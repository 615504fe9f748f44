/* SPDX-License-Identifier: MIT */
#include "splat_age.h"

#include <tgmath.h>

real saga_splat_ageing(const saga_splat_params *p, size_t i)
{
    return p->log2_width && p->log2_width[i] < -1
               ? exp2(fmin(-p->log2_width[i], R(100)))
               : 2;
}
