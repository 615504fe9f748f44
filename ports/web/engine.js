// SPDX-License-Identifier: MIT
//
// A film in a scene that another engine draws: ports/three and
// ports/playcanvas. The viewer has the clock, the workers and the file; the
// engine has the camera. Matrices are 4x4, stored by columns, as in WebGL.
//
// The decoder sorts and projects for the camera of the last request. Until the
// next splats come, `toClip` reprojects the last ones by their depths to the
// engine's present camera, so that they stay among the engine's own objects.

import * as cam from './camera.js';
import { SHAPE_GLSL } from './gpu.js';
import { Viewer } from './viewer.js';
import { eyeAt, inside, outside, placeOf } from './volume.js';

const SPLAT_INTS = 11;     // 32-bit integers of a saga_splat of saga.h
export const FLOATS = 10;  // floats of a splat that `floatsOf` returns

// Returns the splats from back to front, because engines blend in this order.
// Each has its mean in pixels, its depth in box units, q0; the conic's factor
// g, n, h; and its colour.
export function floatsOf({ bytes, nSplats }) {
    const ints = new Int32Array(bytes.buffer, bytes.byteOffset,
        SPLAT_INTS * nSplats);
    const floats = new Float32Array(FLOATS * nSplats);
    let from = SPLAT_INTS * nSplats;

    for (let to = 0; to < floats.length; to += FLOATS) {
        from -= SPLAT_INTS;
        floats[to] = ints[from] / 2 ** 8;
        floats[to + 1] = ints[from + 1] / 2 ** 8;
        floats[to + 2] = ints[from + 6];
        floats[to + 3] = ints[from + 5] / 2 ** 20;
        for (let i = 2; i < 5; i++)
            floats[to + 2 + i] = ints[from + i] / 2 ** 28;
        floats[to + 7] = (ints[from + 7] & 65535) / 32768;
        floats[to + 8] = (ints[from + 7] >>> 16) / 32768;
        floats[to + 9] = (ints[from + 8] & 65535) / 32768;
    }
    return floats;
}

// An engine's vertex shader calls saga_place, its fragment shader saga_mixed;
// the viewport is the rectangle in which the engine draws, in pixels; the tools
// are those of the splats. saga_linear is 1 if the engine takes what is drawn as
// linear light and encodes it later, else 0.
export const VERTEX_GLSL = `
uniform mat4 saga_to_clip;
uniform vec2 saga_size;
uniform vec4 saga_viewport;
uniform highp int saga_tools;
uniform float saga_linear;
flat out vec4 saga_mean;  // framebuffer pixels; splat pixels for one of these
flat out vec3 saga_chol;
flat out vec4 saga_splat;
${SHAPE_GLSL}
vec3 saga_light(vec3 c) { // of an sRGB colour
    return mix(c / 12.92, pow((c + 0.055) / 1.055, vec3(2.4)),
        step(0.04045, c));
}

vec4 saga_place(vec2 corner, vec4 place, vec3 chol, vec3 colour) {
    vec2 d = saga_corner(chol, place.w, saga_tools, corner);
    vec4 clip = saga_to_clip * vec4(place.xy * place.z, place.z, 1.0);
    saga_mean = vec4((clip.xy / clip.w * 0.5 + 0.5) * saga_viewport.zw +
        saga_viewport.xy, saga_size / saga_viewport.zw);
    saga_chol = chol;
    saga_splat = vec4(saga_linear > 0.5 ? saga_light(colour) : colour, place.w);
    clip.xy += d * vec2(2.0, -2.0) / saga_size * clip.w;
    return clip;
}
`;

export const FRAGMENT_GLSL = `
uniform highp int saga_tools;
flat in vec4 saga_mean;
flat in vec3 saga_chol;
flat in vec4 saga_splat;
${SHAPE_GLSL}
vec4 saga_mixed() {
    vec2 d = (gl_FragCoord.xy - saga_mean.xy) * saga_mean.zw * vec2(1.0, -1.0);
    float alpha = saga_alpha(saga_chol, saga_splat.a, saga_tools, d);
    if (alpha == 0.0)
        discard;
    return vec4(alpha * saga_splat.rgb, alpha);
}
`;

// Returns the matrix product a b.
export function product(a, b) {
    return Array.from({ length: 16 }, (_, i) => [0, 1, 2, 3].reduce(
        (sum, k) => sum + a[4 * k + i % 4] * b[4 * (i >> 2) + k], 0));
}

// Returns the decoder's camera with the same view as an engine's camera.
// modelView maps the capture's units to the camera: it may turn, move, and
// scale equally in all directions.
export function valuesFrom(view, modelView, projection, width, height) {
    const m = modelView, p = projection;
    const scale = Math.hypot(m[0], m[1], m[2]);
    const axis = (i, sign) => [m[i], m[i + 4], m[i + 8]].map(
        (x) => sign * x / scale);
    const rows = [axis(0, 1), axis(1, -1), axis(2, -1)];
    const t = [m[12], -m[13], -m[14]];
    const eye = [0, 1, 2].map((k) => -rows.reduce(
        (sum, row, i) => sum + row[k] * t[i], 0) / scale);
    const lens = Int32Array.from(view.home);

    lens.set([width * p[0] / 2, height * p[5] / 2, width * (1 - p[8]) / 2,
        height * (1 + p[9]) / 2].map((x) => Math.round(x * 65536)), 12);
    lens.set([width, height], 17);
    return cam.placed(lens,
        { rotation: rows.flat(), centre: view.toUnits(eye) });
}

// Returns the matrix that maps splats to the clip space of the engine's camera.
// The splats were made for the camera `values` and are given as (x depth, y
// depth, depth, 1), with x and y in pixels and depth in box units.
export function toClip(view, values, modelView, projection) {
    const { rotation: r, centre } = cam.poseOf(values);
    const [fx, fy, cx, cy] = Array.from(values.slice(12, 16),
        (x) => x / 65536);
    const eye = view.toMetres(centre);
    const column = (i) => cam.times(r.slice(3 * i, 3 * i + 3),
        view.info.unit);
    const [right, down, forward] = [0, 1, 2].map(column);
    const ahead = forward.map((f, k) =>
        f - right[k] * cx / fx - down[k] * cy / fy);

    return product(product(projection, modelView), [
        ...right.map((x) => x / fx), 0, ...down.map((x) => x / fy), 0,
        ...ahead, 0, ...eye, 1]);
}

export class EngineView extends Viewer {
    // take: a function that is called with the splats of every picture (from
    // SagaFile.splats or, with make = 'gaussians', from SagaFile.gaussians) and
    // with the values of its camera.
    constructor(take, { make = 'splats', ...options } = {}) {
        super(null, { ...options,
            screen: { takesSplats: true, make, showSplats: take } });
    }

    // Asks for the splats for a camera of the engine.
    lookFrom(modelView, projection, width, height) {
        if (this.info)
            this.want(valuesFrom(this, modelView, projection, width, height));
    }

    // Asks for Gaussians. Only their colours depend on the camera, and only on
    // its position `eye`, which is in the capture's units.
    lookFromPlace(eye) {
        if (!this.info)
            return;
        const values = Int32Array.from(this.home);

        values.set(this.toUnits(eye).map(Math.round), 9);
        this.want(values);
    }

    toClip(values, modelView, projection) {
        return toClip(this, values, modelView, projection);
    }

    // Returns an eye, or else the place of the viewing volume that is nearest to
    // it. Positions are in the capture's units.
    held(eye) {
        const volume = this.viewingVolume;

        return volume && outside(volume, eye) > 0
            ? eyeAt(volume, inside(volume, placeOf(volume, eye))) : eye;
    }

    // Returns the pose of a camera of the rig and its vertical field of view in
    // degrees. The pose is a matrix with the columns right, up, back and
    // position, in the capture's units.
    rigPlace(index) {
        const { values } = this.rig[index];
        const { rotation: r, centre } = cam.poseOf(values);

        return { fov: cam.fovOf(values), matrix: [...r.slice(0, 3), 0,
            ...cam.times(r.slice(3, 6), -1), 0,
            ...cam.times(r.slice(6, 9), -1), 0, ...this.toMetres(centre), 1] };
    }
}
