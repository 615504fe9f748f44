/* SPDX-License-Identifier: MIT
 *
 * Vectors of 128 bits, as gcc and clang have them for every machine.
 */
#ifndef SAGA_VECTOR_X4_H
#define SAGA_VECTOR_X4_H

#include <stdint.h>

typedef int32_t i32x4 __attribute__((vector_size(16)));
typedef uint32_t u32x4 __attribute__((vector_size(16)));
typedef int16_t i16x8 __attribute__((vector_size(16)));

#endif
