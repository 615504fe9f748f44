#!/bin/bash
# SPDX-License-Identifier: MIT
#
# check_api.sh: guarantees that programs in C and C++ that use only saga.h and
# libsaga.a compile without warnings by every standard from C11 and C++11 on
# that the compilers support, and draw the picture of vectors/MANIFEST.
set -u
cd "$(dirname "$0")/.."
checks=api
# shellcheck source=tests/cli/verdict.sh
. tests/cli/verdict.sh

lib=${SAGA_LIB:-build/libsaga.a}
[ -f "$lib" ] || complain "no $lib: make lib, or set SAGA_LIB"
mkdir "$tmp/include"
cp decoder/saga.h "$tmp/include"
warn="-Wall -Wextra -pedantic -Wconversion -Wshadow -Wundef -Werror"

# of FILE: prints the CRC of the frame that MANIFEST has for the first segment,
# at t = 0, in camera 0.
of() { awk -v f="$1" '$1 == f && $2 == 0 && $7 == 0 && $8 == 0 { print $11 }' \
    vectors/MANIFEST; }

# try COMPILER SOURCE STANDARD...: compiles SOURCE by each standard and runs the
# last program made.
try() {
    local cc=$1 source=$2 v want
    shift 2
    for std in "$@"; do
        # shellcheck disable=SC2086
        "$cc" -std="$std" $warn -O1 -I"$tmp/include" "$source" "$lib" \
            -o "$tmp/use" 2>"$tmp/log" ||
            complain "$cc -std=$std $source: $(cat "$tmp/log")"
    done
    for v in good/motion.saga good/segments.saga; do
        want=$(of "$v")
        [ -n "$want" ] || complain "vectors/MANIFEST has no $v"
        [ "$("$tmp/use" "vectors/$v" 2>&1)" = "$want" ] ||
            complain "$cc $source: $v is not $want"
    done
    verdict "$cc $(basename "$source")"
}

for cc in gcc clang; do
    try $cc tests/api/use_from_c.c c17 c11
    try ${cc/%gcc/g}++ tests/api/use_from_cpp.cpp c++20 c++11
done

# All declarations of the header must have C linkage in C++.
cp decoder/saga.h "$tmp/all.cpp"
g++ -fsyntax-only -Wall -Wextra -pedantic -Werror "$tmp/all.cpp" \
    2>"$tmp/log" || complain "$(cat "$tmp/log")"
sed -n 's/^[a-z].*[ *]\(saga_[a-z0-9_]*\)(.*/\1/p' decoder/saga.h |
    sort -u >"$tmp/names"
[ -s "$tmp/names" ] || complain "no functions found in saga.h"
{
    echo '#include <saga.h>'
    echo 'extern void *const all[];'
    echo 'void *const all[] = {'
    sed 's/.*/    (void *)&,/' "$tmp/names"
    echo '};'
} >"$tmp/names.cpp"
g++ -c -I"$tmp/include" "$tmp/names.cpp" -o "$tmp/names.o" 2>"$tmp/log" ||
    complain "$(cat "$tmp/log")"
nm -u "$tmp/names.o" | awk '{ print $2 }' | sort -u |
    diff "$tmp/names" - >"$tmp/log" || complain "$(cat "$tmp/log")"
verdict linkage
all_passed
