#!/bin/bash
# SPDX-License-Identifier: MIT
#
# check_ablation.sh: guarantees, for lab/ablation.sh with build/saga
# (SAGA=...) and the programs of lab/ beside it,
#   bd-rate     the BD-rate of curves whose mean change of rate is known, and of
#               a monotone cubic that was integrated by hand, is right
#   options     make_refit refuses invalid options, and files that are not saga
#               files
#   masked      of the demo's masked anchors, neighbours recover the direction
#               better than random anchors, and the mean has the error that the
#               definition of a mean gives
#   small       with a small scene at two rates there is a file of each variant,
#               which uses only the sources of entropy that the variant allows;
#               a refit that leaves nothing out gives the same bytes; the
#               paper's model has the tools and the shared anchors that its row
#               leaves in; a higher lambda makes a smaller file; a second run
#               computes nothing again
set -u
cd "$(dirname "$0")/../.." || exit
saga=${SAGA:-${BUILD:-build}/saga}
bin=$(dirname "$saga")

checks=ablation
. tests/cli/verdict.sh

# ---- bd-rate
PYTHONDONTWRITEBYTECODE=1 python3 - >>"$bad" 2>&1 <<'PYTHON' ||
import math
import sys

sys.path.insert(0, "lab")
from ablation_table import same_symbols
from bd_rate import bd_rate, integral


def near(a, b):
    assert abs(a - b) < 1e-9, (a, b)


anchor = [(1000, 30.0), (2100, 32.5), (3900, 34.0), (9000, 36.0)]
near(bd_rate(anchor, anchor), 0)
# 10 % more bytes must be a BD-rate of 10, whatever the curve and the order.
near(bd_rate(anchor, [(1.1 * r, p) for r, p in anchor[::-1]]), 10)
# The logarithms of the rates are lines, which the cubic reproduces. They differ
# by 0.2 at 30 dB and by 0.02 more for each dB. Both curves have 31 to 33 dB, in
# whose middle they differ by 0.24.
a = [(math.exp(5 + 0.3 * (p - 30)), p) for p in (30, 31.5, 33)]
b = [(math.exp(5.2 + 0.32 * (p - 30)), p) for p in (31, 32, 33.5, 35)]
near(bd_rate(a, b), 100 * (math.exp(0.24) - 1))
near(bd_rate(b, a), 100 * (math.exp(-0.24) - 1))
# The cubic through (0, 0), (1, 1), (2, 1) has slopes 1 and 0, and therefore
# derivatives 3/2, 0, 0. Its integral is 1/2 + (3/2) / 12 = 0.625 over [0, 1]
# and 1 over [1, 2]. Over [0, 1/2], where y = 3/2 t - t^3 / 2, it is 3/16 -
# 1/128.
near(integral([0, 1, 2], [0, 1, 1], 0, 2), 1.625)
near(integral([0, 1, 2], [0, 1, 1], 0, 0.5), 3 / 16 - 1 / 128)
# With slopes 1 and 3, the interior derivative is 2 / (1 + 1/3) = 3/2, and those
# at the ends are 0 and (9 - 1) / 2 = 4. The integrals are 1/2 + (0 - 3/2) / 12
# and (1 + 4) / 2 + (3/2 - 4) / 12.
near(integral([0, 1, 2], [0, 1, 4], 0, 2), 0.5 - 0.125 + 2.5 - 2.5 / 12)
# A run with twice the bytes and one with half the bytes must give a mean change
# of 0.
class Run:
    def __init__(self, n):
        self.bytes = n


near(same_symbols([Run(10), Run(300)], [Run(20), Run(150)]), 0)
near(same_symbols([Run(10), Run(300)], [Run(40), Run(300)]), 100)
# There must be no result if the curves have no quality in common, or if two
# rates of a curve have one PSNR.
assert bd_rate(anchor, [(r, p + 9) for r, p in anchor]) is None
assert bd_rate(anchor, [(1000, 30.0), (2000, 30.0)]) is None
assert bd_rate(anchor, anchor[:1]) is None
PYTHON
    complain "bd_rate"
verdict bd-rate

# ---- options
: >"$tmp/none.saga"
refuses() { # refuses STATUS OPTIONS...
    local want=$1 rc
    shift
    "$bin/make_refit" "$@" >"$tmp/out" 2>"$tmp/err"
    rc=$?
    [ "$rc" = "$want" ] && [ -s "$tmp/err" ] && [ ! -s "$tmp/out" ] ||
        complain "make_refit $*: status $rc, not $want: $(cat "$tmp/err")"
}
refuses 2
for wrong in '--ablate groups=17' '--ablate nothing' '--ablate' \
    '--iterations 2' '--iterations' '--nothing 3'; do
    # shellcheck disable=SC2086
    refuses 2 "$tmp/none.saga" "$tmp/x.saga" $wrong
done
refuses 1 "$tmp/none.saga" "$tmp/x.saga"
"$bin/make_order0" "$tmp/none.saga" >"$tmp/out" 2>&1 &&
    complain "make_order0 takes an empty file"
verdict options

# ---- masked
# The mean of the known features is nearly that of all, which is the constant
# with the least error: no more than 1 of their RMS.
"$bin/make_masked" docs/demo.saga >"$tmp/out" 2>&1 && awk '
    /%/ { n++; by[$1]++
          if (!($6 > 2 * $8 && $5 < $7 && $9 < 1.01)) bad = 1 }
    END { exit bad || n != 10 || by["coarse"] != 5 }' "$tmp/out" ||
    complain "make_masked: $(cat "$tmp/out")"
verdict masked

# ---- small
folder=$tmp/ablation
results=$tmp/results
mkdir "$folder"
"$saga" synth "$folder/capture" --size 64x36 --cameras 4 --hold-out 1 \
    --frames 3 --points 300 --depth-every 0 >"$tmp/out" 2>&1 ||
    complain "synth: $(cat "$tmp/out")"
ablate() {
    LAMBDAS='0.09 0.0009' TRAIN='--primitives 150 --iterations 150 --moving' \
        REFIT='--iterations 20' PAPER=ring:80:36:24 \
        PAPER_SYNTH='--size 48x27 --cameras 4 --frames 3' \
        lab/ablation.sh "$saga" "$folder" "$results" 1 "again=$folder/r2/in.saga" >"$tmp/out" 2>&1 ||
        complain "ablation: $(tail -n 3 "$tmp/out")"
}
ablate
python3 - "$folder" >>"$bad" 2>&1 <<'PYTHON' || complain "what was made"
import json, os, sys

HYPER, PARENT, GROUPS, BANK = 1, 2, 4, 8
never = {"no-bank": BANK, "no-hyperprior": HYPER, "no-parent": PARENT,
         "no-groups": GROUPS, "nothing": HYPER | PARENT | GROUPS | BANK,
         "all-no-bank": BANK}
slots = [f"slots{n}" for n in (32, 64, 128, 256, 512)]
for rate in "r1", "r2":
    at = os.path.join(sys.argv[1], rate)
    full = json.load(open(f"{at}/full.json"))
    for name in list(never) + ["all", "all-plain", "raw"] + \
            (slots if rate == "r2" else []):
        r = json.load(open(f"{at}/{name}.json"))
        assert r["bytes"] == os.path.getsize(f"{at}/{name}.saga"), name
        assert r["before"] == full["before"], name
        for key in "coarse", "fine", "primitives":
            kind = r["entropy_model"][key]
            assert not kind["sources"] & never.get(name, 0), (name, kind)
            if name in ["all", "all-plain"] + slots:
                assert kind["sources"] & BANK, (name, kind)
        for key in "tree", "fine_suffixes", "primitive_suffixes":
            assert r["after"][key] == full["after"][key], (name, key)
rows = [json.loads(x) for x in open(f"{sys.argv[1]}/paper/ring.json")]
HASH, BANK_TOOL, PLAIN = 1 << 8, 1 << 9, 1 << 10
tools = {"flat": 0, "no-hash": BANK_TOOL, "no-bank": HASH,
         "plain-update": HASH | BANK_TOOL | PLAIN}
by_row = {}
for r in sorted(rows, key=lambda r: r["factor"]):
    by_row.setdefault(r["row"], []).append(r["bytes"])
    found = r["tools"] & (HASH | BANK_TOOL | PLAIN)
    assert found == tools.get(r["row"], HASH | BANK_TOOL), r
    own = r["row"] == "flat"
    assert (r["fine"] == r["primitives"]) == own, r
assert len(rows) == 26 and len(by_row) == 12, rows
assert len({tuple(b) for b in by_row.values()}) == 12, by_row
# A higher price gives fewer bytes, except where nearly all are those of networks
# without a price.
for name, b in by_row.items():
    assert b[0] > b[-1] or name == "raw-networks", by_row
PYTHON
for text in '| as trained ' \
    '| full model ' \
    '| constants by channel ' '| raw networks' '## Slots' '| again ' \
    '## The paper.s whole model' '| residual hash | V3' 'ring: 80 primitives' \
    '| built-in | \*\*all\*\*' ; do
    grep -q "$text" "$results/ablation.md" || complain "no '$text'"
done
! command -v gnuplot >/dev/null || grep -q '</svg>' "$results/ablation.svg" ||
    complain "no plot: $(tail -n 3 "$tmp/out")"
touch "$tmp/then"
cp "$results/ablation.md" "$tmp/was"
ablate
anew=$(find "$folder"/r? -newer "$tmp/then" -type f)
[ -z "$anew" ] || complain "made anew: $anew"
cmp -s "$results/ablation.md" "$tmp/was" || complain "another table"
verdict small

all_passed
