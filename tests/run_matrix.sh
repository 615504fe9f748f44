#!/bin/bash
# SPDX-License-Identifier: MIT
#
# run_matrix.sh [small|all] [NAME...]: guarantees that every machine and
# compiler decodes to the same bits.
# Builds tests/stream/check_vectors.c with each compiler, optimisation and
# machine of the table and runs it, under qemu or Wine if needed: it must find
# no mismatch with vectors/MANIFEST, and make as many comparisons as the tests'
# build with gcc or the first row. It prints one line "ok" or "FAIL" for each
# row. NAME: only the rows with these names.
set -u
cd "$(dirname "$0")/.."

what=${1:-small}
[ $# = 0 ] || shift
only=" $* "
vectors=${VECTORS:-vectors}
make=${MAKE:-make}
build=${BUILD:-build}/matrix
jobs=$(nproc 2>/dev/null || echo 2)
timeout=${TIMEOUT:-900}
unset MAKEFLAGS MFLAGS
export UBSAN_OPTIONS=print_stacktrace=1

# size name                | compiler | emulator | OPT | make variables
# (| stands for a blank in a variable; STATIC: LDFLAGS=-static; AVX2: emulated
# where the machine has none; PATTERN, ZERO: what variables begin with; MEMORY:
# MemorySanitizer; plain, x4: the path instead of the best one)
table='
all gcc-O0                 | gcc   | | -O0 |
all gcc-O3                 | gcc   | | -O3 |
all clang-O0-zero          | clang | | -O0 | ZERO
all clang-O3               | clang | | -O3 |
all gcc-O3-avx2            | gcc   | | -O3 | AVX2
all gcc-O1-pattern         | gcc   | | -O1 | PATTERN
small s390x-gcc-O2         | s390x-linux-gnu-gcc | s390x | -O2 | STATIC
all gcc-O2-sanitize        | gcc   | | -O2 | SANITIZE=1
all clang-O0               | clang | | -O0 |
all gcc-O1-pattern-plain   | gcc   | | -O1 | PATTERN plain
all gcc-O1-pattern-x4      | gcc   | | -O1 | PATTERN x4
all gcc-O1-zero            | gcc   | | -O1 | ZERO
all gcc-O1-zero-plain      | gcc   | | -O1 | ZERO plain
all gcc-O1-zero-x4         | gcc   | | -O1 | ZERO x4
all clang-O1-pattern       | clang | | -O1 | PATTERN
all clang-O1-pattern-plain | clang | | -O1 | PATTERN plain
all clang-O1-pattern-x4    | clang | | -O1 | PATTERN x4
all clang-O1-zero-plain    | clang | | -O1 | ZERO plain
all clang-O1-zero-x4       | clang | | -O1 | ZERO x4
all clang-O2-memory        | clang | | -O2 | MEMORY
all clang-O2-memory-plain  | clang | | -O2 | MEMORY plain
all clang-O2-memory-x4     | clang | | -O2 | MEMORY x4
all gcc-Os                 | gcc   | | -Os |
all gcc-O3-native          | gcc   | | -O3 | CFLAGS=-march=native
all gcc-O2-unsigned-char   | gcc   | | -O2 | CFLAGS=-funsigned-char
all clang-O1-sanitize      | clang | | -O1 | SANITIZE=1
all clang-O3-avx2          | clang | | -O3 | AVX2
all clang-O2-unsigned-char | clang | | -O2 | CFLAGS=-funsigned-char
all s390x-gcc-O0           | s390x-linux-gnu-gcc | s390x | -O0 | STATIC
all s390x-gcc-O3           | s390x-linux-gnu-gcc | s390x | -O3 | STATIC
all s390x-gcc-O2-ubsan     | s390x-linux-gnu-gcc | s390x | -O2 | STATIC CFLAGS=-fsanitize=undefined|-fsanitize-undefined-trap-on-error|-DSAGA_CHECK
all s390x-clang-O3         | clang | s390x | -O3 | STATIC CFLAGS=--target=s390x-linux-gnu|-isystem|/usr/s390x-linux-gnu/include
all aarch64-gcc-O2         | aarch64-linux-gnu-gcc | aarch64 | -O2 | STATIC
all aarch64-gcc-O3         | aarch64-linux-gnu-gcc | aarch64 | -O3 | STATIC
all aarch64-clang-O3       | clang | aarch64 | -O3 | STATIC CFLAGS=--target=aarch64-linux-gnu|-isystem|/usr/aarch64-linux-gnu/include
all armv7-gcc-O2-arm       | arm-linux-gnueabihf-gcc | arm | -O2 | STATIC CFLAGS=-marm
all armv7-gcc-Os-thumb     | arm-linux-gnueabihf-gcc | arm | -Os | STATIC CFLAGS=-mthumb
all armv7-gcc-O3-neon      | arm-linux-gnueabihf-gcc | arm | -O3 | STATIC CFLAGS=-mthumb|-mfpu=neon
all armv7-gcc-O2-signed    | arm-linux-gnueabihf-gcc | arm | -O2 | STATIC CFLAGS=-mthumb|-fsigned-char
all riscv64-gcc-O2         | riscv64-linux-gnu-gcc | riscv64 | -O2 | STATIC
all riscv64-gcc-O3         | riscv64-linux-gnu-gcc | riscv64 | -O3 | STATIC
all i686-gcc-O2            | i686-linux-gnu-gcc | i386 | -O2 | STATIC
all i686-gcc-O3-x87        | i686-linux-gnu-gcc | i386 | -O3 | STATIC CFLAGS=-mno-sse
all powerpc-gcc-O2         | powerpc-linux-gnu-gcc | ppc | -O2 | STATIC
all powerpc-gcc-O3         | powerpc-linux-gnu-gcc | ppc | -O3 | STATIC
all mips-gcc-O2            | mips-linux-gnu-gcc | mips | -O2 | STATIC
all windows-gcc-O2         | x86_64-w64-mingw32-gcc | wine | -O2 | STATIC
all windows-gcc-O3-x4      | x86_64-w64-mingw32-gcc | wine | -O3 | STATIC x4
'

# begins COMPILER INIT: prints the flag that sets the initial value of
# variables. clang 14 needs a second flag for zeros.
begins() {
    local flag=-ftrivial-auto-var-init=$2

    "$1" "$flag" -fsyntax-only -x c /dev/null 2>/dev/null || flag="$flag \
-enable-trivial-auto-var-init-zero-knowing-it-will-be-removed-from-clang"
    echo "$flag"
}

trim() { sed 's/^ *//; s/ *$//'; }
failed=0
# run_tests.sh has checked the vectors with gcc.
expected=$(tail -n 1 "${BUILD:-build}/gcc/vectors.txt" 2>/dev/null)
fail() {
    failed=1
    echo "FAIL matrix $1: $2"
}

# row NAME COMPILER EMULATOR OPT VARIABLES: builds and runs a row of the table.
row() {
    local name=$1 cc=$2 qemu=$3 opt=$4 v args=() run=() path=() out exe=
    local start=$SECONDS
    local dir=$build/$name
    args=(BUILD="$dir" CC="$cc" OPT="$opt" OPENMP=)
    for v in $5; do
        case $v in
        STATIC) args+=(LDFLAGS=-static) ;;
        PATTERN | ZERO) args+=(CFLAGS="$(begins "$cc" "${v,,}")") ;;
        MEMORY) args+=(CFLAGS=-fsanitize=memory) ;;
        plain | x4) path=("$v") ;;
        AVX2)
            args+=(CFLAGS=-mavx2)
            grep -q '\<avx2\>' /proc/cpuinfo || {
                qemu=x86_64
                run=(-cpu max)
            }
            ;;
        *) args+=("${v//|/ }") ;;
        esac
    done
    command -v "$cc" >/dev/null || { fail "$name" "no $cc"; return; }
    if [ "$qemu" = wine ]; then
        exe=.exe
        run=(env WINEPREFIX="$(realpath -m "$build/wine")" WINEDEBUG=-all wine)
        command -v wine >/dev/null || { fail "$name" "no wine"; return; }
    elif [ -n "$qemu" ]; then
        run=("qemu-$qemu-static" "${run[@]}")
        command -v "${run[0]}" >/dev/null ||
            { fail "$name" "no ${run[0]}"; return; }
    fi
    mkdir -p "$dir"
    if ! "$make" -s -j"$jobs" "${args[@]}" "$dir/check_vectors$exe" \
        >"$dir/build.txt" 2>&1; then
        cat "$dir/build.txt"
        fail "$name" "does not build"
        return
    fi
    timeout "$timeout" "${run[@]}" "$dir/check_vectors$exe" "$vectors" \
        "${path[@]}" >"$dir/out.txt" 2>&1 </dev/null
    local rc=$?
    out=$(grep -E '^[0-9]+ passed, [0-9]+ failed$' "$dir/out.txt" | tail -n 1)
    : "${expected:=$out}"
    if [ $rc != 0 ] || [ "$out" != "$expected" ] ||
        [[ ! $out =~ ^[1-9][0-9]*\ passed,\ 0\ failed$ ]]; then
        tail -n 30 "$dir/out.txt"
        fail "$name" "exit status $rc; ${out:-no totals} (first: $expected)"
        return
    fi
    echo "ok   matrix $name: $out ($((SECONDS - start)) s)"
}

if [ ! -e tests/stream/check_vectors.c ]; then
    fail all "no tests/stream/check_vectors.c"
    exit 1
fi
while IFS= read -r line; do
    [ -n "$line" ] || continue
    # The first four bars separate columns.
    IFS='|' read -r head cc qemu opt rest <<<"$line"
    size=${head%% *}
    name=$(echo "${head#* }" | trim)
    [ "$what" = all ] || [ "$size" = small ] || continue
    [ "$only" = "  " ] || [[ $only == *" $name "* ]] || continue
    row "$name" "$(echo "$cc" | trim)" "$(echo "$qemu" | trim)" \
        "$(echo "$opt" | trim)" "$rest"
done <<<"$table"
exit $failed
