// SPDX-License-Identifier: MIT
//
// A .saga film as an entity of a PlayCanvas scene, drawn with WebGL2:
//
//     const film = await SagaEntity.load(app, 'scene.saga');
//     app.root.addChild(film.entity);
//     film.placeCamera(camera);
//     film.view.play();
//
// The entity has the capture's units. Opaque objects hide it according to the
// depth of each splat, and it hides them.

import * as pc from 'playcanvas';
import { EngineView, FLOATS, FRAGMENT_GLSL, VERTEX_GLSL, floatsOf }
    from 'saga-web/engine.js';
import { Recoder } from './recoder.js';

const VERTEX = `${VERTEX_GLSL}
attribute vec3 corner;
attribute vec4 place;
attribute vec3 chol;
attribute vec3 colour;

void main() {
    gl_Position = saga_place(corner.xy, place, chol, colour);
}`;

const FRAGMENT = `${FRAGMENT_GLSL}
void main() {
    gl_FragColor = saga_mixed();
}`;

// The vertex attributes of a splat: its values from floatsOf.
const SPLAT = [['place', pc.SEMANTIC_ATTR12, 4], ['chol', pc.SEMANTIC_ATTR13, 3],
    ['colour', pc.SEMANTIC_ATTR14, 3]];

function makeMaterial() {
    const material = new pc.ShaderMaterial({
        uniqueName: 'saga', vertexGLSL: VERTEX, fragmentGLSL: FRAGMENT,
        attributes: { corner: pc.SEMANTIC_POSITION, ...Object.fromEntries(
            SPLAT.map(([name, semantic]) => [name, semantic])) },
    });

    material.blendState = new pc.BlendState(true, pc.BLENDEQUATION_ADD,
        pc.BLENDMODE_ONE, pc.BLENDMODE_ONE_MINUS_SRC_ALPHA);
    material.depthWrite = false;
    material.cull = pc.CULLFACE_NONE;
    material.update();
    return material;
}

function makeSquare(device) {
    const mesh = new pc.Mesh(device);

    mesh.setPositions([-1, -1, 0, 1, -1, 0, -1, 1, 0, 1, 1, 0]);
    mesh.setIndices([0, 1, 2, 2, 1, 3]);
    mesh.update(pc.PRIMITIVE_TRIANGLES);
    return mesh;
}

// Moves an entity with a camera to a camera of the film's rig.
export function placeCamera({ entity, view }, camera, index) {
    const { fov, matrix } = view.rigPlace(index);
    const place = new pc.Mat4();

    place.data.set(matrix);
    place.mul2(entity.getWorldTransform(), place);
    camera.setPosition(place.getTranslation());
    camera.setRotation(new pc.Quat().setFromMat4(place));
    camera.camera.fov = fov;
}

// Moves an entity with a camera that is outside the film's viewing volume to
// the nearest place in it.
export function holdCamera({ entity, view }, camera) {
    const world = entity.getWorldTransform();
    const { x, y, z } = new pc.Mat4().copy(world).invert().transformPoint(
        camera.getPosition());
    const eye = [x, y, z], held = view.held(eye);

    if (held !== eye)
        camera.setPosition(world.transformPoint(new pc.Vec3(...held)));
}

export class SagaEntity {
    // source: a URL or a File. options: simd and seconds, as in viewer.d.ts.
    static async load(app, source, options) {
        const film = new SagaEntity(app, options);

        await film.view.open(source);
        return film;
    }

    constructor(app, options) {
        const device = app.graphicsDevice;

        this.device = device;
        this.recoder = Recoder.of(app);
        this.format = new pc.VertexFormat(device, SPLAT.map(
            ([, semantic, components]) => ({ semantic, components,
                type: pc.TYPE_FLOAT32 })));
        this.instance = new pc.MeshInstance(makeSquare(device), makeMaterial());
        this.instance.cull = false;
        this.instance.visible = false;
        this.buffer = null;
        this.entity = new pc.Entity('saga');
        this.entity.addComponent('render', { meshInstances: [this.instance],
            castShadows: false, receiveShadows: false,
            layers: [this.recoder.film.id] });
        this.modelView = new pc.Mat4();
        this.values = null; // the camera for which the splats were made
        // The clock of the film; viewer.d.ts lists its events.
        this.view = new EngineView((splats) => this.take(splats), options);
        this.handles = [
            app.scene.on('prerender', (camera) => this.look(camera)),
            app.scene.on('prerender:layer', (camera, layer) =>
                layer === this.recoder.film && this.aim(camera)),
        ];
    }

    take(splats) {
        const { instance } = this;
        const data = floatsOf(splats);

        this.values = splats.values;
        instance.visible = splats.nSplats > 0;
        if (!instance.visible)
            return;
        this.buffer?.destroy();
        this.buffer = new pc.VertexBuffer(this.device, this.format,
            data.length / FLOATS, { data: data.buffer });
        instance.setInstancing(this.buffer);
        instance.instancingCount = splats.nSplats;
        instance.setParameter('saga_size', [splats.width, splats.height]);
        instance.setParameter('saga_tools', splats.tools);
    }

    // Called before a camera is drawn.
    look(camera) {
        const { device, view } = this;

        this.recoder.join(camera);
        const { z, w } = camera.rect;
        const size = [z * device.width, w * device.height].map(Math.round);
        const projection = camera.projectionMatrix.data;
        const modelView = this.modelView.mul2(camera.viewMatrix,
            this.entity.getWorldTransform()).data;

        view.lookFrom(modelView, projection, ...size);
        if (!this.values)
            return;
        this.instance.setParameter('saga_to_clip', Float32Array.from(
            view.toClip(this.values, modelView, projection)));
    }

    // Called before it is drawn to a target, which in a frame of passes may be
    // smaller than the screen, and then is encoded as sRGB at the end.
    aim({ rect, shaderParams }) {
        const { width, height } = this.device.renderTarget ?? this.device;

        this.instance.setParameter('saga_viewport', [rect.x * width,
            rect.y * height, rect.z * width, rect.w * height]);
        this.instance.setParameter('saga_linear', Number(
            shaderParams.shaderOutputGamma === pc.GAMMA_NONE &&
            !this.recoder.isEncoded));
    }

    placeCamera(camera, index = this.view.start) {
        placeCamera(this, camera, index);
    }

    holdCamera(camera) {
        holdCamera(this, camera);
    }

    destroy() {
        this.handles.forEach((handle) => handle.off());
        this.view.clear();
        this.entity.destroy();
        this.buffer?.destroy();
    }
}
