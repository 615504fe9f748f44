// SPDX-License-Identifier: MIT
import type { SagaCamera, SagaInfo } from './saga.js';
import type { Viewer } from './viewer.js';

/** The element <saga-player src autoplay loop camera poster controls muted
 * preload crossorigin draw="exact" background="transparent" bounds="off">. Events of a
 * video: loadstart, durationchange, loadedmetadata; loadeddata and canplay when
 * the first picture is drawn; play, pause, ended, timeupdate, seeking, seeked,
 * ratechange, volumechange; waiting when a segment is late, and playing when it
 * has come; progress, whose detail is { segment, got, nbytes }, in bytes, with
 * segment -1 for the head; error, whose detail is a sentence. And
 * camerachange. */
export class SagaPlayer extends HTMLElement {
    /** The viewer that draws in the element; it has paths, sizes, and the last
     * picture's numbers. */
    readonly viewer: Viewer;
    readonly info: SagaInfo | null;
    readonly rig: SagaCamera[];
    readonly paused: boolean;
    readonly ended: boolean;
    /** Whether the picture of the last seek is still to come. */
    readonly seeking: boolean;
    /** 0: no file; 1: no picture of this time; 3: this segment is here; 4: all
     * segments are. */
    readonly readyState: number;
    /** The times whose segments are here, in seconds. */
    readonly buffered: TimeRanges;
    /** Why the film cannot be shown, with the codes of MediaError; or null. */
    readonly error: { code: number; message: string } | null;
    /** "none": nothing is fetched before play(); else the head and the first
     * segment are as soon as the element is seen. */
    preload: string;
    /** "use-credentials": requests to other servers have cookies. */
    crossOrigin: string | null;
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
    /** Resolves when the film plays; rejects if it cannot be opened, is paused
     * before, or another film is to be shown. A film without sound that is not seen plays when it is. */
    play(): Promise<void>;
    /** Also calls off play() and autoplay of a film that is not open yet. */
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
