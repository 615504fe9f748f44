// SPDX-License-Identifier: MIT
//
// A canvas that shows a .saga file: any time, from any camera. It draws in a
// worker and has no controls of its own; controls.js moves its camera, page.js
// is a whole page around it.
//
//     const viewer = new Viewer(canvas);
//     await viewer.open('scene.saga');
//     viewer.selectCamera(2);
//     viewer.play();
//
// Until a file is open there is no camera and no time: what would change them
// does nothing. setScale holds for every file.
//
// Events: `opened`, `change` (camera, time or playing), `drawn` (viewer.drawn
// has the picture's numbers), `failed` (detail: a sentence).

import * as cam from './camera.js';
import { keyAt } from './path.js';

const TIME_DEN = 256; // moments between two frames, while it plays

export class Viewer extends EventTarget {
    // simd: false for the plain decoder; else what the browser has. seconds:
    // that decoding a segment may take.
    constructor(canvas, { simd, seconds } = {}) {
        super();
        this.canvas = canvas;
        this.simd = simd;
        this.seconds = seconds;
        this.scale = 1;         // of the picture, relative to the camera's
        this.wantCrc = false;
        this.rig = [];
        this.segments = [];
        this.clear();
    }

    clear() {
        this.worker?.terminate();
        this.worker = null;
        this.info = null;
        this.frame = 0;
        this.playing = false;
        this.path = null;       // of key cameras, while it is played
        this.busy = false;      // a picture is being drawn
        this.stale = false;     // and another one is wanted
        this.spare = null;      // a buffer for the next picture
        this.drawn = null;
        this.pending = null;    // segment asked for ahead of time
    }

    emit(type, detail) {
        this.dispatchEvent(new CustomEvent(type, { detail }));
    }

    // --- A file

    // An address, or a File. Resolves once it is open; rejects with a sentence.
    open(source) {
        this.clear();
        this.worker = new Worker(new URL('worker.js', import.meta.url),
            { type: 'module' });
        const address = typeof source === 'string'
            ? new URL(source, document.baseURI).href : source;

        return new Promise((resolve, reject) => {
            this.worker.onmessage = ({ data }) => {
                if (data.drawn)
                    this.show(data.drawn);
                else if (data.opened)
                    resolve(this.begin(data.opened));
                else
                    reject(this.fail(data.failed));
            };
            this.worker.onerror = (event) => reject(this.fail(
                `the decoder cannot be started (${event.message})`));
            this.worker.postMessage({ open: address, simd: this.simd,
                seconds: this.seconds });
        });
    }

    begin({ info, rig, segments, name, size, simd }) {
        Object.assign(this, { info, rig, segments, name, size,
            usesSimd: simd });
        const poses = rig.map((camera) => cam.poseOf(camera.values));

        this.home = rig.length ? rig[0].values : cam.standInLens();
        this.focus = rig.length ? cam.focusOf(poses) : [0, 0, 0];
        this.up = rig.length ? cam.upOf(poses) : [0, -1, 0];
        // Who hears of the file may move its camera at once.
        this.placeCamera(0);
        this.emit('opened');
        this.changed();
    }

    fail(sentence) {
        this.playing = false;
        this.busy = false;
        this.emit('failed', sentence);
        return new Error(sentence);
    }

    // --- Camera

    // Camera `index` of the rig, to the bit until it is moved.
    selectCamera(index) {
        if (!this.info)
            return;
        this.placeCamera(index);
        this.changed();
    }

    placeCamera(index) {
        this.camera = Math.max(0, Math.min(index, this.rig.length - 1));
        this.lens = this.rig.length ? this.rig[this.camera].values : this.home;
        this.pose = cam.poseOf(this.lens);
        this.moved = false;
        this.findPivot();
    }

    // Drags turn the camera about the point of its axis nearest the focus.
    findPivot() {
        const forward = cam.forwardOf(this.pose);
        const depth = cam.dot(cam.sub(this.focus, this.pose.centre), forward);

        this.pivot = cam.add(this.pose.centre,
            cam.times(forward, depth > 0 ? depth : 2 ** 22));
    }

    setPose(pose, lens = this.lens) {
        this.pose = pose;
        this.lens = lens;
        this.moved = true;
        this.changed();
    }

    // Radians.
    orbit(yaw, pitch) {
        if (!this.info)
            return;
        this.setPose(cam.orbited(this.pose, this.pivot, this.up, yaw, pitch));
    }

    dolly(factor) {
        if (!this.info)
            return;
        this.setPose(cam.dollied(this.pose, this.pivot, factor));
    }

    // Pixels of the picture, at the pivot's distance.
    pan(dx, dy) {
        if (!this.info)
            return;
        const distance = cam.norm(cam.sub(this.pivot, this.pose.centre));
        const perPixel = distance * 65536 / this.lens[12];
        const by = cam.add(
            cam.times(cam.rightOf(this.pose), -dx * perPixel),
            cam.times(cam.downOf(this.pose), -dy * perPixel));

        this.pivot = cam.add(this.pivot, by);
        this.setPose(cam.moved(this.pose, by));
    }

    setScale(scale) {
        this.scale = scale;
        this.changed();
    }

    // What is drawn: the rig's own integers where nothing was moved.
    values() {
        const lens = cam.resized(this.lens, this.scale);

        return this.moved ? cam.placed(lens, this.pose) : lens;
    }

    // --- Key cameras, in the capture's units

    toMetres(point) {
        return point.map((x, i) => this.info.centre[i] + x * this.info.unit);
    }

    toUnits(point) {
        return point.map((x, i) => (x - this.info.centre[i]) / this.info.unit);
    }

    // null while nothing is open.
    key(seconds = 0) {
        return this.info && { seconds, frame: this.frame, fov: cam.fovOf(this.lens),
            eye: this.toMetres(this.pose.centre),
            target: this.toMetres(this.pivot),
            up: cam.times(cam.downOf(this.pose), -1) };
    }

    goToKey(key) {
        if (!this.info)
            return;
        const eye = this.toUnits(key.eye), target = this.toUnits(key.target);

        this.pivot = target;
        this.frame = this.inFile(key.frame);
        this.setPose(cam.lookAt(eye, target, cam.unit(key.up)),
            cam.withFov(this.lens, key.fov));
    }

    // --- Time

    inFile(frame) {
        return Math.max(0, Math.min(frame, this.info.nFrames - 1 / TIME_DEN));
    }

    // In frames; at rest a whole one.
    seek(frame) {
        if (!this.info)
            return;
        this.frame = this.inFile(this.playing ? frame : Math.round(
            Math.min(frame, this.info.nFrames - 1)));
        this.changed();
    }

    play() {
        if (!this.info || this.playing)
            return;
        this.playing = true;
        this.since = performance.now();
        requestAnimationFrame((now) => this.tick(now));
        this.changed();
    }

    pause() {
        this.playing = false;
        this.path = null;
        this.seek(Math.floor(this.frame));
    }

    // Plays key cameras, then goes on from where they end.
    playPath(keys) {
        if (!this.info)
            return;
        this.pause();
        this.path = { keys, seconds: keys[0].seconds };
        this.play();
    }

    tick(now) {
        const passed = Math.max(0, now - this.since) / 1000;

        if (!this.playing)
            return;
        this.since = now;
        if (this.path)
            this.tickPath(passed);
        else
            this.frame = this.inFile((this.frame + passed * this.info.fps) %
                                     this.info.nFrames);
        this.fetchAhead();
        this.changed();
        requestAnimationFrame((next) => this.tick(next));
    }

    tickPath(passed) {
        const { keys } = this.path;

        this.path.seconds += passed;
        this.goToKey(keyAt(keys, this.path.seconds));
        if (this.path.seconds >= keys[keys.length - 1].seconds)
            this.pause();
    }

    // The segment after the one that is played.
    fetchAhead() {
        const next = this.segments.findIndex(
            (s) => s.firstFrame > this.frame);

        if (next > 0 && next !== this.pending) {
            this.pending = next;
            this.worker.postMessage({ fetch: next });
        }
    }

    // --- Pictures

    // One picture at a time; what changes meanwhile makes the next one.
    changed() {
        if (!this.info)
            return;
        this.emit('change');
        if (this.busy)
            this.stale = true;
        else
            this.ask();
    }

    ask() {
        const den = Number.isInteger(this.frame) ? 1 : TIME_DEN;
        const buffer = this.spare, values = this.values();

        this.busy = true;
        this.stale = false;
        this.spare = null;
        this.worker.postMessage({ draw: { values,
            num: Math.round(this.frame * den), den, crc: this.wantCrc,
            buffer } }, buffer ? [buffer] : []);
    }

    show(drawn) {
        const { canvas } = this;
        const { width, height, pixels } = drawn;

        if (canvas.width !== width || canvas.height !== height) {
            canvas.width = width;
            canvas.height = height;
        }
        canvas.getContext('2d', { alpha: false })
            .putImageData(new ImageData(pixels, width, height), 0, 0);
        this.spare = pixels.buffer;
        this.drawn = { ...drawn, pixels: null };
        this.busy = false;
        this.emit('drawn');
        if (this.stale)
            this.ask();
    }
}
