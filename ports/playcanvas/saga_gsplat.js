// SPDX-License-Identifier: MIT
//
// A .saga film as an asset of the engine's own type for splats. This is a
// parser for its gsplat handler, which has others for PLY and SOG.
//
//     app.loader.getHandler('gsplat').addParser(new SagaParser(app));
//     const asset = new pc.Asset('film', 'gsplat', { url: 'scene.saga' });
//     app.assets.add(asset);
//     asset.ready(() => {
//         entity.addComponent('gsplat', { asset });
//         asset.resource.view.play();
//     });
//     app.assets.load(asset);

import * as pc from 'playcanvas';
import { EngineView } from 'saga-web/engine.js';

// The names of the textures. Each holds one of the planes that gaussians.js
// makes.
const PLANES = ['sagaMean', 'sagaScale', 'sagaTurn', 'sagaColour'];

function formatFor(device) {
    return new pc.GSplatFormat(device, PLANES.map(
        (name) => ({ name, format: pc.PIXELFORMAT_RGBA32F })), {
        readGLSL: `
vec3 getCenter() { return loadSagaMean().xyz; }
vec4 getColor() { return vec4(loadSagaColour().rgb, loadSagaMean().w); }
vec3 getScale() { return loadSagaScale().xyz; }
vec4 getRotation() { return loadSagaTurn(); }
`,
        readWGSL: `
fn getCenter() -> vec3f { return loadSagaMean().xyz; }
fn getColor() -> vec4f { return vec4f(loadSagaColour().rgb, loadSagaMean().w); }
fn getScale() -> vec3f { return loadSagaScale().xyz; }
fn getRotation() -> vec4f { return loadSagaTurn(); }
`,
    });
}

// The splats of the film at the time of the view's clock.
export class SagaSplats extends pc.GSplatContainer {
    constructor(app, view) {
        const { info } = view;
        const half = 2 ** 23 * info.unit; // half the size of the cube

        super(app.graphicsDevice, info.maxPrimitives + 1,
            formatFor(app.graphicsDevice));
        this.aabb = new pc.BoundingBox(new pc.Vec3(info.centre),
            new pc.Vec3(half, half, half));
        this.view = view;
        this.app = app;
        this.more = 0;
        this.owner = null; // the gsplat component that shows these splats
        this.toFilm = new pc.Mat4();
        this.update(0);
        this.handle = app.scene.on('prerender', (camera) => this.look(camera));
    }

    take({ bytes, nSplats }) {
        const planes = new Float32Array(bytes.buffer, 0, 16 * nSplats);
        const { centers } = this;

        for (const [i, name] of PLANES.entries()) {
            const texture = this.getTexture(name);

            const floats = texture.lock();

            floats.set(planes.subarray(4 * nSplats * i, 4 * nSplats * (i + 1)));
            floats.fill(0, 4 * nSplats, 4 * nSplats + 4);
            texture.unlock();
        }
        // The engine sorts the splats by their centers.
        for (let i = 0; i < nSplats; i++)
            centers.set(planes.subarray(4 * i, 4 * i + 3), 3 * i);
        // The engine draws a copy of the textures, which it makes anew only if
        // the number of splats changes. The last one is empty.
        this.more = 1 - this.more;
        this.update(nSplats + this.more);
    }

    // Called before a camera is drawn. Colours depend on its position.
    look(camera) {
        if (this.owner?.resource !== this)
            this.owner = this.app.root.findComponents('gsplat').find(
                ({ resource }) => resource === this);
        if (!this.owner)
            return;
        const place = this.toFilm.copy(this.owner.entity.getWorldTransform())
            .invert().transformPoint(camera.entity.getPosition());

        this.view.lookFromPlace([place.x, place.y, place.z]);
    }

    destroy() {
        this.handle.off();
        this.view.clear();
        super.destroy();
    }
}

export class SagaParser {
    // options: simd and seconds, as in viewer.d.ts.
    constructor(app, options) {
        this.app = app;
        this.options = options;
    }

    canParse({ ext }) {
        return ext === 'saga';
    }

    async load(url, callback, asset) {
        let splats = null;
        const view = new EngineView((made) => splats.take(made),
            { ...this.options, make: 'gaussians' });

        view.addEventListener('progress', ({ detail: { got, nbytes } }) =>
            asset?.fire('progress', got, nbytes));
        try {
            await view.open(url.load);
            splats = new SagaSplats(this.app, view);
            callback(null, splats);
        } catch (error) {
            callback(error.message);
        }
    }

    open(url, data) {
        return data;
    }
}
