#!/bin/bash
# SPDX-License-Identifier: MIT
#
# check_floors.sh: guarantees, for lab/floors.sh with build/saga (SAGA=...)
# and make_zeroed beside it,
#   table       invented reports give the right differences and verdicts, even
#               if a number or the held-out views are missing
#   small       with a small scene from demo.sh, floors.sh makes a still file
#               without temporal tools, and a file with zero features, which has
#               fewer bytes; a second run trains nothing again; a missing demo
#               is reported
set -u
cd "$(dirname "$0")/../.." || exit
saga=${SAGA:-${BUILD:-build}/saga}

checks=floors
. tests/cli/verdict.sh

# has TEXT: checks that the table has this line, with repeated blanks as one.
has() {
    tr -s ' ' <"$tmp/table" | grep -qxF -e "$1" ||
        complain "no line '$1' in: $(cat "$tmp/table")"
}
table() { # table FOLDER
    python3 lab/floors_table.py "$1/encode.json" "$1/moving.json" \
        "$1/still.json" "$1/zeroed.json" >"$tmp/table" 2>>"$tmp/bad" ||
        complain "floors_table.py fails"
}

# ---- table
cat >"$tmp/invent.py" <<'PYTHON'
import json, sys

folder, held = sys.argv[1], int(sys.argv[2])


def pair(training, held_out):
    return {"training": training, "held_out": held_out if held else None,
            "n_training": 40, "n_held_out": 20 if held else 0}


def put(name, value):
    json.dump(value, open(f"{folder}/{name}.json", "w"))


def score(psnr, median, changing):
    return {"psnr": psnr, "median_psnr": median, "changing_psnr": changing}


def scores(training, held_out, views):
    return {"training": training, "held_out": held_out, "n_training": 3,
            "n_held_out": held, "views": views}


none = score(None, None, None)
put("encode", {"psnr_warm_up": pair(34.0, 33.75), "psnr_float": pair(33.5, 33),
               "psnr_decoded_float": pair(33.25, 33.0),
               "psnr": pair(33.0, 33.125),
               "psnr_against_decoded_float": pair(55.0, 54.5)})
views = [dict(score(30.0, 25.0, 1.0), name="a", held_out=False),
         dict(score(31.0, 31.0, 1.0), name="b", held_out=False),
         dict(score(32.0, None, 1.0), name="c", held_out=False),
         dict(score(20.0, 25.0, 1.0), name="d", held_out=True)]
put("moving", scores(score(31.0, None, 27.5), score(33.0, 28.0, 24.0)
                     if held else none, views[:3 + held]))
put("still", scores(score(25.0, None, 25.5), score(24.0, 28.0, None)
                    if held else none, views[:3 + held]))
put("zeroed", scores(score(26.0, None, 9.0), score(28.5, 28.0, 9.0)
                     if held else none, views[:3 + held]))
PYTHON
python3 "$tmp/invent.py" "$tmp" 1 || complain "nothing invented"
table "$tmp"
has ' warm-up above file 1.000 <= 1.0 ok 0.625 <= 0.5 MISSED'
has ' file above --still 2.000 >= 2.0 ok - >= 2.0 MISSED'
has ' temporal median pictures - 28.000'
has ' above it 1 of 3 training views MISSED'
has ' not b: 31.000, its median 31.000'
has ' not c: 32.000, its median infinite'
has ' file above it 5.000 >= 5.0 ok 4.500 >= 5.0 MISSED'
has ' the last two apart 0.250 <= 0.1 MISSED 0.125 <= 0.1 MISSED'
has ' one against the other 55.000 >= 55.0 ok 54.500 >= 55.0 MISSED'
has '4 of 11 floors reached'
[ "$(wc -L <"$tmp/table")" -le 80 ] || complain "more than 80 columns"
python3 "$tmp/invent.py" "$tmp" 0 || complain "nothing invented"
table "$tmp"
has ' warm-up above file 1.000 <= 1.0 ok -'
has ' file above --still 2.000 >= 2.0 ok -'
has '4 of 6 floors reached'
verdict table

# ---- small
small=(--primitives 150 --iterations 300)
demo=$tmp/demo
mkdir "$demo"
lab/floors.sh "$saga" "$demo" 1 "${small[@]}" >"$tmp/out" 2>&1
rc=$?
[ "$rc" = 2 ] && grep -q 'no finished demo' "$tmp/out" ||
    complain "without a demo: status $rc: $(cat "$tmp/out")"
"$saga" synth "$demo/capture" --size 64x36 --cameras 4 --hold-out 1 \
    --frames 4 --points 300 --depth-every 0 >"$tmp/out" 2>&1 ||
    complain "synth: $(cat "$tmp/out")"
tools/demo.sh "$saga" "$demo" 1 "${small[@]}" --moving >"$tmp/out" 2>&1 ||
    complain "demo: $(tail -n 3 "$tmp/out")"
floors() {
    lab/floors.sh "$saga" "$demo" 1 "${small[@]}" >"$tmp/out" 2>&1 ||
        complain "floors: $(tail -n 3 "$tmp/out")"
}
floors
cp "$demo/floors.txt" "$tmp/table"
grep -q '^[0-9]* of 11 floors reached$' "$tmp/table" ||
    complain "table: $(cat "$tmp/table")"
python3 -c 'import json, sys
demo = sys.argv[1]
def read(name):
    return json.load(open(demo + "/" + name + ".json"))
assert read("encode")["temporal"] and not read("still/encode")["temporal"]
moving, still, zeroed = read("moving"), read("still"), read("zeroed")
psnr = read("encode")["psnr"]["training"] # the same pictures: all there are
assert abs(moving["training"]["psnr"] - psnr) < 1e-6
assert zeroed["bytes"]["coarse"] < moving["bytes"]["coarse"]
for part in "networks", "fine", "primitives":
    assert zeroed["bytes"][part] == moving["bytes"][part], part
for a in still, zeroed:
    assert a["training"]["psnr"] != moving["training"]["psnr"]
    assert a["training"]["median_psnr"] == moving["training"]["median_psnr"]
' "$demo" 2>>"$tmp/bad" || complain "what was measured"
cp -p "$demo/still/demo.saga" "$tmp/was"
floors
[ ! "$demo/still/demo.saga" -nt "$tmp/was" ] || complain "trained anew"
cmp -s "$demo/floors.txt" "$tmp/table" || complain "another table"
verdict small

all_passed
