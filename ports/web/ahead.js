// SPDX-License-Identifier: MIT
//
// A worker of worker.js that decodes segments ahead of time in an instance of
// its own. The first message is { head, seconds, module }, every further one
//
//     { number, bytes } -> { block, ms }, of SagaFile.block; {} where it fails

import { SagaFile } from './saga.js';

let file = null; // promise of it

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
