// SPDX-License-Identifier: MIT
//
// A viewer's camera and time as a key camera, in the capture's units, and as a
// line of text, to share a view.

import { downOf, fovOf, lookAt, times, unit, withFov } from './camera.js';

// Returns the present key camera, or null if no file is open.
export function keyOf(viewer, seconds) {
    return viewer.info && { seconds, frame: viewer.frame,
        fov: fovOf(viewer.lens), eye: viewer.toMetres(viewer.pose.centre),
        target: viewer.toMetres(viewer.pivot),
        up: times(downOf(viewer.pose), -1) };
}

export function goToKey(viewer, key) {
    if (!viewer.info)
        return;
    const eye = viewer.toUnits(key.eye), target = viewer.toUnits(key.target);

    viewer.pivot = target;
    viewer.bounds.isLed = false;
    viewer.frame = viewer.inFile(key.frame);
    viewer.setPose(lookAt(eye, target, unit(key.up)),
        withFov(viewer.lens, key.fov));
}

// Returns "camera=2&frame=12", or the position of a free camera; '' if no file
// is open.
export function stateOf(viewer) {
    const text = (numbers) => numbers.map((x) => Number(x.toPrecision(7)))
        .join(',');

    if (!viewer.info)
        return '';
    if (!viewer.moved)
        return `camera=${viewer.camera}&frame=${Math.floor(viewer.frame)}`;
    const { frame, fov, eye, target, up } = viewer.key();

    return `frame=${Math.floor(frame)}&fov=${text([fov])}&eye=${text(eye)}` +
        `&target=${text(target)}&up=${text(up)}`;
}

// Sets camera and time from such a line. Returns whether it had any.
export function setState(viewer, line) {
    const said = new URLSearchParams(line);
    const numbers = (name) => (said.get(name) || '').split(',').map(Number);
    const [frame, fov, camera] = ['frame', 'fov', 'camera'].map(
        (name) => Number(said.get(name) || 0));
    const [eye, target, up] = ['eye', 'target', 'up'].map(numbers);
    const isPlace = fov > 0 && fov < 180 && [eye, target, up].every(
        (v) => v.length === 3 && v.every(Number.isFinite));

    if (!viewer.info || !Number.isFinite(frame) ||
        !(isPlace || said.has('camera') || said.has('frame')))
        return false;
    if (isPlace)
        viewer.goToKey({ frame, fov, eye, target, up });
    else if (Number.isInteger(camera))
        viewer.selectCamera(camera);
    viewer.seek(frame);
    return true;
}
