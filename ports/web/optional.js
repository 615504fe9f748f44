// SPDX-License-Identifier: MIT
//
// The optional chunks between a file's head and its segments, which are not
// needed for pictures: names and exposures of the cameras, and the sound. The
// exposures are not used.

const CHUNK_NBYTES = 12;   // bytes of a chunk before its payload
const MOST_NAMES = 2 ** 17; // bytes
const USUAL_NBYTES = 4096; // enough for most names and the next chunk's header

// Sets the names of the cameras in the file's rig. Returns where its sound
// ends, in bytes from the start of the file, or 0 if it has none. bytes: the
// file's head.
export async function readOptional(file, bytes) {
    const end = Math.min(...file.segments.map(({ offset }) => offset));
    const readOn = (to) => file.readOn(bytes, Math.min(to, end));
    let at = file.info.headNbytes;

    bytes = await readOn(at + USUAL_NBYTES);
    const names = chunkAt(bytes, at, 'NAME', Math.min(end, at + MOST_NAMES));

    if (names) {
        at = names.end;
        bytes = await readOn(at + CHUNK_NBYTES);
        nameCameras(file.rig, bytes.subarray(names.begin + 8, names.end));
    }
    const exposures = chunkAt(bytes, at, 'EXPO', end);

    if (exposures) {
        at = exposures.end;
        bytes = await readOn(at + CHUNK_NBYTES);
    }
    return chunkAt(bytes, at, 'OPUS', end)?.end ?? 0;
}

// Returns where the payload of the chunk at byte `at` lies, or null if the
// chunk has another type or its payload goes beyond `end`.
function chunkAt(bytes, at, type, end) {
    const begin = at + CHUNK_NBYTES;

    if (bytes.length < begin ||
        String.fromCharCode(...bytes.subarray(at, at + 4)) !== type)
        return null;
    const nbytes = new DataView(bytes.buffer, bytes.byteOffset)
        .getUint32(at + 4, true);

    return begin + nbytes <= end ? { begin, end: begin + nbytes } : null;
}

// Sets the cameras' names. A coded name says how many of its first bytes are
// those of the name before it.
function nameCameras(rig, bytes) {
    let at = 0;
    let name = new Uint8Array();

    for (const camera of rig) {
        const [shared, more] = bytes.subarray(at, at + 2);

        name = new Uint8Array([...name.subarray(0, shared),
            ...bytes.subarray(at + 2, at + 2 + more)]);
        camera.name = new TextDecoder().decode(name);
        at += 2 + more;
    }
}
