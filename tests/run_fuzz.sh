#!/bin/bash
# SPDX-License-Identifier: MIT
#
# run_fuzz.sh MINUTES [NAME...]: runs fuzzers under ASan and UBSan, each for so
# many minutes: decode and segment (stream/fuzz_*.c), input
# (capture/fuzz_input.c), path and http (cli/fuzz_*.c). They begin with the
# inputs of tests/corpus; new ones come to fuzz/NAME of the build folder, and
# one that shows a fault to fuzz/NAME.fault.
# Prints a line for each with its executions and the edges that they cover.
set -u
cd "$(dirname "$0")/.." || exit

minutes=${1:-5}
[ "$minutes" -gt 0 ] || { echo "run_fuzz.sh MINUTES [NAME...]" >&2; exit 2; }
shift
names=${*:-decode segment input path http}
build=${BUILD:-build}/fuzz
failed=0
export LSAN_OPTIONS=suppressions=$PWD/tests/support/lsan.supp
export LSAN_OPTIONS=$LSAN_OPTIONS:print_suppressions=0

mkdir -p "$build"

corpus() { # corpus NAME: the folders that a fuzzer begins with
    case $1 in
    decode) echo tests/corpus vectors/good ;;
    *) echo "tests/corpus/$1" ;;
    esac
}

for name in $names; do
    # libFuzzer is clang's. No threads: forks and timeouts would not see them.
    # Traces of comparisons, from which libFuzzer guesses values that a program
    # looks for, would take two thirds of the decoder's time, and the decoder
    # looks for few.
    if ! "${MAKE:-make}" -s -j"$(nproc)" BUILD="$build" CC=clang OPT=-O1 \
        OPENMP= SANITIZE=1 CFLAGS=-fsanitize=fuzzer-no-link \
        CORE_CFLAGS=-fno-sanitize-coverage=trace-cmp \
        "$build/fuzz_$name" >"$build.txt" 2>&1; then
        cat "$build.txt"
        echo "FAIL fuzz $name: does not build"
        failed=1
        continue
    fi
    mkdir -p "$build/$name"
    log=$build/$name.txt
    asan=allocator_may_return_null=1
    options=
    # A run of fuzz_segment takes a tenth of a millisecond, less than libFuzzer's
    # look at all of its inputs and at leaks. The decoder frees nothing, so that
    # ASan need not keep much of what was freed.
    if [ "$name" = segment ]; then
        asan=$asan:quarantine_size_mb=1
        options='-entropic=0 -detect_leaks=0'
    fi
    # shellcheck disable=SC2046,SC2086
    ASAN_OPTIONS=$asan "$build/fuzz_$name" -max_len=12000 -timeout=60 \
        -rss_limit_mb=4000 $options \
        -max_total_time=$((60 * minutes)) -print_final_stats=1 \
        -artifact_prefix="$build/$name.fault." "$build/$name" \
        $(corpus "$name") >"$log" 2>&1 </dev/null
    rc=$?
    runs=$(sed -n 's/^stat::number_of_executed_units: //p' "$log")
    edges=$(grep -o 'cov: [0-9]*' "$log" | tail -n 1)
    more=$(grep "^fuzz_$name:" "$log")
    if [ $rc = 0 ]; then
        echo "ok   fuzz $name: $runs executions, ${edges#cov: } edges" \
            "${more:+(${more#*: })}"
    else
        tail -n 30 "$log"
        echo "FAIL fuzz $name: exit status $rc, $build/$name.fault.*"
        failed=1
    fi
done
exit $failed
