#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Plants faults of calibration in good captures, one at a time, and prints what
`saga check` says of each, as tables for docs/results/calibration.md.

  faults.py WORK [CAPTURE ...]

The captures, all without points, are "studio 14", "studio 4", "room 10" and
"room 4". Studio is ../shared/data/studio, the room is made by `saga synth`.
Pictures are written to WORK. A fault is

  named    if a note says what is wrong, and with which cameras
  seen     if other notes warn of something that the good capture has not
  missed   if there is no such note

Environment, with defaults: SAGA (build/saga), THREADS (1), FAULTS (a regular
expression; faults whose name it matches are planted; all), VERBOSE (if set, the
notes are printed, too)."""
import copy
import glob
import json
import math
import os
import re
import struct
import subprocess
import sys

ROOT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
SAGA = os.environ.get("SAGA", os.path.join(ROOT, "build/saga"))
STUDIO = os.path.join(ROOT, "../shared/data/studio")
THREADS = os.environ.get("THREADS", "1")
FAULTS = os.environ.get("FAULTS", "")
CAPTURES = {"studio 14": None, "studio 4": (1, 3, 5, 7),
            "room 10": None, "room 4": (0, 3, 6, 9)}


# --- Matrices: a camera has `a`, camera to world in OpenCV's axes, its centre
# `b`, its lens (f, cx, cy) and a list of pictures.

def transposed(a):
    return [list(column) for column in zip(*a)]


def times(a, b):
    return [[sum(x * y for x, y in zip(row, column)) for column in zip(*b)]
            for row in a]


def apply(a, x):
    return [sum(p * q for p, q in zip(row, x)) for row in a]


def rotation(axis, degrees):
    """Returns the matrix that turns about an axis of the camera."""
    c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    i, j = (axis + 1) % 3, (axis + 2) % 3
    m = [[float(p == q) for q in range(3)] for p in range(3)]
    m[i][i] = m[j][j] = c
    m[i][j], m[j][i] = -s, s
    return m


# --- Captures -----------------------------------------------------------------

def frames_of(video, folder):
    """Returns the pictures of a video."""
    if not os.path.isdir(folder):
        os.makedirs(folder)
        subprocess.run(["ffmpeg", "-v", "error", "-nostdin", "-i", video,
                        folder + "/%05d.png"], check=True)
    return sorted(glob.glob(folder + "/*.png"))


def numbers_of(path):
    """Returns the rows of a table of numbers in NumPy's format."""
    with open(path, "rb") as f:
        data = f.read()
    begin = 10 + struct.unpack("<H", data[8:10])[0]
    values = struct.unpack("<%dd" % ((len(data) - begin) // 8), data[begin:])
    return [values[i:i + 17] for i in range(0, len(values), 17)]


def studio(work):
    cameras = []
    for v, row in enumerate(numbers_of(STUDIO + "/poses_bounds.npy")):
        # The columns are down, right, backwards, the centre, and (H, W, f).
        m = [row[5 * i:5 * i + 5] for i in range(3)]
        name = "cam%02d" % v
        cameras.append({
            "a": [[r[1], r[0], -r[2]] for r in m], "b": [r[3] for r in m],
            "f": m[2][4], "cx": m[1][4] / 2, "cy": m[0][4] / 2, "name": name,
            "files": frames_of("%s/%s.mp4" % (STUDIO, name),
                               "%s/studio/%s" % (work, name))})
    return cameras


def room(work):
    folder = work + "/room"
    if not os.path.isdir(folder):
        subprocess.run([SAGA, "synth", folder], check=True,
                       stdout=subprocess.DEVNULL)
    with open(folder + "/transforms.json") as f:
        told = json.load(f)
    cameras = {}
    for e in told["frames"]:
        name = os.path.basename(os.path.dirname(e["file_path"]))
        m = e["transform_matrix"]
        lens = {k: e.get(k, told.get(k)) for k in ("fl_x", "cx", "cy")}
        cameras.setdefault(name, {
            "a": [[r[0], -r[1], -r[2]] for r in m[:3]], "b": [r[3] for r in
                                                              m[:3]],
            "f": lens["fl_x"], "cx": lens["cx"], "cy": lens["cy"],
            "name": name, "files": []})["files"].append(
                os.path.join(folder, e["file_path"]))
    for camera in cameras.values():
        camera["files"].sort()
    return [cameras[name] for name in sorted(cameras)]


def write(cameras, path, moving):
    """Writes a transforms.json as nerfstudio has it: camera to world, in
    OpenGL's axes, unless a fault gave the camera a matrix of its own. If not
    `moving`, only the first frame is used, which saves time."""
    n = min(len(c["files"]) for c in cameras) if moving else 1
    frames = []
    for c in cameras:
        m = c.get("matrix") or [[r[0], -r[1], -r[2], b]
                                for r, b in zip(c["a"], c["b"])]
        for k in range(n):
            frames.append({
                "file_path": c["files"][k], "time": k / 30, "fl_x": c["f"],
                "fl_y": c["f"], "cx": c["cx"], "cy": c["cy"],
                "transform_matrix": m + [[0, 0, 0, 1]]})
    with open(path, "w") as f:
        json.dump({"fps": 30, "frames": frames}, f)


# --- Faults: functions that change a list of cameras; the pattern is what a note
# must say, in which {i} is the name of camera i.

def matrices(form, opencv):
    def plant(cameras):
        for c in cameras:
            a = c["a"] if opencv else [[r[0], -r[1], -r[2]] for r in c["a"]]
            to = transposed(a)
            t = [-x for x in apply(to, c["b"])]
            a = to if form in ("inverse", "transposed") else a
            b = t if form in ("inverse", "translation") else c["b"]
            c["matrix"] = [row + [x] for row, x in zip(a, b)]
    return plant


def reverse(axes, world=False):
    """Reverses axes of the cameras and, if `world` is set, the world's z axis.
    """
    def plant(cameras):
        for c in cameras:
            rows = [[-x if k in axes else x for k, x in enumerate(row)]
                    for row in c["a"]]
            if world:
                rows[2] = [-x for x in rows[2]]
                c["b"] = c["b"][:2] + [-c["b"][2]]
            c["a"] = rows
    return plant


def focal(factor, centre=False, only=None):
    def plant(cameras):
        for c in cameras if only is None else [cameras[only]]:
            c["f"] *= factor
            if centre:
                c["cx"] *= factor
                c["cy"] *= factor
    return plant


def exchange(v, w):
    def plant(cameras):
        cameras[v]["files"], cameras[w]["files"] = (cameras[w]["files"],
                                                    cameras[v]["files"])
    return plant


def turn(v, axis, degrees):
    def plant(cameras):
        cameras[v]["a"] = times(cameras[v]["a"], rotation(axis, degrees))
    return plant


def shift(v, metres):
    def plant(cameras):
        right = [row[0] for row in cameras[v]["a"]]
        cameras[v]["b"] = [b + metres * r for b, r in zip(cameras[v]["b"],
                                                          right)]
    return plant


def same_pose(v, w):
    """Gives camera w the pose of v, a millimetre beside it, because two pictures
    with exactly one pose and one time are refused."""
    def plant(cameras):
        cameras[w]["a"] = cameras[v]["a"]
        cameras[w]["b"] = [x + 0.001 for x in cameras[v]["b"]]
    return plant


def late(v, frames):
    def plant(cameras):
        for i, c in enumerate(cameras):
            if i != v:
                c["files"] = c["files"][frames:]
    return plant


def brighter(v, gain):
    def plant(cameras):
        files = []
        for path in cameras[v]["files"][:1]:
            folder, name = os.path.split(path)
            to = os.path.join(folder + "-x%g" % gain, name)
            if not os.path.exists(to):
                os.makedirs(os.path.dirname(to), exist_ok=True)
                subprocess.run(["ffmpeg", "-v", "error", "-nostdin", "-i",
                                path, "-vf", "lutrgb=" + ":".join(
                                    "%s=val*%g" % (k, gain) for k in "rgb"),
                                to], check=True)
            files.append(to)
        cameras[v]["files"] = files
    return plant


def small(cameras):
    """Disturbs every camera by 0.2 degrees, 2 mm and 1 % of its focal length,
    in one of eight directions."""
    for i, c in enumerate(cameras):
        signs = [1 if i >> k & 1 else -1 for k in range(3)]
        for axis in range(3):
            c["a"] = times(c["a"], rotation(axis, 0.2 / 3 ** 0.5 *
                                            signs[axis]))
        c["b"] = [b + 0.002 / 3 ** 0.5 * s for b, s in zip(c["b"],
                                                           signs[1:] +
                                                           signs[:1])]
        c["f"] *= 1 + 0.01 * signs[i % 3]


def lens_pattern(factor, centre=False):
    """Returns the pattern of a note on focal lengths, with the factor to 10 %.
    """
    return ("focal lengths and centres" if centre else "focal lengths") + \
        ".* too (long|short) by about", max(factor, 1 / factor)


INVERSE = "matrices are world to camera"
OPENCV = "camera axes are OpenCV's"
FITS_NOT = "{1} does not fit the other cameras|{1} changes most"
TABLE = [
    ("matrices of world to camera", matrices("inverse", False),
     INVERSE + "[^,]* --fix"),
    ("world to camera, OpenCV's axes", matrices("inverse", True),
     INVERSE + ", and " + OPENCV),
    ("OpenCV's axes", matrices("right", True), "fit: " + OPENCV),
    ("rotations transposed", matrices("transposed", False),
     "rotations are transposed"),
    ("translations of world to camera", matrices("translation", False),
     "translations are those of world to camera"),
    ("the cameras' x axis reversed", reverse((0,)),
     "camera axes have x reversed"),
    ("the cameras' x and y axes reversed", reverse((0, 1)),
     "camera axes have x and y reversed"),
    ("a mirrored world", reverse((), True), "the world is a mirror image"),
    ("a mirrored world, z axes reversed", reverse((2,), True),
     "z reversed, and the world is a mirror image"),
    ("another resolution, x2", focal(2, True), lens_pattern(2, True)),
    ("another resolution, x0.5", focal(0.5, True), lens_pattern(2, True)),
    ("focal lengths x2", focal(2), lens_pattern(2)),
    ("focal lengths x1.33", focal(4 / 3), lens_pattern(4 / 3)),
    ("focal lengths x1.1", focal(1.1), lens_pattern(1.1)),
    ("focal lengths x0.9", focal(0.9), lens_pattern(0.9)),
    ("focal lengths x0.75", focal(0.75), lens_pattern(0.75)),
    ("focal length of one camera x1.1", focal(1.1, only=1), FITS_NOT),
    ("files of two cameras exchanged", exchange(1, 2),
     "pictures of ({1} and {2}|{2} and {1}) are exchanged"),
    ("a camera turned by 3 degrees", turn(1, 1, 3), FITS_NOT),
    ("a camera turned by 1 degree", turn(1, 1, 1), FITS_NOT),
    ("a camera turned by 0.5 degrees", turn(1, 1, 0.5), FITS_NOT),
    ("a camera tilted by 0.5 degrees", turn(1, 0, 0.5), FITS_NOT),
    ("a camera rolled by 1 degree", turn(1, 2, 1), FITS_NOT),
    ("a camera moved by 10 cm", shift(1, 0.1), FITS_NOT),
    ("a camera with the pose of another", same_pose(2, 1),
     "have the same pose|{2} does not fit the other cameras"),
    ("a camera 2 frames late", late(1, 2), r"{1} seems to run [12]\.\d frames "
     ".* behind"),
    ("a camera half a stop brighter", brighter(1, 2 ** (0.5 / 2.2)),
     r"{1} is 0\.\d\d stops brighter"),
    ("all disturbed: 0.2 degrees, 1 %, 2 mm", small, "can be refined"),
]


# --- Verdicts -----------------------------------------------------------------

def notes_of(cameras, folder, moving):
    os.makedirs(folder, exist_ok=True)
    path = folder + "/transforms.json"
    write(cameras, path, moving)
    done = subprocess.run([SAGA, "check", path, "--json", "--quiet",
                           "--follow-paths", "--threads", THREADS],
                          stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    if done.returncode:
        return ["refused: " + done.stderr.decode().strip()]
    told = json.loads(done.stdout)
    if os.environ.get("VERBOSE"):
        print(told["refinement"])
    return told["warnings"]


def is_named(pattern, cameras, notes):
    pattern, factor = (pattern, None) if isinstance(pattern, str) else pattern
    for i, c in enumerate(cameras):
        # A camera with a single picture has its number in the name.
        pattern = pattern.replace("{%d}" % i, re.escape(c["name"]) + r"\S*")
    for note in notes:
        found = re.search(pattern, note)
        if found and factor:
            told = re.match(r" ([0-9.]+)", note[found.end():])
            found = told and abs(math.log(float(told[1].rstrip(".")) /
                                          factor)) < 0.1
        if found:
            return True
    return False


def kinds(notes):
    """Returns the notes without their numbers."""
    return {re.sub(r"[0-9.]+", "", note) for note in notes}


def main():
    work = os.path.abspath(sys.argv[1])
    os.makedirs(work, exist_ok=True)
    names = sys.argv[2:] or list(CAPTURES)
    made = {"studio": None, "room": None}
    rows = {}
    for name in names:
        kind = name.split()[0]
        made[kind] = made[kind] or {"studio": studio, "room": room}[kind](work)
        some = CAPTURES[name]
        good = [c for v, c in enumerate(made[kind]) if not some or v in some]
        as_is = notes_of(copy.deepcopy(good), work + "/planted", True)
        rows.setdefault("as it is", []).append(
            "; ".join(n for n in as_is) if os.environ.get("VERBOSE")
            else "%d notes" % len(as_is))
        for fault, plant, pattern in TABLE:
            if not re.search(FAULTS, fault):
                continue
            cameras = copy.deepcopy(good)
            plant(cameras)
            notes = notes_of(cameras, work + "/planted", "late" in fault)
            verdict = "named" if is_named(pattern, cameras, notes) else \
                "seen" if kinds(notes) - kinds(as_is) else "missed"
            rows.setdefault(fault, []).append(verdict)
            if os.environ.get("VERBOSE"):
                print("%s, %s: %s\n  %s" % (name, fault, verdict, "\n  ".join(
                    n for n in notes if n not in as_is)), flush=True)
    print("| fault | " + " | ".join(names) + " |\n|" + "---|" * (len(names) +
                                                                1))
    for fault, verdicts in rows.items():
        print("| %s | %s |" % (fault, " | ".join(verdicts)))


if __name__ == "__main__":
    main()
