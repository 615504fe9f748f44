// SPDX-License-Identifier: MIT
import type { SagaCamera, SagaInfo } from './saga.js';
import type { Viewer } from './viewer.js';

/** <saga-player src autoplay loop camera poster controls muted draw="exact">.
 * Events: loadeddata, play, pause, ended, timeupdate, ratechange, volumechange,
 * camerachange;
 * waiting and playing where a segment is late and has come; progress, whose
 * detail is { segment, got, nbytes }, segment -1 for the head; error, whose
 * detail is a sentence. */
export class SagaPlayer extends HTMLElement {
    /** What is below the element: paths, sizes, the last picture's numbers. */
    readonly viewer: Viewer;
    readonly info: SagaInfo | null;
    readonly rig: SagaCamera[];
    readonly paused: boolean;
    /** Seconds; NaN while nothing is open. */
    readonly duration: number;
    /** Seconds. */
    currentTime: number;
    playbackRate: number;
    muted: boolean;
    /** Volume of the sound, 0 to 1. */
    volume: number;
    src: string;
    /** Index of a camera of the rig, from 0; -1 if it was moved. */
    camera: number;

    open(source: string | File): Promise<void>;
    play(): void;
    pause(): void;
    /** Returns camera and time as a line, to share a view. */
    toState(): string;
    /** Sets a view from such a line; returns whether it had one. */
    setState(line: string): boolean;
}

declare global {
    interface HTMLElementTagNameMap {
        'saga-player': SagaPlayer;
    }
}
