#!/bin/bash
# SPDX-License-Identifier: MIT
#
# report.sh NAME CAPTURE [options of saga encode]: encodes a capture with
# --preset fast, evaluates the file, and writes docs/results/NAME.html and
# .json. The page shows the held-out cameras and the first other ones, VIEWS (3)
# in all, as JPEG, so that it stays small. Results of an earlier run in
# build/report/ are kept.
set -euo pipefail
name=$1 capture=$2
shift 2
saga=${SAGA:-build/saga} views=${VIEWS:-3} out=docs/results to=build/report/$name
mkdir -p "$to"
[[ -e $to/$name.saga ]] ||
    "$saga" encode "$capture" -o "$to/$name.saga" --preset fast "$@"
[[ -e $to/$name.json ]] ||
    "$saga" eval "$to/$name.saga" "$capture" --pictures "$to/pictures" \
        --json >"$to/$name.json"
python3 - "$to/$name.json" "$views" "$out/$name.json" <<'END'
import json
import os
import subprocess
import sys

path, most, kept = sys.argv[1], int(sys.argv[2]), sys.argv[3]


def write(to, result):
    with open(to, "w") as f:
        json.dump(result, f, indent=1)
        f.write("\n")


with open(path) as f:
    result = json.load(f)
order = sorted(result["views"], key=lambda v: not v["held_out"])
for i, view in enumerate(order):
    png = view.pop("picture", None)
    if png and i < most:
        jpeg = os.path.splitext(png)[0] + ".jpg"
        if png != jpeg:
            subprocess.run(["ffmpeg", "-v", "error", "-nostdin", "-y", "-i",
                            png, "-q:v", "5", jpeg], check=True)
        view["picture"] = jpeg
result["protocol"]["capture"] = os.path.basename(
    result["protocol"]["capture"].rstrip("/"))
write(path, result)
for view in result["views"]:
    view.pop("picture", None)
write(kept, result)
END
"$saga" report "$to/$name.json" -o "$out/$name.html"
