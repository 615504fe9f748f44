// SPDX-License-Identifier: MIT
//
// Converts the primitives at a time to the Gaussian splats of other engines,
// which draw normal distributions. They are in the capture's units.

// The bit in the header's tools that says that splats fall off faster than
// Gaussians.
export const STEEP = 64;
export const GAUSSIAN_INTS = 13; // 32-bit integers of a web_gaussian of
                                 // saga_web.c
const MOST_ALPHA = 64880 / 65536;
const PEAK_STEPS = 32;           // steps of the table for each unit of log2 P;
                                 // log2 P is 0 to 3

// Engines draw normal distributions, without flat tops (opacities P above 1)
// and steep edges. Each splat becomes a normal distribution that covers the
// same area. With s = log2(e) r^2 / 2 a splat covers the integral over s of
// min(1, P 2^-s), or if it is steep of min(1, P 2^-(s + s^2 / 2)); exp(-r^2 /
// 2) covers 1 / ln 2. Returns the factors by which the deviations grow, for
// log2 P = 0, 1 / PEAK_STEPS, ... 3.
function widenings(isSteep) {
    const step = 1 / 64;

    return Float64Array.from({ length: 3 * PEAK_STEPS + 1 }, (_, i) => {
        let sum = 0;

        for (let s = step / 2; s < 24; s += step)
            sum += 2 ** Math.min(0, i / PEAK_STEPS - s -
                (isSteep ? s * s / 2 : 0));
        return Math.sqrt(Math.LN2 * step * sum);
    });
}

const tables = new Map(); // isSteep -> widenings

function wideningsOf(isSteep) {
    if (!tables.has(isSteep))
        tables.set(isSteep, widenings(isSteep));
    return tables.get(isSteep);
}

// Returns four planes, each with four floats for each primitive, for textures:
// mean and opacity; standard deviations; quaternion w, x, y, z; colour.
export function planesOf(ints, n, { unit, centre, tools }) {
    const planes = new Float32Array(16 * n);
    const [means, scales, quats, colours] = [0, 1, 2, 3].map(
        (i) => planes.subarray(4 * i * n, 4 * (i + 1) * n));
    const wider = wideningsOf((tools & STEEP) !== 0);

    for (let i = 0; i < n; i++) {
        const from = GAUSSIAN_INTS * i, to = 4 * i;
        const q0 = ints[from + 10] / 2 ** 20;
        const peak = Math.max(0, 3 - q0);
        const wide = unit * wider[Math.round(PEAK_STEPS * peak)];
        const length = Math.hypot(ints[from + 3], ints[from + 4],
            ints[from + 5], ints[from + 6]);

        for (let k = 0; k < 3; k++) {
            means[to + k] = centre[k] + unit * ints[from + k];
            scales[to + k] = wide * 2 ** (ints[from + 7 + k] / 1024);
        }
        means[to + 3] = Math.min(MOST_ALPHA, 2 ** (3 - q0));
        for (let k = 0; k < 4; k++)
            quats[to + k] = length > 0 ? ints[from + 3 + k] / length
                : Number(k === 0);
        colours[to] = (ints[from + 11] & 65535) / 32768;
        colours[to + 1] = (ints[from + 11] >>> 16) / 32768;
        colours[to + 2] = (ints[from + 12] & 65535) / 32768;
    }
    return planes;
}
