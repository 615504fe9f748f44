// SPDX-License-Identifier: MIT
//
// A canvas that the graphics processor draws with WebGL2: either the splats
// that the decoder has sorted and projected, in one instanced draw call, or
// pixels that the decoder has drawn.
//
// A splat is drawn as the square |v| <= l, |w| <= l in the decoder's own
// coordinates (docs/arithmetic.md, Blending), where its opacity ends at l. In
// the picture this is a parallelogram close around the ellipse. Each pixel
// computes its own v and w. Interpolating them between the corners would be too
// coarse, since some processors snap corners to a grid of a sixteenth of a
// pixel.
//
// Colour and transmittance T are summed front to back in 16-bit floats, with T
// in the alpha channel: rgb += T alpha colour, T *= 1 - alpha. Eight bits would
// lose faint splats.

import { STEEP } from './gaussians.js';

const SPLAT_NBYTES = 44; // bytes of a saga_splat of saga.h
// Browsers allow 16 contexts of WebGL, on phones 8, and take back the oldest
// one if there are more. Seven canvases have one of their own.
const MOST_CONTEXTS = 7;

// The shape of a splat, for all shaders here and in engine.js. f: the factor g,
// n, h of the splat's conic. q0: the peak of its opacity is exp2(3 - q0). d:
// the offset from its mean in pixels, y down. tools: those of the film.
export const SHAPE_GLSL = `
bool saga_is_steep(int tools) {
    return (tools & ${STEEP}) != 0;
}

vec2 saga_corner(vec3 f, float q0, int tools, vec2 corner) {
    float rest = 11.0 - q0;
    // s + s^2 / 2 = rest
    float reach = sqrt(saga_is_steep(tools) ? sqrt(1.0 + 2.0 * rest) - 1.0 : rest);
    // g and h of 0 are less than half a unit, Q28
    vec2 gh = max(f.xz, vec2(exp2(-29.0)));
    vec2 box = reach / gh.y * vec2(length(vec2(f.y, gh.y)) / gh.x, 1.0);
    // A processor cannot draw corners that are millions of pixels away. The box
    // is cut off where no picture can be: means are within 2^15 pixels of its
    // middle.
    if (max(box.x, box.y) > 65536.0)
        return corner * min(box, 65536.0);
    // v = g dx - n dy, w = h dy
    vec2 vw = reach * corner;
    float dy = vw.y / gh.y;
    return vec2((vw.x + f.y * dy) / gh.x, dy);
}

float saga_alpha(vec3 f, float q0, int tools, vec2 d) {
    vec2 vw = vec2(f.x * d.x - f.y * d.y, f.z * d.y);
    float s = dot(vw, vw);
    float q = q0 + s + (saga_is_steep(tools) ? 0.5 * s * s : 0.0);
    return q >= 11.0 ? 0.0 : min(exp2(3.0 - q), 64880.0 / 65536.0);
}
`;

const SPLAT_VERTEX = `#version 300 es
precision highp float;
precision highp int;
layout(location = 0) in ivec2 mean_q8;
layout(location = 1) in ivec3 chol_q28;
layout(location = 2) in int q0_q20;
layout(location = 3) in uvec3 colour_q15;
uniform vec2 size;
uniform highp int tools;
flat out vec2 mean;
flat out vec3 chol;
flat out vec4 splat;

${SHAPE_GLSL}
void main() {
    float q0 = float(q0_q20) * exp2(-20.0);
    mean = vec2(mean_q8) / 256.0;
    chol = vec3(chol_q28) * exp2(-28.0);
    splat = vec4(vec3(colour_q15) / 32768.0, q0);
    vec2 d = saga_corner(chol, q0, tools,
        vec2(gl_VertexID & 1, gl_VertexID >> 1) * 2.0 - 1.0);
    gl_Position = vec4((mean + d) / size * 2.0 - 1.0, 0.0, 1.0);
}`;

const SPLAT_FRAGMENT = `#version 300 es
precision highp float;
uniform highp int tools;
flat in vec2 mean;
flat in vec3 chol;
flat in vec4 splat;
out vec4 mixed;

${SHAPE_GLSL}
void main() {
    // The first row is the picture's top one.
    float alpha = saga_alpha(chol, splat.a, tools, gl_FragCoord.xy - mean);
    if (alpha == 0.0)
        discard;
    mixed = vec4(alpha * splat.rgb, alpha);
}`;

// One triangle covers the whole picture.
const PICTURE_VERTEX = `#version 300 es
void main() {
    gl_Position = vec4(gl_VertexID == 1 ? 3.0 : -1.0,
                       gl_VertexID == 2 ? 3.0 : -1.0, 0.0, 1.0);
}`;

// Adds the background, weighted by the transmittance that remains, or leaves it
// to the page, which takes colours that are multiplied by their alpha. WebGL
// counts rows from the bottom.
const PICTURE_FRAGMENT = `#version 300 es
precision highp float;
precision highp sampler2D;
uniform sampler2D picture;
uniform vec3 background;
uniform int height;
uniform bool clear;
out vec4 shown;

void main() {
    ivec2 at = ivec2(gl_FragCoord.xy);
    at.y = height - 1 - at.y;
    vec4 c = texelFetch(picture, at, 0);
    shown = clear ? vec4(c.rgb, 1.0 - c.a)
                  : vec4(c.rgb + c.a * background, 1.0);
}`;

function compile(gl, kind, source) {
    const shader = gl.createShader(kind);

    gl.shaderSource(shader, source);
    gl.compileShader(shader);
    return shader;
}

// Returns the program and the locations of its uniforms.
export function link(gl, vertex, fragment, uniforms) {
    const program = gl.createProgram();

    gl.attachShader(program, compile(gl, gl.VERTEX_SHADER, vertex));
    gl.attachShader(program, compile(gl, gl.FRAGMENT_SHADER, fragment));
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS) &&
        !gl.isContextLost())
        throw new Error(gl.getProgramInfoLog(program));
    return { program, ...Object.fromEntries(uniforms.map(
        (name) => [name, gl.getUniformLocation(program, name)])) };
}

// Draws splats into any framebuffer whose alpha channel holds T, with the
// picture's first row first.
export class SplatPainter {
    constructor(gl) {
        this.gl = gl;
        this.n = 0;
        this.splats = link(gl, SPLAT_VERTEX, SPLAT_FRAGMENT,
            ['size', 'tools']);
        this.array = gl.createVertexArray();
        this.buffer = gl.createBuffer();
        gl.bindVertexArray(this.array);
        gl.bindBuffer(gl.ARRAY_BUFFER, this.buffer);
        for (const [i, n, type, offset] of [[0, 2, gl.INT, 0],
            [1, 3, gl.INT, 8], [2, 1, gl.INT, 20],
            [3, 3, gl.UNSIGNED_SHORT, 28]]) {
            gl.enableVertexAttribArray(i);
            gl.vertexAttribIPointer(i, n, type, SPLAT_NBYTES, offset);
            gl.vertexAttribDivisor(i, 1);
        }
        gl.bindVertexArray(null);
    }

    // Uploads splats: the result { bytes, nSplats, width, height, tools } of
    // SagaFile.splats.
    upload({ bytes, nSplats, width, height, tools }) {
        const { gl } = this;

        Object.assign(this, { n: nSplats, width, height, tools });
        gl.bindBuffer(gl.ARRAY_BUFFER, this.buffer);
        // Each picture gets new memory, so that none waits for the last one.
        gl.bufferData(gl.ARRAY_BUFFER, bytes, gl.STREAM_DRAW);
    }

    // Draws all splats in one call.
    draw() {
        const { gl, splats } = this;

        gl.useProgram(splats.program);
        gl.uniform2f(splats.size, this.width, this.height);
        gl.uniform1i(splats.tools, this.tools);
        gl.bindVertexArray(this.array);
        gl.enable(gl.BLEND);
        gl.blendFuncSeparate(gl.DST_ALPHA, gl.ONE, gl.ZERO,
            gl.ONE_MINUS_SRC_ALPHA);
        gl.drawArraysInstanced(gl.TRIANGLE_STRIP, 0, 4, this.n);
        gl.disable(gl.BLEND);
        gl.bindVertexArray(null);
    }
}

// Sets the size of a canvas, which clears it; therefore only if it changes.
function sizeTo(canvas, width, height) {
    if (canvas.width !== width || canvas.height !== height) {
        canvas.width = width;
        canvas.height = height;
    }
}

let nContexts = 0; // of canvases that have one of their own

export class GpuScreen {
    // Returns null if the browser has no WebGL2.
    static open(canvas) {
        if (nContexts >= MOST_CONTEXTS)
            return SharedScreen.open(canvas);
        const screen = GpuScreen.make(canvas);

        nContexts += Number(screen !== null);
        return screen;
    }

    static make(canvas) {
        const gl = canvas.getContext('webgl2', { depth: false,
            stencil: false, antialias: false,
            powerPreference: 'high-performance' });

        return gl && new GpuScreen(canvas, gl);
    }

    constructor(canvas, gl) {
        this.canvas = canvas;
        this.gl = gl;
        this.loser = gl.getExtension('WEBGL_lose_context');
        this.isReleased = this.isGone = false; // as asked
        this.isTaken = this.isLost = false;    // as it is
        this.transparent = false; // the page shows where the film does not
        this.begin();
        canvas.addEventListener('webglcontextlost', (event) => {
            event.preventDefault();
            this.isLost = true;
            setTimeout(() => this.restore());
        });
        canvas.addEventListener('webglcontextrestored', () => {
            this.isTaken = this.isLost = false;
            if (this.isReleased)
                this.release();
            else
                this.begin();
        });
    }

    begin() {
        const { gl } = this;

        // If the browser has no framebuffers of 16-bit floats, only pixels can
        // be shown.
        this.takesSplats = Boolean(
            gl.getExtension('EXT_color_buffer_float') ||
            gl.getExtension('EXT_color_buffer_half_float'));
        this.painter = new SplatPainter(gl);
        this.picture = link(gl, PICTURE_VERTEX, PICTURE_FRAGMENT,
            ['background', 'height', 'clear']);
        this.sum = gl.createTexture();
        this.pixels = gl.createTexture();
        this.frame = gl.createFramebuffer();
        this.size = [0, 0];
        this.again = () => {};
    }

    // Gives the context back, until `regain`. forGood: the canvas is not in the
    // page, and another one may have a context of its own instead.
    release(forGood = false) {
        nContexts -= Number(forGood && !this.isGone);
        this.isGone ||= forGood;
        this.isReleased = true;
        if (!this.isTaken)
            this.loser?.loseContext();
        this.isTaken = true;
    }

    // Takes a context again. Then the canvas gets `webglcontextrestored`.
    regain() {
        nContexts += Number(this.isGone);
        this.isGone = this.isReleased = false;
        this.restore();
    }

    // Browsers restore a context only after they have dispatched
    // `webglcontextlost`, which is a task after release().
    restore() {
        if (this.isTaken && this.isLost && !this.isReleased)
            this.loser?.restoreContext();
    }

    resize(width, height) {
        const { gl } = this;

        sizeTo(this.canvas, width, height);
        gl.viewport(0, 0, width, height);
    }

    // Makes the buffer of sums as large as the picture.
    resizeSum(width, height) {
        const { gl } = this;

        gl.bindFramebuffer(gl.FRAMEBUFFER, this.frame);
        if (this.size[0] === width && this.size[1] === height)
            return;
        this.size = [width, height];
        gl.deleteTexture(this.sum);
        this.sum = gl.createTexture();
        gl.bindTexture(gl.TEXTURE_2D, this.sum);
        gl.texStorage2D(gl.TEXTURE_2D, 1, gl.RGBA16F, width, height);
        gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0,
            gl.TEXTURE_2D, this.sum, 0);
    }

    showSplats(splats) {
        this.resize(splats.width, splats.height);
        this.painter.upload(splats);
        this.again = () => this.drawSplats(splats.background);
        this.again();
    }

    drawSplats(background) {
        const { gl, painter } = this;

        this.resizeSum(painter.width, painter.height);
        gl.clearColor(0, 0, 0, 1);
        gl.clear(gl.COLOR_BUFFER_BIT);
        painter.draw();
        this.show(this.sum, background, this.transparent);
    }

    showPixels({ bytes, width, height }) {
        const { gl } = this;

        this.resize(width, height);
        gl.bindTexture(gl.TEXTURE_2D, this.pixels);
        gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA8, width, height, 0, gl.RGBA,
            gl.UNSIGNED_BYTE, new Uint8Array(bytes.buffer, 0, bytes.length));
        gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.NEAREST);
        this.again = () => this.show(this.pixels, [0, 0, 0], false);
        this.again();
    }

    show(texture, background, clear) {
        const { gl, picture } = this;

        gl.bindFramebuffer(gl.FRAMEBUFFER, null);
        gl.useProgram(picture.program);
        gl.bindTexture(gl.TEXTURE_2D, texture);
        gl.uniform3fv(picture.background, background);
        gl.uniform1i(picture.height, this.canvas.height);
        gl.uniform1i(picture.clear, clear);
        gl.drawArrays(gl.TRIANGLES, 0, 3);
    }

    // Returns the picture as ImageData. It is drawn again, because browsers do
    // not keep what they have shown.
    read() {
        const { gl } = this;
        const { width, height } = this.canvas;
        const rows = new Uint8Array(4 * width * height);
        const image = new ImageData(width, height);

        this.again();
        gl.readPixels(0, 0, width, height, gl.RGBA, gl.UNSIGNED_BYTE, rows);
        for (let y = 0; y < height; y++)
            image.data.set(rows.subarray(4 * width * y, 4 * width * (y + 1)),
                4 * width * (height - 1 - y));
        // ImageData has colours that are not multiplied by alpha.
        for (let i = 0; this.transparent && i < image.data.length; i++)
            if (i % 4 < 3)
                image.data[i] *= 255 / Math.max(1, image.data[i | 3]);
        return image;
    }
}

// A canvas to which pictures are copied from another one, whose context all of
// these share.
class SharedScreen {
    static gpu;

    static open(canvas) {
        this.gpu ??= GpuScreen.make(document.createElement('canvas'));
        return this.gpu && new SharedScreen(canvas, this.gpu);
    }

    constructor(canvas, gpu) {
        this.canvas = canvas;
        this.gpu = gpu;
        this.gl = gpu.gl;
        this.takesSplats = gpu.takesSplats;
        this.transparent = false;
        this.context = canvas.getContext('2d');
        // The shared context must not keep canvases that are gone.
        const weak = new WeakRef(canvas);

        gpu.canvas.addEventListener('webglcontextrestored', ({ type }) =>
            weak.deref()?.dispatchEvent(new Event(type)));
    }

    showSplats(splats) {
        this.gpu.transparent = this.transparent;
        this.gpu.showSplats(splats);
        this.copy();
    }

    showPixels(pixels) {
        this.gpu.showPixels(pixels);
        this.copy();
    }

    copy() {
        const { canvas, gpu } = this;

        sizeTo(canvas, gpu.canvas.width, gpu.canvas.height);
        // Where the new picture is transparent, it replaces the old one too. A
        // new size resets the context.
        this.context.globalCompositeOperation = 'copy';
        this.context.drawImage(gpu.canvas, 0, 0);
    }

    read() {
        return this.context.getImageData(0, 0, this.canvas.width,
            this.canvas.height);
    }
}

// A canvas without a graphics processor, which shows pixels only.
export class PlainScreen {
    constructor(canvas) {
        this.canvas = canvas;
        this.takesSplats = false;
        this.context = canvas.getContext('2d', { alpha: false });
    }

    showPixels({ bytes, width, height }) {
        sizeTo(this.canvas, width, height);
        this.context.putImageData(new ImageData(bytes, width, height), 0, 0);
    }

    read() {
        return this.context.getImageData(0, 0, this.canvas.width,
            this.canvas.height);
    }
}
