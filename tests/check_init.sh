#!/bin/bash
# SPDX-License-Identifier: MIT
#
# check_init.sh [small|all]: guarantees that the decoder's results depend only
# on a file's bytes and not on uninitialised memory, with all vector
# instructions of this machine (plain C, 128 bits, AVX2), for all vectors and
# tests/corpus:
#   painted   `check_vectors --init` (tests/stream/check_init.c) fills work
#             block, scratch, stack and results with one of two patterns before
#             every call; the results are the same with both
#   memory    clang's MemorySanitizer finds nothing in the same program without
#             patterns; in `all` also in a build with 64-bit registers only
# Further rows of run_matrix.sh compare builds whose variables initially hold a
# pattern or zeros, and the sanitizer's build, with vectors/MANIFEST. BUILD/gcc
# is where run_tests.sh has built the tree with gcc.
set -u
cd "$(dirname "$0")/.." || exit

what=${1:-small}
out=${BUILD:-build}
make=${MAKE:-make}
jobs=$(nproc 2>/dev/null || echo 2)
timeout=${TIMEOUT:-1200}
unset MAKEFLAGS MFLAGS
files=(vectors/*/*.saga tests/corpus/*.saga)
failed=0

# build DIR PROGRAM VARIABLES...: builds a program. Returns 1, after the
# compiler's messages, if that fails.
build() {
    local dir=$out/$1 program=$2
    shift 2
    mkdir -p "$dir"
    "$make" -s -j"$jobs" BUILD="$dir" "$@" "$dir/$program" \
        >"$dir/build-$program.txt" 2>&1 && return
    cat "$dir/build-$program.txt"
    return 1
}

# verdict NAME COMMAND...: runs a command, whose last line says how many tests
# passed.
verdict() {
    local name=$1 log=$out/init/$1.txt rc last
    shift
    timeout "$timeout" "$@" >"$log" 2>&1 </dev/null
    rc=$?
    last=$(tail -n 1 "$log")
    if [ $rc = 0 ] && [[ $last =~ ^[1-9][0-9]*\ passed,\ 0\ failed$ ]]; then
        echo "ok   init $name: $last"
    else
        tail -n 30 "$log"
        failed=1
        echo "FAIL init $name: exit status $rc"
    fi
}

not_built() {
    failed=1
    echo "FAIL init $1: does not build"
}

# memory NAME VARIABLES...: builds and runs it under MemorySanitizer.
memory() {
    local name=$1

    shift
    build "init/$name" check_vectors CC=clang OPT=-O1 OPENMP= "$@" \
        CFLAGS="-fsanitize=memory -gline-tables-only" ||
        { not_built "$name"; return; }
    verdict "$name" "$out/init/$name/check_vectors" --init "${files[@]}"
}

mkdir -p "$out/init"
if build gcc check_vectors CC=gcc WERROR=-Werror; then
    verdict painted "$out/gcc/check_vectors" --init "${files[@]}"
else
    not_built painted
fi
memory memory
[ "$what" != all ] || memory memory-general CORE_CFLAGS=-mgeneral-regs-only
exit $failed
