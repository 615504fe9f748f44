// SPDX-License-Identifier: MIT
//
// The page around a viewer: time, cameras, numbers, paths, files dropped on
// it. The address may say what to show (README.md lists the parameters).

import { Viewer } from './viewer.js';
import { addControls } from './controls.js';
import { FORMAT, parsePath } from './path.js';
import { heightOf, widthOf } from './camera.js';

const $ = (id) => document.getElementById(id);
const root = document.documentElement;
const asked = new URLSearchParams(location.search);
const carried = JSON.parse($('carried').textContent);
const KEY_SECONDS = 2; // from one key camera to the next
const RATE_MS = 2000;  // over which pictures are counted

const viewer = new Viewer($('canvas'), {
    simd: asked.get('simd') === '0' ? false : undefined,
    seconds: Number(asked.get('seconds')) || carried.seconds,
});
let references = [];    // { camera, frame, crc } of the file that is shown
let keys = [];          // of the camera path

// For scripts on the page, and for the tests.
window.viewer = viewer;

// --- Opening ---------------------------------------------------------------

function setState(state) {
    root.dataset.state = state;
}

function tellProblem(sentence) {
    $('sentence').textContent = sentence;
    setState('problem');
}

function dismiss() {
    setState(viewer.drawn ? 'ready' : 'empty');
}

async function open(source, pictures = []) {
    references = pictures;
    setState('loading');
    try {
        await viewer.open(source);
    } catch {
        return false; // the `failed` event has told it
    }
    return true;
}

// "frame=12" or "time=0.5", in seconds.
function askedFrame() {
    if (asked.has('time'))
        return Number(asked.get('time')) * viewer.info.fps;
    return Number(asked.get('frame') || 0);
}

async function openAsked() {
    const src = asked.get('src') || carried.src;
    const crc = asked.get('crc');
    const pictures = !asked.has('src') || src === carried.src
        ? carried.pictures : [];

    if (!src)
        return;
    if (!await open(src, crc ? [{ camera: Number(asked.get('camera') || 0),
        frame: Number(asked.get('frame') || 0), crc }] : pictures))
        return;
    viewer.selectCamera(Number(asked.get('camera') || 0));
    viewer.seek(askedFrame() || 0);
    if (asked.has('path'))
        await openPath(fetch(asked.get('path')), asked.get('path'));
    if (asked.get('play') === '1' && keys.length)
        viewer.playPath(keys);
    else if (asked.get('play') === '1')
        viewer.play();
}

// A .saga file, or a path of key cameras.
function openFile(file) {
    if (file.name.endsWith('.json'))
        openPath(file, file.name);
    else
        open(file);
}

// --- What is shown ---------------------------------------------------------

const plural = (n, word) => `${n.toLocaleString('en')} ${word}` +
    (n === 1 ? '' : 's');

function bytesText(n) {
    return n < 1e6 ? `${(n / 1000).toFixed(1)} kB`
        : `${(n / 1e6).toFixed(2)} MB`;
}

function showFile() {
    const { info, rig } = viewer;

    $('name').textContent = viewer.name;
    $('summary').textContent = [
        `${(info.nFrames / info.fps).toFixed(1)} s`,
        plural(info.nFrames, 'frame'), plural(rig.length, 'camera'),
        ...viewer.size ? [bytesText(viewer.size)] : []].join('  \u00b7  ');
    document.title = `${viewer.name} - saga`;
    $('camera').replaceChildren(...rig.map(({ name, number }, i) =>
        new Option(name || `camera ${number}`, i)), new Option('free', 'free'));
    $('camera').lastChild.hidden = true;
    $('time').max = info.nFrames - 1;
    $('time').disabled = info.nFrames < 2;
    $('parts').replaceChildren(...viewer.segments.map(({ nFrames }) => {
        const part = document.createElement('span');

        part.style.flex = nFrames;
        return part;
    }));
    setState('ready');
}

// Called as soon as the user does something.
function showState() {
    const { info, frame } = viewer;

    if (!info)
        return;
    root.classList.toggle('playing', viewer.playing);
    $('play').setAttribute('aria-label', viewer.playing ? 'Pause' : 'Play');
    $('time').value = Math.min(frame, info.nFrames - 1);
    $('clock').textContent = `${(frame / info.fps).toFixed(2)} / ` +
        `${(info.nFrames / info.fps).toFixed(2)} s`;
    $('scale').value = viewer.scale;
    $('camera').value = viewer.moved ? 'free' : viewer.camera;
    viewer.wantCrc = !$('stats').hidden || !viewer.playing;
    fit();
}

// The canvas as large as the stage has room for.
function fit() {
    if (!viewer.info)
        return;
    const width = widthOf(viewer.lens), height = heightOf(viewer.lens);
    const { clientWidth, clientHeight } = $('stage');
    const scale = Math.min(clientWidth / width, clientHeight / height);

    $('canvas').style.width = `${Math.floor(width * scale)}px`;
    $('canvas').style.height = `${Math.floor(height * scale)}px`;
}

// --- Numbers ---------------------------------------------------------------

let shown = []; // when the last pictures came, ms

// What came before the last RATE_MS says nothing of now: the time to begin with
// is that of the last picture before them.
function noteShown(now) {
    shown.push(now);
    while (shown.length > 2 && now - shown[1] >= RATE_MS)
        shown.shift();
}

function rateText() {
    const span = shown[shown.length - 1] - shown[0];

    if (!viewer.playing)
        return 'at rest';
    return span > 0 ? `${(1000 * (shown.length - 1) / span).toFixed(1)} ` +
        'a second' : '';
}

// What the reference decoder says of this picture; undefined: it is not said.
function referenceOf({ num, den, values }) {
    if (viewer.moved || viewer.scale !== 1 || den !== 1)
        return undefined;
    return references.find(({ camera, frame }) => frame === num &&
        viewer.rig[camera]?.values.every((v, i) => v === values[i]))?.crc;
}

function crcText(drawn) {
    const reference = referenceOf(drawn);

    if (!drawn.crc)
        return ['', ''];
    if (!reference)
        return [drawn.crc, ''];
    return drawn.crc === reference ? [`${drawn.crc} = reference`, 'good']
        : [`${drawn.crc}, reference ${reference}`, 'bad'];
}

function showNumbers() {
    const { drawn } = viewer;
    const { times } = drawn;
    const [crc, verdict] = crcText(drawn);
    const rows = [
        ['picture', `${drawn.width} \u00d7 ${drawn.height}`],
        ['primitives', `${drawn.nSplats.toLocaleString('en')} seen of ` +
            drawn.nPrimitives.toLocaleString('en')],
        ['view, draw', `${times.view.toFixed(1)}, ${times.draw.toFixed(1)} ms`],
        ['shown', rateText()],
        ['segment', `${drawn.segment + 1} of ${viewer.segments.length}, ` +
            `decoded in ${times.segment.toFixed(0)} ms`],
        ['fetched', bytesText(drawn.fetched) +
            (drawn.size ? ` of ${bytesText(drawn.size)}` : '')],
        ['decoder', viewer.usesSimd ? 'WebAssembly, SIMD' : 'WebAssembly'],
        ['CRC-32C', crc, verdict],
    ];

    root.dataset.crc = drawn.crc || '';
    root.dataset.verdict = verdict;
    $('stats').replaceChildren(...rows.flatMap(([name, value, kind]) => {
        const dt = document.createElement('dt');
        const dd = document.createElement('dd');

        dt.textContent = name;
        dd.textContent = value;
        dd.className = kind || '';
        return [dt, dd];
    }));
}

function showDrawn() {
    if (viewer.playing)
        noteShown(performance.now());
    else
        shown = [];
    [...$('parts').children].forEach((part, i) =>
        part.classList.toggle('kept', viewer.drawn.kept.includes(i)));
    showNumbers();
}

// --- A path ----------------------------------------------------------------

function addKey() {
    const last = keys[keys.length - 1];

    keys.push(viewer.key(last ? last.seconds + KEY_SECONDS : 0));
    showKeys();
}

function keyItem(key, i) {
    const item = document.createElement('li');
    const go = document.createElement('button');
    const seconds = document.createElement('input');
    const remove = document.createElement('button');

    go.className = 'go';
    go.textContent = `${i + 1}   frame ${key.frame.toFixed(0)}`;
    go.title = 'Show this camera';
    go.onclick = () => { viewer.pause(); viewer.goToKey(key); };
    seconds.type = 'number';
    seconds.min = 0;
    seconds.step = 0.5;
    seconds.value = key.seconds;
    seconds.title = 'Seconds from the path\'s start';
    seconds.onchange = () => {
        key.seconds = Math.max(0, Number(seconds.value) || 0);
        keys.sort((a, b) => a.seconds - b.seconds);
        showKeys();
    };
    remove.textContent = '\u00d7';
    remove.title = 'Remove this camera';
    remove.onclick = () => { keys.splice(i, 1); showKeys(); };
    item.append(go, seconds, 's', remove);
    return item;
}

function showKeys() {
    $('keys').replaceChildren(...keys.map(keyItem));
    $('no-keys').hidden = keys.length > 0;
    for (const id of ['play-path', 'save-path', 'clear-path'])
        $(id).disabled = !keys.length;
}

function savePath() {
    const { lens, info } = viewer;
    const path = { format: FORMAT, fps: info.fps,
        size: [widthOf(lens), heightOf(lens)], keys };
    const link = document.createElement('a');

    link.href = URL.createObjectURL(new Blob(
        [JSON.stringify(path, null, 1) + '\n'], { type: 'application/json' }));
    link.download = viewer.name.replace(/\.saga$/, '') + '-path.json';
    link.click();
    URL.revokeObjectURL(link.href);
}

// from: a File, or the promise of a Response.
async function openPath(from, name) {
    try {
        const file = await from;

        if (file.ok === false)
            throw new Error(`the server answers ${file.status}`);
        keys = parsePath(await file.text()).keys;
        $('path').hidden = false;
        showKeys();
        showPressed();
    } catch (error) {
        tellProblem(`${name}: ${error.message}`);
    }
}

// --- Controls --------------------------------------------------------------

function showPressed() {
    $('show-stats').setAttribute('aria-pressed', !$('stats').hidden);
    $('show-path').setAttribute('aria-pressed', !$('path').hidden);
}

function toggle(panel) {
    $(panel).hidden = !$(panel).hidden;
    showPressed();
    viewer.wantCrc = true;
}

function togglePlaying() {
    if (viewer.playing)
        viewer.pause();
    else
        viewer.play();
}

function toggleFull() {
    if (document.fullscreenElement)
        document.exitFullscreen();
    else
        root.requestFullscreen();
}

function step(frames) {
    viewer.pause();
    viewer.seek(Math.round(viewer.frame) + frames);
}

const shortcuts = {
    ' ': togglePlaying,
    ',': () => step(-1),
    '.': () => step(1),
    ArrowLeft: () => step(-1),
    ArrowRight: () => step(1),
    f: toggleFull,
    k: () => { $('path').hidden = false; showPressed(); addKey(); },
    p: () => toggle('path'),
    r: () => viewer.selectCamera(viewer.camera),
    s: () => toggle('stats'),
};

function onKey(event) {
    const digit = Number(event.key);

    if (event.key === 'Escape' && root.dataset.state === 'problem')
        dismiss();
    if (!viewer.info || event.ctrlKey || event.metaKey || event.altKey ||
        event.target.matches('input[type="number"], select') ||
        (event.key === ' ' && event.target.matches('button')))
        return;
    if (digit >= 1 && digit <= 9 && digit <= viewer.rig.length)
        viewer.selectCamera(digit - 1);
    else if (shortcuts[event.key])
        shortcuts[event.key]();
    else
        return;
    event.preventDefault();
}

const on = (id, type, call) => $(id).addEventListener(type, call);

on('play', 'click', togglePlaying);
on('time', 'input', () => viewer.seek(Number($('time').value)));
on('camera', 'change', () => viewer.selectCamera(Number($('camera').value)));
on('reset', 'click', () => viewer.selectCamera(viewer.camera));
on('scale', 'change', () => viewer.setScale(Number($('scale').value)));
on('show-path', 'click', () => toggle('path'));
on('show-stats', 'click', () => toggle('stats'));
on('full', 'click', toggleFull);
on('add-key', 'click', addKey);
on('play-path', 'click', () => viewer.playPath(keys));
on('save-path', 'click', savePath);
on('clear-path', 'click', () => { keys = []; showKeys(); });
on('file', 'change', () => {
    if ($('file').files.length)
        openFile($('file').files[0]);
});
on('dismiss', 'click', dismiss);

addEventListener('keydown', onKey);
addEventListener('resize', fit);
addEventListener('dragover', (event) => {
    event.preventDefault();
    root.classList.add('dropping');
});
addEventListener('dragleave', () => root.classList.remove('dropping'));
addEventListener('drop', (event) => {
    event.preventDefault();
    root.classList.remove('dropping');
    if (event.dataTransfer.files.length)
        openFile(event.dataTransfer.files[0]);
});

let rest;
addEventListener('pointermove', () => {
    clearTimeout(rest);
    root.classList.remove('resting');
    rest = setTimeout(() => root.classList.add('resting'), 2500);
});

viewer.addEventListener('opened', showFile);
viewer.addEventListener('change', showState);
viewer.addEventListener('drawn', showDrawn);
viewer.addEventListener('failed', (event) => tellProblem(event.detail));
addControls(viewer, $('canvas'));
$('stats').hidden = asked.get('stats') !== '1';
$('path').hidden = !asked.has('path');
viewer.wantCrc = true;
showPressed();
showKeys();
openAsked();
