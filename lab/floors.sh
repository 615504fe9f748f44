#!/bin/bash
# SPDX-License-Identifier: MIT
#
# floors.sh SAGA FOLDER THREADS [OPTIONS]: compares the demo's file with simple
# alternatives (lab/floors_table.py has the goals). It runs after tools/demo.sh
# with the same arguments, except --moving. It trains the scene again with
# --still in FOLDER/still, sets the file's coarse features to zero (make_zeroed,
# next to SAGA), evaluates all three files and prints one table, which is kept
# in FOLDER/floors.txt. If it was stopped, the same command continues; a still
# file that is newer than the demo's is kept.
set -eu
saga=$1
demo=$2
threads=$3
shift 3
lab=$(dirname "$0")
zeroed=$(dirname "$saga")/make_zeroed
still=$demo/still

if [ ! -s "$demo/encode.json" ] || [ ! -f "$demo/demo.saga" ]; then
    echo "floors: $demo has no finished demo; \`make demo\` makes it" >&2
    exit 2
fi
if [ ! "$still/done" -nt "$demo/encode.json" ]; then
    mkdir -p "$still"
    ln -sfn ../capture "$still/capture"
    "$lab/../tools/demo.sh" "$saga" "$still" "$threads" "$@" --still
    touch "$still/done"
fi
"$zeroed" "$demo/demo.saga" "$demo/zeroed.saga"

# score FILE NAME: evaluates it into $demo/NAME.json.
score() {
    "$saga" eval "$1" "$demo/capture" --threads "$threads" --json \
        >"$demo/$2.json"
}
score "$demo/demo.saga" moving
score "$still/demo.saga" still
score "$demo/zeroed.saga" zeroed
echo
python3 "$lab/floors_table.py" "$demo/encode.json" "$demo/moving.json" \
    "$demo/still.json" "$demo/zeroed.json" >"$demo/floors.txt"
cat "$demo/floors.txt"
