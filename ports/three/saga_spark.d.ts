// SPDX-License-Identifier: MIT
import type { PerspectiveCamera } from 'three';
import type { SplatMesh } from '@sparkjsdev/spark';
import type { EngineView } from 'saga-web/engine.js';

/** A film that Spark draws, in the capture's units. */
export class SagaSplatMesh extends SplatMesh {
    /** simd: false for the decoder without SIMD; seconds: limit for decoding
     * a segment. */
    static load(
        source: string | File,
        options?: { simd?: boolean; seconds?: number },
    ): Promise<SagaSplatMesh>;

    /** The clock, the file's properties, and events. */
    readonly view: EngineView;

    /** Puts a camera at the place of a camera of the rig. */
    placeCamera(camera: PerspectiveCamera, index?: number): void;
}
