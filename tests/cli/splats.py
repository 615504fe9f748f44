# SPDX-License-Identifier: MIT
"""Readers of splat files and a renderer of splats, written from the public
descriptions of the formats and nothing of ours, for checks of what `saga
export` writes. A splat is a dictionary: mean (3), quat (w, x, y, z), scale (3,
deviations), opacity (0..1), colour (coefficients of spherical harmonics, each
R, G, B); lengths in the file's units."""

import gzip
import json
import math
import struct


def read(path):
    with open(path, "rb") as f:
        return f.read()


def sigmoid(x):
    return 1 / (1 + math.exp(-x))


def read_ply(path):
    data = read(path)
    end = data.index(b"end_header\n") + len(b"end_header\n")
    lines = data[:end].decode().split("\n")
    assert lines[0] == "ply", lines[0]
    assert lines[1] == "format binary_little_endian 1.0", lines[1]
    names = [line.split()[2] for line in lines
             if line.startswith("property float ")]
    n = int([line for line in lines if line.startswith("element")][0].split()
            [2])
    record = struct.Struct("<%df" % len(names))
    assert len(data) == end + n * record.size, "length"
    rest = sum(name.startswith("f_rest_") for name in names) // 3
    splats = []
    for i in range(n):
        v = dict(zip(names, record.unpack_from(data, end + i * record.size)))
        colour = [[v["f_dc_%d" % c] for c in range(3)]]
        for k in range(rest):
            colour.append([v["f_rest_%d" % (c * rest + k)] for c in range(3)])
        splats.append({
            "mean": [v[a] for a in "xyz"],
            "quat": [v["rot_%d" % k] for k in range(4)],
            "scale": [math.exp(v["scale_%d" % k]) for k in range(3)],
            "opacity": sigmoid(v["opacity"]), "colour": colour})
        if "time" in v:
            splats[-1].update(time=v["time"], duration=math.exp(
                v["log_duration"]), velocity=[v["velocity_%d" % k]
                                              for k in range(3)])
    return splats


def read_moving(path):
    """Reads FTGS PLY, version 1. Returns a function that returns the splats of
    a frame."""
    notes = dict(line.split()[1:] for line in
                 read(path).split(b"end_header")[0].decode().split("\n")
                 if line.startswith("comment "))
    assert notes["ftgs_version"] == "1" and notes["use_velocity"] == "1"
    assert notes["time_units"] == "normalized"
    splats, n = read_ply(path), int(notes["n_frames"])

    def at(frame):
        t = frame / max(n - 1, 1)
        return [dict(s, mean=[x + v * (t - s["time"])
                              for x, v in zip(s["mean"], s["velocity"])],
                     opacity=max(1e-4, s["opacity"] * math.exp(
                         -((t - s["time"]) / s["duration"]) ** 2 / 2)))
                for s in splats]
    return at


def turned(splat, axis):
    """Turns a splat by half a turn around x or z, before all other
    rotations."""
    w, x, y, z = splat["quat"]
    flip = [1 if k == axis else -1 for k in range(3)]
    colour = [list(c) for c in splat["colour"]]
    # The coefficients of degree 1 are in the order y, z, x; those of even
    # degrees are not turned.
    for k, a in enumerate([1, 2, 0][:len(colour) - 1]):
        colour[1 + k] = [flip[a] * v for v in colour[1 + k]]
    return dict(splat, mean=[f * v for f, v in zip(flip, splat["mean"])],
                quat=[-x, w, -z, y] if axis == 0 else [-z, -y, x, w],
                colour=colour)


def read_spz(path):
    data = gzip.decompress(read(path))
    magic, version, n, degree, bits, flags, zero = \
        struct.unpack_from("<3I4B", data)
    assert (magic, version, flags, zero) == (0x5053474e, 3, 0, 0)
    rest = (degree + 1) ** 2 - 1
    assert len(data) == 16 + n * (20 + 3 * rest), "length"
    at_alpha = 16 + 9 * n
    at_colour, at_scale = at_alpha + n, at_alpha + 4 * n
    at_quat = at_scale + 3 * n
    at_rest = at_quat + 4 * n
    splats = []
    for i in range(n):
        mean = []
        for k in range(3):
            v = int.from_bytes(data[16 + 9 * i + 3 * k:][:3], "little",
                               signed=True)
            mean.append(v / 2 ** bits)
        word = struct.unpack_from("<I", data, at_quat + 4 * i)[0]
        q, shift = [0.0] * 4, 30
        largest = word >> 30
        for k in range(4):
            if k == largest:
                continue
            shift -= 10
            v = word >> shift & 1023
            q[k] = (v & 511) / 511 * math.sqrt(0.5) * (-1 if v & 512 else 1)
        q[largest] = math.sqrt(max(0, 1 - sum(v * v for v in q)))
        byte = data[at_colour + 3 * i:at_colour + 3 * i + 3]
        colour = [[(b / 255 - 0.5) / 0.15 for b in byte]]
        for k in range(rest):
            at = at_rest + 3 * (rest * i + k)
            colour.append([(b - 128) / 128 for b in data[at:at + 3]])
        splats.append({
            "mean": mean, "quat": [q[3], q[0], q[1], q[2]],
            "scale": [math.exp(b / 16 - 10)
                      for b in data[at_scale + 3 * i:at_scale + 3 * i + 3]],
            "opacity": data[at_alpha + i] / 255, "colour": colour})
    return [turned(s, 0) for s in splats]


def read_glb(path):
    data = read(path)
    magic, version, total, n_json, kind = struct.unpack_from("<5I", data)
    assert (magic, version, kind) == (0x46546c67, 2, 0x4e4f534a)
    assert total == len(data) and n_json % 4 == 0
    gltf = json.loads(data[20:20 + n_json])
    n_bin, kind = struct.unpack_from("<2I", data, 20 + n_json)
    assert kind == 0x004e4942 and total == 28 + n_json + n_bin
    assert gltf["extensionsUsed"][0] == "KHR_gaussian_splatting"
    primitive = gltf["meshes"][0]["primitives"][0]
    assert primitive["mode"] == 0
    assert primitive["extensions"]["KHR_gaussian_splatting"]["kernel"] == \
        "ellipse"
    arrays = {}
    for name, index in primitive["attributes"].items():
        accessor = gltf["accessors"][index]
        view = gltf["bufferViews"][accessor["bufferView"]]
        m = {"SCALAR": 1, "VEC3": 3, "VEC4": 4}[accessor["type"]]
        assert accessor["componentType"] == 5126
        assert view["byteLength"] == 4 * m * accessor["count"]
        floats = struct.unpack_from(
            "<%df" % (m * accessor["count"]), data,
            28 + n_json + view["byteOffset"])
        arrays[name] = [floats[m * i:m * i + m]
                        for i in range(accessor["count"])]
        if name == "POSITION":
            for which, of in (("min", min), ("max", max)):
                assert struct.pack("<3f", *accessor[which]) == struct.pack(
                    "<3f", *(of(p[k] for p in arrays[name])
                             for k in range(3)))
    k = "KHR_gaussian_splatting:"
    harmonics = sorted(name for name in arrays if name.startswith(k + "SH"))
    splats = []
    for i, mean in enumerate(arrays["POSITION"]):
        x, y, z, w = arrays[k + "ROTATION"][i]
        splats.append(turned({
            "mean": list(mean), "quat": [w, x, y, z],
            "scale": list(arrays[k + "SCALE"][i]),
            "opacity": arrays[k + "OPACITY"][i][0],
            "colour": [list(arrays[h][i]) for h in harmonics]}, 2))
    return splats


# --- Drawing ---------------------------------------------------------------

def rotation(q):
    n = math.sqrt(sum(v * v for v in q))
    w, x, y, z = (v / n for v in q)
    return [[1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]]


def covariance(splat):
    r, s = rotation(splat["quat"]), splat["scale"]
    return [[sum(r[i][k] * r[j][k] * s[k] ** 2 for k in range(3))
             for j in range(3)] for i in range(3)]


def colour_towards(splat, d):
    """Evaluates harmonics of degree 0 and 1 in a direction."""
    x, y, z = d
    y1 = 0.4886025119029199
    basis = [0.28209479177387814, -y1 * y, y1 * z, -y1 * x]
    return [max(0.0, 0.5 + sum(b * c[k] for b, c in
                               zip(basis, splat["colour"])))
            for k in range(3)]


def project(splat, camera, low_pass):
    """Returns a splat in the picture (depth, mean, inverse covariance,
    extents), or None if it is not in front of the camera."""
    r, (fx, fy) = camera["rotation"], camera["focal"]
    v = [m - c for m, c in zip(splat["mean"], camera["centre_metres"])]
    x, y, z = (sum(r[3 * i + k] * v[k] for k in range(3)) for i in range(3))
    if z < camera["near_metres"]:
        return None
    w, h = camera["width"], camera["height"]
    cx, cy = camera["principal"]
    # The Jacobian is evaluated at most 0.15 of the picture's side outside the
    # picture.
    sx = min(max(fx * x / z, -0.15 * w - cx), 1.15 * w - cx)
    sy = min(max(fy * y / z, -0.15 * h - cy), 1.15 * h - cy)
    j = [[(fx * r[k] - sx * r[6 + k]) / z for k in range(3)],
         [(fy * r[3 + k] - sy * r[6 + k]) / z for k in range(3)]]
    s = covariance(splat)
    a, b, c = (sum(j[p][m] * s[m][n] * j[q][n] for m in range(3)
                   for n in range(3)) for p, q in ((0, 0), (0, 1), (1, 1)))
    a += low_pass
    c += low_pass
    det = a * c - b * b
    n = math.sqrt(sum(k * k for k in v))
    return {"depth": z, "mean": [fx * x / z + cx, fy * y / z + cy],
            "conic": [c / det, -b / det, a / det],
            "reach": [math.sqrt(11.1 * a), math.sqrt(11.1 * c)],
            "opacity": splat["opacity"],
            "colour": colour_towards(splat, [k / n for k in v])}


def draw_one(splat, picture, light, width, height):
    (mx, my), (a, b, c) = splat["mean"], splat["conic"]
    rx, ry = splat["reach"]
    for y in range(max(0, int(my - ry)), min(height, int(my + ry) + 2)):
        dy = y + 0.5 - my
        for x in range(max(0, int(mx - rx)), min(width, int(mx + rx) + 2)):
            dx = x + 0.5 - mx
            power = 0.5 * (a * dx * dx + c * dy * dy) + b * dx * dy
            alpha = min(0.99, splat["opacity"] * math.exp(-power))
            if alpha < 1 / 256:
                continue
            i = y * width + x
            for k in range(3):
                picture[3 * i + k] += light[i] * alpha * splat["colour"][k]
            light[i] *= 1 - alpha


def draw(splats, camera, background, low_pass=0.3):
    """Draws the splats front to back. Returns samples in 0..1, rows from the
    top."""
    n = camera["width"] * camera["height"]
    picture, light = [0.0] * (3 * n), [1.0] * n
    seen = [p for p in (project(s, camera, low_pass) for s in splats) if p]
    for splat in sorted(seen, key=lambda s: s["depth"]):
        draw_one(splat, picture, light, camera["width"], camera["height"])
    return [picture[i] + light[i // 3] * background[i % 3]
            for i in range(3 * n)]


def psnr(picture, samples):
    """Returns the PSNR of samples in 0..1 against 8-bit samples."""
    error = sum((255 * min(p, 1) - s) ** 2 for p, s in zip(picture, samples))
    return 10 * math.log10(255 ** 2 * len(samples) / max(error, 1e-9))
