// SPDX-License-Identifier: MIT
//
// Lets a viewer's picture follow the turns of a telephone, as if the scene were
// behind its glass: the camera goes to where the eye is as seen from the
// telephone. It begins where the camera is, and goes at most about LIMIT from
// there. Drags continue to work. The bounds of a film do not resist: the camera
// would no longer be where the device is held, and not return with it.

import { orbited } from './camera.js';

const LIMIT = 0.35;   // radians that the camera can turn, each way
const STILL = 0.002;  // radians; smaller turns are the trembling of a hand
const PATIENCE_MS = 1000; // time until a device without a sensor is noticed

const radians = (degrees) => degrees * Math.PI / 180;

// Returns whether this is a device that one turns in the hand. Only secure
// pages have its turns.
export const hasTilt = () => 'DeviceOrientationEvent' in globalThis &&
    isSecureContext && matchMedia('(pointer: coarse)').matches;

// Returns the rotation of the device's axes (right, top, out of the glass) to
// the earth's, as rows: Rz(alpha) Rx(beta) Ry(gamma), as the standard defines
// the event's angles.
export function rotationOf({ alpha, beta, gamma }) {
    const [a, b, g] = [alpha, beta, gamma].map(radians);
    const [ca, sa] = [Math.cos(a), Math.sin(a)];
    const [cb, sb] = [Math.cos(b), Math.sin(b)];
    const [cg, sg] = [Math.cos(g), Math.sin(g)];

    return [[ca * cg - sa * sb * sg, -cb * sa, ca * sg + cg * sa * sb],
        [cg * sa + ca * sb * sg, ca * cb, sa * sg - ca * cg * sb],
        [-cb * sg, sb, cb * cg]];
}

// Returns the angles { yaw, pitch } by which the camera turns. The eye stays in
// front of the glass as it was at `zero`: its direction in the device's axes is
// now^T zero (0, 0, 1). turn: degrees of the screen's orientation; at 90 the
// device's top is on the left.
export function turnOf(zero, now, turn) {
    const eye = [0, 1, 2].map((i) => zero.reduce(
        (sum, row, k) => sum + row[2] * now[k][i], 0));
    const c = Math.cos(radians(turn)), s = Math.sin(radians(turn));
    const right = c * eye[0] - s * eye[1], up = s * eye[0] + c * eye[1];
    const soft = (angle) => LIMIT * Math.tanh(angle / LIMIT);

    return { yaw: soft(Math.atan2(right, eye[2])),
        pitch: soft(Math.atan2(up, Math.hypot(right, eye[2]))) };
}

export class Tilt {
    constructor(viewer) {
        this.viewer = viewer;
        this.isOn = false;
        this.zero = null;                 // the rotation at which it began
        this.done = { yaw: 0, pitch: 0 }; // what the camera has turned since
        this.follow = (event) => this.note(event);
    }

    // Starts or ends; a browser may ask the user, which it does only in a
    // click. Rejects with an error that has a sentence.
    async toggle() {
        if (this.isOn) {
            this.stop();
            return;
        }
        if (await DeviceOrientationEvent.requestPermission?.() === 'denied')
            throw new Error('the browser does not allow it');
        this.isOn = true;
        this.zero = null;
        this.viewer.bounds.hold(this);
        addEventListener('deviceorientation', this.follow);
        await new Promise((resolve) => setTimeout(resolve, PATIENCE_MS));
        if (!this.isOn || this.zero)
            return;
        this.stop();
        throw new Error('the device does not say how it is turned');
    }

    // Turns the camera back.
    stop() {
        this.isOn = false;
        removeEventListener('deviceorientation', this.follow);
        if (this.viewer.moved)
            this.turnTo({ yaw: 0, pitch: 0 });
        this.done = { yaw: 0, pitch: 0 };
        this.viewer.bounds.letGo(this);
    }

    note(event) {
        const turn = screen.orientation?.angle ?? 0;

        if (event.alpha === null || event.beta === null)
            return;
        // A camera that was chosen is where the next turns begin.
        if (!this.zero || this.turn !== turn ||
            (!this.viewer.moved && (this.done.yaw || this.done.pitch))) {
            this.zero = rotationOf(event);
            this.turn = turn;
            this.done = { yaw: 0, pitch: 0 };
        }
        this.turnTo(turnOf(this.zero, rotationOf(event), turn));
    }

    turnTo({ yaw, pitch }) {
        const { viewer } = this;

        if (!viewer.info)
            return;
        const by = { yaw: yaw - this.done.yaw, pitch: pitch - this.done.pitch };

        if (Math.hypot(by.yaw, by.pitch) < STILL)
            return;
        this.done = { yaw, pitch };
        viewer.bounds.isLed = true;
        viewer.setPose(orbited(viewer.pose, viewer.pivot, viewer.up, by.yaw,
            -by.pitch));
    }
}
