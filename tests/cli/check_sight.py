#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""check_sight.py: guarantees, for the kinds of pictures of `saga render`,
  stereo  the pictures of two eyes are next to each other, the left one first.
          They have saga-dec's pixels for cameras that are moved along their
          axis here, in metres or the capture's units
  depth   depths, in the capture's units, are the mean depths that an
          independent renderer finds, and so are the opacities; PNG and EXR
          files, read here, hold the same
  rgba    a picture with opacity, laid over a colour here, is the one drawn
          over this colour, also along an orbit; films have the same opacities
  bad     options that exclude each other give a message of one line"""

import functools
import json
import math
import os
import re
import struct
import subprocess
import sys
import tempfile
import zlib

import splats
from verdict import SAGA, SAGA_DEC, Verdicts, pixels, read

DEMO = "docs/demo.saga"

checks = Verdicts("sight")
complain, verdict = checks.complain, checks.verdict
saga = functools.partial(checks.run, SAGA)


# --- Two eyes --------------------------------------------------------------

def dec(tmp, scene, camera):
    """Returns saga-dec's pixels of frame 1."""
    name, out = tmp + "/camera.txt", tmp + "/want.ppm"
    values = camera["rotation_q30"] + camera["centre"] + \
        camera["focal_q16"] + camera["principal_q16"] + \
        [camera["near"], camera["width"], camera["height"]] + \
        camera["background"]
    with open(name, "w") as f:
        f.write(" ".join(map(str, values)))
    subprocess.run([SAGA_DEC, scene, "--camera", name, "--time", "1", "-o",
                    out], check=True)
    return re.sub(rb"^P6\n\d+ \d+\n255\n", b"", read(out), count=1)


def integers(info, index):
    """Returns a camera of the file as its 22 integers.
    tests/support/gen_stream.c gives all vectors this background."""
    c, metric = info["rig"][index], info["metric"]
    unit = metric["metres_per_unit"]
    mantissa, exponent = metric["unit_mantissa_exponent"]
    unit = math.ldexp(mantissa, exponent)
    return {
        "rotation_q30": [round(x * 2 ** 30) for x in c["rotation"]],
        "centre": [round((x - m) / unit) for x, m in
                   zip(c["centre_metres"], metric["centre_metres"])],
        "focal_q16": [round(x * 65536) for x in c["focal"]],
        "principal_q16": [round(x * 65536) for x in c["principal"]],
        "near": round(c["near_metres"] / unit), "width": c["width"],
        "height": c["height"], "background": [3000, 4000, 8000],
        "unit": unit}


def moved(camera, aside):
    """Returns the camera moved to its right, in the capture's units."""
    right = [x / 2 ** 30 for x in camera["rotation_q30"][:3]]
    return {**camera, "centre": [
        c + round(aside / camera["unit"] * r)
        for c, r in zip(camera["centre"], right)]}


def check_stereo(tmp):
    for scene in ("vectors/good/motion.saga", "vectors/good/names.saga"):
        info = json.loads(saga("info", scene, "--json"))
        metres = info["metric"]["metres_in_capture_unit"]
        camera = integers(info, 1)
        saga("render", scene, "--camera", 1, "--frame", 1, "--stereo", 0.25,
             "-o", tmp + "/pair.png")
        half = 0.125 / (metres or 1.0)
        got, line = pixels(tmp + "/pair.png", "rgb24"), 6 * camera["width"]
        for eye, aside in enumerate((-half, half)):
            want = dec(tmp, scene, moved(camera, aside))
            mine = b"".join(got[y * line + eye * line // 2:
                                y * line + (eye + 1) * line // 2]
                            for y in range(camera["height"]))
            if mine != want:
                complain(scene, "eye", eye, "is not saga-dec's")
    if metres != 0.1875:
        complain("names.saga has", metres, "metres in its unit")
    verdict("stereo")


# --- Depth and alpha -------------------------------------------------------

def read_exr(path, channel, width, height):
    """Returns the floats of an EXR with one channel, compressed with ZIP in
    blocks of 16 lines."""
    data, at = read(path), 8
    if data[:4] != struct.pack("<I", 20000630):
        complain(path, "is no EXR")
    while data[at]:
        name, kind = data[at:].split(b"\0", 2)[:2]
        at += len(name) + len(kind) + 2
        nbytes = struct.unpack_from("<I", data, at)[0]
        value = data[at + 4:at + 4 + nbytes]
        at += 4 + nbytes
        if name == b"channels" and value[:6] != channel.encode() + b"\0" + \
                struct.pack("<I", 2):
            complain(path, "has the channels", value)
        if name == b"compression" and value != b"\3":
            complain(path, "is compressed by", value)
    out = [0.0] * (width * height)
    for offset in struct.unpack_from("<%dQ" % ((height + 15) // 16), data,
                                     at + 1):
        y, nbytes = struct.unpack_from("<II", data, offset)
        block = data[offset + 8:offset + 8 + nbytes]
        n = width * min(16, height - y)
        if nbytes < 4 * n:
            block = bytearray(zlib.decompress(block))
            for i in range(1, 4 * n):
                block[i] = (block[i - 1] + block[i] - 128) & 255
            half = 2 * n
            block = bytes(block[i // 2 + i % 2 * half] for i in range(4 * n))
        out[y * width:y * width + n] = struct.unpack("<%df" % n, block)
    return out


def depths_of(path, camera):
    """Returns alpha and mean depth by the independent renderer."""
    n = camera["width"] * camera["height"]
    sums, light = [0.0] * (3 * n), [1.0] * n
    seen = [p for p in (splats.project(s, camera, 0.1)
                        for s in splats.read_ply(path)) if p]
    for p in sorted(seen, key=lambda s: s["depth"]):
        p["colour"] = [p["depth"], 1.0, 0.0]
        splats.draw_one(p, sums, light, camera["width"], camera["height"])
    alpha = sums[1::3]
    return alpha, [s / a if a > 0 else 0 for s, a in zip(sums[::3], alpha)]


def shown(tmp, scene, kind, channel, size):
    """Returns the samples of a PNG as 16 bits, and those of an EXR."""
    for ending in ("png", "exr"):
        saga("render", scene, "--camera", 2, "--frame", 7, "--size",
             "%dx%d" % size, "--" + kind, "-o", tmp + "/%s.%s" % (kind, ending))
    png = pixels(tmp + "/%s.png" % kind, "gray16le")
    return struct.unpack("<%dH" % (size[0] * size[1]), png), \
        read_exr(tmp + "/%s.exr" % kind, channel, *size)


# A PLY has neither splats with a flat top nor steep ones, so that its splats
# have only approximately the size of ours.
def check_depth(tmp, scene, scale):
    camera = json.loads(saga("info", scene, "--json"))["rig"][2]
    for name in ("width", "height"):
        camera[name] //= scale
    for name in ("focal", "principal"):
        camera[name] = [v / scale for v in camera[name]]
    size = camera["width"], camera["height"]
    ply = tmp + "/%d.ply" % scale
    saga("export", scene, "-o", ply, "--frame", "7", "--camera", "2")
    alpha, depth = depths_of(ply, camera)
    opaque = [i for i, a in enumerate(alpha) if a > 0.25]
    png, exr = shown(tmp, scene, "depth", "Z", size)
    off = math.sqrt(sum((exr[i] / depth[i] - 1) ** 2 for i in opaque) /
                    len(opaque))
    if len(opaque) < 200 or off > 0.05:
        complain(scene, "depths are", off, "off at", len(opaque), "pixels")
    if any(abs(p - 1000 * e) > 0.5001 for p, e in zip(png, exr)):
        complain(scene, "PNG and EXR have other depths")
    png, exr = shown(tmp, scene, "alpha", "A", size)
    clear = math.sqrt(sum((a - e) ** 2 for a, e in zip(alpha, exr)) / len(exr))
    if clear > 0.08 or max(exr) > 1 or min(exr) < 0:
        complain(scene, "alpha is", clear, "off")
    if any(abs(p - 65535 * e) > 0.5001 for p, e in zip(png, exr)):
        complain(scene, "PNG and EXR have other alphas")
    print("     %s: depth %.5f of itself, alpha %.5f rms; alpha %.2f to %.2f" %
          (scene, off, clear, min(alpha), max(alpha)))


# --- Colour with opacity ---------------------------------------------------

def check_rgba(tmp):
    over, size = (0, 255, 128), ("--size", "96x54")
    for way in (("--camera", 1), ("--orbit", 4)):
        name = "%d" if way[0] == "--orbit" else "3"
        for kind in (("--rgba",), ("--over", "#%02x%02x%02x" % over)):
            saga("render", DEMO, *way, *size, *kind, "-o",
                 "%s/%s_%s.png" % (tmp, kind[0][2:], name))
        rgba = pixels(tmp + "/rgba_3.png", "rgba")
        want = pixels(tmp + "/over_3.png", "rgb24")
        off = [abs(a * c / 255 + (1 - a / 255) * b - w)
               for a, rgb, shown in zip(rgba[3::4], zip(
                   rgba[::4], rgba[1::4], rgba[2::4]),
                   zip(want[::3], want[1::3], want[2::3]))
               for c, b, w in zip(rgb, over, shown)]
        # Colours over black, straight ones and opacities are rounded to 8 bits.
        if max(off) > 2.5 or not 0 < sum(rgba[3::4]):
            complain("RGBA", way[0], "is", max(off), "off")
    for ending, codec in (("webm", "libvpx-vp9"), ("mov", "prores")):
        film = tmp + "/film." + ending
        saga("render", DEMO, "--orbit", 4, *size, "--rgba", "-o", film)
        got = subprocess.run(
            ["ffmpeg", "-nostdin", "-v", "error", "-c:v", codec, "-i", film,
             "-f", "rawvideo", "-pix_fmt", "rgba", "-"], check=True,
            stdout=subprocess.PIPE).stdout
        last = got[3 * len(rgba):]
        off = [abs(a - b) for a, b in zip(last[3::4], rgba[3::4])]
        if len(got) != 4 * len(rgba) or sum(off) > 3 * len(off):
            complain(film, "has other opacities")
    verdict("rgba")


def check_bad(tmp):
    def refused(says, *options, out="/x.png", status=2):
        saga("render", DEMO, *options, "-o", tmp + out, status=status,
             says=says)

    refused("--depth, --alpha, --rgba and --over exclude", "--depth", "--alpha")
    refused("--over takes RRGGBB, not '12345'", "--over", "12345")
    refused("--rgba is written as .png, .webm or .mov", "--rgba", out="/x.mp4")
    refused("--stereo takes a distance above 0", "--stereo=-1")
    refused("written as .png or .exr", "--depth", out="/x.mp4")
    refused("side by side", "--stereo", 0.1, "--size", "9000x100", status=1)
    refused("an eye would stand outside", "--stereo", 1e9, status=1)
    if [n for n in os.listdir(tmp) if n.startswith("x.")]:
        complain("pictures of what was refused")
    verdict("bad")


def main():
    with tempfile.TemporaryDirectory() as tmp:
        check_stereo(tmp)
        check_depth(tmp, DEMO, 4)
        check_depth(tmp, "vectors/good/motion.saga", 2)
        verdict("depth")
        check_rgba(tmp)
        check_bad(tmp)
    return 1 if checks.failed else 0


sys.exit(main())
