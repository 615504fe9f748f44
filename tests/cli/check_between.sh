#!/bin/bash
# SPDX-License-Identifier: MIT
#
# check_between.sh: guarantees, for `saga encode` (build/saga, or SAGA=...) and
# a small ring of cameras 30 degrees apart, of which three are left out,
#   presets     no camera left out is more than 0.5 dB worse in the file of
#               `balanced` than in that of `fast`, which has two thirds of its
#               bytes. A long primitive that is drawn falsely before one costs
#               4 dB (docs/lab/warm-up.md)
#   predicted   what `encode` predicts between the cameras is within 2 dB of
#               what the cameras left out have, and these count
set -u
saga=$(realpath "${SAGA:-${BUILD:-build}/saga}")
checks=between
. "$(dirname "$0")/verdict.sh"
cd "$tmp" || exit

run_as=("$saga")
expect 0 synth ring --scene ring --size 160x90 --samples 1 --cameras 12 \
    --hold-out 3 --frames 8 --depth-every 0 --quiet
for preset in fast balanced; do
    expect 0 encode ring -o $preset.saga --preset $preset --device cpu --quiet \
        --json
    mv out $preset.report
    expect 0 eval $preset.saga ring --no-ssim --json --quiet
    mv out $preset.json
done
python3 - >>"$bad" 2>&1 <<'PYTHON' || complain "the presets"
import json

fast, balanced = ([v for v in json.load(open(f"{name}.json"))["views"]
                   if v["held_out"]] for name in ("fast", "balanced"))
assert len(fast) == 3
for a, b in zip(fast, balanced):
    assert b["psnr"] > a["psnr"] - 0.5, (a["name"], a["psnr"], b["psnr"])
PYTHON
verdict presets

python3 - >>"$bad" 2>&1 <<'PYTHON' || complain "the prediction"
import json

for name in "fast", "balanced":
    report = json.load(open(f"{name}.report"))
    between, psnr = report["psnr_between"], report["psnr"]
    assert between["measured"], between
    assert between["expected"] == psnr["held_out"], (between, psnr)
    assert abs(between["predicted"] - psnr["held_out"]) < 2, (between, psnr)
PYTHON
verdict predicted

all_passed
