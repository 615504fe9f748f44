// SPDX-License-Identifier: MIT

/** An error whose message is a sentence for the user. Control characters in
 * it, from names or servers, are written as \u{1b}. */
export class SagaError extends Error {
    /** A saga_status of saga.h, an HTTP status, or 0 if there is neither. */
    status: number;
}

/** An object from which the bytes of a file are read. */
export interface SagaSource {
    /** The file's name for messages. */
    readonly name: string;
    /** The file's size in bytes; NaN until it is known. */
    readonly size: number;
    /** Number of bytes that have arrived so far. */
    readonly fetched: number;
    /** Reads bytes. It returns fewer than nbytes only at the end of the
     * file. */
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

/** The compiled decoder. */
export function loadModule(options?: {
    simd?: boolean;
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
    /** The largest number of primitives in any segment. */
    maxPrimitives: number;
    /** The bits of the header's field `tools`, as docs/bitstream.md lists
     * them. */
    tools: number;
    /** A position in the capture's unit of length is centre + unit * box
     * units. */
    unit: number;
    centre: [number, number, number];
}

export interface SagaCamera {
    /** The number that the capture gave the camera. */
    number?: number;
    /** The name that the capture gave the camera; "" if the file does not state
     * it. */
    name?: string;
    /** The 22 integers of saga_camera in saga.h, in its order. */
    values: Int32Array;
}

/** From where a film looks well: a sector of a ball around the pivot. An eye of
 * azimuth a, elevation e and distance d is at pivot + d (cos e (cos a front +
 * sin a side) + sin e up), with side = up x front. Positions and distances are
 * in the capture's unit, angles in radians. */
export interface SagaViewingVolume {
    pivot: number[];
    /** The least and the largest distance of the eye from the pivot. */
    distance: [number, number];
    /** Height of the floor above the pivot, along up; null if unknown. */
    floor: number | null;
    up: number[];
    front: number[];
    /** The largest magnitude of the azimuth; pi is all round. */
    azimuth: number;
    /** The least and the largest elevation. */
    elevation: [number, number];
    /** How far the eye may look away from the pivot. */
    turn: number;
    /** The camera of the rig with which a player begins. */
    start: number;
    /** The expected PSNR in dB: at the cameras that were trained on, and half
     * way between neighbours, which held-out cameras have; 0 if unknown. */
    quality: [number, number];
}

export interface SagaSegment {
    number: number;
    firstFrame: number;
    nFrames: number;
    offset: number;
    nbytes: number;
    /** The wanted time within the segment, 0..65535. */
    t: number;
}

export interface SagaPicture {
    width: number;
    height: number;
    /** The picture's rows of R, G, B: a view of the decoder's memory, valid
     * until the next call. */
    rgb: Uint8Array;
    /** The same picture with an alpha of 255. */
    rgba: Uint8Array;
    nPrimitives: number;
    /** Number of primitives seen from the camera. */
    nSplats: number;
}

/** The input from which a graphics processor draws a picture; see gpu.js. */
export interface SagaSplats {
    width: number;
    height: number;
    nPrimitives: number;
    nSplats: number;
    /** The tools of the file, which say how splats fall off. */
    tools: number;
    /** The background's R, G, B, 0..1. */
    background: number[];
    /** An array of saga_splat of saga.h, nearest first: a view of the decoder's
     * memory, valid until the next call. */
    bytes: Uint8Array;
}

/** An open file. Its calls wait for each other. Whatever it throws because of
 * the file, its source or a wrong argument is a SagaError. */
export class SagaFile {
    static open(
        source: string | URL | Blob | Uint8Array | SagaSource,
        options?: {
            module?: WebAssembly.Module;
            /** Limit in seconds for decoding the head or a segment; default
             * 30. */
            seconds?: number;
        },
    ): Promise<SagaFile>;

    readonly info: SagaInfo;
    readonly rig: SagaCamera[];
    readonly segments: SagaSegment[];
    /** Null if the file has none, or if it is damaged. */
    readonly viewingVolume: SagaViewingVolume | null;
    readonly source: SagaSource;
    /** Milliseconds that the last segment, view and picture took. */
    readonly times: { segment: number; view: number; draw: number };

    /** Whether the file has a sound; the sound may be damaged. */
    readonly hasSound: boolean;

    /** Fetches the film's sound. Returns null if there is none, else the time
     * of the film at which it begins, in seconds, and an Ogg stream of Opus.
     * Rejects if the sound is damaged. */
    sound(): Promise<{ start: number; bytes: Uint8Array } | null>;

    /** Returns the segment that holds the time num / den, in frames. */
    find(num: number, den: number): SagaSegment;

    /** Returns the bytes of a segment, which are fetched only once. It may be
     * called ahead of time. */
    fetchSegment(number: number): Promise<Uint8Array>;

    /** The start of the file, from which it was opened: to the end of the
     * cameras' names. */
    readonly head: Uint8Array;

    /** Decodes a segment, unless it is already decoded. */
    decode(number: number): Promise<void>;

    /** Returns a copy of the decoder with its segment. `adopt` of another
     * SagaFile that was opened from the same head takes it, so that a worker
     * can decode ahead of time. ms: the time that decoding took. */
    block(): Uint8Array;
    adopt(number: number, block: Uint8Array, ms?: number): void;

    /** Draws the picture at the time num / den in frames; both are integers. */
    draw(camera: SagaCamera, num: number, den?: number): Promise<SagaPicture>;

    /** Makes the splats of a picture instead of its pixels. */
    splats(camera: SagaCamera, num: number, den?: number): Promise<SagaSplats>;

    /** Returns the segment's primitives at a time as Gaussians in the capture's
     * units, with the colours that the camera sees. bytes has four planes of
     * four floats for each primitive: mean and opacity; standard deviations;
     * quaternion w, x, y, z; colour. Invisible ones have an opacity of nearly 0
     * and keep their places: an engine that sorts later may draw them in the
     * order of another time of the same segment. */
    gaussians(camera: SagaCamera, num: number, den?: number): Promise<
        Pick<SagaSplats, 'nPrimitives' | 'nSplats' | 'tools' | 'bytes'>>;

    /** Returns the CRC-32C of the last picture's rgb, as 8 hexadecimal
     * digits. */
    crc(): string;
}
