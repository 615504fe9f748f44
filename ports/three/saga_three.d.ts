// SPDX-License-Identifier: MIT
import type { Mesh, Object3D, PerspectiveCamera } from 'three';
import type { EngineView } from 'saga-web/engine.js';

/** A film in a scene that a WebGLRenderer draws. Its unit of length is the
 * capture's. It may be moved, turned, and scaled equally in all directions. */
export class SagaMesh extends Mesh {
    /** simd: false selects the decoder without SIMD. seconds: time limit for
     * decoding a segment. */
    static load(
        source: string | File,
        options?: { simd?: boolean; seconds?: number },
    ): Promise<SagaMesh>;

    /** The clock, the file's properties, and events. */
    readonly view: EngineView;

    /** Moves a camera to the position and orientation of a camera of the rig,
     * and gives it its field of view. */
    placeCamera(camera: PerspectiveCamera, index?: number): void;
    /** Moves a camera that is outside the film's viewing volume to the nearest
     * place in it; to be called after controls have moved it. */
    holdCamera(camera: Object3D): void;
    dispose(): void;
}
