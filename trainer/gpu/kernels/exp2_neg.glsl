/* SPDX-License-Identifier: MIT
 *
 * Returns 2^-x for x in [-100, 100], with a relative error below 2e-7: the
 * polynomial of basics/vec.h, so that all devices round alike, and nearly as
 * the host. A device's own exp2 and log2 may err by more, and all splats of one
 * opacity in the same direction. */
float exp2_neg(float x)
{
    const float i = round(x);
    precise float p;

    p = -0.00133908633646712344;
    p = fma(p, x - i, 0.00967603191832205408);
    p = fma(p, x - i, -0.0555035711421907782);
    p = fma(p, x - i, 0.240221074853083375);
    p = fma(p, x - i, -0.693147188026228781);
    p = fma(p, x - i, 1.00000007545489719);
    return uintBitsToFloat(floatBitsToUint(p) - (int(i) << 23));
}
