// SPDX-License-Identifier: MIT
import type { SagaSplats } from './saga.js';

/** Draws splats in one call into the bound framebuffer, which must be cleared
 * to (0, 0, 0, 1). Colours are added to it, and alpha becomes the
 * transmittance, the share of the background that remains visible. The
 * picture's first row becomes the first row of the framebuffer. */
export class SplatPainter {
    constructor(gl: WebGL2RenderingContext);
    upload(splats: Omit<SagaSplats, 'background' | 'nPrimitives'>): void;
    draw(): void;
}

/** A canvas that shows splats, or pixels. */
export class GpuScreen {
    /** Returns null if the browser has no WebGL2. */
    static open(canvas: HTMLCanvasElement): GpuScreen | null;
    /** Whether the browser supports everything that drawing splats needs. */
    readonly takesSplats: boolean;
    /** Whether splats are shown without their background, so that the page shows
     * through; initially false. */
    transparent: boolean;
    showSplats(splats: Omit<SagaSplats, 'nPrimitives'>): void;
    showPixels(picture: {
        bytes: Uint8ClampedArray;
        width: number;
        height: number;
    }): void;
    read(): ImageData;
}

/** A canvas without a graphics processor, for pixels only. */
export class PlainScreen {
    constructor(canvas: HTMLCanvasElement);
    readonly takesSplats: false;
    showPixels(picture: {
        bytes: Uint8ClampedArray;
        width: number;
        height: number;
    }): void;
    read(): ImageData;
}
