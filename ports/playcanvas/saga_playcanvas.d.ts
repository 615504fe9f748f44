// SPDX-License-Identifier: MIT
import type { AppBase, Entity } from 'playcanvas';
import type { EngineView } from 'saga-web/engine.js';

/** A film in a scene that is drawn with WebGL2. A unit of its entity is the
 * capture's; it may be moved, turned, and scaled alike in all directions. */
export class SagaEntity {
    /** simd: false for the plain decoder; seconds: that decoding a segment may
     * take. */
    static load(
        app: AppBase,
        source: string | File,
        options?: { simd?: boolean; seconds?: number },
    ): Promise<SagaEntity>;

    /** To be added to the scene. */
    readonly entity: Entity;
    /** The clock, what is known of the file, and events. */
    readonly view: EngineView;

    /** Puts an entity with a camera where a camera of the rig stands. */
    placeCamera(camera: Entity, index?: number): void;
    destroy(): void;
}

/** The same for any entity that shows a film. */
export function placeCamera(film: { entity: Entity; view: EngineView },
    camera: Entity, index: number): void;
