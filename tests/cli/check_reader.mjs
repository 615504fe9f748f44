// SPDX-License-Identifier: MIT
//
// check_reader.mjs: guarantees, for ports/web/saga.js in Node,
//   servers    whatever a server does, the film plays, or there is a SagaError
//              that says what the server did; never is more read than was asked
//              for, and nothing waits for ever
//   addresses  whatever an address is, a film opens or there is a SagaError
//   volumes    a viewing volume is what vectors/VALUES says; places, distances
//              from it and the expected PSNR are the derived ones
//   sources    so with bytes, a Blob, and objects that break their promises
//   refusals   every line of vectors/MANIFEST and vectors/REFUSALS about a
//              damaged file gives its status, read as a whole and by ranges
//   segments   opening 32,000 segments takes less than ten times as long as
//              opening 8,000
//   promises   calls that overlap, wrong times and wrong cameras do not change
//              what another call returns
// WEB=... is the folder that `make web` makes, build/web by default.

import fs from 'node:fs';
import http from 'node:http';
import zlib from 'node:zlib';
import path from 'node:path';
import { pathToFileURL } from 'node:url';

const WEB = path.resolve(process.env.WEB || 'build/web');

if (!fs.existsSync(`${WEB}/saga.wasm`)) {
    console.log('ok   reader skipped: no clang or no wasm-ld, so no decoder');
    process.exit(0);
}
const { BytesSource, HttpSource, SagaFile, loadModule } =
    await import(pathToFileURL(`${WEB}/saga.js`));
const module = await loadModule();
const demo = fs.readFileSync('docs/demo.saga');
let complaints = [], failed = false;

const complain = (...words) => complaints.push(words.join(' '));

function verdict(name) {
    for (const c of complaints)
        console.log(`     ${c}`);
    console.log(`${complaints.length ? 'FAIL' : 'ok  '} reader ${name}`);
    failed ||= complaints.length > 0;
    complaints = [];
}

process.on('unhandledRejection', (e) => complain('unhandled:', e));

const NEVER = 'it never ends';

// Returns what a call comes to, but does not wait for ever.
async function within(ms, call) {
    let timer;
    const late = new Promise((resolve) => {
        timer = setTimeout(() => resolve(NEVER), ms);
    });
    const done = call().catch((e) => `${e.name}: ${e.message}`);
    const told = await Promise.race([done, late]);

    clearTimeout(timer);
    return told;
}

// --- Servers ---------------------------------------------------------------

const MB = Buffer.alloc(1 << 20);
let n = 0;              // requests so far
let sent = 0;           // MiB of a body without end

// Answers with the bytes [a, b) and the range of the bytes [first, end).
function part(s, a, b, { first = a, end = b, total = demo.length } = {}) {
    s.writeHead(206, { 'Content-Range': `bytes ${first}-${end - 1}/${total}` });
    s.end(demo.subarray(a, b));
}

function whole(s, bytes = demo, headers = {}) {
    s.writeHead(200, headers);
    s.end(bytes);
}

const right = (s, [a, b]) => part(s, a, b);

function endless(s, status, headers) {
    s.writeHead(status, headers);
    s.write(demo.subarray(0, 4096));
    const more = () => {
        if (!s.destroyed && ++sent < 400)
            s.write(MB, more);
        else
            s.end();
    };

    more();
}

// name: [what the server does for a range [a, b) or, without one, for null; a
// word of the error, or '' if the film plays].
const SERVERS = {
    right: [right, ''],
    'no ranges': [(s) => whole(s), ''],
    'no ranges, cut': [(s) => whole(s, demo.subarray(0, 20000)), 'cut short'],
    'length too long': [(s) => {
        const { socket } = s;

        whole(s, demo, { 'Content-Length': demo.length + 1000 });
        setTimeout(() => socket.destroy(), 50);
    }, 'interrupted'],
    'length too short': [(s) => {
        s.socket.end('HTTP/1.1 200 OK\r\nContent-Length: 100\r\n\r\n' +
            demo.subarray(0, 30000).toString('latin1'));
    }, 'cut short'],
    'always the first bytes': [(s) => part(s, 0, 100), 'range "bytes 0-99/'],
    'another range': [(s, [a, b]) => part(s, a + 16, b + 16), 'range "bytes'],
    shifted: [(s, r) => r ? part(s, r[0] + 1, r[1] + 1,
        { first: r[0], end: r[1] }) : whole(s), 'sends other bytes where'],
    empty: [(s, [a]) => part(s, a, a, { end: a + 1 }), 'sends 0'],
    'byte by byte': [(s, [a]) => part(s, a, a + 1), '1 bytes at a time'],
    'in small parts': [(s, [a, b]) => part(s, a, Math.min(b, a + 1000)), ''],
    'too much': [(s, [a]) => part(s, a, demo.length), ''],
    'huge size': [(s, [a, b]) => part(s, a, a + 50,
        { end: b, total: 999999999999999 }), 'sends 50'],
    'unknown size': [(s, [a, b]) => part(s, a, b, { total: '*' }), ''],
    'unknown size, small parts': [(s, [a, b]) => part(s, a,
        Math.min(b, a + 1000), { total: '*' }), ''],
    'negative size': [(s, [a, b]) => part(s, a, b, { total: -5 }),
        'range "bytes'],
    'other size': [(s, [a, b]) => part(s, a, b,
        { total: demo.length + ++n }), 'has changed on its server'],
    'no range told': [(s, [a, b]) => {
        s.writeHead(206);
        s.end(demo.subarray(a, b));
    }, ''],
    'gone later': [(s, r) => ++n > 1 ? s.writeHead(404).end() : right(s, r),
        'answers 404'],
    'broken later': [(s, r) => ++n > 2 ? s.writeHead(500).end() : right(s, r),
        'answers 500; try again later'],
    'login later': [(s, r) => ++n > 1 ? whole(s, '<html>login</html>')
        : right(s, r), 'sends 18 bytes instead of the file'],
    'no content': [(s) => s.writeHead(204).end(), 'answers 204'],
    'not modified': [(s) => s.writeHead(304).end(), 'answers 304'],
    'too many': [(s) => s.writeHead(429).end(), '429; try again later'],
    reset: [(s) => {
        s.writeHead(206, { 'Content-Length': 4096,
            'Content-Range': `bytes 0-4095/${demo.length}` });
        s.write(demo.subarray(0, 1000));
        setTimeout(() => s.socket.destroy(), 50);
    }, 'interrupted'],
    'web page': [(s) => whole(s, '<!doctype html><html></html>'),
        'is a page of the web'],
    'gzip that is none': [(s) => whole(s, demo, { 'Content-Encoding': 'gzip' }),
        'not the gzip'],
    'always gzip': [(s) => whole(s, zlib.gzipSync(demo),
        { 'Content-Encoding': 'gzip' }), ''],
    'ranges of gzip': [(s, r) => {
        const bytes = zlib.gzipSync(demo);
        const headers = { 'Content-Encoding': 'gzip' };

        if (!r)
            return whole(s, bytes, headers);
        s.writeHead(206, { ...headers,
            'Content-Range': `bytes ${r[0]}-${r[1] - 1}/${bytes.length}` });
        s.end(bytes.subarray(...r));
    }, ''],
    redirect: [(s) => s.writeHead(302, { Location: '/film.saga' }).end(),
        'redirect'],
    'without end': [(s) => endless(s, 206,
        { 'Content-Range': `bytes 0-4095/${demo.length}` }), 'range "bytes'],
    silent: [() => {}, 'has sent nothing for 0.5 s'],
    'silent in between': [(s) => {
        s.writeHead(200);
        s.write(demo.subarray(0, 1000));
    }, 'has sent nothing for 0.5 s'],
};

let serve = null; // the first element of a row of SERVERS
const server = http.createServer((request, s) => {
    s.setHeader('Connection', 'close'); // so that no row meets another
    const [, a, b] = /bytes=(\d+)-(\d+)/.exec(request.headers.range) ?? [];

    if (Number(a) >= demo.length)
        s.writeHead(416).end(); // after the end
    else
        serve(s, a === undefined ? (serve.length > 1 ? null : [])
            : [Number(a), Math.min(Number(b) + 1, demo.length)]);
});

await new Promise((resolve) => server.listen(0, '127.0.0.1', resolve));
const root = `http://127.0.0.1:${server.address().port}/`;

async function drawn(source) {
    const file = await SagaFile.open(source, { module });

    await file.draw(file.rig[0], 0);
    return file.crc();
}
const wanted = await drawn(demo);

// What is told must be the picture, or a SagaError with the word.
function judge(what, told, word) {
    if (word === '' ? told !== wanted
        : !told.startsWith('SagaError: ') || !told.includes(word))
        complain(`${what}: ${told}`);
}

async function checkServers() {
    for (const [name, [answer, word]] of Object.entries(SERVERS)) {
        const source = new HttpSource(`${root}film.saga`);

        serve = answer;
        n = sent = 0;
        source.waitSeconds = 0.5;
        const told = await within(5000, () => drawn(source));

        judge(name, told, word);
        if (told === NEVER) {
            verdict('servers'); // it may disturb whatever comes after it
            process.exit(1);
        }
        if (sent > 40)
            complain(`${name}: reads on and on, ${sent} MiB`);
    }
    verdict(`servers: ${Object.keys(SERVERS).length} habits`);
}

async function checkAddresses() {
    serve = right;
    for (const [address, word] of [[`${root}100%.saga`, ''],
        [`${root}a%E0%A4%A.saga`, ''], [`${root}x.saga?%`, ''], [root, ''],
        [new URL(`${root}%e2%82%ac.saga`), ''], ['', 'cannot be fetched'],
        ['http://[', 'cannot be fetched'], ['no://x', 'cannot be fetched'],
        ['http://127.0.0.1:1/x.saga', 'x.saga: cannot be fetched']])
        judge(`"${address}"`, await within(5000, () => drawn(address)), word);
    const { name } = new HttpSource(`${root}a%1b%5b2J%e2%80%ae.saga`);
    const told = await within(5000, () => SagaFile.open(
        new BytesSource(new Uint8Array(9), name), { module }));

    judge('a name', told, ' a\\u{1b}[2J\\u{202e}.saga: ');
    verdict('addresses');
}

// The viewing volumes of vectors/VALUES, in the order of the file's fields; -1:
// none. An eye that is put somewhere is found there again.
async function checkVolumes() {
    const { eyeAt, expectedPsnr, inside, outside, placeOf } =
        await import(pathToFileURL(`${WEB}/volume.js`));
    const near = (what, a, b, most = 1e-9) => {
        if (!(Math.abs(a - b) <= most * Math.max(1, Math.abs(b))))
            complain(`${what}: ${a}, not ${b}`);
    };
    let lines = 0;

    for (const line of fs.readFileSync('vectors/VALUES', 'utf8').split('\n')) {
        const [name, what, ...words] = line.split(' ');

        if (what !== 'sector')
            continue;
        lines++;
        const { viewingVolume: v, info } = await SagaFile.open(
            fs.readFileSync(`vectors/${name}`), { module });
        const n = words.map(Number);

        if (n.length === 1) {
            if (v !== null)
                complain(`${name}: has a volume`);
            continue;
        }
        for (const i of [0, 1, 2]) {
            near(`${name}: pivot`, v.pivot[i],
                info.centre[i] + info.unit * n[i]);
            near(`${name}: up`, v.up[i], n[6 + i] / Math.hypot(
                ...n.slice(6, 9)));
        }
        near(`${name}: front`, Math.hypot(...v.front), 1);
        near(`${name}: front`, v.front.reduce((s, x, i) => s + x * v.up[i], 0),
            0);
        [v.distance[0], v.distance[1], v.floor].forEach((x, i) =>
            near(`${name}: lengths`, x ?? info.unit * -(2 ** 31),
                info.unit * n[3 + i]));
        [v.azimuth, ...v.elevation, v.turn].forEach((x, i) =>
            near(`${name}: angles`, x, Math.PI * n[12 + i] / 32768));
        [v.start, ...v.quality.map((x) => 256 * x)].forEach((x, i) =>
            near(`${name}: start, quality`, x, n[16 + i]));
    }
    if (lines !== 4)
        complain(`VALUES has ${lines} volumes`);

    // 50 to 70 degrees of azimuth are outside: 20 degrees at elevation 0.
    const degrees = Math.PI / 180;
    const volume = { pivot: [1, 2, 3], distance: [2, 4], up: [0, 0, 1],
        front: [1, 0, 0], azimuth: 50 * degrees,
        elevation: [-10 * degrees, 30 * degrees], turn: 20 * degrees,
        quality: [36, 30] };
    const at = (azimuth, elevation, distance) => eyeAt(volume,
        { azimuth: azimuth * degrees, elevation: elevation * degrees,
            distance });
    const [x, y, z] = at(90, 0, 2);

    near('side', Math.hypot(x - 1, y - 4, z - 3), 0); // up x front is y
    near('there', placeOf(volume, at(-40, 25, 3)).azimuth, -40 * degrees);
    near('inside', outside(volume, at(-40, 25, 3)), 0);
    near('aside', outside(volume, at(70, 0, 3)), 20 * degrees);
    near('above', outside(volume, at(0, 45, 3)), 15 * degrees);
    near('far', outside(volume, at(0, 0, 8)), Math.log(2));
    near('turned', outside(volume, at(0, 0, 3), [-Math.cos(50 * degrees),
        Math.sin(50 * degrees), 0]), 30 * degrees);
    near('back', outside(volume, eyeAt(volume, inside(volume,
        placeOf(volume, at(170, -80, 1))))), 0);
    const psnr = (azimuth) => expectedPsnr(volume, [at(0, 0, 3), at(40, 0, 3)],
        at(azimuth, 0, 3));

    near('at a camera', psnr(40), 36, 1e-6);
    near('between', psnr(20), 30, 1e-6);
    near('a quarter', psnr(10), 33, 1e-6);  // 2 * 10 / (10 + 30) = 1/2
    near('outside', psnr(60), 33 - 3.4907, 1e-4); // 2 * 20 / 80, 20 dB for each
                                            // of 10 degrees in radians
    near('held out', expectedPsnr(volume, [], at(40, 0, 3)), 30, 1e-6);
    near('unknown', expectedPsnr({ ...volume, quality: [0, 0] }, [],
        at(0, 0, 3)) ?? 0,
        0);
    verdict(`volumes: ${lines} lines of VALUES`);
}

async function checkSources() {
    const read = async (at, k) => demo.subarray(at, at + k);
    const source = (more) => ({ name: 'x', size: demo.length, read, ...more });

    for (const [what, given, word] of [
        ['a Blob', new Blob([demo]), ''], ['a source', source(), ''],
        ['more than asked', source({ read: async (at) => demo.subarray(at) }),
            ''],
        ['nothing', source({ read: async () => demo.subarray(0, 0) }),
            'cut short'],
        ['no bytes', source({ read: async () => [1, 2, 3] }), 'no Uint8Array'],
        ['what throws', source({ read: async () => {
            throw new Error('no');
        } }), 'x: cannot be read (no)'],
        ['a File that is gone', Object.assign(new Blob([demo]), { slice: () =>
            ({ size: 1, arrayBuffer: async () => { throw new Error('gone'); }
            }) }), 'cannot be read (gone)'],
        ['undefined', undefined, 'is opened from'], ['7', 7, 'is opened from'],
        ['an array', [83], 'is opened from']])
        judge(what, await within(5000, () => drawn(given)), word);
    verdict('sources');
}

// --- Verdicts of the lists -------------------------------------------------

// Yields [what, kind, status, bytes] of the damaged files.
function *damaged() {
    for (const [, name, status] of fs.readFileSync('vectors/MANIFEST', 'utf8')
        .matchAll(/^(bad\/\S+) status (-\d+)$/gm))
        yield [name, 'status', Number(status), fs.readFileSync(
            `vectors/${name}`)];
    const refusals = fs.readFileSync('vectors/REFUSALS', 'utf8');

    for (const line of refusals.split('\n')) {
        const [rule, name, kind, status, from, ...edits] = line.split(' ');

        if (!from || rule === '#' || kind === 'exposure')
            continue; // JavaScript does not read exposures
        const old = fs.readFileSync(`vectors/${from}`), parts = [];
        let at = 0;

        for (const [place, k, text] of edits.map((edit) => edit.split(':'))) {
            parts.push(old.subarray(at, Number(place)),
                Buffer.from(text, 'hex'));
            at = Number(place) + Number(k);
        }
        yield [`${rule} ${name}`, kind, Number(status),
            Buffer.concat([...parts, old.subarray(at)])];
    }
}

// The calls whose status the lists have.
const ASK = {
    status: (file) => file.draw(file.rig[0], 0),
    last: (file) => file.find(file.info.nFrames - 1, 1),
    names: (file) => file.check(file.nameStatus, 'names'),
    sound: async (file) => (await file.sound()) ??
        file.check(-1, 'there is no sound'),
    volume: (file) => file.check(file.volumeStatus, 'volume'),
};
// The sound is not fetched for the volume, so that its checksum is not seen.
const UNSEEN = 'volume.2 OPUS.crc';

async function statusOf(source, kind) {
    try {
        await ASK[kind](await SagaFile.open(source, { module }));
        return 0;
    } catch (error) {
        return error.name === 'SagaError' ? error.status : String(error);
    }
}

async function checkRefusals() {
    let count = 0;

    for (const [what, kind, status, bytes] of damaged()) {
        const ranged = { name: what, size: NaN,
            read: async (at, k) => bytes.subarray(at, at + k) };

        for (const source of [bytes, ranged]) {
            const got = await statusOf(source, kind);
            // A file that ends after its head has no optional chunks.
            const isNone = status === -11 && got === -1 &&
                kind !== 'status' && bytes.length < 65536;

            if (what === UNSEEN ? got !== 0 : got !== status && !isNone)
                complain(what, kind, 'gives', got, 'not', status);
        }
        count++;
    }
    if (count < 600)
        complain('the lists have', count, 'lines');
    verdict(`refusals: ${count} files`);
}

// --- Many segments ---------------------------------------------------------

const TABLE = Uint32Array.from({ length: 256 }, (_, i) => {
    for (let k = 0; k < 8; k++)
        i = i & 1 ? i >>> 1 ^ 0x82f63b78 : i >>> 1;
    return i;
});

function crc32c(crc, bytes) {
    crc = ~crc;
    for (const byte of bytes)
        crc = crc >>> 8 ^ TABLE[(crc ^ byte) & 255];
    return ~crc >>> 0;
}

// Returns a film whose index has this many segments of a frame each. They all
// lie where the first one does, since their bytes are not read here.
function manySegments(count) {
    const old = fs.readFileSync('vectors/good/still.saga');
    const n = old.readUInt32LE(8);
    const head = Buffer.from(old.subarray(0, n));
    const index = Buffer.alloc(12 + 16 * count);
    const chunk = (bytes, owner) => bytes.writeUInt32LE(crc32c(crc32c(owner,
        bytes.subarray(0, 8)), bytes.subarray(12)), 8);

    head.writeUInt32LE(count, 16);
    head.writeUInt32LE(count, 20);
    head.writeUInt32LE(25, 24);
    head.writeUInt32LE(1, 28);
    head.writeUInt32LE(crc32c(0, head.subarray(0, n - 4)), n - 4);
    index.write('INDX');
    index.writeUInt32LE(16 * count, 4);
    const nets = Buffer.from(old.subarray(n + 28,
        n + 40 + old.readUInt32LE(n + 32)));
    const offset = n + index.length + nets.length;

    for (let i = 0; i < count; i++) {
        index.writeUInt32LE(offset, 12 + 16 * i);
        index.writeUInt32LE(100, 20 + 16 * i);
        index.writeUInt32LE(1, 24 + 16 * i);
    }
    chunk(index, head.readUInt32LE(n - 4));
    chunk(nets, head.readUInt32LE(n - 4));
    return Buffer.concat([head, index, nets]);
}

async function checkSegments() {
    const times = [];

    for (const count of [8000, 32000]) {
        const bytes = manySegments(count);
        const start = performance.now();
        const file = await SagaFile.open(bytes, { module });

        times.push(performance.now() - start);
        const { segments } = file, last = segments[count - 1];
        const { firstFrame, offset, nbytes } = file.find(count - 1, 1);

        if (segments.length !== count || last.firstFrame !== firstFrame ||
            last.offset !== offset || last.nbytes !== nbytes)
            complain('of', count, 'segments the last is', JSON.stringify(last));
    }
    if (times[1] > 10 * times[0])
        complain('opening takes', times.map(Math.round), 'ms');
    verdict(`segments: 8,000, 32,000 in ${times.map(Math.round)} ms`);
}

// --- Promises of the module ------------------------------------------------

async function checkPromises() {
    const file = await SagaFile.open(
        fs.readFileSync('vectors/good/segments.saga'), { module });
    const places = [[0, 2], [1, 40], [2, 70], [0, 41], [1, 3]];
    const one = async ([camera, frame]) => {
        await file.draw(file.rig[camera], frame);
        return file.crc();
    };
    const apart = [];

    for (const place of places)
        apart.push(await one(place));
    const together = await Promise.all(places.map(
        ([camera, frame]) => file.draw(file.rig[camera], frame)
            .then(() => file.crc())));

    if (together.join() !== apart.join())
        complain('calls at once give', together, 'not', apart);
    const { values } = file.rig[0];
    const wrong = [[{ values }, 0.5], [{ values }, NaN], [{ values }, -1],
        [{ values }, 2 ** 32], [{ values }, 1, 0], [{ values }, 10 ** 6],
        [{ values: values.slice(0, 5) }, 0], [undefined, 0], [{}, 0],
        [{ values: new Int32Array(22) }, 0]];

    for (const [i, args] of wrong.entries())
        for (const call of ['draw', 'splats', 'gaussians']) {
            const told = await within(5000, () => file[call](...args));

            // Gaussians are the same from a camera without a lens.
            if (!String(told).startsWith('SagaError') &&
                !(call === 'gaussians' && i === wrong.length - 1))
                complain(call, JSON.stringify(args), 'gives', told);
        }
    if (await one(places[0]) !== apart[0])
        complain('after wrong calls there is another picture');
    verdict('promises');
}

await checkServers();
await checkAddresses();
await checkSources();
await checkVolumes();
await checkRefusals();
await checkSegments();
await checkPromises();
server.closeAllConnections();
server.close();
process.exit(failed ? 1 : 0);
