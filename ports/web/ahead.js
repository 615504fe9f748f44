// SPDX-License-Identifier: MIT
//
// A worker that worker.js starts to decode segments ahead of time, in a decoder
// of its own. The first message is { head, seconds, module }. Every further one
// is
//
//     { number, bytes } -> { block, ms } from SagaFile.block, or {} if it fails

import { SagaFile } from './saga.js';

let file = null; // promise of the opened SagaFile

async function decode({ number, bytes }) {
    const instance = await file;
    const start = performance.now();
    const status = instance.decodeBytes(instance.segments[number], bytes);

    return status ? {}
        : { block: instance.block(), ms: performance.now() - start };
}

onmessage = async ({ data }) => {
    if (data.head) {
        const { head, seconds, module } = data;

        file = SagaFile.open(head, { module, seconds });
        return;
    }
    const reply = await decode(data).catch(() => ({}));

    postMessage(reply, reply.block ? [reply.block.buffer] : []);
};
