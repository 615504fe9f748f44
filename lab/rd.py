#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Measures rate and distortion of scenes; `make rd` and `make rd-short` run it.

  rd.py [--short] [--x265] [--table] [--scenes A,B] [--seeds N,M] [--rates N,M]
        [NAME=CAPTURE ...]

Trains each scene of lab/rd.ini (SCENES=FILE: another list) at its rates with
its seeds, evaluates the finished file, and appends a row to rows.jsonl
(--short: short.jsonl) in RESULTS (docs/results/rd). A row that exists for the
code of this tree and these options is not measured again. The code is the
contents of common/, decoder/ and trainer/, so that a change elsewhere keeps the
rows. An interrupted training is continued. --x265 also measures missing points
of x265. --table only writes RESULTS.md and .svg from existing rows, which the
long form does at its end. The short form prints how each row differs from the
previous one with these options.

Environment, with defaults: SAGA (build/saga), WORK (build/rd), RESULTS
(docs/results/rd), THREADS (1).
"""
import configparser
import datetime
import hashlib
import json
import math
import os
import subprocess
import sys

import rd_table
import simulcast

LAB = os.path.dirname(os.path.abspath(__file__))
ROOT = os.path.dirname(LAB)
SAGA = os.environ.get("SAGA", os.path.join(ROOT, "build/saga"))
WORK = os.environ.get("WORK", os.path.join(ROOT, "build/rd"))
RESULTS = os.environ.get("RESULTS", os.path.join(ROOT, "docs/results/rd"))
SCENES = os.environ.get("SCENES", os.path.join(LAB, "rd.ini"))
THREADS = os.environ.get("THREADS", "1")


def say(text):
    print(text, flush=True)


# --- The code ----------------------------------------------------------------

def code_of_tree():
    """Returns a hash of the contents of the folders on which results depend."""
    digest = hashlib.sha256()
    for top in "common", "decoder", "trainer":
        for folder, folders, files in sorted(os.walk(os.path.join(ROOT, top))):
            folders.sort()
            for name in sorted(f for f in files if f.endswith((".c", ".h"))):
                path = os.path.join(folder, name)
                digest.update(os.path.relpath(path, ROOT).encode() + b"\0")
                digest.update(open(path, "rb").read())
    return digest.hexdigest()[:12]


def commit_of_tree():
    """Returns the commit, with a + if the tree has changes, or None without
    git."""
    git = ["git", "-C", ROOT]
    try:
        commit = subprocess.check_output(
            git + ["rev-parse", "--short", "HEAD"], text=True,
            stderr=subprocess.DEVNULL).strip()
        changes = subprocess.check_output(
            git + ["status", "--porcelain", "common", "decoder", "trainer"])
    except (OSError, subprocess.CalledProcessError):
        return None
    return commit + ("+" if changes else "")


# --- Scenes ------------------------------------------------------------------

class Scene:
    """A section of lab/rd.ini, and the path of its capture."""

    def __init__(self, name, section, capture):
        self.name = name
        self.synth = section.get("synth", "").split()
        self.rates = [r.split(":") for r in section["rates"].split()]
        self.iterations = section["iterations"]
        self.seeds = section["seeds"].split()
        self.options = section.get("options", "").split()
        self.crfs = section.get("x265", "").split()
        within = section.get("within", "").split()
        self.within = (float(within[0]), float(within[1])) if within else None
        self.capture = capture

    def encode_options(self, rate, seed):
        primitives, bits = self.rates[rate]
        return ["--primitives", primitives, "--lambda", bits, "--iterations",
                self.iterations, "--seed", seed] + self.options

    def source(self):
        return "synth " + " ".join(self.synth) if self.synth else "capture"


def read_scenes(form, captures):
    """Returns all scenes of the short or the long form. captures: {name:
    path}."""
    table = configparser.ConfigParser()
    with open(SCENES) as f:
        table.read_file(f)
    scenes = []
    for title in table.sections():
        short, name = title.startswith("short "), title.split()[-1]
        if short != (form == "short") or title == "capture":
            continue
        if "synth" in table[title]:
            # Captures with different options have different folders.
            options = table[title]["synth"]
            mark = hashlib.sha256(options.encode()).hexdigest()[:8]
            path = os.path.join(WORK, f"{name}-{mark}")
        else:
            path = captures.pop(name, None)
        scenes.append(Scene(name, table[title], path))
    if form == "full":
        scenes += [Scene(name, table["capture"], path)
                   for name, path in captures.items()]
    return scenes


def prepare(scene):
    """Renders a built-in scene. Returns False, after a message, if the scene is
    a capture that does not exist."""
    if not scene.capture or not (scene.synth or os.path.exists(scene.capture)):
        where = scene.capture or "it is not named: CAPTURES='NAME=PATH ...'"
        say(f"rd: {scene.name} is skipped: no capture ({where})")
        return False
    if scene.synth and not os.path.exists(scene.capture):
        say(f"rd: rendering {scene.name}")
        os.makedirs(WORK, exist_ok=True)
        status, _ = run([SAGA, "synth", scene.capture, "--depth-every", "0",
                         "--threads", THREADS] + scene.synth,
                        subprocess.DEVNULL)
        if status:
            sys.exit(f"rd: {scene.name}: saga synth was stopped or failed")
    return True


# --- Running -----------------------------------------------------------------

def run(command, out):
    """Runs a command. Returns the CPU seconds that it and its children took."""
    env = dict(os.environ, OMP_NUM_THREADS=THREADS)
    process = subprocess.Popen(command, stdout=out, env=env)
    while True:
        try:
            _, status, usage = os.wait4(process.pid, 0)
            break
        except KeyboardInterrupt:
            pass  # the command has got the signal, too, and saves its state
    process.returncode = os.waitstatus_to_exitcode(status)
    return process.returncode, usage.ru_utime + usage.ru_stime


def must(command, name):
    """Runs a command and writes its output to the file `name` when it is
    complete. Returns its CPU seconds."""
    with open(name + ".part", "w") as out:
        status, seconds = run(command, out)
    if status:
        return None, seconds
    os.replace(name + ".part", name)
    return json.load(open(name)), seconds


def spent_before(name):
    return float(open(name).read()) if os.path.exists(name) else 0.0


def train(scene, base, options):
    """Trains. Returns the report, and the CPU seconds, which include those of
    interrupted runs."""
    resume = ["--resume"] if os.path.exists(base + ".saga.ckpt") else []
    before = spent_before(base + ".cpu") if resume else 0.0
    report, seconds = must(
        [SAGA, "encode", scene.capture, "-o", base + ".saga", "--json",
         "--threads", THREADS] + options + resume, base + ".encode.json")
    with open(base + ".cpu", "w") as f:
        f.write(str(before + seconds))
    if report is None:
        sys.exit(f"rd: {scene.name}: saga encode was stopped or failed; the "
                 "same command goes on")
    return report, before + seconds


def hold_out(scene):
    at = scene.options.index("--hold-out") if "--hold-out" in scene.options \
        else -1
    return scene.options[at:at + 2] if at >= 0 else []


def evaluate(scene, what, name, *options):
    report, _ = must([SAGA, "eval", what, scene.capture, "--json", "--threads",
                      THREADS, *options] + hold_out(scene), name)
    if report is None:
        sys.exit(f"rd: {scene.name}: saga eval fails")
    return report


# --- Rows --------------------------------------------------------------------

def mean(values):
    values = [v for v in values if v is not None]
    return sum(values) / len(values) if values else None


def changing(views):
    """Returns the PSNR over all changing pixels of these views."""
    error = pixels = 0
    for v in views:
        n = v["changing_pixels"]
        pixels += n
        if v["changing_psnr"] is not None:
            error += n * 10 ** (-v["changing_psnr"] / 10)
    return -10 * math.log10(error / pixels) if error else None


def quality(report):
    """Returns the PSNR by our protocol: from the squared error over all frames
    of a camera, then averaged over cameras."""
    views = report["views"]
    sets = {"all": views,
            "training": [v for v in views if not v["held_out"]],
            "held_out": [v for v in views if v["held_out"]]}
    return {"psnr": {k: mean(v["psnr_of_mean_mse"] for v in s)
                     for k, s in sets.items()},
            "changing": {k: changing(s) for k, s in sets.items()},
            "ssim": {k: mean(v["ssim_valid"] for v in s)
                     for k, s in sets.items()}}


def append(path, row):
    os.makedirs(os.path.dirname(path), exist_ok=True)
    with open(path, "a") as f:
        f.write(json.dumps(row) + "\n")


def read_rows(path):
    if not os.path.exists(path):
        return []
    with open(path) as f:
        return [json.loads(line) for line in f if line.strip()]


def same(row, wanted):
    return all(row.get(k) == wanted[k]
               for k in ("scene", "code", "source", "options"))


def measure(scene, code, rate, seed):
    """Trains and evaluates; returns the row."""
    options = scene.encode_options(rate, seed)
    base = os.path.join(WORK, code, scene.name)
    os.makedirs(base, exist_ok=True)
    mark = hashlib.sha256(" ".join([scene.source()] + options).encode())
    base = os.path.join(base, mark.hexdigest()[:12])
    report, seconds = train(scene, base, options)
    judged = evaluate(scene, base + ".saga", base + ".eval.json")
    row = {"scene": scene.name, "rate": rate, "seed": seed, "code": code,
           "commit": commit_of_tree(), "source": scene.source(),
           "options": options, "bytes": judged["nbytes"],
           "parts": judged["bytes"]}
    row.update(quality(judged))
    row.update(warm_up=report["psnr_warm_up"], bits=report["bits"],
               cpu_minutes=seconds / 60, threads=int(THREADS),
               date=datetime.date.today().isoformat())
    return row


def train_all(scenes, path, chosen):
    code = code_of_tree()
    for scene in scenes:
        if not prepare(scene):
            continue
        for seed in chosen("seeds", scene.seeds):
            for rate in chosen("rates", range(len(scene.rates))):
                rate = int(rate)
                wanted = {"scene": scene.name, "code": code,
                          "source": scene.source(),
                          "options": scene.encode_options(rate, seed)}
                if any(same(row, wanted) for row in read_rows(path)):
                    continue
                say(f"rd: {scene.name}, rate {rate + 1}, seed {seed}: " +
                    " ".join(wanted["options"]))
                row = measure(scene, code, rate, seed)
                append(path, row)
                say("    " + rd_table.line(row))


def x265_all(scenes, path):
    for scene in scenes:
        if not scene.crfs or not prepare(scene):
            continue
        for crf in scene.crfs:
            if any(p["codec"] == "x265" and p["scene"] == scene.name and
                   p.get("source") == scene.source() and p["crf"] == crf
                   for p in read_rows(path)):
                continue
            say(f"rd: {scene.name}: x265, crf {crf}")
            folder = os.path.join(WORK, "x265")
            os.makedirs(folder, exist_ok=True)
            try:
                point = simulcast.encode(scene.capture, "x265", crf, folder)
            except simulcast.Missing as why:
                say(f"rd: {why}, so x265 is not measured")
                return
            judged = evaluate(scene, simulcast.decoded(folder),
                              os.path.join(folder, "eval.json"), "--no-ssim")
            point.update(codec="x265", scene=scene.name,
                         source=scene.source(), crf=crf)
            point.update(quality(judged))
            append(path, point)
            say("    " + rd_table.line(point))


# --- Command -----------------------------------------------------------------

def arguments(words):
    flags, lists, captures = set(), {}, {}
    words = iter(words)
    for word in words:
        if word in ("--short", "--x265", "--table"):
            flags.add(word[2:])
        elif word in ("--scenes", "--seeds", "--rates"):
            lists[word[2:]] = next(words, "").split(",")
        elif "=" in word and not word.startswith("-"):
            name, path = word.split("=", 1)
            captures[name] = path
        else:
            sys.exit(__doc__.strip())
    return flags, lists, captures


def main(words):
    flags, lists, captures = arguments(words)
    form = "short" if "short" in flags else "full"
    path = os.path.join(RESULTS, "short.jsonl" if form == "short" else
                        "rows.jsonl")
    points = os.path.join(RESULTS, "points.jsonl")
    scenes = [s for s in read_scenes(form, captures)
              if s.name in lists.get("scenes", [s.name])]
    if not scenes:
        sys.exit("rd: no such scene in " + SCENES)

    def chosen(key, every):
        wanted = lists.get(key)
        if key == "rates" and wanted:
            wanted = [str(int(w) - 1) for w in wanted]
        return [e for e in every if not wanted or str(e) in wanted]

    if "x265" in flags:
        x265_all(scenes, points)
    if not {"table", "x265"} & flags:
        train_all(scenes, path, chosen)
    if form == "short":
        rd_table.differences(read_rows(path), scenes, code_of_tree())
    else:
        rd_table.write(RESULTS, read_rows(path), read_rows(points), scenes)


if __name__ == "__main__":
    main(sys.argv[1:])
