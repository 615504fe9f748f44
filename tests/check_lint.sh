#!/bin/sh
# SPDX-License-Identifier: MIT
#
# check_lint.sh: guarantees that clang-tidy finds nothing in the sources that
# are not tests, except for the exceptions of .clang-tidy.
set -eu
cd "$(dirname "$0")/.."

build=${BUILD:-build}/lint
mkdir -p "$build"
"${MAKE:-make}" -s CC=clang BUILD="$build" \
    COMMANDS="$build/compile_commands.json" "$build/compile_commands.json"
find common decoder trainer tools lab bench -name '*.c' | sort >"$build/files"
if xargs -n 8 -P "$(nproc)" clang-tidy --quiet -p "$build" \
    <"$build/files" >"$build/log" 2>/dev/null; then
    echo "ok   lint: $(wc -l <"$build/files") files"
else
    cat "$build/log"
    echo "FAIL lint"
    exit 1
fi
