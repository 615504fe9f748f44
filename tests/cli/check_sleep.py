#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""check_sleep.py: guarantees, for players that nobody sees, in headless Chromium,
  scroll   of players in a long page only those that are seen, or nearly, have a
           worker and a context; one that is seen again is where it was, and
           plays on if it played
  context  a context that is given back and wanted again at once comes back, and
           one that is wanted and given back at once does not
  unseen   play() where nobody sees the film opens it and takes no context; the
           promise rejects at pause()
  stands   woken, the clock stands until a picture is drawn; asleep, no segments
           are here; a film that falls asleep while it waits does not tell that
           it plays
  again    if the server fails once when a player is woken, play() wakes it
  address  a relative address means the same after the page's own has changed
Without Chromium or the decoder in WebAssembly, the check prints that it was
skipped.
"""

import json
import os
import sys

from verdict import WEB, Verdicts, read
import browser  # noqa: E402  (verdict knows where)

DEMO = "demo.saga"

checks = Verdicts("sleep")
complain, verdict = checks.complain, checks.verdict


def expect(tab, what, script):
    got = tab.run(script)
    if got is not True:
        complain(what, repr(got))


# A page of players under each other, 120 pixels each. seen() returns those that
# are in the window; awake() the numbers of those that have a worker and of
# contexts; kept() those that rest and keep a context of their own.
SCROLL = """(async () => {
    await import('/player.js');
    window.players = Array.from({ length: %d }, (_, i) => {
        const player = document.createElement('saga-player');
        player.style = 'width: 160px; height: 120px; aspect-ratio: auto';
        player.setAttribute('camera', i %% 4);
        player.src = '/demo.saga';
        return player;
    });
    window.seen = () => players.filter((player) => {
        const { top, bottom } = player.getBoundingClientRect();
        return bottom > 0 && top < innerHeight;
    });
    window.awake = () => {
        const all = players.filter(({ viewer }) => viewer.worker);
        return [all.length, new Set(players.map(
            ({ viewer }) => viewer.ownScreen?.gl).filter(
            (gl) => gl && !gl.isContextLost())).size];
    };
    window.kept = () => players.filter(({ viewer }) => !viewer.worker &&
        viewer.ownScreen?.release && !viewer.ownScreen.gl.isContextLost());
    window.stand = () => seen().every(({ viewer }) => viewer.drawn &&
        !viewer.isAsleep &&
        (viewer.playing || !viewer.busy && !viewer.stale) &&
        viewer.read().data.some((x, i, all) => i %% 4 < 3 && x !== all[i %% 4]));
    document.body.replaceChildren(...players);
})()"""


def check_scroll(tab):
    n = 60 if "SAGA_TEST_LONG" in os.environ else 16
    tab.run(SCROLL % n)
    most = 0
    for top in [*range(0, 120 * n, 480), 0]:
        tab.run("scrollTo(0, %d)" % top)
        tab.wait("stand()", "JSON.stringify(players.map(({ viewer: v }) => "
                 "[Boolean(v.worker), Boolean(v.drawn), v.busy, v.isAsleep]))")
        if top == 0:
            tab.run("""(() => {
                const [first, second] = players;
                first.camera = 3;
                first.currentTime = 0.5;
                second.loop = true;
                second.viewer.orbit(0.2, 0);
                window.was = second.toState().replace(/frame=[0-9]+/, '');
            })()""" if not most else "0")
            tab.run("players[1].loop = true; players[1].viewer.loop = true; "
                    "void players[1].play()")
        # Four are in the window; half of it above and below are near.
        tab.wait("awake()[0] <= 9", "JSON.stringify(awake())")
        tab.wait("kept().length === 0", "kept().map((p) => players.indexOf(p))")
        most = max(most, *tab.run("awake()"))
    if tab.run("players[0].toState()") != "camera=3&frame=12" or \
            not tab.run("players[1].toState().replace(/frame=[0-9]+/, '') === "
                        "was && !players[1].paused"):
        complain("seen again, two players are at", tab.run(
            "players.slice(0, 2).map((p) => p.toState() + was)"))
    frame = tab.run("players[1].viewer.frame")
    tab.wait("players[1].viewer.frame !== %r" % frame)
    tab.run("document.body.replaceChildren()")
    # Canvases that share a context leave it for the next ones.
    tab.wait("awake()[0] === 0 && awake()[1] < 2", "awake().join()")
    verdict("scroll: %d players, at most %d awake" % (n, most))


# Makes a page with one element, which lies far below the window's end or not.
PUT = """(async () => {
    await import('/player.js');
    window.player = document.createElement('saga-player');
    window.told = [];
    for (const type of ['waiting', 'playing', 'error'])
        player.addEventListener(type, () => told.push(type));
    player.style = 'width: 400px; height: 300px; aspect-ratio: auto';
    window.hide = (is) => {
        player.style.marginTop = is ? '5000px' : '0px';
    };
    window.outcome = (promise) => promise.then(() => 'plays',
        ({ name }) => name);
    hide(%s);
    const given = %s;
    for (const name in given)
        player.setAttribute(name, given[name]);
    document.body.replaceChildren(player);
    window.viewer = player.viewer;
})()"""
ASLEEP = "viewer.isAsleep && viewer.screen.gl.isContextLost()"
SHOWN = """viewer.drawn && !viewer.busy && !viewer.stale &&
    viewer.read().data.some((x, i, all) => i % 4 < 3 && x !== all[i % 4])"""


def put(tab, url, is_hidden=False, **attributes):
    tab.go(url + "empty.html")
    tab.run(PUT % (json.dumps(is_hidden),
                   json.dumps({"src": DEMO, **attributes})))
    if not is_hidden:
        tab.wait(SHOWN)


def hide(tab):
    tab.run("hide(true)")
    tab.wait(ASLEEP)


def check_context(tab):
    told = tab.run("""(async () => {
        const { GpuScreen } = await import('/gpu.js');
        const screen = GpuScreen.open(document.createElement('canvas'));
        const wait = () => new Promise((resolve) => setTimeout(resolve, 200));
        const told = [];

        for (const calls of [['release', 'regain'], ['release'],
            ['regain', 'release'], ['regain'],
            ['release', 'regain', 'release'],
            ['regain', 'release', 'regain']]) {
            calls.forEach((call) => screen[call]());
            await wait();
            told.push(screen.gl.isContextLost() ===
                (calls.at(-1) === 'release'));
        }
        screen.release(true);
        return told;
    })()""")
    if told != [True] * 6:
        complain("contexts are as wanted:", told)
    verdict("context")


def check_unseen(tab, url):
    put(tab, url, is_hidden=True, preload="none", loop="")
    tab.run("void (window.end = outcome(player.play()))")
    tab.wait("viewer.playing && " + ASLEEP)
    tab.run("player.pause()")
    expect(tab, "play() and pause() where nobody sees it:",
           "Promise.race([end, new Promise((resolve) => setTimeout(resolve, "
           "1000))]).then((end) => end === 'AbortError' || end)")
    tab.run("hide(false)")
    tab.wait(SHOWN)
    verdict("unseen")


def check_stands(tab, url):
    put(tab, url, loop="")
    tab.run("player.play()")
    hide(tab)
    expect(tab, "asleep there are segments:",
           "player.buffered.length === 0 && player.readyState === 1")
    tab.run("""(() => {
        window.held = [];
        viewer.show = (drawn) => held.push(drawn);
        hide(false);
    })()""")
    tab.wait("held.length > 0")
    frame = tab.run("viewer.frame")
    tab.run("new Promise((resolve) => setTimeout(resolve, 500))")
    expect(tab, "without a picture, the clock goes on from %r to" % frame,
           "viewer.frame === %r && viewer.waiting || viewer.frame" % frame)
    tab.run("told.length = 0")
    hide(tab)
    expect(tab, "it falls asleep and tells", "told.length === 0 || told")
    tab.run("delete viewer.show; hide(false)")
    tab.wait("viewer.drawn && viewer.frame !== %r" % frame)
    verdict("stands")


def check_again(tab, server):
    put(tab, server.url, loop="")
    hide(tab)
    film, server.files[DEMO] = server.files[DEMO], 503
    tab.run("hide(false)")
    tab.wait("player.error && player.$('told').textContent")
    tab.run("new Promise((resolve) => setTimeout(resolve, 200))")
    server.files[DEMO] = film
    expect(tab, "after a failure play() comes to",
           "outcome(player.play()).then((end) => end === 'plays' || end)")
    expect(tab, "it still tells", "player.error === null && "
           "player.$('told').textContent === '' || "
           "player.$('told').textContent")
    verdict("again")


def check_address(tab, url):
    put(tab, url)
    hide(tab)
    tab.run("history.pushState(null, '', '/a/b'); hide(false)")
    tab.wait("player.error || " + SHOWN)
    expect(tab, "in another folder it tells",
           "player.error === null || player.error.message")
    verdict("address")


def main():
    if checks.skips():
        return 0
    files = {name: read(os.path.join(WEB, name)) for name in os.listdir(WEB)}
    files[DEMO] = read("docs/demo.saga")
    files["empty.html"] = b"<!doctype html><body>"
    server = browser.FileServer(files)
    with checks.tab() as tab:
        tab.go(server.url + "empty.html")
        check_scroll(tab)
        check_context(tab)
        check_unseen(tab, server.url)
        check_stands(tab, server.url)
        check_again(tab, server)
        check_address(tab, server.url)
    return 1 if checks.failed else 0


sys.exit(main())
