#!/bin/bash
# SPDX-License-Identifier: MIT
#
# check_rd.sh: guarantees, for lab/rd.py with build/saga (SAGA=...),
#   interval    the BD-rate within an interval of PSNR is right, and missing if
#               the curves have too little in common; so is the saving at one
#               PSNR
#   protocol    invented evaluations give the right means over views
#   page        invented rows give the right differences: rows with other
#               options are left out, and the newest code is compared with the
#               one before
#   small       with a small scene at two rates all rows are complete; a second
#               run keeps them, and a change of the code makes new ones; x265 is
#               measured as well if it is installed; a missing capture or
#               program is reported
set -u
cd "$(dirname "$0")/../.." || exit
saga=$(realpath "${SAGA:-${BUILD:-build}/saga}")

checks=rd
. tests/cli/verdict.sh
export PYTHONDONTWRITEBYTECODE=1 PYTHONPATH=lab

# ---- interval
python3 - >>"$bad" 2>&1 <<'PYTHON' || complain "bd_rate"
import math

from bd_rate import bd_rate, common, saving

# The logarithms of the rates are lines, 0.2 apart at 30 dB and 0.02 more for
# each dB.
a = [(math.exp(5 + 0.3 * (p - 30)), p) for p in (30, 31.5, 33)]
b = [(math.exp(5.2 + 0.32 * (p - 30)), p) for p in (31, 32, 33.5, 35)]
assert common(a, b) == (31, 33)
assert common(a, b, (32, 40)) == (32, 33)
want = 100 * (math.exp(0.23) - 1)  # in the middle of 31 and 32
assert abs(bd_rate(a, b, (31, 32)) - want) < 1e-9
assert bd_rate(a, b, (31, 32), 1.0) is not None
assert bd_rate(a, b, (31, 31.9), 1.0) is None
assert bd_rate(a, b, None, 2.5) is None
# At 32 dB the lines are 0.24 apart, at 33 dB 0.26; neither curve reaches 36 dB.
for p, apart in (32, 0.24), (33, 0.26):
    assert abs(saving(a, b, p) - 100 * (math.exp(apart) - 1)) < 1e-9
assert saving(a, b, 36) is None and saving(a, b, 30) is None
assert common(a, b, (34, 40)) is None and bd_rate(a, b, (34, 40)) is None
PYTHON
verdict interval

# ---- protocol: 30 and 32 dB are 31; held out apart; changing pixels together:
# 1,000 at 20 dB and 3,000 at 10 dB have (0.01 + 0.3) / 4 as much error.
python3 - >>"$bad" 2>&1 <<'PYTHON' || complain "quality"
import math

from rd import quality


def view(held_out, psnr, pixels, changing):
    return {"held_out": held_out, "psnr_of_mean_mse": psnr, "psnr": 99,
            "changing_pixels": pixels, "changing_psnr": changing,
            "ssim_valid": 0.5}


q = quality({"views": [view(False, 30.0, 1000, 20.0), view(True, 35.0, 0, None),
                       view(False, 32.0, 3000, 10.0)]})
assert q["psnr"] == {"training": 31.0, "held_out": 35.0, "all": 97 / 3}, q
want = -10 * math.log10((0.01 + 3 * 0.1) / 4)
assert abs(q["changing"]["training"] - want) < 1e-9, q
assert abs(q["changing"]["all"] - want) < 1e-9, q
assert q["changing"]["held_out"] is None, q
PYTHON
verdict protocol

# ---- page: the new state has 10 % fewer bytes at each rate, and half of x265's.
# Held out it has 1 dB less, for which x265 takes a factor of sqrt(1 / 2).
python3 - >"$tmp/page" 2>>"$bad" <<'PYTHON' || complain "page"
import rd
import rd_table

section = {"synth": "--scene ring", "rates": "10:1 20:0.5", "seeds": "1 2",
           "iterations": "9", "x265": "30"}
scene = rd.Scene("ring", section, "/x")
score = {s: {"all": 0, "training": 0, "held_out": 0} for s in
         ("psnr", "changing", "ssim")}


def row(code, rate, seed, nbytes, psnr, options=None):
    held = {"all": psnr, "training": psnr, "held_out": psnr - 1}
    return {"scene": "ring", "source": "synth --scene ring", "code": code,
            "commit": code, "date": "d", "seed": seed, "bytes": nbytes,
            "options": options or scene.encode_options(rate, seed),
            "psnr": held, "changing": held, "ssim": held, "cpu_minutes": 2.0,
            "warm_up": {"training": 30.0, "held_out": 29.0}}


rows = [row("old", 0, "1", 1000, 20.0), row("old", 1, "1", 2000, 22.0),
        row("new", 0, "1", 900, 20.0), row("new", 1, "1", 1800, 22.0),
        row("new", 0, "2", 900, 20.0), row("new", 1, "2", 1800, 22.0),
        row("new", 0, "1", 5, 50.0, ["--primitives", "99", "--seed", "1"])]
points = [{"codec": "x265", "scene": "ring", "source": "synth --scene ring",
           "crf": "30", "bytes": b, "psnr": {"all": p, "held_out": p,
                                             "training": p}}
          for b, p in ((1800, 20.0), (3600, 22.0), (7200, 24.0))]
points += [dict(points[0], source="synth --scene room", bytes=1)]
print(rd_table.page([scene], rows, points))
rd_table.differences(rows, [scene], "new")
rd_table.differences(rows, [scene], "none")
PYTHON
has() { # has TEXT: a line of it
    grep -qF -e "$1" "$tmp/page" || complain "no '$1' in: $(cat "$tmp/page")"
}
has '| ring | x265 medium | -50.0 % | 20.0 to 22.0 | -29.3 % | 20.0 to 21.0'
has '| 20 | 0.5 | 1.8 | **21.00** | 22.00 | 21.00 | 22.00 | 29.00 / 30.00 | 2.0 | 2 |'
has 'ring       -10.0 %   held out +0.00  training +0.00'
! grep -q ' 99 ' "$tmp/page" || complain "other options are on the page"
verdict page

# ---- small
mkdir "$tmp/out"
cat >"$tmp/rd.ini" <<'INI'
[room]
synth = --size 64x36 --cameras 4 --hold-out 1 --frames 4 --points 300
rates = 60:0.2 150:0.05
iterations = 60
seeds = 1
options = --moving
x265 = 30 40

[lost]
rates = 100:0.1
iterations = 60
seeds = 1
INI
measure() {
    SAGA=$saga WORK=$tmp/work RESULTS=$tmp/out/rd SCENES=$tmp/rd.ini \
        lab/rd.py "$@" >"$tmp/say" 2>"$tmp/err" ||
        complain "rd.py $*: $(tail -n 3 "$tmp/err")"
}
measure
grep -q 'lost is skipped: no capture (it is not named' "$tmp/say" ||
    complain "a capture that is not there: $(cat "$tmp/say")"
python3 - "$tmp/out/rd/rows.jsonl" "$tmp/work" >>"$bad" 2>&1 <<'PYTHON' ||
import glob, json, os, sys

rows = [json.loads(line) for line in open(sys.argv[1])]
sizes = {os.path.getsize(p) for p in glob.glob(sys.argv[2] + "/*/room/*.saga")}
assert len(rows) == 2 and {r["bytes"] for r in rows} == sizes, sizes
for r in rows:
    assert sum(r["parts"].values()) == r["bytes"], r["parts"]
    assert 10 < r["psnr"]["held_out"] < 40 and 0 < r["cpu_minutes"] < 5, r
    p = r["psnr"]
    assert abs(4 * p["all"] - 3 * p["training"] - p["held_out"]) < 1e-6, p
    assert r["options"][-1] == "--moving" and r["scene"] == "room", r
PYTHON
    complain "rows"
cp "$tmp/out/rd/rows.jsonl" "$tmp/was"
measure
cmp -s "$tmp/out/rd/rows.jsonl" "$tmp/was" || complain "measured anew"
grep -q '^| room | 150 | 0.05 | ' "$tmp/out/rd.md" || complain "no page"
# Rows that were measured with another state of the code must not count.
sed -i 's/"code": "[0-9a-f]*"/"code": "other"/' "$tmp/out/rd/rows.jsonl"
measure --rates 2
[ "$(wc -l <"$tmp/out/rd/rows.jsonl")" = 3 ] || complain "not one row more"
measure --x265
if grep -q 'no ffmpeg with libx265' "$tmp/say"; then
    echo "     no x265 here"
else
    python3 - "$tmp/out/rd/points.jsonl" >>"$bad" 2>&1 <<'PYTHON' ||
import json, sys

a, b = [json.loads(line) for line in open(sys.argv[1])]
assert a["crf"] == "30" and a["bytes"] > b["bytes"] > 400, (a, b)
assert 45 > a["psnr"]["held_out"] > b["psnr"]["held_out"] > 20, (a, b)
assert a["streams"] == 4
PYTHON
        complain "x265"
fi
verdict small

all_passed
