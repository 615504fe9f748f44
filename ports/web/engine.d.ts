// SPDX-License-Identifier: MIT
import type { SagaSplats } from './saga.js';
import { Viewer } from './viewer.js';

/** Floats of a splat. */
export const FLOATS: number;
/** Splats from back to front: mean (2, pixels), depth (box units), q0; g, n, h;
 * colour (3). */
export function floatsOf(splats: SagaSplats): Float32Array;
export function isSteep(splats: SagaSplats): boolean;
/** saga_place and saga_mixed, in GLSL ES 3. */
export const VERTEX_GLSL: string;
export const FRAGMENT_GLSL: string;

/** A viewer whose camera is an engine's. Matrices are 4x4, by columns. */
export class EngineView extends Viewer {
    constructor(
        take: (splats: SagaSplats & { values: Int32Array }) => void,
        options?: { simd?: boolean; seconds?: number;
            make?: 'splats' | 'gaussians' },
    );
    /** modelView takes the capture's units to the camera. */
    lookFrom(modelView: ArrayLike<number>, projection: ArrayLike<number>,
        width: number, height: number): void;
    /** For Gaussians: the camera's position, in the capture's units. */
    lookFromPlace(eye: number[]): void;
    /** Maps splats made for `values` to the engine's screen. */
    toClip(values: Int32Array, modelView: ArrayLike<number>,
        projection: ArrayLike<number>): number[];
    /** Returns the place of a camera of the rig. */
    rigPlace(index: number): { fov: number; matrix: number[] };
}
