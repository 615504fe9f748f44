// SPDX-License-Identifier: MIT
//
// Where the bytes of a file come from. A source has a name; read(offset,
// nbytes), which returns fewer bytes only at the end of the file; size (NaN
// until it is known); and fetched, the number of bytes that have come. saga.js
// exports what users of the module need.

const WAIT_SECONDS = 60;   // without a byte, until a server counts as silent
const FEW_NBYTES = 256;    // only one answer may have fewer, unless the file
                           // ends there
const MOST_NBYTES = 2 ** 30; // of a file that its server sends only as a whole

// Returns text from a file, an address or a server with those characters made
// visible that a reader does not see or that change what stands around them.
export function visible(text) {
    return String(text).replace(/[\p{Cc}\p{Cf}\p{Zl}\p{Zp}\p{Cs}]/gu, (c) =>
        `\\u{${c.codePointAt(0).toString(16)}}`);
}

// An error whose message is a sentence for the user, with a remedy.
export class SagaError extends Error {
    constructor(message, status = 0) {
        super(visible(message));
        this.name = 'SagaError';
        this.status = status;
    }
}

export class BytesSource {
    constructor(bytes, name = 'the file') {
        this.bytes = bytes;
        this.name = name;
        this.size = bytes.length;
        this.fetched = bytes.length;
    }

    async read(offset, nbytes) {
        return this.bytes.subarray(offset, offset + nbytes);
    }
}

// A source that reads a File or Blob.
export class BlobSource {
    constructor(blob) {
        this.blob = blob;
        this.name = blob.name || 'the file';
        this.size = blob.size;
        this.fetched = 0;
    }

    async read(offset, nbytes) {
        const part = this.blob.slice(offset, offset + nbytes);

        this.fetched += part.size;
        return new Uint8Array(await part.arrayBuffer());
    }
}

// Returns the last part of an address, for messages.
function nameOf(url) {
    const last = url.replace(/[?#].*/, '').replace(/.*\//, '');

    try {
        return decodeURIComponent(last) || url || 'the file';
    } catch {
        return last; // a % that no two digits follow
    }
}

// A source that reads a URL. If the server does not support ranges, or the
// browser cannot read its ranges, the whole file is fetched once.
export class HttpSource {
    // credentials: as for `fetch`.
    constructor(url, credentials = 'same-origin') {
        this.url = String(url);
        this.credentials = credentials;
        this.name = nameOf(this.url);
        this.size = NaN;
        this.fetched = 0;
        this.hasRanges = false; // a part of the file has come
        this.whole = null;      // promise of the file's bytes
        this.waitSeconds = WAIT_SECONDS;
        this.onProgress = () => {}; // called with { offset, got, nbytes }
    }

    async read(offset, nbytes) {
        const parts = [];
        let got = 0, few = 0;

        while (!this.whole && got < nbytes && !(offset + got >= this.size)) {
            const part = await this.readPart(offset + got, nbytes - got);

            if (!part || part.length === 0)
                break;
            parts.push(part);
            got += part.length;
            // A server may send less than it is asked for, but the file must
            // not come byte by byte.
            if (got < nbytes && part.length < FEW_NBYTES &&
                !(offset + got >= this.size) && ++few > 1)
                throw this.fault(`sends ${part.length} bytes at a time`);
        }
        return this.whole
            ? (await this.whole).subarray(offset, offset + nbytes)
            : joined(parts, got);
    }

    // Returns bytes of the file from `offset` on, at most nbytes; none if the
    // file ends there; null if `whole` will have them.
    async readPart(offset, nbytes) {
        try {
            return await this.readRange(offset, nbytes);
        } catch (error) {
            // Browsers do not read a range of what a server compresses.
            const answer = error.isTransfer && !this.hasRanges &&
                await this.request({});

            if (answer?.response?.status !== 200)
                throw error;
            this.whole ??= this.readWhole(answer);
            return null;
        }
    }

    async readRange(offset, nbytes) {
        const last = offset + nbytes - 1;
        const answer = await this.request({ Range: `bytes=${offset}-${last}` });
        const { status, headers } = answer.response;

        if (status === 200) {
            this.whole ??= this.readWhole(answer);
            return null;
        }
        if (status !== 206)
            answer.stop.abort();
        if (status === 416)
            return new Uint8Array(0);
        if (status !== 206)
            throw this.refusal(status);
        // A range of compressed bytes is none of the file.
        if (!/^(|identity)$/i.test(headers.get('Content-Encoding') ?? ''))
            throw this.failed('its server compresses the parts of the file; ' +
                'let it send them as they are');
        const least = this.announced(headers.get('Content-Range'), offset,
            last);
        const bytes = await this.bodyOf(answer, offset, nbytes);

        if (bytes.length < least)
            throw this.fault(`announces ${least} bytes and sends ` +
                `${bytes.length}`);
        this.hasRanges = true;
        return bytes;
    }

    // Returns how many of the wanted bytes an answer has. Without an agreement
    // a page cannot see the range of an answer of another server.
    announced(range, offset, last) {
        if (range === null)
            return 1;
        const [, from, to, total] =
            /^bytes (\d+)-(\d+)\/(\d+|\*)$/.exec(range) ?? [];
        const size = Number(total); // NaN if it is *

        if (Number(from) !== offset || !(Number(to) >= offset) ||
            Number(to) >= size)
            throw this.fault(`answers with the range "${range}" where bytes ` +
                `${offset}-${last} were asked for`);
        if (size !== this.size && !Number.isNaN(size) &&
            !Number.isNaN(this.size))
            throw new SagaError(`${this.name}: it has changed on its server ` +
                `from ${this.size} to ${size} bytes; load the page again`);
        this.size = size || this.size;
        return Math.min(Number(to), last) - offset + 1;
    }

    // Reads an answer that has the whole file.
    async readWhole(answer) {
        try {
            const { status } = answer.response;

            if (status !== 200)
                throw this.refusal(status);
            const bytes = await this.bodyOf(answer, 0, MOST_NBYTES + 1);

            if (bytes.length > MOST_NBYTES)
                throw this.fault('sends the file only as a whole, and more ' +
                    'than a GiB');
            if (this.size >= 0 && this.size !== bytes.length)
                throw this.fault(`sends ${bytes.length} bytes instead of the ` +
                    `file, which has ${this.size}`);
            this.size = bytes.length;
            return bytes;
        } catch (error) {
            this.whole = null; // the next read tries again
            throw error;
        }
    }

    // Returns whether the whole file begins otherwise than with these bytes,
    // which have come as a part of it.
    async isOther(bytes) {
        if (!this.hasRanges)
            return false;
        const whole = await this.bodyOf(await this.request({}), 0,
            bytes.length);

        return bytes.some((byte, i) => byte !== whole[i]);
    }

    // --- Requests

    // Returns { response, stop }, where stop ends the request.
    async request(headers) {
        const stop = new AbortController();

        try {
            const response = await this.patiently(stop,
                fetch(this.url, { headers, signal: stop.signal,
                    credentials: this.credentials }));

            return { response, stop };
        } catch (error) {
            throw error instanceof SagaError ? error
                : this.failed(await this.isForbidden()
                    ? 'its server does not allow this page to read it; let ' +
                        'it send Access-Control-Allow-Origin (CORS), or put ' +
                        'the file beside the page'
                    : `cannot be fetched (${whyOf(error)}); check the ` +
                        'address and the network');
        }
    }

    // Returns the first bytes of an answer, at most `most`; what comes after
    // them is not read.
    async bodyOf({ response, stop }, offset, most) {
        const { body, headers } = response;
        const nbytes = Number(headers.get('Content-Length')) || NaN;
        const reader = body?.getReader();
        const parts = [];
        let got = 0;

        try {
            while (reader && got < most) {
                const { done, value } = await this.patiently(stop,
                    reader.read());

                if (done)
                    break;
                parts.push(value.subarray(0, most - got));
                this.fetched += value.length;
                got += parts[parts.length - 1].length;
                this.onProgress({ offset, got, nbytes });
            }
        } catch (error) {
            const coding = headers.get('Content-Encoding');

            throw error instanceof SagaError ? error : this.failed(
                `the transfer was interrupted (${whyOf(error)})` + (coding
                    ? ` or is not the ${coding} that its server says`
                    : '') + '; try again');
        }
        stop.abort();
        return joined(parts, got);
    }

    // Waits for what a server sends next, but not for ever.
    async patiently(stop, promise) {
        const timer = setTimeout(() => stop.abort(), 1000 * this.waitSeconds);

        try {
            return await promise;
        } catch (error) {
            throw stop.signal.aborted
                ? new SagaError(`${this.name}: its server has sent nothing ` +
                    `for ${this.waitSeconds} s; try again later`)
                : error;
        } finally {
            clearTimeout(timer);
        }
    }

    // Returns whether a server answers but does not allow this page to read the
    // answer. A failed fetch has no reason, but a fetch in the mode no-cors
    // succeeds if a server answers.
    async isForbidden() {
        const here = globalThis.location;

        try {
            if (!here || new URL(this.url, here).origin === here.origin)
                return false;
            await fetch(this.url, { method: 'HEAD', mode: 'no-cors' });
            return true;
        } catch {
            return false;
        }
    }

    // --- Errors

    // Of a transfer, which another way of asking may avoid.
    failed(sentence) {
        return Object.assign(new SagaError(`${this.name}: ${sentence}`),
            { isTransfer: true });
    }

    fault(what) {
        return new SagaError(`${this.name}: its server ${what}; put the file ` +
            'on a server that answers ranges right, or not at all');
    }

    refusal(status) {
        const isLater = status === 429 || status >= 500;

        return new SagaError(`${this.name}: the server answers ${status}; ` +
            (isLater ? 'try again later' : 'check the address'), status);
    }
}

// Returns the reason of a failed fetch. Node has it one step deeper.
function whyOf(error) {
    return error.cause?.message || error.message;
}

export function joined(parts, nbytes) {
    const all = new Uint8Array(nbytes);
    let at = 0;

    for (const part of parts) {
        all.set(part, at);
        at += part.length;
    }
    return all;
}
