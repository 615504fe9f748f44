#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Calibrates cameras by a charuco board that was carried through the scene.

  charuco.py FOLDER COLUMNS ROWS SQUARE MARKER [--dictionary DICT_4X4_50]

FOLDER has a synchronous video of each camera (mp4, mov, mkv, avi). The board
has COLUMNS x ROWS squares of SQUARE metres and markers of MARKER metres, dark
on light or light on dark. Writes
FOLDER/calibration.toml, which `saga` reads beside the videos. With "--board
FILE.png" it only draws the board, to be printed. It needs OpenCV 4.6 with its
module aruco (Debian: python3-opencv).

Every camera gets its lens from the frames in which it sees the board well. Two
cameras that see the board at the same moments then have a pose relative to each
other, and the poses of all cameras follow from the pairs with the most common
frames."""
import argparse
import os
import sys

try:
    import cv2
    import numpy as np
    cv2.aruco.CharucoBoard_create
except (ImportError, AttributeError):
    sys.exit("charuco.py: needs OpenCV 4.6 with its module aruco, and numpy: "
             "apt install python3-opencv")

LEAST_CORNERS = 8    # corners that a frame must show to count
MOST_FRAMES = 40     # for the lens of a camera; more take long
LEAST_FRAMES = 5
MOST_ERROR = 3       # pixels; what is above is another board
DICTIONARIES = sorted(d for d in dir(cv2.aruco) if d.startswith("DICT_"))


def markers_in(grey, dictionary):
    """Returns the markers of a picture, on light or on dark paper."""
    how = cv2.aruco.DetectorParameters_create()
    how.detectInvertedMarker = True
    markers, ids, _ = cv2.aruco.detectMarkers(grey, dictionary, parameters=how)
    return markers, [] if ids is None else ids


def corners_of(video, board, dictionary, step):
    """Returns the size of the pictures, for each frame that shows the board its
    corners (their numbers and pixels), and a hint in case they are too few."""
    frames, size, k, seen, best = {}, None, 0, set(), (0, None)
    reader = cv2.VideoCapture(video)
    while True:
        ok, picture = reader.read()
        if not ok:
            break
        grey = cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY)
        size = grey.shape[::-1]
        if k % step == 0:
            markers, ids = markers_in(grey, dictionary)
            seen.update(int(i) for i in np.ravel(ids))
            best = max(best, (len(ids), k), key=lambda b: b[0])
            if len(ids):
                n, corners, numbers = cv2.aruco.interpolateCornersCharuco(
                    markers, ids, grey, board)
                if n >= LEAST_CORNERS:
                    frames[k] = numbers, corners
        k += 1
    if size is None:
        sys.exit("%s: cannot be read as a video" % video)
    few = len(frames) < LEAST_FRAMES
    return size, frames, hint(video, k, board, seen, best[0]) if few else ""


def hint(video, n_frames, board, seen, most):
    """Returns what may be wrong if a video shows the board too seldom."""
    n = len(board.ids)
    if seen:
        wrong = sum(i >= n for i in seen)
        return ("at most %d of the board's %d markers are seen at once, %s" %
                (most, n, "and %d that it does not have: are COLUMNS and ROWS "
                 "exchanged?" % wrong if wrong else "so hold it nearer and "
                 "flatter, in more light; compare COLUMNS, ROWS and MARKER"))
    reader, counts = cv2.VideoCapture(video), {}
    for k in range(n_frames):
        if not reader.grab() or k % max(1, n_frames // 8):
            continue
        grey = cv2.cvtColor(reader.retrieve()[1], cv2.COLOR_BGR2GRAY)
        for d in DICTIONARIES:
            found = markers_in(grey, cv2.aruco.Dictionary_get(
                getattr(cv2.aruco, d)))[1]
            counts[d] = counts.get(d, 0) + len(found)
    other = max(counts, key=counts.get, default=None)
    return "no marker of its dictionary is seen; " + (
        "there are markers of %s: try --dictionary %s" % (other, other)
        if other and counts[other] else "is it the right video?")


def lens_of(name, size, frames, board, why):
    """Returns matrix and distortion of a camera, from evenly spread frames."""
    chosen = sorted(frames)
    chosen = chosen[::max(1, len(chosen) // MOST_FRAMES)]
    if len(chosen) < LEAST_FRAMES:
        sys.exit("%s: the board is in %d frames, %d are needed: %s" %
                 (name, len(chosen), LEAST_FRAMES, why))
    error, matrix, distortion, _, _ = cv2.aruco.calibrateCameraCharuco(
        [frames[k][1] for k in chosen], [frames[k][0] for k in chosen], board,
        size, None, None, flags=cv2.CALIB_FIX_ASPECT_RATIO | cv2.CALIB_FIX_K3 |
        cv2.CALIB_ZERO_TANGENT_DIST,
        criteria=(cv2.TERM_CRITERIA_COUNT + cv2.TERM_CRITERIA_EPS, 50, 1e-7))
    if not error < MOST_ERROR:
        sys.exit("%s: the corners do not fit the board, by %.0f pixels: are "
                 "COLUMNS and ROWS right, and not exchanged?" % (name, error))
    print("%s: %d frames, %.2f pixels" % (name, len(chosen), error))
    return matrix, distortion.ravel()


def boards_of(frames, lens, board):
    """Returns the 4 x 4 matrix from board to camera for each frame."""
    poses = {}
    for k, (ids, corners) in frames.items():
        ok, turn, shift = cv2.aruco.estimatePoseCharucoBoard(
            corners, ids, board, lens[0], lens[1], None, None)
        if ok:
            poses[k] = np.eye(4)
            poses[k][:3, :3] = cv2.Rodrigues(turn)[0]
            poses[k][:3, 3] = shift.ravel()
    return poses


def mean_of(poses):
    """Returns the rotation nearest to all, with the median of the shifts."""
    u, _, v = np.linalg.svd(sum(p[:3, :3] for p in poses))
    mean = np.eye(4)
    mean[:3, :3] = u @ np.diag([1, 1, np.linalg.det(u @ v)]) @ v
    mean[:3, 3] = np.median([p[:3, 3] for p in poses], axis=0)
    return mean


def chain(names, boards):
    """Returns world to camera for each camera; the first one's is 1. Cameras
    are added in the order of their common frames with one that has a pose."""
    poses = {names[0]: np.eye(4)}
    while len(poses) < len(names):
        n, new, old = max((len(boards[a].keys() & boards[b].keys()), a, b)
                          for a in names if a not in poses for b in poses)
        if n == 0:
            sys.exit("%s never sees the board together with the others" % new)
        common = boards[new].keys() & boards[old].keys()
        poses[new] = mean_of([boards[new][k] @ np.linalg.inv(boards[old][k])
                              for k in common]) @ poses[old]
        print("%s: pose from %d frames in common with %s" % (new, n, old))
    return poses


def numbers(values):
    return "[" + ", ".join("%.9g" % v for v in values) + "]"


def write(path, names, sizes, lenses, poses):
    with open(path + ".part", "w") as f:
        for i, name in enumerate(names):
            matrix, distortion = lenses[name]
            f.write('[cam_%d]\nname = "%s"\nsize = [%d, %d]\n' %
                    (i, name, *sizes[name]))
            f.write("matrix = [%s]\n" % ", ".join(map(numbers, matrix)))
            f.write("distortions = %s\n" % numbers(distortion[:5]))
            f.write("rotation = %s\n" % numbers(
                cv2.Rodrigues(poses[name][:3, :3])[0].ravel()))
            f.write("translation = %s\n\n" % numbers(poses[name][:3, 3]))
    os.replace(path + ".part", path)
    print(path)


def main():
    parser = argparse.ArgumentParser(
        description="Calibrates cameras by a charuco board.")
    parser.add_argument("folder")
    parser.add_argument("columns", type=int)
    parser.add_argument("rows", type=int)
    parser.add_argument("square", type=float)
    parser.add_argument("marker", type=float)
    parser.add_argument("--dictionary", default="DICT_4X4_50",
                        choices=DICTIONARIES, metavar="DICT_...")
    parser.add_argument("--step", type=int, default=1,
                        help="use every STEP-th frame")
    parser.add_argument("--board", help="draw the board to this picture")
    told = parser.parse_args()
    if told.columns < 2 or told.rows < 2 or told.step < 1:
        parser.error("COLUMNS and ROWS are at least 2, STEP at least 1")
    if not 0 < told.marker < told.square:
        parser.error("MARKER must be above 0 and below SQUARE, in metres")
    dictionary = cv2.aruco.Dictionary_get(getattr(cv2.aruco, told.dictionary))
    board = cv2.aruco.CharucoBoard_create(told.columns, told.rows, told.square,
                                          told.marker, dictionary)
    if told.columns * told.rows // 2 > len(dictionary.bytesList):
        parser.error("%s has %d markers, too few for %d x %d squares" %
                     (told.dictionary, len(dictionary.bytesList), told.columns,
                      told.rows))
    if told.board:
        if not cv2.imwrite(told.board, board.draw((200 * told.columns,
                                                   200 * told.rows))):
            sys.exit("%s: cannot be written" % told.board)
        return
    videos = sorted(os.path.join(told.folder, v)
                    for v in os.listdir(told.folder) if v[0] != "." and
                    v.lower().endswith((".mp4", ".mov", ".mkv", ".avi")))
    if not videos:
        sys.exit("%s: has no videos (mp4, mov, mkv, avi)" % told.folder)
    names, sizes, lenses, boards = [], {}, {}, {}
    for video in videos:
        name = os.path.splitext(os.path.basename(video))[0]
        sizes[name], frames, why = corners_of(video, board, dictionary,
                                              told.step)
        lenses[name] = lens_of(name, sizes[name], frames, board, why)
        boards[name] = boards_of(frames, lenses[name], board)
        names.append(name)
    write(os.path.join(told.folder, "calibration.toml"), names, sizes, lenses,
          chain(names, boards))


if __name__ == "__main__":
    try:
        main()
    except OSError as e:
        sys.exit("charuco.py: %s: %s" % (e.filename, e.strerror))
    except cv2.error as e:
        sys.exit("charuco.py: OpenCV: %s" % e.err)
