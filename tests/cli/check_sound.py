#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""check_sound.py: guarantees, for the sound of films on the page of ports/web,
in headless Chromium,
  button   there is a button for a film with sound, and none for the demo; the
           sound is fetched once, when it is first heard, by a byte range of its
           own
  muted    the attribute, the key M, the button and the property turn it off and
           on
  unseen   a film that is heard plays on where nobody sees it, also if a script
           starts it anew; without sound it rests there
  gesture  if the browser blocks sound, the user's next gesture starts it
  clock    the sound has the picture's time: in playback, after a seek, at twice
           the rate, after loops, and if it starts before or after the first
           frame; it stands if the clock does, and is silent before its start
           and after its end
  late     it waits if a segment is late
  damaged  a film whose sound is damaged plays without sound
Without Chromium, its Opus decoder or the decoder in WebAssembly, the check
prints that it was skipped.
"""

import json
import math
import os
import struct
import subprocess
import sys
import tempfile
import wave

from verdict import SAGA, WEB, Verdicts, read
import browser  # noqa: E402  (verdict knows where)

DEMO = "docs/demo.saga"
COPIES = 4          # of the demo, a second each
FILM_SECONDS = 4.0
WAV_SECONDS = 3.0
LATE, EARLY = 0.5, -0.75 # starts of the sound
MOST_OFF = 0.1      # seconds
IN_A_ROW = 6       # pictures at which the sound must be right

checks = Verdicts("sound")
complain, verdict = checks.complain, checks.verdict


# --- Films -----------------------------------------------------------------

def write_wav(path):
    rate = 48000
    with wave.open(path, "wb") as f:
        f.setparams((1, 2, rate, 0, "NONE", ""))
        f.writeframes(b"".join(
            struct.pack("<h", int(8000 * math.sin(440 * math.tau * i / rate)))
            for i in range(int(WAV_SECONDS * rate))))


def saga(*args):
    subprocess.run([SAGA, *args], check=True, stdout=subprocess.DEVNULL)


def place_of_sound(film):
    """Returns the offset of the chunk OPUS and its number of bytes."""
    at = film.index(b"OPUS")
    while film[at + 16:at + 20] != b"OggS":
        at = film.index(b"OPUS", at + 1)
    return at, 12 + struct.unpack_from("<I", film, at + 4)[0]


def make_films(folder):
    wav, silent = folder + "/take.wav", folder + "/silent.saga"
    write_wav(wav)
    saga("join", *[DEMO] * COPIES, "-o", silent)
    films = {"demo.saga": read(DEMO)}
    for name, start in (("late.saga", LATE), ("early.saga", EARLY)):
        saga("mux", silent, "--audio", wav, "--start", str(start), "-o",
             folder + "/" + name)
        films[name] = read(folder + "/" + name)
    damaged = bytearray(films["late.saga"])
    at, nbytes = place_of_sound(damaged)
    damaged[at + nbytes - 1] ^= 1
    films["damaged.saga"] = bytes(damaged)
    return films


# --- The page --------------------------------------------------------------

# Makes a page with one element. At every tick, `clock` gets [the picture's
# time, the sound's time, whether the sound runs], in seconds of the film.
PUT = """(async () => {
    await import('/player.js');
    window.player = document.createElement('saga-player');
    player.style = 'width: 600px; height: 60px; aspect-ratio: auto';
    const given = %s;
    for (const name in given)
        player.setAttribute(name, given[name]);
    document.body.replaceChildren(player);
    window.viewer = player.viewer;
    window.sound = player.sound;
    window.audio = sound.audio;
    window.clock = [];
    viewer.addEventListener('change', () => viewer.info && clock.push([
        viewer.frame / viewer.info.fps, audio.currentTime,
        !audio.paused && !audio.seeking]));
})()"""


def put(tab, server, **attributes):
    tab.go(server.url + "empty.html")
    server.served.clear()
    tab.run(PUT % json.dumps({"controls": "", **attributes}))
    tab.wait("viewer.drawn")


def press(tab, key):
    tab.call("Input.dispatchKeyEvent", type="keyDown", key=key, text=key)
    tab.call("Input.dispatchKeyEvent", type="keyUp", key=key)


def click(tab, name):
    """Returns the middle of a button of the element."""
    x, y = tab.run("""(() => {
        const { x, y, width, height } = player.$('%s').getBoundingClientRect();
        return [x + width / 2, y + height / 2];
    })()""" % name)
    for kind in ("mousePressed", "mouseReleased"):
        tab.call("Input.dispatchMouseEvent", type=kind, x=x, y=y,
                 button="left", clickCount=1)


def expect(tab, what, script):
    got = tab.run(script)
    if got is not True:
        complain(what, repr(got))


def settles(tab, what, script):
    """Waits for a condition for as long as a slow machine may need."""
    try:
        tab.wait(script)
    except TimeoutError:
        complain(what, tab.run("JSON.stringify([clock.slice(-3), audio.paused,"
                               "audio.readyState, sound.isHeard])"))


# --- The checks ------------------------------------------------------------

def of_sound(server):
    """Returns what was sent of the middle of the sound: (first byte, number of
    bytes)."""
    at, nbytes = place_of_sound(server.files["late.saga"])
    middle = at + nbytes // 2
    return [(first, n) for path, first, n in server.served
            if path == "late.saga" and first <= middle < first + n]


def check_button(tab, server):
    put(tab, server, src="/demo.saga")
    expect(tab, "the demo has a button of sound",
           "player.$('sound').hidden && !sound.exists")
    press(tab, "m")
    put(tab, server, src="/late.saga")
    at, nbytes = place_of_sound(server.files["late.saga"])
    expect(tab, "a film with sound has no button",
           "!player.$('sound').hidden")
    for _ in range(2):
        tab.run("player.canvas.focus()")
        press(tab, " ")
        settles(tab, "it is not heard", "!audio.paused && audio.currentTime")
        press(tab, " ")
    settles(tab, "it goes on while the film stands", "audio.paused")
    got = of_sound(server)
    if len(got) != 1 or got[0][0] + got[0][1] != at + nbytes + 4:
        complain("of the sound in bytes", at, "to", at + nbytes,
                 "is fetched", got)
    verdict("button")


def check_muted(tab, server):
    put(tab, server, src="/late.saga", loop="", muted="")
    tab.run("player.canvas.focus()")
    press(tab, " ")
    tab.wait("player.currentTime > %g" % (LATE + 0.5))
    if of_sound(server):
        complain("a sound that is muted is fetched")
    expect(tab, "what is muted is heard", "audio.paused && player.muted && "
           "player.$('sound').title === 'Sound on (M)'")
    press(tab, "m")
    settles(tab, "M does not begin it", "!audio.paused && !player.muted && "
            "player.$('sound').title === 'Sound off (M)'")
    press(tab, "m")
    settles(tab, "M does not end it", "audio.paused && player.muted")
    tab.run("player.muted = false")
    settles(tab, "the property does not begin it", "!audio.paused")
    click(tab, "sound")
    settles(tab, "the button does not end it", "audio.paused && player.muted")
    click(tab, "sound")
    settles(tab, "the button does not begin it", "!audio.paused")
    tab.run("player.volume = 0.25")
    expect(tab, "the volume is", "audio.volume === 0.25 || audio.volume")
    verdict("muted")


def check_unseen(tab, server):
    put(tab, server, src="/late.saga", loop="")
    tab.run("player.canvas.focus()")
    press(tab, " ")
    settles(tab, "it is not heard", "!audio.paused")
    tab.run("player.style.marginTop = '5000px'; "
            "new Promise((resolve) => setTimeout(resolve, 500))")
    settles(tab, "unseen it is not heard", "!audio.paused")
    expect(tab, "unseen, but heard, it rests", "!viewer.isAsleep")
    tab.run("window.worker = viewer.worker; player.pause(); "
            "player.currentTime = 0; void player.play(); "
            "new Promise((resolve) => setTimeout(resolve, 300))")
    expect(tab, "started anew it gives worker or context back",
           "viewer.worker === worker && !viewer.screen.gl.isContextLost()")
    tab.run("player.muted = true")
    settles(tab, "unseen and silent it goes on", "viewer.isAsleep && "
            "viewer.worker === null && audio.paused")
    tab.run("player.muted = false")
    settles(tab, "heard again it rests", "!viewer.isAsleep && !audio.paused")
    verdict("unseen")


def check_gesture(server):
    """Checks a page on which no user has clicked, in a browser of its own."""
    tab = browser.Browser()
    try:
        put(tab, server, src="/late.saga", loop="", autoplay="")
        settles(tab, "without a gesture it is not refused", "sound.isBlocked")
        expect(tab, "what is refused is told as", "audio.paused && "
               "player.$('sound').title === 'Sound on (M)' || "
               "player.$('sound').title")
        press(tab, "m")
        settles(tab, "M does not begin it", "!audio.paused && sound.isHeard")
        put(tab, server, src="/late.saga", loop="", autoplay="")
        settles(tab, "anew without a gesture, it is not refused",
                "sound.isBlocked")
        click(tab, "clock")
        settles(tab, "a click does not begin it", "!audio.paused")
        checks.complaints.extend(tab.log)
    finally:
        tab.close()
    verdict("gesture")


# Whether the sound ran at the picture's time in the last IN_A_ROW pictures;
# pictures outside the sound do not count.
TOGETHER = """(() => {
    const inside = clock.filter(([at]) => at > %(start)g && at < %(end)g)
        .slice(-%(n)d);
    return inside.length === %(n)d && inside.every(([at, sound, runs]) =>
        runs && Math.abs(at - %(start)g - sound) <= %(off)g);
})()"""


def together(tab, what, start):
    tab.run("clock.length = 0")
    settles(tab, what, TOGETHER % {
        "start": start, "end": start + WAV_SECONDS - MOST_OFF, "n": IN_A_ROW,
        "off": MOST_OFF})


def check_clock(tab, server):
    for name, start in (("late.saga", LATE), ("early.saga", EARLY)):
        put(tab, server, src="/" + name, loop="")
        tab.run("player.canvas.focus()")
        press(tab, " ")
        together(tab, name + ": played, it is not in time", start)
        tab.run("player.currentTime = 1.5")
        together(tab, name + ": after a seek, it is not in time", start)
        tab.run("player.playbackRate = 2")
        together(tab, name + ": at twice the rate, it is not in time", start)
        expect(tab, "its rate is", "audio.playbackRate === 2 || "
               "audio.playbackRate")
        tab.run("player.playbackRate = 1; player.currentTime = %g" %
                (FILM_SECONDS - 0.3))
        tab.wait("player.currentTime < 2")
        together(tab, name + ": after a loop, it is not in time", start)
        tab.run("player.pause()")
        for at in (2, 0.75):
            tab.run("player.currentTime = %g" % at)
            settles(tab, name + ": a seek at rest does not set it",
                    "audio.paused && Math.abs(player.currentTime - %g - "
                    "audio.currentTime) <= %g" % (start, MOST_OFF))
    check_outside(tab, server)
    verdict("clock")


def check_outside(tab, server):
    put(tab, server, src="/late.saga", loop="")
    tab.run("player.canvas.focus()")
    press(tab, " ")
    tab.wait("player.currentTime > %g" % (LATE + 1))
    tab.run("clock.length = 0; player.currentTime = 0")
    tab.wait("clock.length > 2 && player.currentTime > %g" % (LATE + 0.3))
    early = tab.run("clock.filter(([at, , runs], i) => i > 1 && at < %g && "
                    "runs)" % LATE)
    if early:
        complain("before it begins, it is heard:", early)
    put(tab, server, src="/early.saga")
    press(tab, "m") # a gesture of this page; it mutes
    press(tab, "m")
    tab.run("player.play(); player.currentTime = 1")
    tab.wait("player.currentTime > 1.2 && !audio.paused")
    tab.wait("player.currentTime > %g" % (EARLY + WAV_SECONDS + 0.2))
    settles(tab, "behind its end, it is heard", "audio.paused")
    tab.run("player.playbackRate = 0; player.currentTime = 1")
    settles(tab, "it is heard where time stands", "audio.paused")


def check_late(tab, server):
    """If a segment does not arrive, the sound must wait together with the
    picture."""
    put(tab, server, src="/late.saga", loop="")
    tab.run("player.canvas.focus()")
    press(tab, " ")
    tab.wait("!audio.paused")
    tab.run("""(() => {
        const real = viewer.show.bind(viewer);
        window.held = [];
        viewer.show = (drawn) => drawn.segment === viewer.drawn.segment
            ? real(drawn) : held.push(drawn);
        window.release = () => {
            viewer.show = real;
            held.forEach((drawn) => real(drawn));
        };
        player.currentTime = (player.currentTime + 1.5) %% %g;
    })()""" % FILM_SECONDS)
    settles(tab, "it goes on while a segment is waited for",
            "viewer.waiting && audio.paused")
    tab.run("release()")
    together(tab, "after that it is not in time", LATE)
    verdict("late")


def check_damaged(tab, server):
    put(tab, server, src="/damaged.saga", loop="")
    tab.run("player.canvas.focus()")
    press(tab, " ")
    settles(tab, "a damaged sound keeps its button",
            "player.$('sound').hidden && audio.paused")
    before = tab.run("viewer.frame")
    settles(tab, "with a damaged sound the film stands",
            "viewer.frame !== %r" % before)
    verdict("damaged")


def main():
    if checks.skips():
        return 0
    files = {name: read(os.path.join(WEB, name)) for name in os.listdir(WEB)}
    files["empty.html"] = b"<!doctype html><body>"
    with tempfile.TemporaryDirectory() as folder:
        files.update(make_films(folder))
    server = browser.FileServer(files)
    with checks.tab() as tab:
        tab.go(server.url + "empty.html")
        if not tab.run("new Audio().canPlayType('audio/ogg; codecs=opus')"):
            print("ok   sound skipped: this chromium cannot play Opus")
            return 0
        check_button(tab, server)
        check_muted(tab, server)
        check_unseen(tab, server)
        check_gesture(server)
        check_clock(tab, server)
        check_late(tab, server)
        check_damaged(tab, server)
    return 1 if checks.failed else 0


sys.exit(main())
