/* SPDX-License-Identifier: MIT
 *
 * The tiles that a splat touches; splat/splat_tiles.c. Two kernels compute
 * them, one to count and one to list, so nothing here may be contracted. (If
 * a driver still finds other tiles the second time, expand.comp keeps to the
 * count.) */
struct outline {
    vec2 mean;
    float g, n, h, q0;
    uvec2 x, y; /* pixels [x[0], x[1]) and [y[0], y[1]) */
};

/* Returns the columns [c0, c1) of tiles in a row of tiles. */
uvec2 tile_columns(outline o, uint row)
{
    const uint ya = max(row * TILE, o.y[0]);
    const uint yb = min(row * TILE + TILE, o.y[1]);
    precise float rest, tall, peak, lo, hi, a, b, right, left, slack;
    uint c0, c1;

    rest = (f.cut - o.q0) * 1.001 + 0.001;
    tall = sqrt(rest) / o.h;
    peak = o.n * sqrt(rest / (o.n * o.n + o.h * o.h)) / o.h;
    lo = clamp(float(ya) + 0.5 - o.mean.y, -tall, tall);
    hi = clamp(float(yb) - 0.5 - o.mean.y, -tall, tall);
    a = clamp(peak, lo, hi);
    b = clamp(-peak, lo, hi);
    right = rest - o.h * o.h * a * a;
    left = rest - o.h * o.h * b * b;
    right = (o.n * a + (right > 0 ? sqrt(right) : 0)) / o.g;
    left = (o.n * b - (left > 0 ? sqrt(left) : 0)) / o.g;
    slack = 0.05 + 1e-4 * (abs(right) + abs(left) + tall);
    c0 = uint(clamp(floor(o.mean.x + left - slack), float(o.x[0]),
                    float(o.x[1] - 1))) / TILE;
    c1 = uint(clamp(ceil(o.mean.x + right + slack), float(o.x[0]),
                    float(o.x[1] - 1))) / TILE + 1;
    return uvec2(c0, max(c0, c1));
}
