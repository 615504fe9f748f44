#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""check_types.py: guarantees, for the types of the npm packages (ports/web,
ports/three, ports/playcanvas),
  names       every exported name and every member that a .d.ts file declares is
              in the module of the same name, and every module that a
              package.json exports by name has types
  use         TypeScript compiles a program that uses the packages together with
              the real engines
  misuse      TypeScript refuses wrong arguments, so that the packages' types are
              not `any`
TypeScript and the engines are fetched from the registry of npm once for a build
folder. Without npm or the registry, the check prints what it skipped.
"""

import json
import os
import re
import shutil
import subprocess
import sys
import tempfile

from verdict import Verdicts, read
import npm  # noqa: E402  (verdict knows where)

PORTS = ("web", "three", "playcanvas")
FETCHED = (("typescript", "5.9.3"), ("three", "0.187.0"),
           ("@types/three", "0.187.0"), ("@sparkjsdev/spark", "2.2.0"),
           ("playcanvas", "2.23.3"))

checks = Verdicts("types")
complain, verdict = checks.complain, checks.verdict

HEAD = """
import { SagaFile, loadModule } from 'saga-web';
import { SagaPlayer } from 'saga-web/player.js';
import { GpuScreen, SplatPainter } from 'saga-web/gpu.js';
import { floatsOf } from 'saga-web/engine.js';
import { Viewer } from 'saga-web/viewer.js';
import { outside } from 'saga-web/volume.js';
import { addControls, moveByKey } from 'saga-web/controls.js';
import { enterHeadset, hasHeadset } from 'saga-web/xr.js';
import { SagaMesh } from 'saga-three';
import { SagaSplatMesh } from 'saga-three/spark.js';
import { SagaSplats } from 'saga-three/splats.js';
import { SagaEntity, placeCamera } from 'saga-playcanvas';
import { SagaParser } from 'saga-playcanvas/gsplat.js';
import { SparkRenderer } from '@sparkjsdev/spark';
import * as THREE from 'three';
import * as pc from 'playcanvas';
"""

USE = HEAD + """
export async function plain(canvas: HTMLCanvasElement) {
    const file = await SagaFile.open('scene.saga',
        { module: await loadModule({ simd: false }) });
    const { rgba, width, height } = await file.draw(file.rig[0], 12);
    const splats = await file.splats(file.rig[0], 12);
    const floats: Float32Array = floatsOf(splats);
    const player: SagaPlayer = document.createElement('saga-player');
    const viewer = new Viewer(canvas, { exact: true });
    const session: EventTarget | null =
        await hasHeadset() ? await enterHeadset(player.viewer) : null;

    addControls(viewer, canvas);
    moveByKey(viewer, 'ArrowLeft');
    player.currentTime = player.duration / 2;
    player.setState(player.toState());
    GpuScreen.open(canvas)?.showSplats(splats);
    new SplatPainter(canvas.getContext('webgl2')!).upload(splats);
    return [rgba.length === 4 * width * height, floats, session];
}

export async function inThree(scene: THREE.Scene,
    renderer: THREE.WebGLRenderer, camera: THREE.PerspectiveCamera) {
    const film = await SagaMesh.load('scene.saga', { simd: true });
    const other = await SagaSplatMesh.load('scene.saga');
    const third = await SagaSplats.load('scene.saga');

    const volume = film.view.viewingVolume;
    const off: number = volume ? outside(volume, camera.position.toArray()) : 0;

    scene.add(film, new SparkRenderer({ renderer }), other, third);
    console.log(off);
    film.placeCamera(camera);
    film.view.play();
    other.view.seek(3);
    film.dispose();
    third.dispose();
}

export async function inPlayCanvas(app: pc.Application, camera: pc.Entity) {
    const film = await SagaEntity.load(app, new File([], 'scene.saga'));
    const handler = app.loader.getHandler('gsplat') as unknown as
        { addParser(parser: SagaParser): void };

    app.root.addChild(film.entity);
    film.placeCamera(camera, 2);
    placeCamera(film, camera, 2);
    handler.addParser(new SagaParser(app));
    film.destroy();
}
"""

# Each line has one error.
MISUSE = HEAD + """
SagaFile.open(7);
document.createElement('saga-player').play('now');
addControls(document.body, document.body);
SagaMesh.load('scene.saga', { simd: 'no' });
SagaSplatMesh.load('scene.saga').then((film) => film.placeCamera(3));
SagaSplats.load('scene.saga').then((film) => film.placeCamera(3));
SagaEntity.load(3, 'scene.saga');
new SagaParser('app');
"""
N_MISUSES = 8


# --- Names -----------------------------------------------------------------

def declared(text):
    """Exported names of a .d.ts file, and members of its exported classes."""
    text = re.sub(r"/\*.*?\*/", "", text, flags=re.S)
    yield from re.findall(
        r"^export (?:class|function|const) (\w+)", text, re.M)
    for body in re.findall(r"^export class .*?^}", text, re.M | re.S):
        yield from re.findall(
            r"^    (?:static |readonly )*(\w+)[(:?]", body, re.M)


def check_names():
    n = 0
    for port in PORTS:
        folder = "ports/%s/" % port
        modules = {m for m in os.listdir(folder) if m.endswith(".d.ts")}
        for name in modules:
            source = read(folder + name[:-5] + ".js").decode()
            if port == "web" and name == "engine.d.ts":
                source += read(folder + "viewer.js").decode()
            for word in declared(read(folder + name).decode()):
                n += 1
                if not re.search(r"\b%s\b" % word, source):
                    complain(name, "declares", word)
        for path, entry in json.loads(
                read(folder + "package.json"))["exports"].items():
            # An entry that is only a path has no exports to be typed.
            if "*" not in path and isinstance(entry, dict) and \
                    entry["types"][2:] not in modules:
                complain(port, "has no types for", path)
    if n < 100:
        complain("only", n, "names are declared")
    verdict("names: %d" % n)


# --- Programs --------------------------------------------------------------

def install(folder):
    """Returns whether packages and engines are in folder/node_modules."""
    modules = os.path.join(folder, "node_modules")
    for name, version in FETCHED:
        if not npm.unpack(name, version, modules):
            return False
    for port in PORTS:
        shutil.copytree("ports/" + port, modules + "/saga-" + port)
    return True


def errors_of(folder, **programs):
    """Returns the messages of TypeScript for programs that are compiled
    together, which takes the time of one."""
    for name, text in programs.items():
        with open(os.path.join(folder, name + ".ts"), "w") as f:
            f.write(text)
    # Types of the engines are not checked themselves: some have errors.
    done = subprocess.run(
        ["node", os.path.join("node_modules", "typescript", "lib", "tsc.js"),
         "--noEmit", "--strict", "--skipLibCheck", "--target", "es2022", "--lib", "es2022,dom,dom.iterable",
         "--module", "esnext", "--moduleResolution", "bundler",
         *(name + ".ts" for name in programs)],
        cwd=folder, stdout=subprocess.PIPE, timeout=600)
    return done.stdout.decode()


def check_programs():
    with tempfile.TemporaryDirectory() as folder:
        if not install(folder):
            print("ok   types skipped: the registry cannot be reached")
            return
        text = errors_of(folder, use=USE, misuse=MISUSE)
        lines = {int(n) for n in re.findall(r"^misuse\.ts\((\d+),", text, re.M)}
        # A message may go on in lines that are indented.
        if re.search(r"^(?!misuse\.ts| ).", text, re.M):
            complain(text)
        verdict("use")
        first = MISUSE.count("\n") - N_MISUSES + 1
        if lines != set(range(first, first + N_MISUSES)):
            complain("errors are in lines", sorted(lines), "not from", first,
                     text)
        verdict("misuse")


def main():
    check_names()
    if npm.is_there() and shutil.which("node"):
        check_programs()
    else:
        print("ok   types skipped: npm is not installed")
    return 1 if checks.failed else 0


sys.exit(main())
