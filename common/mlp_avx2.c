/* SPDX-License-Identifier: MIT
 *
 * The tiles of dense layers with AVX2, used if it is detected at run time.
 */
#include "mlp_layer.h"

#ifdef SAGA_MLP_MAY_AVX2

#define AVX2 __attribute__((target("avx2")))
#define INLINE static inline __attribute__((always_inline)) AVX2
#define SAGA_MLP_AVX2
#include "mlp_x86.h"

AVX2 uint32_t saga_mlp_tiles__avx2(int16_t *y, const saga_layer *layer,
                                   const int16_t *x, uint32_t n)
{
    return run_tiles(y, layer, x, n);
}

#endif
