// SPDX-License-Identifier: MIT
//
// A .saga film for Spark, which draws Gaussian splats in scenes of three.js and
// sorts the film's splats together with all others:
//
//     const spark = new SparkRenderer({ renderer });
//     const film = await SagaSplatMesh.load('scene.saga');
//     scene.add(spark, film);
//     film.view.play();

import * as THREE from 'three';
import { ExtSplats, SplatMesh, utils } from '@sparkjsdev/spark';
import { EngineView } from 'saga-web/engine.js';
import { placeCamera } from './saga_three.js';

// Returns empty splats of Spark's float format, at least `least`, in textures
// of the size that Spark uses for this number.
function emptySplats(least) {
    const { maxSplats } = utils.getTextureSize(least);
    const extArrays = [0, 1].map(() => new Uint32Array(4 * maxSplats));

    return new ExtSplats({ extArrays, numSplats: 0 });
}

export class SagaSplatMesh extends SplatMesh {
    // source: a URL or a File. options: simd and seconds, as in viewer.d.ts.
    static async load(source, options) {
        let film = null;
        const view = new EngineView((made) => film.take(made),
            { ...options, make: 'gaussians' });

        await view.open(source);
        film = new SagaSplatMesh(view);
        await film.initialized;
        return film;
    }

    constructor(view) {
        super({ extSplats: emptySplats(view.info.maxPrimitives + 1),
            raycastable: false });
        // The clock of the film; viewer.d.ts lists its events.
        this.view = view;
        this.more = 0;
    }

    take({ bytes, nSplats: n }) {
        const { extSplats } = this;
        const [mean, scale, turn, colour] = [0, 1, 2, 3].map(
            (i) => new Float32Array(bytes.buffer, 16 * i * n, 4 * n));

        for (let i = 0, k = 0; i < n; i++, k += 4)
            utils.encodeExtSplat(extSplats.extArrays, i,
                mean[k], mean[k + 1], mean[k + 2],
                scale[k], scale[k + 1], scale[k + 2],
                turn[k + 1], turn[k + 2], turn[k + 3], turn[k],
                mean[k + 3], colour[k], colour[k + 1], colour[k + 2]);
        for (const ints of extSplats.extArrays)
            ints.fill(0, 4 * n, 4 * n + 4);
        // Spark shows the old splats until it has sorted the new ones, but only
        // if their number changes. The last one is empty.
        this.more = 1 - this.more;
        extSplats.numSplats = n + this.more;
        for (const texture of extSplats.textures)
            texture.needsUpdate = true;
        this.updateVersion();
    }

    // Spark calls this before it draws. The splats' colours depend on the
    // position of its camera.
    update(context) {
        const eye = new THREE.Vector3().setFromMatrixPosition(
            context.viewToWorld);

        this.view.lookFromPlace(this.worldToLocal(eye).toArray());
        super.update(context);
    }

    placeCamera(camera, index = this.view.start) {
        placeCamera(this, camera, index);
    }

    dispose() {
        this.view.clear();
        super.dispose();
    }
}
