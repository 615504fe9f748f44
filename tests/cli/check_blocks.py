#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""check_blocks.py: guarantees that what README.md, docs/from-cameras.md and the
walk-throughs print as commands runs as printed: every block of a page in its
order, in one folder, under `bash -e`. Programs are the real ones, but captures are tiny and
trainings short: `saga` is a script that adds options, and `saga view` is ended
once it serves. `make`, `apt-get` and `dpkg-buildpackage` only tell whether what
they are asked for exists (check_install, check_packages and check_debian run
them), `colmap` and, without OpenCV, `charuco.py` make what they would have made,
and ffplay reads its input.
  shell       the blocks of these pages
  python      Python's block, without numpy up to the line that needs it
A block of another language begins with a word that tells it.
"""
import os
import re
import subprocess
import sys
import tempfile

from verdict import ROOT, SAGA, SAGA_DEC, Verdicts

v = Verdicts("blocks")
LANGUAGES = {"C": r"saga_\w+\(&", "TOML": r"\[", "Python": r"film = ",
             "tree": r"workspace/\n", "output": r"camera  "}

SAGA_SCRIPT = r"""#!/bin/bash
tiny='--size 48x32 --cameras 3 --hold-out 1 --points 100 --depth-every 0'
short='--primitives 60 --iterations 30 --no-refine --ablate no-teachers'
case $1 in
synth) exec "$REAL/saga" "$@" $tiny --samples 1 ;;
encode) exec "$REAL/saga" "$@" $short ;;
import) exec "$REAL/saga" "$@" --iterations 20 ;;
render) [[ $* == *--depth* ]] || set -- "$@" --size 64x36
    exec "$REAL/saga" "$@" ;;
view) timeout 20 "$REAL/saga" "$@" >served 2>&1 & pid=$!
    until grep -q http served; do kill -0 $pid || exit; sleep 0.05; done
    kill $pid; exit 0 ;;
esac
exec "$REAL/saga" "$@"
"""
SCRIPTS = {
    "saga": SAGA_SCRIPT,
    "make": "#!/bin/bash\nfor t; do grep -qE \"^[a-z ]*\\b$t\\b.*:\" "
            "\"$TREE/Makefile\" || exit 1; done\n",
    "apt-get": "#!/bin/sh\ntest \"$2\" = dpkg-dev || test -f "
               "\"$TREE/debian/control\"\n",
    "dpkg-buildpackage": "#!/bin/sh\ntest -f \"$TREE/debian/rules\"\n",
    "ffplay": "#!/bin/sh\ncat >/dev/null\n",
    "colmap": "#!/bin/sh\ncase $1 in mapper) mkdir sparse/0 && "
              "cp -r scene/images scene/points.ply scene/transforms.json . "
              ";; esac\n",
    # Without OpenCV the script cannot run; what it writes is made instead.
    "python3": "#!/bin/sh\nif \"$PYTHON\" -c 'import cv2' 2>/dev/null; then\n"
               "    exec \"$PYTHON\" \"$@\"\nfi\n"
               "test -f \"$1\" && mkdir -p board && "
               "touch board/calibration.toml\n"
}


def blocks_of(page):
    """Yields the first line's number and the text of each block."""
    text = open(os.path.join(ROOT, page)).read()
    for m in re.finditer(r"(?:(?<=\n\n)|(?<=\n\n\n))((?:    .*\n|\n(?=    ))+)",
                         text):
        lines = [line[4:] for line in m[1].strip("\n").split("\n")]
        yield text[:m.start()].count("\n") + 1, "\n".join(lines)


def shell_of(page):
    """Returns a script of all blocks of commands. Each prints its line first,
    so that a failure tells where it is."""
    script = []
    for line, block in blocks_of(page):
        if not any(re.match(begin, block) for begin in LANGUAGES.values()):
            script += ["echo AT %d >&2" % line, block]
    return "\n".join(script) + "\n"


def make_folder(tmp):
    path = os.path.join(tmp, "bin")
    os.makedirs(path)
    for name, text in SCRIPTS.items():
        with open(os.path.join(path, name), "w") as f:
            f.write(text)
        os.chmod(os.path.join(path, name), 0o755)
    for name in "docs", "examples":
        os.symlink(os.path.join(os.path.abspath(ROOT), name),
                   os.path.join(tmp, name))
    # README calls the programs in build/, a user of the installed ones by name.
    os.makedirs(tmp + "/build")
    for name in "saga", "saga-play":
        at = path + "/saga" if name == "saga" else os.path.abspath(
            os.path.join(os.path.dirname(SAGA_DEC), name))
        os.symlink(at, tmp + "/build/" + name)
    return dict(os.environ, PATH=path + ":" + os.environ["PATH"],
                REAL=os.path.dirname(os.path.abspath(SAGA)),
                TREE=os.path.abspath(ROOT), PYTHON=sys.executable)


def run(page, env, tmp, before):
    """Runs the blocks of a page, after what its reader has already."""
    done = subprocess.run(["bash", "-e", "-o", "pipefail", "-c", before +
                           shell_of(page)], cwd=tmp, env=env, timeout=600,
                          stdin=subprocess.DEVNULL, capture_output=True,
                          text=True, errors="replace")
    if done.returncode:
        at = re.findall(r"^AT (\d+)$", done.stderr, re.M)
        v.complain("%s:%s: status %d: %s" % (
            page, at[-1] if at else "before", done.returncode,
            done.stderr.strip().split("\n")[-1]))


QUIET = "exec >/dev/null; ffmpeg() { command ffmpeg -v error -y \"$@\"; }\n"
TAKE = "ffmpeg -f lavfi -i sine=d=1 -c:a libopus take.opus\n"
FILM = ("saga synth scene; mkdir raw\n"
        "for c in 00 01 02; do ffmpeg -i scene/images/cam$c/%05d.png -r 24 "
        "-c:v libx264 -qp 20 -pix_fmt yuv420p cam$c.mp4; done\n"
        "cp cam00.mp4 raw/cam03.mp4\n")
# What the page of COLMAP leads to.
POSES = "cp -r scene/images scene/points.ply scene/transforms.json .\n"
# A workspace of caliscope: x, y, z of a camera in OpenGL are x, -y, -z.
WORKSPACE = r"""
at=workspace/calibration/extrinsic/capture_volume
mkdir -p workspace/recordings/walk $at
for i in 0 1 2; do mv cam0$i.mp4 workspace/recordings/walk/cam_$i.mp4; done
"$PYTHON" - >$at/camera_array.toml <<'END'
import json
scene = json.load(open("scene/transforms.json"))
for i in range(3):
    m = next(f["transform_matrix"] for f in scene["frames"]
             if "cam0%d/" % i in f["file_path"])
    r = [[s * m[k][a] for k in range(3)] for a, s in ((0, 1), (1, -1), (2, -1))]
    t = [-sum(r[a][k] * m[k][3] for k in range(3)) for a in range(3)]
    print("[cameras.%d]\nsize = [%d, %d]\ndistortions = [0, 0, 0, 0, 0]" % (
        i, scene["w"], scene["h"]))
    print("matrix =", [[scene["fl_x"], 0, scene["cx"] - 0.5],
                       [0, scene["fl_y"], scene["cy"] - 0.5], [0, 0, 1]])
    print("rotation = %s\ntranslation = %s" % (r, t))
END
"""


def check_shell():
    for page, before in (("README.md", QUIET + TAKE),
                         ("docs/from-cameras.md", QUIET + FILM + POSES),
                         ("docs/walk-colmap.md", QUIET + FILM),
                         ("docs/walk-caliscope.md", QUIET + FILM + WORKSPACE)):
        with tempfile.TemporaryDirectory() as tmp:
            run(page, make_folder(tmp), tmp, before)
    v.verdict("shell")


def check_python():
    sys.path.insert(0, os.path.join(ROOT, "ports", "python"))
    os.environ.setdefault("SAGA_LIBRARY",
                          os.path.join(os.path.dirname(os.path.abspath(SAGA)),
                                       "libsaga.so.0"))
    if not os.path.exists(os.environ["SAGA_LIBRARY"]):
        print("     skipped: there is no libsaga.so.0 (`make shared`)")
    else:
        import saga
        names = {"saga": saga}
        block = next(b for _, b in blocks_of("README.md")
                     if re.match(LANGUAGES["Python"], b))
        try:
            for line in block.split("\n"):
                exec(line, names)
            shape = eval(block.split("\n")[-1].split("#")[0], names).shape
            if str(shape) not in block:
                v.complain("README.md has not the shape", shape)
        except saga.Error as error:
            if "numpy" not in str(error):
                raise
            print("     no numpy: the last line was not run")
    v.verdict("python")


check_shell()
check_python()
sys.exit(v.failed)
