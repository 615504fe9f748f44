#!/bin/bash
# SPDX-License-Identifier: MIT
#
# check_codecs.sh: guarantees, for lab/compare.py (`make compare`),
#   missing     a codec that ffmpeg does not support is named and left out
#   curves      a codec has four results, measured by the capture's protocol,
#               whose bytes and PSNR fall with its quality setting; saga files
#               have theirs; BD-rates and a page of all results are written;
#               nothing is measured twice
#   savings     the table has the change of bytes at each PSNR that both curves
#               reach, and the curves of anchors.json in the capture's folder
# Without an ffmpeg that supports libx265 it prints a message.
set -u
cd "$(dirname "$0")/../.." || exit
export SAGA=${SAGA:-build/saga}
checks=codecs
# shellcheck source=tests/cli/verdict.sh
. tests/cli/verdict.sh
export PYTHONDONTWRITEBYTECODE=1

"$SAGA" synth "$tmp/cap" --size 64x48 --cameras 2 --hold-out 0 --frames 3 \
    --depth-every 0 >"$tmp/log" 2>&1 || complain "$(cat "$tmp/log")"
"$SAGA" encode "$tmp/cap" -o "$tmp/a.saga" --primitives 60 --iterations 30 \
    >"$tmp/log" 2>&1 || complain "$(cat "$tmp/log")"
# The list has an encoder that no ffmpeg has, next to one that exists.
python3 - "$tmp" >"$tmp/say" 2>&1 <<'PYTHON' || complain "$(tail -n 1 "$tmp/say")"
import importlib.util, os, sys
sys.path.insert(0, "lab")
import simulcast
simulcast.CODECS["absent"] = simulcast.CODECS["x265"]._replace(
    encoder="libabsent")
os.environ.update(CODECS="absent x265", EVAL="--no-ssim")
spec = importlib.util.spec_from_file_location("lab_compare", "lab/compare.py")
lab = importlib.util.module_from_spec(spec)
spec.loader.exec_module(lab)
tmp = sys.argv[1]
lab.main([tmp + "/cap", tmp + "/work", tmp + "/a.saga"])
PYTHON
grep -q 'no ffmpeg with libabsent, so absent is left out' "$tmp/say" ||
    complain "absent: $(cat "$tmp/say")"
verdict missing
if grep -q 'no ffmpeg with libx265' "$tmp/say"; then
    echo "     skipped: no x265 here"
    all_passed
    exit
fi

python3 - "$tmp/work" >>"$bad" 2>&1 <<'PYTHON' || complain curves
import json, os, sys

work = sys.argv[1]
points = [json.loads(line) for line in open(work + "/x265.json")]
assert [p["quality"] for p in points] == ["24", "30", "36", "42"]
for p, q in zip(points, points[1:]):
    assert p["nbytes"] > q["nbytes"] > 200, (p["nbytes"], q["nbytes"])
    assert 50 > p["training"]["psnr"] > q["training"]["psnr"] > 15, p
mine = json.load(open(work + "/saga.json"))
assert mine["codec"] == "saga" and mine["nbytes"] == os.path.getsize(
    os.path.dirname(work) + "/a.saga")
page = open(work + "/report.html").read()
data = json.loads(page.split('id="data">')[1].split("</script>")[0])
assert [s["name"] for s in data["series"]] == ["x265", "saga"]
assert len(data["pictures"]) == 10, len(data["pictures"])
PYTHON
grep -q 'a curve needs four points' "$tmp/say" || complain "no comparison"
before=$(stat -c %Y.%Z "$tmp"/work/x265-*.json)
EVAL=--no-ssim CODECS=x265 lab/compare.py "$tmp/cap" "$tmp/work" "$tmp/a.saga" \
    >"$tmp/say" 2>&1 || complain "again: $(tail -n 1 "$tmp/say")"
[ "$before" = "$(stat -c %Y.%Z "$tmp"/work/x265-*.json)" ] ||
    complain "measured twice"
CODECS=x264 lab/compare.py "$tmp/cap" "$tmp/work" "$tmp/a.saga" \
    >"$tmp/say" 2>&1 && complain "x264 is taken"
grep -q 'no codec x264; there are x265' "$tmp/say" || complain "$(cat "$tmp/say")"
verdict curves

# ---- savings: log-rates that are lines, 0.2 apart at 30 dB and 0.02 more for
# each dB, so 0.14 at 27 dB, 0.17 at 28.5 and 0.24 at 32; ours begins at 28 dB.
python3 - >>"$bad" 2>&1 <<'PYTHON' || complain table
import math, sys
sys.path.insert(0, "lab")
import compare

a = [(math.exp(5 + 0.3 * (p - 30)), p) for p in (26, 29, 32, 35)]
b = [(math.exp(5.2 + 0.32 * (p - 30)), p) for p in (28, 30, 32.5)]
head, one, two = compare.table({"a": a, "b": b}, b)
assert head.split()[-9:] == ["BD-rate", "27", "dB", "28.5", "dB", "30", "dB",
                             "32", "dB"], head
want = [100 * (math.exp(x) - 1) for x in (0.205, 0.17, 0.2, 0.24)]
want = [f"{w:+.1f}" for w in want]
assert one.replace(" %", "").split() == ["a", want[0], "-"] + want[1:], one
assert two.replace(" %", "").split() == ["b", "+0.0", "-"] + ["+0.0"] * 3, two
PYTHON
# The anchor curve that comes with the capture has twice the bytes of saga's
# curve.
"$SAGA" encode "$tmp/cap" -o "$tmp/b.saga" --primitives 200 --iterations 200 \
    >"$tmp/log" 2>&1 || complain "$(cat "$tmp/log")"
rm "$tmp/work/saga-1.json"
EVAL=--no-ssim CODECS='' lab/compare.py "$tmp/cap" "$tmp/work" "$tmp/a.saga" \
    "$tmp/b.saga" >"$tmp/say" 2>&1 || complain "two: $(tail -n 1 "$tmp/say")"
python3 - "$tmp" >>"$bad" 2>&1 <<'PYTHON' || complain anchors
import json, sys
sys.path.insert(0, "lab")
import compare

points = compare.points_of(sys.argv[1] + "/work/saga.json")
json.dump({"curves": {"a codec": {"kB": [b / 500 for b, _ in points],
                                  "psnr_rgb": [p for _, p in points]}}},
          open(sys.argv[1] + "/cap/anchors.json", "w"))
PYTHON
EVAL=--no-ssim CODECS=x265 lab/compare.py "$tmp/cap" "$tmp/work" \
    "$tmp/a.saga" "$tmp/b.saga" >"$tmp/say" 2>&1 ||
    complain "anchors: $(tail -n 1 "$tmp/say")"
grep -Eq '^x265 +(-|[+-][0-9.]+ %) ' "$tmp/say" ||
    complain "x265: $(cat "$tmp/say")"
grep -Eq '^a codec +-50\.0 %( +(-50\.0 %|-)){4}$' "$tmp/say" ||
    complain "a codec: $(cat "$tmp/say")"
echo '{"curves": {"a codec": {"kB": [1, 2], "psnr_rgb": [30]}}}' \
    >"$tmp/cap/anchors.json"
EVAL=--no-ssim CODECS=x265 lab/compare.py "$tmp/cap" "$tmp/work" \
    "$tmp/a.saga" >"$tmp/say" 2>&1 && complain "a bad anchors.json is taken"
grep -q 'anchors.json has no curves of kB and psnr_rgb' "$tmp/say" ||
    complain "bad: $(cat "$tmp/say")"
verdict savings

all_passed
