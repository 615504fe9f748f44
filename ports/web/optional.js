// SPDX-License-Identifier: MIT
//
// What JavaScript reads of a file by itself: the entries of the index, the
// names of the cameras, the viewing volume, and where the chunks after the head
// lie, which are not needed for pictures. The decoder checks what is read here;
// before that, only the number of bytes to fetch depends on it.

const CHUNK_NBYTES = 12;   // bytes of a chunk before its payload
const ENTRY_NBYTES = 16;   // bytes of an entry of the index
const MOST_NBYTES = 2 ** 17; // of names or exposures: more than the largest rig
                             // has
const VOLUME_NBYTES = 64;  // enough to see whether the chunk VOLU has its length
const HALF_TURN = 32768;   // pi in the volume's angles
const NO_FLOOR = -(2 ** 31); // the volume's floor is unknown
const USUAL_NBYTES = 4096; // enough for most names and the next chunk's header

const viewOf = (bytes) => new DataView(bytes.buffer, bytes.byteOffset,
    bytes.length);

// Yields the segments of a file's head: { nFrames, offset, nbytes }.
export function *entriesOf(head, { nSegments }) {
    const view = viewOf(head);
    let at = view.getUint32(8, true) + CHUNK_NBYTES;

    for (let i = 0; i < nSegments && at + ENTRY_NBYTES <= head.length; i++) {
        yield { nFrames: view.getUint32(at + 12, true),
            offset: view.getUint32(at, true) +
                2 ** 32 * view.getUint32(at + 4, true),
            nbytes: view.getUint32(at + 8, true) };
        at += ENTRY_NBYTES;
    }
}

// Sets the file's `head`, which goes on to the end of the cameras' names.
// Returns soundEnd, where its sound ends, in bytes from the start of the file,
// or 0 if it has none; and the chunk that may be its viewing volume, with the
// bytes before it but for the sound, which is long. Both are null if the first
// segment leaves no room for a chunk.
// bytes: the head alone.
export async function readOptional(file, bytes) {
    let start = Infinity, at = file.info.headNbytes;

    // The bytes of segments are left to whoever decodes them.
    for (const { offset } of entriesOf(bytes, file.info))
        start = Math.min(start, offset);
    const readOn = (from, n) => file.readOn(bytes,
        Math.max(from, Math.min(from + n, start)));

    bytes = await readOn(at, USUAL_NBYTES);
    for (const type of ['NAME', 'EXPO']) {
        const end = endOf(bytes, at, type);

        if (end > at + MOST_NBYTES)
            break;
        if (end) {
            bytes = await readOn(end, CHUNK_NBYTES);
            at = end;
        }
        if (type === 'NAME')
            file.head = bytes.subarray(0, end || at + 4);
    }
    const soundEnd = endOf(bytes, at, 'OPUS'), place = soundEnd || at;
    const nbytes = Math.min(VOLUME_NBYTES, start - place);

    if (nbytes < CHUNK_NBYTES)
        return { soundEnd, before: null, chunk: null };
    // A damaged length leads behind the file, which is no reason to refuse it.
    const chunk = soundEnd
        ? await file.read(place, nbytes).catch(() => new Uint8Array())
        : (await readOn(place, nbytes)).subarray(place, place + nbytes);

    return { soundEnd, before: bytes.subarray(0, at), chunk };
}

// Returns where the chunk at byte `at` ends, or 0 if it has another type.
function endOf(bytes, at, type) {
    const begin = at + CHUNK_NBYTES;

    return bytes.length >= begin &&
        String.fromCharCode(...bytes.subarray(at, at + 4)) === type
        ? begin + viewOf(bytes).getUint32(at + 4, true) : 0;
}

// Sets the names of the cameras in the file's rig, after the decoder has found
// them right. A coded name says how many of its first bytes are those of the
// name before it.
export function nameCameras({ head, info, rig }) {
    let at = info.headNbytes + CHUNK_NBYTES + 8;
    let name = new Uint8Array();

    for (const camera of rig) {
        const [shared, more] = head.subarray(at, at + 2);

        name = new Uint8Array([...name.subarray(0, shared),
            ...head.subarray(at + 2, at + 2 + more)]);
        camera.name = new TextDecoder().decode(name);
        at += 2 + more;
    }
}

// Returns the volume of a chunk VOLU, which the decoder has found right, of a
// file with this `info` (volume.js says what it is). Vectors are computed here,
// so that a worker need not fetch volume.js and camera.js.
export function volumeOf(chunk, { centre, unit: size }) {
    const view = viewOf(chunk.subarray(CHUNK_NBYTES));
    const three = (read) => [0, 1, 2].map(read);
    const unit = (v) => v.map((x) => x / Math.hypot(...v));
    const direction = (at) => three((i) => view.getInt16(at + 2 * i, true));
    const angle = (n) => n * Math.PI / HALF_TURN;
    const up = unit(direction(24)), ahead = direction(30);
    const rise = up.reduce((sum, x, i) => sum + x * ahead[i], 0);
    const floor = view.getInt32(20, true);

    return {
        pivot: three((i) => centre[i] + size * view.getInt32(4 * i, true)),
        distance: [12, 16].map((at) => size * view.getUint32(at, true)),
        floor: floor === NO_FLOOR ? null : size * floor,
        up, front: unit(three((i) => ahead[i] - rise * up[i])),
        azimuth: angle(view.getUint16(36, true)),
        elevation: [38, 40].map((at) => angle(view.getInt16(at, true))),
        turn: angle(view.getUint16(42, true)),
        start: view.getUint16(44, true),
        quality: [46, 48].map((at) => view.getUint16(at, true) / 256),
    };
}
