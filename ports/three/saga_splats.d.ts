// SPDX-License-Identifier: MIT
import type { Object3D, PerspectiveCamera } from 'three';
import type { GaussianSplat } from 'three/addons/objects/GaussianSplat.js';
import type { EngineView } from 'saga-web/engine.js';

/** A film that a WebGPURenderer of three.js 0.187 draws as Gaussian splats. Its
 * unit of length is the capture's. */
export class SagaSplats extends GaussianSplat {
    /** simd: false selects the decoder without SIMD. seconds: time limit for
     * decoding a segment. */
    static load(
        source: string | File,
        options?: { simd?: boolean; seconds?: number },
    ): Promise<SagaSplats>;

    /** The clock, the file's properties, and events. */
    readonly view: EngineView;

    /** Moves a camera to the position and orientation of a camera of the rig,
     * and gives it its field of view. */
    placeCamera(camera: PerspectiveCamera, index?: number): void;

    /** Moves a camera that is outside the film's viewing volume to the nearest
     * place in it; to be called after controls have moved it. */
    holdCamera(camera: Object3D): void;

    /** Ends the film's workers and frees what the graphics processor has. */
    dispose(): void;
}
