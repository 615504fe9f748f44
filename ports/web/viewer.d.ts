// SPDX-License-Identifier: MIT
import type { SagaCamera, SagaInfo, SagaSegment, SagaViewingVolume }
    from './saga.js';

/** A key camera, in the capture's units. */
export interface KeyCamera {
    /** Time of the path in seconds. */
    seconds: number;
    /** Frame of the file that is shown then. */
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
    /** From where the film looks well; null if the file does not say. */
    readonly viewingVolume: SagaViewingVolume | null;
    readonly bounds: {
        /** Whether the camera is kept in the viewing volume; initially true. */
        isOn: boolean;
        /** How far outside the user has moved the camera, in radians. */
        readonly out: number;
        /** The PSNR that may be expected here, in dB, if all cameras of the rig
         * were trained on; null if unknown. */
        readonly expected: number | null;
        /** The same if the cameras near here were held out. */
        readonly leastExpected: number | null;
    };
    /** The camera of the rig with which the film begins. */
    readonly start: number;
    readonly name: string;
    /** Why nothing is shown, with the codes of MediaError; or null. */
    readonly error: { code: number; message: string } | null;
    /** For requests of a file, as for `fetch`. */
    credentials: RequestCredentials | undefined;
    /** Time in frames. */
    readonly frame: number;
    readonly playing: boolean;
    /** Whether a segment is late, so that the clock stands. */
    readonly waiting: boolean;
    /** Whether the camera was moved, so that it is no longer one of the rig. */
    readonly moved: boolean;
    /** Size of an exact picture, relative to the camera's picture. */
    readonly scale: number;
    /** Whether the decoder draws the pixels; always true without WebGL2. */
    readonly exact: boolean;
    /** Whether pictures have the size that setRoom gave. */
    readonly fills: boolean;
    /** Whether playback begins anew at the end; initially true. */
    loop: boolean;
    /** Rate of playback; initially 1. */
    rate: number;
    /** Numbers of the picture that was drawn last; null before the first one, and
     * while a player rests unseen. */
    readonly drawn: {
        width: number;
        height: number;
        nPrimitives: number;
        nSplats: number;
        /** Whether the graphics processor drew it. */
        gpu: boolean;
        /** CRC-32C of an exact picture. */
        crc: string | null;
        num: number;
        den: number;
        values: Int32Array;
        segment: number;
        /** Whether its segment was decoded ahead of time. */
        ahead: boolean;
        times: { segment: number; view: number; draw: number };
        fetched: number;
        size: number;
        /** Segments whose bytes are kept and need not be fetched again. */
        kept: number[];
    } | null;
    /** Whether the CRC of each exact picture is computed. */
    wantCrc: boolean;

    open(source: string | File): Promise<void>;
    selectCamera(index: number): void;
    setScale(scale: number): void;
    setExact(exact: boolean): void;
    /** Shows what is behind the canvas instead of the film's background, except
     * in exact pictures. */
    setTransparent(transparent: boolean): void;
    /** Sets the size of the window in pixels, which the graphics processor
     * fills. */
    setRoom(width: number, height: number): void;
    /** Returns the picture on the canvas. */
    read(): ImageData;
    /** Returns camera and time as one line of text. */
    toState(): string;
    /** Sets camera and time from such a line. Returns whether it had any. */
    setState(line: string): boolean;
    /** Turns the camera about its pivot by angles in radians. */
    orbit(yaw: number, pitch: number): void;
    dolly(factor: number): void;
    /** Moves the camera parallel to its picture, by pixels. */
    pan(dx: number, dy: number): void;
    /** Returns the present camera as a key camera; null while no file is
     * open. */
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
