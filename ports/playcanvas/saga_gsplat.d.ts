// SPDX-License-Identifier: MIT
import type { AppBase, Asset, GSplatContainer } from 'playcanvas';
import type { EngineView } from 'saga-web/engine.js';

/** The resource of a gsplat asset that was loaded from a .saga file. */
export class SagaSplats extends GSplatContainer {
    /** The clock, the file's properties, and events. */
    readonly view: EngineView;
}

/** A parser for `app.loader.getHandler('gsplat').addParser`. */
export class SagaParser {
    /** simd: false selects the decoder without SIMD. seconds: time limit for
     * decoding a segment. */
    constructor(app: AppBase, options?: { simd?: boolean; seconds?: number });
    canParse(context: { ext: string }): boolean;
    load(url: { load: string; original: string },
        callback: (error: string | null, resource?: SagaSplats) => void,
        asset?: Asset): void;
    open(url: string, data: SagaSplats): SagaSplats;
}
