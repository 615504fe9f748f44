#!/bin/bash
# SPDX-License-Identifier: MIT
#
# run_tests.sh check|test|all|sanitize: builds everything for a tier of tests,
# runs its programs and checks, even after a failure, and ends with one line
#
#     N passed, N failed
#
# N counts the tests of the cmocka programs and the "ok"/"FAIL" lines of the
# check scripts. A program that cannot be built, crashes, runs out of time or
# reports no test counts as one failure. Exits non-zero if anything failed.
# tests/README.md has the tiers in a table.
#
# Programs see SAGA_TEST_LONG=1 in `all`, SAGA_TEST_SANITIZED=1 when built
# with sanitizers, and SAGA_TEST_SEED, SAGA_TEST_COUNT if the caller set them.
set -u
cd "$(dirname "$0")/.."

what=${1:-test}
build=${BUILD:-build}/test
jobs=${JOBS:-$(nproc 2>/dev/null || echo 2)}
make=${MAKE:-make}
unset MAKEFLAGS MFLAGS MAKELEVEL
# Threads that wait for each other in short loops take four times the CPU time
# of their work. Tests of thread independence set the number of threads
# themselves.
export OMP_NUM_THREADS=${OMP_NUM_THREADS:-1}
export ASAN_OPTIONS=${ASAN_OPTIONS:-detect_stack_use_after_return=1}
export UBSAN_OPTIONS=${UBSAN_OPTIONS:-print_stacktrace=1}
timeout=1200
size=small
if [ "$what" = all ]; then
    export SAGA_TEST_LONG=1
    size=all
    timeout=14400
fi
# The python3 of a version manager is a script that takes longer than most of
# what it starts, so that its directory comes after that of the interpreter.
python=$(python3 -c 'import sys; print(sys.executable)')
[ "$python" = "$(command -v python3)" ] || PATH=$(dirname "$python"):$PATH
# In `make test` each program runs in one configuration: tests of memory and bad
# input run under the sanitizers, all others, which are about numbers, at full
# speed. These are about numbers: the vectors, the trainings of
# test_out_of_memory, and the tiny scene that the sanitized programs check,
# encode and draw, guard the memory of what they call.
numbers=$(echo tests/stream/test_stream.c tests/capture/test_input_survey.c \
    tests/hardcases/test_hard_training.c)
guarded=$(ls tests/{stream,hardcases}/test_*.c tests/*/test_input_*.c \
    tests/reference/test_ref_file.c tests/train/test_out_of_memory.c \
    tests/warm/test_plane_sweep.c |
    grep -vxFf <(printf '%s\n' $numbers))
plain=$(printf '%s\n' tests/*/test_*.c | grep -vxFf <(printf '%s\n' $guarded))
case $what in
check)
    plain=$(printf '%s\n' $plain tests/hardcases/test_*.c |
        grep -v -e '/lab/' -e '/reference/' -e '/test_input_' \
            -e '/test_stream' | sort -u)
    ;;
all | sanitize)
    plain="$plain $guarded"
    guarded=$plain
    ;;
esac
sources=$plain

# Two runs in one folder would overwrite each other's builds.
mkdir -p "$build"
exec 9>"$build/lock"
if command -v flock >/dev/null && ! flock -n 9; then
    echo "waiting for another run in $build"
    flock 9
fi

# A video that was read before is not read again; see ffmpeg_once.sh.
once=$(cd "$build" && pwd)/once
rm -rf "$once"
mkdir -p "$once/kept"
for tool in ffmpeg ffprobe; do
    command -v $tool >/dev/null &&
        ln -s "$PWD/tests/support/ffmpeg_once.sh" "$once/$tool"
done
PATH=$once:$PATH

# seconds FILE: prints the sum of user and system times that `times` wrote to
# FILE.
seconds() {
    awk '{ gsub(/[ms]/, " "); s += $1 * 60 + $2 + $3 * 60 + $4 }
         END { printf "%.1f", s }' "$1"
}
# phase NAME: notes the CPU time that the shell and its children have taken by
# the end of a phase. It must not run in a subshell, whose times begin at zero.
phase() {
    times >"$build/times.txt"
    echo "$1 $(seconds "$build/times.txt")" >>"$build/phases.txt"
}
: >"$build/phases.txt"
: >"$build/programs.txt"

passed=0
failed=0
failures=
pass() { passed=$((passed + 1)); echo "ok   $1"; }
fail() {
    failed=$((failed + 1))
    failures="$failures$1"$'\n'
    echo "FAIL $1"
}

# make_in NAME ARGUMENTS...: runs make with the list of this tier's test
# programs.
make_in() {
    local name=$1
    shift
    "$make" -s -k -j"$jobs" BUILD="$build/$name" WERROR=-Werror \
        TIMEOUT="$timeout" TESTS_SRC="$sources" "$@"
}

# build NAME TARGETS FLAGS...: builds and prints one line, and the messages only
# if it fails.
build() {
    local name=$1 targets=$2
    shift 2
    mkdir -p "$build/$name"
    # shellcheck disable=SC2086
    if make_in "$name" "$@" $targets >"$build/$name/build.txt" 2>&1; then
        pass "build $name"
    else
        cat "$build/$name/build.txt"
        fail "build $name"
    fi
    phase "build-$name"
}

sum_of() { # sum_of WORD LOG: of the lines "[  WORD  ] N test(s)"
    sed -n "s/^\[ *$1 *\] \([0-9][0-9]*\) test(s).*/\1/p" "$2" |
        awk '{ s += $1 } END { print s + 0 }'
}

# programs NAME FLAGS...: runs every test program of a configuration.
programs() {
    local name=$1 log=$build/$1/log src t rc p f s
    shift
    rm -rf "$log"
    # In scripts `saga` sets this by itself.
    OMP_WAIT_POLICY=passive make_in "$name" "$@" run-tests >/dev/null 2>&1
    for src in $sources; do
        t=$(basename "$src" .c)
        if [ ! -e "$log/$t.rc" ]; then
            fail "$name $t: not built"
            continue
        fi
        rc=$(cat "$log/$t.rc")
        # The leak checker's thread may crash while OpenMP's threads are ending.
        # That says nothing about the program, so it runs again.
        for _ in 1 2 3 4 5; do
            grep -q 'LeakSanitizer has encountered a fatal' "$log/$t.log" ||
                break
            timeout "$timeout" "$build/$name/$t" >"$log/$t.log" 2>&1
            rc=$?
        done
        p=$(sum_of PASSED "$log/$t.log")
        f=$(sum_of FAILED "$log/$t.log")
        passed=$((passed + p))
        failed=$((failed + f))
        if [ "$rc" = 0 ] && [ "$f" = 0 ] && [ "$p" != 0 ]; then
            s=$(seconds "$log/$t.cpu")
            echo "$s $name $t" >>"$build/programs.txt"
            echo "ok   $name $t: $p tests, $s s"
            # The test's own messages are shown, without cmocka's lines.
            grep -v -e '^\[' -e '^ *$' "$log/$t.log" | sed 's/^/     /'
            continue
        fi
        cat "$log/$t.log"
        if [ "$f" != 0 ]; then
            failures="$failures$name $t"$'\n'
            echo "FAIL $name $t: $f of $((p + f)) tests"
        else
            [ "$rc" = 124 ] && rc="124, out of time"
            fail "$name $t: $p tests passed, exit status $rc"
        fi
    done
    phase "programs-$name"
}

# check NAME COMMAND...: runs a script that prints "ok ..." and "FAIL ..."
# lines.
check() {
    local name=$1 log=$build/check/$1.txt rc p f
    shift
    mkdir -p "$build/check"
    "$@" </dev/null 2>&1 | tee "$log"
    rc=${PIPESTATUS[0]}
    p=$(grep -c '^ok ' "$log")
    f=$(grep -c '^FAIL ' "$log")
    passed=$((passed + p))
    failed=$((failed + f))
    [ "$f" = 0 ] || failures="$failures$(grep '^FAIL ' "$log" |
        sed "s/^FAIL */$name: /")"$'\n'
    if [ "$f" = 0 ] && { [ "$rc" != 0 ] || [ "$p" = 0 ]; }; then
        fail "$name: $p passed, exit status $rc"
    fi
    phase "$name"
}

# vectors NAME: checks the streams of vectors/ against the MANIFEST.
vectors() {
    local program=$build/$1/check_vectors log=$build/$1/vectors.txt last
    timeout "$timeout" "$program" vectors >"$log" 2>&1 </dev/null
    last=$(tail -n 1 "$log")
    if [[ $last =~ ^[1-9][0-9]*\ passed,\ 0\ failed$ ]]; then
        pass "vectors $1: $last"
    else
        cat "$log"
        fail "vectors $1"
    fi
    phase "vectors-$1"
}

frozen() {
    SAGA_CHECK_VECTORS=$build/gcc/check_vectors \
        check frozen python3 tests/check_frozen.py
}

tree() {
    check tree tests/check_tree.sh
    check format tests/check_format.sh
    check docs tests/check_docs.sh
    check page python3 tests/check_page.py
    check paper python3 tests/check_paper.py
    check places python3 tests/check_coverage.py places
    check faults python3 tests/run_planted.py places
}

sanitized() {
    # The page inside saga is left without its decoder, which is the same as
    # that of build gcc. `make test` leaves some of UBSan's checks of the
    # trainer to `make test-all`.
    local some=1
    [ "$what" != test ] || some=quick
    local flags=(CC=clang OPT=-O1 SANITIZE=$some LDFLAGS=-fuse-ld=lld HAS_WASM=)
    sources=$guarded
    build sanitize "tests $build/sanitize/check_vectors
        $build/sanitize/saga $build/sanitize/saga-dec
        $build/sanitize/saga-play" "${flags[@]}"
    export LSAN_OPTIONS=suppressions=$PWD/tests/support/lsan.supp
    export LSAN_OPTIONS=$LSAN_OPTIONS:print_suppressions=0
    vectors sanitize
    SAGA_TEST_SANITIZED=1 programs sanitize "${flags[@]}"
    # The trainer runs from the capture to the decoded pixels.
    # No driver of a GPU, since lavapipe's leaks.
    VK_DRIVER_FILES=/absent VK_ICD_FILENAMES=/absent \
        SAGA=$build/sanitize/saga SAGA_DEC=$build/sanitize/saga-dec \
        check round-sanitize tests/cli/check_round.sh
    sources=$plain
}

# These must pass after every change of a line.
few() {
    tree
    build gcc "all tests $build/gcc/check_vectors" CC=gcc
    check circles tests/check_circles.sh "$build/gcc"
    vectors gcc
    frozen
    programs gcc CC=gcc
    check round tests/cli/check_round.sh
}

# These must pass before every push.
many() {
    tree
    build gcc "all tests lab-programs bench-programs
        $build/gcc/check_vectors" CC=gcc
    if make_in gcc CC=gcc -q all; then
        pass "build gcc: nothing is left to make"
    else
        fail "build gcc: make -q: something is left to make"
    fi
    check kernels tests/check_kernels.sh
    check tables "$make" -s BUILD="$build/gcc" CC=gcc WERROR=-Werror tables
    check circles tests/check_circles.sh "$build/gcc"
    check headers tests/check_headers.sh "$size"
    check symbols tests/check_symbols.sh "$size"
    check nofloat tests/check_nofloat.sh "$size"
    check stack python3 tests/check_stack.py "$size"
    SAGA_LIB=$build/gcc/libsaga.a check api tests/check_api.sh
    SAGA_LIB=$build/gcc/libsaga.a check abi python3 tests/check_abi.py
    SAGA_CHECK_VECTORS=$build/gcc/check_vectors \
        check conform tests/check_conform.sh
    for name in round cli encode subject volume floors rd codecs input \
        install; do
        check "$name" "tests/cli/check_$name.sh"
    done
    [ "$what" != all ] || check packages tests/cli/check_packages.sh
    [ "$what" != all ] || check ablation tests/cli/check_ablation.sh
    [ "$what" != all ] || check between tests/cli/check_between.sh
    check devices tests/cli/check_devices.sh
    [ "$what" != all ] || check subgroups tests/cli/check_subgroups.sh
    check ksy python3 tests/check_ksy.py
    check metrics python3 tests/cli/check_metrics.py
    check python python3 tests/cli/check_python.py
    check fields python3 tests/cli/check_fields.py
    check report python3 tests/cli/check_report.py
    check view python3 tests/cli/check_view.py
    check desktop python3 tests/cli/check_desktop.py
    check path python3 tests/cli/check_path.py
    check pipe python3 tests/cli/check_pipe.py
    check blocks python3 tests/cli/check_blocks.py
    check sight python3 tests/cli/check_sight.py
    check exchange python3 tests/cli/check_exchange.py
    check boxes python3 tests/cli/check_boxes.py
    if command -v node >/dev/null; then
        WEB=$build/gcc/web \
            check reader timeout 300 node tests/cli/check_reader.mjs
    else
        pass "reader skipped: node is not installed"
    fi
    check web python3 tests/cli/check_web.py
    check whole python3 tests/cli/check_whole.py
    check player python3 tests/cli/check_player.py
    check sleep python3 tests/cli/check_sleep.py
    check phone python3 tests/cli/check_phone.py
    check bounds python3 tests/cli/check_bounds.py
    check sound python3 tests/cli/check_sound.py
    check stream python3 tests/cli/check_stream.py
    check engines python3 tests/cli/check_engines.py
    [ "$what" != all ] || check aframe python3 tests/cli/check_aframe.py
    [ "$what" != all ] || check types python3 tests/cli/check_types.py
    [ "$what" != all ] || check bundles python3 tests/cli/check_bundles.py
    check headset python3 tests/cli/check_headset.py
    check firmware tests/check_firmware.sh "$size"
    vectors gcc
    frozen
    programs gcc CC=gcc
    sanitized
    # The sanitizers are clang's. What was not built with them is only checked
    # for clang's warnings.
    [ "$what" != all ] || build clang objects CC=clang CFLAGS=-fsyntax-only \
        COMPILED="$build/sanitize"
    [ "$what" != all ] || check lint tests/check_lint.sh
    [ "$what" != all ] || check cmake tests/check_cmake.sh
    [ "$what" != all ] || check debian tests/cli/check_debian.sh
    [ "$what" != all ] || check windows tests/cli/check_windows.sh
    [ "$what" != all ] || check double tests/cli/check_double.sh
    [ "$what" != all ] || check schedulers tests/cli/check_schedulers.sh
    [ "$what" != all ] || check charuco python3 tests/cli/check_charuco.py
    check matrix tests/run_matrix.sh "$size"
    check init tests/check_init.sh "$size"
    [ "$what" != all ] || check mutants tests/run_mutants.sh
    [ "$what" != all ] || check coverage python3 tests/check_coverage.py
    [ "$what" != all ] || check crashes python3 tests/cli/run_crashes.py
    [ "$what" != all ] || check checks python3 tests/run_small_mutants.py checks
    [ "$what" != all ] || check planted python3 tests/run_planted.py
}

export BUILD="$build" SAGA="$build/gcc/saga" SAGA_DEC="$build/gcc/saga-dec"
case $what in
check) few ;;
test | all) many ;;
sanitize) sanitized ;;
*) echo "run_tests.sh check|test|all|sanitize" >&2; exit 2 ;;
esac

if [ -n "$failures" ]; then
    echo "failures:"
    printf '%s' "$failures" | sed 's/^/  /'
fi
echo "CPU seconds, user and system:"
awk '{ printf "  %-18s %6.1f\n", $1, $2 - before; before = $2 }
     END { printf "  %-18s %6.1f\n", "all", before }' "$build/phases.txt"
echo "the slowest programs:"
sort -rn "$build/programs.txt" | head -n 10 |
    awk '{ printf "  %-28s %6.1f\n", $2 " " $3, $1 }'
echo "elapsed $SECONDS s"
echo "$passed passed, $failed failed"
[ "$failed" = 0 ]
