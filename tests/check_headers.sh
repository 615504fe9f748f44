#!/bin/sh
# SPDX-License-Identifier: MIT
#
# check_headers.sh [small|all]: guarantees that every header compiles alone, and
# if it is included twice, without warnings, with only the include paths that
# its folder may use. In `all` gcc and clang compile each header. In `small` a
# header that its own .c file includes first has been compiled alone by both
# builds of the tree; it must only have a guard, and gcc compiles the others, but
# for those of tests/, lab/ and bench/.
set -eu
cd "$(dirname "$0")/.."

what=${1:-all}
compilers='gcc clang'
others='tests/*/*.h lab/*.h bench/*.h'
[ "$what" = all ] || { compilers=gcc && others=; }
tmp=$(mktemp -d)
trap 'rm -rf "$tmp"' EXIT
warn="-std=c11 -Wall -Wextra -Wconversion -Wshadow -Wundef -Wcast-align
    -Wstrict-prototypes -Wmissing-prototypes -Wvla -Werror
    -Wno-unused-function -Wno-unused-const-variable"
trainer=$(find trainer -type d | sort | sed 's/^/-I/')
rooms() { # rooms FILE: what the room of a file of the trainer may see
    room=${1#trainer/}
    room=${room%/*}
    for r in $room $(sed -n "s|^SEE_$room *:=||p" Makefile); do
        echo "-Itrainer/$r"
    done
}
# in_its_own_file FILE: the .c file of that name includes the header first, and
# the header's first and last directives are those of a guard.
in_its_own_file() {
    own=${1%.h}.c
    [ -e "$own" ] || return 1
    [ "$(grep -m1 '^#include' "$own")" = "#include \"${1##*/}\"" ] &&
        awk '/^#/ { n++; last = $0; if (n < 3) d[n] = $0 }
             END { split(d[1], a); split(d[2], b)
                   exit !(a[1] == "#ifndef" && b[1] == "#define" &&
                          a[2] == b[2] && last ~ /^#endif/) }' "$1"
}
mkdir "$tmp/include"
[ ! -e decoder/saga.h ] || cp decoder/saga.h "$tmp/include"
mkdir "$tmp/reference"
cp reference/verify.h "$tmp/reference"

for cc in $compilers; do
    bad=0
    n=0
    built=0
    # shellcheck disable=SC2086
    for h in common/*.h common/*/*.h decoder/*.h decoder/*/*.h trainer/*/*.h \
        trainer/*/*/*.h tools/*.h ports/*/*.h reference/*.h $others; do
        [ -e "$h" ] || continue
        case $h in
        *_tables.h | *_real.h) continue ;; # parts of one C file
        common/*) see="-ffreestanding -Icommon" ;;
        decoder/*) see="-ffreestanding -Icommon -Idecoder" ;;
        tools/*) see="-D_XOPEN_SOURCE=700 -I$tmp/include" ;;
        ports/*) see="-ffreestanding -I$tmp/include" ;;
        trainer/cli/*) see="-D_XOPEN_SOURCE=700 -Icommon -I$tmp/include -I$tmp/reference $(rooms "$h")" ;;
        trainer/*) see="-D_XOPEN_SOURCE=700 -Icommon -I$tmp/include $(rooms "$h")" ;;
        reference/*) see="-D_XOPEN_SOURCE=700 -Icommon -Idecoder -Itrainer/basics -Itrainer/code" ;;
        *) see="-D_XOPEN_SOURCE=700 -Icommon -Idecoder $trainer -Ireference -Itests/support -Ilab -Ibench" ;;
        esac
        if [ "$what" != all ] && in_its_own_file "$h"; then
            built=$((built + 1))
            continue
        fi
        n=$((n + 1))
        name=$(basename "$h")
        printf '#include "%s"\n#include "%s"\nextern int x;\n' \
            "$name" "$name" >"$tmp/t.c"
        # shellcheck disable=SC2086
        $cc $warn $see -I"$(dirname "$h")" -fsyntax-only "$tmp/t.c" || {
            echo "     $h"
            bad=1
        }
    done
    if [ "$bad" = 0 ]; then
        echo "ok   headers $cc: $n compile alone, $built first in their files"
    else
        echo "FAIL headers $cc"
        : >"$tmp/failed"
    fi
done
[ ! -e "$tmp/failed" ]
