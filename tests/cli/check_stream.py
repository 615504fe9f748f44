#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""check_stream.py: guarantees, for films of several segments in the player of
ports/web, in headless Chromium, from a server that sends half as fast
again as the film is played, with a delay,
  open        a poster stands until there is a picture; what has come is
              reported
  seams       at most two pictures of the film are late where a segment ends and
              the next begins, or the film begins anew: each segment is fetched
              once, in order, and decoded ahead of time. Without looking ahead
              the same film stands at its first seam, so the measure works
  pixels      a segment that was decoded ahead has the decoder's own bits
  seek        a seek to what has not come is reported, and shows it
  late        where the server is too slow the clock stands: no picture is left
              out, and `waiting` and `playing` are reported
  rate        the speed of the bar and of the element is that of the film
Without Chromium, or without the decoder for it, it says that it was skipped.
"""

import json
import os
import subprocess
import sys
import tempfile

from verdict import SAGA, WEB, Verdicts, read
import browser  # noqa: E402  (verdict knows where)

FILM = "film.saga"
RATE = 0.5              # of the film's time: two seconds a segment
DELAY = 0.1             # seconds, of the server
FPS = 24                # of the demo
N_SEGMENTS = 4

checks = Verdicts("stream")
complain, verdict = checks.complain, checks.verdict


def make_film(tmp):
    """The demo four times, a segment of a second each."""
    two, four = os.path.join(tmp, "two.saga"), os.path.join(tmp, FILM)
    for a, to in (("docs/demo.saga", two), (two, four)):
        subprocess.run([SAGA, "join", a, a, "-o", to], check=True,
                       stdout=subprocess.DEVNULL)
    return read(four)


# A page with one element, small enough for any machine. `shown` has of every
# picture when it came (ms), its frame and its segment.
PUT = """(async () => {
    await import('/player.js');
    window.player = document.createElement('saga-player');
    window.viewer = player.viewer;
    window.told = [];
    window.shown = [];
    for (const type of ['waiting', 'playing', 'ratechange', 'error'])
        player.addEventListener(type, () => told.push(type));
    window.progress = [];
    window.said = new Set();
    player.addEventListener('progress', ({ detail }) => {
        progress.push(detail);
        said.add(player.$('told').textContent);
    });
    viewer.addEventListener('drawn', () => shown.push([performance.now(),
        viewer.drawn.num / viewer.drawn.den, viewer.drawn.segment,
        viewer.drawn.ahead]));
    viewer.wantCrc = true;
    player.style = 'width: 160px; height: 90px; aspect-ratio: auto';
    const given = %s;
    for (const name in given)
        player.setAttribute(name, given[name]);
    document.body.replaceChildren(player);
    player.playbackRate = %g;
})()"""


def put(tab, server, **attributes):
    tab.go(server.url + "empty.html")
    server.served.clear()
    tab.run(PUT % (json.dumps({"src": "/" + FILM, "controls": "",
                               **attributes}), RATE))


def of_film(server):
    return [(first, n) for path, first, n in server.served if path == FILM]


def seams(shown):
    """The number of pictures late at each seam of the film: none is while the
    next one comes within two of the film's pictures' time."""
    picture_ms = 1000 / (FPS * RATE)
    return [max(0, int((b[0] - a[0]) / picture_ms) - 1)
            for a, b in zip(shown, shown[1:]) if a[2] != b[2]]


def check_open(tab, server):
    put(tab, server, poster="/poster.svg")
    tab.wait("viewer.info")
    if tab.run("player.$('poster').hidden || viewer.drawn !== null"):
        complain("the poster is not there while the film opens")
    tab.wait("viewer.drawn")
    if not tab.run("player.$('poster').hidden"):
        complain("the poster hides the first picture")
    steps = tab.run("progress.filter(({ segment }) => segment === 0)")
    got = [p["got"] for p in steps]
    nbytes = tab.run("viewer.segments[0].nbytes")
    if len(got) < 4 or got != sorted(got) or got[-1] != nbytes or \
            {p["nbytes"] for p in steps} != {nbytes}:
        complain("the first segment of", nbytes, "bytes comes in", got)
    said = tab.run("[...said]")
    if sum(s.startswith("loading ") and s.endswith("%") for s in said) < 3:
        complain("while it comes, the element says", said)
    if tab.run("player.$('told').textContent") != "":
        complain("then it still says something")
    verdict("open")


def play(tab, n_seams):
    tab.run("shown.length = 0; player.play()")
    tab.wait("shown.filter((s, i) => i && s[2] !== shown[i - 1][2]).length "
             ">= %d" % n_seams)
    tab.run("player.pause()")
    return tab.run("shown")


def check_seams(tab, server, film):
    put(tab, server, loop="")
    tab.wait("viewer.drawn")
    parts = tab.run("viewer.segments.map((s) => [s.offset, s.nbytes])")
    shown = play(tab, N_SEGMENTS + 1) # the first seam again, too
    late = seams(shown)
    if max(late) > 2:
        complain("at the seams pictures are late:", late)
    ahead = [b[3] for a, b in zip(shown, shown[1:]) if a[2] != b[2]]
    if sum(ahead) < N_SEGMENTS: # one may have been too late for that
        complain("decoded ahead of time:", ahead)
    got = of_film(server)
    if got[-N_SEGMENTS:] != [tuple(p) for p in parts] or \
            sum(n for _, n in got) != len(film):
        complain("fetched:", got)
    put(tab, server, loop="")
    tab.run("viewer.lookAhead = () => {}")
    tab.wait("viewer.drawn")
    stands = seams(play(tab, 1))
    if stands[0] < 5:
        complain("without looking ahead only these are late:", stands)
    verdict("seams: late pictures %s, without looking ahead %s" %
            (late, stands))


def check_pixels(tab, server):
    put(tab, server, draw="exact", loop="")
    tab.wait("viewer.drawn")
    tab.run("player.play()")
    tab.wait("viewer.drawn.ahead")
    tab.run("player.pause()")
    tab.wait("!viewer.busy && viewer.drawn.den === 1 && viewer.drawn.crc")
    told = tab.run("""(async () => {
        const { SagaFile } = await import('/saga.js');
        const { num, crc, ahead, segment } = viewer.drawn;
        const file = await SagaFile.open('/%s');
        await file.draw(file.rig[0], num);
        return [segment, ahead, crc, file.crc()];
    })()""" % FILM)
    if not told[0] or not told[1] or told[2] != told[3]:
        complain("decoded ahead and at once:", told)
    verdict("pixels")


def check_seek(tab, server):
    put(tab, server)
    tab.wait("viewer.drawn")
    tab.run("told.length = 0; said.clear(); viewer.seek(80)")
    tab.wait("viewer.drawn.segment === 3")
    if tab.run("told") != ["waiting"] or not tab.run(
            "[...said].some((s) => s.startsWith('loading '))") or \
            tab.run("player.$('told').textContent") != "":
        complain("a seek is told as", tab.run("[told, [...said]]"))
    if tab.run("viewer.drawn.num") != 80:
        complain("a seek shows", tab.run("viewer.drawn.num"))
    verdict("seek")


def check_late(tab, server, nbytes):
    server.rate = nbytes / 4 # of what is played in two seconds
    put(tab, server)
    tab.wait("viewer.drawn")
    tab.run("told.length = 0; shown.length = 0; viewer.play()")
    tab.wait("viewer.drawn.segment === 1")
    tab.run("viewer.pause()")
    told = tab.run("told")
    if told[:2] != ["waiting", "playing"]:
        complain("a late segment is told as", told)
    shown = tab.run("shown")
    skipped = [b[1] - a[1] for a, b in zip(shown, shown[1:]) if a[2] != b[2]]
    stood = seams(shown)
    # Two seconds of film are 24 pictures; it stood for as long.
    if not 0 < skipped[0] < 12 or stood[0] < 12:
        complain("the film goes on", skipped, "frames later; stood for", stood)
    verdict("late")


def check_rate(tab, server):
    server.rate = None
    put(tab, server)
    tab.wait("viewer.drawn && !viewer.busy")
    for set_rate, rate in (("player.playbackRate = 2", 2), (
            "player.$('rate').value = '0.5'; player.$('rate')"
            ".dispatchEvent(new Event('change'))", 0.5)):
        tab.run("told.length = 0; viewer.frame = 10; " + set_rate +
                "; viewer.advance(0.75)")
        if tab.run("[viewer.frame, told.join(), player.$('rate').value]") != \
                [10 + 0.75 * FPS * rate, "ratechange", str(rate)]:
            complain(set_rate, "comes to", tab.run(
                "[viewer.frame, told, player.$('rate').value]"))
    verdict("rate")


def main():
    if checks.skips():
        return 0
    files = {name: read(os.path.join(WEB, name)) for name in os.listdir(WEB)}
    files["empty.html"] = b"<!doctype html><link rel=icon href=data:,><body>"
    files["poster.svg"] = b"<svg xmlns='http://www.w3.org/2000/svg'/>"
    with tempfile.TemporaryDirectory() as tmp:
        film = files[FILM] = make_film(tmp)
    server, tab = browser.FileServer(files), browser.Browser()
    segment = len(film) / N_SEGMENTS
    try:
        # A segment is played in 1 / RATE seconds.
        server.delay, server.rate = DELAY, 3 / 2 * segment * RATE
        check_open(tab, server)
        check_seams(tab, server, film)
        check_pixels(tab, server)
        check_seek(tab, server)
        check_late(tab, server, segment)
        check_rate(tab, server)
        checks.complaints.extend(tab.log)
        verdict("console")
    finally:
        tab.close()
    return 1 if checks.failed else 0


sys.exit(main())
