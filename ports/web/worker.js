// SPDX-License-Identifier: MIT
//
// A worker that opens one file and draws it, so that the page stays responsive.
// It answers each `open` and `draw` once, in their order:
//
//     { open: address or File, simd, seconds, places, credentials } ->
//         { opened } or { failed }: a sentence, and { code } as in MediaError
//     { draw: { values, num, den, make, crc, buffer } } -> { drawn } or
//         { failed }: the result of SagaFile's method `make`, which is `draw`,
//         `splats` or `gaussians`; buffer is reused
//     { sound: true } -> { sound }: the result of SagaFile's sound(), later, or
//         null if that fails
//     { ahead: segments }: the segment that is shown, and the next ones; they
//         are fetched in this order, and another worker decodes the second
//
// If its first message has a `head`, it decodes ahead of time (ahead.js). It
// also posts { progress: { segment, got, nbytes } }, in bytes. The segment
// is -1 for the head, and for a file that its server sends as a whole.

import { decodesAhead } from './ahead.js';
import { places, startWorker } from './places.js';
import { HttpSource, SagaFile, hasSimd, loadModule } from './saga.js';

const TELL_MS = 50;

let file = null;
let next = null;       // decodes the next segment of the open file
let plan = [];         // the segments of the last `ahead` message
let ahead = false;     // whether the decoded segment was decoded ahead of time

// The next segment, decoded by a worker of this worker while this one draws.
class Next {
    constructor({ head, seconds }, module) {
        this.worker = startWorker();
        this.worker.postMessage({ head, seconds, module });
        this.made = new Map(); // number of a segment -> promise of { block, ms
                               // }, or of {}
        this.resolvers = [];   // resolve functions of the segments in progress,
                               // in order
        this.worker.onmessage = ({ data }) => this.resolvers.shift()(data);
        this.worker.onerror = () => {
            this.prepare = () => {};
            this.resolvers.forEach((resolve) => resolve({}));
        };
    }

    // Gives a segment to the worker. Two segments are kept: when a
    // segment begins to play, the next one may be asked for before the first
    // picture of this one.
    prepare(number, bytes) {
        if (this.made.has(number))
            return;
        this.made.set(number,
            new Promise((resolve) => this.resolvers.push(resolve)));
        this.worker.postMessage({ number, bytes });
        if (this.made.size > 2)
            this.made.delete(this.made.keys().next().value);
    }

    // Returns the prepared segment, once.
    async take(number) {
        const made = this.made.get(number);

        this.made.delete(number);
        return made || {};
    }
}

// Makes a source from a URL, whose transfers are reported as `progress`.
function watched(source, credentials) {
    if (typeof source !== 'string')
        return source;
    const http = new HttpSource(source, credentials);
    let told = -Infinity;

    http.onProgress = ({ offset, got, nbytes }) => {
        const now = performance.now();

        if (now - told < TELL_MS && got !== nbytes)
            return;
        const segment = file?.segments.findIndex(
            (s) => s.offset === offset) ?? -1;

        if (file && segment < 0)
            return; // no picture waits for the sound
        told = now;
        postMessage({ progress: { got, nbytes, segment } });
    };
    return http;
}

async function open({ open: source, simd = hasSimd(), seconds,
    places: given, credentials }) {
    file = null;
    Object.assign(places, given);
    const module = await loadModule({ simd });

    file = await SagaFile.open(watched(source, credentials),
        { module, seconds });
    next = file.segments.length > 1 && globalThis.Worker
        ? new Next(file, module) : null;
    const { info, rig, segments, hasSound, viewingVolume } = file;
    const { name, size } = file.source;

    return { opened: { info, rig, segments, hasSound, viewingVolume, name, size,
        simd } };
}

async function lookAhead(numbers) {
    plan = numbers;
    for (const [i, number] of numbers.entries()) {
        const bytes = await file.fetchSegment(number);

        if (plan !== numbers)
            return;
        if (i === 1)
            next?.prepare(number, bytes);
    }
}

// Takes the segment that holds a time, if it was decoded ahead of time.
async function changeSegment(num, den) {
    const { number } = file.find(num, den);

    if (number === file.segment)
        return;
    const { block, ms } = next ? await next.take(number) : {};

    ahead = Boolean(block);
    if (ahead)
        file.adopt(number, block, ms);
}

// Copies bytes into buffer if they fit and do not leave too much of it unused.
function copyTo(buffer, bytes) {
    const fits = buffer && buffer.byteLength >= bytes.length &&
        buffer.byteLength <= 4 * bytes.length;
    const to = new Uint8ClampedArray(
        fits ? buffer : new ArrayBuffer(bytes.length), 0, bytes.length);

    to.set(bytes);
    return to;
}

async function draw({ values, num, den, make, crc, buffer }) {
    await changeSegment(num, den);
    const made = await file[make]({ values }, num, den);
    const gpu = make !== 'draw';
    const { width, height, nPrimitives, nSplats, tools, background } = made;

    return { drawn: {
        width, height, nPrimitives, nSplats, tools, background, gpu,
        bytes: copyTo(buffer, gpu ? made.bytes : made.rgba),
        crc: crc && !gpu ? file.crc() : null, num, den, values,
        segment: file.segment, ahead, times: { ...file.times },
        fetched: file.source.fetched, size: file.source.size,
        kept: [...file.here],
    } };
}

// Returns MediaError's number: the transfer failed, or decoding did, or nothing
// that can be shown is there.
const codeOf = (error) => error.isTransfer ? 2 : file?.rig ? 3 : 4;

async function answer(message) {
    try {
        return message.open ? await open(message) : await draw(message.draw);
    } catch (error) {
        const text = error.name === 'SagaError' ? error.message
            : `the decoder stopped (${error.message}); load the page again`;

        return { failed: text, code: codeOf(error) };
    }
}

async function sendSound() {
    const sound = await file.sound().catch(() => null);

    postMessage({ sound }, sound ? [sound.bytes.buffer] : []);
}

let last = Promise.resolve();

onmessage = ({ data }) => {
    if (data.head) { // the worker of a worker
        onmessage = decodesAhead(data);
        return;
    }
    if (data.ahead) {
        if (file)
            lookAhead(data.ahead).catch(() => {}); // drawing reports errors
        return;
    }
    if (data.sound) {
        if (file) // else it is asked for again when the file is open
            sendSound();
        return;
    }
    last = last.then(() => answer(data)).then((reply) =>
        postMessage(reply, reply.drawn ? [reply.drawn.bytes.buffer] : []));
};
