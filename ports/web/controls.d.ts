// SPDX-License-Identifier: MIT
import type { Viewer } from './viewer.js';

/** Moves the camera if a key (KeyboardEvent.key) does so; returns whether it
 * does. */
export function moveByKey(viewer: Viewer, key: string): boolean;

/** Lets mouse, wheel and touch on an element move the viewer's camera. */
export function addControls(viewer: Viewer, element: HTMLElement): void;
