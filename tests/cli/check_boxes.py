#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""check_boxes.py: guarantees, for films in the containers that docs/isobmff.md
and docs/gltf.md draft,
  mp4   ffprobe finds a sample for each segment, with the right time, duration
        and position, and each is an access point; the configuration and all
        samples, concatenated, are the film; a segment whose byte range alone
        was fetched can be drawn
  hls   if the initialisation range and the range of one segment are fetched by
        the playlist, ffprobe finds the sample of this segment in them
  gltf  a reader that does not know the extension finds the splats of a frame;
        the film is in the same file"""

import json
import re
import struct
import subprocess
import sys
import tempfile

from verdict import SAGA, SAGA_DEC, Verdicts, read
import boxes  # noqa: E402  (verdict knows where)
import splats  # noqa: E402

SCENE = "vectors/good/segments.saga"
DEMO = "docs/demo.saga"
FILM = "SAGA_gaussian_film"

checks = Verdicts("boxes")
complain, verdict = checks.complain, checks.verdict


def write(path, data):
    with open(path, "wb") as f:
        f.write(data)
    return path


def probe(path, *options):
    return json.loads(subprocess.check_output(
        ["ffprobe", "-v", "error", *options, "-show_streams", "-show_packets",
         "-of", "json", path]))


def picture(path, frame):
    return checks.run(SAGA_DEC, path, "--camera", "rig:1", "--time", frame,
                      "--crc")


def wanted(film):
    """Yields for each sample what ffprobe should report: time, duration,
    length."""
    parts, time = boxes.parts_of(film), 0
    for frames, data in parts["segments"]:
        duration = frames * parts["rate"][1]
        yield time, duration, len(data)
        time += duration


def check_packets(path, told, samples):
    got = [(p["pts"], int(p["size"])) for p in told["packets"]]
    if got != [(time, n) for time, _, n in samples]:
        complain(path, "has the samples", got, "not", samples)
    ends = int(told["streams"][0]["duration_ts"])
    if ends != samples[-1][0] + samples[-1][1]:
        complain(path, "ends at", ends)
    if not all(p["flags"].startswith("K") for p in told["packets"]):
        complain(path, "has samples that are no access points")


def check_mp4(tmp):
    film = read(SCENE)
    data, places = boxes.mux(film)
    path = write(tmp + "/film.mp4", data)
    told = probe(path)
    if [s["codec_tag_string"] for s in told["streams"]] != ["saga"]:
        complain("streams:", told["streams"])
    check_packets(path, told, list(wanted(film)))
    head = boxes.walk(data, [b"moov", b"trak", b"mdia", b"minf", b"stbl",
                             b"stsd", b"saga", b"sagC"])[4:]
    samples = [data[int(p["pos"]):][:int(p["size"])] for p in told["packets"]]
    if head + b"".join(samples) != film:
        complain("configuration and samples are not the film")
    # The film has the second segment, as the index locates it, and zeros for
    # the others.
    at, n = places[2 + 1]
    sizes = [size for _, _, size in wanted(film)]
    write(tmp + "/part.saga", head + bytes(sizes[0]) +
          boxes.walk(data[at:at + n], [b"mdat"]) + bytes(sum(sizes[2:])))
    if picture(tmp + "/part.saga", 30) != picture(SCENE, 30):
        complain("a segment that came by its range is drawn otherwise")
    verdict("mp4")


def check_hls(tmp):
    film = read(SCENE)
    data, places = boxes.mux(film)
    text = boxes.playlist(film, "film.mp4", places)
    start, = re.findall(r'#EXT-X-MAP:URI="film.mp4",BYTERANGE="(\d+)@0"', text)
    ranges = re.findall(r"#EXTINF:(.*),\n#EXT-X-BYTERANGE:(\d+)@(\d+)\n", text)
    samples = list(wanted(film))
    if len(ranges) != len(samples):
        complain("the playlist has", len(ranges), "segments")
    for (seconds, n, at), sample in zip(ranges, samples):
        path = write(tmp + "/range.mp4", data[:int(start)] +
                     data[int(at):int(at) + int(n)])
        check_packets(path, probe(path), [sample])
        if abs(float(seconds) - sample[1] / 30) > 1e-5:
            complain("a segment of", sample, "lasts", seconds, "seconds")
    verdict("hls")


def with_film(glb, film):
    """Returns a glTF file of a frame, with the film in its buffer."""
    n_json, = struct.unpack_from("<I", glb, 12)
    gltf, bin = json.loads(glb[20:20 + n_json]), glb[28 + n_json:]
    film_padded = film + bytes(-len(film) % 4)
    gltf["bufferViews"].append({"buffer": 0, "byteOffset": len(bin),
                                "byteLength": len(film)})
    gltf["buffers"][0]["byteLength"] = len(bin) + len(film_padded)
    of = gltf["meshes"][0]["primitives"][0]["extensions"]
    of["KHR_gaussian_splatting"]["extensions"] = {
        FILM: {"bufferView": len(gltf["bufferViews"]) - 1, "start": 0,
               "loop": True}}
    gltf["extensionsUsed"].append(FILM)
    text = json.dumps(gltf).encode()
    text += b" " * (-len(text) % 4)
    bin += film_padded
    return struct.pack("<5I", 0x46546c67, 2, 28 + len(text) + len(bin),
                       len(text), 0x4e4f534a) + text + \
        struct.pack("<2I", len(bin), 0x004e4942) + bin


def film_of(glb):
    """Returns the film to which the extension refers."""
    n_json, = struct.unpack_from("<I", glb, 12)
    gltf = json.loads(glb[20:20 + n_json])
    of = gltf["meshes"][0]["primitives"][0]["extensions"]
    told = of["KHR_gaussian_splatting"]["extensions"][FILM]
    view = gltf["bufferViews"][told["bufferView"]]
    at = 28 + n_json + view["byteOffset"]
    return glb[at:at + view["byteLength"]]


def check_gltf(tmp):
    still = tmp + "/still.glb"
    checks.run(SAGA, "export", DEMO, "-o", still)
    path = write(tmp + "/film.glb", with_film(read(still), read(DEMO)))
    if film_of(read(path)) != read(DEMO):
        complain("the film is not beside the frame")
    if splats.read_glb(path) != splats.read_glb(still):
        complain("the frame is not what it was without the film")
    verdict("gltf")


with tempfile.TemporaryDirectory() as folder:
    check_mp4(folder)
    check_hls(folder)
    check_gltf(folder)
sys.exit(checks.failed)
