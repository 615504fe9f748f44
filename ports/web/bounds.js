// SPDX-License-Identifier: MIT
//
// Keeps a viewer's camera in the film's viewing volume, softly: the farther a
// drag leads outside, the less it moves, and a spring pulls the camera back
// when it ends. Cameras of the rig, paths and shared views may be anywhere.

import { forwardOf } from './camera.js';
import { expectedPsnr, nearer, outside, partOf } from './volume.js';

const WAIT_MS = 150;   // from the last move until the spring pulls
const SPRING_MS = 120; // in which it pulls all but 1/e of the way
const NEAR = 0.002;    // radians that it goes in a last step
const ROUNDING = 1e-6; // radians; of a camera on the volume's surface

export class Bounds {
    constructor(viewer) {
        this.viewer = viewer;
        this.isOn = true;
        this.holders = new Set(); // fingers or a tilted device: what holds the
                                  // camera, so that the spring waits
        this.isLed = false;       // the user has moved the camera
        this.timer = 0;
    }

    hold(by) {
        this.holders.add(by);
    }

    letGo(by) {
        this.holders.delete(by);
        this.release();
    }

    // How far outside a pose is, in radians; 0 is inside.
    outOf({ centre, rotation }) {
        const { viewer } = this, volume = viewer.viewingVolume;
        const out = volume && this.isOn ? outside(volume,
            viewer.toMetres(centre), forwardOf({ rotation })) : 0;

        return out > ROUNDING ? out : 0;
    }

    // How far outside the user has moved the camera; a path may lead anywhere,
    // and a shared view be anywhere.
    get out() {
        const { viewer } = this;

        return this.isLed && !viewer.path ? this.outOf(viewer.pose) : 0;
    }

    // The PSNR in dB that may be expected from the camera's place, if all
    // cameras of the rig were trained on and if those near here were not, which
    // the file does not say. Each is null if it is unknown.
    get expected() {
        return this.expectedOf(this.viewer.rig);
    }

    get leastExpected() {
        return this.viewer.viewingVolume?.quality[1] ? this.expectedOf([])
            : null;
    }

    expectedOf(trained) {
        const { viewer } = this, volume = viewer.viewingVolume;
        const eyes = trained.map(({ values }) =>
            viewer.toMetres(Array.from(values.slice(9, 12))));

        return volume && expectedPsnr(volume, eyes,
            viewer.toMetres(viewer.pose.centre));
    }

    // Returns the pose after a step of the user. step: returns the pose after a
    // part of it.
    softened(step) {
        this.isLed = true;
        this.release();
        return step(partOf(this.outOf(this.viewer.pose), this.outOf(step(1))));
    }

    // Pulls the camera back, unless it is held or moved before.
    release() {
        clearTimeout(this.timer);
        this.timer = setTimeout(() => this.pull(performance.now()), WAIT_MS);
    }

    clear() {
        clearTimeout(this.timer);
        this.timer = 0;
    }

    pull(since) {
        const { viewer, timer } = this;

        if (this.holders.size || viewer.path || !viewer.info || !this.out)
            return;
        viewer.nextFrame((now) => {
            const { out } = this;

            if (timer !== this.timer || !out)
                return;
            this.move(out < NEAR ? 1
                : 1 - Math.exp(-Math.max(0, now - since) / SPRING_MS));
            if (out >= NEAR)
                this.pull(now);
        });
    }

    move(share) {
        const { viewer } = this, { rotation, centre } = viewer.pose;
        const pose = nearer(viewer.viewingVolume,
            { rotation, centre: viewer.toMetres(centre) }, share);

        viewer.setPose({ ...pose, centre: viewer.toUnits(pose.centre) });
        viewer.findPivot();
    }
}
