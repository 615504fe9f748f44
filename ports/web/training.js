// SPDX-License-Identifier: MIT
//
// The panel of a film that is still in training, for the page of `saga view` on
// a checkpoint: PSNR and bits against time, and a button that asks the training
// to finish. The server has the course of the training (course.csv) and, until
// the training has answered it, the request (finish).

const EVERY_MS = 3000; // between two looks at the course
const WIDTH = 300, HEIGHT = 96;
const MOST_POINTS = 300;

let isAsked = false; // this page has asked the training to finish
let timer = 0;       // of EVERY_MS

const $ = (id) => document.getElementById(id);

// Returns the rows { iteration, stage, psnr, bits, seconds } of a course. A last
// line without an end is still being written.
export function rowsOf(text) {
    return text.split('\n').slice(1, -1).map((line) => {
        const [iteration, stage, psnr, bits, seconds] = line.split(',');

        return { iteration: Number(iteration), stage, psnr: Number(psnr),
            bits: Number(bits), seconds: Number(seconds) };
    });
}

// Returns the points of a polyline through one number of the rows, from its
// least at the bottom to its greatest at the top. 0 stands for "not known yet".
function lineOf(rows, name) {
    const known = rows.filter((row) => row[name] > 0);
    const step = Math.ceil(known.length / MOST_POINTS);
    // The newest row is always a point.
    const some = known.filter((_, i) => (known.length - 1 - i) % step === 0);
    const values = some.map((row) => row[name]);
    const low = Math.min(...values), range = Math.max(...values) - low || 1;
    const end = rows[rows.length - 1].seconds || 1;

    return some.map((row) => `${(WIDTH * row.seconds / end).toFixed(1)},${
        (HEIGHT - HEIGHT * (row[name] - low) / range).toFixed(1)}`).join(' ');
}

function timeText(seconds) {
    const minutes = Math.floor(seconds / 60);

    return minutes < 1 ? `${seconds.toFixed(0)} s`
        : minutes < 60 ? `${minutes} min`
            : `${Math.floor(minutes / 60)} h ${minutes % 60} min`;
}

function showCourse(rows) {
    const last = rows[rows.length - 1];

    for (const name of ['psnr', 'bits'])
        $(`course-${name}`).setAttribute('points', lineOf(rows, name));
    $('course-now').textContent = [
        `${last.stage}, iteration ${last.iteration.toLocaleString('en')}`,
        timeText(last.seconds)].join(', ');
    $('now-psnr').textContent = last.psnr > 0 ? `${last.psnr.toFixed(2)} dB`
        : '';
    $('now-bits').textContent = last.bits > 0
        ? `${(last.bits / 8000).toFixed(1)} kB and networks` : '';
}

function tell(sentence) {
    $('course-told').textContent = sentence;
}

function tellEnd() {
    clearInterval(timer);
    $('finish').disabled = true;
    tell('The training has ended; its terminal says what it wrote.');
}

// A server that is only busy gives another answer, and is asked again.
const isGone = ({ status }) => status === 404;

async function look() {
    const course = await fetch('course.csv');
    const rows = course.ok ? rowsOf(await course.text()) : [];

    if (rows.length)
        showCourse(rows);
    // The course goes with the checkpoint, and the request with its answer.
    if (isGone(course) || (isAsked && isGone(await fetch('finish'))))
        tellEnd();
}

async function askToFinish() {
    $('finish').disabled = true;
    try {
        const answer = await fetch('finish', { method: 'POST' });

        isAsked = answer.ok;
        tell(isAsked ? 'The training was asked to finish.'
            : await answer.text());
    } catch {
        tell('saga view does not answer; it has ended.');
    }
    $('finish').disabled = isAsked;
}

// Shows the panel, and goes on to look at the course.
export function followTraining() {
    $('training').hidden = false;
    $('finish').onclick = askToFinish;
    // A look fails if `saga view` has ended.
    timer = setInterval(() => look().catch(() => {}), EVERY_MS);
    look().catch(() => {});
}
