// SPDX-License-Identifier: MIT
//
// Mouse, pen and fingers on a viewer's canvas: a drag orbits, with shift or
// another button it pans; the wheel and two fingers move nearer or farther.
// Arrow keys orbit; W, S, A, D, Q, E move the camera.

import { heightOf, widthOf } from './camera.js';

const TURN = Math.PI;      // radians for a drag across the canvas
const STEP = Math.PI / 36; // radians for an arrow key
const STRIDE = 24;         // pixels for a key that moves the camera
const NEARER = 0.92;
const SLOP = 10;           // pixels by which a finger moves until the browser
                           // knows whether it scrolls the page

// Keys without a modifier move the camera.
const MOVES = {
    ArrowLeft: (viewer) => viewer.orbit(-STEP, 0),
    ArrowRight: (viewer) => viewer.orbit(STEP, 0),
    ArrowUp: (viewer) => viewer.orbit(0, -STEP),
    ArrowDown: (viewer) => viewer.orbit(0, STEP),
    w: (viewer) => viewer.dolly(NEARER),
    s: (viewer) => viewer.dolly(1 / NEARER),
    a: (viewer) => viewer.pan(STRIDE, 0),
    d: (viewer) => viewer.pan(-STRIDE, 0),
    q: (viewer) => viewer.pan(0, -STRIDE),
    e: (viewer) => viewer.pan(0, STRIDE),
};

// Moves the camera if the key does so; returns whether it does.
export function moveByKey(viewer, key) {
    const move = MOVES[key.length === 1 ? key.toLowerCase() : key];

    if (move)
        move(viewer);
    return Boolean(move);
}

export function addControls(viewer, element) {
    const pointers = new Map(); // id -> { x, y, waits }; waits: a finger that
                                // may still scroll the page

    // The middle and the spread of the touching pointers.
    const gauge = () => {
        const all = [...pointers.values()];
        const x = all.reduce((sum, p) => sum + p.x, 0) / all.length;
        const y = all.reduce((sum, p) => sum + p.y, 0) / all.length;
        const spread = all.length < 2 ? 0
            : Math.hypot(all[0].x - all[1].x, all[0].y - all[1].y);

        return { x, y, spread };
    };
    const perPixel = () => {
        const { clientWidth, clientHeight } = viewer.canvas;

        return Math.max(widthOf(viewer.lens) / (clientWidth || 1),
            heightOf(viewer.lens) / (clientHeight || 1));
    };

    const across = () => Math.max(element.clientWidth, element.clientHeight);

    element.addEventListener('pointerdown', (event) => {
        if (!viewer.info)
            return;
        element.setPointerCapture(event.pointerId);
        viewer.bounds.hold(element);
        pointers.set(event.pointerId, { x: event.clientX, y: event.clientY,
            waits: event.pointerType === 'touch' });
        event.preventDefault();
    });

    element.addEventListener('pointermove', (event) => {
        if (!viewer.info || !pointers.has(event.pointerId))
            return;
        const { x, y, waits } = pointers.get(event.pointerId);
        const isHeld = waits && pointers.size === 1;
        const before = gauge();

        if (isHeld && Math.hypot(event.clientX - x, event.clientY - y) < SLOP)
            return;
        pointers.set(event.pointerId, { x: event.clientX, y: event.clientY });
        if (isHeld)
            return; // if it scrolls, the browser ends its events now
        const now = gauge();
        const dx = now.x - before.x, dy = now.y - before.y;

        if (event.shiftKey || event.buttons > 1 || pointers.size > 1)
            viewer.pan(dx * perPixel(), dy * perPixel());
        else
            viewer.orbit(-dx / across() * TURN, -dy / across() * TURN);
        if (pointers.size > 1 && before.spread && now.spread)
            viewer.dolly(before.spread / now.spread);
    });

    for (const end of ['pointerup', 'pointercancel'])
        element.addEventListener(end, (event) => {
            pointers.delete(event.pointerId);
            if (!pointers.size)
                viewer.bounds.letGo(element);
        });

    element.addEventListener('wheel', (event) => {
        if (!viewer.info)
            return;
        event.preventDefault();
        viewer.dolly(Math.exp(Math.max(-0.5, Math.min(0.5,
            event.deltaY * (event.deltaMode ? 0.05 : 0.0015)))));
    }, { passive: false });

    element.addEventListener('contextmenu', (event) =>
        event.preventDefault());
}
