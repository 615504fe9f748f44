#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""ablation_table.py FOLDER [NAME=ORDER0.json ...]: the tables of the ablation.

lab/ablation.sh fills FOLDER. It has a folder rN/ for each rate, the lowest
first, with VARIANT.json (make_refit), VARIANT.eval.json (saga eval --json) and
VARIANT.times.json (make_times) for each variant, and trained.eval.json for the
file from which the variants are made; shared.SCENE.json (make_shared); and
paper/SCENE/PART.LAMBDA.json (saga encode --json), the paper's model without a
part.
Further arguments are reports of make_order0, with the scenes' names.
Prints Markdown; writes FOLDER/curves.dat and FOLDER/slots.dat for gnuplot.
"""
import glob
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
# The rows of make_shared, and their names in the table: how many coarse
# anchors, fine anchors and primitives there are, and how many neighbours (K) a
# primitive reads.
SHARING = [("own", "1:1:1, its own features"),
           ("shared", "1:2:2 by place, K 4"),
           ("nearest", "1:2:2 by place, K 1")]
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
STAGES = [("networks", "open: networks"), ("coarse", "tree, coarse anchors"),
          ("fine", "fine anchors, their features"),
          ("primitives", "primitives' offsets"),
          ("reconstruction", "primitives' attributes"),
          ("decode", "a segment: all but networks")]
PICTURE = [("view", "a picture: animate, project, sort"),
           ("draw", "a picture: blend")]


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
        self.held_out = self.eval["held_out"]["psnr"]


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


def components(rates):
    runs = [r["full"] for r in rates]
    print("## Bitstream by component, kB\n")
    rows = [[name] + [kb(r.report["after"][key]) for r in runs]
            for key, name in KINDS]
    for key, name in (("entropy", "entropy networks"),
                      ("reconstruction", "reconstruction networks")):
        rows.append([name] + [kb(r.report["after"]["networks"][key])
                              for r in runs])
    rows.append(["headers and rounding"] + [kb(r.bytes - sum(
        r.report["after"][key] for key, _ in KINDS) - sum(
        r.report["after"]["networks"][k]
        for k in ("entropy", "reconstruction"))) for r in runs])
    rows.append(["file"] + [kb(r.bytes) for r in runs])
    rows.append(["networks, of the file"] + [
        f"{100 * r.eval['bytes']['networks'] / r.bytes:.0f} %" for r in runs])
    rows.append(["reconstruction networks, bits a parameter"] + [
        f"{8 * n['reconstruction'] / n['reconstruction_parameters']:.2f}"
        for n in (r.report["after"]["networks"] for r in runs)])
    rows.append(["PSNR, training / held out, dB"] + [
        f"{db(r.psnr)} / {db(r.held_out)}" for r in runs])
    table(["component"] + [label(i) for i in range(len(runs))], rows)


def runtime(rates):
    runs = [r["full"] for r in rates]
    print("## Decoding time by component, ms\n")
    rows = [[name] + [f"{r.times[key]:.2f}" for r in runs]
            for key, name in STAGES]
    rows += [[name + " *"] + [f"{r.eval['decode_ms'][key]:.2f}" for r in runs]
             for key, name in PICTURE]
    table(["component"] + [label(i) for i in range(len(runs))], rows)
    n = runs[0].eval["decode_ms"]["threads"]
    prose("Times are CPU time of one thread, the best of several runs. Those "
          "with an asterisk are means over all pictures, wall time with "
          f"{n} thread{'s' if n > 1 else ''}.")


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
    print("## Entropy model without its parts\n")
    full = [r["full"] for r in rates]
    trained = [r["trained"] for r in rates]
    rows = [["as trained", percent(same_symbols(full, trained)),
             percent(bd_rate(points(full), points(trained)))] +
            [f"{kb(r.bytes)} / {db(r.psnr)}" for r in trained]]
    for key, name in VARIANTS:
        runs = [r[key] for r in rates]
        if not all(r.there for r in runs):
            continue
        base = [r[AGAINST.get(key, "full")] for r in rates]
        rows.append([name, percent(same_symbols(base, runs)),
                     percent(bd_rate(points(base), points(runs)))] +
                    [f"{kb(r.bytes)} / {db(r.psnr)} / {sources(r)}"
                     for r in runs])
    table(["variant", "rate", "BD-rate"] + [label(i) + ": kB / dB / sources"
                                            for i in range(len(rates))], rows)
    prose("The letters are the sources (inputs of the entropy networks) of "
          "coarse anchors, fine offsets and primitive offsets that saved more "
          "than their weights cost: hyperprior (h), parent (p), groups (g), "
          "bank (m). \"Rate\" is the mean change of the bytes against the "
          "full model (the last two rows: against all sources), on the same "
          "symbols. \"BD-rate\" is the change at equal PSNR of the training "
          "views, by monotone cubics of log-rate over the common interval. "
          "\"Rate\" is the more reliable number: features are rounded "
          "relative to the prediction, so in a refit they move by up to half "
          "a step, which costs another amount of PSNR in each variant.")
    prose("No file of this table has the paper's residual hash "
          "([lab/residual-hash.md](../lab/residual-hash.md)), so all of them "
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
        print("## Slots of the bank\n")
        table(["slots", "rate", "file, kB", "symbols", "entropy networks",
               "ms to decode a segment"], rows)
        prose("The file of the last rate is coded with memory banks of "
              "different sizes, which are kept even where they do not pay. "
              "\"Rate\" is the change of the bytes, on the same symbols, "
              "against all sources except the bank.")


def order0(scenes):
    print("## Against an adaptive order-0 coder\n")
    rows = []
    for name, path in scenes:
        r = load(path)
        networks = r["networks"]["entropy"]
        for key, text in KINDS:
            k = r["kinds"][key]
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
    prose("Both sides code the same symbols. Values are coded as decoded, in "
          "steps; each channel of the order-0 coder has adaptive frequencies "
          "of its own (Krichevsky and Trofimov) and 32 bits for their range. "
          "It codes structure as a list of coordinates, which favours us, so "
          "the fair comparison is that of the values. \"Its entropy\" is the "
          "limit of any order-0 coder.")


def shared_scenes(folder):
    """Returns the rows of each scene; a row is a list of runs."""
    out = {}
    for name in sorted(os.listdir(folder)):
        if name.startswith("shared.") and name.endswith(".json"):
            runs = [json.loads(x) for x in open(os.path.join(folder, name))]
            out[name[len("shared."):-len(".json")]] = {
                key: [r for r in runs if r["row"] == key]
                for key, _ in SHARING}
    return out


def bd_of(rows, anchor, key, views="training"):
    """Returns the BD-rate, or None if PSNR falls as bytes grow: then chance has
    more effect than the rate."""
    curves = [sorted((r["bytes"], r[views]) for r in rows[k])
              for k in (anchor, key)]
    falls = any(b[1] <= a[1] for c in curves for a, b in zip(c, c[1:]))
    return None if falls else bd_rate(*curves)


def shared(scenes):
    print("## Shared anchors\n")
    for scene, rows in scenes.items():
        print(f"{scene}, {rows['own'][0]['primitives']:,} primitives:\n")
        factors = [r["factor"] for r in rows["own"]]
        table(["anchors", "BD-rate, training", "held out"] +
              [f"lambda x {f:g}" for f in factors],
              [[name, percent(bd_of(rows, "own", key)),
                percent(bd_of(rows, "own", key, "held_out"))] +
               [f"{r['bytes']:,}; {db(r['training'])} / {db(r['held_out'])}"
                for r in rows[key]] + [""] * (len(factors) - len(rows[key]))
               for key, name in SHARING])
    prose("\"1:2:2\" means one coarse anchor with two fine anchors and two "
          "primitives. \"By place\" means that a coarse anchor starts with the "
          "mean of its primitives' features, and that these are told apart by "
          "their places in it. K is the number of fine anchors that a "
          "primitive interpolates. The columns multiply the lambda that `saga "
          "encode` chooses by itself. A cell has bytes and PSNR in dB of "
          "training / held-out views, from the decoded file on sampled "
          "pictures. A dash: the curves share no PSNR, or PSNR falls as bytes "
          "grow.")
    prose("Pictures have 160x90 pixels; 2,400 iterations, seed 1; all rows of "
          "a scene continue from one warm-up. Each row is one rendering, so "
          "less than 2 % proves nothing. [lab/anchors.md](../lab/anchors.md) "
          "has longer renderings.")


# The paper's model without a part: the name of the runs, the paper's name and
# BD-rate for it, and what is left out.
PARTS = (("full", "", "", "nothing"),
         ("flat", "V1", "+13.04 %", "shared anchors (`--model auto`)"),
         ("nearest", "V2", "+11.24 %", "interpolation (K = 1)"),
         ("no-hash", "V3", "+3.07 %", "residual hash"),
         ("raw-networks", "V4", "+8.37 %", "coding of networks"),
         ("plain-update", "V5", "+9.68 %", "projection of the bank's update"),
         ("no-bank", "", "", "memory bank"),
         ("no-fuse", "", "", "Fuse_c and Fuse_f"))


def paper_runs(folder):
    """For each scene, and each part, the runs at all rates, the lowest first.
    Scenes of which a part is missing are left out."""
    out = {}
    for scene in sorted(glob.glob(os.path.join(folder, "paper", "*"))):
        parts = {}
        for name, *_ in PARTS:
            runs = [json.load(open(p)) for p in
                    glob.glob(os.path.join(scene, f"{name}.*.json"))]
            parts[name] = sorted(runs, key=lambda r: -r["options"]["lambda"])
        if all(parts.values()):
            out[os.path.basename(scene)] = parts
    return out


def whole_scene(scene, runs):
    """A scene's model of the paper beside itself without its parts."""
    def bd(name, views):
        rows = {key: [{"bytes": r["nbytes"], views: r["psnr"][views]}
                      for r in runs[key]] for key in ("full", name)}
        return percent(bd_of(rows, "full", name, views))

    first = runs["full"][0]
    nets = [100 * r["bytes"]["networks"] / r["nbytes"] for r in runs["full"]]
    print(f"{scene}, {first['options']['primitives']:,} primitives, networks "
          f"are {min(nets):.0f} to {max(nets):.0f} % of the first row:\n")
    table(["left out", "name", "paper", "training", "held out"] +
          [f"lambda {r['options']['lambda']:g}" for r in runs["full"]],
          [[what, v, paper, bd(name, "training"), bd(name, "held_out")] +
           [f"{r['nbytes']:,}; {db(r['psnr']['training'])} / "
            f"{db(r['psnr']['held_out'])}" for r in runs[name]]
           for name, v, paper, what in PARTS])


def whole(scenes):
    """The paper's whole model beside itself without its parts."""
    print("## The paper's whole model without its parts\n")
    for scene, runs in scenes.items():
        whole_scene(scene, runs)
    options = next(iter(scenes.values()))["full"][0]["options"]
    prose("`saga encode --model paper` has shared anchors, interpolation, "
          "Fuse, residual hash and memory bank. Each row leaves one part out "
          "and is trained anew from the pictures. Paper, training and held "
          "out are BD-rates against the first row: above 0, the part pays. A "
          "cell has bytes and PSNR in dB of training / held-out views, from "
          f"the decoded file. All trainings have {options['iterations']:,} "
          f"iterations and seed {options['seed']}; pictures have 160x90 "
          "pixels. Each row is one training at each rate, so less than 2 % "
          "proves nothing. A dash: the curves share no PSNR, or PSNR falls as "
          "bytes grow.")
    prose("Networks are 12 % of the paper's files of megabytes. A part that "
          "adds a network therefore has more to win back here. We believe "
          "that V1 differs from the paper because of how training starts: a "
          "primitive with features of its own starts as the warm-up made it "
          "([lab/start.md](../lab/start.md)), primitives that share an anchor "
          "start as their mean.")


def beside(rates, scenes):
    """Returns a table that compares the paper's ablation with ours. Numbers
    that were measured on other pages are quoted from them."""
    def ours(runs, against="full"):
        base = [r[against] for r in rates]
        there = all(r.there for r in base + runs)
        return percent(same_symbols(base, runs)) if there else "-"

    def by_scene(anchor, key):
        return [percent(bd_of(scenes[s], anchor, key)) if s in scenes else "-"
                for s in ("room", "ring")]

    def of_slots(n):
        a, b = rates[-1]["slots64"], rates[-1][f"slots{n}"]
        return (percent(same_symbols([a], [b])) if a.there and b.there
                else "-")

    one = ["not measured"]
    rows = [
        ["V1, no coarse/fine", "+13.04 %", *by_scene("shared", "own"),
         "sharing loses (1)"],
        ["V2, no interpolation", "+11.24 %", *by_scene("shared", "nearest"),
         "not measured"],
        ["V3, no residual hash", "+3.07 %", "none (2)", "none (2)",
         "not measured"],
        ["V4, raw networks", "+8.37 %", ours([r["raw"] for r in rates]), *one,
         "+4.2 % (3)"],
        ["V5, plain update", "+9.68 %",
         ours([r["all-plain"] for r in rates], "all"), *one, "-0.3 % (3)"]]
    for n, paper in ((32, "+8.87 %"), (128, "-10.27 %"), (256, "-15.66 %"),
                     (512, "-16.19 %")):
        rows.append([f"{n} slots instead of 64", paper, of_slots(n), *one,
                     "+0.1 % (3)" if n == 512 else "not measured"])
    rows += [["no base", "has none", "+104 % (4)", *one, "not measured"],
             ["two layers instead of one", "has none", *one, *one,
              "not measured (5)"]]
    print("## Compared with the paper\n")
    table(["row", "paper", "room", "ring", "ring, 100,000 primitives"], rows)
    prose("V1 to V5 are the paper's names of its variants. V1 and V2 are the "
          "BD-rate of the training views against shared anchors with "
          "interpolation (the paper's full model), from the tables above. V4, "
          "V5 and slots of the memory bank are the change of the bytes on the "
          "same symbols at 320x180: the mean of the rates, for slots the last "
          "rate. The scene of 100,000 primitives has one rate. Numbers in "
          "brackets refer to the notes below.")
    for text in (
            "V1 has anchors of one tier, so that each primitive has "
            "features of its own. In the paper this costs 13 %, here it "
            "saves bytes: features are learned under the price of their "
            "bits, and those of primitives that could share an anchor have "
            "almost nothing in common. We believe that the paper has more "
            "primitives for each anchor. (1) With 100,000 primitives, "
            "shared anchors whose children are told apart by number take 29 "
            "% more bytes at 0.5 dB less; told apart by place they were not "
            "run ([lab/anchors.md](../lab/anchors.md)).",
            "V2 has no interpolation of anchors. That changes little here, "
            "because few primitives have a second fine anchor within reach: "
            "with K = 4, 500 primitives of the room begin with 589 "
            "neighbours in all.",
            "V3 has no residual hash. (2) None of these files has one. "
            "Where anchors are not shared the hash costs 3 % on the mean; "
            "where they are it saves 2 to 4 %, as in the paper "
            "([lab/residual-hash.md](../lab/residual-hash.md)).",
            "V4 has uncoded networks. Networks are a tenth of a small file "
            "here, and would be a third of it if they were not coded. With "
            "100,000 primitives they weigh little, as in the paper, where "
            "networks are 12 % of a file after coding.",
            "V5 has the plain update of the memory bank. Hyperprior and "
            "groups leave the bank at most 0.5 % of the symbols to save, so "
            "its update rule and its number of slots change hardly more "
            "than the bytes of its own networks. (3) Measured in "
            "[lab/memory.md](../lab/memory.md).",
            "The paper has neither a base nor layers. (4) On ten seconds of "
            "the room at 160x90 a base gives -51 % by BD-rate "
            "([training.md](training.md)). (5) On studio two layers take 4 "
            "% more bytes and lose 1.1 dB on held-out views at one rate "
            "([lab/layers.md](../lab/layers.md))."):
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
    print("# Ablation of the entropy model: `make ablation`\n")
    prose("What is each part of the entropy model worth? The model predicts "
          "the residuals of a file by small networks, whose inputs "
          "(*sources*) are the hyperprior, the parent, earlier groups and the "
          "memory bank ([concepts.md](../concepts.md)). Each rate is one "
          "training of the room. For each variant the entropy networks are "
          "fitted anew (a *refit*) to the symbols of that file "
          "(lab/gen_refit.h), so bytes compare on the same symbols. "
          "[lab/sources.md](../lab/sources.md) explains what disagrees with "
          "the paper.")
    files(folder, len(rates))
    print("![rate and distortion](ablation.svg)\n")
    components(rates)
    runtime(rates)
    ablation(rates)
    slots(rates[-1], folder)
    sharing = shared_scenes(folder)
    if sharing:
        shared(sharing)
        beside(rates, sharing)
    paper = paper_runs(folder)
    if paper:
        whole(paper)
    if scenes:
        order0(scenes)


if __name__ == "__main__":
    if len(sys.argv) < 2:
        sys.exit(__doc__.splitlines()[0])
    main(sys.argv[1], [a.split("=", 1) for a in sys.argv[2:]])
