// SPDX-License-Identifier: MIT
import type { PerspectiveCamera } from 'three';
import type { SplatMesh } from '@sparkjsdev/spark';
import type { EngineView } from 'saga-web/engine.js';

/** A film that Spark draws, in the capture's units. */
export class SagaSplatMesh extends SplatMesh {
    /** simd: false for the plain decoder; seconds: that decoding a segment may
     * take. */
    static load(
        source: string | File,
        options?: { simd?: boolean; seconds?: number },
    ): Promise<SagaSplatMesh>;

    /** The clock, what is known of the file, and events. */
    readonly view: EngineView;

    /** Puts a camera where one of the rig stands. */
    placeCamera(camera: PerspectiveCamera, index?: number): void;
}
