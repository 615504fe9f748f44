#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""ablation_table.py FOLDER [NAME=ORDER0.json ...]: the tables of the ablation.

lab/ablation.sh fills FOLDER. It has a folder rN/ for each rate, the lowest
first, with VARIANT.json (make_refit), VARIANT.eval.json (saga eval --json) and
VARIANT.times.json (make_times) for each variant, and trained.eval.json for the
file from which the variants are made; and paper/SCENE.json (make_paper), the
paper's model without a part.
Further arguments are reports of make_order0, with the scenes' names.
Prints Markdown; writes FOLDER/curves.dat and FOLDER/slots.dat for gnuplot.
"""
import json
import math
import os
import sys
import textwrap

from bd_rate import bd_rate

VARIANTS = [
    ("full", "full model"),
    ("no-bank", "no bank"),
    ("no-hyperprior", "no hyperprior"),
    ("no-parent", "no parent"),
    ("no-groups", "no groups"),
    ("nothing", "constants by channel"),
    ("raw", "raw networks, 16 bits"),
    ("all", "all sources, whatever they are worth"),
    ("all-no-bank", "... except the bank"),
    ("all-plain", "... with the plain update"),
]
# A variant is compared with the full model unless another one stands here.
AGAINST = {"all-no-bank": "all", "all-plain": "all"}
SLOTS = 32, 64, 128, 256, 512
KINDS = [
    ("tree", "tree"),
    ("coarse_centres", "coarse centres"),
    ("coarse_features", "coarse features"),
    ("fine_suffixes", "fine suffixes"),
    ("fine_offsets", "fine offsets"),
    ("primitive_counts", "primitive counts"),
    ("primitive_suffixes", "primitive suffixes"),
    ("primitive_offsets", "primitive offsets"),
]


# --- Reading -----------------------------------------------------------------

def load(*names):
    path = os.path.join(*names)
    return json.load(open(path)) if os.path.exists(path) else None


def parameters(report):
    n = report["after"]["networks"]
    return n["entropy_parameters"] + n["reconstruction_parameters"]


class Trained:
    """The trained file from which the variants of one rate are made."""

    def __init__(self, folder):
        report = load(folder, "trained.eval.json")
        self.bytes, self.psnr = report["nbytes"], report["training"]["psnr"]


class Run:
    """One file: its variant at one rate."""

    def __init__(self, folder, variant):
        self.report = load(folder, variant + ".json")
        self.eval = load(folder, variant + ".eval.json")
        self.times = load(folder, variant + ".times.json")
        self.there = None not in (self.report, self.eval, self.times)
        if not self.there:
            return
        self.bytes = self.report["bytes"]
        if variant == "raw":  # parameters are not coded: 16 bits for each
            self.bytes += 2 * parameters(self.report) - \
                self.eval["bytes"]["networks"]
        self.psnr = self.eval["training"]["psnr"]


def points(runs):
    return [(r.bytes, r.psnr) for r in runs]


def same_symbols(full, runs):
    """Returns the mean change of the bytes, in per cent, at any PSNR."""
    change = [math.log(r.bytes / f.bytes) for f, r in zip(full, runs)]
    return 100 * (math.exp(sum(change) / len(change)) - 1)


# --- Tables ------------------------------------------------------------------

def table(head, rows):
    print("| " + " | ".join(head) + " |")
    print("|" + "---|" * len(head))
    for row in rows:
        print("| " + " | ".join(row) + " |")
    print()


def prose(text):
    print(textwrap.fill(text, 80, break_on_hyphens=False) + "\n")


def kb(n):
    return f"{n / 1000:.1f}"


def db(x):
    return "-" if x is None else f"{x:.2f}"


def percent(x):
    return "-" if x is None else f"{x:+.1f} %"


def label(rate):
    return f"rate {rate + 1}"


def sources(run):
    """Returns the sources of each kind as text: coarse C, fine F, primitives P,
    each followed by letters for hyperprior (h), parent (p), groups (g) and
    memory bank (m)."""
    out = []
    for kind in "coarse", "fine", "primitives":
        bits = run.report["entropy_model"][kind]["sources"]
        out.append("".join(c for i, c in enumerate("hpgm") if bits >> i & 1)
                   or "-")
    return " ".join(out)


def ablation(rates):
    print("### Entropy model without its parts\n")
    full = [r["full"] for r in rates]
    trained = [r["trained"] for r in rates]
    ends = 0, len(rates) - 1
    rows = [["as trained", percent(same_symbols(full, trained)),
             percent(bd_rate(points(full), points(trained)))] +
            [f"{kb(trained[i].bytes)} / {db(trained[i].psnr)}" for i in ends] +
            [""]]
    for key, name in VARIANTS:
        runs = [r[key] for r in rates]
        if not all(r.there for r in runs):
            continue
        base = [r[AGAINST.get(key, "full")] for r in rates]
        rows.append([name, percent(same_symbols(base, runs)),
                     percent(bd_rate(points(base), points(runs)))] +
                    [f"{kb(runs[i].bytes)} / {db(runs[i].psnr)}"
                     for i in ends] + [sources(runs[-1])])
    table(["variant", "rate", "BD-rate"] +
          [label(i) + ": kB / dB" for i in ends] + ["sources"],
          rows)
    prose("The letters are the sources (inputs of the entropy networks) of "
          "coarse anchors, fine offsets and primitive offsets that saved more "
          "than their weights cost at the last rate: hyperprior (h), parent "
          "(p), groups (g), bank (m). \"Rate\" is the mean change of the bytes "
          "against the full model (the last two rows: against all sources), "
          "on the same symbols. It is more reliable than the \"BD-rate\" of "
          "the training views: features are rounded relative to the "
          "prediction, so in a refit they move by up to half a step, which "
          "costs another amount of PSNR in each variant.")
    prose("No file of this table has the paper's residual hash "
          "([residual-hash](../lab/README.md)), so all of them "
          "are its variant V3.")


def slots(rate, folder):
    rows, lines = [], []
    without = rate["all-no-bank"]
    if not without.there:
        return
    for n, run in [(0, without)] + [(n, rate[f"slots{n}"]) for n in SLOTS]:
        if not run.there:
            continue
        change = same_symbols([without], [run])
        ms = run.times["decode"]
        after = run.report["after"]
        if n:
            lines.append([str(n), f"{change:.4f}", f"{ms:.3f}"])
        rows.append([str(n), percent(change), kb(run.bytes),
                     kb(sum(after[key] for key, _ in KINDS)),
                     kb(after["networks"]["entropy"]), f"{ms:.1f}"])
    with open(os.path.join(folder, "slots.dat"), "w") as out:
        out.write("# slots, rate %, ms to decode the segment\n")
        out.writelines(" ".join(x) + "\n" for x in lines)
    if rows:
        print("### Slots of the bank\n")
        table(["slots", "rate", "file, kB", "symbols", "entropy networks",
               "ms to decode a segment"], rows)
        prose("The file of the last rate is coded with memory banks of "
              "different sizes, which are kept even where they do not pay. "
              "\"Rate\" is the change of the bytes, on the same symbols, "
              "against all sources except the bank.")


def order0(scenes):
    print("### Against an adaptive order-0 coder\n")
    rows = []
    for name, path in scenes:
        r = load(path)
        networks = r["networks"]["entropy"]
        for key, text in KINDS:
            k = r["kinds"][key]
            if k["order0"] >= 50:
                rows.append([name, text, kb(k["saga"]), kb(k["order0"]),
                             kb(k["entropy0"]), ""])
        for key in "values", "structure", "all":
            k, own = r[key], 0 if key == "structure" else networks
            rows.append([name, f"**{key}**" + ("" if key == "structure" else
                         f", entropy networks {kb(own)} kB included"),
                         kb(k["saga"] + own), kb(k["order0"]),
                         kb(k["entropy0"]), f"{100 * k['saving']:.1f} %"])
    table(["scene", "kind", "saga, kB", "order-0, kB", "its entropy, kB",
           "saved"], rows)
    prose("Both sides code the same symbols; each channel of the order-0 coder "
          "has adaptive frequencies of its own (Krichevsky and Trofimov). It "
          "codes structure as a list of coordinates, which favours us. \"Its "
          "entropy\" is the limit of any order-0 coder.")


# The paper's model without a part: make_paper's row, the paper's name and
# BD-rate for it, and what is otherwise.
PARTS = (("full", "", "", "nothing"),
         ("flat", "V1", "+13.04 %", "shared anchors (`--model auto`)"),
         ("nearest", "V2", "+11.24 %", "interpolation (K = 1)"),
         ("no-hash", "V3", "+3.07 %", "residual hash"),
         ("raw-networks", "V4", "+8.37 %", "coding of networks"),
         ("plain-update", "V5", "+9.68 %", "projection of the bank's update"),
         ("slots=32", "", "+8.87 %", "32 of the 64 slots"),
         ("slots=128", "", "-10.27 %", "none: 128 slots"),
         ("slots=256", "", "-15.66 %", "none: 256 slots"),
         ("slots=512", "", "-16.19 %", "none: 512 slots"),
         ("no-bank", "", "", "memory bank"),
         ("no-fuse", "", "", "Fuse_c and Fuse_f"))
# Why the numbers differ from the paper's.
NOTES = (
    "**Chance** moves room and ring more than most parts do: models with 32, "
    "64 and 256 slots hardly differ, and yet lie between 30.3 and 32.1 dB at "
    "one price on the room. There only V1, V2 and V4 say something. On the "
    "large ring chance is 0.05 dB and 1 % of the bytes, but its trainings are "
    "short: the files are still 4 dB below the warm-up.",
    "**V1**, no shared anchors, saves a fifth to two fifths of the bytes on "
    "room and ring ([lab/anchors.md](../lab/anchors.md)). On the large ring, "
    "with four to five bytes for a primitive, sharing saves 7 %, as in the "
    "paper: 14 % at 25.7 dB, nothing at 26.2. Fewer primitives with features "
    "of their own were not tried there.",
    "**V2**, no interpolation, is better on all three scenes. With K = 4 few "
    "primitives have a second fine anchor within reach.",
    "**V3**, no residual hash (two tables of 256 entries with a network, 2 to "
    "3 kB): room and ring disagree, and 1.7 % prove nothing.",
    "**V4**, uncoded networks: networks are half of a small file, 12 % of the "
    "paper's.",
    "**V5** and slots: hyperprior and groups leave the bank at most 0.5 % of "
    "the symbols to save. On the same symbols, without chance, the tables of "
    "today's entropy model have both.",
    "The paper has neither a base (-51 % by BD-rate on ten seconds of the "
    "room, [training.md](training.md)) nor layers ([layers](../lab/README.md)).")

SCENES = (("room", "room"), ("ring", "ring"), ("large", "large ring"))


def paper_runs(folder):
    """Returns for each scene, and each part, the runs at all rates, the lowest
    first."""
    out = {}
    for scene, _ in SCENES:
        path = os.path.join(folder, "paper", scene + ".json")
        if os.path.exists(path):
            runs = [json.loads(x) for x in open(path)]
            out[scene] = {name: sorted((r for r in runs if r["row"] == name),
                                       key=lambda r: -r["factor"])
                          for name, *_ in PARTS}
    return out


def bd_of(runs, name, views="training"):
    """Returns the BD-rate of a part against the full model, or None if PSNR
    falls as bytes grow: then chance has more effect than the rate."""
    curves = [sorted((r["bytes"], r[views]) for r in runs[key])
              for key in ("full", name)]
    falls = any(b[1] <= a[1] for c in curves for a, b in zip(c, c[1:]))
    return None if falls else bd_rate(*curves)


def of_part(runs, name, views="training"):
    return ("" if not runs[name]
            else percent(bd_of(runs, name, views)))


def beside(scenes):
    """The paper's ablation beside ours."""
    print("## The paper's whole model without its parts\n")
    rows = [[what, v, paper] + [of_part(scenes[s], name) if s in scenes
                                else "" for s, _ in SCENES]
            for name, v, paper, what in PARTS[1:]]
    table(["left out", "name", "paper"] + [title for _, title in SCENES],
          rows)


def whole_scene(title, runs):
    """A scene's model of the paper, and itself without its parts, at each
    rate."""
    first = runs["full"][0]
    nets = [100 * r["networks"] / r["bytes"] for r in runs["full"]]
    most = max(len(r) for r in runs.values())
    prose(f"{title}: {first['primitives']:,} primitives, "
          f"{first['iterations'][0]:,} iterations of warm-up "
          f"({db(first['warm_up'])} dB) and {first['iterations'][1]:,} of "
          f"rendering; networks are {min(nets):.0f} to {max(nets):.0f} % of "
          "the first row:")
    table(["left out", "training", "held out"] +
          [f"rate {i + 1}" for i in range(most)],
          [[what, of_part(runs, name), of_part(runs, name, "held_out")] +
           [f"{r['bytes']:,}; {db(r['training'])} / {db(r['held_out'])} "
            f"(x{r['factor']:g})" for r in runs[name]] +
           [""] * (most - len(runs[name]))
           for name, _, _, what in PARTS if runs[name]])


def whole(scenes):
    """The paper's whole model beside itself without its parts."""
    beside(scenes)
    prose("`saga encode --model paper` has shared anchors, interpolation, "
          "Fuse, residual hash and memory bank. Each row leaves one part out; "
          "it begins the rendering stage from the same warm-up as the others. "
          "A number is the BD-rate of the training views against the whole "
          "model: above 0, the part pays. A dash: the curves share no PSNR, or "
          "PSNR falls as bytes grow. Empty: not measured. Each row is one training at each rate, with seed 1, so "
          "less than 2 % proves nothing. Room and ring are filmed with "
          "160x90 pixels; the large ring is filmed by 12 cameras of 960x540 "
          "pixels in 60 frames.")
    for scene, title in SCENES:
        if scene in scenes:
            whole_scene(title, scenes[scene])
    prose("A cell has bytes and PSNR in dB of training / held-out views, from "
          "the decoded file on sampled pictures, and the price of a bit "
          "relative to that which `saga encode` would choose.")
    for text in NOTES:
        print(textwrap.fill(text, 80, initial_indent="- ",
                            subsequent_indent="  ", break_on_hyphens=False))
    print()


def curves(rates, folder):
    with open(os.path.join(folder, "curves.dat"), "w") as out:
        for key, name in VARIANTS:
            runs = [r[key] for r in rates if r[key].there]
            if runs:
                out.write(f'"{name}"\n')
                out.writelines(f"{r.bytes / 1000:.3f} {r.psnr:.4f}\n"
                               for r in runs)
                out.write("\n\n")


def files(folder, n_rates):
    """Returns a sentence about the encoded files, from the trainings'
    reports."""
    reports = [load(folder, f"r{i + 1}", "encode.json")
               for i in range(n_rates)]
    if None in reports:
        return
    o = reports[0]["options"]
    prose("The files have "
          + ", ".join(f"{r['nbytes']:,}" for r in reports) + " bytes. They "
          f"come from trainings with {reports[0]['n_views']} cameras, "
          f"{reports[0]['n_frames']} frames, {o['primitives']:,} primitives, "
          f"{o['iterations']:,} iterations, seed {o['seed']}, and --lambda "
          + ", ".join(f"{r['options']['lambda']:g}" for r in reports) + ".")


def main(folder, scenes):
    names = [k for k, _ in VARIANTS] + [f"slots{n}" for n in SLOTS]
    rates = []
    while os.path.isdir(os.path.join(folder, f"r{len(rates) + 1}")):
        at = os.path.join(folder, f"r{len(rates) + 1}")
        rates.append({n: Run(at, n) for n in names})
        rates[-1]["trained"] = Trained(at)
    if not rates or not all(r["full"].there for r in rates):
        sys.exit(f"ablation_table: {folder} has no finished runs")
    curves(rates, folder)
    print("# Ablation: `make ablation`\n")
    paper = paper_runs(folder)
    if paper:
        whole(paper)
    print("## Today's entropy model\n")
    prose("Each rate is one training of the room. For each variant the entropy "
          "networks are fitted anew (a *refit*) to the symbols of that file "
          "(lab/gen_refit.h), so bytes compare on the same symbols. "
          "[lab/sources.md](../lab/sources.md) explains their inputs, the "
          "*sources*, and what disagrees with the paper.")
    files(folder, len(rates))
    print("![rate and distortion](ablation.svg)\n")
    ablation(rates)
    slots(rates[-1], folder)
    if scenes:
        order0(scenes)


if __name__ == "__main__":
    if len(sys.argv) < 2:
        sys.exit(__doc__.splitlines()[0])
    main(sys.argv[1], [a.split("=", 1) for a in sys.argv[2:]])
