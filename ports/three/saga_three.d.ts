// SPDX-License-Identifier: MIT
import type { Mesh, PerspectiveCamera } from 'three';
import type { EngineView } from 'saga-web/engine.js';

/** A film in a scene that a WebGLRenderer draws. A unit of it is the capture's;
 * it may be moved, turned, and scaled alike in all directions. */
export class SagaMesh extends Mesh {
    /** simd: false for the decoder without SIMD; seconds: limit for decoding
     * a segment. */
    static load(
        source: string | File,
        options?: { simd?: boolean; seconds?: number },
    ): Promise<SagaMesh>;

    /** The clock, the file's properties, and events. */
    readonly view: EngineView;

    /** Puts a camera at the place of a camera of the rig. */
    placeCamera(camera: PerspectiveCamera, index?: number): void;
    dispose(): void;
}
