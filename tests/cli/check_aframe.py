#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""check_aframe.py: guarantees, for the component of A-Frame in ports/three, in
headless Chromium,
  picture     the film's first camera is where A-Frame's camera is, and level;
              the picture has a PSNR of at least 40 dB against the decoder's
  clock       the film plays by itself, unless autoplay is false; a change of
              loop keeps the film
  end         a removed entity ends the film's worker; of a film that does not
              exist the entity tells model-error
A-Frame is fetched from the registry of npm once for a build folder. Without npm,
the registry, Chromium or the decoder in WebAssembly, the check prints that it
was skipped.
"""

import os
import sys

from verdict import WEB, Verdicts, read
import browser  # noqa: E402  (verdict knows where)
import npm  # noqa: E402

PACKAGES = (("aframe", "1.8.0", ("dist/aframe-v1.8.0.module.min.js",)),
            ("super-three", "0.184.0", ("build/three.module.js",
                                        "build/three.core.js")))
LEAST_DB = 40

checks = Verdicts("aframe")
complain, verdict = checks.complain, checks.verdict

PAGE = b"""<!doctype html>
<script type="importmap">{ "imports": {
    "aframe": "./aframe/dist/aframe-v1.8.0.module.min.js",
    "three": "./super-three/build/three.module.js",
    "saga-web/": "./web/" } }</script>
<body><script type="module">
import 'aframe';
import './three/saga_aframe.js';
document.body.innerHTML = `<a-scene embedded vr-mode-ui="enabled: false"
    style="width: 320px; height: 180px"><a-entity id="film" position="0 1.6 0"
    saga="src: demo.saga; autoplay: false"></a-entity>
    <a-camera position="0 1.6 0" look-controls-enabled="false"></a-camera>
    </a-scene>`;
window.el = document.getElementById('film');
</script>"""

# How far the camera is from the film's first one, in box units; how much it
# leans to the side; and the PSNR of the picture.
PICTURE = """(async () => {
    const { SagaFile } = await import('/web/saga.js');
    const THREE = await import('three');
    const { view } = el.components.saga.film, { sceneEl } = el;
    const { renderer } = sceneEl, gl = renderer.getContext();
    const frame = () => new Promise((done) => requestAnimationFrame(done));
    const draw = () => renderer.render(sceneEl.object3D, sceneEl.camera);

    sceneEl.object3D.background = new THREE.Color().setRGB(...Array.from(
        view.home.slice(19, 22), (x) => x / 32768), THREE.SRGBColorSpace);
    do {
        draw();
        await frame();
    } while (view.busy || view.stale || !el.components.saga.film.values?.every(
        (x, i) => x === view.wanted[i]));
    const { width, height } = renderer.domElement;
    const rows = new Uint8Array(4 * width * height);
    draw();
    gl.readPixels(0, 0, width, height, gl.RGBA, gl.UNSIGNED_BYTE, rows);
    const file = await SagaFile.open('/demo.saga');
    const { rgba } = await file.draw({ values: view.wanted }, view.frame);
    let sum = 0;
    for (let y = 0; y < height; y++)
        for (let x = 0; x < 4 * width; x++)
            sum += (rgba[4 * width * y + x] -
                rows[4 * width * (height - 1 - y) + x]) ** 2;
    const first = view.rig[view.start].values, now = view.wanted;
    const right = Array.from(now.slice(0, 3), (x) => x / 2 ** 30);
    return [Math.hypot(...[9, 10, 11].map((i) => first[i] - now[i])),
        right.reduce((lean, x, i) => lean + x * view.up[i], 0),
        10 * Math.log10(255 * 255 / (sum / (3 * width * height)))];
})()"""


def check_picture(tab):
    tab.wait("el.components?.saga?.film?.view.drawn")
    off, lean, db = tab.run(PICTURE)
    if off > 64 or abs(lean) > 1e-6 or db < LEAST_DB:
        complain("it is off by", off, "leans by", lean, "has", db, "dB")
    verdict("picture: %.1f dB" % db)


def check_clock(tab):
    if tab.run("el.components.saga.film.view.playing"):
        complain("autoplay: false plays")
    tab.run("void (window.film = el.components.saga.film); "
            "el.setAttribute('saga', 'loop', false)")
    if tab.run("film !== el.components.saga.film || film.view.loop"):
        complain("loop: false is not obeyed, or opens the film again")
    tab.run("el.setAttribute('saga', 'src: demo.saga?2; autoplay: true')")
    tab.wait("el.components.saga.film.view.frame > 0")
    if tab.run("film.view.worker !== null"):
        complain("the film before keeps its worker")
    verdict("clock")


def check_end(tab):
    tab.run("void (window.film = el.components.saga.film); el.remove()")
    tab.wait("film.view.worker === null")
    tab.run("""(() => {
        const other = document.createElement('a-entity');
        other.addEventListener('model-error', ({ detail }) => {
            window.told = detail.message;
        });
        other.setAttribute('saga', 'src: none.saga');
        document.querySelector('a-scene').append(other);
    })()""")
    tab.wait("window.told?.includes('404')")
    verdict("end")


def main():
    if checks.skips():
        return 0
    if not npm.is_there():
        print("ok   aframe skipped: npm is not installed")
        return 0
    files = {"demo.saga": read("docs/demo.saga"), "index.html": PAGE}
    for folder, to in ((WEB, "web/"), ("ports/three", "three/")):
        files.update({to + name: read(os.path.join(folder, name))
                      for name in os.listdir(folder)})
    for name, version, wanted in PACKAGES:
        package = npm.fetch(name, version, wanted)
        if package is None:
            print("ok   aframe skipped: the registry cannot be reached")
            return 0
        files.update({"%s/%s" % (name, w): data for w, data in package.items()})
    server, tab = browser.FileServer(files), browser.Browser()
    try:
        tab.go(server.url + "index.html")
        check_picture(tab)
        check_clock(tab)
        check_end(tab)
    finally:
        tab.close()
    return 1 if checks.failed else 0


sys.exit(main())
