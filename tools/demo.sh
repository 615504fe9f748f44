#!/bin/bash
# SPDX-License-Identifier: MIT
#
# demo.sh SAGA FOLDER THREADS [OPTIONS]: renders the built-in scene as a
# capture, encodes it, evaluates the file, and draws pictures next to the filmed
# ones. If it was stopped, the same command continues. OPTIONS go to `saga
# encode`.
set -euo pipefail
saga=$1
demo=$2
threads=$3
shift 3

mkdir -p "$demo"
capture=$demo/capture
file=$demo/demo.saga
if [ ! -d "$capture" ]; then
    "$saga" synth "$capture" --threads "$threads"
fi
# A finished file that is newer than the program is not made again.
if [ -f "$file.ckpt" ] || [ ! "$file" -nt "$saga" ]; then
    echo "encoding; after Ctrl-C, the same command continues from a checkpoint"
    resume=()
    [ ! -f "$file.ckpt" ] || resume=(--resume)
    "$saga" encode "$capture" -o "$file" --primitives 3000 \
        --iterations 18000 --threads "$threads" "${resume[@]}" "$@" \
        --json >"$demo/encode.json"
fi
"$saga" eval "$file" "$capture" --threads "$threads" \
    --pictures "$demo/pictures" | tee "$demo/table.txt"
echo
echo "$file: the scene; \`saga render\` draws any view of it"
echo "$demo/encode.json: results of the training, and bits of each part"
echo "$demo/pictures: filmed, decoded, and 4 times the difference, for each camera"
# In a pipe, `times` would report the CPU time of a subshell.
times >"$demo/times.txt"
echo "CPU time of all: $(awk 'NR == 2 { print $1 }' "$demo/times.txt")"
