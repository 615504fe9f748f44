#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""check_shutter.py: guarantees, for what `saga encode` reports of shutters,
  rolling     it reports which of seven cameras has a rolling shutter, and how
              long that takes to read a frame. Its pictures are composed of rows
              of a room rendered at four times the rate
  quiet       with SAGA_TEST_LONG: the JSON reports nothing if all cameras have
              a global shutter. `rolling` has six such cameras as well;
              measure/test_shutter.c tests the computation"""

import json
import os
import re
import shutil
import subprocess
import sys
import tempfile

from verdict import SAGA, Verdicts, pixels

WIDTH, HEIGHT, FRAMES, FINER = 96, 54, 16, 4
ROLLS, READOUT = "cam02", 0.8  # frames from its first row to its last

checks = Verdicts("shutter")
complain, verdict = checks.complain, checks.verdict


def take(film, readout):
    """Returns the frames of a camera whose rows are read one after another. The
    middle row is read at the middle of the frame."""
    row = 3 * WIDTH
    rows = []
    for frame in range(FRAMES):
        for y in range(HEIGHT):
            late = readout * ((y + 0.5) / HEIGHT - 0.5)
            at = round(FINER * (frame + 0.5 + late)) * HEIGHT + y
            rows.append(film[at * row:(at + 1) * row])
    return b"".join(rows)


def capture(room, folder, readouts):
    with open(room + "/transforms.json") as f:
        told = json.load(f)
    for camera in sorted(os.listdir(room + "/images")):
        film = pixels("%s/images/%s/%%05d.png" % (room, camera))
        to = "%s/images/%s" % (folder, camera)
        os.makedirs(to)
        subprocess.run(
            ["ffmpeg", "-v", "error", "-f", "rawvideo", "-pix_fmt", "rgb24",
             "-s", "%dx%d" % (WIDTH, HEIGHT), "-i", "-", "-start_number", "0",
             to + "/%05d.png"], check=True,
            input=take(film, readouts.get(camera, 0)))
    told["fps"] /= FINER
    told["frames"] = [f for f in told["frames"] if
                      int(f["file_path"][-9:-4]) < FRAMES]
    for name in list(told):
        if name.endswith("_filenames"):
            told[name] = [p for p in told[name] if int(p[-9:-4]) < FRAMES]
    shutil.copy(room + "/points.ply", folder)
    with open(folder + "/transforms.json", "w") as f:
        json.dump(told, f)


def encode(tmp, name, readouts, *options):
    capture(tmp + "/room", tmp + "/" + name, readouts)
    return checks.run(SAGA, "encode", tmp + "/" + name, "-o",
                      tmp + "/%s.saga" % name, "--primitives", 1200,
                      "--iterations", 1500, "--threads", 1, *options)


def check_quiet(tmp):
    for name, found in json.loads(encode(tmp, "quiet", {},
                                         "--json"))["readout"].items():
        if found["shows"] or not abs(found["frames"]) < READOUT / 2:
            complain("without a rolling shutter,", name, "has", found)
    verdict("quiet")


def check_rolling(tmp):
    said = re.findall(r"(\w+): the last row is (\S+) of a frame \(\+-(\S+)\) "
                      r"(\w+)", encode(tmp, "rolling", {ROLLS: READOUT}))
    if [name for name, _, _, _ in said] != [ROLLS] or \
            abs(float(said[0][1]) - READOUT) > 0.25 or \
            float(said[0][2]) > 0.2 or said[0][3] != "behind":
        complain("of", ROLLS, "with", READOUT, "frames it says", said)
    verdict("rolling")


with tempfile.TemporaryDirectory() as tmp:
    checks.run(SAGA, "synth", tmp + "/room", "--size",
               "%dx%d" % (WIDTH, HEIGHT), "--cameras", 7, "--hold-out", 1,
               "--frames", FINER * (FRAMES + 1), "--fps", 24 * FINER,
               "--points", 800, "--depth-every", 0, "--threads", 1)
    check_rolling(tmp)
    if os.environ.get("SAGA_TEST_LONG"):
        check_quiet(tmp)
sys.exit(checks.failed)
