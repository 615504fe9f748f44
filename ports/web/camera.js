// SPDX-License-Identifier: MIT
//
// Cameras in float, which a user moves, and in the decoder's integers.
//
// A pose is { rotation, centre }: the camera's right, down and forward
// directions as rows in box axes (9 numbers), and its position in box units
// (3). The `values` of a camera are the 22 integers of saga_camera, in its
// order.

const ROTATION = 0, CENTRE = 9, FOCAL = 12, PRINCIPAL = 14, SIZE = 17;
const ONE_Q30 = 2 ** 30, ONE_Q16 = 65536;
const FARTHEST = 2 ** 29; // box units; largest coordinate of a camera
const MOST_PIXELS = 2 ** 25, MOST_SIDE = 8192; // of an exact picture in the
                          // camera's size; view_cli.c has the same limits

// --- Vectors ---------------------------------------------------------------

export const add = (a, b) => a.map((x, i) => x + b[i]);
export const sub = (a, b) => a.map((x, i) => x - b[i]);
export const times = (a, s) => a.map((x) => x * s);
export const dot = (a, b) => a.reduce((sum, x, i) => sum + x * b[i], 0);
export const norm = (a) => Math.hypot(...a);
export const unit = (a) => times(a, 1 / (norm(a) || 1));
export const cross = (a, b) => [a[1] * b[2] - a[2] * b[1],
    a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];

// Returns v turned by an angle about a unit axis.
function turned(v, axis, angle) {
    const c = Math.cos(angle), s = Math.sin(angle);

    return add(add(times(v, c), times(cross(axis, v), s)),
        times(axis, dot(axis, v) * (1 - c)));
}

// --- Poses -----------------------------------------------------------------

export const rightOf = (pose) => pose.rotation.slice(0, 3);
export const downOf = (pose) => pose.rotation.slice(3, 6);
export const forwardOf = (pose) => pose.rotation.slice(6, 9);

export function poseOf(values) {
    return {
        rotation: Array.from(values.slice(ROTATION, ROTATION + 9),
            (r) => r / ONE_Q30),
        centre: Array.from(values.slice(CENTRE, CENTRE + 3)),
    };
}

// Returns the pose of a camera at eye that looks at target, with the top of its
// picture towards up.
export function lookAt(eye, target, up) {
    const forward = unit(sub(target, eye));
    const right = unit(cross(forward, up));

    return { rotation: [...right, ...cross(forward, right), ...forward],
        centre: eye };
}

// Returns the pose turned rigidly about a point.
export function turnedAbout(pose, pivot, axis, angle) {
    const rows = [rightOf(pose), downOf(pose), forwardOf(pose)];

    return {
        rotation: rows.flatMap((row) => turned(row, axis, angle)),
        centre: add(pivot, turned(sub(pose.centre, pivot), axis, angle)),
    };
}

// Turns a pose around the pivot: by yaw about up, then by pitch, which stops
// shortly before it looks straight up or down.
export function orbited(pose, pivot, up, yaw, pitch) {
    const limit = 0.05;
    const angle = Math.acos(Math.max(-1, Math.min(1,
        dot(forwardOf(pose), up))));
    const next = Math.max(limit, Math.min(Math.PI - limit, angle - pitch));
    const level = turnedAbout(pose, pivot, up, yaw);

    return turnedAbout(level, pivot, rightOf(level), angle - next);
}

// Moves a pose nearer to the pivot, or farther away.
export function dollied(pose, pivot, factor) {
    return { rotation: pose.rotation,
        centre: add(pivot, times(sub(pose.centre, pivot), factor)) };
}

export function moved(pose, by) {
    return { rotation: pose.rotation, centre: add(pose.centre, by) };
}

// Returns by how much a pose moves so that what is at the pivot's distance moves
// by these pixels of the lens.
export function panOf(pose, pivot, lens, dx, dy) {
    const perPixel = norm(sub(pivot, pose.centre)) * ONE_Q16 /
        lens[FOCAL];

    return add(times(rightOf(pose), -dx * perPixel),
        times(downOf(pose), -dy * perPixel));
}

// Returns the point of the camera's axis that is nearest to a point, or one
// ahead if that is behind the camera.
export function onAxis(pose, point) {
    const forward = forwardOf(pose);
    const depth = dot(sub(point, pose.centre), forward);

    return add(pose.centre, times(forward, depth > 0 ? depth : 2 ** 22));
}

// --- Integers --------------------------------------------------------------

// Returns the lens, which is an array of `values`, scaled to another size of
// the picture.
export function resized(lens, scale) {
    const values = Int32Array.from(lens);

    if (scale === 1)
        return values;
    for (const at of [FOCAL, FOCAL + 1])
        values[at] = Math.max(1, Math.round(lens[at] * scale));
    for (const i of [0, 1]) {
        const side = Math.max(1, Math.min(16384,
            Math.round(lens[SIZE + i] * scale)));
        const off = lens[PRINCIPAL + i] - lens[SIZE + i] * ONE_Q16 / 2;

        values[SIZE + i] = side;
        values[PRINCIPAL + i] = Math.round(side * ONE_Q16 / 2 + off * scale);
    }
    return values;
}

// Returns the size of an exact picture, relative to the camera's picture. If
// that has more than any screen, it is the window's, `room`.
export function exactScale(lens, scale, room) {
    const sides = [widthOf(lens), heightOf(lens)];
    const scaled = sides.map((x) => x * scale);
    const [across, down] = room ?? [1920, 1080];

    return Math.max(...scaled) <= MOST_SIDE &&
        scaled[0] * scaled[1] <= MOST_PIXELS ? scale
        : Math.min(scale, across / sides[0], down / sides[1]);
}

// Returns the lens for a picture of width x height. If its shape differs from
// that of the lens's picture, up to a fifth of the lens's field of view is cut
// off, so that the picture shows less of what no camera has filmed.
export function fitted(lens, width, height) {
    const values = Int32Array.from(lens);
    const sides = [width / lens[SIZE], height / lens[SIZE + 1]];
    const scale = Math.min(Math.max(...sides), 1.25 * Math.min(...sides));

    values.set([width, height], SIZE);
    for (const i of [0, 1]) {
        const off = lens[PRINCIPAL + i] - lens[SIZE + i] * ONE_Q16 / 2;

        values[FOCAL + i] = Math.max(1, Math.round(lens[FOCAL + i] * scale));
        values[PRINCIPAL + i] = Math.round(values[SIZE + i] * ONE_Q16 / 2 +
            off * scale);
    }
    return values;
}

// Returns the values of a camera with this lens at a pose.
export function placed(lens, pose) {
    const values = Int32Array.from(lens);

    pose.rotation.forEach((r, i) => {
        values[ROTATION + i] = Math.round(r * ONE_Q30);
    });
    pose.centre.forEach((c, i) => {
        values[CENTRE + i] = Math.max(-FARTHEST,
            Math.min(FARTHEST, Math.round(c)));
    });
    return values;
}

export const widthOf = (values) => values[SIZE];
export const heightOf = (values) => values[SIZE + 1];

// Returns the vertical field of view, in degrees.
export function fovOf(values) {
    const half = heightOf(values) * ONE_Q16 / 2 / values[FOCAL + 1];

    return 2 * Math.atan(half) * 180 / Math.PI;
}

// Returns the lens with another vertical field of view, in degrees.
export function withFov(lens, fov) {
    const values = Int32Array.from(lens);
    const focal = heightOf(lens) * ONE_Q16 / 2 /
        Math.tan(fov * Math.PI / 360);
    const aspect = lens[FOCAL] / lens[FOCAL + 1];

    values[FOCAL] = Math.max(1, Math.round(focal * aspect));
    values[FOCAL + 1] = Math.max(1, Math.round(focal));
    return values;
}

// Returns a camera for files without a rig, which looks straight ahead from 1.2
// cubes away.
export function standInLens() {
    const width = 640, height = 360;
    const values = new Int32Array(22);

    values.set([width * ONE_Q16, width * ONE_Q16, width * ONE_Q16 / 2,
        height * ONE_Q16 / 2, 2 ** 14, width, height], FOCAL);
    return placed(values, lookAt([0, 0, -1.2 * 2 ** 24], [0, 0, 0],
        [0, -1, 0]));
}

// --- A rig -----------------------------------------------------------------

// Solves m x = v for a symmetric positive 3x3 matrix by Cramer's rule.
function solve3(m, v) {
    const column = (i) => [m[0][i], m[1][i], m[2][i]];
    const det = (a, b, c) => dot(a, cross(b, c));
    const [a, b, c] = [0, 1, 2].map(column);
    const d = det(a, b, c);

    return [det(v, b, c) / d, det(a, v, c) / d, det(a, b, v) / d];
}

// Returns the point at which the cameras look: the point nearest to all their
// axes, with a small weight for the cube's centre, which decides if there is a
// single camera.
export function focusOf(poses) {
    const m = [0, 1, 2].map((i) => [0, 1, 2].map(
        (k) => (i === k ? 1e-3 * poses.length : 0)));
    let v = [0, 0, 0];

    for (const pose of poses) {
        const f = forwardOf(pose);

        for (let i = 0; i < 3; i++)
            for (let k = 0; k < 3; k++)
                m[i][k] += (i === k ? 1 : 0) - f[i] * f[k];
        v = add(v, sub(pose.centre, times(f, dot(f, pose.centre))));
    }
    return solve3(m, v);
}

// Returns the up direction: perpendicular to the cameras' right directions,
// near the mean of their up directions. It is right if cameras are level,
// whatever their tilt.
export function upOf(poses) {
    const mean = poses.reduce((sum, pose) => sub(sum, downOf(pose)),
        [0, 0, 0]);
    let up = unit(norm(mean) > 1e-6 ? mean : times(downOf(poses[0]), -1));

    for (let step = 0; step < 64; step++) {
        const next = poses.reduce((sum, pose) => sub(sum, times(rightOf(pose),
            dot(rightOf(pose), up) / poses.length)), up);

        if (norm(next) < 1e-6)
            break;
        up = unit(next);
    }
    return up;
}
