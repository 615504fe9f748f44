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
# NAME: only these targets are checked. `small` takes two: gcc's objects are
# those of the other tests, and Cortex-M0 leaves most to a library. Those of
# clang and Cortex-M3 are also linked without one, for browsers and as firmware.
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
    {
        $nm -o "$@"
        echo
        $size -A "$@"
    } | awk -v may="^($(allowed "$target"))\$" -v objects=$# '
        /^$/ { sizes = 1 }
        !sizes {
            object = $1
            sub(/:.*/, "", object)
            name = $NF
            type = $(NF - 1)
            if (type ~ /^[Uwv]$/ && NF == 3) {
                used[object ": undefined " name] = name
                next
            }
            if (type ~ /^[A-Zuvw]$/) {
                if (defined[name]++)
                    print name ": defined twice"
                if (name !~ /^saga_[A-Za-z0-9_]*$/)
                    print object ": " name " is not saga_"
            }
            if (type ~ /^[bBsSgGC]$/ && name !~ /^\$/)
                print object ": variable " name
        }
        sizes && $NF == ":" { object = $1; seen++ }
        sizes && $1 !~ /^\.data\.rel\.ro/ && $2 > 0 &&
            $1 ~ /^(\.(data|bss|tdata|tbss|sdata|sbss)(\..*)?|COMMON)$/ {
            print object ": " $1 " has " $2 " bytes" }
        END {
            for (u in used)
                if (!(used[u] in defined) && used[u] !~ may)
                    print u
            if (seen != objects)
                print seen + 0 " of " objects " objects can be read"
        }'
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
target cortex-m0 arm-none-eabi-gcc -Os "$thumb -mcpu=cortex-m0"
if [ "$what" = all ]; then
    target x86_64-clang clang -O2 ''
    target cortex-m3 arm-none-eabi-gcc -Os "$thumb -mcpu=cortex-m3"
    target x86_64-gcc-O0 gcc -O0 ''
    target x86_64-clang-O0 clang -O0 ''
    target cortex-m0-O2 arm-none-eabi-gcc -O2 "$thumb -mcpu=cortex-m0"
    target aarch64 aarch64-linux-gnu-gcc -O2 ''
    target rv32imc riscv64-unknown-elf-gcc -Os \
        "-march=rv32imc -mabi=ilp32 -misa-spec=2.2"
    target cortex-m4-O3 arm-none-eabi-gcc -O3 "$thumb -mcpu=cortex-m4"
fi
[ ! -e "$tmp/failed" ]
