// SPDX-License-Identifier: MIT
//
// The page around a player: numbers, paths, files dropped on it. Parameters of
// the address select what is shown (README.md lists them). The present view is
// written after its #, so that it can be shared.

import './player.js';
import { FORMAT, parsePath } from './path.js';
import { heightOf, widthOf } from './camera.js';
import { pressKey } from './keys.js';
import { visible } from './source.js';
import { followTraining } from './training.js';
import { carriedFilm, wholePage } from './whole.js';

const $ = (id) => document.getElementById(id);
const root = document.documentElement;
const asked = new URLSearchParams(location.search);
const carried = JSON.parse($('carried').textContent);
const KEY_SECONDS = 2; // time of the path from one key camera to the next
const RATE_MS = 2000;  // time over which pictures are counted
const SETTLED_MS = 300; // time without a change, after which the view is
                        // written to the address

const player = $('player');
const { viewer } = player;
let references = [];    // { camera, frame, crc }: known checksums of pictures
                        // of the open file
let keys = [];          // key cameras of the path
let opened = null;      // the file that is shown, or its address
let noted = null;       // the last state that was written to the address
let settling = 0;       // the timer of SETTLED_MS

// Scripts on the page, and the tests, may use the viewer.
window.viewer = viewer;

// --- Opening ---------------------------------------------------------------

function setState(state) {
    root.dataset.state = state;
}

function tellProblem(sentence) {
    $('sentence').textContent = visible(sentence);
    setState('problem');
}

function dismiss() {
    setState(viewer.drawn ? 'ready' : 'empty');
}

async function open(source, pictures = []) {
    references = pictures;
    opened = source;
    setState('loading');
    try {
        await player.open(source);
    } catch {
        return false; // the `failed` event has reported it
    }
    return true;
}

// Returns the frame that the address asks for, as "frame=12" or, in seconds, as
// "time=0.5".
function askedFrame() {
    if (asked.has('time'))
        return Number(asked.get('time')) * viewer.info.fps;
    return Number(asked.get('frame') || 0);
}

// Returns the film of a page that has it in it, or else its address.
async function askedFilm() {
    try {
        return await carriedFilm(carried.name) ?? (asked.get('src') ||
            carried.src);
    } catch (error) {
        tellProblem(`the film in this page cannot be unpacked (${
            error.message}); use a browser of 2023 or later`);
        return null;
    }
}

async function openAsked() {
    const src = await askedFilm();
    const crc = asked.get('crc');
    const pictures = !asked.has('src') || src === carried.src
        ? carried.pictures : [];

    if (!src)
        return;
    if (!await open(src, crc ? [{ camera: Number(asked.get('camera') || 0),
        frame: Number(asked.get('frame') || 0), crc }] : pictures))
        return;
    if (!viewer.setState(location.hash.slice(1))) {
        viewer.selectCamera(Number(asked.get('camera') ?? viewer.start));
        viewer.seek(askedFrame() || 0);
    }
    noted = viewer.toState();
    if (asked.has('path'))
        await openPath(fetch(asked.get('path')), asked.get('path'));
    if (asked.get('play') === '1' && keys.length)
        viewer.playPath(keys);
    else if (asked.get('play') === '1')
        viewer.play();
}

// Opens a .saga file, or a path of key cameras.
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
    setState('ready');
}

// Updates the page's controls after a change of what is shown.
function showState() {
    $('scale').value = viewer.scale;
    $('scale').hidden = viewer.fills;
    viewer.wantCrc = !$('stats').hidden || !viewer.playing;
    clearTimeout(settling);
    if (!viewer.playing)
        settling = setTimeout(noteState, SETTLED_MS);
}

// Writes the view to the address, which stays as it was until the view changes.
function noteState() {
    const state = viewer.toState();

    // A page inside another page has no address of its own.
    if (noted === null || state === noted || location.protocol === 'about:')
        return;
    noted = state;
    history.replaceState(null, '', '#' + state);
}

// --- Numbers ---------------------------------------------------------------

let shown = []; // times of the last pictures, ms

// Notes that a picture was shown. Of the pictures older than RATE_MS only the
// last one is kept: the count of pictures a second begins at its time.
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

// Returns the known checksum of this picture, or undefined if there is none.
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

// The file does not say which cameras of the rig were trained on.
function expectedRows({ expected, leastExpected: least }) {
    if (expected === null)
        return [];
    const there = expected.toFixed(1), between = least?.toFixed(1);

    return [['expected here', there === between ? `${there} dB of PSNR`
        : `${between ? `${between} dB of PSNR, ${there}`
            : `${there} dB of PSNR`} at a camera of the training`]];
}

function showNumbers() {
    const { drawn } = viewer;
    const { times } = drawn;
    const [crc, verdict] = crcText(drawn);
    const rows = [
        ['picture', `${drawn.width} \u00d7 ${drawn.height}`],
        ['primitives', `${drawn.nSplats.toLocaleString('en')} seen of ` +
            drawn.nPrimitives.toLocaleString('en')],
        [drawn.gpu ? 'view, copy' : 'view, draw',
            `${times.view.toFixed(1)}, ${times.draw.toFixed(1)} ms`],
        ...expectedRows(viewer.bounds),
        ['drawn by', drawn.gpu ? 'graphics processor' : 'decoder, exact'],
        ['shown', rateText()],
        ['segment', `${drawn.segment + 1} of ${viewer.segments.length}, ` +
            `decoded in ${times.segment.toFixed(0)} ms` +
            (drawn.ahead ? ', ahead' : '')],
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
    showNumbers();
}

// --- Saving ----------------------------------------------------------------

// Saves a blob under the film's name with another ending.
function save(blob, ending) {
    const link = document.createElement('a');

    link.href = URL.createObjectURL(blob);
    link.download = viewer.name.replace(/\.saga$/, '') + ending;
    link.click();
    URL.revokeObjectURL(link.href);
}

async function savePage() {
    try {
        save(await wholePage(opened, viewer), '.html');
    } catch (error) {
        tellProblem(error.message);
    }
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

    save(new Blob([JSON.stringify(path, null, 1) + '\n'],
        { type: 'application/json' }), '-path.json');
}

// Opens a path. from: a File, or the promise of a Response.
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

const shortcuts = {
    k: () => { $('path').hidden = false; showPressed(); addKey(); },
    n: () => toggle('stats'),
    p: () => toggle('path'),
};

function onKey(event) {
    const call = shortcuts[event.key];

    if (event.key === 'Escape' && root.dataset.state === 'problem')
        dismiss();
    if (!viewer.info || event.ctrlKey || event.metaKey || event.altKey ||
        event.target.matches('input, select'))
        return;
    if (!call) {
        pressKey(player, event);
        return;
    }
    call();
    event.preventDefault();
}

const on = (id, type, call) => $(id).addEventListener(type, call);

on('scale', 'change', () => viewer.setScale(Number($('scale').value)));
on('show-path', 'click', () => toggle('path'));
on('show-stats', 'click', () => toggle('stats'));
on('add-key', 'click', addKey);
on('play-path', 'click', () => viewer.playPath(keys));
on('save-path', 'click', savePath);
on('save-page', 'click', savePage);
on('clear-path', 'click', () => { keys = []; showKeys(); });
on('file', 'change', () => {
    if ($('file').files.length)
        openFile($('file').files[0]);
});
on('dismiss', 'click', dismiss);

addEventListener('keydown', onKey);
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

addEventListener('hashchange', () => {
    if (viewer.setState(location.hash.slice(1)))
        noted = viewer.toState();
});

viewer.addEventListener('opened', showFile);
viewer.addEventListener('change', showState);
viewer.addEventListener('drawn', showDrawn);
viewer.addEventListener('failed', (event) => tellProblem(event.detail));
// The decoder draws if the address asks for it (draw=exact), or for a checksum,
// which needs exact pictures.
if (asked.get('draw') === 'exact' || (asked.has('crc') && !asked.has('draw')))
    viewer.setExact(true);
if (asked.has('background')) {
    player.setAttribute('background', 'transparent');
    document.body.style.background = asked.get('background');
}
if (asked.has('bounds'))
    player.setAttribute('bounds', asked.get('bounds'));
viewer.simd = asked.get('simd') === '0' ? false : undefined;
viewer.seconds = Number(asked.get('seconds')) || carried.seconds;
$('save-page').hidden = Boolean($('film')); // the browser saves such a page
$('stats').hidden = asked.get('stats') !== '1';
$('path').hidden = !asked.has('path');
if (carried.training)
    followTraining();
viewer.wantCrc = true;
showPressed();
showKeys();
openAsked();
