#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""check_headset.py: guarantees, for the page of ports/web in headless Chromium
with a headset that iwer emulates,
  offer       there is a button for the headset only if there is a headset
  start       wherever in the room the head is when a session begins, it is at
              the viewer's camera, which looks level; if that is outside the
              viewing volume, it is at the volume's surface
  eyes        each eye's picture has a PSNR of at least 40 dB against what the
              decoder draws for this eye's camera, and differs from that of the
              other eye, also after the head has turned and moved
  fade        the picture gets dim as the head leaves the viewing volume; far
              outside the film stands still until the head is back, unless
              the button says that it is to pause
  clock       the film plays by the headset's clock; its button pauses
  leave       after the session the page shows its own picture and plays on
iwer is fetched by npm once for a build folder. Without npm, the registry,
Chromium or the decoder in WebAssembly, the check prints that it was skipped.
"""

import os
import sys

from verdict import WEB, Verdicts, read
import browser  # noqa: E402  (verdict knows where)
import npm  # noqa: E402

IWER = ("iwer", "2.5.0", ("build/iwer.min.js",))
LEAST_DB = 40

checks = Verdicts("headset")
complain, verdict = checks.complain, checks.verdict

# Script that runs before the page: it installs the emulated headset, keeps the
# page's session, and puts the origin of its spaces away from the head.
INSTALL = """;
window.device = new IWER.XRDevice(IWER.metaQuest3, { stereoEnabled: true });
device.installRuntime({ forceInstall: true });
{
    const real = navigator.xr.requestSession.bind(navigator.xr);
    navigator.xr.requestSession = async (mode) => {
        const session = await real(mode);
        const ask = session.requestReferenceSpace.bind(session);
        session.requestReferenceSpace = async (type) =>
            (await ask(type)).getOffsetReferenceSpace(new XRRigidTransform(
                { x: 0.4, y: -0.3, z: 1 }, { y: 0.6, w: 0.8 }));
        return window.session = session;
    };
}
"""

# eyes() waits for the splats of this pose of the head. It returns the PSNR of
# each eye's picture against the decoder's picture for this eye's camera, and
# for the other eye's.
SHARED = """(async () => {
const { SagaFile } = await import('/saga.js');
const { product, valuesFrom } = await import('/engine.js');
const file = await SagaFile.open('/demo.saga');
const player = document.getElementById('player');
const { viewer } = player;
const space = await session.requestReferenceSpace('local');

window.viewer = viewer;
window.player = player;
const beside = (want, got) => {
    let sum = 0;
    for (let i = 0; i < want.length; i++)
        sum += (want[i] - got[i]) ** 2;
    return 10 * Math.log10(255 * 255 / Math.max(1e-9, sum / want.length * 4 /
    3));
};
const inFrame = (call) => new Promise((resolve) =>
    session.requestAnimationFrame((now, frame) => resolve(call(frame))));

const { standing } = await import('/xr.js');
window.model = standing(viewer, await inFrame((frame) =>
    frame.getViewerPose(space).transform.matrix));

// What an eye's part of the canvas shows, rows from the top.
function readEye(gl, { x, y, width, height }) {
    const rows = new Uint8Array(4 * width * height), got = rows.slice();
    gl.readPixels(x, y, width, height, gl.RGBA, gl.UNSIGNED_BYTE, rows);
    for (let i = 0; i < height; i++)
        got.set(rows.subarray(4 * width * i, 4 * width * (i + 1)),
            4 * width * (height - 1 - i));
    return got;
}

// The brightest sample of an eye's picture.
window.brightest = async () => {
    for (let i = 0; i < 4; i++)
        await inFrame(() => {});
    return inFrame((frame) => {
        const [view] = frame.getViewerPose(space).views;
        const box = session.renderState.baseLayer.getViewport(view);
        return readEye(viewer.screen.gl, box).reduce((most, x, i) =>
            Math.max(most, i % 4 < 3 ? x : 0), 0);
    });
};

window.eyes = async () => {
    const settled = () => !viewer.busy && !viewer.stale &&
        viewer.screen.made?.values.every((v, i) => v === viewer.wanted[i]);
    let seen = null;
    for (let i = 0; i < 4; i++) // the device moves in its own frames
        await inFrame(() => {});
    while (!seen)
        seen = await inFrame((frame) => settled() &&
            frame.getViewerPose(space).views.map((view) => {
                const box = session.renderState.baseLayer.getViewport(view);
                return { got: readEye(viewer.screen.gl, box),
                    values: valuesFrom(viewer, product(
                        view.transform.inverse.matrix, model),
                    view.projectionMatrix, box.width, box.height) };
            }));
    const want = [];
    for (const { values } of seen)
        want.push(Uint8Array.from((await file.draw({ values },
            viewer.frame)).rgba));
    return [beside(want[0], seen[0].got), beside(want[1], seen[1].got),
        beside(want[0], seen[1].got)];
};
})()"""


def check_offer(tab, url):
    tab.go(url + "index.html?src=demo.saga")
    tab.wait("document.getElementById('player').viewer.drawn")
    if not tab.run("document.getElementById('player').$('headset').hidden"):
        complain("without a headset it is offered")
    tab.call("Page.addScriptToEvaluateOnNewDocument",
             source=npm.fetch(*IWER)["build/iwer.min.js"].decode() + INSTALL)
    tab.go(url + "index.html?src=demo.saga&camera=4")
    tab.wait("document.getElementById('player').viewer.drawn")
    tab.wait("!document.getElementById('player').$('headset').hidden")
    tab.run("void (window.viewer = "
            "document.getElementById('player').viewer)")
    verdict("offer")


def enter(tab):
    tab.run("window.session = null; "
            "document.getElementById('player').$('headset').click()")
    tab.wait("Boolean(window.session && viewer.wanted)")


# Returns how far the camera between the eyes is from `place`, in the capture's
# unit, and how much it looks up or down or aside of the viewer's camera.
START = """(async (place) => {
    const { dot, forwardOf, poseOf } = await import('/camera.js');
    const { rotation, centre } = poseOf(viewer.wanted);
    const ahead = forwardOf({ rotation }), was = forwardOf(viewer.pose);
    const off = viewer.toMetres(centre).map((x, i) => x - place[i]);

    return [Math.hypot(...off), dot(ahead, viewer.up), dot(was, viewer.up) ** 2 +
        dot(ahead, was) ** 2 - 1];
})"""


def check_start(tab):
    # A ball around the pivot, which ends at three quarters of the way to the
    # camera.
    for part, script in ((1, "null"), (0.75, """{
            pivot: focus, up: viewer.up, front: forwardOf(viewer.pose),
            azimuth: Math.PI, elevation: [-Math.PI / 2, Math.PI / 2],
            turn: Math.PI, quality: [0, 0],
            distance: [0, 0.75 * Math.hypot(...eye.map(
                (x, i) => x - focus[i]))] }""")):
        tab.run("""import('/camera.js').then(({ forwardOf }) => {
            const focus = viewer.toMetres(viewer.focus);
            const eye = viewer.toMetres(viewer.pose.centre);
            viewer.viewingVolume = %s;
            window.begins = focus.map((x, i) => x + %g * (eye[i] - x));
        })""" % (script, part))
        enter(tab)
        off = tab.run(START + "(begins)")
        # A ten-thousandth is the rounding of the camera's integers.
        if max(map(abs, off)) > 1e-4:
            complain("a session begins off by", off)
        tab.run("viewer.viewingVolume = null; session.end()")
        tab.wait("viewer.wanted === null")
    verdict("start")


def check_eyes(tab):
    enter(tab)
    tab.run(SHARED)
    told = []
    for head in ("", "device.position.x += 0.1; device.quaternion.set("
                 "0.05, 0.1, 0, Math.sqrt(1 - 0.0125));"):
        told.append(tab.run("(() => { %s return eyes(); })()" % head))
    for left, right, other in told:
        if min(left, right) < LEAST_DB or other > min(left, right) - 6:
            complain("left, right, left's picture in the right eye: dB",
                     left, right, other)
    verdict("eyes: %.1f, %.1f dB; %.1f, %.1f with the head turned" % (
        *told[0][:2], *told[1][:2]))


# A volume around the head, then one from whose end it is away by a factor of
# e^0.175, which is half of what makes the picture as dim as it gets, a quarter;
# then by e^1.
def check_fade(tab):
    tab.run("viewer.rate = 0; viewer.play()") # all pictures are of one time
    got = tab.run("""(async () => {
        const { poseOf } = await import('/camera.js');
        const [x, y, z] = viewer.toMetres(poseOf(viewer.wanted).centre);
        const told = [];

        for (const distance of [1, Math.exp(-0.175), Math.exp(-1)]) {
            viewer.viewingVolume = { pivot: [x, y, z + 1], up: [0, -1, 0],
                front: [0, 0, -1], azimuth: Math.PI,
                elevation: [-Math.PI / 2, Math.PI / 2], turn: Math.PI,
                quality: [0, 0],
                distance: [0, distance * (1 + 1e-6)] };
            told.push(await brightest(), viewer.playing);
        }
        viewer.viewingVolume = null;
        return [await brightest(), viewer.playing, ...told];
    })()""")
    paused = tab.run("""(async () => {
        const volume = { pivot: viewer.toMetres(viewer.focus), up: [0, -1, 0],
            front: [0, 0, -1], azimuth: Math.PI,
            elevation: [-Math.PI / 2, Math.PI / 2], turn: Math.PI,
            quality: [0, 0], distance: [0, 1e-3] };
        const told = [];

        viewer.viewingVolume = volume;
        await brightest();
        for (let i = 0; i < 2; i++) {
            session.dispatchEvent(new Event('select'));
            viewer.viewingVolume = volume;
            await brightest();
            told.push(viewer.playing);
            viewer.viewingVolume = null;
            await brightest();
            told.push(viewer.playing);
        }
        return told;
    })()""")
    if paused != [False, False, False, True]:
        complain("the button is pressed far outside, then inside; each time the "
                 "film plays outside, inside:", paused)
    tab.run("viewer.pause(); viewer.rate = 1")
    if got[1::2] != [True, True, True, False]:
        complain("without a volume, inside, outside, far outside the film "
                 "plays:", got[1::2])
    if any(abs(got[2 * i] - part * got[0]) > 2
           for i, part in enumerate((1, 1, 0.625, 0.25))):
        complain("there the eye's brightest sample is", got[::2])
    verdict("fade")


def check_clock(tab):
    tab.run("viewer.seek(0); viewer.play()")
    tab.wait("viewer.frame > 3 && viewer.drawn.num / viewer.drawn.den > 3")
    tab.run("session.dispatchEvent(new Event('select'))")
    if tab.run("viewer.playing"):
        complain("the headset's button does not pause")
    tab.run("session.dispatchEvent(new Event('select'))")
    if not tab.run("viewer.playing"):
        complain("the headset's button does not play")
    verdict("clock")


def check_leave(tab):
    tab.run("session.end()")
    tab.wait("viewer.wanted === null && viewer.screen.painter")
    before = tab.run("viewer.frame")
    tab.wait("viewer.frame !== %r" % before)
    tab.run("viewer.pause()")
    tab.wait("!viewer.busy && !viewer.stale && "
             "viewer.drawn.width === viewer.room[0]")
    verdict("leave")


def main():
    if checks.skips():
        return 0
    if not npm.is_there():
        print("ok   headset skipped: npm is not installed")
        return 0
    if npm.fetch(*IWER) is None:
        print("ok   headset skipped: the registry cannot be reached")
        return 0
    files = {name: read(os.path.join(WEB, name)) for name in os.listdir(WEB)}
    files["demo.saga"] = read("docs/demo.saga")
    server = browser.FileServer(files)
    with checks.tab() as tab:
        check_offer(tab, server.url)
        check_start(tab)
        check_eyes(tab)
        check_fade(tab)
        check_clock(tab)
        check_leave(tab)
    return 1 if checks.failed else 0


sys.exit(main())
