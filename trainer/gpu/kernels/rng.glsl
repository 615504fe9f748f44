/* SPDX-License-Identifier: MIT
 *
 * basics/rng.h with words of 32 bits, the lower one first. */
uvec2 times(uvec2 a, uvec2 b)
{
    uint high, low;

    umulExtended(a.x, b.x, high, low);
    return uvec2(low, high + a.x * b.y + a.y * b.x);
}

/* Returns x ^ (x >> n), 0 < n < 32. */
uvec2 fold(uvec2 x, int n)
{
    return x ^ uvec2(x.x >> n | x.y << 32 - n, x.y >> n);
}

uvec2 mix64(uvec2 x)
{
    x = times(fold(x, 30), uvec2(0x1ce4e5b9u, 0xbf58476du));
    x = times(fold(x, 27), uvec2(0x133111ebu, 0x94d049bbu));
    return fold(x, 31);
}

/* Returns a number of -1/2 .. 1/2: saga_rng_double() - 1/2, in 24 bits. */
float noise(uvec2 key, uvec2 counter)
{
    uvec2 x = times(counter, uvec2(0x7f4a7c15u, 0x9e3779b9u));
    uint carry;

    x.x = uaddCarry(x.x, key.x, carry);
    x.y += key.y + carry;
    x = mix64(mix64(x) ^ key);
    return (float(x.y >> 8) - 8388607.5) / 16777216;
}
