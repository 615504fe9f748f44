// SPDX-License-Identifier: MIT
//
// A .saga film as an object of a three.js scene, drawn by its WebGLRenderer:
//
//     const film = await SagaMesh.load('scene.saga');
//     scene.add(film);
//     film.placeCamera(camera);
//     film.view.play();
//
// The object has the capture's units. Opaque objects hide it according to the
// depth of each splat, and it hides them.
//
// The decoder mixes splats as sRGB. Passes that encode colours at their end want
// linear light; what they have drawn so far is therefore encoded before the
// film is drawn over it, and decoded afterwards.

import * as THREE from 'three';
import { EngineView, FLOATS, FRAGMENT_GLSL, VERTEX_GLSL, floatsOf }
    from 'saga-web/engine.js';

// The lines with # are three's own, for a logarithmic depth buffer.
const VERTEX = `#include <common>
#include <logdepthbuf_pars_vertex>
${VERTEX_GLSL}
in vec4 place;
in vec3 chol;
in vec3 colour;

void main() {
    gl_Position = saga_place(position.xy, place, chol, colour);
#include <logdepthbuf_vertex>
}`;

const FRAGMENT = `#include <common>
#include <logdepthbuf_pars_fragment>
${FRAGMENT_GLSL}
out vec4 mixed;

void main() {
#include <logdepthbuf_fragment>
    mixed = saga_mixed();
}`;

const RECODE_VERTEX = `
void main() {
    gl_Position = vec4(position.xy, 0.0, 1.0);
}`;

const RECODE_FRAGMENT = `
uniform sampler2D was;
uniform bool encodes;
out vec4 recoded;

void main() {
    vec4 c = max(texelFetch(was, ivec2(gl_FragCoord.xy), 0), 0.0);
    recoded = encodes ? sRGBTransferOETF(c) : sRGBTransferEOTF(c);
}`;

// Encodes the colours of a target as sRGB, and decodes them again.
class Recoder {
    constructor() {
        const geometry = new THREE.BufferGeometry();
        const material = new THREE.ShaderMaterial({
            glslVersion: THREE.GLSL3, vertexShader: RECODE_VERTEX,
            fragmentShader: RECODE_FRAGMENT, depthTest: false,
            depthWrite: false, blending: THREE.NoBlending,
            uniforms: { was: { value: null }, encodes: { value: false } },
        });

        geometry.setAttribute('position', new THREE.BufferAttribute(
            new Float32Array([-1, -1, 0, 3, -1, 0, -1, 3, 0]), 3));
        this.triangle = new THREE.Mesh(geometry, material);
        this.triangle.frustumCulled = false;
        this.camera = new THREE.Camera();
        this.copy = null; // of the target's colours
    }

    // Samples of a pixel cannot be copied.
    static takes(target) {
        return target?.isWebGLRenderTarget && !target.samples;
    }

    run(renderer, encodes) {
        const { width, height, texture } = renderer.getRenderTarget();
        const { triangle, camera } = this, { autoClear } = renderer;
        const { uniforms } = triangle.material;

        if (this.copy?.image.width !== width ||
            this.copy.image.height !== height ||
            this.copy.type !== texture.type) {
            this.copy?.dispose();
            this.copy = new THREE.FramebufferTexture(width, height);
            this.copy.type = texture.type;
        }
        renderer.copyFramebufferToTexture(this.copy);
        uniforms.was.value = this.copy;
        uniforms.encodes.value = encodes;
        renderer.autoClear = false;
        renderer.render(triangle, camera);
        renderer.autoClear = autoClear;
    }

    dispose() {
        this.copy?.dispose();
        this.triangle.geometry.dispose();
        this.triangle.material.dispose();
    }
}

// Returns whether what a renderer draws is taken as linear light. The canvas
// gets sRGB; a pass after it encodes what is drawn to other targets.
function isLinear(renderer) {
    const target = renderer.getRenderTarget();
    const space = target === null ? renderer.outputColorSpace
        : target.isXRRenderTarget ? target.texture.colorSpace
            : THREE.LinearSRGBColorSpace;

    return space === THREE.LinearSRGBColorSpace;
}

// Returns the rectangle in which a renderer draws. Until it is given a size,
// that is the whole canvas, which the renderer tells as nothing.
function viewportOf(renderer, viewport) {
    const { z } = renderer.getCurrentViewport(viewport);
    const { width, height } = renderer.domElement;

    return z ? viewport : viewport.set(0, 0, width, height);
}

function makeMaterial() {
    const uniforms = { saga_to_clip: new THREE.Matrix4(),
        saga_size: new THREE.Vector2(1, 1),
        saga_viewport: new THREE.Vector4(), saga_tools: 0,
        saga_linear: 0 };

    return new THREE.ShaderMaterial({
        glslVersion: THREE.GLSL3, vertexShader: VERTEX, fragmentShader: FRAGMENT,
        uniforms: Object.fromEntries(Object.entries(uniforms).map(
            ([name, value]) => [name, { value }])),
        transparent: true, depthWrite: false, side: THREE.DoubleSide,
        toneMapped: false, blending: THREE.CustomBlending,
        blendSrc: THREE.OneFactor, blendDst: THREE.OneMinusSrcAlphaFactor,
    });
}

// Makes an instance for each splat: a square of four corners, with the splat's
// values from floatsOf as attributes.
function makeGeometry(floats, nSplats) {
    const geometry = new THREE.InstancedBufferGeometry();
    const buffer = new THREE.InstancedInterleavedBuffer(floats, FLOATS);

    buffer.setUsage(THREE.StreamDrawUsage);
    geometry.setAttribute('position', new THREE.BufferAttribute(
        new Float32Array([-1, -1, 0, 1, -1, 0, -1, 1, 0, 1, 1, 0]), 3));
    geometry.setIndex([0, 1, 2, 2, 1, 3]);
    for (const [name, n, at] of [['place', 4, 0], ['chol', 3, 4],
        ['colour', 3, 7]])
        geometry.setAttribute(name,
            new THREE.InterleavedBufferAttribute(buffer, n, at));
    geometry.instanceCount = nSplats;
    return geometry;
}

// Moves a PerspectiveCamera to a camera of the film's rig.
export function placeCamera(film, camera, index) {
    const { fov, matrix } = film.view.rigPlace(index);

    film.updateWorldMatrix(true, false);
    new THREE.Matrix4().fromArray(matrix).premultiply(film.matrixWorld)
        .decompose(camera.position, camera.quaternion, camera.scale);
    camera.scale.set(1, 1, 1);
    camera.fov = fov;
    camera.updateProjectionMatrix();
    camera.updateMatrixWorld();
}

// Moves a camera that is outside the film's viewing volume to the nearest place
// in it.
export function holdCamera(film, camera) {
    film.updateWorldMatrix(true, false);
    const at = camera.getWorldPosition(new THREE.Vector3());
    const eye = film.worldToLocal(at).toArray(), held = film.view.held(eye);

    if (held === eye)
        return;
    camera.position.copy(film.localToWorld(new THREE.Vector3(...held)));
    camera.parent?.worldToLocal(camera.position);
    camera.updateMatrixWorld();
}

export class SagaMesh extends THREE.Mesh {
    // source: a URL or a File. options: simd and seconds, as in viewer.d.ts.
    static async load(source, options) {
        const film = new SagaMesh(options);

        await film.view.open(source);
        return film;
    }

    constructor(options) {
        super(makeGeometry(new Float32Array(FLOATS), 0), makeMaterial());
        this.frustumCulled = false;
        this.viewport = new THREE.Vector4();
        this.modelView = new THREE.Matrix4();
        this.recoder = new Recoder();
        this.isEncoded = false; // the target's colours are, while it is drawn
        this.values = null; // the camera for which the splats were made
        // The clock of the film; viewer.d.ts lists its events.
        this.view = new EngineView((splats) => this.take(splats), options);
    }

    take(splats) {
        const { uniforms } = this.material;

        this.geometry.dispose();
        this.geometry = makeGeometry(floatsOf(splats), splats.nSplats);
        uniforms.saga_size.value.set(splats.width, splats.height);
        uniforms.saga_tools.value = splats.tools;
        this.values = splats.values;
    }

    onBeforeRender(renderer, scene, camera) {
        if (!renderer.isWebGLRenderer)
            throw new Error('a SagaMesh is drawn by a WebGLRenderer; a ' +
                'WebGPURenderer draws SagaSplats of saga-three/splats.js');
        const { uniforms } = this.material;
        const { x, y, z, w } = viewportOf(renderer, this.viewport);
        const projection = camera.projectionMatrix.elements;
        const modelView = this.modelView.multiplyMatrices(
            camera.matrixWorldInverse, this.matrixWorld).elements;

        this.view.lookFrom(modelView, projection, Math.round(z), Math.round(w));
        uniforms.saga_viewport.value.set(x, y, z, w);
        this.isEncoded = isLinear(renderer) &&
            Recoder.takes(renderer.getRenderTarget());
        uniforms.saga_linear.value = Number(isLinear(renderer) &&
            !this.isEncoded);
        if (this.values)
            uniforms.saga_to_clip.value.fromArray(
                this.view.toClip(this.values, modelView, projection));
        this.material.uniformsNeedUpdate = true;
        if (this.isEncoded)
            this.recoder.run(renderer, true);
    }

    onAfterRender(renderer) {
        if (this.isEncoded)
            this.recoder.run(renderer, false);
    }

    placeCamera(camera, index = this.view.start) {
        placeCamera(this, camera, index);
    }

    holdCamera(camera) {
        holdCamera(this, camera);
    }

    dispose() {
        this.view.clear();
        this.recoder.dispose();
        this.geometry.dispose();
        this.material.dispose();
    }
}
