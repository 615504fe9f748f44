#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""check_player.py: guarantees, for the drawing by the graphics processor and
the player of ports/web, in headless Chromium with WebGL2 in software,
  near        pictures that the graphics processor draws have a PSNR of at least
              45 dB against the decoder's, and no sample differs by more than 3:
              for every good vector, three cameras, three times; for the demo
              also in the size of a window
  clear       a picture without background, laid over that background here, is
              the opaque one, also in a context that canvases share; the element
              does so with background="transparent"
  call        a picture is drawn by one draw call of all its splats
  window      pictures fill the element, at the resolution of the device; exact
              pictures have the camera's size and the decoder's bits
  many        17 canvases on a page, more than a browser has contexts of WebGL,
              all keep their picture. A player that is moved goes on; one that
              was removed gives its context back, and shows the film again when
              it is put back
  lost        if the browser takes a context and gives it back, its picture comes
              back and plays on, also where canvases share the context
  leaks       after many changes of src there are as many workers, listeners and
              nodes as after a few
  large       of cameras with 16,384 x 16,384 pixels it draws what the window has
  pace        pictures get smaller on a slow machine, and are sharp at rest;
              they do not get smaller if the worker takes most of the time, or
              if the device shows few pictures however small they are
  element     attributes, properties and events work as documented; users who
              prefer reduced motion get no autoplay
  video       it behaves as a <video>: play() opens and resolves or rejects, a
              pause() before the film is open wins, readyState, buffered,
              seeking, an error with a code; arrow keys on the bar seek and
              leave the camera alone
  keys, touch keys and fingers move the camera, also in a tall window
  state       a line of text stores camera and time, from which they are
              restored; so does the page's address
  names       everything that can be focused has a name and a role
Without Chromium or the decoder in WebAssembly, the check prints that it was
skipped.
"""

import json
import os
import sys

from verdict import WEB, Verdicts, read
import browser  # noqa: E402  (verdict knows where)
import film  # noqa: E402

GOOD = "vectors/good/"
LEAST_DB, MOST_OFF = 45, 3
DEMO = "demo.saga"

checks = Verdicts("player")
complain, verdict = checks.complain, checks.verdict

# near(source, [[values or index of a camera, size or null]]): returns the PSNR
# of the GPU's pictures against the decoder's at the first, middle and last
# frame.
NEAR = """
async function near(source, places) {
    const { SagaFile } = await import('/saga.js');
    const { GpuScreen } = await import('/gpu.js');
    const { fitted } = await import('/camera.js');
    const file = await SagaFile.open(source);
    const screen = GpuScreen.open(document.createElement('canvas'));
    const told = [];

    if (!screen?.takesSplats)
        throw new Error('no WebGL2');
    for (const [camera, size] of places) {
        if (camera >= file.rig.length)
            continue;
        let values = file.rig[camera].values;
        if (size)
            values = fitted(values, ...size);
        for (const part of [0, 0.37, 1]) {
            const last = file.info.nFrames - 1, num = Math.round(64 * last *
            part); const { rgba } = await file.draw({ values }, num, 64);
            const want = Uint8Array.from(rgba);
            screen.showSplats(await file.splats({ values }, num, 64));
            const got = screen.read().data;
            let sum = 0, most = 0;
            for (let i = 0; i < want.length; i++) {
                const d = want[i] - got[i];
                sum += d * d;
                most = Math.max(most, Math.abs(d));
            }
            told.push([camera, num / 64, want.length === got.length
                ? 10 * Math.log10(255 * 255 / Math.max(
                    1e-9, sum / (want.length / 4 * 3))) : 0, most]);
        }
    }
    return told;
}
"""


def check_near(tab, names):
    worst, most = 999, 0
    for name in names:
        places = "[[0], [1, [640, 360]]]" if name == DEMO else \
            "[[0], [1], [2]]"
        told = tab.run("""(async () => { %s
            return near('/%s', %s); })()""" % (NEAR, name, places))
        worst = min([worst, *(db for _, _, db, _ in told)])
        most = max([most, *(d for _, _, _, d in told)])
        if worst < LEAST_DB or most > MOST_OFF:
            complain(name, "drawn from splats has", json.dumps(told))
            break
    verdict("near: %d files, at least %.1f dB, at most %d off" %
            (len(names), worst, most))


# clear(): how far, in levels, pictures without background are off the opaque
# ones when they are laid over their background: on a canvas with a context of
# its own, and on one that shares it; and how much of them is opaque.
CLEAR = """
async function clear() {
    const { SagaFile } = await import('/saga.js');
    const { GpuScreen } = await import('/gpu.js');
    const file = await SagaFile.open('/motion.saga');
    const screens = Array.from({ length: 8 }, () =>
        GpuScreen.open(document.createElement('canvas')));
    const told = [];

    for (const screen of [screens[0], screens[7]])
        for (const frame of [0, 7]) {
            const splats = await file.splats(file.rig[0], frame);
            screen.transparent = false;
            screen.showSplats(splats);
            const want = screen.read().data;
            screen.transparent = true;
            screen.showSplats(splats);
            const got = screen.read().data;
            let most = 0, sum = 0;
            for (let i = 0; i < want.length; i++) {
                const a = got[i | 3] / 255;
                const b = 255 * splats.background[i % 4];
                if (i % 4 < 3)
                    most = Math.max(most, Math.abs(
                        a * got[i] + (1 - a) * b - want[i]));
                sum += i % 4 < 3 ? 0 : a / (want.length / 4);
            }
            told.push([screen.constructor.name, most, sum]);
        }
    screens.forEach((screen) => screen.release?.(true));
    return told;
}
"""


def check_clear(tab):
    told = tab.run("(async () => { %s return clear(); })()" % CLEAR)
    if [name for name, _, _ in told] != ["GpuScreen"] * 2 + \
            ["SharedScreen"] * 2 or any(
                most > MOST_OFF or not 0.01 < alpha < 0.95
                for _, most, alpha in told):
        complain("pictures without background:", json.dumps(told))
    put(tab, background="transparent")
    see = "[player.viewer.transparent, " \
        "getComputedStyle(player).backgroundColor]"
    shown = tab.run(see)
    tab.run("player.removeAttribute('background')")
    if [shown, tab.run(see)] != [[True, "rgba(0, 0, 0, 0)"],
                                 [False, "rgb(0, 0, 0)"]]:
        complain("the element:", shown, tab.run(see))
    verdict("clear")


# --- The element -----------------------------------------------------------

# Makes a page with one element of 400x300 that has these attributes.
PUT = """(async () => {
    await import('/player.js');
    window.player = document.createElement('saga-player');
    window.told = [];
    for (const type of ['loadstart', 'durationchange', 'loadedmetadata',
        'loadeddata', 'canplay', 'play', 'playing', 'pause', 'ended',
        'timeupdate', 'seeking', 'seeked', 'error'])
        player.addEventListener(type, () => told.push(type));
    player.style = 'width: 400px; height: 300px; aspect-ratio: auto';
    const given = %s;
    for (const name in given)
        player.setAttribute(name, given[name]);
    document.body.replaceChildren(player);
    window.viewer = player.viewer;
})()"""


def put(tab, **attributes):
    tab.run(PUT % json.dumps({"src": "/" + DEMO, **attributes}))
    settle(tab)


def settle(tab):
    """Waits until a picture has been drawn and, unless the film plays, no other
    is needed. On a slow machine a film that plays always needs another one."""
    tab.wait("viewer.drawn && (viewer.playing || !viewer.busy && !viewer.stale)",
             """(({ info, drawn, busy, stale, playing, waiting, frame, asked }) =>
             JSON.stringify({ open: Boolean(info), drawn, busy, stale, playing,
                 waiting, frame, asked, exact: viewer.exact,
                 lost: viewer.screen.gl?.isContextLost(),
                 text: document.querySelector('saga-player')
                     ?.$('told').textContent }))(viewer)""")


def expect(tab, what, script):
    got = tab.run(script)
    if got is not True:
        complain(what, repr(got))


def check_call(tab):
    put(tab)
    counts = tab.run("""(async () => {
        const { gl } = viewer.screen;
        const real = gl.drawArraysInstanced.bind(gl);
        const counts = [];

        gl.drawArraysInstanced = (mode, first, n, copies) => {
            counts.push([n, copies]);
            real(mode, first, n, copies);
        };
        viewer.seek(7);
        await new Promise((resolve) => viewer.addEventListener('drawn', resolve,
            { once: true }));
        return [counts, viewer.drawn.nSplats];
    })()""")
    if counts[0] != [[4, counts[1]]] or counts[1] < 1000:
        complain("a picture takes the draw calls", counts)
    verdict("call")


def check_window(tab):
    for sharp in (2, 1):
        tab.call("Emulation.setDeviceMetricsOverride", width=640, height=480,
                 deviceScaleFactor=sharp, mobile=False)
        put(tab)
        tab.wait("viewer.drawn.width === %d && viewer.drawn.height === %d" %
                 (400 * sharp, 300 * sharp))
        expect(tab, "the canvas does not fill the element:", """
            [player.canvas.clientWidth, player.canvas.clientHeight].join() ===
            '400,300' || player.canvas.clientWidth""")
    put(tab, draw="exact")
    expect(tab, "an exact picture has not the decoder's bits:", """
        (async () => {
            const { SagaFile } = await import('/saga.js');
            const file = await SagaFile.open('/demo.saga');
            const { rgba } = await file.draw(file.rig[0], 0);
            const got = viewer.read().data;
            return viewer.drawn.width === 320 && got.length === rgba.length &&
                got.every((x, i) => x === rgba[i]);
        })()""")
    verdict("window")


# Shows a picture in each of 17 canvases. Returns the sums of their samples, and
# that of the first one after it has given back its context and taken another.
MANY = """(async () => {
    const { SagaFile } = await import('/saga.js');
    const { GpuScreen } = await import('/gpu.js');
    const file = await SagaFile.open('/still.saga');
    const splats = await file.splats(file.rig[0], 0);
    const made = { ...splats, bytes: Uint8Array.from(splats.bytes) };
    const sum = (screen) => screen.read().data.reduce((a, b) => a + b, 0);
    const canvases = Array.from({ length: 17 },
        () => document.createElement('canvas'));

    document.body.replaceChildren(...canvases);
    await new Promise((resolve) => setTimeout(resolve, 100));
    const screens = canvases.map((canvas) => GpuScreen.open(canvas));
    for (const screen of screens)
        screen.showSplats(made);
    await new Promise((resolve) => setTimeout(resolve, 200));
    const sums = screens.map(sum);
    const again = new Promise((resolve) => canvases[0].addEventListener(
        'webglcontextrestored', resolve, { once: true }));

    screens[0].release?.();
    await new Promise((resolve) => setTimeout(resolve, 100));
    const lost = screens[0].gl.isContextLost();

    screens[0].regain?.();
    if (lost)
        await Promise.race([again,
            new Promise((resolve) => setTimeout(resolve, 5000))]);
    screens[0].showSplats(made);
    const told = [...sums, sum(screens[0]), lost];

    screens.forEach((screen) => screen.release?.(true));
    return told;
})()"""


def check_many(tab):
    *sums, again, lost = tab.run(MANY)
    if len(sums) != 17 or len({*sums, again}) != 1 or not lost:
        complain("the canvases have the sums", sums, again, lost)
    put(tab)
    tab.run("window.other = document.createElement('div'); "
            "window.worker = viewer.worker; document.body.append(other); "
            "other.append(player)")
    tab.run("new Promise((resolve) => setTimeout(resolve, 100))")
    expect(tab, "a player that is moved opens its film again:",
           "viewer.worker === worker && viewer.info !== null")
    tab.run("player.remove(); new Promise((resolve) => setTimeout(resolve, "
            "100))")
    expect(tab, "a player that was removed keeps its worker or context:",
           "viewer.worker === null && viewer.screen.gl.isContextLost()")
    tab.run("document.body.append(player)")
    settle(tab)
    expect(tab, "a player that was put back shows", """(() => {
        const { data } = viewer.read();
        return data.some((x, i) => i % 4 < 3 && x !== data[i % 4]);
    })()""")
    verdict("many")


# Takes the context of a canvas as a browser does that has too little memory.
LOST = """(async () => {
    const { gl } = viewer.screen, loser = gl.getExtension('WEBGL_lose_context');
    const sum = () => viewer.read().data.reduce((a, b) => a + b, 0);
    const wait = (ms) => new Promise((resolve) => setTimeout(resolve, ms));
    const until = async (is) => {
        for (let i = 0; i < 300 && !is(); i++)
            await wait(20);
    };
    const told = [viewer.screen.constructor.name, sum()];

    loser.loseContext();
    await wait(100);
    loser.restoreContext();
    await until(() => !gl.isContextLost());
    await wait(50);
    await until(() => !viewer.busy && !viewer.stale);
    told.push(sum());
    viewer.loop = true;
    viewer.play();
    loser.loseContext();
    await wait(100);
    loser.restoreContext();
    await until(() => !gl.isContextLost());
    const { frame } = viewer;
    await until(() => viewer.frame !== frame);
    viewer.pause();
    viewer.seek(0);
    await wait(50);
    await until(() => !viewer.busy && !viewer.stale);
    return [...told, sum(), viewer.frame, frame];
})()"""


def check_lost(tab):
    for others in (0, 8):
        tab.run("""(async () => {
            const { GpuScreen } = await import('/gpu.js');
            document.body.replaceChildren();
            await new Promise((resolve) => setTimeout(resolve, 100));
            window.others = Array.from({ length: %d },
                () => GpuScreen.open(document.createElement('canvas')));
        })()""" % others)
        put(tab)
        name, *sums, at, frame = tab.run(LOST)
        if name != ("SharedScreen" if others else "GpuScreen") or \
                len({*sums}) != 1:
            complain("a lost context", name, sums, at, frame)
        tab.run("others.forEach((screen) => screen.release?.(true))")
    verdict("lost")


def check_leaks(tab):
    n = 50 if "SAGA_TEST_LONG" in os.environ else 12
    tab.call("Performance.enable")
    put(tab)
    names = ("JSEventListeners", "Nodes", "Documents")

    def count():
        tab.call("HeapProfiler.collectGarbage")
        found = {m["name"]: m["value"]
                 for m in tab.call("Performance.getMetrics")["metrics"]}
        return [found[name] for name in names] + [tab.n_workers()]
    for i in range(n + 3):
        if i == 3:
            before = count()
        tab.run("viewer.drawn = null; player.src = '/%s?%d'" % (
            "still.saga" if i % 2 else DEMO, i))
        settle(tab)
    after = count()
    if after != before:
        complain("listeners, nodes, documents and workers are", after, "not",
                 before, "after", n, "changes of src")
    verdict("leaks: %d changes of src" % n)


def check_large(tab):
    for draw in ("", "exact"):
        put(tab, src="/large.saga", draw=draw)
        width, height = tab.run("[viewer.drawn.width, viewer.drawn.height]")
        if width > 400 or height > 300 or max(width, height) < 300:
            complain("of a large camera it draws", width, "x", height, draw)
    verdict("large")


# Simulates a machine that needs `per` ms for a picture of full size, `work` of
# them in the worker; returns the scale that Pace chooses.
PACE = """(async () => {
    const { Pace } = await import('/pace.js');
    const run = (pace, n, per, work, least = 16.7) => {
        let now = 0;
        for (let i = 0; i < n; i++) {
            now += Math.max(least, work, per * pace.scale ** 2);
            pace.note(now, work);
        }
        return pace.scale;
    };
    const back = new Pace(), hot = new Pace();
    return [run(new Pace(), 900, 10, 3), run(new Pace(), 900, 40, 3),
        run(new Pace(), 900, 900, 3), run(new Pace(), 900, 40, 39),
        (run(back, 300, 40, 3), back.pause(), run(back, 900, 5, 3)),
        run(new Pace(), 900, 5, 3, 33.3), run(new Pace(), 900, 60, 3, 33.3),
        (run(hot, 300, 5, 3, 33.3), run(hot, 900, 60, 3, 33.3))];
})()"""


def check_pace(tab):
    fast, slow, worst, worker, back, saves, both, hot = tab.run(PACE)
    # 40 ms at full size are 16.4 ms at a scale of 0.64.
    # Of a device that shows 30 pictures a second at most, those that need 60 ms
    # come in time at a scale of 0.74, and faster at none.
    if fast != 1 or not 0.5 < slow < 0.9 or worst != 0.35 or worker != 1 or \
            back != 1 or saves != 1 or not 0.3 < both < 0.75 or \
            not 0.3 < hot < 0.75:
        complain("pace comes to", fast, slow, worst, worker, back, saves, both,
                 hot)
    put(tab)
    tab.run("""(() => {
        window.widths = [];
        viewer.addEventListener('drawn', () => widths.push(viewer.drawn.width));
        viewer.pace.scale = 0.5;
        viewer.orbit(0.1, 0);
    })()""")
    tab.wait("widths.length > 1")
    expect(tab, "widths while it moves, and after:",
           "widths.join() === '200,400' || widths")
    verdict("pace")


def check_element(tab):
    put(tab, camera="2", loop="")
    expect(tab, "camera=2 is not obeyed:", "player.camera === 2")
    expect(tab, "without the attribute camera it goes to", """(() => {
        viewer.viewingVolume = { start: 3 };
        player.removeAttribute('camera');
        viewer.viewingVolume = null;
        return player.camera === 3 || player.camera;
    })()""")
    expect(tab, "without autoplay it plays:", "player.paused")
    expect(tab, "duration is", "player.duration === 1 || player.duration")
    tab.run("player.currentTime = 0.5")
    settle(tab)
    expect(tab, "currentTime is", "player.currentTime === 0.5")
    tab.run("player.removeAttribute('loop'); player.playbackRate = 2; "
            "told.length = 0; player.play()")
    tab.wait("told.includes('ended')")
    expect(tab, "events:", """['play', 'timeupdate', 'pause', 'ended'].every(
        (type) => told.includes(type)) && player.paused || told""")
    put(tab, autoplay="", loop="")
    tab.wait("player.currentTime > 0")
    expect(tab, "autoplay does not play:", "!player.paused")
    tab.call("Emulation.setEmulatedMedia", features=[
        {"name": "prefers-reduced-motion", "value": "reduce"}])
    put(tab, autoplay="")
    expect(tab, "little motion, but it plays:", "player.paused")
    tab.call("Emulation.setEmulatedMedia", features=[])
    tab.run("player.src = '/none.saga'")
    tab.wait("told.includes('error') && "
             "player.$('told').textContent.includes('404')")
    expect(tab, "the error is", "player.error.code === 4 && "
           "player.error.message.includes('404') || player.error")
    verdict("element")


# What a page that knows <video> does, and what it may expect.
def check_video(tab):
    tab.run(PUT % json.dumps({"preload": "none", "controls": "",
                              "src": "/" + DEMO}))
    expect(tab, "preload=none opens:", "player.readyState === 0")
    expect(tab, "play() does not open and play:", """player.play().then(() =>
        !player.paused && player.readyState === 4 && ['loadstart',
            'durationchange', 'loadedmetadata', 'loadeddata', 'canplay', 'play',
            'playing'].every((type) => told.includes(type)) || told)""")
    expect(tab, "buffered is", """player.buffered.length === 1 &&
        player.buffered.start(0) === 0 && player.buffered.end(0) ===
        player.duration || player.buffered.length""")
    expect(tab, "a seek tells", """(player.pause(), told.length = 0,
        new Promise((resolve) => {
            player.addEventListener('seeked', () => resolve(
                told.join() === 'seeking,timeupdate,seeked' &&
                player.currentTime === 0.75 && !player.seeking || told),
                { once: true });
            player.currentTime = 0.75;
        }))""")
    tab.run("player.$('play').focus()")
    before = tab.run("viewer.pose")
    for key, time in (("End", 23 / 24), ("ArrowLeft", 0), ("ArrowRight", 23 / 24),
                      ("Home", 0)):
        press(tab, key)
        settle(tab)
        if abs(tab.run("player.currentTime") - time) > 1e-9 or \
                tab.run("viewer.pose") != before:
            complain(key, "on the bar leads to", tab.run("player.currentTime"))
    expect(tab, "an interrupted play() gives", """(() => {
        const told = player.play();
        player.pause();
        return told.then(() => 'nothing', (e) => e.name === 'AbortError' || e);
    })()""")
    # In one go, since a film is open within a few messages.
    for given in {"preload": "none"}, {"autoplay": ""}:
        expect(tab, "play() before the film is open, and pause(), give", """
            (async () => {
                await %s;
                const first = player.play().catch((e) => e.name);
                const asked = !player.paused;
                player.pause();
                const isOpen = Boolean(player.info), isOff = player.paused;
                return await first === 'AbortError' && asked && isOff &&
                    !isOpen || [await first, asked, isOff, isOpen];
            })()""" % (PUT % json.dumps({"src": "/" + DEMO, **given})))
        settle(tab)
        expect(tab, "then the film is not paused:", "player.paused && "
               "!told.includes('play') || told")
    expect(tab, "play(), pause(), play() give", """(async () => {
        const first = player.play().catch((e) => e.name);
        player.pause();
        await player.play();
        return await first === 'AbortError' && !player.paused || await first;
    })()""")
    expect(tab, "play() of a film that another replaces gives", """
        (async () => {
            player.src = '/%s?a';
            const first = player.play().catch((e) => e.name);
            player.src = '/%s?b';
            return await first === 'AbortError' || await first;
        })()""" % (DEMO, DEMO))
    expect(tab, "play() after that does not play:",
           "player.play().then(() => !player.paused)")
    expect(tab, "play() of nothing gives", """(() => {
        player.src = '/none.saga';
        return player.play().then(() => 'nothing',
            (e) => e.message.includes('404') || e);
    })()""")
    verdict("video")


def press(tab, key, **more):
    text = {"text": key} if len(key) == 1 else {}
    tab.call("Input.dispatchKeyEvent", type="keyDown", key=key, **text, **more)
    tab.call("Input.dispatchKeyEvent", type="keyUp", key=key, **more)


DISTANCE = ("Math.hypot(...viewer.pose.centre.map((c, i) => "
            "c - viewer.pivot[i]))")


def check_keys(tab):
    put(tab)
    tab.run("player.canvas.focus()")
    for key in ("ArrowLeft", "ArrowRight", "ArrowUp", "ArrowDown", "w", "s",
                "a", "d", "q", "e"):
        tab.run("viewer.selectCamera(0)")
        before = tab.run("viewer.pose")
        far = tab.run(DISTANCE)
        press(tab, key)
        after = tab.run("viewer.pose")
        turns = before["rotation"] != after["rotation"]
        nearer = tab.run(DISTANCE) / far
        if before["centre"] == after["centre"] or \
                turns != key.startswith("Arrow") or \
                (abs(nearer - 1) > 1e-6) != (key in "ws") or \
                (key == "w") != (nearer < 0.99):
            complain(key, "moves the camera from", before, "to", after)
    press(tab, "3")
    expect(tab, "3 does not choose a camera:", "player.camera === 2")
    press(tab, ".")
    press(tab, " ")
    expect(tab, "space does not play:", "!player.paused")
    press(tab, " ")
    expect(tab, "space does not pause:", "player.paused")
    press(tab, "g")
    settle(tab)
    tab.wait("viewer.drawn.gpu === false && viewer.drawn.width === 320")
    press(tab, "g")
    tab.wait("viewer.drawn.gpu === true && viewer.drawn.width === 400")
    verdict("keys")


def touch(tab, kind, *points):
    tab.call("Input.dispatchTouchEvent", type=kind, touchPoints=[
        {"x": x, "y": y, "id": i} for i, (x, y) in enumerate(points)])


def check_touch(tab):
    tab.call("Emulation.setDeviceMetricsOverride", width=360, height=640,
             deviceScaleFactor=2, mobile=True)
    tab.call("Emulation.setTouchEmulationEnabled", enabled=True)
    put(tab)
    tab.run("player.style = 'position: fixed; inset: 0; aspect-ratio: auto'")
    tab.wait("viewer.drawn.width === 720 && viewer.drawn.height === 1280")
    far, before = tab.run(DISTANCE), tab.run("viewer.pose.rotation")
    touch(tab, "touchStart", (180, 300))
    touch(tab, "touchMove", (165, 300))
    touch(tab, "touchMove", (140, 300))
    touch(tab, "touchEnd")
    if tab.run("viewer.pose.rotation") == before or \
            abs(tab.run(DISTANCE) / far - 1) > 1e-6:
        complain("a finger does not orbit")
    touch(tab, "touchStart", (150, 300), (210, 300))
    touch(tab, "touchMove", (120, 300), (240, 300))
    touch(tab, "touchEnd")
    if not 0.4 < tab.run(DISTANCE) / far < 0.7:
        complain("two fingers come to", tab.run(DISTANCE) / far)
    tab.call("Emulation.setTouchEmulationEnabled", enabled=False)
    tab.call("Emulation.setDeviceMetricsOverride", width=640, height=480,
             deviceScaleFactor=1, mobile=False)
    verdict("touch")


def check_state(tab, url):
    put(tab)
    tab.run("viewer.selectCamera(3); viewer.seek(5)")
    expect(tab, "the state of a camera is", "player.toState() === "
           "'camera=3&frame=5' || player.toState()")
    tab.run("viewer.orbit(0.3, 0.1); viewer.dolly(0.8)")
    line = tab.run("player.toState()")
    before = tab.run("Array.from(viewer.values())")
    tab.run("viewer.selectCamera(0); viewer.seek(0)")
    expect(tab, "the state is refused:", "player.setState(%s)" %
           json.dumps(line))
    after = tab.run("Array.from(viewer.values())")
    # The page's address holds seven digits of each number.
    if max(abs(a - b) for a, b in zip(before[:9], after[:9])) > 2 ** 12 or \
            max(abs(a - b) for a, b in zip(before[9:12], after[9:12])) > 64 or \
            tab.run("viewer.frame") != 5:
        complain("a state comes back as", before, after)
    for bad in ("", "eye=1,2", "frame=x", "fov=40&eye=1,2,3&target=1,2,3"):
        expect(tab, "obeys " + bad, "!player.setState(%s)" % json.dumps(bad))
    tab.go(url + "index.html?src=%s#%s" % (DEMO, line))
    settle(tab)
    shown = tab.run("Array.from(viewer.values())")[:12]
    if max(abs(a - b) for a, b in zip(shown, after)) > 2 ** 12 or \
            tab.run("viewer.frame") != 5:
        complain("the address is obeyed as", shown, "not", after)
    tab.run("viewer.selectCamera(1)")
    tab.wait("location.hash === '#camera=1&frame=5'")
    tab.run("location.hash = 'camera=2&frame=9'")
    tab.wait("viewer.camera === 2 && viewer.frame === 9")
    verdict("state")


def check_names(tab):
    put(tab, controls="")
    nodes = tab.call("Accessibility.getFullAXTree")["nodes"]
    named = {}
    for node in nodes:
        is_focusable = any(p["name"] == "focusable" and p["value"]["value"]
                           for p in node.get("properties", []))
        if is_focusable and node["role"]["value"] != "RootWebArea":
            named.setdefault(node["role"]["value"], []).append(
                node["name"]["value"])
    want = {"button": ["Play (space)", "Back to the camera (R)",
                       "Full screen (F)"], "slider": ["time"],
            "combobox": ["camera", "speed"]}
    for role, names in want.items():
        if named.get(role) != names:
            complain("of the role", role, "there are", named.get(role))
    if not any("drag" in name for name in named.get("image", []) +
               named.get("img", [])):
        complain("the canvas has no name:", named)
    verdict("names")


def main():
    if checks.skips():
        return 0
    files = {name: read(os.path.join(WEB, name)) for name in os.listdir(WEB)}
    names = sorted(os.listdir(GOOD))
    files.update({name: read(GOOD + name) for name in names})
    files[DEMO] = read("docs/demo.saga")
    still = film.Edit(film.Film("vectors", "good/still.saga"))
    for i in range(still.film.get("header.n_cameras")):
        still.set("camera%d.width" % i, 16384)
        still.set("camera%d.height" % i, 16384)
    files["large.saga"] = still.whole()
    files["empty.html"] = (
        b"<!doctype html><meta name=viewport content=width=device-width><body>")
    server = browser.FileServer(files)
    with checks.tab() as tab:
        tab.go(server.url + "empty.html")
        check_call(tab)
        check_window(tab)
        check_clear(tab)
        check_many(tab)
        check_lost(tab)
        check_leaks(tab)
        check_large(tab)
        check_pace(tab)
        check_element(tab)
        check_video(tab)
        check_keys(tab)
        check_touch(tab)
        check_names(tab)
        check_state(tab, server.url)
        check_near(tab, names + [DEMO])
    return 1 if checks.failed else 0


sys.exit(main())
