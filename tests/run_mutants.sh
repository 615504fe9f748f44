#!/bin/bash
# SPDX-License-Identifier: MIT
#
# run_mutants.sh [NAME...]: guarantees that checks of the tree ("gates") notice
# the mistakes that they are made for. Each mutant is a deliberate mistake in a
# copy of the tree (mutants/NAME in the build folder). It must change its file.
# Each gate under "caught by" must fail on it. The gates under "passes" must
# not: they show that the failing gates are needed, and that the mutant has only
# the mistake that it is meant to have.
#
# A gate is a row of tests/run_matrix.sh, by its name, which must build, run and
# report mismatches; or CHECK/TARGET:REGEX, which stands for tests/check_CHECK.*
# with that target (all if there is none) and an expression that its output must
# match besides FAIL. tests/README.md has them in a table.
#
# Objects that the gates have built from the tree itself are copied, so that
# only the files that a mutant changes are compiled again.
set -u
cd "$(dirname "$0")/.."

only=" $* "
build=${BUILD:-build}
case $build in
/*) inner=build ;; # the copies build in themselves
*) inner=$build ;;
esac
failed=0

# mutant NAME FILE PERL CAUGHT_BY PASSES: PERL edits the whole file, which is in
# $_.
mutants() {
    # Integers of the format are little-endian. A little-endian machine cannot
    # notice the mistake.
    mutant native-endian common/fx.h \
        's/(fx_load32_le\(const uint8_t \*p\)\s*\{\s*)return [^;]*;/$1uint32_t x;\n    __builtin_memcpy(&x, p, 4);\n    return x;/' \
        's390x-gcc-O2' 'gcc-O0'

    # Bytes of 128 and more are read through a signed char.
    mutant signed-char common/fx.h \
        's/return \(uint32_t\)p\[0\] \| \(uint32_t\)p\[1\] << 8;/return (uint32_t)((const char *)p)[0] |\n           (uint32_t)((const char *)p)[1] << 8;/' \
        'gcc-O0' ''

    # 8-bit weights are read through a char, which is unsigned on Arm, s390x and
    # others.
    mutant unsigned-char common/arch/mlp_pairs.h \
        's/const int8_t \*/const char */g' \
        's390x-gcc-O2' 'gcc-O0'

    # A tile stops when its first pixel is opaque.
    mutant tile-stop-early decoder/raster.c \
        's/any = 0;(.*?)any \|= t\[i\];/any = ~0u;$1any &= t[i];/s' \
        'gcc-O0' ''

    # Pixels stop only when all pixels of their tile are opaque.
    mutant tile-stop-late decoder/blend.c \
        's/if \(\*t < SAGA_T_FLOOR_Q16\)\n\s*continue;\n//' \
        's390x-gcc-O2' ''

    # The rounding of the format lacks its half.
    mutant rounding common/fx.h \
        's/return \(x \+ \(int32_t\)\(1u << \(n - 1\)\)\) >> n;/return x >> n;/' \
        'gcc-O0' ''

    # A variable is read before it is written; most builds happen to have the
    # right value in it.
    mutant unset common/syntax_nets.c \
        's/    to\.out\.n = 0;\n//' \
        'gcc-O1-pattern' 'gcc-O0'

    # These mutants are caught by the checks of the objects and of the tree.
    mutant variable common/mlp.c \
        '$_ .= "static int planted;\nint saga_planted(void);\nint saga_planted(void)\n{\n    return planted++;\n}\n"' \
        'symbols/x86_64-gcc:variable.planted' ''
    mutant division common/mlp.c \
        '$_ .= "uint64_t saga_planted(uint64_t a, uint64_t b);\nuint64_t saga_planted(uint64_t a, uint64_t b)\n{\n    return a / b;\n}\n"' \
        'symbols/cortex-m0:undefined.__aeabi_uldivmod' ''
    mutant float common/mlp.c \
        '$_ .= "int saga_planted(int a);\nint saga_planted(int a)\n{\n    return (int)((__typeof__(1 / 2.f))a * 3 / 2);\n}\n"' \
        'nofloat/cortex-m0:undefined.*__aeabi_fmul|U.__aeabi_fmul' ''
    mutant recursion common/mlp.c \
        '$_ .= "void saga_planted(volatile int *n);\nvoid saga_planted(volatile int *n)\n{\n    if (*n)\n        saga_planted(n + 1);\n    *n = 0;\n}\n"' \
        'stack/x86_64:recursion:.saga_planted' ''
    mutant unlisted common/mlp.c \
        '$_ .= "int (*saga_planted(void))(int);\nstatic int planted(int x)\n{\n    return x;\n}\nint (*saga_planted(void))(int)\n{\n    return planted;\n}\n"' \
        'stack/x86_64:planted.*its.address.is.taken' ''
    mutant include common/mlp.c \
        '$_ = qq(#include "range_dec.h"\n$_)' \
        'tree:common.must.not.see.decoder/range_dec.h' ''
}

fail() {
    failed=1
    echo "FAIL mutant $1: $2"
}

# reuse TREE FOLDER: copies what was built there already, with its dates.
reuse() {
    [ -d "$build/$2" ] && [ "$inner" = "$build" ] || return 0
    mkdir -p "$1/$inner/${2%/*}"
    cp -Rp "$build/$2" "$1/$inner/$2"
}

# gate TREE GATE: prints caught, with the number of mismatches; passes; or
# broken (it does not build, crashes or checks nothing).
gate() {
    local out name=${2%%:*} check target
    if [[ $2 == *:* ]]; then
        check=${name%/*}
        target=${name#"$check"}
        target=${target#/}
        reuse "$1" "symbols/$target"
        reuse "$1" "stack/$target"
        [ "$check" = symbols ] && target="small $target"
        # shellcheck disable=SC2086
        out=$(cd "$1" && BUILD=$inner GIT_DIR=/nonexistent \
            tests/check_"$check".* $target 2>&1)
        echo "$out" >"$1/gate.txt"
        if ! grep -q "^FAIL $check" <<<"$out"; then
            echo passes
        elif grep -Eq "${2#*:}" <<<"$out"; then
            echo caught
        else
            echo "fails for another reason"
        fi
        return
    fi
    reuse "$1" "matrix/$2"
    out=$(cd "$1" && BUILD=$inner tests/run_matrix.sh all "$2" 2>&1)
    echo "$out" >"$1/gate.txt"
    if [[ $out == *"ok   matrix $2:"* ]]; then
        echo passes
    elif [[ $out =~ FAIL\ matrix\ [^\ ]*\ exit\ status.*[1-9][0-9]*\ failed\ \(first ]]; then
        echo caught
    else
        echo broken
    fi
}

mutant() {
    local name=$1 file=$2 perl=$3 caught=$4 passes=$5 tree row got
    [ "$only" = "  " ] || [[ $only == *" $name "* ]] || return 0
    tree=$build/mutants/$name
    rm -rf "$tree"
    mkdir -p "$tree"
    cp -Rp Makefile common decoder reference trainer tests vectors "$tree" || {
        fail "$name" "cannot copy the tree"
        return
    }
    if [ ! -e "$file" ]; then
        fail "$name" "no $file"
        return
    fi
    perl -0pi -e "$perl" "$tree/$file"
    if cmp -s "$file" "$tree/$file"; then
        fail "$name" "its edit matches nothing in $file"
        return
    fi
    for row in $caught; do
        grep -q "^| $name | .*\`${row%%:*}\`" tests/README.md || {
            fail "$name" "tests/README.md does not say that ${row%%:*} catches it"
            return
        }
        got=$(gate "$tree" "$row")
        if [ "$got" != caught ]; then
            sed 's/^/     /' "$tree/gate.txt"
            fail "$name" "$row should catch it: $got"
            return
        fi
    done
    for row in $passes; do
        got=$(gate "$tree" "$row")
        if [ "$got" != passes ]; then
            sed 's/^/     /' "$tree/gate.txt"
            fail "$name" "$row should pass: $got"
            return
        fi
    done
    echo "ok   mutant $name: caught by ${caught%%:*}${passes:+, not by $passes}"
    rm -rf "$tree"
}

mutants
exit $failed
