// SPDX-License-Identifier: MIT
//
// A path of key cameras, in the capture's units. `saga render --path` reads the
// same format:
//
//     { "format": "saga camera path 1", "fps": 30, "size": [480, 270],
//       "keys": [{ "seconds": 0, "frame": 0, "eye": [x, y, z],
//                  "target": [x, y, z], "up": [x, y, z], "fov": 45 }, ...] }
//
// seconds is a time of the path, frame the frame of the file that is shown
// then. fov is vertical, in degrees. Between the keys each number follows a
// cubic through all keys.

export const FORMAT = 'saga camera path 1';

const isVector = (v) => Array.isArray(v) && v.length === 3 &&
    v.every(Number.isFinite);

function checkKey(key, i) {
    for (const name of ['seconds', 'frame', 'fov'])
        if (!Number.isFinite(key[name]))
            throw new Error(`key ${i + 1} of the path has no ${name}`);
    for (const name of ['eye', 'target', 'up'])
        if (!isVector(key[name]))
            throw new Error(`key ${i + 1} of the path has no ${name}`);
}

export function parsePath(text) {
    const path = JSON.parse(text);

    if (path.format !== FORMAT || !Array.isArray(path.keys))
        throw new Error(`the path does not have the format "${FORMAT}"`);
    path.keys.forEach(checkKey);
    path.keys.sort((a, b) => a.seconds - b.seconds);
    return path;
}

// These convert a key to a row of numbers, and back.
const flat = (key) => [key.frame, key.fov, ...key.eye, ...key.target,
    ...key.up];
const unflat = (row, seconds) => ({ seconds, frame: row[0], fov: row[1],
    eye: row.slice(2, 5), target: row.slice(5, 8), up: row.slice(8, 11) });

// Returns the slope at key i: that of the line between its neighbours, or at an
// end of the path that of the last interval.
function slopeAt(rows, at, i, column) {
    const a = Math.max(i - 1, 0), b = Math.min(i + 1, rows.length - 1);

    return (rows[b][column] - rows[a][column]) / (at[b] - at[a] || 1);
}

// Returns the camera at a time of the path, which has at least one key.
export function keyAt(keys, seconds) {
    const at = keys.map((key) => key.seconds), rows = keys.map(flat);
    const last = keys.length - 1;

    if (seconds <= at[0])
        return { ...keys[0], seconds };
    if (seconds >= at[last])
        return { ...keys[last], seconds };
    const i = at.findLastIndex((s) => s <= seconds);
    const span = at[i + 1] - at[i], x = (seconds - at[i]) / span;
    const row = rows[i].map((a, column) => {
        const b = rows[i + 1][column];
        const m = span * slopeAt(rows, at, i, column);
        const n = span * slopeAt(rows, at, i + 1, column);

        return a + x * (m + x * (3 * (b - a) - 2 * m - n +
            x * (2 * (a - b) + m + n)));
    });

    return unflat(row, seconds);
}
