// SPDX-License-Identifier: MIT
//
// A canvas that shows a .saga file at any time, from any camera. A worker
// decodes and sorts, and the graphics processor draws in any size. With
// `exact`, the worker also draws, with the same bits as every decoder, in the
// size of the camera's picture. controls.js moves the camera, player.js is an
// element with controls.
//
//     const viewer = new Viewer(canvas);
//     await viewer.open('scene.saga');
//     viewer.selectCamera(2);
//     viewer.play();
//
// Until a file is open there is no camera and no time, and calls that would
// change them do nothing. setScale applies to all files.
//
// While it plays, the next segments are fetched, and another worker decodes the
// next one. If a segment is late, the clock stands.
//
// Events: `opened`, `change` (camera, time or playing), `drawn` (viewer.drawn
// has the picture's numbers), `waiting` and `resumed` (a segment is late, and
// has come), `progress` (detail: { segment, got, nbytes } of a transfer),
// `sound` (after askSound), `failed` (detail: a sentence).

import { Bounds } from './bounds.js';
import * as cam from './camera.js';
import { GpuScreen, PlainScreen } from './gpu.js';
import { visible } from './source.js';
import { Pace } from './pace.js';
import { keyAt } from './path.js';
import { absolutePlaces, cannotStart, startWorker } from './places.js';
import { goToKey, keyOf, setState, stateOf } from './state.js';

const TIME_DEN = 256; // steps of time between two frames, while it plays
const REST_MS = 150;  // time without a change, after which the sharp picture is
                      // drawn
const MOST_MS = 250;  // largest step of the clock
const WAIT_MS = 200;  // delay of a late segment, after which `waiting` is
                      // emitted
const AHEAD_SECONDS = 10, AHEAD_SEGMENTS = 16; // limits of what is fetched

// Calls back when the page shows its next picture.
export const onPage = (call) => requestAnimationFrame(call);

export class Viewer extends EventTarget {
    // exact: true for the decoder's own picture, which a browser without WebGL2
    // always shows. simd: false for the decoder without SIMD; by default SIMD
    // is used if the browser has it. seconds: limit for decoding a segment.
    // screen: shows the pictures instead of a canvas (engine.js).
    constructor(canvas, { exact = false, simd, seconds, screen } = {}) {
        super();
        this.canvas = canvas;
        this.screen = screen;
        this.wantsExact = exact;
        this.transparent = false;
        this.room = null;       // width and height of the window, if set
        this.pace = new Pace();
        this.rest = 0;          // timer
        canvas?.addEventListener('webglcontextrestored', () => this.changed());
        this.simd = simd;
        this.seconds = seconds;
        this.credentials = undefined; // of requests for a file, as for `fetch`
        this.scale = 1;         // size of an exact picture, relative to the
                                // camera's picture
        this.loop = true;       // plays from the start after the end
        this.rate = 1;          // rate of playback
        this.wantCrc = false;
        this.nextFrame = onPage;
        this.rig = [];
        this.segments = [];
        this.hasSound = false;
        this.viewingVolume = null;
        this.bounds = new Bounds(this);
        this.clear();
    }

    // A page may have many players, and browsers have few contexts; the canvas
    // takes one when it is first drawn.
    get screen() {
        this.ownScreen ??= GpuScreen.open(this.canvas) ||
            new PlainScreen(this.canvas);
        return this.ownScreen;
    }

    set screen(screen) {
        this.ownScreen = screen;
    }

    get exact() {
        return this.wantsExact || !this.screen.takesSplats;
    }

    clear() {
        this.disconnect();
        this.isAsleep = false;
        this.info = null;
        this.error = null;      // why nothing is shown
        this.frame = 0;
        this.playing = false;
        this.movedAt = -Infinity; // when the camera was last moved
        this.wanted = null;     // camera of an engine or a headset, which is
                                // drawn instead
        this.path = null;       // the path of key cameras that is played
        this.drawn = null;
        this.waiting = false;
        this.wantsSound = false; // it was asked for and has not come
    }

    // Ends the worker.
    disconnect() {
        clearTimeout(this.rest);
        clearTimeout(this.late);
        this.bounds.clear();
        this.worker?.terminate();
        this.worker = null;
        this.busy = false;      // a picture is being drawn
        this.stale = false;     // another picture is needed after it
        this.spare = null;      // an ArrayBuffer that the worker may use for
                                // the next picture
        this.asked = -1;        // number of the segment that the picture in
                                // progress needs
        this.looked = null;     // the segment for which lookAhead has asked for
                                // the next ones
    }

    emit(type, detail) {
        this.dispatchEvent(new CustomEvent(type, { detail }));
    }

    // --- A file

    // Opens a URL or a File. Resolves when it is open; rejects with an error
    // whose message is a sentence.
    open(source) {
        this.clear();
        try {
            // The page's own address may change until the viewer is woken.
            this.source = typeof source === 'string'
                ? new URL(source, document.baseURI).href : source;
        } catch {
            return Promise.reject(this.fail(`${source}: is no address`));
        }
        return this.connect().then((opened) => this.begin(opened));
    }

    // Starts a worker, which opens the file.
    connect() {
        this.ownScreen?.regain?.();
        try {
            this.worker = startWorker();
        } catch (error) {
            return Promise.reject(this.fail(cannotStart(error.message)));
        }
        return new Promise((resolve, reject) => {
            this.worker.onmessage = ({ data }) => {
                if (data.drawn)
                    this.show(data.drawn);
                else if (data.progress)
                    this.emit('progress', data.progress);
                else if (data.sound !== undefined)
                    this.takeSound(data.sound);
                else if (data.opened)
                    resolve(data.opened);
                else
                    reject(this.fail(data.failed, data.code));
            };
            this.worker.onerror = (event) => reject(this.fail(
                cannotStart(event.message)));
            this.worker.postMessage({ open: this.source, simd: this.simd,
                seconds: this.seconds, places: absolutePlaces(),
                credentials: this.credentials });
        });
    }

    // Gives worker and context back while nobody sees the canvas. The clock
    // stands until the viewer is woken and has opened the file again. An address
    // that a page has made may be gone by then.
    sleep() {
        if (this.isAsleep || !this.info || /^blob:/.test(this.source))
            return;
        this.isAsleep = true;
        this.drawn = null; // the next worker has no segment
        this.endWait();
        this.disconnect();
        this.ownScreen?.release?.();
    }

    wake() {
        if (!this.isAsleep)
            return;
        this.isAsleep = false;
        this.error = null;
        this.busy = true; // until the file is open
        this.connect().then(() => {
            this.busy = false;
            this.looked = null; // no worker has a list of what comes next
            this.changed();
            if (this.wantsSound)
                this.askSound();
            if (this.playing)
                this.runClock();
        }, () => this.sleep()); // `failed` has reported it
    }

    begin({ info, rig, segments, hasSound, viewingVolume: volume, name, size,
        simd }) {
        Object.assign(this, { info, rig, segments, hasSound, size,
            name: visible(name), usesSimd: simd, viewingVolume: volume });
        const poses = rig.map((camera) => cam.poseOf(camera.values));

        this.home = rig.length ? rig[0].values : cam.standInLens();
        this.focus = volume ? this.toUnits(volume.pivot)
            : rig.length ? cam.focusOf(poses) : [0, 0, 0];
        this.up = volume ? volume.up
            : rig.length ? cam.upOf(poses) : [0, -1, 0];
        // Listeners of `opened` may move the camera at once.
        this.placeCamera(this.start);
        this.emit('opened');
        this.changed();
    }

    // code: of MediaError; 4 if there is nothing that can be shown.
    fail(why, code = 4) {
        const sentence = visible(why);

        this.error = { code, message: sentence };
        this.playing = false;
        this.busy = false;
        this.endWait();
        this.emit('failed', sentence);
        return new Error(sentence);
    }

    // --- Camera

    // The camera with which the film begins.
    get start() {
        return this.viewingVolume?.start ?? 0;
    }

    // Selects camera `index` of the rig, which is exact until it is moved.
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
        this.moved = this.bounds.isLed = false;
        this.findPivot();
    }

    // Finds the point about which drags turn the camera.
    findPivot() {
        this.pivot = cam.onAxis(this.pose, this.focus);
    }

    setPose(pose, lens = this.lens) {
        this.pose = pose;
        this.lens = lens;
        this.moved = true;
        this.movedAt = performance.now();
        this.changed();
    }

    // Turns the camera about the pivot by angles in radians.
    orbit(yaw, pitch) {
        if (!this.info)
            return;
        this.setPose(this.bounds.softened((part) => cam.orbited(this.pose,
            this.pivot, this.up, part * yaw, part * pitch)));
    }

    dolly(factor) {
        if (!this.info)
            return;
        this.setPose(this.bounds.softened((part) =>
            cam.dollied(this.pose, this.pivot, factor ** part)));
    }

    // Moves the camera parallel to its picture, so that things at the pivot's
    // distance move by these pixels.
    pan(dx, dy) {
        if (!this.info)
            return;
        const by = cam.panOf(this.pose, this.pivot, this.lens, dx, dy);
        const pose = this.bounds.softened((part) =>
            cam.moved(this.pose, cam.times(by, part)));

        this.pivot = cam.add(this.pivot,
            cam.sub(pose.centre, this.pose.centre));
        this.setPose(pose);
    }

    setScale(scale) {
        this.scale = scale;
        this.changed();
    }

    // Selects who draws: the decoder, or the graphics processor.
    setExact(exact) {
        this.wantsExact = exact;
        this.changed();
    }

    // Shows what is behind the canvas instead of the film's background. Exact
    // pictures keep that.
    setTransparent(transparent) {
        this.transparent = transparent;
        this.changed();
    }

    // Sets the pixels of the window, which the graphics processor fills.
    setRoom(width, height) {
        const side = (x) => Math.max(1, Math.min(16384, Math.round(x)));
        const room = [side(width), side(height)];

        if (this.room && room.every((x, i) => x === this.room[i]))
            return;
        this.room = room;
        this.changed();
    }

    // Returns whether pictures have the size of the window.
    get fills() {
        return !this.exact && this.room !== null && !this.wanted;
    }

    // Draws the camera `values` of an engine or headset, until it is set to
    // null.
    want(values) {
        if (values && this.wanted?.every((x, i) => x === values[i]))
            return;
        this.wanted = values;
        this.changed();
    }

    // Returns the camera to draw: the rig's own integers, in the camera's own
    // size, if nothing was moved. While something moves, pictures may be
    // smaller on a slow machine.
    values() {
        if (this.wanted)
            return this.wanted;
        const detail = this.isMoving() ? this.pace.scale : 1;
        const lens = this.fills
            ? cam.fitted(this.lens, ...this.room.map(
                (x) => Math.max(1, Math.round(x * detail))))
            : cam.resized(this.lens,
                cam.exactScale(this.lens, this.scale, this.room));

        return this.moved ? cam.placed(lens, this.pose) : lens;
    }

    isMoving() {
        return this.playing ||
            performance.now() - this.movedAt < REST_MS;
    }

    // Returns the picture on the canvas as ImageData.
    read() {
        return this.screen.read();
    }

    // --- Places in the capture's units, key cameras

    toMetres(point) {
        return point.map((x, i) => this.info.centre[i] + x * this.info.unit);
    }

    toUnits(point) {
        return point.map((x, i) => (x - this.info.centre[i]) / this.info.unit);
    }

    key(seconds = 0) { return keyOf(this, seconds); }
    goToKey(key) { goToKey(this, key); }
    toState() { return stateOf(this); }
    setState(line) { return setState(this, line); }

    // --- Time

    inFile(frame) {
        return Math.max(0, Math.min(frame, this.info.nFrames - 1 / TIME_DEN));
    }

    // Goes to a time in frames; at rest it is a whole frame.
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
        if (!this.loop && this.frame >= this.info.nFrames - 1)
            this.frame = 0;
        this.playing = true;
        this.runClock();
        this.changed();
    }

    // Starts the clock. A clock that runs already is replaced.
    runClock() {
        const next = () => this.nextFrame((now) => {
            if (this.clock !== next || !this.playing || !this.worker)
                return;
            this.tick(now);
            next();
        });

        this.clock = next;
        this.since = performance.now();
        next();
    }

    // Sets what triggers pictures: a page and a headset have different clocks.
    setClock(nextFrame) {
        this.nextFrame = nextFrame;
        if (this.playing)
            this.runClock();
    }

    pause() {
        this.playing = false;
        this.path = null;
        this.seek(Math.floor(this.frame));
    }

    // Plays a path of key cameras. At its end the last view stays.
    playPath(keys) {
        if (!this.info)
            return;
        this.pause();
        this.path = { keys, seconds: keys[0].seconds };
        this.play();
    }

    tick(now) {
        // The step is limited: if the page was suspended, the film continues
        // where it was.
        const passed = Math.max(0, Math.min(MOST_MS, now - this.since)) / 1000;

        this.since = now;
        if (!this.isLate())
            this.advance(passed);
        this.lookAhead();
        this.changed();
    }

    advance(seconds) {
        if (this.path)
            this.tickPath(seconds);
        else
            this.tickTime(seconds * this.info.fps * this.rate);
    }

    tickTime(frames) {
        const { nFrames } = this.info;
        const next = this.frame + frames;

        this.frame = this.inFile(this.loop ? next % nFrames : next);
        if (this.loop || next < nFrames)
            return;
        this.pause();
        this.emit('ended');
    }

    tickPath(passed) {
        const { keys } = this.path;

        this.path.seconds += passed;
        this.goToKey(keyAt(keys, this.path.seconds));
        if (this.path.seconds >= keys[keys.length - 1].seconds)
            this.pause();
    }

    // --- Segments

    segmentAt(frame) {
        return this.segments.findLastIndex((s) => s.firstFrame <= frame);
    }

    // Tells the worker the next segments when another segment begins to play.
    lookAhead() {
        const { segments, info, loop } = this;
        const at = this.segmentAt(this.frame);
        const list = [at];
        let frames = 0;

        if (segments.length < 2 || this.looked === at)
            return;
        this.looked = at;
        for (let i = at + 1; frames < AHEAD_SECONDS * info.fps &&
            list.length < Math.min(segments.length, AHEAD_SEGMENTS) &&
            (loop || i < segments.length); i++) {
            const next = i % segments.length;

            list.push(next);
            frames += segments[next].nFrames;
        }
        this.worker?.postMessage({ ahead: list });
    }

    // Returns whether the picture in progress needs another segment than the
    // last picture.
    isLate() {
        return this.busy && this.asked !== this.drawn?.segment;
    }

    beginWait() {
        clearTimeout(this.late);
        this.late = setTimeout(() => {
            this.waiting = true;
            this.emit('waiting');
        }, WAIT_MS);
    }

    endWait() {
        clearTimeout(this.late);
        if (!this.waiting)
            return;
        this.waiting = false;
        this.emit('resumed');
    }

    // --- Sound

    // Fetches the film's sound for the event `sound`, whose detail is
    // { start, bytes }, or null if it is damaged. sound.js plays it.
    askSound() {
        this.wantsSound = true;
        this.worker?.postMessage({ sound: true });
    }

    takeSound(sound) {
        this.wantsSound = false;
        this.emit('sound', sound);
    }

    // --- Pictures

    // Asks the worker for a picture, one at a time. Changes made meanwhile lead
    // to one further picture.
    changed() {
        if (!this.info)
            return;
        this.emit('change');
        if (this.busy)
            this.stale = true;
        else if (this.worker)
            this.ask();
    }

    ask() {
        const den = Number.isInteger(this.frame) ? 1 : TIME_DEN;
        const buffer = this.spare, values = this.values();

        this.busy = true;
        this.stale = false;
        this.spare = null;
        this.asked = this.segmentAt(this.frame);
        if (this.isLate() && !this.waiting)
            this.beginWait();
        this.worker.postMessage({ draw: { values,
            num: Math.round(this.frame * den), den,
            make: this.exact ? 'draw' : this.screen.make ?? 'splats',
            crc: this.wantCrc, buffer } }, buffer ? [buffer] : []);
    }

    show(drawn) {
        this.screen.transparent = this.transparent;
        if (drawn.gpu)
            this.screen.showSplats(drawn);
        else
            this.screen.showPixels(drawn);
        this.spare = drawn.bytes.buffer;
        this.drawn = { ...drawn, bytes: null };
        this.busy = false;
        this.endWait();
        this.keepPace();
        this.emit('drawn');
        if (this.stale)
            this.ask();
    }

    // Makes pictures smaller while something moves on a slow machine, and draws
    // a sharp one at rest.
    keepPace() {
        const now = performance.now();
        const { view, draw } = this.drawn.times;

        clearTimeout(this.rest);
        if (!this.fills)
            return;
        if (this.isMoving())
            this.pace.note(now, view + draw);
        else
            this.pace.pause();
        if (!this.playing && this.drawn.width < this.room[0])
            this.rest = setTimeout(() => this.changed(), REST_MS + 1);
    }
}
