#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""check_path.py: guarantees, for the cameras of `saga render` that are not in
the file,
  keys        for a path of key cameras, the pixels are those of saga-dec for
              the camera and time computed here, at the keys and between them
  nerfstudio  so are those for nerfstudio's camera path, with its axes and its
              render_time
  colmap      so are those for COLMAP's images, as text and binary, each with
              its lens and size, in the order of the names; a rig that was
              written as COLMAP files gives the pixels of --camera
  look-at     so are those for --look-at, with and without --eye
  loop        a .gif or .webp of a film with sound has the pictures of an .mp4,
              and begins anew at its end
  film        an .mp4 has the right pictures, number of pictures and rate; if
              ffmpeg fails or is missing, no file remains
  full        if the disk is full at any moment of a film, an export or a mux,
              the status is not 0, and there are the files of before
  bad         invalid paths give a message of one line"""

import functools
import json
import math
import os
import re
import struct
import subprocess
import sys
import tempfile

from verdict import SAGA, SAGA_DEC, Verdicts, pixels, read

SCENE = "vectors/good/motion.saga"
# Values of the vector's header, as tests/support/gen_stream.c writes it.
UNIT = 2.0 ** -22
NEAR = 1 << 18
BACKGROUND = [3000, 4000, 8000]

checks = Verdicts("path")
complain, verdict = checks.complain, checks.verdict


def info():
    return json.loads(checks.run(SAGA, "info", SCENE, "--json"))


N_FRAMES = info()["n_frames"]


# --- The same cameras, computed here ---------------------------------------

def sub(a, b):
    return [x - y for x, y in zip(a, b)]


def cross(a, b):
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2],
            a[0] * b[1] - a[1] * b[0]]


def unit(a):
    n = math.sqrt(sum(x * x for x in a))
    return [x / n for x in a]


def looking(eye, target, up):
    forward = unit(sub(target, eye))
    right = unit(cross(forward, up))
    return right + cross(forward, right) + forward


def camera(rotation, eye, fov, width, height):
    """Returns the camera's 22 integers."""
    focal = height / 2 / math.tan(math.radians(fov) / 2)
    return [round(r * 2 ** 30) for r in rotation] + \
        [round(x / UNIT) for x in eye] + 2 * [round(focal * 65536)] + \
        [width * 32768, height * 32768, NEAR, width, height] + BACKGROUND


def mix(a, b, x):
    if isinstance(a, list):
        return [mix(p, q, x) for p, q in zip(a, b)]
    return a + (b - a) * x


def pixels_of(tmp, values, frame):
    name, out = tmp + "/camera.txt", tmp + "/want.ppm"
    with open(name, "w") as f:
        f.write(" ".join(map(str, values)))
    subprocess.run([SAGA_DEC, SCENE, "--camera", name, "--time", "%d/65536" %
                    round(frame * 65536), "-o", out], check=True)
    with open(out, "rb") as f:
        return re.sub(rb"^P6\n\d+ \d+\n255\n", b"", f.read(), count=1)


# --- Running ---------------------------------------------------------------

render = functools.partial(checks.run, SAGA, "render", SCENE)


def write(tmp, what):
    name = tmp + "/path.json"
    with open(name, "w") as f:
        f.write(what if isinstance(what, str) else json.dumps(what))
    return name


def same(tmp, name, values, frame):
    if not os.path.exists(name):
        complain(name, "is not there")
    elif pixels(name) != pixels_of(tmp, values, frame):
        complain(name, "has other pixels than saga-dec's")


KEYS = [
    {"seconds": 0, "frame": 0, "eye": [-1.5, 1.3, -4.8],
     "target": [0, 0, 0], "up": [0, -1, 0], "fov": 50},
    {"seconds": 2, "frame": 10, "eye": [1.5, 1.0, -4.0],
     "target": [0.25, 0.5, 0.25], "up": [0.25, -1, 0], "fov": 60},
    {"seconds": 3, "frame": 400, "eye": [1.5, -1.0, -4.0],
     "target": [0, 0.5, 0], "up": [0, -1, 0], "fov": 40},
]


def key_camera(key, width, height):
    return camera(looking(key["eye"], key["target"], key["up"]), key["eye"],
                  key["fov"], width, height)


def between(a, b, x):
    return {name: mix(a[name], b[name], x) for name in a}


def check_keys(tmp):
    """Checks paths of two keys, which must be straight, and of three keys,
    which must pass through all of them."""
    path = {"format": "saga camera path 1", "fps": 2, "size": [96, 60],
            "keys": [KEYS[1], KEYS[0]]}
    render("-o", tmp + "/two%d.png", "--path", write(tmp, path))
    for i in range(5):
        key = between(KEYS[0], KEYS[1], i / 4)
        same(tmp, tmp + "/two%d.png" % i, key_camera(key, 96, 60),
             key["frame"])
    path["keys"] = KEYS
    render("-o", tmp + "/three%d.png", "--path", write(tmp, path))
    for i, key, frame in ((0, KEYS[0], 0), (4, KEYS[1], 10),
                          (6, KEYS[2], N_FRAMES - 1)):
        same(tmp, tmp + "/three%d.png" % i, key_camera(key, 96, 60), frame)
    if os.path.exists(tmp + "/three7.png"):
        complain("three seconds at 2 a second are not 7 pictures")
    # A frame given as an option must stay fixed along the path. A single key
    # must give one picture.
    path["keys"] = KEYS[1:2]
    render("-o", tmp + "/one.png", "--path", write(tmp, path), "--frame", "3")
    same(tmp, tmp + "/one.png", key_camera(KEYS[1], 96, 60), 3)
    verdict("keys")


def check_nerfstudio(tmp):
    poses = []
    for key, share in ((KEYS[0], 0.0), (KEYS[1], 1.0)):
        rows = looking(key["eye"], key["target"], key["up"])
        axes = (rows[0:3], [-x for x in rows[3:6]], [-x for x in rows[6:9]])
        matrix = [x for i in range(3) for x in
                  [axes[0][i], axes[1][i], axes[2][i], key["eye"][i]]]
        poses.append({"camera_to_world": matrix + [0, 0, 0, 1],
                      "fov": key["fov"], "aspect": 1.6, "render_time": share})
    path = {"camera_type": "perspective", "render_width": 96,
            "render_height": 60, "fps": 24, "seconds": 1,
            "camera_path": poses}
    render("-o", tmp + "/nerf%d.png", "--path", write(tmp, path))
    same(tmp, tmp + "/nerf0.png", key_camera(KEYS[0], 96, 60), 0)
    same(tmp, tmp + "/nerf1.png", key_camera(KEYS[1], 96, 60), N_FRAMES - 1)
    path["camera_type"] = "equirectangular"
    render("-o", tmp + "/x%d.png", "--path", write(tmp, path), status=2,
           says='"camera_type" is not "perspective"')
    verdict("nerfstudio")


# Each row has name, size, fx fy cx cy, quaternion w x y z, centre. The ids are
# not in the order of names.
IMAGES = [
    ("a 10.jpg", (80, 50), (70.5, 71.25, 41.5, 24.75), (30, 1, -2, 1),
     (0.5, 0.25, -3)),
    ("a 2.jpg", (96, 60), (80, 80, 48, 30), (9, 2, 2, 4), (1.5, -0.5, -4)),
    ("c.jpg", (96, 60), (80, 80, 48, 30), (5, 0, -1, 0), (-1, 0, -4)),
]


def turned(q):
    """Returns the rows of world to camera for a quaternion w, x, y, z of any
    length."""
    w, x, y, z = (v / math.sqrt(sum(a * a for a in q)) for v in q)
    return [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y),
            2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x),
            2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]


def quaternion(r):
    """Returns the quaternion w, x, y, z of a matrix that turns by less than
    half a turn."""
    w = math.sqrt(1 + r[0] + r[4] + r[8]) / 2
    return (w, (r[7] - r[5]) / 4 / w, (r[2] - r[6]) / 4 / w,
            (r[3] - r[1]) / 4 / w)


def moved(rotation, centre):
    return [-sum(rotation[3 * i + k] * centre[k] for k in range(3))
            for i in range(3)]


def write_text(folder, images, model="PINHOLE", more=""):
    os.makedirs(folder, exist_ok=True)
    with open(folder + "/cameras.txt", "w") as f:
        f.write("# comment\n")
        for i, (_, size, lens, *_) in enumerate(images):
            f.write("%d %s %d %d %s%s\n" % (i + 5, model, *size, " ".join(
                map(repr, lens)), more))
    with open(folder + "/images.txt", "w") as f:
        for i, (name, _, _, q, centre) in enumerate(images):
            numbers = [*q, *moved(turned(q), centre)]
            f.write("%d %s %d %s\n1.5 2.5 -1\n" % (
                i + 1, " ".join(map(repr, numbers)), i + 5, name))
    return folder + "/images.txt"


def write_binary(folder, images):
    os.makedirs(folder)
    with open(folder + "/cameras.bin", "wb") as f:
        f.write(struct.pack("<Q", len(images)))
        for i, (_, size, lens, *_) in enumerate(images):
            f.write(struct.pack("<IIQQ4d", i + 5, 1, *size, *lens))
    with open(folder + "/images.bin", "wb") as f:
        f.write(struct.pack("<Q", len(images)))
        for i, (name, _, _, q, centre) in enumerate(images):
            f.write(struct.pack("<I7dI", i + 1, *q,
                                *moved(turned(q), centre), i + 5))
            f.write(name.encode() + bytes(1) + struct.pack("<Q", 0))
    return folder + "/images.bin"


def colmap_camera(image):
    _, size, lens, q, centre = image
    return [round(r * 2 ** 30) for r in turned(q)] + \
        [round(x / UNIT) for x in centre] + [round(65536 * x) for x in lens] + \
        [NEAR, *size] + BACKGROUND


def check_colmap(tmp):
    # Names count as numbers where they are: 2 comes before 10.
    ordered = [IMAGES[1], IMAGES[0], IMAGES[2]]
    for name in (write_text(tmp + "/text", IMAGES),
                 write_binary(tmp + "/binary", IMAGES)):
        render("-o", tmp + "/colmap%d.png", "--path", name)
        for i, image in enumerate(ordered):
            same(tmp, tmp + "/colmap%d.png" % i, colmap_camera(image),
                 i * N_FRAMES / 3)
            os.remove(tmp + "/colmap%d.png" % i)
    # At another size, everything that was visible must stay visible.
    render("-o", tmp + "/half%d.png", "--path", tmp + "/text/images.txt",
           "--size", "48x40", "--frame", "5")
    name, _, lens, *pose = ordered[0]
    same(tmp, tmp + "/half0.png",
         colmap_camera((name, (48, 40), (40, 40, 24, 20), *pose)), 5)
    # All pictures of a film must have the size of the first one.
    film = tmp + "/colmap.mp4"
    render("-o", film, "--path", tmp + "/text/images.txt")
    if len(pixels(film)) != 3 * 3 * 96 * 60:
        complain("a film of COLMAP's images has", len(pixels(film)), "bytes")
    check_colmap_rig(tmp)
    check_bad_colmap(tmp)
    verdict("colmap")


def check_colmap_rig(tmp):
    """Checks the file's own rig, written for COLMAP. Rotations are restored
    within the last bits, which changes a pixel by at most one."""
    rig = info()["rig"]
    images = [("%d.png" % i, (c["width"], c["height"]),
               (*c["focal"], *c["principal"]), quaternion(c["rotation"]),
               c["centre_metres"]) for i, c in enumerate(rig)]
    render("-o", tmp + "/rig%d.png", "--frame", "2", "--path",
           write_text(tmp + "/rig", images))
    for i in range(len(rig)):
        render("-o", tmp + "/own.png", "--camera", str(i), "--frame", "2")
        got, want = (pixels(tmp + "/%s.png" % n) for n in ("rig%d" % i, "own"))
        off = max(abs(a - b) for a, b in zip(got, want))
        if len(got) != len(want) or off > 1:
            complain("the rig's camera", i, "is off by", off)


def check_bad_colmap(tmp):
    def refused(says, name=tmp + "/bad/images.txt"):
        render("-o", tmp + "/x%d.png", "--path", name, status=2, says=says)

    write_text(tmp + "/bad", IMAGES, model="FOV", more=" 0.5")
    refused("camera model FOV is not supported")
    write_text(tmp + "/bad", IMAGES[:1])
    with open(tmp + "/bad/images.txt", "a") as f:
        f.write("9 1 0 0 0 0 0 0 77 z.png\n\n")
    refused("image z.png names camera 77, which is missing")
    write_text(tmp + "/bad", [])
    refused("the model has 0 images")
    os.remove(tmp + "/bad/cameras.txt")
    refused("cameras.txt: cannot be opened")
    write_text(tmp + "/bad", [(*IMAGES[0][:2], (0, 70, 40, 25),
                               *IMAGES[0][3:])])
    refused("intrinsics are not usable")


def check_look_at(tmp):
    rig = info()["rig"]
    # The cameras of the rig are level, so that the up direction is -y.
    fov = math.degrees(2 * math.atan(60 / rig[2]["focal"][1]))
    eye = [round(x / UNIT) * UNIT for x in rig[2]["centre_metres"]]
    render("-o", tmp + "/at.png", "--camera", "2", "--look-at", "0.5,0,-0.5")
    render("-o", tmp + "/from.png", "--eye=-1,0.5,-4", "--look-at=0.5,0,-.5")
    for name, place in (("at", eye), ("from", [-1, 0.5, -4])):
        values = camera(looking(place, [0.5, 0, -0.5], [0, -1, 0]), place,
                        fov, 160, 120)
        want = pixels_of(tmp, values, 0)
        got = pixels(tmp + "/%s.png" % name)
        # The up direction is found from the rig by iteration, so that samples
        # may differ by one.
        off = max(abs(a - b) for a, b in zip(got, want))
        if len(got) != len(want) or off > 1:
            complain("--look-at,", name + ": pixels are off by", off)
    render("-o", tmp + "/x.png", "--eye", "1,2,3", status=2,
           says="--eye needs --look-at")
    render("-o", tmp + "/x.png", "--look-at", "1,2", status=2,
           says="--look-at takes X,Y,Z")
    render("-o", tmp + "/x%d.png", "--look-at", "1,2,3", "--orbit", "3",
           status=2, says="--look-at works only with")
    render("-o", tmp + "/x.png", "--look-at", "1,2,3", "--eye", "1,2,3",
           status=1, says="give another point")
    verdict("look-at")


def check_film(tmp):
    path = write(tmp, {"format": "saga camera path 1", "fps": 6,
                       "size": [95, 61], "keys": KEYS[:2]})
    film = tmp + "/film.mp4"
    render("-o", film, "--path", path)
    told = subprocess.run(
        ["ffprobe", "-v", "error", "-count_frames", "-show_entries",
         "stream=codec_name,width,height,r_frame_rate,nb_read_frames,"
         "color_space", "-of", "csv=p=0", film], check=True,
        stdout=subprocess.PIPE).stdout.decode().strip()
    if told != "h264,96,62,bt709,6/1,13":
        complain("the film is", told)
    got = pixels(film)[:3 * 96 * 62]
    want = pixels_of(tmp, key_camera(KEYS[0], 95, 61), 0)
    pairs = [(got[y * 288 + x], want[y * 285 + x]) for y in range(61)
             for x in range(285)]
    error = sum((a - b) ** 2 for a, b in pairs) / len(pairs)
    # The tolerance is large, because chroma has half the size and the picture
    # has small blots with steep edges.
    if error > 400:
        complain("the film's first picture has a squared error of", error)
    before = sorted(os.listdir(tmp))
    render("-o", tmp + "/lost.mp4", "--orbit", "3", status=2,
           says="install ffmpeg", env={**os.environ, "PATH": tmp})
    fake = tmp + "/ffmpeg"
    with open(fake, "w") as f:
        f.write("#!/bin/sh\necho it is broken >&2\nexit 1\n")
    os.chmod(fake, 0o755)
    render("-o", tmp + "/lost.mp4", "--orbit", "3", status=2,
           says="it is broken", env={**os.environ, "PATH": tmp + ":/bin"})
    os.remove(fake)
    if sorted(os.listdir(tmp)) != before:
        complain("left behind:", set(os.listdir(tmp)) - set(before))
    verdict("film")


def check_loop(tmp):
    """A GIF's first picture is compared with the decoder's: 256 colours leave
    less than 12 levels RMS. Marks that a film begins anew: GIF's Netscape block
    with 0, WebP's chunk ANIM with 0."""
    sound, heard = tmp + "/loop.opus", tmp + "/loop.saga"
    subprocess.run(["ffmpeg", "-v", "error", "-f", "lavfi", "-i", "sine=d=1",
                    "-c:a", "libopus", sound], check=True)
    checks.run(SAGA, "mux", SCENE, "--audio", sound, "-o", heard)
    four = ("render", heard, "--camera", 0, "--frames", "0:4", "--size",
            "64x36", "-o")
    checks.run(SAGA, *four, tmp + "/loop_%d.png")
    checks.run(SAGA, *four, tmp + "/loop.gif")
    checks.run(SAGA, *four, tmp + "/loop.webp")
    gif, webp = read(tmp + "/loop.gif"), read(tmp + "/loop.webp")
    got, want = pixels(tmp + "/loop.gif"), pixels(tmp + "/loop_0.png")
    at = webp.find(b"ANIM")
    if b"NETSCAPE2.0\x03\x01\0\0" not in gif or at < 0 or \
            webp[at + 12:at + 14] != b"\0\0":
        complain("a GIF or WebP does not begin anew")
    if len(got) != 4 * len(want) or webp.count(b"ANMF") != 4:
        complain("a GIF has", len(got), "bytes, a WebP", webp.count(b"ANMF"),
                 "pictures")
    error = sum((a - b) ** 2 for a, b in zip(got, want)) / len(want)
    if error > 144:
        complain("the GIF's first picture has a squared error of", error)
    verdict("loop")


def check_full(tmp):
    """A film of 40 kB is more than ffmpeg holds back: the disk is full in the
    middle of it, or for the last byte, which is written when the index is moved
    to the front."""
    sound, out = tmp + "/take.opus", tmp + "/out"
    subprocess.run(["ffmpeg", "-v", "error", "-f", "lavfi", "-i", "sine=d=1",
                    "-c:a", "libopus", sound], check=True)
    for ending, words in (
            (".mp4", ("render", SCENE, "--orbit", 8, "--size", "320x240")),
            (".ply", ("export", SCENE, "--frame", 0)),
            (".saga", ("mux", SCENE, "--audio", sound))):
        checks.run(SAGA, *words, "-o", out + ending)
        size = os.path.getsize(out + ending)
        with open(out + ending, "wb") as f:
            f.write(b"old")
        before = sorted(os.listdir(tmp))
        n = 16 if "SAGA_TEST_LONG" in os.environ else 1
        for limit in [0, *(size * (2 * i + 1) // (2 * n) for i in range(n)),
                      size - 1]:
            checks.run(SAGA, *words, "-o", out + ending, status=2,
                       says="free space", disk=limit)
            if read(out + ending) != b"old":
                complain(ending, "with", limit, "bytes left is replaced")
            if sorted(os.listdir(tmp)) != before:
                complain(ending, "with", limit, "bytes left leaves",
                         set(os.listdir(tmp)) - set(before))
        checks.run(SAGA, *words, "-o", out + ending, disk=size)
        if os.path.getsize(out + ending) != size:
            complain(ending, "is cut by a disk that it fits in")
    verdict("full")


def check_bad(tmp):
    def refused(what, says):
        render("-o", tmp + "/x%d.png", "--path", write(tmp, what), status=2,
               says=says)

    key = KEYS[0]
    form = "saga camera path 1"
    refused("{", "is not valid JSON")
    refused([], "is not an object")
    refused({"format": "saga camera path 9", "keys": KEYS}, "is not a camera")
    refused({"format": form, "keys": []}, '0 "keys"')
    refused({"format": form, "keys": [key, {**key, "eye": [1, 2]}]},
            'camera 2 of the path has no valid "eye"')
    refused({"format": form, "keys": [{**key, "fov": 180}]}, '"fov"')
    refused({"format": form, "keys": [{**key, "eye": [0, 0, 0]}]},
            "has no direction")
    refused({"format": form, "size": [0, 5], "keys": KEYS}, "path.json")
    refused({"format": form, "fps": -1, "keys": KEYS}, '"fps"')
    refused({"format": form, "keys": [key, {**key, "seconds": 1e9}]},
            "pictures")
    refused({"camera_path": [{"camera_to_world": [0] * 16, "fov": 40}]},
            "camera_to_world")
    refused({"camera_path": []}, "pictures")
    render("-o", tmp + "/x%d.png", "--path", tmp + "/none.json", status=2,
           says="none.json: cannot be opened")
    render("-o", tmp + "/x%d.png", "--path", write(tmp, {}), "--orbit", "3",
           status=2, says="exclude each other")
    if [n for n in os.listdir(tmp) if n.startswith("x")]:
        complain("pictures of refused paths")
    verdict("bad")


def main():
    with tempfile.TemporaryDirectory() as tmp:
        check_keys(tmp)
        check_nerfstudio(tmp)
        check_colmap(tmp)
        check_look_at(tmp)
        check_film(tmp)
        check_loop(tmp)
        check_full(tmp)
        check_bad(tmp)
    return 1 if checks.failed else 0


sys.exit(main())
