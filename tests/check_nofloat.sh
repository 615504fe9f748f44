#!/bin/sh
# SPDX-License-Identifier: MIT
#
# check_nofloat.sh [small|all] [NAME...]: guarantees that common/ and decoder/
# use no floating point:
#   source   no float, double or floating constant is outside of comments
#   objects  they compile with -mgeneral-regs-only on x86-64 and AArch64, and
#            call no float routine there or on soft-float Arm
# NAME: only the objects of these targets are checked. `small` leaves clang and
# Cortex-M3 out, as no source has a float that the others would not see.
set -eu
cd "$(dirname "$0")/.."

make=${MAKE:-make}
what=all
case ${1:-} in small | all) what=$1 && shift ;; esac
only=" $* "
build=${BUILD:-build}
unset MAKEFLAGS MFLAGS
tmp=$(mktemp -d)
trap 'rm -rf "$tmp"' EXIT

# Comments, strings and characters are blanked before the search.
source_check() {
    find common decoder -name '*.[ch]' | sort | python3 -c '
import re, sys
code = re.compile(
    r"/\*.*?\*/|//[^\n]*|\"(\\.|[^\"\\\n])*\"|\x27(\\.|[^\x27\\\n])*\x27", re.S)
token = re.compile(
    r"(?<![A-Za-z0-9_])(float|double|_Complex|__fp16|_Float[0-9]+|__float[0-9]+"
    r"|(math|float|complex|tgmath)\.h|[0-9]+\.[0-9]*|\.[0-9]+"
    r"|[0-9]+[eE][-+]?[0-9]+|0[xX][0-9a-fA-F]+[pP][-+]?[0-9]+)"
    r"([fFlL]?)(?![A-Za-z0-9_])")
for name in sys.stdin.read().split():
    with open(name, encoding="utf-8") as f:
        text = code.sub(lambda m: re.sub(r"[^\n]", " ", m.group()), f.read())
    for n, line in enumerate(text.split("\n"), 1):
        if token.search(line):
            print("     %s:%d:%s" % (name, n, line))' >"$tmp/bad"
    if [ -s "$tmp/bad" ]; then
        cat "$tmp/bad"
        echo "FAIL nofloat source"
        : >"$tmp/failed"
    else
        echo "ok   nofloat source"
    fi
}
[ $# != 0 ] || source_check

# The float routines of libgcc, of the Arm run-time ABI, and of libm.
routine='__(add|sub|mul|div|neg|eq|ne|lt|le|gt|ge|cmp|unord|pow)[sdtx]f[23]'
routine="$routine|__(float|fix)(un)?[sdt]i[sdtx]f|__fix(uns)?[sdtx]f[sdt]i"
routine="$routine|__(extend|trunc)[sdtxh]f[sdtxh]f2"
routine="$routine|__aeabi_[cfd][a-z0-9]*|__aeabi_[iu]?[il]?2[fd]|__aeabi_u?[il]2[fd]"
routine="$routine|__gnu_[fhd]2[fhd].*|(ll?r(int|ound)|sqrt|exp2?|log2?|sin|cos|pow|fabs|floor|ceil)f?"

target() { # target NAME CC NM FOLDER OPT FLAGS
    case $only in
    "  " | *" $1 "*) ;;
    *) return ;;
    esac
    folder=$build/$4/$1
    if ! "$make" -s -k -j"$(nproc)" BUILD="$folder" CC="$2" OPT="$5" \
        CFLAGS="$6" lib >"$tmp/log" 2>&1; then
        cat "$tmp/log"
        echo "FAIL nofloat $1: does not build"
        : >"$tmp/failed"
        return
    fi
    find common decoder -name '*.c' | sort |
        sed "s|^\(.*\)\.c\$|$folder/obj/\1.o|" >"$tmp/objects"
    if ! xargs "$3" -u -o <"$tmp/objects" >"$tmp/undefined"; then
        echo "FAIL nofloat $1: $3 cannot read the objects"
        : >"$tmp/failed"
        return
    fi
    grep -E " ($routine)\$" "$tmp/undefined" >"$tmp/bad" || :
    if [ -s "$tmp/bad" ]; then
        sed 's/^/     /' "$tmp/bad"
        echo "FAIL nofloat $1"
        : >"$tmp/failed"
    else
        echo "ok   nofloat $1"
    fi
}

target x86_64 gcc nm nofloat -O2 -mgeneral-regs-only
if [ "$what" = all ]; then
    target x86_64-clang clang nm nofloat -O2 -mgeneral-regs-only
    target aarch64-clang clang nm nofloat -O2 \
        '--target=aarch64-none-elf -mgeneral-regs-only'
fi
if command -v aarch64-linux-gnu-gcc >/dev/null; then
    target aarch64-gcc aarch64-linux-gnu-gcc aarch64-linux-gnu-nm nofloat -O2 \
        -mgeneral-regs-only
fi
# check_symbols.sh builds the same objects.
for cpu in cortex-m0 $([ "$what" = small ] || echo cortex-m3); do
    target "$cpu" arm-none-eabi-gcc arm-none-eabi-nm symbols -Os \
        "-mthumb -mfloat-abi=soft -mcpu=$cpu"
done
[ ! -e "$tmp/failed" ]
