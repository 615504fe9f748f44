// SPDX-License-Identifier: MIT
//
// A worker that has one file open and draws it, so that the page stays
// responsive. It answers every message but `fetch` once, in their order:
//
//     { open: address or File, simd, seconds } -> { opened } or { failed }
//     { draw: { values, num, den, gpu, crc, buffer } } -> { drawn } or
//         { failed }: with gpu splats, else pixels; buffer is used again
//     { fetch: segment }                  ahead of time

import { SagaFile, hasSimd, loadModule } from './saga.js';

let file = null;

async function open({ open: source, simd = hasSimd(), seconds }) {
    file = null;
    const module = await loadModule({ simd });

    file = await SagaFile.open(source, { module, seconds });
    const { info, rig, segments } = file;
    const { name, size } = file.source;

    return { opened: { info, rig, segments, name, size, simd } };
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

async function draw({ values, num, den, gpu, crc, buffer }) {
    const made = gpu ? await file.splats({ values }, num, den)
        : await file.draw({ values }, num, den);
    const { width, height, nPrimitives, nSplats, tools, background } = made;

    return { drawn: {
        width, height, nPrimitives, nSplats, tools, background, gpu,
        bytes: copyTo(buffer, gpu ? made.bytes : made.rgba),
        crc: crc && !gpu ? file.crc() : null, num, den, values,
        segment: file.segment, times: { ...file.times },
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

let last = Promise.resolve();

onmessage = ({ data }) => {
    if (data.fetch !== undefined) {
        file?.fetchSegment(data.fetch).catch(() => {});
        return;
    }
    last = last.then(() => answer(data)).then((reply) =>
        postMessage(reply, reply.drawn ? [reply.drawn.bytes.buffer] : []));
};
