// SPDX-License-Identifier: MIT
import type { Viewer } from './viewer.js';

/** Returns whether the browser can show the page's pictures in a headset. */
export function hasHeadset(): Promise<boolean>;
/** Shows the viewer's film in the headset. It must be called at a click or key.
 * At the `end` event of the session the pictures return to the viewer's
 * canvas. */
export function enterHeadset(viewer: Viewer): Promise<EventTarget>;
