#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""check_page.py: guarantees that the tables of docs/bitstream.md have no gaps,
and that every good vector is made of the fields that they name, with values in
their ranges, lengths that fit, right checksums, and no byte between chunks."""
import os
import re
import sys

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path.insert(0, os.path.join(HERE, "stream"))
import film  # noqa: E402
import page  # noqa: E402

FOLDER = os.path.join(HERE, "..", "vectors", "good")


def gaps():
    """Yields what is wrong with the tables by themselves."""
    stated = dict(re.findall(r"^\| ([A-Z][A-Za-z ]+?) \| (\d+) \|",
                             "\n".join(page.lines), re.M))
    for name, fields in page.structures.items():
        at = 0
        for f in fields:
            if f.offset != at:
                yield f"{name}: {f.name} is at {f.offset}, not at {at}"
            size = page.TYPES.get(f.type) or page.sizes.get(f.type)
            if f.size != size:
                yield f"{name}: {f.name} has {f.size} bytes, {f.type} {size}"
            bits = 8 * f.size - f.signed
            low = -(1 << bits) if f.signed else 0
            if any(lo < low or hi >= 1 << bits or lo > hi
                   for lo, hi in f.ranges):
                yield f"{name}: the range of {f.name} does not fit {f.type}"
            at += f.size * f.count
        if stated.get(name) != str(at):
            yield f"{name}: has {at} bytes, not {stated.get(name)}"


def outside(f):
    """Yields the fields whose values are not in their ranges."""
    single = f.get("header.more_layers") == 0
    for name, place in f.fields.items():
        # A single layer has no length.
        if single and name.endswith(".layer0.nbytes"):
            continue
        for k in range(place.count if place.ranges else 0):
            at = place.at + k * place.size
            v = int.from_bytes(f.data[at:at + place.size], "little",
                               signed=place.signed)
            if not any(lo <= v <= hi for lo, hi in place.ranges):
                yield f"{name}[{k}] is {v}"


def read_names(f):
    """Adds the fields of the names. Yields what is wrong with them."""
    at, length = f.chunks["NAME"].at + 12 + page.sizes["Names"], 0
    for i in range(f.get("header.n_cameras")):
        at = f.add(f"name{i}", "Name", at)
        if f.get(f"name{i}.shared") > length:
            yield f"name{i} shares more than there is"
        length = f.get(f"name{i}.shared") + f.get(f"name{i}.more")
        if length > 63:
            yield f"name{i} has {length} bytes"
        at += f.get(f"name{i}.more")
    if at != f.chunks["NAME"].end:
        yield f"the names end at {at}, not at {f.chunks['NAME'].end}"


def unequal(f):
    """Yields the lengths, places and checksums that are wrong."""
    def same(what, a, b):
        return [f"{what} is {a}, not {b}"] if a != b else []

    yield from same("header_nbytes", f.get("header.header_nbytes"),
                    f.header_nbytes)
    at = f.header_nbytes
    yield from same("the header's CRC", f.crc("header"),
                    film.crc32c(0, f.data[:at - 4]))
    for label, c in sorted(f.chunks.items(), key=lambda item: item[1].at):
        yield from same(f"the place of {label}", c.at, at)
        kind = label.split(".")[-1]
        yield from same(f"the type of {label}", f.data[c.at:c.at + 4],
                        kind.encode())
        at = c.end
        crc = film.crc32c(f.crc(c.owner), f.data[c.at:c.at + 8])
        yield from same(f"the CRC of {label}", f.crc(label),
                        film.crc32c(crc, f.data[c.at + 12:c.end]))
        if kind in ("COAR", "FINE", "PRIM", "SEGM"):
            yield from same(f"{label} is empty", c.nbytes == 12, False)
    yield from same("the end", at, len(f.data))
    entries = page.sizes["Index entry"] * f.n_segments
    for label, n in (("INDX", entries), ("NETS", f.get("header.nets_nbytes")),
                     ("EXPO", page.sizes["Exposure"] *
                      f.get("header.n_cameras")),
                     ("VOLU", page.sizes["Volume"])):
        if label in f.chunks:
            yield from same(f"the payload of {label}",
                            f.chunks[label].nbytes - 12, n)
    if f.has_base:
        yield from same("base.nbytes", f.get("base.nbytes"), sum(
            f.chunks[f"base.{k}"].nbytes for k in ("COAR", "FINE", "PRIM")))


def wrong_segments(f):
    """Yields what index and segments state otherwise than it is."""
    first = 0
    layers = f.get("header.more_layers") + 1
    for i, (begin, end) in enumerate(f.segments):
        part, n_prim = f"segment{i}", 0
        said = [f.get(f"index{i}.nbytes"), f.get(f"index{i}.n_frames"),
                f.get(f"{part}.number"), f.get(f"{part}.first_frame")]
        found = [end - begin, f.get(f"{part}.n_frames"), i, first]
        for k in range(layers):
            layer = f"{part}.layer{k}"
            n_prim += f.get(f"{layer}.n_prim")
            for kind in ("coarse", "fine"):
                if f.get(f"{layer}.n_{kind}") > f.get(f"header.max_{kind}"):
                    yield f"{layer} has too many of {kind}"
            if layers > 1:
                said.append(f.get(f"{layer}.nbytes"))
                found.append(sum(f.chunks[f"{layer}.{kind}"].nbytes
                                 for kind in ("COAR", "FINE", "PRIM")))
        if said != found:
            yield f"{part} states {said}, it has {found}"
        if n_prim > f.get("header.max_prim"):
            yield f"{part} has {n_prim} primitives"
        first += f.get(f"{part}.n_frames")
    if first != f.get("header.n_frames"):
        yield f"the segments have {first} frames"


def wrong(f):
    if "NAME" in f.chunks:
        yield from read_names(f)
    if "OPUS" in f.chunks:
        at = f.add("sound", "Sound", f.chunks["OPUS"].at + 12)
        if f.data[at:at + 4] != b"OggS":
            yield "the sound is no Ogg"
    yield from outside(f)
    yield from unequal(f)
    yield from wrong_segments(f)


def main():
    found = list(gaps())
    if film.crc32c(0, b"123456789") != 0xe3069283:
        found.append("the CRC-32C of the digits is wrong")
    seen, names = set(), sorted(os.listdir(FOLDER))
    for name in names:
        f = film.Film(FOLDER, name)
        seen.update(f.chunks)
        found += [f"{name}: {text}" for text in wrong(f)]
    for label in ("NAME", "EXPO", "OPUS", "VOLU", "base.PRIM",
                  "segment0.layer1.PRIM"):
        if label not in seen:
            found.append(f"no file has {label}")
    print(*found[:20], sep="\n", end="\n" if found else "")
    print(f"{'FAIL' if found else 'ok  '} page: {len(names)} files")
    return bool(found)


sys.exit(main())
