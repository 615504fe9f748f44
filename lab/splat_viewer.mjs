// SPDX-License-Identifier: MIT
//
// node splat_viewer.mjs VIEWER FILE INFO.json CAMERA OUT.png
//
// Writes the picture that a public viewer draws from a splat file, in headless
// Chromium, for a camera of the rig that `saga info --json` lists. VIEWER is
// gs3d (@mkkellogg/gaussian-splats-3d), spark (@sparkjsdev/spark), or
// playcanvas, the only one that reads GLB. The environment variable OPTIONS has
// further options of the viewer, as JSON. It runs in a folder where npm has
// installed the viewer, three and puppeteer-core; docs/results/export.md has
// the commands.
import fs from 'fs';
import http from 'http';
import path from 'path';
import { createRequire } from 'module';

const [viewer, file, info, index, out] = process.argv.slice(2);
const here = process.cwd();
const puppeteer = createRequire(here + '/')('puppeteer-core');
const camera = JSON.parse(fs.readFileSync(info)).rig[Number(index)];
const extension = path.extname(file);
const options = process.env.OPTIONS || '{}';

const gs3d = '/node_modules/@mkkellogg/gaussian-splats-3d/build/' +
    'gaussian-splats-3d.module.js';
// A camera of three with the same view as ours.
const three = `
const renderer = new THREE.WebGLRenderer({ preserveDrawingBuffer: true,
    canvas: document.querySelector('canvas') });
renderer.setSize(c.width, c.height, false);
renderer.setClearColor(0, 1);
const camera = new THREE.PerspectiveCamera(fov, aspect, c.near_metres, 1000);
new THREE.Matrix4().set(...rows.flat(), 0, 0, 0, 1)
    .decompose(camera.position, camera.quaternion, camera.scale);
camera.updateMatrixWorld(true);`;
const programs = {
playcanvas: `
import * as pc from '/node_modules/playcanvas/build/playcanvas.mjs';
const app = new pc.Application(document.querySelector('canvas'), {
    graphicsDeviceOptions: { preserveDrawingBuffer: true, antialias: false,
                             alpha: false } });
app.graphicsDevice.maxPixelRatio = 1;
app.setCanvasFillMode(pc.FILLMODE_NONE, c.width, c.height);
app.setCanvasResolution(pc.RESOLUTION_FIXED, c.width, c.height);
app.start();
Object.assign(app.scene.gsplat, ${options});
const camera = new pc.Entity();
camera.addComponent('camera', { clearColor: new pc.Color(0, 0, 0, 1), fov,
    nearClip: c.near_metres, farClip: 1000, aspectRatio: aspect,
    aspectRatioMode: pc.ASPECT_MANUAL });
const column = i => rows.map(row => row[i]);
camera.setPosition(...column(3));
camera.setRotation(new pc.Quat().setFromMat4(new pc.Mat4().set([
    ...column(0), 0, ...column(1), 0, ...column(2), 0, 0, 0, 0, 1])));
app.root.addChild(camera);
const isGlb = ${extension === '.glb'};
const asset = new pc.Asset('file', isGlb ? 'container' : 'gsplat',
                           { url: '/file${extension}' });
app.assets.add(asset);
app.assets.load(asset);
await new Promise((done, failed) => {
    asset.once('error', failed);
    asset.ready(done);
});
const splats = isGlb ? asset.resource.instantiateRenderEntity()
                     : new pc.Entity();
if (!isGlb)
    splats.addComponent('gsplat', { asset });
app.root.addChild(splats);
const draw = () => {};`,
gs3d: `${three}
import * as G from '${gs3d}';
renderer.outputColorSpace = THREE.LinearSRGBColorSpace;
const viewer = new G.Viewer({ selfDrivenMode: false, useBuiltInControls: false,
    renderer, camera, sharedMemoryForWorkers: false, gpuAcceleratedSort: false,
    sphericalHarmonicsDegree: 2, integerBasedSort: false,
    splatSortDistanceMapPrecision: 20, maxScreenSpaceSplatSize: 4096,
    sceneRevealMode: G.SceneRevealMode.Instant, ...${options} });
await viewer.addSplatScene('/file', { format: G.SceneFormat.Ply,
    splatAlphaRemovalThreshold: 1, showLoadingUI: false,
    progressiveLoad: false });
const draw = () => { viewer.update(); viewer.render(); };`,
spark: `${three}
import { SparkRenderer, SplatMesh } from
    '/node_modules/@sparkjsdev/spark/dist/spark.module.js';
const scene = new THREE.Scene();
scene.add(new SparkRenderer({ renderer, ...${options} }));
const mesh = new SplatMesh({ url: '/file', fileName: 'x${extension}' });
await mesh.initialized;
scene.add(mesh);
const draw = () => renderer.render(scene, camera);`
};

// Our cameras have y down and z forward, those of three y up and z back; in SPZ
// the whole scene is turned around x, in GLB around z.
const page = `<!doctype html><canvas></canvas>
<script type="importmap">{ "imports":
    { "three": "/node_modules/three/build/three.module.js",
      "three/addons/": "/node_modules/three/examples/jsm/" } }</script>
<script type="module">
import * as THREE from 'three';
const c = ${JSON.stringify(camera)}, r = c.rotation, e = c.centre_metres;
const turn = ${JSON.stringify(
    { '.spz': [1, -1, -1], '.glb': [-1, -1, 1] }[extension] || [1, 1, 1])};
const fov = 2 * Math.atan(c.height / 2 / c.focal[1]) * 180 / Math.PI;
const aspect = c.width / c.height * c.focal[1] / c.focal[0];
const rows = [0, 1, 2].map(i => [r[i], -r[3 + i], -r[6 + i], e[i]]
    .map(v => turn[i] * v));
${programs[viewer]}
for (let i = 0; i < 40; i++) {
    draw();
    await new Promise(done => setTimeout(done, 50));
}
window.done = true;
</script>`;

const server = http.createServer((request, response) => {
    const url = request.url.split('?')[0];
    const name = url.startsWith('/file') ? file : path.join(here, url);
    const is_script = /\.m?js$/.test(url);
    if (url !== '/' && !fs.existsSync(name))
        return response.writeHead(404).end();
    response.writeHead(200, { 'content-type': url === '/' ? 'text/html' :
        is_script ? 'text/javascript' : 'application/octet-stream' });
    response.end(url === '/' ? page : fs.readFileSync(name));
}).listen(0);

const browser = await puppeteer.launch({
    executablePath: process.env.CHROMIUM || '/usr/bin/chromium',
    args: ['--no-sandbox', '--use-gl=angle', '--use-angle=swiftshader',
           '--enable-unsafe-swiftshader']
});
const tab = await browser.newPage();
tab.on('pageerror', error => console.error(String(error)));
await tab.goto(`http://localhost:${server.address().port}/`);
await tab.waitForFunction('window.done', { timeout: 120000 });
const url = await tab.evaluate(
    'document.querySelector("canvas").toDataURL("image/png")');
fs.writeFileSync(out, Buffer.from(url.split(',')[1], 'base64'));
await browser.close();
server.close();
