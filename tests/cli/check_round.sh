#!/bin/bash
# SPDX-License-Identifier: MIT
#
# check_round.sh: guarantees, for build/saga (SAGA=...) and build/saga-dec
# (SAGA_DEC=...), with a tiny scene from the capture to the pictures:
#   round       the scene's capture is written, encoded, and drawn from the file
#               by the decoder; the pictures drawn resemble the capture
#   play        saga-play draws the pictures of saga-dec, with any number of
#               threads
set -u
build=${BUILD:-build}
saga=$(realpath "${SAGA:-$build/saga}")
saga_dec=$(realpath "${SAGA_DEC:-$build/saga-dec}")
saga_play=$(dirname "$saga_dec")/saga-play
checks=round
. "$(dirname "$0")/verdict.sh"
cd "$tmp" || exit

run() { # run PROGRAM ARGUMENTS...
    "$@" >out 2>err </dev/null || complain "$*: $(tail -n 1 err)"
}

run "$saga" synth cap --size 64x36 --cameras 4 --hold-out 1 --frames 4 \
    --points 300 --depth-every 0
run "$saga" check cap
run "$saga" encode cap -o x.saga --primitives 300 --iterations 300 --moving
run "$saga" info x.saga
run "$saga_dec" x.saga --camera rig:0 --time 1/2 -o x.ppm
[ "$(wc -c <x.ppm)" = $((13 + 3 * 64 * 36)) ] || complain "x.ppm: another size"
run "$saga" eval x.saga cap --json
python3 -c 'import json
r = json.load(open("out"))
assert r["training"]["psnr"] > 18, r["training"]' 2>>"$bad" ||
    complain "eval: $(head -c 300 out)"
verdict round

run "$saga_play" x.saga 1
cp out one
for threads in 2 5; do
    run "$saga_play" x.saga $threads
    cmp -s one out || complain "$threads threads draw other pictures than one"
done
run "$saga_play" --seconds 600 x.saga 2
cmp -s one out || complain "--seconds 600 changes pictures"
"$saga_play" --seconds 1e-9 x.saga >out 2>err && complain "--seconds 1e-9: 0"
grep -q "took more than 1e-09 s; allow more with --seconds" err ||
    complain "--seconds 1e-9: $(cat err)"
for frame in 0 3; do
    run "$saga_dec" x.saga --camera rig:0 --time $frame/1 --crc
    grep -qi "^$frame $(cat out)\$" one ||
        complain "picture $frame is not saga-dec's: $(cat out)"
done
verdict play

all_passed
