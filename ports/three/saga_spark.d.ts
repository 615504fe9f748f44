// SPDX-License-Identifier: MIT
import type { PerspectiveCamera } from 'three';
import type { SplatMesh } from '@sparkjsdev/spark';
import type { EngineView } from 'saga-web/engine.js';

/** A film that Spark draws. Its unit of length is the capture's. */
export class SagaSplatMesh extends SplatMesh {
    /** simd: false selects the decoder without SIMD. seconds: time limit for
     * decoding a segment. */
    static load(
        source: string | File,
        options?: { simd?: boolean; seconds?: number },
    ): Promise<SagaSplatMesh>;

    /** The clock, the file's properties, and events. */
    readonly view: EngineView;

    /** Moves a camera to the position and orientation of a camera of the rig,
     * and gives it its field of view. */
    placeCamera(camera: PerspectiveCamera, index?: number): void;
}
