// SPDX-License-Identifier: MIT
//
// An element that plays a .saga file:
//
//     <script type="module" src="player.js"></script>
//     <saga-player src="scene.saga" autoplay loop controls></saga-player>
//
// Attributes: src; autoplay, unless the user prefers reduced motion; loop;
// camera, an index of the rig from 0; poster, a picture until the first one is
// drawn; controls, the bar; draw="exact", the decoder's own pixels; muted, no
// sound until it is turned on.
//
// Events: loadeddata, play, pause, waiting, playing, progress, ended,
// timeupdate, ratechange, volumechange, camerachange, error. Its style sets its
// size; the default is 16:9 of the width. Elements in it with slot="buttons"
// are added to the bar. player.d.ts has properties and methods.

import { addControls, moveByKey } from './controls.js';
import { heightOf, widthOf } from './camera.js';
import { trust } from './places.js';
import { Sound } from './sound.js';
import { visible } from './source.js';
import { Viewer } from './viewer.js';
import { enterHeadset, hasHeadset } from './xr.js';

const REST_MS = 2500; // time without a pointer movement, until the bar
                      // disappears
const MOST_PARTS = 400; // of the bar; each stands for as many segments
const RATES = [0.25, 0.5, 1, 1.5, 2]; // rates of playback that the bar offers

const icon = (id, label, paths) => `<button class="icon" id="${id}"
    title="${label}" aria-label="${label}"><svg viewBox="0 0 24 24"
    aria-hidden="true">${paths}</svg></button>`;

const STYLE = `
:host { display: block; position: relative; aspect-ratio: 16 / 9;
    overflow: hidden; background: #000; color: #d9dcdf; color-scheme: dark;
    container-type: inline-size;
    font: 14px/1.45 system-ui, "Segoe UI", "DejaVu Sans", sans-serif;
    --accent: #e0a458; }
:host([hidden]), [hidden] { display: none !important; }
#frame { position: absolute; inset: 0; display: grid; place-items: center; }
canvas { outline: none; cursor: grab; touch-action: none; user-select: none; }
canvas:active { cursor: grabbing; }
canvas:focus-visible { outline: 2px solid var(--accent); outline-offset: -2px; }
#poster { position: absolute; width: 100%; height: 100%; object-fit: contain;
    pointer-events: none; }
#told { position: absolute; max-width: 34em; margin: 0; padding: 0 24px;
    text-align: center; overflow-wrap: anywhere; }
#bar { position: absolute; inset: auto 0 0; display: flex; align-items: center;
    gap: 8px; padding: 28px 12px 8px; transition: opacity 0.3s;
    background: linear-gradient(transparent, #000b); }
:host([resting]) #bar:not(:focus-within) { opacity: 0; }
:host([resting]) canvas { cursor: none; }
#line { position: relative; flex: 1; min-width: 60px; display: grid; }
#parts { position: absolute; inset: 0 8px; display: flex; align-items: center;
    gap: 2px; }
#parts span { height: 4px; border-radius: 2px;
    background: linear-gradient(90deg, #fff9 var(--got, 0%), #fff4 0); }
#time { position: relative; width: 100%; height: 28px; margin: 0;
    background: none; appearance: none; cursor: pointer; }
#time::-webkit-slider-runnable-track, #time::-moz-range-track {
    background: none; }
#time::-webkit-slider-thumb { appearance: none; width: 16px; height: 16px;
    border-radius: 50%; background: var(--accent); }
#time::-moz-range-thumb { width: 16px; height: 16px; border: 0;
    border-radius: 50%; background: var(--accent); }
#clock { min-width: 8.5em; text-align: right; white-space: nowrap;
    font-variant-numeric: tabular-nums; }
select, ::slotted(select) { max-width: 10em; padding: 4px 9px; font: inherit;
    border: 1px solid #fff3; border-radius: 6px; background: #24272a;
    color: inherit; }
.icon { display: grid; place-items: center; flex: none; width: 34px;
    height: 34px; padding: 0; border: 0; border-radius: 6px; background: none;
    color: inherit; cursor: pointer; }
.icon:hover { background: #fff2; }
.icon svg { width: 20px; height: 20px; fill: currentColor; }
.icon .stroke { fill: none; stroke: currentColor; stroke-width: 2; }
:focus-visible { outline: 2px solid var(--accent); outline-offset: 1px; }
.pauses, .playing .plays { display: none; }
.playing .pauses { display: inline; }
.waves { display: none; }
.heard .waves { display: inline; }
.heard .cross { display: none; }
@container (max-width: 640px) {
    #clock { display: none; }
    select { max-width: 6em; }
    #bar { gap: 4px; padding-inline: 6px; }
}
@media (prefers-reduced-motion: reduce) { #bar { transition: none; } }
`;

const MARKUP = `<div id="frame">
  <canvas tabindex="0" role="img" part="canvas"
    aria-label="volumetric video; drag or use the arrow keys to look around">
  </canvas>
  <img id="poster" alt="" hidden>
  <p id="told" part="told" role="status"></p>
</div>
<div id="bar" part="bar" role="group" aria-label="player" hidden>
  ${icon('play', 'Play (space)', `<path class="plays" d="M7 4v16l13-8z"/><path
      class="pauses" d="M6 4h4v16H6zM14 4h4v16h-4z"/>`)}
  <div id="line"><div id="parts"></div><input type="range" id="time" min="0"
    max="0" step="any" value="0" aria-label="time"></div>
  <output id="clock">0.00 / 0.00 s</output>
  <select id="camera" title="Camera (1 to 9)" aria-label="camera"></select>
  <select id="rate" title="Speed" aria-label="speed">${RATES.map((rate) =>
        `<option value="${rate}"${rate === 1 ? ' selected' : ''}>${rate}&times;
        </option>`).join('')}</select>
  ${icon('reset', 'Back to the camera (R)',
        '<path class="stroke" d="M5 5v5h5M5.5 10a7.5 7.5 0 1 1-1 5"/>')}
  ${icon('sound', 'Sound on (M)', `<path d="M4 9h4l5-4v14l-5-4H4z"/><path
      class="stroke waves" d="M16 9a4 4 0 0 1 0 6M18.5 6a8 8 0 0 1 0 12"/><path
      class="stroke cross" d="M16 9.5l5 5M21 9.5l-5 5"/>`)}
  <slot name="buttons"></slot>
  ${icon('headset', 'In a headset (V)', `<path class="stroke"
      d="M3 7h18v10h-6l-3-3-3 3H3z"/>`)}
  ${icon('full', 'Full screen (F)', `<path class="stroke"
      d="M4 9V4h5M15 4h5v5M20 15v5h-5M9 20H4v-5"/>`)}
</div>`;

// A server that renders pages imports this module, too, and has no elements.
const Base = globalThis.HTMLElement ?? class {};

export class SagaPlayer extends Base {
    static observedAttributes = ['src', 'camera', 'controls', 'draw', 'loop',
        'muted', 'poster'];

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
        this.watcher = new ResizeObserver(() => this.fit());
        this.listen();
    }

    connectedCallback() {
        this.watcher.observe(this);
        this.viewer.screen.regain?.();
        if (this.isShut && this.src)
            this.open(this.src).catch(() => {});
        this.isShut = false;
    }

    disconnectedCallback() {
        this.watcher.disconnect();
        // An element that is only moved within the page goes on.
        setTimeout(() => {
            if (!this.isConnected)
                this.shut();
        });
    }

    // Ends workers and gives the graphics processor's memory back.
    shut() {
        this.isShut = true;
        this.viewer.clear();
        this.sound.clear();
        this.viewer.screen.release?.();
    }

    attributeChangedCallback(name, before, now) {
        const { viewer } = this;

        if (name === 'src' && now)
            this.open(now).catch(() => {}); // the `error` event reports it
        else if (name === 'camera')
            viewer.selectCamera(Number(now));
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
            if (viewer.playing)
                this.emit('playing');
        });
        viewer.addEventListener('progress',
            ({ detail }) => this.showProgress(detail));
        viewer.addEventListener('failed', ({ detail }) => {
            this.tell(detail);
            this.emit('error', detail);
        });
        on('play', 'click', () => this.toggle());
        on('time', 'input', () => viewer.seek(Number(this.$('time').value)));
        on('camera', 'change', () => viewer.selectCamera(
            Number(this.$('camera').value)));
        on('rate', 'change', () => {
            this.playbackRate = this.$('rate').value;
        });
        on('reset', 'click', () => viewer.selectCamera(viewer.camera));
        on('sound', 'click', () => this.sound.toggle());
        this.sound.addEventListener('change', () => this.showSound());
        this.showSound();
        on('full', 'click', () => this.toggleFull());
        on('headset', 'click', () => this.enterHeadset());
        this.$('headset').hidden = true;
        hasHeadset().then((has) => {
            this.$('headset').hidden = !has || !viewer.screen.takesSplats;
        });
        this.addEventListener('keydown', (event) => this.onKey(event));
        for (const type of ['pointermove', 'pointerdown', 'keydown'])
            this.addEventListener(type, () => this.wake());
    }

    emit(type, detail) {
        this.dispatchEvent(new CustomEvent(type, { detail }));
    }

    // --- A file

    // Opens a URL or a File. If it fails, it rejects with an error whose
    // message is a sentence.
    async open(source) {
        this.tell('opening');
        this.showPoster(this.getAttribute('poster'));
        await this.viewer.open(source);
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
        viewer.selectCamera(Number(this.getAttribute('camera')));
        this.emit('loadeddata');
        if (this.hasAttribute('autoplay') && !still)
            viewer.play();
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
        this.$('time').setAttribute('aria-valuetext', `${seconds(frame)} s`);
        this.$('clock').textContent =
            `${seconds(frame)} / ${seconds(info.nFrames)} s`;
        this.$('camera').value = now.camera;
        this.fit();
        if (before.playing !== now.playing && (before.playing || now.playing))
            this.emit(now.playing ? 'play' : 'pause');
        if (before.frame !== frame)
            this.emit('timeupdate');
        if (before.pose !== now.pose)
            this.emit('camerachange');
        this.wake();
    }

    showSound() {
        const { exists, isHeard } = this.sound;
        const label = `Sound ${isHeard ? 'off' : 'on'} (M)`;

        this.$('sound').hidden = !exists;
        this.$('sound').classList.toggle('heard', isHeard);
        this.$('sound').setAttribute('aria-label', label);
        this.$('sound').title = label;
        this.emit('volumechange');
    }

    showDrawn() {
        this.$('poster').hidden = true;
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
    wake() {
        clearTimeout(this.sleeping);
        this.removeAttribute('resting');
        if (this.viewer.playing)
            this.sleeping = setTimeout(
                () => this.toggleAttribute('resting', true), REST_MS);
    }

    // --- Keys

    toggle() {
        if (this.viewer.playing)
            this.viewer.pause();
        else
            this.viewer.play();
    }

    toggleFull() {
        if (document.fullscreenElement)
            document.exitFullscreen();
        else
            this.requestFullscreen();
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
        this.viewer.seek(Math.round(this.viewer.frame) + frames);
    }

    // Handles keys of the element, and of a page that consists of a player.
    onKey(event) {
        const { viewer } = this;
        const [at] = event.composedPath();
        const digit = Number(event.key);
        const calls = {
            ' ': () => this.toggle(),
            ',': () => this.step(-1),
            '.': () => this.step(1),
            f: () => this.toggleFull(),
            m: () => this.sound.toggle(),
            v: () => this.enterHeadset(),
            r: () => viewer.selectCamera(viewer.camera),
            g: () => viewer.setExact(!viewer.exact),
        };

        if (!viewer.info || event.defaultPrevented || event.ctrlKey ||
            event.metaKey || event.altKey || at.matches?.('input, select') ||
            (event.key === ' ' && at.matches?.('button')))
            return;
        if (digit >= 1 && digit <= 9 && digit <= viewer.rig.length)
            viewer.selectCamera(digit - 1);
        else if (calls[event.key.toLowerCase()])
            calls[event.key.toLowerCase()]();
        else if (!moveByKey(viewer, event.key))
            return;
        event.preventDefault();
    }

    // --- For scripts

    play() { this.viewer.play(); }
    pause() { this.viewer.pause(); }
    toState() { return this.viewer.toState(); }
    setState(line) { return this.viewer.setState(line); }

    get info() { return this.viewer.info; }
    get rig() { return this.viewer.rig; }
    get paused() { return !this.viewer.playing; }

    get duration() {
        return this.info ? this.info.nFrames / this.info.fps : NaN;
    }

    get currentTime() {
        return this.info ? this.viewer.frame / this.info.fps : 0;
    }

    set currentTime(seconds) {
        if (this.info)
            this.viewer.seek(seconds * this.info.fps);
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

    get src() { return this.getAttribute('src') || ''; }
    set src(address) { this.setAttribute('src', address); }

    // -1 if the camera was moved.
    get camera() { return this.viewer.moved ? -1 : this.viewer.camera ?? 0; }
    set camera(index) { this.setAttribute('camera', index); }
}

globalThis.customElements?.define('saga-player', SagaPlayer);
