#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""walk.py FILE.saga FOLDER: draws the scene as seen from half-way between two
neighbouring cameras of the file's rig, a picture for each frame, as PPM. It
shows how to draw with a camera that is not in the rig."""
import os
import sys

import saga


def between(a, b):
    """Returns a camera half-way between two: the first one, moved. Its integers
    are those of saga_camera, in units of the file's box."""
    c = a.copy()
    for i in range(3):
        c.centre[i] = (a.centre[i] + b.centre[i]) // 2
    return c


def main(name, folder):
    film = saga.open(name)
    os.makedirs(folder, exist_ok=True)
    n = film.info.n_cameras
    for frame in range(film.info.n_frames):
        i = frame * max(n - 1, 1) // film.info.n_frames
        camera = between(film.camera(i), film.camera(min(i + 1, n - 1)))
        with open(f"{folder}/{frame:05d}.ppm", "wb") as f:
            f.write(b"P6\n%d %d\n255\n" % (camera.width, camera.height))
            f.write(film.pixels(camera, frame))


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    main(*sys.argv[1:])
