# SPDX-License-Identifier: MIT
"""The Bjontegaard delta rate (BD-rate), by monotone cubic interpolation."""
import math


def pchip_slopes(x, y):
    """Derivatives of the monotone cubic through (x, y) (Fritsch, Carlson)."""
    n = len(x)
    h = [b - a for a, b in zip(x, x[1:])]
    slope = [(b - a) / s for a, b, s in zip(y, y[1:], h)]
    if n == 2:
        return [slope[0]] * 2

    def end(h0, h1, s0, s1):
        d = ((2 * h0 + h1) * s0 - h0 * s1) / (h0 + h1)
        if d * s0 <= 0:
            return 0.0
        return 3 * s0 if s0 * s1 <= 0 and abs(d) > 3 * abs(s0) else d

    d = [end(h[0], h[1], slope[0], slope[1])]
    for i in range(1, n - 1):
        a, b = slope[i - 1], slope[i]
        w1, w2 = 2 * h[i] + h[i - 1], h[i] + 2 * h[i - 1]
        d.append(0.0 if a * b <= 0 else (w1 + w2) / (w1 / a + w2 / b))
    return d + [end(h[-1], h[-2], slope[-1], slope[-2])]


def integral(x, y, lo, hi):
    """Returns the area under the monotone cubic through (x, y), from lo to hi
    within x."""
    d = pchip_slopes(x, y)
    total = 0.0
    for i in range(len(x) - 1):
        h = x[i + 1] - x[i]
        s = (y[i + 1] - y[i]) / h
        c, b = (3 * s - 2 * d[i] - d[i + 1]) / h, (d[i] + d[i + 1] - 2 * s) / h
        b /= h

        def antiderivative(t):
            return t * (y[i] + t * (d[i] / 2 + t * (c / 3 + t * b / 4)))

        t0 = min(max(lo - x[i], 0), h)
        t1 = min(max(hi - x[i], 0), h)
        total += antiderivative(t1) - antiderivative(t0)
    return total


def curve(points):
    """Returns the points (bytes, dB) as (dB, log bytes), or None if they are
    fewer than two, or two have the same PSNR."""
    points = sorted((p, math.log(r)) for r, p in points)
    if len(points) < 2 or any(b[0] <= a[0] for a, b in
                              zip(points, points[1:])):
        return None
    return [p for p, _ in points], [r for _, r in points]


def common(anchor, test, within=None):
    """Returns the interval of PSNR that both curves and `within` have in
    common, or None if it is empty."""
    curves = [curve(anchor), curve(test)]
    if None in curves:
        return None
    ends = [(c[0][0], c[0][-1]) for c in curves] + ([within] if within else [])
    lo, hi = max(e[0] for e in ends), min(e[1] for e in ends)
    return (lo, hi) if lo < hi else None


def log_rate_at(points, psnr):
    """Returns the logarithm of the bytes at this PSNR, by the monotone cubic,
    or None beyond the ends of the curve."""
    c = curve(points)
    if not c or not c[0][0] <= psnr <= c[0][-1]:
        return None
    (x, y), i = c, max(i for i, p in enumerate(c[0][:-1]) if p <= psnr)
    d, h = pchip_slopes(x, y), x[i + 1] - x[i]
    s, t = (y[i + 1] - y[i]) / h, (psnr - x[i]) / h
    # The Hermite form of the cubic between the two neighbouring points.
    return y[i] + h * t * (d[i] * (1 - t) ** 2 + s * t * (3 - 2 * t) +
                           d[i + 1] * t * (t - 1))


def saving(anchor, test, psnr):
    """Returns the change of the bytes at this PSNR, in per cent, or None if one
    of the curves does not reach it."""
    rates = [log_rate_at(c, psnr) for c in (anchor, test)]
    return None if None in rates else 100 * (math.exp(rates[1] - rates[0]) - 1)


def bd_rate(anchor, test, within=None, least=0.0):
    """Returns the mean change of the rate at equal PSNR, in per cent, from
    anchor (the reference) to test; both are lists of two or more points
    (bytes, dB). Returns None if the curves have less than `least` dB in
    common, within the pair `within` if given, or if PSNR does not grow with
    the bytes."""
    interval = common(anchor, test, within)
    if not interval or interval[1] - interval[0] < least:
        return None
    lo, hi = interval
    mean = [integral(*curve(c), lo, hi) / (hi - lo) for c in (anchor, test)]
    return 100 * (math.exp(mean[1] - mean[0]) - 1)
