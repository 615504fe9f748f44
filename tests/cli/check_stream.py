#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""check_stream.py: guarantees, for films of several segments in the player of
ports/web, in headless Chromium, from a server that sends 1.5 times as fast as
the film is played,
  open        the poster is shown until there is a picture; the transfer is
              reported
  seams       playback does not pause where one segment ends and the next
              begins, or where the film loops: each segment is fetched once, in
              order, and decoded ahead of time. If nothing is decoded ahead, the
              same film pauses at its first seam, which shows that the
              measurement works
  pixels      a segment that was decoded ahead of time has the decoder's bits
  seek        a seek to a segment that has not been fetched is reported as
              waiting, and then shows its picture
  late        if the server is too slow, the clock stands: no picture is left
              out, and `waiting` and `playing` are reported
  rate        the film plays at the rate that is chosen in the bar or set for
              the element
The check advances the page's clock by one picture at a time, and lets the
server send a number of bytes for each picture. So it counts pictures, and the
speed of the machine does not matter.
Without Chromium or the decoder in WebAssembly, the check prints that it was
skipped.
"""

import json
import os
import subprocess
import sys
import tempfile
import time

from verdict import SAGA, WEB, Verdicts, read
import browser  # noqa: E402  (verdict knows where)

FILM = "film.saga"
FPS = 24                # of the demo, whose segments have as many pictures
N_SEGMENTS = 4
ALL = 1 << 30           # bytes: more than a film has

checks = Verdicts("stream")
complain, verdict = checks.complain, checks.verdict


def make_film(tmp):
    """Joins the demo four times, which gives a segment for each second."""
    two, four = os.path.join(tmp, "two.saga"), os.path.join(tmp, FILM)
    for a, to in (("docs/demo.saga", two), (two, four)):
        subprocess.run([SAGA, "join", a, a, "-o", to], check=True,
                       stdout=subprocess.DEVNULL)
    return read(four)


# Makes a page with one element that is small enough for any machine. For every
# picture, `shown` gets its frame, its segment, and whether that was decoded
# ahead. `step` moves the clock to the next picture of the film.
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
    viewer.addEventListener('drawn', () => shown.push([viewer.drawn.num /
        viewer.drawn.den, viewer.drawn.segment, viewer.drawn.ahead]));
    viewer.setClock((call) => { window.tick = call; });
    window.step = () => tick(viewer.since + 1000 / %d);
    viewer.wantCrc = true;
    player.style = 'width: 160px; height: 90px; aspect-ratio: auto';
    const given = %s;
    for (const name in given)
        player.setAttribute(name, given[name]);
    document.body.replaceChildren(player);
})()"""


def put(tab, server, granted=ALL, **attributes):
    server.valve.grant(ALL) # to answers of the page before
    tab.go(server.url + "empty.html")
    with server.line:
        server.valve.grant(granted)
    server.served.clear()
    server.sent.clear()
    tab.run(PUT % (FPS, json.dumps({"src": "/" + FILM, "controls": "",
                                    **attributes})))


def open_first(tab, server, **attributes):
    """Opens the film and shows its first picture. After that, the server sends
    nothing."""
    put(tab, server, **attributes)
    tab.wait("viewer.drawn && !viewer.busy")
    server.valve.grant(0)


def of_film(requests):
    return [(first, n) for path, first, n in requests if path == FILM]


class Play:
    """Plays the film from its present frame. With each picture, the server
    sends `rate` times the bytes of a picture. `stood` has for each seam the
    number of pictures during which the clock stood still."""

    def __init__(self, tab, server, rate, looks_ahead=True):
        self.tab, self.server = tab, server
        self.looks_ahead = looks_ahead
        self.parts = [(s["offset"], s["nbytes"])
                      for s in tab.run("viewer.segments")]
        self.each = int(rate * self.parts[0][1] / FPS)
        self.stood = []
        # The clock is moved by a quarter frame, so that no step ends exactly at
        # a segment's end, where rounding would matter.
        tab.run("shown.length = 0; told.length = 0; viewer.frame += 0.25; "
                "player.play()")
        tab.wait("!viewer.busy")

    def came(self):
        """Returns the numbers of the segments that were sent completely."""
        sent = of_film(self.server.sent)
        return [i for i, part in enumerate(self.parts) if part in sent]

    def send(self):
        """Sends the bytes of a picture. If the player requests segments ahead,
        it requests all of them, and these bytes arrive before the clock
        moves on."""
        valve = self.server.valve
        valve.grant(self.each)
        if self.looks_ahead:
            browser.wait_for(lambda: not valve.left or
                             len(self.came()) == N_SEGMENTS)
            self.tab.wait("%s.every((i) => progress.some((p) => p.segment === i"
                          " && p.got === p.nbytes))" % self.came())

    def is_held(self):
        """Returns whether the picture waits for a segment, and the segment for
        bytes."""
        asked, is_late = self.tab.run("[viewer.asked, viewer.isLate()]")
        return is_late and self.server.valve.held == self.parts[asked][0]

    def step(self):
        """Moves the clock by one picture; returns whether a picture was
        shown."""
        self.tab.run("step()")
        self.send()
        browser.wait_for(lambda: self.is_held() or
                         not self.tab.run("viewer.busy"))
        return not self.tab.run("viewer.busy")

    def through(self, n_seams):
        """Plays until the film has passed this number of seams."""
        n, stood = 0, 0
        segment = self.tab.run("viewer.drawn.segment")
        while n < n_seams:
            if not self.step():
                stood += 1
                # The player reports that it waits only after a short delay.
                self.tab.wait("told.includes('waiting')")
                continue
            now = self.tab.run("viewer.drawn.segment")
            if now != segment:
                self.stood.append(stood)
                n, stood = n + 1, 0
            segment = now
        self.tab.run("player.pause()")
        self.tab.wait("!viewer.busy && !viewer.stale")
        return self.tab.run("shown")


def check_open(tab, server):
    open_first(tab, server)
    first, nbytes = tab.run(
        "[viewer.segments[0].offset, viewer.segments[0].nbytes]")
    put(tab, server, granted=first, poster="/poster.svg") # the head alone
    tab.wait("viewer.info")
    if tab.run("player.$('poster').hidden || viewer.drawn !== null"):
        complain("the poster is not there while the film opens")
    # The page reports at most twenty times a second.
    for _ in range(11):
        server.valve.grant(nbytes // 12)
        time.sleep(0.1)
        browser.wait_for(lambda: server.valve.left == 0)
    server.valve.grant(ALL)
    tab.wait("viewer.drawn")
    if not tab.run("player.$('poster').hidden"):
        complain("the poster hides the first picture")
    steps = tab.run("progress.filter(({ segment }) => segment === 0)")
    got = [p["got"] for p in steps]
    if len(got) < 4 or got != sorted(got) or got[-1] != nbytes or \
            {p["nbytes"] for p in steps} != {nbytes}:
        complain("the first segment of", nbytes, "bytes comes in", got)
    said = tab.run("[...said]")
    if sum(s.startswith("loading ") and s.endswith("%") for s in said) < 3:
        complain("while it comes, the element says", said)
    if tab.run("player.$('told').textContent") != "":
        complain("then it still says something")
    verdict("open")


def check_seams(tab, server, film):
    open_first(tab, server, loop="")
    play = Play(tab, server, 3 / 2)
    shown = play.through(N_SEGMENTS + 1) # the first seam again, too
    if any(play.stood):
        complain("at the seams the clock stands for", play.stood, "pictures")
    ahead = [b[2] for a, b in zip(shown, shown[1:]) if a[1] != b[1]]
    if ahead != (N_SEGMENTS + 1) * [True]:
        complain("decoded ahead of time:", ahead)
    got = of_film(server.served)
    if got[-N_SEGMENTS:] != play.parts or sum(n for _, n in got) != len(film):
        complain("fetched:", got)
    open_first(tab, server, loop="")
    tab.run("viewer.lookAhead = () => {}")
    blind = Play(tab, server, 3 / 2, looks_ahead=False)
    blind.through(1)
    if not 12 <= blind.stood[0] <= 18: # 24 / 1.5 are 16
        complain("without looking ahead it stands for", blind.stood)
    verdict("seams: the clock stands for %s pictures, without looking ahead %s"
            % (play.stood, blind.stood))


def check_pixels(tab, server):
    open_first(tab, server, draw="exact", loop="")
    Play(tab, server, 3 / 2).through(1)
    tab.wait("viewer.drawn.den === 1 && viewer.drawn.crc")
    told = tab.run("""(async () => {
        const { SagaFile } = await import('/saga.js');
        const { num, crc, ahead, segment } = viewer.drawn;
        const file = await SagaFile.open('/at_once');
        await file.draw(file.rig[0], num);
        return [segment, ahead, crc, file.crc()];
    })()""")
    if not told[0] or not told[1] or told[2] != told[3]:
        complain("decoded ahead and at once:", told)
    verdict("pixels")


def check_seek(tab, server):
    open_first(tab, server)
    tab.run("told.length = 0; said.clear(); viewer.seek(80)")
    tab.wait("told.length")
    server.valve.grant(ALL)
    tab.wait("viewer.drawn.segment === 3")
    if tab.run("told") != ["waiting"] or not tab.run(
            "[...said].some((s) => s.startsWith('loading '))") or \
            tab.run("player.$('told').textContent") != "":
        complain("a seek is told as", tab.run("[told, [...said]]"))
    if tab.run("viewer.drawn.num") != 80:
        complain("a seek shows", tab.run("viewer.drawn.num"))
    verdict("seek")


def check_late(tab, server):
    open_first(tab, server)
    play = Play(tab, server, 1 / 2)
    shown = play.through(1)
    told = tab.run("told")
    if told[:3] != ["playing", "waiting", "playing"]:
        complain("a late segment is told as", told)
    skipped = [b[0] - a[0] for a, b in zip(shown, shown[1:]) if a[1] != b[1]]
    # Half of the segment arrives with earlier pictures, the rest takes as many
    # pictures again.
    if not 0 < skipped[0] <= 2 or not 20 <= play.stood[0] <= 28:
        complain("the film goes on", skipped, "frames later; it stood for",
                 play.stood)
    verdict("late")


def check_rate(tab, server):
    open_first(tab, server)
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
    files["at_once"] = film
    server = browser.FileServer(files)
    with checks.tab() as tab:
        server.valve = browser.Valve()
        check_open(tab, server)
        check_seams(tab, server, film)
        check_pixels(tab, server)
        check_seek(tab, server)
        check_late(tab, server)
        check_rate(tab, server)
    return 1 if checks.failed else 0


sys.exit(main())
