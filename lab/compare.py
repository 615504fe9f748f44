#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Compares saga with video codecs on a capture; `make compare` runs it.

  compare.py CAPTURE WORK [FILE.saga ...]

Codes each camera of the capture separately with every codec of simulcast.py
that ffmpeg supports here, at four qualities, and evaluates the pictures and the
files with `saga eval`. Without files it trains saga at the rates in the section
"capture" of lab/rd.ini, which takes long. Writes to WORK: CODEC.json and
saga.json with a result for each quality; report.html. Prints the output of
`saga compare` for each codec and the first, and a table: the BD-rate of saga
against each codec, and the change of bytes at 27, 28.5, 30 and 32 dB, by the
PSNR of lab/rd.py over all cameras. Existing results are not measured again.

A file anchors.json in the capture's folder may hold curves of codecs that do
not run here, which the table then has too, measured on all frames of the
capture at its full size:
  {"curves": {NAME: {"kB": [...], "psnr_rgb": [...]}, ...}}

Environment, with defaults: SAGA (build/saga), THREADS (1), EVAL (options of
`saga eval`, such as "--no-ssim" or "--lpips FILE.npz"; none), CODECS (names of
codecs; all), KEY (frames between two keyframes; the codec's choice).
"""
import configparser
import json
import os
import subprocess
import sys

import simulcast
from bd_rate import bd_rate, saving
from rd import quality
from rd_table import AT

LAB = os.path.dirname(os.path.abspath(__file__))
SAGA = os.environ.get("SAGA", os.path.join(os.path.dirname(LAB), "build/saga"))
THREADS = os.environ.get("THREADS", "1")
EVAL = os.environ.get("EVAL", "").split()


def say(text):
    print(text, flush=True)


def saga(*words):
    return subprocess.run([SAGA, *words], check=True, text=True,
                          stdout=subprocess.PIPE).stdout


def write(path, text):
    with open(path + ".part", "w") as f:
        f.write(text)
    os.replace(path + ".part", path)


def judge(what, capture, path, more):
    """Evaluates a file or a folder and writes the result with `more` added."""
    result = json.loads(saga("eval", what, capture, "--json", "--threads",
                             THREADS, "--pictures", path[:-5], *EVAL))
    result.update(more)
    write(path, json.dumps(result))


def curve(work, name, paths):
    """Writes all results of a codec into one file."""
    path = os.path.join(work, name + ".json")
    write(path, "\n".join(open(p).read() for p in paths) + "\n")
    return path


def measure_codec(capture, work, codec):
    paths = []
    for quality in simulcast.CODECS[codec].rates:
        path = os.path.join(work, f"{codec}-{quality}.json")
        paths.append(path)
        if os.path.exists(path):
            continue
        say(f"compare: {codec}, quality {quality}")
        folder = os.path.join(work, "stream")
        os.makedirs(folder, exist_ok=True)
        point = simulcast.encode(capture, codec, quality, folder,
                                 os.environ.get("KEY"))
        judge(simulcast.decoded(folder), capture, path,
              {"codec": codec, "quality": quality, "nbytes": point["bytes"]})
    return curve(work, codec, paths)


def train(capture, work):
    """Trains files at the rates in the section "capture" of lab/rd.ini."""
    table = configparser.ConfigParser()
    table.read(os.path.join(LAB, "rd.ini"))
    section, files = table["capture"], []
    for rate in section["rates"].split():
        primitives, bits = rate.split(":")
        path = os.path.join(work, f"saga-{primitives}.saga")
        files.append(path)
        if not os.path.exists(path):
            say(f"compare: saga, {primitives} primitives")
            resume = ["--resume"] if os.path.exists(path + ".ckpt") else []
            saga("encode", capture, "-o", path, "--primitives", primitives,
                 "--lambda", bits, "--iterations", section["iterations"],
                 "--threads", THREADS, *resume)
    return files


def measure_saga(capture, work, files):
    paths = []
    for i, name in enumerate(files):
        path = os.path.join(work, f"saga-{i + 1}.json")
        paths.append(path)
        if not os.path.exists(path) or \
                os.path.getmtime(path) < os.path.getmtime(name):
            judge(name, capture, path, {"codec": "saga"})
    return curve(work, "saga", paths)


# --- The table ---------------------------------------------------------------

def points_of(path):
    """Returns the points (bytes, dB) of all results in a file."""
    with open(path) as f:
        results = [json.loads(line) for line in f]
    return [(r["nbytes"], quality(r)["psnr"]["all"]) for r in results]


def anchors_of(capture):
    """Returns the curves that came with the capture, {name: points}."""
    path = os.path.join(capture, "anchors.json")
    if not os.path.exists(path):
        return {}
    try:
        with open(path) as f:
            curves = json.load(f)["curves"]
        return {name: [(1000 * kb, db) for kb, db in
                       zip(c["kB"], c["psnr_rgb"], strict=True)]
                for name, c in curves.items()}
    except (AttributeError, KeyError, TypeError, ValueError) as why:
        sys.exit(f"compare: {path} has no curves of kB and psnr_rgb: {why!r}")


def percent(value):
    return "-" if value is None else f"{value:+.1f} %"


def table(anchors, ours):
    """Returns lines that state how many bytes saga saves against each of the
    anchors, {name: points}."""
    head = "bytes of saga against"
    width = max(len(name) for name in [head, *anchors])
    lines = [head.ljust(width) + "   BD-rate" +
             "".join(f"{db:7g} dB" for db in AT)]
    for name, anchor in anchors.items():
        cells = [bd_rate(anchor, ours)] + [saving(anchor, ours, db)
                                           for db in AT]
        lines.append(name.ljust(width) + "".join(percent(c).rjust(10)
                                                 for c in cells))
    return lines


def main(words):
    if len(words) < 2 or words[0].startswith("-"):
        sys.exit(__doc__.strip())
    capture, work, files = words[0], words[1], words[2:]
    for path in [capture] + files:
        if not os.path.exists(path):
            sys.exit(f"compare: there is no {path}")
    wanted = os.environ.get("CODECS", " ".join(simulcast.CODECS)).split()
    os.makedirs(work, exist_ok=True)
    given, curves = anchors_of(capture), []
    for codec in wanted:
        try:
            curves.append(measure_codec(capture, work, codec))
        except simulcast.Missing as why:
            say(f"compare: {why}, so {codec} is left out")
        except KeyError:
            sys.exit(f"compare: no codec {codec}; there are " +
                     ", ".join(simulcast.CODECS))
    curves.append(measure_saga(capture, work, files or train(capture, work)))
    for other in curves[1:]:
        say(saga("compare", curves[0], other))
    anchors = {os.path.basename(c)[:-5]: points_of(c) for c in curves[:-1]}
    anchors.update(given)
    say("\n".join(table(anchors, points_of(curves[-1]))) + "\n")
    report = os.path.join(work, "report.html")
    saga("report", *curves, "-o", report)
    say(f"compare: {report} shows all of it")


if __name__ == "__main__":
    main(sys.argv[1:])
