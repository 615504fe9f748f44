#!/bin/bash
# SPDX-License-Identifier: MIT
#
# check_double.sh: guarantees, with build/saga (SAGA=...) and one whose trainer
# computes in double (make REAL=double), on four seeds of a tiny scene,
#   warm-up     after a hundred iterations both have the same PSNR within 0.1
#               dB: until then rounding changes no decision that matters
#   files       the mean PSNR over the seeds is the same within 0.3 dB. With one
#               seed the files may differ by 0.4 dB, as files of two seeds do
#               (docs/lab/README.md)
# shellcheck disable=SC2034,SC2154,SC1091
set -u
cd "$(dirname "$0")/../.." || exit
saga=${SAGA:-${BUILD:-build}/saga}
double=$(dirname "$saga")/double
export OMP_NUM_THREADS=1

checks=double
. tests/cli/verdict.sh

"${MAKE:-make}" -s BUILD="$double" REAL=double "$double/saga" >"$tmp/make" 2>&1 ||
    complain "make REAL=double: $(tail -3 "$tmp/make")"
"$saga" synth "$tmp/scene" --size 96x54 --frames 4 --cameras 4 \
    >"$tmp/synth" 2>&1 || complain "synth fails"

# train PROGRAM NAME SEED: trains, and keeps the log and the report of `saga
# eval`.
train() {
    "$1" encode "$tmp/scene" -o "$tmp/$2.saga" --primitives 400 --preset fast \
        --iterations 300 --seed "$3" --log "$tmp/$2.$3.csv" >"$tmp/log" 2>&1 ||
        complain "$1: $(tail -1 "$tmp/log")"
    "$saga" eval "$tmp/$2.saga" "$tmp/scene" --json >"$tmp/$2.$3.json" \
        2>"$tmp/log" || complain "eval: $(tail -1 "$tmp/log")"
}
for seed in 1 2 3 4; do
    train "$saga" single $seed
    train "$double/saga" double $seed
done

# apart WHAT: prints double minus single for each seed, their mean, and the
# largest absolute difference.
apart() {
    python3 - "$tmp" "$1" <<'PYTHON'
import csv, json, sys

folder, what = sys.argv[1:]


def psnr(name, seed):
    with open(f"{folder}/{name}.{seed}." +
              ("csv" if what == "warm-up" else "json")) as f:
        if what == "files":
            return json.load(f)["training"]["psnr"]
        return [float(r["psnr"]) for r in csv.DictReader(f)
                if r["iteration"] == "100"][0]


d = [psnr("double", seed) - psnr("single", seed) for seed in range(1, 5)]
print(*(f"{x:+.4f}" for x in d), f"{sum(d) / 4:.4f}",
      f"{max(map(abs, d)):.4f}")
PYTHON
}
# within COLUMN DB WHAT: checks that a column printed by `apart` is within DB.
within() {
    apart "$3" >"$tmp/apart" 2>"$tmp/log" || complain "$(tail -1 "$tmp/log")"
    echo "     $3, dB, double less single, mean, largest: $(cat "$tmp/apart")"
    awk -v k="$1" -v most="$2" '{ d = $k < 0 ? -$k : $k }
        END { exit !(NR == 1 && d <= most) }' "$tmp/apart" ||
        complain "more than $2 dB apart"
    verdict "$3"
}
within 6 0.1 warm-up
within 5 0.3 files

all_passed
