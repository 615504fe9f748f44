#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""check_web.py: guarantees, for the page of ports/web in headless Chromium,
  vectors     the frames of every good vector have the CRC of vectors/MANIFEST,
              with and without SIMD
  pixels      the canvas has exactly saga-dec's pixels: for vectors, cameras of
              the rig and moved ones, times between frames, with and without
              SIMD; the page shows their CRC, and marks a wrong one
  bad         every bad vector is refused with the status of vectors/MANIFEST; a
              damaged, missing or wrong file gives a message with its name,
              which Escape closes, and then a good file can be opened. A server
              that forbids other pages to read its files is distinguished from a
              server that does not answer
  names       names of cameras and files are shown as text, whatever is in them,
              with invisible characters made visible
  ranges      of a file with several segments only the head and the segments
              that are shown are fetched, each once, as the server counts. If
              the server does not support ranges, the whole file is fetched
              once. In a film of ten seconds, seeks fetch the segments that they
              show
  drop        a file that is dropped on the page is shown without a request to
              the server
  controls    mouse, wheel and keys move the camera and the time; a key camera
              that is saved and loaded is the same, in the capture's units.
              Calls to a viewer before its file is open do not prevent it from
              showing the file
  modules     the page names all modules that it imports, so that a browser
              fetches them at once; modules and decoder have at most 132 kB
              compressed, a tenth more than before format 1.0
  numbers     the reported rate of pictures is that of the last two seconds
  view        `saga view` serves the page with the file, also after a token with
              --host, and the page computes the same CRC as the program
  training    of a film in training the page shows the newest numbers, and a
              curve of each through the times of the course
  rate        the time for a picture is reported, without a bound, since
              machines differ
Without Chromium or the decoder in WebAssembly, the check prints that it was
skipped. `check_web.py FILE.saga ...` only reports the rate for these files.
"""

import base64
import gzip
import json
import os
import re
import subprocess
import sys
import tempfile
import urllib.parse

from verdict import SAGA, SAGA_DEC, WEB, Verdicts, crc32c, pixels, read
import browser  # noqa: E402  (verdict knows where)
import film  # noqa: E402

GOOD = "vectors/good/"
SEGMENTS = "segments.saga"
LONG = "long.saga"

checks = Verdicts("web")
complain, verdict = checks.complain, checks.verdict


# --- References ------------------------------------------------------------

def reference(tmp, path, camera, time):
    """Returns saga-dec's R, G, B bytes."""
    out = os.path.join(tmp, "reference.ppm")
    subprocess.run([SAGA_DEC, path, "--camera", camera, "--time", time, "-o",
                    out], check=True)
    ppm = read(out)
    head = re.match(rb"P6\n(\d+) (\d+)\n255\n", ppm)
    return ppm[head.end():]


def make_long(tmp):
    """Joins the film of three segments four times."""
    two, four = os.path.join(tmp, "two.saga"), os.path.join(tmp, LONG)
    for a, to in ((GOOD + SEGMENTS, two), (two, four)):
        subprocess.run([SAGA, "join", a, a, "-o", to], check=True,
                       stdout=subprocess.DEVNULL)
    return read(four)


# --- The page --------------------------------------------------------------

# Returns the canvas as R, G, B bytes in base 64.
CANVAS = """(() => {
    const from = viewer.read().data;
    let text = '';
    for (let i = 0; i < from.length; i++)
        if (i % 4 !== 3)
            text += String.fromCharCode(from[i]);
    return btoa(text);
})()"""
STATE = "document.documentElement.dataset.state"


class Page:
    def __init__(self, files):
        self.server = browser.FileServer(files)
        self.tab = browser.Browser()
        self.tab.call("Emulation.setDeviceMetricsOverride", width=640,
                      height=480, deviceScaleFactor=1, mobile=False)

    def show(self, query, server=None):
        self.tab.go((server or self.server).url + "index.html?draw=exact&" +
                    query)
        return self.settle()

    def settle(self):
        """Waits until the requested film is shown or refused; returns the
        state."""
        self.tab.wait("%s === 'problem' || %s === 'empty' || (%s === 'ready' "
                      "&& viewer.drawn && !viewer.busy)" % (3 * (STATE,)))
        return self.tab.run(STATE)

    def do(self, script):
        self.tab.run("(() => { %s })()" % script)
        return self.settle()

    def pixels(self):
        return base64.b64decode(self.tab.run(CANVAS))

    def sentence(self):
        return self.tab.run("document.getElementById('sentence').textContent")


def compare(page, want, what):
    if page.tab.run(STATE) != "ready":
        complain(what, "is not shown:", page.sentence())
    elif page.pixels() != want:
        complain(what, "has other pixels than saga-dec's")


# --- Checks ----------------------------------------------------------------

def check_pixels(page, tmp):
    for name in ("still", "motion", "random_level2", "no_fuse", "memory"):
        for simd in (1, 0):
            page.show("src=%s.saga&simd=%d&stats=1" % (name, simd))
            if page.tab.run("viewer.usesSimd") != bool(simd):
                complain("simd=%d is not obeyed" % simd)
            n = page.tab.run("viewer.info.nFrames")
            for camera, frame in ((0, 0), (1, n - 1), (2, n // 2)):
                page.do("viewer.selectCamera(%d); viewer.seek(%d)" %
                        (camera, frame))
                compare(page, reference(
                    tmp, GOOD + name + ".saga", "rig:%d" % camera,
                    str(frame)), "%s, simd=%d, camera %d, frame %d" %
                    (name, simd, camera, frame))
        check_moved(page, tmp, name)
    check_crc(page, tmp)
    check_library(page, tmp)
    verdict("pixels")


def check_moved(page, tmp, name):
    page.do("viewer.orbit(0.2, -0.1); viewer.dolly(0.9); viewer.pan(3, -2); "
            "viewer.setScale(0.5)")
    camera = os.path.join(tmp, "camera.txt")
    with open(camera, "w") as f:
        f.write(" ".join(map(str, page.tab.run(
            "Array.from(viewer.drawn.values)"))))
    frame = page.tab.run("viewer.drawn.num")
    compare(page, reference(tmp, GOOD + name + ".saga", camera, str(frame)),
            name + ", moved")
    page.do("viewer.setScale(1)")


def check_crc(page, tmp):
    right = "%08x" % crc32c(0, reference(tmp, GOOD + "still.saga", "rig:1",
                                         "0"))
    for crc, want in ((right, "good"), ("00000000", "bad"), ("", "")):
        page.show("src=still.saga&camera=1&crc=" + crc)
        shown = page.tab.run("document.documentElement.dataset.crc")
        got = page.tab.run("document.documentElement.dataset.verdict")
        if shown != right or got != want:
            complain("crc=%s: shown %s, '%s', not %s, '%s'" %
                     (crc, shown, got, right, want))


def check_library(page, tmp):
    """Checks SagaFile without the page, at a time between two frames."""
    text = page.tab.run("""(async () => {
        const { SagaFile } = await import('/saga.js');
        const file = await SagaFile.open('/motion.saga');
        const { rgb } = await file.draw(file.rig[1], 15, 2);
        return btoa(String.fromCharCode(...rgb));
    })()""")
    if base64.b64decode(text) != reference(tmp, GOOD + "motion.saga",
                                           "rig:1", "15/2"):
        complain("frame 15/2 of motion.saga differs")


def check_vectors(page, manifest):
    # Each row has file, segment, time, camera, and the CRC of the frame.
    rows = re.findall(r"^good/(\S+) (\d+) .* (\d+) (\d+) \S+ \S+ (\S+)$",
                      manifest, re.M)
    wrong = page.tab.run("""(async () => {
        const { SagaFile, loadModule } = await import('/saga.js');
        const wrong = [];
        for (const simd of [true, false]) {
            const module = await loadModule({ simd });
            for (const [name, segment, t, camera, crc] of %s) {
                const file = await SagaFile.open('/' + name, { module });
                await file.decode(Number(segment));
                file.ints(file.wasm.saga_web_camera(), 22)
                    .set(file.rig[camera].values);
                file.check(file.wasm.saga_web_view(Number(t)), 'view');
                file.check(file.wasm.saga_web_draw(), 'draw');
                if (file.crc() !== crc)
                    wrong.push([name, segment, camera, simd, file.crc()]);
            }
        }
        return wrong;
    })()""" % json.dumps(rows))
    for w in wrong:
        complain("other pixels:", w)
    if len(rows) < 30:
        complain("the MANIFEST has", len(rows), "good rows")
    verdict("vectors: %d frames, twice" % len(rows))


def check_bad(page, manifest):
    bad = dict(re.findall(r"^(bad/\S+) status (-\d+)$", manifest, re.M))
    got = page.tab.run("""(async () => {
        const { SagaFile, loadModule } = await import('/saga.js');
        const module = await loadModule();
        const status = {};
        for (const name of %s) {
            status[name] = 0;
            try {
                const file = await SagaFile.open('/' + name, { module });
                for (const s of file.segments)
                    await file.draw(file.rig[0], s.firstFrame);
            } catch (error) {
                status[name] = error.status;
            }
        }
        return status;
    })()""" % json.dumps(list(bad)))
    for name, status in bad.items():
        # If a file is cut inside its rig, this may be found only when cameras
        # are listed.
        if got[name] != int(status):
            complain(name, "is refused with", got[name], "not", status)
    if len(bad) < 40:
        complain("the MANIFEST lists", len(bad), "bad vectors")
    for query, word in (("src=bad/crc_segment.saga", "crc_segment.saga"),
                        ("src=bad/magic.saga", "magic.saga"),
                        ("src=none.saga", "404"),
                        ("src=still.saga&seconds=-1", "allow more with"),
                        ("src=saga.js", "saga.js: ")):
        if page.show(query) != "problem" or word not in page.sentence():
            complain(query, "says", repr(page.sentence()))
    page.do("viewer.open(new File([new Uint8Array(9)], 'dropped.saga'))"
            ".catch(() => {})")
    page.tab.wait("document.getElementById('sentence').textContent"
                  ".startsWith('dropped.saga: ')")
    page.do("viewer.open('still.saga')")
    page.tab.wait(STATE + " === 'ready'")
    for path in ("still.saga", "none.json"):
        page.show("src=%s&path=%s" % (SEGMENTS, path))
        page.tab.wait(STATE + " === 'problem'")
        if path not in page.sentence():
            complain("path=" + path, "says", repr(page.sentence()))
    # Before there is a picture, the page is empty and not ready.
    page.tab.wait("document.getElementById('player').viewer.drawn")
    press(page, "Escape")
    if page.tab.run(STATE) != "ready":
        complain("Escape does not close what is told")
    check_others(page)
    verdict("bad")


NAMES = "<b>x</b>", "a\u0085b\u202ec", "<img src=x onerror=told=1>"


def make_named():
    """Returns a film whose cameras have these names."""
    edit = film.Edit(film.Film("vectors", "good/names.saga"))
    chunk = edit.film.chunk("NAME")
    names = b"".join(bytes((0, len(n.encode()))) + n.encode() for n in NAMES)
    return edit.payload("NAME", edit.film.data[chunk.at + 12:chunk.at + 20] +
                        names).whole()


def check_names(page):
    shown = []
    for src in ("named.saga", "<b>%1b\u202e.saga"):
        page.show("src=" + urllib.parse.quote(src))
        shown += page.tab.run("""[
            ...[...document.getElementById('player').shadowRoot
                .getElementById('camera').options].map((o) => o.label),
            document.getElementById('name').textContent, document.title,
            document.getElementById('sentence').textContent,
            document.querySelectorAll('b, img').length, window.told ?? 0]""")
    want = [NAMES[0], "a\\u{85}b\\u{202e}c", NAMES[2], "free", "named.saga",
            "named.saga - saga", "", 0, 0]
    # The other one is not on the server.
    told = shown[-3] if len(shown) > 3 else ""
    if shown[:len(want)] != want or shown[-2:] != [0, 0] or \
            not told.startswith("<b>\\u{1b}\\u{202e}.saga: "):
        complain("shown:", shown)
    verdict("names")


def check_others(page):
    """Checks files of another server that allows this, that does not, and that
    is gone."""
    for share in (True, False):
        other = browser.FileServer(page.server.files, share=share)
        state = page.show("src=%sstill.saga" % other.url)
        if share and state != "ready":
            complain("a shared file is refused:", page.sentence())
        if not share and "CORS" not in page.sentence():
            complain("a server that does not share says", page.sentence())
        other.shutdown()
        other.server_close()
    page.show("src=%sstill.saga" % other.url)
    if "the network" not in page.sentence():
        complain("no server says", page.sentence())


def bytes_of(server, path):
    """Returns (first byte, number) of each answer for a path, and forgets all
    answers."""
    served = [(a, n) for p, a, n in server.served if p == path]
    server.served.clear()
    return served


def check_ranges(page, files, tmp):
    page.server.served.clear()
    page.show("src=" + SEGMENTS)
    head = page.tab.run("viewer.info.headNbytes")
    part = page.tab.run("viewer.segments.map((s) => [s.offset, s.nbytes])")
    part = [tuple(p) for p in part]

    def want(what, *ranges):
        got = bytes_of(page.server, SEGMENTS)
        if got != list(ranges):
            complain(what, "fetches", got, "not", list(ranges))

    if len(part) != 3 or head + sum(n for _, n in part) != len(
            files[SEGMENTS]):
        complain("segments.saga:", head, part)
    want("the start", (0, 4096), (4096, head - 4096), part[0])
    frame = page.tab.run("viewer.segments[2].firstFrame + 3")
    page.do("viewer.seek(%d)" % frame)
    want("a seek", part[2])
    compare(page, reference(tmp, GOOD + SEGMENTS, "rig:0", str(frame)),
            "after a seek")
    page.do("viewer.seek(2)")
    want("a seek back")
    told = page.tab.run("viewer.drawn.fetched")
    if told != head + part[0][1] + part[2][1]:
        complain("the page says that it fetched", told, "bytes")
    page.tab.run("viewer.play()")
    page.tab.wait("viewer.drawn.kept.length === 3")
    page.tab.run("viewer.pause()")
    page.settle()
    want("playing", part[1])
    check_whole(page, files, tmp)
    sought, whole = check_long(page, files)
    verdict("ranges: %d of %d bytes for the first picture, %d for a seek; "
            "%d of %d for four seeks in ten seconds" %
            (head + part[0][1], len(files[SEGMENTS]), part[2][1], sought,
             whole))


def check_long(page, files):
    """Checks a film of more than ten seconds with a segment for each second. It
    was joined, so that it is no vector."""
    page.show("src=" + LONG)
    page.server.served.clear()
    parts = page.tab.run("viewer.segments.map((s) => [s.offset, s.nbytes])")
    seconds = page.tab.run("viewer.info.nFrames / viewer.info.fps")
    if len(parts) != 12 or not 10 < seconds < 12:
        complain("the long film has", len(parts), "segments,", seconds, "s")
    for segment in (7, 2, 11, 7, 4):
        page.do("viewer.seek(viewer.segments[%d].firstFrame + 1)" % segment)
        if page.tab.run("viewer.drawn.segment") != segment:
            complain("a seek does not show segment", segment)
    got = bytes_of(page.server, LONG)
    if got != [tuple(parts[i]) for i in (7, 2, 11, 4)]:
        complain("seeks of the long film fetch", got)
    return sum(n for _, n in got), len(files[LONG])


def check_drop(page, files):
    """Simulates a drop of a file on the page, with the events of a browser."""
    page.show("")
    page.server.served.clear()
    page.do("""const data = new DataTransfer();
        const text = atob('%s');
        data.items.add(new File([Uint8Array.from(text, (c) =>
            c.charCodeAt(0))], 'mine.saga'));
        document.getElementById('stage').dispatchEvent(new DragEvent('drop',
            { dataTransfer: data, bubbles: true, cancelable: true }));""" %
            base64.b64encode(files["motion.saga"]).decode())
    page.tab.wait(STATE + " === 'ready'")
    name = page.tab.run("document.getElementById('name').textContent")
    if name != "mine.saga" or page.tab.run("viewer.rig.length") < 1:
        complain("a dropped file is shown as", name)
    if any(path.endswith(".saga") for path, _, _ in page.server.served):
        complain("a dropped file is fetched:", page.server.served)
    verdict("drop")


def check_whole(page, files, tmp):
    plain = browser.FileServer(files, ranges=False)
    page.show("src=%s&frame=70" % SEGMENTS, plain)
    compare(page, reference(tmp, GOOD + SEGMENTS, "rig:0", "70"),
            "without ranges")
    page.do("viewer.seek(1)")
    got = bytes_of(plain, SEGMENTS)
    if got != [(0, len(files[SEGMENTS]))]:
        complain("without ranges it fetches", got)


def mouse(tab, kind, x, y, **more):
    tab.call("Input.dispatchMouseEvent", type=kind, x=x, y=y, **more)


def drag(page, dx, dy, **more):
    more = {"button": "left", "buttons": 1, **more}
    mouse(page.tab, "mousePressed", 320, 240, clickCount=1, **more)
    mouse(page.tab, "mouseMoved", 320 + dx, 240 + dy, **more)
    mouse(page.tab, "mouseReleased", 320 + dx, 240 + dy, clickCount=1, **more)
    page.settle()


def press(page, key):
    text = {"text": key} if len(key) == 1 else {}
    page.tab.call("Input.dispatchKeyEvent", type="keyDown", key=key, **text)
    page.tab.call("Input.dispatchKeyEvent", type="keyUp", key=key)
    page.settle()


def check_controls(page, tmp):
    run = page.tab.run
    page.show("src=motion.saga&camera=1&frame=3")
    if run("viewer.camera + ' ' + viewer.frame") != "1 3":
        complain("camera= and frame= are not obeyed")
    place = "Array.from(viewer.drawn.values.slice(0, 12))"
    gap = ("Math.hypot(...viewer.pose.centre.map((c, i) => "
           "c - viewer.pivot[i]))")
    before, far = run(place), run(gap)
    drag(page, 60, 20)
    if run(place) == before or abs(run(gap) / far - 1) > 1e-6:
        complain("a drag does not orbit")
    # If the scene is dragged down and to the right, the camera must move up and
    # to the left.
    if run("""(() => {
            const by = viewer.pose.centre.map((c, i) => c -
                viewer.rig[1].values[9 + i]);
            const along = (axis) => axis.reduce(
                (sum, a, i) => sum + a * by[i], 0);
            return along(viewer.up) > 0 &&
                along(viewer.pose.rotation.slice(0, 3)) < 0;
        })()""") is not True:
        complain("a drag orbits the wrong way")
    before = run(place)
    drag(page, 30, 0, modifiers=8)
    after = run(place)
    if after[:9] != before[:9] or after[9:] == before[9:]:
        complain("a drag with shift does not pan")
    mouse(page.tab, "mouseWheel", 320, 240, deltaX=0, deltaY=100)
    page.tab.wait("Math.abs(%s / %r - 1) > 0.1" % (gap, far))
    page.settle()
    press(page, "r")
    if run("viewer.moved"):
        complain("R does not go back to the camera")
    press(page, "2")
    press(page, ".")
    if run("viewer.camera + ' ' + viewer.frame") != "1 4":
        complain("2 and . do not choose camera and frame")
    check_path(page, tmp)
    check_early(page)
    verdict("controls")


# Makes a viewer to which all sorts of calls are made before its file is open,
# and records which events it sends.
EARLY = """(async () => {
    const { Viewer } = await import('/viewer.js');
    const canvas = document.createElement('canvas');
    const early = new Viewer(canvas);
    const all = () => {
        early.setScale(0.5); early.selectCamera(1); early.seek(2);
        early.orbit(1, 0); early.dolly(2); early.pan(1, 1); early.pause();
        early.play(); early.playPath([early.key()]); early.pause();
    };

    all();
    const open = early.open('/motion.saga');
    all();
    await new Promise((resolve) => {
        const again = () => { early.setScale(1); resolve(); };

        early.addEventListener('opened', again);
        open.catch(resolve);
    });
    for (let i = 0; i < 200 && !(early.drawn && !early.busy); i++)
        await new Promise((resolve) => setTimeout(resolve, 50));
    early.worker.terminate();
    return [canvas.width, canvas.height, early.camera, early.frame];
})()"""


def check_early(page):
    page.show("src=motion.saga")
    want = page.tab.run("[viewer.canvas.width, viewer.canvas.height, 0, 0]")
    try:
        got = page.tab.run(EARLY)
    except RuntimeError as error:
        got = str(error)[:200]
    if got != want:
        complain("a viewer that is asked early shows", got, "not", want)


def check_numbers(page):
    """Simulates forty pictures at ten a second, then four that take 0.7
    seconds."""
    page.show("src=still.saga&stats=1")
    text = page.tab.run("""(() => {
        const { now } = performance;
        let time = now.call(performance);
        viewer.playing = true;
        performance.now = () => time;
        for (let i = 0; i < 44; i++) {
            time += i < 40 ? 100 : 700;
            viewer.emit('drawn');
        }
        delete performance.now;
        viewer.playing = false;
        return document.getElementById('stats').textContent;
    })()""")
    if "shown1.4 a second" not in text:
        complain("the rate told is not 1.4:", text)
    verdict("numbers")


def check_path(page, tmp):
    run = page.tab.run
    drag(page, 40, -10)
    press(page, "k")
    key = run("viewer.key()")
    metres = run("viewer.pose.centre.map((c, i) => "
                 "viewer.info.centre[i] + c * viewer.info.unit)")
    if any(abs(a - b) > 1e-9 for a, b in zip(key["eye"], metres)):
        complain("a key camera is not in the capture's units")
    before = run("Array.from(viewer.drawn.values)")
    press(page, "1")
    page.do("document.querySelector('#keys .go').click()")
    after = run("Array.from(viewer.drawn.values)")
    if max(abs(a - b) for a, b in zip(before[:9], after[:9])) > 2 ** 14 or \
            before[9:12] != after[9:12]:
        complain("a key camera does not come back", before, after)
    check_render(page, tmp, key)
    # On a path through two cameras, the middle must be between them.
    middle = run("""(async () => {
        const { keyAt, parsePath } = await import('/path.js');
        const a = viewer.key(0);
        const b = { ...a, seconds: 2, frame: 10, fov: a.fov + 4 };
        const path = parsePath(JSON.stringify(
            { format: 'saga camera path 1', keys: [b, a] }));
        const { frame, fov } = keyAt(path.keys, 1);
        return [frame - (a.frame + 10) / 2, fov - a.fov - 2];
    })()""")
    if max(map(abs, middle)) > 1e-9:
        complain("a path's middle is off by", middle)


def check_render(page, tmp, key):
    """`saga render` must draw from a key camera what the page draws."""
    path, out = tmp + "/path.json", tmp + "/path.png"
    with open(path, "w") as f:
        json.dump({"format": "saga camera path 1", "fps": 30,
                   "size": [160, 120], "keys": [key]}, f)
    subprocess.run([SAGA, "render", GOOD + "motion.saga", "--path", path,
                    "-o", out], check=True)
    got, want = pixels(out), page.pixels()
    # The last bit of a direction may differ.
    if len(got) != len(want) or max(abs(a - b) for a, b in
                                    zip(got, want)) > 1:
        complain("saga render sees something else from a key camera")


# What the page has fetched, in this order, and who named it: a module that
# another one imports is named by 'script', one that a link names by 'other'.
FETCHED = """performance.getEntriesByType('resource')
    .map((e) => [e.name.split('/').at(-1), e.initiatorType])"""
MOST_NBYTES = 132000


def check_modules(page, files):
    page.show("src=still.saga")
    fetched = page.tab.run(FETCHED)
    # The worker begins when all modules are here, and imports its own.
    before = fetched[:[name for name, _ in fetched].index("worker.js")]
    late = [name for name, by in before if by == "script"]
    if late != ["page.js"]:
        complain("only page.js is to be named by a script, not", late)
    nbytes = sum(len(gzip.compress(data, 9)) for name, data in files.items()
                 if re.fullmatch(r"\w+\.js|saga_simd\.wasm", name))
    if nbytes > MOST_NBYTES:
        complain("modules and decoder have", nbytes, "bytes")
    verdict("modules")


def check_view(page, *options):
    view = subprocess.Popen([SAGA, "view", GOOD + "still.saga", *options],
                            stdout=subprocess.PIPE, stderr=subprocess.DEVNULL)
    try:
        url = view.stdout.readline().decode().strip()
        page.tab.go(url + "?draw=exact")
        page.settle()
        verdicts = []
        for camera in range(3):
            page.do("viewer.selectCamera(%d)" % camera)
            verdicts.append(page.tab.run(
                "document.documentElement.dataset.verdict"))
        if verdicts != ["good"] * 3:
            complain(url, "finds the CRCs", verdicts)
    finally:
        view.terminate()
    if view.wait(10) != 0:
        complain("saga view ends with", view.returncode)


def check_training(page, files):
    """The panel of a training, for a course that ends in half a line."""
    files["training.html"] = files["index.html"].replace(
        b'{ "src": null,', b'{ "src": "still.saga", "training": true,')
    # A server that has no time has not ended.
    files["course.csv"] = 503
    page.tab.go(page.server.url + "training.html?draw=exact")
    page.settle()
    files["course.csv"] = b"""iteration,stage,psnr,bits,seconds
10,warm-up,20.0000,0,1.00
20,rendering,30.0000,16000,2.00
30,rendering,25.0000,8000,4.00
40,rend"""
    page.tab.wait("document.getElementById('course-psnr').points.length")
    told = page.tab.run("document.getElementById('training').innerText")
    for text in "rendering, iteration 30, 4 s", "25.00 dB", "1.0 kB", "Finish":
        if text not in told:
            complain("of a training it shows", told)
    # Pictures of 300 x 96: time to the right, each number between its bounds.
    for name, want in (("psnr", "75.0,96.0 150.0,0.0 300.0,48.0"),
                       ("bits", "150.0,0.0 300.0,96.0")):
        got = page.tab.run("document.getElementById('course-%s')"
                           ".getAttribute('points')" % name)
        if got != want:
            complain("the curve of", name, "is", got)
    del files["course.csv"]
    page.tab.wait("document.getElementById('course-told').textContent"
                  ".includes('has ended')")
    page.show("src=still.saga")
    if page.tab.run("document.getElementById('training').checkVisibility()"):
        complain("a finished film has the panel of a training")
    verdict("training")


# COUNT measures pictures a second over a number of pictures, which is larger if
# the program was called only to measure rates.
RATED = 200 if sys.argv[1:] else 20
COUNT = """new Promise((resolve) => {
    const start = performance.now();
    let left = %d;
    const n = left;
    viewer.addEventListener('drawn', function count() {
        if (--left)
            return;
        viewer.removeEventListener('drawn', count);
        resolve(1000 * n / (performance.now() - start));
    });
})"""


def check_rate(page, name):
    texts = []
    for simd in (1, 0):
        page.tab.go(page.server.url + "index.html?draw=exact&src=%s&simd=%d&play=1" %
                    (name, simd))
        page.tab.wait("viewer.drawn")
        # The first pictures are drawn while the browser still compiles the
        # module.
        page.tab.run(COUNT % 5)
        before = page.tab.worker_seconds()
        rate = page.tab.run(COUNT % RATED)
        each = (page.tab.worker_seconds() - before) / RATED
        texts.append("%.1f ms of CPU a picture%s, %.0f a second here" % (
            1000 * each, "" if simd else " without SIMD", rate))
        if not 0 < each < 5:
            complain("a picture takes", each, "s of the worker's CPU time")
    size = page.tab.run("viewer.drawn.width + 'x' + viewer.drawn.height")
    n = page.tab.run("viewer.drawn.nPrimitives")
    verdict("rate: %s, %s, %d primitives: %s" % (name, size, n,
                                                 "; ".join(texts)))


def only_rates(files, paths):
    for path in paths:
        files[os.path.basename(path)] = read(path)
    page = Page(files)
    try:
        for path in paths:
            check_rate(page, os.path.basename(path))
    finally:
        page.tab.close()
    print("load: %.1f, %.1f, %.1f" % os.getloadavg())
    return 1 if checks.failed else 0


def main():
    if checks.skips():
        return 0
    files = {name: read(os.path.join(WEB, name)) for name in os.listdir(WEB)}
    for folder, prefix in ((GOOD, ""), ("vectors/bad/", "bad/")):
        files.update({prefix + name: read(folder + name)
                      for name in os.listdir(folder)})
    if sys.argv[1:]:
        return only_rates(files, sys.argv[1:])
    manifest = read("vectors/MANIFEST").decode()
    rated = "still.saga"
    if os.path.exists("docs/demo.saga"):
        rated = "demo.saga"
        files[rated] = read("docs/demo.saga")
    with tempfile.TemporaryDirectory() as tmp:
        files[LONG] = make_long(tmp)
        files["named.saga"] = make_named()
        page = Page(files)
        try:
            page.show("")
            check_vectors(page, manifest)
            check_pixels(page, tmp)
            check_bad(page, manifest)
            check_names(page)
            check_ranges(page, files, tmp)
            check_drop(page, files)
            check_controls(page, tmp)
            check_modules(page, files)
            check_numbers(page)
            check_view(page)
            check_view(page, "--host", "127.0.0.2")
            verdict("view")
            check_training(page, files)
            check_rate(page, rated)
            checks.complaints.extend(page.tab.log)
            verdict("console")
        finally:
            page.tab.close()
    return 1 if checks.failed else 0


sys.exit(main())
