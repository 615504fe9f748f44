// SPDX-License-Identifier: MIT
import type { SagaCamera, SagaInfo } from './saga.js';
import type { Viewer } from './viewer.js';

/** The element <saga-player src autoplay loop camera poster controls muted
 * draw="exact">. Events: loadeddata, play, pause, ended, timeupdate,
 * ratechange, volumechange, camerachange; waiting when a segment is late, and
 * playing when it has come; progress, whose detail is { segment, got, nbytes },
 * in bytes, with segment -1 for the head; error, whose detail is a sentence. */
export class SagaPlayer extends HTMLElement {
    /** The viewer that draws in the element; it has paths, sizes, and the last
     * picture's numbers. */
    readonly viewer: Viewer;
    readonly info: SagaInfo | null;
    readonly rig: SagaCamera[];
    readonly paused: boolean;
    /** Duration in seconds; NaN while no file is open. */
    readonly duration: number;
    /** Time in seconds. */
    currentTime: number;
    playbackRate: number;
    muted: boolean;
    /** Volume of the sound, 0 to 1. */
    volume: number;
    src: string;
    /** Index of the camera in the rig, from 0; -1 if the user has moved the
     * camera. */
    camera: number;

    open(source: string | File): Promise<void>;
    play(): void;
    pause(): void;
    /** Returns camera and time as one line of text, to share a view. */
    toState(): string;
    /** Sets camera and time from such a line. Returns whether it had any. */
    setState(line: string): boolean;
}

declare global {
    interface HTMLElementTagNameMap {
        'saga-player': SagaPlayer;
    }
}
