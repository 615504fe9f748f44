#!/bin/bash
# SPDX-License-Identifier: MIT
#
# ablation.sh SAGA FOLDER RESULTS THREADS [NAME=FILE.saga ...]: measures how
# many bytes each part of the entropy model saves (lab/ablation_table.py has the
# tables). It trains the built-in scene at four rates in FOLDER, trains each
# file's entropy networks anew without one part after the other (make_refit,
# next to SAGA), evaluates and times them (make_times), compares the last rate's
# file and the named files with an order-0 coder (make_order0), and writes
# RESULTS/ablation.md and .svg. If it was stopped, the same command continues:
# results that are newer than their inputs are kept.
#
# It takes about 50 minutes of one core: 4 trainings of 3 minutes, 45 refits of
# 3,000 iterations and 20 to 30 s, 49 evaluations of 17 s. With half of the
# iterations, REFIT="--iterations 1500", it took 35 to 45 minutes.
#
# Then it trains the paper's whole model (`saga encode --model paper`), and the
# same without one part after the other, on each scene of PAPER,
# NAME:PRIMITIVES:WARM:RENDER. All rows of a scene continue from one warm-up of
# WARM iterations (make_paper). A row of room or ring takes 40 s. The scene
# "large" is the ring filmed by 12 cameras of 960x540 in 60 frames. Its pictures
# take 20 CPU minutes, its warm-up 9 and a row 6; it is left out if PAPER does
# not name it:
#
#     PAPER='room:2000:3600:4800 ring:2000:3600:4800 large:100000:3600:1000'
#
# Environment: LAMBDAS (the rates, the lowest first), TRAIN (more options of
# `saga encode`) and REFIT (of make_refit); for the paper's model PAPER,
# PAPER_SYNTH (options of `saga synth`) and PAPER_ROWS (ROW:FACTOR, as
# make_paper's).
set -euo pipefail
saga=$1
folder=$2
results=$3
threads=$4
shift 4
lab=$(dirname "$0")
bin=$(dirname "$saga")
capture=$folder/capture
read -ra lambdas <<<"${LAMBDAS:-1600 600 200 60}"
read -ra train <<<"${TRAIN:---primitives 5000 --iterations 6000}"
read -ra refit <<<"${REFIT:-}"
export OMP_NUM_THREADS=$threads

mkdir -p "$folder" "$results"
[ -d "$capture" ] || "$saga" synth "$capture" --threads "$threads"

# into FILE COMMAND...: writes the command's output to FILE when it is complete.
into() {
    local to=$1
    shift
    "$@" >"$to.part"
    mv "$to.part" "$to"
}

# score FILE NAME: evaluates FILE into NAME.eval.json.
score() {
    into "$2.eval.json" "$saga" eval "$1" "$capture" --threads "$threads" \
        --json
}

# variant FOLDER NAME OPTIONS...: refits FOLDER/in.saga and evaluates the
# result.
variant() {
    local at=$1 name=$1/$2
    shift 2
    if [ ! "$name.json" -nt "$at/in.saga" ]; then
        echo "  $name"
        into "$name.json" "$bin/make_refit" "$at/in.saga" "$name.saga" "$@" \
            "${refit[@]}"
    fi
    [ "$name.eval.json" -nt "$name.json" ] || score "$name.saga" "$name"
    [ "$name.times.json" -nt "$name.json" ] ||
        into "$name.times.json" "$bin/make_times" "$name.saga"
}

number=0
for lambda in "${lambdas[@]}"; do
    number=$((number + 1))
    at=$folder/r$number
    mkdir -p "$at"
    echo "rate $number: lambda $lambda"
    if [ -f "$at/in.saga.ckpt" ] || [ ! -f "$at/in.saga" ]; then
        resume=()
        [ ! -f "$at/in.saga.ckpt" ] || resume=(--resume)
        into "$at/encode.json" "$saga" encode "$capture" -o "$at/in.saga" \
            --lambda "$lambda" --threads "$threads" "${train[@]}" \
            "${resume[@]}" --json
    fi
    [ "$at/trained.eval.json" -nt "$at/in.saga" ] ||
        score "$at/in.saga" "$at/trained"
    variant "$at" full
    variant "$at" no-bank --ablate no-bank
    variant "$at" all --keep
    variant "$at" all-no-bank --keep --ablate no-bank
    variant "$at" all-plain --keep --ablate plain-update
    variant "$at" no-hyperprior --ablate no-hyperprior
    variant "$at" no-parent --ablate no-parent
    variant "$at" no-groups --ablate groups=1
    variant "$at" nothing --ablate no-bank,no-hyperprior,no-parent,groups=1
    variant "$at" raw --ablate raw-networks
done
# The sizes of the memory bank are tried at the last rate only, where the most
# symbols share the cost of its networks.
for slots in 32 64 128 256 512; do
    variant "$at" "slots$slots" --keep --ablate "slots=$slots"
done

# --- The paper's model

# Options of `saga synth` for a scene of PAPER.
synth_of() {
    case $1 in
    large) echo --scene ring --size 960x540 --cameras 12 --frames 60 ;;
    *) echo --scene "$1" "${PAPER_SYNTH:---size 160x90}" ;;
    esac
}

# Each row at some prices, in units of that which `saga encode` would choose. At
# the same price flat files are better and larger, so theirs are higher.
factors="4 0.25"
rows=${PAPER_ROWS:-$(
    for row in full nearest no-hash raw-networks plain-update no-bank no-fuse \
        slots=32 slots=128 slots=256 slots=512; do
        printf "$row:%s " $factors
    done
    printf "flat:%s " 64 32 8 4
)}
mkdir -p "$folder/paper"
for scene in ${PAPER:-room:2000:3600:4800 ring:2000:3600:4800}; do
    IFS=: read -r name primitives warm render <<<"$scene"
    at=$folder/paper/$name
    # shellcheck disable=SC2046
    [ -d "$at" ] || "$saga" synth "$at" --threads "$threads" $(synth_of "$name")
    # Rows that an earlier run finished are kept.
    missing=$(for row in $rows; do
        grep -qs "\"row\": \"${row%:*}\", \"factor\": ${row#*:}," "$at.json" ||
            echo "$row"
    done)
    # shellcheck disable=SC2086
    [ -z "$missing" ] || OMP_NUM_THREADS=1 "$bin/make_paper" "$at" \
        "$primitives" "$warm" "$render" "$threads" $missing >>"$at.json"
done

reports=()
for scene in "built-in=$folder/r$number/full.saga" "$@"; do
    report=$folder/order0.${scene%%=*}.json
    into "$report" "$bin/make_order0" "${scene#*=}"
    reports+=("${scene%%=*}=$report")
done
into "$results/ablation.md" python3 "$lab/ablation_table.py" "$folder" \
    "${reports[@]}"
if command -v gnuplot >/dev/null; then
    gnuplot -e "folder='$folder'; out='$results/ablation.svg'" \
        "$lab/ablation.gp"
else
    echo "ablation: no gnuplot, so no ablation.svg" >&2
fi
echo "$results/ablation.md"
