// SPDX-License-Identifier: MIT
import type { SagaSplats } from './saga.js';
import { Viewer } from './viewer.js';

/** Number of floats of a splat, from floatsOf. */
export const FLOATS: number;
/** Returns the splats from back to front. Each has: mean (2, pixels), depth
 * (box units), q0; the conic's factor g, n, h; colour (3). */
export function floatsOf(splats: SagaSplats): Float32Array;
/** Vertex shader functions in GLSL ES 3, among them saga_place; the fragment
 * shader has saga_mixed. */
export const VERTEX_GLSL: string;
export const FRAGMENT_GLSL: string;

/** A viewer that draws with the camera of another engine. Matrices are 4x4,
 * stored by columns. */
export class EngineView extends Viewer {
    constructor(
        take: (splats: SagaSplats & { values: Int32Array }) => void,
        options?: { simd?: boolean; seconds?: number;
            make?: 'splats' | 'gaussians' },
    );
    /** Asks for the splats as the engine's camera sees them. modelView maps the
     * capture's units to the camera's axes. */
    lookFrom(modelView: ArrayLike<number>, projection: ArrayLike<number>,
        width: number, height: number): void;
    /** Asks for Gaussians, whose colours are those seen from `eye`, a position
     * in the capture's units. */
    lookFromPlace(eye: number[]): void;
    /** Returns the matrix that maps splats that were made for the camera
     * `values` to the clip space of the engine's camera. */
    toClip(values: Int32Array, modelView: ArrayLike<number>,
        projection: ArrayLike<number>): number[];
    /** Returns an eye, or else the place of the viewing volume that is nearest to
     * it, in the capture's units. */
    held(eye: number[]): number[];
    /** Returns the vertical field of view, in degrees, and the pose, as a
     * matrix, of a camera of the rig. */
    rigPlace(index: number): { fov: number; matrix: number[] };
}
