#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""check_exchange.py: guarantees, for files that are cut and joined,
  cut         frames of a file draw the same pixels, from the same bytes
  join        the parts of a file, joined, are the file; in another order they
              draw what they drew
  refused     ranges inside a segment or beyond the file, and files of other
              networks, cameras, rates or cubes, in one line that says why"""

import os
import struct
import subprocess
import sys
import tempfile

from verdict import Verdicts, read

os.chdir(os.path.join(os.path.dirname(__file__), "..", ".."))
BUILD = os.environ.get("BUILD", "build")
SAGA = os.environ.get("SAGA", BUILD + "/saga")
SAGA_DEC = os.environ.get("SAGA_DEC", BUILD + "/saga-dec")
SCENE = "vectors/good/segments.saga"
# The vector's segments begin at these frames, as tests/support/gen_stream.c
# writes it; the last one ends where the file does.
STARTS = [0, 16, 65, 89]

checks = Verdicts("exchange")
complain, verdict = checks.complain, checks.verdict


def saga(*arguments, status=0, says="", program=SAGA):
    """Runs the program; returns what it printed."""
    done = subprocess.run([program, *map(str, arguments)],
                          stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    text = done.stderr.decode()
    if done.returncode != status:
        complain(arguments, "ends with", done.returncode, "not", status, text)
    elif status and (says not in text or text.count("\n") != 1):
        complain(arguments, "says", repr(text), "not", repr(says))
    return done.stdout.decode()


def write(path, data):
    with open(path, "wb") as f:
        f.write(data)
    return path


# --- A file's chunks, read and signed here ---------------------------------

def crc32c(crc, data):
    crc ^= 0xffffffff
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = crc >> 1 ^ (0x82f63b78 if crc & 1 else 0)
    return crc ^ 0xffffffff


def signed(data):
    """The bytes of a file with the CRCs of docs/bitstream.md, section 2."""
    data = bytearray(data)
    at = struct.unpack_from("<I", data, 8)[0]
    owner = crc32c(0, data[:at - 4])
    struct.pack_into("<I", data, at - 4, owner)
    while at < len(data):
        n = struct.unpack_from("<I", data, at + 4)[0]
        crc = crc32c(crc32c(owner, data[at:at + 8]),
                     data[at + 12:at + 12 + n])
        struct.pack_into("<I", data, at + 8, crc)
        if data[at:at + 4] == b"NETS":
            owner = crc
        at += 12 + n
    return bytes(data)


def changed(data, at, value):
    """The file with another byte, signed anew."""
    data = bytearray(data)
    data[at] ^= value
    return signed(data)


# --- Cutting and joining ---------------------------------------------------

def picture(path, frame):
    return saga(path, "--camera", "rig:1", "--time", "%d/2" % frame, "--crc",
                program=SAGA_DEC)


def same_pictures(path, first, other, start, n):
    """Do n frames of path from `first` on look like other's from `start`?"""
    for i in range(0, 2 * n, 7):
        if picture(path, 2 * first + i) != picture(other, 2 * start + i):
            complain(path, "differs from", other, "at half-frame", i)


def check_cut(tmp):
    parts = []
    for i in range(3):
        parts.append(tmp + "/part%d.saga" % i)
        saga("cut", SCENE, "%d:%d" % (STARTS[i], STARTS[i + 1]), "-o",
             parts[i])
        same_pictures(parts[i], 0, SCENE, STARTS[i],
                      STARTS[i + 1] - STARTS[i])
    saga("cut", SCENE, "16:", "-o", tmp + "/end.saga")
    same_pictures(tmp + "/end.saga", 49, SCENE, 65, 24)
    saga("cut", SCENE, ":", "-o", tmp + "/all.saga")
    if read(tmp + "/all.saga") != read(SCENE):
        complain("all frames of a file are not the file")
    if read(parts[0]) != signed(read(parts[0])):
        complain("a part's checksums are not those of the documents")
    verdict("cut")
    return parts


def check_join(tmp, parts):
    two, three = tmp + "/two.saga", tmp + "/three.saga"
    saga("join", parts[0], parts[1], "-o", two)
    saga("join", two, parts[2], "-o", three)
    if read(three) != read(SCENE):
        complain("the parts of a file are not the file")
    saga("join", parts[2], three, "-o", two)
    same_pictures(two, 0, SCENE, 65, 24)
    same_pictures(two, 24, SCENE, 0, 89)
    saga("info", two)
    saga("join", two, two, "-o", two)
    same_pictures(two, 113, SCENE, 65, 24)
    verdict("join")


def check_refused(tmp, part):
    data = read(part)
    rig = 174
    networks = struct.unpack_from("<I", data, 8)[0] + 12 + 16 + 12 + 100
    out = tmp + "/refused.saga"
    saga("cut", SCENE, "0:20", "-o", out, status=1,
         says="frame 20 is inside segment 1, which is frames 16:65")
    saga("cut", SCENE, "3:16", "-o", out, status=1,
         says="inside segment 0, which is frames 0:16")
    saga("cut", SCENE, "16:900", "-o", out, status=1, says="its 89 frames")
    saga("cut", SCENE, "89:", "-o", out, status=1, says="its 89 frames")
    saga("cut", SCENE, "16", "-o", out, status=2, says="'16' is no range")
    saga("cut", SCENE, "0:16", status=2, says="-o OUT is missing")
    saga("cut", "/dev/null/x", "0:16", "-o", out, status=2, says="x")
    saga("cut", "Makefile", "0:16", "-o", out, status=1, says="Makefile")
    saga("cut", write(tmp + "/hurt.saga", data[:-1]), ":", "-o", out,
         status=1, says="copy the file again")
    for at, what in ((networks, "networks"), (rig + 5, "rig"),
                     (24, "frame rate"), (48, "cube"), (80, "model"),
                     (103, "model")):
        other = write(tmp + "/other.saga", changed(data, at, 2))
        saga("join", part, other, "-o", out, status=1, says="its " + what)
    saga("join", part, "vectors/good/still.saga", "-o", out, status=1,
         says="not what")
    if os.path.exists(out):
        complain("something was written though it was refused")
    verdict("refused")


with tempfile.TemporaryDirectory() as folder:
    check_refused(folder, check_cut(folder)[0])
    check_join(folder, [folder + "/part%d.saga" % i for i in range(3)])
sys.exit(checks.failed)
