#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""make_refusals.py [FOLDER]: writes FOLDER/REFUSALS (vectors/) again.

Each line is a file that a decoder must refuse, described by edits of a good
vector; vectors/README.md has the format. Fields, their places and their ranges
come from the tables of docs/bitstream.md, so that a range which changes there
changes here. A row breaks one rule and keeps all others where this is possible:
checksums are made anew, and a file with a bad header ends after its header, so
that a decoder without the check would report TRUNCATED.
"""
import os
import sys

import levels
import page
from film import Edit, Film

OK, ARG, DATA, TRUNCATED, VERSION, LEVEL = 0, -1, -10, -11, -12, -13

rows = {}


def row(rule, name, status, edit, kind="status"):
    """Adds a line of REFUSALS. rule: the check of docs/bitstream.md that the
    file fails."""
    assert (rule, name) not in rows, (rule, name)
    rows[rule, name] = f"{rule} {name} {kind} {status} {edit.line()}"


def head_row(film, rule, name, status, **fields):
    """Adds a file that has other values in its header and ends after it."""
    edit = Edit(film)
    for field, value in fields.items():
        edit.set(field.replace("__", "."), value)
    edit.cut(film.header_nbytes)
    row(rule, name, status, edit)


# --- Opening -----------------------------------------------------------------

# Ranges of the tables whose violation is not DATA, by the field's name: the
# rule of section 4 and the status of a value below and above.
OTHERS = {
    "level": ("open.10", LEVEL), "more_layers": ("open.8", VERSION),
    "version": ("open.2", VERSION), "reserved": ("open.2", VERSION),
}
COUNTS = ("max_coarse", "max_fine", "max_prim", "n_coarse", "n_fine", "n_prim")
MAY_BE_0 = ("net_fuse_c", "net_fuse_f", "net_fine", "net_geo")


def outside(field):
    """Returns values just outside a field's ranges: below them, above them, and
    the first of each gap between them."""
    most = (1 << 8 * field.size) - 1
    found = []
    for (_, end), (begin, _) in zip(field.ranges, field.ranges[1:]):
        if end + 1 < begin:
            found.append(end + 1)
    if field.signed:
        most >>= 1
    if field.ranges[0][0] > (-most - 1 if field.signed else 0):
        found.insert(0, field.ranges[0][0] - 1)
    if field.ranges[-1][1] < most:
        found.append(field.ranges[-1][1] + 1)
    return found


def verdict(name, value, field):
    """Returns the rule and the status for a value outside the range of a
    header's field."""
    last = name.split(".")[-1]
    if last == "version" and value == 0:
        return "open.2", DATA
    if last in OTHERS:
        return OTHERS[last]
    if last in COUNTS and value > field.ranges[-1][1]:
        return "open.11", LEVEL
    if last.startswith("sources_") and value >= 16:
        return "open.8", VERSION
    if last == "tools":
        known = 0xf7f
        return ("open.4", VERSION) if value & ~known else ("open.9", DATA)
    if last in ("n_cameras", "header_nbytes"):
        return "open.5", DATA
    return "open.9", DATA


def header_ranges(film, names):
    for name in names:
        field = film.field(name)
        if not field.ranges or field.count > 1:
            continue
        for value in outside(field):
            rule, status = verdict(name, value, field)
            more = {"header.n_frames": value} if value > 1 and \
                name == "header.n_segments" else {}
            head_row(film, rule, f"{name}={value}", status, **{name: value},
                     **more)


def opening(plain, bank, hashed, classed):
    """Adds headers that are refused. plain is a film with a base and two
    segments, bank one with a memory bank, hashed one with a residual hash,
    classed one with two classes."""
    names = [n for n in plain.fields if n.startswith(("header.", "base."))]
    header_ranges(plain, [n for n in names
                          if "bank_" not in n and "hash_" not in n])
    header_ranges(bank, [n for n in bank.fields
                         if n.startswith("bank.") or "bank_" in n])
    header_ranges(hashed, [n for n in hashed.fields
                           if n.startswith("hash.") or "hash_" in n])
    header_ranges(classed, [n for n in classed.fields
                            if n.startswith("classes.")])
    for at in range(4):
        edit = Edit(plain).replace(at, 1, bytes([plain.data[at] ^ 0x20]))
        row("open.1", f"magic[{at}]", DATA, edit.cut(at + 1))
    for n in (0, 3, 7, page.sizes["Header"] - 1):
        row("open.3", f"n={n}", TRUNCATED, Edit(plain, sign=False).cut(n))
    row("open.6", "n=header_nbytes-1", TRUNCATED,
        Edit(plain, sign=False).cut(plain.header_nbytes - 1))
    row("open.7", "crc", DATA, Edit(plain).damage("header.crc"))
    for bit in (7, *range(12, 32)):
        head_row(plain, "open.4", f"tools|2^{bit}", VERSION,
                 header__tools=plain.get("header.tools") | 1 << bit)
    for kind in ("coarse", "fine", "prim"):
        head_row(plain, "open.8", f"sources_{kind}|16", VERSION,
                 **{f"header.sources_{kind}":
                    plain.get(f"header.sources_{kind}") | 16})
    n = plain.header_nbytes
    for by in (-1, 1):
        head_row(plain, "open.5", f"header_nbytes{by:+}", DATA,
                 header__header_nbytes=n + by)
    head_row(plain, "open.9", "n_frames<n_segments", DATA, header__n_frames=1)
    # Check 10 comes after these.
    head_row(plain, "open.8", "more_layers=8-and-level=4", VERSION,
             header__more_layers=8, header__level=4)
    head_row(plain, "open.9", "octaves=9-and-level=4", DATA,
             header__octaves=9, header__level=4)
    networks(plain, [n for n in plain.fields if n.startswith("header.net_")])
    networks(bank, [n for n in bank.fields if n.startswith("bank.net_")])
    networks(hashed, ["hash.net_res.width"])
    tools(plain, bank)
    hash_fields(plain, hashed)
    class_fields(classed)
    ends(plain)


def networks(film, names):
    for name in names:
        if name.endswith(".width") and name.split(".")[1] not in MAY_BE_0:
            head_row(film, "open.9", f"{name}=0", DATA, **{name: 0})
    if "header.net_colour.width" in names:
        head_row(film, "open.9", "net_colour.width=33", DATA,
                 header__net_colour__width=33)


def tools(plain, bank):
    """Adds headers that break the rules of section 3 for BANK, PLAIN_WRITE and
    bank_*."""
    off = bank.get("header.tools")
    slots, width = bank.get("header.bank_slots"), bank.get("header.bank_width")
    head_row(plain, "open.9", "plain_write-without-bank", DATA,
             header__tools=plain.get("header.tools") | 1 << 10)
    for kind in ("coarse", "fine", "prim"):
        name = f"header.sources_{kind}"
        head_row(plain, "open.9", f"{name}-reads-no-bank", DATA,
                 **{name: plain.get(name) | 8})
    head_row(plain, "open.9", "bank_slots-without-bank", DATA,
             header__bank_slots=slots)
    head_row(plain, "open.9", "bank_width-without-bank", DATA,
             header__bank_width=width)
    head_row(plain, "open.9", "bank_blocks-without-bank", DATA,
             header__bank_blocks=1)
    for name in ("bank_slots", "bank_width", "bank_blocks"):
        head_row(bank, "open.9", f"{name}=0-with-bank", DATA,
                 **{f"header.{name}": 0})
    head_row(bank, "open.9", "bank-unread", DATA,
             **{f"header.sources_{kind}": bank.get(f"header.sources_{kind}") & 7
                for kind in ("coarse", "fine", "prim")})
    head_row(bank, "open.9", "512-slots-of-8", DATA, header__bank_slots=512,
             header__bank_width=8)
    assert off & 1 << 9


def hash_fields(plain, hashed):
    """Adds headers that break the rules of section 3 for HASH and hash_*."""
    for name in ("hash_levels", "hash_log2_entries"):
        head_row(plain, "open.8", f"{name}-without-hash", VERSION,
                 **{f"header.{name}": 1})
        head_row(hashed, "open.9", f"{name}=0-with-hash", DATA,
                 **{f"header.{name}": 0})
    # A shift by 33 must not pass as one by 1.
    for count, bits in ((2, 9), (3, 8), (5, 7), (8, 7), (9, 1), (1, 33)):
        head_row(hashed, "open.9", f"{count}-tables-of-2^{bits}", DATA,
                 header__hash_levels=count, header__hash_log2_entries=bits)


def class_fields(film):
    """Adds headers that break the rules of section 3 for classes, and some that
    keep them. film has two classes."""
    features = film.get("header.features")

    def classed(what, keeps=False, **values):
        head_row(film, "open.12" if keeps else "open.9", f"classes-{what}",
                 TRUNCATED if keeps else DATA,
                 **{f"classes.{k}": v for k, v in values.items()})

    for c in (0, 1):
        def one_class(what, first, n, one, keeps=False):
            classed(f"{c}-{what}", keeps, **{f"class_{c}.first": first,
                                             f"class_{c}.n": n,
                                             f"class_{c}.one": one})

        one_class("first+n=F+1", 1, features, 0)
        one_class("first=F+1", features + 1, 0, 0)
        # These sums must not pass as 0 to 4 of 8 bits.
        one_class("first+n=260", 200, 60, 0)
        one_class("one=F+1", 0, features - 1, features + 1)
        one_class("one=first", 1, 3, 1)
        one_class("one=last", 1, 3, 3)
        one_class("one-before-run", 1, 3, 0, keeps=True)
        one_class("one-behind-run", 1, 3, 4, keeps=True)
        one_class("all", 0, features, features, keeps=True)
        one_class("none", features, 0, features, keeps=True)
    for c in (2, 3):
        for name in ("first", "n", "one"):
            classed(f"{c}.{name}-of-two", **{f"class_{c}.{name}": 1})
    classed("3.one-of-three", n_classes=3, **{"class_3.one": 1})
    none = {f"class_1.{name}": 0 for name in ("first", "n", "one")}
    classed("of-1", n_classes=1, **none)
    classed("of-0", n_classes=0, **none,
            **{f"class_0.{name}": 0 for name in ("first", "n", "one")})
    classed("of-3", keeps=True, n_classes=3)
    classed("of-4", keeps=True, n_classes=4)


def ends(plain):
    """Adds files whose head is incomplete."""
    nets = plain.chunk("NETS")
    row("open.12", "n=nets_end-1", TRUNCATED,
        Edit(plain, sign=False).cut(nets.end - 1))
    row("open.12", "n=base_end-1", TRUNCATED,
        Edit(plain, sign=False).cut(plain.head_nbytes - 1))


def level_rows(film, which=""):
    """Adds headers at each limit of each level, for which the status is
    TRUNCATED since nothing follows them, and headers just above each limit.
    which: what tells their names from those of another film."""
    place = {n.split(".", 1)[1]: n for n in film.fields
             if n.startswith(("header.", "base.", "bank.", "hash.",
                              "classes."))
             and film.field(n).count == 1 and n != "header.crc"}
    good = {name: film.get(path) for name, path in place.items()}
    for level in range(len(levels.CAPS)):
        for limit, at, above, grown in levels.pairs(good, level):
            for name, h, status in (("at", at, TRUNCATED),
                                    ("above", above, LEVEL)):
                edit = Edit(film)
                for field, value in h.items():
                    if value != good[field]:
                        edit.set(place[field], value)
                rule = "open.11" if status == LEVEL else "open.12"
                text = f"level{level}.{limit}{which}.{name}-by-" + \
                    "+".join(grown)
                if (rule, text) not in rows:
                    row(rule, text, status, edit.cut(film.header_nbytes))


# --- Chunks ------------------------------------------------------------------

def chunk_rows(film, rule, label, rest):
    """Adds the errors that are checked for every chunk. Its container has
    `rest` bytes from the chunk on."""
    at = film.chunk(label).at
    row(rule, f"{label}.type", DATA,
        Edit(film).set(f"{label}.type", int.from_bytes(b"XXXX", "little")))
    row(rule, f"{label}.crc", DATA, Edit(film).damage(f"{label}.crc"))
    row(rule, f"{label}.owner", DATA, Edit(film).owned(label, 0))
    row(rule, f"{label}.nbytes", TRUNCATED,
        Edit(film).set(f"{label}.nbytes", rest - 12 + 1))
    row(rule, f"{label}.damage", DATA,
        Edit(film, sign=False).replace(
            at + 12, 1, bytes([film.data[at + 12] ^ 1])))


def chunks(plain, layers):
    segment = plain.segment(0)
    for label, rule in (("INDX", "find"), ("NETS", "open.13")):
        chunk_rows(plain, rule, label, plain.chunk(label).nbytes)
    for rule, part in (("base", "base"), ("segment", "segment0")):
        end = plain.head_nbytes if rule == "base" else segment[1]
        for name, number in (("COAR", 6), ("FINE", 7), ("PRIM", 8)):
            label = f"{part}.{name}"
            chunk_rows(plain, f"{rule}.{number}", label,
                       end - plain.chunk(label).at)
    chunk_rows(plain, "segment.2", "segment0.SEGM", segment[1] - segment[0])
    for name in ("COAR", "FINE", "PRIM"):
        label = f"segment0.layer1.{name}"
        chunk_rows(layers, "segment.10", label,
                   segment_end(layers) - layers.chunk(label).at)
    too_few_bytes(plain)
    continued(plain)


def segment_end(film):
    return film.segment(0)[1]


def too_few_bytes(film):
    """Adds files in which a length leaves less than a chunk header for a
    chunk."""
    base = film.chunk("base.COAR").at
    begin, _ = film.segment(0)
    for name, number in (("COAR", 6), ("FINE", 7), ("PRIM", 8)):
        for left in (0, 11):
            n = film.chunk(f"base.{name}").at - base + left
            row(f"base.{number}", f"base.{name}.left={left}", TRUNCATED,
                Edit(film).set("base.nbytes", n))
            n = film.chunk(f"segment0.{name}").at - begin + left
            row(f"segment.{number}", f"{name}.left={left}", TRUNCATED,
                Edit(film).set("index0.nbytes", n))
    for left in (0, 11):
        row("segment.2", f"SEGM.left={left}", TRUNCATED,
            Edit(film).set("index0.nbytes", left))


def continued(film):
    """Adds files with chunks that continue the CRC of a wrong chunk."""
    for label, owner in (("NETS", "INDX"), ("base.COAR", "header"),
                         ("base.FINE", "NETS"), ("base.PRIM", "NETS"),
                         ("segment0.SEGM", "NETS"),
                         ("segment0.COAR", "segment0.SEGM"),
                         ("segment0.FINE", "segment0.COAR"),
                         ("segment0.PRIM", "segment0.FINE")):
        row("section.2", f"{label}-continues-{owner}", DATA,
            Edit(film).owned(label, film.crc(owner)))


# --- Index and segments ------------------------------------------------------

def index(plain, three):
    """Adds errors of the index of a film, and one of a film of three
    segments."""
    n = plain.get("INDX.nbytes")
    frames = plain.get("header.n_frames")
    for by in (-1, -16):
        row("find", f"INDX.nbytes{by:+}", DATA,
            Edit(plain).set("INDX.nbytes", n + by))
    row("find", "index0.n_frames=0", DATA,
        Edit(plain).set("index0.n_frames", 0)
        .set("header.n_frames", frames - plain.get("index0.n_frames")))
    row("find", "index0.n_frames-above-all", DATA,
        Edit(plain).set("index0.n_frames", frames + 1))
    row("find", "index0.n_frames-2^32", DATA,
        Edit(plain).set("index0.n_frames", 2**32 - 1))
    last = plain.n_segments - 1
    row("find", "fewer-frames-than-the-header", DATA,
        Edit(plain).set("header.n_frames", frames + 1), kind="last")
    row("find", "second-entry-above-all", DATA,
        Edit(plain).set(f"index{last}.n_frames",
                        plain.get(f"index{last}.n_frames") + 1), kind="last")
    row("find", "second-entry=0", DATA,
        Edit(plain).set(f"index{last}.n_frames", 0), kind="last")
    # In 32 bits, the sum of the first two is 2 and that of all 30.
    row("find", "sum-of-frames-above-2^32", DATA,
        Edit(three).set("index0.n_frames", 3).set("header.n_frames", 30)
        .set("index1.n_frames", 2**32 - 1).set("index2.n_frames", 28),
        kind="last")
    for name, value in (("offset", len(plain.data)), ("offset", 1 << 63),
                        ("offset", (1 << 64) - 1), ("nbytes", 2**32 - 1)):
        row("segment.1", f"index0.{name}={value}", TRUNCATED,
            Edit(plain).set(f"index0.{name}", value))
    row("segment.1", "n=segment_end-1-and-SEGM.type", TRUNCATED,
        Edit(plain, sign=False).set("segment0.SEGM.type", 0x58585858)
        .cut(segment_end(plain) - 1))
    row("segment.1", "n=segment_end-1", TRUNCATED,
        Edit(plain, sign=False).cut(segment_end(plain) - 1))


def segments(plain, layers):
    names = ("number", "first_frame", "n_frames")
    for name in names:
        path = f"segment0.{name}"
        row("segment.4", f"{path}+1", DATA,
            Edit(plain).set(path, plain.get(path) + 1))
    for name, k in (("coarse", 0), ("fine", 0), ("prim", 0)):
        n = plain.get(f"segment0.layer0.n_{name}")
        row("segment.4", f"n_{name}>max_{name}", DATA,
            Edit(plain).set(f"header.max_{name}", n - 1))
        row("segment.4", f"n_{name}=2^32-1", DATA,
            Edit(plain).set(f"segment0.layer{k}.n_{name}", 2**32 - 1))
    row("segment.4", "n_coarse=0", DATA,
        Edit(plain).set("segment0.layer0.n_coarse", 0))
    for by in (-1, 1):
        name = "segment0.SEGM.nbytes"
        row("segment.3", f"SEGM.nbytes{by:+}", DATA,
            Edit(plain).set(name, plain.get(name) + by))
    row("open.14", "byte-after-NETS", DATA, Edit(plain).surplus("NETS"))
    row("segment.9", "byte-after-PRIM", DATA,
        Edit(plain).surplus("segment0.PRIM"))
    row("open.16", "byte-after-PRIM-of-base", DATA,
        Edit(plain).surplus("base.PRIM"))
    layered(layers)


def layered(film):
    path = "segment0.layer{}.{}"
    for layer in (0, 1):
        for by in (-1, 1):
            name = path.format(layer, "nbytes")
            row("segment.4", f"{name}{by:+}", DATA,
                Edit(film).set(name, film.get(name) + by))
        name = path.format(layer, "n_coarse")
        row("segment.4", f"{name}=0", DATA, Edit(film).set(name, 0))
    for kind in ("coarse", "fine"):
        most = max(film.get(path.format(k, f"n_{kind}")) for k in (0, 1))
        row("segment.4", f"layers.n_{kind}>max", DATA,
            Edit(film).set(f"header.max_{kind}", most - 1))
    prim = sum(film.get(path.format(k, "n_prim")) for k in (0, 1))
    row("segment.4", "layers.n_prim-together", DATA,
        Edit(film).set("header.max_prim", prim - 1))
    row("segment.4", "layers.n_prim-wraps", DATA,
        Edit(film).set(path.format(0, "n_prim"), 2**32 - 1)
        .set(path.format(1, "n_prim"), prim + 1))
    first = film.chunk("segment0.layer0.PRIM").end
    row("segment.5", "first-layer-cut", TRUNCATED,
        Edit(film, sign=False).cut(first - 1))
    row("segment.5", "first-layer-missing", TRUNCATED,
        Edit(film, sign=False).cut(film.chunk("segment0.layer0.COAR").at))


# --- Views, names, exposures, sound, volume ----------------------------------

def views(film):
    for name, field in film.fields.items():
        if not name.startswith("camera0.") or not field.ranges:
            continue
        for k in range(field.count):
            for value in outside(field):
                element = f"{name}[{k}]" if field.count > 1 else name
                row("view", f"{element}={value}", ARG,
                    Edit(film).set(element, value))
    most = film.field("camera0.rotation_q30").ranges[0][1]
    for k in range(3):
        edit = Edit(film)
        for axis, value in enumerate((most // 2, -(most // 2), most % 2 + 1)):
            edit.set(f"camera0.rotation_q30[{3 * k + axis}]", value)
        row("view", f"rotation-row-{k}-of-sum-{most + 1}", ARG, edit)
    row("view", "no-camera", ARG, Edit(film).without_cameras())


def names(film):
    chunk = film.chunk("NAME")
    examples = list(page.examples())
    for number, (payload, status) in enumerate(examples):
        # The last example has too many names.
        rule = "names" if not status else \
            f"names.{6 + (number + 1 == len(examples))}"
        edit = Edit(film).replace(chunk.at + 20, chunk.nbytes - 20, payload)
        edit.set("NAME.nbytes", 8 + len(payload)).cut(chunk.end)
        row(rule, f"example-{number + 1}", status, edit, kind="names")
    long, c1 = b"a" * 62, "".join(map(chr, range(0x80, 0xa0))).encode()
    odd = "\ufeff\ufffe\U0001ffff\u2028\u202e".encode()
    for status, name, new in (
            (DATA, "64-bytes", b"\0\x40" + long + b"aa\0\0\0\0"),
            (DATA, "63-shared-and-1", b"\0\x3f" + long + b"a\x3f\1b\0\0"),
            (OK, "63-bytes", b"\0\x3f" + long + b"a\0\0\0\0"),
            (OK, "62-shared-and-1", b"\0\x3e" + long + b"\x3e\1b\x3f\0"),
            (OK, "controls-of-C1", b"\0\x3e" + c1[:62] + b"\0\2" + c1[62:] +
             b"\0\0"),
            (OK, "marks", bytes([0, len(odd)]) + odd + b"\0\0\0\0")):
        edit = Edit(film).replace(chunk.at + 20, chunk.nbytes - 20, new)
        edit.set("NAME.nbytes", 8 + len(new)).cut(chunk.end)
        row("names.6" if status else "names", f"name-of-{name}", status, edit,
            kind="names")
    row("names.1", "no-camera", ARG, Edit(film).without_cameras(), kind="names")
    for n in (0, 7):
        edit = Edit(film).replace(chunk.at + 12 + n, chunk.nbytes - 12 - n, b"")
        row("names.5", f"NAME.nbytes={n}", DATA,
            edit.set("NAME.nbytes", n).cut(chunk.end), kind="names")
    for label, edit, status in (
            ("type", Edit(film).set("NAME.type", 0x58585858), ARG),
            ("crc", Edit(film).damage("NAME.crc"), DATA),
            ("owner", Edit(film).owned("NAME", 0), DATA),
            ("nbytes", Edit(film).set("NAME.nbytes", len(film.data)),
             TRUNCATED)):
        row("names.4" if status != ARG else "names.3", f"NAME.{label}", status,
            edit, kind="names")
    for n in (-chunk.at + film.header_nbytes, -1, 0, 3, 11, chunk.nbytes - 1):
        row("names.2" if n < 4 else "names.4", f"NAME.cut={n}", TRUNCATED,
            Edit(film, sign=False).cut(chunk.at + n), kind="names")


def sound(film):
    """Adds files with errors of the sound. film has names and sound."""
    names, chunk = film.chunk("NAME"), film.chunk("OPUS")

    def cut(rule, n):
        row(rule, f"n={n}", TRUNCATED, Edit(film, sign=False).cut(n),
            kind="sound")

    cut("sound.1", names.at + 3)
    cut("sound.2", names.at + 11)
    cut("sound.2", names.end + 3)
    cut("sound.4", chunk.at + 11)
    cut("sound.4", chunk.end - 1)
    cut("sound.6", chunk.end + 3)
    for rule, label, edit, status in (
            ("sound.2", "NAME.crc", Edit(film).damage("NAME.crc"), DATA),
            ("sound.3", "OPUS.type",
             Edit(film).set("OPUS.type", 0x58585858), ARG),
            ("sound.4", "OPUS.crc", Edit(film).damage("OPUS.crc"), DATA),
            ("sound.4", "OPUS.owner", Edit(film).owned("OPUS", 0), DATA),
            ("sound.4", "OPUS.nbytes",
             Edit(film).set("OPUS.nbytes", len(film.data)), TRUNCATED),
            ("sound.7", "OPUS.twice",
             Edit(film, sign=False).replace(
                 chunk.end, 0, film.data[chunk.at:chunk.end]), DATA)):
        row(rule, label, status, edit, kind="sound")
    # A length that leaves out the OggS that follows.
    for n in (4, 7):
        row("sound.5", f"OPUS.nbytes={n}", DATA,
            Edit(film).set("OPUS.nbytes", n), kind="sound")


def exposures(film, without, with_base):
    """Asks for the exposure of camera 0: in `film` with names and sound, in
    `without`, which has no exposures, and in `with_base`, which has a base
    and no names."""
    def ask(rule, name, status, edit):
        row(f"exposures.{rule}" if status else "exposures", name, status, edit,
            kind="exposure")

    chunk, names = film.chunk("EXPO"), film.chunk("NAME")
    n = chunk.nbytes - 12
    ask(1, "no-camera", ARG, Edit(film).without_cameras())
    for at, what in ((film.header_nbytes, "header"), (names.at + 3, "head+3")):
        ask(2, f"cut={what}", TRUNCATED, Edit(film, sign=False).cut(at))
    ask(3, "NAME.crc", DATA, Edit(film).damage("NAME.crc"))
    ask(3, "NAME.nbytes", TRUNCATED,
        Edit(film).set("NAME.nbytes", len(film.data)))
    for by in (-1, 0, 3):
        ask(3, f"NAME.cut={by}", TRUNCATED,
            Edit(film, sign=False).cut(names.end + by))
    ask(4, "none", ARG, Edit(without))
    ask(4, "EXPO.type", ARG, Edit(film).set("EXPO.type", 0x58585858))
    ask(5, "EXPO.crc", DATA, Edit(film).damage("EXPO.crc"))
    ask(5, "EXPO.owner", DATA, Edit(film).owned("EXPO", 0))
    ask(5, "EXPO.nbytes", TRUNCATED,
        Edit(film).set("EXPO.nbytes", len(film.data)))
    for by in (4, 11, chunk.nbytes - 1):
        ask(5, f"EXPO.cut={by}", TRUNCATED,
            Edit(film, sign=False).cut(chunk.at + by))
    ask(5, "EXPO.cut=end", 0, Edit(film, sign=False).cut(chunk.end))
    for by in (-1, 1):
        ask(6, f"EXPO.nbytes{by:+}", DATA, Edit(film).resize("EXPO", by))
    ask(6, "EXPO.nbytes=0", DATA, Edit(film).resize("EXPO", -n))
    for camera in range(film.get("header.n_cameras")):
        for k in range(3):
            name = f"exposure{camera}.gain_q12[{k}]"
            ask(7, f"{name}=255", DATA, Edit(film).set(name, 255))
    ask(7, "exposure0.gain_q12[0]=256", 0,
        Edit(film).set("exposure0.gain_q12[0]", 256))
    base = with_base.chunk("base.PRIM")
    ask(5, "damaged-base", 0, Edit(with_base).damage("base.PRIM.crc"))
    ask(2, "cut-in-base", TRUNCATED,
        Edit(with_base, sign=False).cut(base.end - 1))
    # In the file, the sound comes after the exposures.
    row("sound.2", "EXPO.crc", DATA, Edit(film).damage("EXPO.crc"),
        kind="sound")
    row("sound", "EXPO.gain", 0,
        Edit(film).set("exposure0.gain_q12[0]", 255), kind="sound")
    row("sound.2", "EXPO.cut=3", TRUNCATED,
        Edit(film, sign=False).cut(chunk.end + 3), kind="sound")


def volume(film, without, bare):
    """Asks for the volume: in `film` with names, exposures and sound, in
    `without`, which has no volume, and in `bare`, where the volume follows the
    head."""
    def ask(rule, name, status, edit):
        row(f"volume.{rule}" if status else "volume", name, status, edit,
            kind="volume")

    chunk, n = film.chunk("VOLU"), page.sizes["Volume"]
    names, exposures, sound = map(film.chunk, ("NAME", "EXPO", "OPUS"))
    ask(1, "head+3", TRUNCATED, Edit(film, sign=False).cut(names.at + 3))
    for label in ("NAME", "EXPO", "OPUS"):
        ask(2, f"{label}.crc", DATA, Edit(film).damage(f"{label}.crc"))
        ask(2, f"{label}.nbytes", TRUNCATED,
            Edit(film).set(f"{label}.nbytes", len(film.data)))
    for at in (names.end + 3, exposures.end + 3, sound.end - 1, sound.end + 3):
        ask(2, f"cut={at}", TRUNCATED, Edit(film, sign=False).cut(at))
    # What is left out or put in another order hides what follows.
    ask(2, "without-OPUS", 0,
        Edit(film, sign=False).replace(sound.at, sound.nbytes, b""))
    ask(3, "none", ARG, Edit(without))
    ask(3, "VOLU.type", ARG, Edit(film).set("VOLU.type", 0x58585858))
    ask(3, "OPUS.type", ARG, Edit(film).set("OPUS.type", 0x58585858))
    ask(3, "VOLU-before-OPUS", 0, Edit(film, sign=False).replace(
        sound.at, sound.nbytes + chunk.nbytes, film.data[chunk.at:chunk.end] +
        film.data[sound.at:sound.end]))
    ask(4, "VOLU.crc", DATA, Edit(film).damage("VOLU.crc"))
    ask(4, "VOLU.owner", DATA, Edit(film).owned("VOLU", 0))
    ask(4, "VOLU.nbytes", TRUNCATED,
        Edit(film).set("VOLU.nbytes", len(film.data)))
    for by in (4, 11, chunk.nbytes - 1):
        ask(4, f"VOLU.cut={by}", TRUNCATED,
            Edit(film, sign=False).cut(chunk.at + by))
    ask(4, "VOLU.cut=end", 0, Edit(film, sign=False).cut(chunk.end))
    ask(4, "bare", 0, Edit(bare))
    for by in (-n, -1, 1):
        ask(5, f"VOLU.nbytes{by:+}", DATA, Edit(film).resize("VOLU", by))
    # Each field beyond its range, and at its ends.
    for name, field in film.fields.items():
        for value in outside(field) if name.startswith("volume.") and \
                field.ranges else ():
            for k in range(field.count):
                at = f"{name}[{k}]" if field.count > 1 else name
                ask(6, f"{at}={value}", DATA, Edit(film).set(at, value))
    ask(6, "distance_min>distance_max", DATA, Edit(film).set(
        "volume.distance_min", film.get("volume.distance_max") + 1))
    ask(6, "distance_min=distance_max", 0, Edit(film).set(
        "volume.distance_min", film.get("volume.distance_max")))
    ask(6, "elevation_min>elevation_max", DATA, Edit(film).set(
        "volume.elevation_min", film.get("volume.elevation_max") + 1))
    ask(6, "elevation_min=elevation_max", 0, Edit(film).set(
        "volume.elevation_min", film.get("volume.elevation_max")))
    ask(6, "start=n_cameras", DATA,
        Edit(film).set("volume.start", film.get("header.n_cameras")))
    ask(6, "start=0", 0, Edit(film).set("volume.start", 0))
    # 2^27 = 8192^2 + 8192^2, 2^29 = 16384^2 + 16384^2, 2^24 = 1024 * 16384.
    for status, name, up, front in (
            (0, "shortest-up", (8192, 8192, 0), (0, 0, 16384)),
            (DATA, "short-up", (8192, 8191, 0), (0, 0, 16384)),
            (0, "longest-up", (16384, 16384, 0), (0, 0, 16384)),
            (DATA, "long-up", (16384, 16384, 1), (0, 0, 16384)),
            (0, "shortest-front", (0, 16384, 0), (8192, 0, -8192)),
            (DATA, "short-front", (0, 16384, 0), (-8191, 0, 8192)),
            (0, "longest-front", (0, 16384, 0), (-16384, 0, 16384)),
            (DATA, "long-front", (0, 16384, 0), (16384, 1, 16384)),
            (0, "up-front=2^24", (0, 16384, 0), (0, 1024, 16384)),
            (DATA, "up-front=2^24+16384", (0, 16384, 0), (0, 1025, 16384)),
            (0, "up-front=-2^24", (0, 16384, 0), (0, -1024, 16384)),
            (DATA, "up-front=-2^24-16384", (0, 16384, 0), (0, -1025, 16384)),
            (DATA, "up-front-wraps", (-23170, 0, 0), (-23170, 0, 0)),
            (DATA, "square-wraps", (-32768, -32768, -32768), (0, 0, 16384))):
        edit = Edit(film)
        for k in range(3):
            edit.set(f"volume.up[{k}]", up[k])
            edit.set(f"volume.front[{k}]", front[k])
        ask(6, name, status, edit)


# --- Contents ----------------------------------------------------------------

def contents(folder):
    """Keeps files with a symbol replaced in a payload of corner.saga. Such
    payloads came from a program that decodes and encodes again, of which only
    the history has the text (tests/stream/transcode.c, up to 71c8d842): both
    the file and the symbols' rules are frozen."""
    with open(os.path.join(folder, "REFUSALS")) as f:
        for line in f.read().splitlines():
            rule, name, _, _, path, *_ = [*line.split(), *[""] * 5]
            if path == "good/corner.saga":
                rows[rule, name] = line


def counts(film):
    """Adds files whose counts in SEGM or the base disagree with the symbols,
    and payloads that are too long or too short (sections 6 and 10)."""
    for kind in ("coarse", "fine", "prim"):
        for by in (-1, 1):
            for path, most in ((f"segment0.layer0.n_{kind}",
                                f"header.max_{kind}"), (f"base.n_{kind}", "")):
                edit = Edit(film).set(path, film.get(path) + by)
                if most:
                    edit.set(most, film.get(most) + 1)
                row("section.10", f"{path}{by:+}", DATA, edit)
    for label in ("NETS", "base.COAR", "base.FINE", "base.PRIM",
                  "segment0.COAR", "segment0.FINE", "segment0.PRIM"):
        chunk = film.chunk(label)
        row("section.6", f"{label}+1", DATA, Edit(film).resize(label, 1))
        row("section.6", f"{label}-1", DATA, Edit(film).resize(label, -1))
        row("section.6", f"{label}-empty", DATA,
            Edit(film).resize(label, 12 - chunk.nbytes))
        row("section.6", f"{label}-code=2^32-1", DATA,
            Edit(film).replace(chunk.at + 12, 4, b"\xff" * 4))


HEAD = """\
# Files that a decoder must refuse, a line each: the check of
# docs/bitstream.md that the file fails, a name, what is asked of the file, the
# status, a good vector, and edits of it, AT:N:HEX, in order: N bytes at AT of
# the good file are replaced. README.md says more. Made by `make vectors`.
"""


def depths(space, time):
    """Adds files whose trees are too deep by one level with suffixes of 8 bits.
    Both have no fine anchors, so that nothing else depends on these bits."""
    for film, what in ((space, "space"), (time, "time")):
        row("section.10", f"one-too-deep-in-{what}", DATA,
            Edit(film).set("header.tier_coarse.suffix_bits", 8))


def main():
    folder = sys.argv[1] if len(sys.argv) > 1 else "vectors"

    def film(name):
        return Film(folder, f"good/{name}.saga")

    plain, layers = film("base_level3"), film("layers")
    hashed, classed = film("hash_level3"), film("classes_level0")
    opening(plain, film("memory_level3"), hashed, classed)
    level_rows(plain)
    level_rows(hashed)
    level_rows(classed, "-of-classes")
    level_rows(film("memory_level3"))
    chunks(plain, layers)
    index(plain, film("segments"))
    segments(plain, layers)
    views(plain)
    names(film("names"))
    sound(film("sound"))
    exposures(film("exposures"), film("sound"), film("exposures_base"))
    volume(film("volume"), film("sound"), film("volume_least"))
    counts(plain)
    depths(film("deepest_in_space"), film("deepest_in_time"))
    contents(folder)
    with open(os.path.join(folder, "REFUSALS"), "w") as f:
        f.write(HEAD + "\n".join(rows.values()) + "\n")
    print(f"{len(rows)} refusals")


main()
