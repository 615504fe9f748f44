# SPDX-License-Identifier: MIT
"""Shows rows of lab/rd.py as a page, a plot, and differences."""
import math
import os
import shutil
import subprocess
import sys
import tempfile
import textwrap

from bd_rate import bd_rate, common, saving

LAB = os.path.dirname(os.path.abspath(__file__))
LEAST = 1.0  # dB that curves must have in common for a useful BD-rate
AT = 27, 28.5, 30, 32  # dB at which savings are told
CODECS = {"x265": "x265 medium", "vvenc": "VVenC medium",
          "vvenc_psnr": "VVenC for PSNR",
          "vvenc_series": "VVenC in series"}


def mean(values):
    values = [v for v in values if v is not None]
    return sum(values) / len(values) if values else None


def db(x):
    return "-" if x is None else f"{x:.2f}"


def kb(x):
    return f"{x / 1000:.1f}"


def percent(x):
    return "-" if x is None else f"{x:+.1f} %"


def line(row):
    """Returns a row or a point as a line for the terminal."""
    p, c = row["psnr"], row.get("changing", {})
    text = (f"{row['scene']:8} {kb(row['bytes']):>8} kB  held out "
            f"{db(p.get('held_out')):>5}  training {db(p.get('training')):>5}"
            f"  changing {db(c.get('held_out')):>5} / "
            f"{db(c.get('training')):>5}")
    if "cpu_minutes" in row:
        text += f"  {row['cpu_minutes']:.1f} CPU min"
    return text


# --- Curves ------------------------------------------------------------------

def setting(row):
    """Returns a row's options without the seed."""
    o = row["options"]
    at = o.index("--seed")
    return tuple(o[:at] + o[at + 2:])


class Point:
    """The results at one rate: the means over its seeds."""

    def __init__(self, rows):
        self.rows = rows
        self.bytes = math.exp(mean(math.log(r["bytes"]) for r in rows))

    def psnr(self, of, key="psnr"):
        return mean(r[key].get(of) for r in self.rows)


def rates(rows):
    groups = {}
    for row in rows:
        groups.setdefault(setting(row), []).append(row)
    return sorted((Point(g) for g in groups.values()), key=lambda p: p.bytes)


def curve(points, of):
    """Returns the points (bytes, dB) of rows or rates; none if there are no
    views of this set."""
    out = [(p.bytes, p.psnr(of)) if isinstance(p, Point) else
           (p["bytes"], p["psnr"].get(of)) for p in points]
    return [] if any(d is None for _, d in out) else out


def of_scene(rows, scene):
    """Returns the rows of the scene as lab/rd.ini defines it now, grouped by
    code, the oldest code first."""
    wanted = {tuple(scene.encode_options(i, seed)) for i in
              range(len(scene.rates)) for seed in scene.seeds}
    states = {}
    for row in rows:
        if (row["scene"] == scene.name and row["source"] == scene.source() and
                tuple(row["options"]) in wanted):
            # Code that is measured again counts as the newest.
            states[row["code"]] = states.pop(row["code"], []) + [row]
    return list(states.values())


def anchors(points, scene):
    """Returns {codec: its points on the pictures of this scene}."""
    out = {}
    for p in points:
        if p["scene"] == scene.name and p.get("source", scene.source()) == \
                scene.source():
            out.setdefault(p["codec"], []).append(p)
    return {c: sorted(out[c], key=lambda p: p["bytes"]) for c in CODECS
            if c in out}


# --- The page ----------------------------------------------------------------

def table(head, rows):
    return ("\n".join(["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
                      + ["| " + " | ".join(r) + " |" for r in rows]) + "\n\n")


def prose(text):
    return textwrap.fill(" ".join(text.split()), 80,
                         break_on_hyphens=False) + "\n\n"


def scene_rows(name, rows):
    out = []
    for p in rates(rows):
        o = p.rows[0]["options"]
        warm = [[r["warm_up"][s] for r in p.rows]
                for s in ("held_out", "training")]
        out.append([name, o[1], o[3] if float(o[3]) else "rule", kb(p.bytes),
                    f"**{db(p.psnr('held_out'))}**",
                    db(p.psnr("training")),
                    db(p.psnr("held_out", "changing")),
                    db(p.psnr("training", "changing")),
                    f"{db(mean(warm[0]))} / {db(mean(warm[1]))}",
                    f"{mean(r['cpu_minutes'] for r in p.rows):.1f}",
                    str(len(p.rows))])
    return out


def scene_table(scenes, rows):
    """All scenes as one table, and how each was made."""
    out, how = [], ""
    for scene in scenes:
        states = of_scene(rows, scene)
        if states:
            out += scene_rows(scene.name, states[-1])
            o = " ".join(scene.options + ["--iterations", scene.iterations])
            how += f"**{scene.name}**: {scene.source()}; {o}. "
    return table(["scene", "primitives", "lambda", "kB", "**held out**",
                  "training", "changing, held out", "changing, training",
                  "warm-up, held out / training", "CPU min", "seeds"],
                 out) + prose(how)


def against(anchor, test, within):
    """Returns the BD-rate and its interval of PSNR, as two cells of a table."""
    if not anchor or not test:
        return ["-", ""]
    interval = common(anchor, test, within)
    if not interval:
        return ["-", "nothing in common"]
    rate = bd_rate(anchor, test, within, LEAST)
    return [percent(rate), f"{interval[0]:.1f} to {interval[1]:.1f}" +
            ("" if rate is not None else ": too little")]


def bd_table(scenes, rows, points):
    out = []
    for scene in scenes:
        states = of_scene(rows, scene)
        if not states:
            continue
        all_views = curve(rates(states[-1]), "all")
        held_out = curve(rates(states[-1]), "held_out")
        for codec, its in anchors(points, scene).items():
            anchor = curve(its, "all")
            out.append([scene.name, CODECS[codec]] +
                       against(anchor, all_views, scene.within) +
                       against(curve(its, "held_out"), held_out,
                               scene.within))
    return table(["scene", "against", "all cameras", "over dB",
                  "held-out cameras", "over dB"], out)


def saving_table(scenes, rows, points):
    out = []
    for scene in scenes:
        states = of_scene(rows, scene)
        ours = curve(rates(states[-1]), "all") if states else []
        for codec, its in anchors(points, scene).items():
            cells = [percent(saving(curve(its, "all"), ours, db))
                     if ours else "-" for db in AT]
            if set(cells) != {"-"}:
                out.append([scene.name, CODECS[codec]] + cells)
    return table(["scene", "against"] + [f"{db:g} dB" for db in AT], out)


def point_table(scenes, points):
    out = [[scene.name, CODECS[codec]] +
           [", ".join(filter("-".__ne__, map(cell, its))) or "-" for cell in (
               lambda p: kb(p["bytes"]), lambda p: db(p["psnr"].get("all")),
               lambda p: db(p["psnr"].get("held_out")))]
           for scene in scenes
           for codec, its in anchors(points, scene).items()]
    return table(["scene", "codec", "kB", "all cameras", "held-out cameras"],
                 out)


PROTOCOL = """Files of `saga encode` are decoded by the integer decoder from the
closed and reopened file. PSNR is computed from the squared error over all
frames of a camera and over R, G and B; the tables have the mean over the
cameras, in dB. Held-out cameras are those that training never saw. Changing
pixels differ by more than 8/255 from the temporal median of their view."""

COLUMNS = """"rule" is the price of a bit that `saga encode` chooses by itself;
the warm-up's PSNR is that before anything is coded. A row with several seeds
is their mean. CPU minutes are those of `saga encode`, all threads together, on
a shared machine."""

OTHERS = """A row has the points of a codec; points.jsonl has all numbers. x265
and VVenC code every camera as a stream of its own, the held-out ones too. Their
bytes are those of all raw streams together. x265 runs with preset medium,
--tune psnr, no wavefronts and no text in the stream (lab/simulcast.py)."""

VVENC = """VVenC's points came with the capture: version 1.15, preset medium,
all cameras together. "For PSNR" is VVenC without its perceptual quantisation.
"In series" is one stream of all cameras one after another, every second one
backwards in time: the best plain video coding that was found."""

BD = """BD-rate is the mean change of bytes at equal PSNR, computed by monotone cubics of log-rate over
the interval that both curves cover; if they share less than 1 dB, there is
none."""

HELD_OUT = """The other codecs coded the held-out cameras, too. Bytes are always
those of all cameras."""

SAVINGS = """A cell is the change of bytes at the same PSNR of all cameras, or a
dash if one of the curves does not reach it."""


def page(scenes, rows, points):
    out = "# Rate and distortion: `make rd`\n\n"
    out += prose(PROTOCOL)
    out += "![rate and distortion](rd.svg)\n\n"
    out += "## BD-rate\n\n" + bd_table(scenes, rows, points)
    out += prose(BD) + prose(HELD_OUT)
    out += "## Savings by PSNR\n\n" + saving_table(scenes, rows, points)
    out += prose(SAVINGS)
    out += "## Scenes\n\n" + scene_table(scenes, rows)
    out += prose(COLUMNS)
    out += "## Other codecs\n\n" + point_table(scenes, points)
    out += prose(OTHERS) + prose(VVENC)
    return out.rstrip("\n") + "\n"


# --- The plot ----------------------------------------------------------------

def curves_of(scene, rows, points):
    """Returns (title, line type, curve) for everything measured on a scene."""
    states, its = of_scene(rows, scene), anchors(points, scene)
    ours = rates(states[-1]) if states else []
    out = [("saga, all cameras", 1, curve(ours, "all")),
           ("saga, held out", 2, curve(ours, "held_out"))]
    out += [(title, 3 + i, curve(its.get(codec, []), "all"))
            for i, (codec, title) in enumerate(CODECS.items())]
    return [c for c in out if c[2]]


def block(title, points):
    return f'"{title}"\n' + "".join(f"{b / 1000:.3f} {d:.4f}\n"
                                    for b, d in points) + "\n\n"


def plot(scenes, rows, points, to):
    if not shutil.which("gnuplot"):
        print("rd: no gnuplot, so no " + to, file=sys.stderr)
        return
    with tempfile.TemporaryDirectory() as folder:
        names, types = [], []
        for scene in scenes:
            curves = curves_of(scene, rows, points)
            if not curves:
                continue
            names.append(scene.name)
            types.append("".join(str(c[1]) for c in curves))
            with open(os.path.join(folder, scene.name + ".dat"), "w") as f:
                f.writelines(block(c[0], c[2]) for c in curves)
        subprocess.check_call(
            ["gnuplot", "-e", f"folder='{folder}'; out='{to}'; "
             f"scenes='{' '.join(names)}'; types='{' '.join(types)}'",
             os.path.join(LAB, "rd.gp")])


def write(results, rows, points, scenes):
    if not rows and not points:
        print("rd: nothing is measured, so nothing is written")
        return
    with open(results + ".md.part", "w") as f:
        f.write(page(scenes, rows, points))
    os.replace(results + ".md.part", results + ".md")
    plot(scenes, rows, points, results + ".svg")
    print(bd_table(scenes, rows, points) + results + ".md")


# --- The short form ----------------------------------------------------------

def change(old, new, of, key):
    a, b = old[key].get(of), new[key].get(of)
    return f"{b - a:+.2f}" if None not in (a, b) else "-"


def differences(rows, scenes, code):
    """Prints how the rows of this code differ from the latest of other code."""
    for scene in scenes:
        states = of_scene(rows, scene)
        now = [s for s in states if s[0]["code"] == code]
        before = [s for s in states if s[0]["code"] != code]
        if not now:
            continue
        for row in now[0]:
            print(line(row) + f"  seed {row['seed']}")
        if not before:
            print(f"{scene.name}: no row before, nothing to compare with")
            continue
        for new in now[0]:
            for old in before[-1]:
                if old["options"] == new["options"]:
                    compare(old, new)


def compare(old, new):
    more = 100 * (new["bytes"] / old["bytes"] - 1)
    print(f"{new['scene']:8} {more:+7.1f} %   held out "
          f"{change(old, new, 'held_out', 'psnr')}  training "
          f"{change(old, new, 'training', 'psnr')}  changing "
          f"{change(old, new, 'held_out', 'changing')} / "
          f"{change(old, new, 'training', 'changing')}  CPU "
          f"x{new['cpu_minutes'] / old['cpu_minutes']:.2f}  seed {new['seed']}"
          f", against {old['commit']} of {old['date']}")
