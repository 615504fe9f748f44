// SPDX-License-Identifier: MIT
//
// Decoding segments ahead of time, in a worker of a worker.

import { SagaFile } from './saga.js';

// Returns an `onmessage` that answers each { number, bytes } with { block, ms }
// from SagaFile.block, or {} if that fails.
export function decodesAhead({ head, seconds, module }) {
    const file = SagaFile.open(head, { module, seconds });

    const decode = async ({ number, bytes }) => {
        const instance = await file;
        const start = performance.now();
        const status = instance.decodeBytes(instance.segments[number], bytes);

        return status ? {}
            : { block: instance.block(), ms: performance.now() - start };
    };

    return async ({ data }) => {
        const reply = await decode(data).catch(() => ({}));

        postMessage(reply, reply.block ? [reply.block.buffer] : []);
    };
}
