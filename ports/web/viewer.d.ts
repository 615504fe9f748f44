// SPDX-License-Identifier: MIT
import type { SagaCamera, SagaInfo, SagaSegment } from './saga.js';

/** In the capture's units. */
export interface KeyCamera {
    /** Of the path. */
    seconds: number;
    /** Of the file. */
    frame: number;
    eye: number[];
    target: number[];
    up: number[];
    /** Vertical, degrees. */
    fov: number;
}

/** A canvas that shows a file, drawn in a worker. Events: `opened`, `change`,
 * `drawn`, and `failed`, whose detail is a sentence. Until a file is open, what
 * would change its camera or time does nothing; setScale holds. */
export class Viewer extends EventTarget {
    constructor(canvas: HTMLCanvasElement, options?: {
        simd?: boolean;
        /** That decoding a segment may take; 30. */
        seconds?: number;
    });

    readonly info: SagaInfo | null;
    readonly rig: SagaCamera[];
    readonly segments: SagaSegment[];
    readonly name: string;
    /** In frames. */
    readonly frame: number;
    readonly playing: boolean;
    /** Whether the camera is none of the rig's any more. */
    readonly moved: boolean;
    /** Of the picture, relative to the camera's. */
    readonly scale: number;
    /** The last picture's numbers. */
    readonly drawn: {
        width: number;
        height: number;
        nPrimitives: number;
        nSplats: number;
        crc: string | null;
        num: number;
        den: number;
        values: Int32Array;
        segment: number;
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
    /** Radians. */
    orbit(yaw: number, pitch: number): void;
    dolly(factor: number): void;
    /** Pixels of the picture. */
    pan(dx: number, dy: number): void;
    /** The camera as it is; null while nothing is open. */
    key(seconds?: number): KeyCamera | null;
    goToKey(key: KeyCamera): void;
    seek(frame: number): void;
    play(): void;
    pause(): void;
    playPath(keys: KeyCamera[]): void;
}
