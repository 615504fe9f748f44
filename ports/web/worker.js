// SPDX-License-Identifier: MIT
//
// A worker that has one file open and draws it, so that the page stays
// responsive. It answers `open` and `draw` once, in their order:
//
//     { open: address or File, simd, seconds } -> { opened } or { failed }
//     { draw: { values, num, den, make, crc, buffer } } -> { drawn } or
//         { failed }: what SagaFile's method `make` gives, `draw`, `splats` or
//         `gaussians`; buffer is used again
//     { sound: true } -> { sound }: what SagaFile's sound() gives, or null if
//         that fails, as soon as it is there
//     { ahead: segments }: the one that is shown, and those that come then;
//         they are fetched in this order, the second is decoded elsewhere
//
// and tells now and then { progress: { segment, got, nbytes } }, in bytes; of
// the head, or of a file that its server gives whole, segment is -1.

import { HttpSource, SagaFile, hasSimd, loadModule } from './saga.js';

const TELL_MS = 50;

let file = null;
let next = null;       // Next of this file
let plan = [];         // the last `ahead`
let ahead = false;     // whether what is decoded was decoded ahead of time

// The next segment, decoded by a worker of this worker (ahead.js) while this
// one draws.
class Next {
    constructor({ head, seconds }, module) {
        this.worker = new Worker(new URL('ahead.js', import.meta.url),
            { type: 'module' });
        this.worker.postMessage({ head, seconds, module });
        this.made = new Map(); // number -> promise of { block, ms }, or of {}
        this.resolvers = [];   // of what is being decoded, in order
        this.worker.onmessage = ({ data }) => this.resolvers.shift()(data);
        this.worker.onerror = () => {
            this.prepare = () => {};
            this.resolvers.forEach((resolve) => resolve({}));
        };
    }

    // Two are kept: when a segment begins to be played, the one after it may be
    // asked for before its own first picture is.
    prepare(number, bytes) {
        if (this.made.has(number))
            return;
        this.made.set(number,
            new Promise((resolve) => this.resolvers.push(resolve)));
        this.worker.postMessage({ number, bytes });
        if (this.made.size > 2)
            this.made.delete(this.made.keys().next().value);
    }

    // The prepared one, once.
    async take(number) {
        const made = this.made.get(number);

        this.made.delete(number);
        return made || {};
    }
}

// An address becomes a source that tells how far it is.
function watched(source) {
    if (typeof source !== 'string')
        return source;
    const http = new HttpSource(source);
    let told = -Infinity;

    http.onProgress = ({ offset, got, nbytes }) => {
        const now = performance.now();

        if (now - told < TELL_MS && got !== nbytes)
            return;
        const segment = file?.segments.findIndex(
            (s) => s.offset === offset) ?? -1;

        if (file && segment < 0)
            return; // the sound, for which no picture waits
        told = now;
        postMessage({ progress: { got, nbytes, segment } });
    };
    return http;
}

async function open({ open: source, simd = hasSimd(), seconds }) {
    file = null;
    const module = await loadModule({ simd });

    file = await SagaFile.open(watched(source), { module, seconds });
    next = file.segments.length > 1 && globalThis.Worker
        ? new Next(file, module) : null;
    const { info, rig, segments, hasSound } = file;
    const { name, size } = file.source;

    return { opened: { info, rig, segments, hasSound, name, size, simd } };
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

// Takes the segment of a time from where it was decoded ahead.
async function changeSegment(num, den) {
    const { number } = file.find(num, den);

    if (number === file.segment)
        return;
    const { block, ms } = next ? await next.take(number) : {};

    ahead = Boolean(block);
    if (ahead)
        file.adopt(number, block, ms);
}

// bytes in buffer, if that is large enough for what is not much smaller.
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

async function answer(message) {
    try {
        return message.open ? await open(message) : await draw(message.draw);
    } catch (error) {
        const text = error.name === 'SagaError' ? error.message
            : `the decoder stopped (${error.message}); load the page again`;

        return { failed: text };
    }
}

async function sendSound() {
    const sound = await file.sound().catch(() => null);

    postMessage({ sound }, sound ? [sound.bytes.buffer] : []);
}

let last = Promise.resolve();

onmessage = ({ data }) => {
    if (data.ahead) {
        if (file)
            lookAhead(data.ahead).catch(() => {}); // drawing it tells
        return;
    }
    if (data.sound) {
        sendSound();
        return;
    }
    last = last.then(() => answer(data)).then((reply) =>
        postMessage(reply, reply.drawn ? [reply.drawn.bytes.buffer] : []));
};
