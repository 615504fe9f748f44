#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""floors_table.py ENCODE MOVING STILL ZEROED: compares the demo's file with
simple alternatives, so that an easy scene cannot make it look good.

Prints, for training and held-out views, each measured number, its goal, and
whether the goal is reached. Arguments are JSON files: the report of `saga
encode`, and the results of `saga eval` for its file, for a file trained with
--still, and for a copy whose coarse features are zero. A missing number (null:
infinite or undefined) prints as - and does not reach its goal.
"""
import json
import sys

SETS = "training", "held_out"
reached = []


def difference(a, b):
    return [None if x is None or y is None else x - y for x, y in zip(a, b)]


def line(mark, text, values, goals=(None, None), fits=None):
    """Prints a line. goals are those of the two sets of views; fits(value,
    goal) returns whether a goal is reached."""
    out = f"{mark:2}{text:28}"
    for value, goal in zip(values, goals):
        out += "         -" if value is None else f"{value:10.3f}"
        if goal is None:
            out += " " * 15
            continue
        reached.append(value is not None and fits(value, goal))
        sign = "<=" if fits is at_most else ">="
        out += f" {sign}{goal:5.1f} " + ("ok    " if reached[-1] else "MISSED")
    print(out.rstrip())


def at_most(value, goal):
    return value <= goal


def at_least(value, goal):
    return value >= goal


def medians(views):
    """Checks that every training view, not only their mean, has a higher PSNR
    than its temporal median."""
    training = [v for v in views if not v["held_out"]]
    low = [v for v in training if v["psnr"] is not None and
           (v["median_psnr"] is None or v["psnr"] <= v["median_psnr"])]
    text = f"{len(training) - len(low)} of {len(training)} training views"
    reached.append(not low)
    print(f"  {'above it':28}  {text}  {'MISSED' if low else 'ok'}")
    for v in low:
        median = v["median_psnr"]
        print(f"    not {v['name']}: {v['psnr']:.3f}, its median "
              f"{'infinite' if median is None else f'{median:.3f}'}")


def main(names):
    encode, moving, still, zeroed = [json.load(open(n)) for n in names]
    sets = [s for s in SETS if moving["n_" + s]]

    def of(report, key):
        return [report[s][key] if s in sets else None for s in SETS]

    def trained(key):
        return [encode[key][s] if s in sets else None for s in SETS]

    def goals(training, held_out):
        return [g if s in sets else None
                for s, g in zip(SETS, (training, held_out))]

    warm, model = trained("psnr_warm_up"), trained("psnr_float")
    coded, file = trained("psnr_decoded_float"), trained("psnr")
    shown = encode["psnr"]
    print(f"{'PSNR, dB':32}training{'':17}held out")
    line("a", "flat warm-up, float", warm)
    line("", "file, integer decoder *", file)
    line("", "warm-up above file", difference(warm, file), goals(1.0, 0.5),
         at_most)
    changing = of(moving, "changing_psnr"), of(still, "changing_psnr")
    line("b", "changing pixels, file", changing[0])
    line("", "changing pixels, --still", changing[1])
    line("", "file above --still", difference(*changing), goals(2.0, 2.0),
         at_least)
    line("c", "file, all frames", of(moving, "psnr"))
    line("", "temporal median pictures", of(moving, "median_psnr"))
    medians(moving["views"])
    line("d", "features zeroed, all frames", of(zeroed, "psnr"))
    line("", "file above it",
         difference(of(moving, "psnr"), of(zeroed, "psnr")), goals(5.0, 5.0),
         at_least)
    line("e", "float before quantisation *", model)
    line("", "decoded symbols, in float *", coded)
    line("", "file, integer decoder *", file)
    line("", "the last two apart", [x if x is None else abs(x) for x in
                                    difference(coded, file)],
         goals(0.1, 0.1), at_most)
    line("", "one against the other",
         trained("psnr_against_decoded_float"), goals(55.0, 55.0), at_least)
    print(f"* of {shown['n_training']} + {shown['n_held_out']} pictures, evenly"
          " spread; changing pixels: more than 8/255 off the\n  view's "
          "temporal median, all taken together")
    print(f"{sum(reached)} of {len(reached)} floors reached")


if __name__ == "__main__":
    if len(sys.argv) != 5:
        sys.exit(__doc__.splitlines()[0])
    main(sys.argv[1:])
