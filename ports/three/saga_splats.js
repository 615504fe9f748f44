// SPDX-License-Identifier: MIT
//
// A .saga film for the Gaussian splats that three.js itself draws, with its
// WebGPURenderer (or its WebGL2 backend):
//
//     const film = await SagaSplats.load('scene.saga');
//     scene.add(film);
//     film.view.play();
//
// The GaussianSplat of three.js 0.187 has no call that changes its splats: what
// has an underscore here are its own buffers.

import * as THREE from 'three/webgpu';
import { sRGBTransferEOTF, vec4 } from 'three/tsl';
import { GaussianSplat } from 'three/addons/objects/GaussianSplat.js';
import { createGaussianSplatGeometry, writeColorBytes, writeCovariance }
    from 'three/addons/utils/GaussianSplatUtils.js';
import { EngineView } from 'saga-web/engine.js';
import { holdCamera, placeCamera } from './saga_three.js';

// Returns `n` splats that show nothing.
const emptySplats = (n) => createGaussianSplatGeometry(new Float32Array(3 * n),
    new Float32Array(6 * n), new Uint8ClampedArray(4 * n));

export class SagaSplats extends GaussianSplat {
    // source: a URL or a File. options: simd and seconds, as in viewer.d.ts.
    static async load(source, options) {
        let film = null;
        const view = new EngineView((made) => film.take(made),
            { ...options, make: 'gaussians' });

        await view.open(source);
        film = new SagaSplats(view);
        return film;
    }

    constructor(view) {
        super(emptySplats(view.info.maxPrimitives));
        const sort = this.onBeforeRender, { colorNode } = this.material;

        this.frustumCulled = false;
        // The clock of the film; viewer.d.ts lists its events.
        this.view = view;
        // The renderer takes colours as linear light, which it encodes.
        this.material.colorNode = vec4(sRGBTransferEOTF(colorNode.rgb),
            colorNode.a);
        // The splats' colours depend on the position of the camera.
        this.onBeforeRender = (renderer, scene, camera) => {
            if (!renderer.isWebGPURenderer)
                throw new Error('SagaSplats are drawn by a WebGPURenderer; a ' +
                    'WebGLRenderer draws a SagaMesh of saga-three');
            const eye = camera.getWorldPosition(new THREE.Vector3());

            view.lookFromPlace(this.worldToLocal(eye).toArray());
            sort(renderer, scene, camera);
        };
    }

    take({ bytes, nSplats: n }) {
        const { position, covariance, color } = this.splatGeometry.attributes;
        const [mean, scale, turn, colour] = [0, 1, 2, 3].map(
            (i) => new Float32Array(bytes.buffer, 16 * i * n, 4 * n));

        // The splats beyond n are at the first one's place and show nothing; if
        // there is none, all stay where they are.
        if (n === 0)
            color.array.fill(0);
        for (let i = 0; n > 0 && i < position.count; i++) {
            const k = i < n ? 4 * i : 0, size = Number(i < n);

            for (let axis = 0; axis < 3; axis++)
                position.array[3 * i + axis] = mean[k + axis];
            writeCovariance(covariance.array, 6 * i, size * scale[k],
                size * scale[k + 1], size * scale[k + 2],
                turn[k + 1], turn[k + 2], turn[k + 3], turn[k]);
            writeColorBytes(color.array, 4 * i, 255 * colour[k],
                255 * colour[k + 1], 255 * colour[k + 2],
                255 * size * mean[k + 3]);
        }
        this.fill();
        this.computeBoundingSphere();
        this._sortInitialized = false;
    }

    // Copies the geometry to the buffers of the renderer.
    fill() {
        const { position, covariance, color } = this.splatGeometry.attributes;
        const { centerRead, covarianceARead, covarianceBRead, colorRead } =
            this._buffers;
        const copy = ({ value }, source, first, n) => {
            for (let i = 0; i < source.count; i++)
                for (let k = 0; k < n; k++)
                    value.array[4 * i + k] =
                        source.array[source.itemSize * i + first + k];
            value.needsUpdate = true;
        };

        copy(centerRead, position, 0, 3);
        copy(covarianceARead, covariance, 0, 4);
        copy(covarianceBRead, covariance, 4, 2);
        colorRead.value.array.set(new Uint32Array(color.array.buffer));
        colorRead.value.needsUpdate = true;
        for (const { value } of [centerRead, covarianceARead, covarianceBRead,
            colorRead])
            if (value.pbo) // of the WebGL2 backend
                value.pbo.needsUpdate = true;
    }

    placeCamera(camera, index = this.view.start) {
        placeCamera(this, camera, index);
    }

    holdCamera(camera) {
        holdCamera(this, camera);
    }

    dispose() {
        this.view.clear();
        // The buffers and the kernels of the sort have no dispose() of theirs.
        for (const { value } of Object.values({ ...this._buffers,
            ...this._sort }).filter((node) => node?.value?.isBufferAttribute)) {
            value.pbo?.dispose();
            value.dispose();
        }
        for (const kernel of ['reset', 'histogram', 'prefix', 'scatter'])
            this._sort?.[`_${kernel}Node`]?.dispose();
        this.geometry.dispose();
        this.material.dispose();
    }
}
