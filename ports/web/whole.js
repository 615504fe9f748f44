// SPDX-License-Identifier: MIT
//
// A page in one file, with its film, its modules and the decoder. It needs no
// server and no network; tools/whole.sh makes it without a film, as whole.html.

import { SagaError, joined } from './source.js';
import { places } from './places.js';

const GROUP = 4 * 2 ** 18; // digits of base64 that are converted at a time
const MOST_NBYTES = 2 ** 28; // of a film in a page; browsers have strings of
                             // less than 2^29 characters. As export_page.c
const POSTER_WIDTH = 640;

const $ = (id) => document.getElementById(id);

function bytesOf(base64) {
    const text = atob(base64);
    const bytes = new Uint8Array(text.length);

    // A loop, since Uint8Array.from takes far longer.
    for (let i = 0; i < text.length; i++)
        bytes[i] = text.charCodeAt(i);
    return bytes;
}

// Returns parts of the bytes that an element has in base64.
function partsOf(id) {
    const text = $(id).textContent;
    const parts = [];

    for (let at = 0; at < text.length; at += GROUP)
        parts.push(bytesOf(text.slice(at, at + GROUP)));
    return parts;
}

// Returns a blob as a data URL.
const addressOf = (blob) => new Promise((resolve, reject) => {
    const reader = new FileReader();

    reader.onload = () => resolve(reader.result);
    reader.onerror = () => reject(reader.error);
    reader.readAsDataURL(blob);
});

// Returns the film that this page has in it, or null if it is no such page.
// Workers of a page without a server come from data URLs.
export async function carriedFilm(name) {
    if (!$('film'))
        return null;
    const packed = new Blob(partsOf('decoder')).stream();
    const decoder = await addressOf(await new Response(packed.pipeThrough(
        new DecompressionStream('gzip')), { headers: {
        'Content-Type': 'application/wasm' } }).blob());
    const film = new File(partsOf('film'), name);

    $('film').remove(); // frees the text
    Object.assign(places, { wasm: decoder, simd: decoder,
        worker: 'data:text/javascript,' +
            encodeURIComponent($('code').textContent) });
    return film;
}

// Returns a picture of the viewer as a data URL, as large as a poster is.
function posterOf(viewer) {
    const image = viewer.read();
    const [from, to] = [0, 1].map(() => document.createElement('canvas'));

    Object.assign(from, { width: image.width, height: image.height });
    from.getContext('2d').putImageData(image, 0, 0);
    to.width = Math.min(POSTER_WIDTH, image.width);
    to.height = Math.max(1, Math.round(image.height * to.width / image.width));
    to.getContext('2d').drawImage(from, 0, 0, to.width, to.height);
    return to.toDataURL('image/jpeg', 0.8);
}

// Returns the film of a viewer as such a page. film: a File, or an address.
export async function wholePage(film, viewer) {
    const fetched = async (address) => {
        const response = await fetch(address);

        if (!response.ok)
            throw new SagaError(`${address}: the server answers ` +
                `${response.status}; check the address`, response.status);
        return response;
    };
    const parser = new DOMParser();
    const page = parser.parseFromString(await (await fetched(
        new URL('./whole.html', import.meta.url))).text(), 'text/html');
    const blob = typeof film === 'string' ? await (await fetched(film)).blob()
        : film;

    if (blob.size > MOST_NBYTES)
        throw new SagaError(`${viewer.name}: is too large for a page; put it ` +
            'on a server (docs/embed.md)');
    page.title = viewer.name;
    page.getElementById('carried').textContent = JSON.stringify(
        { src: null, pictures: [], name: viewer.name })
        .replaceAll('<', '\\u003c');
    page.getElementById('poster').src = posterOf(viewer);
    page.getElementById('film').textContent =
        (await addressOf(blob)).replace(/^[^,]*,/, '');
    return new Blob([`<!doctype html>\n${page.documentElement.outerHTML}\n`],
        { type: 'text/html' });
}
