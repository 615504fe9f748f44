// SPDX-License-Identifier: MIT

/** An error with a sentence for the user. */
export class SagaError extends Error {
    /** A saga_status of saga.h, an HTTP status, or 0. */
    status: number;
}

/** Where the bytes of a file come from. */
export interface SagaSource {
    /** The name for messages. */
    readonly name: string;
    /** The size in bytes; NaN until it is known. */
    readonly size: number;
    /** Number of bytes that have come so far. */
    readonly fetched: number;
    /** Returns fewer bytes only at the end of the file. */
    read(offset: number, nbytes: number): Promise<Uint8Array>;
}

export class BytesSource implements SagaSource {
    constructor(bytes: Uint8Array, name?: string);
    readonly name: string;
    readonly size: number;
    readonly fetched: number;
    read(offset: number, nbytes: number): Promise<Uint8Array>;
}

export class BlobSource implements SagaSource {
    constructor(blob: Blob);
    readonly name: string;
    readonly size: number;
    readonly fetched: number;
    read(offset: number, nbytes: number): Promise<Uint8Array>;
}

/** Reads by HTTP ranges; if the server has none, reads the whole file. */
export class HttpSource implements SagaSource {
    constructor(url: string | URL);
    readonly name: string;
    readonly size: number;
    readonly fetched: number;
    read(offset: number, nbytes: number): Promise<Uint8Array>;
}

/** Whether the decoder with SIMD can be used here. */
export function hasSimd(): boolean;

/** The compiled decoder; `base` is where the .wasm files lie. */
export function loadModule(options?: {
    simd?: boolean;
    base?: string | URL;
}): Promise<WebAssembly.Module>;

export interface SagaInfo {
    version: number;
    level: number;
    workNbytes: number;
    headNbytes: number;
    nSegments: number;
    nFrames: number;
    fpsNum: number;
    fpsDen: number;
    /** Frames a second. */
    fps: number;
    nCameras: number;
    /** The maximum over all segments. */
    maxPrimitives: number;
    /** Bits of the header: docs/bitstream.md. */
    tools: number;
    /** The capture's unit: centre + unit * box units. */
    unit: number;
    centre: [number, number, number];
}

export interface SagaCamera {
    /** The number that the capture gives it. */
    number?: number;
    /** What the capture calls it; "" if the file does not say. */
    name?: string;
    /** The 22 integers of saga_camera in saga.h, in its order. */
    values: Int32Array;
}

export interface SagaSegment {
    number: number;
    firstFrame: number;
    nFrames: number;
    offset: number;
    nbytes: number;
    /** Of the wanted time in it, 0..65535. */
    t: number;
}

export interface SagaPicture {
    width: number;
    height: number;
    /** Rows of R, G, B; a view of the decoder's memory until the next call. */
    rgb: Uint8Array;
    /** The same picture with an alpha of 255. */
    rgba: Uint8Array;
    nPrimitives: number;
    /** Number of primitives seen from the camera. */
    nSplats: number;
}

/** What a graphics processor makes a picture of: see gpu.js. */
export interface SagaSplats {
    width: number;
    height: number;
    nPrimitives: number;
    nSplats: number;
    /** The file's, which say how they fall off. */
    tools: number;
    /** R, G, B, 0..1. */
    background: number[];
    /** An array of saga_splat of saga.h, nearest first; a view of the decoder's
     * memory until the next call. */
    bytes: Uint8Array;
}

/** An open file. It draws one picture at a time. */
export class SagaFile {
    static open(
        source: string | URL | Blob | Uint8Array | SagaSource,
        options?: {
            module?: WebAssembly.Module;
            /** Seconds that decoding the head or a segment may take; 30. */
            seconds?: number;
        },
    ): Promise<SagaFile>;

    readonly info: SagaInfo;
    readonly rig: SagaCamera[];
    readonly segments: SagaSegment[];
    readonly source: SagaSource;
    /** Milliseconds of the last segment, view and picture. */
    readonly times: { segment: number; view: number; draw: number };

    /** Whether there is a sound; it may be damaged. */
    readonly hasSound: boolean;

    /** The film's sound, fetched now, or null: the time of the film at which it
     * begins, in seconds, and an Ogg stream of Opus. Rejects if damaged. */
    sound(): Promise<{ start: number; bytes: Uint8Array } | null>;

    /** The segment that shows the time num / den, in frames. */
    find(num: number, den: number): SagaSegment;

    /** The bytes of a segment, fetched once; call it ahead of time too. */
    fetchSegment(number: number): Promise<Uint8Array>;

    /** What it was opened from: the file's first bytes. */
    readonly head: Uint8Array;

    /** Decodes a segment, unless it is decoded. */
    decode(number: number): Promise<void>;

    /** The decoder with its segment, for `adopt` of an instance opened from the
     * same head, in a worker for example: decoding ahead of time. ms: what it
     * took. */
    block(): Uint8Array;
    adopt(number: number, block: Uint8Array, ms?: number): void;

    /** The picture at the time num / den, in frames; both are integers. */
    draw(camera: SagaCamera, num: number, den?: number): Promise<SagaPicture>;

    /** The splats of that picture instead. */
    splats(camera: SagaCamera, num: number, den?: number): Promise<SagaSplats>;

    /** The primitives of a time as Gaussians in the capture's units, in the
     * colours that the camera sees. bytes: of four planes of four floats each:
     * mean, opacity; standard deviations; quaternion w, x, y, z; colour. */
    gaussians(camera: SagaCamera, num: number, den?: number): Promise<
        Pick<SagaSplats, 'nPrimitives' | 'nSplats' | 'tools' | 'bytes'>>;

    /** CRC-32C of the last picture's rgb, 8 digits. */
    crc(): string;
}
