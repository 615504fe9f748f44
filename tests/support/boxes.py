# SPDX-License-Identifier: MIT
"""Puts a film into an ISO base media file, as docs/isobmff.md drafts it: the
file is fragmented, with a movie fragment for each segment, and an index of
the fragments."""

import struct

IDENTITY = struct.pack(">9I", 1 << 16, 0, 0, 0, 1 << 16, 0, 0, 0, 1 << 30)
TRACK = 1


def box(kind, *parts):
    body = b"".join(parts)
    return struct.pack(">I4s", 8 + len(body), kind) + body


def full(kind, version, flags, *parts):
    return box(kind, struct.pack(">I", version << 24 | flags), *parts)


def parts_of(film):
    """Returns the fields that a container needs, and the film's bytes: those
    before the first segment, and (frames, bytes) for each segment
    (docs/bitstream.md)."""
    header_nbytes, level = struct.unpack_from("<IB", film, 8)
    n_segments, = struct.unpack_from("<I", film, 16)
    rate = struct.unpack_from("<2I", film, 24)
    version, = struct.unpack_from("<H", film, 4)
    entries = [struct.unpack_from("<QII", film, header_nbytes + 12 + 16 * i)
               for i in range(n_segments)]
    return {"version": version, "level": level, "rate": rate,
            "head": film[:entries[0][0]],
            "segments": [(n, film[at:at + nbytes])
                         for at, nbytes, n in entries]}


def codec(parts):
    return "saga.%d.%d" % (parts["version"], parts["level"])


def sample_entry(parts):
    return box(b"saga", bytes(6), struct.pack(">H", 1),
               bytes([4]) + b"saga" + bytes(27),
               full(b"sagC", 0, 0, parts["head"]))


def movie(parts):
    scale = parts["rate"][0]
    empty = struct.pack(">I", 0)
    table = box(b"stbl", full(b"stsd", 0, 0, struct.pack(">I", 1),
                              sample_entry(parts)),
                full(b"stts", 0, 0, empty), full(b"stsc", 0, 0, empty),
                full(b"stsz", 0, 0, empty, empty),
                full(b"stco", 0, 0, empty))
    media = box(b"mdia",
                full(b"mdhd", 0, 0, struct.pack(">4I2H", 0, 0, scale, 0,
                                                0x55c4, 0)),
                full(b"hdlr", 0, 0, empty, b"volv", bytes(12), b"saga\0"),
                box(b"minf", full(b"vvhd", 0, 0),
                    box(b"dinf", full(b"dref", 0, 0, struct.pack(">I", 1),
                                      full(b"url ", 0, 1))), table))
    return box(b"moov",
               full(b"mvhd", 0, 0, struct.pack(">4I", 0, 0, scale, 0),
                    struct.pack(">IH", 1 << 16, 1 << 8), bytes(10), IDENTITY,
                    bytes(24), struct.pack(">I", TRACK + 1)),
               box(b"trak", full(b"tkhd", 0, 3, struct.pack(
                   ">5I", 0, 0, TRACK, 0, 0), bytes(16), IDENTITY, bytes(8)),
                   media),
               box(b"mvex", full(b"trex", 0, 0, struct.pack(
                   ">5I", TRACK, 1, 0, 0, 0))))


def fragment(number, start, duration, data):
    """Returns a movie fragment of one segment. A segment is one sample, which
    needs no other segment and is an access point."""
    def build(offset):
        return box(b"moof", full(b"mfhd", 0, 0, struct.pack(">I", number)),
                   box(b"traf",
                       full(b"tfhd", 0, 0x020000, struct.pack(">I", TRACK)),
                       full(b"tfdt", 1, 0, struct.pack(">Q", start)),
                       full(b"trun", 0, 0x701, struct.pack(
                           ">Ii3I", 1, offset, duration, len(data),
                           0x02000000))))
    return build(len(build(0)) + 8) + box(b"mdat", data)


def mux(film):
    """Returns the file's bytes, and a list of (offset, length) of its
    beginning, of its index and of each fragment."""
    parts = parts_of(film)
    scale, step = parts["rate"]
    start = box(b"ftyp", b"iso6", struct.pack(">I", 0), b"iso6dashsaga")
    start += movie(parts)
    time, fragments, index = 0, [], b""
    for i, (frames, data) in enumerate(parts["segments"]):
        fragments.append(fragment(i + 1, time, frames * step, data))
        index += struct.pack(">3I", len(fragments[-1]), frames * step,
                             0x90000000)
        time += frames * step
    sidx = full(b"sidx", 0, 0, struct.pack(">4I2H", TRACK, scale, 0, 0, 0,
                                           len(fragments)), index)
    places, at = [(0, len(start)), (len(start), len(sidx))], \
        len(start) + len(sidx)
    for f in fragments:
        places.append((at, len(f)))
        at += len(f)
    return start + sidx + b"".join(fragments), places


def playlist(film, name, places):
    """Returns an HLS playlist with byte ranges of one file."""
    parts = parts_of(film)
    seconds = [n * parts["rate"][1] / parts["rate"][0]
               for n, _ in parts["segments"]]
    lines = ["#EXTM3U", "#EXT-X-VERSION:7", "#EXT-X-PLAYLIST-TYPE:VOD",
             "#EXT-X-TARGETDURATION:%d" % (max(seconds) + 0.5),
             '#EXT-X-MAP:URI="%s",BYTERANGE="%d@0"' % (name, places[0][1])]
    for s, (at, n) in zip(seconds, places[2:]):
        lines += ["#EXTINF:%.6f," % s, "#EXT-X-BYTERANGE:%d@%d" % (n, at),
                  name]
    return "\n".join(lines + ["#EXT-X-ENDLIST", ""])


def walk(data, path):
    """Returns the payload of the first box on a path of types."""
    at, first = 0, path[0]
    while at < len(data):
        n, kind = struct.unpack_from(">I4s", data, at)
        assert 8 <= n <= len(data) - at, kind
        if kind == first:
            body = data[at + 8:at + n]
            # stsd and the sample entry have fixed fields before the boxes that
            # they contain.
            skip = {b"stsd": 8, b"saga": 40}.get(kind, 0)
            return walk(body[skip:], path[1:]) if path[1:] else body
        at += n
    raise ValueError(first)
