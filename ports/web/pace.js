// SPDX-License-Identifier: MIT
//
// Finds the size at which sixty pictures a second are shown, as a fraction of
// the window's size. It uses only the times at which pictures came.

const SLOW_MS = 22, FAST_MS = 17.5; // intervals between two pictures
const FEW = 6, MANY = 60;           // number of slow or fast pictures, until
                                    // the size changes
const LEAST = 0.35;
const GAIN = 0.9; // the smallest pictures must come in this part of the time

export class Pace {
    constructor() {
        this.scale = 1;
        this.hold = MANY;  // fast pictures until a larger one is tried
        this.helps = true; // whether smaller pictures come sooner
        this.pause();
    }

    // Stops the measurement, when nothing moves any more.
    pause() {
        this.last = null;
        this.slow = this.fast = this.passed = 0;
    }

    // Notes that a picture came at the time `now`, and that the worker took
    // `worked` for it, both in ms. If the worker takes most of the time,
    // smaller pictures do not help.
    note(now, worked) {
        const passed = this.last === null ? 0 : now - this.last;

        this.last = now;
        if (passed > SLOW_MS && passed > 2 * worked) {
            this.fast = 0;
            this.passed += passed;
            if (++this.slow >= FEW)
                this.shrink(this.passed / this.slow);
        } else if (passed > 0 && passed < FAST_MS) {
            this.slow = this.passed = 0;
            this.helps = true;
            if (++this.fast >= this.hold)
                this.grow();
        }
    }

    // Makes pictures smaller, which came at intervals of this mean. If a size
    // was too large just after it grew, the next attempt to grow comes later. A
    // telephone that saves power shows 30 pictures a second, however small they
    // are; it gets sharp ones, until they come still later.
    shrink(mean) {
        this.slow = this.passed = 0;
        if (!this.helps && mean < this.mean / GAIN)
            return;
        if (this.scale === 1)
            this.mean = mean;
        this.helps = this.scale > LEAST || mean < GAIN * this.mean;
        if (this.grew)
            this.hold = Math.min(64 * MANY, 2 * this.hold);
        this.grew = false;
        this.scale = this.helps ? Math.max(LEAST, this.scale * 0.8) : 1;
    }

    grow() {
        this.grew = this.scale < 1;
        this.scale = Math.min(1, this.scale / 0.8);
        this.fast = 0;
    }
}
