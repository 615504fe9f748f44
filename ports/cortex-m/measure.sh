#!/bin/sh
# SPDX-License-Identifier: MIT
#
# measure.sh FOLDER: trains a level 0 file of the built-in scene (about 20 s of
# CPU), builds the firmware for every board and optimisation, runs it in QEMU,
# and prints the tables of docs/results/embedded.md. All results, picture.ppm
# among them, are kept in FOLDER. SAGA names the program.
set -eu
cd "$(dirname "$0")/../.."

out=${1:?usage: measure.sh FOLDER}
here=ports/cortex-m
saga=${SAGA:-build/saga}

mkdir -p "$out"
[ -e "$out/capture" ] ||
    "$saga" synth "$out/capture" --size 160x120 >"$out/log" 2>&1
[ -e "$out/scene.saga" ] ||
    "$saga" encode "$out/capture" -o "$out/scene.saga" --level 0 \
        --primitives 512 --iterations 3000 --lambda 0.02 >"$out/log" 2>&1

# The streams are the vectors of level 0, then the trained scene.
set --
for f in vectors/good/*.saga; do
    [ "$(od -An -tu1 -j12 -N1 "$f" | tr -d ' ')" != 0 ] || set -- "$@" "$f"
done

# run BOARD OPT CFLAGS STREAM...: runs the firmware and writes its output to
# FOLDER/BOARD-OPT.txt.
run() {
    board=$1 opt=$2 cflags=$3 name=$1$2
    shift 3
    OPT=$opt CFLAGS=$cflags $here/build.sh "$board" "$out/$name" "$@" \
        "$out/scene.saga" >"$out/command.txt"
    command=$(tail -n 1 "$out/command.txt")
    $command,arg=x,arg="$out/picture.ppm" >"$out/$name.txt" 2>&1 </dev/null
}

# code NAME: prints the bytes of the decoder's objects, and of all code and
# constants.
code() {
    arm-none-eabi-size "$out/$1"/*.o | awk '
        $NF !~ /(boot|semihost|firmware|streams)\.o$|filename/ { s += $1 }
        END { printf "%d ", s }'
    arm-none-eabi-size -A "$out/$1/firmware.elf" |
        awk '$1 == ".text" || $1 == ".rodata" { s += $2 } END { print s }'
}

# numbers NAME: prints a line for each file: name, bytes, coarse, fine,
# primitives, work, scratch, strip, stack, MACs, then the instructions to open,
# to decode, and the means over two pictures to make a view and to draw it.
numbers() {
    awk '
    function value(key,   i) {
        for (i = 2; i < NF; i++) if ($i == key) return $(i + 1)
    }
    function flush() {
        if (name) row[++n] = name " " bytes " " made
        if (name) tail[n] = macs " " open * per " " decode * per " " \
            view * per / 2 " " draw * per / 2
    }
    /^# timer/ { per = value("instructions") / value("ticks") }
    /^# file/ {
        flush()
        name = $3; bytes = $4; work = value("work")
        macs = value("macs"); open = value("open"); view = draw = 0
    }
    /^# segment/ {
        decode = value("decode")
        made = value("coarse") " " value("fine") " " value("primitives") " " \
            work
    }
    /^# picture/ { view += value("view"); draw += value("draw") }
    /^# memory/ {
        flush()
        for (i = 1; i <= n; i++)
            print row[i], value("scratch"), value("strip"), value("stack"), \
                tail[i]
    }' "$out/$1.txt"
}

for b in mps2-an385 mps2-an386 mps3-an547; do
    run $b -Os "" "$@"
done
run mps2-an385 -O2 "" "$@"
run mps3-an547 -O2 "" "$@"
run mps3-an547 -O3 -mfloat-abi=hard "$@"

echo "| file | bytes | coarse, fine, primitives | work | RAM | million" \
    "products | open | segment | view | draw |"
echo "|---|---|---|---|---|---|---|---|---|---|"
numbers mps2-an385-Os | awk '{
    sub(/.*\//, "", $1)
    printf "| %s | %d | %d, %d, %d | %d | %d | %.2f | %.1f | %.1f | %.1f | %.1f |\n",
        $1, $2, $3, $4, $5, $6, $6 + $7 + $8 + $9, $10 / 1e6, $11 / 1e6,
        $12 / 1e6, $13 / 1e6, $14 / 1e6 }'
echo
echo "| board | core | build | decoder | firmware | stack | open | segment |" \
    "view | draw |"
echo "|---|---|---|---|---|---|---|---|---|---|"
for name in mps2-an385-Os mps2-an386-Os mps3-an547-Os mps2-an385-O2 \
    mps3-an547-O2 mps3-an547-O3; do
    case $name in
    mps2-an385*) core=Cortex-M3 ;;
    mps2-an386*) core=Cortex-M4 ;;
    *-O3) core="Cortex-M55, MVE" ;;
    *) core=Cortex-M55 ;;
    esac
    numbers "$name" | tail -n 1 | awk -v board="${name%-*}" -v core="$core" \
        -v build="-${name##*-}" -v code="$(code "$name")" '{
        split(code, c, " ")
        printf "| %s | %s | `%s` | %d | %d | %d | %.1f | %.1f | %.1f | %.1f |\n",
            board, core, build, c[1], c[2], $9, $11 / 1e6, $12 / 1e6,
            $13 / 1e6, $14 / 1e6 }'
done
