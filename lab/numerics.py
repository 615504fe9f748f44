#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""numerics.py BUILD OUT [NAME=FILE.saga ...]: writes OUT/numerics.md, .json and
plots. Without files it draws the plots of an earlier numerics.json.
BUILD/numerics and BUILD/numerics-plain hold bench_numerics with and without
vector instructions; BUILD holds saga and make_formats. `make numerics` runs it.

Each file is verified at three cameras and three times. The first file is also
drawn in other number formats.
"""

import datetime
import json
import math
import os
import subprocess
import sys

VARIANTS = ["float64", "float32", "integer, plain C", "integer, vectors"]
STAGES = ["symbols", "scaffold", "primitives", "animation", "splats", "pixels"]
NETWORKS = ("bits of activations", "bits of activations, by unit",
            "bits of weights")


def run(*command, **options):
    return subprocess.run(command, check=True, text=True,
                          stdout=subprocess.PIPE, **options).stdout


def instructions(program, folder):
    """Returns {(operator, integer|float32|float64): instructions for a
    unit}."""
    os.makedirs(folder, exist_ok=True)
    for name in os.listdir(folder):
        os.unlink(os.path.join(folder, name))
    try:
        run("valgrind", "-q", "--tool=callgrind", "--dump-instr=no",
            f"--callgrind-out-file={folder}/out", program, "x", "count",
            stderr=subprocess.DEVNULL)
    except (OSError, subprocess.CalledProcessError):
        return {}
    counts = {}
    for name in os.listdir(folder):
        key, total = None, 0
        with open(os.path.join(folder, name)) as f:
            for line in f:
                if line.startswith("desc: Trigger: Client Request: "):
                    key = line.split(": ", 3)[3].strip()
                elif line.startswith(("summary:", "totals:")):
                    total = int(line.split()[1])
        if key:
            operator, variant, n = key.split("|")
            counts[operator, variant] = total / float(n)
    return counts


def operators(build):
    """Returns the rows of both builds. The rows of float come from the first
    build."""
    rows = []
    for folder, name in (("numerics", VARIANTS[3]),
                         ("numerics-plain", VARIANTS[2])):
        program = f"{build}/{folder}/bench_numerics"
        counts = instructions(program, f"{build}/{folder}/callgrind")
        for r in json.loads(run(program, name))["operators"]:
            if r["variant"] not in (name, *VARIANTS[:2]) or (
                    r["variant"] != name and name == VARIANTS[2]):
                continue
            kind = "integer" if r["variant"] == name else r["variant"]
            r["instructions"] = counts.get((r["operator"], kind))
            rows.append(r)
    return rows


def verified(saga, path):
    info = json.loads(run(saga, "info", path, "--json"))
    cameras, frames = len(info["rig"]), info["n_frames"]
    return [json.loads(run(saga, "verify", path, "--json", "--camera", str(c),
                           "--frame", str(f), stderr=subprocess.DEVNULL))
            for c in sorted({0, cameras // 2, cameras - 1})
            for f in sorted({0, frames // 2, frames - 1})]


# ---- numbers

def bits(row):
    """Returns the number of correct bits in the operator's range, or None if it
    is exact."""
    if not row.get("rms"):
        return None
    return math.log2(row["peak"] / row["rms"])


def db(rms):
    return 20 * math.log10(255 / rms) if rms else math.inf


def significant(v, n=3):
    if v is None:
        return ""
    if v == 0:
        return "0"
    digits = max(0, n - 1 - math.floor(math.log10(abs(v))))
    return f"{v:.{digits}f}" if digits < 7 else f"{v:.{n - 1}e}"


# ---- tables for gnuplot

def fill_wholes(result):
    """Fills in the errors of segment and picture from the first file."""
    views = next(iter(result["files"].values()))
    whole = {s: mean_square(views, s) for s in STAGES}
    rms = {"segment (demo)": math.sqrt(whole["scaffold"] ** 2 -
                                       whole["animation"] ** 2),
           "picture (demo)": whole["animation"]}
    for r in result["operators"]:
        if r["operator"] in rms and r["variant"] in VARIANTS[2:]:
            r["rms"], r["peak"] = rms[r["operator"]], 255


def operator_table(rows, names, path):
    with open(path, "w") as f:
        for variant in VARIANTS:
            f.write(f"# {variant}\n")
            for i, name in enumerate(names):
                for r in rows:
                    if (r["operator"], r["variant"]) != (name, variant):
                        continue
                    right = bits(r)
                    if right is None:
                        right = 53 if variant == "float64" else math.nan
                    f.write(f"{i + 1} {r['ns'][2]} {r['ns'][1]} {r['ns'][3]} "
                            f"{right} 0 \"{name}\"\n")
            f.write("\n\n")


def format_tables(rows, folder):
    for part in ("splats", "networks"):
        with open(f"{folder}/formats_{part}.dat", "w") as f:
            last = None
            for r in rows:
                name = r["format"]
                if not r["value"].lstrip("-").isdigit() or (
                        (name in NETWORKS) != (part == "networks")):
                    continue
                if name != last:
                    f.write(("\n\n" if last else "") + f"\"{name}\"\n")
                    last = name
                if r["rms"] > 0:
                    f.write(f"{r['value']} {r['rms']} {int(r['chosen'])}\n")


def draw(names, folder, out):
    titles = " ".join(f"'{n}'" for n in names)
    run("gnuplot", "-e", f"folder='{folder}'; out='{out}/numerics'; "
        f"n_operators={len(names)}; titles=\"{titles}\"",
        os.path.join(os.path.dirname(__file__), "numerics.gp"))


# ---- the page

HEAD = """# Numerics: what integers cost, and how exact they are

`make numerics` writes this page, numerics.json and the plots. Measured
{date}: one thread of {cpu},
{compiler}, while other programs ran. Times are
CPU time, medians of 15 repetitions of a millisecond or more; bars are
quartiles. Errors are exact: all values of an operator are compared with float64
on the same inputs. "16 right bits" means that the RMS error is 2^-16 of the
largest value. [numerics](../lab/README.md) has the conclusions.

![time and error of every operator](numerics.svg)

The dark dot is the decoder. The time of a segment is given for one of its
primitives, that of a picture for one of its pixels. In the next plot float64
counts as 53 bits:

![time against error](numerics_points.svg)

| operator | unit | {columns} | right bits, float32 | right bits, integers | largest error, integers |
|---|---|---|---|---|---|---|---|---|
"""

HEAD_COLUMNS = ("float64, ns | float32, ns | plain C, ns (instructions) | "
                "vectors, ns (instructions)")

READ = """
Every build computes the same integers. "Vectors" is the code that the decoder
chooses on this machine; "plain C" has no vector instruction. The float code is
plain C compiled with AVX2 ({flags}), except the
dense layer in float32, which is the trainer's. The time of the blend is given
for one pixel of a splat's box.

- Operators that sum many values are the least exact.
- Interpolation is slower than float, because it divides value by value.
- Reciprocals and roots of 32 bits are exact to 2^-30.
"""

STAGES_HEAD = """
## A picture: where its error comes from

`saga verify` draws nine pictures (three cameras at three times). A row "from X"
computes the stage X and all later ones in float64, and everything before in
integers. The first rows have the RMS difference to the decoder's picture before
it is rounded to 8 bits, in levels of 255; errors of independent stages add up
as squares. The last rows compare the 8-bit pictures. The files, made on the day
of the measurement, are
{sizes}.

| stage | {names} |
|---|{rules}
"""

STAGES_TEXT = """
- **The decoder's error is the row "from scaffold"**, the decoded anchors. The
  row "from symbols" also has the rounding of the entropy model's predictions,
  which is no loss, since the encoder makes the same.
- **Computing the primitives loses most**, above all in their motion; splats
  lose by the rounding of their means to 1/256 of a pixel.
- In {cut} of all pixels some splat is drawn by only one of the two
  computations, if they start from the same scaffold, and in {cut_pixels} if
  they start from the same splats; most of these change by a level at most.
"""

FORMATS_HEAD = """
## Formats that one could choose

The reference draws {file} (camera 0, frame 0) once in double, then with one
rounding at a time. The table has the RMS error of the picture before it is
rounded to 8 bits, in levels of 255; that rounding itself, the grey line of the plot,
costs 0.29. The decoder's formats are bold. "g, n, h" are the factors of a
splat's inverse covariance, q is the exponent of its alpha, and T the light that
is left behind it.

![formats](numerics_formats.svg)

| format | RMS of each |
|---|---|
"""

FORMATS_TEXT = """
- Each bit less below the pixel, and of the activations, doubles the error. "By
  unit", each input of a layer has an exponent of its own.
- Weights of 8 bits are for files that are trained with them (level 0).
- A smallest alpha of 1/128, below which a splat is not drawn, would blend
  {saved} fewer pixels, at an error of {saved_rms} levels.
"""


def cpu():
    with open("/proc/cpuinfo") as f:
        for line in f:
            if line.startswith("model name"):
                return "a guest with " + line.split(":")[1].strip()
    return "this machine"


def operator_lines(rows, names):
    by = {(r["operator"], r["variant"]): r for r in rows}
    for name in names:
        of = [by.get((name, v)) for v in VARIANTS]
        cells = []
        for variant, r in zip(VARIANTS, of):
            cell = significant(r["ns"][2]) if r else ""
            if r and variant.startswith("integer") and r["instructions"]:
                cell += f" ({significant(r['instructions'])})"
            cells.append(cell)
        right = [bits(r) if r and "rms" in r else None
                 for r in (of[1], of[3])]
        cells += ["" if b is None else f"{b:.1f}" for b in right]
        cells.append(significant(of[3].get("max")))
        yield f"| {name} | {of[0]['unit']} | " + " | ".join(cells) + " |\n"


def mean_square(views, stage):
    return math.sqrt(sum(v["pictures_from"][stage]["rms"] ** 2
                         for v in views) / len(views))


def stage_lines(files):
    for stage in STAGES:
        yield f"| from {stage} | " + " | ".join(
            f"{mean_square(v, stage):.4f}" for v in files.values()) + " |\n"
    for stage in ("symbols", "scaffold", "animation"):
        cells = []
        for views in files.values():
            p = [v["pictures_from"][stage] for v in views]
            cells.append(f"{min(x['psnr'] for x in p):.1f} to "
                         f"{max(x['psnr'] for x in p):.1f} dB, "
                         f"{max(x['max'] for x in p)} "
                         f"({sum(x['n_far'] for x in p)} of {samples(views)})")
        yield (f"| 8 bits, from {stage}: PSNR, largest level (samples more "
               "than one off) | "
               + " | ".join(cells) + " |\n")


def samples(views):
    n = sum(3 * v["width"] * v["height"] for v in views)
    return f"{n / 1e6:.1f} M"


def share(views, stage):
    n = sum(v["width"] * v["height"] for v in views)
    return 100 * sum(v["pictures_from"][stage]["n_cut"] for v in views) / n


def format_lines(rows):
    for name in dict.fromkeys(r["format"] for r in rows):
        cells = []
        for r in rows:
            if r["format"] == name:
                cell = f"{r['value']}: {significant(r['rms'], 2)}"
                cells.append(f"**{cell}**" if r["chosen"] else cell)
        yield f"| {name} | " + ", ".join(cells) + " |\n"


def page(result):
    rows, files = result["operators"], result["files"]
    names = list(dict.fromkeys(r["operator"] for r in rows))
    formats = result["formats"]
    first = next(iter(files.values()))
    cuts = {r["value"]: r for r in formats
            if r["format"] == "smallest alpha"}
    text = HEAD.format(date=result["date"], cpu=result["cpu"],
                       compiler=result["compiler"], columns=HEAD_COLUMNS)
    text += "".join(operator_lines(rows, names))
    text += READ.format(flags="-O3 -march=x86-64-v3")
    sizes = ",\n".join(f"{n} with {result['nbytes'][n]:,} bytes and "
                       f"{v[0]['n_primitives']:,} primitives"
                       for n, v in files.items())
    text += STAGES_HEAD.format(sizes=sizes, names=" | ".join(files),
                               rules="---|" * len(files))
    text += "".join(stage_lines(files))
    text += STAGES_TEXT.format(cut=f"{share(first, 'scaffold'):.1f} %",
                               cut_pixels=f"{share(first, 'pixels'):.2f} %")
    text += FORMATS_HEAD.format(file=next(iter(files)))
    text += "".join(format_lines(formats))
    text += FORMATS_TEXT.format(
        saved=f"{100 * (1 - cuts['1/128']['n_pairs'] / cuts['1/256']['n_pairs']):.0f} %",
        saved_rms=significant(cuts["1/128"]["rms"], 2))
    return text


def measure(build, files):
    first = next(iter(files.values()))
    return {
        "date": datetime.date.today().isoformat(), "cpu": cpu(),
        "compiler": run("gcc", "--version").splitlines()[0],
        "operators": operators(build),
        "formats": json.loads(run(f"{build}/make_formats", first))["formats"],
        "nbytes": {name: os.path.getsize(path)
                   for name, path in files.items()},
        "files": {name: verified(f"{build}/saga", path)
                  for name, path in files.items()},
    }


def main():
    build, out = sys.argv[1:3]
    files = dict(a.split("=", 1) for a in sys.argv[3:])
    folder = f"{build}/numerics"
    if files:
        result = measure(build, files)
        with open(f"{out}/numerics.json", "w") as f:
            json.dump(result, f, separators=(",", ":"))
            f.write("\n")
    with open(f"{out}/numerics.json") as f:
        result = json.load(f)
    fill_wholes(result)
    names = list(dict.fromkeys(r["operator"] for r in result["operators"]))
    operator_table(result["operators"], names, f"{folder}/operators.dat")
    format_tables(result["formats"], folder)
    draw(names, folder, out)
    with open(f"{out}/numerics.md", "w") as f:
        f.write(page(result))
    print(f"{out}/numerics.md")


if __name__ == "__main__":
    main()
