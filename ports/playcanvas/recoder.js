// SPDX-License-Identifier: MIT
//
// Layers for films in scenes that a CameraFrame draws.
//
// The decoder mixes splats as sRGB. A frame of passes wants linear light, which
// it encodes at its end; what it has drawn before the film is therefore encoded
// by a triangle in a layer before the film's, and decoded by one in a layer
// after it. In a frame's default format, of 11 and 10 bits, the many splats of
// a pixel would lose more by rounding than mixing them as linear light costs.

import * as pc from 'playcanvas';

// The engine encodes with this exponent instead of the curve of sRGB.
const GAMMA = 2.2;

const VERTEX = `
attribute vec3 corner;
uniform float saga_power;

void main() { // nothing, if the power is 0
    gl_Position = saga_power > 0.0 ? vec4(corner.xy, 0.0, 1.0) : vec4(0.0);
}`;

const FRAGMENT = `
uniform sampler2D saga_was;
uniform float saga_power;

void main() {
    vec4 c = max(texelFetch(saga_was, ivec2(gl_FragCoord.xy), 0), 0.0);
    gl_FragColor = vec4(pow(c.rgb, vec3(saga_power)), c.a);
}`;

function makeTriangle(device) {
    const mesh = new pc.Mesh(device);
    const material = new pc.ShaderMaterial({
        uniqueName: 'saga-recode', vertexGLSL: VERTEX, fragmentGLSL: FRAGMENT,
        attributes: { corner: pc.SEMANTIC_POSITION },
    });

    mesh.setPositions([-1, -1, 0, 3, -1, 0, -1, 3, 0]);
    mesh.update(pc.PRIMITIVE_TRIANGLES);
    material.depthTest = material.depthWrite = false;
    material.cull = pc.CULLFACE_NONE;
    material.update();
    const triangle = new pc.MeshInstance(mesh, material, new pc.GraphNode());

    triangle.cull = false;
    triangle.setParameter('saga_power', 0);
    return triangle;
}

const recoders = new WeakMap(); // application -> Recoder

export class Recoder {
    // Films of an application share their layers.
    static of(app) {
        if (!recoders.has(app))
            recoders.set(app, new Recoder(app));
        return recoders.get(app);
    }

    constructor(app) {
        const { scene, graphicsDevice: device } = app, { layers } = scene;
        const world = layers.getLayerById(pc.LAYERID_WORLD);
        const [before, film, after] = ['saga-encode', 'saga', 'saga-decode']
            .map((name) => new pc.Layer({ name }));
        const at = layers.getTransparentIndex(world) + 1;

        this.device = device;
        this.copy = null; // a target with a copy of what is drawn
        this.film = film;
        this.ids = [before, film, after].map(({ id }) => id);
        this.isEncoded = false; // what is drawn is, in the film's layer
        layers.insertOpaque(before, at);
        layers.insertTransparent(film, at + 1);
        layers.insertOpaque(after, at + 2);
        const [encode, decode] = [before, after].map((layer) => {
            const triangle = makeTriangle(device);

            layer.addMeshInstances([triangle]);
            return triangle;
        });

        scene.on('prerender:layer', ({ shaderParams }, layer, transparent) => {
            if (transparent)
                return;
            if (layer === before) {
                // The screen itself has no colour buffer that can be read.
                const target = this.device.renderTarget?.colorBuffer;

                this.isEncoded = shaderParams.shaderOutputGamma ===
                    pc.GAMMA_NONE && Boolean(target) &&
                    target.format !== pc.PIXELFORMAT_111110F &&
                    film.meshInstances.some((m) => m.visible);
                this.run(encode, 1 / GAMMA);
            } else if (layer === after) {
                this.run(decode, GAMMA);
                this.isEncoded = false;
            }
        });
    }

    // A camera that draws the scene's own objects draws films, too.
    join(camera) {
        if (camera.layers.includes(pc.LAYERID_WORLD) &&
            !camera.layers.includes(this.film.id))
            camera.layers = [...camera.layers, ...this.ids];
    }

    run(triangle, power) {
        triangle.setParameter('saga_power', this.isEncoded ? power : 0);
        if (!this.isEncoded)
            return;
        const { renderTarget } = this.device;
        const { width, height, format } = renderTarget.colorBuffer;
        const was = this.copy?.colorBuffer;

        if (was?.width !== width || was.height !== height ||
            was.format !== format) {
            this.copy?.destroyTextureBuffers();
            this.copy?.destroy();
            this.copy = new pc.RenderTarget({ depth: false,
                colorBuffer: new pc.Texture(this.device, { name: 'saga', width,
                    height, format, mipmaps: false,
                    minFilter: pc.FILTER_NEAREST,
                    magFilter: pc.FILTER_NEAREST }) });
        }
        this.device.copyRenderTarget(renderTarget, this.copy, true, false);
        triangle.setParameter('saga_was', this.copy.colorBuffer);
    }
}
