#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""check_metrics.py: guarantees, for what `saga eval` measures,

  ffmpeg      the PSNR of RGB, and of Y, U and V by a formula written here, is
              ffmpeg's within 1e-4 dB; SSIM is ffmpeg's within 1e-4 for flat
              pictures, where both definitions agree
  temporal    the PSNR of the differences of successive pictures, and that after
              the best gain of each view, are those computed here
  lpips       a file of weights that is invalid, incomplete or cut is reported;
              with the weights in ../shared/data, if they exist, LPIPS is in the
              report
  compare     the differences of two results, and of two curves that differ by a
              known factor, are right; results of other protocols, other files
              and damaged files are refused

The pictures are those of a built-in scene and a noisy copy of them. SAGA=... is
the program (build/saga).
"""
import json
import math
import os
import re
import shutil
import struct
import subprocess
import sys
import tempfile
import zlib

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from verdict import Verdicts, pixels, read  # noqa: E402

SAGA = os.environ.get("SAGA", "build/saga")
WIDTH, HEIGHT, FRAMES = 64, 40, 3
LPIPS = "../shared/data/lpips/lpips_squeeze_v0.1.npz"
v = Verdicts("metrics")


def ffmpeg(*words):
    return subprocess.run(["ffmpeg", "-hide_banner", "-nostdin", "-y", *words],
                          check=True, capture_output=True, text=True).stderr


def evaluate(*words):
    run = subprocess.run([SAGA, "eval", *words], capture_output=True,
                         text=True)
    return run.returncode, run.stdout, run.stderr


def add_noise(path, seed):
    """Writes the picture again as PNG, with pseudo-random noise."""
    rgb = bytearray(pixels(path))
    for i, x in enumerate(rgb):
        seed = (seed * 1664525 + 1013904223) & 0xffffffff
        rgb[i] = min(max(x + (seed >> 24) % 17 - 6, 0), 255)
    rows = b"".join(b"\0" + bytes(rgb[3 * WIDTH * y:3 * WIDTH * (y + 1)])
                    for y in range(HEIGHT))
    with open(path, "wb") as f:
        f.write(b"\x89PNG\r\n\x1a\n")
        for kind, data in ((b"IHDR", struct.pack(">IIBBBBB", WIDTH, HEIGHT, 8,
                                                 2, 0, 0, 0)),
                           (b"IDAT", zlib.compress(rows)), (b"IEND", b"")):
            f.write(struct.pack(">I", len(data)) + kind + data +
                    struct.pack(">I", zlib.crc32(kind + data)))


def yuv(rgb):
    """Returns the planes of 8-bit YCbCr in BT.709, full range."""
    planes = bytearray(), bytearray(), bytearray()
    for i in range(0, len(rgb), 3):
        r, g, b = rgb[i:i + 3]
        y = 0.2126 * r + 0.7152 * g + 0.0722 * b
        for plane, x in zip(planes, (y, 128 + (b - y) / 1.8556,
                                     128 + (r - y) / 1.5748)):
            plane.append(min(max(math.floor(x + 0.5), 0), 255))
    return b"".join(planes)


def judge_of_ffmpeg(a, b, form, judge, title):
    """Returns what an ffmpeg filter reports for two raw pictures, by
    component."""
    for name, data in (("a.raw", a), ("b.raw", b)):
        with open(os.path.join(tmp, name), "wb") as f:
            f.write(data)
    raw = ["-f", "rawvideo", "-pix_fmt", form, "-s", f"{WIDTH}x{HEIGHT}", "-i"]
    text = ffmpeg(*raw, os.path.join(tmp, "a.raw"), *raw,
                  os.path.join(tmp, "b.raw"), "-lavfi", judge, "-f", "null",
                  "-")
    line = re.search(title + r" (.*)", text).group(1)
    return {k: float(x) for k, x in re.findall(r"(\w+):([0-9.]+)", line)}


def psnr_of_ffmpeg(a, b, form):
    return judge_of_ffmpeg(a, b, form, "psnr", "PSNR")


def near(what, value, wanted):
    if value is None or abs(value - wanted) > 1e-4:
        v.complain(what, "is", value, "not", wanted)


def check_ffmpeg():
    for frame in range(FRAMES):
        status, out, err = evaluate(noisy, capture, "--json", "--no-ssim",
                                    "--compare", f"{frame}:{frame + 1}")
        if status:
            return v.complain(err)
        view = json.loads(out)["views"][1]
        a, b = [pixels(f"{c}/images/cam01/{frame:05d}.png")
                for c in (noisy, capture)]
        near("PSNR", view["psnr"], psnr_of_ffmpeg(a, b, "rgb24")["average"])
        parts = psnr_of_ffmpeg(yuv(a), yuv(b), "yuvj444p")
        for k in "yuv":
            near("PSNR-" + k, view["psnr_" + k], parts[k])


def flat_copy(name, grey):
    """Copies the capture with pictures of a single grey. Returns the bytes of
    one."""
    to = os.path.join(tmp, name)
    shutil.copytree(capture, to)
    for camera in range(2):
        for frame in range(FRAMES):
            ffmpeg("-f", "lavfi", "-i", "color=black:s=%dx%d,format=rgb24,"
                   "lutrgb=%d:%d:%d" % (WIDTH, HEIGHT, grey, grey, grey),
                   "-frames:v", "1",
                   f"{to}/images/cam{camera:02d}/{frame:05d}.png")
    return pixels(to + "/images/cam00/00000.png")


def check_flat():
    """ffmpeg's SSIM has windows of 8x8 boxes, ours Gaussian ones. In flat
    pictures the window does not matter, so that both must agree."""
    a, b = flat_copy("dark", 60), flat_copy("bright", 97)
    status, out, err = evaluate(os.path.join(tmp, "dark"),
                                os.path.join(tmp, "bright"), "--json")
    if status or set(a) != {60} or set(b) != {97}:
        return v.complain(set(a), set(b), err)
    said = judge_of_ffmpeg(a[::3], b[::3], "gray", "ssim", "SSIM")["Y"]
    if not 0.8 < said < 0.95:
        v.complain("ffmpeg's SSIM is", said)
    near("SSIM v", json.loads(out)["views"][0]["ssim_valid"], said)


def exposed_mse(made, truth):
    """Returns the squared error of pictures after the best factor for each
    channel."""
    left = 0
    for k in range(3):
        x = [p for picture in made for p in picture[k::3]]
        y = [p for picture in truth for p in picture[k::3]]
        f = sum(p * q for p, q in zip(x, y)) / sum(p * p for p in x)
        left += sum((f * p - q) ** 2 for p, q in zip(x, y)) / len(x) / 3
    return left


def check_temporal():
    _, out, _ = evaluate(noisy, capture, "--json", "--no-ssim")
    report = json.loads(out)
    a, b = [[pixels(f"{c}/images/cam00/{i:05d}.png") for i in range(FRAMES)]
            for c in (noisy, capture)]
    errors = [(a[i][k] - a[i - 1][k] - b[i][k] + b[i - 1][k]) ** 2
              for i in range(1, FRAMES) for k in range(len(a[0]))]
    mse = sum(errors) / len(errors)
    near("temporal PSNR", report["views"][0]["temporal_psnr"],
         10 * math.log10(255 ** 2 / mse))
    near("exposed PSNR", report["views"][0]["psnr_exposed"],
         10 * math.log10(255 ** 2 / exposed_mse(a, b)))
    _, out, _ = evaluate(noisy, capture, "--json", "--no-ssim", "--compare",
                         "1:2")
    if json.loads(out)["views"][0]["temporal_psnr"] is not None:
        v.complain("a single picture has a temporal PSNR")


def check_lpips():
    bad = os.path.join(tmp, "weights.npz")
    for data, word in ((b"no weights at all, but some text", "not an .npz"),
                       (b"PK\5\6" + bytes(18), "alex.lin0")):
        with open(bad, "wb") as f:
            f.write(data)
        status, out, err = evaluate(noisy, capture, "--lpips", bad)
        if status != 1 or out or word not in err or bad not in err:
            v.complain("bad weights:", status, err)
    status, _, err = evaluate(noisy, capture, "--lpips", bad + "x")
    if status != 2 or bad + "x" not in err:
        v.complain("no weights:", status, err)
    if not os.path.exists(LPIPS):
        print("     skipped: there is no " + LPIPS)
        return
    whole = read(LPIPS)
    with open(bad, "wb") as f:
        f.write(whole.replace(b"squeeze.lin5.npy", b"squeeze.lin9.npy"))
    status, out, err = evaluate(noisy, capture, "--lpips", bad)
    if status != 1 or "squeeze.lin5" not in err:
        v.complain("weights without lin5:", status, err)
    status, out, err = evaluate(noisy, capture, "--lpips", LPIPS, "--json",
                                "--compare", "0:1")
    report = json.loads(out) if not status else {}
    if not report or not 0.001 < report["training"]["lpips"] < 1:
        v.complain("no LPIPS:", status, err)
    elif "SqueezeNet" not in report["protocol"]["lpips"]:
        v.complain("the protocol has no net")


def compare(*words):
    run = subprocess.run([SAGA, "compare", *words], capture_output=True,
                         text=True)
    return run.returncode, run.stdout, run.stderr


def write(name, *results):
    path = os.path.join(tmp, name)
    with open(path, "w") as f:
        f.write(name.startswith("list") and json.dumps(results) or
                "\n".join(json.dumps(r, indent=1) for r in results))
    return path


def check_compare():
    _, out, _ = evaluate(noisy, capture, "--json", "--no-ssim")
    report = json.loads(out)

    def result(nbytes, db):
        """Returns a report of a file of `nbytes` with all PSNRs equal to db."""
        r = json.loads(out)
        r["nbytes"] = nbytes
        for s in r["views"] + [r["training"]]:
            s["psnr"], s["lpips"] = db, 1 / db
        return r

    rates = [(1000, 30), (2100, 33), (3900, 35), (8000, 37.5), (15000, 39)]
    a = write("curve", *[result(n, q) for n, q in rates])
    b = write("list", *[result(0.8 * n, q) for n, q in rates])
    status, out_ab, err = compare(a, b, "--json")
    if status:
        return v.complain(err)
    bd = json.loads(out_ab)["bd_rate"]
    for s in "all", "training":
        for metric in "psnr", "lpips":
            near("BD-rate of " + metric, bd[s][metric]["pchip"], -20)
            near("BD-rate of " + metric, bd[s][metric]["akima"], -20)
    if "does not grow" not in bd["all"]["psnr_yuv"]["refused"]:
        v.complain("a flat curve gives", bd["all"])
    far = write("far", *[result(n, q + 8) for n, q in rates])
    if "too little" not in compare(a, far)[1]:
        v.complain("curves apart:", *compare(a, far))
    one, two = write("one", result(1000, 30)), write("two", result(900, 31.5))
    near("the difference", json.loads(compare(one, two, "--json")[1])
         ["difference"]["all"]["psnr"], 1.5)
    report["protocol"]["frames"] = [1, FRAMES]
    for bad, word in ((write("other", report), "frames"),
                      (write("mixed", result(1, 2), report), "frames"),
                      (write("none"), "no results"),
                      (write("older", dict(report, schema=0)), "schema"),
                      (os.path.join(capture, "transforms.json"), "than results")):
        status, text, err = compare(one, bad)
        if status != 1 or text or word not in err or bad not in err:
            v.complain(bad, status, err)
    with open(one, "a") as f:
        f.write("{")
    status, text, err = compare(one, two)
    if status != 1 or text or "not JSON" not in err:
        v.complain("a cut file:", status, err)


tmp = tempfile.mkdtemp()
try:
    capture, noisy = os.path.join(tmp, "a"), os.path.join(tmp, "b")
    subprocess.run([SAGA, "synth", capture, "--size", f"{WIDTH}x{HEIGHT}",
                    "--cameras", "2", "--frames", str(FRAMES), "--hold-out",
                    "0", "--depth-every", "0"], check=True,
                   capture_output=True)
    shutil.copytree(capture, noisy)
    for camera in range(2):
        for frame in range(FRAMES):
            add_noise(f"{noisy}/images/cam{camera:02d}/{frame:05d}.png",
                      3 * camera + frame)
    check_ffmpeg()
    check_flat()
    v.verdict("ffmpeg")
    check_temporal()
    v.verdict("temporal")
    check_lpips()
    v.verdict("lpips")
    check_compare()
    v.verdict("compare")
finally:
    shutil.rmtree(tmp)
sys.exit(v.failed)
