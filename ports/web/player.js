// SPDX-License-Identifier: MIT
//
// An element that plays a .saga file:
//
//     <script type="module" src="player.js"></script>
//     <saga-player src="scene.saga" autoplay loop controls></saga-player>
//
// Attributes: src; autoplay, unless the user prefers reduced motion; loop;
// camera, an index of the rig from 0; poster, a picture until the first one is
// drawn; background="transparent", no background of the film; controls, the
// bar; draw="exact", the decoder's own pixels, with their background; muted, no
// sound until it is turned on; preload="none", nothing is fetched before
// play(), else when the element is seen; crossorigin, as for a video;
// bounds="off", the camera may leave the film's viewing volume.
//
// Properties, methods and events are those of a video as far as they have a
// meaning, and camerachange. Its style sets its size; the default is 16:9 of
// the width. Elements in it with slot="buttons" are added to the bar.
// player.d.ts has all of them.

import { addControls } from './controls.js';
import { heightOf, widthOf } from './camera.js';
import { pressKey } from './keys.js';
import { MARKUP, STYLE } from './markup.js';
import { trust } from './places.js';
import { Sound } from './sound.js';
import { Tilt, hasTilt } from './tilt.js';
import { visible } from './source.js';
import { Viewer } from './viewer.js';
import { shade } from './volume.js';
import { enterHeadset, hasHeadset } from './xr.js';

const REST_MS = 2500; // time without a pointer movement, until the bar
                      // disappears
const MOST_PARTS = 400; // of the bar; each stands for as many segments

// Values of readyState, as of a video.
const HAVE_NOTHING = 0, HAVE_METADATA = 1, HAVE_FUTURE_DATA = 3,
    HAVE_ENOUGH_DATA = 4;

const pausedBefore = () =>
    new DOMException('called off before it played', 'AbortError');

// Rejects when the signal is aborted.
const aborted = (signal) => new Promise((_, reject) => {
    signal.addEventListener('abort', () => reject(signal.reason));
});

// A server that renders pages imports this module, too, and has no elements.
const Base = globalThis.HTMLElement ?? class {};

export class SagaPlayer extends Base {
    static observedAttributes = ['src', 'background', 'bounds', 'camera',
        'controls', 'draw', 'loop', 'muted', 'poster'];

    constructor() {
        super();
        this.attachShadow({ mode: 'open' }).innerHTML =
            trust('createHTML', MARKUP);
        // Pages may forbid style sheets in markup.
        this.shadowRoot.adoptedStyleSheets = [new CSSStyleSheet()];
        this.shadowRoot.adoptedStyleSheets[0].replaceSync(STYLE);
        this.$ = (id) => this.shadowRoot.getElementById(id);
        this.canvas = this.shadowRoot.querySelector('canvas');
        // Scripts use the viewer for what the element does not offer.
        this.viewer = new Viewer(this.canvas);
        this.viewer.loop = false;
        this.sound = new Sound(this.viewer);
        this.tilt = new Tilt(this.viewer);
        this.watcher = new ResizeObserver(() => this.fit());
        this.isSeen = false; // or nearly
        this.isDue = false;  // the film of `src` is opened when it is seen
        this.isHeld = false; // it was paused, so that it does not autoplay
        this.isAsked = false; // play() waits for the film
        this.pausing = new AbortController(); // of what play() waits for
        this.seenBy = new IntersectionObserver((entries) => {
            this.isSeen = entries.at(-1).isIntersecting;
            this.attend();
        }, { rootMargin: '50%' });
        this.listen();
    }

    connectedCallback() {
        this.watcher.observe(this);
        this.seenBy.observe(this);
        if (this.isShut && this.src)
            this.load(this.isHeld);
        this.isShut = false;
    }

    disconnectedCallback() {
        this.watcher.disconnect();
        this.seenBy.disconnect();
        // An element that is only moved within the page goes on.
        setTimeout(() => {
            if (!this.isConnected)
                this.shut();
        });
    }

    // Ends workers and gives the graphics processor's memory back.
    shut() {
        this.isShut = true;
        this.isSeen = false;
        this.callOff();
        this.tilt.stop();
        this.viewer.clear();
        this.sound.clear();
        this.viewer.ownScreen?.release?.(true);
    }

    attributeChangedCallback(name, before, now) {
        const { viewer } = this;

        if (name === 'src' && now)
            this.load();
        else if (name === 'background')
            viewer.setTransparent(now === 'transparent');
        else if (name === 'bounds')
            viewer.bounds.isOn = now !== 'off';
        else if (name === 'camera')
            viewer.selectCamera(Number(now ?? viewer.start));
        else if (name === 'controls')
            this.$('bar').hidden = now === null;
        else if (name === 'draw')
            viewer.setExact(now === 'exact');
        else if (name === 'loop')
            viewer.loop = now !== null;
        else if (name === 'muted')
            this.muted = now !== null;
        else if (name === 'poster')
            this.showPoster(now);
    }

    listen() {
        const { viewer } = this;
        const on = (id, type, call) => this.$(id).addEventListener(type, call);

        addControls(viewer, this.canvas);
        viewer.addEventListener('opened', () => this.begin());
        viewer.addEventListener('change', () => this.showState());
        viewer.addEventListener('drawn', () => this.showDrawn());
        viewer.addEventListener('ended', () => this.emit('ended'));
        viewer.addEventListener('waiting', () => {
            this.tell('loading');
            this.emit('waiting');
        });
        viewer.addEventListener('resumed', () => {
            this.tell('');
            if (viewer.playing && !viewer.isAsleep)
                this.emit('playing');
        });
        viewer.addEventListener('progress',
            ({ detail }) => this.showProgress(detail));
        viewer.addEventListener('failed', ({ detail }) => {
            this.tell(detail);
            this.emit('error', detail);
        });
        on('play', 'click', () => this.toggle());
        on('time', 'input', () => this.seek(Number(this.$('time').value)));
        on('camera', 'change', () => viewer.selectCamera(
            Number(this.$('camera').value)));
        on('rate', 'change', () => {
            this.playbackRate = this.$('rate').value;
        });
        on('reset', 'click', () => viewer.selectCamera(viewer.camera));
        on('sound', 'click', () => this.sound.toggle());
        this.sound.addEventListener('change', () => this.showSound());
        this.showSound();
        on('tilt', 'click', () => this.toggleTilt());
        this.$('tilt').hidden = !hasTilt();
        on('full', 'click', () => this.toggleFull());
        this.$('full').hidden = !document.fullscreenEnabled;
        on('headset', 'click', () => this.enterHeadset());
        this.$('headset').hidden = true;
        this.addEventListener('keydown', (event) => pressKey(this, event));
        for (const type of ['pointermove', 'pointerdown', 'keydown'])
            this.addEventListener(type, () => this.showBar());
    }

    emit(type, detail) {
        this.dispatchEvent(new CustomEvent(type, { detail }));
    }

    // --- A file

    // Opens the film of `src` as soon as it is seen, unless it has to wait for
    // play().
    load(isHeld = false) {
        this.callOff();
        this.viewer.clear();
        this.opening = null;
        this.isHeld = isHeld;
        this.showPoster(this.getAttribute('poster'));
        this.isDue = this.preload !== 'none';
        this.attend();
    }

    // Returns whether the player is seen, heard or shown in a headset.
    get isNeeded() {
        const { viewer, sound } = this;

        return this.isSeen || viewer.wanted !== null ||
            (viewer.playing && sound.isHeard);
    }

    // Only a player that is needed has a worker and a context of the graphics
    // processor. Others keep camera and time.
    attend() {
        const { viewer } = this;

        if (!this.isNeeded) {
            // A script that has paused the film may go on to play it.
            setTimeout(() => !this.isNeeded && viewer.sleep());
        } else if (this.isDue) {
            this.open(this.src).catch(() => {}); // `error` reports it
        } else if (viewer.isAsleep) {
            this.tell('');
            viewer.wake();
        }
    }

    // Opens a URL or a File. If it fails, it rejects with an error whose
    // message is a sentence.
    open(source) {
        this.isHeld = this.isHeld && this.isDue;
        this.isDue = false;
        this.tell('opening');
        this.showPoster(this.getAttribute('poster'));
        this.viewer.credentials = this.crossOrigin === 'use-credentials'
            ? 'include' : undefined;
        this.seeking = false;
        this.isFresh = true; // no picture of the film is drawn yet
        this.opening = this.viewer.open(source);
        this.emit('loadstart');
        return this.opening;
    }

    begin() {
        const { viewer } = this;
        const still = matchMedia('(prefers-reduced-motion: reduce)').matches;

        this.tell('');
        this.before = {};
        this.$('camera').replaceChildren(...viewer.rig.map(
            ({ name, number }, i) =>
                new Option(visible(name) || `camera ${number}`, i)),
        new Option('free', 'free'));
        this.$('camera').lastChild.hidden = true;
        this.$('time').max = viewer.info.nFrames - 1;
        this.$('time').disabled = viewer.info.nFrames < 2;
        this.showParts();
        this.canvas.setAttribute('aria-label', `volumetric video ${
            viewer.name}; drag or use the arrow keys to look around`);
        viewer.selectCamera(Number(
            this.getAttribute('camera') ?? viewer.start));
        this.emit('durationchange');
        this.emit('loadedmetadata');
        if (this.hasAttribute('autoplay') && !still && !this.isHeld)
            viewer.play();
        this.attend();
    }

    // --- What is shown

    tell(sentence) {
        this.$('told').textContent = sentence;
    }

    // Makes the parts of the bar, each as wide as its segments are long.
    showParts() {
        const { segments } = this.viewer;
        const n = Math.min(segments.length, MOST_PARTS);
        const frames = new Array(n).fill(0);

        segments.forEach(({ nFrames }, i) => {
            frames[this.partOf(i)] += nFrames;
        });
        this.$('parts').replaceChildren(...frames.map((nFrames) => {
            const part = document.createElement('span');

            part.style.flex = nFrames;
            return part;
        }));
    }

    partOf(segment) {
        const n = this.viewer.segments.length;

        return Math.floor(segment * Math.min(n, MOST_PARTS) / n);
    }

    showPoster(src) {
        this.$('poster').hidden = !src;
        if (src)
            this.$('poster').src = src;
    }

    // Sets the canvas's size: the canvas fills the element, or has the
    // picture's shape in the largest size that fits.
    fit() {
        const { viewer, canvas, clientWidth, clientHeight } = this;
        const sharp = globalThis.devicePixelRatio || 1;

        viewer.setRoom(clientWidth * sharp, clientHeight * sharp);
        if (!viewer.info)
            return;
        const width = viewer.fills ? clientWidth : widthOf(viewer.lens);
        const height = viewer.fills ? clientHeight : heightOf(viewer.lens);
        const scale = Math.min(clientWidth / width, clientHeight / height);

        canvas.style.width = `${Math.floor(width * scale)}px`;
        canvas.style.height = `${Math.floor(height * scale)}px`;
    }

    showState() {
        const { viewer } = this;
        const { info, frame } = viewer;
        const seconds = (frames) => (frames / info.fps).toFixed(2);
        const now = { playing: viewer.playing, frame,
            camera: viewer.moved ? 'free' : viewer.camera, pose: viewer.pose };
        const { before } = this;

        this.before = now;
        this.$('bar').classList.toggle('playing', now.playing);
        this.$('play').setAttribute('aria-label',
            now.playing ? 'Pause (space)' : 'Play (space)');
        this.$('time').value = Math.min(frame, info.nFrames - 1);
        this.$('time').setAttribute('aria-valuetext', `${seconds(frame)} of ${
            seconds(info.nFrames)} seconds`);
        this.$('clock').textContent =
            `${seconds(frame)} / ${seconds(info.nFrames)} s`;
        this.$('camera').value = now.camera;
        this.$('edge').style.opacity = shade(viewer.bounds.out);
        this.fit();
        if (before.playing !== now.playing && (before.playing || now.playing))
            this.emit(now.playing ? 'play' : 'pause');
        if (before.frame !== frame)
            this.emit('timeupdate');
        if (before.pose !== now.pose)
            this.emit('camerachange');
        this.attend();
        this.showBar();
    }

    showSound() {
        const { exists, isHeard } = this.sound;
        const label = `Sound ${isHeard ? 'off' : 'on'} (M)`;

        this.$('sound').hidden = !exists;
        this.$('sound').classList.toggle('heard', isHeard);
        this.$('sound').setAttribute('aria-label', label);
        this.$('sound').title = label;
        this.emit('volumechange');
        this.attend();
    }

    showDrawn() {
        this.$('poster').hidden = true;
        if (this.isFresh) {
            this.isFresh = false;
            hasHeadset().then((has) => {
                this.$('headset').hidden = !has ||
                    !this.viewer.screen.takesSplats;
            });
            this.emit('loadeddata');
            this.emit('canplay');
        }
        if (this.seeking && !this.viewer.stale) {
            this.seeking = false;
            this.emit('seeked');
        }
        const kept = new Set(this.viewer.drawn.kept.map(
            (segment) => this.partOf(segment)));

        [...this.$('parts').children].forEach((part, i) => {
            if (kept.has(i))
                part.style.setProperty('--got', '100%');
            else if (part.style.getPropertyValue('--got') === '100%')
                part.style.removeProperty('--got'); // its bytes were dropped
        });
    }

    // Shows how much of the awaited segment has arrived, as text and in the
    // segment's part of the bar.
    showProgress({ segment, got, nbytes }) {
        const { viewer } = this;
        const percent = `${Math.round(100 * got / nbytes)}%`;

        if (nbytes > 0 && segment >= 0)
            this.$('parts').children[this.partOf(segment)]?.style
                .setProperty('--got', percent);
        if (nbytes > 0 && (!viewer.info || viewer.waiting) &&
            (segment < 0 || segment === viewer.asked))
            this.tell(`loading ${percent}`);
        this.emit('progress', { segment, got, nbytes });
    }

    // Shows the bar, which stays while the user does something or the film
    // stands.
    showBar() {
        clearTimeout(this.barTimer);
        this.removeAttribute('resting');
        if (this.viewer.playing)
            this.barTimer = setTimeout(
                () => this.toggleAttribute('resting', true), REST_MS);
    }

    // --- What buttons and keys do

    toggle() {
        if (!this.paused)
            this.pause();
        else
            this.play().catch(() => {}); // the `error` event reports it
    }

    toggleFull() {
        if (document.fullscreenElement)
            document.exitFullscreen();
        else
            this.requestFullscreen();
    }

    async toggleTilt() {
        const show = () => this.$('tilt').setAttribute('aria-pressed',
            this.tilt.isOn);
        const done = this.tilt.toggle();

        try {
            show();
            await done;
        } catch (error) {
            this.tell(`the picture cannot follow the device (${
                error.message})`);
        }
        show();
    }

    async enterHeadset() {
        if (this.$('headset').hidden || !this.info)
            return;
        try {
            await enterHeadset(this.viewer);
        } catch (error) {
            this.tell(`the headset cannot be entered (${error.message})`);
        }
    }

    step(frames) {
        this.viewer.pause();
        this.seek(Math.round(this.viewer.frame) + frames);
    }

    seek(frame) {
        if (!this.info)
            return;
        this.seeking = true;
        this.emit('seeking');
        this.viewer.seek(frame);
    }

    // --- For scripts

    // Resolves when the film plays; rejects if it cannot be opened, or if it is
    // paused before.
    async play() {
        const { signal } = this.pausing;

        this.isAsked = true;
        try {
            if (!this.viewer.info)
                await Promise.race([aborted(signal), this.opening &&
                    !this.error ? this.opening : this.open(this.src)]);
            signal.throwIfAborted();
            this.viewer.play();
        } finally {
            this.isAsked &&= signal !== this.pausing.signal;
        }
        await this.drawn();
        signal.throwIfAborted();
        if (this.paused && !this.ended)
            throw pausedBefore();
        this.emit('playing');
    }

    // Rejects what play() has promised and not kept.
    callOff() {
        this.isAsked = false;
        this.pausing.abort(pausedBefore());
        this.pausing = new AbortController();
    }

    // Also a film that is not open yet stays paused.
    pause() {
        this.isHeld = true;
        this.callOff();
        this.viewer.pause();
    }

    // Resolves when the next picture is drawn, or the film is paused.
    drawn() {
        return new Promise((resolve, reject) => {
            const { viewer } = this, over = new AbortController();
            const { signal } = over;
            const end = () => {
                over.abort();
                if (viewer.error)
                    reject(new Error(viewer.error.message));
                resolve();
            };

            viewer.addEventListener('drawn', end, { signal });
            viewer.addEventListener('failed', end, { signal });
            this.addEventListener('pause', end, { signal });
        });
    }

    toState() { return this.viewer.toState(); }
    setState(line) { return this.viewer.setState(line); }

    get info() { return this.viewer.info; }
    get rig() { return this.viewer.rig; }
    get paused() { return !this.viewer.playing && !this.isAsked; }

    get duration() {
        return this.info ? this.info.nFrames / this.info.fps : NaN;
    }

    get currentTime() {
        return this.info ? this.viewer.frame / this.info.fps : 0;
    }

    set currentTime(seconds) {
        if (this.info)
            this.seek(seconds * this.info.fps);
    }

    get ended() {
        return this.paused && !this.viewer.loop && Boolean(this.info) &&
            this.viewer.frame >= this.info.nFrames - 1;
    }

    // { code, message }, with the codes of MediaError, or null.
    get error() { return this.viewer.error; }

    get readyState() {
        const { info, drawn, frame, segments } = this.viewer;

        if (!info)
            return HAVE_NOTHING;
        if (!drawn || drawn.segment !== this.viewer.segmentAt(frame))
            return HAVE_METADATA;
        return drawn.kept.length === segments.length ? HAVE_ENOUGH_DATA
            : HAVE_FUTURE_DATA;
    }

    // The times whose segments are here, as a TimeRanges.
    get buffered() {
        const { info, drawn, segments } = this.viewer;
        const ranges = [];

        for (const i of [...drawn?.kept ?? []].sort((a, b) => a - b)) {
            const { firstFrame, nFrames } = segments[i];
            const last = ranges[ranges.length - 1];

            if (last?.end === firstFrame)
                last.end += nFrames;
            else
                ranges.push({ start: firstFrame, end: firstFrame + nFrames });
        }
        return { length: ranges.length,
            start: (i) => ranges[i].start / info.fps,
            end: (i) => ranges[i].end / info.fps };
    }

    get playbackRate() { return this.viewer.rate; }
    set playbackRate(rate) {
        this.viewer.rate = Math.max(0, Number(rate) || 0);
        // The element shows nothing if the rate is not one of its choices.
        this.$('rate').value = this.viewer.rate;
        this.emit('ratechange');
    }

    get muted() { return this.sound.muted; }
    set muted(muted) { this.sound.muted = muted; }

    get volume() { return this.sound.audio.volume; }
    set volume(volume) {
        this.sound.audio.volume = volume;
        this.emit('volumechange');
    }

    get preload() { return this.getAttribute('preload') || 'auto'; }
    set preload(preload) { this.setAttribute('preload', preload); }
    get crossOrigin() { return this.getAttribute('crossorigin'); }
    set crossOrigin(mode) { this.setAttribute('crossorigin', mode); }
    get src() { return this.getAttribute('src') || ''; }
    set src(address) { this.setAttribute('src', address); }

    // -1 if the camera was moved.
    get camera() { return this.viewer.moved ? -1 : this.viewer.camera ?? 0; }
    set camera(index) { this.setAttribute('camera', index); }
}

globalThis.customElements?.define('saga-player', SagaPlayer);
