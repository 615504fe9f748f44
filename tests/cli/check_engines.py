#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""check_engines.py: guarantees, for films in scenes of other engines
(ports/three, ports/playcanvas) in headless Chromium, where the example page
plays the demo,
  NAME picture   the engine's picture from a camera of the rig, and from one
                 next to it, has a PSNR of at least 40 dB against the decoder's
  NAME depth     a wall in front of the film hides all of it, a wall behind it
                 nothing, and a wall through its middle a part
  NAME late      splats that were made for another camera are drawn where the
                 present camera sees them
  NAME placed    if film and camera are moved, turned and enlarged together, the
                 picture stays the same
  NAME hold      a camera outside the viewing volume is moved to its surface, in
                 the direction of the pivot, and one inside is not moved
  NAME composer  through passes that encode linear light at their end it has at
                 least 50 dB, because what they have drawn is encoded while the
                 film is mixed, and the walls hide the same; in PlayCanvas with
                 several samples a pixel, too, and at least 30 dB with its
                 default format or at half the size
  three logarithmic, three reversed  the walls hide the same with a logarithmic
                 and with a reversed depth buffer
  three unsized  a renderer that has not been given a size shows the film, and
                 one with tone mapping its colours; other renderers are refused
  gsplat, spark  the pictures that PlayCanvas and Spark draw with their own
                 splat renderers have a PSNR of at least 30 dB, also at once
                 when the time changes; these renderers do not support the steep
                 falloff of our splats
  splats WebGL, splats WebGPU  so have the pictures of the splat renderer that
                 three.js has itself, with both backends of its WebGPURenderer,
                 and the walls hide the same; a time without splats shows none
  spark files    Spark reads the splats of a frame that `saga export` wrote as
                 PLY, compressed PLY, SPZ and SOG
The engines' own renderers of splats and Spark's readers are asked in `make
test-all` alone: they test what `saga export` writes, which check_exchange.py
does without a browser. NAME is an engine. The engines are fetched from the
registry of npm once for a build folder. Without npm, the registry, Chromium or
the decoder in WebAssembly, the check prints that it was skipped.
"""

import math
import os
import sys
import tempfile

import splats
from verdict import SAGA, WEB, Verdicts, read
import browser  # noqa: E402  (verdict knows where)
import npm  # noqa: E402

LEAST_DB = 40
LEAST_COMPOSED_DB = 50
LEAST_GAUSSIANS_DB = 30
SIZE = 320, 180         # of the demo's cameras

# For each engine, its npm packages, their versions, and the files of them that
# a page needs.
ENGINES = {
    "three": (
        ("three", "0.187.0", ("build/three.module.js", "build/three.core.js",
                              "build/three.webgpu.js", "build/three.tsl.js",
                              "examples/jsm/gpgpu/CountingSort.js",
                              "examples/jsm/objects/GaussianSplat.js",
                              "examples/jsm/utils/GaussianSplatUtils.js",
                              "examples/jsm/shaders/CopyShader.js",
                              "examples/jsm/shaders/OutputShader.js",
                              *("examples/jsm/postprocessing/%s.js" % p for p in
                                ("EffectComposer", "MaskPass", "OutputPass",
                                 "Pass", "RenderPass", "ShaderPass")))),
        ("@sparkjsdev/spark", "2.2.0", ("dist/spark.module.js",))),
    "playcanvas": (("playcanvas", "2.23.3", ("build/playcanvas.mjs",)),),
}

# The engine's own drawing of splats, by the word that the page's address has
# for it.
OWN = {"three": "spark", "playcanvas": "gsplat"}

checks = Verdicts("engines")
complain, verdict = checks.complain, checks.verdict


def fetch(engine):
    """Returns {path: bytes} of the files that a page of the engine needs, or
    None."""
    files = {}
    for name, version, wanted in ENGINES[engine]:
        package = npm.fetch(name, version, wanted)
        if package is None:
            return None
        files.update({"%s/node_modules/%s/%s" % (engine, name, w): data
                      for w, data in package.items()})
    return files


def files_of(name):
    folder = "ports/%s/" % name
    files = {"%s/%s" % (name, n): read(folder + n) for n in os.listdir(folder)}
    files.update({"web/" + n: read(os.path.join(WEB, n))
                  for n in os.listdir(WEB)})
    files["demo.saga"] = read("docs/demo.saga")
    return files


# Functions that are added to the page for the tests: `draw()` draws the scene
# and returns its pixels, rows from the top; `settled()` waits until the film's
# splats are those of the camera.
SHARED = """
window.frame = () => new Promise((resolve) => requestAnimationFrame(resolve));
window.settled = async () => {
    do {
        draw();
        await frame();
    } while (view.busy || view.stale || !view.wanted || made() === null ||
        !view.wanted.every((x, i) => x === made()[i]));
    draw();
};
window.exact = async (values) => {
    const { SagaFile } = await import('/web/saga.js');
    const { rgba } = await (window.file ??= await SagaFile.open('/demo.saga'))
        .draw({ values }, view.frame);
    return Uint8Array.from(rgba);
};
window.beside = (want, got) => {
    let sum = 0;
    for (let i = 0; i < want.length; i++)
        sum += (want[i] - got[i]) ** 2;
    return want.length === got.length
        ? 10 * Math.log10(255 * 255 / Math.max(1e-9, sum / want.length * 4 / 3))
        : 0;
};
window.part = (got, [r, g, b]) => {
    let n = 0;
    for (let i = 0; i < got.length; i += 4)
        n += Math.abs(got[i] - r) + Math.abs(got[i + 1] - g) +
            Math.abs(got[i + 2] - b) < 6;
    return n / (got.length / 4);
};
// What an engine sorts elsewhere takes some pictures to come.
window.comesTo = async (index, time, least) => {
    const end = performance.now() + 20000;
    let db = 0;
    look(index, 0);
    view.seek(time);
    while (db < least && performance.now() < end) {
        draw();
        await frame();
        db = view.busy ? 0
            : beside(await exact(view.rig[index].values), draw());
    }
    return db;
};
// Returns the PSNR of the first picture after the time has changed, against
// the exact picture of the old or the new time, whichever is nearer. The engine
// may still have the order in which it drew the old splats.
window.atOnce = async (index, time) => {
    const { values } = view.rig[index];
    const old = await exact(values);
    view.seek(time);
    while (view.busy || view.stale)
        await frame();
    const got = draw();
    return Math.max(beside(old, got), beside(await exact(values), got));
};
window.background = () => Array.from(view.home.slice(19, 22),
    (x) => x / 32768);
"""

# The same functions for each engine. wall(depth) puts a wall across the view of
# the film's cameras.
WORDS = {"three": """
window.view = film.view;
window.made = () => film.values;
renderer.setAnimationLoop(null);
view.pause();
renderer.setPixelRatio(1);
renderer.setSize(%d, %d);
camera.aspect = %d / %d;
scene.remove(box);
scene.background = new THREE.Color().setRGB(...background(),
    THREE.SRGBColorSpace);
window.wall = new THREE.Mesh(new THREE.PlaneGeometry(1000, 1000),
    new THREE.MeshBasicMaterial({ color: 0xff00ff }));
window.look = (index, aside) => {
    film.placeCamera(camera, index);
    camera.translateX(aside);
    camera.updateMatrixWorld();
};
window.putWall = (depth) => {
    scene.add(wall);
    wall.position.copy(camera.position);
    wall.quaternion.copy(camera.quaternion);
    wall.translateZ(-depth);
};
window.removeWall = () => scene.remove(wall);
window.place = () => {
    film.position.set(1, -2, 3);
    film.rotation.set(0.3, 0.5, -0.2);
    film.scale.setScalar(2.5);
};
window.draw = () => {
    const { width, height } = renderer.domElement;
    const gl = renderer.getContext();
    const rows = new Uint8Array(4 * width * height);
    const got = new Uint8Array(rows.length);

    (window.renderNow ?? (() => renderer.render(scene, camera)))();
    gl.readPixels(0, 0, width, height, gl.RGBA, gl.UNSIGNED_BYTE, rows);
    for (let y = 0; y < height; y++)
        got.set(rows.subarray(4 * width * y, 4 * width * (y + 1)),
            4 * width * (height - 1 - y));
    return got;
};
""" % (2 * SIZE), "playcanvas": """
window.view = film.view;
window.made = () => film.values;
app.autoRender = false;
view.pause();
app.setCanvasFillMode(pc.FILLMODE_NONE, %d, %d);
app.setCanvasResolution(pc.RESOLUTION_FIXED, %d, %d);
box.enabled = false;
camera.camera.clearColor = new pc.Color(...background());
window.wall = new pc.Entity();
{
    const material = new pc.StandardMaterial();

    material.useLighting = false;
    material.diffuse.set(0, 0, 0);
    material.emissive.set(1, 0, 1);
    material.cull = pc.CULLFACE_NONE;
    material.update();
    wall.addComponent('render', { type: 'plane', material });
    wall.setLocalScale(1000, 1, 1000);
    wall.enabled = false;
    app.root.addChild(wall);
}
window.look = (index, aside) => {
    film.placeCamera(camera, index);
    camera.translateLocal(aside, 0, 0);
};
window.putWall = (depth) => {
    wall.enabled = true;
    wall.setPosition(camera.getPosition());
    wall.setRotation(camera.getRotation());
    wall.translateLocal(0, 0, -depth);
    wall.rotateLocal(90, 0, 0);
};
window.removeWall = () => { wall.enabled = false; };
window.place = () => {
    film.entity.setPosition(1, -2, 3);
    film.entity.setEulerAngles(17, 30, -11);
    film.entity.setLocalScale(2.5, 2.5, 2.5);
};
window.draw = () => {
    const { width, height } = app.graphicsDevice;
    const { gl } = app.graphicsDevice;
    const rows = new Uint8Array(4 * width * height);
    const got = new Uint8Array(rows.length);

    app.frameStart?.();
    app.render();
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    gl.readPixels(0, 0, width, height, gl.RGBA, gl.UNSIGNED_BYTE, rows);
    for (let y = 0; y < height; y++)
        got.set(rows.subarray(4 * width * y, 4 * width * (y + 1)),
            4 * width * (height - 1 - y));
    return got;
};
""" % (2 * SIZE)}

# The distance of the film's middle from its first camera, in the capture's
# units.
MIDST = """Math.hypot(...view.toMetres(view.focus).map((x, i) =>
    x - view.rigPlace(0).matrix[12 + i]))"""


def check_picture(tab, name):
    told = []
    for frame, index, aside in ((0, 0, 0), (13, 4, 0), (7, 2, 0.3)):
        told.append(tab.run("""(async () => {
            view.seek(%d);
            look(%d, %g);
            await settled();
            return beside(await exact(view.wanted), draw());
        })()""" % (frame, index, aside)))
    if min(told) < LEAST_DB:
        complain("beside the exact pictures, dB:", told)
    # The engine's camera, converted back, must be the rig's camera.
    off = tab.run("""(async () => {
        look(4, 0);
        await settled();
        return view.rig[4].values.map((x, i) => Math.abs(x - view.wanted[i]));
    })()""")
    if max(list(off.values())[:9]) > 4096 or \
            max(list(off.values())[9:12]) > 64:
        complain("camera 4 comes back with an error of", off)
    verdict("%s picture: %s dB" % (name, ", ".join("%.1f" % t for t in told)))


def check_depth(tab, name):
    tab.run("look(0, 0); settled()")
    far, near, midst = (tab.run("""(() => {
        putWall(%s);
        const got = draw();
        removeWall();
        return part(got, [255, 0, 255]);
    })()""" % depth) for depth in (
        "20 * " + MIDST, "0.02 * " + MIDST, "0.6 * " + MIDST))
    if far > 0.02 or near < 0.999 or not 0.05 < midst < 0.95:
        complain("of the picture, walls hide", far, near, midst)
    verdict("%s depth: %.2f, %.2f and %.2f hidden" % (name, far, midst, near))


# Functions by which an engine draws through passes, the last of which encodes
# linear light as sRGB.
COMPOSE = {"three": """
        const from = (pass) => import(
            'three/addons/postprocessing/' + pass + '.js');
        const { EffectComposer } = await from('EffectComposer');
        const { RenderPass } = await from('RenderPass');
        const { OutputPass } = await from('OutputPass');
        const composer = new EffectComposer(renderer);

        composer.addPass(new RenderPass(scene, camera));
        composer.addPass(new OutputPass());
        window.renderNow = () => composer.render();
        window.uncompose = () => { window.renderNow = null; };
""", "playcanvas": """
        const composer = new pc.CameraFrame(app, camera.camera);

        composer.rendering.toneMapping = pc.TONEMAP_NONE;
        composer.rendering.renderFormats = [pc.PIXELFORMAT_RGBA16F];
        window.recompose = (settings) => {
            Object.assign(composer.rendering, settings);
            composer.update();
        };
        composer.update();
        window.uncompose = () => composer.destroy();
"""}


# Settings of a CameraFrame, and the least PSNR of the film in it.
FRAMES = (("samples: 4", LEAST_COMPOSED_DB),
          ("samples: 1, renderTargetScale: 0.5", 30),
          ("renderTargetScale: 1, renderFormats: [pc.PIXELFORMAT_111110F]", 30))


def check_frames(tab):
    for settings, least in FRAMES:
        db = tab.run("""(async () => {
            recompose({ %s });
            draw();
            return beside(await exact(view.wanted), draw());
        })()""" % settings)
        if db < least:
            complain("with", settings, "it has", db, "dB")


def check_composer(tab, name):
    db = tab.run("""(async () => {
        view.seek(0);
        look(0, 0);
        await settled();
        const want = await exact(view.wanted);
        %s
        draw();
        return beside(want, draw());
    })()""" % COMPOSE[name])
    if db < LEAST_COMPOSED_DB:
        complain("through a composer it has", db, "dB")
    check_depth(tab, name + " composer")
    if name == "playcanvas":
        check_frames(tab)
    tab.run("uncompose()")
    if name == "playcanvas" and tab.run("""(() => {
            const { gammaCorrection } = camera.camera;

            camera.camera.gammaCorrection = pc.GAMMA_NONE;
            try {
                app.render();
            } catch (e) {
                return e.message;
            } finally {
                camera.camera.gammaCorrection = gammaCorrection;
            }
            return '';
        })()"""):
        complain("linear light on the screen itself stops the engine")
    verdict("%s composer: %.1f dB" % (name, db))


def check_buffers(tab):
    """The same walls with the other depth buffers of three.js."""
    for word in "logarithmic", "reversed":
        tab.run("""(() => {
            renderer = new THREE.WebGLRenderer({ %sDepthBuffer: true });
            renderer.setSize(%d, %d);
        })()""" % (word, *SIZE))
        if not tab.run("renderer.capabilities.%sDepthBuffer" % word):
            print("ok   engines three %s skipped: the browser cannot" % word)
            continue
        tab.run("draw()") # the first picture turns the camera's depth
        check_depth(tab, "three " + word)


def check_unsized(tab):
    told = []
    for mapping in "NoToneMapping", "ACESFilmicToneMapping":
        told.append(tab.run("""(async () => {
            renderer = new THREE.WebGLRenderer();
            renderer.toneMapping = THREE.%s;
            camera.aspect = 2; // of a canvas that nobody has given a size
            look(0, 0);
            await settled();
            return beside(await exact(view.wanted), draw());
        })()""" % mapping))
    tab.run("camera.aspect = %d / %d; renderer.setSize(%d, %d)" % (2 * SIZE))
    if not tab.run("""(() => {
        try {
            film.onBeforeRender({}, scene, camera);
        } catch ({ message }) {
            return message.includes('WebGLRenderer');
        }
    })()"""):
        complain("another renderer is not told to be the wrong one")
    if min(told) < LEAST_DB:
        complain("without a size, with tone mapping it has", told, "dB")
    verdict("three unsized: %.1f dB, with tone mapping %.1f" % tuple(told))


# Functions that put the camera, tell where it is, and map the film's positions
# to the scene's.
HOLD = {"three": """
    const put = (...at) => camera.position.set(...at);
    const at = () => camera.getWorldPosition(new THREE.Vector3()).toArray();
    const world = (p) => film.localToWorld(new THREE.Vector3(...p))
        .toArray();""", "playcanvas": """
    const put = (...at) => camera.setPosition(...at);
    const at = () => Array.from(camera.getPosition().toArray());
    const world = (p) => Array.from(film.entity.getWorldTransform()
        .transformPoint(new pc.Vec3(...p)).toArray());"""}


def check_hold(tab, name, engine=None):
    off = tab.run("""(() => {
        %s
        const pivot = [1, 2, 3], eye = [1.3, 2.9, 2];
        const mixed = (a, b, t) => a.map((x, i) => x + t * (b[i] - x));
        const far = (a, b) => Math.hypot(...a.map((x, i) => x - b[i]));
        const told = [];

        view.viewingVolume = { pivot, up: [0, 0, 1], front: [1, 0, 0],
            azimuth: Math.PI, elevation: [-Math.PI / 2, Math.PI / 2],
            turn: Math.PI, distance: [0, far(pivot, eye)] };
        for (const [t, want] of [[2, 1], [0.5, 0.5]]) {
            put(...world(mixed(pivot, eye, t)));
            film.holdCamera(camera);
            told.push(far(at(), world(mixed(pivot, eye, want))));
        }
        view.viewingVolume = null;
        return told;
    })()""" % HOLD[engine or name])
    if max(off) > 1e-5:
        complain("held cameras are off by", off)
    verdict(name + " hold")


def check_late(tab, name):
    """Checks splats that were made for camera 4 and are drawn from a place
    beside it."""
    db = tab.run("""(async () => {
        look(4, 0);
        await settled();
        look(4, 0.05);
        const got = draw(); // its splats are not there yet
        const still = view.rig[4].values;
        const place = await exact(view.wanted);
        return [beside(place, got), beside(await exact(still), got)];
    })()""")
    if db[0] < 30 or db[0] < db[1] + 3:
        complain("beside the new and the old view, dB:", db)
    verdict("%s late: %.1f dB, %.1f beside the old view" % (name, *db))


def check_placed(tab, name):
    db = tab.run("""(async () => {
        place();
        look(3, 0);
        await settled();
        return beside(await exact(view.rig[3].values), draw());
    })()""")
    if db < LEAST_DB:
        complain("elsewhere in the scene it has", db, "dB")
    verdict("%s placed: %.1f dB" % (name, db))


# In the words for three.js, those that another renderer needs.
SPLATS = """
window.made = () => view.wanted;
window.draw = () => {
    const { width, height } = renderer.domElement;
    const got = new OffscreenCanvas(width, height).getContext('2d');

    renderer.render(scene, camera);
    got.drawImage(renderer.domElement, 0, 0);
    return got.getImageData(0, 0, width, height).data;
};
"""


def check_splats(server, backend, flags):
    """The splat renderer of three.js, with one of its backends."""
    tab = browser.Browser(flags=flags)
    try:
        tab.go(server.url + "three/three.html?src=/demo.saga&splats=1")
        tab.wait("window.film?.view.drawn && film.view.playing")
        for words in SHARED, WORDS["three"], SPLATS:
            tab.run(words)
        if not tab.run("renderer.backend.is%sBackend === true" % backend):
            complain("three.js does not use", backend)
        check_gaussians(tab, "splats " + backend)
        check_depth(tab, "splats " + backend)
        told = tab.run("""(async () => {
            const kept = [];

            for (let i = 0; i < 3; i++) {
                const more = await film.constructor.load('/demo.saga');

                await new Promise((end) => more.view.addEventListener(
                    'drawn', end, { once: true }));
                scene.add(more);
                draw();
                scene.remove(more);
                more.dispose();
                kept.push(Object.entries(renderer.info.memory).filter(
                    ([, n]) => typeof n === 'number').map(
                    ([name, n]) => `${name} ${n}`).join());
            }
            return kept;
        })()""")
        if told[1] != told[2]:
            complain("dispose() leaves", told)
        verdict("splats %s dispose" % backend)
        check_hold(tab, "splats " + backend, "three")
        # A time at which no splat is there.
        empty = tab.run("""(() => {
            film.take({ bytes: new Uint8Array(0), nSplats: 0 });
            draw();
            const { position, covariance, color } =
                film.splatGeometry.attributes;

            return [[...position.array, ...covariance.array].every(isFinite),
                Math.max(...color.array,
                    ...film._buffers.colorRead.value.array)];
        })()""")
        if empty != [True, 0]:
            complain("without splats it has", empty)
        # three.js says that it falls back to WebGL2.
        checks.complaints.extend(
            line for line in tab.log if "under WebGL2 backend" not in line)
        verdict("splats %s empty" % backend)
    finally:
        tab.close()


def check_gaussians(tab, what):
    told = [tab.run("comesTo(%d, %d, %d)" % (index, frame, LEAST_GAUSSIANS_DB))
            for frame, index in ((0, 0), (13, 4))]
    if min(told) < LEAST_GAUSSIANS_DB:
        complain("it comes to", told, "dB")
    at_once = [tab.run("atOnce(4, %d)" % frame) for frame in (14, 15, 16, 17)]
    if min(at_once) < LEAST_GAUSSIANS_DB:
        complain("at once it has", at_once, "dB")
    verdict("%s: %.1f, %.1f dB; %s at once" % (
        what, *told, ", ".join("%.1f" % t for t in at_once)))


# --- Files -------------------------------------------------------------------

# Formats that Spark reads, and whether their axes are turned against PLY's.
READ = {"ply": False, "compressed.ply": False, "spz": True, "sog": False}


def differ(a, b):
    """Returns how far two splats are apart, in units of what the formats and the
    16 bytes to which Spark reduces a splat may round together."""
    c, d = (sum(splats.covariance(s), []) for s in (a, b))
    size = max(map(abs, c))
    return max(
        max(abs(x - y) for x, y in zip(a["mean"], b["mean"])) / 0.005,
        max(abs(x - y) for x, y in zip(c, d)) / size / 0.3,
        abs(a["opacity"] - b["opacity"]) / 0.01,
        max(abs(x - y) for x, y in zip(a["rgb"], b["rgb"])) / 0.02)


def read_by_spark(tab, name, turn):
    rows = tab.run("""(async () => {
        const { SplatMesh } = await import('@sparkjsdev/spark');
        const mesh = new SplatMesh({ url: '/%s' });
        const rows = [];

        await mesh.initialized;
        mesh.forEachSplat((i, x, s, q, opacity, rgb) => rows.push([
            [x.x, x.y, x.z], [s.x, s.y, s.z], [q.w, q.x, q.y, q.z], opacity,
            [rgb.r, rgb.g, rgb.b]]));
        return rows;
    })()""" % name)
    got = [{"mean": x, "scale": s, "quat": q, "opacity": o, "rgb": rgb,
            "colour": [[0, 0, 0]]} for x, s, q, o, rgb in rows]
    return [splats.turned(s, 0) for s in got] if turn else got


def check_files(server, tab):
    worst = {}
    with tempfile.TemporaryDirectory() as tmp:
        for suffix in READ:
            path = "%s/x.%s" % (tmp, suffix)
            checks.run(SAGA, "export", "docs/demo.saga", "--frame", 12, "-o",
                       path)
            server.files["x." + suffix] = read(path)
        want = splats.read_ply(tmp + "/x.ply")
    for s in want:
        s["rgb"] = [min(max(0.5 + 0.28209479177387814 * c, 0), 1)
                    for c in s["colour"][0]]
    for suffix, turn in READ.items():
        got = read_by_spark(tab, "x." + suffix, turn)
        if len(got) != len(want):
            complain("Spark reads", len(got), "splats of", suffix)
        # Formats may have another order. Every 20th splat is looked for.
        worst[suffix] = max((min(differ(s, w) for w in want)
                             for s in got[::20]), default=math.inf)
        if worst[suffix] > 1:
            complain("Spark reads", suffix, "with errors of", worst[suffix],
                     "times what is allowed")
    verdict("spark files: errors of %s of what is allowed" % ", ".join(
        "%.2f" % w for w in worst.values()))


def check_engine(name):
    package = fetch(name)
    if package is None:
        print("ok   engines %s skipped: the registry cannot be reached" % name)
        return
    server = browser.FileServer({**files_of(name), **package})
    tab = browser.Browser()

    def begin(more=""):
        tab.go(server.url + "%s/%s.html?src=/demo.saga%s" % (name, name, more))
        tab.wait("window.film?.view.drawn && film.view.playing")
        tab.run(SHARED)
        tab.run(WORDS[name])

    try:
        begin()
        check_picture(tab, name)
        check_depth(tab, name)
        check_late(tab, name)
        check_composer(tab, name)
        if name == "three":
            check_buffers(tab)
            check_unsized(tab)
        check_placed(tab, name)
        check_hold(tab, name)
        if "SAGA_TEST_LONG" in os.environ:
            begin("&%s=1" % OWN[name])
            check_gaussians(tab, OWN[name])
            if name == "three":
                check_files(server, tab)
                check_splats(server, "WebGL", browser.FLAGS)
                check_splats(server, "WebGPU", browser.WEBGPU_FLAGS)
        checks.complaints.extend(tab.log)
        verdict(name + " console")
    finally:
        tab.close()


def main():
    if checks.skips():
        return 0
    if not npm.is_there():
        print("ok   engines skipped: npm is not installed")
        return 0
    for name in ENGINES:
        check_engine(name)
    return 1 if checks.failed else 0


sys.exit(main())
