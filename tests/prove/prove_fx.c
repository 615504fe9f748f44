/* SPDX-License-Identifier: MIT
 *
 * Each function of fx.h with all arguments that its comment allows.
 */
#include "prove.h"

#include "fx.h"

static int32_t any32(void)
{
    return Frama_C_interval(INT32_MIN, INT32_MAX);
}

static int64_t any64(void)
{
    return Frama_C_long_interval(INT64_MIN, INT64_MAX);
}

static void shifts(void)
{
    int32_t x;
    int64_t z;
    int n;

    //@ loop unroll 32;
    for (n = 0; n <= 31; n++) {
        const int32_t half = n ? (int32_t)(1u << (n - 1)) : 0;

        x = fx_rshift(Frama_C_interval(INT32_MIN, INT32_MAX - half), n);
        //@ check n == 0 || -(1 << 31 - n) <= x <= (1 << 31 - n);
    }
    //@ loop unroll 63;
    for (n = 0; n <= 62; n++) {
        const int64_t half = n ? (int64_t)1 << (n - 1) : 0;

        z = fx_rshift64(Frama_C_long_interval(INT64_MIN, INT64_MAX - half), n);
        (void)z;
    }
    //@ loop unroll 32;
    for (n = 31; n <= 62; n++)
        x = fx_mul_rshift(any32(), any32(), n);
    (void)x;
}

static void limits(void)
{
    int32_t y;

    y = fx_clamp(any32(), -32768, 32767);
    //@ check -32768 <= y <= 32767;
    y = fx_sat16(any32());
    //@ check -32767 <= y <= 32767;
    y = fx_clamp64(any64(), -5, 7);
    //@ check -5 <= y <= 7;
    y = fx_sat16_64(any64());
    //@ check -32767 <= y <= 32767;
    y = fx_min(any32(), any32());
    y = fx_max(any32(), any32());
    (void)y;
}

static void formats(void)
{
    int32_t y;
    int from, to;

    //@ loop unroll 25;
    for (from = 0; from <= 24; from++)
        //@ loop unroll 25;
        for (to = 0; to <= 24; to++) {
            y = fx_requant16((int16_t)Frama_C_interval(-32768, 32767), from,
                             to);
            //@ check -32768 <= y <= 32767;
            if (to - from > 15)
                continue;
            y = fx_requant32(Frama_C_interval(-32768, 32768), from, to);
            //@ check -(1 << 30) <= y <= 1 << 30;
            (void)y;
        }
}

static void zeros(void)
{
    int n;

    n = fx_clz32(any_of(1, UINT32_MAX));
    //@ check 0 <= n <= 31;
    n = fx_clz64(Frama_C_unsigned_long_interval(1, UINT32_MAX));
    //@ check 32 <= n <= 63;
    n = fx_clz64(Frama_C_unsigned_long_interval((uint64_t)1 << 32, UINT64_MAX));
    //@ check 0 <= n <= 31;
    (void)n;
}

static void loads(void)
{
    uint8_t bytes[8];
    uint32_t x;

    any_bytes(bytes, sizeof bytes);
    x = fx_load16_le(bytes + 6);
    //@ check x <= 65535;
    x = fx_load32_le(bytes + 4);
    fx_store16_le(bytes + 6, x);
    fx_store32_le(bytes + 4, x);
}

int main(void)
{
    shifts();
    limits();
    formats();
    zeros();
    loads();
    return 0;
}
