// SPDX-License-Identifier: MIT
//
// The viewing volume of a film: from where it looks well. It is a sector of a
// ball around a pivot, in azimuth, elevation and distance (docs/bitstream.md,
// section 13). Positions are in the capture's unit, angles in radians.

import { add, cross, dollied, dot, forwardOf, norm, sub, times, turnedAbout,
    unit } from './camera.js';

const MOST = 0.35; // radians that an eye can be pulled outside
const WORSE = 20;  // dB lost per radian outside the volume, a guess

// Returns the level direction of an azimuth.
function levelAt({ up, front }, azimuth) {
    return add(times(front, Math.cos(azimuth)),
        times(cross(up, front), Math.sin(azimuth)));
}

// Returns the position of an eye { azimuth, elevation, distance }.
export function eyeAt(volume, { azimuth, elevation: e, distance }) {
    const { pivot, up } = volume;

    return add(pivot, times(add(times(levelAt(volume, azimuth), Math.cos(e)),
        times(up, Math.sin(e))), distance));
}

// Returns { azimuth, elevation, distance } of an eye.
export function placeOf(volume, eye) {
    const { pivot, up, front } = volume;
    const off = sub(eye, pivot), height = dot(off, up);
    const x = dot(off, front), y = dot(off, cross(up, front));

    return { azimuth: Math.atan2(y, x),
        elevation: Math.atan2(height, Math.hypot(x, y)), distance: norm(off) };
}

// Returns the place inside the volume that is nearest in each of the three.
export function inside(volume, { azimuth, elevation, distance }) {
    const within = (x, [least, most]) => Math.max(least, Math.min(most, x));

    return { azimuth: within(azimuth, [-volume.azimuth, volume.azimuth]),
        elevation: within(elevation, volume.elevation),
        distance: within(distance, volume.distance) };
}

// Returns how far an eye that looks `forward` is outside, as an angle: of the
// way to the volume as seen from the pivot, of the logarithm of the distance,
// and of what it looks past the pivot more than it should. 0 is inside.
export function outside(volume, eye, forward) {
    const at = placeOf(volume, eye), to = inside(volume, at);

    return Math.hypot((at.azimuth - to.azimuth) * Math.cos(at.elevation),
        at.elevation - to.elevation,
        Math.log((at.distance || 1) / (to.distance || 1)),
        forward ? Math.max(0, lookOff(volume, eye, forward) - volume.turn) : 0);
}

// Returns the angle between the viewing direction and that to the pivot.
function lookOff({ pivot }, eye, forward) {
    const ahead = sub(pivot, eye);

    return Math.atan2(norm(cross(ahead, forward)), dot(ahead, forward));
}

// Returns how dark the edge of the picture should be: 0 inside the volume, 1
// where the eye can be pulled at most.
export const shade = (out) => Math.min(1, out / MOST);

// Returns the part that is made of a step from `before` to `after`, both from
// `outside`: the farther outside, the less of a step that leads away, and not
// much more than to the farthest, however large it is.
export const partOf = (before, after) => after <= before ? 1
    : Math.max(0, Math.min(1 - before / MOST,
        (MOST - before) / (after - before)));

// Returns the pose after it has gone a share of the way inside: it turns about
// the pivot, comes nearer or goes away, and turns about itself.
export function nearer(volume, pose, share) {
    const { pivot, up } = volume;
    const at = placeOf(volume, pose.centre), to = inside(volume, at);
    const round = share * (to.azimuth - at.azimuth);
    const level = levelAt(volume, at.azimuth + round);
    const there = dollied(turnedAbout(turnedAbout(pose, pivot, up, round),
        pivot, cross(level, up), share * (to.elevation - at.elevation)),
    pivot, ((to.distance || 1) / (at.distance || 1)) ** share);
    const { centre } = there, forward = forwardOf(there);
    const past = lookOff(volume, centre, forward) - volume.turn;

    return past <= 0 ? there : turnedAbout(there, centre,
        unit(cross(forward, sub(pivot, centre))), share * past);
}

// Returns the PSNR that may be expected at an eye, in dB, or null if the film
// does not say. It is quality[0] in the direction of a camera that was trained
// on, and quality[1] half way between two of them; between these it is linear
// in 2 a / (a + b), where a and b are the angles to the nearest ones. It falls
// outside the volume. eyes: positions of these cameras; without any it is
// quality[1] everywhere.
export function expectedPsnr(volume, eyes, eye) {
    const [at, between] = volume.quality;
    const ahead = unit(sub(eye, volume.pivot));
    const [a = 1, b = a] = eyes.map((p) => {
        const to = unit(sub(p, volume.pivot));

        return Math.atan2(norm(cross(ahead, to)), dot(ahead, to));
    }).sort((p, q) => p - q);

    if (!at)
        return null;
    return at + ((between || at) - at) * (a + b > 0 ? 2 * a / (a + b) : 0) -
        WORSE * outside(volume, eye);
}
