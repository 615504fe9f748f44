#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""check_phone.py: guarantees, for the page and the element of ports/web in
headless Chromium that emulates telephones and tablets,
  sizes       in portrait, in landscape and on a tablet all controls, also those
              of the page's panels, have at least 44 x 44 pixels, on a desk at
              least 28 x 28; they lie in the window, none on another, and the
              seek bar has at least half of the width
  fingers     on the page one finger turns the camera in any direction, two move
              it, and neither they nor a double tap zoom or scroll the page
  scrolling   in a longer page a finger that goes up or down on the element
              scrolls the page; one that goes sideways turns the camera, and two
              move it
  tilt        a button lets the picture follow the device: the camera goes to
              where the eye is as seen from the device, by the derived angle, in
              both orientations of the screen; it goes back when that ends. A
              device without a sensor is told; without a film nothing turns
Without Chromium or the decoder in WebAssembly, the check prints that it was
skipped.
"""

import math
import os
import sys

from verdict import WEB, Verdicts, read
import browser  # noqa: E402  (verdict knows where)

DEMO = "demo.saga"
PHONE = (390, 844)
SIZES = [PHONE, (320, 568), (844, 390), (768, 1024), (1920, 1080)]
DESK = SIZES[-1]
LIMIT = 0.35  # radians; of tilt.js

checks = Verdicts("phone")
complain, verdict = checks.complain, checks.verdict

# Returns [name, left, top, right, bottom] of all controls that are shown.
CONTROLS = """[...player.shadowRoot.querySelectorAll('button, select, input'),
    ...document.querySelectorAll('button, select, aside input')].map((e) => {
        const r = e.getBoundingClientRect();
        return [e.id || e.textContent, r.left, r.top, r.right, r.bottom];
    }).filter(([, left, , right]) => right > left)"""


def hold(tab, size, orientation="portraitPrimary", angle=0):
    is_phone = size != DESK
    tab.call("Emulation.setDeviceMetricsOverride", width=size[0],
             height=size[1], deviceScaleFactor=1, mobile=is_phone,
             screenOrientation={"type": orientation, "angle": angle})
    tab.call("Emulation.setTouchEmulationEnabled", enabled=is_phone)


def show(tab, url):
    tab.go(url)
    tab.run("""window.player = document.querySelector('saga-player');
        import('/player.js').then(() => { window.viewer = player.viewer; })""")
    settle(tab)


def settle(tab):
    tab.wait("viewer.drawn && !viewer.busy && !viewer.stale")


def meet(a, b):
    return a[1] < b[3] and b[1] < a[3] and a[2] < b[4] and b[2] < a[4]


def check_sizes(tab, url):
    n = 0
    for size in SIZES:
        least = 28 if size == DESK else 44
        hold(tab, size)
        show(tab, "%sindex.html?src=%s&at=%d" % (url, DEMO, size[0]))
        tab.run("player.$('sound').hidden = false") # as of a film with sound
        for panel in ("path", "none"):
            tab.run("document.getElementById('path').hidden = %s" %
                    ("false" if panel == "path" else "true"))
            controls = tab.run(CONTROLS)
            n += len(controls)
            for i, (name, left, top, right, bottom) in enumerate(controls):
                if min(right - left, bottom - top) < least - 0.01:
                    complain(size, name, "has", right - left, bottom - top)
                if min(left, top) < 0 or right > size[0] or bottom > size[1]:
                    complain(size, name, "is at", left, top)
                for other in controls[:i]:
                    if meet(controls[i], other):
                        complain(size, name, "lies on", other[0])
                if name == "time" and right - left < size[0] / 2:
                    complain(size, "the seek bar has", right - left)
    verdict("sizes: %d places of controls" % n)


def touch(tab, kind, *points):
    tab.call("Input.dispatchTouchEvent", type=kind, touchPoints=[
        {"x": x, "y": y, "id": i} for i, (x, y) in enumerate(points)])


def drag(tab, *fingers):
    """Moves fingers, each from (x, y) by (dx, dy), in eight steps."""
    for step in range(9):
        touch(tab, "touchMove" if step else "touchStart", *(
            (x + step * dx / 8, y + step * dy / 8)
            for (x, y), (dx, dy) in fingers))
    touch(tab, "touchEnd")


TURNED = "JSON.stringify(viewer.pose.rotation)"
PLACE = "JSON.stringify([visualViewport.scale, scrollX, scrollY])"
DISTANCE = ("Math.hypot(...viewer.pose.centre.map((c, i) => "
            "c - viewer.pivot[i]))")


def check_fingers(tab, url):
    hold(tab, PHONE)
    show(tab, url + "index.html?src=" + DEMO)
    before = tab.run(PLACE)
    # A drag along the longer side of the window turns by pi; the first of its
    # eight steps tells the browser only that the page does not scroll.
    for dx, dy in ((0, 100), (120, 0), (0, -150)):
        want = tab.run("""import('/camera.js').then(({ orbited }) =>
            orbited(viewer.pose, viewer.pivot, viewer.up, %g, %g))""" % (
                -7 / 8 * math.pi * dx / PHONE[1],
                -7 / 8 * math.pi * dy / PHONE[1]))
        drag(tab, ((200, 400), (dx, dy)))
        got = tab.run("viewer.pose")
        if math.dist(got["rotation"], want["rotation"]) > 1e-3 or \
                math.dist(got["centre"], want["centre"]) > 2 ** 12:
            complain("a finger that goes", dx, dy, "brings the camera to", got,
                     "not", want)
    turned, far = tab.run(TURNED), tab.run(DISTANCE)
    drag(tab, ((180, 400), (-80, 0)), ((220, 400), (80, 0)))
    # The spread grows from 40 to 200 pixels.
    if tab.run(TURNED) != turned or \
            abs(tab.run(DISTANCE) / far - 40 / 200) > 0.01:
        complain("two fingers come to", tab.run(DISTANCE) / far)
    for _ in range(2):
        touch(tab, "touchStart", (200, 300))
        touch(tab, "touchEnd")
    tab.run("new Promise((resolve) => setTimeout(resolve, 400))")
    if tab.run(PLACE) != before:
        complain("fingers take the page from", before, "to", tab.run(PLACE))
    verdict("fingers")


def check_scrolling(tab, url):
    hold(tab, PHONE)
    show(tab, url + "long.html")
    turned = tab.run(TURNED)
    drag(tab, ((200, 250), (0, -160)))
    tab.wait("scrollY > 80")
    if tab.run(TURNED) != turned:
        complain("a finger that scrolls the page turns the camera")
    tab.run("""new Promise((resolve) => {
        onscrollend = () => { onscrollend = null; resolve(); };
        setTimeout(() => onscrollend?.(), 1000);
    })""")
    tab.run("scrollTo(0, 0)")
    drag(tab, ((100, 200), (160, 0)))
    if tab.run(TURNED) == turned or tab.run("scrollY"):
        complain("a finger that goes sideways: scrolled by",
                 tab.run("scrollY"))
    turned = tab.run(TURNED)
    was = tab.run("viewer.pose.centre")
    drag(tab, ((150, 240), (0, -160)), ((250, 240), (0, -160)))
    if tab.run(TURNED) != turned or tab.run("viewer.pose.centre") == was or \
            tab.run("scrollY"):
        complain("two fingers that go up: scrolled by", tab.run("scrollY"))
    verdict("scrolling")


# Returns how far, as angles about the pivot, the camera is from `was`: to the
# right and down.
MOVED = """(({ pose, pivot }) => {
    const off = (c) => c.map((x, i) => x - pivot[i]);
    const dot = (a, b) => a.reduce((sum, x, i) => sum + x * b[i], 0);
    const a = off(was.centre), b = off(pose.centre);
    const along = (row) => Math.asin(dot(b, was.rotation.slice(row, row + 3)) /
        Math.hypot(...b));
    return [along(0), along(3), dot(a, b) / Math.hypot(...a) /
        Math.hypot(...b)];
})(viewer)"""


def turn(tab, alpha, beta, gamma):
    tab.call("DeviceOrientation.setDeviceOrientationOverride", alpha=alpha,
             beta=beta, gamma=gamma)


def check_tilt(tab, url):
    soft = LIMIT * math.tanh(math.radians(10) / LIMIT)
    # The device stands upright. It is turned by 10 degrees towards the user's
    # right, so that the eye is on its left; or its top is turned away by 10, so
    # that the eye is below.
    for size, name, angle, upright, right, back in (
            (PHONE, "portraitPrimary", 0, (0, 90, 0), (10, 90, 0), (0, 80, 0)),
            ((844, 390), "landscapePrimary", 90, (0, 0, -90), (10, 0, -90),
             (0, 0, -80))):
        hold(tab, size, name, angle)
        show(tab, "%sindex.html?src=%s&at=%s" % (url, DEMO, name))
        turn(tab, *upright)
        tab.run("window.was = viewer.pose; player.$('tilt').click()")
        tab.wait("player.tilt.zero")
        for posture, want in ((right, (-soft, 0)), (back, (0, soft))):
            turn(tab, *posture)
            tab.wait("Math.acos(%s[2]) > 0.1" % MOVED)
            got = tab.run(MOVED)
            if math.dist(got[:2], want) > 0.02:
                complain(name, "turned to", posture, "the camera moves by", got)
            turn(tab, *upright)
            tab.wait("%s[2] > 1 - 1e-9" % MOVED)
        turn(tab, *right)
        tab.wait("Math.acos(%s[2]) > 0.1" % MOVED)
        tab.run("player.$('tilt').click()")
        if tab.run("%s[2]" % MOVED) < 1 - 1e-9 or \
                tab.run("player.$('tilt').ariaPressed") != "false":
            complain("it does not go back:", tab.run(MOVED))
    # A device that is turned before a film is open turns nothing.
    hold(tab, PHONE)
    show(tab, url + "long.html?closed")
    tab.run("player.replaceWith(player = document.createElement('saga-player'));"
            "player.$('tilt').click()")
    for posture in ((0, 90, 0), (10, 90, 0)):
        turn(tab, *posture)
        tab.wait("player.tilt.zero")
    tab.run("new Promise((resolve) => setTimeout(resolve, 200))")
    if tab.log:
        complain("turned without a film it throws", tab.log)
        tab.log.clear()
    tab.run("player.$('tilt').click()")
    tab.call("DeviceOrientation.clearDeviceOrientationOverride")
    show(tab, url + "long.html")
    tab.run("player.$('tilt').click()")
    tab.wait("player.$('told').textContent.includes('does not say')")
    hold(tab, DESK)
    show(tab, url + "long.html?desk")
    if not tab.run("player.$('tilt').hidden"):
        complain("a desk has the button")
    verdict("tilt")


def main():
    if checks.skips():
        return 0
    files = {name: read(os.path.join(WEB, name)) for name in os.listdir(WEB)}
    files[DEMO] = read("docs/demo.saga")
    files["long.html"] = (
        b"<!doctype html><meta name=viewport content=width=device-width>"
        b"<script type=module src=player.js></script>"
        b"<saga-player src=demo.saga controls style='height: 400px; "
        b"width: 380px; aspect-ratio: auto'></saga-player>"
        b"<p style='height: 3000px'>")
    server = browser.FileServer(files)
    with checks.tab() as tab:
        check_sizes(tab, server.url)
        check_fingers(tab, server.url)
        check_scrolling(tab, server.url)
        check_tilt(tab, server.url)
    return 1 if checks.failed else 0


sys.exit(main())
