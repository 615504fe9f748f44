#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""check_fields.py: guarantees that the decoder reads docs/bitstream.md as
stream/film.py and levels.py do, for every good vector:

  levels    the limits of levels.py and of saga.h are the page's
  info      saga_probe gives the header's fields and section 9's numbers
  rig       saga_rig gives each camera's fields, also where all bytes differ
  segments  saga_find and saga_decode give index and counts; a segment that is
            cut on either side of a layer's end has the whole layers before it
  ranges    a header with a field at a bound of its range is not refused but
            for its level; one of all values of a byte that are outside is
  cameras   saga_view takes the bounds of the fields, not the values outside
  names     saga_name_camera gives the statuses of the page's examples, and of
            names that are no UTF-8

BUILD=... or build has libsaga.so.0, which `make shared` makes.
"""
import ctypes
import os
import re
import subprocess
import sys

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from verdict import BUILD, Verdicts  # noqa: E402
sys.path.insert(0, "ports/python")
import film as films  # noqa: E402
import levels  # noqa: E402
import page  # noqa: E402

if os.path.isdir(BUILD + "/gcc"):
    BUILD += "/gcc"
os.environ["SAGA_LIBRARY"] = BUILD + "/libsaga.so.0"
# With other flags make would build everything again.
subprocess.run([os.environ.get("MAKE", "make"), "-s", "BUILD=" + BUILD,
                "CC=gcc", *(["WERROR=-Werror"] if BUILD.endswith("/gcc")
                            else []), "shared"], check=True)
import saga  # noqa: E402

OK, ARG, DATA, TRUNCATED, VERSION, LEVEL = 0, -1, -10, -11, -12, -13
FOLDER = "vectors/good"
NAMES = sorted(os.listdir(FOLDER))
# Values in the ranges of these may contradict other fields.
COUPLED = ("header_nbytes", "n_cameras", "n_segments", "n_frames")
TIED = ("tools", "sources_coarse", "sources_fine", "sources_prim",
        "bank_slots", "bank_width", "bank_blocks", "hash_levels",
        "hash_log2_entries", "n_classes", "first", "n", "one")

v = Verdicts("fields")
lib = saga._lib()
lib.saga_find_layer.argtypes = [ctypes.c_void_p] * 4 + [ctypes.c_size_t,
                                                        ctypes.c_uint32]


class Layer(ctypes.Structure):
    _fields_ = [(name, ctypes.c_uint32)
                for name in ("n_coarse", "n_fine", "n_primitives", "end")]


class Film(films.Film):
    """A good vector, and the decoder's answers about it."""

    def signed(self, name, k=0):
        place = self.fields[name]
        at = place.at + k * place.size
        return int.from_bytes(self.data[at:at + place.size], "little",
                              signed=place.signed)

    def open(self):
        self.info = saga._Info()
        must(lib.saga_probe(ref(self.info), self.data, len(self.data)))
        n = self.info.work_nbytes
        self.block = ctypes.create_string_buffer(n + 16)
        at = -ctypes.addressof(self.block) % 16 + \
            ctypes.addressof(self.block)
        self.dec = ctypes.c_void_p()
        must(lib.saga_open(ref(self.dec), at, n, self.data, self.head_nbytes,
                           None))
        return self

    def found(self, frame):
        segment = saga._Segment()
        must(lib.saga_find(ref(segment), self.data, len(self.data), frame, 1))
        return segment

    def decode(self, segment, n):
        """Returns the status for the segment's first n bytes, and a report."""
        part = self.data[segment.offset:segment.offset + n]
        report = saga._Report()
        status = lib.saga_decode(self.dec, ref(segment), part, n, None)
        if status == OK:
            must(lib.saga_tell(ref(report), self.dec))
        return status, report


def ref(x):
    return ctypes.byref(x)


def must(status):
    if status:
        raise SystemExit(f"FAIL fields: status {status}")


def same(what, got, wanted):
    if got != wanted:
        v.complain(what, "is", got, "not", wanted)


def base_of(f, name):
    return f.get("base." + name) if f.has_base else 0


def figures(f):
    """Returns the fields by the names that levels.py uses."""
    h = {}
    for name in f.fields:
        room, rest = name.split(".", 1)
        if room in ("header", "base", "bank", "hash", "classes"):
            h[rest] = f.get(name)
    return levels.Figures(h)


def check_info(f):
    i = f.info
    for name in ("version level n_segments n_frames fps_num fps_den n_cameras "
                 "max_coarse max_fine nets_nbytes tools features unit_mantissa "
                 "unit_exponent centre_exponent").split():
        same(f"{f.name}: {name}", getattr(i, name), f.signed("header." + name))
    for k in range(3):
        same(f"{f.name}: centre", i.centre_mantissa[k],
             f.signed("header.centre_mantissa", k))
    same(f"{f.name}: maximum and base",
         [i.max_primitives, i.base_coarse, i.base_fine, i.base_primitives,
          i.base_nbytes, i.motion_order, i.n_layers, i.head_nbytes],
         [f.get("header.max_prim"), *(base_of(f, n) for n in (
             "n_coarse", "n_fine", "n_prim", "nbytes")),
          i.tools >> 3 & 3, f.get("header.more_layers") + 1, f.head_nbytes])
    every = dict(zip(levels.NAMES, figures(f).all()))
    same(f"{f.name}: weights, work, bytes of work",
         [i.n_weights, i.work, i.work_nbytes],
         [every[n] for n in ("weights", "work", "work_bytes")])


def check_levels():
    """Compares the tables of levels with levels.py, by which REFUSALS tries
    each limit."""
    found = [page.cells_of(line) for line in page.lines
             if re.match(r"\| [0-3] \|( [\d^,]+ \|){3}", line)]
    with open("decoder/saga.h", encoding="ascii") as f:
        covers = re.findall(r"(\d+)u", re.search(
            r"SAGA_COVER_MAX\(level\).*\n.*\n", f.read())[0])
    for level, caps in enumerate(levels.CAPS):
        first, second = [
            [2 ** int(c[2:]) if c[:2] == "2^" else 0 if c == "all networks"
             else int(c.replace(",", "") or 99) for c in cells[1:]]
            for cells in (found[level], found[level + 4])]
        same(f"level {level}", tuple(first + second[:2]), caps)
        same(f"cover of level {level}", second[2], int(covers[level]))


def check_rig(f):
    end = f.place("header.crc")[0]
    n = f.get("header.n_cameras")
    begin = f.place("camera0.number")[0] if n else end
    head = f.data[:begin] + bytes((k * 167 >> 3) & 255
                                  for k in range(begin, end))
    head += films.crc32c(0, head).to_bytes(4, "little")
    for data in f.data, head:
        f.data, kept = data, f.data
        for k in range(n):
            camera, number = saga.Camera(), ctypes.c_uint32()
            must(lib.saga_rig(ref(camera), ref(number), data, len(data), k))
            same(f"{f.name}: number", number.value,
                 f.get(f"camera{k}.number"))
            for name, _ in camera._fields_:
                got, place = getattr(camera, name), f"camera{k}.{name}"
                count = f.fields[place].count
                same(f"{f.name}: {place}", list(got) if count > 1 else [got],
                     [f.signed(place, i) for i in range(count)])
        f.data = kept


def check_cuts(f, number, segment):
    part = f"segment{number}"
    end = f.chunk(part + ".SEGM").nbytes
    for k in range(f.info.n_layers):
        layer, begin = Layer(), end
        end += f.get(f"{part}.layer{k}.nbytes")
        must(lib.saga_find_layer(ref(layer), f.dec, ref(segment),
                                 f.data[segment.offset:], begin, k))
        same(f"{f.name}: end of {part}, layer {k}", layer.end, end)
        for n, wanted in ((end - 1, k), ((begin + end) // 2, k), (end, k + 1)):
            status, report = f.decode(segment, n)
            same(f"{f.name}: {n} bytes of {part}", [status, report.n_layers],
                 [OK if wanted else TRUNCATED, wanted])
    same(f"{f.name}: end of {part}", end, segment.nbytes)


def check_segments(f):
    first = 0
    for i in range(f.info.n_segments):
        part, s = f"segment{i}", f.found(first)
        same(f"{f.name}: {part}", [s.offset, s.nbytes, s.number, s.first_frame,
                                   s.n_frames],
             [f.get(f"index{i}.offset"), f.get(f"index{i}.nbytes"), i,
              f.get(part + ".first_frame"), f.get(f"index{i}.n_frames")])
        status, report = f.decode(s, s.nbytes)
        counts = [sum(f.get(f"{part}.layer{k}.{name}")
                      for k in range(f.info.n_layers))
                  for name in ("n_coarse", "n_fine", "n_prim")]
        counts[2] += base_of(f, "n_prim")
        same(f"{f.name}: counts of {part}",
             [status, report.n_layers, report.n_coarse, report.n_fine,
              report.n_primitives], [OK, f.info.n_layers, *counts])
        if f.info.n_layers > 1:
            check_cuts(f, i, s)
        first += s.n_frames


def status_with(f, at, size, value):
    """Returns the status of the header with another value of a field."""
    head = bytearray(f.data[:f.header_nbytes])
    head[at:at + size] = (value % (1 << 8 * size)).to_bytes(size, "little")
    crc = saga.crc32c(head[:-4])
    head[-4:] = crc.to_bytes(4, "little")
    return lib.saga_probe(ref(saga._Info()), bytes(head), len(head))


def tried(place, thorough):
    """Returns values of a field: its bounds, the values outside, those of its
    type, and all of a byte if `thorough`."""
    low = -(1 << 8 * place.size - 1) if place.signed else 0
    if thorough and place.size == 1:
        return range(256)
    high = low + (1 << 8 * place.size) - 1
    values = {x for lo, hi in place.ranges for x in (lo - 1, lo, hi, hi + 1)}
    return sorted(x for x in values | {low, high} if low <= x <= high)


def is_refused(name, value):
    """Returns whether the page refuses a width apart from its range."""
    _, net, field = f"..{name}".rsplit(".", 2)
    return field == "width" and (
        value == 0 and net not in ("net_fuse_c", "net_fuse_f", "net_fine",
                                   "net_geo") or
        net == "net_colour" and value > 32)


def check_ranges(f, thorough):
    # Classes name features.
    tied = TIED + ("features",) * ("classes.n_classes" in f.fields)
    for name, place in f.fields.items():
        last = name.split(".")[-1]
        if name.split(".")[0] not in (
                "header", "bank", "hash", "base", "classes") or \
                not place.ranges or place.count > 1:
            continue
        for value in tried(place, thorough):
            inside = any(lo <= value <= hi for lo, hi in place.ranges) and \
                not is_refused(name, value)
            if inside and (last in COUPLED or last in tied and
                           value != f.signed(name)):
                continue
            status = status_with(f, place.at, place.size, value)
            if inside != (status in (OK, LEVEL)) and (inside or
                                                      status == OK):
                v.complain(f"{f.name}: {name} = {value}: status {status}")


def check_cameras(f):
    segment = f.found(0)
    must(f.decode(segment, segment.nbytes)[0])
    for name, kind in saga.Camera._fields_:
        place = f.fields["camera0." + name]
        for k in range(place.count if place.ranges else 0):
            for value in tried(place, False):
                camera, number = saga.Camera(), ctypes.c_uint32()
                must(lib.saga_rig(ref(camera), ref(number), f.data,
                                  len(f.data), 0))
                camera.rotation_q30 = [0] * 9
                if place.count > 1:
                    getattr(camera, name)[k] = value
                else:
                    setattr(camera, name, value)
                inside = any(lo <= value <= hi for lo, hi in place.ranges)
                same(f"view with {name}[{k}] = {value}",
                     lib.saga_view(f.dec, ref(camera), 0), OK if inside
                     else ARG)


def names():
    """Yields payloads of three names, and their status: the page's examples,
    and all ways in which UTF-8 may be wrong."""
    yield from page.examples()
    for text, status in (
            ("7e", OK), ("dfbf", OK), ("e0a080", OK), ("ed9fbf", OK),
            ("ee8080", OK), ("f0908080", OK), ("61c3a97a", OK), ("bf", DATA),
            ("61e9", DATA), ("e97a", DATA), ("c3", DATA), ("c37a", DATA),
            ("c3c3", DATA), ("e282", DATA), ("e2827a", DATA),
            ("f09f8e", DATA), ("c1bf", DATA), ("edbfbf", DATA),
            ("f5808080", DATA), ("ff", DATA), ("fe", DATA)):
        name = bytes.fromhex(text)
        yield bytes([0, len(name)]) + name + bytes(4), status


def check_names(f):
    chunk, n_ok = f.chunk("NAME"), 0
    for payload, status in names():
        edit = films.Edit(f).payload(
            "NAME", bytes(page.sizes["Names"]) + payload)
        edit.sign_all()
        end = chunk.end
        data = edit.bytes_of(0, end)
        for k in range(f.info.n_cameras):
            same(f"example {payload.hex()}, camera {k}", lib.saga_name_camera(
                ref(saga._Naming()), data, len(data), k), status)
        n_ok += status == OK
    same("some examples are valid", n_ok > 0, True)


def main():
    everything = [Film(FOLDER, name).open() for name in NAMES]
    by_name = {f.name: f for f in everything}
    check_levels()
    v.verdict("levels")
    for name, check in (("info", check_info), ("rig", check_rig),
                        ("segments", check_segments)):
        for f in everything:
            check(f)
        v.verdict(name)
    for f in everything:
        check_ranges(f, f.name in (
            "whole.saga", "base_level3.saga", "classes_whole.saga"))
    v.verdict("ranges")
    check_cameras(everything[0])
    v.verdict("cameras")
    check_names(by_name["names.saga"])
    v.verdict("names")
    return v.failed


sys.exit(main())
