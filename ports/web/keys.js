// SPDX-License-Identifier: MIT
//
// Keys that are pressed in a player.

import { moveByKey } from './controls.js';

const SKIP = 1; // seconds for an arrow key on the bar

// Seeks by a key that was pressed on the bar; returns whether it does that.
function seekByKey(player, key) {
    const { info, frame } = player.viewer;
    const skip = SKIP * info.fps;
    const to = { ArrowLeft: frame - skip, ArrowDown: frame - skip, Home: 0,
        ArrowRight: frame + skip, ArrowUp: frame + skip,
        End: info.nFrames - 1 }[key];

    if (to === undefined)
        return false;
    player.seek(to);
    return true;
}

// Handles keys of the element, and of a page that consists of a player.
export function pressKey(player, event) {
    const { viewer } = player;
    const [at] = event.composedPath();
    const onBar = event.composedPath().includes(player.$('bar'));
    const digit = Number(event.key);
    const calls = {
        ' ': () => player.toggle(),
        ',': () => player.step(-1),
        '.': () => player.step(1),
        f: () => player.toggleFull(),
        m: () => player.sound.toggle(),
        v: () => player.enterHeadset(),
        r: () => viewer.selectCamera(viewer.camera),
        g: () => viewer.setExact(!viewer.exact),
    };

    if (event.key === ' ' && !viewer.info && !onBar)
        player.toggle();
    if (!viewer.info || event.defaultPrevented || event.ctrlKey ||
        event.metaKey || event.altKey || at.matches?.('select') ||
        (at.matches?.('input') && at !== player.$('time')) ||
        (event.key === ' ' && at.matches?.('button')))
        return;
    if (onBar && seekByKey(player, event.key)) {
        event.preventDefault();
        return;
    }
    if (digit >= 1 && digit <= 9 && digit <= viewer.rig.length)
        viewer.selectCamera(digit - 1);
    else if (calls[event.key.toLowerCase()])
        calls[event.key.toLowerCase()]();
    else if (!moveByKey(viewer, event.key))
        return;
    event.preventDefault();
}
