#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""check_python.py: guarantees, for ports/python/saga.py,

  structures  sizes and offsets of all fields are those that a C compiler gives
              the structures of saga.h
  pictures    every good vector that has a rig gives the checksums of
              vectors/MANIFEST; at times between frames the pixels are
              saga-dec's
  volume      the viewing volume is that of `saga volume`
  errors      a missing, cut or damaged file, and cameras and times that do not
              exist, raise saga.Error; for a bad vector it has the status of
              vectors/MANIFEST
  arrays      pictures and primitives are right as numpy arrays; skipped, with a
              message, without numpy
  refusals    every line of vectors/REFUSALS about a damaged file gives its
              status; for every 37th, saga-dec and `saga render` name the same
              reason, and info, cut, join and mux end as they should
  promises    wrong types and values are refused by name, and so are a closed
              film, a copy of one, and numbers that a camera cannot hold; threads
              that share a film get the pictures that each would get alone; a
              film gives its memory back, and lives on after there was none
  encode      encode() runs the program with the given options, and returns the
              report or raises the program's message
  readme      the packages that the README names exist, and its example prints
              what it states

BUILD=... or build has libsaga.so.0 (`make shared`), SAGA=... is the program.
"""
import concurrent.futures
import copy
import ctypes
import json
import math
import os
import re
import shutil
import subprocess
import sys
import tempfile
from fractions import Fraction

sys.dont_write_bytecode = True
sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from verdict import Verdicts, python_module  # noqa: E402

BUILD = os.environ.get("BUILD", "build")
BUILD = BUILD + "/gcc" if os.path.isdir(BUILD + "/gcc") else BUILD
SAGA = os.environ.setdefault("SAGA", BUILD + "/saga")
SAGA_DEC = os.environ.get("SAGA_DEC", BUILD + "/saga-dec")
saga = python_module(BUILD)

v = Verdicts("python")
MANIFEST = [line.split() for line in open("vectors/MANIFEST")
            if line.strip() and not line.startswith("#")]


def check_structures(tmp):
    for name in saga.__all__:
        if not hasattr(saga, name):
            v.complain("the module has no", name)
    structures = {"saga_camera": saga.Camera, "saga_info": saga._Info,
                  "saga_segment": saga._Segment, "saga_picture": saga._Picture,
                  "saga_job": saga._Job, "saga_report": saga._Report,
                  "saga_animated": saga._Animated,
                  "saga_naming": saga._Naming, "saga_watch": saga._Watch,
                  "saga_volume": saga._Volume}
    lines, wanted = [], []
    for name, s in structures.items():
        lines.append(f'printf("%zu\\n", sizeof({name}));')
        wanted.append(ctypes.sizeof(s))
        for field, kind in s._fields_:
            lines.append(f'printf("%zu\\n", offsetof({name}, {field}));')
            lines.append(f'printf("%zu\\n", sizeof((({name} *)0)->{field}));')
            wanted += [getattr(s, field).offset, ctypes.sizeof(kind)]
    with open(tmp + "/s.c", "w") as f:
        f.write('#include "saga.h"\n#include <stdio.h>\nint main(void)\n{\n' +
                "\n".join(lines) + "\nreturn 0;\n}\n")
    subprocess.run(["gcc", "-Idecoder", tmp + "/s.c", "-o", tmp + "/s"],
                   check=True)
    got = [int(x) for x in subprocess.check_output([tmp + "/s"]).split()]
    if got != wanted:
        v.complain("saga.h has", got, "not", wanted)


def check_pictures(tmp):
    n = 0
    for row in MANIFEST:
        if len(row) < 11 or not row[0].startswith("good/"):
            continue
        name, segment, time, camera = row[0], int(row[1]), int(row[6]), \
            int(row[7])
        if segment or time:
            continue
        film = saga.open("vectors/" + name)
        crc = "%08x" % saga.crc32c(film.pixels(camera, 0))
        n += 1
        if crc != row[10]:
            v.complain(name, "camera", camera, "is", crc, "not", row[10])
    if n < 10:
        v.complain("only", n, "pictures compared")
    film = saga.open("vectors/good/segments.saga")
    for time in "0", "5/2", str(film.info.n_frames - 1):
        crc = subprocess.check_output(
            [SAGA_DEC, "vectors/good/segments.saga", "--camera", "rig:0",
             "--time", time, "--crc"], text=True).strip()
        if "%08x" % saga.crc32c(film.pixels(0, Fraction(time))) != crc:
            v.complain("time", time, "is not saga-dec's")


def check_names():
    film = saga.open("vectors/good/names.saga")
    wanted = ["c\u00e1m 0", "c\u00e1m 9", ""]
    if film.names != wanted or film.metres != 3 / 16:
        v.complain(film.names, film.metres)
    if film.pixels("c\u00e1m 9") != film.pixels(1):
        v.complain("a camera's name gives another picture than its number")
    film = saga.open("vectors/good/still.saga")
    if any(film.names) or film.metres != 0:
        v.complain("names where there are none:", film.names)


# What `saga volume` calls the fields of saga.Volume.
VOLUME = {"azimuth": "azimuth_degrees", "lowest": "lowest_degrees",
          "highest": "highest_degrees", "turn": "turn_degrees"}


def check_volume():
    for name in "volume", "volume_least", "volume_most":
        path = f"vectors/good/{name}.saga"
        told = json.loads(subprocess.check_output(
            [SAGA, "volume", path, "--json"], text=True))["volume"]
        told["psnr"] = told["psnr_at_cameras"], told["psnr_between"]
        for field, value in saga.open(path).volume._asdict().items():
            other = told[VOLUME.get(field, field)]
            pairs = zip(value, other) if isinstance(value, tuple) else \
                [(value, other)]
            for a, b in pairs:
                if a != b and not abs(a - b) <= 1e-6 * max(1, abs(b)):
                    v.complain(name, field, value, "not", other)
    if saga.open("vectors/good/still.saga").volume is not None:
        v.complain("a volume where there is none")


def status_of(call):
    try:
        call()
    except saga.Error as error:
        return error.status if error.status is not None else str(error)
    return "nothing"


def damaged():
    """Yields rule, name, status and bytes of the lines of REFUSALS that ask for
    a picture."""
    for line in open("vectors/REFUSALS"):
        rule, name, kind, status, path, *edits = line.split()
        if rule == "#" or kind != "status":
            continue
        old, new, at = open("vectors/" + path, "rb").read(), b"", 0
        for place, n, text in (e.split(":") for e in edits):
            new += old[at:int(place)] + bytes.fromhex(text)
            at = int(place) + int(n)
        yield rule, name, int(status), new + old[at:]


# The programs take 0.1 s for a line of REFUSALS, so few lines are given to them.
EVERY = 5 if os.environ.get("SAGA_TEST_LONG") else 37
REASONS = {0: "", -1: "out of its range", -10: "not a valid stream",
           -11: "ends too early", -12: "newer decoder", -13: "exceeds its level"}
TOOLS = [[SAGA_DEC, "FILE", "--camera", "rig:0", "--time", "0", "--crc"],
         [SAGA, "render", "FILE", "-o", "OUT.png", "--camera", "0", "--quiet"],
         [SAGA, "info", "FILE"], [SAGA, "cut", "FILE", "0:1", "-o", "OUT"],
         [SAGA, "join", "FILE", "FILE", "-o", "OUT"],
         [SAGA, "mux", "FILE", "--audio", "none", "-o", "OUT"]]


def check_tools(rule, name, status, data):
    """Programs that draw must give a line's status. The others read no more
    than they need: all refuse what no decoder opens, and none leaves a file."""
    with tempfile.TemporaryDirectory() as tmp:
        path, out = tmp + "/x.saga", tmp + "/y"
        with open(path, "wb") as f:
            f.write(data)
        for tool in TOOLS:
            r = subprocess.run([w.replace("FILE", path).replace("OUT", out)
                                for w in tool], text=True, capture_output=True)
            what = os.path.basename(tool[0]), tool[1], rule, name
            draws = "FILE" == tool[1] or tool[1] == "render"
            must = draws or rule.startswith("open.")
            # A file of level 3 may need more memory than these programs have.
            reasons = REASONS[status], "buffer is too small", "no camera"
            if r.returncode not in ([1 if status else 0] if must else [0, 1]):
                v.complain(*what, "ends with", r.returncode, r.stderr)
            if r.returncode and draws and not any(
                    x in r.stderr for x in reasons):
                v.complain(*what, "says", r.stderr, "not", reasons[0])
            if r.returncode and len(os.listdir(tmp)) > 1:
                v.complain(*what, "leaves", os.listdir(tmp))
            for left in os.listdir(tmp):
                if left != "x.saga":
                    os.remove(tmp + "/" + left)


def check_refusals():
    n = 0
    for rule, name, status, data in damaged():
        n += 1
        got = status_of(lambda: saga.open(data).pixels(0, 0))
        got = 0 if got == "nothing" else got
        if got != status:
            v.complain(rule, name, "gives", got, "not", status)
        if n % EVERY == 0:
            check_tools(rule, name, status, data)
    if n < 600:
        v.complain("only", n, "lines")


class Ratio:
    """A number of another package."""
    def as_integer_ratio(self):
        return 5, 2


def raised_by(call):
    try:
        return call()
    except Exception as error:
        return type(error).__name__ + ": " + str(error)


def check_promises():
    name = "vectors/good/segments.saga"
    data = open(name, "rb").read()
    film, camera = saga.open(name), saga.open(name).camera(0)
    first = film.pixels(0, Fraction(5, 2))
    for what, call, word in (
            ("a number as file", lambda: saga.open(7), "TypeError"),
            ("None", lambda: saga.open(None), "TypeError"),
            ("text as bytes", lambda: saga.Film("x", "text"), "TypeError"),
            ("seconds as text", lambda: saga.open(name, "5"), "TypeError"),
            ("no number of seconds", lambda: saga.open(name, math.nan),
             "TypeError"),
            ("half a camera", lambda: film.pixels(0.5), "TypeError"),
            ("no camera", lambda: film.pixels(None), "TypeError"),
            ("a camera before the first", lambda: film.pixels(-1),
             "Error: " + name + ": no camera -1"),
            ("a time as text", lambda: film.pixels(0, "5/2"), "TypeError"),
            ("a time of two", lambda: film.pixels(0, (5, 2)), "TypeError"),
            ("no time", lambda: film.pixels(0, math.nan), "Error: " + name),
            ("no end", lambda: film.pixels(0, math.inf), "Error: " + name),
            # 65535 times this does not fit the decoder's 32 bits.
            ("too late", lambda: film.pixels(0, 65536 + 1 / 65536),
             "Error: " + name + ": frame 65536."),
            ("half", lambda: film.pixels(0, 2.5) == first, True),
            ("a number of others", lambda: film.pixels(0, Ratio()) == first,
             True),
            ("a camera that is none", lambda: film.pixels(saga.Camera()),
             "Error: " + name),
            ("a field that is none", lambda: setattr(camera, "widht", 1),
             "AttributeError"),
            ("a width above its type", lambda: setattr(camera, "width", 65552),
             "OverflowError"),
            ("a centre above its type", lambda: camera.centre.__setitem__(
                1, 2 ** 32), "OverflowError"),
            ("a whole centre", lambda: setattr(camera, "centre",
                                               (0, 2 ** 32, 0)),
             "OverflowError"),
            ("a copy", lambda: copy.copy(film), "TypeError"),
            ("a deep copy", lambda: copy.deepcopy(film), "TypeError"),
            ("a CRC of 5", lambda: saga.crc32c(5), "TypeError"),
            ("a CRC of wide items", lambda: saga.crc32c(memoryview(
                first).cast("B", (len(first) // 3, 3))) ==
             saga.crc32c(first), True),
            ("a name", lambda: saga.Film("a\x1b[2J\u202e", b"no"),
             "Error: a\\x1b[2J\\u202e: ")):
        got = raised_by(call)
        if got is not word and not str(got).startswith(str(word)):
            v.complain(what, "gives", str(got)[:99], "not", word)
    if film.pixels(0, Fraction(5, 2)) != first:
        v.complain("after wrong calls there is another picture")
    check_closed(name, data, first)
    check_threads(film)
    check_memory(name)


def check_closed(name, data, first):
    with saga.open(bytearray(data)) as film:
        kept = film.pixels(0, 2.5)
    for call in (lambda: film.pixels(), lambda: film.camera(0),
                 lambda: film.names, lambda: film.metres,
                 lambda: film.layers(), lambda: film.close() or
                 film.pixels(0, 70)):
        got = raised_by(call)
        if got != "Error: bytes: the film is closed":
            v.complain("a closed film gives", str(got)[:99])
    if kept != first or film.info.n_frames != saga.open(name).info.n_frames:
        v.complain("closing a film changes what it gave")


def check_threads(film):
    """Each thread asks for other segments of one film."""
    places = [(i % 2, 35 * (i % 3) + i % 5) for i in range(24)]
    alone = [saga.crc32c(film.pixels(*place)) for place in places]
    with concurrent.futures.ThreadPoolExecutor(4) as pool:
        shared = list(pool.map(
            lambda place: saga.crc32c(film.pixels(*place)), places))
    if shared != alone:
        v.complain("threads get other pictures")


def check_memory(name):
    done = subprocess.run([sys.executable, "-c", """if True:
        import gc, resource, sys, weakref
        sys.path.insert(0, "ports/python")
        import saga
        film = saga.open(sys.argv[1])
        first, big = film.pixels(), film.camera(0)
        gc.disable()
        gone = weakref.ref(saga.open(sys.argv[1], seconds=9))
        assert gone() is None, "a film is kept"
        big.width = big.height = 16384
        used = 4096 * int(open("/proc/self/statm").read().split()[0])
        resource.setrlimit(resource.RLIMIT_AS, (used + 10 ** 8,) * 2)
        try:
            film.pixels(big)
            raise SystemExit("a picture of 800 MB comes")
        except MemoryError:
            pass
        assert film.pixels() == first, "then there is another picture"
        """, name], capture_output=True, text=True)
    if done.returncode:
        v.complain("without memory:", done.stderr.strip()[-200:])


def check_errors():
    n = 0
    for row in MANIFEST:
        if not row[0].startswith("bad/"):
            continue

        def all_pictures(name=row[0]):
            film = saga.open("vectors/" + name)
            for frame in range(film.info.n_frames):
                film.pixels(film.camera(0), frame)

        n += 1
        got = status_of(all_pictures)
        if got != int(row[-1]):
            v.complain(row[0], "gives", got, "not", row[-1])
    if n < 20:
        v.complain("only", n, "bad vectors")
    film = saga.open("vectors/good/motion.saga")
    for call, word in ((lambda: film.pixels(99), -1),
                       (lambda: film.pixels("no"), "no camera 'no' among"),
                       (lambda: film.pixels(0, -1), "no frame -1"),
                       (lambda: film.pixels(0, 10 ** 6), -1),
                       (lambda: saga.open(b""), -11),
                       (lambda: saga.open(film.info.name, seconds=-1), -21)):
        got = status_of(call)
        if word != got and str(word) not in str(got):
            v.complain("instead of", word, ":", got)
    patient = saga.open(film.info.name, seconds=600)
    wanted = patient.pixels()
    patient._seconds, patient._segment = -1, None
    if status_of(patient.pixels) != -21:
        v.complain("a segment is decoded after its time is over")
    patient._seconds = 600
    if patient.pixels() != wanted:
        v.complain("another picture after decoding was stopped")
    try:
        saga.open("no such file")
        v.complain("a file that is not there opens")
    except FileNotFoundError:
        pass


def check_arrays():
    try:
        import numpy
    except ImportError:
        print("     skipped: there is no numpy")
        return
    film = saga.open(open("vectors/good/motion.saga", "rb").read())
    picture = film.picture(1, 2)
    camera = film.camera(1)
    if picture.shape != (camera.height, camera.width, 3) or \
            picture.tobytes() != film.pixels(1, 2):
        v.complain("the array is another picture")
    p = film.primitives(2)
    n = len(p["mean"])
    if [p[k].shape for k in ("mean", "quat", "scale", "opacity")] != [
            (n, 3), (n, 4), (n, 3), (n,)] or not 0 < n <= \
            film.info.max_primitives:
        v.complain({k: a.shape for k, a in p.items()})
    width = film.info.metres_per_unit * 2 ** 24
    if not (numpy.allclose(numpy.linalg.norm(p["quat"], axis=1), 1) and
            (p["scale"] > 0).all() and (p["opacity"] <= 1).all() and
            (p["opacity"] >= 0).all() and numpy.median(numpy.abs(
                p["mean"] - film.info.centre_metres)) < width):
        v.complain("primitives out of range")


def check_encode(tmp):
    subprocess.run([SAGA, "synth", tmp + "/cap", "--size", "48x32",
                    "--cameras", "2", "--hold-out", "0", "--frames", "2",
                    "--depth-every", "0"], check=True, capture_output=True)
    report = saga.encode(tmp + "/cap", tmp + "/x.saga", primitives=50,
                         iterations=30, still=True, resume=False)
    film = saga.open(tmp + "/x.saga")
    if report["nbytes"] != film.info.nbytes or report["temporal"] or \
            report["n_frames"] != film.info.n_frames:
        v.complain("report", report)
    got = status_of(lambda: saga.encode(tmp + "/none", tmp + "/y.saga"))
    if tmp + "/none" not in str(got):
        v.complain("no capture:", got)
    os.environ["SAGA"] = tmp + "/no-program"
    got = status_of(lambda: saga.encode(tmp + "/cap", tmp + "/y.saga"))
    if "Install the program saga" not in str(got):
        v.complain("no program:", got)
    check_libraries(tmp)
    os.environ["SAGA"] = SAGA
    was = sys.modules.get("numpy")
    sys.modules["numpy"] = None      # as if it were not installed
    got = status_of(lambda: saga.open(tmp + "/x.saga").picture())
    del sys.modules["numpy"]
    if was:
        sys.modules["numpy"] = was
    if "python3-numpy" not in str(got):
        v.complain("no numpy:", got)


def check_libraries(tmp):
    """A program that does not find a library leads to the packages of all that
    it links itself."""
    os.environ["SAGA"] = tmp + "/no-library"
    with open(tmp + "/no-library", "w") as f:
        f.write("#!/bin/sh\necho 'saga: error while loading shared libraries: "
                "libtiff.so.6: cannot open shared object file' >&2\nexit 127\n")
    os.chmod(tmp + "/no-library", 0o755)
    got = str(status_of(lambda: saga.encode(tmp + "/cap", tmp + "/y.saga")))
    if "libtiff.so.6: cannot open" not in got or "ffmpeg" not in got:
        v.complain("no library:", got)
    # The packages' names are those of Debian 12.
    if not os.path.exists("/etc/debian_version") or \
            not open("/etc/debian_version").read().startswith("12."):
        return
    linked = subprocess.run(["objdump", "-p", SAGA], check=True, text=True,
                            stdout=subprocess.PIPE).stdout
    for name in re.findall(r"NEEDED +(\S+)", linked):
        told = subprocess.run(["dpkg", "-S", "*/" + name], text=True,
                              stdout=subprocess.PIPE).stdout
        packages = set(re.findall(r"^([^:]+):", told, re.M))
        if not packages & {*got.split(), "libc6"}:
            v.complain("the packages of", name, "are", packages)


def check_readme():
    text = open("ports/python/README.md").read()
    there = re.findall(r"^Package: (\S+)$", open("debian/control").read(), re.M)
    for name in re.findall(r"\b(?:python3-|libsaga)[a-z0-9-]+\b(?!\.)", text):
        if name not in there:
            v.complain("no package", name, "among", there)
    film = saga.open("docs/demo.saga")
    camera = film.camera(0)
    for wanted in ((film.info.n_frames, film.info.n_cameras),
                   (camera.height, camera.width, 3)):
        if str(wanted) + "\n" not in text:
            v.complain("README.md does not give", wanted)


tmp = tempfile.mkdtemp()
try:
    for name, check, words in (("structures", check_structures, [tmp]),
                               ("pictures", check_pictures, [tmp]),
                               ("names", check_names, []),
                               ("volume", check_volume, []),
                               ("errors", check_errors, []),
                               ("refusals", check_refusals, []),
                               ("promises", check_promises, []),
                               ("arrays", check_arrays, []),
                               ("encode", check_encode, [tmp]),
                               ("readme", check_readme, [])):
        check(*words)
        v.verdict(name)
finally:
    shutil.rmtree(tmp)
sys.exit(v.failed)
