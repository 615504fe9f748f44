#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Guarantees that examples/charuco.py finds the lens and the distance of two
cameras from drawn videos of a board, on light and on dark paper, and that what
it cannot do ends with status 1 or 2, one line and its reason. The truth is the
homography by which this script draws the board. Skipped without OpenCV."""
import os
import re
import subprocess
import sys
import tempfile

try:
    import cv2
    import numpy as np
    cv2.aruco.CharucoBoard_create
except (ImportError, AttributeError):
    print("ok   charuco skipped: OpenCV 4.6 (python3-opencv) is absent")
    sys.exit(0)

ROOT = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..")
PROGRAM = os.path.join(ROOT, "examples", "charuco.py")
BOARD = ["7", "5", "0.04", "0.03"]
W, H, FOCAL, APART, N = 640, 480, 620.0, 0.1, 12


def run(*told):
    p = subprocess.run([sys.executable, PROGRAM, *told], capture_output=True,
                       text=True)
    return p.returncode, p.stdout + p.stderr


def draw_videos(folder, picture, inverted):
    """Two cameras side by side see the board turn and move."""
    lens = np.array([[FOCAL, 0, W / 2], [0, FOCAL, H / 2], [0, 0, 1]])
    scale = 7 * 0.04 / picture.shape[1]       # metres of a pixel of the board
    for camera in range(2):
        out = cv2.VideoWriter(f"{folder}/c{camera}.avi",
                              cv2.VideoWriter_fourcc(*"MJPG"), 30, (W, H))
        for k in range(N):
            a = 2 * np.pi * k / N
            turn = cv2.Rodrigues(np.array([0.5 * np.sin(a), 0.5 * np.cos(a),
                                           0.2 * np.sin(2 * a)]))[0]
            centre = np.array([0.03 * np.cos(a), 0.02 * np.sin(a), 0.45])
            corner = centre - turn @ np.array([0.14, 0.10, 0])
            corner[0] -= camera * APART - APART / 2
            h = lens @ np.column_stack([turn[:, 0] * scale, turn[:, 1] * scale,
                                        corner])
            out.write(cv2.warpPerspective(
                255 - picture if inverted else picture, h, (W, H),
                flags=cv2.INTER_AREA, borderValue=(128, 128, 128)))
        out.release()


def numbers_of(text, key):
    return [[float(x) for x in re.findall(r"[-+.\de]+", line)]
            for line in re.findall(rf"^{key} = (.*)$", text, re.M)]


def fits(folder):
    with open(folder + "/calibration.toml") as f:
        text = f.read()
    lens, shift = numbers_of(text, "matrix"), numbers_of(text, "translation")
    return (all(abs(m[0] / FOCAL - 1) < 0.02 for m in lens) and
            abs(np.linalg.norm(shift[1]) / APART - 1) < 0.05)


def main():
    bad = []
    with tempfile.TemporaryDirectory() as d:
        board = d + "/board.png"
        if run(d, *BOARD, "--board", board)[0]:
            bad.append("board is not drawn")
        picture = cv2.imread(board)
        for inverted in False, True:
            folder = f"{d}/{int(inverted)}"
            os.mkdir(folder)
            draw_videos(folder, picture, inverted)
            status, text = run(folder, *BOARD)
            if status or not fits(folder):
                bad.append(f"inverted={inverted}: {status} {text}")
        os.mkdir(d + "/none")
        os.mkdir(d + "/noise")
        with open(d + "/noise/c.mp4", "wb") as f:
            f.write(b"no video" * 99)
        for told, status, reason in [
                ([d + "/0", *BOARD, "--dictionary", "DICT_5X5_50"], 1,
                 "try --dictionary DICT_4X4"),
                ([d + "/0", "5", "4", "0.04", "0.03"], 1, "do not fit"),
                ([d + "/0", *BOARD, "--dictionary", "DICT_9"], 2, "DICT_9"),
                ([d + "/0", "7", "5", "0.03", "0.04"], 2, "MARKER"),
                ([d + "/0", "70", "50", "0.04", "0.03"], 2, "too few"),
                ([d + "/none", *BOARD], 1, "has no videos"),
                ([d + "/absent", *BOARD], 1, "No such file"),
                ([d + "/noise", *BOARD], 1, "cannot be read as a video")]:
            found, text = run(*told)
            if found != status or reason not in text or "Traceback" in text:
                bad.append(f"{told[1:]}: {found} {text}")
    for b in bad:
        print("FAIL charuco", b)
    if not bad:
        print("ok   charuco: boards on light and dark paper, and 8 refusals")
    return bool(bad)


if __name__ == "__main__":
    sys.exit(main())
