// SPDX-License-Identifier: MIT
//
// A viewer's film in a headset, by WebXR. The worker sorts and projects for one
// camera between the eyes whose field covers those of both. Each eye draws
// these splats in one call, reprojected by their depths (engine.js). A unit of
// the capture is a metre. The user starts upright at the viewer's camera, or at
// the place of the viewing volume that is nearest to it.
//
// As the head leaves the viewing volume, the picture gets dim, and in the end
// the film stands still until the head is back. The scene stays where it is in
// the room: in the dark, or in a picture that goes with the head, a user would
// lose balance and the way back. The brightness tells which way that is.

import * as cam from './camera.js';
import { FLOATS, FRAGMENT_GLSL, VERTEX_GLSL, floatsOf, product, toClip,
    valuesFrom } from './engine.js';
import { link } from './gpu.js';
import { onPage } from './viewer.js';
import { nearer, outside, shade } from './volume.js';

const MARGIN = 1.1; // widening of the field of view, since heads turn while
                    // splats are made
const DIM = 0.25;   // brightness far outside the viewing volume

const VERTEX = `#version 300 es
precision highp float;
${VERTEX_GLSL}
layout(location = 0) in vec4 place;
layout(location = 1) in vec3 chol;
layout(location = 2) in vec3 colour;

void main() {
    vec2 corner = vec2(gl_VertexID & 1, gl_VertexID >> 1) * 2.0 - 1.0;
    gl_Position = saga_place(corner, place, chol, colour);
}`;

const FRAGMENT = `#version 300 es
precision highp float;
${FRAGMENT_GLSL}
uniform float saga_shown;
out vec4 mixed;

void main() {
    mixed = saga_mixed();
    mixed.rgb *= saga_shown;
}`;

export async function hasHeadset() {
    try {
        return Boolean(await navigator.xr?.isSessionSupported('immersive-vr'));
    } catch {
        return false; // the page has no permission to ask
    }
}

// Draws the splats of the last picture for each eye.
class EyeScreen {
    constructor(gl) {
        this.gl = gl;
        this.takesSplats = true;
        this.made = null;
        this.program = link(gl, VERTEX, FRAGMENT, ['saga_to_clip', 'saga_size',
            'saga_viewport', 'saga_tools', 'saga_shown']);
        this.shown = 1; // brightness
        this.array = gl.createVertexArray();
        this.buffer = gl.createBuffer();
        gl.bindVertexArray(this.array);
        gl.bindBuffer(gl.ARRAY_BUFFER, this.buffer);
        for (const [i, n, at] of [[0, 4, 0], [1, 3, 4], [2, 3, 7]]) {
            gl.enableVertexAttribArray(i);
            gl.vertexAttribPointer(i, n, gl.FLOAT, false, 4 * FLOATS, 4 * at);
            gl.vertexAttribDivisor(i, 1);
        }
        gl.bindVertexArray(null);
    }

    showSplats(splats) {
        const { gl } = this;
        const { values, nSplats, background, tools } = splats;

        this.made = { values, nSplats, background, tools };
        gl.bindBuffer(gl.ARRAY_BUFFER, this.buffer);
        gl.bufferData(gl.ARRAY_BUFFER, floatsOf(splats), gl.STREAM_DRAW);
    }

    begin(framebuffer) {
        const { gl } = this;

        gl.bindFramebuffer(gl.FRAMEBUFFER, framebuffer);
        gl.clearColor(...this.made.background.map((x) => this.shown * x), 1);
        gl.clear(gl.COLOR_BUFFER_BIT);
    }

    // Draws for one eye with splats that were made for the camera in between.
    drawEye(clip, projection, { x, y, width, height }) {
        const { gl, program, made } = this;
        const [fx, fy] = made.values.slice(12, 14);

        gl.viewport(x, y, width, height);
        gl.useProgram(program.program);
        gl.uniformMatrix4fv(program.saga_to_clip, false, clip);
        gl.uniform2f(program.saga_size, 2 * fx / 65536 / projection[0],
            2 * fy / 65536 / projection[5]);
        gl.uniform4f(program.saga_viewport, x, y, width, height);
        gl.uniform1i(program.saga_tools, made.tools);
        gl.uniform1f(program.saga_shown, this.shown);
        gl.bindVertexArray(this.array);
        gl.enable(gl.BLEND);
        gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
        gl.drawArraysInstanced(gl.TRIANGLE_STRIP, 0, 4, made.nSplats);
        gl.disable(gl.BLEND);
        gl.bindVertexArray(null);
    }
}

// Returns the pose at which a session begins.
function startOf(viewer) {
    const { pose, viewingVolume: volume, bounds } = viewer;
    const centre = viewer.toMetres(pose.centre);

    return volume && bounds.isOn
        ? nearer(volume, { rotation: pose.rotation, centre }, 1)
        : { rotation: pose.rotation, centre };
}

// Returns the matrix that maps the capture's units to the headset's space,
// whose y is up, for a user who starts with the head at `head`, a matrix. The
// space's own origin may be anywhere in the room.
export function standing(viewer, head) {
    const { rotation, centre } = startOf(viewer), { up } = viewer;
    const level = (ahead, top) => cam.unit(
        cam.sub(ahead, cam.times(top, cam.dot(ahead, top))));
    const ahead = level(cam.forwardOf({ rotation }), up);
    const rows = [cam.cross(ahead, up), up, cam.times(ahead, -1)];
    const back = level(Array.from(head.slice(8, 11)), [0, 1, 0]);
    const place = [...cam.cross([0, 1, 0], back), 0, 0, 1, 0, 0, ...back, 0,
        ...head.slice(12)];

    return product(place, [0, 1, 2].flatMap((k) =>
        [...rows.map((row) => row[k]), 0]).concat(
        rows.map((row) => -cam.dot(row, centre)), 1));
}

// Returns the field of view, from the point between the eyes, that covers the
// fields of all eyes. It has the tangents of the left, right, bottom and top
// edge.
function fieldOf({ transform, views }) {
    const field = [Infinity, -Infinity, Infinity, -Infinity];

    for (const { projectionMatrix: p, transform: { matrix } } of views) {
        const turn = product(transform.inverse.matrix, matrix);

        for (const [x, y] of [[-1, -1], [1, -1], [-1, 1], [1, 1]]) {
            const at = [(x + p[8]) / p[0], (y + p[9]) / p[5], -1];
            const [right, up, back] = [0, 1, 2].map((i) =>
                turn[i] * at[0] + turn[4 + i] * at[1] + turn[8 + i] * at[2]);

            field[0] = Math.min(field[0], -right / back);
            field[1] = Math.max(field[1], -right / back);
            field[2] = Math.min(field[2], -up / back);
            field[3] = Math.max(field[3], -up / back);
        }
    }
    return field.map((x) => MARGIN * x);
}

// Returns the camera between the eyes, with the pixel density of the first
// eye's picture.
function valuesBetween(viewer, model, pose, { width, height }) {
    const [l, r, b, t] = fieldOf(pose);
    const [{ projectionMatrix: p }] = pose.views;
    const projection = new Float32Array(16);

    projection[0] = 2 / (r - l);
    projection[5] = 2 / (t - b);
    projection[8] = (r + l) / (r - l);
    projection[9] = (t + b) / (t - b);
    return valuesFrom(viewer, product(pose.transform.inverse.matrix, model),
        projection, Math.round(width * p[0] * (r - l) / 2),
        Math.round(height * p[5] * (t - b) / 2));
}

// Returns how far a head is outside the viewing volume; it may look anywhere.
function outsideOf(viewer, values) {
    const { viewingVolume: volume, bounds } = viewer;

    return volume && bounds.isOn
        ? outside(volume, viewer.toMetres(cam.poseOf(values).centre)) : 0;
}

// Shows the film in the headset. It must be called at a click or key. The
// headset's own button plays and pauses. Resolves to the session.
export async function enterHeadset(viewer) {
    const session = await navigator.xr.requestSession('immersive-vr');
    const { screen: page, exact } = viewer, { gl } = page;
    const screen = new EyeScreen(gl);
    let model = null, isHeld = false; // isHeld: the film waits for the head

    await gl.makeXRCompatible();
    const layer = new XRWebGLLayer(session, gl,
        { antialias: false, depth: false, alpha: false });

    session.updateRenderState({ baseLayer: layer });
    const space = await session.requestReferenceSpace('local');
    const draw = (now, frame) => {
        const pose = frame.getViewerPose(space);

        session.requestAnimationFrame(draw);
        if (!pose || !viewer.info)
            return;
        model ??= standing(viewer, pose.transform.matrix);
        const values = valuesBetween(viewer, model, pose,
            layer.getViewport(pose.views[0]));

        viewer.want(values);
        const out = shade(outsideOf(viewer, values));

        screen.shown = 1 - (1 - DIM) * out;
        if (out === 1 && viewer.playing) {
            viewer.pause();
            isHeld = true;
        } else if (out < 0.5 && isHeld) {
            viewer.play();
            isHeld = false;
        }
        if (!screen.made)
            return;
        screen.begin(layer.framebuffer);
        for (const view of pose.views)
            screen.drawEye(toClip(viewer, screen.made.values,
                product(view.transform.inverse.matrix, model),
                view.projectionMatrix), view.projectionMatrix,
            layer.getViewport(view));
    };

    // The user has chosen a new middle of the room.
    space.addEventListener('reset', () => {
        model = null;
    });
    session.addEventListener('select', () => {
        if (isHeld)
            isHeld = false; // a film that stands is not to go on
        else if (viewer.playing)
            viewer.pause();
        else
            viewer.play();
    });
    session.addEventListener('end', () => {
        viewer.screen = page;
        viewer.setExact(exact);
        viewer.setClock(onPage);
        viewer.want(null);
        if (isHeld)
            viewer.play();
    });
    viewer.screen = screen;
    viewer.setExact(false);
    viewer.setClock((call) => session.requestAnimationFrame(call));
    session.requestAnimationFrame(draw);
    return session;
}
