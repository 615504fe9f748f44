#!/bin/sh
# SPDX-License-Identifier: MIT
#
# check_symbols.sh [small|all] [NAME...]: guarantees, for the objects of common/
# and decoder/ of several compilers and machines,
#   undefined   they use only symbols that they define themselves, or that the
#               allow list of the machine has: mem*; on Cortex-M0 and rv32 also
#               the 64-bit shifts and product of the compiler's own library
#   defined     every global symbol begins with saga_, and is defined once
#   memory      .data, .bss, .tdata and .tbss are empty
# Constant tables of pointers (.data.rel.ro) are read-only and allowed.
# NAME: only these targets are checked.
#
# check_symbols.sh --objects TARGET FILE.o...: checks the given objects.
set -eu

nm=nm
size=size
mem='memcpy|memmove|memset|memcmp'

allowed() {
    case $1 in
    cortex-m0*) echo "$mem|__aeabi_lmul|__aeabi_llsl|__aeabi_llsr|__aeabi_lasr" ;;
    rv32*) echo "$mem|__ashldi3|__ashrdi3|__lshrdi3" ;;
    *) echo "$mem" ;;
    esac
}

# examine TARGET FILE.o...: prints messages about objects, or nothing if they
# are as required.
examine() {
    target=$1
    shift
    $nm -g --defined-only -o "$@" >"$tmp/defined"
    sed 's/.* //' "$tmp/defined" | sort -u >"$tmp/names"
    sed 's/.* //' "$tmp/defined" | sort | uniq -d | sed 's/$/: defined twice/'
    grep -v ' saga_[A-Za-z0-9_]*$' "$tmp/defined" |
        sed 's/^\(.*\):[0-9a-f]* *[A-Za-z] \(.*\)$/\1: \2 is not saga_/' || :
    $nm -u -o "$@" >"$tmp/undefined"
    sed 's/^\(.*\): *[A-Za-z] \(.*\)$/\1 \2/' "$tmp/undefined" |
        while read -r object symbol; do
            grep -qx "$symbol" "$tmp/names" ||
                echo "$symbol" | grep -Eqx "$(allowed "$target")" ||
                echo "$object: undefined $symbol"
        done
    for o in "$@"; do
        $size -A "$o" | awk -v o="$o" '
            $1 ~ /^\.data\.rel\.ro/ { next }
            $1 ~ /^\.(data|bss|tdata|tbss|sdata|sbss)(\.|$)/ && $2 > 0 {
                print o ": " $1 " has " $2 " bytes" }
            $1 == "COMMON" && $2 > 0 { print o ": COMMON" }'
        $nm "$o" | awk -v o="$o" '
            $2 ~ /^[dDbBsSgGC]$/ && $3 !~ /^\$/ { d[$3] = $2 }
            END { for (s in d) if (d[s] != "d" && d[s] != "D")
                      print o ": variable " s }'
    done
}

tmp=$(mktemp -d)
trap 'rm -rf "$tmp"' EXIT

if [ "${1:-}" = --objects ]; then
    target=$2
    shift 2
    examine "$target" "$@" >"$tmp/bad"
    cat "$tmp/bad"
    [ ! -s "$tmp/bad" ]
    exit
fi

cd "$(dirname "$0")/.."
what=${1:-small}
[ $# = 0 ] || shift
only=" $* "
make=${MAKE:-make}
build=${BUILD:-build}/symbols
unset MAKEFLAGS MFLAGS

# target NAME CC OPT CFLAGS: compiles the objects for a target and examines
# them.
target() {
    case $only in
    "  " | *" $1 "*) ;;
    *) return ;;
    esac
    if ! command -v "$2" >/dev/null; then
        echo "FAIL symbols $1: no $2"
        : >"$tmp/failed"
        return
    fi
    folder=$build/$1
    werror=
    if [ "$1" = x86_64-gcc ]; then # run_tests.sh builds the same objects
        folder=${BUILD:-build}/gcc
        werror=-Werror
    fi
    if ! "$make" -s -j"$(nproc)" BUILD="$folder" CC="$2" OPT="$3" \
        CFLAGS="$4" WERROR="$werror" lib >"$tmp/log" 2>&1; then
        cat "$tmp/log"
        echo "FAIL symbols $1: does not build"
        : >"$tmp/failed"
        return
    fi
    nm=nm
    size=size
    case $2 in
    *-gcc)
        nm=${2%-gcc}-nm
        size=${2%-gcc}-size
        ;;
    esac
    set -- "$1" $(find common decoder -name '*.c' | sort |
        sed "s|^\(.*\)\.c\$|$folder/obj/\1.o|")
    examine "$@" >"$tmp/bad"
    name=$1
    shift
    if [ -s "$tmp/bad" ]; then
        sed 's/^/     /' "$tmp/bad"
        echo "FAIL symbols $name"
        : >"$tmp/failed"
    else
        echo "ok   symbols $name: $# objects," \
            "$($size "$@" | awk '{ s += $1 } END { print s }') bytes" \
            "of code and constants"
    fi
}

thumb="-mthumb -mfloat-abi=soft"
target x86_64-gcc gcc -O2 ''
target x86_64-clang clang -O2 ''
target cortex-m0 arm-none-eabi-gcc -Os "$thumb -mcpu=cortex-m0"
target cortex-m3 arm-none-eabi-gcc -Os "$thumb -mcpu=cortex-m3"
if [ "$what" = all ]; then
    target x86_64-gcc-O0 gcc -O0 ''
    target x86_64-clang-O0 clang -O0 ''
    target cortex-m0-O2 arm-none-eabi-gcc -O2 "$thumb -mcpu=cortex-m0"
    target aarch64 aarch64-linux-gnu-gcc -O2 ''
    target rv32imc riscv64-unknown-elf-gcc -Os \
        "-march=rv32imc -mabi=ilp32 -misa-spec=2.2"
    target cortex-m4-O3 arm-none-eabi-gcc -O3 "$thumb -mcpu=cortex-m4"
fi
[ ! -e "$tmp/failed" ]
