// SPDX-License-Identifier: MIT
import type { Viewer } from './viewer.js';

/** Whether the browser shows pages in a headset. */
export function hasHeadset(): Promise<boolean>;
/** Shows the viewer's film there, at a click or key; the viewer's pictures come
 * back with the session's `end`. */
export function enterHeadset(viewer: Viewer): Promise<EventTarget>;
