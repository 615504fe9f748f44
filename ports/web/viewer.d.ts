// SPDX-License-Identifier: MIT
import type { SagaCamera, SagaInfo, SagaSegment } from './saga.js';

/** A key camera, in the capture's units. */
export interface KeyCamera {
    /** Time of the path. */
    seconds: number;
    /** Frame of the file. */
    frame: number;
    eye: number[];
    target: number[];
    up: number[];
    /** Vertical field of view, degrees. */
    fov: number;
}

/** A canvas that shows a file, decoded in a worker and drawn by the graphics
 * processor or, with exact, by the decoder. Events: `opened`, `change`,
 * `drawn`, `ended`; `waiting` and `resumed` when a segment is late and when it
 * has come; `progress`, with { segment, got, nbytes }; `sound`, after askSound;
 * and `failed`, whose detail is a sentence. Until a file is open, calls that
 * would change its camera or time do nothing; setScale applies. */
export class Viewer extends EventTarget {
    constructor(canvas: HTMLCanvasElement, options?: {
        exact?: boolean;
        simd?: boolean;
        /** Limit in seconds for decoding a segment; default 30. */
        seconds?: number;
    });

    readonly info: SagaInfo | null;
    readonly rig: SagaCamera[];
    readonly segments: SagaSegment[];
    readonly hasSound: boolean;
    readonly name: string;
    /** Time in frames. */
    readonly frame: number;
    readonly playing: boolean;
    /** A segment is late; the clock stands. */
    readonly waiting: boolean;
    /** Whether the camera is none of the rig's any more. */
    readonly moved: boolean;
    /** Of an exact picture, relative to the camera's. */
    readonly scale: number;
    /** Whether the decoder draws; always where there is no WebGL2. */
    readonly exact: boolean;
    /** Whether pictures have the size that setRoom gave. */
    readonly fills: boolean;
    /** Whether it begins anew at the end; true. */
    loop: boolean;
    /** Of time; 1. */
    rate: number;
    /** The last picture's numbers. */
    readonly drawn: {
        width: number;
        height: number;
        nPrimitives: number;
        nSplats: number;
        /** Drawn by the graphics processor. */
        gpu: boolean;
        /** Of an exact picture. */
        crc: string | null;
        num: number;
        den: number;
        values: Int32Array;
        segment: number;
        /** Whether it was decoded ahead of time. */
        ahead: boolean;
        times: { segment: number; view: number; draw: number };
        fetched: number;
        size: number;
        /** Segments that need not be fetched again. */
        kept: number[];
    } | null;
    /** Whether pictures come with their CRC. */
    wantCrc: boolean;

    open(source: string | File): Promise<void>;
    selectCamera(index: number): void;
    setScale(scale: number): void;
    setExact(exact: boolean): void;
    /** Pixels of the window, which the graphics processor fills. */
    setRoom(width: number, height: number): void;
    /** The picture on the canvas. */
    read(): ImageData;
    /** Camera and time in a line. */
    toState(): string;
    /** Sets a view from such a line; returns whether it had one. */
    setState(line: string): boolean;
    /** Radians. */
    orbit(yaw: number, pitch: number): void;
    dolly(factor: number): void;
    /** Pixels of the picture. */
    pan(dx: number, dy: number): void;
    /** The camera as it is; null while nothing is open. */
    key(seconds?: number): KeyCamera | null;
    goToKey(key: KeyCamera): void;
    seek(frame: number): void;
    /** Fetches the film's sound for the event `sound`, whose detail is
     * { start, bytes }, or null if the sound is damaged; sound.js plays it. */
    askSound(): void;
    play(): void;
    pause(): void;
    playPath(keys: KeyCamera[]): void;
}
