#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""check_pipe.py: guarantees, for the streams that saga-play writes,
  rgb         the bytes are saga-dec's pixels, picture after picture, with any
              number of threads
  y4m         the header, and the size of a picture, agree with the file; the
              samples are saga-dec's pixels, converted exactly by the formula of
              BT.601, or of BT.709 above 576 lines
  ffmpeg      ffmpeg reads the stream, and gets the same colours
  failure     if the file ends too early, neither output nor a part of it
              remains
  words       contradictory options give a message of one line"""

import os
import re
import subprocess
import sys
import tempfile
from fractions import Fraction

from verdict import SAGA, SAGA_DEC, Verdicts, read

SAGA_PLAY = os.path.join(os.path.dirname(SAGA_DEC), "saga-play")
SCENE = "vectors/good/motion.saga"
PICTURES = (0, 3)

checks = Verdicts("pipe")
complain, verdict = checks.complain, checks.verdict


def play(*words):
    done = subprocess.run([SAGA_PLAY, *map(str, words)], timeout=60,
                          stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    if done.returncode:
        complain(words, "fails:", done.stderr.decode())
    return done.stdout


def picture(tmp, scene, camera, frame):
    """Returns the R, G, B bytes of a picture drawn by saga-dec."""
    out = os.path.join(tmp, "x.ppm")
    checks.run(SAGA_DEC, scene, "--camera", "rig:%d" % camera, "--time",
               "%d/1" % frame, "-o", out)
    ppm = read(out)
    return ppm[re.match(rb"P6\n\d+ \d+\n255\n", ppm).end():]


# --- The formula, in fractions ---------------------------------------------

def nearest(x):
    return int(x + Fraction(1, 2))


def converter(kr, kb):
    """Converts by ITU-R BT.601 or BT.709 in 8 bits: Y' = 16 + 219 E'y, C = 128
    + 224 E'c."""
    known = {}

    def convert(r, g, b):
        if (r, g, b) not in known:
            r1, g1, b1 = (Fraction(x, 255) for x in (r, g, b))
            y = kr * r1 + (1 - kr - kb) * g1 + kb * b1
            known[r, g, b] = (
                nearest(16 + 219 * y),
                nearest(128 + 224 * (b1 - y) / (2 * (1 - kb))),
                nearest(128 + 224 * (r1 - y) / (2 * (1 - kr))))
        return known[r, g, b]

    return convert


BT601 = converter(Fraction(299, 1000), Fraction(114, 1000))
BT709 = converter(Fraction(2126, 10000), Fraction(722, 10000))


def planes(rgb, convert):
    pixels = [convert(*rgb[i:i + 3]) for i in range(0, len(rgb), 3)]
    return b"".join(bytes(p[k] for p in pixels) for k in range(3))


# --- Checks ----------------------------------------------------------------

# motion.saga has 47 frames of 160x120 at 30 frames a second
# (tests/support/gen_stream.c).
N_FRAMES, N_PIXELS = 47, 160 * 120
HEADER = b"YUV4MPEG2 W160 H120 F30:1 Ip A1:1 C444 XCOLORRANGE=LIMITED\n"


def check_rgb(tmp):
    for camera, threads in ((0, 1), (1, 3)):
        got = play("--rgb", "-", SCENE, threads, camera)
        if len(got) != N_FRAMES * 3 * N_PIXELS:
            complain("camera", camera, "gives", len(got), "bytes")
        for frame in PICTURES:
            at = 3 * N_PIXELS * frame
            if got[at:at + 3 * N_PIXELS] != picture(tmp, SCENE, camera, frame):
                complain("camera", camera, "picture", frame, "differs")
    verdict("rgb")


def compare(stream, header, rgb, frame, convert):
    """Compares picture `frame` of a stream with saga-dec's pixels."""
    size = len(b"FRAME\n") + len(rgb)
    at = len(header) + size * frame
    if not stream.startswith(header):
        complain("the header is", stream[:80])
    if stream[at:at + size] != b"FRAME\n" + planes(rgb, convert):
        complain("picture", frame, "of", header, "differs")


def check_y4m(tmp):
    stream = play(SCENE, "--y4m", "-")
    if len(stream) != len(HEADER) + N_FRAMES * (6 + 3 * N_PIXELS):
        complain("the stream has", len(stream), "bytes")
    for frame in PICTURES:
        compare(stream, HEADER, picture(tmp, SCENE, 0, frame), frame, BT601)
    path = os.path.join(tmp, "x.y4m")
    play("--y4m", path, SCENE)
    if read(path) != stream:
        complain("a file has other bytes than the pipe")
    for height, convert in ((576, BT601), (578, BT709)):
        check_tall(tmp, height, convert)
    verdict("y4m")


def check_tall(tmp, height, convert):
    """Makes a file with colourful pictures of 32 x `height` at 24 frames a
    second."""
    capture = os.path.join(tmp, "capture%d" % height)
    scene = os.path.join(tmp, "tall.saga")
    checks.run(SAGA, "synth", capture, "--size", "32x%d" % height, "--cameras",
               4, "--hold-out", 1, "--frames", 2, "--points", 300,
               "--depth-every", 0)
    checks.run(SAGA, "encode", capture, "-o", scene, "--primitives", 60,
               "--iterations", 30)
    header = HEADER.replace(b"W160 H120 F30", b"W32 H%d F24" % height)
    rgb = picture(tmp, scene, 0, 1)
    compare(play("--y4m", "-", scene), header, rgb, 1, convert)
    if planes(rgb, BT601) == planes(rgb, BT709):
        complain("the pictures are grey")


def check_ffmpeg(tmp):
    path = os.path.join(tmp, "x.y4m")
    play(SCENE, 1, 0, 4, "--y4m", path)
    rgb = subprocess.run(
        ["ffmpeg", "-v", "error", "-i", path, "-vf", "scale=flags=bicubic+"
         "accurate_rnd+full_chroma_int", "-f", "rawvideo", "-pix_fmt",
         "rgb24", "-"], stdout=subprocess.PIPE, check=True).stdout
    want = b"".join(picture(tmp, SCENE, 0, frame) for frame in range(4))
    # A step of 8-bit chroma is 2.02 steps of blue, and each of the three
    # samples is rounded.
    if len(rgb) != len(want) or max(
            abs(a - b) for a, b in zip(rgb, want)) > 3:
        complain("ffmpeg has other pictures")
    verdict("ffmpeg")


def check_words():
    help = "see saga-play --help"
    for words, says in (((SCENE, "--y4m"), help),
                        (("--y4m", "-", "--rgb", "-", SCENE), help),
                        (("--y4m", "-", "--y4m", "-", SCENE), help),
                        ((SCENE, 1, 0, 1, 5), help), ((), help),
                        ((SCENE, "x"), help), (("-v",), help),
                        ((SCENE, "--y4m", "/nowhere/x"), "cannot write"),
                        ((SCENE, "--rgb", "/dev/full"), "cannot write")):
        checks.run(SAGA_PLAY, *words, status=2, says=says)
    verdict("words")


def check_failure(tmp):
    """If the input ends too early, there must be no output file, and an old one
    must not change."""
    short, out = os.path.join(tmp, "short.saga"), os.path.join(tmp, "out.y4m")
    with open(short, "wb") as to:
        to.write(read(SCENE)[:-100])
    for old in None, b"old":
        if old:
            with open(out, "wb") as to:
                to.write(old)
        checks.run(SAGA_PLAY, "--y4m", out, short, status=1,
                   says="ends too early")
        left = read(out) if os.path.exists(out) else None
        if left != old or any("saga-part" in n for n in os.listdir(tmp)):
            complain("a file cut short leaves a part of its output")
    verdict("failure")


def main():
    with tempfile.TemporaryDirectory() as tmp:
        check_rgb(tmp)
        check_y4m(tmp)
        check_ffmpeg(tmp)
        check_failure(tmp)
    check_words()
    return 1 if checks.failed else 0


sys.exit(main())
