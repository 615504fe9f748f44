#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""check_bounds.py: guarantees, for films with a viewing volume in the page of
ports/web in headless Chromium,
  begin       the film begins at the volume's camera, unless the address asks for
              another one, and turns about its pivot and its up direction
  spring      a drag to the side, above, and a wheel lead outside only so far, and
              darken the edge of the picture; when they end, the camera comes
              back to the limit. Inside nothing pulls
  free        with bounds=off nothing holds the camera; cameras of the rig and
              shared views stay where they are, also after a click
  tilt        a device that is turned leads outside and back to where the camera
              was; while it does so nothing pulls
  numbers     they have the PSNR that the film promises at a camera, if that was
              held out and if it was trained on
Without Chromium or the decoder in WebAssembly, the check prints that it was
skipped.
"""

import math
import os
import sys
import tempfile

from verdict import SAGA, WEB, Verdicts, read
import browser  # noqa: E402  (verdict knows where)

SIDE, START = 20, 3    # degrees of azimuth; the volume's camera
MOST = 0.35            # radians; of volume.js

checks = Verdicts("bounds")
complain, verdict = checks.complain, checks.verdict

PLACE = """import('/volume.js').then(({ placeOf }) => placeOf(
    viewer.viewingVolume, viewer.toMetres(viewer.pose.centre)))"""
SHADE = "Number(player.$('edge').style.opacity)"


def show(tab, url, more=""):
    tab.go("about:blank")
    tab.go(url + "index.html?src=film.saga" + more)
    tab.wait("window.viewer?.drawn && !viewer.busy && !viewer.stale")


def mouse(tab, kind, x, y):
    tab.call("Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left",
             buttons=0 if kind == "mouseReleased" else 1, clickCount=1)


def drag(tab, dx, dy):
    """Drags from the middle of the picture, and holds what it has."""
    mouse(tab, "mousePressed", 320, 200)
    for step in range(1, 17):
        mouse(tab, "mouseMoved", 320 + dx * step / 16, 200 + dy * step / 16)


def at_rest(tab):
    tab.run("new Promise((resolve) => setTimeout(resolve, 300))")
    tab.wait("viewer.bounds.out === 0 && !viewer.busy && !viewer.stale")


def near(what, got, want, most=2e-3):
    if abs(got - want) > most:
        complain(what, "is", got, "not", want)


def check_begin(tab, url):
    show(tab, url)
    if tab.run("[viewer.camera, viewer.moved]") != [START, False]:
        complain("it begins at", tab.run("viewer.camera"))
    off = tab.run("""Math.hypot(...viewer.toUnits(viewer.viewingVolume.pivot)
        .map((x, i) => x - viewer.focus[i])) + Math.hypot(
        ...viewer.viewingVolume.up.map((x, i) => x - viewer.up[i]))""")
    near("the distance of pivot and up from the volume's", off, 0, 1e-3)
    show(tab, url, "&camera=1")
    if tab.run("viewer.camera") != 1:
        complain("camera=1 begins at", tab.run("viewer.camera"))
    verdict("begin")


def check_spring(tab, url):
    show(tab, url)
    volume = tab.run("viewer.viewingVolume")
    near("the azimuth", math.degrees(volume["azimuth"]), SIDE, 0.01)
    least, most = volume["elevation"]
    # A drag to the right turns the camera to the left.
    for dx, dy, what, limit in ((-250, 0, "azimuth", volume["azimuth"]),
                                (250, 0, "azimuth", -volume["azimuth"]),
                                (0, 150, "elevation", most),
                                (0, -150, "elevation", least)):
        tab.run("viewer.selectCamera(viewer.start)")
        drag(tab, dx, dy)
        held, out = tab.run(PLACE)[what], tab.run("viewer.bounds.out")
        if not 0.02 < out < MOST + 0.1 or abs(held - limit) < 0.02:
            complain("a drag by", dx, dy, "holds", what, held, "of", limit)
        near("the edge's shade", tab.run(SHADE), min(1, out / MOST), 0.01)
        mouse(tab, "mouseReleased", 320 + dx, 200 + dy)
        at_rest(tab)
        near(what, tab.run(PLACE)[what], limit)
        near("the edge's shade at rest", tab.run(SHADE), 0)
    # A large step ends about where a pull would.
    tab.run("viewer.selectCamera(viewer.start); viewer.orbit(1.5, 0)")
    if not 0.02 < tab.run("viewer.bounds.out") < MOST + 0.15:
        complain("a large step leads", tab.run("viewer.bounds.out"))
    tab.run("viewer.selectCamera(viewer.start)")
    for _ in range(12):
        tab.run("viewer.dolly(1.2)")
    at_rest(tab)
    near("the distance", tab.run(PLACE)["distance"], volume["distance"][1],
         0.01)
    # Panned, it looks past the pivot; then it turns back by itself.
    tab.run("viewer.selectCamera(viewer.start); viewer.pan(400, 0)")
    at_rest(tab)
    tab.run("viewer.selectCamera(viewer.start); viewer.orbit(0.02, 0)")
    before = tab.run("viewer.pose")
    at_rest(tab)
    if tab.run("viewer.pose") != before:
        complain("inside it is pulled to", tab.run("viewer.pose"))
    verdict("spring")


def check_free(tab, url):
    show(tab, url, "&bounds=off")
    tab.run("viewer.orbit(1, 0)")
    line, place = tab.run("viewer.toState()"), tab.run(PLACE)
    tab.run("new Promise((resolve) => setTimeout(resolve, 400))")
    if tab.run("viewer.toState()") != line or tab.run(SHADE) != 0 or \
            abs(place["azimuth"]) < 0.6:
        complain("without bounds it comes to", tab.run(PLACE))
    show(tab, url, "#" + line)
    tab.run("new Promise((resolve) => setTimeout(resolve, 400))")
    near("a shared view", tab.run(PLACE)["azimuth"], place["azimuth"])
    mouse(tab, "mousePressed", 320, 200)
    mouse(tab, "mouseReleased", 320, 200)
    tab.run("new Promise((resolve) => setTimeout(resolve, 400))")
    near("a shared view after a click", tab.run(PLACE)["azimuth"],
         place["azimuth"])
    tab.run("viewer.selectCamera(0)")
    tab.run("new Promise((resolve) => setTimeout(resolve, 400))")
    if tab.run("viewer.moved"):
        complain("a camera of the rig is moved")
    verdict("free")


def check_tilt(tab, url):
    show(tab, url)
    # The limit of the volume is 20 degrees from the front; the device is turned
    # by more, in steps that the bounds would shorten.
    tab.run("""(() => {
        player.tilt.toggle();
        window.turn = (alpha) => dispatchEvent(new DeviceOrientationEvent(
            'deviceorientation', { alpha, beta: 90, gamma: 0 }));
        window.was = viewer.pose.centre;
    })()""")
    tab.wait("player.tilt.isOn")
    outs = []
    for side in (1, -1):
        for alpha in (0, 5, 10, 15, 20, 40):
            tab.run("turn(%d)" % (side * alpha))
        out = tab.run("viewer.bounds.out")
        tab.run("new Promise((resolve) => setTimeout(resolve, 400))")
        if tab.run("viewer.bounds.out") != out:
            complain("a turned device is pulled from", out)
        for alpha in (20, 10, 5, 0):
            tab.run("turn(%d)" % (side * alpha))
        off = tab.run("Math.hypot(...viewer.pose.centre.map((x, i) => "
                      "x - was[i])) / Math.hypot(...was)")
        near("the turned device's way back", off, 0, 1e-9)
        outs.append(out)
    if max(outs) < 0.05:
        complain("turned to both sides it leads", outs)
    tab.run("turn(20); player.tilt.toggle()")
    at_rest(tab)
    verdict("tilt")


def check_numbers(tab, url):
    show(tab, url, "&stats=1")
    tell = "document.getElementById('stats').textContent"
    if "expected" in tab.run(tell):
        complain("it expects something of a film that promises nothing")
    # At a camera of the rig, all that lowers it is that the camera is outside.
    for quality, words in (("36, 30", "30.0 dB of PSNR, 36.0 at a camera "
                            "of the training"),
                           ("36, 0", "expected here36.0 dB of PSNR at a camera"),
                           ("36, 36", "36.0 dB of PSNRdrawn by")):
        tab.run("viewer.viewingVolume.quality = [%s]; viewer.changed()" %
                quality)
        tab.wait(tell + ".includes('%s')" % words, tell)
    verdict("numbers")


def main():
    if checks.skips():
        return 0
    files = {name: read(os.path.join(WEB, name)) for name in os.listdir(WEB)}
    with tempfile.TemporaryDirectory() as tmp:
        film = os.path.join(tmp, "film.saga")
        checks.run(SAGA, "volume", "docs/demo.saga", "--find", "--azimuth",
                   SIDE, "--start", START, "-o", film)
        files["film.saga"] = read(film)
    server = browser.FileServer(files)
    with checks.tab() as tab:
        tab.call("Emulation.setDeviceMetricsOverride", width=640, height=480,
                 deviceScaleFactor=1, mobile=False)
        check_begin(tab, server.url)
        check_spring(tab, server.url)
        check_free(tab, server.url)
        check_tilt(tab, server.url)
        check_numbers(tab, server.url)
    return 1 if checks.failed else 0


sys.exit(main())
