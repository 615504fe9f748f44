#!/bin/sh
# SPDX-License-Identifier: MIT
#
# build.sh BOARD FOLDER [STREAM...]: builds FOLDER/firmware.elf for a board of
# QEMU: mps2-an385 (Cortex-M3), mps2-an386 (M4) or mps3-an547 (M55). The
# streams, by default those of level 0 in vectors/good, go into its flash. OPT
# has the optimisation options (default -Os and some below), CC the compiler.
# The script prints how to run the firmware.
set -eu
cd "$(dirname "$0")/../.."

fail() {
    echo "build.sh: $1" >&2
    exit 2
}

[ $# -ge 2 ] || fail "usage: build.sh BOARD FOLDER [STREAM...]"
board=$1
out=$2
shift 2
case $board in
mps2-an385) cpu=cortex-m3 ;;
mps2-an386) cpu=cortex-m4 ;;
mps3-an547) cpu=cortex-m55 ;;
*) fail "$board: not a board it knows" ;;
esac
cc=${CC:-arm-none-eabi-gcc}
command -v "$cc" >/dev/null || fail "no $cc; apt-get install gcc-arm-none-eabi"

# A file's level is its 13th byte.
if [ $# = 0 ]; then
    for f in vectors/good/*.saga; do
        [ "$(od -An -tu1 -j12 -N1 "$f" | tr -d ' ')" != 0 ] || set -- "$@" "$f"
    done
fi

# The streams go into flash unchanged, and have their names in vectors/MANIFEST.
mkdir -p "$out"
i=0
{
    echo '.section .streams, "a"'
    for f; do
        [ -s "$f" ] || fail "$f: not there, or empty"
        echo "name$i: .asciz \"${f#vectors/}\""
        echo ".balign 4"
        echo "stream$i: .incbin \"$f\""
        echo "end$i:"
        i=$((i + 1))
    done
    echo '.section .rodata, "a"'
    echo '.balign 4'
    echo '.global streams'
    echo 'streams:'
    k=0
    while [ $k -lt $i ]; do
        echo ".word name$k, stream$k, end$k"
        k=$((k + 1))
    done
    echo '.word 0, 0, 0'
} >"$out/streams.s"

# The three -fno options make the code 1.5 % smaller: constants that are kept in
# registers through a loop must be saved around it, and reordered instructions
# need longer encodings.
flags="-std=c11 -ffreestanding -mthumb -mcpu=$cpu
    ${OPT:--Os -fno-move-loop-invariants -fno-tree-loop-im
        -fno-schedule-insns2}
    -ffunction-sections -fdata-sections ${CFLAGS:-}
    -Wall -Wextra -Wconversion -Wshadow -Wundef -Wcast-align
    -Wstrict-prototypes -Wmissing-prototypes -Wvla"
here=ports/cortex-m
# shellcheck disable=SC2086
{
    mkdir -p "$out/include"
    cp decoder/saga.h "$out/include"
    (cd "$out" && "$cc" $flags -I"$OLDPWD/common" -I"$OLDPWD/decoder" -c \
        "$OLDPWD"/common/*.c "$OLDPWD"/decoder/*.c)
    (cd "$out" && "$cc" $flags -Werror -Iinclude -fno-builtin \
        -fno-tree-loop-distribute-patterns -c "$OLDPWD/$here"/*.c)
    "$cc" -mcpu=$cpu -c "$out/streams.s" -o "$out/streams.o"
    "$cc" -nostdlib -mthumb -mcpu=$cpu -T $here/firmware.ld -Wl,--gc-sections \
        -Wl,-Map="$out/firmware.map" "$out"/*.o -o "$out/firmware.elf"
}
echo "qemu-system-arm -M $board -display none -serial none -monitor none" \
    "-icount shift=0 -kernel $out/firmware.elf" \
    "-semihosting-config enable=on,target=native"
