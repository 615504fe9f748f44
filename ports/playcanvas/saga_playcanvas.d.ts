// SPDX-License-Identifier: MIT
import type { AppBase, Entity } from 'playcanvas';
import type { EngineView } from 'saga-web/engine.js';

/** A film in a scene that is drawn with WebGL2. The entity's unit of length is
 * the capture's. The entity may be moved, turned, and scaled equally in all
 * directions. */
export class SagaEntity {
    /** simd: false selects the decoder without SIMD. seconds: time limit for
     * decoding a segment. */
    static load(
        app: AppBase,
        source: string | File,
        options?: { simd?: boolean; seconds?: number },
    ): Promise<SagaEntity>;

    /** The entity to add to the scene. */
    readonly entity: Entity;
    /** The clock, the file's properties, and events. */
    readonly view: EngineView;

    /** Moves an entity with a camera to the position and orientation of a
     * camera of the rig, and gives it its field of view. */
    placeCamera(camera: Entity, index?: number): void;
    /** Moves an entity with a camera that is outside the film's viewing volume to
     * the nearest place in it; to be called after controls have moved it. */
    holdCamera(camera: Entity): void;
    destroy(): void;
}

/** Moves a camera as SagaEntity.holdCamera does, for any entity that shows a
 * film. */
export function holdCamera(film: { entity: Entity; view: EngineView },
    camera: Entity): void;

/** Moves a camera as SagaEntity.placeCamera does, for any entity that shows a
 * film. */
export function placeCamera(film: { entity: Entity; view: EngineView },
    camera: Entity, index: number): void;
