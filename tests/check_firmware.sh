#!/bin/bash
# SPDX-License-Identifier: MIT
#
# check_firmware.sh [small|all] [BOARD...]: guarantees, for the firmware of
# ports/cortex-m on boards that QEMU emulates (mps2-an385, mps2-an386,
# mps3-an547, or those named; `small` leaves the second out),
#   size     code and constants take at most 50 KiB, the stack 4 KiB, and all
#            RAM 256 KiB (otherwise linking fails)
#   vectors  every level 0 stream gives the checksums of vectors/MANIFEST
#   scene    the pictures of a trained file are those of saga-dec
# SAGA and SAGA_DEC are the programs. Without the compiler or the emulator it
# prints that it is skipped.
set -u
cd "$(dirname "$0")/.." || exit

build=${BUILD:-build}/firmware
saga=${SAGA:-build/saga}
dec=${SAGA_DEC:-build/saga-dec}
scene=$build/scene.saga
for p in arm-none-eabi-gcc qemu-system-arm; do
    command -v $p >/dev/null || {
        echo "ok   firmware skipped: $p is not installed"
        exit 0
    }
done
code_most=51200
stack_most=4096
tmp=$(mktemp -d)
trap 'rm -rf "$tmp"' EXIT
failed=0
fail() {
    failed=1
    echo "FAIL firmware $1"
}

# These are the lines that the firmware must print, one for each picture.
streams=()
for f in vectors/good/*.saga; do
    [ "$(od -An -tu1 -j12 -N1 "$f" | tr -d ' ')" = 0 ] && streams+=("$f")
done
# The firmware draws the two pictures that every stream has.
for f in "${streams[@]}"; do
    grep "^${f#vectors/} " vectors/MANIFEST | cut -d' ' -f1,2,4- |
        awk '$6 == 0 && $7 == 0 || $6 == 40000 && $7 == 1'
done | sort >"$tmp/wanted"
[ -s "$tmp/wanted" ] || fail "vectors: no level 0 stream in vectors/good"

# A short training of the built-in scene. It has 4 frames: t = 40000 is frame
# 40000 * 4 / 65536.
mkdir -p "$build"
"$saga" synth "$tmp/capture" --size 160x120 --cameras 3 --hold-out 0 \
    --frames 4 --samples 1 --depth-every 0 >"$tmp/log" 2>&1 </dev/null &&
    "$saga" encode "$tmp/capture" -o "$scene" --level 0 --primitives 400 \
        --iterations 100 --moving --threads 1 >>"$tmp/log" 2>&1 </dev/null ||
    { cat "$tmp/log"; fail "scene: cannot be made"; }
"$dec" "$scene" --camera rig:0 --crc >"$tmp/frames" &&
    "$dec" "$scene" --camera rig:1 --time 625/256 --crc >>"$tmp/frames" ||
    fail "scene: saga-dec refuses it"

size_of() { # size_of SECTION ELF
    arm-none-eabi-size -A "$2" | awk -v s="$1" '$1 == s { print $2 }'
}

board() {
    local out=$build/$1 code stack
    if ! ports/cortex-m/build.sh "$1" "$out" "${streams[@]}" "$scene" \
        >"$tmp/log" 2>&1; then
        cat "$tmp/log"
        fail "$1: does not build"
        return
    fi
    # shellcheck disable=SC2046
    if ! timeout "${TIMEOUT:-120}" $(tail -n 1 "$tmp/log") >"$tmp/said" 2>&1 \
        </dev/null; then
        tail -n 5 "$tmp/said"
        fail "$1: does not run to its end"
        return
    fi
    grep '^good/' "$tmp/said" | sort >"$tmp/vectors"
    if ! diff "$tmp/wanted" "$tmp/vectors"; then
        fail "$1: not what vectors/MANIFEST says"
    else
        echo "ok   firmware $1: $(wc -l <"$tmp/wanted") pictures of" \
            "${#streams[@]} vectors"
    fi
    if ! grep "^$scene " "$tmp/said" | awk '{ print $NF }' |
        diff "$tmp/frames" -; then
        fail "$1: not what saga-dec draws of the scene"
    else
        echo "ok   firmware $1: $(wc -l <"$tmp/frames") pictures of a scene"
    fi
    code=$(($(size_of .text "$out/firmware.elf") +
        $(size_of .rodata "$out/firmware.elf")))
    stack=$(sed -n 's/^# memory.* stack //p' "$tmp/said")
    if [ "$code" -gt $code_most ] || [ "${stack:-9999}" -gt $stack_most ]; then
        fail "$1: $code bytes of code, $stack of stack"
    else
        echo "ok   firmware $1: $code bytes of code, $stack of stack"
    fi
}

all='mps2-an385 mps2-an386 mps3-an547'
case ${1:-} in
small) # without the M4, between the two others
    all='mps2-an385 mps3-an547'
    shift
    ;;
all) shift ;;
esac
boards=${*:-$all}
for b in $boards; do
    board "$b"
done
exit $failed
