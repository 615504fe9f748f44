#!/bin/sh
# SPDX-License-Identifier: MIT
#
# check_headers.sh: guarantees that every header compiles alone, and if it is
# included twice, without warnings by gcc and clang, with only the include paths
# that its folder may use.
set -eu
cd "$(dirname "$0")/.."

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
mkdir "$tmp/include"
[ ! -e decoder/saga.h ] || cp decoder/saga.h "$tmp/include"
mkdir "$tmp/reference"
cp reference/verify.h "$tmp/reference"

for cc in gcc clang; do
    bad=0
    n=0
    for h in common/*.h common/*/*.h decoder/*.h decoder/*/*.h trainer/*/*.h \
        trainer/*/*/*.h tools/*.h ports/*/*.h reference/*.h tests/*/*.h lab/*.h bench/*.h; do
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
        echo "ok   headers $cc: $n compile alone"
    else
        echo "FAIL headers $cc"
        : >"$tmp/failed"
    fi
done
[ ! -e "$tmp/failed" ]
