#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""check_exchange.py: guarantees, for splats that are exported and imported, and
files that are cut and joined,
  draw        an independent renderer draws the exported PLY as saga-dec draws
              the file: positions, shapes, opacities, colours, axes and units
              agree
  formats     PLY, SPZ and GLB hold the same splats; SPZ within its quantisation
              steps
  moving      FTGS PLY of the demo: each splat's line is nearest to the
              decoder's positions of all frames, weighted by opacity, and its
              opacity is the decoder's if it stays below 1; the independent
              renderer draws frames at most 3 dB worse than from a PLY each;
              films of several segments and single frames are refused
  programs    @playcanvas/splat-transform reads the same splats from SPZ,
              compressed PLY and SOG, within their steps; skipped without npm
  outputs     the requested frames are written, either completely or not at all;
              README lists the same formats as the help
  import      a file that was encoded from PLY splats is drawn as an independent
              renderer draws the splats; a sequence of SPZ files gives as many
              frames; an invalid PLY is reported
  meant       splats that are left out, clamped or read otherwise than the
              format says are told in one line for each kind; splats at one
              point are no error; what a level or the memory has no room for is
              refused before anything is drawn
  cut         frames that were cut from a file draw the same pixels, from the
              same coded bytes
  join        the parts of a file, joined, are the file; in another order they
              draw the same pixels as before
  base        every part has the file's base and names; parts with different
              bases cannot be joined
  layers      a file cut to its first layers draws what the file draws if it
              ends after these layers; `saga info` reports the bytes and counts
              of each layer
  sound       sound can be put into a film and removed; `saga info` reports it;
              a cut keeps it only if it has all frames. A film rendered as MP4
              has sound of the film's duration and start, but none if the
              pictures do not follow the film's time, as with --orbit
  refused     ranges that begin or end inside a segment or beyond the file, and
              files with other networks, cameras, rates or cubes, are refused in
              one line that says why"""

import functools
import math
import os
import re
import shutil
import json
import struct
import subprocess
import sys
import tempfile

import splats
from verdict import SAGA, SAGA_DEC, Verdicts, crc32c, python_module, read
import npm  # noqa: E402  (verdict knows where)

decoder = python_module()

SCENE = "vectors/good/segments.saga"
# The first frame of each segment of the vector, as tests/support/gen_stream.c
# writes it; the last number is the end of the film.
STARTS = [0, 19, 61, 78]
DEMO = "docs/demo.saga"

checks = Verdicts("exchange")
complain, verdict = checks.complain, checks.verdict
saga = functools.partial(checks.run, SAGA)


def write(path, data):
    with open(path, "wb") as f:
        f.write(data)
    return path


# --- A file's chunks, read and signed here ---------------------------------

ASIDE = b"NAME", b"EXPO", b"OPUS" # optional chunks between head and segments


def signed(data):
    """Returns the file with the CRCs computed by docs/bitstream.md, section
    2."""
    data = bytearray(data)
    at = struct.unpack_from("<I", data, 8)[0]
    owner = nets = crc32c(0, data[:at - 4])
    in_head = True
    struct.pack_into("<I", data, at - 4, owner)
    while at < len(data):
        kind, n = struct.unpack_from("<4sI", data, at)
        crc = crc32c(crc32c(nets if kind in ASIDE else owner,
                            data[at:at + 8]), data[at + 12:at + 12 + n])
        struct.pack_into("<I", data, at + 8, crc)
        nets = crc if kind == b"NETS" else nets
        in_head = in_head and kind not in (*ASIDE, b"SEGM")
        if in_head and kind != b"INDX":
            owner = crc
        at += 12 + n
    return bytes(data)


def changed(data, at, value):
    """Returns the file with a byte changed by XOR and the CRCs computed
    again."""
    data = bytearray(data)
    data[at] ^= value
    return signed(data)


# --- Cutting and joining ---------------------------------------------------

def picture(path, frame):
    return checks.run(SAGA_DEC, path, "--camera", "rig:1", "--time",
                      "%d/2" % frame, "--crc")


def same_pictures(path, first, other, start, n):
    """Checks that n frames of `path` from `first` on look like those of `other`
    from `start` on."""
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
    saga("cut", SCENE, "19:", "-o", tmp + "/end.saga")
    same_pictures(tmp + "/end.saga", 42, SCENE, 61, 17)
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
    saga("join", *parts, "-o", three)
    if read(three) != read(SCENE):
        complain("three parts at once are not the file")
    saga("join", parts[2], three, "-o", two)
    same_pictures(two, 0, SCENE, 61, 17)
    same_pictures(two, 17, SCENE, 0, 78)
    saga("info", two)
    saga("join", two, two, "-o", two)
    same_pictures(two, 95, SCENE, 61, 17)
    verdict("join")


def check_base(tmp):
    """Base and names must be in every part, and parts with different bases must
    not be joined."""
    whole = "vectors/good/base_names.saga"
    data = read(whole)
    header_nbytes = struct.unpack_from("<I", data, 8)[0]
    frames = struct.unpack_from("<I", data, header_nbytes + 24)[0]
    parts = [tmp + "/base%d.saga" % i for i in range(2)]
    out = tmp + "/base.saga"
    saga("cut", whole, ":%d" % frames, "-o", parts[0])
    saga("cut", whole, "%d:" % frames, "-o", parts[1])
    same_pictures(parts[1], 0, whole, frames, 4)
    for part in parts:
        if read(part) != signed(read(part)):
            complain(part, "has not the checksums of the documents")
    saga("join", *parts, "-o", out)
    if read(out) != data:
        complain("the parts of a file with a base are not the file")
    if json.loads(saga("info", parts[1], "--json"))["rig"] != \
            json.loads(saga("info", whole, "--json"))["rig"]:
        complain("a part has not the names of its file")
    second = read(parts[1])
    other = changed(second, second.index(b"FINE") + 14, 1)
    saga("join", parts[0], write(tmp + "/other.saga", other), "-o",
         tmp + "/none.saga", status=1, says="its base")
    verdict("base")


def loud_from(path):
    """Returns the seconds until the first loud sample of a file's sound."""
    pcm = subprocess.check_output(
        ["ffmpeg", "-v", "error", "-i", path, "-f", "s16le", "-ac", "1",
         "-ar", "48000", "-"])
    samples = struct.unpack("<%dh" % (len(pcm) // 2), pcm)
    return next((i / 48000 for i, x in enumerate(samples) if abs(x) > 2000),
                None), len(samples) / 48000


def check_film_sound(film, tmp):
    """Checks films rendered from the demo, which has 24 frames in one second
    and a sound that begins at 0.25 s."""
    out = tmp + "/film.mp4"
    for frames, begins, lasts in (("0:24", 0.25, 1), ("12:24", 0, 0.5)):
        saga("render", film, "--frames", frames, "-o", out)
        first, seconds = loud_from(out)
        if first is None or abs(first - begins) > 0.03 or \
                abs(seconds - lasts) > 0.05:
            complain("frames", frames, "sound from", first, "for", seconds)
    saga("render", film, "--orbit", "8", "-o", out)
    told = subprocess.check_output(["ffprobe", "-v", "error", "-show_entries",
                                    "stream=codec_type", out])
    if b"audio" in told:
        complain("a film with a time of its own has sound")


def check_sound(tmp):
    take, wav, film, out = (tmp + "/" + name for name in
                            ("take.opus", "take.wav", "sound.saga", "o.saga"))
    tone = ["-f", "lavfi", "-i", "sine=440:d=2", "-af", "volume=8"]
    subprocess.run(["ffmpeg", "-v", "error", *tone, "-c:a", "libopus", take],
                   check=True)
    subprocess.run(["ffmpeg", "-v", "error", *tone, wav], check=True)
    saga("mux", DEMO, "--audio", take, "--start", "0.25", "-o", film)
    if read(take) not in read(film) or read(film) != signed(read(film)):
        complain("the film has not the stream that it was given")
    told = json.loads(saga("info", film, "--json"))["sound"]
    if told["start_seconds"] != 0.25 or told["n_channels"] != 1 or \
            abs(told["seconds"] - 2) > 0.03:
        complain("info tells of the sound", told)
    if "from 0.250 s on" not in saga("info", film) or \
            "sound  " in saga("info", DEMO):
        complain("info does not say whether there is sound")
    same_pictures(film, 0, DEMO, 0, 3)
    saga("mux", film, "--audio", "none", "-o", out)
    if read(out) != read(DEMO):
        complain("a film without its sound is not what it was")
    saga("mux", film, "--audio", wav, "--start", "-0.5", "-o", out)
    told = json.loads(saga("info", out, "--json"))["sound"]
    if told["start_seconds"] != -0.5 or abs(told["seconds"] - 2) > 0.03:
        complain("a sound that ffmpeg coded is told as", told)
    saga("cut", film, ":", "-o", out)
    if read(out) != read(film):
        complain("all frames of a film are not the film")
    if "sound is left out" not in saga("join", film, film, "-o", out):
        complain("join does not say that it leaves the sound out")
    check_film_sound(film, tmp)
    hurt = bytearray(read(take))
    hurt[-1] ^= 1
    # A playlist names another file or address, whatever its own name is.
    concat = write(tmp + "/list.mp4", b"ffconcat version 1.0\nfile take.opus\n")
    hls = write(tmp + "/list.opus", b"#EXTM3U\n#EXT-X-TARGETDURATION:5\n"
                b"#EXTINF:5,\ntake.opus\n#EXT-X-ENDLIST\n")
    for name, says in ((write(tmp + "/hurt.opus", hurt), "wrong checksum"),
                       (DEMO, "finds no sound"),
                       (concat, '"concat", which can name other files'),
                       (hls, '"hls", which can name other files')):
        saga("mux", DEMO, "--audio", name, "-o", tmp + "/none.saga",
             status=1 if "hurt" in name else 2, says=says)
    if os.path.exists(tmp + "/none.saga"):
        complain("a film was written with a sound that is none")
    verdict("sound")


def check_refused(tmp, part):
    data = read(part)
    rig = 174
    networks = struct.unpack_from("<I", data, 8)[0] + 12 + 16 + 12 + 100
    out = tmp + "/refused.saga"
    saga("cut", SCENE, "0:20", "-o", out, status=1,
         says="frame 20 is inside segment 1, which is frames 19:61")
    saga("cut", SCENE, "3:19", "-o", out, status=1,
         says="inside segment 0, which is frames 0:19")
    saga("cut", SCENE, "19:900", "-o", out, status=1, says="its 78 frames")
    saga("cut", SCENE, "78:", "-o", out, status=1, says="its 78 frames")
    saga("cut", SCENE, "19", "-o", out, status=2, says="'19' is not a range")
    saga("cut", SCENE, "0:19", status=2, says="-o OUT is missing")
    saga("cut", "/dev/null/x", "0:19", "-o", out, status=2, says="x")
    saga("cut", "Makefile", "0:19", "-o", out, status=1, says="Makefile")
    saga("cut", write(tmp + "/hurt.saga", data[:-1]), ":", "-o", out,
         status=1, says="copy the file again")
    for at, what in ((networks, "networks"), (rig + 5, "rig"),
                     (24, "frame rate"), (48, "cube"), (80, "networks"),
                     (103, "model")):
        other = write(tmp + "/other.saga", changed(data, at, 2))
        saga("join", part, other, "-o", out, status=1, says="its " + what)
    saga("join", part, "vectors/good/still.saga", "-o", out, status=1,
         says="differs from that of")
    if os.path.exists(out):
        complain("something was written though it was refused")
    verdict("refused")


# --- Splats ----------------------------------------------------------------

def small_camera(index, scale):
    """Returns camera `index` of the demo's rig with a smaller picture."""
    info = json.loads(saga("info", DEMO, "--json"))
    c = info["rig"][index]
    for name in ("width", "height"):
        c[name] //= scale
    for name in ("focal", "principal"):
        c[name] = [v / scale for v in c[name]]
    return c


def shown(camera, index, frame, out):
    """Returns the samples of our picture."""
    size = "%dx%d" % (camera["width"], camera["height"])
    saga("render", DEMO, "--camera", index, "--frame", frame, "--size", size,
         "-o", out.replace("ppm", "png"))
    subprocess.run(["ffmpeg", "-v", "error", "-y", "-i",
                    out.replace("ppm", "png"), out], check=True)
    return re.sub(rb"^P6\n\d+ \d+\n255\n", b"", read(out), count=1)


def drawn(path, camera, index, frame):
    """Returns the PSNR of a PLY, drawn by the independent renderer, against our
    picture."""
    pixels = shown(camera, index, frame, os.path.dirname(path) + "/want.ppm")
    picture = splats.draw(splats.read_ply(path), camera, [0, 0, 0], 0.1)
    return splats.psnr(picture, pixels)


def check_draw(tmp):
    camera = small_camera(3, 4)
    # The renderer uses saga's low-pass. Other programs have neither splats with
    # a flat top nor steep ones, so that 31.5 dB are reached at a quarter of the
    # size.
    for name, options, least in (("baked", ["--camera", "3"], 31),
                                 ("fitted", ["--sh", "1"], 31)):
        folder = tmp + "/" + name
        saga("export", DEMO, "-o", folder + "/frame_%05d.ply", "--frames", "7:8",
             *options)
        got = drawn(folder + "/frame_00007.ply", camera, 3, 7)
        print("     %s colours: %.1f dB" % (name, got))
        if not got > least:
            complain(name, "colours are drawn at", got, "dB, not", least)
    verdict("draw")


def far(a, b):
    return max(abs(x - y) for x, y in zip(a, b))


def flat(matrix):
    return [v for row in matrix for v in row]


def compare(a, b, name, bounds):
    """Compares the splats of two files. The bounds are of mean, rotation,
    logarithm of scales, opacity, constant colour and other coefficients."""
    if len(a) != len(b):
        complain(name, "has", len(b), "splats, not", len(a))
    worst = [0.0] * 6
    for s, t in zip(a, b):
        for i, d in enumerate((
                far(s["mean"], t["mean"]),
                far(flat(splats.covariance(dict(s, scale=[1, 2, 4]))),
                    flat(splats.covariance(dict(t, scale=[1, 2, 4])))),
                max(abs(math.log(x / y)) if x > math.exp(-10) else 0
                    for x, y in zip(s["scale"], t["scale"])),
                abs(s["opacity"] - t["opacity"]),
                far(s["colour"][0], t["colour"][0]),
                far(flat(s["colour"][1:]) + [0], flat(t["colour"][1:]) + [0]))):
            worst[i] = max(worst[i], d)
    if not all(w <= bound for w, bound in zip(worst, bounds)):
        complain(name, "is off by", worst, "not within", bounds)


def export(out, frame=12, *options):
    saga("export", DEMO, "-o", out, "--frame", frame, *options)
    return out


def animated():
    """Returns opacity and position of each primitive that the demo draws, in
    each frame, as the decoder has them."""
    film, one = decoder.open(DEMO), decoder._Animated()
    unit, centre = film.info.metres_per_unit, film.info.centre_metres
    told = [[] for _ in range(film.info.max_primitives)]
    for frame in range(film.info.n_frames):
        t = film._seek(frame)
        for i, p in enumerate(told):
            if decoder._lib().saga_primitive_at(decoder.ctypes.byref(one),
                                                film._dec, i, t):
                complain("no primitive", i)
            q0 = one.q0_q20 / 2 ** 20
            p.append((2 ** (3 - q0) if q0 < 11 else 0,
                      [c + unit * x for c, x in zip(centre, one.x)]))
    return [p for p in told if any(o for o, _ in p)]


def check_moving(tmp):
    out = tmp + "/demo.ftgs.ply"
    told = saga("export", DEMO, "-o", out)
    at, truth = splats.read_moving(out), animated()
    frames, peaks = range(len(truth[0])), splats.read_ply(out)
    moved = [at(f) for f in frames]
    if len(moved[0]) != len(truth):
        complain(len(moved[0]), "splats, not", len(truth))
    worst, square, weight = [0.0, 0.0, 0.0], 0.0, 0.0
    for i, p in enumerate(truth):
        w = [min(o, 1) for o, _ in p]
        if peaks[i]["opacity"] < 0.99:
            worst[0] = max(worst[0], *(abs(moved[f][i]["opacity"] - w[f])
                                       for f in frames if w[f]))
        # Where the sum of squares is least, its derivatives are 0.
        for k in range(3):
            off = [moved[f][i]["mean"][k] - p[f][1][k] for f in frames]
            square += sum(a * d * d for a, d in zip(w, off))
            worst[1] = max(worst[1], abs(sum(a * d for a, d in zip(w, off))))
            worst[2] = max(worst[2], abs(sum(f * a * d for f, a, d in
                                             zip(frames, w, off))))
        weight += sum(w)
    if worst[0] > 0.002 or worst[1] > 1e-4 or worst[2] > 1e-3:
        complain("opacities, lines are off by", worst)
    says = re.search(r"24 frames, (\d+) splats; as lines, off by (\S+) units",
                     told)
    if not says or int(says[1]) != len(truth) or \
            abs(float(says[2]) - math.sqrt(square / weight)) > 1e-4:
        complain("off by", math.sqrt(square / weight), "it says", told)
    camera = small_camera(3, 4)
    saga("export", DEMO, "-o", tmp + "/each/%d.ply")
    for frame in 0, 7, 23:
        sound = [s for s in moved[frame] if s["opacity"] > 1 / 256]
        each = splats.read_ply(tmp + "/each/%d.ply" % frame)
        pixels = shown(camera, 3, frame, tmp + "/want.ppm")
        got, most = (splats.psnr(splats.draw(s, camera, [0, 0, 0], 0.1), pixels)
                     for s in (sound, each))
        print("     frame %d: %.1f dB, %.1f of its own" % (frame, got, most))
        if not got > most - 3:
            complain("frame", frame, "is drawn at", got, "dB, not", most)
    saga("export", SCENE, "-o", tmp + "/no.ftgs.ply", status=1,
         says="has 3 segments, of which a file of moving splats holds one; "
         "`saga cut` takes one of them out")
    saga("export", DEMO, "-o", out, "--frame", "3", status=2,
         says="one file holds all frames")
    verdict("moving")


def check_formats(tmp):
    pattern, folder = tmp + "/ply/frame_%05d.ply", tmp + "/ply"
    saga("export", DEMO, "-o", pattern, "--frames", "11:13")
    if sorted(os.listdir(folder)) != ["frame_00011.ply", "frame_00012.ply"]:
        complain("frames 11:13 are", os.listdir(folder))
    ply = splats.read_ply(folder + "/frame_00012.ply")
    if read(export(tmp + "/one.ply")) != read(folder + "/frame_00012.ply"):
        complain("a frame alone is not that of the sequence")
    compare(ply, splats.read_glb(export(tmp + "/x.glb")), "GLB",
            [1e-6, 1e-5, 1e-5, 1e-6, 0, 0])
    compare(ply, splats.read_spz(export(tmp + "/x.spz")), "SPZ",
            [0.51 / 4096, 0.06, 0.51 / 16, 0.51 / 255, 0.51 / 255 / 0.15,
             4.6 / 128])
    if len(ply[0]["colour"]) != 4 or not any(
            abs(v) > 0.01 for s in ply for v in flat(s["colour"][1:])):
        complain("no harmonics of degree 1")
    verdict("formats")


TRANSFORM = ("@playcanvas/splat-transform", "2.7.1", (
    "bin/cli.mjs", "package.json", "lib/webp.mjs", "lib/webp.wasm",
    "dist/cli.mjs", "dist/worker.mjs", "dist/spz-BM9WF3Nc.js",
    "dist/spz-Vf7157fI.js"))


def splat_transform(tmp):
    """Returns a function that converts a file with splat-transform, or None
    without npm. An empty module replaces webgpu, which this conversion does
    not use but which must exist."""
    files = npm.fetch(*TRANSFORM) if npm.is_there() else None
    if files is None:
        return None
    files["node_modules/webgpu/index.mjs"] = \
        b"export const create = null, globals = {};"
    files["node_modules/webgpu/package.json"] = \
        b'{"type": "module", "main": "index.mjs"}'
    for name, data in files.items():
        path = os.path.join(tmp, "transform", name)
        os.makedirs(os.path.dirname(path), exist_ok=True)
        write(path, data)
    return lambda a, b: checks.run(
        "node", tmp + "/transform/bin/cli.mjs", "-q", "-w", "-g", "cpu", a, b)


def matched(a, b):
    """Returns some splats of a, and for each of them the splat of b with the
    nearest mean."""
    some = a[::len(a) // 60]
    return some, [min(b, key=lambda t: math.dist(s["mean"], t["mean"]))
                  for s in some]


def read_by_others(ours):
    """Returns the bounds for compare() with what another program reads: half a
    step of the means in metres (the scene is 8 m wide), of rotations,
    logarithms of scales, opacities and colours. docs/results/export.md derives
    the steps; those of SOG's scales divide the range that the file has."""
    scales = [math.log(x) for s in ours for x in s["scale"]]
    spread = max(scales) - min(scales)
    return {
        ".spz": [0.51 / 4096, 0.06, 0.51 / 16, 0.51 / 255, 0.51 / 255 / 0.15,
                 4.6 / 128],
        ".v4.spz": [0.51 / 4096, 0.06, 0.51 / 16, 0.51 / 255, 0.51 / 255 / 0.15,
                    4.6 / 128],
        ".compressed.ply": [4 / 1023, 0.06, 8 / 1023, 0.51 / 255, 0.02,
                            1.01 / 64],
        ".sog": [16 / 65535, 0.3, 0.51 / 255 * spread, 0.51 / 255, 0.02, 0.02]}


def check_programs(tmp):
    """Checks what splat-transform reads from our files."""
    transform = splat_transform(tmp)
    if not transform:
        print("ok   exchange programs (skipped: no npm)")
        return
    ours = splats.read_ply(export(tmp + "/ours.ply"))
    for suffix, bounds in read_by_others(ours).items():
        transform(export(tmp + "/x" + suffix), tmp + "/theirs.ply")
        theirs = splats.read_ply(tmp + "/theirs.ply")
        if len(theirs) != len(ours):
            complain(suffix, "has", len(theirs), "splats, not", len(ours))
        compare(*matched(ours, theirs), suffix, bounds)
    verdict("programs")


def suffixes():
    """Returns the suffixes of the formats in `saga help export`, which the
    README must list, too."""
    rows = re.findall(r"^  (\.\S+) +(.*?): ", saga("help", "export"), re.M)
    page = read("README.md").decode()
    for suffix, name in rows:
        if "| `%s` | %s |" % (suffix, name) not in page:
            complain("README has no row of", suffix, name)
    return [suffix for suffix, name in rows]


def check_outputs(tmp):
    """Checks the names and places of exported files."""
    out, folder = tmp + "/none", tmp + "/ply"
    *splats, page = suffixes()
    known = ", ".join(splats) + ", or %s for a page" % page
    if ".ply, " not in known:
        complain("help tells of the formats", known)
    for options, status, says in (
            ([], 2, "-o OUT is missing"),
            (["-o", out], 2, "use one of " + known),
            (["-o", folder + "/%d.ply"], 2, "exists"),
            (["-o", "%d.ply"], 2, "as in frames/%d.ply"),
            (["-o", out + "/%d/x.ply"], 2, "after the last slash"),
            (["-o", out + "/%d.ply", "--frame", "3"], 2, "for a sequence"),
            (["-o", out + ".ply", "--frames", "3:4"], 2, "does not fit"),
            (["-o", out + "/%d.ply", "--frames", "20:30"], 1,
             "its 24 frames"),
            (["-o", out + ".glb", "--frame", "24"], 1,
             "has no frame 24 among its 24"),
            (["-o", out + ".spz", "--camera", "99"], 1, "has no camera 99"),
            (["-o", tmp + "/no/x.spz"], 2, "cannot be created"),
            (["-o", tmp + "/no/x/%d.ply"], 2, "folder cannot be made")):
        saga("export", DEMO, *options, status=status, says=says)
    saga("export", "Makefile", "-o", out + ".spz", status=1, says="Makefile")
    for suffix in suffixes():
        os.symlink("/dev/full", tmp + "/full" + suffix)
        saga("export", DEMO, "-o", tmp + "/full" + suffix, status=2,
             says="check the free space")
    if [n for n in os.listdir(tmp) if n.startswith("none")]:
        complain("something was written though it was refused")
    verdict("outputs")


# --- Splats of others ------------------------------------------------------

COLUMNS = ["x", "y", "z", "f_dc_0", "f_dc_1", "f_dc_2", "opacity", "scale_0",
           "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3"]


def ball(n, shift=0.0):
    """Returns rows of splats on a sphere, whose colours depend on the place."""
    rows = []
    for i in range(n):
        z = (2 * i + 1) / n - 1
        r, angle = math.sqrt(1 - z * z), 2.399963 * i
        place = [r * math.cos(angle), r * math.sin(angle), z]
        colour = [1.5 * v for v in place]
        rows.append([7 * v + shift for v in place] + colour +
                    [2.0, -0.3, -0.6, -0.9, 1.0, 0.2 * z, -0.1, 0.3])
    return rows


MOTION = ["time", "log_duration"] + ["velocity_%d" % k for k in range(3)]


def ply(rows, names=COLUMNS, notes=()):
    head = "ply\nformat binary_little_endian 1.0\n"
    head += "".join("comment %s\n" % note for note in notes)
    head += "element vertex %d\n" % len(rows)
    head += "".join("property float %s\n" % name for name in names)
    return (head + "end_header\n").encode() + \
        b"".join(struct.pack("<%df" % len(row), *row) for row in rows)


def check_import(tmp):
    # An opacity of infinity is opaque; faint splats and those without a place
    # must be left out.
    rows = ball(152)
    rows[7][6], rows[8][6], rows[9][7] = math.inf, -7.0, math.nan
    still, out = write(tmp + "/ball.ply", ply(rows)), tmp + "/ball.saga"
    saga("import", still, "-o", out, "--size", "48x48",
         "--iterations", "700", "--lambda", "1")
    info = json.loads(saga("info", out, "--json"))
    if info["n_frames"] != 1 or len(info["rig"]) != 24 or \
            info["decoding"]["max_primitives"] != 150:
        complain("the still has", info["n_frames"], "frames",
                 len(info["rig"]), "cameras", info["decoding"])
    for index in (2, 20):
        saga("render", out, "--camera", index, "-o", tmp + "/ball.png")
        subprocess.run(["ffmpeg", "-v", "error", "-y", "-i", tmp + "/ball.png",
                        tmp + "/ball.ppm"], check=True)
        pixels = re.sub(rb"^P6\n\d+ \d+\n255\n", b"",
                        read(tmp + "/ball.ppm"), count=1)
        sound = [s for i, s in enumerate(splats.read_ply(still))
                 if i not in (8, 9)]
        picture = splats.draw(sound, info["rig"][index], [0, 0, 0])
        got = splats.psnr(picture, pixels)
        print("     imported, camera %d: %.1f dB" % (index, got))
        if not got > 33:
            complain("camera", index, "draws the import at", got, "dB")
    saga("export", DEMO, "-o", tmp + "/seq/%d.spz", "--frames", "8:11")
    saga("import", tmp + "/seq", "-o", out, "--primitives", "60", "--fps",
         "12", "--iterations", "60", "--cameras", out)
    info = json.loads(saga("info", out, "--json"))
    if info["n_frames"] != 3 or info["frames_per_second"] != [12, 1]:
        complain("the sequence has", info["n_frames"], "frames at",
                 info["frames_per_second"])
    check_import_moving(tmp)
    check_import_refused(tmp)


def check_import_moving(tmp):
    out, rows = tmp + "/moves.saga", ball(40)
    moves = write(tmp + "/moves.ftgs.ply", ply(
        [row + [i % 5 / 4, 0.5, 0.5, -1, i % 3] for i, row in enumerate(rows)],
        COLUMNS + MOTION,
        ["ftgs_version 1", "time_units normalized", "n_frames 3"]))
    saga("import", moves, "-o", out, "--size", "32x32", "--primitives", "40",
         "--iterations", "20", "--fps", "12")
    info = json.loads(saga("info", out, "--json"))
    if info["n_frames"] != 3 or info["frames_per_second"] != [12, 1]:
        complain("moving splats give", info["n_frames"], "frames at",
                 info["frames_per_second"])
    os.mkdir(tmp + "/moves")
    for f in range(2):
        shutil.copy(moves, tmp + "/moves/%d.ply" % f)
    saga("import", tmp + "/moves", "-o", out, "--size", "32x32", status=1,
         says="has splats that move, in a folder of frames")
    # Also if only the first one moves.
    write(tmp + "/moves/1.ply", ply(rows))
    saga("import", tmp + "/moves", "-o", out, "--size", "32x32", status=1,
         says="/0.ply: has splats that move, in a folder of frames")
    fades = write(tmp + "/fades.ftgs.ply", ply(
        [row + [0, -4, 0, 0, 0] for row in rows], COLUMNS + MOTION,
        ["ftgs_version 1", "time_units normalized", "n_frames 3"]))
    saga("import", fades, "-o", out, "--size", "32x32", status=1,
         says="has no visible splat at frame 1 of 3")


def check_import_refused(tmp):
    rows, out = ball(5), tmp + "/refused.saga"
    for data, says in (
            (b"no", "is not in a known splat format"),
            (ply(rows)[:-3], "announces 5 points"),
            (ply([]), "has no splats"),
            (ply(rows, ["q"] + COLUMNS[1:]), "have no x"),
            (ply([r + [0.0] * 5 for r in rows],
                 COLUMNS + ["f_rest_%d" % k for k in range(5)]),
             "5 values of f_rest"),
            (ply([r + [0.0] * 5 for r in rows], COLUMNS + MOTION),
             "so that their unit of time is unknown; export every frame as a "
             "PLY of its own"),
            (ply([r + [0.0] * 5 for r in rows], COLUMNS + MOTION,
                 ["time_units normalized"]),
             "not the number of frames, 1 to 65535; write \"comment n_frames "
             "N\" into its header"),
            (ply([r + [0.0] for r in rows], COLUMNS + ["velocity_0"]),
             "has splats that move, but no time"),
            (ply([[math.inf] + r[1:] for r in rows]),
             "has no splat to show: leaves out 5 of 5 splats: 5 with numbers "
             "that are not finite")):
        bad = write(tmp + "/bad.ply", data)
        saga("import", bad, "-o", out, status=1, says=says)
    good = write(tmp + "/good.ply", ply(rows))
    saga("import", good, "-o", out, "--cameras", good, status=1,
         says="its header is refused")
    saga("import", tmp + "/none", "-o", out, status=2,
         says="cannot be opened")
    saga("import", good, status=2, says="-o OUT is missing")
    # The first frame is that with the smallest number.
    os.mkdir(tmp + "/unpadded")
    for k in 2, 10:
        write(tmp + "/unpadded/f%d.PLY" % k, b"no")
    write(tmp + "/unpadded/._f1.PLY", b"no")
    saga("import", tmp + "/unpadded", "-o", out, status=1, says="/f2.PLY: ")
    os.mkdir(tmp + "/empty")
    saga("import", tmp + "/empty", "-o", out, status=1,
         says="has no file of splats")
    write(tmp + "/empty/0.ply", b"")
    write(tmp + "/empty/1.spz", b"")
    saga("import", tmp + "/empty", "-o", out, status=1,
         says="has files of different formats")
    if [n for n in os.listdir(tmp) if n.startswith("refused")]:
        complain("something was written though it was refused")
    verdict("import")


FOUND = "../shared/data/found/"
SAMPLES = (("glb_log_scale/in.glb", "read as logarithms"),
           ("ply_activated/in.ply", "read as lengths"),
           ("ply_coincident/in.ply", ""),
           ("ply_nan_first_row/in.ply", "leaves out 1 of 400 splats"),
           ("sog_null_codebook/meta.json", "lacks its first number"),
           ("spz_late_axis_extension/in.spz", ""))


def check_meant(tmp):
    out = tmp + "/meant.saga"
    few = ["-o", out, "--size", "16x16", "--iterations", "2"]
    nan = float("nan")

    def told(rows, says, *options, status=0):
        saga("import", write(tmp + "/meant.ply", ply(rows)), *few, *options,
             status=status, says=says)

    rows = ball(60)
    told([[0.0] * 14, [nan] * 14] + rows, "leaves out 2 of 62 splats: 1 with "
         "numbers that are not finite or above a million, 1 that are rows of "
         "zeros\n")
    told([r[:6] + [1 / (1 + math.exp(-k / 9 + 3))] +
          [math.exp(x) for x in r[7:10]] + r[10:]
          for k, r in enumerate(rows)],
         "scales are read as lengths; by their size they are no logarithms "
         "(1 file)\n")
    told(rows, "leaves out 20 of 60 splats: 20 that are less visible",
         "--primitives", "40")
    # More splats lie at one point than a cell has room for.
    told([[1.0, 2.0, 3.0] + r[3:] for r in rows] + rows, "")
    told([[9e5] * 3 + rows[0][3:]] + rows, "positions outside the scene's cube "
         "are moved to its faces (1 splat)\n")
    # Level 0 has room for 1,024 primitives, and fewer if its memory says so.
    told(ball(1100), "has 1100 splats, level 0 has room for ", "--level", "0",
         status=1)
    # What many splats take is known when they are read.
    whole = ply(ball(800))
    end = whole.index(b"end_header\n") + 11
    write(tmp + "/many.ply", whole[:end].replace(
        b"vertex 800\n", b"vertex 80000\n") + 100 * whole[end:])
    saga("import", tmp + "/many.ply", *few, "--level", "3", "--memory", "1",
         status=1, says="GiB to train with 80000 splats; --memory allows 1; "
         "give --memory 2")
    # In units of which a splat has more than 379, SPZ has no such scales.
    told([[1e3 * x for x in r[:3]] + r[3:7] + [x + 7 for x in r[7:10]] + r[10:]
          for r in rows], "")
    saga("export", out, "-o", tmp + "/large.spz", "--sh", "0", says="scales "
         "beyond the 4.54e-05 to 379 units of SPZ, and are clamped")
    for name, says in SAMPLES:
        if os.path.exists(FOUND + name):
            saga("import", FOUND + name, *few, says=says)
        else:
            print("     skipped: no", FOUND + name)
    verdict("meant")


def check_layers(tmp):
    """Checks three layers in a segment, cut by `saga cut` and by the end of the
    file."""
    whole, out = "vectors/good/layers_level0.saga", tmp + "/layers.saga"
    told = json.loads(saga("info", whole, "--json"))
    layers = told["segments"][0]["layers"]
    if told["decoding"]["n_layers"] != 3 or len(layers) != 3 or sum(
            layer["n_primitives"] for layer in layers) != \
            told["segments"][0]["n_primitives"]:
        complain("info does not tell the layers of", whole)
    table = re.findall(r"^ +\d+ +(\d+) +\d+ +\d+ +\d+ +(\d+) bytes$",
                       saga("info", whole), re.M)
    for k in range(3):
        saga("cut", whole, ":", "--layers", k + 1, "-o", out)
        if [int(n) for n in table[k]] != \
                [layers[k]["nbytes"], len(read(out))]:
            complain("info tells", table[k], "of layer", k + 1)
        if read(out) != signed(read(out)):
            complain(k + 1, "layers have not the checksums of the documents")
        cut = whole if k == 2 else "vectors/cut/layers_%d.saga" % (k + 1)
        same_pictures(out, 0, cut, 0, 2)
    if read(out) != read(whole):
        complain("all layers of a file are not the file")
    saga("cut", SCENE, ":", "--layers", 2, "-o", out, status=1,
         says="its layers: 1; asked for: 2")
    saga("join", tmp + "/part0.saga", whole, "-o", out, status=1,
         says="its ")
    saga("info", "vectors/cut/layers_1.saga", status=1, says="the file ends")
    verdict("layers")


with tempfile.TemporaryDirectory() as folder:
    check_draw(folder)
    check_formats(folder)
    check_moving(folder)
    check_programs(folder)
    check_outputs(folder)
    check_import(folder)
    check_meant(folder)
    check_refused(folder, check_cut(folder)[0])
    check_join(folder, [folder + "/part%d.saga" % i for i in range(3)])
    check_base(folder)
    check_layers(folder)
    check_sound(folder)
sys.exit(checks.failed)
