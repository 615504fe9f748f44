// SPDX-License-Identifier: MIT
//
// Where the files are that belong to the library and are no modules of the
// page: the worker and the decoder's two WebAssembly files. Bundlers look for
// the literal addresses in `wasmAt` and `startWorker`, and put the files beside
// what they make. A page that has them elsewhere says so before it opens a
// film:
//
//     import { places } from 'saga-web/places.js';
//     places.worker = '/static/worker.js';
//
// Addresses are relative to the page.

export const places = { worker: null, wasm: null, simd: null };

// Returns the address of the decoder, with SIMD or without.
export function wasmAt(simd) {
    const given = simd ? places.simd : places.wasm;

    if (given)
        return new URL(given, globalThis.document?.baseURI);
    return simd ? new URL('./saga_simd.wasm', import.meta.url)
        : new URL('./saga.wasm', import.meta.url);
}

// Returns addresses that mean the same in a worker.
export const absolutePlaces = () => Object.fromEntries(Object.entries(places)
    .map(([name, at]) => [name, at && new URL(at, document.baseURI).href]));

// Returns the sentence for a worker that does not start. A browser says nothing
// of why, if a policy forbids it or its script does not come.
export const cannotStart = (why) => `the decoder cannot be started (${why ||
    'worker.js does not come, or the page\'s Content-Security-Policy forbids ' +
    'it; worker-src must allow it, and blob: if another server has it'})`;

// Starts a worker of worker.js. In a worker, that is itself once more.
export function startWorker() {
    if (!globalThis.document)
        return workerAt(location.href, isModule() ? 'module' : 'classic');
    if (places.worker)
        return workerAt(new URL(places.worker, document.baseURI).href);
    try {
        return new Worker(new URL('./worker.js', import.meta.url),
            { type: 'module' });
    } catch {
        // Another server has the library, or the page wants Trusted Types.
        return workerAt(import.meta.url.replace(/[^/]*$/, 'worker.js'));
    }
}

const blobs = {}; // addresses of scripts that were made, by their text

// A page may not start a worker from another server, but one that imports it.
// In a sandboxed frame, whose origin is "null", that is no Blob either.
function workerAt(address, type = 'module') {
    const text = `import ${JSON.stringify(address)};`;
    const isOurs = /^(blob|data):/.test(address) ||
        new URL(address).origin === self.origin;
    const url = isOurs ? address : self.origin === 'null'
        ? `data:text/javascript,${encodeURIComponent(text)}`
        : blobs[text] ??= URL.createObjectURL(
            new Blob([text], { type: 'text/javascript' }));

    return new Worker(trust('createScriptURL', url), { type });
}

// Some bundlers make a worker that is no module.
function isModule() {
    try {
        importScripts();
        return false;
    } catch {
        return true;
    }
}

let policy = null;

// Returns markup or an address that is the library's own, as pages with Trusted
// Types want it. Their header allows it by `trusted-types saga`.
export function trust(create, text) {
    policy ??= globalThis.trustedTypes?.createPolicy('saga',
        { createHTML: (t) => t, createScriptURL: (t) => t }) ??
        { [create]: (t) => t };
    return policy[create](text);
}
