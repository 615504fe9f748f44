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

// Returns whether what a renderer draws is taken as linear light. The canvas
// gets sRGB; a pass after it encodes what is drawn to other targets.
function isLinear(renderer) {
    const target = renderer.getRenderTarget();
    const space = target === null ? renderer.outputColorSpace
        : target.isXRRenderTarget ? target.texture.colorSpace
            : THREE.LinearSRGBColorSpace;

    return space === THREE.LinearSRGBColorSpace;
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
        const { uniforms } = this.material;
        const { x, y, z, w } = renderer.getCurrentViewport(this.viewport);
        const projection = camera.projectionMatrix.elements;
        const modelView = this.modelView.multiplyMatrices(
            camera.matrixWorldInverse, this.matrixWorld).elements;

        this.view.lookFrom(modelView, projection, Math.round(z), Math.round(w));
        uniforms.saga_viewport.value.set(x, y, z, w);
        uniforms.saga_linear.value = Number(isLinear(renderer));
        if (this.values)
            uniforms.saga_to_clip.value.fromArray(
                this.view.toClip(this.values, modelView, projection));
        this.material.uniformsNeedUpdate = true;
    }

    placeCamera(camera, index = this.view.start) {
        placeCamera(this, camera, index);
    }

    dispose() {
        this.view.clear();
        this.geometry.dispose();
        this.material.dispose();
    }
}
