#!/bin/sh
# SPDX-License-Identifier: MIT
#
# curve.sh CAPTURE FOLDER: a capture at four sizes, judged, as a page of curves.
# ITERATIONS: of each training (6000, which takes minutes). PRIMITIVES: of the
# files.
set -eu
capture=$1
folder=$2
saga=${SAGA:-saga}

mkdir -p "$folder"
: >"$folder/curve.json"
for n in ${PRIMITIVES:-2500 5000 10000 20000}; do
    "$saga" encode "$capture" -o "$folder/$n.saga" --primitives $n \
        --iterations "${ITERATIONS:-6000}"
    "$saga" eval "$folder/$n.saga" "$capture" --pictures "$folder/$n" --json \
        >>"$folder/curve.json"
done
"$saga" report "$folder/curve.json" -o "$folder/report.html"
