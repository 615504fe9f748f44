// SPDX-License-Identifier: MIT
import type { AppBase, Entity } from 'playcanvas';
import type { EngineView } from 'saga-web/engine.js';

/** A film in a scene that is drawn with WebGL2. A unit of its entity is the
 * capture's; it may be moved, turned, and scaled alike in all directions. */
export class SagaEntity {
    /** simd: false for the decoder without SIMD; seconds: limit for decoding
     * a segment. */
    static load(
        app: AppBase,
        source: string | File,
        options?: { simd?: boolean; seconds?: number },
    ): Promise<SagaEntity>;

    /** The entity to add to the scene. */
    readonly entity: Entity;
    /** The clock, the file's properties, and events. */
    readonly view: EngineView;

    /** Puts an entity with a camera at the place of a camera of the rig. */
    placeCamera(camera: Entity, index?: number): void;
    destroy(): void;
}

/** Does the same for any entity that shows a film. */
export function placeCamera(film: { entity: Entity; view: EngineView },
    camera: Entity, index: number): void;
