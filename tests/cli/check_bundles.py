#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""check_bundles.py: guarantees, for the packages that `make npm` packs,
  vite, esbuild, webpack, rollup
              each of them bundles an app with the element, the library,
              three.js and PlayCanvas; in Chromium the app shows the picture of
              vectors/MANIFEST, and its worker decodes ahead of time
  policies    the element plays under a strict Content-Security-Policy with
              Trusted Types, from a module of another server, and in a sandboxed
              frame; what a policy forbids is named in the message
  server      what a server that renders pages imports needs no window
Bundlers and engines come from npm in fixed versions. Without npm or Chromium
the check prints that it was skipped."""

import os
import shutil
import subprocess
import sys
import tempfile

from verdict import WEB, Verdicts, read
import browser  # noqa: E402  (verdict knows where)
import npm  # noqa: E402

VERSIONS = ("vite@8.3.8", "esbuild@0.28.2", "webpack@5.113.0",
            "webpack-cli@7.3.1", "rollup@4.68.8",
            "@rollup/plugin-node-resolve@16.0.3", "three@0.187.0",
            "playcanvas@2.23.3")
FILM = "vectors/good/segments.saga"
PORTS = ("web", "three", "playcanvas")
# The checksum of its first frame by its first camera.
with open("vectors/MANIFEST") as f:
    CRC = [line.split()[-1] for line in f
           if line.startswith("good/segments.saga")][0]

APP = """
import 'saga-web/player.js';
import { SagaFile } from 'saga-web';
import { SagaMesh } from 'saga-three';
import * as playcanvas from 'saga-playcanvas';

window.engines = [SagaMesh, ...Object.values(playcanvas)];
window.SagaFile = SagaFile;
"""

# Plays the film in the element until a segment comes that was decoded ahead of
# time; returns the CRC of the first picture, by the element and by the library.
PLAY = """(async () => {
    const player = document.createElement('saga-player');
    const { viewer } = player;
    const drawn = (is) => new Promise((resolve) => viewer.addEventListener(
        'drawn', () => is(viewer.drawn) && resolve(viewer.drawn.crc)));

    player.setAttribute('draw', 'exact');
    document.body.append(player);
    viewer.wantCrc = true;
    const first = drawn(() => true);
    await player.open(new URL('film.saga', FROM).href);
    const told = [await first];
    const ahead = drawn((picture) => picture.ahead);
    viewer.loop = true;
    player.play();
    await ahead;
    player.pause();
    if (window.SagaFile) {
        const file = await SagaFile.open(new URL('film.saga', FROM).href);
        await file.draw(file.rig[0], 0);
        told.push(file.crc());
    }
    return told;
})().catch((error) => [error.message])"""

# {bundler: (command, folder of what it makes, files that are copied there)}.
WASM = ("saga.wasm", "saga_simd.wasm")
BUNDLERS = {
    "vite": (["vite", "build", "--outDir", "vite", "--logLevel", "error"], ()),
    "esbuild": (["esbuild", "app=app.js", "worker=saga-web/worker.js",
                 "--bundle", "--format=esm", "--minify", "--outdir=esbuild",
                 "--log-level=error"], WASM),
    "webpack": (["webpack", "--mode", "production", "--entry", "./app.js",
                 "-o", "webpack", "--output-filename", "app.js",
                 "--performance-hints", "false"], ()),
    "rollup": (["rollup", "app.js", "node_modules/saga-web/worker.js", "-p",
                "@rollup/plugin-node-resolve", "-d", "rollup", "--silent"],
               WASM),
}

checks = Verdicts("bundles")
complain, verdict = checks.complain, checks.verdict


def install():
    """Returns the folder with the bundlers, or None."""
    folder = os.path.abspath(os.path.join(npm.FOLDER, "bundles"))
    if not os.path.exists(folder + "/node_modules/.bin/vite"):
        os.makedirs(folder, exist_ok=True)
        done = subprocess.run(
            ["npm", "install", "--ignore-scripts", "--no-save", "--silent",
             "--no-audit", "--no-fund", "--prefix", folder, *VERSIONS],
            stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, timeout=600)
        if done.returncode:
            shutil.rmtree(folder)
            return None
    return folder


def make_app(bundlers, folder):
    """Writes an app that uses the packages as an installed one would."""
    modules = folder + "/node_modules"
    os.mkdir(modules)
    for name in os.listdir(bundlers + "/node_modules"):
        os.symlink(os.path.join(bundlers, "node_modules", name),
                   os.path.join(modules, name))
    for port in PORTS:
        shutil.copytree(os.path.join(WEB, "..", port),
                        modules + "/saga-" + port)
    for name, text in (
            ("app.js", APP), ("package.json", '{"type": "module"}'),
            ("index.html", '<!doctype html><meta charset="utf-8"><body>'
             '<script type="module" src="app.js"></script>')):
        with open(os.path.join(folder, name), "w") as f:
            f.write(text)


def files_in(folder):
    return {os.path.relpath(os.path.join(at, name), folder):
            read(os.path.join(at, name))
            for at, _, names in os.walk(folder) for name in names}


def play(tab, server, page="index.html", origin=None):
    """Returns the checksums of the pictures, or a message."""
    tab.go(server.url + page)
    tab.wait("customElements.get('saga-player')")
    return tab.run(PLAY.replace("FROM", "'%s'" % (origin or server).url))


def expect(told, what):
    if not told or any(crc != CRC for crc in told):
        complain(what, "shows", told, "instead of", CRC)


# --- Bundlers --------------------------------------------------------------

def check_bundler(tab, app, name):
    command, copied = BUNDLERS[name]
    done = subprocess.run(
        ["node_modules/.bin/" + command[0], *command[1:]], cwd=app,
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT, timeout=600)
    if done.returncode or b"arning" in done.stdout:
        complain(name, done.stdout.decode())
    else:
        files = files_in(os.path.join(app, name))
        files.update({c: read(os.path.join(WEB, c)) for c in copied})
        files.setdefault("index.html", read(app + "/index.html"))
        files["film.saga"] = read(FILM)
        server = browser.FileServer(files)
        expect(play(tab, server), name)
        if not tab.run("engines.length > 1"):
            complain(name, "has no engines")
        server.shutdown()
    verdict(name)


# --- Pages -----------------------------------------------------------------

STRICT = ("default-src 'none'; connect-src 'self'; worker-src 'self'; "
          "script-src 'self' 'wasm-unsafe-eval'; style-src 'self'; "
          "require-trusted-types-for 'script'; trusted-types saga")
# A policy, and what the message names.
FORBIDDEN = (
    ("script-src 'self'", "'wasm-unsafe-eval'"),
    ("worker-src 'none'", "worker-src"),
)


def site(script="player.js", policy=None, share=False):
    """Returns a server of a page with the library and the film."""
    files = {n: read(os.path.join(WEB, n)) for n in os.listdir(WEB)}
    files["film.saga"] = read(FILM)
    files["index.html"] = (
        '<!doctype html><meta charset="utf-8"><body>'
        '<script type="module" src="%s"></script>' % script).encode()
    files["frame.html"] = (
        b"<!doctype html><script>told = null; onmessage = ({ data }) => told = "
        b"data</script><iframe sandbox='allow-scripts' src='inner.html'>")
    files["inner.html"] = files["index.html"] + (
        "<script type=module>onload = async () => parent.postMessage(await "
        "%s, '*')</script>" % PLAY.replace("FROM", "location.href")).encode()
    headers = {"Content-Security-Policy": policy} if policy else {}
    return browser.FileServer(files, share=share, headers=headers)


def check_policies(tab):
    expect(play(tab, site(policy=STRICT)), "a strict policy")
    for policy, named in FORBIDDEN:
        told = play(tab, site(policy=policy))
        if len(told) != 1 or named not in told[0]:
            complain("the message for", policy, "is", told)
    other = site(share=True)
    expect(play(tab, site(other.url + "player.js")), "another server's module")
    tab.go(other.url + "frame.html")
    tab.wait("told")
    expect(tab.run("told"), "a sandboxed frame")
    verdict("policies")


def check_server():
    for name in ("saga", "player", "viewer", "gpu", "engine"):
        done = subprocess.run(
            ["node", "--input-type=module", "-e", "await import(%r)" %
             os.path.abspath(os.path.join(WEB, name + ".js"))],
            stderr=subprocess.PIPE)
        if done.returncode:
            complain(name, done.stderr.decode())
    verdict("server")


def main():
    check_server()
    if not npm.is_there() or not browser.find_chromium() or \
            not os.path.exists(os.path.join(WEB, "saga.wasm")):
        print("ok   bundles skipped: needs npm, Chromium and build/web")
        return 1 if checks.failed else 0
    tab = browser.Browser()
    check_policies(tab)
    bundlers = install()
    if bundlers is None:
        print("ok   bundles skipped: the registry cannot be reached")
    else:
        with tempfile.TemporaryDirectory() as app:
            make_app(bundlers, app)
            for name in BUNDLERS:
                check_bundler(tab, app, name)
    tab.close()
    return 1 if checks.failed else 0


sys.exit(main())
