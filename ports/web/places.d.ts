// SPDX-License-Identifier: MIT

/** Addresses of the library's files that are no modules of the page, relative
 * to the page. null: where the library is, or where a bundler put them. To be
 * set before a film is opened. */
export const places: {
    /** worker.js, alone or in a bundle. */
    worker: string | URL | null;
    /** saga.wasm, the decoder without SIMD. */
    wasm: string | URL | null;
    /** saga_simd.wasm. */
    simd: string | URL | null;
};
