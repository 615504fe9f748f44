// SPDX-License-Identifier: MIT
//
// A .saga file in JavaScript, decoded by the C decoder in WebAssembly with the
// same pixels as everywhere. The bytes of the file are fetched when they are
// needed.
//
//     const file = await SagaFile.open('scene.saga');
//     const picture = await file.draw(file.rig[0], 0);
//     picture.rgba, picture.width, picture.height, file.crc()
//
// Runs wherever WebAssembly does: page, worker or Node. Calls of one SagaFile
// wait for each other; saga.d.ts has the types.

import { GAUSSIAN_INTS, planesOf } from './gaussians.js';
import { entriesOf, nameCameras, readOptional, volumeOf }
    from './optional.js';
import { wasmAt } from './places.js';
import { BlobSource, BytesSource, HttpSource, SagaError, joined }
    from './source.js';

export { BlobSource, BytesSource, HttpSource, SagaError };

// Indices of the fields of saga_web.c's structures, in 32-bit integers.
const INFO = {
    version: 0, level: 1, workNbytes: 2, headNbytes: 3, nSegments: 4,
    nFrames: 5, fpsNum: 6, fpsDen: 7, nCameras: 8, maxPrimitives: 9,
    tools: 16,
};
const UNIT = 10, CENTRE = 12, CENTRE_EXPONENT = 15;
const SPLAT_NBYTES = 44;  // bytes of a saga_splat
const WIDTH = 17, BACKGROUND = 19; // indices in a camera's values
const CAMERA_LENGTH = 22; // number of a camera's values; the camera's number
                          // follows them

const ARG = -1;
const DATA = -10;
const TRUNCATED = -11;
const STOPPED = -21;
const SECONDS = 30; // default time limit for decoding
const SOUND_RATE = 48000; // units of a sound's start in a second
const FIRST_NBYTES = 4096; // bytes that hold the header and the rig of most
                           // files
const KEPT_SEGMENTS = 64;  // number of coded segments that are kept

// --- The module ------------------------------------------------------------

// A WebAssembly module with one SIMD instruction. Browsers that support SIMD
// accept it.
const SIMD_PROBE = new Uint8Array([
    0, 97, 115, 109, 1, 0, 0, 0, 1, 5, 1, 96, 0, 1, 123, 3, 2, 1, 0, 10, 10, 1,
    8, 0, 65, 0, 253, 15, 253, 98, 11,
]);

export function hasSimd() {
    return WebAssembly.validate(SIMD_PROBE);
}

// Returns the compiled decoder for SagaFile.open, also in workers.
export async function loadModule({ simd = hasSimd() } = {}) {
    const url = wasmAt(simd);
    const bytes = await bytesAt(url).catch(() => null);

    if (!bytes || !isWasm(bytes))
        throw new SagaError(`${url.href}: ` + (bytes ? 'is no WebAssembly'
            : 'cannot be fetched') + '; put saga.wasm and saga_simd.wasm ' +
            'beside saga.js, or set `places` of places.js to where they are');
    try {
        return await WebAssembly.compile(bytes);
    } catch (error) {
        throw new SagaError('the decoder may not be compiled ' +
            `(${error.message}); let the page's Content-Security-Policy have ` +
            "'wasm-unsafe-eval' in script-src");
    }
}

const isWasm = (bytes) =>
    new Uint8Array(bytes, 0, 4).join() === '0,97,115,109';

// Returns the bytes at a URL as an ArrayBuffer. Node's fetch does not read
// files; bundlers for browsers must not look for what does.
async function bytesAt(url) {
    if (url.protocol === 'file:' && globalThis.process) {
        const module = 'node:fs/promises';
        const { readFile } = await import(
            /* webpackIgnore: true */ /* @vite-ignore */ module);

        return Uint8Array.from(await readFile(url)).buffer;
    }
    const response = await fetch(url);

    return response.ok ? response.arrayBuffer() : null;
}

// --- A file ----------------------------------------------------------------

export class SagaFile {
    // source: a URL, a File or Blob, bytes, or an object like the sources
    // above. module: from loadModule, which is called if it is not given.
    // seconds: limit for decoding the head or a segment.
    static async open(source, { module, seconds = SECONDS } = {}) {
        const compiled = module || await loadModule();
        const file = await SagaFile.make(compiled, sourceOf(source), seconds);

        await file.readHead();
        return file;
    }

    // Makes an instance without a file.
    static async make(module, source, seconds) {
        const clock = { end: Infinity };
        const instance = await WebAssembly.instantiate(module,
            { env: { stop: () => Number(performance.now() > clock.end) } });

        return new SagaFile(module, instance.exports, source, seconds, clock);
    }

    constructor(module, wasm, source, seconds, clock) {
        this.module = module;
        this.wasm = wasm;
        this.source = source;
        this.seconds = seconds;
        this.clock = clock;        // the deadline, which the decoder asks for
        this.segment = -1;         // number of the decoded segment
        this.head = null;          // the start of the file, to the end of the
                                   // cameras' names
        this.last = Promise.resolve(); // the last call that decodes or draws
        this.coded = new Map();    // number -> promise of a segment's bytes
        this.here = new Set();     // numbers of the segments that have come
        this.times = { segment: 0, view: 0, draw: 0 }; // ms, of the last calls
    }

    ints(at, n) {
        return new Int32Array(this.wasm.memory.buffer, at, n);
    }

    bytes(at, n) {
        return new Uint8Array(this.wasm.memory.buffer, at, n);
    }

    // Throws unless the status is 0.
    check(status, what) {
        if (status === 0)
            return;
        if (status === STOPPED)
            throw new SagaError(`${this.source.name}: decoding took more ` +
                `than ${this.seconds} s; allow more with seconds=` +
                `${6 * this.seconds} in the address`, status);
        const at = this.wasm.saga_web_status_text(status);
        const text = this.bytes(at, 80);
        const why = String.fromCharCode(...text.subarray(0, text.indexOf(0)));

        throw new SagaError(`${this.source.name}: ${what} (${why}); ` +
            remedyOf(status), status);
    }

    startClock() {
        this.clock.end = performance.now() + 1000 * this.seconds;
    }

    write(at, bytes) {
        if (!at)
            this.check(-2, 'is too large for this browser\'s memory');
        this.bytes(at, bytes.length).set(bytes);
    }

    // --- Head

    // Reads the start of the file, then the rest of the head, whose length is
    // in the header.
    async readHead() {
        let bytes = await this.read(0, FIRST_NBYTES);
        let status = this.probe(bytes), n = 0;

        while (status === TRUNCATED && bytes.length > n) {
            n = bytes.length;
            bytes = await this.readOn(bytes, 2 * n);
            status = this.probe(bytes);
        }
        if (status)
            await this.refuse(bytes, status);
        this.tellInfo();
        bytes = await this.readOn(bytes, this.info.headNbytes);
        this.head = bytes;
        const { soundEnd, before, chunk } = await readOptional(this, bytes);

        this.soundEnd = soundEnd;
        this.volumeStatus = chunk ? this.findVolume(before, chunk) : ARG;
        // Like names, a damaged one is no reason to refuse the film.
        this.viewingVolume = this.volumeStatus === 0
            ? volumeOf(chunk, this.info) : null;
        this.check(this.probe(this.head), 'its header is refused');
        this.startClock();
        this.check(this.wasm.saga_web_open(), 'its networks are refused');
        this.rig = Array.from({ length: this.info.nCameras },
            (_, i) => this.readCamera(i));
        this.segments = this.listSegments();
        // Damaged names are no reason to refuse the film.
        this.nameStatus = this.wasm.saga_web_find_names();
        if (this.nameStatus === 0)
            nameCameras(this);
    }

    findVolume(before, chunk) {
        const bytes = joined([before, chunk], before.length + chunk.length);

        this.write(this.wasm.saga_web_head(bytes.length), bytes);
        return this.wasm.saga_web_find_volume();
    }

    // Throws the reason why the start of a file is none of a .saga file.
    async refuse(bytes, status) {
        const text = String.fromCharCode(...bytes.subarray(0, 64));

        if (status === DATA && /^\s*<(!doctype|html|\?xml)/i.test(text))
            throw new SagaError(`${this.source.name}: is a page of the web ` +
                'and no .saga file; check the address', status);
        if (status === DATA && await this.source.isOther?.(bytes)
            .catch(() => false))
            throw this.source.fault('sends other bytes where a part of the ' +
                'file is asked for than in the whole file');
        this.check(status, 'is not a .saga file that can be shown');
    }

    probe(bytes) {
        this.write(this.wasm.saga_web_head(bytes.length), bytes);
        return this.wasm.saga_web_probe();
    }

    // Reads from the source, which may be anybody's.
    async read(offset, nbytes) {
        const { name } = this.source;
        let bytes;

        try {
            bytes = await this.source.read(offset, nbytes);
        } catch (error) {
            throw error instanceof SagaError ? error
                : new SagaError(`${name}: cannot be read (${error.message})`);
        }
        if (!(bytes instanceof Uint8Array))
            throw new SagaError(`${name}: its source returns no Uint8Array`);
        return bytes.subarray(0, nbytes);
    }

    // Returns the first nbytes of the file, of which `bytes` have come already.
    async readOn(bytes, nbytes) {
        if (nbytes <= bytes.length)
            return bytes;
        const more = await this.read(bytes.length, nbytes - bytes.length);

        return joined([bytes, more], bytes.length + more.length);
    }

    tellInfo() {
        const told = this.ints(this.wasm.saga_web_info(), 17);
        const power = (mantissa, exponent) => mantissa * 2 ** exponent;

        this.info = Object.fromEntries(Object.entries(INFO).map(
            ([name, at]) => [name, told[at] >>> 0]));
        // A still has no rate; its fps is 25.
        this.info.fps = this.info.fpsNum / this.info.fpsDen || 25;
        // A position in the capture's unit is centre + unit * box units.
        this.info.unit = power(told[UNIT], told[UNIT + 1]);
        this.info.centre = [0, 1, 2].map(
            (i) => power(told[CENTRE + i], told[CENTRE_EXPONENT]));
    }

    // Returns a camera of the rig, { number, name, values }, with the values of
    // saga_camera; name is "" if the file has none.
    readCamera(index) {
        this.check(this.wasm.saga_web_rig(index), 'its rig is refused');
        const told = this.ints(this.wasm.saga_web_camera(), CAMERA_LENGTH + 1);

        return { number: told[CAMERA_LENGTH], name: '',
            values: told.slice(0, CAMERA_LENGTH) };
    }

    // Lists the byte range and the frames of every segment. Finding the last
    // frame checks all entries of the index up to it.
    listSegments() {
        const { nFrames } = this.info;
        const list = [];
        let firstFrame = 0;

        this.find(nFrames - 1, 1);
        for (const entry of entriesOf(this.head, this.info)) {
            list.push({ number: list.length, firstFrame, ...entry, t: 0 });
            firstFrame += entry.nFrames;
            if (firstFrame >= nFrames)
                break;
        }
        return list;
    }

    find(num, den) {
        // Others would be rounded on their way into WebAssembly.
        if (![num, den].every((x) => Number.isInteger(x) && x >= 0 &&
            x < 2 ** 32))
            this.check(ARG, 'has no such time');
        this.check(this.wasm.saga_web_find(num, den), 'has no such time');
        const told = this.ints(this.wasm.saga_web_segment(), 7);

        return { number: told[0], firstFrame: told[1] >>> 0,
            nFrames: told[2] >>> 0,
            offset: (told[3] >>> 0) + 2 ** 32 * (told[4] >>> 0),
            nbytes: told[5] >>> 0, t: told[6] };
    }

    // --- Sound

    get hasSound() {
        return this.soundEnd > 0;
    }

    // Returns the film's sound, or null. Another instance checks it, so that
    // this one keeps its segment and its memory.
    async sound() {
        if (!this.hasSound)
            return null;
        // Another 4 bytes show the type of the next chunk.
        const bytes = await this.readOn(this.head, this.soundEnd + 4);
        const other = await SagaFile.make(this.module, this.source,
            this.seconds);

        other.write(other.wasm.saga_web_head(bytes.length), bytes);
        other.check(other.wasm.saga_web_find_sound(), 'its sound is refused');
        const [offset, nbytes, start] =
            other.ints(other.wasm.saga_web_sound(), 3);

        return { start: start / SOUND_RATE,
            bytes: bytes.slice(offset, offset + nbytes) };
    }

    // --- Segments

    // Returns the bytes of a segment, which are fetched once. It may be called
    // ahead of time.
    fetchSegment(number) {
        const { offset, nbytes } = this.segments[number];
        let bytes = this.coded.get(number);

        if (!bytes) {
            bytes = this.read(offset, nbytes);
            bytes.then(() => this.here.add(number),
                () => this.forget(number));
        }
        this.coded.delete(number); // moves the segment to the end of the map,
                                   // where it is dropped last
        this.coded.set(number, bytes);
        if (this.coded.size > KEPT_SEGMENTS)
            this.forget(this.coded.keys().next().value);
        return bytes;
    }

    forget(number) {
        this.coded.delete(number);
        this.here.delete(number);
    }

    decode(number) {
        return this.inTurn(() => this.decodeNow(number));
    }

    async decodeNow(number) {
        if (this.segment === number)
            return;
        const bytes = await this.fetchSegment(number);
        const start = performance.now();
        const status = this.decodeBytes(this.segments[number], bytes);

        if (status)
            this.forget(number);
        this.check(status, `segment ${number} is refused`);
        this.segment = number;
        this.times.segment = performance.now() - start;
    }

    // Returns a copy of the decoder with its segment, for `adopt` of another
    // instance that was opened from the same `head`. So a worker can decode
    // ahead of time.
    block() {
        return this.bytes(this.wasm.saga_web_work() >>> 0,
            this.info.workNbytes).slice();
    }

    adopt(number, block, ms = 0) {
        this.segment = -1;
        this.write(this.wasm.saga_web_work() >>> 0, block);
        this.check(this.wasm.saga_web_adopt(), `segment ${number} is refused`);
        this.segment = number;
        this.times.segment = ms;
    }

    // Decodes a segment. If it has layers, its first bytes may be enough, which
    // the decoder checks.
    decodeBytes({ firstFrame }, bytes) {
        this.segment = -1;
        if (bytes.length === 0)
            return TRUNCATED;
        this.write(this.wasm.saga_web_input(bytes.length), bytes);
        this.startClock();
        return this.wasm.saga_web_decode(firstFrame, bytes.length);
    }

    // --- Pictures

    // Draws the picture at the time num / den in frames; both are integers.
    // rgba, and rgb without alpha, as saga-dec writes it, are views of the
    // decoder's memory and valid until the next call.
    draw(camera, num, den = 1) {
        return this.inTurn(() => this.drawNow(camera, num, den));
    }

    async drawNow(camera, num, den) {
        await this.view(camera, num, den);
        const start = performance.now();

        this.check(this.wasm.saga_web_draw(), 'cannot be drawn');
        this.times.draw = performance.now() - start;
        return this.picture();
    }

    // Calls a function when the calls before it have ended, so that none finds
    // the segment of another.
    inTurn(call) {
        const turn = this.last.then(call);

        this.last = turn.catch(() => {});
        return turn;
    }

    // Decodes the segment of a time, sets the camera, and returns the time in
    // the decoder's unit, 1/65536 of the segment.
    async look(camera, num, den) {
        const { number, t } = this.find(num, den);

        if (camera?.values?.length !== CAMERA_LENGTH)
            throw new SagaError(`a camera has ${CAMERA_LENGTH} values`, ARG);
        await this.decodeNow(number);
        this.ints(this.wasm.saga_web_camera(), CAMERA_LENGTH)
            .set(camera.values);
        return t;
    }

    async view(camera, num, den) {
        const t = await this.look(camera, num, den);
        const start = performance.now();

        this.check(this.wasm.saga_web_view(t),
            'cannot be drawn from this camera');
        this.times.view = performance.now() - start;
    }

    // Returns the splats of a picture, for a graphics processor to draw
    // (gpu.js). bytes is an array of saga_splat of saga.h, nearest first,
    // without boxes and computed in floats: a view of the decoder's memory that
    // is valid until the next call.
    splats(camera, num, den = 1) {
        return this.inTurn(() => this.splatsNow(camera, num, den));
    }

    async splatsNow(camera, num, den) {
        const t = await this.look(camera, num, den);
        const start = performance.now();
        const { values } = camera;
        const at = this.wasm.saga_web_splats(t);
        const [, , , , nPrimitives, nSplats] =
            this.ints(this.wasm.saga_web_picture(), 6);

        if (!at)
            this.check(-2, 'is too large for this browser\'s memory');
        this.times.view = performance.now() - start;
        this.times.draw = 0;
        return { width: values[WIDTH], height: values[WIDTH + 1], nPrimitives,
            nSplats, tools: this.info.tools,
            background: Array.from(values.slice(BACKGROUND, BACKGROUND + 3),
                (x) => x / 32768),
            bytes: this.bytes(at >>> 0, SPLAT_NBYTES * nSplats) };
    }

    // Returns the segment's primitives at a time, with the colours that the
    // camera sees, for an engine that sorts and projects them itself. Invisible
    // ones have an opacity of nearly 0 and keep their places. bytes come from
    // planesOf.
    gaussians(camera, num, den = 1) {
        return this.inTurn(() => this.gaussiansNow(camera, num, den));
    }

    async gaussiansNow(camera, num, den) {
        const t = await this.look(camera, num, den);
        const start = performance.now();
        const at = this.wasm.saga_web_gaussians(t);
        const [, , , , nPrimitives, nSplats] =
            this.ints(this.wasm.saga_web_picture(), 6);

        if (!at)
            this.check(-2, 'is too large for this browser\'s memory');
        this.times.view = performance.now() - start;
        const planes = planesOf(
            this.ints(at, GAUSSIAN_INTS * nSplats), nSplats, this.info);

        this.times.draw = performance.now() - start - this.times.view;
        return { nPrimitives, nSplats, tools: this.info.tools,
            bytes: new Uint8Array(planes.buffer) };
    }

    picture() {
        const [width, height, rgb, rgba, nPrimitives, nSplats] =
            this.ints(this.wasm.saga_web_picture(), 6);

        return { width, height, nPrimitives, nSplats,
            rgb: this.bytes(rgb >>> 0, 3 * width * height),
            rgba: this.bytes(rgba >>> 0, 4 * width * height) };
    }

    // Returns the CRC-32C of the last picture's rgb, as saga-dec --crc prints
    // it.
    crc() {
        return (this.wasm.saga_web_crc() >>> 0).toString(16).padStart(8, '0');
    }
}

function sourceOf(source) {
    if (source instanceof Uint8Array)
        return new BytesSource(source);
    if (typeof Blob !== 'undefined' && source instanceof Blob)
        return new BlobSource(source);
    if (typeof source === 'string' || source instanceof URL)
        return new HttpSource(source);
    if (typeof source?.read !== 'function')
        throw new SagaError('a file is opened from a URL, a File, a Blob, a ' +
            'Uint8Array or an object with read()');
    return source;
}

function remedyOf(status) {
    switch (status) {
    case TRUNCATED: return 'the file is cut short: copy it again';
    case -12: return 'it needs a newer version of this page';
    case -13: return 'it needs more than its level allows';
    case -2: return 'close other tabs, or use saga-dec';
    case -1: return 'choose another time or camera';
    default: return '`saga info` shows what is damaged';
    }
}
